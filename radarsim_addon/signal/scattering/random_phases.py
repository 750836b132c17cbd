# SPDX-License-Identifier: GPL-3.0-or-later
"""Random phases of rough scatterers: seeded, one for each path, constant over the pulses.

Paths of a table have scatterers that are tied to the surface, see
:mod:`.scattering.surface_speckle`; these here are for rings, whose pixels know no surface, and for
what is left.

A pixel of a rough surface stands for many scatterers whose heights differ by more than a
wavelength: its phase is anything. Without that, neighbouring pixels of a smooth mesh add up in
phase, and the level of an echo grows with the number of pixels; with it, the mean power is the sum
of the powers, and the map shows speckle as a radar's does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...array_types import Complex
from ..paths import Paths

_U64 = np.uint64


def path_phasors(paths: Paths, seed: int) -> Complex:
    """Return the complex factor of each path's amplitude.

    It is that of the surface's scatterers where the paths have one (see
    :mod:`.scattering.surface_speckle`). Else exp(j phi), phi uniform and independent from path to
    path; phi depends on where the path was found (ring, row, column; the row of the table) and on
    the seed alone, so it is the same however the paths are split into parts.

    Parameters
    ----------
    paths
        Paths.
    seed
        Any whole number; another one is another realisation of the speckle.

    Returns
    -------
    ndarray
        Complex, (paths,).
    """
    if paths.phasors is not None and not np.isnan(paths.phasors).any():
        return paths.phasors
    state = np.full(len(paths), seed % 2**64, dtype=_U64)
    for part in (paths.ring, paths.row, paths.col):
        state = hash_step(state ^ part.astype(np.int64).view(_U64))
    random: Complex = np.exp(2j * np.pi * uniform(state))
    if paths.phasors is None:
        return random
    # NaN: the paths of which the surface's scatterers are not known
    return np.where(np.isnan(paths.phasors), random, paths.phasors)


def uniform(state: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Hashes as numbers in [0, 1): 53 bits are what a float64 holds there."""
    return np.asarray((state >> _U64(11)).astype(np.float64) / 2**53)


def hash_step(state: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """One step of SplitMix64 (Steele, Lea, Flood 2014): every bit depends on every other."""
    with np.errstate(over="ignore"):
        state = state + _U64(0x9E3779B97F4A7C15)
        state = (state ^ (state >> _U64(30))) * _U64(0xBF58476D1CE4E5B9)
        state = (state ^ (state >> _U64(27))) * _U64(0x94D049BB133111EB)
    return np.asarray(state ^ (state >> _U64(31)))
