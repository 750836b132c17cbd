# SPDX-License-Identifier: GPL-3.0-or-later
"""Echoes against Eq. 9-14 in the time domain, and the identities that any echo must obey."""

import math

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.physics.constants import SPEED_OF_LIGHT_MPS
from radarsim_addon.signal import (
    Burst,
    Paths,
    Radar,
    Waveform,
    expected_power_profile,
    make_paths,
    replica,
    synthesize,
)
from radarsim_addon.signal.maps import range_process
from tests.signal.oracle import echo_at, unit_paths

RADAR = Radar(Waveform(5.3e9, 50e6, 2.5e-6, 60e6), Burst(1000.0, 5))
WINDOW_M = (500.0, 1500.0)


def many_paths(count: int = 300) -> Paths:
    rng = np.random.default_rng(3)
    rate = np.where(rng.random(count) < 0.5, 0.0, rng.uniform(-40, 40, count))
    return make_paths(rng.uniform(0, 1, count), 2 * rng.uniform(600, 1400, count), rate)


def whole_sample_range_m(radar: Radar, sample: int, start_m: float) -> float:
    """A range whose echo falls on the sampling grid of a window that starts at start_m."""
    return start_m + sample * radar.waveform.sample_spacing_m


def test_chirp_is_the_papers() -> None:
    waveform = RADAR.waveform
    samples = replica(waveform)
    assert samples.size == 150
    phase = np.unwrap(np.angle(samples))
    frequency = np.diff(phase) / (2 * np.pi) * waveform.sampling_rate_hz
    chirp_rate = np.diff(frequency) * waveform.sampling_rate_hz
    np.testing.assert_allclose(chirp_rate, 20e12, rtol=1e-6)  # Table I
    assert frequency[0] == pytest.approx(-frequency[-1])


def test_echo_on_the_grid_is_exactly_the_papers_sum() -> None:
    ranges = [whole_sample_range_m(RADAR, n, WINDOW_M[0]) for n in (0, 7, 31, 200)]
    paths = unit_paths(RADAR, ranges)
    echoes = synthesize(paths, RADAR, range_limits_m=WINDOW_M)
    expected = echo_at(paths, RADAR, echoes.fast_time_s, echoes.slow_time_s)
    assert np.abs(expected).max() > 0.9
    np.testing.assert_allclose(echoes.plane, expected, atol=5e-8)


def test_moving_echo_between_the_samples_is_the_papers_sum_band_limited() -> None:
    """A rectangular chirp has 1 % of its energy beyond the sampling rate; the matched filter over
    the band leaves that out, and then both agree, in phase too."""
    paths = unit_paths(RADAR, [777.77, 1234.5], [10.0, -35.0])
    echoes = synthesize(paths, RADAR, range_limits_m=WINDOW_M)
    literal = echo_at(paths, RADAR, echoes.fast_time_s, echoes.slow_time_s)
    difference = np.sqrt(np.mean(np.abs(echoes.plane - literal) ** 2))
    assert difference < 0.2 * np.sqrt(np.mean(np.abs(literal) ** 2))
    import dataclasses

    found = range_process(echoes).plane
    expected = range_process(dataclasses.replace(echoes, samples=literal[None])).plane
    assert np.abs(found - expected).max() < 0.02


def test_transform_against_term_by_term() -> None:
    paths = many_paths()
    found = synthesize(paths, RADAR, range_limits_m=WINDOW_M)
    expected = synthesize(paths, RADAR, range_limits_m=WINDOW_M, nufft_backend="direct")
    scale = np.abs(expected.plane).max()
    assert np.abs(found.plane - expected.plane).max() < 1e-8 * scale


def test_superposition() -> None:
    paths = many_paths()
    parts = [paths.select(slice(0, 100)), paths.select(slice(100, None))]
    separate = [
        synthesize(part, RADAR, range_limits_m=WINDOW_M, tolerance=1e-9).plane for part in parts
    ]
    for together in (paths, iter(parts), Paths.join(parts)):
        echoes = synthesize(together, RADAR, range_limits_m=WINDOW_M, tolerance=1e-9)
        np.testing.assert_allclose(
            echoes.plane, separate[0] + separate[1], atol=1e-8 * np.abs(echoes.plane).max()
        )


def test_result_does_not_depend_on_chunks() -> None:
    paths = many_paths()
    whole = synthesize(paths, RADAR, range_limits_m=WINDOW_M).plane
    for chunk in (1, 17, 299):
        found = synthesize(paths, RADAR, range_limits_m=WINDOW_M, chunk=chunk).plane
        np.testing.assert_allclose(found, whole, atol=1e-8 * np.abs(whole).max())


def test_moving_everything_away_delays_the_echo_and_turns_its_phase() -> None:
    """By a whole number of samples: the same samples, later, times exp(-j 4 pi dr / lambda)."""
    paths, shift = many_paths(), 24
    away_m = shift * RADAR.waveform.sample_spacing_m
    moved = make_paths(paths.radiance, paths.length_m + 2 * away_m, paths.range_rate_mps)
    # what moves during its own delay as well moves further, see the light times below
    near, far = (
        synthesize(p, RADAR, range_limits_m=WINDOW_M, motion_within_pulse=False).plane
        for p in (paths, moved)
    )
    turn = np.exp(-4j * np.pi * away_m / RADAR.waveform.wavelength_m)
    np.testing.assert_allclose(
        far[:, shift:], near[:, :-shift] * turn, atol=1e-8 * np.abs(near).max()
    )


def test_moving_the_transmitter_away_delays_the_echo() -> None:
    """Length is camera to scatterer to emitter: 30 m more on one leg are 15 m of range."""
    scatterer = np.array([1000.0, 0.0, 0.0])

    def arrival_s(transmitter: np.ndarray) -> float:
        length_m = np.linalg.norm(scatterer) + np.linalg.norm(scatterer - transmitter)
        echoes = synthesize(make_paths(1.0, float(length_m)), RADAR, range_limits_m=WINDOW_M)
        energy = np.abs(echoes.plane[0]) ** 2
        return float((energy * echoes.fast_time_s).sum() / energy.sum())

    later_s = arrival_s(np.array([-30.0, 0.0, 0.0])) - arrival_s(np.zeros(3))
    assert later_s == pytest.approx(30.0 / SPEED_OF_LIGHT_MPS, rel=1e-3)


def test_receding_echo_has_negative_doppler() -> None:
    radar = Radar(RADAR.waveform, Burst(1000.0, 64))
    for rate_mps in (3.0, -3.0):
        echoes = synthesize(unit_paths(radar, [1000.0], rate_mps), radar, range_limits_m=WINDOW_M)
        turn = np.sum(echoes.plane[1:] * echoes.plane[:-1].conj())
        doppler_hz = np.angle(turn) / (2 * np.pi) * radar.burst.prf_hz
        wanted_hz = -2 * rate_mps * radar.waveform.carrier_hz / SPEED_OF_LIGHT_MPS
        assert doppler_hz == pytest.approx(wanted_hz, rel=1e-3)


def test_phase_at_long_stand_off_at_77_ghz() -> None:
    """10 km: 5e6 cycles of the carrier; the phase is that of the length to 1e-6 rad."""
    radar = Radar(Waveform(77e9, 150e6, 10e-6, 180e6), Burst(1000.0, 1))
    step_m = radar.waveform.sample_spacing_m
    range_m = 9990.0 + 4 * step_m
    from fractions import Fraction

    cycles = Fraction(2 * range_m) * Fraction(77_000_000_000) / Fraction(299_792_458)
    expected = -2 * math.pi * float(cycles - int(cycles))
    values = range_process(
        synthesize(unit_paths(radar, [range_m]), radar, range_limits_m=(9990.0, 10010.0)),
        oversample=1,
    ).plane
    assert abs(values[0, 4]) == pytest.approx(1, abs=1e-8)
    assert np.angle(values[0, 4] * np.exp(-1j * expected)) == pytest.approx(0, abs=1e-6)


def test_echoes_from_outside_do_not_wrap_into_the_window() -> None:
    chirp_m = SPEED_OF_LIGHT_MPS * RADAR.waveform.duration_s / 2
    far = [WINDOW_M[0] - 1.01 * chirp_m, WINDOW_M[1] + 1.01 * chirp_m, 50e3, 400e3]
    echoes = synthesize(unit_paths(RADAR, far), RADAR, range_limits_m=WINDOW_M)
    assert not echoes.plane.any()
    assert echoes.outside == 4
    # half a chirp beyond the end: its front is in the last samples, nothing in the first
    partly = unit_paths(RADAR, [WINDOW_M[1] + 0.5 * chirp_m])
    echoes = synthesize(partly, RADAR, range_limits_m=WINDOW_M)
    assert echoes.outside == 0
    assert np.abs(echoes.plane[0, -20:]).min() > 0.5
    assert np.abs(echoes.plane[0, :200]).max() < 0.01


def test_echo_of_an_earlier_pulse_folds_into_the_window() -> None:
    """At the true range less the unambiguous one, with the carrier phase of the true delay."""
    radar = Radar(RADAR.waveform, Burst(1000.0, 3))
    fold_m = radar.burst.unambiguous_range_m
    shift = 40
    near_m = whole_sample_range_m(radar, shift, WINDOW_M[0])
    earlier_s, rate_mps = 2 / radar.burst.prf_hz, 3.0
    # so that the delay c tau = 2 R(t - 2 P + tau / 2) falls on the sampling grid
    start_m = (near_m + 2 * fold_m) * (1 - rate_mps / SPEED_OF_LIGHT_MPS) + rate_mps * earlier_s
    far = unit_paths(radar, [start_m], [rate_mps])
    found = synthesize(far, radar, range_limits_m=WINDOW_M, tolerance=1e-9)
    expected = echo_at(far, radar, found.fast_time_s + earlier_s, found.slow_time_s - earlier_s)
    inside = slice(shift + 2, shift + radar_chirp(radar) - 2)
    np.testing.assert_allclose(found.plane[0, inside], expected[0, inside], atol=1e-4)
    assert found.report is not None and found.report.range_ambiguous_count == 1
    profile = expected_power_profile(far, radar, range_limits_m=WINDOW_M)
    assert profile.range_m[np.argmax(profile.power)] == pytest.approx(near_m, abs=0.5)
    alone = synthesize(far, radar, range_limits_m=WINDOW_M, range_folding=False)
    assert not alone.plane.any()
    assert alone.outside == 1


def radar_chirp(radar: Radar) -> int:
    return replica(radar.waveform).size


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-9, 1e-12])
def test_tolerance_of_echoes(tolerance: float) -> None:
    paths = many_paths()
    exact = synthesize(paths, RADAR, range_limits_m=WINDOW_M, slow_time_transform="direct")
    found = synthesize(paths, RADAR, range_limits_m=WINDOW_M, tolerance=tolerance)
    error = np.linalg.norm(found.plane - exact.plane) / np.linalg.norm(exact.plane)
    assert error <= tolerance
    assert found.report is not None
    assert found.report.tolerance == tolerance
    assert {step.motion for step in found.report.steps} == {"still", "linear"}


def test_no_paths_give_zeros() -> None:
    none: list[Paths] = []
    for nothing in (make_paths(np.empty(0), np.empty(0)), none):
        echoes = synthesize(nothing, RADAR, range_limits_m=WINDOW_M)
        assert echoes.plane.shape[0] == 5
        assert not echoes.plane.any()


@pytest.mark.parametrize("range_limits_m", [(5.0, 5.0), (-1.0, 5.0), (0.0, math.inf), (9.0, 5.0)])
def test_range_window_must_make_sense(range_limits_m: tuple[float, float]) -> None:
    with pytest.raises(ConfigError, match="0 <= start < stop"):
        synthesize(many_paths(), RADAR, range_limits_m=range_limits_m)


def test_window_too_long_for_memory_is_refused() -> None:
    with pytest.raises(ConfigError, match="shorter range limits"):
        synthesize(many_paths(), RADAR, range_limits_m=(0.0, 1e9))


def test_chirp_of_one_sample_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"holds 1\.5 samples .* expected 2 to 4194304"):
        Waveform(5e9, 1e6, 1e-7, 15e6)
