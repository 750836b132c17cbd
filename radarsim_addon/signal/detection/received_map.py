# SPDX-License-Identifier: GPL-3.0-or-later
"""The map over all ranges whose echoes are in the samples, on which detection works."""

from __future__ import annotations

from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..echoes import Echoes
from ..maps import RangeDopplerMap, RangeProfiles, Recording


def _heard_window_m(echoes: Echoes) -> tuple[float, float]:
    """Return the ranges with echoes in the samples, complete or in part [m].

    All of them for sampled frequencies; for pulses a pulse's length more than the range limits.
    """
    waveform = echoes.radar.waveform
    if waveform.family == "line":
        return 0.0, waveform.unambiguous_range_m
    start_m, stop_m = echoes.range_limits_m
    reach_m = SPEED_OF_LIGHT_MPS * waveform.duration_s / 2
    return max(start_m - reach_m, 0.0), stop_m + reach_m


def received_recording(
    echoes: Echoes, rd_map: RangeDopplerMap, mti: int, compressed: RangeProfiles | None = None
) -> Recording:
    """Return the map over all ranges with echoes in the samples.

    Parameters
    ----------
    echoes, rd_map
        Samples and range-Doppler map.
    mti
        Pulses of the canceller of the map, 0 for none.
    compressed
        Profiles that the map was made of, before the canceller; None: compute them.

    Returns
    -------
    Recording
        The extended map with the samples.
    """
    return Recording.over(echoes, _heard_window_m(echoes), rd_map, mti, compressed)
