# SPDX-License-Identifier: GPL-3.0-or-later
"""Each option of processing reaches what it is for: hand-worked numbers of unequal echoes."""

from __future__ import annotations

import dataclasses
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon.contract import (
    GROUND_TRUTH_FILE,
    AntennaRecord,
    GroundTruthRecord,
    LinkBudget,
    ObjectRecord,
    frame_dir,
)
from radarsim_addon.errors import ConfigError
from radarsim_addon.signal import (
    Burst,
    Cfar,
    FmcwWaveform,
    FrameResult,
    PmcwWaveform,
    ProcessOptions,
    Radar,
    RangeDopplerMap,
    Receiver,
    SpectrogramOptions,
    open_run,
    process_frame,
    process_run,
)
from radarsim_addon.signal.radar import Weather
from radarsim_addon.typed_json import write_record
from tests.signal import synthetic
from tests.signal import unequal as u

MAST, BOAT, AIRCRAFT = u.ECHOES
BASE = ProcessOptions(radar=u.FMCW, range_taper="none", doppler_taper="none", speckle_seed=None)
#: Receiver gain apart, nothing in it is like anything else.
BUDGET = LinkBudget(
    100.0, AntennaRecord("isotropic", {"gain_dbi": 20.0}),
    AntennaRecord("isotropic", {"gain_dbi": 13.0}), transmit_loss_db=1.0, receive_loss_db=2.0,
    other_loss_db=0.5, noise_figure_db=4.0, antenna_temperature_k=150.0,
)  # fmt: skip
BUDGET_GAIN = 100 * 10 ** ((20 + 13 - 3.5) / 10) / u.EIRP_W
#: k (T_a + (F - 1) T_0) fs of a sample; 251 samples and 15 pulses add up.
BUDGET_NOISE_W = 1.380649e-23 * (150 + (10**0.4 - 1) * 290) * 2e6


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return u.write_run(tmp_path_factory.mktemp("unequal") / "run")


@pytest.fixture(scope="module")
def base(run: Path) -> FrameResult:
    return processed(run)


def processed(run: Path, **changes: Any) -> FrameResult:
    opened = open_run(run)
    options = dataclasses.replace(BASE, **changes).for_run(opened)
    return process_frame(options.open(opened.frame(1)), options)


def cell(rd_map: RangeDopplerMap, echo: u.Echo) -> tuple[int, int]:
    """Row and column of an echo in a map."""
    rows_hz = rd_map.doppler_hz + 2 * echo.rate_mps / rd_map.radar.waveform.wavelength_m
    return int(np.argmin(np.abs(rows_hz))), column_of(rd_map, echo)


def column_of(holder: Any, echo: u.Echo) -> int:
    """Column of an echo in a profile."""
    return int(np.argmin(np.abs(holder.range_m - echo.range_m)))


def coherent_w(echo: u.Echo) -> float:
    """Power of both rows in phase."""
    return sum(math.sqrt(power_w) for power_w in echo.powers_w) ** 2


def powers(result: FrameResult) -> dict[str, float]:
    """Every number of a result that is power in watts, once for each way to it."""
    expected, rd_map = result.expected, result.rd_map
    assert expected is not None
    row, column = cell(rd_map, BOAT)
    fine = column_of(result.profile, BOAT)
    found = {
        "statistics": result.statistics.power_w,
        "budget": result.budget.received_w,
        "profile": result.profile.power[fine],
        "compressed": result.compressed.mean_power[0, column_of(result.compressed, MAST)],
        "map": rd_map.power[0, row, column],
        "expected profile": expected.profile[column],
        "expected map": expected.map[row, column],
        "its error": expected.map_error[row, column],
        "edge": 10 ** (result.edges[1].level_db / 10),
    }
    for echo in result.budget.objects:
        found[f"power of {echo.name}"] = echo.power_w
        found[f"error of {echo.name}"] = echo.power_error_w
    return found


def test_powers_of_the_frame_as_it_is(base: FrameResult) -> None:
    """All that follows is relative to these."""
    found = powers(base)
    for name in ("statistics", "budget"):
        assert found[name] == pytest.approx(8.2e-11), name
    for name in ("profile", "expected profile", "expected map", "power of Boat", "edge"):
        assert found[name] == pytest.approx(BOAT.power_w, rel=1e-6), name
    # an FMCW shows the boat a 26th of a cell nearer
    assert found["map"] == pytest.approx(coherent_w(BOAT), rel=1e-2)
    assert found["compressed"] == pytest.approx(coherent_w(MAST), rel=1e-4)
    assert [edge.peak_range_m for edge in base.edges] == pytest.approx(
        [MAST.range_m, BOAT.range_m, AIRCRAFT.range_m], abs=1e-6
    )
    assert [echo.name for echo in base.budget.objects] == ["Mast", "Boat", "Aircraft"]
    for echo, known in zip(base.budget.objects, u.ECHOES, strict=True):
        assert echo.paths == 2 and echo.multi_object_power_w == 0
        assert echo.power_w == pytest.approx(known.power_w)
        assert echo.rcs_m2 == pytest.approx(known.rcs_m2, rel=1e-9)
        assert echo.range_m == pytest.approx(known.range_m)
        assert echo.range_rate_mps == pytest.approx(known.rate_mps)
        # all rows of an object are in one place
        ratio = echo.rcs_error_m2 / echo.power_error_w
        assert ratio == pytest.approx(known.rcs_m2 / known.power_w, rel=1e-9)
        # half the difference of the replicates, each of them twice its row
        assert echo.power_error_w >= abs(np.subtract(*known.powers_w)) * (1 - 1e-9)
    assert base.budget.objects[0].power_error_w == pytest.approx(3e-11)
    assert base.statistics.counts.paths == 6
    assert base.statistics.nearest_m == pytest.approx(MAST.range_m)
    assert base.statistics.farthest_m == pytest.approx(AIRCRAFT.range_m)
    assert base.statistics.fastest_mps == pytest.approx(-AIRCRAFT.rate_mps)


@pytest.mark.parametrize(
    ("changes", "gain"),
    [
        ({"receive_antenna_gain_dbi": 7.0}, 10**0.7),
        ({"link_budget": BUDGET}, BUDGET_GAIN),
        # the effective area of an antenna is lambda^2 / 4 pi
        ({"radar": Radar(FmcwWaveform(10.6e9, 50e6, 251, 2e6), Burst(2000.0, 15))}, 0.25),
    ],
    ids=["receiver gain", "link budget", "carrier"],
)
def test_gain_is_in_all_powers(
    run: Path, base: FrameResult, changes: dict[str, Any], gain: float
) -> None:
    result = processed(run, **changes)
    before = powers(base)
    for name, power_w in powers(result).items():
        assert power_w == pytest.approx(gain * before[name], rel=6e-3), name
    for echo, was in zip(result.budget.objects, base.budget.objects, strict=True):
        assert echo.rcs_m2 == pytest.approx(was.rcs_m2, rel=1e-9)
        assert echo.rcs_error_m2 == pytest.approx(was.rcs_error_m2, rel=1e-9)


@pytest.mark.parametrize(
    ("weather", "db_per_km"),
    [
        # k R^alpha with k and alpha of ITU-R P.838-3, table 5, at 10 GHz
        (Weather(50.0, rain_polarisation="horizontal"), 0.01217 * 50**1.2571),
        (Weather(50.0, rain_polarisation="vertical"), 0.01129 * 50**1.2156),
    ],
    ids=["horizontal", "vertical"],
)
def test_rain_takes_its_part_of_each_path(run: Path, weather: Weather, db_per_km: float) -> None:
    radar = Radar(FmcwWaveform(10e9, 50e6, 251, 2e6), u.FMCW.burst)
    dry, wet = (processed(run, radar=radar, weather=one) for one in (None, weather))
    for echo, was in zip(wet.budget.objects, dry.budget.objects, strict=True):
        lost_db = 10 * math.log10(was.power_w / echo.power_w)
        assert lost_db == pytest.approx(2e-3 * was.range_m * db_per_km, rel=2e-3)
    lost_w = sum(one.power_w for one in wet.budget.objects)
    assert wet.statistics.power_w == pytest.approx(lost_w, rel=1e-9)
    codes = {item.code: item.numbers for item in wet.findings}
    assert codes["weather-attenuates"]["attenuation_db_per_km"] == pytest.approx(
        db_per_km, rel=2e-3
    )
    assert codes["rain-echo-left-out"]["rain_mm_per_h"] == 50.0


@pytest.mark.parametrize(("ranges", "doppler"), [("hann", "none"), ("none", "hann")])
def test_tapers_are_along_their_own_axis(run: Path, ranges: str, doppler: str) -> None:
    """Hann's window brings a quarter of the power into both neighbours, no window nothing."""
    result = processed(run, range_taper=ranges, doppler_taper=doppler)
    rd_map, expected = result.rd_map, result.expected
    assert expected is not None
    row, column = cell(rd_map, MAST)
    step = round(u.CELL_M / (rd_map.range_m[1] - rd_map.range_m[0]))
    assert step * (rd_map.range_m[1] - rd_map.range_m[0]) == pytest.approx(u.CELL_M)
    across, along = (0.25 * (taper == "hann") for taper in (ranges, doppler))
    for power in (rd_map.plane_power, expected.map):
        here = power[row, column]
        for sign in (-1, 1):
            assert power[row, column + sign * step] / here == pytest.approx(across, abs=1e-4)
            assert power[row + sign, column] / here == pytest.approx(along, abs=1e-4)
    for holder, power in ((result.profile, result.profile.power), (expected, expected.profile)):
        middle = column_of(holder, MAST)
        away = round(u.CELL_M / (holder.range_m[1] - holder.range_m[0]))
        neighbours = power[[middle - away, middle + away]] / power[middle]
        np.testing.assert_allclose(neighbours, across, atol=1e-4)
    assert (rd_map.range_taper, rd_map.doppler_taper) == (ranges, doppler)
    assert (result.profile.range_taper, result.compressed.range_taper) == (ranges, ranges)
    # a Hann window has a noise bandwidth of 1.5 cells
    noise = processed(run, link_budget=BUDGET, range_taper=ranges, doppler_taper=doppler)
    lost_db = [one.burst_db for one in noise.budget.snr.values()]
    assert lost_db[0] == pytest.approx(
        10 * math.log10(MAST.power_w * BUDGET_GAIN * 251 * 15 / 1.5 / BUDGET_NOISE_W), abs=0.05
    )


@pytest.mark.parametrize(
    ("options", "noise_w"),
    [
        ({"link_budget": BUDGET, "thermal_noise": True}, BUDGET_NOISE_W),
        (
            {"receiver": Receiver(noise_figure_db=3.0, antenna_temperature_k=90.0)},
            1.380649e-23 * (90 + (10**0.3 - 1) * 290) * 2e6,
        ),
    ],
    ids=["link budget", "receiver"],
)
def test_noise_is_in_samples_profile_and_map(
    run: Path, options: dict[str, Any], noise_w: float
) -> None:
    quiet = processed(run, link_budget=options.get("link_budget"))
    result = processed(run, **options)
    assert result.received.noise_power_w == pytest.approx(noise_w, rel=1e-6)
    assert result.profile_noise_power == pytest.approx(noise_w / 251, rel=1e-6)
    assert result.map_noise_power == pytest.approx(noise_w / 251 / 15, rel=1e-6)
    for name, noise in (("echoes", noise_w), ("rd_map", noise_w / 251 / 15)):
        field = "samples" if name == "echoes" else "values"
        added = getattr(getattr(result, name), field) - getattr(getattr(quiet, name), field)
        assert np.mean(np.abs(added) ** 2) == pytest.approx(noise, rel=0.1), name
    if "link_budget" in options:
        assert result.noise_of_budget == pytest.approx((result.budget.noise_w or 0.0) / 251 / 15)
        for echo in u.ECHOES:
            ratio = echo.power_w * BUDGET_GAIN / noise_w
            snr = result.budget.snr[echo.name]
            for found, gain in (
                (snr.single_sample_db, 1), (snr.single_pulse_db, 251), (snr.burst_db, 251 * 15),
            ):  # fmt: skip
                assert found == pytest.approx(10 * math.log10(ratio * gain), abs=1e-6)
    else:
        assert result.budget.noise_w is None and result.budget.snr == {}


def test_adc_bits_and_full_scale(run: Path) -> None:
    """Steps of 2 A / 2^6; the strongest samples clip."""
    full = 1e-5
    result = processed(run, receiver=Receiver(adc_bits=6, adc_full_scale=full))
    assert result.received.full_scale == full
    assert result.received.step == pytest.approx(2 * full / 64)
    assert result.map_noise_power == pytest.approx((2 * full / 64) ** 2 / 6 / 251 / 15)
    steps = np.concatenate([result.echoes.plane.real, result.echoes.plane.imag]) / (2 * full / 64)
    halves = 2 * steps
    np.testing.assert_allclose(halves, np.rint(halves), atol=1e-6)
    assert 0 < result.received.clipped < steps.size
    (found,) = (item for item in result.findings if item.code == "adc-clipped")
    assert found.numbers == {"count": result.received.clipped, "samples": 251 * 15}


def test_a_canceller_passes_what_moves(run: Path, base: FrameResult) -> None:
    """Two pulses over the root of 2: 2 sin^2(pi f / PRF) of the power, 0 at rest."""
    result = processed(run, mti=2)
    assert result.rd_map.plane.shape[0] == 14 and result.mti == 2
    mean = result.rd_map.plane_power.sum(axis=0)
    for echo in u.ECHOES[1:]:
        column = cell(result.rd_map, echo)[1]
        gain = 2 * math.sin(math.pi * echo.rate_cells / 15) ** 2
        assert mean[column] == pytest.approx(gain * coherent_w(echo), rel=2e-2)
    assert mean[column_of(result.rd_map, MAST)] < 1e-6 * coherent_w(MAST)
    np.testing.assert_array_equal(result.echoes.samples, base.echoes.samples)


def test_parts_are_listed_by_themselves_where_asked(run: Path, tmp_path: Path) -> None:
    """The mast is a part of the boat, which keeps its own range rate."""
    copied = tmp_path / "run"
    shutil.copytree(run, copied)
    record = open_run(run).record
    objects = [
        ObjectRecord(echo.name, None, echo.range_m, None, part_of="Boat" if echo is MAST else "")
        for echo in u.ECHOES
    ]
    truth = GroundTruthRecord(1, 0.0, objects, record.fingerprint)
    write_record(copied / frame_dir(1) / GROUND_TRUTH_FILE, truth)
    whole = processed(copied).budget.objects
    assert [echo.name for echo in whole] == ["Boat", "Aircraft"]
    assert whole[0].power_w == pytest.approx(MAST.power_w + BOAT.power_w, rel=1e-9)
    assert whole[0].range_rate_mps == pytest.approx(BOAT.rate_mps)
    parts = processed(copied, parts=True).budget.objects
    assert [echo.name for echo in parts] == ["Mast", "Boat", "Aircraft"]


def test_speckle_and_its_cells(run: Path, base: FrameResult) -> None:
    row, column = cell(base.rd_map, MAST)
    still = base.rd_map.plane[row, column]
    assert abs(still) ** 2 == pytest.approx(coherent_w(MAST), rel=1e-3)
    first, again, other = (
        processed(run, speckle_seed=seed).rd_map.plane[row, column] for seed in (3, 3, 4)
    )
    assert first == again and abs(first - other) > 1e-3 * abs(first)
    assert abs(first - still) > 1e-3 * abs(first)
    for size_m in (0.7, 6.0):
        report = processed(run, speckle_seed=3, speckle_cell_size_m=size_m).speckle
        assert report is not None and report.cell_m == size_m


def test_range_limits_end_all_axes(run: Path) -> None:
    result = processed(run, range_limits_m=(150.0, 350.0), link_budget=BUDGET)
    for holder in (result.rd_map, result.profile, result.compressed, result.expected):
        assert holder is not None
        assert holder.range_m[0] == 150.0 and 348.0 < holder.range_m[-1] <= 350.0
    assert result.budget.excluded_reason == {"Aircraft": "outside the range limits"}
    assert sorted(result.budget.snr) == ["Boat", "Mast"]
    row, column = cell(result.rd_map, BOAT)
    here = result.rd_map.range_m[column]
    assert here == pytest.approx(BOAT.range_m, abs=0.76)
    strongest = result.rd_map.plane_power[row].argmax()
    assert abs(int(strongest) - column) <= 1
    beyond = processed(run, range_limits_m=(150.0, 760.0))
    (found,) = (i for i in beyond.findings if i.code == "range-limits-beyond-sampled-band")
    assert found.numbers["range_limit_m"] == 760.0
    assert found.numbers["unambiguous_range_m"] == pytest.approx(251 * u.CELL_M)


def test_radar_gives_the_axes(run: Path) -> None:
    """The run has 64 pulses at 1 kHz."""
    radar = Radar(FmcwWaveform(5.3e9, 50e6, 251, 2e6), Burst(800.0, 9))
    result = processed(run, radar=radar)
    assert result.echoes.samples.shape == (1, 9, 251)
    np.testing.assert_allclose(result.rd_map.doppler_hz, 800 / 9 * np.arange(-4, 5))
    np.testing.assert_allclose(
        result.rd_map.velocity_mps, -u.WAVELENGTH_M / 2 * 800 / 9 * np.arange(-4, 5)
    )
    own = processed(run, radar=None)
    assert own.rd_map.doppler_hz.size == 64
    assert own.echoes.radar.waveform.kind == "lfm"


def test_amplitudes_of_the_paper(run: Path) -> None:
    """B r^2 with the radiance B = 4 pi P / (lambda^2 Omega)."""
    result = processed(run, amplitude_model="paper")
    row, column = cell(result.rd_map, MAST)
    size = sum(4 * math.pi * p / u.WAVELENGTH_M**2 / 1e-6 * MAST.range_m**2 for p in MAST.powers_w)
    assert abs(result.rd_map.plane[row, column]) == pytest.approx(size, rel=1e-3)
    assert result.echoes.amplitude_model == "paper" and result.expected is None
    # without speckle powers add up
    sizes = [4 * math.pi * p / u.WAVELENGTH_M**2 / 1e-6 * MAST.range_m**2 for p in MAST.powers_w]
    power = result.profile.power[column_of(result.profile, MAST)]
    assert power == pytest.approx(sizes[0] ** 2 + sizes[1] ** 2, rel=1e-3)


def test_a_code_takes_no_taper_along_range(run: Path) -> None:
    """PMCW has its own sidelobes: Hann's window along range costs nothing, along Doppler 1.5."""
    waveform = PmcwWaveform(5.3e9, 20e-9, 9, code_repeats=3)
    noise_w = BUDGET_NOISE_W / 2e6 * waveform.sampling_rate_hz
    for ranges, doppler, loss in (("hann", "none", 1.0), ("none", "hann", 1.5)):
        result = processed(
            run, radar=Radar(waveform, u.FMCW.burst), range_taper=ranges, doppler_taper=doppler,
            link_budget=BUDGET, thermal_noise=True,
        )  # fmt: skip
        gain = 511 * 3 * 15 / loss
        ratio = MAST.power_w * BUDGET_GAIN / noise_w
        assert result.budget.snr["Mast"].burst_db == pytest.approx(
            10 * math.log10(gain * ratio), abs=0.01
        )
        assert result.map_noise_power == pytest.approx(noise_w / gain, rel=1e-3)
        assert result.noise_of_budget == pytest.approx(noise_w / gain, rel=1e-3)


def test_edges_that_are_not_listed_are_counted(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("radarsim_addon.signal.pipeline.frame.MAX_EDGES", 2)
    result = processed(run)
    assert (len(result.edges), result.edges_left_out) == (2, 1)
    assert [edge.peak_range_m for edge in result.edges] == pytest.approx(
        [MAST.range_m, BOAT.range_m]
    )


def test_engine_of_the_synthesis(run: Path) -> None:
    result = processed(
        run, nufft_backend="finufft", tolerance=1e-9, slow_time_transform="per-pulse"
    ).echoes.report
    assert result is not None
    assert (result.backend, result.tolerance) == ("finufft", 1e-9)
    assert (result.paths, result.pulses, result.frequencies) == (6, 15, 251)
    ways = {(step.motion, step.transform, step.paths, step.transforms) for step in result.steps}
    assert ways == {("still", "once", 2, 1), ("linear", "pulse by pulse", 4, 15)}


def test_the_detector_is_the_one_that_was_chosen(run: Path) -> None:
    cfar = Cfar("ca", 1e-9, guard=(2, 5), train=(2, 6))
    found = processed(run, cfar=cfar, receiver=Receiver(noise_figure_db=50.0)).detections
    assert found is not None and found.cfar == cfar
    assert found.left_out == 0
    by_level = sorted(u.ECHOES, key=coherent_w, reverse=True)
    for target, echo in zip(found.targets, by_level, strict=False):
        assert target.range_m == pytest.approx(echo.range_m, abs=0.5)
        assert target.velocity_mps == pytest.approx(echo.rate_mps, abs=0.1)
        assert target.doppler_hz == pytest.approx(-2 * target.velocity_mps / u.WAVELENGTH_M)
        assert target.level_db == pytest.approx(10 * math.log10(coherent_w(echo)), abs=1.0)
        # k T0 F fs over 251 samples and 15 pulses
        noise_db = 10 * math.log10(1.380649e-23 * 290 * 1e5 * 2e6 / 251 / 15)
        assert target.noise_db == pytest.approx(noise_db, abs=1e-3)
        assert target.snr_db == pytest.approx(target.level_db - noise_db, abs=1e-3)


@pytest.mark.parametrize(("name", "echo"), [("Air*", AIRCRAFT), ("Boat", BOAT)])
def test_a_spectrogram_of_some_pulses_and_an_object(run: Path, name: str, echo: u.Echo) -> None:
    """Windows of 5 pulses that overlap by 2: every 3 pulses a row of 5 Doppler cells of 200 Hz."""
    shown = processed(run, spectrogram=SpectrogramOptions(5, 0.4, object_name=name)).spectrogram
    assert shown is not None and shown.power.shape == (4, 5)
    np.testing.assert_allclose(shown.time_s, 2e-3 + 3e-3 * np.arange(4), atol=1e-3)
    np.testing.assert_allclose(shown.doppler_hz, 200.0 * np.arange(-2, 3), atol=1e-9)
    np.testing.assert_allclose(shown.velocity_mps, -u.WAVELENGTH_M / 2 * shown.doppler_hz)
    doppler_hz = -2 * echo.rate_mps / u.WAVELENGTH_M
    column = int(shown.power.sum(axis=0).argmax())
    assert abs(shown.doppler_hz[column] - doppler_hz) <= 100


@pytest.mark.parametrize(("taper", "share"), [("none", 0.950), ("hamming", 0.9996)])
def test_a_spectrogram_of_an_object_has_the_range_taper(
    run: Path, taper: str, share: float
) -> None:
    """Within two cells of a point are 95 % of a sinc's energy, and nearly all of Hamming's."""
    limits_m = MAST.range_m - 2 * u.CELL_M, MAST.range_m + 2 * u.CELL_M
    powers_w = [
        processed(
            run,
            range_taper=taper,
            spectrogram=SpectrogramOptions(5, 0.4, object_name="Mast", limits_m=limits),
        ).spectrogram.power.sum()
        for limits in (limits_m, None)
    ]
    assert powers_w[0] / powers_w[1] == pytest.approx(share, abs=0.01)


def test_a_limit_of_the_range_rate_is_that_between_snapshots(tmp_path: Path) -> None:
    setup = synthetic.Setup(rings=2, radar=u.FMCW)
    echoes = [(2, 3, 300.0, 6.0, 1e-6), (5, 6, 200.0, -2.0, 1e-6), (8, 8, 100.0, 0.0, 1e-6)]
    folder = synthetic.write_run(tmp_path / "run", setup, synthetic.points(setup, echoes))
    for limit_mps, rejected in ((10.0, 0), (4.0, 1), (1.0, 2)):
        found = processed(folder, max_range_rate_mps=limit_mps, radar=None).statistics
        assert found.counts.range_rate_rejected == rejected
        assert found.fastest_mps == pytest.approx({0: 6.0, 1: 2.0, 2: 0.0}[rejected], abs=0.05)


@pytest.mark.parametrize(
    ("changes", "more"),
    [
        ({}, []),
        ({"hdf5": True}, [".h5"]),
        ({"sigmf": True}, [".sigmf-data", ".sigmf-meta"]),
        (
            {"cfar": Cfar("ca", 1e-9), "receiver": Receiver(noise_figure_db=50.0)},
            ["_detections.csv", "_detections.json"],
        ),
        ({"spectrogram": SpectrogramOptions(5, 0.5)}, ["_spectrogram.npz"]),
        (
            {"plots": True, "animate": True, "animation_format": "gif", "link_budget": BUDGET},
            ["_echo.png", "_range_doppler.png", "_range_profile.png"],
        ),
    ],
    ids=["none", "hdf5", "sigmf", "cfar", "spectrogram", "pictures"],
)
def test_files_are_those_that_were_asked_for(
    run: Path, tmp_path: Path, changes: dict[str, Any], more: list[str]
) -> None:
    options = dataclasses.replace(BASE, **{"plots": False, "products": False} | changes)
    list(process_run(run, options, out=tmp_path))
    always = ["_expected.npz", "_map.npz", "_profile.npz", "_summary.json"]
    expected = [f"frame_0001{ending}" for ending in [*always, *more]]
    if changes.get("animate"):
        expected += ["antennas.png", "range_doppler.gif"]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(expected)


@pytest.mark.parametrize("changes", [{"parquet": True}, {"ros_bag": True}])
def test_files_of_an_array_need_one(run: Path, tmp_path: Path, changes: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="holds the targets of an array"):
        list(process_run(run, dataclasses.replace(BASE, **changes), out=tmp_path))


def test_no_option_is_without_a_test() -> None:
    """Every option is named in this file with a value of its own."""
    text = Path(__file__).read_text("utf-8")
    for field in dataclasses.fields(ProcessOptions):
        assert f"{field.name}=" in text or f'"{field.name}":' in text, field.name
