# SPDX-License-Identifier: GPL-3.0-or-later
"""What rain scatters back: Mie series of the drops, summed over a drop size distribution.

Sizes after Marshall and Palmer (J. Meteorol. 5, 165, 1948): N(D) = 8000 exp(-4.1 R^-0.21 D) drops
per m^3 and mm of diameter D [mm], R in mm/h. Drops are spheres of pure water.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..array_types import Complex, Real
from ..errors import ConfigError
from .checks import passive_index, real_array
from .constants import SPEED_OF_LIGHT_MPS
from .materials_water import liebe_permittivity

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
    radius_m, wavelength_m
        [m], broadcast.
    index
        n + jk relative to the medium around, k >= 0.

    Returns
    -------
    ndarray
        Of the broadcast shape [m^2].

    Raises
    ------
    ConfigError
        A number out of range; a sphere of more than 16 000 wavelengths around, inside it.
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

    Parameters
    ----------
    frequency_hz
        Above 0 [Hz].
    rain_mm_per_h
        Rain rate R, 0 or more [mm/h].
    temperature_c
        Of the drops [degC].

    Returns
    -------
    float
        eta = sum of sigma_b(D) N(D) dD [1/m].

    Raises
    ------
    ConfigError
        A number out of range.
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
    tuple of float
        Mean and standard deviation [m/s]; downwards is positive.

    Raises
    ------
    ConfigError
        A number out of range.
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
