# SPDX-License-Identifier: GPL-3.0-or-later
"""Overlays of the 3D view: field of view, beams, range rings, paths. No part of the scene."""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import blf
import bpy
import gpu
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix, Vector

from ...arrays import Real
from ...errors import RadarSimError
from ...findings import length_text
from ...physics.antennas import Antenna
from ...signal.radar import RadarSystem, peak_direction
from ..plan import check_unit_scale, shortest_decimal
from ..rig_settings import PROGRESS_PROPERTY
from ..scene import active_radar, frame_edges
from .fields import RadarPanel, active_group, split, tr
from .link_budget_panel import scene_system
from .scene_reading import current_measurement, rig_of, scene_record
from .shown_results import chosen_target

# -------------------------------------------------------------------------------------------------
# Lines of the overlays in a receiver's or transmitter's own axes: looking along -z, y up.
# -------------------------------------------------------------------------------------------------


#: Points of a circle, and of the line around a beam.
_POINTS = 96
#: Largest angle from the peak at which the edge of a beam is looked for [rad].
_WIDEST = math.radians(89.0)


class Label(NamedTuple):
    """A text and its place, in metres."""

    place: tuple[float, float, float]
    text: str


def round_length(longest_m: float) -> float:
    """Return the step of about five range rings: 1, 2 or 5 times a power of ten [m]."""
    power = 10.0 ** math.floor(math.log10(longest_m / 5))
    return max(step * power for step in (1, 2, 5) if step * power <= longest_m / 5)


def ring_ranges(longest_m: float) -> list[float]:
    """Return the ranges of the rings up to a range [m]."""
    step_m = round_length(longest_m)
    return [step_m * number for number in range(1, math.floor(longest_m / step_m + 1e-9) + 1)]


def segments(points: Real, closed: bool = False) -> Real:
    """Return the ends of a line's pieces one after the other, (2 n, 3), from its points (m, 3)."""
    following = np.roll(points, -1, axis=0) if closed else points[1:]
    return np.stack([points[: len(following)], following], axis=1).reshape(-1, 3)


def arc(range_m: float, half_angle: float) -> Real:
    """Return points of a range ring in the plane y = 0, (n, 3) [m]; pi: the whole circle."""
    angle = np.linspace(-half_angle, half_angle, _POINTS)
    return range_m * np.stack([np.sin(angle), np.zeros(_POINTS), -np.cos(angle)], axis=1)


def pyramid(edges: tuple[float, float, float, float], range_m: float) -> Real:
    """Return a field of view as line ends: four edges, and the frame on the sphere of `range_m`.

    edges: left, right, bottom, top at distance 1.
    """
    left, right, bottom, top = edges
    across, up = np.linspace(left, right, _POINTS), np.linspace(bottom, top, _POINTS)
    sides = [
        (across, np.full(_POINTS, bottom)), (np.full(_POINTS, right), up),
        (across[::-1], np.full(_POINTS, top)), (np.full(_POINTS, left), up[::-1]),
    ]  # fmt: skip
    u, v = (np.concatenate(parts) for parts in zip(*sides, strict=True))
    frame = _on_sphere(np.stack([u, v, np.full(u.size, -1.0)], axis=1), range_m)
    corners = frame[::_POINTS]
    spokes = np.stack([np.zeros((4, 3)), corners], axis=1).reshape(-1, 3)
    return np.concatenate([spokes, segments(frame, closed=True)])


def beam(antenna: Antenna, axis: Real, range_m: float) -> Real:
    """Return the line around a beam at half its peak gain, as line ends on a sphere [m].

    axis: direction of the peak. Directions in which the gain stays above half of it have no edge
    and are drawn at 89 degrees.
    """
    side = np.cross(axis, [0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    phi = 2 * np.pi * np.arange(_POINTS) / _POINTS
    around = np.cos(phi)[:, None] * side + np.sin(phi)[:, None] * np.cross(side, axis)
    half = 0.5 * float(antenna.gain(axis))
    # The first crossing: in steps of a beam's fraction, then by bisection.
    steps = _WIDEST * np.linspace(0.0, 1.0, 721)[1:]
    falls = np.stack([antenna.gain(_tilted(axis, around, angle)) < half for angle in steps])
    first = np.where(falls.any(axis=0), falls.argmax(axis=0), len(steps) - 1)
    high, low = steps[first], np.where(first > 0, steps[first - 1], 0.0)
    for _ in range(30):
        middle = (low + high) / 2
        below = antenna.gain(_tilted(axis, around, middle)) < half
        high, low = np.where(below, middle, high), np.where(below, low, middle)
    return segments(range_m * _tilted(axis, around, high), closed=True)


def arrow(place: Real, along: Real) -> Real:
    """Return an arrow from a place, with a head of a seventh of its length, as line ends."""
    tip = place + along
    aside = np.cross(along, [0.0, 0.0, 1.0] if np.hypot(*along[:2]) > 0 else [1.0, 0.0, 0.0])
    aside *= np.linalg.norm(along) / np.linalg.norm(aside) / 14
    back = tip - along / 7
    return np.array([place, tip, tip, back + aside, tip, back - aside])


def range_cell(place: Real, thick_m: float, half_angle: float) -> Real:
    """Return the arcs at half a range cell before and behind a place, and what joins them.

    place: in the receiver's axes [m]. The arcs have its elevation and end with the field of view.
    """
    range_m = float(np.linalg.norm(place))
    up = math.asin(place[1] / range_m) if range_m > 0 else 0.0
    angle = np.linspace(-half_angle, half_angle, _POINTS)
    unit = np.stack(
        [
            math.cos(up) * np.sin(angle),
            np.full(_POINTS, math.sin(up)),
            -math.cos(up) * np.cos(angle),
        ],
        axis=1,
    )
    near, far = max(range_m - thick_m / 2, 0.0) * unit, (range_m + thick_m / 2) * unit
    joins = np.stack([near[[0, -1]], far[[0, -1]]], axis=1).reshape(-1, 3)
    return np.concatenate([segments(near), segments(far), joins])


def _tilted(axis: Real, around: Real, angle: Real | float) -> Real:
    """Directions at angles from the axis, (n, 3)."""
    angle = np.broadcast_to(angle, len(around))[:, None]
    return np.asarray(np.cos(angle) * axis + np.sin(angle) * around)


def _on_sphere(directions: Real, range_m: float) -> Real:
    return np.asarray(range_m * directions / np.linalg.norm(directions, axis=1, keepdims=True))


#: Colours that are readable on light and dark themes (Okabe and Ito), with their opacity.
_COLOURS = {
    "view": (0.34, 0.71, 0.91, 0.9),
    "transmitter": (0.90, 0.62, 0.0, 0.9),
    "receiver": (0.0, 0.62, 0.45, 0.9),
    "rings": (0.65, 0.65, 0.65, 0.8),
    "unambiguous": (0.84, 0.37, 0.0, 0.9),
    "paths": (0.94, 0.89, 0.26, 0.9),
    "velocities": (0.80, 0.47, 0.65, 0.9),
    "cell": (1.0, 1.0, 1.0, 0.9),
}
_WIDTH_PX = 1.5
_FONT_PX = 11
_MOST_BEAMS = 16
#: Overlays in the order of the panel: the ends of their properties' names.
_NAMES = ("view", "beams", "rings", "unambiguous", "velocities", "cell", "paths")
_handles: list[Any] = []


class Lines(NamedTuple):
    """Lines of one colour: ends in metres, and the matrix of what carries them."""

    kind: str
    ends: Real
    matrix: Any


def overlay_lines(context: bpy.types.Context) -> tuple[list[Lines], list[tuple[Label, Any]]]:
    """Return lines and labels that are switched on, in the axes of receiver and transmitter."""
    shown = getattr(context.window_manager, PROGRESS_PROPERTY)
    scene = context.scene
    radar = active_radar(scene)
    rig = rig_of(scene, radar)
    metres = check_unit_scale(shortest_decimal(scene.unit_settings.scale_length))
    measurement, _ = current_measurement(scene)
    record = scene_record(context)
    if measurement is None:
        return [], []
    longest_m = _longest_m(measurement, record)
    receiver, transmitter = (
        _unscaled(item.matrix_world, metres) for item in (rig.camera, rig.emitter)
    )
    found: list[Lines] = []
    labels: list[tuple[Label, Any]] = []
    perspective = rig.camera.data.type == "PERSP"
    edges = (-1.0, 1.0, -1.0, 1.0)
    if perspective:
        edges = frame_edges(rig.camera.data, measurement.width_px, measurement.height_px, metres)
    if shown.overlay_view and perspective:
        found.append(Lines("view", pyramid(edges, longest_m), receiver))
    half_angle = float(np.arctan(max(abs(edges[0]), abs(edges[1])))) if perspective else np.pi
    if shown.overlay_rings:
        ranges = ring_ranges(longest_m)
        ends = np.concatenate([segments(arc(range_m, half_angle)) for range_m in ranges])
        found.append(Lines("rings", ends, receiver))
        labels += [(Label((0.0, 0.0, -r), length_text(r)), receiver) for r in ranges]
    if shown.overlay_unambiguous:
        limit_m = measurement.radar.unambiguous_range_m
        ends = segments(arc(limit_m, half_angle))
        found.append(Lines("unambiguous", ends, receiver))
        text = tr("{range} unambiguous", range=length_text(float(f"{limit_m:.3g}")))
        labels.append((Label((0.0, 0.0, -limit_m), text), receiver))
    if shown.overlay_velocities and record is not None:
        world = Matrix.Scale(1 / metres, 4)
        for place, velocity in record.moving.values():
            found.append(Lines("velocities", arrow(place, velocity), world))
            speed = f"{np.linalg.norm(velocity):.3g} m/s"
            labels.append((Label(tuple(place + velocity), speed), world))
    if shown.overlay_cell:
        cursor = receiver.inverted() @ scene.cursor.location
        ends, label = _cell_at(np.array(cursor, dtype=np.float64), measurement.radar, half_angle)
        found.append(Lines("cell", ends, receiver))
        labels.append((label, receiver))
    target = chosen_target() if shown.overlay_paths else None
    if target is not None and target["lines_m"]:
        ends = np.concatenate([segments(np.array(line)) for line in target["lines_m"]])
        found.append(Lines("paths", ends, Matrix.Scale(1 / metres, 4)))
    system = scene_system(scene) if shown.overlay_beams else None
    for kind, matrix in (("transmitter", transmitter), ("receiver", receiver)):
        if system is not None and getattr(system.record, kind).kind not in ("isotropic", "table"):
            found.append(Lines(kind, _beam(system, kind, longest_m), matrix))
    return found, labels


def _cell_at(place: Real, radar: Any, half_angle: float) -> tuple[Real, Label]:
    """Outline of the range cell around a place in the receiver's axes, and what it measures [m]."""
    thick_m = radar.waveform.range_resolution_m
    text = tr(
        "{range}: cell {thickness} x {rate:.3g} m/s",
        range=length_text(float(f"{np.linalg.norm(place):.4g}")),
        thickness=length_text(float(f"{thick_m:.3g}")),
        rate=radar.velocity_resolution_mps,
    )
    return range_cell(place, thick_m, half_angle), Label(tuple(place), text)


def _longest_m(measurement: Any, record: Any) -> float:
    """How far lines reach: to the range limit, else as far as the scene [m]."""
    reach_m = 0.0 if record is None else record.extent.from_emitter_m
    return float(measurement.range_stop_m or reach_m or 100.0)


def _unscaled(matrix: Any, metres: float) -> Any:
    """The pose of an antenna, from metres into the scene's units."""
    place, turn, _ = matrix.decompose()
    return Matrix.Translation(place) @ turn.to_matrix().to_4x4() @ Matrix.Scale(1 / metres, 4)


_beams: dict[tuple[int, str, float], tuple[RadarSystem, Real]] = {}


def _beam(system: RadarSystem, kind: str, range_m: float) -> Real:
    """The edge of a beam; the last ones are kept, since views draw at every move of the mouse."""
    key = (id(system), kind, range_m)
    if key not in _beams:
        if len(_beams) > _MOST_BEAMS:
            _beams.clear()
        antenna = getattr(system, kind)
        _beams[key] = system, beam(antenna, peak_direction(antenna), range_m)
    return _beams[key][1]


@functools.lru_cache(maxsize=1)
def _shader() -> Any:
    return gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")


def _draw_lines() -> None:
    context = bpy.context
    if not context.space_data.overlay.show_overlays:
        return
    try:
        found, _ = overlay_lines(context)
    except RadarSimError:
        return  # the panels say what is missing
    shader = _shader()
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL")
    for lines in found:
        batch = batch_for_shader(shader, "LINES", {"pos": lines.ends.astype(np.float32)})
        with gpu.matrix.push_pop():
            gpu.matrix.multiply_matrix(lines.matrix)
            shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
            shader.uniform_float("lineWidth", _WIDTH_PX * context.preferences.system.ui_scale)
            shader.uniform_float("color", _COLOURS[lines.kind])
            batch.draw(shader)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")


def _draw_labels() -> None:
    context = bpy.context
    if not context.space_data.overlay.show_overlays:
        return
    try:
        _, labels = overlay_lines(context)
    except RadarSimError:
        return
    blf.size(0, _FONT_PX * context.preferences.system.ui_scale)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    blf.enable(0, blf.SHADOW)  # readable on any theme
    blf.shadow(0, 5, 0.0, 0.0, 0.0, 1.0)
    for label, matrix in labels:
        place = location_3d_to_region_2d(
            context.region, context.region_data, matrix @ Vector(label.place)
        )
        if place is not None:
            blf.position(0, place.x, place.y, 0)
            blf.draw(0, label.text)
    blf.disable(0, blf.SHADOW)


class RADARSIM_PT_overlays(RadarPanel, bpy.types.Panel):
    bl_label = "Overlays"
    bl_idname = "RADARSIM_PT_overlays"
    bl_parent_id = "RADARSIM_PT_rig"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return active_group(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        column = split(self.layout).column(heading="Show")
        shown = getattr(context.window_manager, PROGRESS_PROPERTY)
        for name in _NAMES:
            column.prop(shown, f"overlay_{name}")


CLASSES: tuple[type, ...] = (RADARSIM_PT_overlays,)


def show_overlays() -> None:
    """Draw in all 3D views from now on; a second call changes nothing."""
    if _handles or bpy.app.background:
        return
    add = bpy.types.SpaceView3D.draw_handler_add
    _handles.append(add(_draw_lines, (), "WINDOW", "POST_VIEW"))
    _handles.append(add(_draw_labels, (), "WINDOW", "POST_PIXEL"))


def hide_overlays() -> None:
    """Draw no more; a second call changes nothing."""
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")
