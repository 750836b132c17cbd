# SPDX-License-Identifier: GPL-3.0-or-later
"""Beats of moving bodies against their closed form in continuous time.

The oracle knows bodies and a transmitter whose phase is phi(t) = 2 pi (f0 t + K t^2 / 2), and takes
the received phase phi(t - tau) less phi(t) at each sample, in extended precision: no frequencies,
no transform, no lengths of paths. De-chirped samples are exact so, at any bandwidth; a pulse's are
not, for a rectangular chirp has no band limit.
"""

from collections.abc import Callable

import numpy as np
import pytest

from radarsim_addon.signal.motion import LinearMotion, PathMotion
from radarsim_addon.signal.spectrum import (
    FrequencyGrid,
    Ramp,
    ReceiveWindow,
    Spectrum,
    SpectrumAccumulator,
)
from radarsim_addon.signal.spectrum.grid import SynthesisContext
from radarsim_addon.signal.spectrum.transform import RampTransform
from tests.signal.spectrum_oracle import LIGHT, Function, relative

Body = Callable[[np.longdouble], np.ndarray]

#: 77 GHz: 1 GHz in 51.2 us, chirps every 60 us. 5.3 GHz: 400 MHz in 102.4 us, every 400 us.
RADARS = {
    77e9: (2e13, 10e6, 512, 60e-6, 128),
    5.3e9: (4e12, 5e6, 512, 400e-6, 128),
}


def chirps(carrier_hz: float) -> tuple[FrequencyGrid, np.ndarray, float]:
    slope, rate_hz, samples, interval_s, count = RADARS[carrier_hz]
    grid = FrequencyGrid(carrier_hz, slope / rate_hz, samples)
    return grid, np.arange(count) * interval_s, slope


def beat(carrier_hz: float, body: Body, amplitude: np.ndarray) -> np.ndarray:
    """Received times conjugate of transmitted, (chirps, samples); no motion within a chirp."""
    slope, rate_hz, samples, interval_s, count = RADARS[carrier_hz]
    t = np.arange(samples).astype(np.longdouble) / np.longdouble(rate_hz)
    f0, k = np.longdouble(carrier_hz), np.longdouble(slope)
    result = np.zeros((count, samples), dtype=complex)
    for chirp in range(count):
        place = body(np.longdouble(chirp * interval_s))
        delay = 2 * np.sqrt((place**2).sum(axis=1)) / LIGHT
        for tau, a in zip(delay, amplitude, strict=True):
            then = f0 * (t - tau) + k * (t - tau) ** 2 / 2
            cycles = then - (f0 * t + k * t**2 / 2)
            result[chirp] += a * np.exp(2j * np.pi * (cycles - np.rint(cycles)).astype(float))
    return result


def form(carrier_hz: float, motion: PathMotion, amplitude: np.ndarray, **options) -> Spectrum:
    grid, times_s, slope = chirps(carrier_hz)
    accumulator = SpectrumAccumulator(
        grid, times_s, extra_cycles=lambda tau: slope * tau**2 / 2, **options
    )
    accumulator.add(motion, amplitude)
    return accumulator.result()


def motion_of(body: Body, moving: bool = True) -> PathMotion:
    """What a kinematics stage would hand over: lengths in float64."""

    def lengths(time_s: float) -> np.ndarray:
        place = body(np.longdouble(time_s)).astype(float)
        return 2 * np.linalg.norm(place, axis=1)

    return Function(lengths, np.full(lengths(0.0).size, moving))


def static(range_m: float) -> Body:
    rng = np.random.default_rng(4)
    place = range_m * np.array([1, 0, 0]) + rng.uniform(-1, 1, (12, 3))
    return lambda t: place.astype(np.longdouble)


def receding(range_m: float) -> Body:
    """30 m/s along the line of sight."""
    start = static(range_m)(np.longdouble(0))
    return lambda t: start + t * np.array([30, 0, 0])


def crossing(range_m: float) -> Body:
    """30 m/s across the line of sight: the range bends."""
    start = static(range_m)(np.longdouble(0))
    return lambda t: start + t * np.array([2, 30, 0])


def accelerating(range_m: float) -> Body:
    """10 g along the line of sight."""
    start = static(range_m)(np.longdouble(0))
    return lambda t: start + t**2 / 2 * np.array([98.0665, 0, 0])


def rotor(range_m: float) -> Body:
    """Two blades of 0.25 m whose tips go at 50 m/s (32 turns a second), tilted."""
    along = np.linspace(0.05, 0.25, 6)
    radius = np.concatenate([along, -along]).astype(np.longdouble)

    def place(t: np.longdouble) -> np.ndarray:
        angle = np.longdouble(50) / np.longdouble(0.25) * t
        x = range_m + radius * np.cos(angle)
        y = radius * np.sin(angle) * np.cos(np.longdouble(0.3))
        return np.stack([x, y, radius * np.sin(angle) * np.sin(np.longdouble(0.3))], axis=1)

    return place


def limb(range_m: float) -> Body:
    """A leg of 0.9 m that swings by 0.5 rad, twice a second, on a body that walks at 1.5 m/s."""
    along = np.linspace(0.1, 0.9, 9).astype(np.longdouble)

    def place(t: np.longdouble) -> np.ndarray:
        angle = np.longdouble(0.5) * np.sin(4 * np.longdouble(np.pi) * t)
        x = range_m + np.longdouble(1.5) * t + along * np.sin(angle)
        return np.stack([x, np.full(9, np.longdouble(0.2)), -along * np.cos(angle)], axis=1)

    return place


@pytest.mark.parametrize("range_m", [10.0, 100.0])
@pytest.mark.parametrize("carrier_hz", [77e9, 5.3e9])
@pytest.mark.parametrize("body", [static, receding, crossing, accelerating, rotor, limb])
def test_beat_against_continuous_time(body, carrier_hz, range_m) -> None:
    place = body(range_m)
    amplitude = np.random.default_rng(0).uniform(0.1, 1, place(np.longdouble(0)).shape[0])
    expected = beat(carrier_hz, place, amplitude)
    found = form(carrier_hz, motion_of(place, body is not static), amplitude)
    assert relative(found.values, expected) <= 1e-6
    kinds = {step.motion for step in found.report.steps}
    assert kinds == {"still"} if body is static else "still" not in kinds


def test_range_migration_over_many_bins() -> None:
    """300 m/s for 7.6 ms are 2.3 m, 15 range bins of 1 GHz; both ways of constant rates."""
    rng = np.random.default_rng(7)
    start = 40 + rng.uniform(-3, 3, 20)
    grid, times_s, _ = chirps(77e9)
    slope = np.longdouble(RADARS[77e9][0])
    amplitude = rng.normal(size=20)
    direction = np.array([1, 0, 0])
    expected = beat(
        77e9, lambda t: (start + np.longdouble(300) * t)[:, None] * direction, amplitude
    )
    motion = LinearMotion(2 * start, np.full(20, 300.0))
    for method in ("type3", "per-pulse"):
        found = form(77e9, motion, amplitude, method=method).values
        assert relative(found, expected) <= 1e-6
    # one path without its residual video phase, which type 3 does not take
    delay = 2 * (start[0] + np.longdouble(300) * times_s.astype(np.longdouble)) / LIGHT
    video = slope * delay**2 / 2
    turn = np.exp(2j * np.pi * (video - np.rint(video)).astype(float))[:, None]
    alone = beat(
        77e9,
        lambda t: (start[:1] + np.longdouble(300) * t)[:, None] * direction,
        amplitude[:1],
    )
    for method in ("type3", "per-pulse"):
        accumulator = SpectrumAccumulator(grid, times_s, method=method)
        accumulator.add(motion.select(slice(0, 1)), amplitude[:1])
        assert relative(accumulator.result().values * turn, alone) <= 1e-6
    bins = 2.3 / (299_792_458 / (2 * grid.step_hz * grid.count))
    peak = np.argmax(np.abs(np.fft.ifft(alone, axis=1)), axis=1)
    assert peak[-1] - peak[0] == pytest.approx(bins, abs=1.5)
    assert bins > 15


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("bend_m", [0.0, 1e-6, 3e-3])
def test_pulses_together_are_those_one_by_one(weighted: bool, bend_m: float) -> None:
    """Ramps of few paths, some of them beyond what is received, against the direct sum."""
    pulses, rows, count = 7, 30, 64
    rng = np.random.default_rng(1)
    ramp = Ramp(2e-7, 2e13)
    context = SynthesisContext.of(
        FrequencyGrid(77e9, 4e6, count), ReceiveWindow(1e-7, 2.4e-7), None, ramp, None
    )  # fmt: skip
    middle_m = rng.uniform(2.0, 80.0, (pulses, rows))
    moved_m = rng.uniform(-40, 40, (pulses, rows)) * ramp.half_s(count)
    lengths_m = np.stack([middle_m - moved_m, middle_m, middle_m + moved_m + bend_m], axis=1)
    weights = rng.normal(size=(pulses, rows) if weighted else rows) + 0j
    ways = {name: RampTransform(context, 1e-6, name) for name in ("finufft", "direct")}
    together = list(ways["finufft"].pulses(lengths_m, weights, None))
    assert len(together) == pulses
    for number, found in enumerate(together):
        own = weights[number] if weighted else weights
        exact = ways["direct"](lengths_m[number], own)
        assert found.kept == exact.kept < rows
        assert relative(found.values, exact.values) < 1e-7
        assert found.error.energy == pytest.approx(exact.error.energy, rel=1e-12)
