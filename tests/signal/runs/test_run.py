# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs: opened, checked against their plan, and every bad one named."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon import contract, typed_json
from radarsim_addon.errors import ConfigError, FrameFileError, RadarSimError, SchemaError
from radarsim_addon.signal import open_run
from radarsim_addon.signal.radar import Burst, array_preset, channels_to_dict
from radarsim_addon.signal.runs import exr, plan_changes
from tests.signal.synthetic import (
    PAPER_RADAR,
    Setup,
    empty,
    encode,
    points,
    run_record,
    write_render,
    write_run,
)

SETUP = Setup(frames=(1, 2, 3, 7), rings=2)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_run(tmp_path / "Lauf 1 é", SETUP, points(SETUP, [(5, 6, 123.0, 0.0, 1.0)]))


def edit(path: Path, **changes: Any) -> None:
    data = json.loads(path.read_text(encoding="utf-8"))
    data.update(changes)
    path.write_text(json.dumps(data), encoding="utf-8")


def test_run_gives_plan_radar_and_frames(folder: Path) -> None:
    run = open_run(folder)
    assert run.radar == PAPER_RADAR
    assert run.range_limits_m == (0.0, 500.0)
    assert run.renders == 16
    assert [frame.number for frame in run.frames()] == [1, 2, 3, 7]
    assert run.frame(7).time_s == pytest.approx(7 / 24)
    assert run.missing() == []
    assert run.frame(1).scene() is None
    record, channels = run.frame(2).image(0, 1)
    assert (record.frame, record.ring, record.snapshot_index) == (2, 0, 1)
    assert channels["B"][5, 6] == SETUP.metres_per_unit**2


def test_scene_record_is_found(folder: Path) -> None:
    scene = contract.GroundTruthRecord(1, 0.0, [contract.ObjectRecord("Wall", 100.0, 120.0, None)])
    typed_json.write_record(folder / contract.frame_dir(1) / contract.GROUND_TRUTH_FILE, scene)
    assert open_run(folder).frame(1).scene() == scene


def test_missing_renders_are_listed(folder: Path) -> None:
    (folder / "frames/frame_0002/ring_001_t1.exr").unlink()
    (folder / "frames/frame_0003/ring_000_t0.json").unlink()
    gaps = open_run(folder).missing()
    assert [(g.frame, g.ring, g.snapshot_index) for g in gaps] == [(2, 1, 1), (3, 0, 0)]
    assert "ring_001_t1.exr" in gaps[0].reason
    assert "sidecar" in gaps[1].reason


def test_unknown_frame_names_those_there(folder: Path) -> None:
    with pytest.raises(FrameFileError, match="no frame 4; it has frames 1-3, 7"):
        open_run(folder).frame(4)


def test_not_a_run(tmp_path: Path) -> None:
    with pytest.raises(FrameFileError, match="none does not exist"):
        open_run(tmp_path / "none")
    with pytest.raises(FrameFileError, match=r"run\.json is missing"):
        open_run(tmp_path)


def test_a_scene_in_place_of_a_run(tmp_path: Path) -> None:
    blend = tmp_path / "scene.blend"
    blend.touch()
    with pytest.raises(FrameFileError, match=r"is not a folder.* radarsim render .*scene\.blend"):
        open_run(blend)
    blend.unlink()
    with pytest.raises(FrameFileError, match=r"does not exist\. .*run\.json\.$"):
        open_run(blend)
    with pytest.raises(FrameFileError, match=r"cannot be read: File name too long|does not exist"):
        open_run(tmp_path / ("a" * 300))


def test_missing_sidecar(folder: Path) -> None:
    (folder / "frames/frame_0001/ring_000_t0.json").unlink()
    with pytest.raises(FrameFileError, match="missing"):
        open_run(folder).frame(1).image(0)


@pytest.mark.parametrize("name", ["run.json", "frames/frame_0001/ring_000_t0.json"])
def test_newer_schema(folder: Path, name: str) -> None:
    edit(folder / name, schema_version=contract.SCHEMA_VERSION + 1)
    with pytest.raises(SchemaError, match="Update radarsim"):
        open_run(folder).frame(1).image(0)


def test_changed_exr_does_not_match_its_checksum(folder: Path) -> None:
    exr.write_exr(
        folder / "frames/frame_0001/ring_000_t0.exr", encode(SETUP, *(a + 1 for a in empty(SETUP)))
    )
    with pytest.raises(SchemaError, match="SHA-256"):
        open_run(folder).frame(1).image(0)


def test_exr_of_another_size(folder: Path) -> None:
    zeros = np.zeros((4, 5), np.float32)
    write_render(folder, SETUP, 1, 0, 0, {"R": zeros, "G": zeros, "B": zeros})
    with pytest.raises(SchemaError, match=r"is 5 x 4 pixels, its sidecar .* has 16 x 12"):
        open_run(folder).frame(1).image(0)


@pytest.mark.parametrize(
    "changes",
    [{"frame": 2}, {"ring": 1}, {"snapshot_index": 1}, {"range_encoding_length_m": 5.0},
     {"width_px": 3}, {"exr_file": "other.exr"}, {"metres_per_unit": 1.0}],
    ids=lambda changes: next(iter(changes)),
)  # fmt: skip
def test_sidecar_of_another_render(folder: Path, changes: dict[str, Any]) -> None:
    write_render(folder, SETUP, 1, 0, 0, encode(SETUP, *empty(SETUP)), **changes)
    with pytest.raises(SchemaError, match=next(iter(changes))):
        open_run(folder).frame(1).image(0)


@pytest.mark.parametrize("run_fingerprint", ["synthetic", "", "another"])
def test_sidecar_of_another_run(folder: Path, run_fingerprint: str) -> None:
    """Files of older versions name no run."""
    channels = encode(SETUP, *empty(SETUP))
    write_render(folder, SETUP, 1, 0, 0, channels, run_fingerprint=run_fingerprint)
    frame = open_run(folder).frame(1)
    if run_fingerprint != "another":
        assert frame.image(0)[0].run_fingerprint == run_fingerprint
        return
    with pytest.raises(SchemaError, match=r"ring_000_t0.json: frame 1 belongs to another run"):
        frame.image(0)


def test_negative_radiance(folder: Path) -> None:
    channels = encode(SETUP, *empty(SETUP))
    channels["B"][3, 4] = -1e-9
    write_render(folder, SETUP, 1, 0, 0, channels)
    with pytest.raises(FrameFileError, match=r"channel B is negative .* row 3, column 4"):
        open_run(folder).frame(1).image(0)


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({"ring_step_m": 0.0}, FrameFileError, "ring_step_m is 0.0"),
        ({"rings": 0}, FrameFileError, "rings is 0"),
        ({"metres_per_unit": 0.0}, FrameFileError, "metres_per_unit"),
        ({"range_encoding_length_m": -1.0}, FrameFileError, "range_encoding_length_m"),
        ({"snapshots": 3}, FrameFileError, "snapshots is 3"),
        ({"snapshot_interval_s": 0.0}, ConfigError, "snapshot interval is 0.0"),
        ({"frames": []}, FrameFileError, "lists 0 frames"),
        ({"frame_times_s": [0.0]}, FrameFileError, "4 frames and 1 times"),
        ({"burst": {"prf_hz": 1000.0, "pulses": 12.5}}, ConfigError, "Pulses is 12.5"),
        ({"burst": {"prf_hz": 1000.0}}, ConfigError, "Burst lacks pulses"),
        ({"burst": {"prf_hz": 500e3, "pulses": 128.0}}, ConfigError, "longer than the pulse"),
        ({"waveform": {"carrier_hz": 5e9}}, ConfigError, "lacks bandwidth_hz"),
    ],
)
def test_plan_that_does_not_fit(
    folder: Path, changes: dict[str, Any], kind: type[RadarSimError], words: str
) -> None:
    typed_json.write_record(folder / "run.json", dataclasses.replace(run_record(SETUP), **changes))
    with pytest.raises(kind, match=words):
        open_run(folder)


def test_damaged_plan(folder: Path) -> None:
    text = (folder / "run.json").read_text(encoding="utf-8")
    (folder / "run.json").write_text(text[: len(text) // 2], encoding="utf-8")
    with pytest.raises(FrameFileError, match="cannot be read as JSON"):
        open_run(folder)


def test_ring_out_of_range_is_the_callers_mistake(folder: Path) -> None:
    with pytest.raises(IndexError):
        open_run(folder).frame(1).image(2)


def test_changes_of_a_plan_are_short_texts() -> None:
    """An array, a PRF, frames and a link budget; nothing of what follows from other fields."""
    earlier = run_record(Setup(frames=(1, 2, 3)))
    board = channels_to_dict(array_preset("3x4", 0.0039).channels(Burst(1e4, 64), 1e-5))
    waveform = {**earlier.waveform, "bandwidth_hz": 5e8}
    burst = {**earlier.burst, "prf_hz": 2.5e4}
    now = dataclasses.replace(
        earlier,
        frames=[1, 2, 3, 4],
        frame_times_s=[0.0, 0.1, 0.2, 0.3],
        waveform=waveform,
        burst=burst,
        channels=board,
        link_budget=contract.LinkBudget(),
        versions={"radarsim": "0"},
    )
    assert plan_changes(earlier, earlier) == []
    prf, bandwidth = earlier.burst["prf_hz"], earlier.waveform["bandwidth_hz"]
    assert plan_changes(earlier, now) == [
        "frames: 1-3 -> 1-4",
        f"waveform.bandwidth_hz: {bandwidth:.12g} -> 500000000",
        f"burst.prf_hz: {prf:.12g} -> 25000",
        "link_budget: none -> set",
        "array: none -> 3x4",
    ]
    assert "array: 3x4 -> none" in plan_changes(now, earlier)
    moved = [{**channel, "start_offset_s": channel["start_offset_s"] + 1e-6} for channel in board]
    other = dataclasses.replace(
        now, channels=moved, link_budget=contract.LinkBudget(noise_figure_db=7.0)
    )
    assert plan_changes(now, other) == [
        "link_budget.noise_figure_db: 0 -> 7",
        "array: other values",
    ]
