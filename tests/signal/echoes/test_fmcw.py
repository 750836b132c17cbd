# SPDX-License-Identifier: GPL-3.0-or-later
"""FMCW: beats against the phases of the two ramps themselves, motion within a ramp, the ADC."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from radarsim_addon.physics.constants import SPEED_OF_LIGHT_MPS
from radarsim_addon.signal import FmcwWaveform, Waveform, range_doppler, synthesize
from radarsim_addon.signal.echoes import line_times_s
from radarsim_addon.signal.maps import range_process
from radarsim_addon.signal.motion import LinearMotion
from radarsim_addon.signal.motion.kinematics import Rows
from radarsim_addon.signal.radar import AnyWaveform
from tests.signal.oracle import unit_paths
from tests.signal.waveform_kinds import FMCW, PMCW, STEPPED, burst_of


def beat(
    waveform: FmcwWaveform, range_m: float, rate_mps: float, times_s: np.ndarray
) -> np.ndarray:
    """Received times conjugate of transmitted, from the phase of the ramp itself."""
    start_hz = waveform.carrier_hz - waveform.slope_hz_per_s * waveform.grid_middle_s
    ramp_s = waveform.adc_start_s + np.arange(waveform.adc_samples) / waveform.sampling_rate_hz

    def cycles(t: np.ndarray) -> np.ndarray:
        return start_hz * t + waveform.slope_hz_per_s * t**2 / 2

    rows = []
    for time_s in times_s:
        delay_s = retarded_s(lambda t: range_m + rate_mps * t, time_s + ramp_s)
        rows.append(np.exp(2j * np.pi * (cycles(ramp_s - delay_s) - cycles(ramp_s))))
    return np.array(rows)


def retarded_s(range_m: Callable[[np.ndarray], np.ndarray], times_s: np.ndarray) -> np.ndarray:
    """Delays of what is received at these times and met half of them before."""
    delay_s = np.zeros_like(times_s)
    for _ in range(4):  # each round gains six digits
        delay_s = 2 * range_m(times_s - delay_s / 2) / SPEED_OF_LIGHT_MPS
    return delay_s


@pytest.mark.parametrize("rate_mps", [0.0, 8.0, -30.0, 300.0])
def test_beat_of_a_path_is_that_of_the_two_ramps(rate_mps: float) -> None:
    """Frequency, phase, residual video phase, coupling and motion within the ramp together."""
    radar = burst_of(FMCW, 8)
    found = synthesize(
        unit_paths(radar, [23.4], [rate_mps]), radar, range_limits_m=(0.0, 38.0)
    ).plane
    truth = beat(FMCW, 23.4, rate_mps, line_times_s(radar))
    assert np.linalg.norm(found - truth) < 1e-6 * np.linalg.norm(truth)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
@pytest.mark.parametrize("fastest_mps", [3.0, 30.0, 300.0])
def test_many_moving_targets_are_one_transform(fastest_mps: float, tolerance: float) -> None:
    """The residual video phase, which ties delay and rate together, of each of them."""
    rng = np.random.default_rng(1)
    radar = burst_of(FMCW, 64)
    range_m, rate_mps = rng.uniform(5, 35, 60), rng.uniform(-1, 1, 60) * fastest_mps
    found = synthesize(
        unit_paths(radar, list(range_m), list(rate_mps)), radar, range_limits_m=(0.0, 38.0),
        slow_time_transform="type3", tolerance=tolerance,
    )  # fmt: skip
    truth = sum(
        beat(FMCW, r, v, line_times_s(radar)) for r, v in zip(range_m, rate_mps, strict=True)
    )
    assert np.linalg.norm(found.plane - truth) < tolerance * np.linalg.norm(truth)
    assert found.report is not None
    assert found.report.error_estimate < tolerance
    (step,) = found.report.steps
    assert (step.motion, step.transform, step.paths) == ("linear", "type 3", 60)


def test_targets_beyond_the_adc_are_filtered_alike_in_one_transform() -> None:
    """By where the ramp shows them: the beat's frequency holds the Doppler shift as well."""
    radar = burst_of(FMCW, 16)
    limit_m = FMCW.unambiguous_range_m
    range_m = limit_m + np.linspace(-3, 3, 13)
    for rate_mps in (200.0, -200.0):
        paths = unit_paths(radar, list(range_m), rate_mps)
        one, each = (
            synthesize(paths, radar, range_limits_m=(0.0, 38.0), slow_time_transform=way)
            for way in ("type3", "per-pulse")
        )
        assert np.linalg.norm(one.plane - each.plane) < 1e-6 * np.linalg.norm(each.plane)
        assert one.outside == each.outside > 0
        assert one.report is not None
        assert "type 3" in {step.transform for step in one.report.steps}


def test_beat_of_a_blade_that_turns_within_the_ramp() -> None:
    """Tip 50 m/s on 0.25 m: 10 000 m/s^2."""
    radar = burst_of(FMCW, 32)

    def range_m(time_s: np.ndarray) -> np.ndarray:
        angle = 200 * time_s + 0.4
        return np.hypot(20 + 0.25 * np.cos(angle), 0.25 * np.sin(angle))

    class Blade:
        moving = np.array([True])

        def lengths_m(self, times_s: np.ndarray, rows: object) -> np.ndarray:
            return 2 * range_m(times_s)[None]

        def select(self, rows: object) -> "Blade":
            return self

    paths = dataclasses.replace(unit_paths(radar, [20.0]), motion=Blade())
    found = synthesize(paths, radar, range_limits_m=(0.0, 38.0)).plane
    start_hz = FMCW.carrier_hz - FMCW.slope_hz_per_s * FMCW.grid_middle_s
    ramp_s = FMCW.adc_start_s + np.arange(FMCW.adc_samples) / FMCW.sampling_rate_hz
    delay_s = retarded_s(range_m, line_times_s(radar)[:, None] + ramp_s)
    cycles = -start_hz * delay_s - FMCW.slope_hz_per_s * (ramp_s * delay_s - delay_s**2 / 2)
    truth = np.exp(2j * np.pi * cycles)
    # the jerk, left out, turns the phase by 2e-5 rad at the ends of the ramp
    assert np.linalg.norm(found - truth) < 1e-5 * np.linalg.norm(truth)


def test_beat_frequency_and_residual_video_phase() -> None:
    radar = burst_of(FMCW, 1)
    delay_s = 2 * 20.0 / SPEED_OF_LIGHT_MPS
    samples = synthesize(unit_paths(radar, [20.0]), radar, range_limits_m=(0.0, 38.0)).plane[0]
    beat_hz = -FMCW.slope_hz_per_s * delay_s  # falls: received times conjugate of transmitted
    step = np.exp(2j * np.pi * beat_hz / FMCW.sampling_rate_hz)
    np.testing.assert_allclose(samples[1:] / samples[:-1], step, atol=1e-7)
    profile = range_process(
        synthesize(unit_paths(radar, [20 * 0.149896229]), radar, range_limits_m=(0.0, 38.0)),
        "none",
        1,
    )
    delay_s = 2 * 20 * 0.149896229 / SPEED_OF_LIGHT_MPS
    phase = -2 * np.pi * FMCW.carrier_hz * delay_s + np.pi * FMCW.slope_hz_per_s * delay_s**2
    assert profile.plane[0, 20] == pytest.approx(np.exp(1j * phase), abs=1e-6)


def test_fmcw_mover_stands_where_it_will_be() -> None:
    """Range-Doppler coupling: f0 / K times the range rate."""
    radar = burst_of(FMCW, 64)
    rate_mps, range_m = 8.0, 20.0
    rd_map = range_doppler(
        range_process(
            synthesize(unit_paths(radar, [range_m], [rate_mps]), radar, range_limits_m=(0.0, 38.0)),
            "hann",
            16,
        ),
        "hann",
    )
    row, col = np.unravel_index(np.argmax(rd_map.plane_power), rd_map.plane_power.shape)
    burst_s = 63 / radar.burst.prf_hz
    later_s = FMCW.carrier_hz / FMCW.slope_hz_per_s
    assert rate_mps * later_s > 0.015
    expected_m = range_m + rate_mps * (burst_s / 2 + FMCW.grid_middle_s + later_s)
    # the cell's own raster, and the residual video phase: K tau of tau' is no Doppler
    assert rd_map.range_m[col] == pytest.approx(expected_m, abs=0.006)
    assert rd_map.velocity_mps[row] == pytest.approx(rate_mps, abs=radar.velocity_resolution_mps)


PULSE = Waveform(77e9, 150e6, 10e-6, 180e6)


class _BurstOnly(LinearMotion):
    """Known from 0 to the end of the burst alone, as motion sampled from an animation."""

    span_s = 0.0

    def lengths_m(self, times_s: np.ndarray, rows: Rows) -> np.ndarray:
        assert times_s.min() >= 0 and times_s.max() <= self.span_s
        return super().lengths_m(times_s, rows)


@pytest.mark.parametrize("waveform", [FmcwWaveform(77e9, 1e9, 64, 5e6), STEPPED, PMCW, PULSE])
def test_motion_is_asked_for_within_the_burst_alone(waveform: AnyWaveform) -> None:
    radar = burst_of(waveform, 6)
    paths = unit_paths(radar, [5.0], [3.0])
    motion = _BurstOnly(paths.length_m, paths.range_rate_mps)
    object.__setattr__(motion, "span_s", 6 / radar.burst.prf_hz)
    known = dataclasses.replace(paths, motion=motion)
    range_limits_m = (0.0, 9.0)
    np.testing.assert_array_equal(
        synthesize(known, radar, range_limits_m=range_limits_m).plane,
        synthesize(paths, radar, range_limits_m=range_limits_m).plane,
    )


def test_anti_alias_filter_takes_out_what_is_beyond_the_adc() -> None:
    for real in (False, True):
        waveform = FmcwWaveform(77e9, 1e9, 256, 10e6, real_adc=real)
        radar = burst_of(waveform, 2)
        limit_m = waveform.unambiguous_range_m
        paths = unit_paths(radar, [limit_m * 0.9, limit_m * 1.1])
        echoes = synthesize(paths, radar, range_limits_m=(0.0, 2 * limit_m))
        assert echoes.outside == 1
        profile = range_process(echoes, "hann")
        assert profile.range_m[-1] < limit_m
        assert profile.range_m[np.argmax(np.abs(profile.plane[0]))] == pytest.approx(
            0.9 * limit_m, abs=0.1
        )
