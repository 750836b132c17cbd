# SPDX-License-Identifier: GPL-3.0-or-later
"""The Blender half, and its interface for scripts.

``add_radar``, ``settings``, ``material``, ``set_clutter``,
``set_clutter_fluctuation``, ``assign_material``, ``assign_by_name``, ``measure``, ``process``: see
:mod:`.headless.scripting`. They are loaded when they are first used: importing this package does
not import bpy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .headless.scripting import (
        add_radar,
        assign_by_name,
        assign_material,
        material,
        measure,
        process,
        set_clutter,
        set_clutter_fluctuation,
        settings,
    )

__all__ = [
    "add_radar",
    "assign_by_name",
    "assign_material",
    "material",
    "measure",
    "process",
    "set_clutter",
    "set_clutter_fluctuation",
    "settings",
]


def __getattr__(name: str) -> Any:
    if name in __all__:
        from .headless import scripting

        # Modules of these names, such as the room `settings`, are found by import statements only.
        value = globals()[name] = getattr(scripting, name)
        return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
