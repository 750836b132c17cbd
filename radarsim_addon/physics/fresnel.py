# SPDX-License-Identifier: GPL-3.0-or-later
"""Fresnel reflection of a plane wave at a smooth boundary.

Time convention exp(-j w t): a passive medium has Im(n) >= 0 (engineering texts with exp(+j w t)
write n - jk; take the complex conjugate of their index).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..array_types import Complex, Real


def _terms(index: ArrayLike, cos_incidence: ArrayLike) -> tuple[Complex, Real, Complex]:
    """Return n^2, cos(theta) and q = sqrt(n^2 - sin^2 theta), the branch with Im(q) >= 0."""
    eps = np.asarray(index, dtype=np.complex128) ** 2
    cosine = np.asarray(cos_incidence, dtype=np.float64)
    # n^2 - sin^2 as (n^2 - 1) + cos^2 keeps its digits at grazing incidence and for n near 1.
    return eps, cosine, np.sqrt((eps - 1) + cosine**2)


def reflection_coefficients(index: ArrayLike, cos_incidence: ArrayLike) -> tuple[Complex, Complex]:
    """Return the amplitude reflection coefficients from vacuum onto a medium.

    Parameters
    ----------
    index : Complex index n + jk of the medium, Im >= 0. Broadcasts with `cos_incidence`.
    cos_incidence : Cosine of the angle of incidence, 0 to 1

    Returns
    -------
    r_s, r_p : Perpendicular (s, TE) and parallel (p, TM); at normal incidence r_p = -r_s

    Notes
    -----
    Born and Wolf, Principles of Optics, 1.5.2 (20), in a form without subtraction of near-equal
    numbers: c - q = (1 - n^2)/(c + q), n^2 c - q = (n^2 - 1)((n^2 + 1) c^2 - 1)/(n^2 c + q).
    """
    eps, cosine, q = _terms(index, cos_incidence)
    r_s = (1 - eps) / (cosine + q) ** 2
    r_p = (eps - 1) * ((eps + 1) * cosine**2 - 1) / (eps * cosine + q) ** 2
    return r_s, r_p


def power_transmission(index: ArrayLike, cos_incidence: ArrayLike) -> tuple[Real, Real]:
    """Return the fraction of the power that enters the medium, 1 - |r|^2.

    Computed without the subtraction, so that it keeps its digits if |r| is near one: conductors and
    grazing incidence.

    Parameters
    ----------
    index, cos_incidence : As for `reflection_coefficients`

    Returns
    -------
    t_s, t_p : Fractions for both polarisations, of the broadcast shape
    """
    eps, cosine, q = _terms(index, cos_incidence)
    t_s = 4 * cosine * q.real / np.abs(cosine + q) ** 2
    t_p = 4 * cosine * (eps * np.conj(q)).real / np.abs(eps * cosine + q) ** 2
    return t_s, t_p


def unpolarised_reflectance(index: ArrayLike, cos_incidence: ArrayLike) -> Real:
    """Return the reflectance (|r_s|^2 + |r_p|^2)/2 that the Radar Material's nodes evaluate.

    Parameters
    ----------
    index, cos_incidence : As for `reflection_coefficients`

    Returns
    -------
    ndarray : Fraction of the incident power, of the broadcast shape
    """
    r_s, r_p = reflection_coefficients(index, cos_incidence)
    return np.asarray((np.abs(r_s) ** 2 + np.abs(r_p) ** 2) / 2, dtype=np.float64)
