# SPDX-License-Identifier: GPL-3.0-or-later
"""Area clutter: the radar cross section of a unit of ground or sea, sigma0, by grazing angle.

>>> clutter_model("nrl_sea").sigma0_db(9.65e9, 0.02, "horizontal", sea_state=3)

Each model has a band of frequencies and an interval of grazing angles in which its source holds.
Outside, its equation is continued; a table holds its last row. A caller asks `is_valid`.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..array_types import Real
from ..errors import ConfigError
from .checks import EDGE_SLACK, real_array
from .clutter_table import ClutterTable, read_clutter_table
from .material_model import Parameter

CLUTTER_TABLE = "table"
"""Name under which a CSV file is read; it takes the one parameter ``path``."""
POLARISATIONS = ("average", "vertical", "horizontal")
"""Polarisations on both ways; "average" is the mean of sigma0 of the other two."""

#: Least grazing angle that an equation is evaluated at [rad]: 0 has no logarithm.
_LEAST_RAD = 1e-9


@dataclass(frozen=True)
class ClutterModel:
    """A model of sigma0, both ways in one polarisation.

    Attributes
    ----------
    name
        Key in the registry.
    title
        Name for people.
    source
        Publication of the equation or the numbers.
    band_hz
        Lowest and highest frequency [Hz].
    grazing_rad
        Smallest and largest grazing angle [rad].
    sigma0_db_of
        Equation: (frequency_hz, grazing_rad, "vertical" or "horizontal", **parameters) -> dB.
    parameters
        Its other parameters.
    """

    name: str
    title: str
    source: str
    band_hz: tuple[float, float]
    grazing_rad: tuple[float, float]
    sigma0_db_of: Callable[..., Real] = field(repr=False, compare=False)
    parameters: tuple[Parameter, ...] = ()

    def sigma0_db(
        self,
        frequency_hz: float,
        grazing_rad: ArrayLike,
        polarisation: str = "average",
        **parameters: float,
    ) -> Real:
        """Return sigma0.

        Parameters
        ----------
        frequency_hz
            Frequency [Hz].
        grazing_rad
            Grazing angles, 0 to pi/2 [rad].
        polarisation
            One of `POLARISATIONS`.
        **parameters
            Values of the model's `parameters` by name.

        Returns
        -------
        ndarray
            sigma0 in the shape of `grazing_rad` [dB].

        Raises
        ------
        ConfigError
            A number out of range, an unknown polarisation, an unknown or missing parameter.
        """
        if polarisation not in POLARISATIONS:
            raise ConfigError(
                f"Polarisation {polarisation!r}; expected one of {', '.join(POLARISATIONS)}."
            )
        values = self._values(parameters)
        frequency = float(real_array("Frequency", frequency_hz, "Hz", above=0.0))
        grazing = real_array("Grazing angle", grazing_rad, "rad", 0.0, np.pi / 2)
        grazing = np.maximum(grazing, _LEAST_RAD)
        if polarisation != "average":
            return np.asarray(self.sigma0_db_of(frequency, grazing, polarisation, **values))
        both = [10 ** (self.sigma0_db_of(frequency, grazing, one, **values) / 10) for one in _SIDES]
        return np.asarray(10 * np.log10((both[0] + both[1]) / 2))

    def is_valid(self, frequency_hz: ArrayLike, grazing_rad: ArrayLike) -> NDArray[np.bool_]:
        """Return whether the source of the model holds at frequencies [Hz] and angles [rad]."""
        inside: NDArray[np.bool_] = np.asarray(True)
        for value, limits in ((frequency_hz, self.band_hz), (grazing_rad, self.grazing_rad)):
            low, high = limits[0] * (1 - EDGE_SLACK), limits[1] * (1 + EDGE_SLACK)
            inside = inside & (np.asarray(value) >= low) & (np.asarray(value) <= high)
        return np.asarray(inside)

    def _values(self, given: dict[str, float]) -> dict[str, float]:
        known = {parameter.name: parameter for parameter in self.parameters}
        unknown = sorted(set(given) - set(known))
        if unknown:
            raise ConfigError(
                f"Clutter {self.name!r} has no parameter {unknown[0]!r}; its parameters: "
                f"{', '.join(known) or 'none'}."
            )
        values = {}
        for one in self.parameters:
            value = given.get(one.name, one.default)
            if value is None:
                raise ConfigError(
                    f"Clutter {self.name!r} needs {one.name} [{one.unit or '1'}]: {one.meaning}."
                )
            what = f"{one.name} of clutter {self.name!r}"
            values[one.name] = float(real_array(what, value, one.unit, one.minimum, one.maximum))
        return values


_SIDES = POLARISATIONS[1:]


def _constant_gamma_db(_f_hz: float, grazing_rad: Real, _side: str, gamma_db: float) -> Real:
    return np.asarray(gamma_db + 10 * np.log10(np.sin(grazing_rad)))


#: c1 to c5 of the NRL sea model; of the report's two prints the listing has more digits.
_NRL_SEA = {
    "horizontal": (-73.0, 20.781, 7.351, 25.65, 0.0054),
    "vertical": (-50.796, 25.93, 0.7093, 21.588, 0.00211),
}


def _nrl_sea_db(frequency_hz: float, grazing_rad: Real, side: str, sea_state: float) -> Real:
    """Gregers-Hansen and Mital, eq. 7, with the constants of their listing."""
    c1, c2, c3, c4, c5 = _NRL_SEA[side]
    psi_deg = np.degrees(grazing_rad)
    by_frequency = (27.5 + c3 * psi_deg) * np.log10(frequency_hz / 1e9) / (1 + 0.95 * psi_deg)
    by_state = c4 * (1 + sea_state) ** (1 / (2 + 0.085 * psi_deg + 0.033 * sea_state))
    slant = c2 * np.log10(np.sin(grazing_rad))
    return np.asarray(c1 + slant + by_frequency + by_state + c5 * psi_deg**2)


_MODELS = (
    ClutterModel(
        "constant_gamma",
        "Constant gamma",
        "sigma0 = gamma sin(grazing angle)",
        (0.0, np.inf),
        (0.0, np.pi / 2),
        _constant_gamma_db,
        (Parameter("gamma_db", "dB", "sigma0 over the sine of the angle", -15.0, -80.0, 20.0),),
    ),
    ClutterModel(
        "nrl_sea",
        "Sea (NRL)",
        "Gregers-Hansen and Mital, NRL/MR/5310-12-9346 (2012), mean over look directions",
        (0.5e9, 35e9),
        (np.radians(0.1), np.radians(60.0)),
        _nrl_sea_db,
        (Parameter("sea_state", "", "Douglas sea state, 0 to 6", 3.0, 0.0, 6.0),),
    ),
)


def nathanson_sea(sea_state: int) -> str:
    """Return the file with Nathanson's measured sigma0 of the sea, for the model 'table'.

    Parameters
    ----------
    sea_state
        Douglas sea state, 0 to 6, a whole number.

    Returns
    -------
    str
        Path of the CSV file. Of frequencies with five angles at least: 0.5 to 35 GHz, fewer at sea
        states 0 and 6; 0.1 to 60 degrees, in part from 1 degree on.

    Raises
    ------
    ConfigError
        Another sea state.
    """
    if sea_state not in range(7):
        raise ConfigError(f"Sea state is {sea_state!r}; expected a whole number from 0 to 6.")
    return str(Path(__file__).with_name("sea_tables") / f"sea_state_{int(sea_state)}.csv")


def clutter_models() -> MappingProxyType[str, ClutterModel]:
    """Return the models that need no file, by name (read only).

    Returns
    -------
    mapping of str to ClutterModel
    """
    return MappingProxyType({model.name: model for model in _MODELS})


def clutter_model(name: str, path: str | Path | None = None) -> ClutterModel:
    """Return a model.

    Parameters
    ----------
    name
        Key of `clutter_models`, or 'table'.
    path
        CSV file, for 'table' only, see `read_clutter_table`.

    Returns
    -------
    ClutterModel
        The model.

    Raises
    ------
    ConfigError
        Unknown name, with the nearest ones; 'table' without `path`, another name with it; or a
        table that cannot be used.
    """
    if name == CLUTTER_TABLE:
        if not path:
            raise ConfigError("Clutter 'table' has no path; give a CSV file over grazing angle.")
        return _of_table(read_clutter_table(path))
    if path:
        raise ConfigError(f"Clutter {name!r} takes no path; only 'table' reads a file.")
    found = clutter_models().get(name)
    if found is None:
        known = [*clutter_models(), CLUTTER_TABLE]
        near = difflib.get_close_matches(name, known, n=2)
        hint = f"did you mean {', '.join(near)}? " if near else ""
        raise ConfigError(f"There is no clutter model {name!r}: {hint}Known: {', '.join(known)}.")
    return found


def _of_table(table: ClutterTable) -> ClutterModel:
    return ClutterModel(
        CLUTTER_TABLE,
        f"Table {table.path.name}",
        f"{table.rows} rows of {table.path.name}",
        table.band_hz,
        table.grazing_rad,
        table.sigma0_db,
    )
