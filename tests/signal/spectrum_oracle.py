# SPDX-License-Identifier: GPL-3.0-or-later
"""The sum that the synthesis stands for, term by term in extended precision; and test motions."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from radarsim_addon.signal.motion.kinematics import Rows
from radarsim_addon.signal.spectrum import FrequencyGrid

LIGHT = np.longdouble(299_792_458)

#: Lengths of all paths at a time [m].
Lengths = Callable[[np.longdouble], np.ndarray]


def direct_sum(
    grid: FrequencyGrid,
    times_s: np.ndarray,
    lengths: Lengths,
    amplitude: np.ndarray,
    extra: Callable[[np.ndarray], np.ndarray] | None = None,
) -> np.ndarray:
    """S[m, n] with phases in long double: 64 bits of mantissa on this machine's kind."""
    n = np.arange(grid.count).astype(np.longdouble)
    frequency = np.longdouble(grid.start_hz) + n * np.longdouble(grid.step_hz)
    result = np.zeros((times_s.size, grid.count), dtype=complex)
    for m, time_s in enumerate(times_s):
        delay = np.asarray(lengths(np.longdouble(time_s)), dtype=np.longdouble) / LIGHT
        more = 0 if extra is None else extra(delay)
        for k, f in enumerate(frequency):
            cycles = more - f * delay
            cycles -= np.rint(cycles)
            result[m, k] = np.sum(amplitude * np.exp(2j * np.pi * cycles.astype(float)))
    return result


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    """Relative L2 error."""
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


@dataclass(frozen=True)
class Function:
    """A motion from a formula: lengths of all paths at one time."""

    lengths: Callable[[float], np.ndarray]
    moving: np.ndarray

    def lengths_m(self, times_s: np.ndarray, rows: Rows) -> np.ndarray:
        columns = [np.asarray(self.lengths(t), dtype=float)[rows] for t in times_s]
        return np.stack(columns, axis=1)

    def select(self, rows: Rows) -> "Function":
        return Function(lambda t: self.lengths(t)[rows], self.moving[rows])
