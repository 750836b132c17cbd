# SPDX-License-Identifier: GPL-3.0-or-later
"""Which objects a user has marked as mirrors, or as none, in the custom property of an object."""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import Any

import bpy

from ...errors import ConfigError

MIRROR = "radarsim_mirror"
#: Value, name and description of each choice, the first where nothing is chosen.
MIRROR_CHOICES = (
    ("auto", "Automatic", "Where it is smooth and planar, in the order of what the radar sees"),
    ("first", "First", "Before all others, if the number of mirror images does not do for all"),
    ("never", "Never", "No image of the transmitter, whatever its material"),
)
_NAMES = tuple(name for name, _, _ in MIRROR_CHOICES)


def mirror_choice(item: Any) -> str:
    """Return whether an object gets images of the transmitter.

    Parameters
    ----------
    item : bpy.types.Object

    Returns
    -------
    str
        'auto', 'first' or 'never'.
    """
    found = item.get(MIRROR)
    return found if found in _NAMES else _NAMES[0]


def set_mirror(item: Any, choice: str = "first") -> None:
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


def set_mirrors(scene: Any, patterns: str, choice: str) -> None:
    """Mark the objects of a scene that a command line names.

    Parameters
    ----------
    scene : bpy.types.Scene
    patterns
        Names, which may contain * and ?, separated by commas.
    choice
        As for `set_mirror`.

    Raises
    ------
    ConfigError
        A name that no object has.
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
    """Return the choice as a property of objects, for the window.

    Returns
    -------
    bpy.props.EnumProperty
    """

    def read(item: Any) -> int:
        return _NAMES.index(mirror_choice(item))

    def write(item: Any, number: int) -> None:
        set_mirror(item, _NAMES[number])

    return bpy.props.EnumProperty(
        name="Mirror Images",
        description="Choose whether the object gets images of the transmitter",
        items=MIRROR_CHOICES,
        get=read,
        set=write,
    )
