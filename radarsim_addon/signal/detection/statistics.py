# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums over the paths of a radar frame, and findings about them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Mask, Real
from ...findings import Finding, finding
from ..decoding import FrameInput, iter_path_chunks
from ..paths import NEGLIGIBLE_FRACTION, PathCounts, PathFlag, Paths, path_power_w
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
    in_maps
        Number of paths whose echo the maps show at their range, folded if it is ambiguous.
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
    in_maps: int = 0


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


class StatisticsSum:
    """Running statistics over chunks of paths; `receiver_gain` is G_r, linear."""

    def __init__(
        self,
        radar: Radar,
        receiver_gain: float,
        range_limits_m: tuple[float, float] = (0.0, np.inf),
    ) -> None:
        self._radar, self._gain = radar, receiver_gain
        self._limits_m, self._in_maps = range_limits_m, 0
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
        self._in_maps += int(np.count_nonzero(self._are_in_maps(range_m, speed)))

    def _are_in_maps(self, range_m: Real, speed_mps: Real) -> Mask:
        """Return which paths the maps show at some time of the burst, (n,)."""
        waveform, burst = self._radar.waveform, self._radar.burst
        reach_m = waveform.range_resolution_m + speed_mps * burst.pulses / burst.prf_hz
        start_m, stop_m = self._limits_m
        found = range_m - reach_m < self._radar.unambiguous_range_m
        period_m = self._radar.range_period_m
        if np.isfinite(period_m):
            # An ambiguous echo is shown at the largest of its ranges that the maps contain.
            beyond_m = np.maximum(range_m - stop_m - reach_m, 0.0)
            range_m = range_m - np.ceil(beyond_m / period_m) * period_m
            found = np.ones(range_m.size, dtype=bool)
        found &= (range_m + reach_m >= start_m) & (range_m - reach_m <= stop_m)
        return np.asarray(found)

    def result(self, outside: float) -> FrameStatistics:
        """Return the statistics; `outside` paths (mean over the pulses) are beyond the range
        limits.
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
            in_maps=self._in_maps,
        )


def statistics_findings(
    statistics: FrameStatistics,
    radar: Radar,
    sampling_mode: str = "rings",
    range_limits_m: tuple[float, float] = (0.0, np.inf),
    unranged_fraction: float = 0.0,
) -> list[Finding]:
    """Return findings on the products of a frame that follow from its paths.

    In the sampling mode "paths", the render reports mixed pixels itself. `unranged_fraction` is the
    fraction of the received power in paths without a length.
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
    found += _outside(statistics, radar, range_limits_m)
    if counts.range_encoding_underflow:
        count = counts.range_encoding_underflow
        if of_paths and unranged_fraction > NEGLIGIBLE_FRACTION:
            numbers = {"count": count, "fraction": unranged_fraction}
            found.append(finding("paths-without-length", **numbers))
        elif not of_paths:
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


def _outside(
    statistics: FrameStatistics, radar: Radar, range_limits_m: tuple[float, float]
) -> list[Finding]:
    """Find echoes outside the recorded ranges. If all echoes are outside, the maps are empty."""
    paths, outside = statistics.counts.paths, statistics.outside_range_limits
    start_m, stop_m = range_limits_m
    if radar.waveform.kind == "fmcw":
        stop_m = min(stop_m, radar.unambiguous_range_m)
    if paths and not statistics.in_maps:
        numbers = {"nearest_m": statistics.nearest_m, "farthest_m": statistics.farthest_m}
        limits = {"start_m": start_m, "stop_m": stop_m}
        return [finding("all-echoes-outside-ranges", count=paths, **numbers, **limits)]
    return [finding("paths-outside-range-limits", count=round(outside))] if outside >= 0.5 else []
