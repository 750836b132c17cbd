# SPDX-License-Identifier: GPL-3.0-or-later
"""Points that lie evenly in pixels, and how values change from point to point.

The points of a pixel are a grid of lines across and up, and values change along both axes
independently. So changes are computed line by line, of which there are fewer than points.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...array_types import Indices, Real


@dataclass(frozen=True)
class PixelLines:
    """Lines of points in pixels, at one place along an axis each.

    Attributes
    ----------
    row
        Row of the pixel of each line, (lines,).
    place
        Place along the axis in the pixel, from -1/2 to 1/2, (lines,).
    of_point
        The line on which each point lies, (points,).
    """

    row: Indices
    place: Real
    of_point: Indices


@dataclass(frozen=True)
class PixelPoints:
    """Points in the pixels of rows.

    Attributes
    ----------
    row
        Row that each point belongs to, in rising order, (points,).
    lines
        By place across, and by place up.
    """

    row: Indices
    lines: tuple[PixelLines, PixelLines]

    @classmethod
    def of(cls, along: Indices) -> PixelPoints:
        """Return the points of rows with so many across and up, (rows, 2): line by line, from
        below, each from left to right.
        """
        across, up = along.T
        first, second = (_lines(count) for count in (across, up))
        width = across.take(second[0])
        # points of the lines before, and lines across of the rows before
        begins, lefts = np.cumsum(width) - width, np.cumsum(across) - across
        number = np.arange(int(width.sum()))
        number += np.repeat(lefts.take(second[0]) - begins, width)
        line = np.repeat(np.arange(width.size), width)
        lines = PixelLines(*first, number), PixelLines(*second, line)
        return cls(second[0].take(line), lines)


def _lines(count: Indices) -> tuple[Indices, Real]:
    """Row of each of so many lines in pixels, and its place in the pixel, (lines,)."""
    row = np.repeat(np.arange(count.size), count)
    number = np.arange(row.size) - (np.cumsum(count) - count).take(row)
    return row, (number + 0.5) / count.take(row) - 0.5


def along_steps(steps: Real, points: PixelPoints) -> Real:
    """Return by how much values change, (points,), at points in pixels of rows with these steps,
    (n, 2, 2).
    """
    if not steps.any():
        return np.zeros(points.row.size)
    change: list[Real] = []
    for lines, (mean, half, bent) in zip(points.lines, courses(steps), strict=True):
        row, place = lines.row, lines.place
        of_line = place * mean.take(row)
        of_line += place**2 * half.take(row)
        if bent.any():
            of_line += abs(place) * bent.take(row)
        change.append(of_line.take(lines.of_point))
    return np.add(change[0], change[1], out=change[0])


def courses(steps: Real) -> Iterator[tuple[Real, Real, Real]]:
    """Factors of x, x^2 and |x| by which values change at x in a pixel across, and up, (n,) each.

    With a step on either side it is the parabola through the three rays, which the neighbours'
    meets half-way; with one side alone that half is straight, and the other one stays at the ray.
    """
    for before, after in ((steps[:, axis, 0], steps[:, axis, 1]) for axis in (0, 1)):
        known = (before != 0) & (after != 0)
        half = (after - before) / 2
        yield (before + after) / 2, np.where(known, half, 0.0), np.where(known, 0.0, half)


def shares(power_steps: Real, points: PixelPoints) -> Real:
    """Return the fraction of its row's power that each point has, (points,); they add up to 1."""
    row, share = points.row, along_steps(power_steps, points)
    share += 1
    share /= np.bincount(row, share).take(row)
    return share
