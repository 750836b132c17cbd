# SPDX-License-Identifier: GPL-3.0-or-later
"""Scattering of rough surfaces: the Kirchhoff model in the geometric-optics limit.

Surface heights are Gaussian with rms slope m (one component). Facets with a normal half way between
radar and receiver reflect. The model equals a microfacet lobe with the Beckmann distribution,
alpha = sqrt(2) m, and Roughness = sqrt(alpha) in Cycles. All arguments broadcast.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..array_types import Real
from ..errors import ConfigError
from ..findings import Finding, finding
from .checks import direction_cosine, passive_index, real_array, require_one_shape
from .fresnel import unpolarised_reflectance

Masking = Literal["none", "smith", "cycles"]
MASKINGS: tuple[Masking, ...] = ("none", "smith", "cycles")

#: Index of a medium that reflects all but 4e-9 at normal incidence.
_CONDUCTOR = 1e9

_erfc = np.vectorize(math.erfc, otypes=[np.float64])


# -- conversions -----------------------------------------------------------------------------------


def rms_slope(rms_height_m: ArrayLike, correlation_length_m: ArrayLike) -> Real:
    """Return m = sqrt(2) h / l for a Gaussian correlation function (Ulaby, Moore, Fung II, 12-4).

    An exponential correlation function has no finite slope: use a measured slope for it.

    Parameters
    ----------
    rms_height_m, correlation_length_m
        h and l [m].

    Returns
    -------
    ndarray
        Rms slope.
    """
    height = real_array("Rms height", rms_height_m, "m", minimum=0.0)
    length = real_array("Correlation length", correlation_length_m, "m", above=0.0)
    return np.asarray(np.sqrt(2) * height / length, dtype=np.float64)


def cycles_roughness(slope: ArrayLike) -> Real:
    """Return the Roughness of Cycles' glossy and metallic nodes, sqrt(alpha).

    Parameters
    ----------
    slope
        Rms slope m.

    Returns
    -------
    ndarray : 0 to 1; Cycles clamps larger values

    Raises
    ------
    ConfigError
        For slopes above 1/sqrt(2), beyond a roughness of 1.
    """
    roughness = np.sqrt(np.sqrt(2) * real_array("Rms slope", slope, "", minimum=0.0))
    if np.any(roughness > 1 + 1e-9):
        raise ConfigError(
            f"Rms slope {np.max(np.asarray(slope)):g} needs a roughness of {roughness.max():g}; "
            "Cycles allows at most 1 (slope 0.7071). Model such a surface by its geometry."
        )
    return np.asarray(np.minimum(roughness, 1.0), dtype=np.float64)


def slope_from_roughness(roughness: ArrayLike) -> Real:
    """Return the rms slope of a Cycles roughness, r^2 / sqrt(2).

    Parameters
    ----------
    roughness
        r, 0 to 1.

    Returns
    -------
    ndarray
        Rms slope.
    """
    value = real_array("Roughness", roughness, "", 0.0, 1.0)
    return np.asarray(value**2 / np.sqrt(2), dtype=np.float64)


def least_rms_height_m(slope: ArrayLike, wavelength_m: ArrayLike) -> Real:
    """Return m lambda / sqrt(2), the least RMS height that a slope can stand for.

    It is that of a correlation length of one wavelength. The Kirchhoff model does not hold for
    much shorter ones (`kirchhoff_limits`: k l > 6), and longer ones have larger heights. Slopes
    from sqrt(2)/8 on (a Roughness of 0.5) have lambda/8 or more: these surfaces are rough. A
    smaller slope does not tell whether a surface is rough.

    Parameters
    ----------
    slope
        RMS slope m.
    wavelength_m
        lambda [m].

    Returns
    -------
    ndarray
        RMS height [m].
    """
    wavelength = real_array("Wavelength", wavelength_m, "m", above=0.0)
    return np.asarray(real_array("Rms slope", slope, "", minimum=0.0) * wavelength / np.sqrt(2))


def coherent_fraction(
    rms_height_m: ArrayLike, wavelength_m: ArrayLike, cos_incidence: ArrayLike = 1.0
) -> Real:
    """Return the fraction of the mirror-like power that roughness leaves, exp(-(2 k h cos)^2).

    Ament 1953.

    Parameters
    ----------
    rms_height_m, wavelength_m
        h and wavelength [m].
    cos_incidence
        Cosine of the angle of incidence.

    Returns
    -------
    ndarray
        Fraction, 0 to 1.
    """
    height = real_array("Rms height", rms_height_m, "m", minimum=0.0)
    wavelength = real_array("Wavelength", wavelength_m, "m", above=0.0)
    rayleigh = 4 * np.pi * height / wavelength * direction_cosine(cos_incidence)
    return np.asarray(np.exp(-(rayleigh**2)), dtype=np.float64)


def kirchhoff_limits(
    rms_height_m: float,
    correlation_length_m: float,
    wavelength_m: float,
    cos_incidence: float = 1.0,
) -> tuple[Finding, ...]:
    """Return the reasons why the Kirchhoff geometric-optics model is invalid.

    Ulaby, Moore and Fung II, 12-4: k l > 6 and mean radius of curvature above the wavelength,
    l^2 > 2.76 h lambda, for the Kirchhoff approximation; (2 k h cos)^2 > 10 for its stationary
    phase limit. The bound of the slope is where the single scattering of Cycles was measured to be
    within 0.02 dB of the model without masking.

    Parameters
    ----------
    rms_height_m, correlation_length_m, wavelength_m
        h, l and lambda [m].
    cos_incidence
        Cosine of the angle of incidence.

    Returns
    -------
    tuple of Finding
        Without subjects; empty if the model is valid.
    """
    height = float(real_array("Rms height", rms_height_m, "m", minimum=0.0))
    length = float(real_array("Correlation length", correlation_length_m, "m", above=0.0))
    wavelength = float(real_array("Wavelength", wavelength_m, "m", above=0.0))
    cosine = float(direction_cosine(cos_incidence))
    wavenumber = 2 * np.pi / wavelength
    reasons = []
    if wavenumber * length <= 6:
        reasons.append(finding("kirchhoff-short-correlation", k_l=wavenumber * length))
    if length**2 <= 2.76 * height * wavelength:
        curvature = length**2 / (height * wavelength)
        reasons.append(finding("kirchhoff-curved-facets", curvature=curvature))
    phase_rad = 2 * wavenumber * height * cosine
    if phase_rad**2 <= 10:
        reasons.append(finding("kirchhoff-coherent-part", phase_rad=phase_rad))
    slope = float(rms_slope(height, length))
    if slope > 0.4:
        reasons.append(finding("kirchhoff-steep-slopes", slope=slope))
    return tuple(reasons)


# -- the model -------------------------------------------------------------------------------------


def sigma0(
    index: ArrayLike,
    slope: ArrayLike,
    cos_incidence: ArrayLike,
    masking: Masking = "none",
) -> Real:
    """Return the backscatter coefficient of a rough surface, both like polarisations.

    |Gamma(0)|^2 exp(-tan^2/alpha^2) / (alpha^2 cos^4), alpha = sqrt(2) m (Ulaby, Moore, Fung II,
    eq. 12.55; Valenzuela 1978), Gamma(0) at normal incidence on the facet. Times G with masking.

    Parameters
    ----------
    index
        Complex index n + jk.
    slope
        Rms slope m, more than 0.
    cos_incidence
        Cosine of the incidence angle; at 0 the coefficient is 0.
    masking : 'none', 'smith' or 'cycles'; see `masking_lambda`

    Returns
    -------
    ndarray
        sigma_0 [m^2/m^2].
    """
    alpha = np.sqrt(2) * real_array("Rms slope", slope, "", above=0.0)
    cosine = direction_cosine(cos_incidence)
    require_one_shape(index=np.asarray(index), slope=alpha, cos_incidence=cosine)
    reflectance = unpolarised_reflectance(passive_index(index), 1.0)
    # The floor keeps tan^2 finite; the value there is zero anyway.
    safe = np.maximum(cosine, 1e-100)
    tan2 = (1 - safe) * (1 + safe) / safe**2
    # In logarithms: near grazing 1/cos^4 overflows before the exponential wins.
    log_value = -tan2 / alpha**2 - 2 * np.log(alpha) - 4 * np.log(safe)
    value = np.where(cosine > 0, reflectance * np.exp(log_value), 0.0)
    if _masking(masking) == "none":
        return np.asarray(value, dtype=np.float64)
    return np.asarray(value / (1 + 2 * masking_lambda(alpha, safe, masking)), dtype=np.float64)


def facet_brightness(
    slope: ArrayLike, cos_in: ArrayLike, cos_out: ArrayLike, cos_facet: ArrayLike
) -> Real:
    """Return how bright facets that reflect everything are, for a transmitter and a receiver.

    4 pi f cos_in = pi D G2 / cos_out, with f the BRDF of a perfect conductor, D the Beckmann
    distribution at the facet half way, and G2 the masking of Cycles. Times the reflectance at the
    facet it is the cross section per area that the receiver sees: `sigma0` over cos_out where both
    antennas are at one place. A Lambert surface has 4 rho cos_in.

    Parameters
    ----------
    slope
        Rms slope m, more than 0.
    cos_in, cos_out
        Cosines of the angles from the normal to transmitter and receiver; 0 behind either.
    cos_facet
        Cosine of the angle from the normal to the facet half way.

    Returns
    -------
    ndarray
        Brightness [m^2/m^2].
    """
    alpha = np.sqrt(2) * real_array("Rms slope", slope, "", above=0.0)
    ahead = (np.asarray(cos_in) > 0) & (np.asarray(cos_out) > 0)
    enters, leaves = (np.where(ahead, cosine, 1.0) for cosine in (cos_in, cos_out))
    masking = sum(masking_lambda(alpha, cosine, "cycles") for cosine in (enters, leaves))
    single = sigma0(_CONDUCTOR, slope, cos_facet) / (1 + masking) / leaves
    return np.asarray(np.where(ahead, single, 0.0), dtype=np.float64)


def _masking(masking: str) -> str:
    if masking not in MASKINGS:
        raise ConfigError(f"Masking is {masking!r}; expected one of {', '.join(MASKINGS)}.")
    return masking


def masking_lambda(alpha: ArrayLike, cosine: ArrayLike, masking: Masking = "smith") -> Real:
    """Return Smith's Lambda of a Beckmann surface; G1 = 1/(1 + Lambda), G2 = 1/(1 + L_i + L_o).

    Parameters
    ----------
    alpha
        Width of the Beckmann distribution.
    cosine
        Cosine of the angle from the normal.
    masking
        'smith': exact, (exp(-a^2)/(a sqrt(pi)) - erfc(a))/2 with a = 1/(alpha tan) (Smith 1967).
        'cycles': the rational approximation of Walter et al. 2007 eq. 27 that renderers use, with
        up to 3e-3 of error in the masking. 'none': 0.

    Returns
    -------
    ndarray
        Lambda, 0 or more.
    """
    width = np.asarray(alpha, dtype=np.float64)
    c = np.asarray(cosine, dtype=np.float64)
    if _masking(masking) == "none":
        return np.zeros(np.broadcast_shapes(width.shape, c.shape))
    tangent = np.sqrt(np.maximum((1 - c) * (1 + c), 0)) / np.maximum(c, 1e-300)
    # a is capped on both sides: 30 is no masking at all, 1e-12 is grazing.
    a = np.clip(1 / np.maximum(width * tangent, 1e-300), 1e-12, 30.0)
    if masking == "cycles":
        rational = (1 - 1.259 * a + 0.396 * a**2) / (3.535 * a + 2.181 * a**2)
        return np.asarray(np.where(a < 1.6, rational, 0.0), dtype=np.float64)
    return np.asarray(
        np.maximum((np.exp(-(a**2)) / (a * np.sqrt(np.pi)) - _erfc(a)) / 2, 0.0), dtype=np.float64
    )


def albedo(
    slope: float,
    cos_incidence: float,
    index: complex | None = None,
    masking: Masking = "smith",
    steps: int = 512,
) -> float:
    """Return the fraction of the incident power that single scattering by the facets reflects.

    The mean over Gaussian slopes of F(i.m) G2 (i.m)/((n.i)(n.m)), over visible facets that
    reflect upwards; midpoint rule on `steps` x `steps` equal-probability cells (converged to
    1e-4 at the default). The difference from 1 for a perfect conductor is the multiple
    scattering that the model omits.

    Parameters
    ----------
    slope
        Rms slope m, more than 0.
    cos_incidence
        Cosine of the incidence angle, more than 0.
    index
        Complex index; None is a perfect conductor, F = 1.
    masking : 'smith' (exact) or 'cycles' (rational approximation)
    steps
        Cells per direction.

    Returns
    -------
    float
        Fraction, 0 to 1.

    Raises
    ------
    ConfigError
        Slope or cosine out of bounds, amplifying index, or no masking.
    """
    alpha = float(np.sqrt(2) * real_array("Rms slope", slope, "", above=0.0))
    cos_i = float(real_array("Cosine of the angle of incidence", cos_incidence, "", None, 1.0, 0.0))
    sin_i = math.sqrt((1 - cos_i) * (1 + cos_i))
    if _masking(masking) == "none":
        raise ConfigError(
            "Masking is 'none', with which the albedo exceeds 1; use 'smith' or 'cycles'."
        )
    cell = (np.arange(steps) + 0.5) / steps
    radius = alpha * np.sqrt(-np.log1p(-cell))[:, None]
    azimuth = np.pi * cell[None, :]  # half the circle: the other half is its mirror image
    slope_x, slope_y = radius * np.cos(azimuth), radius * np.sin(azimuth)
    cos_m = 1 / np.sqrt(1 + slope_x**2 + slope_y**2)
    # Facet normal m = (-p, -q, 1) cos_m; incident direction i = (sin, 0, cos).
    facing = (cos_i - slope_x * sin_i) * cos_m
    cos_o = 2 * facing * cos_m - cos_i
    used = (facing > 0) & (cos_o > 0)
    weight: Real | float = 1.0
    if index is not None:
        weight = unpolarised_reflectance(passive_index(index), np.clip(facing, 0.0, 1.0))
    lambda_i = masking_lambda(alpha, cos_i, masking)
    lambda_o = masking_lambda(alpha, np.where(used, cos_o, 1.0), masking)
    value = weight * facing / (cos_i * cos_m) / (1 + lambda_i + lambda_o)
    return float(np.mean(np.where(used, value, 0.0)))
