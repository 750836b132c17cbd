# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths that share scatterers add up coherently: over mirrors, and over the same two in reverse.

**Mirrors** (`interference_factors`). Echoes of different scatterers have independent phases, so
their expected powers add up. Paths over one scatterer, direct and over mirrors, have its phase in
common. Their amplitudes a_i exp(j p_i) with p_i = mirror phase - k l_i interfere: the expected
power is the sum over all pairs of a_i a_j cos(p_i - p_j) o(l_i - l_j) with the overlap o of their
responses in range. Each path of a pair carries half of what both bring, so a path's own number may
be negative; sums over a range cell are not, as far as it resolves no pair.

**Reverses** (`reverse_factors`, `reverse_amplitudes`). A wave follows a path of two or more
reflections in both directions, and the table has both, found separately: A, B where the receiver
sees A, and B, A where it sees B. They have one phase of scattering, so both together have the mean
power P_AB + P_BA + 2 o sqrt(P_AB P_BA) cos(k d), with d the length of the reverse less that of the
path. Rays rarely find both paths of one pair of surface cells, so each path carries its half: its
power is multiplied by 1 + o cos(k d). In echoes, the paths A, B and B, A have independent phases,
and the amplitude has the root of this factor with the phase of 1 + o exp(-j k d). With antennas in
one place, d = 0 and the factor is 2. With antennas apart, d changes over the surfaces by many
wavelengths, and the mean power is the sum of both. An echo has one delay, so a taper over the band
does not change the factor: o is that without taper.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from ...arrays import Complex, Mask, Real, distances
from ...contract import PathsRecord
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..motion import AntennaMotion, PathImages, places_m
from ..paths import PathFlag, PathRows, Paths, has_images, images_of
from ..radar import Channel, window_at

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
    """Factors from the powers of paths by themselves (n,), with their gains, to their expected
    powers. Rows are of whole tile replicates; 1 for a path that shares its scatterer with no other.
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


def reverse_factors(
    rows: PathRows,
    record: PathsRecord,
    carrier_hz: float,
    range_resolution_m: float,
) -> Real:
    """Factors on the expected powers of rows of a table, (n,); 1 for a path without a reverse."""
    factors = np.ones(rows.size)
    chosen = np.flatnonzero(rows["flags"] & PathFlag.HAS_REVERSE)
    if record.receiver.kind == "orthographic" or not chosen.size:
        return factors
    mine = rows[chosen]
    receiver_m, transmitter_m = (
        np.asarray(one.matrix_world, dtype=np.float64)[:3, 3]
        for one in (record.receiver, record.transmitter)
    )
    if _in_one_place(receiver_m, transmitter_m, carrier_hz):
        factors[chosen] = 2.0
        return factors
    ends = mine["first_scatterer_m"], mine["last_scatterer_m"]
    longer_m, known = _longer_m(*ends, receiver_m, transmitter_m, images_of(mine, record.images))
    factors[chosen[known]] = _both(longer_m, carrier_hz, range_resolution_m).real[known]
    return factors


def reverse_amplitudes(
    paths: Paths,
    channel: Channel,
    antennas: AntennaMotion,
    carrier_hz: float,
    range_resolution_m: float,
) -> Complex | None:
    """Factors on the amplitudes of n speckled paths in a channel, elements at the frame's time;
    None where no path has a reverse.
    """
    chosen = np.flatnonzero(paths.flags & PathFlag.HAS_REVERSE)
    geometry = paths.geometry
    if antennas.orthographic or geometry is None or not chosen.size:
        return None
    now_s = np.zeros(1)
    receiver_m = places_m(antennas.receiver, now_s, np.asarray(channel.rx.position_m))[0]
    transmitter_m = places_m(antennas.transmitter, now_s, np.asarray(channel.tx.position_m))[0]
    factors = np.ones(len(paths), dtype=np.complex128)
    if _in_one_place(receiver_m, transmitter_m, carrier_hz):
        factors[chosen] = math.sqrt(2.0)
        return factors
    images = None if geometry.images is None else geometry.images.select(chosen)
    ends = geometry.first_scatterer_m[chosen], geometry.last_scatterer_m[chosen]
    longer_m, known = _longer_m(*ends, receiver_m, transmitter_m, images)
    both = _both(longer_m, carrier_hz, range_resolution_m)
    both *= np.sqrt(np.maximum(both.real, 0.0)) / np.maximum(np.abs(both), np.finfo(float).tiny)
    factors[chosen[known]] = both[known]
    return factors


def _in_one_place(receiver_m: Real, transmitter_m: Real, carrier_hz: float) -> bool:
    """Whether all paths are as long as their reverses, to 2e-3 wavelengths."""
    apart_m = float(np.linalg.norm(receiver_m - transmitter_m))
    return apart_m * carrier_hz <= 1e-3 * SPEED_OF_LIGHT_MPS


def _both(longer_m: Real, carrier_hz: float, range_resolution_m: float) -> Complex:
    """1 + o exp(-j k d), (n,); the real part is the factor on the power."""
    turned = np.exp(-2j * math.pi * carrier_hz / SPEED_OF_LIGHT_MPS * longer_m)
    return np.asarray(1 + range_overlap(longer_m, range_resolution_m) * turned)


def _longer_m(
    first_m: Real, last_m: Real, receiver_m: Real, transmitter_m: Real, images: PathImages | None
) -> tuple[Real, Mask]:
    """Lengths of reverses less those of paths (n,) [m], 0 where unknown, and where known."""
    receiver_here, receiver_there = receiver_m, receiver_m
    transmitter_here, transmitter_there = transmitter_m, transmitter_m
    if images is not None:  # the reverse goes over the other antenna's mirrors
        receiver_here, receiver_there = (images.places(end, receiver_m) for end in (0, 1))
        transmitter_here, transmitter_there = (images.places(end, transmitter_m) for end in (1, 0))
    longer_m = distances(first_m, transmitter_there) - distances(first_m, receiver_here)
    longer_m += distances(last_m, receiver_there) - distances(last_m, transmitter_here)
    known = np.isfinite(longer_m)
    return np.where(known, longer_m, 0.0), known
