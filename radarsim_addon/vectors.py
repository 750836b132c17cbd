# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors of three components, (n, 3), column by column.

numpy's own reductions over an axis of three take about ten times as long. Their sums are in the
same order, so the results have the same bits.
"""

from __future__ import annotations

import numpy as np

from .array_types import Indices, Mask, Real


def dots(a: Real, b: Real) -> Real:
    """Return the scalar product of each pair of vectors, (n,); one of the two may be (3,)."""
    return _products(np.asarray(a).T, np.asarray(b).T)


def norms(vectors: Real) -> Real:
    """Return the lengths of vectors, (n,)."""
    squares = _products(vectors.T, vectors.T)
    return np.asarray(np.sqrt(squares, out=squares))


def distances(a: Real, b: Real) -> Real:
    """Return the distance of each pair of points, (n,); one of the two may be (3,)."""
    (x, y, z), (p, q, r) = np.asarray(a).T, np.asarray(b).T
    away = np.stack([x - p, y - q, z - r])
    return norms(away.T)


def crosses(a: Real, b: Real) -> Real:
    """Return the cross product of each pair of vectors, (n, 3)."""
    (x, y, z), (p, q, r) = np.asarray(a).T, np.asarray(b).T
    return np.stack([y * r - z * q, z * p - x * r, x * q - y * p]).T


def largest(vectors: Real) -> Real:
    """Return the largest magnitude of each vector's components, (n,); NaN where one is NaN."""
    x, y, z = np.abs(vectors.T)
    return np.asarray(np.maximum(np.maximum(x, y), z))


def are_finite(vectors: Real) -> Mask:
    """Return which vectors have finite components alone, (n,)."""
    x, y, z = vectors.T
    return np.asarray(np.isfinite(x) & np.isfinite(y) & np.isfinite(z))


def take_rows(vectors: Real, rows: Indices) -> Real:
    """Return some rows of (n, 3), with contiguous columns."""
    return np.asarray(vectors.T.take(rows, axis=1).T)


def turned(turn: Real, vectors: Real) -> Real:
    """Matrix, (3, 3) or one each, (3, 3, n), times vectors, (3, n)."""
    product = np.empty(vectors.shape)
    for row, factors in zip(product, turn, strict=True):
        # many poses do not turn at all
        used = [(f, v) for f, v in zip(factors, vectors, strict=True) if np.any(f)]
        row[:] = 0.0
        if used:
            np.multiply(*used[0], out=row)
        for factor, vector in used[1:]:
            row += factor * vector
    return product


def _products(a: Real, b: Real) -> Real:
    """Sum of the products of three components each, (3, n) or (3,)."""
    found = np.asarray(a[0] * b[0])
    term = np.asarray(a[1] * b[1])
    found += term
    found += np.multiply(a[2], b[2], out=term)
    return found
