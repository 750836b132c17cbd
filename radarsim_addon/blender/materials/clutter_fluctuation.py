# SPDX-License-Identifier: GPL-3.0-or-later
"""Texture and motion of a material's clutter, as custom properties of the material.

``radarsim_fluctuation_<field>`` holds the field of `contract.FluctuationRecord`. Any material may
have them; echoes of its objects' surfaces take them, expected powers do not change.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any

from ...contract import FluctuationRecord
from ...errors import ConfigError
from ...physics.clutter_statistics import check_motion, check_texture

#: Of the custom properties.
PREFIX = "radarsim_fluctuation_"
_FIELDS = {item.name: item.default for item in dataclasses.fields(FluctuationRecord)}


def set_clutter_fluctuation(material: Any, **values: Any) -> None:
    """Give the echoes of a material's surfaces a texture, and scatterers that move.

    Parameters
    ----------
    material : bpy.types.Material
    **values
        texture ("none", "k", "lognormal", "weibull"), texture_shape, texture_length_m; motion
        ("none", "exponential", "gaussian", "sea"), motion_speed_mps, motion_fraction: see
        `physics.clutter_statistics.texture` and `clutter_velocities`. What is left out is taken
        away.

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
    """Return the fluctuation of the first of some materials that has one.

    Parameters
    ----------
    materials : iterable of bpy.types.Material or None
        Of an object, by slot.

    Returns
    -------
    FluctuationRecord or None

    Raises
    ------
    ConfigError
        A material's numbers are out of range; the message names it.
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
