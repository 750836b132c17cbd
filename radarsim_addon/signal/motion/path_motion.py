# SPDX-License-Identifier: GPL-3.0-or-later
"""Protocol of the motion of paths: how their lengths change over a burst."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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

    @property
    def moving_vertices(self) -> NDArray[np.bool_]:
        """Whether the first and the last vertex move, (n, 2)."""
        ...

    @property
    def scatterers_move(self) -> NDArray[np.bool_]:
        """(n,): True where a vertex or a mirror of the path moves, not only an antenna."""
        ...

    def lengths_m(self, times_s: Real, rows: Rows) -> Real:
        """Return the total lengths of some rows, (rows, times) [m]. Callers limit rows x times."""
        ...

    def displacements_m(self, times_s: Real, rows: Rows, end: int, points_m: Real) -> Real:
        """Return displacements since t = 0 of points near the first (`end` 0) or last (1) vertex.

        `points_m` are points at t = 0 on the bodies of these vertices, (rows, 3) [m]. The result,
        (rows, times, 3) [m], is 0 where the motion of the vertex is not known.
        """
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

    @property
    def moving_vertices(self) -> NDArray[np.bool_]:
        """All False: of the vertices' motion only the range rate is known."""
        return np.zeros((self.length_m.size, 2), dtype=bool)

    @property
    def scatterers_move(self) -> NDArray[np.bool_]:
        """Paths that move: of a range rate alone it is not known whose motion it is."""
        return self.moving

    def lengths_m(self, times_s: Real, rows: Rows) -> Real:
        """See `PathMotion`."""
        return self.length_m[rows, None] + 2 * self.range_rate_mps[rows, None] * times_s

    def displacements_m(self, times_s: Real, rows: Rows, end: int, points_m: Real) -> Real:
        """See `PathMotion`; all 0."""
        return np.zeros((len(points_m), np.size(times_s), 3))

    def select(self, rows: Rows) -> LinearMotion:
        """See `PathMotion`."""
        return LinearMotion(self.length_m[rows], self.range_rate_mps[rows])


def mean_over_burst(motion: PathMotion, burst_s: float, rows: Rows) -> tuple[Real, Real]:
    """Return one-way ranges in the middle of a burst and mean range rates over it, (rows,) each.

    A map shows an echo there: range rates of accelerating bodies at t are not those of its peaks.

    Parameters
    ----------
    motion
        Of the paths.
    burst_s
        Time from the first pulse to the last one, above 0 [s].
    rows
        Rows of the paths.

    Returns
    -------
    middle_m, rate_mps
        Half of the lengths, and its change per time, (rows,) each.
    """
    first_m, middle_m, last_m = motion.lengths_m(np.array([0.0, 0.5, 1.0]) * burst_s, rows).T / 2
    return middle_m, (last_m - first_m) / burst_s


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

    @property
    def moving_vertices(self) -> NDArray[np.bool_]:
        """See `PathMotion`."""
        return np.concatenate([part.moving_vertices for part in self.parts])

    @property
    def scatterers_move(self) -> NDArray[np.bool_]:
        """See `PathMotion`."""
        return np.concatenate([part.scatterers_move for part in self.parts])

    def _places(
        self, rows: Rows
    ) -> Iterator[tuple[PathMotion, NDArray[np.intp], NDArray[np.intp]]]:
        """Parts that rows lie in, with the rows' places among `rows` and in the part."""
        starts = np.cumsum([0, *(part.moving.size for part in self.parts)])
        wanted = np.arange(starts[-1])[rows]
        for part, start, stop in zip(self.parts, starts[:-1], starts[1:], strict=True):
            here = np.flatnonzero((wanted >= start) & (wanted < stop))
            if here.size:
                yield part, here, wanted[here] - start

    def lengths_m(self, times_s: Real, rows: Rows) -> Real:
        """See `PathMotion`."""
        lengths = np.empty((np.arange(self.moving.size)[rows].size, np.size(times_s)))
        for part, here, own in self._places(rows):
            lengths[here] = part.lengths_m(times_s, own)
        return lengths

    def displacements_m(self, times_s: Real, rows: Rows, end: int, points_m: Real) -> Real:
        """See `PathMotion`."""
        moved = np.empty((len(points_m), np.size(times_s), 3))
        for part, here, own in self._places(rows):
            moved[here] = part.displacements_m(times_s, own, end, points_m[here])
        return moved

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

    @property
    def moving_vertices(self) -> NDArray[np.bool_]:
        """See `PathMotion`."""
        return self.whole.moving_vertices[self.rows]

    @property
    def scatterers_move(self) -> NDArray[np.bool_]:
        """See `PathMotion`."""
        return self.whole.scatterers_move[self.rows]

    def lengths_m(self, times_s: Real, rows: Rows) -> Real:
        """See `PathMotion`."""
        return self.whole.lengths_m(times_s, self.rows[rows])

    def displacements_m(self, times_s: Real, rows: Rows, end: int, points_m: Real) -> Real:
        """See `PathMotion`."""
        return self.whole.displacements_m(times_s, self.rows[rows], end, points_m)

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
