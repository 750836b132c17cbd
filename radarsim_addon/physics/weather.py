# SPDX-License-Identifier: GPL-3.0-or-later
"""Attenuation of waves by rain, fog and the gases of the air, and what rain scatters back.

Attenuation is in dB per kilometre of path, one way: a radar's two-way path of length L loses
10^(-gamma L / 10^4) of its power, with L in metres and gamma in dB/km.

- Rain: gamma = k R^alpha, R the rain rate [mm/h] (ITU-R P.838-3).
- Fog: droplets small against the wavelength (ITU-R P.840-8).
- Gases: the sum over the spectral lines of oxygen and water vapour, and a continuum (ITU-R
  P.676-12, annex 1).

Rain's echo is the Mie series of its drops, spheres of pure water, summed over the sizes of
Marshall and Palmer (J. Meteorol. 5, 165, 1948): N(D) = 8000 exp(-4.1 R^-0.21 D) drops per m^3 and
mm of diameter D [mm].
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Complex, Real
from ..errors import ConfigError
from .checks import passive_index, real_array
from .constants import SPEED_OF_LIGHT_MPS, ZERO_CELSIUS_K
from .materials import liebe_permittivity

#: Rows of ITU-R P.676-12, tables 1 and 2: line frequency [GHz], coefficients a1 to a6 or b1 to b6.
OXYGEN_LINES, VAPOUR_LINES = (
    np.loadtxt(Path(__file__).with_name("gas_lines") / f"{gas}_lines.csv", delimiter=",")
    for gas in ("oxygen", "vapour")
)


Polarisation = Literal["horizontal", "vertical", "average"]

#: Band of each model [Hz]: P.838-3 and P.676-12 end at 1 THz, droplets are small below 200 GHz.
_RAIN_BAND_HZ = (1e9, 1e12)
_GAS_BAND_HZ = (1e9, 1e12)
_FOG_BAND_HZ = (0.0, 200e9)

# P.838-3, tables 1 to 4: rows a, b, c of the Gaussians over lg f, then slope m and constant c.
# fmt: off
_RAIN_K = {
    "horizontal": ((-5.33980, -0.35351, -0.23789, -0.94158),
                   (-0.10008, 1.26970, 0.86036, 0.64552),
                   (1.13098, 0.45400, 0.15354, 0.16817), -0.18961, 0.71147),
    "vertical": ((-3.80595, -3.44965, -0.39902, 0.50167),
                 (0.56934, -0.22911, 0.73042, 1.07319),
                 (0.81061, 0.51059, 0.11899, 0.27195), -0.16398, 0.63297),
}
_RAIN_ALPHA = {
    "horizontal": ((-0.14318, 0.29591, 0.32177, -5.37610, 16.1721),
                   (1.82442, 0.77564, 0.63773, -0.96230, -3.29980),
                   (-0.55187, 0.19822, 0.13164, 1.47828, 3.43990), 0.67849, -1.95537),
    "vertical": ((-0.07771, 0.56727, -0.20238, -48.2991, 48.5833),
                 (2.33840, 0.95545, 1.14520, 0.791669, 0.791459),
                 (-0.76284, 0.54039, 0.26809, 0.116226, 0.116479), -0.053739, 0.83433),
}
# fmt: on


def rain_coefficients(frequency_hz: ArrayLike, polarisation: Polarisation) -> tuple[Real, Real]:
    """Return k and alpha of gamma = k R^alpha (ITU-R P.838-3) on a level path.

    Parameters
    ----------
    frequency_hz : 1 GHz to 1 THz
    polarisation
        "horizontal", "vertical", or "average": circular, or linear at 45 degrees (eq. 4 and 5).

    Returns
    -------
    tuple of ndarray : k [dB/km at 1 mm/h] and alpha

    Raises
    ------
    ConfigError : an unknown polarisation
    """
    log_ghz = np.log10(_in_band("Rain", frequency_hz, _RAIN_BAND_HZ) / 1e9)
    if polarisation == "average":
        horizontal = rain_coefficients(frequency_hz, "horizontal")
        vertical = rain_coefficients(frequency_hz, "vertical")
        k = (horizontal[0] + vertical[0]) / 2
        product = horizontal[0] * horizontal[1] + vertical[0] * vertical[1]
        return k, np.asarray(product / (2 * k))
    if polarisation not in _RAIN_K:
        raise ConfigError(
            f"Polarisation {polarisation!r}; expected 'horizontal', 'vertical' or 'average'."
        )
    k = 10 ** _gaussians(log_ghz, *_RAIN_K[polarisation])
    return np.asarray(k), _gaussians(log_ghz, *_RAIN_ALPHA[polarisation])


def _gaussians(
    log_ghz: Real,
    height: tuple[float, ...],
    centre: tuple[float, ...],
    width: tuple[float, ...],
    slope: float,
    constant: float,
) -> Real:
    """Evaluate P.838-3, eq. (2) and (3): a sum of Gaussians and a line over lg f."""
    steps = (log_ghz[..., None] - np.array(centre)) / np.array(width)
    total = np.sum(np.array(height) * np.exp(-(steps**2)), axis=-1)
    return np.asarray(total + slope * log_ghz + constant)


def rain_attenuation_db_per_km(
    frequency_hz: ArrayLike, rain_mm_per_h: ArrayLike, polarisation: Polarisation = "average"
) -> Real:
    """Return the attenuation by rain, k R^alpha (ITU-R P.838-3).

    Parameters
    ----------
    frequency_hz, polarisation : as for `rain_coefficients`
    rain_mm_per_h : rain rate R, 0 or more

    Returns
    -------
    ndarray
    """
    rate = real_array("Rain rate", rain_mm_per_h, "mm/h", minimum=0.0)
    k, alpha = rain_coefficients(frequency_hz, polarisation)
    return np.asarray(k * rate**alpha)


def fog_attenuation_db_per_km(
    frequency_hz: ArrayLike, liquid_water_g_per_m3: ArrayLike, temperature_c: ArrayLike = 15.0
) -> Real:
    """Return the attenuation by fog or cloud (ITU-R P.840-8, eq. 1 and 2).

    Parameters
    ----------
    frequency_hz : up to 200 GHz
    liquid_water_g_per_m3
        Liquid water, 0 or more: about 0.05 in medium fog (300 m of sight), 0.5 in thick fog (50 m).
    temperature_c : of the droplets, -20 to 50 degC

    Returns
    -------
    ndarray
    """
    f_hz = _in_band("Fog", frequency_hz, _FOG_BAND_HZ)
    water = real_array("Liquid water", liquid_water_g_per_m3, "g/m^3", minimum=0.0)
    warmth = real_array("Temperature", temperature_c, "degC", minimum=-20.0, maximum=50.0)
    permittivity = liebe_permittivity(f_hz, warmth)
    eta = (2 + permittivity.real) / permittivity.imag
    return np.asarray(0.819 * f_hz / 1e9 / (permittivity.imag * (1 + eta**2)) * water)


def gas_attenuation_db_per_km(
    frequency_hz: ArrayLike,
    pressure_hpa: ArrayLike = 1013.25,
    temperature_c: ArrayLike = 15.0,
    vapour_g_per_m3: ArrayLike = 7.5,
) -> Real:
    """Return the attenuation by oxygen and water vapour (ITU-R P.676-12, annex 1).

    Parameters
    ----------
    frequency_hz : 1 GHz to 1 THz
    pressure_hpa : pressure of the dry air
    temperature_c : of the air, -100 to 60 degC
    vapour_g_per_m3 : density of water vapour, 0 or more

    Returns
    -------
    ndarray
    """
    f_ghz = _in_band("Gases", frequency_hz, _GAS_BAND_HZ) / 1e9
    dry = real_array("Pressure", pressure_hpa, "hPa", minimum=0.0)
    kelvin = ZERO_CELSIUS_K + real_array(
        "Temperature", temperature_c, "degC", minimum=-100.0, maximum=60.0
    )
    vapour = real_array("Water vapour", vapour_g_per_m3, "g/m^3", minimum=0.0) * kelvin / 216.7
    f_ghz, dry, kelvin, vapour = np.broadcast_arrays(f_ghz, dry, kelvin, vapour)
    theta = 300 / kelvin
    total = (
        _oxygen(f_ghz[..., None], dry[..., None], vapour[..., None], theta[..., None])
        + _dry_continuum(f_ghz, dry, vapour, theta)
        + _vapour(f_ghz[..., None], dry[..., None], vapour[..., None], theta[..., None])
    )
    return np.asarray(0.1820 * f_ghz * total)


def _oxygen(f_ghz: Real, dry_hpa: Real, vapour_hpa: Real, theta: Real) -> Real:
    """Sum over oxygen's lines (eq. 3 to 7)."""
    line_ghz, a1, a2, a3, a4, a5, a6 = OXYGEN_LINES.T
    strength = a1 * 1e-7 * dry_hpa * theta**3 * np.exp(a2 * (1 - theta))
    width = a3 * 1e-4 * (dry_hpa * theta ** (0.8 - a4) + 1.1 * vapour_hpa * theta)
    width = np.sqrt(width**2 + 2.25e-6)  # Zeeman splitting
    mixing = (a5 + a6 * theta) * 1e-4 * (dry_hpa + vapour_hpa) * theta**0.8
    return np.sum(strength * _line_shape(f_ghz, line_ghz, width, mixing), axis=-1)


def _vapour(f_ghz: Real, dry_hpa: Real, vapour_hpa: Real, theta: Real) -> Real:
    """Sum over water vapour's lines (eq. 3 to 7)."""
    line_ghz, b1, b2, b3, b4, b5, b6 = VAPOUR_LINES.T
    strength = b1 * 1e-1 * vapour_hpa * theta**3.5 * np.exp(b2 * (1 - theta))
    width = b3 * 1e-4 * (dry_hpa * theta**b4 + b5 * vapour_hpa * theta**b6)
    doppler = 2.1316e-12 * line_ghz**2 / theta
    width = 0.535 * width + np.sqrt(0.217 * width**2 + doppler)
    return np.sum(strength * _line_shape(f_ghz, line_ghz, width, np.zeros(1)), axis=-1)


def _line_shape(f_ghz: Real, line_ghz: Real, width: Real, mixing: Real) -> Real:
    """Return F_i of eq. (5)."""
    below, above = line_ghz - f_ghz, line_ghz + f_ghz
    found = (width - mixing * below) / (below**2 + width**2)
    found = found + (width - mixing * above) / (above**2 + width**2)
    return np.asarray(f_ghz / line_ghz * found)


def _dry_continuum(f_ghz: Real, dry_hpa: Real, vapour_hpa: Real, theta: Real) -> Real:
    """Return oxygen's Debye spectrum and nitrogen under pressure (eq. 8 and 9)."""
    width = 5.6e-4 * (dry_hpa + vapour_hpa) * theta**0.8
    # without air there is no width: the product with the pressure is 0 then
    oxygen = 6.14e-5 * width / np.maximum(width**2 + f_ghz**2, 1e-300)
    nitrogen = 1.4e-12 * dry_hpa * theta**1.5 / (1 + 1.9e-5 * f_ghz**1.5)
    return np.asarray(f_ghz * dry_hpa * theta**2 * (oxygen + nitrogen))


def _in_band(subject: str, frequency_hz: ArrayLike, band_hz: tuple[float, float]) -> Real:
    try:
        return real_array("Frequency", frequency_hz, "Hz", minimum=band_hz[0], maximum=band_hz[1])
    except ConfigError as error:
        raise ConfigError(f"{subject}: {error}") from None


# -- echo ------------------------------------------------------------------------------------------

#: Diameters of drops [mm]: larger ones break up; the trapezoidal rule over them is good to 1e-4.
_DIAMETERS_MM = np.linspace(0.0, 8.0, 401)[1:]
#: Largest size parameter times index that the series is summed for.
_LARGEST_INSIDE = 1e5


def sphere_backscatter_m2(radius_m: ArrayLike, wavelength_m: ArrayLike, index: ArrayLike) -> Real:
    """Return the radar cross section of a sphere of any size and material (Mie series).

    sigma = pi/k^2 |sum (2n + 1)(-1)^n (a_n - b_n)|^2 (Bohren and Huffman, Absorption and Scattering
    of Light by Small Particles, 1983, 4.82).

    Parameters
    ----------
    radius_m, wavelength_m : [m]
    index : n + jk relative to the medium around

    Returns
    -------
    ndarray : [m^2]

    Raises
    ------
    ConfigError : a sphere of more than 16 000 wavelengths around, inside it
    """
    radius = real_array("Radius", radius_m, "m", minimum=0.0)
    wavelength = real_array("Wavelength", wavelength_m, "m", above=0.0)
    radius, wavelength, indices = np.broadcast_arrays(radius, wavelength, passive_index(index))
    size = np.maximum(2 * np.pi * radius / wavelength, 1e-6).ravel()
    inside = np.abs(size * indices.ravel()).max(initial=0.0)
    if inside > _LARGEST_INSIDE:
        raise ConfigError(
            f"2 pi |index| radius / wavelength is {inside:.3g}; the series is summed up to "
            f"{_LARGEST_INSIDE:g}. Take the limit of large spheres, or of a perfect conductor."
        )
    total = _back_amplitude(size, indices.ravel())
    found = wavelength.ravel() ** 2 / (4 * np.pi) * np.abs(total) ** 2
    return np.asarray(np.where(radius > 0, found.reshape(radius.shape), 0.0))


def _back_amplitude(size: Real, index: Complex) -> Complex:
    """Return sum (2n + 1)(-1)^n (a_n - b_n), (sizes,)."""
    terms = int(np.ceil((size + 4.05 * size ** (1 / 3) + 2).max()))
    derivative = _log_derivatives(size * index, terms)
    total = np.zeros(size.shape, dtype=np.complex128)
    # psi and xi = psi - i chi of Riccati and Bessel by upward recurrence, from n = -1 and 0
    psi_before, psi = np.cos(size), np.sin(size)
    chi_before, chi = -np.sin(size), np.cos(size)
    for n in range(1, terms + 1):
        psi_before, psi = psi, (2 * n - 1) / size * psi - psi_before
        chi_before, chi = chi, (2 * n - 1) / size * chi - chi_before
        xi, xi_before = psi - 1j * chi, psi_before - 1j * chi_before
        used = n <= size + 4.05 * size ** (1 / 3) + 2
        electric = derivative[n] / index + n / size
        magnetic = derivative[n] * index + n / size
        with np.errstate(over="ignore", invalid="ignore"):
            difference = (electric * psi - psi_before) / (electric * xi - xi_before) - (
                magnetic * psi - psi_before
            ) / (magnetic * xi - xi_before)
        total[used] += ((2 * n + 1) * (-1) ** n * difference)[used]
    return total


def _log_derivatives(argument: Complex, terms: int) -> Complex:
    """Return D_n = psi_n'/psi_n for n from 0 to `terms` by downward recurrence, (terms + 1, n)."""
    start = max(terms, int(np.ceil(np.abs(argument).max()))) + 16
    found = np.zeros((start + 1, argument.size), dtype=np.complex128)
    for n in range(start, 0, -1):
        found[n - 1] = n / argument - 1 / (found[n] + n / argument)
    return np.asarray(found[: terms + 1])


def rain_reflectivity_per_m(
    frequency_hz: float, rain_mm_per_h: float, temperature_c: float = 10.0
) -> float:
    """Return the radar cross section of a unit of volume of rain, eta [m^2/m^3 = 1/m].

    eta = sum of sigma_b(D) N(D) dD.

    Parameters
    ----------
    frequency_hz, rain_mm_per_h, temperature_c : carrier, rain rate, temperature of the drops

    Returns
    -------
    float
    """
    weight = _drop_densities(rain_mm_per_h)
    return float(np.sum(weight * _drop_sections_m2(frequency_hz, temperature_c)))


def rain_fall_speeds(
    frequency_hz: float, rain_mm_per_h: float, temperature_c: float = 10.0
) -> tuple[float, float]:
    """Return mean and spread of the fall speeds that rain's echo shows, weighted by eta.

    A drop falls at 9.65 - 10.3 exp(-0.6 D) m/s (Atlas, Srivastava, Sekhon, Rev. Geophys. 11, 1,
    1973), not below 0.

    Parameters
    ----------
    frequency_hz, rain_mm_per_h, temperature_c
        As for `rain_reflectivity_per_m`; the rain rate is above 0.

    Returns
    -------
    tuple of float : mean and standard deviation [m/s]; downwards is positive
    """
    real_array("Rain rate", rain_mm_per_h, "mm/h", above=0.0)
    weight = _drop_densities(rain_mm_per_h) * _drop_sections_m2(frequency_hz, temperature_c)
    fall_mps = np.maximum(9.65 - 10.3 * np.exp(-0.6 * _DIAMETERS_MM), 0.0)
    mean_mps = np.average(fall_mps, weights=weight)
    return float(mean_mps), float(np.sqrt(np.average((fall_mps - mean_mps) ** 2, weights=weight)))


def _drop_densities(rain_mm_per_h: float) -> Real:
    """Return the drops of each diameter in a unit of volume, N(D) dD [1/m^3]."""
    rate = float(real_array("Rain rate", rain_mm_per_h, "mm/h", minimum=0.0))
    step_mm = _DIAMETERS_MM[1] - _DIAMETERS_MM[0]
    if rate == 0:
        return np.zeros(_DIAMETERS_MM.size)
    return np.asarray(8000 * np.exp(-4.1 * rate**-0.21 * _DIAMETERS_MM) * step_mm)


def _drop_sections_m2(frequency_hz: float, temperature_c: float) -> Real:
    wavelength_m = SPEED_OF_LIGHT_MPS / real_array("Frequency", frequency_hz, "Hz", above=0.0)
    index = np.sqrt(liebe_permittivity(frequency_hz, temperature_c))
    return sphere_backscatter_m2(_DIAMETERS_MM / 2e3, wavelength_m, index)
