# SPDX-License-Identifier: GPL-3.0-or-later
"""Clutter models of materials: sigma0 by grazing angle, next to the lobes of medium and surface.

The user's values are custom properties of a physical material:

=================================  =================================================================
``radarsim_clutter``               name of the model in `physics.clutter` ("nrl_sea", "table"...)
``radarsim_clutter_<parameter>``   parameters of the model, by name
``radarsim_clutter_path``          CSV file of the model "table"
=================================  =================================================================

A run evaluates the models at its carrier and polarisation, see `set_clutter_tables`.

``radarsim_fluctuation_<field>`` are the fields of `contract.FluctuationRecord`: texture and motion
of the clutter of any material. Echoes of its surfaces take them; expected powers do not change.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import bpy

from ...contract import FluctuationRecord
from ...errors import ConfigError
from ...physics.clutter import (
    CLUTTER_TABLE,
    check_motion,
    check_texture,
    clutter_model,
)
from ...physics.materials import TABLE
from ...signal.scene import Clutter
from ..nodes.groups import group_input, group_kind
from ..nodes.physical_material import CLUTTER_ROW, PHYSICAL_KIND
from .physical_materials import MEDIUM
from .physical_materials import PATH as MEDIUM_PATH

CLUTTER = "radarsim_clutter"
PARAMETER_PREFIX = "radarsim_clutter_"
PATH = "radarsim_clutter_path"
NO_CLUTTER = "none"


def clutter_of(material: bpy.types.Material) -> Clutter | None:
    """Return the clutter model of a material or None. Raises ConfigError for an unknown model."""
    name = None if material is None else material.get(CLUTTER)
    if not isinstance(name, str) or name in ("", NO_CLUTTER):
        return None
    if name == CLUTTER_TABLE:
        return Clutter(name, {}, bpy.path.abspath(str(material.get(PATH, ""))))
    try:
        known = clutter_model(name).parameters
    except ConfigError as error:
        raise ConfigError(f"Material {material.name!r}: {error}") from error
    given = {one.name: material.get(PARAMETER_PREFIX + one.name) for one in known}
    return Clutter(name, {key: float(value) for key, value in given.items() if value is not None})


def clutter_name(materials: Iterable[Any]) -> str | None:
    """Return the clutter model's name of the first of an object's materials that renders one."""
    for material in materials:
        clutter = clutter_of(material)
        if clutter is not None and group_input(material, CLUTTER_ROW) is not None:
            return clutter.name
    return None


def table_files(material: bpy.types.Material) -> list[Path]:
    """Return the CSV files that a material takes its medium and its clutter from."""
    keys = ((MEDIUM, TABLE, MEDIUM_PATH), (CLUTTER, CLUTTER_TABLE, PATH))
    names = [material.get(path) for key, table, path in keys if material.get(key) == table]
    return [Path(bpy.path.abspath(name)) for name in names if isinstance(name, str) and name]


def set_clutter(
    material: bpy.types.Material, name: str, *, path: str | None = None, **parameters: float
) -> None:
    """Give a physical material a clutter model.

    Parameters
    ----------
    material : bpy.types.Material
        Of the physical Radar Material group.
    name
        Key of `physics.clutter.clutter_models`, 'table' together with `path`, or 'none'.
    path
        CSV file, for 'table' only.
    **parameters
        Values of the model's ``parameters`` by name.

    Raises
    ------
    ConfigError
        Not such a material, an unknown model or parameter, a number out of range, or a table that
        cannot be used. The material stays as it was.
    """
    if group_kind(material) != PHYSICAL_KIND:
        raise ConfigError(
            f"Material {material.name!r} has no physical Radar Material at its output, which a "
            "clutter model needs. Choose Use Physical Inputs in the Material tab, without a "
            "thickness of a thin sheet."
        )
    if name != NO_CLUTTER:
        where = None if path is None else bpy.path.abspath(path)
        Clutter(name, parameters, where).sigma0_db(1e9, 0.1, "average")
    for key in [key for key in material.keys() if key.startswith(PARAMETER_PREFIX)]:
        del material[key]
    material[CLUTTER] = name
    if path is not None:
        material[PATH] = path
    for key, value in parameters.items():
        material[PARAMETER_PREFIX + key] = float(value)


# Texture and motion.

PREFIX = "radarsim_fluctuation_"
_FIELDS = {item.name: item.default for item in dataclasses.fields(FluctuationRecord)}


def set_clutter_fluctuation(material: bpy.types.Material, **values: Any) -> None:
    """Give the echoes of a material's surfaces a texture, and scatterers that move.

    Parameters
    ----------
    material : bpy.types.Material
    **values
        texture ("none", "k", "lognormal", "weibull"), texture_shape, texture_length_m; motion
        ("none", "exponential", "gaussian", "sea"), motion_speed_mps, motion_fraction: see
        `physics.clutter.texture` and `clutter_velocities`. What is left out is taken away.

    Raises
    ------
    ConfigError
        An unknown name or kind, a number out of range. The material stays as it was.
    """
    unknown = sorted(set(values) - set(_FIELDS))
    if unknown:
        raise ConfigError(
            f"There is no {unknown[0]!r} of a clutter fluctuation; expected {', '.join(_FIELDS)}."
        )
    _checked(FluctuationRecord(**values))
    for name in _FIELDS:
        if name in values:
            material[PREFIX + name] = values[name]
        elif PREFIX + name in material:
            del material[PREFIX + name]


def fluctuation_of(materials: Iterable[Any]) -> FluctuationRecord | None:
    """Return the fluctuation of the first of an object's materials that has one.

    Raises ConfigError, which names the material, for numbers out of range.
    """
    for material in materials:
        if material is None or not any(PREFIX + name in material for name in _FIELDS):
            continue
        values = {
            name: type(default)(material.get(PREFIX + name, default))
            for name, default in _FIELDS.items()
        }
        try:
            record = _checked(FluctuationRecord(**values))
        except ConfigError as error:
            raise ConfigError(f"Material {material.name!r}: {error}") from error
        if (record.texture, record.motion) != ("none", "none"):
            return record
    return None


def _checked(record: FluctuationRecord) -> FluctuationRecord:
    check_texture(record.texture, record.texture_shape, record.texture_length_m)
    check_motion(record.motion, record.motion_speed_mps, record.motion_fraction)
    return record
