# SPDX-License-Identifier: GPL-3.0-or-later
"""The library of materials: complex index of refraction by name and frequency.

>>> material("concrete", 5.3e9)                               # ITU-R P.2040-3
>>> material("sea_water", 5.3e9, temperature_c=10, salinity_psu=35)
>>> material("table", 5.3e9, path="my_measurement.csv")

Convention exp(-j w t): Im >= 0.
"""

from __future__ import annotations

import difflib
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

from numpy.typing import ArrayLike

from ..array_types import Complex
from ..errors import ConfigError
from .material_model import MaterialModel
from .materials_general import general_models, table_model
from .materials_itu import itu_models
from .materials_soil import soil_models
from .materials_water import water_models

TABLE = "table"
"""Name under which a CSV file is read; it takes the one parameter ``path``."""


@lru_cache(maxsize=1)
def models() -> MappingProxyType[str, MaterialModel]:
    """Return all models of the library by name (read only)."""
    everything = (*general_models(), *itu_models(), *water_models(), *soil_models())
    return MappingProxyType({model.name: model for model in everything})


def material_model(name: str, path: str | Path | None = None) -> MaterialModel:
    """Return a model: its source, edition, band and parameters.

    Parameters
    ----------
    name
        Key of `models`, or 'table'.
    path
        CSV file, for 'table' only.

    Returns
    -------
    MaterialModel
        The model.

    Raises
    ------
    ConfigError
        Unknown name, with the nearest ones; 'table' without `path`, or another name with it.
    """
    if name == TABLE:
        if path is None:
            raise ConfigError("Material 'table' has no path; give a CSV file over frequency.")
        return table_model(path)
    if path is not None:
        raise ConfigError(f"Material {name!r} takes no path; only 'table' reads a file.")
    found = models().get(name)
    if found is None:
        near = difflib.get_close_matches(name, [*models(), TABLE], n=3)
        hint = f"did you mean {', '.join(near)}? " if near else ""
        raise ConfigError(
            f"There is no material {name!r}: {hint}Known: {', '.join(sorted([*models(), TABLE]))}."
        )
    return found


def material(
    name: str,
    frequency_hz: ArrayLike,
    *,
    path: str | Path | None = None,
    beyond_band: str = "refuse",
    **parameters: ArrayLike,
) -> Complex:
    """Return the complex index of refraction n + jk of a material of the library.

    Parameters
    ----------
    name
        Key of `models`, or 'table' together with `path`.
    frequency_hz
        Frequency [Hz], any shape.
    path
        CSV file, for 'table' only.
    beyond_band
        Outside the band of validity: 'refuse', 'hold' its nearest edge or 'extrapolate'.
    **parameters
        Values of the model's ``parameters`` by name; they broadcast with `frequency_hz`.

    Returns
    -------
    ndarray
        Index of the broadcast shape, Im >= 0.

    Raises
    ------
    ConfigError
        Unknown name, frequency outside the band of validity, parameter out of range or NaN.
    """
    return material_model(name, path).index(frequency_hz, beyond_band, **parameters)


def permittivity(
    name: str,
    frequency_hz: ArrayLike,
    *,
    path: str | Path | None = None,
    beyond_band: str = "refuse",
    **parameters: ArrayLike,
) -> Complex:
    """Return the complex relative permittivity of a material of the library.

    Parameters
    ----------
    name, frequency_hz, path, beyond_band, **parameters
        As for `material`.

    Returns
    -------
    ndarray
        Permittivity of the broadcast shape, Im >= 0.
    """
    return material_model(name, path).permittivity(frequency_hz, beyond_band, **parameters)
