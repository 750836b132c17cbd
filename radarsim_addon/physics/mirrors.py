# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflection at mirrors: images of points, the field of a polarised wave, beams at curved mirrors.

Fields are complex vectors in world axes, (n, 3) for each of k waves; ways are the unit vectors
along which waves travel, (n, 3). A mirror keeps the part across its plane of incidence (s) with
r_s, and turns the part in it (p) with the wave, with r_p::

    E' = r_s (s . E) s + r_p (p . E) p',    s = n x u / |n x u|,  p = u x s,  p' = u' x s

for a wave along u that leaves along u' = u - 2 (n . u) n (Born and Wolf, Principles of Optics,
1.5.2). Reflections in a row are applied one after the other, so a mirror that is tilted about the
line of sight turns part of a vertical wave into a horizontal one. What counts of the last wave is
its part with the polarisation of the run (`co_polar`).

Coefficients are written with exp(-j w t). Echoes carry exp(+j w t): the amplitude of a path has the
conjugate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Complex, Real, crosses, dots, norms, reals
from .fresnel import amplitude_coefficients, reflection_coefficients

#: Length of a cross product of unit vectors below which they are parallel.
_PARALLEL = 1e-9
#: Argument of the Bessel function from which two terms of its expansion do: 1e-6.
_LARGE = 300.0


class Reflected(NamedTuple):
    """Waves after one or more mirrors, relative to the waves before them, (n,) each.

    Attributes
    ----------
    power : fraction of the power that remains in the polarisation of the run
    phase_rad : change of phase in this polarisation
    turned : fraction of the power that is then in the other polarisation
    apart
        If the run has both polarisations: the power times sin^2 of half the difference of their
        phases. Else 0.
    """

    power: Real
    phase_rad: Real
    turned: Real
    apart: Real


@dataclass(frozen=True)
class MirrorMaterial:
    """A smooth surface at the carrier.

    Attributes
    ----------
    index : complex index n + jk
    share : part of the reflected power that is mirrored, 0 to 1
    polarised
        Whether the material's nodes reflect the polarisation of the run; else the mean of both.
    rms_height_m : of a slightly rough surface [m]; 0: smooth
    sheet_wavelengths
        Thickness of a thin sheet with interference inside, in wavelengths in vacuum; 0: a
        half-space.
    """

    index: complex
    share: float
    polarised: bool
    rms_height_m: float = 0.0
    sheet_wavelengths: float = 0.0

    def reflect(
        self, fields: Complex, incoming: Real, normal: Real, wavelength_m: float
    ) -> Complex:
        """Return the fields of waves along `incoming` after a reflection, (k, n, 3).

        They leave along `reflected_ways`. `normal` is a unit vector across the mirror, (3,), or one
        for each wave, (n, 3).
        """
        across = crosses(np.broadcast_to(normal, incoming.shape), incoming)
        straight = norms(across) < _PARALLEL
        across[straight] = _level(incoming[straight])
        across /= norms(across)[:, None]
        cosine = np.abs(dots(incoming, normal))
        factor = np.sqrt(self.share)
        if self.rms_height_m > 0:
            factor = factor * coherent_reflection(self.rms_height_m, cosine, wavelength_m)
        if self.sheet_wavelengths > 0:
            faces = amplitude_coefficients(self.index, self.sheet_wavelengths, 1.0, cosine)[2:]
        else:
            faces = reflection_coefficients(self.index, cosine)
        r_s, r_p = (factor * one for one in faces)
        before = crosses(incoming, across)
        after = crosses(reflected_ways(incoming, normal), across)
        s, p = r_s * _along(fields, across), r_p * _along(fields, before)
        return np.asarray(s[..., None] * across + p[..., None] * after)

    def reflection(
        self, incoming: Real, normal: Real, polarisation: str, wavelength_m: float
    ) -> Reflected:
        """Return waves of a polarisation (see `sent_fields`) after one reflection."""
        fields = self.reflect(sent_fields(incoming, polarisation), incoming, normal, wavelength_m)
        return co_polar(fields, reflected_ways(incoming, normal), polarisation)

    def rendered_power(self, incoming: Real, normal: Real, polarisation: str) -> Real:
        """Return the fraction of the power that Cycles reflects at the smooth surface, (n,).

        It is that of both polarisations after the reflection, and of a simple material the mean
        over those before it, too.
        """
        if not self.polarised:
            polarisation = "average"
        found = replace(self, rms_height_m=0.0).reflection(incoming, normal, polarisation, 1.0)
        return found.power + found.turned


def reflected_ways(incoming: Real, normal: Real) -> Real:
    """Return the directions in which waves leave a mirror.

    Parameters
    ----------
    incoming, normal : ways, and unit vectors across the mirror

    Returns
    -------
    ndarray : ways
    """
    return np.asarray(incoming - 2 * dots(incoming, normal)[:, None] * normal)


def sent_fields(ways: Real, polarisation: str) -> Complex:
    """Return the unit fields of waves of a polarisation, (1, n, 3).

    Parameters
    ----------
    ways : ways of the waves
    polarisation
        "horizontal": the field is level; "vertical": in the vertical plane of the wave (world z is
        up); "average": waves of both, horizontal ones first, (2, n, 3).

    Returns
    -------
    ndarray : complex, so that mirrors can change the phase
    """
    level = _level(ways)
    upright = crosses(level, ways)
    chosen = {"horizontal": [level], "vertical": [upright], "average": [level, upright]}
    return np.array(chosen[polarisation], dtype=np.complex128)


def co_polar(fields: Complex, ways: Real, polarisation: str) -> Reflected:
    """Return what waves have of the polarisation in which they were sent.

    Parameters
    ----------
    fields : of `sent_fields` after mirrors, (1 or 2, n, 3)
    ways : ways of the waves now
    polarisation
        See `sent_fields`; "average": means of the powers of both, phase of the horizontal one.

    Returns
    -------
    Reflected
    """
    kept = np.stack([dots(*both) for both in zip(fields, sent_fields(ways, polarisation))])
    power = np.mean(np.abs(kept) ** 2, axis=0)
    every = np.mean([dots(field, np.conj(field)).real for field in fields], axis=0)
    apart = power * np.sin(np.angle(kept[-1] * np.conj(kept[0])) / 2) ** 2
    return Reflected(power, np.angle(kept[0]), np.maximum(every - power, 0.0), apart)


def mirror_matrix(normal: ArrayLike, offset_m: float) -> tuple[Real, Real]:
    """Return the reflection x -> A x + b at the plane of the points with normal . x = offset.

    Parameters
    ----------
    normal : unit vector across the plane, (3,)
    offset_m : distance of the plane from the origin along the normal [m]

    Returns
    -------
    A, b : shapes (3, 3) and (3,) [m]
    """
    unit = np.asarray(normal, dtype=np.float64)
    return np.eye(3) - 2 * np.outer(unit, unit), 2 * offset_m * unit


def coherent_reflection(rms_height_m: ArrayLike, sine: ArrayLike, wavelength_m: float) -> Real:
    """Return the factor of a slightly rough plane on the amplitude that it mirrors.

    exp(-x) I0(x) with x = 2 (k h sin psi)^2: A. R. Miller, R. M. Brown, E. Vegh, New derivation for
    the rough-surface reflection coefficient and for the distribution of sea-wave elevations, IEE
    Proc. H 131 (1984) 114-116.

    Parameters
    ----------
    rms_height_m, wavelength_m : RMS height and wavelength [m]
    sine : sines of grazing angles

    Returns
    -------
    ndarray : 1 for a smooth plane, less for a rough one
    """
    height_m, sine = reals(rms_height_m, sine)
    x = 2 * (2 * np.pi * height_m * sine / wavelength_m) ** 2
    near = np.minimum(x, _LARGE)
    with np.errstate(divide="ignore"):
        far = (1 + 1 / (8 * x)) / np.sqrt(2 * np.pi * x)
    return np.asarray(np.where(x < _LARGE, np.exp(-near) * np.i0(near), far))


def _along(fields: Complex, ways: Real) -> Complex:
    """Return the components of fields (k, n, 3) along unit vectors (n, 3), (k, n)."""
    return np.stack([dots(field, ways) for field in fields])


def _level(ways: Real) -> Real:
    """Return horizontal unit vectors normal to directions of waves, (n, 3).

    For vertical directions, the vector is the x axis.
    """
    level = crosses(ways, np.broadcast_to(np.array([0.0, 0.0, 1.0]), ways.shape))
    level[norms(level) < _PARALLEL] = (1.0, 0.0, 0.0)
    return np.asarray(level / norms(level)[:, None])


def reflected_widths(curvature: Real, cosine: Real, before_m: Real, after_m: Real) -> Real:
    """Return how wide a beam from a point is behind a curved mirror, over its width on the mirror.

    By geometric optics: G. A. Deschamps, Ray techniques in electromagnetics, Proc. IEEE 60 (1972)
    1022-1035.

    Parameters
    ----------
    curvature
        Curvature tensor of the surface, (n, 2, 2) [1/m], positive where it is convex. The first
        axis is that of the plane of incidence, the second lies across that plane.
    cosine : cosine of the angle of incidence, (n,)
    before_m, after_m : way from the point to the mirror, and from the mirror on, (n,) [m]

    Returns
    -------
    ndarray
        Widths along the principal axes of the wavefront, the smaller first, (n, 2). Their product
        is the ratio of areas: the irradiance behind the mirror is that on the mirror over the
        product. 0 is a focus; below 0 the beam has passed one.
    """
    tensor = 2 * np.array(curvature, dtype=np.float64)
    tensor[:, 0, 0] /= cosine
    tensor[:, 1, 1] *= cosine
    tensor += np.eye(2) / np.asarray(before_m)[:, None, None]
    return np.asarray(1 + np.asarray(after_m)[:, None] * np.linalg.eigvalsh(tensor))
