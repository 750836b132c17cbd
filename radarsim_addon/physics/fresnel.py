# SPDX-License-Identifier: GPL-3.0-or-later
"""Fresnel reflection of a plane wave at a smooth boundary, and at a plane-parallel slab in vacuum.

With c = cos(theta) outside, q = sqrt(n^2 - 1 + c^2) is the normal component of the wave vector
inside over k0. The coefficients of a face follow from n^2, c and q, those of a slab of thickness d
from two faces and the complex phase of one passage, delta = k0 q d. Of a slab there are three
descriptions, all power per incident power (`slab_power`):

- ``coherent``: all internal reflections interfere (Airy; Born and Wolf 7.6, 14.4): a
  monochromatic wave on a perfect sheet.
- ``incoherent``: all internal reflections, added in power. The mean over frequency of a lossless
  or weakly lossy slab that is many wavelengths thick.
- ``single-pass``: the straight path alone. It is the result of a range gate if the internal
  echoes fall into other range cells, and of straight-through ray tracing.

The last two describe separate passages. An absorbing sheet thinner than its penetration depth, or
a wave that tunnels through beyond total reflection, has none: the first term of the series can
exceed the power that enters. It is capped so that energy is conserved; use 'coherent' for such
sheets.

In all functions index is the complex index n + jk, Im >= 0, and cos_incidence the cosine of the
angle of incidence outside, 0 to 1.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Complex, Real
from ..errors import ConfigError
from .checks import direction_cosine, passive_index, real_array, require_one_shape


class _FacePower(NamedTuple):
    """One polarisation at a face that a wave meets from vacuum."""

    r: Complex  # amplitude reflection coefficient
    tt: Complex  # product of the amplitudes that enter and leave, 1 - r^2
    entering: Real  # fraction of the power that enters, 1 - |r|^2


def _normal_wave(index: ArrayLike, cos_incidence: ArrayLike) -> tuple[Complex, Real, Complex]:
    """Return n^2, cos(theta) and q, on the branch with Im(q) >= 0."""
    eps = np.asarray(index, dtype=np.complex128) ** 2
    cosine = np.asarray(cos_incidence, dtype=np.float64)
    # n^2 - sin^2 as (n^2 - 1) + cos^2 keeps its digits at grazing incidence and for n near 1.
    return eps, cosine, np.asarray(np.sqrt((eps - 1) + cosine**2), dtype=np.complex128)


def _faces(eps: Complex, cosine: Real, q: Complex) -> tuple[_FacePower, _FacePower]:
    """Return the perpendicular (s, TE) and parallel (p, TM) wave; at normal incidence r_p = -r_s.

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
    return _FacePower(r_s, tt_s, enter_s), _FacePower(r_p, tt_p, enter_p)


def reflection_coefficients(index: ArrayLike, cos_incidence: ArrayLike) -> tuple[Complex, Complex]:
    """Return the amplitude reflection coefficients from vacuum onto a medium.

    Parameters
    ----------
    index, cos_incidence : index of refraction and cosine of incidence

    Returns
    -------
    r_s, r_p : perpendicular and parallel; at normal incidence r_p = -r_s
    """
    s, p = _faces(*_normal_wave(index, cos_incidence))
    return s.r, p.r


def power_transmission(index: ArrayLike, cos_incidence: ArrayLike) -> tuple[Real, Real]:
    """Return the fraction of the power that enters the medium, 1 - |r|^2.

    It keeps its digits if |r| is near one: conductors and grazing incidence.

    Parameters
    ----------
    index, cos_incidence : index of refraction and cosine of incidence

    Returns
    -------
    t_s, t_p
    """
    s, p = _faces(*_normal_wave(index, cos_incidence))
    return s.entering, p.entering


def unpolarised_reflectance(index: ArrayLike, cos_incidence: ArrayLike) -> Real:
    """Return the reflectance (|r_s|^2 + |r_p|^2)/2 that the Radar Material's nodes evaluate.

    Parameters
    ----------
    index, cos_incidence : index of refraction and cosine of incidence

    Returns
    -------
    ndarray
    """
    r_s, r_p = reflection_coefficients(index, cos_incidence)
    return np.asarray((np.abs(r_s) ** 2 + np.abs(r_p) ** 2) / 2)


# -- slabs -----------------------------------------------------------------------------------------

Model = Literal["coherent", "incoherent", "single-pass"]
MODELS: tuple[Model, ...] = ("coherent", "incoherent", "single-pass")


class SlabPower(NamedTuple):
    """Fractions of the incident power for both polarisations; all arrays have the same shape.

    Attributes
    ----------
    transmitted_s, transmitted_p, reflected_s, reflected_p
    """

    transmitted_s: Real
    transmitted_p: Real
    reflected_s: Real
    reflected_p: Real

    @property
    def transmitted(self) -> Real:
        """Transmission of an unpolarised wave, one passage. For two, average the squares."""
        return (self.transmitted_s + self.transmitted_p) / 2

    @property
    def reflected(self) -> Real:
        """Reflection of an unpolarised wave."""
        return (self.reflected_s + self.reflected_p) / 2

    @property
    def absorbed_s(self) -> Real:
        """1 - T - R; for 'single-pass' it includes the internal echoes."""
        return 1 - self.transmitted_s - self.reflected_s

    @property
    def absorbed_p(self) -> Real:
        """As `absorbed_s`."""
        return 1 - self.transmitted_p - self.reflected_p


def _arguments(
    index: ArrayLike, thickness_m: ArrayLike, wavelength_m: ArrayLike, cos_incidence: ArrayLike
) -> tuple[Complex, Real, Complex, Complex]:
    """Return eps, c, q and delta after a check."""
    n = passive_index(index)
    thickness = real_array("Thickness", thickness_m, "m", above=0.0)
    wavelength = real_array("Wavelength", wavelength_m, "m", above=0.0)
    cosine = direction_cosine(cos_incidence)
    require_one_shape(index=n, thickness_m=thickness, wavelength_m=wavelength, cos_incidence=cosine)
    eps, cosine, q = _normal_wave(n, cosine)
    return eps, cosine, q, np.asarray(2 * np.pi / wavelength * thickness * q, dtype=np.complex128)


def _coherent(face: _FacePower, delta: Complex) -> tuple[Complex, Complex]:
    """Return the amplitude transmission and reflection of the slab."""
    passage = np.exp(1j * delta)
    # 1 - exp(2 j delta) by expm1: a sheet much thinner than the wave keeps its digits.
    contrast = -np.expm1(2j * delta)
    # 1 - r^2 e^2 = (1 - r^2) + r^2 (1 - e^2)
    denominator = face.tt + face.r**2 * contrast
    grazing = denominator == 0
    denominator = np.where(grazing, 1, denominator)
    transmission = np.where(grazing, 0, face.tt * passage / denominator)
    reflection = np.where(grazing, -1, face.r * contrast / denominator)
    return transmission, reflection


def amplitude_coefficients(
    index: ArrayLike,
    thickness_m: ArrayLike,
    wavelength_m: ArrayLike,
    cos_incidence: ArrayLike = 1.0,
) -> tuple[Complex, Complex, Complex, Complex]:
    """Return the amplitude coefficients of the slab with interference.

    The phase of t is that from front face to back face along the normal; a vacuum slab gives
    exp(j k0 c d).

    Parameters
    ----------
    index, thickness_m, wavelength_m, cos_incidence : as for `slab_power`

    Returns
    -------
    t_s, t_p, r_s, r_p : complex
    """
    eps, cosine, q, delta = _arguments(index, thickness_m, wavelength_m, cos_incidence)
    s, p = _faces(eps, cosine, q)
    t_s, r_s = _coherent(s, delta)
    t_p, r_p = _coherent(p, delta)
    return t_s, t_p, r_s, r_p


def slab_power(
    index: ArrayLike,
    thickness_m: ArrayLike,
    wavelength_m: ArrayLike,
    cos_incidence: ArrayLike = 1.0,
    model: Model = "coherent",
) -> SlabPower:
    """Return the transmitted and reflected power of a slab, both polarisations.

    Parameters
    ----------
    index, cos_incidence : index of refraction and cosine; at exactly 0 nothing enters
    thickness_m, wavelength_m : thickness and vacuum wavelength [m], more than 0
    model : see the module's docstring

    Returns
    -------
    SlabPower

    Raises
    ------
    ConfigError : NaN, thickness or wavelength not positive, amplifying index, unknown model
    """
    if model not in MODELS:
        raise ConfigError(f"Slab model is {model!r}; expected one of {', '.join(MODELS)}.")
    eps, cosine, q, delta = _arguments(index, thickness_m, wavelength_m, cos_incidence)
    fractions = []
    for face in _faces(eps, cosine, q):
        if model == "coherent":
            transmission, reflection = _coherent(face, delta)
            fractions.append((np.abs(transmission) ** 2, np.abs(reflection) ** 2))
            continue
        attenuation = np.exp(-2 * delta.imag)
        reflectance = np.abs(face.r) ** 2
        # |1 - r^2|^2 and not (1 - |r|^2)^2: they differ in a lossy medium, and this is the first
        # term of the interference series.
        entering = np.maximum(face.entering, 0.0)
        passing = np.minimum(
            np.abs(face.tt) ** 2 * attenuation, entering * (1 - reflectance * attenuation)
        )
        if model == "single-pass":
            fractions.append((passing, reflectance))
            continue
        rest = 1 - (reflectance * attenuation) ** 2
        safe = np.where(rest > 0, rest, 1.0)
        transmitted = np.where(rest > 0, passing / safe, 0.0)
        back = np.where(rest > 0, passing * reflectance * attenuation / safe, 0.0)
        fractions.append((transmitted, reflectance + back))
    (t_s, r_s), (t_p, r_p) = fractions
    return SlabPower(t_s, t_p, r_s, r_p)


def straight_through_power(
    index: ArrayLike,
    thickness_m: ArrayLike,
    wavelength_m: ArrayLike,
    cos_incidence: ArrayLike = 1.0,
) -> Real:
    """Return one passage as shader nodes evaluate it: (1 - F)^2 exp(-2 k0 Im(q) d), F unpolarised.

    It differs from the mean of 'single-pass' because F is averaged before squaring, and in
    lossy media because (1 - |r|^2)^2 is not |1 - r^2|^2. docs/physics.md has the differences.

    Parameters
    ----------
    index, thickness_m, wavelength_m, cos_incidence : as for `slab_power`

    Returns
    -------
    ndarray
    """
    eps, cosine, q, delta = _arguments(index, thickness_m, wavelength_m, cos_incidence)
    s, p = _faces(eps, cosine, q)
    reflectance = (np.abs(s.r) ** 2 + np.abs(p.r) ** 2) / 2
    return np.asarray((1 - reflectance) ** 2 * np.exp(-2 * delta.imag))


def excess_path_m(index: ArrayLike, thickness_m: ArrayLike, cos_incidence: ArrayLike = 1.0) -> Real:
    """Return the optical length of the straight path through the slab minus that through vacuum.

    d (Re q - c), one way; (n - 1) d at normal incidence only. It follows from the phase of one
    passage; the group delay differs for a medium with an index that changes with frequency.

    Parameters
    ----------
    index, thickness_m, cos_incidence : as for `slab_power`

    Returns
    -------
    ndarray : length [m]
    """
    thickness = real_array("Thickness", thickness_m, "m", minimum=0.0)
    eps, cosine, q = _normal_wave(passive_index(index), direction_cosine(cos_incidence))
    # Lossless: q - c = (n^2 - 1)/(q + c) keeps its digits for n near 1. Lossy: Re q directly.
    total = q + cosine
    safe = np.where(total == 0, 1, total)
    difference = np.where(total == 0, 0, (eps - 1) / safe)
    return np.asarray(thickness * difference.real)


def refraction_angle_rad(index: ArrayLike, cos_incidence: ArrayLike) -> Real:
    """Return the angle of the planes of constant phase inside: tan psi = sin(theta) / Re q.

    Snell's law for real n; Born and Wolf 14.2 for complex n. pi/2 beyond total reflection.

    Parameters
    ----------
    index, cos_incidence : index of refraction and cosine of incidence

    Returns
    -------
    ndarray : angle [rad]
    """
    _, cosine, q = _normal_wave(passive_index(index), direction_cosine(cos_incidence))
    sine = np.sqrt((1 - cosine) * (1 + cosine))
    return np.asarray(np.arctan2(sine, q.real))
