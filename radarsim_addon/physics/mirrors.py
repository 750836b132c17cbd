# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflection at a planar mirror: images of points, and the coefficient of a polarised wave.

Coefficients are written with exp(-j w t) and an index n + jk, as in :mod:`.fresnel`. Echoes carry
exp(+j w t): the amplitude of a path has the conjugate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..array_types import Complex, Real
from ..vectors import crosses, dots, norms
from .fresnel import reflection_coefficients, unpolarised_reflectance
from .slab import amplitude_coefficients

#: Length of a cross product of unit vectors below which they are parallel.
_PARALLEL = 1e-9
#: Argument of the Bessel function from which two terms of its expansion do: 1e-6.
_LARGE = 300.0


@dataclass(frozen=True)
class MirrorMaterial:
    """A smooth surface at the carrier.

    Attributes
    ----------
    index
        Complex index n + jk.
    share
        Part of the reflected power that is mirrored, 0 to 1.
    polarised
        Whether the power depends on the run's polarisation.
    rms_height_m
        Of a slightly rough surface [m]; 0: smooth.
    sheet_wavelengths
        Thickness of a thin sheet, in wavelengths in vacuum; 0: a half-space.
    """

    index: complex
    share: float
    polarised: bool
    rms_height_m: float = 0.0
    sheet_wavelengths: float = 0.0

    def reflection(
        self, incoming: Real, normal: Real, polarisation: str, wavelength_m: float
    ) -> tuple[Real, Real]:
        """Return the fraction of the power and the phase of reflected waves.

        As `mirror_reflection`; the power is that of the material's nodes.

        Parameters
        ----------
        incoming, normal, polarisation
            As there.
        wavelength_m
            Wavelength [m].

        Returns
        -------
        power, phase_rad
            As there, (n,) each.
        """
        power, phase_rad = mirror_reflection(
            self.index, incoming, normal, polarisation, self.sheet_wavelengths
        )
        if not self.polarised:
            power = unpolarised_reflectance(self.index, np.abs(dots(incoming, normal)))
        if self.rms_height_m > 0:
            sine = np.abs(dots(incoming, normal))
            power = power * coherent_reflection(self.rms_height_m, sine, wavelength_m) ** 2
        return self.share * power, phase_rad


def mirror_matrix(normal: ArrayLike, offset_m: float) -> tuple[Real, Real]:
    """Return the reflection x -> A x + b at the plane of the points with normal . x = offset.

    Parameters
    ----------
    normal
        Unit vector across the plane, (3,).
    offset_m
        Distance of the plane from the origin along the normal [m].

    Returns
    -------
    A, b
        Shapes (3, 3) and (3,) [m].
    """
    unit = np.asarray(normal, dtype=np.float64)
    return np.eye(3) - 2 * np.outer(unit, unit), 2 * offset_m * unit


def mirror_reflection(
    index: complex,
    incoming: Real,
    normal: Real,
    polarisation: str,
    sheet_wavelengths: float = 0.0,
) -> tuple[Real, Real]:
    """Return what a smooth plane makes of a polarised wave.

    Parameters
    ----------
    index
        Complex index n + jk of the mirror.
    incoming
        Unit vectors along which waves travel to the mirror, (n, 3).
    normal
        Unit vector across the mirror, (3,), or one for each wave, (n, 3).
    polarisation
        "horizontal": the field is level; "vertical": in the vertical plane of the wave (world z is
        up); "average": power of half a wave each, phase of the horizontal one.
    sheet_wavelengths
        Thickness of a thin sheet with interference inside, in wavelengths in vacuum; 0: a
        half-space.

    Returns
    -------
    power, phase_rad
        Fraction of the power that is reflected, in both polarisations, and phase of the field that
        keeps its polarisation, (n,) each.
    """
    across = crosses(np.broadcast_to(normal, incoming.shape), incoming)
    straight = norms(across) < _PARALLEL
    across[straight] = _level(incoming[straight])
    across /= norms(across)[:, None]
    turned = incoming - 2 * dots(incoming, normal)[:, None] * normal
    cosine = np.abs(dots(incoming, normal))
    if sheet_wavelengths > 0:
        _, _, r_s, r_p = amplitude_coefficients(index, sheet_wavelengths, 1.0, cosine)
    else:
        r_s, r_p = reflection_coefficients(index, cosine)
    vertical = polarisation == "vertical"
    before, after = (_field(way, vertical) for way in (incoming, turned))
    s_in, s_out = dots(before, across), dots(after, across)
    p_in = dots(before, crosses(incoming, across))
    p_out = dots(after, crosses(turned, across))
    kept: Complex = r_s * s_in * s_out + r_p * p_in * p_out
    share = np.full(s_in.shape, 0.5) if polarisation == "average" else s_in**2
    power = share * np.abs(r_s) ** 2 + (1 - share) * np.abs(r_p) ** 2
    return np.asarray(power, dtype=np.float64), np.angle(kept)


def coherent_reflection(rms_height_m: ArrayLike, sine: ArrayLike, wavelength_m: float) -> Real:
    """Return the factor of a slightly rough plane on the amplitude that it mirrors.

    Parameters
    ----------
    rms_height_m
        RMS height [m].
    sine
        Sines of grazing angles.
    wavelength_m
        Wavelength [m].

    Returns
    -------
    ndarray
        1 for a smooth plane, less for a rough one.

    References
    ----------
    A. R. Miller, R. M. Brown, E. Vegh, New derivation for the rough-surface reflection coefficient
    and for the distribution of sea-wave elevations, IEE Proc. H 131 (1984) 114-116:
    exp(-x) I0(x) with x = 2 (k h sin psi)^2.
    """
    height_m = np.asarray(rms_height_m, dtype=np.float64)
    x = 2 * (2 * np.pi * height_m * np.asarray(sine, dtype=np.float64) / wavelength_m) ** 2
    near = np.minimum(x, _LARGE)
    with np.errstate(divide="ignore"):
        far = (1 + 1 / (8 * x)) / np.sqrt(2 * np.pi * x)
    return np.asarray(np.where(x < _LARGE, np.exp(-near) * np.i0(near), far))


def _level(ways: Real) -> Real:
    """Return level unit vectors across ways, (n, 3); along x for ways straight up or down."""
    level = crosses(ways, np.broadcast_to(np.array([0.0, 0.0, 1.0]), ways.shape))
    level[norms(level) < _PARALLEL] = (1.0, 0.0, 0.0)
    return np.asarray(level / norms(level)[:, None])


def _field(ways: Real, vertical: bool) -> Real:
    """Return unit vectors of the field of waves along unit vectors, (n, 3)."""
    level = _level(ways)
    return crosses(level, ways) if vertical else level
