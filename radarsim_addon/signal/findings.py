# SPDX-License-Identifier: GPL-3.0-or-later
"""Edges and movers that a frame's summary names."""

from __future__ import annotations

import math

from ..physics.constants import SPEED_OF_LIGHT_MPS
from .compress import PowerProfile
from .config import Radar
from .detect import LeadingEdge, Peak, find_peaks, leading_edges
from .rangedoppler import RangeDopplerMap

#: Below the strongest cell by more than this is rounding, not an echo: float32 renders. Less where
#: the tolerance of the synthesis is coarse [dB].
MAP_DYNAMICS_DB = 160.0

#: Least level of a mover over the mean noise of a cell [dB].
_OVER_NOISE_DB = 15.0
#: Levels below the strongest at which sidelobes without a window are taken for these [dB].
_UNWINDOWED_DB = 33.0


def dynamics_db(tolerance: float) -> float:
    """How far below the strongest cell an echo can be told from the error of the synthesis [dB]."""
    return min(MAP_DYNAMICS_DB, 20 - 20 * math.log10(tolerance))


def _paired_reach_m(radar: Radar) -> float:
    """How far from a strong echo its paired echoes may lie: a pulse's length."""
    if radar.waveform.family != "pulse":
        return 0.0
    return SPEED_OF_LIGHT_MPS * radar.waveform.duration_s / 2


def find_edges(profile: PowerProfile) -> list[LeadingEdge]:
    """Leading edges, without the paired echoes of stronger ones: see `find_movers`.

    Without a window over the band the sidelobes of the strongest peak are no edges either: 20
    resolutions away, where the next edge may be, they are 36 dB below it.
    """
    reach_m = _paired_reach_m(profile.radar)
    found = leading_edges(profile, 12, by="prominence")
    if profile.window == "none" and found:
        top_db = max(edge.level_db for edge in found)
        found = [edge for edge in found if edge.level_db > top_db - _UNWINDOWED_DB]
    return [
        edge
        for edge in found
        if not any(
            abs(edge.peak_range_m - other.peak_range_m) <= 1.02 * reach_m
            and edge.level_db < other.level_db - 28
            for other in found
        )
    ][:5]


def find_movers(
    rd_map: RangeDopplerMap, slowest_mps: float, tolerance: float, noise_power: float = 0.0
) -> list[Peak]:
    """Peaks off the 0 Hz stripe; none where there are too few pulses to tell.

    A chirp of low time-bandwidth product has paired echoes up to its own length away, some 38 dB
    down whatever the window (the Fresnel ripple of its spectrum): peaks 30 dB below a stronger
    one at the same speed within that distance are taken for these, and at any speed those 40 dB
    below it, where the Doppler window has its sidelobes. `noise_power` is the mean thermal noise of
    a cell: what does not stand 15 dB above it is not told from noise (1e-14 a cell).
    """
    if rd_map.radar.burst.pulses < 16:
        return []
    reach_m = _paired_reach_m(rd_map.radar)
    same_mps = 2 * rd_map.radar.velocity_resolution_mps
    kept: list[Peak] = []
    floor_db = float(rd_map.power_db.max()) - dynamics_db(tolerance)
    if noise_power > 0:
        floor_db = max(floor_db, 10 * math.log10(noise_power) + _OVER_NOISE_DB)
    for peak in find_peaks(rd_map, 20, min_speed_mps=slowest_mps, min_above_db=10.0):
        if peak.level_db < floor_db:
            continue
        near = [other for other in kept if abs(peak.range_m - other.range_m) < reach_m]
        hidden = any(
            peak.level_db < other.level_db - 40
            or (
                peak.level_db < other.level_db - 30
                and abs(peak.velocity_mps - other.velocity_mps) < same_mps
            )
            for other in near
        )
        if not hidden:
            kept.append(peak)
    return kept[:5]
