# SPDX-License-Identifier: GPL-3.0-or-later
"""The link budget (transmit power, antennas, losses, noise) and the weather along the paths.

Without a link budget a path brings the power that a transmitter of the Point light's EIRP in all
directions gives to an isotropic receiver. With one, the power of each path is that times

    P_t G_t(direction at the transmitter) G_r(direction at the receiver) / (L EIRP of the light),

so that no new render is needed: the light's watts are the light level of the renders and cancel.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np

from ...contract import LinkBudget
from ...errors import ConfigError
from ...findings import Finding, finding
from ...options import check_settings, choices_from, documented, setting
from ...physics.radar_equation import from_db, noise_power_w
from ...physics.weather import (
    Polarisation,
    fog_attenuation_db_per_km,
    gas_attenuation_db_per_km,
    rain_attenuation_db_per_km,
    rain_reflectivity_per_m,
)
from ...typed_json import from_json, read_json
from .antennas import PeakedAntenna, make_antenna, self_contained

#: A file with two antenna tables of a degree's step has about 2 MB.
_MAX_BYTES = 64 * 1024 * 1024


@dataclass(frozen=True)
class RadarSystem:
    """A checked link budget with its antennas at a wavelength [m]; each antenna looks along the -z
    of the light or camera, y up.
    """

    record: LinkBudget
    transmitter: PeakedAntenna
    receiver: PeakedAntenna
    wavelength_m: float

    @property
    def loss(self) -> float:
        """All losses together, linear, over 1."""
        record = self.record
        total_db = record.transmit_loss_db + record.receive_loss_db + record.other_loss_db
        return float(from_db(total_db))

    def noise_power_w(self, bandwidth_hz: float) -> float:
        """Return the thermal noise in a bandwidth at the receiver's input, k (T_a + (F-1) T_0) B
        [W].
        """
        record = self.record
        return float(
            noise_power_w(bandwidth_hz, record.noise_figure_db, record.antenna_temperature_k)
        )


def make_system(record: LinkBudget, wavelength_m: float) -> RadarSystem:
    """Check a link budget and make its antennas for a wavelength [m]."""
    check_settings(record)
    return RadarSystem(
        record,
        make_antenna(record.transmitter, wavelength_m, "Transmitter's"),
        make_antenna(record.receiver, wavelength_m, "Receiver's"),
        wavelength_m,
    )


def read_system(path: str | Path) -> LinkBudget:
    """Read a link budget from JSON, with the contents of antenna tables that it names by "file",
    relative to the JSON file. From a ``run.json``, that of the run.
    """
    path = Path(path)
    data: Any = read_json(path, _MAX_BYTES, "Give a JSON file with a link budget.", ConfigError)
    if data.get("schema") == "radarsim/run":
        data = data.get("link_budget")
        if data is None:
            raise ConfigError(
                f"{path} is a run without a link budget; expected one with a link budget."
            )
    if isinstance(data, dict):
        data = {k: value for k, value in data.items() if k not in ("schema", "schema_version")}
    record = from_json(LinkBudget, data, str(path))
    return dataclasses.replace(
        record,
        transmitter=self_contained(record.transmitter, path.parent),
        receiver=self_contained(record.receiver, path.parent),
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
        parts, rain, fog = [], self.rain_mm_per_h, self.fog_g_per_m3
        if rain:
            parts.append(rain_attenuation_db_per_km(carrier_hz, rain, self.rain_polarisation))
        if fog:
            parts.append(fog_attenuation_db_per_km(carrier_hz, fog, self.air_temperature_c))
        if self.gases:
            air = self.air_pressure_hpa, self.air_temperature_c, self.vapour_g_per_m3
            parts.append(gas_attenuation_db_per_km(carrier_hz, *air))
        return float(sum(map(float, parts)))

    def findings(self, carrier_hz: float) -> list[Finding]:
        """Return what to consider about powers in this weather; nothing in clear air."""
        taken = self.attenuation_db_per_km(carrier_hz)
        found = [finding("weather-attenuates", attenuation_db_per_km=taken)] if taken > 0 else []
        if self.rain_mm_per_h > 0:
            eta = rain_reflectivity_per_m(carrier_hz, self.rain_mm_per_h)
            level_db = float(10 * np.log10(eta))
            numbers = {"rain_mm_per_h": self.rain_mm_per_h, "reflectivity_db": level_db}
            found.append(
                finding("rain-echo", **numbers)
                if self.rain_echo
                else finding("rain-echo-left-out", **numbers)
            )
        return found
