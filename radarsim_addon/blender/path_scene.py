# SPDX-License-Identifier: GPL-3.0-or-later
"""Puts a scene into the state for one path per pixel, and makes the renders of that state.

On top of the measuring settings of the rings: a camera of our own that can look at any part of
the field of view, one sample through the pixel centre, passes for position and object, and, where
the materials do not carry the range code, a world volume that does.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .. import contract
from ..errors import RenderError
from .isolation import SURFACE_TYPES
from .nodes.materials import lets_nothing_through
from .pass_files import read_passes
from .path_cameras import aim, camera_kind
from .path_gates import Gate, Region, RenderRequest, View
from .path_tiles import ViewWindow
from .pattern_mesh import PATTERN_PROPERTY
from .poses import rigid_pose
from .recorder import Recorder
from .render_settings import NEAR_CLIP_UNITS

_LIGHT_GROUP = "radarsim"
_WORLD = "radarsim range code (temporary)"
_CAMERA = "radarsim view (temporary)"

#: Colours of a Volume Absorption of density 2/k: what it spares of red, green and blue.
_CODE_RED_GREEN = (0.5, 0.0, 1.0, 1.0)
_CODE_ALL = (0.5, 0.0, 0.5, 1.0)
_BOUNCES = ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces")
#: Renders of fewer pixels than this get one thread: more of them wait for one another longer than
#: they save, in twice the processor time.
_ONE_THREAD_BELOW_PX = 1 << 13
#: Least width and height that Blender renders.
_LEAST_PX = 4
_BORDER = (
    "use_border",
    "use_crop_to_border",
    "border_min_x",
    "border_max_x",
    "border_min_y",
    "border_max_y",
)


class PathScene:
    """The scene while paths are measured; :meth:`restore` gives it back.

    Parameters
    ----------
    scene, view_layer : bpy types
    camera, emitter : bpy.types.Object
    metres_per_unit
    code_length_m
        k.
    world_code
        The code is carried by a world volume instead of by Radar Materials.
    """

    def __init__(
        self,
        scene: Any,
        view_layer: Any,
        camera: Any,
        emitter: Any,
        metres_per_unit: float,
        code_length_m: float,
        world_code: bool,
    ) -> None:
        self._scene, self._view_layer = scene, view_layer
        self._camera, self._emitter = camera, emitter
        self._units = metres_per_unit
        self._inverse_k = metres_per_unit / code_length_m
        self._world_code = world_code
        self._recorder = Recorder()
        self._folder = Path(tempfile.mkdtemp(prefix="radarsim_"))
        self._recorder.on_restore(
            "temporary files", lambda: shutil.rmtree(self._folder, ignore_errors=True)
        )
        self._view: Any = None
        self.kind = camera_kind(camera.data)
        self._volume: Any = None
        self._size = self._canvas = (0, 0)
        self._threads = ("AUTO", 0)
        self._coarse = 1
        self._request = RenderRequest(Gate())
        self.objects: list[str] = []
        self.opaque: frozenset[int] = frozenset()
        self.hidden: frozenset[int] = frozenset()
        self.renders = 0

    def apply(self) -> None:
        """Set everything; on failure what was set is restored before the error goes on."""
        try:
            self._keep_changing()
            self._add_camera()
            self._set_format()
            self._set_passes()
            self._number_objects()
            for name in (
                contract.ATTR_ORDER_MIN,
                contract.ATTR_ORDER_MAX,
                contract.ATTR_DEPTH_MIN,
                contract.ATTR_DEPTH_MAX,
                contract.ATTR_SURFACE_DEPTH,
                contract.ATTR_SURFACE_STOP,
                contract.ATTR_VERTEX_SCALE,
                contract.ATTR_WORLD_CODE,
            ):
                self._recorder.set_item(self._scene, name, 0.0)
            self._recorder.set_item(self._scene, contract.ATTR_VERTEX_ORIGIN, [0.0, 0.0, 0.0])
            if self._world_code:
                self._add_world()
        except BaseException:
            self.restore()
            raise

    def restore(self) -> list[str]:
        """Give the user's scene back; may be called again."""
        return self._recorder.restore()

    # -- antennas at the scene's present time ------------------------------------------------------

    def place(self, depsgraph: Any) -> None:
        """Put our camera where the receiver is at the depsgraph's time."""
        self._view.matrix_world = self._camera.evaluated_get(depsgraph).matrix_world.normalized()
        # The pose is kept as location and angles: what comes back differs by float32 rounding, and
        # is what Cycles renders with.
        self._view_layer.update()

    def look(
        self, window: ViewWindow, shift_px: tuple[float, float], seed: int
    ) -> contract.CameraRecord:
        """Aim at a part of the field of view, moved by a fraction of a pixel; returns what it sees.

        The record is computed from the float32 numbers that Blender really holds. Each view has a
        seed of its own: with a common one the views would draw the same lots, pixel by pixel, and
        shifts would be no replicates of one another.
        """
        data = self._view.data
        self._scene.cycles.seed = seed
        pixel_u = (window.right - window.left) / window.width_px
        pixel_v = (window.top - window.bottom) / window.height_px
        self._size = (window.width_px, window.height_px)
        # A smaller view is the upper left corner of what Blender can render.
        across, down = (max(count, _LEAST_PX) for count in self._size)
        self._canvas = (across, down)
        left = window.left + shift_px[0] * pixel_u
        top = window.top + shift_px[1] * pixel_v
        wanted = (left, left + across * pixel_u, top - down * pixel_v, top)
        left, right, bottom, top = aim(data, self.kind, wanted, across, down, self._units)
        return contract.CameraRecord(
            kind=self.kind,
            matrix_world=rigid_pose(self._view.matrix_world, self._units).tolist(),
            left=left,
            right=left + (right - left) * window.width_px / across,
            bottom=top - (top - bottom) * window.height_px / down,
            top=top,
            near_clip_m=NEAR_CLIP_UNITS * self._units,
        )

    # -- one render --------------------------------------------------------------------------------

    def begin(self, request: RenderRequest, vertex: tuple[np.ndarray, float] | None) -> None:
        """Set the gates for a render.

        Parameters
        ----------
        request
            What is asked for.
        vertex
            Origin and scale for the last vertex, Blender units.
        """
        scene, gate = self._scene, request.gate
        self._request = request
        self._set_frame(request.region, request.coarse)
        scene[contract.ATTR_ORDER_MIN] = gate.order_min - 0.5
        scene[contract.ATTR_ORDER_MAX] = 0.0 if gate.order_max is None else gate.order_max + 0.5
        scene[contract.ATTR_DEPTH_MIN] = gate.depth_min + 0.5
        scene[contract.ATTR_DEPTH_MAX] = 0.0 if gate.depth_max is None else gate.depth_max + 1.5
        self._set_surfaces(gate)
        if gate.order_max is not None:
            for name in _BOUNCES:  # nothing beyond the gate is worth its time
                setattr(scene.cycles, name, gate.order_max - 1)
        scene[contract.ATTR_VERTEX_SCALE] = 0.0
        if request.vertex and vertex is not None:
            scene[contract.ATTR_VERTEX_ORIGIN] = [float(value) for value in vertex[0]]
            scene[contract.ATTR_VERTEX_SCALE] = float(vertex[1])
        inverse_k = self._inverse_k if request.coded else 0.0
        if self._world_code:
            self._set_channels(request)
            scene[contract.ATTR_INVERSE_CODE_LENGTH] = 0.0
            scene[contract.ATTR_WORLD_CODE] = inverse_k
        else:
            scene[contract.ATTR_INVERSE_CODE_LENGTH] = inverse_k
        scene.render.filepath = str(self._folder / "view")

    def _set_channels(self, request: RenderRequest) -> None:
        """Which channels the world's volume attenuates; renders without code do not ask."""
        if not request.coded:
            return
        colour = _CODE_ALL if request.all_channels else _CODE_RED_GREEN
        socket = self._volume.inputs["Color"]
        if tuple(socket.default_value) != colour:  # the world's shader is compiled anew
            socket.default_value = colour

    def _set_frame(self, region: Region | None, coarse: int) -> None:
        """Resolution, and the border that leaves out pixels that hold nothing."""
        render, (width, height) = self._scene.render, self._canvas
        self._coarse = coarse if min(self._size) >= _LEAST_PX * coarse else 1
        if self._coarse > 1:
            width, height = -(-width // coarse), -(-height // coarse)
        elif region is None and self._canvas != self._size:
            region = Region(0, self._size[0], 0, self._size[1])
        render.resolution_x, render.resolution_y = width, height
        mode, threads = self._threads
        if width * height < _ONE_THREAD_BELOW_PX:
            mode, threads = "FIXED", 1
        if (render.threads_mode, render.threads) != (mode, threads):
            render.threads_mode = mode
            if mode == "FIXED":
                render.threads = threads
        render.use_border = render.use_crop_to_border = region is not None
        if region is not None:
            # A quarter of a pixel inside: Blender cuts the product with the width down to a whole
            # number. Pixels of the crop are bit by bit those of the whole frame.
            render.border_min_x = (region.left + 0.25) / width
            render.border_max_x = min((region.right + 0.25) / width, 1.0)
            render.border_min_y = (height - region.bottom + 0.25) / height
            render.border_max_y = min((height - region.top + 0.25) / height, 1.0)

    def _set_surfaces(self, gate: Gate) -> None:
        scene = self._scene
        certain = gate.surface_depth is not None
        scene[contract.ATTR_SURFACE_DEPTH] = (gate.surface_depth or 0) + 0.5 if certain else 0.0
        # The gate itself ends camera rays; a tail (no upper limit) lets them go on.
        stop = certain and gate.depth_max is not None
        scene[contract.ATTR_SURFACE_STOP] = (gate.surface_depth or 0) + 0.5 if stop else 0.0
        # Cycles is told by this of the custom properties, too: writing those from Python tells it
        # nothing, and an update tag of the whole scene would take several times as long.
        # With rays that end at the gate, position and object are those of the gate's surface.
        self._view_layer.pass_alpha_threshold = 1.0 if stop else 0.0

    def render(self) -> None:
        """Render and write the passes (not for use in the UI).

        Raises
        ------
        RenderError
            Cycles failed.
        """
        try:
            result = bpy.ops.render.render(write_still=True, scene=self._scene.name)
        except RuntimeError as error:
            raise RenderError(
                f"Cycles failed: {str(error).strip()} "
                "Render an ordinary image of this scene with Cycles to see whether that works."
            ) from error
        if "FINISHED" not in result:
            raise RenderError("The render was cancelled. Start it again.")

    def end(self) -> View:
        """Read what was rendered."""
        self.renders += 1
        combined = f"Combined_{_LIGHT_GROUP}"
        path = self._folder / "view.exr"
        # Multi-part files name the same pass "Object Index" or "IndexOB" by version.
        passes = read_passes(path, (combined, "Position", "Object Index", "IndexOB"))
        if combined not in passes:
            raise RenderError(
                f"The render has no pass {combined}; found {', '.join(passes) or 'none'}."
            )
        position = None
        if "Position" in passes:
            found = passes["Position"]
            position = np.stack([self._whole(found[axis]) for axis in "XYZ"], axis=-1)
        index = passes.get("Object Index") or passes.get("IndexOB")
        number = None
        if index is not None:
            number = np.rint(self._whole(next(iter(index.values())))).astype(np.int32)
            if position is not None:
                position[number == 0] = np.nan  # nothing was hit
        red, green, blue = (self._whole(passes[combined][name]) for name in "RGB")
        return View(
            red,
            green,
            blue,
            position=position,
            object_index=number,
            coarse=self._coarse,
        )

    def _whole(self, plane: np.ndarray) -> np.ndarray:
        """A channel over the whole view: 0 outside the region, coarse pixels repeated."""
        (width, height), region = self._size, self._request.region
        if self._coarse > 1:
            rows = np.arange(height) * plane.shape[0] // height
            plane = plane[rows][:, np.arange(width) * plane.shape[1] // width]
        expected = (height, width)
        if region is not None:
            expected = (region.bottom - region.top, region.right - region.left)
        if plane.shape != expected:
            raise RenderError(
                f"The render has {plane.shape[1]} x {plane.shape[0]} pixels; expected "
                f"{expected[1]} x {expected[0]}. Report this with the scene's render settings."
            )
        if region is None:
            return plane.astype(np.float64)
        whole = np.zeros((height, width))
        whole[region.top : region.bottom, region.left : region.right] = plane
        return whole

    # -- setting up --------------------------------------------------------------------------------

    def _keep_changing(self) -> None:
        """Remember what changes from render to render."""
        render = self._scene.render
        mode = render.threads_mode
        render.threads_mode = "FIXED"  # else `threads` is that of the machine
        self._threads = (mode, render.threads)
        kept = (
            (self._scene.cycles, ("seed", *_BOUNCES)),
            (render, ("resolution_x", "resolution_y", *_BORDER, "threads")),
        )
        before = [(owner, name, getattr(owner, name)) for owner, names in kept for name in names]

        def undo() -> None:
            render.threads_mode = "FIXED"
            for owner, name, value in before:
                setattr(owner, name, value)
            render.threads_mode = mode

        # The recorder's own `set` leaves equal values alone, and so would not put these back.
        self._recorder.on_restore("seed, bounces and frame", undo)

    def _add_camera(self) -> None:
        data = bpy.data.cameras.new(_CAMERA)
        self._recorder.on_restore(_CAMERA, lambda: bpy.data.cameras.remove(data))
        data.clip_start, data.clip_end = NEAR_CLIP_UNITS, 1e12
        view = bpy.data.objects.new(_CAMERA, data)
        self._recorder.on_restore(_CAMERA, lambda: bpy.data.objects.remove(view))
        self._scene.collection.objects.link(view)
        self._recorder.set(self._scene, "camera", view)
        self._view = view

    def _set_format(self) -> None:
        # The measuring settings remember the user's format; ours replaces theirs within it.
        image, put = self._scene.render.image_settings, self._recorder.set
        if hasattr(image, "media_type"):
            put(image, "media_type", "MULTI_LAYER_IMAGE")
        put(image, "file_format", "OPEN_EXR_MULTILAYER")
        image.color_depth = "32"
        put(image, "exr_codec", "NONE")  # read back at once: packing would only cost time
        put(self._scene.render, "filepath", str(self._folder / "view"))
        put(self._scene.render, "use_file_extension", True)

    def _set_passes(self) -> None:
        put, layer = self._recorder.set, self._view_layer
        put(layer, "use_pass_position", True)
        put(layer, "use_pass_object_index", True)
        put(layer, "pass_alpha_threshold", 0.0)
        active = layer.active_lightgroup_index
        self._recorder.on_restore(
            "active light group", lambda: setattr(layer, "active_lightgroup_index", active)
        )
        with bpy.context.temp_override(scene=self._scene, view_layer=layer):
            bpy.ops.scene.view_layer_add_lightgroup(name=_LIGHT_GROUP)
        self._recorder.on_restore("light group", self._remove_lightgroup)
        put(self._emitter, "lightgroup", _LIGHT_GROUP)

    def _remove_lightgroup(self) -> None:
        layer = self._view_layer
        names = [group.name for group in layer.lightgroups]
        if _LIGHT_GROUP in names:
            layer.active_lightgroup_index = names.index(_LIGHT_GROUP)
            with bpy.context.temp_override(scene=self._scene, view_layer=layer):
                bpy.ops.scene.view_layer_remove_lightgroup()

    def _number_objects(self) -> None:
        """Object n of the list `objects` gets pass index n, from 1."""
        self.objects = []
        opaque, hidden = set(), set()
        for item in sorted(bpy.data.objects, key=lambda o: (o.library is not None, o.name)):
            if item.type in SURFACE_TYPES and PATTERN_PROPERTY not in item:
                self.objects.append(item.name)
                self._recorder.set(item, "pass_index", len(self.objects))
                if _is_opaque(item):
                    opaque.add(len(self.objects))
                if item.hide_render:
                    hidden.add(len(self.objects))
        self.opaque, self.hidden = frozenset(opaque), frozenset(hidden)

    def _add_world(self) -> None:
        """Black world with a volume that attenuates red by 1/k and green by 2/k per unit, and blue
        by 1/k where the scene is coloured."""
        world = bpy.data.worlds.new(_WORLD)
        self._recorder.on_restore(_WORLD, lambda: bpy.data.worlds.remove(world))
        if world.node_tree is None:
            world.use_nodes = True
        tree = world.node_tree
        tree.nodes.clear()
        output = tree.nodes.new("ShaderNodeOutputWorld")
        background = tree.nodes.new("ShaderNodeBackground")
        background.inputs["Strength"].default_value = 0.0
        volume = tree.nodes.new("ShaderNodeVolumeAbsorption")
        volume.inputs["Color"].default_value = _CODE_RED_GREEN
        self._volume = volume
        rate = tree.nodes.new("ShaderNodeAttribute")
        rate.attribute_type, rate.attribute_name = "VIEW_LAYER", contract.ATTR_WORLD_CODE
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
        self._recorder.set(self._scene, "world", world)


def _is_opaque(item: Any) -> bool:
    """Whether an object is known to let nothing through; geometry nodes may set any material."""
    slots = item.material_slots
    if not slots or any(modifier.type == "NODES" for modifier in item.modifiers):
        return False
    return all(lets_nothing_through(slot.material) for slot in slots)
