# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists count a part, such as a wheel, with the object that it is parented to."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

from radarsim_addon import contract
from radarsim_addon.contract import GroundTruthRecord, ObjectRecord
from radarsim_addon.signal import FrameInput, ProcessOptions, open_frame, open_run, process_frame
from radarsim_addon.signal.detection import PathFinder, matching_objects, object_echoes
from radarsim_addon.signal.pipeline.cli import main
from tests.signal import path_runs as pr

NAMES = ["Wheel", "Car", "Sign"]
#: Two of them touch one another's range cell; the sign is far from both.
RANGES_M = {"Wheel": 300.0, "Car": 330.0, "Sign": 430.0}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A car, a wheel that is parented to it, and a sign."""
    here = pr.pose((0, 0, 0))
    receiver, transmitter = pr.camera(here), contract.TransmitterRecord(here, 5.0)
    across = {"Wheel": -90.0, "Car": 0.0, "Sign": 150.0}
    plates = [pr.plate(name, (across[name], RANGES_M[name], 0), 40.0) for name in NAMES]
    objects = [
        ObjectRecord(name, None, RANGES_M[name], None, part_of="Car" if name == "Wheel" else "")
        for name in sorted(NAMES)
    ]
    rows = pr.trace(plates, receiver, transmitter, 64, 2)
    return pr.write_run(
        tmp_path / "run", rows, NAMES, receiver, transmitter, range_limits_m=600.0, replicates=2,
        scene=GroundTruthRecord(1, 0.0, objects),
    )  # fmt: skip


def opened(folder: Path) -> FrameInput:
    return open_frame(open_run(folder).frame(1))


def test_an_object_has_the_power_of_its_parts(folder: Path) -> None:
    frame, carrier_hz = opened(folder), pr.WAVEFORM.carrier_hz
    rows = frame.table.rows
    by_row = {
        name: rows["power_w"][rows["last_object"] == number].sum()
        for number, name in enumerate(NAMES, start=1)
    }
    wholes = {echo.name: echo for echo in object_echoes(frame, carrier_hz)}
    parts = {echo.name: echo for echo in object_echoes(frame.by_parts(), carrier_hz)}
    assert set(wholes) == {"Car", "Sign"} and set(parts) == set(NAMES)
    for name, echo in parts.items():
        assert echo.power_w == pytest.approx(by_row[name], rel=1e-12)
    assert wholes["Car"].power_w == pytest.approx(by_row["Car"] + by_row["Wheel"], rel=1e-12)
    assert wholes["Car"].paths == parts["Car"].paths + parts["Wheel"].paths
    assert wholes["Sign"] == parts["Sign"]
    # the wheel is nearer: the car is where its body is
    assert wholes["Car"].range_m == pytest.approx(parts["Car"].range_m, rel=1e-12)
    assert matching_objects(frame, "Car") == ["Wheel", "Car"]
    assert matching_objects(frame, "Wh*") == ["Wheel"]
    assert matching_objects(frame.by_parts(), "Car") == ["Car"]


def test_a_target_on_a_part_has_the_name_of_its_object(folder: Path) -> None:
    frame = opened(folder)
    range_m = float(frame.table.rows["length_m"][frame.table.rows["last_object"] == 1].min()) / 2
    whole, part = PathFinder(frame), PathFinder(frame.by_parts())
    assert whole.of_target(range_m, 0.0).name == "Car"
    assert part.of_target(range_m, 0.0).name == "Wheel"
    # the paths of an object are those of its parts, too; those of a part are its own
    assert {one.name for one in map(whole.of_object, ("Car", "Wheel"))} == {"Car", "Wheel"}
    counts = [len(whole.of_object(name, 10**6).lines_m) for name in ("Car", "Wheel")]
    own = [len(part.of_object(name, 10**6).lines_m) for name in ("Car", "Wheel")]
    assert counts == [sum(own), own[1]] and min(own) > 0


def test_two_reflections_between_an_object_and_its_part_are_its_own(folder: Path) -> None:
    """A path over body and wheel is an echo of the car alone, not of two targets."""
    frame = opened(folder)
    rows = frame.table.rows.copy()
    rows["first_object"][rows["last_object"] == 2] = 1
    rows["order"][rows["last_object"] == 2] = 2
    rows["power_w"][rows["last_object"] != 2] = 0.0
    table = dataclasses.replace(frame.table, rows=rows)
    frame = dataclasses.replace(frame, tables=(table,))
    range_m = float(rows["length_m"][rows["last_object"] == 2].min()) / 2
    assert PathFinder(frame).of_target(range_m, 0.0).name == "Car (2 reflections)"
    assert PathFinder(frame.by_parts()).of_target(range_m, 0.0).name == "Car and Wheel"
    (car,) = (one for one in object_echoes(frame, pr.WAVEFORM.carrier_hz) if one.power_w)
    assert car.name == "Car" and car.multi_object_power_w == 0.0
    assert not any(one.power_w for one in object_echoes(frame.by_parts(), pr.WAVEFORM.carrier_hz))


def test_commands_and_processing_list_parts_where_asked(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for words, names in (([], {"Car", "Sign"}), (["--parts"], set(NAMES))):
        assert main(["objects", str(folder), *words]) == 0
        lines = capsys.readouterr().out.splitlines()[1:]
        assert {line.split()[0] for line in lines if "RCS" in line} == names
        options = ProcessOptions(parts=bool(words)).for_run(open_run(folder))
        result = process_frame(options.open(open_run(folder).frame(1)), options)
        assert {echo.name for echo in result.budget.objects} == names


def test_runs_without_the_field_list_every_object_by_itself(folder: Path) -> None:
    path = folder / contract.frame_dir(1) / contract.GROUND_TRUTH_FILE
    record = json.loads(path.read_text())
    for item in record["objects"]:
        del item["part_of"]
    del record["record_sha256"]
    path.write_text(json.dumps(record))
    found = object_echoes(opened(folder), pr.WAVEFORM.carrier_hz)
    assert {echo.name for echo in found} == set(NAMES)
