# SPDX-License-Identifier: GPL-3.0-or-later
"""Additions to a scene for one path per pixel: render passes, object numbers, world volume."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import bpy

from ..materials import SURFACE_TYPES, has_no_faces
from ..nodes import attributes
from ..nodes.materials import lets_nothing_through
from ..scene import PATTERN_PROPERTY
from ..state import SettingsRestorer
from .requests import Region

LIGHT_GROUP = "radarsim"
MARK_GROUP = "radarsim_vertices"
_WORLD = "radarsim range encoding (temporary)"
#: Properties of the scene that tell materials and transmitter which paths count.
PATH_GATES = (
    attributes.ATTR_ORDER_MIN,
    attributes.ATTR_ORDER_MAX,
    attributes.ATTR_DEPTH_MIN,
    attributes.ATTR_DEPTH_MAX,
    attributes.ATTR_SURFACE_DEPTH,
    attributes.ATTR_SURFACE_STOP,
    attributes.ATTR_VERTEX_SCALE,
    attributes.ATTR_MARK_ORDER,
    attributes.ATTR_MARK_DEPTH,
    attributes.ATTR_MARK_SCALE,
    attributes.ATTR_WORLD_CODE,
    attributes.ATTR_BY_POLARISATION,
)
#: Settings of Cycles for the number of reflections.
BOUNCES = ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces")

#: Colours of a Volume Absorption of density 2/k: what it spares of red, green and blue.
ENCODING_RED_GREEN = (0.5, 0.0, 1.0, 1.0)
ENCODING_ALL = (0.5, 0.0, 0.5, 1.0)


def set_border(render: Any, region: Region, width_px: int, height_px: int) -> None:
    """Set the border of a render; its pixels are bit by bit those of the whole.

    Parameters
    ----------
    render : bpy.types.RenderSettings
        Settings of the scene.
    region
        What is rendered.
    width_px, height_px
        Size of the whole picture.
    """
    # A quarter of a pixel inside: Blender cuts the product with the width down to a whole number.
    render.border_min_x = (region.left + 0.25) / width_px
    render.border_max_x = min((region.right + 0.25) / width_px, 1.0)
    render.border_min_y = (height_px - region.bottom + 0.25) / height_px
    render.border_max_y = min((height_px - region.top + 0.25) / height_px, 1.0)


def keep_changing(recorder: SettingsRestorer, scene: Any) -> tuple[str, int]:
    """Remember what changes from render to render; return the user's mode and number of threads."""
    render = scene.render
    mode = render.threads_mode
    render.threads_mode = "FIXED"  # else `threads` is that of the machine
    kept = (
        (scene.cycles, ("seed", *BOUNCES)),
        (render, ("resolution_x", "resolution_y", "threads")),
    )
    before = [(owner, name, getattr(owner, name)) for owner, names in kept for name in names]

    def undo() -> None:
        render.threads_mode = "FIXED"
        for owner, name, value in before:
            setattr(owner, name, value)
        render.threads_mode = mode

    # The recorder's own `set` leaves equal values alone, and so would not put these back.
    recorder.on_restore("seed, bounces and size", undo)
    return mode, render.threads


def set_format(recorder: SettingsRestorer, render: Any, path: Path) -> None:
    """Have renders written as multilayer EXR files that are read back at once."""
    # The measuring settings remember the user's format; ours replaces theirs within it.
    image, put = render.image_settings, recorder.set
    if hasattr(image, "media_type"):
        put(image, "media_type", "MULTI_LAYER_IMAGE")
    put(image, "file_format", "OPEN_EXR_MULTILAYER")
    image.color_depth = "32"
    put(image, "exr_codec", "NONE")  # read back at once: packing would only cost time
    if hasattr(image, "use_exr_interleave"):
        put(image, "use_exr_interleave", True)  # one part instead of one a pass: half the time
    put(render, "filepath", str(path))
    put(render, "use_file_extension", True)


def numbered_objects() -> list[Any]:
    """Return the surfaces of the file in the order of their numbers, which begin at 1."""
    by_name = sorted(bpy.data.objects, key=lambda o: (o.library is not None, o.name_full))
    return [i for i in by_name if i.type in SURFACE_TYPES and PATTERN_PROPERTY not in i]


def number_objects(
    recorder: SettingsRestorer,
) -> tuple[list[str], frozenset[int], frozenset[int]]:
    """Give every surface a number that its pixels carry.

    Returns the names, and the numbers of those that let nothing through, and that are not rendered.
    """
    opaque, hidden = set(), set()
    opaque_material = cache(lets_nothing_through)
    items = numbered_objects()
    for number, item in enumerate(items, 1):
        recorder.set(item, "pass_index", number)
        if _is_opaque(item, opaque_material):
            opaque.add(number)
        if item.hide_render:
            hidden.add(number)
    return [item.name_full for item in items], frozenset(opaque), frozenset(hidden)


def add_passes(recorder: SettingsRestorer, scene: Any, view_layer: Any, transmitter: Any) -> None:
    """Position, object, and a light group of the transmitter alone."""
    recorder.set(view_layer, "use_pass_position", True)
    recorder.set(view_layer, "use_pass_object_index", True)
    recorder.set(view_layer, "use_pass_z", False)
    recorder.set(view_layer, "pass_alpha_threshold", 0.0)
    active = view_layer.active_lightgroup_index
    recorder.on_restore(
        "active light group", lambda: setattr(view_layer, "active_lightgroup_index", active)
    )
    add_light_group(recorder, scene, view_layer, LIGHT_GROUP)
    recorder.set(transmitter, "lightgroup", LIGHT_GROUP)


def add_light_group(recorder: SettingsRestorer, scene: Any, view_layer: Any, name: str) -> None:
    """Add a light group; the active one changes as it is taken back."""
    # The operator would have Blender sort all objects of the scene twice. The new camera does once.
    if name not in view_layer.lightgroups:
        view_layer.lightgroups.add(name=name)
    recorder.on_restore("light group", lambda: _remove_light_group(scene, view_layer, name))


def _remove_light_group(scene: Any, view_layer: Any, name: str) -> None:
    names = [group.name for group in view_layer.lightgroups]
    if name in names:
        view_layer.active_lightgroup_index = names.index(name)
        with bpy.context.temp_override(scene=scene, view_layer=view_layer):
            bpy.ops.scene.view_layer_remove_lightgroup()


def add_encoding_world(recorder: SettingsRestorer, scene: Any) -> Any:
    """Add a black world whose volume carries the range encoding; return the volume's node.

    It attenuates red by 1/k and green by 2/k per unit, and blue by 1/k where the scene is coloured.
    """
    world = bpy.data.worlds.new(_WORLD)
    recorder.on_restore(_WORLD, lambda: bpy.data.worlds.remove(world))
    if world.node_tree is None:
        world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputWorld")
    background = tree.nodes.new("ShaderNodeBackground")
    background.inputs["Strength"].default_value = 0.0
    volume = tree.nodes.new("ShaderNodeVolumeAbsorption")
    volume.inputs["Color"].default_value = ENCODING_RED_GREEN
    rate = tree.nodes.new("ShaderNodeAttribute")
    rate.attribute_type, rate.attribute_name = "VIEW_LAYER", attributes.ATTR_WORLD_CODE
    # The Vector output: Fac is the mean of three channels, which rounds.
    split = tree.nodes.new("ShaderNodeSeparateXYZ")
    double = tree.nodes.new("ShaderNodeMath")
    double.operation = "MULTIPLY"
    double.inputs[1].default_value = 2.0
    tree.links.new(rate.outputs["Vector"], split.inputs[0])
    tree.links.new(split.outputs["X"], double.inputs[0])
    tree.links.new(double.outputs[0], volume.inputs["Density"])
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    tree.links.new(volume.outputs[0], output.inputs["Volume"])
    recorder.set(scene, "world", world)
    return volume


def _is_opaque(item: Any, opaque_material: Callable[[Any], bool]) -> bool:
    """Whether an object is known to let nothing through; geometry nodes may set any material."""
    if has_no_faces(item):
        return True
    slots = item.material_slots
    if not slots or any(modifier.type == "NODES" for modifier in item.modifiers):
        return False
    return all(opaque_material(slot.material) for slot in slots)
