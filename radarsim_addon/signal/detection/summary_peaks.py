# SPDX-License-Identifier: GPL-3.0-or-later
"""Leading edges that a frame's summary lists."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..maps import PowerProfile, expected_power_profile
from ..paths import make_paths
from ..radar import Radar
from .peaks import LeadingEdge, leading_edges

#: Dynamic range of a profile of expected power: its convolution rounds at 1e-16 of the largest
#: value times the square root of its length [dB].
PROFILE_DYNAMICS_DB = 130.0
#: An edge up to this far above a stronger peak's response to one path is its sidelobe [dB].
_SIDELOBE_DB = 6.0
#: Smallest distance of two peaks [range resolutions]: a main lobe of Hamming between its nulls.
_SEPARATION = 4.0
#: Peaks that are looked at, the most prominent ones, and leading edges that a summary lists.
_MAX_PEAKS, MAX_EDGES = 50, 5


def _paired_reach_m(radar: Radar) -> float:
    """Return how far from a strong echo its paired echoes may be: a pulse's length [m]."""
    if radar.waveform.family != "pulse":
        return 0.0
    return SPEED_OF_LIGHT_MPS * radar.waveform.duration_s / 2


def _without_sidelobes(profile: PowerProfile, found: list[LeadingEdge]) -> list[LeadingEdge]:
    """Return the edges that exceed the responses of stronger peaks at their range."""
    kept: list[LeadingEdge] = []
    range_limits_m = (float(profile.range_m[0]), float(profile.range_m[-1]))
    step_m = float(profile.range_m[1] - profile.range_m[0]) if profile.range_m.size > 1 else 1.0
    sidelobes = np.zeros_like(profile.power)
    for edge in sorted(found, key=lambda item: -item.level_db):
        place = int(np.argmin(np.abs(profile.range_m - edge.peak_range_m)))
        # the envelope of sidelobes: each is two cells wide
        reach = 2 * math.ceil(profile.radar.waveform.sample_spacing_m / step_m)
        near = sidelobes[max(0, place - reach) : place + reach + 1].max(initial=0.0)
        if 10 ** (edge.level_db / 10) <= near * 10 ** (_SIDELOBE_DB / 10):
            continue
        kept.append(edge)
        point = expected_power_profile(
            make_paths(1.0, 2 * edge.peak_range_m),
            profile.radar,
            range_limits_m=range_limits_m,
            range_taper=profile.range_taper,
        ).power
        count = min(point.size, sidelobes.size)
        strength = 10 ** (edge.level_db / 10) / max(float(point.max()), 1e-300)
        sidelobes[:count] += strength * point[:count]
    return [edge for edge in found if edge in kept]


def find_edges(profile: PowerProfile) -> list[LeadingEdge]:
    """Find leading edges, without sidelobes and paired echoes of stronger ones.

    Parameters
    ----------
    profile
        Expected power against range.

    Returns
    -------
    list of LeadingEdge
        By falling prominence; the summary lists `MAX_EDGES` of them.

    Notes
    -----
    A chirp of low time-bandwidth product has paired echoes up to its own length away, some 38 dB
    down with any taper (the Fresnel ripple of its spectrum). Levels more than `PROFILE_DYNAMICS_DB`
    below the strongest are rounding.
    """
    reach_m = _paired_reach_m(profile.radar)
    least = float(profile.power.max(initial=0.0)) * 10 ** (-PROFILE_DYNAMICS_DB / 10)
    profile = dataclasses.replace(profile, power=np.maximum(profile.power, least))
    separation_m = _SEPARATION * profile.radar.waveform.range_resolution_m
    found = leading_edges(profile, _MAX_PEAKS, by="prominence", separation_m=separation_m)
    found = _without_sidelobes(profile, found)
    return [
        edge
        for edge in found
        if not any(
            abs(edge.peak_range_m - other.peak_range_m) <= 1.02 * reach_m
            and edge.level_db < other.level_db - 28
            for other in found
        )
    ]
