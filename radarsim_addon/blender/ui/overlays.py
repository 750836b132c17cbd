# SPDX-License-Identifier: GPL-3.0-or-later
"""Overlays of the 3D view: field of view, beams, range rings, paths. No part of the scene."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import blf
import bpy
import gpu
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix, Vector

from ...array_types import Real
from ...errors import RadarSimError
from ...findings import length_text
from ...signal.radar import RadarSystem, peak_direction
from ..plan import check_unit_scale, shortest_decimal
from ..rig_settings import PROGRESS_PROPERTY
from ..scene import active_radar, frame_edges
from .fields import RadarPanel, active_group, split
from .link_budget_panel import scene_system
from .overlay_lines import (
    Label,
    arc,
    arrow,
    beam,
    pyramid,
    range_cell,
    ring_ranges,
    segments,
)
from .scene_reading import current_measurement, rig_of, scene_record
from .shown_results import chosen_target
from .translations import tr

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


def overlay_lines(context: Any) -> tuple[list[Lines], list[tuple[Label, Any]]]:
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


def _visible(context: Any) -> bool:
    """Whether a view shows overlays at all, and no run has the scene in its measuring state."""
    running = getattr(context.window_manager, PROGRESS_PROPERTY).running
    return context.space_data.overlay.show_overlays and not running


def _draw_lines() -> None:
    context = bpy.context
    if not _visible(context):
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
    if not _visible(context):
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
    def poll(cls, context: Any) -> bool:
        return active_group(context.scene) is not None

    def draw(self, context: Any) -> None:
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
