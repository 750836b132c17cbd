# SPDX-License-Identifier: GPL-3.0-or-later
"""Sets a scene for renders with one path per pixel, and makes these renders.

In addition to the settings of ring sampling, the scene gets a camera that can look at any part of
the field of view, one sample through the pixel centre, and render passes for position and object.
If the materials do not carry the range encoding, a world volume does.

`PathScene.begin` sets the path class of a `RenderRequest`, `render` writes a multilayer EXR file,
and `end` reads the `View` from it (`read_views`). Up to Blender 4.5 such a file has one part, from
5.0 on one part for each pass. Channels are named ``Layer.Pass.Component`` in both, or
``Layer.Pass.View.Component``.
"""

from __future__ import annotations

import contextlib
import dataclasses
import shutil
from collections.abc import Collection, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ... import contract
from ...arrays import Single
from ...errors import RenderError
from ...processes import temporary_folder
from ...signal.runs import exr_backend
from ..nodes import attributes
from ..scene import NEAR_CLIP_UNITS, aim, camera_kind, rigid_pose
from ..state import SettingsRestorer, Snapshot
from .joint_render import (
    MOST_TOGETHER,
    JointRender,
    Look,
    SecondView,
    is_worth_it,
    may_tell_views,
    second_light,
)
from .requests import PathClass, Region, RenderRequest, View, ViewWindow
from .view_setup import (
    BOUNCES,
    ENCODING_ALL,
    ENCODING_RED_GREEN,
    LIGHT_GROUP,
    MARK_GROUP,
    PATH_GATES,
    EmptyScene,
    ImageLamps,
    ViewCamera,
    add_encoding_world,
    add_passes,
    add_vertex_marks,
    keep_changing,
    number_objects,
    set_border,
    set_format,
)

#: Renders of fewer pixels than this get one thread: more of them wait for one another longer than
#: they save, in twice the processor time.
_ONE_THREAD_BELOW_PX = 1 << 13
#: Small renders in a row after which they get one thread. With another number of threads Cycles
#: takes over the whole scene again: 0.25 s for 1e5 instances.
_FEW_RENDERS = 8
#: Least width and height that Blender renders.
_LEAST_PX = 4


class PathScene:
    """A scene that is set for the measurement of paths, until `restore`.

    `range_encoding_length_m` is k. With `world_encoding` a world volume carries the range encoding
    instead of Radar Materials. `view` is the camera that renders, if the scene has it already; its
    maker removes it. With `vertex_marks`, requests may mark last vertices: all surfaces have Radar
    Materials or absorb.
    """

    def __init__(
        self,
        scene: bpy.types.Scene,
        view_layer: bpy.types.ViewLayer,
        camera: bpy.types.Object,
        transmitter: Any,
        metres_per_unit: float,
        range_encoding_length_m: float,
        world_encoding: bool,
        view: ViewCamera | None = None,
        vertex_marks: bool = False,
    ) -> None:
        self._scene, self._view_layer = scene, view_layer
        self._camera, self._emitter = camera, transmitter
        self._units = metres_per_unit
        self._inverse_k = metres_per_unit / range_encoding_length_m
        self._world_encoding = world_encoding
        self.vertex_marks = vertex_marks
        self._recorder = SettingsRestorer()
        self._folder = temporary_folder()
        self._recorder.on_restore("temporary files", self.remove_files)
        self._own_camera: ViewCamera | None = None
        self._second: SecondView | None = None
        self._views_chosen = False
        self._cameras = view
        self.kind = camera_kind(camera.data)
        self._volume: Any = None
        self._world_colour = ENCODING_RED_GREEN
        self._size = self._canvas = (0, 0)
        self._threads = ("AUTO", 0)
        self._small_in_a_row = 0
        self._request = RenderRequest(PathClass())
        self._aside = EmptyScene(self._recorder)
        self.lamps = ImageLamps(self._recorder, scene, transmitter)
        self._joint: JointRender | None = None
        self._look: Look | None = None
        self.objects: list[str] = []
        self.opaque: frozenset[int] = frozenset()
        self.hidden: frozenset[int] = frozenset()
        self.renders = 0

    def apply(self) -> None:
        """Set everything; on failure restore all settings, then raise the error."""
        try:
            self._threads = keep_changing(self._recorder, self._scene)
            if self._cameras is None:
                self._cameras = self._own_camera = ViewCamera(self._scene)
            self._view = self._cameras.item
            set_format(self._recorder, self._scene.render, self._folder / "view")
            self.objects, self.opaque, self.hidden = number_objects(self._recorder)
            add_passes(self._recorder, self._scene, self._view_layer, self._emitter)
            for name in PATH_GATES:
                self._recorder.set_item(self._scene, name, 0.0)
            self._recorder.set_item(self._scene, attributes.ATTR_VERTEX_ORIGIN, [0.0, 0.0, 0.0])
            if self.vertex_marks:
                add_vertex_marks(self._recorder, self._scene, self._view_layer)
            if self._world_encoding:
                self._volume = add_encoding_world(self._recorder, self._scene)
        except BaseException:
            self.restore()
            raise

    @property
    def all_opaque(self) -> bool:
        """Whether no rendered surface lets rays through."""
        return len(self.opaque | self.hidden) == len(self.objects)

    @property
    def own_names(self) -> frozenset[str]:
        """Names of the data that change from render to render: the camera and its data."""
        names = frozenset() if self._cameras is None else self._cameras.names
        looking = () if self._joint is None else self._joint.cameras
        return names.union(one.name for camera in looking for one in (camera, camera.data))

    def choose_views(self, rays: int) -> None:
        """Make renders with two views of so many rays each, if that is faster. Decided once."""
        if self._views_chosen or self._cameras is None:
            return
        self._views_chosen = True
        if self._joint is not None:  # its looks share renders already
            return
        fits = self.kind != "equirectangular" and may_tell_views(self._emitter)
        if fits and is_worth_it(self._view_layer, rays):
            self._second = SecondView(self._recorder, self._scene, self._cameras, self._emitter)

    @property
    def has_second_view(self) -> bool:
        """Whether the next render can make a second view."""
        return self._second is not None and self._canvas == self._size

    def restore(self) -> list[str]:
        """Restore the user's scene. May be called again."""
        unrestored = self._recorder.restore()
        return unrestored + (self._own_camera.restore() if self._own_camera else [])

    def remove_files(self) -> None:
        shutil.rmtree(self._folder, ignore_errors=True)

    def place(self, snapshot: Snapshot) -> list[list[float]]:
        """Move the camera to the receiver's place at the moment of a snapshot; return its pose in
        metres.

        Rays belong to this pose. The receiver's own pose is rounded differently, which matters at
        poles.
        """
        self._view.matrix_world = snapshot.evaluated(self._camera).matrix_world.normalized()
        if self._joint is not None:
            self._joint.plan([])
        return self._pose()

    def _pose(self) -> list[list[float]]:
        # The pose is kept as location and angles: what comes back differs by float32 rounding, and
        # is what Cycles renders with. It is the pose in the world, as the camera has no parent.
        pose: list[list[float]] = rigid_pose(self._view.matrix_basis, self._units).tolist()
        return pose

    def look(
        self, window: ViewWindow, offset_px: tuple[float, float], seed: int
    ) -> contract.ReceiverRecord:
        """Aim at a part of the field of view, offset by a fraction of a pixel; return the receiver
        record.

        The record is computed from the float32 numbers that Blender holds. Each view has its own
        seed: with a common one, Cycles would use the same random numbers in all views, and they
        would not be independent replicates.
        """
        self._look = window, offset_px
        self._scene.cycles.seed = seed
        self._size = (window.width_px, window.height_px)
        # A smaller view is the upper left corner of what Blender can render.
        across, down = (max(count, _LEAST_PX) for count in self._size)
        self._canvas = (across, down)
        left, right, bottom, top = self._aim(self._view.data, self._look)
        return contract.ReceiverRecord(
            kind=self.kind,
            matrix_world=self._pose(),
            left=left,
            right=left + (right - left) * window.width_px / across,
            bottom=top - (top - bottom) * window.height_px / down,
            top=top,
            near_clip_m=NEAR_CLIP_UNITS * self._units,
        )

    def _aim(self, data: Any, look: Look) -> tuple[float, float, float, float]:
        """Aim a camera; return the edges of its view after rounding."""
        window, offset_px = look
        edges = window.edges_of(offset_px, *self._canvas)
        return aim(data, self.kind, edges, *self._canvas, self._units)

    def join_looks(self, count: int) -> None:
        """Make `count` looks share a render if their paths, of one reflection, need no random
        numbers.

        In a window, Blender makes the renders itself, one by one.
        """
        certain = self.all_opaque and not self._world_encoding
        if bpy.app.background and certain and 1 < count <= MOST_TOGETHER:
            self._joint = JointRender(self._recorder, self._scene, self._view, count)

    def look_together(self, window: ViewWindow, offsets_px: Sequence[tuple[float, float]]) -> None:
        """Announce the next calls of `look`, in order, for the same first request."""
        small = window.width_px * window.height_px < _ONE_THREAD_BELOW_PX
        fits = small and min(window.width_px, window.height_px) >= _LEAST_PX
        if self._joint is not None and fits:
            self._joint.plan([(window, offset_px) for offset_px in offsets_px])

    def begin(self, request: RenderRequest, vertex: tuple[np.ndarray, float] | None) -> None:
        """Set the path class of a render.

        `vertex` has origin and scale for the colours of the last vertex, in Blender units.
        """
        scene, path_class = self._scene, request.path_class
        self._request = request
        self._set_frame(request.region)
        order, depth = path_class.order_max, path_class.depth_max
        scene[attributes.ATTR_ORDER_MIN] = path_class.order_min - 0.5
        scene[attributes.ATTR_ORDER_MAX] = 0.0 if order is None else order + 0.5
        scene[attributes.ATTR_DEPTH_MIN] = path_class.depth_min + 0.5
        scene[attributes.ATTR_DEPTH_MAX] = 0.0 if depth is None else depth + 1.5
        self._set_surfaces(path_class)
        if self._second is not None:
            scene.render.use_multiview = request.beyond is not None
            if request.beyond is not None:
                self._second.begin(request.beyond)
        classes = [one for one in (path_class, request.beyond) if one is not None]
        highest = [one.order_max for one in classes if one.order_max is not None]
        if len(highest) == len(classes):
            for name in BOUNCES:  # nothing beyond the path class is worth its time
                setattr(scene.cycles, name, max(highest) - 1)
        self._set_vertex_colours(request, vertex)
        scene[attributes.ATTR_BY_POLARISATION] = float(request.by_polarisation)
        inverse_k = self._inverse_k if request.encoded else 0.0
        if self._world_encoding:
            if request.encoded:
                colour = ENCODING_ALL if request.all_channels else ENCODING_RED_GREEN
                if self._world_colour != colour:  # Blender compiles the shader again
                    self._volume.inputs["Color"].default_value = self._world_colour = colour
            scene[attributes.ATTR_INVERSE_CODE_LENGTH] = 0.0
            scene[attributes.ATTR_WORLD_CODE] = inverse_k
        else:
            scene[attributes.ATTR_INVERSE_CODE_LENGTH] = inverse_k
        scene.render.filepath = str(self._folder / "view")

    def _set_vertex_colours(
        self, request: RenderRequest, vertex: tuple[np.ndarray, float] | None
    ) -> None:
        """Set the colours by the last vertex, of the transmitter and of marked surfaces."""
        scene, mark = self._scene, request.mark
        scale = 0.0
        if vertex is not None:
            scene[attributes.ATTR_VERTEX_ORIGIN] = [float(value) for value in vertex[0]]
            scale = float(vertex[1])
        scene[attributes.ATTR_VERTEX_SCALE] = scale if request.vertex else 0.0
        scene[attributes.ATTR_MARK_ORDER] = 0.0 if mark is None else mark.order - 1.0
        scene[attributes.ATTR_MARK_DEPTH] = 0.0 if mark is None else mark.depth + 1.0
        scene[attributes.ATTR_MARK_SCALE] = scale if mark is not None and mark.place else 0.0

    def _set_frame(self, region: Region | None) -> None:
        """Set the resolution, and the border around the pixels that can hold a path."""
        render, (width, height) = self._scene.render, self._canvas
        if region is None and self._canvas != self._size:
            region = Region(0, self._size[0], 0, self._size[1])
        render.resolution_x, render.resolution_y = width, height
        self._choose_threads(width * height < _ONE_THREAD_BELOW_PX)
        render.use_border = render.use_crop_to_border = region is not None
        if region is not None:
            set_border(render, region, width, height)

    def _choose_threads(self, small: bool) -> None:
        """Use one thread for small renders, unless only a few of them come between large ones."""
        render = self._scene.render
        self._small_in_a_row = self._small_in_a_row + 1 if small else 0
        if small and self.renders > 0 and self._small_in_a_row <= _FEW_RENDERS:
            return
        mode, threads = ("FIXED", 1) if small else self._threads
        if (render.threads_mode, render.threads) != (mode, threads):
            render.threads_mode = mode
            if mode == "FIXED":
                render.threads = threads

    def _set_surfaces(self, path_class: PathClass) -> None:
        scene, surface_depth = self._scene, path_class.surface_depth
        passed = 0.0 if surface_depth is None else surface_depth + 0.5
        scene[attributes.ATTR_SURFACE_DEPTH] = passed
        # The path class itself ends camera rays; without an upper limit they continue.
        stop = surface_depth is not None and path_class.depth_max is not None
        scene[attributes.ATTR_SURFACE_STOP] = passed if stop else 0.0
        # Cycles is told by this of the custom properties, too: writing those from Python tells it
        # nothing, and an update tag of the whole scene would take several times as long. With rays
        # that end at the path class, position and object are those of the path class's surface.
        self._view_layer.pass_alpha_threshold = 1.0 if stop else 0.0

    def render(self) -> None:
        """Render and write the passes (not in the UI); `RenderError` if Cycles fails."""
        joint, whole = self._joint, self._request.region is None
        if joint is not None and whole and joint.begins_at(self._look):
            for camera, look in zip(joint.cameras, joint.looks, strict=True):
                self._aim(camera.data, look)
            with joint.entered():
                self._render()
        elif joint is None or not joint.has(self._look, self._request):
            self._render()

    def _render(self) -> None:
        try:
            with self._aside.entered(self._scene):
                result = bpy.ops.render.render(write_still=True, scene=self._scene.name)
        except RuntimeError as error:
            raise RenderError(
                f"Cycles failed: {str(error).strip()} "
                "Render an ordinary image of this scene with Cycles to see whether that works."
            ) from error
        if "FINISHED" not in result:
            raise RenderError("The render was cancelled. Start it again.")

    def end(self) -> View:
        """Read the result of the render."""
        self.renders += 1
        joint = self._joint
        if joint is not None and joint.has(self._look, self._request):
            return joint.take(self._look)
        if self._request.beyond is not None and self._second is not None:
            first, second = (self._read(suffix, [""])[0] for suffix in self._second.suffixes)
            # Without a second view, a separate render is made.
            return dataclasses.replace(first, beyond=second_light(first, second))
        if joint is None or not joint.rendered:
            return self._read("", [""])[0]
        joint.keep(self._read("", joint.names), self._request)
        return joint.take(self._look)

    def _read(self, suffix: str, names: list[str]) -> list[View]:
        """Read the views of a file and remove the file."""
        groups = (LIGHT_GROUP, MARK_GROUP) if self._request.mark is not None else (LIGHT_GROUP,)
        path = self._folder / f"view{suffix}.exr"
        lights = [f"Combined_{group}" for group in groups]
        views = read_views(path, lights, names, self._size, self._request.region)
        with contextlib.suppress(OSError):  # a file that is written over goes to the disk at once
            path.unlink()
        return views


def read_views(
    path: Path,
    lights: Sequence[str],
    names: Sequence[str],
    size: tuple[int, int],
    region: Region | None,
) -> list[View]:
    """Read views by their names from a multilayer EXR file; a single view has the name "".

    `lights` are the passes of the transmitter's light, and of marks if there are any. `size` is the
    width and height of a view, of which the file has the `region` (None: all). RenderError if a
    light is missing.
    """
    whole = partial(_whole, size=size, region=region)
    # Multi-part files name the same pass "Object Index" or "IndexOB" by version.
    kinds = *lights, "Position", "Object Index", "IndexOB"
    ends = [f".{name}" if name else "" for name in names]
    passes = read_passes(path, [kind + end for kind in kinds for end in ends])
    views = []
    for end in ends:
        own: list[View] = []
        for name in (light + end for light in lights):
            if name not in passes:
                raise RenderError(
                    f"The render has no pass {name}; found {', '.join(passes) or 'none'}."
                )
            red, green, blue = (whole(passes[name][channel]) for channel in "RGB")
            own.append(View(red, green, blue))
        position = number = None
        if "Position" + end in passes:
            place = passes["Position" + end]
            position = np.stack([whole(place[axis]) for axis in "XYZ"], axis=-1)
        index = passes.get("Object Index" + end) or passes.get("IndexOB" + end)
        if index is not None:
            number = np.rint(whole(next(iter(index.values())))).astype(np.int32)
            if position is not None:
                position[number == 0] = np.nan  # nothing was hit
        light, marks = own[0], own[1] if len(own) > 1 else None
        views.append(
            dataclasses.replace(light, position=position, object_index=number, marks=marks)
        )
    return views


def read_passes(path: Path, wanted: Iterable[str]) -> dict[str, dict[str, Single]]:
    """Read those of the wanted passes that a multilayer EXR file has, from its only view layer.

    Return arrays (height, width) of float32 by pass and component ("R", "X"...). In files with
    several views the names are "pass.view". RenderError if the file cannot be read.
    """
    kind, module = exr_backend()
    names = set(wanted)
    try:
        read = _openexr if kind == "OpenEXR" else _openimageio
        planes = read(module, path, names)
    except (RuntimeError, ValueError, TypeError, OSError) as error:
        raise RenderError(
            f"The render in {path} cannot be read ({error}). Is the disk for temporary files full?"
        ) from error
    passes: dict[str, dict[str, Single]] = {}
    for channel, plane in planes.items():
        name = _wanted(channel, names)
        passes.setdefault(name, {})[channel.rpartition(".")[2]] = plane
    return passes


def _whole(plane: Single, size: tuple[int, int], region: Region | None) -> Single:
    """Return a channel over the whole view, 0 outside the region."""
    width, height = size
    expected = (height, width)
    if region is not None:
        expected = (region.bottom - region.top, region.right - region.left)
    if plane.shape != expected:
        raise RenderError(
            f"The render has {plane.shape[1]} x {plane.shape[0]} pixels; expected "
            f"{expected[1]} x {expected[0]}. Report this with the scene's render settings."
        )
    if region is None:
        return plane
    filled = np.zeros((height, width), dtype=np.float32)
    filled[region.top : region.bottom, region.left : region.right] = plane
    return filled


def _wanted(channel: str, names: Collection[str]) -> str:
    """Return the wanted pass of a channel, "pass" or "pass.view"; empty for none."""
    parts = channel.split(".")[:-1]
    found = (".".join(parts[-count:]) for count in (1, 2) if len(parts) > count)
    return next((name for name in found if name in names), "")


def _openexr(module: Any, path: Path, names: Collection[str]) -> dict[str, Single]:
    found: dict[str, Single] = {}
    with module.File(str(path), separate_channels=True) as file:
        for part in file.parts:
            for name, channel in part.channels.items():
                if _wanted(name, names):
                    found[name] = np.asarray(channel.pixels, dtype=np.float32)
    return found


def _openimageio(module: Any, path: Path, names: Collection[str]) -> dict[str, Single]:
    source = module.ImageInput.open(str(path))
    if source is None:
        raise RuntimeError(module.geterror() or "OpenImageIO cannot open it")
    found: dict[str, Single] = {}
    try:
        index = 0
        while source.seek_subimage(index, 0):
            spec = source.spec()
            index += 1
            if not any(_wanted(name, names) for name in spec.channelnames):
                continue
            pixels = source.read_image(index - 1, 0, 0, spec.nchannels, module.FLOAT)
            if pixels is None:
                raise RuntimeError(source.geterror() or "OpenImageIO cannot read its pixels")
            for number, name in enumerate(spec.channelnames):
                if _wanted(name, names):
                    found[name] = np.ascontiguousarray(np.asarray(pixels)[..., number])
    finally:
        source.close()
    return found
