# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies whose paths move almost alike, interpolated between a few times of the burst."""

import numpy as np
import pytest

from radarsim_addon.signal.motion import LinearMotion
from radarsim_addon.signal.spectrum import (
    AmplitudeHistory,
    CodeShape,
    FrequencyGrid,
    Ramp,
    ReceiveWindow,
    SpectrumAccumulator,
    all_pulses,
)
from tests.signal.spectrum_oracle import Function, direct_sum, relative

PULSES, ROWS = 128, 12
#: 77 GHz, 128 MHz, 40 m of unambiguous path more than there is.
GRID = FrequencyGrid(77e9, 4e6, 32)
TIMES_S = np.arange(PULSES) * 50e-6


def two_bodies(bend_mps2: float, apart_mps: float = 0.2) -> tuple[Function, np.ndarray]:
    """Rows of two bodies, and the most by which rates of either differ from its own."""
    rng = np.random.default_rng(5)
    length_m = rng.uniform(20, 60, 2 * ROWS)
    rate_mps = np.repeat([30.0, -24.0], ROWS) + rng.uniform(-apart_mps, apart_mps, 2 * ROWS)
    bend = bend_mps2 * rng.uniform(0.5, 1, 2 * ROWS)

    def lengths_m(time_s):
        return length_m + rate_mps * time_s + bend * time_s**2

    phase = rng.uniform(0, 2 * np.pi, 2 * ROWS)
    return Function(lengths_m, np.ones(2 * ROWS, dtype=bool)), np.exp(1j * phase)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-9])
def test_against_the_sum(tolerance) -> None:
    motion, amplitude = two_bodies(5.0)
    accumulator = SpectrumAccumulator(GRID, TIMES_S, tolerance=tolerance)
    accumulator.add(motion, amplitude)
    found = accumulator.result()
    expected = direct_sum(GRID, TIMES_S, motion.lengths, amplitude)
    assert relative(found.values, expected) <= tolerance
    assert relative(found.values, expected) <= found.report.error_bound
    (step,) = found.report.steps
    assert (step.motion, step.transform, step.paths) == ("smooth", "interpolated", 2 * ROWS)
    assert step.transforms < PULSES / 2, "nodes of both bodies"
    assert found.report.outside == 0


def test_constant_rates_within_a_sweep() -> None:
    """One body whose paths keep their rates, frequencies one after the other."""
    motion, amplitude = two_bodies(0.0)
    start_m = motion.lengths(0.0)[:ROWS]
    linear = LinearMotion(start_m, (motion.lengths(1.0)[:ROWS] - start_m) / 2)
    found = {}
    for method in ("auto", "direct"):
        accumulator = SpectrumAccumulator(
            FrequencyGrid(77e9, 1e6, 256), np.arange(256) * 30e-6, method=method,
            ramp=Ramp(1e-7, 1e13),
        )  # fmt: skip
        accumulator.add(linear, amplitude[:ROWS])
        found[method] = accumulator.result()
    assert relative(found["auto"].values, found["direct"].values) < 1e-6
    (step,) = found["auto"].report.steps
    assert (step.motion, step.transform) == ("linear", "interpolated")


def test_motion_within_codes() -> None:
    """Motion within a code mixes its frequencies: phases differ by those of the whole band."""
    code = np.sign(np.random.default_rng(6).normal(size=32)).astype(complex)
    motion, amplitude = two_bodies(0.01, 0.0)
    found = {}
    for method in ("auto", "direct"):
        accumulator = SpectrumAccumulator(
            FrequencyGrid(77e9, 15e6, 32), TIMES_S, method=method, pulse=CodeShape(code, 480e6)
        )
        accumulator.add(motion, amplitude)
        found[method] = accumulator.result()
    assert relative(found["auto"].values, found["direct"].values) < 1e-6
    assert [step.transform for step in found["auto"].report.steps] == ["interpolated"]


@pytest.mark.parametrize(("more_s", "way"), [(1.0, "interpolated"), (0.0, "type 3")])
def test_paths_that_leave_the_window_in_a_sweep(
    more_s: float, way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The others go one of the ways; what is received of those that leave is as pulse by pulse."""
    monkeypatch.setattr(all_pulses, "_BLOCK_3", more_s)
    motion, amplitude = two_bodies(5.0)
    found = {}
    for method in ("auto", "direct"):
        accumulator = SpectrumAccumulator(
            GRID, TIMES_S, method=method, ramp=Ramp(1e-6, 4e12),
            listening=ReceiveWindow(-1e-30, 1.9e-7),
        )  # fmt: skip
        accumulator.add(motion, amplitude)
        found[method] = accumulator.result()
    assert relative(found["auto"].values, found["direct"].values) < 1e-6
    ways = {step.transform for step in found["auto"].report.steps}
    assert ways == {way, "pulse by pulse"}
    assert found["auto"].report.outside == pytest.approx(found["direct"].report.outside)
    assert 0 < found["auto"].report.outside < 2 * ROWS


def test_amplitudes_that_change() -> None:
    """Amplitudes of several terms in slow time, as where a beam turns."""
    motion, amplitude = two_bodies(5.0)
    span_s = TIMES_S[-1]
    changes = np.linspace(0.2, 1.5, amplitude.size)

    def at(times_s, rows):
        return amplitude[rows, None] * np.exp(-(np.outer(changes[rows], times_s / span_s) ** 2))

    history = AmplitudeHistory(amplitude, np.ones(amplitude.size, dtype=bool), at)
    accumulator = SpectrumAccumulator(GRID, TIMES_S)
    accumulator.add(motion, history)
    found = accumulator.result()
    every = np.arange(amplitude.size)
    expected = np.stack([
        direct_sum(GRID, time_s[None], motion.lengths, at(time_s[None], every)[:, 0])[0]
        for time_s in TIMES_S
    ])  # fmt: skip
    assert relative(found.values, expected) < 1e-6
    assert [step.transform for step in found.report.steps] == ["interpolated"]
