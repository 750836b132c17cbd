# SPDX-License-Identifier: GPL-3.0-or-later
"""Fresnel reflection of a plane wave at a smooth boundary.

Time convention exp(-j w t): a passive medium has Im(n) >= 0 (engineering texts with exp(+j w t)
write n - jk; take the complex conjugate of their index).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..array_types import Complex, Real


class FacePower(NamedTuple):
    """One polarisation at a face that a wave meets from vacuum.

    Attributes
    ----------
    r
        Amplitude reflection coefficient.
    tt
        Product of the amplitudes that enter and leave, 1 - r^2.
    entering
        Fraction of the power that enters, 1 - |r|^2.
    """

    r: Complex
    tt: Complex
    entering: Real


def normal_wave(index: ArrayLike, cos_incidence: ArrayLike) -> tuple[Complex, Real, Complex]:
    """Return n^2, cos(theta) and q, the normal component of the wave vector inside over k0.

    Parameters
    ----------
    index
        Complex index n + jk of the medium, Im >= 0. Broadcasts with `cos_incidence`.
    cos_incidence
        Cosine of the angle of incidence, 0 to 1.

    Returns
    -------
    eps, cosine, q
        q = sqrt(n^2 - sin^2(theta)), the branch with Im(q) >= 0.
    """
    eps = np.asarray(index, dtype=np.complex128) ** 2
    cosine = np.asarray(cos_incidence, dtype=np.float64)
    # n^2 - sin^2 as (n^2 - 1) + cos^2 keeps its digits at grazing incidence and for n near 1.
    return eps, cosine, np.asarray(np.sqrt((eps - 1) + cosine**2), dtype=np.complex128)


def faces(eps: Complex, cosine: Real, q: Complex) -> tuple[FacePower, FacePower]:
    """Return reflection and transmission of both polarisations.

    Parameters
    ----------
    eps, cosine, q
        As `normal_wave` returns them.

    Returns
    -------
    s, p
        Perpendicular (s, TE) and parallel (p, TM); at normal incidence r_p = -r_s.

    Notes
    -----
    Born and Wolf, Principles of Optics, 1.5.2 (20), in a form without subtraction of near-equal
    numbers: c - q = (1 - n^2)/(c + q), n^2 c - q = (n^2 - 1)((n^2 + 1) c^2 - 1)/(n^2 c + q).
    """
    sum_s, sum_p = cosine + q, eps * cosine + q
    # q = c = 0 is vacuum at exactly grazing incidence: nothing reflects.
    none = (sum_s == 0) | (sum_p == 0)
    sum_s, sum_p = np.where(none, 1, sum_s), np.where(none, 1, sum_p)
    r_s = np.where(none, 0, (1 - eps) / sum_s**2)
    r_p = np.where(none, 0, (eps - 1) * ((eps + 1) * cosine**2 - 1) / sum_p**2)
    tt_s = np.where(none, 1, 4 * cosine * q / sum_s**2)
    tt_p = np.where(none, 1, 4 * eps * cosine * q / sum_p**2)
    enter_s = np.where(none, 1, 4 * cosine * q.real / np.abs(sum_s) ** 2)
    enter_p = np.where(none, 1, 4 * cosine * (eps * np.conj(q)).real / np.abs(sum_p) ** 2)
    return FacePower(r_s, tt_s, enter_s), FacePower(r_p, tt_p, enter_p)


def reflection_coefficients(index: ArrayLike, cos_incidence: ArrayLike) -> tuple[Complex, Complex]:
    """Return the amplitude reflection coefficients from vacuum onto a medium.

    Parameters
    ----------
    index, cos_incidence
        As for `normal_wave`.

    Returns
    -------
    r_s, r_p
        See `faces`.
    """
    s, p = faces(*normal_wave(index, cos_incidence))
    return s.r, p.r


def power_transmission(index: ArrayLike, cos_incidence: ArrayLike) -> tuple[Real, Real]:
    """Return the fraction of the power that enters the medium, 1 - |r|^2.

    It keeps its digits if |r| is near one: conductors and grazing incidence.

    Parameters
    ----------
    index, cos_incidence
        As for `normal_wave`.

    Returns
    -------
    t_s, t_p
        Fractions for both polarisations, of the broadcast shape.
    """
    s, p = faces(*normal_wave(index, cos_incidence))
    return s.entering, p.entering


def unpolarised_reflectance(index: ArrayLike, cos_incidence: ArrayLike) -> Real:
    """Return the reflectance (|r_s|^2 + |r_p|^2)/2 that the Radar Material's nodes evaluate.

    Parameters
    ----------
    index, cos_incidence
        As for `normal_wave`.

    Returns
    -------
    ndarray
        Fraction of the incident power, of the broadcast shape.
    """
    r_s, r_p = reflection_coefficients(index, cos_incidence)
    return np.asarray((np.abs(r_s) ** 2 + np.abs(r_p) ** 2) / 2, dtype=np.float64)
