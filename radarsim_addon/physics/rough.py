# SPDX-License-Identifier: GPL-3.0-or-later
"""Scattering of rough surfaces: the Kirchhoff model in the geometric-optics limit, and lobes.

Surface heights are Gaussian with RMS slope m (one component). Facets with a normal half way between
radar and receiver reflect. The model equals a microfacet lobe with the Beckmann distribution,
alpha = sqrt(2) m, and Roughness = sqrt(alpha) in Cycles. There are conversions between heights,
slopes and roughness, backscatter (`sigma0`) and bistatic scattering (`facet_scattering`), and the
limits of the model (`kirchhoff_limits`).

Energy: a microfacet lobe reflects the albedo A(theta), the mean of Fresnel's F over the facets
(`albedo`); a ray that passes straight through a face gets 1 - F(theta) of the smooth one. A exceeds
F by up to 3e-3 for dielectrics and 0.1 for wet media near grazing incidence, and the sum exceeds 1.
`transmission_factors` reduce the transmission by the excess.

`directive_lobe` is the lobe of effective roughness around the mirrored direction instead. Per
steradian the scattered power goes with ((1 + cos psi) / 2)^exponent, psi the angle to the direction
of the mirrored wave. Over all directions above the surface the lobe adds up to 1, whatever the
angle of incidence (V. Degli-Esposti, F. Fuschini, E. M. Vitucci, G. Falciasecca, Measurement and
modelling of scattering from buildings, IEEE Trans. Antennas Propag. 55 (2007) 143-153, eq. 9 to
12).

In all functions slope is the RMS slope m, index n + jk, and cos_incidence the cosine of the angle
of incidence.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Real, dots, norms, reals
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
    rms_height_m, correlation_length_m : h and l [m]

    Returns
    -------
    ndarray
    """
    height = real_array("Rms height", rms_height_m, "m", minimum=0.0)
    length = real_array("Correlation length", correlation_length_m, "m", above=0.0)
    return np.asarray(np.sqrt(2) * height / length)


def cycles_roughness(slope: ArrayLike) -> Real:
    """Return the Roughness of Cycles' glossy and metallic nodes, sqrt(alpha).

    Parameters
    ----------
    slope : up to 1/sqrt(2), a roughness of 1

    Returns
    -------
    ndarray : 0 to 1

    Raises
    ------
    ConfigError : slope beyond that
    """
    roughness = np.sqrt(np.sqrt(2) * real_array("Rms slope", slope, "", minimum=0.0))
    if np.any(roughness > 1 + 1e-9):
        raise ConfigError(
            f"Rms slope {np.max(np.asarray(slope)):g} needs a roughness of {roughness.max():g}; "
            "Cycles allows at most 1 (slope 0.7071). Model such a surface by its geometry."
        )
    return np.asarray(np.minimum(roughness, 1.0))


def slope_from_roughness(roughness: ArrayLike) -> Real:
    """Return the RMS slope of a Cycles roughness, r^2 / sqrt(2).

    Parameters
    ----------
    roughness : r, 0 to 1

    Returns
    -------
    ndarray
    """
    value = real_array("Roughness", roughness, "", 0.0, 1.0)
    return np.asarray(value**2 / np.sqrt(2))


def least_rms_height_m(slope: ArrayLike, wavelength_m: ArrayLike) -> Real:
    """Return m lambda / sqrt(2), the least RMS height that a slope can stand for [m].

    It is that of a correlation length of one wavelength. The Kirchhoff model does not hold for
    much shorter ones (`kirchhoff_limits`: k l > 6), and longer ones have larger heights. Slopes
    from sqrt(2)/8 on (a Roughness of 0.5) have lambda/8 or more: these surfaces are rough. A
    smaller slope does not tell whether a surface is rough.

    Parameters
    ----------
    slope, wavelength_m : m and lambda [m]

    Returns
    -------
    ndarray
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
    rms_height_m, wavelength_m, cos_incidence : h and lambda [m], and cosine of incidence

    Returns
    -------
    ndarray
    """
    height = real_array("Rms height", rms_height_m, "m", minimum=0.0)
    wavelength = real_array("Wavelength", wavelength_m, "m", above=0.0)
    rayleigh = 4 * np.pi * height / wavelength * direction_cosine(cos_incidence)
    return np.asarray(np.exp(-(rayleigh**2)))


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
    rms_height_m, correlation_length_m, wavelength_m : h, l and lambda [m]
    cos_incidence : cosine of incidence

    Returns
    -------
    tuple of Finding : without subjects; empty if the model is valid
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
    """Return the backscatter coefficient of a rough surface, both like polarisations [m^2/m^2].

    |Gamma(0)|^2 exp(-tan^2/alpha^2) / (alpha^2 cos^4), alpha = sqrt(2) m (Ulaby, Moore, Fung II,
    eq. 12.55; Valenzuela 1978), Gamma(0) at normal incidence on the facet. Times G with masking.

    Parameters
    ----------
    index, slope : of the surface; the slope is more than 0
    cos_incidence : at 0 the coefficient is 0
    masking : see `masking_lambda`

    Returns
    -------
    ndarray
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
        return np.asarray(value)
    return np.asarray(value / (1 + 2 * masking_lambda(alpha, safe, masking)))


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
    slope : more than 0
    cos_in, cos_out
        Cosines of the angles from the normal to transmitter and receiver; 0 behind either.
    cos_facet : cosine of the angle from the normal to the facet half way

    Returns
    -------
    ndarray : [m^2/m^2]
    """
    alpha = np.sqrt(2) * real_array("Rms slope", slope, "", above=0.0)
    ahead = (np.asarray(cos_in) > 0) & (np.asarray(cos_out) > 0)
    enters, leaves = (np.where(ahead, cosine, 1.0) for cosine in (cos_in, cos_out))
    masking = sum(masking_lambda(alpha, cosine, "cycles") for cosine in (enters, leaves))
    single = sigma0(_CONDUCTOR, slope, cos_facet) / (1 + masking) / leaves
    return np.asarray(np.where(ahead, single, 0.0))


def _masking(masking: str) -> str:
    if masking not in MASKINGS:
        raise ConfigError(f"Masking is {masking!r}; expected one of {', '.join(MASKINGS)}.")
    return masking


def masking_lambda(alpha: ArrayLike, cosine: ArrayLike, masking: Masking = "smith") -> Real:
    """Return Smith's Lambda of a Beckmann surface; G1 = 1/(1 + Lambda), G2 = 1/(1 + L_i + L_o).

    Parameters
    ----------
    alpha : width of the Beckmann distribution
    cosine : cosine of the angle from the normal
    masking
        'smith': exact, (exp(-a^2)/(a sqrt(pi)) - erfc(a))/2 with a = 1/(alpha tan) (Smith 1967).
        'cycles': the rational approximation of Walter et al. 2007 eq. 27 that renderers use, with
        up to 3e-3 of error in the masking. 'none': 0.

    Returns
    -------
    ndarray : 0 or more
    """
    width, c = reals(alpha, cosine)
    if _masking(masking) == "none":
        return np.zeros(np.broadcast_shapes(width.shape, c.shape))
    tangent = np.sqrt(np.maximum((1 - c) * (1 + c), 0)) / np.maximum(c, 1e-300)
    # a is capped on both sides: 30 is no masking at all, 1e-12 is grazing.
    a = np.clip(1 / np.maximum(width * tangent, 1e-300), 1e-12, 30.0)
    if masking == "cycles":
        rational = (1 - 1.259 * a + 0.396 * a**2) / (3.535 * a + 2.181 * a**2)
        return np.asarray(np.where(a < 1.6, rational, 0.0))
    return np.asarray(np.maximum((np.exp(-(a**2)) / (a * np.sqrt(np.pi)) - _erfc(a)) / 2, 0.0))


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
    slope, cos_incidence : more than 0
    index : None is a perfect conductor, F = 1
    masking : 'smith' or 'cycles', see `masking_lambda`
    steps : cells per direction

    Returns
    -------
    float : 0 to 1

    Raises
    ------
    ConfigError : no masking
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


# -- transmission that conserves energy ------------------------------------------------------------

RAMP_BELOW = 0.5
"""Cosine of incidence below which the factor runs linearly from the first to the second."""
_FLAT_ABOVE = 0.4
_TRANSMISSION_COSINES = (
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
    index, slope : of the surface; slope 0: smooth
    facet_fresnel : each facet reflects by Fresnel's equations; False: as at normal incidence

    Returns
    -------
    flat, grazing
        Factor for cosines from `RAMP_BELOW` up, and at grazing incidence (cosine 0); linear in the
        cosine between.
    """
    if slope == 0:
        return 1.0, 1.0
    cosines = np.array(_TRANSMISSION_COSINES)
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


# -- from one direction into another ---------------------------------------------------------------


def facet_scattering(
    index: complex, alpha: float, normal: Real, to_one: Real, to_other: Real, exact: bool = True
) -> Real:
    """Return F D G / (4 cos cos): scattered radiance over incident irradiance, per steradian.

    Facets have Beckmann's distribution and Smith's masking in the approximation that Cycles uses
    (Walter et al. 2007, eq. 20, 25 and 27). In backscatter 4 pi cos^2 times this is `sigma0`.

    Parameters
    ----------
    index, alpha : of the surface; sqrt(2) m, above 0
    normal, to_one, to_other
        Unit vectors: of the surface, and from it towards both ends, on its side, (n, 3).
    exact : Fresnel's equations at each facet; False: at normal incidence on it

    Returns
    -------
    ndarray : (n,); 0 where an end is below the surface
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
    return np.asarray(np.where(above, found, 0.0))


# -- directive lobes -------------------------------------------------------------------------------

#: Largest exponent of a lobe: half of its power lies within 2.4 degrees there.
MOST_EXPONENT = 1000
#: Cosines in a table of `lobe_integral`.
_COSINES = 4097


def lobe_exponent(value: object) -> int:
    """Return an exponent as a whole number, 1 to `MOST_EXPONENT`.

    Parameters
    ----------
    value : number

    Returns
    -------
    int

    Raises
    ------
    ConfigError : it is no such number
    """
    if (
        not isinstance(value, int | float | np.integer | np.floating)
        or isinstance(value, bool)
        or not 1 <= value <= MOST_EXPONENT
        or value != int(value)
    ):
        raise ConfigError(
            f"The exponent of a scattered lobe is {value!r}; expected a whole number from 1 (wide) "
            f"to {MOST_EXPONENT} (narrow)."
        )
    return int(value)


def lobe_integral(exponent: int, cosine: Real) -> Real:
    """Return the integral of ((1 + cos psi) / 2)^exponent over all directions above a surface.

    Parameters
    ----------
    exponent, cosine : see `lobe_exponent`; cosines of angles of incidence

    Returns
    -------
    ndarray : solid angles [sr]
    """
    cosine = np.asarray(cosine, dtype=np.float64)
    sine2 = (1 - cosine) * (1 + cosine)
    total = np.zeros(cosine.shape)
    # the sum over w up to (j - 1) / 2 of binomial(2w, w) (sine / 2)^(2w)
    part = term = np.ones(cosine.shape)
    for j in range(exponent + 1):
        share = math.exp(
            math.lgamma(exponent + 1)
            - math.lgamma(j + 1)
            - math.lgamma(exponent - j + 1)
            - exponent * math.log(2)
        )
        if j % 2 and j > 1:
            w = (j - 1) // 2
            term = term * sine2 * (2 * w - 1) / (2 * w)
            part = part + term
        total += share * 2 * math.pi / (j + 1) * (cosine * part if j % 2 else 1.0)
    return np.asarray(total)


@lru_cache(maxsize=64)
def _table(exponent: int) -> tuple[Real, Real]:
    """Return cosines and the integrals at them."""
    cosines = np.linspace(0.0, 1.0, _COSINES)
    return cosines, lobe_integral(exponent, cosines)


def directive_lobe(exponent: int, normal: Real, to_source: Real, to_observer: Real) -> Real:
    """Return the scattered radiance over the irradiance of the scattered fraction, per steradian.

    Parameters
    ----------
    exponent : see `lobe_exponent`
    normal, to_source, to_observer
        Unit vectors: of the surface, and from it towards both, on its side, (n, 3).

    Returns
    -------
    ndarray : (n,); its integral over the observer's directions, times their cosines, is 1
    """
    cosine = dots(normal, to_source)
    mirrored = 2 * cosine * dots(normal, to_observer) - dots(to_source, to_observer)
    lobe = np.clip((1 + mirrored) / 2, 0.0, 1.0) ** exponent
    integral = np.interp(np.clip(cosine, 0.0, 1.0), *_table(exponent))
    return np.asarray(lobe / integral / dots(normal, to_observer))
