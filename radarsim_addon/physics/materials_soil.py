# SPDX-License-Identifier: GPL-3.0-or-later
"""Moist mineral soil: Dobson et al. 1985 (1.4 to 18 GHz), Peplinski et al. 1995 (0.3 to 1.3 GHz).

The two differ in the effective conductivity and, below 1.3 GHz, in a linear correction of eps'.
Published models of soil differ by 3 to 12 % in eps' (up to 40 % in eps'' of dry soil): the
accuracy of a soil's permittivity is that, not the digits printed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..array_types import Complex, Real
from ..errors import ConfigError
from .constants import VACUUM_PERMITTIVITY_F_PER_M
from .material_model import MaterialModel, Parameter

_SOLID_DENSITY_G_PER_CM3 = 2.664
_SOLID_PERMITTIVITY = 4.7
_SHAPE = 0.65
_WATER_INFINITE = 4.9
#: Between Peplinski's band and Dobson's.
_DIVIDE_HZ = 1.35e9


def soil_permittivity(
    frequency_hz: ArrayLike,
    moisture: ArrayLike,
    sand: ArrayLike,
    clay: ArrayLike,
    bulk_density_g_per_cm3: ArrayLike,
    temperature_c: ArrayLike,
) -> Complex:
    """Return the complex relative permittivity of moist mineral soil.

    Dobson et al. 1985 (IEEE Trans. GE-23, 35) eq. (28)-(31); Peplinski et al. 1995
    (IEEE Trans. GRS-33, 803) eq. (2)-(10).

    Parameters
    ----------
    frequency_hz
        Frequency [Hz]. All arguments broadcast.
    moisture
        Water by volume, fraction of 1.
    sand, clay
        Fractions of 1 by weight.
    bulk_density_g_per_cm3
        Dry bulk density [g/cm^3].
    temperature_c
        Temperature [degC].

    Returns
    -------
    ndarray
        Permittivity; NaN if the fitted conductivity makes the free water amplify (very sandy soil
        at low frequency).
    """
    f = np.asarray(frequency_hz, dtype=np.float64)
    mv = np.asarray(moisture, dtype=np.float64)
    s = np.asarray(sand, dtype=np.float64)
    c = np.asarray(clay, dtype=np.float64)
    density = np.asarray(bulk_density_g_per_cm3, dtype=np.float64)
    t = np.asarray(temperature_c, dtype=np.float64)
    low_band = f < _DIVIDE_HZ

    beta_real = 1.2748 - 0.519 * s - 0.152 * c
    beta_imag = 1.33797 - 0.603 * s - 0.166 * c
    conductivity = np.where(
        low_band,
        0.0467 + 0.2204 * density - 0.4111 * s + 0.6614 * c,
        -1.645 + 1.939 * density - 2.25622 * s + 1.594 * c,
    )
    static = 87.134 - 1.949e-1 * t - 1.276e-2 * t**2 + 2.491e-4 * t**3
    omega_tau = f * (1.1109e-10 - 3.824e-12 * t + 6.938e-14 * t**2 - 5.096e-16 * t**3)
    water_real = _WATER_INFINITE + (static - _WATER_INFINITE) / (1 + omega_tau**2)
    solid_fraction = (_SOLID_DENSITY_G_PER_CM3 - density) / (_SOLID_DENSITY_G_PER_CM3 * mv)
    water_imag = omega_tau * (static - _WATER_INFINITE) / (1 + omega_tau**2) + (
        conductivity * solid_fraction / (2 * np.pi * f * VACUUM_PERMITTIVITY_F_PER_M)
    )
    real = (
        1
        + density / _SOLID_DENSITY_G_PER_CM3 * (_SOLID_PERMITTIVITY**_SHAPE - 1)
        + mv**beta_real * water_real**_SHAPE
        - mv
    ) ** (1 / _SHAPE)
    imag = mv ** (beta_imag / _SHAPE) * np.where(water_imag >= 0, water_imag, np.nan)
    real = np.where(low_band, 1.15 * real - 0.68, real)
    return np.asarray(real + 1j * imag, dtype=np.complex128)


def _checked(frequency_hz: Real, **soil: Real) -> Complex:
    total = soil["sand"] + soil["clay"]
    if np.any(total > 1 + 1e-6):
        raise ConfigError(
            f"Sand and clay of material 'soil' add up to {np.max(total):g}; expected at most 1 "
            "(fractions by weight; the rest is silt). Divide percentages by 100."
        )
    return soil_permittivity(frequency_hz, **soil)


def soil_models() -> tuple[MaterialModel, ...]:
    """Return the soil model with its two bands.

    Returns
    -------
    tuple of MaterialModel
        One model.
    """
    return (
        MaterialModel(
            name="soil",
            title="Moist mineral soil",
            source="Dobson et al., IEEE Trans. GE-23, 35; Peplinski et al., GRS-33, 803",
            edition="1985 from 1.4 GHz; 1995 up to 1.3 GHz",
            bands_hz=((0.3e9, 1.3e9), (1.4e9, 18e9)),
            permittivity_of=_checked,
            parameters=(
                Parameter("moisture", "m^3/m^3", "water by volume", None, 0.01, 0.5),
                Parameter("sand", "", "sand, fraction by weight", 0.4, 0.0, 1.0),
                Parameter("clay", "", "clay, fraction by weight", 0.2, 0.0, 1.0),
                Parameter("bulk_density_g_per_cm3", "g/cm^3", "dry bulk density", 1.3, 0.8, 2.0),
                Parameter("temperature_c", "degC", "temperature", 20.0, 0.0, 40.0),
            ),
        ),
    )
