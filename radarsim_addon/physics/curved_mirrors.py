# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflection at a curved mirror by geometric optics: how a beam widens behind it."""

from __future__ import annotations

import numpy as np

from ..array_types import Real


def reflected_widths(curvature: Real, cosine: Real, before_m: Real, after_m: Real) -> Real:
    """Return how wide a beam from a point is behind a curved mirror, over its width on the mirror.

    Parameters
    ----------
    curvature
        Curvature tensor of the surface, (n, 2, 2) [1/m], positive where it is convex. The first
        axis is that of the plane of incidence, the second lies across that plane.
    cosine
        Cosine of the angle of incidence, (n,).
    before_m, after_m
        Way from the point to the mirror, and from the mirror on, (n,) [m].

    Returns
    -------
    ndarray
        Widths along the principal axes of the wavefront, the smaller first, (n, 2). Their product
        is the ratio of areas: the irradiance behind the mirror is that on the mirror over the
        product. 0 is a focus; below 0 the beam has passed one.

    References
    ----------
    G. A. Deschamps, Ray techniques in electromagnetics, Proc. IEEE 60 (1972) 1022-1035.
    """
    tensor = 2 * np.array(curvature, dtype=np.float64)
    tensor[:, 0, 0] /= cosine
    tensor[:, 1, 1] *= cosine
    tensor += np.eye(2) / np.asarray(before_m)[:, None, None]
    return np.asarray(1 + np.asarray(after_m)[:, None] * np.linalg.eigvalsh(tensor))
