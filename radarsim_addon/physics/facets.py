# SPDX-License-Identifier: GPL-3.0-or-later
"""Scattering of a rough surface from one direction into another: Kirchhoff's model, bistatic."""

from __future__ import annotations

import numpy as np

from ..array_types import Real
from ..vectors import dots, norms
from .fresnel import unpolarised_reflectance
from .rough import masking_lambda


def facet_scattering(
    index: complex, alpha: float, normal: Real, to_one: Real, to_other: Real, exact: bool = True
) -> Real:
    """Return F D G / (4 cos cos): scattered radiance over incident irradiance, per steradian.

    Facets have Beckmann's distribution and Smith's masking in the approximation that Cycles uses
    (Walter et al. 2007, eq. 20, 25 and 27). In backscatter 4 pi cos^2 times this is sigma0.

    Parameters
    ----------
    index
        n + jk.
    alpha
        sqrt(2) times the RMS slope, above 0.
    normal, to_one, to_other
        Unit vectors: of the surface, and from it towards both ends, on its side, (n, 3).
    exact
        Fresnel's equations at each facet; False: at normal incidence on it.

    Returns
    -------
    ndarray
        (n,); 0 where an end is below the surface.
    """
    half = to_one + to_other
    half = half / np.maximum(norms(half), 1e-300)[:, None]
    cosines = dots(normal, to_one), dots(normal, to_other)
    facet = np.maximum(dots(normal, half), 1e-100)
    above = (cosines[0] > 0) & (cosines[1] > 0)
    one, other = (np.where(above, cosine, 1.0) for cosine in cosines)
    tan2 = (1 - facet) * (1 + facet) / facet**2
    with np.errstate(over="ignore"):
        density = np.exp(-tan2 / alpha**2 - 4 * np.log(facet)) / (np.pi * alpha**2)
    masked = 1 + sum(masking_lambda(alpha, cosine, "cycles") for cosine in (one, other))
    seen = np.clip(dots(half, to_one), 0.0, 1.0) if exact else 1.0
    found = unpolarised_reflectance(index, seen) * density / masked / (4 * one * other)
    return np.asarray(np.where(above, found, 0.0), dtype=np.float64)
