# SPDX-License-Identifier: GPL-3.0-or-later
"""Expected power of paths that share a scatterer: direct and over mirrors, they add up in phase.

Echoes of different scatterers have independent phases, so their expected powers add up. Paths over
one scatterer have its phase in common. Their amplitudes a_i exp(j p_i) with p_i = mirror phase -
k l_i interfere: the expected power is the sum over all pairs of a_i a_j cos(p_i - p_j) o(l_i - l_j)
with the overlap o of their responses in range. Each path of a pair carries half of what both bring,
so a path's own number may be negative; sums over a range cell are not, as far as it resolves no
pair.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from ...array_types import Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..paths import PathRows, has_images
from ..radar import window_at

#: Points of a band in the overlap of two responses.
_BAND_POINTS = 257
#: Turns of the phase over the band from which on responses do not overlap (1 % without a taper),
#: and steps of the table in a turn, which leave 3e-5.
_MOST_TURNS, _STEPS = 32, 128


def interference_factors(
    rows: PathRows,
    power_w: Real,
    carrier_hz: float,
    range_resolution_m: float,
    range_taper: str = "none",
) -> Real:
    """Return the factors from the powers of paths to their expected powers.

    Parameters
    ----------
    rows
        Of whole tile replicates, (n,).
    power_w
        Power of each path by itself, with its gains, (n,).
    carrier_hz
        Carrier [Hz].
    range_resolution_m
        c / (2 bandwidth) [m].
    range_taper
        Taper over the band, by name.

    Returns
    -------
    ndarray
        (n,); 1 for a path that shares its scatterer with no other.
    """
    factors = np.ones(rows.size)
    if not has_images(rows):
        return factors
    shared = np.flatnonzero((rows["point"] > 0) & (power_w > 0))
    keys = [rows[name][shared] for name in ("point", "replicate", "tile")]
    shared = shared[np.lexsort(keys)]
    keys = [rows[name][shared] for name in ("point", "replicate", "tile")]
    wave = 2 * math.pi * carrier_hz / SPEED_OF_LIGHT_MPS
    length_m = rows["length_m"][shared]
    phase = rows["mirror_phase_rad"][shared] - wave * length_m
    amplitude = np.sqrt(power_w[shared])
    added, apart = np.zeros(shared.size), 0
    while True:
        apart += 1
        first = np.flatnonzero(
            np.logical_and.reduce([key[apart:] == key[: key.size - apart] for key in keys])
        )
        if not first.size:
            break
        other = first + apart
        both = np.cos(phase[first] - phase[other])
        both *= range_overlap(length_m[first] - length_m[other], range_resolution_m, range_taper)
        np.add.at(added, first, both * amplitude[other] / amplitude[first])
        np.add.at(added, other, both * amplitude[first] / amplitude[other])
    factors[shared] += added
    return factors


def range_overlap(apart_m: Real, range_resolution_m: float, taper: str = "none") -> Real:
    """Correlation of range responses whose total lengths differ."""
    # A difference d of the length turns the phase over the band by 2 pi B d / c.
    turns = np.abs(apart_m / (2 * range_resolution_m))
    return np.asarray(np.interp(turns, *_overlap_table(taper), right=0.0))


@lru_cache(maxsize=16)
def _overlap_table(taper: str) -> tuple[Real, Real]:
    """Turns of the phase over the band, and the correlation there."""
    place = (np.arange(_BAND_POINTS) + 0.5) / _BAND_POINTS - 0.5
    weight = window_at(taper, place) ** 2
    grid = np.arange(_MOST_TURNS * _STEPS + 1) / _STEPS
    return grid, np.cos(2 * np.pi * grid[:, None] * place) @ weight / weight.sum()
