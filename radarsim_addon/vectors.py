# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors of three components, (n, 3), column by column.

numpy's own reductions over an axis of three take about ten times as long. Their sums are in the
same order, so the results have the same bits.
"""

from __future__ import annotations

import numpy as np

from .array_types import Mask, Real


def dots(a: Real, b: Real) -> Real:
    """Return the scalar product of each pair of vectors, (n,); one of the two may be (3,)."""
    (x, y, z), (p, q, r) = np.asarray(a).T, np.asarray(b).T
    return np.asarray(x * p + y * q + z * r)


def norms(vectors: Real) -> Real:
    """Return the lengths of vectors, (n,)."""
    x, y, z = vectors.T
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def distances(a: Real, b: Real) -> Real:
    """Return the distance of each pair of points, (n,); one of the two may be (3,)."""
    (x, y, z), (p, q, r) = np.asarray(a).T, np.asarray(b).T
    x, y, z = x - p, y - q, z - r
    return np.asarray(np.sqrt(x * x + y * y + z * z))


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
