# SPDX-License-Identifier: GPL-3.0-or-later
"""Powers: from radiance to received watts, and the radar equation. All arguments broadcast."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..array_types import Real
from .checks import real_array


def to_db(ratio: ArrayLike) -> Real:
    """Return 10 log10 of a power ratio.

    Parameters
    ----------
    ratio
        Ratio, 0 or more.

    Returns
    -------
    ndarray
        Decibels; -inf for zero.

    Raises
    ------
    ConfigError
        For a negative ratio or NaN.
    """
    value = real_array("Power ratio", ratio, "", minimum=0.0)
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10(value), dtype=np.float64)


def from_db(level_db: ArrayLike) -> Real:
    """Return the power ratio 10^(dB/10).

    Parameters
    ----------
    level_db : Decibels

    Returns
    -------
    ndarray
        Ratio, in the same shape.
    """
    value = np.asarray(level_db, dtype=np.float64)
    return np.asarray(10 ** (value / 10), dtype=np.float64)


def effective_area_m2(wavelength_m: ArrayLike, gain: ArrayLike = 1.0) -> Real:
    """Return the effective area of a receiving antenna, G lambda^2 / (4 pi) (Balanis, eq. 2-110).

    Parameters
    ----------
    wavelength_m
        lambda [m].
    gain
        G, linear.

    Returns
    -------
    ndarray
        Area [m^2].
    """
    wavelength = np.asarray(wavelength_m, dtype=np.float64)
    return np.asarray(gain, dtype=np.float64) * wavelength**2 / (4 * np.pi)


def received_power_w(
    radiance: ArrayLike, solid_angle_sr: ArrayLike, wavelength_m: ArrayLike, gain: ArrayLike = 1.0
) -> Real:
    """Return the power that a pixel delivers to the receiver, P = L A_e dOmega.

    There is no further range weight: the return path's 1/R^2 is in dOmega.

    Parameters
    ----------
    radiance
        L [W/(m^2 sr)].
    solid_angle_sr
        dOmega [sr].
    wavelength_m, gain
        As for `effective_area_m2`.

    Returns
    -------
    ndarray
        Power [W].
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
    """Return EIRP G_r lambda^2 sigma / ((4 pi)^3 R^4), the radar equation (Skolnik, eq. 1.7).

    Parameters
    ----------
    eirp_w
        EIRP [W].
    rcs_m2
        sigma [m^2].
    range_m
        R [m].
    wavelength_m
        lambda [m].
    gain
        G_r, linear.

    Returns
    -------
    ndarray
        Received power [W].
    """
    numerator = (
        np.asarray(eirp_w, dtype=np.float64)
        * np.asarray(gain, dtype=np.float64)
        * np.asarray(wavelength_m, dtype=np.float64) ** 2
        * np.asarray(rcs_m2, dtype=np.float64)
    )
    return numerator / ((4 * np.pi) ** 3 * np.asarray(range_m, dtype=np.float64) ** 4)


def bistatic_power_w(
    eirp_w: ArrayLike,
    rcs_m2: ArrayLike,
    transmitter_range_m: ArrayLike,
    receiver_range_m: ArrayLike,
    wavelength_m: ArrayLike,
    gain: ArrayLike = 1.0,
    loss_db: ArrayLike = 0.0,
) -> Real:
    """Return EIRP G_r lambda^2 sigma / ((4 pi)^3 R_t^2 R_r^2 L) (Skolnik, eq. 25.1).

    Parameters
    ----------
    eirp_w
        EIRP towards the target [W].
    rcs_m2
        sigma [m^2].
    transmitter_range_m, receiver_range_m
        R_t and R_r [m].
    wavelength_m
        lambda [m].
    gain
        G_r towards the target, linear.
    loss_db
        All losses together, L in dB.

    Returns
    -------
    ndarray
        Received power [W].

    Raises
    ------
    ConfigError
        NaN, a range or wavelength that is not positive, a negative power, gain or cross section.
    """
    eirp = real_array("EIRP", eirp_w, "W", minimum=0.0)
    rcs = real_array("Radar cross section", rcs_m2, "m^2", minimum=0.0)
    there = real_array("Transmitter range", transmitter_range_m, "m", above=0.0)
    back = real_array("Receiver range", receiver_range_m, "m", above=0.0)
    wavelength = real_array("Wavelength", wavelength_m, "m", above=0.0)
    received = eirp * real_array("Gain", gain, "", minimum=0.0) * wavelength**2 * rcs
    loss = from_db(real_array("Loss", loss_db, "dB"))
    return np.asarray(received / ((4 * np.pi) ** 3 * there**2 * back**2 * loss), dtype=np.float64)


def rcs_from_power_m2(
    power_w: ArrayLike,
    eirp_w: ArrayLike,
    transmitter_range_m: ArrayLike,
    receiver_range_m: ArrayLike,
    wavelength_m: ArrayLike,
    gain: ArrayLike = 1.0,
) -> Real:
    """Return the radar cross section that returns a power: `bistatic_power_w` solved for sigma.

    Parameters
    ----------
    power_w
        Received power [W].
    eirp_w, transmitter_range_m, receiver_range_m, wavelength_m, gain
        As for `bistatic_power_w`.

    Returns
    -------
    ndarray
        Cross section [m^2].
    """
    power = real_array("Received power", power_w, "W", minimum=0.0)
    eirp = real_array("EIRP", eirp_w, "W", above=0.0)
    unit = bistatic_power_w(eirp, 1.0, transmitter_range_m, receiver_range_m, wavelength_m, gain)
    return np.asarray(power / unit, dtype=np.float64)


def lambert_plate_rcs_m2(albedo: ArrayLike, area_m2: ArrayLike, cos_incidence: ArrayLike) -> Real:
    """Return the monostatic cross section of a rough (Lambert) plate, 4 rho A cos^2(theta).

    Parameters
    ----------
    albedo
        rho.
    area_m2
        A [m^2].
    cos_incidence
        cos(theta).

    Returns
    -------
    ndarray
        Cross section [m^2].
    """
    cosine = np.asarray(cos_incidence, dtype=np.float64)
    area = np.asarray(area_m2, dtype=np.float64)
    return np.asarray(4 * np.asarray(albedo, dtype=np.float64) * area * cosine**2)


def lambert_radiance(
    albedo: ArrayLike, eirp_w: ArrayLike, range_m: ArrayLike, cos_incidence: ArrayLike = 1.0
) -> Real:
    """Return the radiance of a Lambert surface lit by a point transmitter.

    rho/pi * EIRP cos(theta) / (4 pi R^2).

    Parameters
    ----------
    albedo
        rho.
    eirp_w
        EIRP [W].
    range_m
        R [m].
    cos_incidence
        cos(theta).

    Returns
    -------
    ndarray
        Radiance [W/(m^2 sr)].
    """
    irradiance = (
        np.asarray(eirp_w, dtype=np.float64)
        * np.asarray(cos_incidence, dtype=np.float64)
        / (4 * np.pi * np.asarray(range_m, dtype=np.float64) ** 2)
    )
    return np.asarray(albedo, dtype=np.float64) / np.pi * irradiance
