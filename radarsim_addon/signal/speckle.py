# SPDX-License-Identifier: GPL-3.0-or-later
"""Random phases of rough scatterers: seeded, one for each path, constant over the pulses.

A pixel of a rough surface stands for many scatterers whose heights differ by more than a
wavelength: its phase is anything. Without that, neighbouring pixels of a smooth mesh add up in
phase, and the level of an echo grows with the number of pixels; with it, the mean power is the sum
of the powers, and the map shows speckle as a radar's does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .paths import Paths

Complex = NDArray[np.complex128]

_U64 = np.uint64


def path_phasors(paths: Paths, seed: int) -> Complex:
    """exp(j phi) of each path, |.| = 1, phi uniform and independent from path to path.

    phi depends on where the path was found (ring, row, column; the row of the table) and on the
    seed alone, so it is the same however the paths are split into parts.

    Parameters
    ----------
    paths
        Paths.
    seed
        Any whole number; another one is another realisation of the speckle.
    """
    state = np.full(len(paths), seed % 2**64, dtype=_U64)
    for part in (paths.ring, paths.row, paths.col):
        state = _mix(state ^ part.astype(np.int64).view(_U64))
    # 53 bits are what a float64 in [0, 1) holds.
    phase = (state >> _U64(11)).astype(np.float64) * (2 * np.pi / 2**53)
    return np.asarray(np.exp(1j * phase))


def _mix(state: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """One step of SplitMix64 (Steele, Lea, Flood 2014): every bit depends on every other."""
    with np.errstate(over="ignore"):
        state = state + _U64(0x9E3779B97F4A7C15)
        state = (state ^ (state >> _U64(30))) * _U64(0xBF58476D1CE4E5B9)
        state = (state ^ (state >> _U64(27))) * _U64(0x94D049BB133111EB)
    return np.asarray(state ^ (state >> _U64(31)))
