# SPDX-License-Identifier: GPL-3.0-or-later
"""Other waveforms, receivers and detectors on a finished run; HDF5, SigMF and their conventions."""

import dataclasses
import importlib.util
import json
import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError, MissingDependencyError
from radarsim_addon.signal import (
    Burst,
    Cfar,
    FmcwWaveform,
    FrameResult,
    PhaseNoise,
    PmcwWaveform,
    ProcessOptions,
    Radar,
    Receiver,
    SteppedWaveform,
    Waveform,
    process_run,
    waveform_to_dict,
)
from radarsim_addon.signal.maps import map_noise_gain
from radarsim_addon.signal.pipeline import main
from radarsim_addon.signal.products.frame_products import write_hdf5
from tests.signal.synthetic import Setup, points, write_run

SETUP = Setup(rings=4, radar=Radar(Waveform(5.3e9, 50e6, 2.5e-6, 60e6), Burst(1000.0, 64)))
ECHOES = [(5, 6, 600.0, 5.0, 1e-6), *((2, c, 300.0, 0.0, 1e-5) for c in range(10))]
#: All of 5.3 GHz, reaching beyond the 1000 m of the rings, 1000 pulses a second.
OTHERS = [
    FmcwWaveform(5.3e9, 50e6, 512, 1e6),
    FmcwWaveform(5.3e9, 50e6, 1024, 2e6, real_adc=True),
    SteppedWaveform(5.3e9, 100e3, 512, 1.5e-6),
    PmcwWaveform(5.3e9, 20e-9, 9, code_repeats=8),
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_run(tmp_path / "Läufe é" / "Run 1", SETUP, points(SETUP, ECHOES))


def result_of(folder: Path, options: ProcessOptions) -> FrameResult:
    return next(e for e in process_run(folder, options) if isinstance(e, FrameResult))


@pytest.mark.parametrize("waveform", OTHERS, ids=["fmcw", "fmcw real", "stepped", "pmcw"])
def test_another_waveform_on_a_finished_run(folder: Path, waveform: object) -> None:
    own = result_of(folder, ProcessOptions(products=False, plots=False, speckle_seed=None))
    radar = Radar(waveform, Burst(1000.0, 64))
    other = result_of(
        folder, ProcessOptions(products=False, plots=False, speckle_seed=None, radar=radar)
    )
    summary = json.loads((folder / "products/frame_0001_summary.json").read_text("utf-8"))
    steps = {(step["motion"], step["transforms"]) for step in summary["synthesis"]["steps"]}
    assert ("still", 1) in steps and len(steps) == 2, "once for all that stands, and the target"
    assert summary["synthesis"]["error_estimate"] <= summary["synthesis"]["tolerance"] == 1e-6
    coupling_m = 0.0
    if isinstance(waveform, FmcwWaveform):
        coupling_m = 5.0 * waveform.carrier_hz / waveform.slope_hz_per_s
    if isinstance(waveform, SteppedWaveform):
        coupling_m = 5.0 * waveform.carrier_hz * waveform.step_time_s / waveform.step_hz
    # the wall and the target, no sidelobe
    assert sorted(round(edge.peak_range_m / 10) for edge in other.edges) == [30, 60]
    assert other.moving_targets[0].velocity_mps == pytest.approx(5.0, abs=0.02)
    assert other.moving_targets[0].range_m == pytest.approx(
        own.moving_targets[0].range_m + coupling_m, abs=0.05
    )
    assert other.moving_targets[0].level_db == pytest.approx(
        own.moving_targets[0].level_db, abs=0.05
    )


def test_receiver_and_detector_by_the_command_line(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    radar = {"waveform": waveform_to_dict(OTHERS[0]), "burst": {"pulses": 64, "prf_hz": 1000.0}}
    (tmp_path / "radar.json").write_text(json.dumps(radar))
    (tmp_path / "lo.csv").write_text("offset_hz,level_dbc_hz\n1e3,-90\n1e5,-110\n")
    code = main([
        "process", str(folder), "--waveform", str(tmp_path / "radar.json"),
        "--noise-figure-db", "3",
        "--adc-bits", "12", "--phase-noise", str(tmp_path / "lo.csv"), "--cfar", "os",
        "--pfa", "1e-6", "--hdf5", "--sigmf", "--no-plots", "--no-products",
    ])  # fmt: skip
    assert code == 0
    assert "targets" in capsys.readouterr().out
    place = folder / "products"
    summary = json.loads((place / "frame_0001_summary.json").read_text("utf-8"))
    assert summary["waveform"]["kind"] == "fmcw"
    assert summary["options"]["receiver"]["adc_bits"] == 12
    assert summary["receiver"]["noise_power_w"] == pytest.approx(1.380649e-23 * 290 * 10**0.3 * 1e6)
    found = json.loads((place / "frame_0001_detections.json").read_text("utf-8"))["targets"]
    near = [t for t in found if abs(t["velocity_mps"] - 5.0) < 0.1]
    # the first is the target; far below it its sidelobes, which a detector finds as well
    assert abs(near[0]["range_m"] - 600.4) < 0.2
    assert all(t["level_db"] < near[0]["level_db"] - 35 for t in near[1:])
    still = [t for t in found if abs(t["range_m"] - 300) < 1 and abs(t["velocity_mps"]) < 0.1]
    assert len(still) >= 1


def test_noise_alone_has_no_moving_targets(tmp_path: Path) -> None:
    far = write_run(tmp_path / "run", SETUP, points(SETUP, [(2, 3, 300.0, 0.0, 1e-12)]))
    noisy = ProcessOptions(
        products=False, plots=False, cfar=Cfar(pfa=1e-7), receiver=Receiver(noise_figure_db=60.0)
    )
    result = result_of(far, noisy)
    assert result.received.noise_power_w > 0
    assert result.moving_targets == []


def test_snr_is_over_the_noise_of_the_run(folder: Path) -> None:
    """But for phase noise, which lies around strong echoes and has no level of its own."""
    noisy = ProcessOptions(
        products=False, plots=False, cfar=Cfar(), receiver=Receiver(noise_figure_db=3.0)
    )
    result = result_of(folder, noisy)
    gain = map_noise_gain(result.rd_map.radar, noisy.range_taper, noisy.doppler_taper)
    level_db = 10 * math.log10(result.received.noise_power_w * gain)
    assert result.detections is not None
    assert len(result.detections.targets) > 1
    for target in result.detections.targets:
        assert target.noise_db == pytest.approx(level_db)
        assert target.snr_db == target.level_db - target.noise_db
    silent = result_of(folder, dataclasses.replace(noisy, receiver=Receiver()))
    assert silent.detections is not None
    assert all(t.noise_db == t.surroundings_db for t in silent.detections.targets)


def test_mti_takes_out_the_wall(folder: Path) -> None:
    options = ProcessOptions(products=False, plots=False, mti=3, cfar=Cfar("ca", 1e-6))
    result = result_of(folder, options)
    assert result.rd_map.plane.shape[0] == 62
    assert result.detections is not None
    assert abs(result.detections.targets[0].velocity_mps - 5.0) < 0.05
    stripe = result.rd_map.plane_power[31]
    assert stripe[np.argmin(np.abs(result.rd_map.range_m - 300))] < 1e-12 * stripe.size


def test_hdf5_says_what_it_holds(folder: Path) -> None:
    import h5py

    options = ProcessOptions(
        products=False, plots=False, hdf5=True, cfar=Cfar(), receiver=Receiver(noise_figure_db=3.0)
    )
    result = result_of(folder, options)
    with h5py.File(folder / "products/frame_0001.h5") as file:
        assert "receding" in file.attrs["sign_convention"]
        assert json.loads(file.attrs["waveform"])["carrier_hz"] == 5.3e9
        np.testing.assert_array_equal(file["echoes/samples"], result.echoes.samples)
        np.testing.assert_array_equal(file["map/values"], result.rd_map.values)
        assert file["map/values"].dims[2][0].name == "/map/range_m"
        assert file["map/velocity_mps"][0] > 0 > file["map/doppler_hz"][0]
        names: list[str] = []
        file.visititems(lambda name, item: names.append(name) if hasattr(item, "dims") else None)
        assert {"profile/expected_power", "detections/snr_db"} <= set(names)
        for name in names:
            assert file[name].attrs["units"], name
            assert file[name].attrs["description"], name
        assert file["echoes/samples"].attrs["units"] == "sqrt(W)"
        assert result.detections is not None
        assert len(file["detections/range_m"]) == len(result.detections.targets)


def test_an_hdf5_file_does_not_depend_on_when_its_objects_are_freed(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A profiler's thread, as that of Dask's workers, holds some of them for a while."""
    import h5py

    result = result_of(folder, ProcessOptions(products=False, plots=False, cfar=Cfar()))
    real = h5py.Group.create_dataset
    made: list[h5py.Dataset | None] = []
    contents = set()
    for held in range(-1, 30):
        made.clear()

        def create(group: h5py.Group, *a: object, held: int = held, **k: object) -> h5py.Dataset:
            data = real(group, *a, **k)
            made.append(data if len(made) == held or held == 29 else None)
            return data

        monkeypatch.setattr(h5py.Group, "create_dataset", create)
        (file,) = write_hdf5(result, tmp_path)
        contents.add(file.read_bytes())
    assert 10 < len(made) < 29
    assert len(contents) == 1


def test_hdf5_without_h5py_is_named(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    there = importlib.util.find_spec
    monkeypatch.setattr(
        "importlib.util.find_spec", lambda name: None if name == "h5py" else there(name)
    )
    with pytest.raises(MissingDependencyError, match="h5py is not installed"):
        result_of(folder, ProcessOptions(products=False, plots=False, hdf5=True))


@pytest.mark.parametrize("waveform", [SETUP.radar.waveform, OTHERS[1]], ids=["complex", "real"])
def test_sigmf_is_a_valid_recording(folder: Path, waveform: object) -> None:
    package = pytest.importorskip("sigmf")
    radar = Radar(waveform, Burst(1000.0, 64))
    result = result_of(folder, ProcessOptions(products=False, plots=False, sigmf=True, radar=radar))
    recording = package.sigmffile.fromfile(str(folder / "products/frame_0001"))
    recording.validate()
    shape = result.echoes.plane.shape
    assert recording.sample_count == shape[0] * shape[1]
    samples = recording.read_samples().reshape(shape)
    scale = np.abs(result.echoes.plane).max()
    np.testing.assert_allclose(samples, result.echoes.plane, atol=1e-7 * scale)
    assert recording.get_captures()[0]["core:frequency"] == 5.3e9
    assert len(recording.get_annotations()) == 64
    meta = json.loads((folder / "products/frame_0001.sigmf-meta").read_text("utf-8"))
    assert meta["global"]["radarsim:prf_hz"] == 1000.0


def test_phase_noise_of_the_run_is_the_seeds(folder: Path) -> None:
    samples = []
    for seed in (1, 1, 2):
        receiver = Receiver(phase_noise=PhaseNoise((1e2, 1e4), (-60.0, -60.0)), noise_seed=seed)
        options = ProcessOptions(products=False, plots=False, receiver=receiver)
        samples.append(result_of(folder, options).echoes.plane)
    np.testing.assert_array_equal(samples[0], samples[1])
    assert np.abs(samples[0] - samples[2]).max() > 1e-3 * np.abs(samples[0]).max()


def test_what_does_not_fit_is_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ConfigError, match="noise of the link budget"):
        result_of(folder, ProcessOptions(thermal_noise=True))
    with pytest.raises(ConfigError, match="MTI canceller"):
        result_of(folder, ProcessOptions(mti=4))
    assert main(["process", str(folder), "--waveform", "nowhere.json"]) == 1
    assert "FrameFileError" in capsys.readouterr().err
    with pytest.raises(SystemExit, match="2"):
        main(["process", str(folder), "--cfar", "ca", "--pfa", "2"])


def test_carrier_and_window_that_differ_are_mentioned(folder: Path) -> None:
    radar = Radar(FmcwWaveform(77e9, 1e9, 256, 10e6), Burst(1000.0, 16))
    result = result_of(folder, ProcessOptions(products=False, plots=False, radar=radar))
    found = {item.code: item.numbers for item in result.findings}
    assert found["carrier-differs-from-run"] == {"carrier_hz": 77e9, "run_carrier_hz": 5.3e9}
    assert found["range-limits-beyond-sampled-band"]["range_limit_m"] == 1000.0
    assert "paths-beyond-sampled-band" in found
    stepped = Radar(SteppedWaveform(5.3e9, 1e6, 16, 1e-6), Burst(1000.0, 16))
    other = result_of(folder, ProcessOptions(products=False, plots=False, radar=stepped))
    (item,) = (one for one in other.findings if one.code.startswith("range-limits-beyond"))
    assert item.code == "range-limits-beyond-unambiguous-range"
    assert item.numbers["unambiguous_range_m"] == pytest.approx(299792458.0 / 2e6)


def test_axes_of_all_files_are_numbers_worked_out_by_hand(folder: Path) -> None:
    """A wall at 300 m, a target at 600 m that recedes by 5 m/s: 1 kHz, 64 pulses, 60 MHz, 5.3 GHz.

    Velocities have steps of 1000/64 Hz times half of 56.56 mm, ranges of c / (4 x 60 MHz).
    """
    import h5py

    options = ProcessOptions(
        plots=False, hdf5=True, sigmf=True, cfar=Cfar(), speckle_seed=None, doppler_taper="none"
    )
    result_of(folder, options)
    products, c_mps = folder / "products", 299_792_458.0
    doppler_hz, wavelength_m = (np.arange(64) - 32) * 1000 / 64, c_mps / 5.3e9
    with (
        h5py.File(products / "frame_0001.h5") as file,
        np.load(products / "frame_0001_map.npz") as arrays,
    ):
        for axes, power in (
            (file["map"], np.abs(file["map/values"][0]) ** 2),
            (arrays, arrays["power"][0]),
        ):
            np.testing.assert_allclose(axes["doppler_hz"][:], doppler_hz, atol=1e-9)
            rates_mps = -doppler_hz * wavelength_m / 2
            np.testing.assert_allclose(axes["velocity_mps"][:], rates_mps, atol=1e-9)
            steps_m = np.diff(axes["range_m"][:])
            np.testing.assert_allclose(steps_m, c_mps / 4 / 60e6, rtol=1e-9)
            far = axes["range_m"][:] > 450
            row, column = np.unravel_index(np.argmax(power * far), power.shape)
            assert axes["range_m"][column] == pytest.approx(600.0, abs=1.3)
            assert axes["velocity_mps"][row] == pytest.approx(5.0, abs=0.23)
        echoes = file["echoes"]
        samples = echoes["samples"]
        for number, name in enumerate(("/channels/number", "slow_time_s", "fast_time_s")):
            scale = samples.dims[number][0]
            assert scale.name.endswith(name) and scale.shape == (samples.shape[number],)
        np.testing.assert_allclose(echoes["slow_time_s"][:], np.arange(64) / 1000, atol=1e-12)
        np.testing.assert_allclose(np.diff(echoes["fast_time_s"][:]), 1 / 60e6, rtol=1e-6)
        energy = (np.abs(samples[0]) ** 2).sum(axis=0)  # a pulse is symmetric about its middle
        assert echoes["fast_time_s"][:] @ energy / energy.sum() == pytest.approx(
            2 * 300.0 / c_mps, abs=2e-8
        )
        units = {name: echoes[name].attrs["units"] for name in ("slow_time_s", "fast_time_s")}
        assert set(units.values()) == {"s"}
        shape = samples.shape
    meta = json.loads((products / "frame_0001.sigmf-meta").read_text("utf-8"))
    assert meta["global"]["core:sample_rate"] == 60e6
    starts = [(a["core:sample_start"], a["radarsim:slow_time_s"]) for a in meta["annotations"]]
    assert starts == [(k * shape[2], pytest.approx(k / 1000)) for k in range(64)]
    raw = np.fromfile(products / "frame_0001.sigmf-data", "<c8").reshape(shape[1:])
    energy = (np.abs(raw) ** 2).sum(axis=0)
    first_s = meta["global"]["radarsim:first_sample_s"]
    middle_s = first_s + np.arange(shape[2]) @ energy / energy.sum() / 60e6
    assert middle_s == pytest.approx(2 * 300.0 / c_mps, abs=2e-8)
