# SPDX-License-Identifier: GPL-3.0-or-later
"""All settings of a user's scene that a measurement might touch, as plain values."""

from __future__ import annotations

from typing import Any

import bpy


def values(owner: Any) -> dict[str, Any]:
    """Every plain property of an RNA struct; pointers by the name of what they point at."""
    found: dict[str, Any] = {}
    for prop in owner.bl_rna.properties:
        if prop.identifier == "rna_type" or prop.type == "COLLECTION":
            continue
        value = getattr(owner, prop.identifier)
        if prop.type == "POINTER":
            found[prop.identifier] = getattr(value, "name", value is not None)
        elif getattr(prop, "is_array", False):
            found[prop.identifier] = [round(item, 9) for item in value]
        elif prop.type == "ENUM" and prop.is_enum_flag:
            found[prop.identifier] = sorted(value)
        else:
            found[prop.identifier] = value
    return found


def snapshot(scene: Any) -> dict[str, Any]:
    """Settings of a scene, its layers, objects, lamps, world, materials, and the preferences."""
    found: dict[str, Any] = {
        "scene": values(scene),
        "scene custom": sorted(key for key in scene.keys() if key not in ("cycles", "radarsim")),
        "render": values(scene.render),
        "image": values(scene.render.image_settings),
        "bake": values(scene.render.bake),
        "cycles": values(scene.cycles),
        "view": values(scene.view_settings),
        "display": values(scene.display_settings),
        "units": values(scene.unit_settings),
        "preferences": values(bpy.context.preferences.view),
        "frame": [scene.frame_current, round(scene.frame_subframe, 7)],
    }
    # Unset in a new file; Blender fills it in whenever a file format is set, and takes no "" back.
    if not found["image"].get("linear_colorspace_settings", True):
        found["image"]["linear_colorspace_settings"] = "sRGB"
    for layer in scene.view_layers:
        found[f"layer {layer.name}"] = values(layer)
        found[f"layer {layer.name} cycles"] = values(layer.cycles)
    for item in scene.objects:
        found[f"object {item.name}"] = {
            "hide_render": item.hide_render,
            "hide_viewport": item.hide_viewport,
            "visible_shadow": item.visible_shadow,
            "visible_camera": item.visible_camera,
            "selected": item.select_get(),
            "matrix": [round(value, 6) for row in item.matrix_world for value in row],
        }
    for kind in ("cameras", "lights", "worlds"):
        for block in getattr(bpy.data, kind):
            found[f"{kind} {block.name}"] = values(block)
    for light in bpy.data.lights:
        found[f"light {light.name} cycles"] = values(light.cycles)
    for material in bpy.data.materials:
        if hasattr(material, "cycles"):
            found[f"material {material.name} cycles"] = values(material.cycles)
    return found


def differences(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """What is not as it was, as ``place.property: old -> new``."""
    found = []
    for place in sorted(before.keys() | after.keys()):
        old, new = before.get(place), after.get(place)
        if isinstance(old, dict) and isinstance(new, dict):
            found += [
                f"{place}.{key}: {old.get(key)!r} -> {new.get(key)!r}"
                for key in sorted(old.keys() | new.keys())
                if old.get(key) != new.get(key)
            ]
        elif old != new:
            found.append(f"{place}: {old!r} -> {new!r}")
    return found
