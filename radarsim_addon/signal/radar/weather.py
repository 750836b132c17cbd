# SPDX-License-Identifier: GPL-3.0-or-later
"""The air between radar and scene: how much rain, fog and gases take of each path's power."""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_args

import numpy as np

from ...findings import Finding, finding
from ...options import check_settings, choices_from, documented, setting
from ...physics.rain_echo import rain_reflectivity_per_m
from ...physics.weather import (
    Polarisation,
    fog_attenuation_db_per_km,
    gas_attenuation_db_per_km,
    rain_attenuation_db_per_km,
)


@documented
@dataclass(frozen=True)
class Weather:
    """The weather along all paths; the default is clear air that takes nothing."""

    rain_mm_per_h: float = setting(
        "Rain", "Attenuate all paths by rain of this rate (ITU-R P.838-3)", 0.0, unit="mm/h",
        minimum=0.0, maximum=500.0,
    )  # fmt: skip
    fog_g_per_m3: float = setting(
        "Fog", "Attenuate all paths by fog of this liquid water content (ITU-R P.840-8)", 0.0,
        unit="g/m^3", minimum=0.0, maximum=10.0,
    )  # fmt: skip
    gases: bool = setting(
        "Gases", "Attenuate all paths by oxygen and water vapour (ITU-R P.676-12)", False
    )
    rain_polarisation: Polarisation = setting(
        "Rain polarisation", "Choose the polarisation that rain attenuates", "average",
        choices=choices_from(get_args(Polarisation)),
    )  # fmt: skip
    rain_echo: bool = setting(
        "Rain echo", "Add the echo of the rain itself within the field of view", False
    )
    wind_x_mps: float = setting(
        "Wind along X", "Let the rain drift along the world's X", 0.0, unit="m/s",
        minimum=-100.0, maximum=100.0,
    )  # fmt: skip
    wind_y_mps: float = setting(
        "Wind along Y", "Let the rain drift along the world's Y", 0.0, unit="m/s",
        minimum=-100.0, maximum=100.0,
    )  # fmt: skip
    air_temperature_c: float = setting(
        "Air temperature", "Set the temperature of air and fog", 15.0, unit="degC",
        minimum=-20.0, maximum=50.0,
    )  # fmt: skip
    air_pressure_hpa: float = setting(
        "Air pressure", "Set the pressure of the dry air", 1013.25, unit="hPa",
        minimum=0.0, maximum=1100.0,
    )  # fmt: skip
    vapour_g_per_m3: float = setting(
        "Water vapour", "Set the density of water vapour", 7.5, unit="g/m^3",
        minimum=0.0, maximum=50.0,
    )  # fmt: skip

    def __post_init__(self) -> None:
        check_settings(self)

    def attenuation_db_per_km(self, carrier_hz: float) -> float:
        """Return the attenuation of a kilometre of path, one way.

        Parameters
        ----------
        carrier_hz
            Carrier [Hz]; the attenuation is the same over the whole band.

        Returns
        -------
        float
            Rain, fog and gases together [dB/km].

        Raises
        ------
        ConfigError
            The carrier is out of the band of a model that is in use.
        """
        parts = []
        if self.rain_mm_per_h:
            rate = self.rain_mm_per_h
            parts.append(rain_attenuation_db_per_km(carrier_hz, rate, self.rain_polarisation))
        if self.fog_g_per_m3:
            warmth = self.air_temperature_c
            parts.append(fog_attenuation_db_per_km(carrier_hz, self.fog_g_per_m3, warmth))
        if self.gases:
            air = self.air_pressure_hpa, self.air_temperature_c, self.vapour_g_per_m3
            parts.append(gas_attenuation_db_per_km(carrier_hz, *air))
        return float(sum(map(float, parts)))

    def findings(self, carrier_hz: float) -> list[Finding]:
        """Return what to know of powers in this weather; nothing in clear air."""
        taken = self.attenuation_db_per_km(carrier_hz)
        found = [finding("weather-attenuates", attenuation_db_per_km=taken)] if taken > 0 else []
        if self.rain_mm_per_h > 0:
            eta = rain_reflectivity_per_m(carrier_hz, self.rain_mm_per_h)
            level_db = float(10 * np.log10(eta))
            rate = self.rain_mm_per_h
            numbers = {"rain_mm_per_h": rate, "reflectivity_db": level_db}
            found.append(
                finding("rain-echo", **numbers)
                if self.rain_echo
                else finding("rain-echo-left-out", **numbers)
            )
        return found
