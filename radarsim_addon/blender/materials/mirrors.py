# SPDX-License-Identifier: GPL-3.0-or-later
"""Grounds as mirrors, and objects that the user has marked as mirrors, or as none."""

from __future__ import annotations

from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any

import bpy

from ...errors import ConfigError, SceneError
from ...physics.mirrors import MirrorMaterial
from ...signal.scene import SMOOTH_BELOW
from .surfaces import surface_at


def ground_mirror(
    material: bpy.types.Material,
    carrier_hz: float,
    beyond_band: str,
    rms_height_m: float | None = None,
) -> MirrorMaterial:
    """Return the coherent reflection of a ground at a carrier, whose material may be rough.

    The material is not changed. `rms_height_m` is in place of the material's. Raises SceneError if
    it is no Radar Material, or neither smooth nor of a known RMS height; ConfigError if the medium
    cannot be evaluated.
    """
    name = "none" if material is None else repr(material.name)
    surface = surface_at(material, carrier_hz, beyond_band)
    if surface.kind == "physical":
        smooth = surface.roughness is not None and surface.roughness <= SMOOTH_BELOW
        if not smooth and surface.rough.rms_height_m == 0 and rms_height_m is None:
            raise SceneError(
                f"The ground's material {name} has a slope and no RMS height, so its coherent "
                "reflection is unknown. Set RMS Height of the material, or --rms-height."
            )
        surface = replace(surface, roughness=0.0)  # the coherent part
    found = surface.mirror
    if found is None or found.sheet_wavelengths > 0:
        raise SceneError(
            f"The ground's material is {name}, which is no mirror with numbers of its own: "
            "expected a physical Radar Material, or a simple one with roughness 0 and Specularity "
            "above 0. Choose such a material, or name another ground by --ground."
        )
    return found if rms_height_m is None else replace(found, rms_height_m=rms_height_m)


# Objects that the user has marked as mirrors, or as none.

#: Custom property of an object.
MIRROR = "radarsim_mirror"
#: Value, name and description of each choice, the first where nothing is chosen.
MIRROR_CHOICES = (
    ("auto", "Automatic", "Where it is smooth and planar, in the order of what the radar sees"),
    ("first", "First", "Before all others, if the number of mirror images does not do for all"),
    ("never", "Never", "No image of the transmitter, whatever its material"),
)
_NAMES = tuple(name for name, _, _ in MIRROR_CHOICES)


def mirror_choice(item: bpy.types.Object) -> str:
    """Return whether an object gets images of the transmitter: 'auto', 'first' or 'never'."""
    found = item.get(MIRROR)
    return found if found in _NAMES else _NAMES[0]


def set_mirror(item: bpy.types.Object, choice: str = "first") -> None:
    """Mark an object as a mirror for paths to the transmitter, or as none.

    Parameters
    ----------
    item : bpy.types.Object
        With its instances.
    choice
        'first': its smooth planar faces get images of the transmitter before those of others.
        'never': they get none. 'auto': by what the transmitter sees in them.

    Raises
    ------
    ConfigError
        Another choice.
    """
    if choice not in _NAMES:
        raise ConfigError(f"Mirror choice {choice!r}; expected one of {', '.join(_NAMES)}.")
    item[MIRROR] = choice


def set_mirrors(scene: bpy.types.Scene, patterns: str, choice: str) -> None:
    """Mark the objects of a scene that a command line names, as `set_mirror` does.

    `patterns` are names, which may contain * and ?, separated by commas. Raises ConfigError for a
    name that no object has.
    """
    items = list(scene.objects)
    for pattern in (one.strip() for one in patterns.split(",")):
        chosen = [item for item in items if fnmatchcase(item.name, pattern)]
        if not chosen:
            raise ConfigError(
                f"No object of the scene is called {pattern!r}, which is to be a mirror "
                f"({choice}). Give names of objects; they may contain * and ?."
            )
        for item in chosen:
            set_mirror(item, choice)


def mirror_property() -> Any:
    """Return the choice as a property of objects, for the window."""

    def read(item: bpy.types.Object) -> int:
        return _NAMES.index(mirror_choice(item))

    def write(item: bpy.types.Object, number: int) -> None:
        set_mirror(item, _NAMES[number])

    return bpy.props.EnumProperty(
        name="Mirror Images",
        description="Choose whether the object gets images of the transmitter",
        items=MIRROR_CHOICES,
        get=read,
        set=write,
    )
