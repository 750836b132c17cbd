# SPDX-License-Identifier: GPL-3.0-or-later
"""Sub-pixel replicates of a pixel grid, and the error at edges along the grid.

The scatter of the replicates gives the error of their mean, except at edges along the grid. A side
of 20.1 pixels mostly covers 20 columns in all replicates, so their scatter does not show the
missing tenth of a column. Such an edge lies somewhere between the rays nearest to it. This gives a
lower bound of the error for each run of pixels whose edge lies in one line. An oblique edge has
short runs and adds little.

A single replicate has no scatter. Its error is that at its edges, and that from the differences of
neighbouring pixels of one surface.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from ...arrays import Integers, Mask, Real
from ...contract import ReceiverRecord
from .footprints import Places, grid_places, placed
from .table import PathRows

#: Relative standard error of a power above which results say that it is uncertain.
MOST_UNCERTAIN = 0.5
#: Steps of the additive recurrence (Roberts' R2 sequence): 1/g and 1/g^2, g^3 = g + 1.
_R2 = (0.7548776662466927, 0.5698402909980532)


def replicate_offset_px(index: int) -> tuple[float, float]:
    """Return the sub-pixel offset of a replicate, across and up [pixels], each from -1/2 to 1/2.

    It is a low-discrepancy sequence that does not start at the pixel centre: a ray exactly on the
    shared edge of two triangles counts both.
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
    """Compute the least variance of the mean value of each label, from its edges along the grid.

    The rows are of one tile at one of `count` replicates. Each has a label from 1 (0: none) and a
    value, such as the power of the replicate alone, (n,). Return (labels + 1,), by label from 0.
    """
    total = np.zeros((1, int(label.max(initial=0)) + 1))
    label = np.where(placed(rows, receiver), label, 0)
    for labels, images in _images(rows, label, value[None], receiver, count, grid):
        total += _edge_variances(labels, images, count, total.shape[1])
    return np.asarray(total[0])


def lone_variances(
    rows: PathRows,
    label: Integers,
    value: Real,
    receiver: ReceiverRecord,
    grid: Places = grid_places,
) -> Real:
    """Compute the variance of the value of each label if there is only one replicate.

    It is the variance at edges, and that from differences within a surface. A grid of rays samples
    a surface systematically, and neighbours of one surface and path class have the same expectation
    except for the change from one pixel to the next. Half the mean squared difference of two pixels
    is therefore the variance of one, or more (successive differences: Wolter, Introduction to
    Variance Estimation, 2007, ch. 8). The error of a pixel without neighbours may be its whole
    value.

    Arguments are those of `edge_variances`; values (sets, n) give (sets, labels + 1).
    """
    sets, size = np.atleast_2d(value), int(label.max(initial=0)) + 1
    known = placed(rows, receiver)
    lost = np.flatnonzero(~known)
    total = _sums_by(label[lost], sets[:, lost] ** 2, size)
    total[:, 0] = 0.0
    for labels, images in _images(rows, np.where(known, label, 0), sets, receiver, 1, grid):
        total += _edge_variances(labels, images, 1, size)
        total += _scatter_variances(labels, images, size)
    return total if value.ndim > 1 else np.asarray(total[0])


def _images(
    rows: PathRows,
    label: Integers,
    value: Real,
    receiver: ReceiverRecord,
    count: int,
    grid: Places = grid_places,
) -> Iterator[tuple[Integers, Real]]:
    """Yield labels and values (sets, n) on the pixel grid, one path class after another.

    The border of the grid is empty. Rows of label 0 are left out.
    """
    kept = np.flatnonzero(label > 0)
    if kept.size == 0:
        return
    if kept.size < rows.size:
        rows, label, value = rows[kept], label[kept], value[:, kept]
    col, row = grid(rows, receiver, count)
    path_class = rows["order"].astype(np.int64) << 16 | rows["transparent_depth"]
    for one in np.unique(path_class):
        here = np.flatnonzero(path_class == one)
        up, across = (at.take(here) for at in (row, col))
        up, across = up - (up.min() - 1), across - (across.min() - 1)
        shape = int(up.max()) + 2, int(across.max()) + 2
        labels, values = np.zeros(shape, dtype=np.int64), np.zeros((len(value), *shape))
        pixel = up * shape[1] + across
        labels.ravel()[pixel] = label.take(here)
        for image, own in zip(values, value, strict=True):
            image.ravel()[pixel] = own.take(here)
        yield labels, values


def _sums_by(label: Integers, values: Real, size: int) -> Real:
    """Return the sum of values (sets, n) by label, (sets, size)."""
    # of no rows bincount makes integers
    return np.array([np.bincount(label, own, size) for own in values], dtype=np.float64)


def _edge_variances(labels: Integers, images: Real, count: int, size: int) -> Real:
    """Return the variance by label, for the mean of so many replicates, of images (sets, ...)."""
    total = np.zeros((len(images), size))
    for axis, variance in zip((1, 0), replicate_variances(count), strict=True):
        # across each other axis the images are transposed; their rims are empty
        own, values = (labels, images) if axis == 0 else (labels.T, images.transpose(0, 2, 1))
        differ = own[1:] != own[:-1]
        for side in (slice(1, None), slice(None, -1)):
            edge = np.zeros(own.shape, dtype=bool)
            np.logical_and(differ, own[side] > 0, out=edge[side])
            # a side has two edges, and the variance is that of a side
            total += variance / 2 * _squared_runs(edge, own, values, size)
    return total


def _scatter_variances(labels: Integers, images: Real, size: int) -> Real:
    """Return the variance by label, from the differences of neighbours of one label, of images
    (sets, ...).
    """
    flat, values = labels.ravel(), images.reshape(len(images), -1)
    squares, pairs = np.zeros((len(images), size)), np.zeros(size)
    # the rim is empty: nothing wraps around
    for stride in (labels.shape[1], 1):
        pair = stride + np.flatnonzero((flat[stride:] > 0) & (flat[stride:] == flat[:-stride]))
        owner = flat.take(pair)
        difference = values.take(pair, axis=1) - values.take(pair - stride, axis=1)
        squares += _sums_by(owner, difference**2, size)
        pairs += np.bincount(owner, minlength=size)
    own = np.flatnonzero(flat > 0)
    owner = flat.take(own)
    pixels = np.bincount(owner, minlength=size)
    whole = _sums_by(owner, values.take(own, axis=1) ** 2, size)
    return np.where(pairs > 0, pixels * squares / np.maximum(2 * pairs, 1), whole)


def _squared_runs(edge: Mask, labels: Integers, images: Real, size: int) -> Real:
    """Sum, by label, the squared values of each run of edge pixels in a line of images (sets, ...),
    (sets, size).
    """
    at = np.flatnonzero(edge)
    place = np.unravel_index(at, edge.shape)
    label = labels[place]
    begins = np.ones(at.size, dtype=bool)
    begins[1:] = (np.diff(at) != 1) | (label[1:] != label[:-1])
    run = np.cumsum(begins) - 1
    sums = _sums_by(run, np.stack([values[place] for values in images]), 0)
    return _sums_by(label[begins], sums**2, size)
