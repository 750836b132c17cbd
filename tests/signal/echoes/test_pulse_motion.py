# SPDX-License-Identifier: GPL-3.0-or-later
"""Pulses and codes that come back from what moves, against direct sums at retarded times."""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from radarsim_addon.physics.constants import SPEED_OF_LIGHT_MPS
from radarsim_addon.signal import (
    Burst,
    Echoes,
    Paths,
    PmcwWaveform,
    Radar,
    Waveform,
    replica,
    synthesize,
)
from radarsim_addon.signal.detection import find_moving_targets
from radarsim_addon.signal.echoes import line_times_s, synthesizer_for
from radarsim_addon.signal.maps import range_doppler, range_process
from radarsim_addon.signal.radar import AnyWaveform, ArbitraryPulse, PhaseCodedPulse
from tests.signal.oracle import echo_at, pulse_at, unit_paths
from tests.signal.spectrum_oracle import Function, relative

#: A chirp at 77 GHz that is under way for 10 us.
CHIRP = Waveform(77e9, 150e6, 10e-6, 180e6)
WINDOW_M = (90.0, 150.0)


def smooth_chirp() -> ArbitraryPulse:
    """Between the samples of a pulse without edges there is nothing but a sinc."""
    time_s = (np.arange(1800) - 899.5) / 180e6
    samples = np.exp(1j * np.pi * 1e13 * time_s**2 - (time_s / 1.3e-6) ** 2)
    return ArbitraryPulse(carrier_hz=77e9, sampling_rate_hz=180e6, samples=samples)


def sampled_chirp() -> ArbitraryPulse:
    """The samples of the chirp, between which the oracle is a sinc, too."""
    return ArbitraryPulse(carrier_hz=77e9, sampling_rate_hz=180e6, samples=replica(CHIRP))


PULSES = {"chirp": sampled_chirp, "smooth": smooth_chirp}


def moving_paths(radar: Radar) -> Paths:
    return unit_paths(radar, [120.3, 131.77, 100.0, 140.0], [60.0, -60.0, 13.0, 0.0])


@functools.cache
def truth_of(pulse: str) -> tuple[Radar, np.ndarray]:
    """Three pulses of all moving paths, term by term."""
    radar = Radar(PULSES[pulse](), Burst(5000.0, 3))
    paths = moving_paths(radar)
    times = synthesize(paths, radar, range_limits_m=WINDOW_M)
    return radar, echo_at(paths, radar, times.fast_time_s, times.slow_time_s)


def error_of(echoes: Echoes, paths: Paths) -> float:
    truth = echo_at(paths, echoes.radar, echoes.fast_time_s, echoes.slow_time_s)
    return relative(echoes.plane, truth)


@pytest.mark.parametrize("transform", ["auto", "type3", "per-pulse", "direct"])
@pytest.mark.parametrize(("pulse", "bound"), [("chirp", 1e-3), ("smooth", 1e-6)])
def test_moving_echoes_are_those_of_retarded_times(
    pulse: str, bound: float, transform: Any
) -> None:
    """60 m/s turn a pulse of 10 us by 2 rad: stop and go is half off. Edges of a chirp ring."""
    radar, truth = truth_of(pulse)
    paths = moving_paths(radar)
    found = synthesize(paths, radar, range_limits_m=WINDOW_M, slow_time_transform=transform)
    assert relative(found.plane, truth) < bound
    assert found.report is not None
    assert found.report.error_estimate < 1e-6
    # none of the edges, which the oracle knows outside the band: the transforms among themselves
    direct = synthesize(paths, radar, range_limits_m=WINDOW_M, slow_time_transform="direct")
    assert relative(found.plane, direct.plane) < 1e-6
    still = synthesize(paths, radar, range_limits_m=WINDOW_M, motion_within_pulse=False)
    assert relative(still.plane, truth) > 0.1


#: A code of 25.5 us, which 60 m/s turn by 5 rad.
CODE = PmcwWaveform(77e9, 100e-9, 8, 3, 1)


@pytest.mark.parametrize("transform", ["auto", "type3", "per-pulse", "direct"])
def test_codes_of_pmcw_have_the_doppler_shift_in_them(transform: Any) -> None:
    """Stop and go is as far off as there is signal; each sample has its own retarded time."""
    radar = Radar(CODE, Burst(5000.0, 3))
    paths = unit_paths(radar, [120.3, 1310.77, 100.0, 2400.0], [60.0, -60.0, 13.0, 0.0])
    limits_m = (0.0, CODE.unambiguous_range_m)
    found = synthesize(paths, radar, range_limits_m=limits_m, slow_time_transform=transform)
    truth = echo_at(paths, radar, found.fast_time_s, line_times_s(radar))
    assert relative(found.plane, truth) < 1e-6
    assert found.report is not None
    assert found.report.error_estimate < 1e-6
    still = synthesize(paths, radar, range_limits_m=limits_m, motion_within_pulse=False)
    assert relative(still.plane, truth) > 0.5


@pytest.mark.parametrize(("waveform", "stop_m"), [(CHIRP, 150.0), (CODE, 3800.0)])
def test_single_echoes_are_those_of_the_synthesis(waveform: AnyWaveform, stop_m: float) -> None:
    """Alone in their pulses: within the window, over its end, beyond it, and folded into it."""
    radar, limits_m = Radar(waveform, Burst(5000.0, 1)), (90.0, stop_m)
    ranges_m = np.array([120.3, stop_m + 1.7, 95.0, 2 * stop_m + 4000.0, 29979.2458 + 131.77])
    rates_mps = np.array([60.0, -60.0, 0.0, 13.0, 25.0])
    found = synthesizer_for(radar, limits_m).single_echoes(ranges_m, rates_mps)
    each = [
        synthesize(
            unit_paths(radar, [r], v), radar, range_limits_m=limits_m, nufft_backend="direct"
        )
        for r, v in zip(ranges_m, rates_mps, strict=True)
    ]
    truth = np.concatenate([echoes.plane for echoes in each])
    assert found.plane.shape == truth.shape
    assert np.abs(found.plane - truth).max() < 1e-11 * np.abs(truth).max()
    assert found.first_sample_s == each[0].first_sample_s
    assert found.outside == np.mean([echoes.outside for echoes in each])


def test_sidelobes_of_a_shifted_code_are_no_targets() -> None:
    """Doppler within a code lifts its sidelobes to -20 dB, all over the range."""
    code = dataclasses.replace(CODE, code_repeats=1)
    radar = Radar(code, Burst(1 / code.duration_s, 64))
    limits_m = (0.0, code.unambiguous_range_m)
    echoes = synthesize(unit_paths(radar, [1500.0], 20.0), radar, range_limits_m=limits_m)
    (found,) = find_moving_targets(echoes, range_doppler(range_process(echoes)), 0)
    assert found.velocity_mps == pytest.approx(20.0, abs=0.1)
    assert found.range_m == pytest.approx(1500.0, abs=0.1)


@pytest.mark.parametrize("backend", ["finufft", "direct"])
def test_one_pulse_has_the_doppler_shift_in_it(backend: Any) -> None:
    radar = Radar(smooth_chirp(), Burst(5000.0, 1))
    paths = moving_paths(radar)
    found = synthesize(paths, radar, range_limits_m=WINDOW_M, nufft_backend=backend)
    assert error_of(found, paths) < 1e-6


def test_fast_targets_far_away_and_a_long_pulse() -> None:
    """3000 m/s, 100 us: hundreds of radians in a pulse, at 400 km 4 m during its flight."""
    samples = np.hanning(2000) * np.exp(1j * np.pi * 1e11 * ((np.arange(2000) - 999.5) / 20e6) ** 2)
    pulse = ArbitraryPulse(carrier_hz=10e9, sampling_rate_hz=20e6, samples=samples)
    radar = Radar(pulse, Burst(100.0, 3))
    paths = unit_paths(radar, [400e3, 400.7e3], [3000.0, -2000.0])
    found = synthesize(paths, radar, range_limits_m=(399e3, 402e3))
    assert error_of(found, paths) < 1e-6


def test_peak_of_a_moving_target_stands_where_it_will_be() -> None:
    """Range-Doppler coupling of a chirp: f0 / K times the range rate, 0.31 m at 60 m/s."""
    radar = Radar(CHIRP, Burst(5000.0, 1))
    for rate_mps in (60.0, -60.0, 0.0):
        echoes = synthesize(unit_paths(radar, [120.0], rate_mps), radar, range_limits_m=WINDOW_M)
        profile = range_process(echoes, "hann", 32)
        found_m = profile.range_m[np.argmax(np.abs(profile.plane[0]))]
        later_s = CHIRP.carrier_hz / CHIRP.fm_rate_hz_per_s
        step_m = profile.range_m[1] - profile.range_m[0]
        assert found_m == pytest.approx(120.0 + rate_mps * later_s, abs=step_m)


@pytest.mark.parametrize(
    ("waveform", "rate_mps"),
    [
        (PhaseCodedPulse(77e9, 1e-6, 13), 30.0),
        (PhaseCodedPulse(10e9, 1e-6, 13), 120.0),
        (CHIRP, 30.0),
    ],
)
def test_sidelobes_of_a_shifted_pulse_are_no_targets(
    waveform: AnyWaveform, rate_mps: float
) -> None:
    """A code does not stand Doppler within it: -20 dB at 450 m, which the response knows."""
    radar = Radar(waveform, Burst(40e3, 64))
    echoes = synthesize(unit_paths(radar, [1500.0], rate_mps), radar, range_limits_m=(1000, 2500))
    rd_map = range_doppler(range_process(echoes))
    (found,) = find_moving_targets(echoes, rd_map, 0)
    assert found.velocity_mps == pytest.approx(rate_mps, abs=0.1)


@pytest.mark.parametrize("waveform", [smooth_chirp(), PhaseCodedPulse(77e9, 1e-6, 13)])
def test_uneven_motion_is_followed_to_the_first_order(waveform: AnyWaveform) -> None:
    """A blade whose tip turns at 50 m/s on 0.25 m: 10 000 m/s^2 bend the phase within a pulse."""

    def range_m(time_s: np.ndarray) -> np.ndarray:
        angle = 200 * time_s + 0.4
        return np.hypot(120 + 0.25 * np.cos(angle), 0.25 * np.sin(angle))

    radar = Radar(waveform, Burst(5000.0, 32))
    motion = Function(lambda t: 2 * np.atleast_1d(range_m(np.float64(t))), np.array([True]))
    paths = dataclasses.replace(unit_paths(radar, [float(range_m(0.0))]), motion=motion)
    found = synthesize(paths, radar, range_limits_m=WINDOW_M)
    assert found.report is not None
    assert {step.motion for step in found.report.steps} == {"smooth"}
    truth = retarded(radar, found, range_m)
    left_rad = found.report.ramp_residual_phase_rad
    (step,) = found.report.steps
    # all pulses in one transform leave nothing out
    assert left_rad == 0 if step.transform == "type 3" else 1e-5 < left_rad < 2e-3
    away = relative(range_process(found).plane, range_process(truth).plane)
    assert away < left_rad + (0 if isinstance(waveform, ArbitraryPulse) else 2e-4)


def retarded(radar: Radar, echoes: Echoes, range_m: Callable[[np.ndarray], np.ndarray]) -> Echoes:
    """The same samples of one scatterer that is met half way between emission and reception."""
    fast_s, lines = echoes.fast_time_s, []
    for time_s in echoes.slow_time_s:
        sent_s = fast_s - 2 * range_m(time_s + fast_s) / SPEED_OF_LIGHT_MPS
        for _ in range(8):
            met_s = time_s + (fast_s + sent_s) / 2
            sent_s = fast_s - 2 * range_m(met_s) / SPEED_OF_LIGHT_MPS
        carrier = np.exp(-2j * np.pi * radar.waveform.carrier_hz * (fast_s - sent_s))
        lines.append(pulse_at(radar, sent_s) * carrier)
    return dataclasses.replace(echoes, samples=np.array(lines)[None])
