# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of a target: the object they end on, and their corners."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.contract import ImageRecord
from radarsim_addon.physics.constants import SPEED_OF_LIGHT_MPS
from radarsim_addon.signal import (
    Burst,
    FmcwWaveform,
    ProcessOptions,
    Radar,
    SteppedWaveform,
    open_frame,
    open_run,
    process_frame,
)
from radarsim_addon.signal.detection import Cfar, PathFinder, Peak
from radarsim_addon.signal.detection.detections import BeamSines, mirror_corners
from radarsim_addon.signal.motion import BodyMotion, FrameMotion
from radarsim_addon.signal.motion.body_motion import Segment
from radarsim_addon.signal.paths import IMAGE_DTYPE, PATH_DTYPE, PathRows
from radarsim_addon.signal.pipeline.cli import frame_lines, main
from radarsim_addon.signal.products.frame_products import write_detections, write_hdf5
from tests.signal import path_runs as pr
from tests.signal import unequal as u


@pytest.fixture(scope="module")
def finder(tmp_path_factory: pytest.TempPathFactory) -> PathFinder:
    """Two plates that face the radar, 300 and 430 m away, the far one 9 times as large."""
    here = pr.pose((0, 0, 0))
    receiver, transmitter = pr.camera(here), contract.TransmitterRecord(here, 5.0)
    plates = [pr.plate("Near", (-60, 300, 0), 25.0), pr.plate("Far", (120, 430, 0), 75.0)]
    rows = pr.trace(plates, receiver, transmitter, 48, 1)
    folder = pr.write_run(
        tmp_path_factory.mktemp("paths") / "run", rows, ["Near", "Far"], receiver, transmitter,
        range_limits_m=600.0,
    )  # fmt: skip
    return PathFinder(open_frame(open_run(folder).frame(1)))


@pytest.mark.parametrize(("name", "centre"), [("Near", (-60, 300, 0)), ("Far", (120, 430, 0))])
def test_a_target_is_the_object_at_its_range(
    finder: PathFinder, name: str, centre: tuple[float, float, float]
) -> None:
    range_m = float(np.linalg.norm(centre))
    found = finder.of_target(range_m, 0.0, most=5)
    assert found.name == name
    assert len(found.lines_m) == 5 == found.power_w.size
    for line in found.lines_m:
        assert line.shape == (3, 3)
        np.testing.assert_array_equal(line[[0, 2]], 0.0)
        assert abs(np.linalg.norm(line[1]) - range_m) < 1.5 * pr.WAVEFORM.range_resolution_m
        assert abs(line[1] - centre)[[0, 2]].max() <= 75 / 2
    of_object = finder.of_object(name)
    assert of_object.name == name
    assert (np.diff(of_object.power_w) <= 0).all() and of_object.power_w[0] > 0
    assert abs(of_object.lines_m[0][1] - centre)[1] < 1e-6


def test_velocity_decides_too_and_folds(finder: PathFinder) -> None:
    """Nothing moves: at 20 cells there is nothing, at whole multiples of the interval all is."""
    radar = Radar(pr.WAVEFORM, pr.BURST)
    assert finder.of_target(306.0, 20 * radar.velocity_resolution_mps).lines_m == []
    folded = finder.of_target(306.0, 2 * radar.max_unambiguous_velocity_mps)
    assert folded.name == "Near"
    assert finder.of_target(360.0, 0.0).name == ""
    assert finder.of_object("Nothing").lines_m == []


@pytest.mark.parametrize("kind", ["pulse", "stepped", "fmcw"])
def test_a_target_has_the_paths_that_fold_to_its_range(finder: PathFinder, kind: str) -> None:
    """The far plate is 1.4 periods away; FMCW filters it out, so that nothing is where it would
    be.
    """
    period_m = 319.0
    prf_hz = SPEED_OF_LIGHT_MPS / (2 * period_m)
    if kind == "pulse":
        short = dataclasses.replace(pr.WAVEFORM, chirp_duration_s=1e-6)
        radar = Radar(short, Burst(prf_hz, 16))
    elif kind == "stepped":
        radar = Radar(SteppedWaveform(pr.WAVEFORM.carrier_hz, prf_hz, 64, 1e-6), Burst(1e3, 16))
    else:
        waveform = FmcwWaveform(pr.WAVEFORM.carrier_hz, 512 * prf_hz, 512, 10e6)
        assert waveform.unambiguous_range_m == pytest.approx(period_m)
        radar = Radar(waveform, Burst(1e3, 16))
    frame_input = dataclasses.replace(finder._input, radar=radar)
    far_m = math.hypot(120, 430)
    found = PathFinder(frame_input).of_target(far_m - period_m, 0.0)
    assert found.name == ("" if kind == "fmcw" else "Far")
    assert bool(found.lines_m) == (kind != "fmcw")


def test_a_target_is_where_its_object_is_in_the_middle_of_the_burst(tmp_path: Path) -> None:
    """Constant range rates: in 7 s the boat goes 20 m, which are 7 cells."""
    frame_input = open_frame(open_run(u.write_run(tmp_path / "run")).frame(1))
    radar = Radar(u.FMCW.waveform, Burst(2.0, 15))
    finder = PathFinder(dataclasses.replace(frame_input, radar=radar))
    boat = u.ECHOES[1]
    assert finder.of_target(boat.range_m + 3.5 * boat.rate_mps, boat.rate_mps).name == "Boat"
    for at_s in (0.0, 7.0):
        assert finder.of_target(boat.range_m + at_s * boat.rate_mps, boat.rate_mps).name == ""


def test_the_strongest_cell_of_the_map_is_on_the_strongest_object(tmp_path: Path) -> None:
    here = pr.pose((0, 0, 0))
    receiver, transmitter = pr.camera(here), contract.TransmitterRecord(here, 5.0)
    plates = [pr.plate("Weak", (-60, 300, 0), 5.0), pr.plate("Strong", (120, 430, 0), 60.0)]
    rows = pr.trace(plates, receiver, transmitter, 48, 1)
    folder = pr.write_run(
        tmp_path / "run", rows, ["Weak", "Strong"], receiver, transmitter, range_limits_m=600.0
    )
    options = ProcessOptions().for_run(open_run(folder))
    result = process_frame(options.open(open_run(folder).frame(1)), options)
    shown = result.rd_map
    row, col = np.unravel_index(np.argmax(shown.plane_power), shown.plane_power.shape)
    found = PathFinder(result.source).of_target(
        float(shown.range_m[col]), float(shown.velocity_mps[row])
    )
    assert found.name == "Strong"


def test_corners_on_mirrors_obey_the_law_of_reflection() -> None:
    """Ground z = 0, then a wall x = 10: legs as long as the straight line to the image."""
    antenna, scatterer = np.array([0.0, 0.0, 2.0]), np.array([4.0, 30.0, 3.0])
    image = ImageRecord([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], [0.0, 10.0], ["Ground", "Wall"])
    corners = mirror_corners(antenna, image, scatterer)
    assert len(corners) == 2
    assert corners[0][2] == pytest.approx(0.0, abs=1e-12)
    assert corners[1][0] == pytest.approx(10.0)
    points = np.array([antenna, *corners, scatterer])
    walked = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert walked == pytest.approx(np.linalg.norm(scatterer - [20.0, 0.0, -2.0]))
    assert mirror_corners(antenna, None, scatterer) == ()


def moving(mps: float) -> BodyMotion:
    if not mps:
        return BodyMotion(np.eye(4))
    translation = np.array([np.zeros(3), [0.0, 0.05 * mps, 0.0]])
    return BodyMotion(np.eye(4), (Segment(0.0, 0.1, translation),))


#: Objects of first and last vertex, reflections, mirrors of the images, what moves, and the name.
NAMES = [
    (("Car", "Car"), 1, [], ["Car"], "Car"),
    (("Car", "House"), 2, [], ["Car"], "Car via House"),
    (("House", "Car"), 2, [], ["Car"], "Car via House"),
    (("Car", "House"), 2, [], [], "Car and House"),
    (("House", "Car"), 2, [], ["Car", "House"], "Car and House"),
    (("House", "Car"), 3, [], ["Car"], "Car via House (3 reflections)"),
    (("Car", "Car"), 2, [], ["Car"], "Car (2 reflections)"),
    (("Car", "Car"), 2, ["Road"], ["Car"], "Car via Road"),
    (("Car", "House"), 3, ["Road"], ["Car"], "Car via House and Road"),
    (("", "Car"), 1, [], ["Car"], "Car"),
    (("", ""), 1, [], [], ""),
]


@pytest.mark.parametrize(("ends", "order", "mirrors", "moves", "name"), NAMES)
def test_a_target_is_named_after_all_that_its_paths_touch(
    ends: tuple[str, str], order: int, mirrors: list[str], moves: list[str], name: str,
    tmp_path: Path,
) -> None:  # fmt: skip
    """Two thirds of the power at 28.27 m have the path that is named, one third is of a fence."""
    objects = ["Car", "House", "Fence"]
    number = {"": 0} | {item: n for n, item in enumerate(objects, start=1)}
    rows = PathRows.zeros(3, IMAGE_DTYPE)
    rows["power_w"], rows["length_m"], rows["solid_angle_sr"] = 1e-9, 2 * 28.27, 1e-6
    rows["order"] = order, order, 1
    for end, item in zip(("first", "last"), ends, strict=True):
        rows[f"{end}_object"] = rows[f"{end}_body"] = number[item], number[item], 3
        rows[f"{end}_scatterer_m"] = 0.0, 28.27, 0.0
    plain = PathRows.zeros(3)
    for column in PATH_DTYPE.names:
        plain[column] = rows[column]
    if mirrors:
        rows["mirrors"][:2], rows["transmitter_image"][:2] = 1, 1
    else:
        rows = plain
    here = pr.pose((0, 0, 0))
    receiver, transmitter = pr.camera(here), contract.TransmitterRecord(here, 5.0)
    folder = pr.write_run(
        tmp_path / "run", plain, objects, receiver, transmitter, range_limits_m=100.0
    )
    frame = open_frame(open_run(folder).frame(1))
    still = BodyMotion(np.array(here))
    bodies = [moving(1e-3 * (item in moves)) for item in objects]
    record = dataclasses.replace(
        frame.table.record, images=[ImageRecord([[0, 0, 1]], [-2.0], mirrors)]
    )
    table = dataclasses.replace(
        frame.table, rows=rows, record=record,
        motion=FrameMotion(0.1, still, still, False, bodies),
    )  # fmt: skip
    finder = PathFinder(dataclasses.replace(frame, tables=(table,)))
    assert finder.of_target(28.27, 0.0).name == name
    (peak,) = finder.named([Peak(28.27, 0.0, 0.0, 1.0, 2.0)])
    assert (peak.name, peak.range_m, peak.peak_to_background_db) == (name, 28.27, 2.0)


#: Part of the transmitters in an array's extent, the sine of a beam's direction, and the name.
#: Over a wall 6 m to the right, the car at (0, 20) is received from (12, 20), and the transmitter
#: sends to the fence at (-4, 20) as to (16, 20).
BEAMS = [
    (0.0, 12 / math.hypot(12, 20), "Car via Wall"),
    (0.0, -4 / math.hypot(4, 20), "Fence via Wall"),
    (1.0, 0.0, "Car via Wall"),
    (1.0, 16 / math.hypot(16, 20), "Fence via Wall"),
    (0.76, 0.24 * 12 / math.hypot(12, 20), "Car via Wall"),
    (0.76, 0.76 * 16 / math.hypot(16, 20) - 0.24 * 4 / math.hypot(4, 20), "Fence via Wall"),
    # next to the fence, which has more power than the post
    (0.0, -0.4, "Post"),
]


@pytest.mark.parametrize(("sent", "sine", "name"), BEAMS)
def test_a_beam_has_the_paths_that_its_array_sees_there(
    sent: float, sine: float, name: str, tmp_path: Path
) -> None:
    objects = ["Car", "Fence", "Post"]
    rows = PathRows.zeros(3, IMAGE_DTYPE)
    rows["power_w"], rows["length_m"], rows["solid_angle_sr"] = (1e-9, 2e-9, 1e-9), 44.0, 1e-6
    rows["first_object"] = rows["last_object"] = 1, 2, 3
    places = np.array([[0, 20, 0], [-4, 20, 0], [-0.4 * 22, 0.9165 * 22, 0]])
    rows["first_scatterer_m"] = rows["last_scatterer_m"] = places
    seen = np.array([[12, 20, 0], places[1], places[2]])
    rows["direction"] = seen / np.linalg.norm(seen, axis=1)[:, None]
    rows["receiver_image"], rows["transmitter_image"] = (1, 0, 0), (0, 1, 0)
    rows["mirrors"], rows["order"] = (1, 1, 0), (2, 2, 1)
    plain = PathRows({column: rows[column] for column in PATH_DTYPE.names or ()})
    here = pr.pose((0, 0, 0))
    receiver, transmitter = pr.camera(here), contract.TransmitterRecord(here, 5.0)
    folder = pr.write_run(
        tmp_path / "run", plain, objects, receiver, transmitter, range_limits_m=100.0
    )
    frame = open_frame(open_run(folder).frame(1))
    images = [ImageRecord([[-1, 0, 0]], [-6.0], ["Wall"])]
    record = dataclasses.replace(frame.table.record, images=images)
    table = dataclasses.replace(frame.table, rows=rows, record=record)
    finder = PathFinder(dataclasses.replace(frame, tables=(table,)))
    right = np.array([[1.0, 0.0, 0.0]])
    beam = BeamSines(right, np.array([sine]), np.array([0.29]), np.array([sent]))
    found = finder.of_target(22.0, 0.0, beam=beam)
    assert found.name == name
    assert found.purity is not None and found.purity > 0.5


def test_an_accelerating_target_is_where_the_map_shows_it(tmp_path: Path) -> None:
    """At t the car is stationary; over the burst its mean range rate is 40 m/s."""
    here, burst_s = pr.pose((0, 0, 0)), (pr.BURST.pulses - 1) / pr.BURST.prf_hz
    receiver, transmitter = pr.camera(here), contract.TransmitterRecord(here, 5.0)
    rows = PathRows.zeros(1)
    rows["power_w"], rows["length_m"], rows["solid_angle_sr"], rows["order"] = 1e-9, 600.0, 1e-6, 1
    for end in ("first", "last"):
        rows[f"{end}_object"] = rows[f"{end}_body"] = 1
        rows[f"{end}_scatterer_m"] = 0.0, 300.0, 0.0
    folder = pr.write_run(
        tmp_path / "run", rows, ["Car"], receiver, transmitter, range_limits_m=600.0
    )
    frame = open_frame(open_run(folder).frame(1))
    still, half = BodyMotion(np.array(here)), 40.0 * burst_s / 2
    # y = a t^2 of Chebyshev's polynomials of x = 2 t / burst - 1
    series = np.array([[0, 0.75 * half, 0], [0, half, 0], [0, 0.25 * half, 0]])
    car = BodyMotion(np.eye(4), (Segment(0.0, burst_s, series),))
    table = dataclasses.replace(
        frame.table, motion=FrameMotion(burst_s, still, still, False, [car])
    )
    finder = PathFinder(dataclasses.replace(frame, tables=(table,)))
    assert finder.of_target(300.0 + half / 2, 40.0).name == "Car"
    assert finder.of_target(300.0, 0.0).name == ""


def test_lists_and_files_have_the_names(tmp_path: Path) -> None:
    """Console, summary, CSV and HDF5 of two plates; the names need quotes and are not ASCII."""
    here = pr.pose((0, 0, 0))
    receiver, transmitter = pr.camera(here), contract.TransmitterRecord(here, 5.0)
    plates = [pr.plate("a", (-60, 300, 0), 25.0), pr.plate("b", (120, 430, 0), 75.0)]
    rows = pr.trace(plates, receiver, transmitter, 48, 1)
    names = ['Wall, "old"', "Türe"]
    folder = pr.write_run(
        tmp_path / "run", rows, names, receiver, transmitter, range_limits_m=600.0
    )
    options = ProcessOptions(cfar=Cfar()).for_run(open_run(folder))
    result = process_frame(options.open(open_run(folder).frame(1)), options)
    found = result.detections
    assert found is not None
    near = {target.name for target in found.targets if abs(target.range_m - 306) < 5}
    far = {target.name for target in found.targets if abs(target.range_m - 446) < 12}
    assert (near, far) == ({names[0]}, {names[1]})
    assert any(line.endswith(names[1]) for line in frame_lines(result))
    table, record = write_detections(tmp_path / "x", found)
    with open(table, encoding="utf-8", newline="") as lines:
        assert {line["name"] for line in csv.DictReader(lines)} >= set(names)
    assert {one["name"] for one in json.loads(record.read_text("utf-8"))["targets"]} >= set(names)
    import h5py

    (path,) = write_hdf5(result, tmp_path)
    with h5py.File(path) as file:
        assert {one.decode() for one in file["detections/name"][:]} >= set(names)


@pytest.mark.parametrize(
    ("limits", "code"), [("0:600", 0), ("290:320", 0), ("1000:1200", 3), ("0:100", 3)]
)
def test_limits_without_an_echo_end_with_the_code_of_empty_results(
    limits: str, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A plate at 300 m: a script that runs `radarsim process` sees that the maps are empty."""
    here = pr.pose((0, 0, 0))
    receiver, transmitter = pr.camera(here), contract.TransmitterRecord(here, 5.0)
    rows = pr.trace([pr.plate("Plate", (0, 300, 0), 25.0)], receiver, transmitter, 32, 1)
    folder = pr.write_run(
        tmp_path / "run", rows, ["Plate"], receiver, transmitter, range_limits_m=600.0
    )
    words = ["--no-plots", "--no-products", "--range-limits", limits]
    assert main(["process", str(folder), *words]) == code
    said = capsys.readouterr()
    text = said.out + said.err
    assert ("[all-echoes-outside-ranges]" in text) == (code == 3)
    if code:
        assert "they are at 300" in text
