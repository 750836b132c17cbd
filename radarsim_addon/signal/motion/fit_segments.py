# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitted segments of a burst: split where two fit better than one, and how well they are known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...array_types import Real
from .body_motion import Segment

#: Fewest samples that a segment of its own may have.
_LEAST_SAMPLES = 6
_MAX_DEPTH = 7
#: How much better two segments must be than one, in units of the criterion.
_SPLIT_GAIN = 20.0
#: Standard deviations in a bound.
_SIGMAS = 3.0


@dataclass(frozen=True)
class FittedSegment:
    """A segment of motion, what it leaves over and how well it is known; see
    :mod:`.motion.series_fit`."""

    segment: Segment
    criterion: float
    move_residual: Real  # (samples, 3) m
    turn_residual: Real  # (samples, 3) rad, or (samples, 9)
    move_spread: float
    turn_spread: float
    move_slow: float
    turn_slow: float


def split_segments(
    fit: Callable[[int, int, float], FittedSegment],
    times_s: Real,
    first: int,
    stop: int,
    stop_s: float,
    marks: list[int],
    depth: int,
) -> list[FittedSegment]:
    """One segment, or several where those fit better."""
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
    best: tuple[float, int] | None = None
    for at in dict.fromkeys(candidates):
        total = sum(
            part.criterion
            for part in (
                fit(first, at, float(times_s[at])),
                fit(at, stop, stop_s),
            )
        )
        if best is None or total < best[0]:
            best = (total, at)
    assert best is not None
    at = best[1]
    at_s = float(times_s[at])
    parts = split_segments(fit, times_s, first, at, at_s, marks, depth + 1) + split_segments(
        fit, times_s, at, stop, stop_s, marks, depth + 1
    )
    if sum(part.criterion for part in parts) + _SPLIT_GAIN < whole.criterion:
        return parts
    return [whole]


def _is_noise(fitted: FittedSegment) -> bool:
    """Whether what is left over looks like rounding: no slow part, no peaks."""
    for residual, slow in (
        (fitted.move_residual, fitted.move_slow),
        (fitted.turn_residual, fitted.turn_slow),
    ):
        scatter = float(np.sqrt(np.mean(residual**2)))
        if slow > 2 * scatter or np.abs(residual).max() > 8 * scatter:
            return False
    return True


def quality_of(fitted: Sequence[FittedSegment], reach_m: float, still: bool) -> tuple[float, float]:
    """rms noise and bound of a displacement at the body's farthest point [m]."""
    noise = bound = 0.0
    for part in fitted:
        move = float(np.sqrt(np.mean(part.move_residual**2)))
        turn = float(np.sqrt(np.mean(part.turn_residual**2))) * reach_m
        noise = max(noise, float(np.hypot(move, turn)))
        if still:
            # it may move by what its rounding hides
            here = np.abs(part.move_residual).max() + reach_m * np.abs(part.turn_residual).max()
        else:
            here = _SIGMAS * np.hypot(
                part.move_slow * part.move_spread, part.turn_slow * reach_m * part.turn_spread
            )
        bound = max(bound, float(here))
    return noise, bound
