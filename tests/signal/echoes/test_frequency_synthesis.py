# SPDX-License-Identifier: GPL-3.0-or-later
"""FMCW, stepped frequency and PMCW through the engine: choices, errors, reports."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError, PathDataError
from radarsim_addon.findings import finding
from radarsim_addon.signal import (
    Burst,
    Echoes,
    FmcwWaveform,
    Paths,
    PhaseNoise,
    PmcwWaveform,
    Radar,
    SteppedWaveform,
    make_paths,
    synthesize,
)
from radarsim_addon.signal.echoes import line_times_s, synthesizer_for
from radarsim_addon.signal.radar import AnyWaveform, LineWaveform, range_limit
from radarsim_addon.signal.spectrum import FrequencyGrid, Ramp, ReceiveWindow, SpectrumAccumulator
from radarsim_addon.signal.spectrum.grid import nodes_for
from tests.signal.oracle import unit_paths
from tests.signal.spectrum_oracle import LIGHT, Function, relative

FMCW = FmcwWaveform(77e9, 1e9, 64, 5e6, adc_start_s=2e-6, idle_s=4e-6)
STEPPED = SteppedWaveform(10e9, 2e6, 48, 50e-6)
PMCW = PmcwWaveform(79e9, 1e-9, 6, code_repeats=3)
KINDS = pytest.mark.parametrize("waveform", [FMCW, STEPPED, PMCW], ids=lambda w: w.kind)


def radar_of(waveform: AnyWaveform, pulses: int) -> Radar:
    return Radar(waveform, Burst(1 / waveform.duration_s, pulses))


def truth(radar: Radar, lengths: Callable, amplitude: np.ndarray) -> np.ndarray:
    """Every sample at its own time of reception, in long double: f_k tau(t) - K tau^2 / 2."""
    waveform = radar.waveform
    assert isinstance(waveform, LineWaveform)
    k = np.arange(waveform.grid_count, dtype=np.longdouble)
    frequency = np.longdouble(waveform.carrier_hz) + (
        k - np.longdouble(waveform.grid_middle)
    ) * np.longdouble(waveform.grid_step_hz)
    within_s = np.longdouble(waveform.grid_start_s) + k * np.longdouble(waveform.grid_interval_s)
    slope = np.longdouble(waveform.slope_hz_per_s) if isinstance(waveform, FmcwWaveform) else 0
    rows = []
    for start_s in line_times_s(radar).astype(np.longdouble):
        delay = np.array([retarded_s(lengths, start_s + u) for u in within_s])
        cycles = frequency[:, None] * delay - slope * delay**2 / 2
        cycles -= np.rint(cycles)
        rows.append(np.exp(-2j * np.pi * cycles.astype(float)) @ amplitude)
    return np.array(rows)


def retarded_s(lengths: Callable, time_s: np.longdouble) -> np.ndarray:
    """Delays of what is received at a time and met half of them before."""
    delay = np.asarray(lengths(time_s)) / LIGHT
    for _ in range(3):  # each round gains six digits
        met = [np.asarray(lengths(time_s - d / 2))[..., i] for i, d in enumerate(delay)]
        delay = np.array(met) / LIGHT
    return delay


def code_truth(radar: Radar, length_m: np.ndarray, rate_mps: np.ndarray) -> np.ndarray:
    """Every sample of PMCW with the delay of its own time, at which the wave is half way back."""
    waveform = radar.waveform
    assert isinstance(waveform, PmcwWaveform)
    code = np.fft.fftshift(np.fft.fft(waveform.replica_samples()))
    sample = np.arange(code.size)
    k = sample - code.size // 2
    frequency = waveform.carrier_hz + k * np.longdouble(waveform.grid_step_hz)
    rows = []
    for start_s in line_times_s(radar).astype(np.longdouble):
        at_s = start_s + sample[:, None] / np.longdouble(waveform.sampling_rate_hz)
        delay = (length_m + rate_mps * at_s) / (LIGHT + rate_mps / np.longdouble(2))
        cycles = frequency[:, None] * delay[:, None, :]
        lines = np.exp(-2j * np.pi * (cycles - np.rint(cycles)).astype(float)).sum(axis=-1)
        turns = np.exp(2j * np.pi * np.outer(sample, k) / code.size)
        rows.append(np.mean(turns * code * lines, axis=1))
    return np.array(rows)


def many(radar: Radar, count: int = 40, seed: int = 0) -> tuple[Paths, np.ndarray, np.ndarray]:
    """Paths of amplitude 1 of which half stand; their lengths and rates of the length."""
    rng = np.random.default_rng(seed)
    range_m = rng.uniform(1, 0.9 * min(radar.waveform.unambiguous_range_m, 60.0), count)
    rate_mps = np.where(np.arange(count) % 2, rng.uniform(-20, 20, count), 0.0)
    return unit_paths(radar, list(range_m), list(rate_mps)), 2 * range_m, 2 * rate_mps


def ways(echoes: Echoes) -> set[tuple[str, str]]:
    assert echoes.report is not None
    return {(s.motion, s.transform) for s in echoes.report.steps}


@KINDS
@pytest.mark.parametrize("synthesis", ["auto", "type3", "per-pulse", "direct"])
def test_samples_are_within_the_tolerance(waveform, synthesis) -> None:
    radar = radar_of(waveform, 5)
    paths, length_m, rate_mps = many(radar)
    found = synthesize(
        paths,
        radar,
        range_limits_m=(0.0, 60.0),
        slow_time_transform=synthesis,
        tolerance=1e-7,
    )
    if isinstance(waveform, PmcwWaveform):
        expected = code_truth(radar, length_m, rate_mps)
    else:
        expected = truth(radar, lambda t: length_m + rate_mps * t, np.ones(len(paths)))
    assert relative(found.plane, expected) <= 1e-7
    report = found.report
    assert report is not None and report.tolerance == 1e-7
    assert report.paths == 40 and report.error_estimate <= 1e-7
    expected_way = "direct sum" if synthesis == "direct" else "once"
    assert ("still", expected_way) in ways(found)
    if synthesis == "type3":
        assert ("linear", "type 3") in ways(found)


@KINDS
def test_direct_agrees_with_auto_for_curved_motion(waveform) -> None:
    """Smooth and linear motion found by the engine, and motion of too few pulses to fit."""
    for pulses in (3, 40):
        radar = radar_of(waveform, pulses)
        paths, length_m, rate_mps = many(radar, 20)
        bend = np.where(np.arange(20) % 3, 0.0, 400.0)

        def lengths(t: float, length=length_m, rate=rate_mps, bend=bend) -> np.ndarray:
            return length + rate * t + bend * t**2

        motion = Function(lengths, (rate_mps != 0) | (bend != 0))
        known = dataclasses.replace(paths, motion=motion)
        range_limits_m = (0.0, 60.0)
        auto = synthesize(known, radar, range_limits_m=range_limits_m)
        direct = synthesize(
            known, radar, range_limits_m=range_limits_m, slow_time_transform="direct"
        )
        assert auto.report is not None and direct.report is not None
        # pulse by pulse, motion within a sweep is followed to the second order
        left_rad = direct.report.ramp_residual_phase_rad
        assert relative(auto.plane, direct.plane) <= 1e-6 + left_rad
        if not isinstance(waveform, PmcwWaveform):
            expected = truth(radar, lengths, np.ones(20))
            assert relative(auto.plane, expected) <= 1e-6 + (left_rad if pulses == 3 else 0.0)
        assert direct.report.backend == "direct" and direct.report.error_bound <= 1e-9
        motions = {step.motion for step in auto.report.steps}
        if pulses == 40:
            # a constant rate is of use to the 2-D transform alone
            assert motions == {"still", "smooth", "linear"}
            assert ("sampled", "direct sum") in ways(direct)
        else:
            assert motions == {"still", "sampled"}


def test_a_static_scene_needs_one_transform() -> None:
    radar = radar_of(FMCW, 256)
    rng = np.random.default_rng(5)
    paths = make_paths(np.ones(100_000), rng.uniform(2, 18, 100_000))
    found = synthesize(paths, radar, range_limits_m=(0.0, 9.0))
    assert found.report is not None
    (step,) = found.report.steps
    assert (step.motion, step.transform) == ("still", "once")
    assert (step.paths, step.transforms) == (100_000, 1)
    assert found.report.pulses == 256
    np.testing.assert_array_equal(found.plane[255], found.plane[0])


@pytest.mark.parametrize("rate_mps", [0.0, 37.0])
def test_phase_at_10_km_and_77_ghz(rate_mps: float) -> None:
    """1e7 cycles of path, 440 of residual video phase: to 2e-8, against long double."""
    waveform = FmcwWaveform(77e9, 20e6, 2048, 20e6)
    radar = radar_of(waveform, 3)
    assert waveform.unambiguous_range_m > 15e3
    range_m = 10_000.123456789
    paths = unit_paths(radar, [range_m], [rate_mps])
    found = synthesize(paths, radar, range_limits_m=(0.0, 15e3), tolerance=1e-8)
    length_m = np.longdouble(2 * range_m)
    expected = truth(radar, lambda t: np.array([length_m + 2 * rate_mps * t]), np.ones(1))
    amplitude = np.abs(found.plane[0, 0])
    assert amplitude == pytest.approx(1, abs=1e-6)
    assert relative(found.plane, amplitude * expected) <= 2e-8


@pytest.mark.parametrize("synthesis", ["auto", "per-pulse"])
def test_stepped_frequency_over_a_whole_second(synthesis: str) -> None:
    """2 GHz in 1 s: a car at 30 m/s bends the phase by 600 rad, many terms of any series."""
    radar = radar_of(SteppedWaveform(10e9, 10e6, 200, 5e-3), 2)
    ranges_m, rates_mps = [10.0, 4.0, 12.0], [30.0, -12.0, 0.01]
    paths = unit_paths(radar, ranges_m, rates_mps)
    found = synthesize(paths, radar, range_limits_m=(0.0, 14.0), slow_time_transform=synthesis)  # type: ignore[arg-type]
    lengths = 2 * np.array(ranges_m), 2 * np.array(rates_mps)
    expected = truth(radar, lambda t: lengths[0] + lengths[1] * t, np.ones(3))
    assert relative(found.plane, expected) <= 1e-6


def test_uneven_motion_within_a_long_sweep_is_said() -> None:
    waveform = SteppedWaveform(10e9, 10e6, 100, 1e-3)
    radar = radar_of(waveform, 30)
    paths = unit_paths(radar, [8.0])

    def swinging(hz: float) -> Paths:
        motion = Function(
            lambda t: np.array([16 + 0.02 * np.sin(2 * np.pi * hz * t)]), np.array([True])
        )
        return dataclasses.replace(paths, motion=motion)

    slow, fast = (
        synthesize(swinging(hz), radar, range_limits_m=(0.0, 14.0)).report for hz in (1e-3, 2.0)
    )
    assert slow is not None and fast is not None
    assert slow.accuracy_findings() == []
    assert fast.accuracy_findings() == [
        finding("uneven-motion-in-sweep", phase_rad=fast.ramp_residual_phase_rad)
    ]
    # the whole error, against every sample at its own time, is of that size
    for hz, report in ((1e-3, slow), (2.0, fast)):
        moved = swinging(hz)
        found = synthesize(moved, radar, range_limits_m=(0.0, 14.0)).plane
        expected = truth(
            radar, lambda t, hz=hz: np.array([16 + 0.02 * np.sin(2 * np.pi * hz * float(t))]),
            np.ones(1),
        )  # fmt: skip
        worst = np.abs(np.angle(found / expected)).max()
        assert worst <= 1.5 * report.ramp_residual_phase_rad + 1e-6
    assert worst >= 0.3 * fast.ramp_residual_phase_rad


def test_what_folds_is_said() -> None:
    radar = radar_of(STEPPED, 4)
    beyond_m = STEPPED.unambiguous_range_m + 5
    paths = unit_paths(radar, [5.0, beyond_m], [1.1 * radar.max_unambiguous_velocity_mps, 0.0])
    report = synthesize(paths, radar, range_limits_m=(0.0, 60.0)).report
    assert report is not None
    assert (report.range_ambiguous_count, report.doppler_ambiguous_count, report.outside) == (
        1,
        1,
        0,
    )
    assert range_limit(radar.waveform) == "frequency step"
    assert radar.unambiguous_range_m == pytest.approx(74.95, abs=0.01)
    radar = radar_of(FMCW, 4)
    paths = unit_paths(radar, [5.0, FMCW.unambiguous_range_m + 1], [1.0, 1.0])
    report = synthesize(paths, radar, range_limits_m=(0.0, 9.0)).report
    assert report is not None
    assert (report.range_ambiguous_count, report.doppler_ambiguous_count, report.outside) == (
        0,
        0,
        1,
    )
    # codes follow one another faster than pulses
    radar = radar_of(PMCW, 4)
    paths = unit_paths(radar, [2.0], [1.1 * radar.max_unambiguous_velocity_mps])
    report = synthesize(paths, radar, range_limits_m=(0.0, 9.0)).report
    assert report is not None and report.doppler_ambiguous_count == 1


@KINDS
def test_a_bad_row_is_named(waveform) -> None:
    radar = radar_of(waveform, 4)
    length_m = np.full(9, 8.0)
    length_m[6] = np.nan
    oscillator = PhaseNoise((1e3, 1e6), (-90.0, -110.0))
    for noise in (None, oscillator):
        synthesizer = synthesizer_for(radar, (0.0, 9.0), phase_noise=noise)
        synthesizer.add(make_paths(np.ones(5), np.full(5, 7.0)))
        with pytest.raises(PathDataError, match=f"Row {5 + 6} .* length nan"):
            synthesizer.add(make_paths(np.ones(9), length_m))


@pytest.mark.parametrize("waveform", [FMCW, STEPPED], ids=lambda w: w.kind)
def test_phase_noise_has_a_report(waveform) -> None:
    """Noise a billionth of a radian high: the samples without it, and what was done."""
    radar = radar_of(waveform, 4)
    paths, _, _ = many(radar)
    synthesizer = synthesizer_for(
        radar, (0.0, 60.0), phase_noise=PhaseNoise((1e3, 1e5), (-240.0, -240.0))
    )
    synthesizer.add(paths)
    noisy = synthesizer.result()
    clean = synthesize(paths, radar, range_limits_m=(0.0, 60.0))
    assert relative(noisy.plane, clean.plane) <= 1e-6
    assert noisy.report is not None and clean.report is not None
    assert noisy.report.paths == 40
    assert any("Phase noise path by path" in note for note in noisy.report.notes)
    assert noisy.report.cancellation_db is not None
    assert 0 < noisy.report.error_estimate <= 1e-5
    # two delays for each path
    assert sum(step.paths for step in noisy.report.steps) == 2 * 40


@pytest.mark.parametrize("waveform", [FMCW, STEPPED], ids=lambda w: w.kind)
def test_phase_noise_tells_what_the_report_without_it_tells(waveform) -> None:
    """Paths that bend, two too fast for the PRF, one beyond the unambiguous range."""
    radar = radar_of(waveform, 24)
    fast_mps = 1.3 * radar.max_unambiguous_velocity_mps
    start_m = np.array([2.0, 16.0, 9.0, 2 * waveform.unambiguous_range_m + 11])
    rate_mps = 2 * np.array([fast_mps, -fast_mps, 0.0, 0.0])
    span_s = 24 / radar.burst.prf_hz

    def lengths(t: float) -> np.ndarray:
        return start_m + rate_mps * t + 1e-3 * np.array([0, 0, 1, 0]) * np.sin(5 * t / span_s)

    paths = dataclasses.replace(
        unit_paths(radar, list(start_m / 2)),
        motion=Function(lengths, np.array([True, True, True, False])),
    )
    clean = synthesize(paths, radar, range_limits_m=(0.0, 9.0)).report
    # delays of its factors 0.3 m apart: each path has its own
    quiet = PhaseNoise((1e3, 1e7), (-240.0, -240.0))
    synthesizer = synthesizer_for(radar, (0.0, 9.0), phase_noise=quiet)
    synthesizer.add(paths)
    noisy = synthesizer.result().report
    assert clean is not None and noisy is not None
    beyond = 1 if waveform is FMCW else 0
    assert (clean.doppler_ambiguous_count, clean.outside) == (2, beyond)
    assert clean.range_ambiguous_count == 1 - beyond and clean.motion_error_rad > 0
    for name in (
        "paths", "pulses", "frequencies", "tolerance", "motion_error_rad", "outside",
        "range_ambiguous_count", "doppler_ambiguous_count",
    ):  # fmt: skip
        assert getattr(noisy, name) == getattr(clean, name), name
    assert noisy.ramp_residual_phase_rad == pytest.approx(clean.ramp_residual_phase_rad, rel=1e-6)


def test_nodes_suffice() -> None:
    """Interpolation at the nodes against the exponential itself."""
    place = np.linspace(-1, 1, 501)
    for bend_rad in (0.0, 1e-4, 0.3, 4.0, 11.0):
        for tolerance in (1e-4, 1e-8, 1e-13):
            nodes = nodes_for(bend_rad, tolerance)
            at = np.cos(np.pi * (np.arange(nodes) + 0.5) / nodes)
            weights = np.polynomial.chebyshev.chebvander(place, nodes - 1) @ np.linalg.inv(
                np.polynomial.chebyshev.chebvander(at, nodes - 1)
            )
            error = np.abs(weights @ np.exp(1j * bend_rad * at) - np.exp(1j * bend_rad * place))
            assert error.max() <= 2 * tolerance
    assert nodes_for(0.0, 1e-8) == 1


def test_bad_ramps() -> None:
    for bad in ((0.0, 0.0), (np.nan, 0.0), (1e-6, np.inf)):
        with pytest.raises(ConfigError):
            Ramp(*bad)
    grid, times_s = FrequencyGrid(1e9, 1e6, 8), np.arange(3.0)
    for options in (
        {"extra_cycles": lambda tau: tau},
        {"listening": ReceiveWindow(0.0, 1.0, 0.5)},
    ):
        with pytest.raises(ConfigError, match="ramp"):
            SpectrumAccumulator(grid, times_s, ramp=Ramp(1e-6), **options)


def test_a_path_at_no_distance_is_heard() -> None:
    radar = radar_of(FMCW, 2)
    echoes = synthesize(unit_paths(radar, [0.0]), radar, range_limits_m=(0.0, 9.0))
    assert echoes.outside == 0
    np.testing.assert_allclose(echoes.plane, 1, atol=1e-6)
