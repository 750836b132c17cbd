# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of the scene from the receiver, rendered by Cycles without a display.

It is rendered in a copy of the scene that shares its objects, so the user's settings do not change.
Radar materials have no colours for viewers. Therefore each object has a plain colour, with ambient
occlusion in place of lights.
"""

from __future__ import annotations

import colorsys
import contextlib
import importlib
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ...contract import ReceiverRecord
from ...errors import ConfigError, SceneError
from ...signal.pictures import placed_targets, plot_scene
from ...signal.pipeline import FrameResult, ProcessOptions, process_frame
from ...signal.runs import Run
from ..nodes.shader_trees import is_fog
from ..run import scene_text
from ..scene import NEAR_CLIP_UNITS, aim
from ..state import SettingsRestorer
from .console import quiet_blender

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Samples of a pixel, and colours that objects get.
_SAMPLES, _COLOURS = 8, 12
_NAME = "radarsim picture"
#: Limits of a picture's width and height [pixels].
_LEAST_PX, _MOST_PX = 16, 8192


def show(measured: Run | FrameResult, *, frame: int | None = None, width_px: int = 800) -> Figure:
    """Draw the scene as the receiver sees it, with the targets of a frame named.

    Cycles renders it; no window is needed. A notebook shows the figure. The scene and its settings
    are as before.

    Parameters
    ----------
    measured
        What :func:`measure` returned, or a result of :func:`process`. Targets are the detections;
        without CFAR, which a run is processed without, the objects with the strongest echoes.
    frame
        Radar frame of a run; None: the first one. A result has its own.
    width_px
        Width of the picture in pixels.

    Returns
    -------
    matplotlib.figure.Figure
        Numbers of at most five targets are listed below the picture: name, range, range rate. With
        rings, no target is marked: they do not give directions.

    Raises
    ------
    SceneError
        The run is of another file or scene than the open ones.
    ConfigError
        A frame is given that the run does not have, or with a result; or a width out of bounds.
    """
    if not _LEAST_PX <= width_px <= _MOST_PX:
        raise ConfigError(
            f"Width is {width_px!r} pixels; expected {_LEAST_PX} to {_MOST_PX}. Give width_px=800."
        )
    if isinstance(measured, FrameResult):
        if frame not in (None, measured.frame):
            raise ConfigError(f"The result is of frame {measured.frame}. Leave out frame={frame}.")
        result = measured
    else:
        options = ProcessOptions().for_run(measured)
        number = measured.record.frames[0] if frame is None else frame
        result = process_frame(options.open(measured.frame(number)), options)
    record, receiver = result.source.frame.record, result.source.receiver
    scene = bpy.data.scenes.get(record.scene)
    if scene is None or record.blend_file != Path(bpy.data.filepath).name:
        raise SceneError(
            f"The run is of {scene_text(record)}, which is not open. Open that file, then show "
            "the run."
        )
    pixels = _rendered(scene, receiver, record.metres_per_unit, result.frame, width_px)
    title = f"{scene.name}, frame {result.frame}, t = {result.time_s:.4g} s"
    return plot_scene(pixels, receiver, placed_targets(result), title)


def _rendered(
    scene: bpy.types.Scene,
    receiver: ReceiverRecord,
    metres_per_unit: float,
    frame: int,
    width_px: int,
) -> NDArray[np.uint8]:
    """Return the picture of a scene at a frame, (height, width, 3)."""
    ratio = (receiver.top - receiver.bottom) / (receiver.right - receiver.left)
    height_px = min(max(round(width_px * ratio), _LEAST_PX), _MOST_PX)
    with tempfile.TemporaryDirectory(prefix="radarsim_") as folder, quiet_blender():
        path = Path(folder, "picture.png")
        with _copy_for_pictures(scene) as (copied, camera):
            camera.matrix_world = _pose(receiver, metres_per_unit)
            edges = receiver.left, receiver.right, receiver.bottom, receiver.top
            aim(camera.data, receiver.kind, edges, width_px, height_px, metres_per_unit)
            copied.render.resolution_x, copied.render.resolution_y = width_px, height_px
            copied.render.filepath = str(path)
            copied.frame_set(frame)
            # the operator renders at the frame of the context's scene, also for another scene
            with bpy.context.temp_override(scene=copied, view_layer=copied.view_layers[0]):
                bpy.ops.render.render("EXEC_DEFAULT", write_still=True)
        pixels = importlib.import_module("matplotlib.image").imread(path)
    return np.asarray(np.rint(255 * pixels[..., :3]), dtype=np.uint8)


def _pose(receiver: ReceiverRecord, metres_per_unit: float) -> Matrix:
    pose = np.array(receiver.matrix_world)
    pose[:3, 3] /= metres_per_unit
    return Matrix(pose.tolist())


@contextlib.contextmanager
def _copy_for_pictures(scene: bpy.types.Scene) -> Iterator[tuple[bpy.types.Scene, Any]]:
    """Provide a copy of a scene with plain colours, and its camera, during a `with` block."""
    recorder = SettingsRestorer()
    recorder.keep_frame(scene)
    try:
        copied = scene.copy()
        recorder.on_restore(_NAME, lambda: bpy.data.scenes.remove(copied))
        data = bpy.data.cameras.new(_NAME)
        recorder.on_restore(_NAME, lambda: bpy.data.cameras.remove(data))
        data.clip_start, data.clip_end = NEAR_CLIP_UNITS, 1e12
        camera = bpy.data.objects.new(_NAME, data)
        recorder.on_restore(_NAME, lambda: bpy.data.objects.remove(camera))
        copied.collection.objects.link(camera)
        copied.camera = camera
        material, world = bpy.data.materials.new(_NAME), bpy.data.worlds.new(_NAME)
        recorder.on_restore(_NAME, lambda: bpy.data.materials.remove(material))
        recorder.on_restore(_NAME, lambda: bpy.data.worlds.remove(world))
        _colour_objects(material)
        _colour_background(world)
        copied.world = world
        for layer in list(copied.view_layers)[1:]:
            copied.view_layers.remove(layer)
        copied.view_layers[0].use = True
        copied.view_layers[0].material_override = material
        for item in copied.objects:  # a volume alone would hide what is in it
            slots = [slot.material for slot in item.material_slots]
            if slots and all(map(is_fog, slots)):
                recorder.set(item, "hide_render", True)
        _set_render(copied)
        yield copied, camera
    finally:
        unrestored = recorder.restore()
    if unrestored:
        raise SceneError(
            f"The scene could not be restored: {'; '.join(unrestored)}. Open the file again."
        )


def _set_render(scene: bpy.types.Scene) -> None:
    """Set up a scene for a small picture, without the user's effects on renders."""
    render, image, view = scene.render, scene.render.image_settings, scene.view_settings
    render.engine = "CYCLES"
    render.resolution_percentage = 100
    render.pixel_aspect_x = render.pixel_aspect_y = 1.0
    for name in (
        "use_border", "use_compositing", "use_sequencer", "use_motion_blur", "use_stamp",
        "use_multiview", "film_transparent", "use_freestyle",
    ):  # fmt: skip
        setattr(render, name, False)
    render.use_file_extension = False
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format, image.color_mode, image.color_depth = "PNG", "RGB", "8"
    view.view_transform, view.look, view.exposure, view.gamma = "Standard", "None", 0.0, 1.0
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", _SAMPLES, 0
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.use_animated_seed = False


def _colour_objects(material: bpy.types.Material) -> None:
    """Give each object a colour of its own, darker in corners and at oblique angles."""
    tree = _empty_tree(material)
    nodes, links = tree.nodes, tree.links
    info, ramp = nodes.new("ShaderNodeObjectInfo"), nodes.new("ShaderNodeValToRGB")
    occlusion, facing = nodes.new("ShaderNodeAmbientOcclusion"), nodes.new("ShaderNodeLayerWeight")
    light, emission = nodes.new("ShaderNodeMapRange"), nodes.new("ShaderNodeEmission")
    ramp.color_ramp.interpolation = "CONSTANT"
    elements = ramp.color_ramp.elements
    while len(elements) < _COLOURS:
        elements.new(1.0)
    for number, element in enumerate(elements):
        element.position = number / _COLOURS
        element.color = (*colorsys.hsv_to_rgb(number / _COLOURS, 0.25, 0.75), 1.0)
    links.new(info.outputs["Random"], ramp.inputs[0])
    links.new(ramp.outputs["Color"], occlusion.inputs["Color"])
    links.new(occlusion.outputs["Color"], emission.inputs["Color"])
    light.inputs["To Min"].default_value, light.inputs["To Max"].default_value = 1.0, 0.35
    links.new(facing.outputs["Facing"], light.inputs["Value"])
    links.new(light.outputs["Result"], emission.inputs["Strength"])
    links.new(emission.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])


def _colour_background(world: bpy.types.World) -> None:
    tree = _empty_tree(world)
    background = tree.nodes.new("ShaderNodeBackground")
    background.inputs["Color"].default_value = (0.75, 0.8, 0.88, 1.0)
    output = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(background.outputs[0], output.inputs["Surface"])


def _empty_tree(owner: Any) -> Any:
    """Return the node tree of new data, without nodes."""
    if owner.node_tree is None:
        owner.use_nodes = True
    owner.node_tree.nodes.clear()
    return owner.node_tree
