# SPDX-License-Identifier: GPL-3.0-or-later
"""Processing again into the same folder, and messages that name what was given."""

import dataclasses
import importlib.util
import json
import sys
from pathlib import Path

import pytest

from radarsim_addon.blender.plan import given_settings, parse_render_arguments
from radarsim_addon.contract import AntennaRecord, RenderRecord, RunRecord
from radarsim_addon.errors import ConfigError, FrameFileError, MissingDependencyError
from radarsim_addon.signal import Burst, Cfar, ProcessOptions, Radar, Waveform, process_run
from radarsim_addon.signal.pipeline import main
from radarsim_addon.signal.radar.link_budget import make_antenna
from radarsim_addon.signal.runs import open_run
from radarsim_addon.typed_json import read_record
from tests.signal.synthetic import Setup, points, write_run

SETUP = Setup(rings=4, radar=Radar(Waveform(5.3e9, 50e6, 2.5e-6, 60e6), Burst(1000.0, 64)))
ECHOES = [(5, 6, 600.0, 5.0, 1e-6)]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_run(tmp_path / "run", SETUP, points(SETUP, ECHOES))


@pytest.mark.parametrize(
    ("option", "kind"), [("cfar", "Cfar"), ("spectrogram", "SpectrogramOptions")]
)
def test_options_of_a_wrong_kind_are_named(folder: Path, option: str, kind: str) -> None:
    options = ProcessOptions(**{option: "os"})
    with pytest.raises(ConfigError, match=rf"{option} of .* is 'os'; expected {kind}\("):
        next(process_run(folder, options))


def test_a_movie_without_blender_is_refused_before_any_work(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The error names what to install, and the format that needs nothing."""
    find = importlib.util.find_spec
    monkeypatch.setitem(sys.modules, "bpy", None)
    monkeypatch.setattr(importlib.util, "find_spec", lambda x: None if x == "bpy" else find(x))
    words = ["process", str(folder), "--no-plots", "--animation-format", "mp4"]
    assert main(words) == MissingDependencyError.exit_code
    said = capsys.readouterr().err
    assert "pip install '.[blender]'" in said and "GIF" in said
    assert not (folder / "products").exists()
    assert main([*words, "--no-animate"]) == 0


def test_nothing_stale_stays_beside_a_new_map(folder: Path) -> None:
    quick = ProcessOptions(products=False, plots=False)
    list(process_run(folder, dataclasses.replace(quick, cfar=Cfar(), sigmf=True)))
    place = folder / "products"
    own = [place / "frame_0001_notes.txt", place / "frame_0002_map.npz", place / "other.png"]
    for path in own:
        path.write_text("mine")
    (place / "range_doppler.gif").write_text("old")
    (place / "frame_0001_echo.png").write_text("old")
    assert (place / "frame_0001_detections.csv").is_file()
    list(process_run(folder, quick))
    kept = {"frame_0001_map.npz", "frame_0001_profile.npz", "frame_0001_summary.json"}
    assert {path.name for path in place.iterdir()} == kept | {path.name for path in own}


def test_levels_are_in_dbw_where_powers_are_watts(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = folder / "products"
    for amplitude_model, unit in (("radar-equation", "dBW"), ("paper", "dB")):
        words = [
            "process",
            str(folder),
            "--amplitude-model",
            amplitude_model,
            "--cfar",
            "ca",
            "--no-plots",
        ]
        assert main(words) == 0
        line = next(x for x in capsys.readouterr().out.splitlines() if "moving target" in x)
        assert f" {unit} " in line.split("range rate")[0]
        for name in ("summary", "detections"):
            record = json.loads((place / f"frame_0001_{name}.json").read_text("utf-8"))
            assert record["level_unit"] == unit


def test_the_plan_counts_tables_and_images(folder: Path) -> None:
    run = open_run(folder)
    assert run.frame(1).planned == run.renders == 8
    record = dataclasses.replace(
        run.record, sampling_mode="paths", rings=1, snapshots=2, visibility_updates=3
    )
    run = dataclasses.replace(run, record=record)
    assert run.frame(1).planned == run.renders == 3


def test_a_tolerance_is_named_as_it_was_given(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["process", str(folder), "--tolerance", "0"])
    said = capsys.readouterr().err
    assert "argument --tolerance: 0 is out of bounds; expected a number from 1e-13 to 0.01" in said


def test_a_beamwidth_is_named_in_degrees() -> None:
    beam = {"azimuth_beamwidth_deg": 6.0, "elevation_beamwidth_deg": 1e9}
    with pytest.raises(
        ConfigError,
        match=r"elevation_beamwidth_deg: Elevation beamwidth is 1000000000\.0 deg.*at most 180 deg",
    ):
        make_antenna(AntennaRecord("gaussian", beam), 0.05)


def test_what_goes_with_a_damaged_record(tmp_path: Path) -> None:
    file = tmp_path / "run.json"
    file.write_text("{")
    with pytest.raises(FrameFileError) as caught:
        read_record(file, RunRecord)
    assert "EXR" not in str(caught.value)
    with pytest.raises(FrameFileError, match="and its EXR"):
        read_record(file, RenderRecord)


def sampling_mode(*words: str) -> object:
    return given_settings(parse_render_arguments(["a.blend", *words])).get("sampling_mode")


def test_options_of_rings_and_paths_together_are_refused() -> None:
    assert sampling_mode() is None
    assert sampling_mode("--rings", "3") == "rings"
    assert sampling_mode("--max-standard-error", "0") == "paths"
    both = ("--rings", "3", "--max-standard-error", "1")
    assert sampling_mode("--sampling-mode", "paths", *both) == "paths"
    with pytest.raises(ConfigError, match="--max-standard-error belongs to paths and --rings"):
        sampling_mode(*both)
    with pytest.raises(ConfigError, match="--visibility-updates belongs to paths and --rings"):
        sampling_mode("--rings", "2", "--visibility-updates", "2")
