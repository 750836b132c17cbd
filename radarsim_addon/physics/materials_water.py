# SPDX-License-Identifier: GPL-3.0-or-later
"""Pure water, sea water and ice: the complex relative permittivity, and the models with their
bands.

Frequencies are in Hz, temperatures in degC, salinity in psu.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Complex, reals
from .constants import VACUUM_PERMITTIVITY_F_PER_M, ZERO_CELSIUS_K
from .material_model import MaterialModel, Parameter


def debye_permittivity(
    frequency_hz: ArrayLike,
    static_permittivity: ArrayLike,
    infinite_permittivity: ArrayLike,
    relaxation_frequency_hz: ArrayLike,
) -> Complex:
    """Return eps_inf + (eps_s - eps_inf)/(1 - j f/f_r), f_r = 1/(2 pi tau) (Debye 1929).

    Parameters
    ----------
    frequency_hz, relaxation_frequency_hz : f and f_r
    static_permittivity, infinite_permittivity : eps_s and eps_inf

    Returns
    -------
    ndarray
    """
    f, static, infinite = reals(frequency_hz, static_permittivity, infinite_permittivity)
    ratio = f / np.asarray(relaxation_frequency_hz)
    return np.asarray(infinite + (static - infinite) / (1 - 1j * ratio), dtype=np.complex128)


def liebe_permittivity(frequency_hz: ArrayLike, temperature_c: ArrayLike) -> Complex:
    """Return the permittivity of pure water by Liebe, Hufford and Manabe 1991, eq. (1) to (4).

    ITU-R P.527-4 has the same.

    Parameters
    ----------
    frequency_hz, temperature_c

    Returns
    -------
    ndarray
    """
    theta = 300 / (np.asarray(temperature_c, dtype=np.float64) + ZERO_CELSIUS_K) - 1
    static = 77.66 + 103.3 * theta
    middle = 0.0671 * static
    infinite = 3.52 - 7.52 * theta
    first_hz = (20.20 - 146.4 * theta + 316 * theta**2) * 1e9
    return (
        debye_permittivity(frequency_hz, static, middle, first_hz)
        + debye_permittivity(frequency_hz, middle, infinite, 39.8 * first_hz)
        - middle
    )


def kaatze_permittivity(frequency_hz: ArrayLike, temperature_c: ArrayLike) -> Complex:
    """Return the permittivity of pure water by Kaatze 1989, one relaxation.

    J. Chem. Eng. Data 34, 371, eq. (5) to (7).

    Parameters
    ----------
    frequency_hz, temperature_c

    Returns
    -------
    ndarray
    """
    celsius = np.asarray(temperature_c, dtype=np.float64)
    static = 10 ** (1.94404 - 1.991e-3 * celsius)
    infinite = 5.77 - 2.74e-2 * celsius
    kelvin = celsius + ZERO_CELSIUS_K
    tau_s = 3.745e-15 * (1 + 7e-5 * (celsius - 27.5) ** 2) * np.exp(2.2957e3 / kelvin)
    return debye_permittivity(frequency_hz, static, infinite, 1 / (2 * np.pi * tau_s))


def klein_swift_permittivity(
    frequency_hz: ArrayLike, temperature_c: ArrayLike, salinity_psu: ArrayLike
) -> Complex:
    """Return the permittivity of sea water by Klein and Swift 1977 (IEEE Trans. AP-25, 104).

    Eq. (5), (8), (14), (17), (18).

    Parameters
    ----------
    frequency_hz, temperature_c, salinity_psu

    Returns
    -------
    ndarray
    """
    f, t, s = reals(frequency_hz, temperature_c, salinity_psu)
    static = (87.134 - 1.949e-1 * t - 1.276e-2 * t**2 + 2.491e-4 * t**3) * (
        1 + 1.613e-5 * s * t - 3.656e-3 * s + 3.210e-5 * s**2 - 4.232e-7 * s**3
    )
    tau_s = (1.768e-11 - 6.086e-13 * t + 1.104e-14 * t**2 - 8.111e-17 * t**3) * (
        1 + 2.282e-5 * s * t - 7.638e-4 * s - 7.760e-6 * s**2 + 1.105e-8 * s**3
    )
    delta = 25 - t
    beta = (
        2.033e-2
        + 1.266e-4 * delta
        + 2.464e-6 * delta**2
        - s * (1.849e-5 - 2.551e-7 * delta + 2.551e-8 * delta**2)
    )
    at_25_c = s * (0.182521 - 1.46192e-3 * s + 2.09324e-5 * s**2 - 1.28205e-7 * s**3)
    conductivity = at_25_c * np.exp(-delta * beta)
    relaxation = debye_permittivity(f, static, 4.9, 1 / (2 * np.pi * tau_s))
    return relaxation + 1j * conductivity / (2 * np.pi * f * VACUUM_PERMITTIVITY_F_PER_M)


def ice_permittivity(frequency_hz: ArrayLike, temperature_c: ArrayLike) -> Complex:
    """Return the permittivity of pure ice by Maetzler 2006.

    Thermal Microwave Radiation (IET), section 5.3.

    Parameters
    ----------
    frequency_hz, temperature_c

    Returns
    -------
    ndarray
    """
    f_hz, celsius = reals(frequency_hz, temperature_c)
    f_ghz = f_hz / 1e9
    kelvin = celsius + ZERO_CELSIUS_K
    theta = 300 / kelvin - 1
    alpha = (0.00504 + 0.0062 * theta) * np.exp(-22.1 * theta)
    resonance = np.exp(335 / kelvin)
    beta = (
        0.0207 / kelvin * resonance / (resonance - 1) ** 2
        + 1.16e-11 * f_ghz**2
        + np.exp(-9.963 + 0.0372 * celsius)
    )
    return np.asarray(
        3.1884 + 9.1e-4 * celsius + 1j * (alpha / f_ghz + beta * f_ghz), dtype=np.complex128
    )


def _temperature(default: float, minimum: float, maximum: float) -> Parameter:
    return Parameter("temperature_c", "degC", "temperature", default, minimum, maximum)


WATER_MODELS = (
    MaterialModel(
        name="water",
        title="Pure water",
        source="Liebe, Hufford, Manabe, Int. J. Infrared Millimeter Waves 12, 659",
        edition="1991, double Debye; as ITU-R P.527-4",
        bands_hz=((1e6, 1e12),),
        permittivity_of=liebe_permittivity,
        parameters=(_temperature(20.0, -4.0, 40.0),),
    ),
    MaterialModel(
        name="water_kaatze",
        title="Pure water, single relaxation",
        source="Kaatze, J. Chem. Eng. Data 34, 371",
        edition="1989",
        bands_hz=((1.1e9, 57e9),),
        permittivity_of=kaatze_permittivity,
        parameters=(_temperature(20.0, -4.1, 60.0),),
        remedy="Use the model 'water' (Liebe, up to 1 THz), or change the carrier.",
    ),
    MaterialModel(
        name="sea_water",
        title="Sea water",
        source="Klein and Swift, IEEE Trans. Antennas Propag. 25, 104",
        edition="1977",
        # Their fit was made for radiometers below X band; they doubt the relaxation above.
        bands_hz=((0.3e9, 10e9),),
        permittivity_of=klein_swift_permittivity,
        parameters=(
            _temperature(20.0, 0.0, 40.0),
            Parameter("salinity_psu", "psu", "salinity", 35.0, 4.0, 40.0),
        ),
    ),
    MaterialModel(
        name="ice",
        title="Pure ice",
        source="Maetzler, in Thermal Microwave Radiation (IET), section 5.3",
        edition="2006",
        bands_hz=((1e7, 3e12),),
        permittivity_of=ice_permittivity,
        # Below 240 K the real part no longer follows the straight line.
        parameters=(_temperature(-10.0, -33.15, 0.0),),
    ),
)
