# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums over the paths of a radar frame, and findings about them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...findings import Finding, finding
from ..decoding import FrameInput, iter_path_chunks
from ..paths import PathCounts, PathFlag, Paths, path_power_w
from ..radar import Radar, range_limit
from ..runs import RadarFrame

#: Fraction of the received power in mixed pixels above which a frame carries a warning.
_MIXED_POWER = 0.05
#: Fraction of the paths that may be without a range rate at the edges of moving objects.
_USUAL_EDGES = 0.05


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
    fastest_mps
        Largest |range rate| of a path [m/s].
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
    fastest_mps: float = 0.0


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
        self._fastest = 0.0
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
        self._fastest = max(self._fastest, float(speed.max()))
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
            fastest_mps=self._fastest,
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


def statistics_findings(
    statistics: FrameStatistics, radar: Radar, sampling_mode: str = "rings"
) -> list[Finding]:
    """Find what to know before you trust a frame's products.

    Parameters
    ----------
    statistics
        Of the frame.
    radar
        Waveform and burst, whose ambiguities count.
    sampling_mode
        "rings" or "paths", whose render has told of mixed pixels.

    Returns
    -------
    list of Finding
        Empty where there is nothing to report.
    """
    counts, found = statistics.counts, []
    of_paths = sampling_mode == "paths"
    if counts.paths == 0:
        found.append(finding("no-echo"))
    if statistics.beyond_unambiguous_range:
        numbers = {
            "count": statistics.beyond_unambiguous_range,
            "unambiguous_range_m": radar.unambiguous_range_m,
        }
        if radar.waveform.kind == "fmcw":
            found.append(finding("paths-beyond-sampled-band", **numbers))
        else:
            limit = range_limit(radar.waveform)
            found.append(finding("range-ambiguous-paths", **numbers, limit=limit))
    if statistics.beyond_max_velocity:
        found.append(
            finding(
                "doppler-ambiguous-paths",
                count=statistics.beyond_max_velocity,
                max_unambiguous_velocity_mps=radar.max_unambiguous_velocity_mps,
                fastest_mps=statistics.fastest_mps,
                prf_hz=radar.prf_for_hz(statistics.fastest_mps),
            )
        )
    if statistics.outside_range_limits >= 0.5:
        count = round(statistics.outside_range_limits)
        found.append(finding("paths-outside-range-limits", count=count))
    if counts.range_encoding_underflow:
        count = counts.range_encoding_underflow
        if of_paths:
            found.append(finding("paths-without-length", count=count))
        else:
            found.append(finding("range-encoding-underflow", count=count))
    if counts.no_range_encoding:
        found.append(finding("no-range-encoding", count=counts.no_range_encoding))
    if counts.range_rate_rejected or counts.single_snapshot:
        rejected, single = counts.range_rate_rejected, counts.single_snapshot
        unknown = finding("no-range-rate", rejected=rejected, single=single)
        # edges of all that moves have such paths, and a run of one snapshot nothing else
        usual = rejected + single <= _USUAL_EDGES * counts.paths or single == counts.paths
        found.append(unknown.as_information() if usual else unknown)
    if statistics.mixed_power_fraction > _MIXED_POWER and not of_paths:
        found.append(finding("mixed-pixels", fraction=statistics.mixed_power_fraction))
    return found
