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

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Complex, Real
from ..errors import ConfigError
from .checks import passive_index, real_array
from .constants import SPEED_OF_LIGHT_MPS, ZERO_CELSIUS_K
from .materials import liebe_permittivity

# Spectral lines up to 1 THz, ITU-R P.676-12, tables 1 and 2. A row: line frequency [GHz], then the
# six coefficients a1 to a6 or b1 to b6 of the tables.
# fmt: off
OXYGEN_LINES = np.array([
    (50.474214, 0.975, 9.651, 6.69, 0, 2.566, 6.85),
    (50.987745, 2.529, 8.653, 7.17, 0, 2.246, 6.8),
    (51.50336, 6.193, 7.709, 7.64, 0, 1.947, 6.729),
    (52.021429, 14.32, 6.819, 8.11, 0, 1.667, 6.64),
    (52.542418, 31.24, 5.983, 8.58, 0, 1.388, 6.526),
    (53.066934, 64.29, 5.201, 9.06, 0, 1.349, 6.206),
    (53.595775, 124.6, 4.474, 9.55, 0, 2.227, 5.085),
    (54.130025, 227.3, 3.8, 9.96, 0, 3.17, 3.75),
    (54.67118, 389.7, 3.182, 10.37, 0, 3.558, 2.654),
    (55.221384, 627.1, 2.618, 10.89, 0, 2.56, 2.952),
    (55.783815, 945.3, 2.109, 11.34, 0, -1.172, 6.135),
    (56.264774, 543.4, 0.014, 17.03, 0, 3.525, -0.978),
    (56.363399, 1331.8, 1.654, 11.89, 0, -2.378, 6.547),
    (56.968211, 1746.6, 1.255, 12.23, 0, -3.545, 6.451),
    (57.612486, 2120.1, 0.91, 12.62, 0, -5.416, 6.056),
    (58.323877, 2363.7, 0.621, 12.95, 0, -1.932, 0.436),
    (58.446588, 1442.1, 0.083, 14.91, 0, 6.768, -1.273),
    (59.164204, 2379.9, 0.387, 13.53, 0, -6.561, 2.309),
    (59.590983, 2090.7, 0.207, 14.08, 0, 6.957, -0.776),
    (60.306056, 2103.4, 0.207, 14.15, 0, -6.395, 0.699),
    (60.434778, 2438, 0.386, 13.39, 0, 6.342, -2.825),
    (61.150562, 2479.5, 0.621, 12.92, 0, 1.014, -0.584),
    (61.800158, 2275.9, 0.91, 12.63, 0, 5.014, -6.619),
    (62.41122, 1915.4, 1.255, 12.17, 0, 3.029, -6.759),
    (62.486253, 1503, 0.083, 15.13, 0, -4.499, 0.844),
    (62.997984, 1490.2, 1.654, 11.74, 0, 1.856, -6.675),
    (63.568526, 1078, 2.108, 11.34, 0, 0.658, -6.139),
    (64.127775, 728.7, 2.617, 10.88, 0, -3.036, -2.895),
    (64.67891, 461.3, 3.181, 10.38, 0, -3.968, -2.59),
    (65.224078, 274, 3.8, 9.96, 0, -3.528, -3.68),
    (65.764779, 153, 4.473, 9.55, 0, -2.548, -5.002),
    (66.302096, 80.4, 5.2, 9.06, 0, -1.66, -6.091),
    (66.836834, 39.8, 5.982, 8.58, 0, -1.68, -6.393),
    (67.369601, 18.56, 6.818, 8.11, 0, -1.956, -6.475),
    (67.900868, 8.172, 7.708, 7.64, 0, -2.216, -6.545),
    (68.431006, 3.397, 8.652, 7.17, 0, -2.492, -6.6),
    (68.960312, 1.334, 9.65, 6.69, 0, -2.773, -6.65),
    (118.750334, 940.3, 0.01, 16.64, 0, -0.439, 0.079),
    (368.498246, 67.4, 0.048, 16.4, 0, 0, 0),
    (424.76302, 637.7, 0.044, 16.4, 0, 0, 0),
    (487.249273, 237.4, 0.049, 16, 0, 0, 0),
    (715.392902, 98.1, 0.145, 16, 0, 0, 0),
    (773.83949, 572.3, 0.141, 16.2, 0, 0, 0),
    (834.145546, 183.1, 0.145, 14.7, 0, 0, 0),
])
VAPOUR_LINES = np.array([
    (22.23508, 0.1079, 2.144, 26.38, 0.76, 5.087, 1),
    (67.80396, 0.0011, 8.732, 28.58, 0.69, 4.93, 0.82),
    (119.99594, 0.0007, 8.353, 29.48, 0.7, 4.78, 0.79),
    (183.310087, 2.273, 0.668, 29.06, 0.77, 5.022, 0.85),
    (321.22563, 0.047, 6.179, 24.04, 0.67, 4.398, 0.54),
    (325.152888, 1.514, 1.541, 28.23, 0.64, 4.893, 0.74),
    (336.227764, 0.001, 9.825, 26.93, 0.69, 4.74, 0.61),
    (380.197353, 11.67, 1.048, 28.11, 0.54, 5.063, 0.89),
    (390.134508, 0.0045, 7.347, 21.52, 0.63, 4.81, 0.55),
    (437.346667, 0.0632, 5.048, 18.45, 0.6, 4.23, 0.48),
    (439.150807, 0.9098, 3.595, 20.07, 0.63, 4.483, 0.52),
    (443.018343, 0.192, 5.048, 15.55, 0.6, 5.083, 0.5),
    (448.001085, 10.41, 1.405, 25.64, 0.66, 5.028, 0.67),
    (470.888999, 0.3254, 3.597, 21.34, 0.66, 4.506, 0.65),
    (474.689092, 1.26, 2.379, 23.2, 0.65, 4.804, 0.64),
    (488.490108, 0.2529, 2.852, 25.86, 0.69, 5.201, 0.72),
    (503.568532, 0.0372, 6.731, 16.12, 0.61, 3.98, 0.43),
    (504.482692, 0.0124, 6.731, 16.12, 0.61, 4.01, 0.45),
    (547.67644, 0.9785, 0.158, 26, 0.7, 4.5, 1),
    (552.02096, 0.184, 0.158, 26, 0.7, 4.5, 1),
    (556.935985, 497, 0.159, 30.86, 0.69, 4.552, 1),
    (620.700807, 5.015, 2.391, 24.38, 0.71, 4.856, 0.68),
    (645.766085, 0.0067, 8.633, 18, 0.6, 4, 0.5),
    (658.00528, 0.2732, 7.816, 32.1, 0.69, 4.14, 1),
    (752.033113, 243.4, 0.396, 30.86, 0.68, 4.352, 0.84),
    (841.051732, 0.0134, 8.177, 15.9, 0.33, 5.76, 0.45),
    (859.965698, 0.1325, 8.055, 30.6, 0.68, 4.09, 0.84),
    (899.303175, 0.0547, 7.914, 29.85, 0.68, 4.53, 0.9),
    (902.611085, 0.0386, 8.429, 28.65, 0.7, 5.1, 0.95),
    (906.205957, 0.1836, 5.11, 24.08, 0.7, 4.7, 0.53),
    (916.171582, 8.4, 1.441, 26.73, 0.7, 5.15, 0.78),
    (923.112692, 0.0079, 10.293, 29, 0.7, 5, 0.8),
    (970.315022, 9.009, 1.919, 25.5, 0.64, 4.94, 0.67),
    (987.926764, 134.6, 0.257, 29.85, 0.68, 4.55, 0.9),
    (1780, 17506, 0.952, 196.3, 2, 24.15, 5),
])
# fmt: on


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
    """P.838-3, eq. (2) and (3): a sum of Gaussians and a line over lg f."""
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
    """Oxygen's Debye spectrum and nitrogen under pressure (eq. 8 and 9)."""
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
