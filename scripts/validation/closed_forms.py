# SPDX-License-Identifier: GPL-3.0-or-later
"""What echoes should be, integrated in float64 from the equations, without the program's own.

The radar equation over a surface: P = EIRP lambda^2/(4 pi)^3 int s0 / (R_t^2 R_r^2) dA, s0 the
scattering coefficient of the surface itself [m^2/m^2] (Ulaby, Moore, Fung II, 12-1).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from radarsim_addon.arrays import Real

from .scenes import EIRP_W, Plate, wavelength

#: s0 as a function of the cosines towards transmitter and receiver.
Coefficient = Callable[[Real, Real], Real]
ORIGIN = np.zeros(3)
_erfc = np.vectorize(math.erfc, otypes=[np.float64])


def lambert_coefficient(albedo: float) -> Coefficient:
    """4 rho cos_i cos_s: radiance rho/pi E in all directions."""
    return lambda cos_i, cos_s: 4 * albedo * cos_i * cos_s


def kirchhoff_coefficient(index: complex, slope: float) -> Coefficient:
    """Geometric optics of a Gaussian surface, straight back (Ulaby, Moore, Fung II, eq. 12.55).

    |(n-1)/(n+1)|^2 exp(-tan^2/(2 m^2)) / (2 m^2 cos^4); both cosines are the same one.
    """
    reflectance = abs((index - 1) / (index + 1)) ** 2

    def value(cos_i: Real, _cos_s: Real) -> Real:
        c = np.maximum(cos_i, 1e-3)
        tan2 = (1 - c**2) / c**2
        return np.asarray(reflectance * np.exp(-tan2 / (2 * slope**2)) / (2 * slope**2 * c**4))

    return value


def smith_lambda(alpha: float, cosine: Real) -> Real:
    """Smith's Lambda of a Beckmann surface, exact (Smith 1967; Heitz 2014, table 1).

    (exp(-a^2)/(a sqrt(pi)) - erfc(a))/2 with a = 1/(alpha tan); shadowing is 1/(1 + sum Lambda).
    """
    sine = np.sqrt(np.maximum(1 - cosine**2, 0))
    a = np.clip(cosine / np.maximum(alpha * sine, 1e-12), 1e-9, 25.0)
    return np.asarray((np.exp(-(a**2)) / (a * math.sqrt(math.pi)) - _erfc(a)) / 2)


def power_over(
    points_m: Real,
    weights_m2: Real,
    normals: Real,
    coefficient: Coefficient,
    transmitter_m: Real = ORIGIN,
    receiver_m: Real = ORIGIN,
) -> float:
    """Received power of surface elements that face both antennas [W]."""
    cosines, factor = [], weights_m2
    for antenna in (transmitter_m, receiver_m):
        way = antenna - points_m
        distance = np.linalg.norm(way, axis=1)
        cosines.append(np.maximum(np.sum(way * normals, axis=1) / distance, 0.0))
        factor = factor / distance**2
    seen = (cosines[0] > 0) & (cosines[1] > 0)
    total = np.sum(np.where(seen, coefficient(*cosines) * factor, 0.0))
    return float(EIRP_W * wavelength() ** 2 / (4 * math.pi) ** 3 * total)


def plate_power(
    plate: Plate,
    coefficient: Coefficient,
    transmitter_m: Real = ORIGIN,
    receiver_m: Real = ORIGIN,
) -> float:
    """Received power of a plate [W]."""
    points, weights = plate.nodes()
    normals = np.broadcast_to(plate.normal, points.shape)
    return power_over(points, weights, normals, coefficient, transmitter_m, receiver_m)


def sphere_power(range_m: float, radius_m: float, coefficient: Coefficient) -> float:
    """Received power of a sphere whose centre is `range_m` ahead, by 2048 Gauss points in cos."""
    # Only the cap that is seen: cosine of the polar angle from the sphere's centre from a/R to 1.
    x, w = np.polynomial.legendre.leggauss(64)
    panels = 32
    x = (2 * np.arange(panels)[:, None] + 1 + x).ravel() / panels - 1
    w = np.tile(w, panels) / panels
    low = radius_m / range_m
    polar = low + (1 - low) * (x + 1) / 2
    weights = w * (1 - low) / 2 * 2 * math.pi * radius_m**2
    sine = np.sqrt(1 - polar**2)
    normals = np.stack([sine, -polar, np.zeros_like(sine)], axis=1)
    points = np.array([0.0, range_m, 0.0]) + radius_m * normals
    return power_over(points, weights, normals, coefficient)
