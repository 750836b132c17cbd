# SPDX-License-Identifier: GPL-3.0-or-later
"""A run processed with an array: lists, files and findings from paths to point clouds."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.errors import ConfigError, MissingDependencyError
from radarsim_addon.signal import ProcessOptions, Progress, Radar, open_run, process_run
from radarsim_addon.signal.detection import Cfar, DirectedDetection
from radarsim_addon.signal.echoes import Receiver
from radarsim_addon.signal.pipeline.cli import main
from radarsim_addon.signal.products import FrameResult, write_bag
from radarsim_addon.signal.radar import (
    SINGLE_CHANNEL,
    AntennaArray,
    Channel,
    Element,
    channels_to_dict,
    linear_array,
)
from radarsim_addon.typed_json import read_record, write_record
from tests.signal import path_runs as pr

WAVELENGTH_M = pr.C0_MPS / pr.WAVEFORM.carrier_hz
#: Right of the boresight; both at one range, so that one cell of the map holds both.
AZIMUTHS_DEG = {"Left": -22.0, "Right": 14.0}
RANGE_M = 310.0


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two small plates that face the radar, which looks along +Y; the right one is 6 m^2."""
    here = pr.pose((2.0, 1.0, 4.0))
    receiver, transmitter = pr.camera(here), contract.TransmitterRecord(here, 5.0)
    plates = []
    for name, azimuth_deg in AZIMUTHS_DEG.items():
        angle = math.radians(azimuth_deg)
        centre = (2 + RANGE_M * math.sin(angle), 1 + RANGE_M * math.cos(angle), 4.0)
        plates.append(pr.plate(name, centre, 10.0 if name == "Left" else 12.0))
    rows = pr.trace(plates, receiver, transmitter, 96)
    return pr.write_run(
        tmp_path_factory.mktemp("array") / "run", rows, list(AZIMUTHS_DEG), receiver, transmitter,
        range_limits_m=600.0,
    )  # fmt: skip


def radar_of(spacing_wavelengths: float = 0.5) -> Radar:
    receivers = linear_array(12, spacing_wavelengths * WAVELENGTH_M)
    array = AntennaArray(linear_array(1, 1.0), receivers)
    return Radar(pr.WAVEFORM, pr.BURST, array.channels(pr.BURST))


def processed(run: Path, out: Path, **given: object) -> FrameResult:
    # noise hides the sidelobes of the pulse
    receiver = Receiver(noise_figure_db=20.0)
    options = ProcessOptions(plots=False, receiver=receiver, **given)  # type: ignore[arg-type]
    return next(e for e in [*process_run(run, options, out=out)] if isinstance(e, FrameResult))


@pytest.fixture(scope="module")
def result(run: Path, tmp_path_factory: pytest.TempPathFactory) -> FrameResult:
    out = tmp_path_factory.mktemp("products")
    return processed(run, out, radar=radar_of(), hdf5=True)


def test_directions_are_a_step_with_its_time(run: Path, tmp_path: Path) -> None:
    options = ProcessOptions(plots=False, radar=radar_of())
    events = list(process_run(run, options, out=tmp_path / "out"))
    steps = [event for event in events if isinstance(event, Progress)]
    assert [step.done for step in steps] == list(range(1, steps[-1].total + 1))
    texts = [re.sub(r" \(\d+\.\d s\)$", " (time)", step.text) for step in steps]
    assert texts == [
        f"frame 1: {step} (time)"
        for step in ("echoes and maps of 12 channels", "directions", "products", "pictures")
    ]


def test_targets_have_the_directions_and_names_of_their_objects(result: FrameResult) -> None:
    assert result.detections is not None
    found = {target.name: target for target in result.detections.targets[:2]}
    assert set(found) == set(AZIMUTHS_DEG)
    for name, azimuth_deg in AZIMUTHS_DEG.items():
        target = found[name]
        assert isinstance(target, DirectedDetection)
        # a plate of 2 degrees with random phases: where it seems to be is near it
        assert target.azimuth_deg == pytest.approx(azimuth_deg, abs=2.0)
        assert target.true_azimuth_deg == pytest.approx(azimuth_deg, abs=1.0)
        assert target.elevation_deg is None
        assert target.true_elevation_deg == pytest.approx(0.0, abs=0.5)
        assert (target.reflections, target.purity) == (1, 1.0)
        angle = math.radians(target.azimuth_deg)
        place = np.array([math.sin(angle), math.cos(angle), 0.0]) * target.range_m + (2, 1, 4)
        assert [target.world_x_m, target.world_y_m, target.world_z_m] == pytest.approx(place)


def test_files_hold_the_points(result: FrameResult) -> None:
    assert result.detections is not None
    files = {path.name.removeprefix("frame_0001").lstrip("_."): path for path in result.files}
    targets = [x for x in result.detections.targets if isinstance(x, DirectedDetection)]
    with open(files["detections.csv"], newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["azimuth_deg"]) for row in rows] == [one.azimuth_deg for one in targets]
    with h5py.File(files["h5"]) as file:
        column = file["detections/true_azimuth_deg"]
        assert column.attrs["units"] == "degree"
        np.testing.assert_array_equal(column[:2], [one.true_azimuth_deg for one in targets[:2]])
    clouds = []
    for ending, last in (("ply", b"end_header\n"), ("pcd", b"DATA binary\n")):
        head, _, data = files[f"points.{ending}"].read_bytes().partition(last)
        clouds.append(np.frombuffer(data, "<f4").reshape(len(targets), -1))
        if ending == "ply":
            names = [x.split()[2] for x in head.decode().splitlines() if x.startswith("property")]
            assert f"element vertex {len(targets)}" in head.decode()
        else:
            fields = next(x for x in head.decode().splitlines() if x.startswith("FIELDS"))
            assert fields.split()[1:] == names
            assert f"POINTS {len(targets)}" in head.decode()
    np.testing.assert_array_equal(clouds[0], clouds[1])
    columns = dict(zip(names, clouds[0].T, strict=True))
    right, forward = -columns["y"], columns["x"]
    azimuth_deg = np.degrees(np.arctan2(right, forward))
    np.testing.assert_allclose(azimuth_deg, columns["azimuth_deg"], atol=1e-4)
    assert np.isnan(columns["elevation_deg"]).all()
    json.loads(files["detections.json"].read_text())


def test_parquet_has_typed_columns_and_more_of_them(
    run: Path, result: FrameResult, tmp_path: Path
) -> None:
    """Read by pandas; what is unknown is null, also the elevation of a row of elements."""
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    found = processed(run, tmp_path, radar=radar_of(), parquet=True)
    table = pandas.read_parquet(tmp_path / "frame_0001_points.parquet")
    targets = found.detections.targets
    assert (table["frame"] == 1).all() and (table["time_s"] == 0.0).all()
    assert table["object"].tolist() == [one.name for one in targets]
    assert table["range"].tolist() == [one.range_m for one in targets]
    assert table["world_y"].tolist() == [one.world_y_m for one in targets]
    assert table["elevation_deg"].isna().all() and table["reflections"].dtype == "int32"
    assert table["ghost"][:2].tolist() == [False, False]
    ply = next(path for path in found.files if path.name.endswith("_points.ply"))
    data = ply.read_bytes().partition(b"end_header\n")[2]
    floats = np.frombuffer(data, "<f4").reshape(len(targets), -1)
    np.testing.assert_allclose(floats, table.iloc[:, 2:13].to_numpy(float), rtol=1e-6)


def test_a_bag_has_the_clouds_of_all_frames_in_order_of_time(run: Path, tmp_path: Path) -> None:
    """Also of a frame without targets; a later processing without it removes it."""
    rosbags = pytest.importorskip("rosbags.highlevel")
    found = processed(run, tmp_path, radar=radar_of(), ros_bag=True)
    targets = found.detections.targets

    def read() -> list[tuple[int, Any]]:
        with rosbags.AnyReader([tmp_path / "points_bag"]) as reader:
            (topic,) = reader.connections
            assert (topic.topic, topic.msgtype) == ("/radar/points", "sensor_msgs/msg/PointCloud2")
            every = reader.messages()
            return [(at_ns, reader.deserialize(data, topic.msgtype)) for _, at_ns, data in every]

    assert [(at_ns, cloud.width) for at_ns, cloud in read()] == [(0, len(targets))]
    write_bag(tmp_path, [(2, 0.5 + 1e-9), (1, 0.25)])
    clouds = read()
    assert [time_ns for time_ns, _ in clouds] == [250_000_000, 500_000_001]
    cloud, empty = (each for _, each in clouds)
    assert (cloud.width, cloud.height, cloud.header.frame_id) == (len(targets), 1, "radar")
    assert (empty.width, empty.data.size) == (0, 0)
    assert (empty.header.stamp.sec, empty.header.stamp.nanosec) == (0, 500_000_001)
    assert [field.offset for field in cloud.fields] == [4 * n for n in range(len(cloud.fields))]
    layout = np.dtype([(field.name, "<f4") for field in cloud.fields])
    values = np.frombuffer(cloud.data.tobytes(), layout)
    np.testing.assert_array_equal(values["x"], np.float32([one.x_m for one in targets]))
    with pytest.raises(ConfigError, match="Frame 7 is at -1 s"):
        write_bag(tmp_path, [(7, -1.0)])
    processed(run, tmp_path, radar=radar_of())
    assert not (tmp_path / "points_bag").exists()


@pytest.mark.parametrize(
    ("option", "package"), [("parquet", "pyarrow.parquet"), ("ros_bag", "rosbags.rosbag2")]
)
def test_files_of_points_need_their_package(
    run: Path, tmp_path: Path, option: str, package: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    name = package.partition(".")[0]
    with pytest.raises(MissingDependencyError, match=f"pip install {name}"):
        processed(run, tmp_path / "missing", radar=radar_of(), **{option: True})
    assert not (tmp_path / "missing").exists()  # it is known before the first frame


def test_a_bag_of_a_shard_is_refused(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["process", str(run), "--ros-bag", "--shard", "1/2"]) != 0
    assert "--ros-bag with --shard: the bag has all frames" in capsys.readouterr().err


def test_the_cross_section_is_that_of_the_paths(result: FrameResult) -> None:
    """Speckle changes the level of a target, and its cross section with it."""
    assert result.detections is not None
    budget = {echo.name: echo for echo in result.budget.objects}
    for target in result.detections.targets[:2]:
        assert isinstance(target, DirectedDetection)
        echo, level_w = budget[target.name], 10 ** (target.level_db / 10)
        expected_m2 = echo.rcs_m2 * level_w / echo.power_w
        assert target.rcs_dbsm == pytest.approx(10 * math.log10(expected_m2), abs=0.2)


def test_grating_lobes_are_a_finding(run: Path, result: FrameResult, tmp_path: Path) -> None:
    """At 1.2 wavelengths the sector is asin(0.5 / 1.2) = 24.6 degrees: nothing beyond is told."""
    wide = processed(run, tmp_path / "wide", radar=radar_of(1.2))
    (found,) = (item for item in wide.findings if item.code == "angles-ambiguous")
    assert found.numbers["sector_deg"] == pytest.approx(24.6, abs=0.2)
    assert not any(item.code == "angles-ambiguous" for item in result.findings)


def test_elements_beyond_those_of_the_render_are_named(run: Path, tmp_path: Path) -> None:
    """The render checks what its elements see; the run's own elements are at the origin."""
    folder, reach_m = tmp_path / "run", radar_of().array_reach_m
    assert reach_m == pytest.approx(5.5 * WAVELENGTH_M / 2)
    shutil.copytree(run, folder)
    paths = folder / contract.frame_dir(1) / contract.PATHS_FILE
    codes = []
    for checked_m in (0.0, reach_m / 2, reach_m):
        record = read_record(paths, contract.PathsRecord)
        write_record(paths, dataclasses.replace(record, array_reach_m=checked_m))
        found = processed(folder, tmp_path / "products", radar=radar_of(), cfar=Cfar()).findings
        codes.append([f.numbers["checked_m"] for f in found if f.code == "array-not-checked"])
    assert codes == [[0.0], [reach_m / 2], []]
    alone = processed(folder, tmp_path / "products").findings
    assert not any(item.code == "array-not-checked" for item in alone)


def test_the_commands_list_angles_and_write_clouds(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    radar = {
        "waveform": dataclasses.asdict(pr.WAVEFORM),
        "array": {"transmitters": [[0, 0, 0]],
                  "receivers": [[n * WAVELENGTH_M / 2, 0, 0] for n in range(8)]},
    }  # fmt: skip
    path = tmp_path / "radar.json"
    path.write_text(json.dumps(radar))
    assert (
        main(
            [
                "process",
                str(run),
                "--waveform",
                str(path),
                "--out",
                str(tmp_path / "p"),
                "--noise-figure-db",
                "20",
            ]
        )
        == 0
    )
    text = capsys.readouterr().out
    assert "azimuth" in text and "elevation" not in text
    names = {file.name for file in (tmp_path / "p").iterdir()}
    assert {"frame_0001_points.ply", "frame_0001_points.pcd", "frame_0001_points.png"} <= names
    # processed again without an array, its files go
    assert main(["process", str(run), "--out", str(tmp_path / "p"), "--no-plots"]) == 0
    assert not any("points" in file.name for file in (tmp_path / "p").iterdir())


def test_a_run_of_its_own_array(run: Path, tmp_path: Path) -> None:
    """The record of a run holds the channels that it was made for, and processing uses them."""
    folder = tmp_path / "run"
    shutil.copytree(run, folder)
    assert open_run(run).radar.channels == (SINGLE_CHANNEL,)
    channels = channels_to_dict(radar_of().channels)
    write_record(folder / "run.json", dataclasses.replace(open_run(run).record, channels=channels))
    assert open_run(folder).radar == radar_of()
    found = processed(folder, tmp_path / "products").detections
    assert found is not None and isinstance(found.targets[0], DirectedDetection)


def test_an_echo_within_the_array_is_refused(run: Path, tmp_path: Path) -> None:
    array = AntennaArray(linear_array(1, 1.0), linear_array(2, 2000.0))
    radar = Radar(pr.WAVEFORM, pr.BURST, array.channels(pr.BURST))
    with pytest.raises(ConfigError, match=r"array reaches 1000 m .* nearest echo is at 30\d"):
        processed(run, tmp_path, radar=radar)


@pytest.mark.parametrize(
    ("channels", "reason"),
    [
        ((Channel(), Channel(rx=Element((1e-4, 0, 0)))), "within a quarter of a wavelength"),
        (
            (Channel(), Channel(rx=Element((0.1, 0, 0)), active=(True, False) * 32)),
            "silent at some pulses",
        ),
    ],
)
def test_channels_that_measure_no_angles_say_why(
    run: Path, tmp_path: Path, channels: tuple[Channel, ...], reason: str
) -> None:
    """Detections are then those of the first channel, as without an array."""
    radar = Radar(pr.WAVEFORM, pr.BURST, channels)
    found = processed(run, tmp_path, radar=radar, cfar=Cfar())
    (missing,) = (item for item in found.findings if item.code == "angles-not-measured")
    assert reason in missing.text
    assert found.detections is not None
    assert not any(isinstance(one, DirectedDetection) for one in found.detections.targets)
