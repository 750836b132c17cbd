# SPDX-License-Identifier: GPL-3.0-or-later
"""Several views of a scene in one render, by Blender's stereo views ("multi-view").

A render of few pixels takes longer to start than to trace: after each change of the camera, Cycles
compiles all shaders again that read attributes of the scene. `JointRender` makes the four
replicates of 64 x 64 pixels in one render, so Cycles compiles once, and they take about half of the
processor time. All views have the same seed. Therefore this is only for rays without random
numbers: one reflection, off surfaces that let nothing through.

Before each render, Cycles also visits all instances of the scene. If there are many, this takes
longer than tracing the rays. `SecondView` adds a second view of the same rays, with other random
numbers and another path class. Its camera is upside down. From this, the transmitter's nodes know
which limits on the number of reflections apply. All other settings are those of the first view.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ..nodes import attributes
from ..nodes.build import TreeBuilder
from ..nodes.groups import ring_emitters
from ..state import SettingsRestorer, latest_snapshot
from .requests import PathClass, RenderRequest, View, ViewWindow
from .view_setup import ViewCamera

#: A part of the field of view, and the offset of its pixels [pixels].
Look = tuple[ViewWindow, tuple[float, float]]

#: Most looks that share a render: Blender keeps the passes of all.
MOST_TOGETHER = 16
_NAME = "radarsim view (temporary)"
_VIEW = "radarsim"
_NODES = "nodes of the transmitter"
_ORDERS = (
    (attributes.ATTR_ORDER_MIN, attributes.ATTR_SECOND_ORDER_MIN),
    (attributes.ATTR_ORDER_MAX, attributes.ATTR_SECOND_ORDER_MAX),
)
_UPSIDE_DOWN = Matrix.Diagonal((-1.0, -1.0, 1.0, 1.0))
_LENS = ("type", "lens", "ortho_scale", "sensor_fit", "sensor_width")
#: Number of instances from which Cycles takes long to visit them before each render.
MANY_INSTANCES = 10_000
#: Distance of places that are the same, relative to the farthest one from the world's origin, and
#: the least fraction of the pixels that see the same.
_SAME_PLACE, _MOST_PIXELS = 1e-4, 0.5


class JointRender:
    """`count` cameras of a scene whose views are made in one render.

    They have the kind and the place of `camera`.
    """

    def __init__(
        self,
        recorder: SettingsRestorer,
        scene: bpy.types.Scene,
        camera: bpy.types.Object,
        count: int,
    ) -> None:
        self._scene, self._camera = scene, camera
        self.cameras: list[Any] = []
        #: Looks of the next joint render, and what came out of the last one, by look.
        self.looks: list[Look] = []
        #: Whether the last render was a joint one.
        self.rendered = False
        self._ready: dict[Look, View] = {}
        self._request: RenderRequest | None = None
        render = scene.render
        recorder.set(render, "views_format", "MULTIVIEW")
        active = render.views.active_index
        recorder.on_restore("active view", lambda: setattr(render.views, "active_index", active))
        for view in render.views:
            recorder.set(view, "use", False)
        for number in range(count):
            self._add(recorder, number)

    def _add(self, recorder: SettingsRestorer, number: int) -> None:
        suffix, views = _suffix(number), self._scene.render.views
        data = self._camera.data.copy()
        data.name = _NAME + suffix
        recorder.on_restore(data.name, lambda: bpy.data.cameras.remove(data))
        item = bpy.data.objects.new(_NAME + suffix, data)
        recorder.on_restore(item.name, lambda: bpy.data.objects.remove(item))
        self._scene.collection.objects.link(item)
        view = views.new(_VIEW + suffix)
        recorder.on_restore(view.name, lambda: views.remove(view))
        view.camera_suffix = view.file_suffix = suffix
        self.cameras.append(item)

    @property
    def names(self) -> list[str]:
        """Names of the views in the render passes, in the order of the cameras."""
        return [_VIEW + _suffix(number) for number in range(len(self.cameras))]

    def plan(self, looks: Sequence[Look]) -> None:
        """Set the looks of the next joint render of the scene as it is; drop earlier views."""
        # Blender finds the cameras by their names, which nothing else may have.
        names = (camera.name for camera in self.cameras)
        found = all(name == _NAME + _suffix(n) for n, name in enumerate(names))
        self.looks = list(looks) if found else []
        self._ready, self.rendered = {}, False

    def begins_at(self, look: Look | None) -> bool:
        """Return whether a joint render may begin at this look: the first planned one."""
        return bool(self.looks) and look == self.looks[0] and not self._ready

    def has(self, look: Look | None, request: RenderRequest) -> bool:
        """Return whether the view of a look is available for a request."""
        return look in self._ready and request == self._request

    def keep(self, views: Sequence[View], request: RenderRequest) -> None:
        """Keep the views of all planned looks."""
        self._ready, self._request = dict(zip(self.looks, views, strict=True)), request
        self.looks, self.rendered = [], False

    def take(self, look: Look | None) -> View:
        """Return the view of a look and drop it."""
        assert look is not None
        return self._ready.pop(look)

    @contextmanager
    def entered(self) -> Iterator[None]:
        """Make the scene render all views during a `with` block, from the place of the camera."""
        own, render = self._camera, self._scene.render
        for item in self.cameras:
            for name in ("location", "rotation_mode", "rotation_euler", "scale"):
                if getattr(item, name) != getattr(own, name):
                    setattr(item, name, getattr(own, name))
        image = render.image_settings
        views_format = image.views_format
        render.use_multiview, self._scene.camera = True, self.cameras[0]
        image.views_format = "MULTIVIEW"
        try:
            yield
            self.rendered = True
        finally:
            image.views_format = views_format
            render.use_multiview, self._scene.camera = False, own


def _suffix(number: int) -> str:
    return f"_{number:05d}"


class SecondView:
    """A second view in all renders from now on.

    `cameras` are those of both views. `may_tell_views` holds for the `transmitter`.
    """

    def __init__(
        self,
        recorder: SettingsRestorer,
        scene: bpy.types.Scene,
        cameras: ViewCamera,
        transmitter: Any,
    ) -> None:
        self._scene, self._view, self._second = scene, cameras.item, cameras.second
        for name in (attributes.ATTR_SECOND_ORDER_MIN, attributes.ATTR_SECOND_ORDER_MAX):
            recorder.set_item(scene, name, 0.0)
        recorder.set_item(scene, attributes.ATTR_FIRST_VIEW_RIGHT, [0.0, 0.0, 0.0])
        _give_second_limits(recorder, _emitter_node(transmitter.data))
        _use_views(recorder, scene, (self._view, self._second))

    @property
    def suffixes(self) -> tuple[str, str]:
        """Suffixes of the file names of both views."""
        return self._view.name, self._second.name

    def begin(self, path_class: PathClass) -> None:
        """Aim where the first view aims; the transmitter lights paths of these orders."""
        item, first, scene = self._second, self._view.data, self._scene
        for name in _LENS:
            setattr(item.data, name, getattr(first, name))
        item.data.shift_x, item.data.shift_y = -first.shift_x, -first.shift_y
        pose = self._view.matrix_basis
        item.matrix_world = pose @ _UPSIDE_DOWN
        scene[attributes.ATTR_FIRST_VIEW_RIGHT] = list(pose.col[0][:3])
        scene[attributes.ATTR_SECOND_ORDER_MIN] = path_class.order_min - 0.5
        scene[attributes.ATTR_SECOND_ORDER_MAX] = (
            0.0 if path_class.order_max is None else path_class.order_max + 0.5
        )


def second_light(first: View, second: View) -> View | None:
    """Return the light of the second view, turned to the first view's orientation.

    None if both views do not see the same places: then the transmitter's nodes have taken the
    second view for the first one.
    """
    if first.position is None or second.position is None:
        return None
    here, there = first.position, second.position[::-1, ::-1]
    apart = np.linalg.norm(here - there, axis=-1)
    seen = np.isfinite(here).all(axis=-1)
    # At edges, one of the two views may see what lies behind.
    same = apart[seen] <= _SAME_PLACE * np.abs(here[seen]).max(initial=0.0)
    return second.turned() if same.sum() > _MOST_PIXELS * same.size else None


def is_worth_it(view_layer: bpy.types.ViewLayer, rays: int) -> bool:
    """Return whether Cycles takes longer to visit the instances than to trace so many rays."""
    return latest_snapshot(view_layer).layout.shape.size >= max(rays, MANY_INSTANCES)


def may_tell_views(transmitter: Any) -> bool:
    """Return whether the transmitter's nodes are radarsim's own and can be replaced."""
    light = transmitter.data
    if light.library is not None or light.override_library is not None:
        return False
    node = _emitter_node(light)
    if node is None or node.mute:
        return False
    found = [_readers(node.node_tree, first) for first, _ in _ORDERS]
    return all(readers and all(n.type == "SEPXYZ" for n in readers) for readers in found)


def _readers(tree: bpy.types.NodeTree, attribute: str) -> list[Any]:
    """Return the nodes that are linked to an attribute of the scene."""
    nodes = (n for n in tree.nodes if n.type == "ATTRIBUTE" and n.attribute_name == attribute)
    return [link.to_node for node in nodes for link in node.outputs["Vector"].links]


def _emitter_node(light: Any) -> Any:
    """Return the only Ring Emitter among a light's nodes; None if there is none, or several."""
    found = ring_emitters(light)
    return found[0] if len(found) == 1 else None


def _use_views(
    recorder: SettingsRestorer, scene: bpy.types.Scene, cameras: tuple[Any, Any]
) -> None:
    """Make Blender render both cameras, each into its own file."""
    render = scene.render
    for view in render.views[2:]:  # the first two cannot be removed
        recorder.set(view, "use", False)
    for view, camera in zip(render.views, cameras, strict=False):
        recorder.set(view, "use", True)
        # Blender replaces one suffix in the name of the scene's camera by another: here the whole
        # name. In Blender 5.2 the suffix of the file is the same setting.
        recorder.set(view, "camera_suffix", camera.name)
        recorder.set(view, "file_suffix", camera.name)
    recorder.set(render, "views_format", "MULTIVIEW")
    recorder.set(render, "use_multiview", True)
    recorder.set(render.image_settings, "views_format", "INDIVIDUAL")


def _give_second_limits(recorder: SettingsRestorer, node: bpy.types.Node) -> None:
    """Replace the nodes of the transmitter by a copy that has limits for the second view, too."""
    before = node.node_tree
    tree = before.copy()
    recorder.on_restore(_NODES, lambda: bpy.data.node_groups.remove(tree))
    build = TreeBuilder(tree)
    right = build.scene_vector_attribute(attributes.ATTR_FIRST_VIEW_RIGHT)
    seen = build.node(
        "ShaderNodeVectorTransform",
        "Right in the view",
        {0: right},
        vector_type="VECTOR",
        convert_from="WORLD",
        convert_to="CAMERA",
    ).outputs[0]
    across = build.node("ShaderNodeSeparateXYZ", "Across", {0: seen}).outputs["X"]
    upside_down = build.math("LESS_THAN", "Second view", across, -0.5)
    for first, second in _ORDERS:
        for node_of_limit in _readers(tree, first):
            value = node_of_limit.outputs["X"]
            readers = [link.to_socket for link in value.links]
            limit = build.select(second, upside_down, value, build.scene_attribute(second))
            for reader in readers:
                tree.links.new(limit, reader)
    node.node_tree = tree
    recorder.on_restore(_NODES, lambda: setattr(node, "node_tree", before))
