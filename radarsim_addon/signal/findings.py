# SPDX-License-Identifier: GPL-3.0-or-later
"""Edges and movers that a frame's summary names."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from ..physics.constants import SPEED_OF_LIGHT_MPS
from .compress import PowerProfile, compress, expected_power_profile
from .config import Radar
from .detect import LeadingEdge, Peak, find_peaks, leading_edges
from .echoes import Echoes
from .mti import cancel
from .paths import make_paths
from .rangedoppler import RangeDopplerMap, range_doppler

#: Below the strongest cell by more than this is rounding, not an echo: float32 renders. Less where
#: the tolerance of the synthesis is coarse [dB].
MAP_DYNAMICS_DB = 160.0

#: Least level of a mover over the mean noise of a cell [dB].
_OVER_NOISE_DB = 15.0
#: Range cells in which a weak mover is taken for a sidelobe of a strong one.
_SIDELOBE_CELLS = 64
#: Cells (Doppler, range) around a peak in which no weaker one is taken.
_GUARD_CELLS = (4, 8)
#: What is no more than this above a stronger peak's response to one path is its sidelobe [dB].
_SIDELOBE_DB = 6.0


def dynamics_db(tolerance: float) -> float:
    """How far below the strongest cell an echo can be told from the error of the synthesis [dB]."""
    return min(MAP_DYNAMICS_DB, 20 - 20 * math.log10(tolerance))


def _paired_reach_m(radar: Radar) -> float:
    """How far from a strong echo its paired echoes may lie: a pulse's length."""
    if radar.waveform.family != "pulse":
        return 0.0
    return SPEED_OF_LIGHT_MPS * radar.waveform.duration_s / 2


def _without_sidelobes(profile: PowerProfile, found: list[LeadingEdge]) -> list[LeadingEdge]:
    """Edges that stand out of what stronger peaks show of themselves at their range."""
    kept: list[LeadingEdge] = []
    window_m = (float(profile.range_m[0]), float(profile.range_m[-1]))
    step_m = float(profile.range_m[1] - profile.range_m[0]) if profile.range_m.size > 1 else 1.0
    sidelobes = np.zeros_like(profile.power)
    for edge in sorted(found, key=lambda item: -item.level_db):
        place = int(np.argmin(np.abs(profile.range_m - edge.peak_range_m)))
        # their envelope: a peak of them is two cells wide
        reach = 2 * math.ceil(profile.radar.waveform.sample_spacing_m / step_m)
        near = sidelobes[max(0, place - reach) : place + reach + 1].max(initial=0.0)
        if 10 ** (edge.level_db / 10) <= near * 10 ** (_SIDELOBE_DB / 10):
            continue
        kept.append(edge)
        point = expected_power_profile(
            make_paths(1.0, 2 * edge.peak_range_m),
            profile.radar,
            window_m=window_m,
            window=profile.window,
        ).power
        count = min(point.size, sidelobes.size)
        strength = 10 ** (edge.level_db / 10) / max(float(point.max()), 1e-300)
        sidelobes[:count] += strength * point[:count]
    return [edge for edge in found if edge in kept]


def find_edges(profile: PowerProfile) -> list[LeadingEdge]:
    """Leading edges, without the paired echoes of stronger ones: see `find_movers`.

    Of waveforms that sample frequencies the sidelobes of stronger peaks are no edges either.
    """
    reach_m = _paired_reach_m(profile.radar)
    found = leading_edges(profile, 12, by="prominence")
    if profile.radar.waveform.family == "line":
        found = _without_sidelobes(profile, found)
    return [
        edge
        for edge in found
        if not any(
            abs(edge.peak_range_m - other.peak_range_m) <= 1.02 * reach_m
            and edge.level_db < other.level_db - 28
            for other in found
        )
    ][:5]


def peaks_beyond(
    echoes: Echoes, rd_map: RangeDopplerMap, mti: int, slowest_mps: float
) -> list[Peak]:
    """Peaks outside the range window, whose sidelobes may lie within it.

    Where frequencies are sampled the samples hold all ranges. Of pulses the window's samples hold
    the part of an echo that reaches into the window; the peak's level is raised by what the cut
    takes off, at most 20 dB. `mti` is that of `rd_map`; `slowest_mps` as in `find_movers`.
    """
    if rd_map.radar.burst.pulses < 16:
        return []
    waveform = rd_map.radar.waveform
    start_m, stop_m = echoes.window_m
    half_m = _paired_reach_m(rd_map.radar) / 2
    line = waveform.family == "line"
    low_m = 0.0 if line else start_m - half_m
    high_m = waveform.unambiguous_range_m if line else stop_m + half_m
    cell_m = 2 * waveform.sample_spacing_m
    sides = [(low_m, start_m - cell_m), (stop_m + cell_m, high_m)]
    sides = [side for side in sides if side[1] > side[0]]
    if not sides:
        return []
    wide = compress(dataclasses.replace(echoes, window_m=(low_m, high_m)), rd_map.window)
    wide_map = range_doppler(cancel(wide, mti) if mti else wide, rd_map.doppler_window)
    found = []
    for side in sides:
        for peak in find_peaks(
            wide_map, 10, min_speed_mps=slowest_mps, range_m=side, min_above_db=10.0
        ):
            outside_m = max(start_m - peak.range_m, peak.range_m - stop_m)
            heard = 1.0 if line else max(1 - outside_m / max(half_m, cell_m), 0.1)
            level_db = peak.level_db - 20 * math.log10(heard)
            found.append(dataclasses.replace(peak, level_db=level_db))
    return found


def find_movers(
    rd_map: RangeDopplerMap,
    slowest_mps: float,
    tolerance: float,
    noise_power: float = 0.0,
    beyond: Sequence[Peak] = (),
) -> list[Peak]:
    """Peaks off the 0 Hz stripe; none where there are too few pulses to tell.

    A chirp of low time-bandwidth product has paired echoes up to its own length away, some 38 dB
    down whatever the window (the Fresnel ripple of its spectrum): peaks 30 dB below a stronger
    one at the same speed within that distance are taken for these, and at any speed those 40 dB
    below it, where the Doppler window has its sidelobes. `noise_power` is the mean thermal noise of
    a cell: what does not stand 15 dB above it is not told from noise (1e-14 a cell). `beyond` are
    peaks outside the window: see `peaks_beyond`.
    """
    if rd_map.radar.burst.pulses < 16:
        return []
    reach_m = _paired_reach_m(rd_map.radar)
    if rd_map.radar.waveform.family == "line":
        # no paired echoes, but windows whose sidelobes hardly fall off: at its own speed a peak
        # 40 dB down is one at any range
        reach_m = _SIDELOBE_CELLS * rd_map.radar.waveform.sample_spacing_m
    same_mps = 2 * rd_map.radar.velocity_resolution_mps
    step_m = float(rd_map.range_m[1] - rd_map.range_m[0]) if rd_map.range_m.size > 1 else 0.0
    kept: list[Peak] = []
    floor_db = float(rd_map.power_db.max()) - dynamics_db(tolerance)
    if noise_power > 0:
        floor_db = max(floor_db, 10 * math.log10(noise_power) + _OVER_NOISE_DB)
    for peak in find_peaks(rd_map, 20, min_speed_mps=slowest_mps, min_above_db=10.0):
        if peak.level_db < floor_db:
            continue
        others = [*beyond, *kept]
        near = [other for other in others if abs(peak.range_m - other.range_m) < reach_m]
        hidden = any(
            peak.level_db < other.level_db - 40
            or (
                peak.level_db < other.level_db - 30
                and abs(peak.velocity_mps - other.velocity_mps) < same_mps
            )
            for other in near
        )
        if rd_map.radar.waveform.family == "line":
            hidden = hidden or any(
                peak.level_db < other.level_db - 40
                and abs(peak.velocity_mps - other.velocity_mps) < same_mps
                for other in others
            )
        # a peak outside the window has the guard cells of `find_peaks`, too
        hidden = hidden or any(
            peak.level_db < other.level_db
            and abs(peak.range_m - other.range_m) <= _GUARD_CELLS[1] * step_m
            and abs(peak.velocity_mps - other.velocity_mps) <= _GUARD_CELLS[0] * same_mps / 2
            for other in beyond
        )
        if not hidden:
            kept.append(peak)
    return kept[:5]
