# SPDX-License-Identifier: GPL-3.0-or-later
"""radarsim: a radar simulator on Blender's Cycles path tracer.

Importing this package imports neither ``bpy`` nor numpy: the Blender half is loaded by
`register` (which Blender calls when it enables the extension), the companion module by
``import radarsim_addon.signal``.
"""

from importlib import import_module as _import_module
from typing import Any as _Any

__version__ = "0.1.0"

#: What scripts use; each part is loaded when it is first named.
_PARTS = ("blender", "errors", "physics", "signal")


def __getattr__(name: str) -> _Any:
    if name in _PARTS:
        return _import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({"__version__", "register", "unregister", *_PARTS})


def register() -> None:
    """Register the add-on's classes with Blender (called by Blender, or by a headless script)."""
    from .blender import addon

    addon.register()


def unregister() -> None:
    """Take back all that `register` added."""
    from .blender import addon

    addon.unregister()
