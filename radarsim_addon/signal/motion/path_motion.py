# SPDX-License-Identifier: GPL-3.0-or-later
"""Protocol of the motion of paths: how their lengths change over a burst."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...array_types import Real

Rows = NDArray[np.bool_] | NDArray[np.intp] | slice


class PathMotion(Protocol):
    """Total optical lengths of n paths at any time of a burst.

    Time 0 is the frame's time t, at which the length is the paths' ``length_m``.
    """

    @property
    def moving(self) -> NDArray[np.bool_]:
        """(n,): False where the length is the same at all times."""
        ...

    def lengths_m(self, times_s: Real, rows: Rows) -> Real:
        """Return the total lengths of some rows, (rows, times) [m]. Callers limit rows x times."""
        ...

    def select(self, rows: Rows) -> PathMotion:
        """Return the motion of these rows alone."""
        ...


@dataclass(frozen=True)
class LinearMotion:
    """Constant range rates: l(t) = l + 2 v t.

    Attributes
    ----------
    length_m
        Total length at t = 0, (n,) [m].
    range_rate_mps
        Rate of the one-way range, receding positive, (n,) [m/s].
    """

    length_m: Real
    range_rate_mps: Real

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Paths with a range rate other than 0, (n,)."""
        return np.asarray(self.range_rate_mps != 0)

    def lengths_m(self, times_s: Real, rows: Rows) -> Real:
        """See `PathMotion`."""
        return self.length_m[rows, None] + 2 * self.range_rate_mps[rows, None] * times_s

    def select(self, rows: Rows) -> LinearMotion:
        """See `PathMotion`."""
        return LinearMotion(self.length_m[rows], self.range_rate_mps[rows])


@dataclass(frozen=True)
class JoinedMotion:
    """Motions in sequence, as of paths that were joined.

    Attributes
    ----------
    parts
        Motions in the order of their rows.
    """

    parts: tuple[PathMotion, ...]

    @property
    def moving(self) -> NDArray[np.bool_]:
        """See `PathMotion`."""
        return np.concatenate([part.moving for part in self.parts])

    def lengths_m(self, times_s: Real, rows: Rows) -> Real:
        """See `PathMotion`."""
        starts = np.cumsum([0, *(part.moving.size for part in self.parts)])
        wanted = np.arange(starts[-1])[rows]
        lengths = np.empty((wanted.size, np.size(times_s)))
        for part, start, stop in zip(self.parts, starts[:-1], starts[1:], strict=True):
            here = np.flatnonzero((wanted >= start) & (wanted < stop))
            if here.size:
                lengths[here] = part.lengths_m(times_s, wanted[here] - start)
        return lengths

    def select(self, rows: Rows) -> PathMotion:
        """See `PathMotion`."""
        starts = np.cumsum([0, *(part.moving.size for part in self.parts)])
        return SelectedMotion(self, np.arange(starts[-1])[rows])


@dataclass(frozen=True)
class SelectedMotion:
    """Some rows of another motion, in any order."""

    whole: PathMotion
    rows: NDArray[np.intp]

    @property
    def moving(self) -> NDArray[np.bool_]:
        """See `PathMotion`."""
        return self.whole.moving[self.rows]

    def lengths_m(self, times_s: Real, rows: Rows) -> Real:
        """See `PathMotion`."""
        return self.whole.lengths_m(times_s, self.rows[rows])

    def select(self, rows: Rows) -> PathMotion:
        """See `PathMotion`."""
        return SelectedMotion(self.whole, self.rows[rows])


def join_motion(parts: Sequence[PathMotion]) -> PathMotion:
    """Join several motions to one.

    Parameters
    ----------
    parts
        Motions in the order of their rows, at least one.

    Returns
    -------
    PathMotion
        Motion of all rows.
    """
    return parts[0] if len(parts) == 1 else JoinedMotion(tuple(parts))
