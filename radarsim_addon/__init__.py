# SPDX-License-Identifier: GPL-3.0-or-later
"""radarsim: a radar simulator on Blender's Cycles path tracer.

Importing this package imports neither ``bpy`` nor numpy: the Blender half is loaded by
:func:`register` (which Blender calls when it enables the extension), the companion module by
``import radarsim_addon.signal``.
"""

__version__ = "0.1.0"


def register() -> None:
    """Register the add-on's classes with Blender (called by Blender, or by a headless script)."""
    from .blender import addon

    addon.register()


def unregister() -> None:
    """Take back all that :func:`register` added."""
    from .blender import addon

    addon.unregister()
