# SPDX-License-Identifier: GPL-3.0-or-later
"""Bound on the transmission of a rough surface, so that it conserves energy.

A microfacet lobe reflects the albedo A(theta), the mean of Fresnel's F over the facets; a ray
that passes straight through a face gets 1 - F(theta) of the smooth one. A exceeds F by up
to 3e-3 for dielectrics and 0.1 for wet media near grazing incidence, and the sum exceeds 1. The
factors of this module reduce the transmission by the excess.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .fresnel import unpolarised_reflectance
from .rough import albedo

RAMP_BELOW = 0.5
"""Cosine of incidence below which the factor runs linearly from the first to the second."""
_FLAT_ABOVE = 0.4
_COSINES = (
    *(1.0, 0.97, 0.94, 0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6, 0.55, 0.5, 0.45, 0.4),
    *(0.35, 0.3, 0.25, 0.2, 0.16, 0.13, 0.1, 0.07, 0.05, 0.03),
)
_STEPS = 96
_SLACK = 3e-4
"""Allowed excess: the error of the integral, small against the powers."""


@lru_cache(maxsize=256)
def transmission_factors(
    index: complex, slope: float, facet_fresnel: bool = True
) -> tuple[float, float]:
    """Return the factors on 1 - F of a rough surface; (1, 1) for a smooth one.

    Parameters
    ----------
    index
        Complex index n + jk.
    slope
        Rms slope m, 0 for a smooth surface.
    facet_fresnel
        Each facet reflects by Fresnel's equations; False: as at normal incidence.

    Returns
    -------
    flat, grazing
        Factor for cosines from `RAMP_BELOW` up, and at grazing incidence (cosine 0); linear in the
        cosine between.

    Raises
    ------
    ConfigError
        Negative slope, amplifying index.
    """
    if slope == 0:
        return 1.0, 1.0
    cosines = np.array(_COSINES)
    normal = float(unpolarised_reflectance(index, 1.0))
    reflected = [
        albedo(slope, float(c), index, "cycles", _STEPS)
        if facet_fresnel
        else normal * albedo(slope, float(c), None, "cycles", _STEPS)
        for c in cosines
    ]
    entering = 1 - unpolarised_reflectance(index, cosines)
    allowed = np.maximum(1 + _SLACK - np.array(reflected), 0.0)
    bound = np.minimum(allowed / np.maximum(entering, 1e-30), 1.0)
    flat = float(bound[cosines >= _FLAT_ABOVE].min())
    ramp = np.maximum(1 - cosines / RAMP_BELOW, 0.0)
    low = ramp > 0
    grazing = float(np.min(flat + (bound[low] - flat) / ramp[low]))
    return flat, min(max(grazing, 0.0), 1.0)
