# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitted segments of a burst: split where two fit better than one, with noise and error bound."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...array_types import Real
from .body_motion import Segment
from .series_fit import Series

#: Minimum number of samples of a segment.
_LEAST_SAMPLES = 6
_MAX_DEPTH = 7
#: Minimum gain of two segments over one, in units of the criterion.
_SPLIT_GAIN = 20.0
#: Largest scatter of rounding, in units of the floor, which is a tenth of float32's step.
_MOST_NOISE = 20.0
#: Standard deviations in a bound.
_SIGMAS = 3.0


@dataclass(frozen=True)
class FittedSegment:
    """A segment of motion, with the series of its translation and rotation."""

    segment: Segment
    move: Series
    turn: Series

    @property
    def criterion(self) -> float:
        """Sum of the criteria of both series."""
        return self.turn.criterion + self.move.criterion


def split_segments(
    fit: Callable[[int, int, float], FittedSegment],
    times_s: Real,
    first: int,
    stop: int,
    stop_s: float,
    marks: list[int],
    depth: int,
) -> list[FittedSegment]:
    """Return one segment, or several if those fit better."""
    whole = fit(first, stop, stop_s)
    if depth >= _MAX_DEPTH or stop - first < 2 * _LEAST_SAMPLES:
        return [whole]
    if _is_noise(whole):
        return [whole]
    lowest, highest = first + _LEAST_SAMPLES, stop - _LEAST_SAMPLES
    candidates = [mark for mark in marks if lowest <= mark <= highest]
    if len(candidates) > 8:
        candidates = candidates[:: len(candidates) // 8]
    candidates.append((first + stop) // 2)

    def criterion_with(at: int) -> float:
        return fit(first, at, float(times_s[at])).criterion + fit(at, stop, stop_s).criterion

    at = min(dict.fromkeys(candidates), key=criterion_with)
    parts = [
        *split_segments(fit, times_s, first, at, float(times_s[at]), marks, depth + 1),
        *split_segments(fit, times_s, at, stop, stop_s, marks, depth + 1),
    ]
    if sum(part.criterion for part in parts) + _SPLIT_GAIN < whole.criterion:
        return parts
    return [whole]


def within_burst(fitted: Sequence[FittedSegment], span_s: float) -> list[FittedSegment]:
    """Return the segments that a burst from 0 to `span_s` touches."""
    last = len(fitted) - 1
    return [
        part
        for number, part in enumerate(fitted)
        if (part.segment.stop_s > 0 or number == last)
        and (part.segment.start_s < span_s or number == 0)
    ]


def _is_noise(fitted: FittedSegment) -> bool:
    """Whether the residual looks like rounding: small, no slow part, no peaks."""
    for series in (fitted.move, fitted.turn):
        scatter = series.scatter
        if (
            scatter > _MOST_NOISE * series.floor
            or series.slow > 2 * scatter
            or np.abs(series.residual).max() > 8 * scatter
        ):
            return False
    return True


def quality_of(fitted: Sequence[FittedSegment], reach_m: float, still: bool) -> tuple[float, float]:
    """Return rms noise and bound of a displacement at the body's farthest point [m]."""
    noise = bound = 0.0
    for part in fitted:
        move, turn = part.move, part.turn
        noise = max(noise, float(np.hypot(move.scatter, turn.scatter * reach_m)))
        if still:
            # it may move by less than its rounding
            here = np.abs(move.residual).max() + reach_m * np.abs(turn.residual).max()
        else:
            here = _SIGMAS * np.hypot(move.slow * move.spread, turn.slow * reach_m * turn.spread)
        bound = max(bound, float(here))
    return noise, bound


def rate_error_of(fitted: Sequence[FittedSegment], reach_m: float) -> float:
    """Return the standard deviation of the velocity at the epoch, farthest point [m/s]."""
    return max(
        float(np.hypot(p.move.slow * p.move.rate, p.turn.slow * reach_m * p.turn.rate))
        for p in fitted
    )
