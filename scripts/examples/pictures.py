# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of example scenes: the scene in its own colours, next to what the radar measured."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from radarsim_addon import signal
from radarsim_addon.arrays import Real

from . import drone, indoor

#: Text that can be read at half the size [points], at 100 pixels per inch.
TEXT_PT = 12
_SKY, _MARK = (0.75, 0.85, 1.0, 1.0), (0.95, 0.75, 0.05)


@dataclass(frozen=True)
class View:
    """How to look at a scene, and how to draw its result.

    `eye` and `aim` are in metres, `hidden` are names of objects in the way, `draw` takes axes and
    the result of the frame and returns the picture's colours, which have a bar.
    """

    eye: tuple[float, float, float]
    aim: tuple[float, float, float]
    angle_deg: float
    title: str
    draw: Callable[[Any, signal.FrameResult], Any]
    hidden: tuple[str, ...] = ()
    mark_m: float = 0.5


def plain_material(name: str, colour: tuple[float, ...]) -> Any:
    """Return an ordinary, matt material."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    shader = next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    shader.inputs["Base Color"].default_value = (*colour[:3], 1.0)
    shader.inputs["Roughness"].default_value = 0.7
    return material


def daylight(scene: Any) -> None:
    """Light a scene by sun and sky instead of the radar."""
    for item in [o for o in scene.objects if o.type == "LIGHT"]:
        item.hide_render = True
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.rotation_euler = 3.5, (0.7, 0.2, 0.9)
    scene.collection.objects.link(sun)
    world = bpy.data.worlds.new("sky")
    if world.node_tree is None:
        world.use_nodes = True
    background = next(n for n in world.node_tree.nodes if n.bl_idname == "ShaderNodeBackground")
    background.inputs["Color"].default_value = _SKY
    background.inputs["Strength"].default_value = 0.7
    scene.world = world


def render_from(
    scene: Any, eye: tuple[float, ...], aim: tuple[float, ...], angle_deg: float,
    size: tuple[int, int], path: Path, samples: int = 64,
) -> Any:  # fmt: skip
    """Render an ordinary picture from one point towards another; return its camera."""
    camera = bpy.data.objects.new("view", bpy.data.cameras.new("view"))
    scene.collection.objects.link(camera)
    camera.location = eye
    camera.rotation_euler = (Vector(aim) - camera.location).to_track_quat("-Z", "Y").to_euler()
    camera.data.angle, camera.data.clip_end = math.radians(angle_deg), 10_000
    scene.camera = camera
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = samples, True
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    if hasattr(scene.render.image_settings, "media_type"):
        scene.render.image_settings.media_type = "IMAGE"
    scene.render.image_settings.file_format = "PNG"
    scene.view_settings.view_transform = "Standard"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return camera


def photograph(view: View, path: Path) -> None:
    """Render the open file in the colours of its materials, with the radar as a yellow cone."""
    scene = bpy.context.scene
    plain = {
        material: plain_material(material.name, tuple(material.diffuse_color))
        for material in bpy.data.materials
        if material.users
    }
    for item in scene.objects:
        for slot in item.material_slots:
            slot.material = plain.get(slot.material, slot.material)
        item.hide_render |= item.name in view.hidden
    radar = next(item for item in scene.objects if item.type == "CAMERA").matrix_world.copy()
    bpy.ops.mesh.primitive_cone_add(radius1=0.5 * view.mark_m, depth=view.mark_m)
    bpy.context.object.matrix_world = radar
    bpy.context.object.scale = (1, 1, 1)
    bpy.context.object.data.materials.append(plain_material("radar", _MARK))
    daylight(scene)
    render_from(scene, view.eye, view.aim, view.angle_deg, (480, 380), path)


def make_picture(name: str, result: signal.FrameResult, path: Path) -> None:
    """Draw the scene of the open file next to its result."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.image import imread
    from PIL import Image

    view = VIEWS[name]
    with tempfile.TemporaryDirectory() as folder, rc_context({"font.size": TEXT_PT}):
        photograph(view, Path(folder) / "scene.png")
        figure = Figure(figsize=(10, 4.0), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=[1.1, 1])
        left.imshow(imread(Path(folder) / "scene.png"))
        left.set_axis_off()
        left.set_title(view.title, fontsize=TEXT_PT)
        figure.colorbar(view.draw(right, result), ax=right, label="power [dB]")
        figure.savefig(path, dpi=100)
    with Image.open(path) as drawn:  # with 256 colours: half of the size
        rgb, method = drawn.convert("RGB"), Image.Quantize.MAXCOVERAGE
        rgb.quantize(256, method, dither=Image.Dither.NONE).save(path, optimize=True)


def draw_map(
    axes: Any, result: signal.FrameResult, span_db: float, speed_mps: float, top_db: float = 0.0
) -> Any:
    """Draw the range-Doppler map against range rate, receding to the right.

    Colours end `top_db` above the strongest cell, and begin `span_db` below it.
    """
    found = result.rd_map
    order = np.argsort(found.velocity_mps)
    power = found.power[0]
    db = signal.power_to_db(power, float(power.max()), -span_db)
    axes.set(xlabel="range rate [m/s]", ylabel="range [m]", xlim=(-speed_mps, speed_mps))
    return axes.pcolormesh(
        found.velocity_mps[order], found.range_m, db[order].T, cmap="viridis",
        vmax=top_db, rasterized=True,
    )  # fmt: skip


def note(axes: Any, text: str, point: tuple[float, float], shift: tuple[float, float]) -> None:
    """Name a point of a map."""
    axes.annotate(
        text, point, xytext=shift, textcoords="offset points", color="w", ha="center",
        arrowprops={"arrowstyle": "-", "lw": 1.0, "color": "w"},
    )  # fmt: skip


#: Labels of cars, in points from their places.
_CAR_LABELS = {"Oncoming Car": (45, 10), "Car Ahead": (40, 20), "Parked Car": (-45, 12)}


def _street(axes: Any, result: signal.FrameResult) -> Any:
    colours = draw_map(axes, result, 55.0, 30.0)
    for name, shift in _CAR_LABELS.items():
        echo = next(item for item in result.budget.objects if item.name == name)
        note(axes, name.lower(), (echo.range_rate_mps, echo.range_m), shift)
    return colours


def _sea(axes: Any, result: signal.FrameResult) -> Any:
    colours = draw_map(axes, result, 60.0, 15.0)
    note(axes, "ship, 6 m/s", (6.0, 3000.0), (0, 40))
    note(axes, "sea", (-0.5, 1500.0), (-50, 20))
    return colours


def spectrogram(result: signal.FrameResult, pulses: int = 48) -> tuple[Real, Real, Real]:
    """Return time [s], range rate [m/s] and power [dB] of the sum of all ranges."""
    from scipy.signal import ShortTimeFFT
    from scipy.signal.windows import hann

    radar, samples = result.compressed.radar, result.compressed.plane.sum(axis=1)
    transform = ShortTimeFFT(
        hann(pulses, sym=False), pulses // 12, radar.burst.prf_hz, mfft=256, fft_mode="centered"
    )
    first, last = transform.lower_border_end[1], transform.upper_border_begin(samples.size)[1]
    power = np.abs(transform.stft(samples, first, last)) ** 2
    rate_mps = -transform.f * radar.waveform.wavelength_m / 2
    time_s = transform.t(samples.size)[first - transform.p_min : last - transform.p_min]
    return time_s, rate_mps, signal.power_to_db(power, float(power.max()), -45.0)


def _drone(axes: Any, result: signal.FrameResult) -> Any:
    time_s, rate_mps, db = spectrogram(result)
    colours = axes.pcolormesh(1e3 * time_s, rate_mps, db, cmap="viridis", rasterized=True)
    for sign in (-1, 1):
        edge_mps = sign * drone.tip_rate_mps() + drone.body_rate_mps()
        axes.axhline(edge_mps, color="w", ls="--")
        axes.text(8.5, edge_mps + sign * 5, "blade tips", color="w", ha="center", va="center")
    axes.set(xlabel="time [ms]", ylabel="range rate [m/s]")
    return colours


def _indoor(axes: Any, result: signal.FrameResult) -> Any:
    colours = draw_map(axes, result, 90.0, 3.0, top_db=-30.0)
    note(axes, "wall", (0.0, indoor.WALL_M), (60, 0))
    note(axes, "cabinet", (0.0, indoor.CABINET_M + 0.3), (60, 12))
    note(axes, "walker", (-1.0, 4.2), (-35, 30))
    return colours


VIEWS = {
    "street": View((-2.5, -7.0, 5.0), (0.5, 18.0, 0.0), 58.0, "Street at 77 GHz", _street),
    "sea": View((60.0, 2870.0, 40.0), (0.0, 3030.0, 5.0), 40.0, "Ship on the sea, X band", _sea),
    "drone": View((0.9, 15.9, 10.5), (0.0, 17.0, 9.97), 30.0, "Drone at 24 GHz", _drone),
    "indoor": View((-5.5, -4.5, 6.0), (0.0, 3.2, 0.8), 55.0, "Through a wall at 2.4 GHz", _indoor,
                   mark_m=0.4),
}  # fmt: skip
"""How to draw each example."""
