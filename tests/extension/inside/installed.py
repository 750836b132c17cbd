# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs in a process of its own, in a clean user folder: install the zip, use it, take it away.

    python installed.py ARCHIVE OUT

Prints one JSON object on the last line.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
from pathlib import Path
from typing import Any

import bpy

MODULE = "bl_ext.user_default.radarsim"


def traces() -> dict[str, list[str]]:
    """All that an add-on may leave behind in Blender."""
    # bpy.types lists what is registered under the names of its base classes.
    classes = {name for name in dir(bpy.types) if "radar" in name.lower()}
    for base in (bpy.types.Operator, bpy.types.Panel, bpy.types.PropertyGroup, bpy.types.UIList,
                 bpy.types.Menu, bpy.types.AddonPreferences):  # fmt: skip
        classes |= {c.__name__ for c in base.__subclasses__() if c.is_registered and _ours(c)}
    properties = [
        f"{kind}.{name}"
        for kind in ("Scene", "Object", "Material", "Light", "Camera", "WindowManager", "World",
                     "ShaderNodeTree", "Collection", "ViewLayer", "Mesh", "Image")
        for name in getattr(bpy.types, kind).bl_rna.properties.keys()
        if "radar" in name.lower()
    ]  # fmt: skip
    handlers = [
        f"{name}: {function.__module__}"
        for name in dir(bpy.app.handlers)
        if isinstance(getattr(bpy.app.handlers, name), list)
        for function in getattr(bpy.app.handlers, name)
        if _ours(function)
    ]
    operators = list(dir(bpy.ops.radarsim)) if "radarsim" in dir(bpy.ops) else []
    return {
        "classes": sorted(classes),
        "properties": sorted(properties),
        "handlers": sorted(handlers),
        "operators": sorted(operators),
    }


def _ours(thing: Any) -> bool:
    return str(getattr(thing, "__module__", "")).startswith((MODULE, "radarsim_addon"))


def plate_scene() -> None:
    """A plate of 4 m x 4 m at 10 m before the radar; small, quick numbers."""
    scene = bpy.context.scene
    bpy.ops.radarsim.setup_rig()
    bpy.ops.mesh.primitive_plane_add(
        size=4.0, location=(0.0, 10.0, 0.0), rotation=(1.5707963, 0, 0)
    )
    plate = bpy.context.object
    for item in bpy.context.selected_objects:
        item.select_set(item == plate)
    bpy.ops.radarsim.assign_material()
    rig = next(item for item in scene.objects if item.type == "EMPTY")
    rig.location = (0.0, 0.0, 0.0)


def main(archive: str, out: str) -> dict[str, Any]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    found: dict[str, Any] = {"before": traces()}
    said = bpy.ops.extensions.package_install_files(
        filepath=archive, repo="user_default", enable_on_install=True
    )
    found["installed"] = sorted(said)
    found["enabled"] = MODULE in bpy.context.preferences.addons
    module = importlib.import_module(MODULE)
    found["file"] = module.__file__
    found["enabled_traces"] = traces()

    plate_scene()
    settings = bpy.data.objects["Radar"].radarsim
    settings.output_folder = out
    settings.frame_mode = "current"
    settings.sampling_mode = "rings"
    settings.rings = 3
    settings.ring_step_m = 5.0
    settings.width_px = settings.height_px = 8
    settings.samples = 1
    found["rendered"] = sorted(bpy.ops.radarsim.render_frames())

    # The interface for scripts, under the name that it has in the extension.
    radarsim = importlib.import_module(f"{MODULE}.blender")
    run = radarsim.measure(bpy.data.objects["Radar"], out + "_script", frames=[1], rings=2)
    found["measured"] = [run.record.rings, run.record.width_px, len(run.missing())]
    radarsim.settings(bpy.data.objects["Radar"]).carrier_hz = 77e9
    found["carrier_hz"] = radarsim.settings(bpy.data.objects["Radar"]).carrier_hz

    # Registering what is registered must not raise, nor double anything.
    module.register()
    found["registered_twice"] = traces()
    bpy.ops.preferences.addon_disable(module=MODULE)
    found["after"] = traces()
    bpy.ops.preferences.addon_enable(module=MODULE)
    found["enabled_again"] = traces()
    bpy.ops.preferences.addon_disable(module=MODULE)
    found["after_again"] = traces()
    found["checkout_imported"] = "radarsim_addon" in sys.modules

    repositories = bpy.context.preferences.extensions.repos
    number = next(n for n, item in enumerate(repositories) if item.module == "user_default")
    found["files_before"] = len(own_files())
    bpy.ops.preferences.addon_enable(module=MODULE)
    said = bpy.ops.extensions.package_uninstall(repo_index=number, pkg_id="radarsim")
    found["uninstalled"] = sorted(said)
    found["after_uninstall"] = traces() | {"files": own_files()}
    found["addons"] = [name for name in bpy.context.preferences.addons.keys() if "radar" in name]
    return found


def own_files() -> list[str]:
    """Files of the user's folder that name the extension, in their path or inside."""
    user = Path(os.environ["BLENDER_USER_RESOURCES"])
    return sorted(
        str(path.relative_to(user))
        for path in user.rglob("*")
        if "radarsim" in str(path.relative_to(user))
        or (path.is_file() and b"radarsim" in path.read_bytes())
    )


if __name__ == "__main__":
    Path(sys.argv[2]).mkdir(parents=True, exist_ok=True)
    print(json.dumps(main(sys.argv[1], sys.argv[2])))
