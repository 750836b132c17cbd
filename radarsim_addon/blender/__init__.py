# SPDX-License-Identifier: GPL-3.0-or-later
"""The Blender half, and its interface for scripts.

``add_radar``, ``antennas``, ``settings``, ``material``, ``simple_material``, ``set_clutter``,
``set_clutter_fluctuation``, ``set_mirror``, ``set_scattered_lobe``, ``assign_material``,
``assign_by_name``, ``measure``, ``process``, ``show``: see :mod:`.headless.scripting`. They are
loaded when they are first used: importing this package does not import bpy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .headless.scripting import (
        add_radar,
        antennas,
        assign_by_name,
        assign_material,
        material,
        measure,
        process,
        settings,
        show,
        simple_material,
    )
    from .materials import set_clutter, set_clutter_fluctuation, set_mirror, set_scattered_lobe

__all__ = [
    "add_radar",
    "antennas",
    "assign_by_name",
    "assign_material",
    "material",
    "measure",
    "process",
    "set_clutter",
    "set_clutter_fluctuation",
    "set_mirror",
    "set_scattered_lobe",
    "settings",
    "show",
    "simple_material",
]


def __getattr__(name: str) -> Any:
    if name in __all__:
        from .headless import scripting as home

        # Modules of these names, such as the room `settings`, are found by import statements only.
        value = globals()[name] = getattr(home, name)
        return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return list(__all__)
