# SPDX-License-Identifier: GPL-3.0-or-later
"""Sub-pixel replicates of a pixel grid, and the error that edges along the grid leave.

The scatter of the replicates gives the error of their mean, except at edges that run along the
grid: a side of 20.1 pixels mostly contains 20 columns in all replicates, and their scatter shows
nothing of the tenth of a column. Such an edge lies somewhere between the rays nearest to it. That
bounds the error from below, run by run of pixels whose edge lies in one line; an oblique edge has
short runs and adds little.

A single replicate has no scatter. Its error is that of its edges, and the differences of
neighbouring pixels of one surface.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...arrays import Integers, Real
from ...contract import ReceiverRecord
from .footprints import Places, grid_places, placed
from .table import PathRows

#: Relative standard error of a power above which results say that it is uncertain.
MOST_UNCERTAIN = 0.5
#: Steps of the additive recurrence (Roberts' R2 sequence): 1/g and 1/g^2, g^3 = g + 1.
_R2 = (0.7548776662466927, 0.5698402909980532)


def replicate_offset_px(index: int) -> tuple[float, float]:
    """Return the sub-pixel offset of a replicate, across and up [pixels], each from -1/2 to 1/2.

    A low-discrepancy sequence that starts off the pixel centre: a ray exactly on the shared edge of
    two triangles counts both.
    """
    u = (0.5 + _R2[0] * (index + 1)) % 1.0 - 0.5
    v = (0.5 + _R2[1] * (index + 1)) % 1.0 - 0.5
    return u, v


@lru_cache(maxsize=64)
def replicate_variances(count: int) -> tuple[float, float]:
    """Return the variance of a side, measured with the first `count` replicates, across and down
    [px^2].

    It is the mean over all lengths and places of the side. The points x_i of the replicates in an
    interval, less its length, are psi(a) - psi(b) with psi the mean of the first Bernoulli
    polynomials of a - x_i. Over all a and b the mean of its square is (1/S^2) sum_ij B_2(frac(x_i -
    x_j)), B_2(x) = x^2 - x + 1/6: the L2 discrepancy of intervals on a circle (Kuipers &
    Niederreiter, Uniform Distribution of Sequences, 1974, ch. 2). Evenly spaced points have 1/(6
    S^2).
    """
    paired = min(count, 1024)  # of more, the variance is taken to fall as their number rises
    replicates = np.array([replicate_offset_px(i) for i in range(paired)])
    across, down = (
        float(np.mean(x**2 - x + 1 / 6))
        for x in ((place[:, None] - place) % 1.0 for place in replicates.T)
    )
    return across * paired / count, down * paired / count


def edge_variances(
    rows: PathRows,
    label: Integers,
    value: Real,
    receiver: ReceiverRecord,
    count: int,
    grid: Places = grid_places,
) -> Real:
    """Compute the least variance of the mean value of each label, by its edges along the grid.

    The rows are of one tile at one of `count` replicates. Each has a label from 1 (0: none) and a
    value such as the power of the replicate alone, (n,). Gives (labels + 1,), by label from 0.
    """
    total = np.zeros(int(label.max(initial=0)) + 1)
    for labels, (values,) in _images(rows, label, value[None], receiver, count, grid):
        total += _edge_variance(labels, values, count, total.size)
    return total


def lone_variances(
    rows: PathRows,
    label: Integers,
    value: Real,
    receiver: ReceiverRecord,
    grid: Places = grid_places,
) -> Real:
    """Compute the variance of the value of each label where there is one replicate alone.

    To the part of the edges comes the difference within a surface: a grid of rays samples it
    systematically, and neighbours of one surface and path class have the same expectation except
    for the change from one pixel to the next. Half the mean squared difference of two is therefore
    the variance of one, or more (successive differences: Wolter, Introduction to Variance
    Estimation, 2007, ch. 8). A pixel without neighbours may be wrong by all of itself.

    Arguments are as for `edge_variances`; values (sets, n) give (sets, labels + 1).
    """
    sets, size = np.atleast_2d(value), int(label.max(initial=0)) + 1
    lost = np.flatnonzero((label > 0) & ~placed(rows, receiver))
    lone = [np.bincount(label[lost], one[lost] ** 2, size) for one in sets]
    total = np.array(lone, dtype=np.float64)  # of no rows bincount makes integers
    for labels, images in _images(rows, label, sets, receiver, 1, grid):
        for own, values in zip(total, images, strict=True):
            own += _edge_variance(labels, values, 1, size)
            own += _scatter_variance(labels, values, size)
    return total if value.ndim > 1 else np.asarray(total[0])


def _images(
    rows: PathRows,
    label: Integers,
    value: Real,
    receiver: ReceiverRecord,
    count: int,
    grid: Places = grid_places,
) -> Iterator[tuple[Integers, Real]]:
    """Yield labels, and values (sets, n), on the grid of pixels, path class by path class, with an
    empty rim.
    """
    kept = np.flatnonzero((label > 0) & placed(rows, receiver))
    if kept.size == 0:
        return
    if kept.size < rows.size:
        rows, label, value = rows[kept], label[kept], value[:, kept]
    col, row = grid(rows, receiver, count)
    path_class = rows["order"].astype(np.int64) << 16 | rows["transparent_depth"]
    for one in np.unique(path_class):
        here = path_class == one
        place = tuple(at[here] - at[here].min() + 1 for at in (row, col))
        shape = tuple(int(at.max()) + 2 for at in place)
        labels, values = np.zeros(shape, dtype=np.int64), np.zeros((len(value), *shape))
        labels[place], values[:, *place] = label[here], value[:, here]
        yield labels, values


def _edge_variance(labels: Integers, values: Real, count: int, size: int) -> Real:
    """Return the variance by label, for the mean of so many replicates."""
    total = np.zeros(size)
    for axis, variance in zip((1, 0), replicate_variances(count), strict=True):
        for step in (1, -1):
            edge = (labels > 0) & (np.roll(labels, step, axis) != labels)
            # a side has two edges, and the variance is that of a side
            total += variance / 2 * _squared_runs(edge, labels, values, axis, size)
    return total


def _scatter_variance(labels: Integers, values: Real, size: int) -> Real:
    """Return the variance by label, from the differences of neighbours of one label."""
    squares, pairs = np.zeros(size), np.zeros(size)
    for axis in (0, 1):
        # the rim is empty: nothing wraps around
        pair = (labels > 0) & (np.roll(labels, 1, axis) == labels)
        owner = labels[pair]
        difference = values[pair] - np.roll(values, 1, axis)[pair]
        squares += np.bincount(owner, difference**2, minlength=size)
        pairs += np.bincount(owner, minlength=size)
    own = labels > 0
    pixels = np.bincount(labels[own], minlength=size)
    whole = np.bincount(labels[own], values[own] ** 2, minlength=size)
    return np.where(pairs > 0, pixels * squares / np.maximum(2 * pairs, 1), whole)


def _squared_runs(
    edge: NDArray[np.bool_], labels: Integers, values: Real, axis: int, size: int
) -> Real:
    """Sum, by label, the squared values of each run of edge pixels in a line along the edge."""
    if axis == 1:
        edge, labels, values = edge.T, labels.T, values.T
    on = edge.ravel()
    label = labels.ravel()
    begins = on.copy()
    begins[1:] &= ~(on[:-1] & (label[1:] == label[:-1]))
    run = np.cumsum(begins)[on] - 1
    sums = np.bincount(run, values.ravel()[on], minlength=1)
    return np.bincount(label[begins], sums[: int(begins.sum())] ** 2, minlength=size)
