# SPDX-License-Identifier: GPL-3.0-or-later
"""Powers: from radiance to received watts, and what the radar equation expects."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Real = NDArray[np.float64]


def effective_area_m2(wavelength_m: ArrayLike, gain: ArrayLike = 1.0) -> Real:
    """Effective area of a receiving antenna, G lambda^2 / (4 pi) [m^2] (Balanis, eq. 2-110)."""
    wavelength = np.asarray(wavelength_m, dtype=np.float64)
    return np.asarray(gain, dtype=np.float64) * wavelength**2 / (4 * np.pi)


def received_power_w(
    radiance: ArrayLike, solid_angle_sr: ArrayLike, wavelength_m: ArrayLike, gain: ArrayLike = 1.0
) -> Real:
    """Power that a pixel delivers to the receiver [W].

    P = L A_e dOmega with L in W/(m^2 sr). There is no further range weight: the return leg's
    1/R^2 is in dOmega.
    """
    return (
        np.asarray(radiance, dtype=np.float64)
        * np.asarray(solid_angle_sr, dtype=np.float64)
        * effective_area_m2(wavelength_m, gain)
    )


def monostatic_power_w(
    eirp_w: ArrayLike,
    rcs_m2: ArrayLike,
    range_m: ArrayLike,
    wavelength_m: ArrayLike,
    gain: ArrayLike = 1.0,
) -> Real:
    """Radar equation, P_r = EIRP G_r lambda^2 sigma / ((4 pi)^3 R^4) [W] (Skolnik, eq. 1.7)."""
    numerator = (
        np.asarray(eirp_w, dtype=np.float64)
        * np.asarray(gain, dtype=np.float64)
        * np.asarray(wavelength_m, dtype=np.float64) ** 2
        * np.asarray(rcs_m2, dtype=np.float64)
    )
    return numerator / ((4 * np.pi) ** 3 * np.asarray(range_m, dtype=np.float64) ** 4)


def lambert_plate_rcs_m2(albedo: ArrayLike, area_m2: ArrayLike, cos_incidence: ArrayLike) -> Real:
    """Monostatic radar cross section of a rough (Lambert) plate, 4 rho A cos^2(theta) [m^2]."""
    cosine = np.asarray(cos_incidence, dtype=np.float64)
    area = np.asarray(area_m2, dtype=np.float64)
    return np.asarray(4 * np.asarray(albedo, dtype=np.float64) * area * cosine**2)


def lambert_radiance(
    albedo: ArrayLike, eirp_w: ArrayLike, range_m: ArrayLike, cos_incidence: ArrayLike = 1.0
) -> Real:
    """Radiance of a Lambert surface lit by a point emitter, W/(m^2 sr).

    rho/pi * EIRP cos(theta) / (4 pi R^2).
    """
    irradiance = (
        np.asarray(eirp_w, dtype=np.float64)
        * np.asarray(cos_incidence, dtype=np.float64)
        / (4 * np.pi * np.asarray(range_m, dtype=np.float64) ** 2)
    )
    return np.asarray(albedo, dtype=np.float64) / np.pi * irradiance
