# SPDX-License-Identifier: GPL-3.0-or-later
"""Every number in the files of a frame, by hand: unequal echoes, two channels, frame 3."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon.contract import AntennaRecord, LinkBudget
from radarsim_addon.signal import (
    Cfar,
    Channel,
    Element,
    FrameResult,
    ProcessOptions,
    Progress,
    Radar,
    Receiver,
    process_run,
)
from tests.signal import unequal as u

FRAME, TIME_S = 3, 0.125
CHANNELS = (Channel(), Channel(start_offset_s=2e-4))
BUDGET = LinkBudget(
    100.0, AntennaRecord("isotropic", {"gain_dbi": 20.0}),
    AntennaRecord("isotropic", {"gain_dbi": 13.0}), transmit_loss_db=1.0, receive_loss_db=2.0,
    other_loss_db=0.5, noise_figure_db=4.0,
)  # fmt: skip
GAIN = 100 * 10 ** ((20 + 13 - 3.5) / 10) / u.EIRP_W
#: k T0 F fs by the link budget and by the receiver, whose noise figure is another.
BUDGET_NOISE_W, NOISE_W = (1.380649e-23 * 290 * 10 ** (f / 10) * 2e6 for f in (4.0, 30.0))
FULL_SCALE, BITS = 2e-3, 12
STEP = 2 * FULL_SCALE / 2**BITS
OPTIONS = ProcessOptions(
    radar=Radar(u.FMCW.waveform, u.FMCW.burst, CHANNELS), range_taper="hann",
    doppler_taper="hamming", products=False, plots=False, link_budget=BUDGET, hdf5=True,
    receiver=Receiver(noise_figure_db=30.0, adc_bits=BITS, adc_full_scale=FULL_SCALE),
    cfar=Cfar("ca", 1e-9, guard=(2, 4), train=(2, 6)), speckle_seed=None,
)  # fmt: skip
#: Noise bandwidth of Hann's and Hamming's windows in cells.
HANN, HAMMING = 1.5, 1.3628
NOISE_CELL_W = (NOISE_W + STEP**2 / 6) * HANN / 251 * HAMMING / 15


@dataclasses.dataclass(frozen=True)
class Written:
    result: FrameResult
    run: Path
    folder: Path

    def file(self, ending: str) -> Path:
        return self.folder / f"frame_0003{ending}"

    def json(self, ending: str) -> Any:
        return json.loads(self.file(ending).read_text("utf-8"))


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Written:
    folder = tmp_path_factory.mktemp("fields")
    run = u.write_run(folder / "run", FRAME, TIME_S)
    results = [e for e in process_run(run, OPTIONS, out=folder / "out") if hasattr(e, "rd_map")]
    return Written(results[0], run, folder / "out")


def coherent_db(echo: u.Echo) -> float:
    """Level of an echo whose two rows are in phase."""
    return 20 * math.log10(sum(math.sqrt(GAIN * power_w) for power_w in echo.powers_w))


def test_summary(written: Written) -> None:
    summary = written.json("_summary.json")
    assert (summary["frame"], summary["time_s"]) == (FRAME, TIME_S)
    assert summary["burst"]["prf_hz"] == 1000.0 and summary["burst"]["pulses"] == 15
    assert summary["waveform"]["adc_samples"] == 251 and summary["level_unit"] == "dBW"
    statistics = summary["statistics"]
    for name, value in (
        ("power_w", 8.2e-11 * GAIN), ("nearest_m", u.ECHOES[0].range_m),
        ("farthest_m", u.ECHOES[2].range_m), ("fastest_mps", -u.ECHOES[2].rate_mps),
    ):  # fmt: skip
        assert statistics[name] == pytest.approx(value, rel=1e-9), name
    assert summary["synthesis"]["paths"] == 6 and summary["synthesis"]["pulses"] == 15
    assert summary["receiver"]["noise_power_w"] == pytest.approx(NOISE_W, rel=1e-6)
    assert summary["receiver"]["full_scale"] == FULL_SCALE
    assert summary["receiver"]["step"] == pytest.approx(STEP)
    assert summary["receiver"]["clipped"] == 0 and summary["leading_edges_left_out"] == 0
    for edge, echo in zip(summary["leading_edges"], u.ECHOES, strict=True):
        assert edge["peak_range_m"] == pytest.approx(echo.range_m, abs=0.01)
        assert edge["level_db"] == pytest.approx(10 * math.log10(GAIN * echo.power_w), abs=0.01)
        # a Hann response is 1.44 cells wide at half its power (Harris 1978)
        assert edge["peak_range_m"] - edge["range_m"] == pytest.approx(0.72 * u.CELL_M, rel=0.01)
    with np.load(written.file("_map.npz")) as arrays:
        power = np.sort(arrays["power"].ravel())
    assert summary["map"]["strongest"] == pytest.approx(power[-1])
    assert summary["map"]["median"] == pytest.approx(power[power.size // 2], rel=1e-3)
    assert summary["map"]["noise_power"] == pytest.approx(NOISE_CELL_W, rel=2e-3)
    for name, size in summary["files"].items():
        assert (written.folder / name).stat().st_size == size
    assert set(summary["files"]) == {p.name for p in written.folder.iterdir()} - {
        "frame_0003_summary.json"
    }
    assert all(item["frames"] == [FRAME] for item in summary["findings"])
    uncertain = next(i for i in summary["findings"] if i["code"] == "power-uncertain")
    assert uncertain["subjects"] == ["Mast", "Aircraft"]


def test_objects_of_the_summary(written: Written) -> None:
    budget = written.json("_summary.json")["link_budget"]
    assert budget["received_w"] == pytest.approx(8.2e-11 * GAIN)
    assert budget["received_dbm"] == pytest.approx(10 * math.log10(8.2e-8 * GAIN))
    assert budget["noise_w"] == pytest.approx(BUDGET_NOISE_W, rel=1e-6)
    assert budget["noise_dbm"] == pytest.approx(10 * math.log10(1e3 * BUDGET_NOISE_W), abs=1e-5)
    assert [one["name"] for one in budget["objects"]] == ["Mast", "Boat", "Aircraft"]
    for found, echo in zip(budget["objects"], u.ECHOES, strict=True):
        power_w = GAIN * echo.power_w
        snr_db = 10 * math.log10(power_w / BUDGET_NOISE_W)
        for name, value in (
            ("power_w", power_w), ("power_dbm", 10 * math.log10(1e3 * power_w)),
            ("rcs_m2", echo.rcs_m2), ("rcs_dbsm", 10 * math.log10(echo.rcs_m2)),
            ("rcs_error_m2", found["power_error_w"] * echo.rcs_m2 / power_w),
            ("range_m", echo.range_m), ("range_rate_mps", echo.rate_mps),
            ("paths", 2), ("multi_object_power_w", 0.0),
        ):  # fmt: skip
            assert found[name] == pytest.approx(value, rel=1e-9, abs=1e-12), name
        snr = found["predicted_snr"]
        assert snr["single_sample_db"] == pytest.approx(snr_db, abs=1e-3)
        assert snr["single_pulse_db"] - snr_db == pytest.approx(10 * math.log10(251), abs=1e-3)
        gain = 251 * 15 / HANN / HAMMING
        assert snr["burst_db"] - snr_db == pytest.approx(10 * math.log10(gain), abs=0.01)
    assert budget["objects"][0]["power_error_w"] == pytest.approx(3e-11 * GAIN)


def test_arrays(written: Written) -> None:
    """Axes, and where each echo is, in both channels and in the expected power."""
    with np.load(written.file("_map.npz")) as file:
        rd_map = dict(file)
    with np.load(written.file("_expected.npz")) as file:
        expected = dict(file)
    with np.load(written.file("_profile.npz")) as file:
        profile = dict(file)
    doppler_hz = 1000 / 15 * np.arange(-7, 8)
    for arrays in (rd_map, expected):
        np.testing.assert_allclose(arrays["doppler_hz"], doppler_hz)
        np.testing.assert_allclose(np.diff(arrays["range_m"]), u.CELL_M / 2)
    np.testing.assert_allclose(rd_map["velocity_mps"], -u.WAVELENGTH_M / 2 * doppler_hz)
    assert rd_map["power"].shape == (2, 15, 501)
    assert profile["coherent_power"].shape == (2, 501)
    for echo in u.ECHOES:
        row = 7 - echo.rate_cells
        column = 2 * echo.cell
        for channel in (0, 1):
            level_db = 10 * math.log10(rd_map["power"][channel, row, column])
            assert level_db == pytest.approx(coherent_db(echo), abs=0.1)
        assert expected["map"][row, column] == pytest.approx(GAIN * echo.power_w, rel=1e-3)
        assert expected["profile"][column] == pytest.approx(GAIN * echo.power_w, rel=1e-3)
        own = written.result.budget.objects[u.ECHOES.index(echo)].power_error_w
        assert expected["profile_error"][column] == pytest.approx(own, rel=0.6)
        fine = int(np.argmin(np.abs(profile["range_m"] - echo.range_m)))
        assert profile["expected_power"][fine] == pytest.approx(GAIN * echo.power_w, rel=1e-3)
        near = slice(column - 2, column + 3)
        for power in profile["coherent_power"]:
            peak = int(power[near].argmax()) + column - 2
            assert abs(peak - column) <= 1
            assert 10 * math.log10(power[column]) == pytest.approx(coherent_db(echo), abs=0.1)
    assert expected["gaps_from_m"] == math.inf


def test_detections(written: Written) -> None:
    """CSV, JSON and HDF5 hold the same; the first three are the echoes."""
    import h5py

    record = written.json("_detections.json")
    targets = record["targets"]
    with open(written.file("_detections.csv"), encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(targets) >= 3
    docs = (Path(__file__).parents[3] / "docs/detection.md").read_text(encoding="utf-8")
    listed = docs.split("`_detections.csv`, `_detections.json`: ")[1].split("- `.h5`")[0]
    columns_said = re.sub(r"\([^)]*\)", "", listed).rstrip().rstrip(".").split(",")
    assert [*rows[0]] == [name.strip() for name in columns_said]
    with h5py.File(written.file(".h5")) as file:
        columns = {name: file[f"detections/{name}"][:] for name in targets[0]}
        attributes = dict(file["detections"].attrs)
    for number, (row, target) in enumerate(zip(rows, targets, strict=True)):
        assert row["name"] == target["name"] == columns["name"][number].decode()
        for name, value in target.items():
            if name == "name":
                continue
            told = math.nan if value is None else float(value)
            assert float(row[name] or "nan") == pytest.approx(told, nan_ok=True), name
            assert columns[name][number] == pytest.approx(told, nan_ok=True), name
    assert (record["cfar"]["guard"], record["cfar"]["train"]) == ([2, 4], [2, 6])
    assert attributes["cfar_guard"].tolist() == [2, 4]
    assert attributes["cfar_train"].tolist() == [2, 6]
    assert attributes["cfar_pfa"] == record["cfar"]["pfa"] == 1e-9
    assert attributes["cells_above_threshold"] == record["cells"]
    assert attributes["independent_training_cells"] == record["independent_cells"]
    noise_db = 10 * math.log10(NOISE_CELL_W)
    for target, echo in zip(targets, u.ECHOES, strict=False):
        assert target["name"] == echo.name
        assert target["range_m"] == pytest.approx(echo.range_m, abs=0.25)
        assert target["velocity_mps"] == pytest.approx(echo.rate_mps, abs=0.02)
        assert target["doppler_hz"] == pytest.approx(-2 * echo.rate_mps / u.WAVELENGTH_M, abs=1)
        assert target["level_db"] == pytest.approx(coherent_db(echo), abs=0.1)
        assert target["noise_db"] == pytest.approx(noise_db, abs=0.01)
        assert target["snr_db"] == pytest.approx(target["level_db"] - target["noise_db"])
        assert target["row"] == 7 - echo.rate_cells
        assert abs(target["col"] - 2 * echo.cell) <= 1


def test_hdf5(written: Written) -> None:
    import h5py

    with h5py.File(written.file(".h5")) as file, np.load(written.file("_map.npz")) as rd_map:
        assert (file.attrs["frame"], file.attrs["time_s"]) == (FRAME, TIME_S)
        assert (file.attrs["prf_hz"], file.attrs["pulses"]) == (1000.0, 15)
        assert json.loads(file.attrs["options"])["range_taper"] == "hann"
        codes = [item["code"] for item in json.loads(file.attrs["findings"])]
        assert codes == [item["code"] for item in written.json("_summary.json")["findings"]]
        assert file["channels/start_offset_s"][:].tolist() == [0, 2e-4]
        assert file["channels/number"][:].tolist() == [0, 1]
        axes = {
            "echoes/samples": ["/channels/number", "/echoes/slow_time_s", "/echoes/fast_time_s"],
            "map/values": ["/channels/number", "/map/doppler_hz", "/map/range_m"],
            "profile/expected_power": ["/profile/range_m"],
            "profile/coherent_power": ["/channels/number", "/profile/coherent_range_m"],
            "uncertainty/map": ["/uncertainty/doppler_hz", "/uncertainty/range_m"],
            "uncertainty/profile_error": ["/uncertainty/range_m"],
        }
        for name, scales in axes.items():
            data = file[name]
            assert [dim[0].name for dim in data.dims] == scales, name
            assert data.shape == tuple(file[scale].size for scale in scales), name
        assert (file["map"].attrs["range_taper"], file["map"].attrs["doppler_taper"]) == (
            "hann", "hamming",
        )  # fmt: skip
        assert file["profile"].attrs["range_taper"] == "hann"
        np.testing.assert_allclose(np.abs(file["map/values"][:]) ** 2, rd_map["power"])
        for name in ("doppler_hz", "velocity_mps", "range_m"):
            np.testing.assert_array_equal(file[f"map/{name}"][:], rd_map[name])
        with np.load(written.file("_expected.npz")) as expected:
            for name in ("range_m", "doppler_hz", "profile", "profile_error", "map", "map_error"):
                np.testing.assert_array_equal(file[f"uncertainty/{name}"][:], expected[name])
        with np.load(written.file("_profile.npz")) as profile:
            for name in ("range_m", "expected_power", "coherent_range_m", "coherent_power"):
                np.testing.assert_array_equal(file[f"profile/{name}"][:], profile[name])
        np.testing.assert_allclose(np.diff(file["echoes/fast_time_s"][:]), 0.5e-6)
        np.testing.assert_allclose(np.diff(file["echoes/slow_time_s"][:]), 1e-3)
        steps = file["echoes/samples"][:].real / STEP
        np.testing.assert_allclose(2 * steps, np.rint(2 * steps), atol=1e-5)
        assert file["echoes"].attrs["noise_power_w"] == pytest.approx(NOISE_W, rel=1e-6)
        assert file["echoes"].attrs["adc_step"] == pytest.approx(STEP)
        assert file["echoes"].attrs["clipped"] == 0


def test_places_of_the_channels(tmp_path: Path) -> None:
    import h5py

    places = {"transmitter": [[0.01, 0, 0], [0.03, 0, 0]], "receiver": [[0, 0.02, 0], [0, 0, 0.04]]}
    channels = tuple(
        Channel(tx=Element(position_m=tuple(tx)), rx=Element(position_m=tuple(rx)))
        for tx, rx in zip(*places.values(), strict=True)
    )
    still = u.write_run(tmp_path / "run", moving=False)
    radar = Radar(u.FMCW.waveform, u.FMCW.burst, channels)
    options = dataclasses.replace(OPTIONS, radar=radar, cfar=None)
    list(process_run(still, options, out=tmp_path))
    with h5py.File(tmp_path / "frame_0001.h5") as file:
        for name, expected in places.items():
            assert file[f"channels/{name}_position_m"][:].tolist() == expected, name


def test_a_frame_that_is_there_is_kept(written: Written) -> None:
    """The result, its summary and a second processing agree on what it was made of."""
    mark = written.json("_summary.json")["fingerprint"]
    assert len(mark) == 64 and written.result.fingerprint == mark
    (event,) = process_run(written.run, OPTIONS, out=written.folder, resume=True)
    assert isinstance(event, Progress) and event.kept is not None
    assert event.text == "frame 3 kept"
