# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/compare_results.py: a changed number is named, renames are followed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scripts import compare_results
from scripts.comparison import names, reading, record, running
from scripts.comparison.differences import Comparison, compare, compare_arrays
from scripts.comparison.names import Removed, Renames
from scripts.comparison.reading import Place, flatten_json, read_folder

NONE = Renames()


def compared(old: Any, new: Any, renames: Renames = NONE) -> Comparison:
    """Two JSON files run.json, side by side."""

    def results(data: Any) -> dict[Place, reading.Values]:
        return {Place("run/run.json", key): values for key, values in flatten_json(data)}

    return compare(results(old), results(new), renames)


def keys(places: list[Place]) -> list[str]:
    return [place.key for place in places]


def test_json_is_flat_and_complete() -> None:
    data = {
        "a": {"b": 1, "on": True, "none": None, "word": "x"},
        "matrix": [[1.0, 2.0], [3.0, 4.0]],
        "ragged": [[1.0], [2.0, 3.0]],
        "items": [{"n": 1}, {"n": 2}],
        "empty": [],
    }
    flat = dict(flatten_json(data))
    assert flat["a.b"] == 1
    assert flat["a.on"].dtype == bool
    assert np.isnan(flat["a.none"])
    assert flat["a.word"] == "x"
    assert flat["matrix"].tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert flat["ragged[1]"].tolist() == [2.0, 3.0]
    assert [int(flat[key]) for key in ("items.length", "items[1].n", "empty.length")] == [2, 2, 0]


def test_a_changed_number_is_named() -> None:
    old = {"radar": {"gain": 2.0, "noise": [1.0, 2.0, 4.0]}, "n": 3}
    new = {"radar": {"gain": 2.0, "noise": [1.0, 2.5, 4.5]}, "n": 3}
    result = compared(old, new)
    assert not result.same
    assert result.numbers == 5
    (found,) = result.differences
    assert str(found.place) == "run/run.json: radar.noise"
    assert (found.differing, found.total, found.index) == (2, 3, (1,))
    assert (found.largest, found.largest_relative) == (0.5, 0.25)
    assert (found.old, found.new) == (2.0, 2.5)
    text = "\n".join(compare_results.case_lines("case", result))
    assert "radar.noise: 2 of 3 differ, by at most 0.5 (relative 0.25); first at [1]" in text
    assert "2.0 -> 2.5" in text


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        (np.nan, np.nan, True),
        (np.nan, 0.0, False),
        (1.0, np.nextafter(1.0, 2.0), False),
        (0.0, -0.0, False),
        (np.float32(0.1), np.float64(np.float32(0.1)), True),
        (np.float32(0.1), np.float64(0.1), False),
        (3, 3.0, True),
        (1 + 2j, 1 + 2j, True),
        (1 + 2j, 1 - 2j, False),
    ],
)
def test_comparison_is_to_the_last_bit(old: Any, new: Any, same: bool) -> None:
    arrays = np.array([7, old, 7]), np.array([7, new, 7])
    assert (compare_arrays(Place("f", "k"), *arrays) is None) == same


def test_a_leading_axis_of_one_channel_is_left_out() -> None:
    samples = np.arange(6.0).reshape(2, 3)
    place = Place("products/frame_0001.h5", "echoes/samples")
    assert compare_arrays(place, samples, samples[None]) is None
    changed = samples[None] + np.eye(2, 3)
    found = compare_arrays(place, samples, changed)
    assert found is not None
    assert (found.differing, found.index) == (2, (0, 0))
    two = compare_arrays(place, samples, np.stack([samples, samples]))
    assert two is not None
    assert two.reason == "shape (2, 3) became (2, 2, 3)"


def test_renames_are_followed() -> None:
    old = {"burst": {"prf_hz": 1000.0, "pulses": 8}, "passes": 1}
    new = {"waveform": {"prf_hz": 1000.0, "pulses": 9}}
    assert keys(compared(old, new).missing) == ["burst.prf_hz", "burst.pulses", "passes"]
    renames = Renames(
        keys=((r"run/run\.json", r"burst\.(.*)", r"waveform.\1"),),
        removed=(Removed(r"run/.*", "passes", "is 1 for paths"),),
    )
    result = compared(old, new, renames)
    assert [found.place.key for found in result.differences] == ["burst.pulses"]
    assert (result.missing, keys(result.removed), result.added) == ([], ["passes"], [])


def test_files_are_renamed_and_keys_of_other_files_are_not() -> None:
    renames = Renames(
        files=((r"(.*)_map\.npz", r"\1_range_doppler.npz"),),
        keys=((r".*_map\.npz", "power", "power_w"),),
    )
    old = {Place("a_map.npz", "power"): np.ones(2), Place("a.npz", "power"): np.ones(2)}
    new = {
        Place("a_range_doppler.npz", "power_w"): np.ones(2),
        Place("a.npz", "power"): np.ones(2),
    }
    assert compare(old, new, renames).same


def test_what_is_missing_fails_and_what_is_new_does_not() -> None:
    more = compared({"a": 1}, {"a": 1, "b": 2})
    assert more.same
    assert keys(more.added) == ["b"]
    less = compared({"a": 1, "b": 2}, {"a": 1})
    assert not less.same
    assert keys(less.missing) == ["b"]
    assert "only in old: run/run.json: b" in "\n".join(compare_results.case_lines("c", less))


@pytest.mark.parametrize(("old", "new"), [(1, 2), (0, 1), (1, 0)])
def test_a_list_of_another_length_fails(old: int, new: int) -> None:
    item = {"range_m": 3.0}
    assert not compared({"movers": [item] * old}, {"movers": [item] * new}).same
    assert not compared({"row": [1.0] * old}, {"row": [1.0] * new}).same


def test_texts_are_told_and_do_not_fail() -> None:
    result = compared({"kind": "LFM", "old": "x"}, {"kind": "lfm"})
    assert result.same
    assert len(result.texts) == 2


def test_exclusions_say_why_and_fit_names() -> None:
    assert all(rule.reason for rule in names.EXCLUDED)
    kept = {"a.h5: map/values", "run/run.json: frame_times_s", "x/paths.json: time_s"}
    gone = {
        "run/run.json: versions.blender",
        "run/run.json: system.schema_version",
        "run/frames/frame_0001/paths.json: table_sha256",
        "products/frame_0001_summary.json: synthesis.steps[0].cpu_s",
        "demo/summary.json: time_s.total",
    }
    places = [Place(*text.split(": ")) for text in kept | gone]
    found = names.compared({place: np.zeros(1) for place in places})
    assert {str(place) for place in found} == kept


def test_every_kind_of_file_is_read(tmp_path: Path) -> None:
    table = np.zeros(3, [("power_w", "<f8"), ("first_m", "<f8", (3,))])
    np.savez(tmp_path / "path_columns.npz", **{name: table[name] for name in table.dtype.names})
    (tmp_path / "paths.npz").write_bytes(b"in a form of its own")
    np.savez(tmp_path / "map.npz", power=np.ones((2, 2)))
    (tmp_path / "d.csv").write_text("range_m,name\n1.5,a\n2.5,b\n")
    (tmp_path / "none.csv").write_text("range_m\n")
    (tmp_path / "s.sigmf-meta").write_text(json.dumps({"global": {"core:datatype": "cf32_le"}}))
    np.arange(2, dtype="<c8").tofile(tmp_path / "s.sigmf-data")
    (tmp_path / "p.png").write_bytes(b"")
    found = {str(place): values for place, values in read_folder(tmp_path).items()}
    assert found["path_columns.npz: first_m"].shape == (3, 3)
    assert found["map.npz: power"].shape == (2, 2)
    assert found["d.csv: range_m"].tolist() == [1.5, 2.5]
    assert found["none.csv: range_m"].size == 0
    assert found["s.sigmf-data: samples"].tolist() == [0, 1]
    assert not any(name.startswith("p.png") for name in found)


def test_exr_and_hdf5_are_read(tmp_path: Path) -> None:
    import h5py
    import OpenEXR as exr

    with h5py.File(tmp_path / "f.h5", "w") as file:
        file.attrs["prf_hz"] = 5.0
        file.attrs["options"] = json.dumps({"mti": 2})
        data = file.create_dataset("map/values", data=np.arange(2) + 1j)
        data.attrs["units"] = "W"
    header = {"compression": exr.ZIP_COMPRESSION, "type": exr.scanlineimage}
    pixels = np.arange(6, dtype=np.float32).reshape(2, 3)
    exr.File(header, {"R": pixels, "ring.001": pixels + 1}).write(str(tmp_path / "e.exr"))
    found = {str(place): values for place, values in read_folder(tmp_path).items()}
    assert found["f.h5: @prf_hz"] == 5.0
    assert found["f.h5: @options.mti"] == 2
    assert found["f.h5: map/values"].tolist() == [1j, 1 + 1j]
    assert found["f.h5: map/values@units"] == "W"
    assert np.array_equal(found["e.exr: ring.001"], pixels + 1)


def test_an_unknown_kind_of_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "new.parquet").write_bytes(b"x")
    with pytest.raises(ValueError, match="parquet"):
        read_folder(tmp_path)


def test_options_are_chosen_by_the_help() -> None:
    renames = Renames(options={"--radar": "--waveform", "--weighting=paper": "--weighting=b-r2"})
    given = ("--radar={data}/a.json", "--weighting=paper", "--hdf5")

    def words(help_text: str) -> list[str]:
        known = running.listed_options(help_text)
        return running.option_words(given, known, renames, Path("data"))

    assert words("[--radar FILE] [--weighting {radar-equation,paper}]\n [--hdf5]") == [
        "--radar=data/a.json",
        "--weighting=paper",
        "--hdf5",
    ]
    assert words("[--waveform FILE] [--weighting {watts,b-r2}] [--hdf5] [--no-radar]") == [
        "--waveform=data/a.json",
        "--weighting=b-r2",
        "--hdf5",
    ]
    with pytest.raises(running.CannotRunError, match="--hdf5"):
        words("[--radar FILE] [--weighting {paper}] [--hdf5-file]")


def test_the_renames_of_the_project_are_read(tmp_path: Path) -> None:
    assert names.read_renames().removed[0].reason == "extra.resumable"
    for text in ('{"keys": [["(", "a", "b"]]}', '{"other": []}'):
        path = tmp_path / "renames.json"
        path.write_text(text)
        with pytest.raises(ValueError, match="renames"):
            names.read_renames(path)


def test_a_record_comes_back_as_it_was(tmp_path: Path) -> None:
    place = Place("products/frame_0001.h5", "map/values@x[0]")
    results = {"case": {place: np.array([np.nan, 1.0]), Place("t", "k"): np.array("text")}}
    record.write_record(tmp_path / "r.npz", record.Record({"blender": "5.2"}, results))
    back = record.read_record(tmp_path / "r.npz")
    assert back.versions == {"blender": "5.2"}
    assert compare(results["case"], back.results["case"], NONE).same
    assert back.results["case"][Place("t", "k")] == "text"


def test_texts_of_hdf5_files_can_be_recorded(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "targets.h5", "w") as file:
        file.create_dataset("name", data=["Van", "Still"], dtype=h5py.string_dtype())
    found = dict(reading._read_hdf5(tmp_path / "targets.h5"))
    results = {"case": {Place("targets.h5", "name"): found["name"]}}
    record.write_record(tmp_path / "r.npz", record.Record({}, results))
    back = record.read_record(tmp_path / "r.npz").results["case"]
    assert back[Place("targets.h5", "name")].tolist() == ["Van", "Still"]


def test_bad_arguments_end_with_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = str(tmp_path)
    assert compare_results.main([folder, folder]) == 2
    assert "is no checkout" in capsys.readouterr().err
    assert compare_results.main([folder, folder, "--only", "nothing"]) == 2
    with pytest.raises(SystemExit) as ended:
        compare_results.main([folder])
    assert ended.value.code == 2


@pytest.mark.blender
@pytest.mark.slow
def test_a_checkout_equals_itself(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """End to end, with one small case."""
    pytest.importorskip("bpy")
    words = [str(root), str(root), "--only", "paths_orthographic"]
    assert compare_results.main(words) == 0, capsys.readouterr().err
    assert "numbers are the same" in capsys.readouterr().out
