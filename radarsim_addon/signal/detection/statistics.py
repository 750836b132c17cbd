# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums over the paths of a radar frame, and warnings about them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..decoding import FrameInput, iter_path_chunks
from ..paths import PathCounts, PathFlag, Paths, path_power_w
from ..radar import Radar
from ..runs import RadarFrame

#: Share of the received power in mixed pixels above which a frame carries a warning.
MIXED_POWER_WARNING = 0.05

_BEYOND_PRF = (
    "(c / 2 PRF). Echoes that fall into the range window stand folded, as in a radar. "
    "Lower the PRF to be rid of the ambiguity."
)
#: What becomes of paths beyond the unambiguous range, by kind of waveform.
_BEYOND = {
    "fmcw": "(the ADC's band). The anti-alias filter takes them out. Sample faster, or lower the "
    "slope.",
    "stepped": "(c / 2 step). They fold back, as in a radar. Take smaller steps to be rid of the "
    "ambiguity.",
    "pmcw": "(the code's length). They fold back, as in a radar. Take a longer code to be rid of "
    "the ambiguity.",
}


@dataclass(frozen=True)
class FrameStatistics:
    """Sums over the paths of one frame.

    Attributes
    ----------
    counts
        Numbers of paths and of their flags.
    power_w
        Sum of the received powers [W].
    mixed_power_fraction
        Fraction of it in pixels that mix several ranges.
    nearest_m, farthest_m
        One-way ranges of the nearest and the farthest path [m]; None without paths.
    beyond_unambiguous_range, beyond_max_velocity
        Numbers of paths.
    outside_range_limits
        Number of paths that the range limits exclude (mean over the pulses).
    """

    counts: PathCounts
    power_w: float
    mixed_power_fraction: float
    nearest_m: float | None
    farthest_m: float | None
    beyond_unambiguous_range: int
    beyond_max_velocity: int
    outside_range_limits: float


class StatisticsSum:
    """Running statistics over chunks of paths.

    Parameters
    ----------
    radar
        Waveform and burst.
    receiver_gain
        G_r, linear.
    """

    def __init__(self, radar: Radar, receiver_gain: float) -> None:
        self._radar, self._gain = radar, receiver_gain
        self._counts = PathCounts()
        self._power = self._mixed = 0.0
        self._far = self._fast = 0
        self._nearest, self._farthest = np.inf, -np.inf

    def add(self, paths: Paths) -> None:
        """Add a chunk of paths."""
        self._counts += paths.counts
        if not len(paths):
            return
        power = path_power_w(paths, self._radar.waveform.wavelength_m, self._gain)
        self._power += float(power.sum())
        self._mixed += float(power[(paths.flags & PathFlag.MIXED) != 0].sum())
        range_m = paths.range_m
        self._nearest = min(self._nearest, float(range_m.min()))
        self._farthest = max(self._farthest, float(range_m.max()))
        self._far += int(np.count_nonzero(range_m > self._radar.unambiguous_range_m))
        speed = np.abs(paths.range_rate_mps)
        self._fast += int(np.count_nonzero(speed > self._radar.max_unambiguous_velocity_mps))

    def result(self, outside: float) -> FrameStatistics:
        """Return the statistics of all paths added so far.

        Parameters
        ----------
        outside
            Number of paths that the range limits exclude (mean over the pulses).

        Returns
        -------
        FrameStatistics
            The sums.
        """
        some = self._counts.paths > 0
        return FrameStatistics(
            counts=self._counts,
            power_w=self._power,
            mixed_power_fraction=self._mixed / self._power if self._power > 0 else 0.0,
            nearest_m=self._nearest if some else None,
            farthest_m=self._farthest if some else None,
            beyond_unambiguous_range=self._far,
            beyond_max_velocity=self._fast,
            outside_range_limits=outside,
        )


def frame_statistics(
    frame: RadarFrame | FrameInput, radar: Radar, receiver_gain: float = 1.0
) -> FrameStatistics:
    """Compute the statistics of one frame's paths, without echoes.

    Parameters
    ----------
    frame
        Radar frame.
    radar
        Waveform and burst.
    receiver_gain
        G_r, linear.

    Returns
    -------
    FrameStatistics
        The sums.
    """
    total = StatisticsSum(radar, receiver_gain)
    for part in iter_path_chunks(frame):
        total.add(part)
    return total.result(0.0)


def statistics_warnings(statistics: FrameStatistics, radar: Radar) -> list[str]:
    """What a user should know before trusting a frame's products, in whole sentences."""
    counts, found = statistics.counts, []
    if counts.paths == 0:
        found.append("No echo at all: the map is empty.")
    if statistics.beyond_unambiguous_range:
        found.append(
            f"{statistics.beyond_unambiguous_range} paths lie beyond the unambiguous range "
            f"{radar.unambiguous_range_m:.6g} m " + _BEYOND.get(radar.waveform.kind, _BEYOND_PRF)
        )
    if statistics.beyond_max_velocity:
        found.append(
            f"{statistics.beyond_max_velocity} paths move faster than the unambiguous "
            f"{radar.max_unambiguous_velocity_mps:.4g} m/s (lambda PRF / 4): they fold "
            "in Doppler, as in a "
            "radar. Raise the PRF to be rid of the ambiguity."
        )
    if statistics.outside_range_limits >= 0.5:
        found.append(
            f"{statistics.outside_range_limits:.0f} paths lie outside the range window "
            "and are left out."
        )
    if counts.range_encoding_underflow:
        found.append(
            f"{counts.range_encoding_underflow} pixels have an echo beyond the range code (red "
            "below what float32 carries) and are left out."
        )
    if counts.no_range_encoding:
        found.append(
            f"{counts.no_range_encoding} pixels have more R than B and are left out: "
            "light that does not "
            "carry the range code. Give every object a Radar Material and hide other lights."
        )
    if counts.range_rate_rejected or counts.single_snapshot:
        found.append(
            f"{counts.range_rate_rejected} paths changed range by more than the speed "
            "limit between the "
            f"passes and {counts.single_snapshot} have an echo in the first pass only "
            "(edges of moving "
            "objects, or a run with one pass); they count as standing still."
        )
    if statistics.mixed_power_fraction > MIXED_POWER_WARNING:
        found.append(
            f"{100 * statistics.mixed_power_fraction:.0f} % of the power is in pixels that mix "
            "several ranges; their range is a mixture. Use one sample per pixel, or more "
            "pixels."
        )
    return found
