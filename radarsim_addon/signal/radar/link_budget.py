# SPDX-License-Identifier: GPL-3.0-or-later
"""The radar's link budget: transmit power, antennas, losses, noise.

Without a system a path brings the power that an emitter of the lamp's EIRP in all directions gives
to an isotropic receiver. With one, each path's power is that times

    P_t G_t(direction at the emitter) G_r(direction at the receiver) / (L EIRP of the lamp),

so that no new render is needed: the lamp's watts are the light level of the renders and cancel.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...contract import LinkBudget
from ...errors import ConfigError
from ...options import check_settings
from ...physics.noise import noise_power_w
from ...physics.radar_equation import from_db
from ...typed_json import from_json, read_json
from .antennas import PeakedAntenna, make_antenna, self_contained

#: A file with two antenna tables of a degree's step has about 2 MB.
_MAX_BYTES = 64 * 1024 * 1024
_RECORD_ONLY = ("schema", "schema_version")


@dataclass(frozen=True)
class RadarSystem:
    """A link budget that was checked, its antennas ready for use.

    Attributes
    ----------
    record
        The numbers.
    transmitter, receiver
        Antennas; each looks along the -z of the lamp or camera, y up.
    wavelength_m
        At which the antennas are [m].
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
        """Thermal noise in a bandwidth at the receiver's input, k (T_a + (F-1) T_0) B [W]."""
        record = self.record
        return float(
            noise_power_w(bandwidth_hz, record.noise_figure_db, record.antenna_temperature_k)
        )


def make_system(record: LinkBudget, wavelength_m: float) -> RadarSystem:
    """Check a link budget and make its antennas.

    Parameters
    ----------
    record
        Powers, losses, noise and antennas.
    wavelength_m
        Of the carrier [m].

    Returns
    -------
    RadarSystem
        The link budget with its two antennas.

    Raises
    ------
    ConfigError
        A number out of range, an antenna that cannot be made, an unknown amplitude model.
    """
    check_settings(record)
    return RadarSystem(
        record,
        make_antenna(record.transmitter, wavelength_m, "Transmitter's"),
        make_antenna(record.receiver, wavelength_m, "Receiver's"),
        wavelength_m,
    )


def read_system(path: str | Path) -> LinkBudget:
    """Read a link budget from JSON.

    Parameters
    ----------
    path
        JSON file with fields of `LinkBudget`; those left out take its defaults. Its antennas may
        name tables by ``"file"``, relative to the JSON file. From a ``run.json`` the link budget
        of the run is taken.

    Returns
    -------
    LinkBudget
        With the contents of antenna tables.

    Raises
    ------
    ConfigError
        The file cannot be read, or holds an unknown field or a value of a wrong kind.
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
        data = {name: value for name, value in data.items() if name not in _RECORD_ONLY}
    record = from_json(LinkBudget, data, str(path))
    return dataclasses.replace(
        record,
        transmitter=self_contained(record.transmitter, path.parent),
        receiver=self_contained(record.receiver, path.parent),
    )
