# SPDX-License-Identifier: GPL-3.0-or-later
"""Additions to a scene for one path per pixel, each removed by a `SettingsRestorer`.

- `ViewCamera`: a camera that can look at any part of the field of view.
- `number_objects`, `add_passes`, `set_format`: passes for position and object, in EXR files.
- `add_encoding_world`: a world volume that carries the range encoding.
- `ImageLamps`: lamps in the places of the transmitter's images behind mirrors.
- `add_vertex_marks`: surfaces that emit light where paths of one class have their last vertex.
- `EmptyScene`: a scene without objects, from which another one is rendered.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ...arrays import Real
from ..materials import SURFACE_TYPES, has_no_faces, read_surface
from ..nodes import attributes, is_radar_material
from ..nodes.build import TreeBuilder
from ..nodes.groups import KIND_PROPERTY, MATERIAL_KINDS
from ..nodes.radar_material import SURFACE
from ..scene import NEAR_CLIP_UNITS, PATTERN_PROPERTY, reads_context
from ..state import SettingsRestorer
from .requests import Region

_NAME, _SECOND = "radarsim view (temporary)", "radarsim second view (temporary)"
LIGHT_GROUP = "radarsim"
MARK_GROUP = "radarsim_vertices"
_WORLD = "radarsim range encoding (temporary)"
#: Properties of the scene from which materials and transmitter know which paths count.
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
#: Colours of a Volume Absorption of density 2/k: 1 less its absorption of red, green and blue.
ENCODING_RED_GREEN = (0.5, 0.0, 1.0, 1.0)
ENCODING_ALL = (0.5, 0.0, 0.5, 1.0)
_LAMP = "radarsim image (temporary)"
_NOTHING = "radarsim no obstacle (temporary)"
_PREFIX = "Vertex mark: "
_SUM = "with the surface"
#: Reflections and transparent surfaces are whole numbers; they are equal within this.
_SAME = 0.25
#: Number of objects in the file from which the empty scene saves time.
_MANY = 500
_EMPTY_NAME = "radarsim empty (temporary)"


class ViewCamera:
    """A camera with which a scene renders from now on, until `restore`.

    `item` is the camera, at the origin of the world. `second` is a further camera, for
    `SecondView`, because Blender sorts all objects when one is added later.
    """

    def __init__(self, scene: bpy.types.Scene) -> None:
        self._recorder = SettingsRestorer()
        self.item, self.second = self._add(_NAME), self._add(_SECOND)
        try:
            for item in (self.item, self.second):
                scene.collection.objects.link(item)
            self._recorder.set(scene, "camera", self.item)
        except BaseException:
            self.restore()
            raise

    def _add(self, name: str) -> Any:
        data = bpy.data.cameras.new(name)
        self._recorder.on_restore(name, lambda: bpy.data.cameras.remove(data))
        data.clip_start, data.clip_end = NEAR_CLIP_UNITS, 1e12
        item = bpy.data.objects.new(name, data)
        self._recorder.on_restore(name, lambda: bpy.data.objects.remove(item))
        return item

    @property
    def names(self) -> frozenset[str]:
        """Names of the cameras and of their data."""
        return frozenset(n for one in (self.item, self.second) for n in (one.name, one.data.name))

    def number_objects(self) -> None:
        """Number the surfaces of a file that Blender has not evaluated yet.

        If `PathScene` did this later, Blender would evaluate each of them again.
        """
        objects = bpy.data.objects
        before = np.zeros(len(objects), dtype=np.int32)
        objects.foreach_get("pass_index", before)
        numbers = {item: number for number, item in enumerate(numbered_objects(), 1)}
        after = [numbers.get(item, old) for item, old in zip(objects, before.tolist(), strict=True)]
        for item, old in zip(objects, before.tolist(), strict=True):
            self._recorder.on_restore("pass_index", partial(setattr, item, "pass_index", old))
        objects.foreach_set("pass_index", after)

    def restore(self) -> list[str]:
        """Restore the scene's own camera; return what failed. May be called again."""
        return self._recorder.restore()


def set_border(render: Any, region: Region, width_px: int, height_px: int) -> None:
    """Set the border of a render; its pixels have the same bits as in the whole picture."""
    # A quarter of a pixel inside: Blender cuts the product with the width down to a whole number.
    render.border_min_x = (region.left + 0.25) / width_px
    render.border_max_x = min((region.right + 0.25) / width_px, 1.0)
    render.border_min_y = (height_px - region.bottom + 0.25) / height_px
    render.border_max_y = min((height_px - region.top + 0.25) / height_px, 1.0)


def keep_changing(recorder: SettingsRestorer, scene: bpy.types.Scene) -> tuple[str, int]:
    """Record settings that change from render to render; return the user's mode and number of
    threads.
    """
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
    """Make renders write multilayer EXR files that can be read quickly."""
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
    """Give each surface a number that its pixels carry.

    Return the names, and the numbers of the surfaces that let nothing through and of those that are
    not rendered.
    """
    opaque, hidden = set(), set()
    opaque_material = cache(lambda material: read_surface(material).is_opaque)
    items = numbered_objects()
    for number, item in enumerate(items, 1):
        recorder.set(item, "pass_index", number)
        if _is_opaque(item, opaque_material):
            opaque.add(number)
        if item.hide_render:
            hidden.add(number)
    return [item.name_full for item in items], frozenset(opaque), frozenset(hidden)


def add_passes(
    recorder: SettingsRestorer,
    scene: bpy.types.Scene,
    view_layer: bpy.types.ViewLayer,
    transmitter: Any,
) -> None:
    """Add passes for position and object, and a light group of the transmitter alone."""
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


def add_light_group(
    recorder: SettingsRestorer, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, name: str
) -> None:
    """Add a light group. The active light group is restored with it."""
    # The operator would have Blender sort all objects of the scene twice. The new camera does once.
    if name not in view_layer.lightgroups:
        view_layer.lightgroups.add(name=name)
    recorder.on_restore("light group", lambda: _remove_light_group(scene, view_layer, name))


def _remove_light_group(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, name: str) -> None:
    names = [group.name for group in view_layer.lightgroups]
    if name in names:
        view_layer.active_lightgroup_index = names.index(name)
        with bpy.context.temp_override(scene=scene, view_layer=view_layer):
            bpy.ops.scene.view_layer_remove_lightgroup()


def add_encoding_world(recorder: SettingsRestorer, scene: bpy.types.Scene) -> Any:
    """Add a black world whose volume carries the range encoding; return the node of the volume.

    Per unit of length, red decays by 1/k, green by 2/k, and blue by 1/k if the scene is coloured.
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


def _is_opaque(item: bpy.types.Object, opaque_material: Callable[[Any], bool]) -> bool:
    """Return whether an object surely lets nothing through; geometry nodes may set any material."""
    if has_no_faces(item):
        return True
    slots = item.material_slots
    if not slots or any(modifier.type == "NODES" for modifier in item.modifiers):
        return False
    return all(opaque_material(slot.material) for slot in slots)


class ImageLamps:
    """The transmitter of a scene, and lamps in the places of its images. One of them is on.

    An image lamp shares the transmitter's light data. Nothing blocks its light: what lies between a
    surface and a place behind a mirror is no obstacle, and real obstacles are found by rays on the
    meshes. Light linking does this with a blocker collection that holds one empty mesh; an empty
    collection would block everything. Both range encodings stay correct, because the ray goes
    straight to the image.
    """

    def __init__(
        self, recorder: SettingsRestorer, scene: bpy.types.Scene, emitter: bpy.types.Object
    ) -> None:
        self._recorder, self._scene, self._emitter = recorder, scene, emitter
        self._lamps: list[Any] = []
        self._blocker: Any = None
        self._shining = 0

    def place(self, places: Real) -> None:
        """Put a lamp at each place, (n, 3) [Blender units], and turn the transmitter on."""
        while len(self._lamps) < len(places):
            self._add()
        for lamp, place in zip(self._lamps, places, strict=False):
            lamp.matrix_world = Matrix.Translation(place)
        self.shine(0)

    def shine(self, number: int) -> None:
        """Turn on the transmitter, 0, or an image, from 1; all others are off."""
        if number == self._shining:
            return
        self._shining = number
        self._emitter.hide_render = number != 0
        for index, lamp in enumerate(self._lamps, start=1):
            lamp.hide_render = index != number

    def _add(self) -> None:
        if self._blocker is None:
            mesh = bpy.data.meshes.new(_NOTHING)
            self._recorder.on_restore(_NOTHING, lambda: bpy.data.meshes.remove(mesh))
            dummy = bpy.data.objects.new(_NOTHING, mesh)
            self._recorder.on_restore(_NOTHING, lambda: bpy.data.objects.remove(dummy))
            blocker = self._blocker = bpy.data.collections.new(_NOTHING)
            self._recorder.on_restore(_NOTHING, lambda: bpy.data.collections.remove(blocker))
            blocker.objects.link(dummy)
            # Changed from render to render: the recorder leaves equal values alone.
            emitter = self._emitter
            self._recorder.on_restore(
                "transmitter: hidden", lambda: setattr(emitter, "hide_render", False)
            )
        lamp = bpy.data.objects.new(_LAMP, self._emitter.data)
        self._recorder.on_restore(_LAMP, lambda: bpy.data.objects.remove(lamp))
        lamp.hide_render = True
        lamp.lightgroup = LIGHT_GROUP
        lamp.light_linking.blocker_collection = self._blocker
        self._scene.collection.objects.link(lamp)
        self._lamps.append(lamp)


def add_vertex_marks(
    recorder: SettingsRestorer, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer
) -> None:
    """Add the light of `VertexMark` to all Radar Materials, and its light group to their objects.

    Colours of light give the place of the last vertex. Colours of the transmitter would need a
    separate render. The light of the surfaces is a light group, so each render has both. Cycles
    does not sample it like a lamp (emission sampling "NONE"), so no path changes. Cycles must shade
    a surface that emits light where the last ray of a path ends, which runs without marks do not
    need.
    """
    add_light_group(recorder, scene, view_layer, MARK_GROUP)
    for item in numbered_objects():
        recorder.set(item, "lightgroup", MARK_GROUP)
    for tree in bpy.data.node_groups:
        # one that was saved in the middle of a measurement has them already
        if tree.get(KIND_PROPERTY) in MATERIAL_KINDS and _PREFIX + _SUM not in tree.nodes:
            recorder.on_restore(tree.name, partial(_remove_light, tree))
            _add_light(tree)
    for material in bpy.data.materials:
        if is_radar_material(material):
            recorder.set(material.cycles, "emission_sampling", "NONE")


def _add_light(tree: bpy.types.NodeTree) -> None:
    build, end = TreeBuilder(tree), _surface_output(tree)
    math, scene = build.math, build.scene_attribute
    surface = end.links[0].from_socket
    with build.prefixed(_PREFIX):
        path = build.node("ShaderNodeLightPath", "Path so far")
        depth = math("ADD", "depth + 1", path.outputs["Transparent Depth"], 1.0)
        order = path.outputs["Ray Depth"]
        here = math("COMPARE", "order", order, scene(attributes.ATTR_MARK_ORDER), _SAME)
        there = math("COMPARE", "depth", depth, scene(attributes.ATTR_MARK_DEPTH), _SAME)
        gate = math("MULTIPLY", "last vertex", here, there)
        origin = build.scene_vector_attribute(attributes.ATTR_VERTEX_ORIGIN)
        point = build.node("ShaderNodeNewGeometry", "Point").outputs["Position"]
        offset = build.vector_math("SUBTRACT", "from origin", {0: point, 1: origin})
        mapped = build.scale("mapped", offset, scene(attributes.ATTR_MARK_SCALE))
        colour = build.vector_math("ADD", "1 + mapped", {0: mapped, 1: (1.0, 1.0, 1.0)})
        light = build.node("ShaderNodeEmission", "light", {"Color": colour, "Strength": gate})
        both = build.add_shaders(_SUM, surface, light.outputs[0])
    tree.links.new(both, end)


def _remove_light(tree: bpy.types.NodeTree) -> None:
    both = tree.nodes.get(_PREFIX + _SUM)
    if both is not None and both.inputs[0].links:
        tree.links.new(both.inputs[0].links[0].from_socket, _surface_output(tree))
    for node in [node for node in tree.nodes if node.name.startswith(_PREFIX)]:
        tree.nodes.remove(node)


def _surface_output(tree: bpy.types.NodeTree) -> Any:
    """Return the input of a group's output node that is its surface."""
    ends = (node for node in tree.nodes if node.bl_idname == "NodeGroupOutput")
    return next(ends).inputs[SURFACE.name]


class EmptyScene:
    """A scene without objects, which is made when it first saves time.

    An operator that Python calls first evaluates all objects of the context's scene: 10 ms for 1000
    objects, before each render. The render evaluates the objects again and does not use the first
    result.
    """

    def __init__(self, recorder: SettingsRestorer) -> None:
        self._recorder = recorder
        self._scene: Any = None
        self._useful: bool | None = None

    @contextlib.contextmanager
    def entered(self, rendered: Any) -> Iterator[None]:
        """Make the empty scene the context of a `with` block, in which another scene is rendered.

        The context stays the user's if there are few objects, or if scripts may read the active
        scene.
        """
        if self._useful is None:
            self._useful = len(bpy.data.objects) >= _MANY and not reads_context()
        if not self._useful:
            yield
            return
        if self._scene is None:
            scene = self._scene = bpy.data.scenes.new(_EMPTY_NAME)
            self._recorder.on_restore(_EMPTY_NAME, lambda: bpy.data.scenes.remove(scene))
        # the operator takes the whole number of the frame from the context, nothing else
        self._scene.frame_current = rendered.frame_current
        layer = self._scene.view_layers[0]
        with bpy.context.temp_override(scene=self._scene, view_layer=layer):
            yield
