# SPDX-License-Identifier: GPL-3.0-or-later
"""Overlays of the 3D view: field of view, beams, array, rings, paths. No part of the scene."""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import blf
import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix, Vector

from ...arrays import Mask, Real
from ...errors import RadarSimError
from ...findings import length_text
from ...physics.antennas import Antenna
from ...signal.radar import RadarSystem, peak_direction
from ..plan import Measurement, check_unit_scale, shortest_decimal
from ..rig_settings import PROGRESS_PROPERTY
from ..scene import active_radar, frame_edges
from .fields import RadarPanel, active_group, split, tr
from .link_budget_panel import scene_system
from .scene_reading import SceneRecord, current_measurement, scene_record, shown_rig
from .shown_results import chosen_target

# -------------------------------------------------------------------------------------------------
# Lines of the overlays in a receiver's or transmitter's own axes: looking along -z, y up.
# -------------------------------------------------------------------------------------------------


#: Points of a circle, and of the line around a beam.
_POINTS = 96
#: Angles from the peak between which the edge of a beam is looked for [rad].
_NARROWEST, _WIDEST = math.radians(0.01), math.radians(89.0)


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
    """Return the ends of the pieces of a line one after the other, (2 n, 3). The line has the
    points (m, 3).
    """
    following = np.roll(points, -1, axis=0) if closed else points[1:]
    return np.stack([points[: len(following)], following], axis=1).reshape(-1, 3)


def arc(range_m: float, half_angle: float) -> Real:
    """Return the points of a range ring in the plane y = 0, (n, 3) [m]. With pi, it is the whole
    circle.
    """
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

    axis: direction of the peak. In directions in which the gain never falls below half, the line is
    at 89 degrees.
    """
    side = np.cross(axis, [0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    phi = 2 * np.pi * np.arange(_POINTS) / _POINTS
    around = np.cos(phi)[:, None] * side + np.sin(phi)[:, None] * np.cross(side, axis)
    half = 0.5 * float(antenna.gain(axis))
    # The first crossing: in steps of a beam's fraction, however wide it is, then by bisection.
    steps = np.geomspace(_NARROWEST, _WIDEST, 240)
    sides = np.cos(steps)[:, None, None] * axis + np.sin(steps)[:, None, None] * around
    falls = antenna.gain(sides) < half
    first = np.where(falls.any(axis=0), falls.argmax(axis=0), len(steps) - 1)
    high, low = steps[first], np.where(first > 0, steps[first - 1], 0.0)
    for _ in range(30):
        middle = (low + high) / 2
        below = antenna.gain(_tilted(axis, around, middle)) < half
        high, low = np.where(below, middle, high), np.where(below, low, middle)
    return segments(range_m * _tilted(axis, around, high), closed=True)


def arrows(places: Real, along: Real) -> Real:
    """Return arrows at places (n, 3) as line ends, (6 n, 3). A head is a seventh of its arrow."""
    tips, back = places + along, places + along * (6 / 7)
    upright = np.hypot(along[:, 0], along[:, 1]) == 0
    aside = np.cross(along, np.where(upright[:, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]))
    lengths = np.linalg.norm(along, axis=1) / np.linalg.norm(aside, axis=1) / 14
    aside *= lengths[:, None]
    ends = [places, tips, tips, back + aside, tips, back - aside]
    return np.stack(ends, axis=1).reshape(-1, 3)


def range_cell(place: Real, thick_m: float, half_angle: float) -> Real:
    """Return the arcs half a range cell before and behind a place, and the lines that join them.

    place: in the receiver's axes [m]. The arcs have its elevation and end at the field of view.
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


def marks(places: Real, half_m: float, crossed: bool) -> Real:
    """Return squares about places (n, 3) as line ends, (8 n, 3), or their diagonals, (4 n, 3)."""
    corners = half_m * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    ends = corners[[0, 2, 1, 3]] if crossed else segments(corners, closed=True)
    return np.asarray((places[:, None] + ends).reshape(-1, 3))


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
    "transmitters": (0.90, 0.62, 0.0, 0.9),
    "receivers": (0.0, 0.62, 0.45, 0.9),
    "virtual": (0.34, 0.71, 0.91, 0.9),
    "rings": (0.65, 0.65, 0.65, 0.8),
    "unambiguous": (0.84, 0.37, 0.0, 0.9),
    "paths": (0.94, 0.89, 0.26, 0.9),
    "velocities": (0.80, 0.47, 0.65, 0.9),
    "cell": (1.0, 1.0, 1.0, 0.9),
}
_WIDTH_PX = 1.5
_FONT_PX = 11
_MOST_BEAMS = 16
#: Labels in view that are looked at.
_MOST_LABELS = 256
#: Overlays in the order of the panel: the ends of their properties' names.
_NAMES = ("view", "beams", "elements", "rings", "unambiguous", "velocities", "cell", "paths")
_handles: list[Any] = []


class Lines(NamedTuple):
    """Lines of one colour: ends in metres, and the matrix of what carries them."""

    kind: str
    ends: Real
    matrix: Any


class _Shown(NamedTuple):
    """What the overlays depend on."""

    #: Which of `_NAMES` are on.
    names: frozenset[str]
    measurement: Measurement
    record: SceneRecord | None
    metres: float
    #: Rows of the poses of receiver and transmitter, without scale [Blender units].
    receiver: tuple[tuple[float, ...], ...]
    transmitter: tuple[tuple[float, ...], ...]
    #: Left, right, bottom and top of the receiver's view at distance 1; None without a perspective.
    edges: tuple[float, float, float, float] | None
    #: Place of the 3D cursor [Blender units].
    cursor: tuple[float, float, float]
    #: Ends of the paths of the chosen target [m].
    paths: Any
    system: RadarSystem | None
    language: str


def _shown(context: bpy.types.Context) -> _Shown | None:
    """Return what the overlays draw; None if nothing can be measured.

    A `RadarSimError` if the radar lacks a part.
    """
    switches = getattr(context.window_manager, PROGRESS_PROPERTY)
    names = frozenset(name for name in _NAMES if getattr(switches, f"overlay_{name}"))
    if not names:
        return None
    scene = context.scene
    rig = shown_rig(scene, active_radar(scene))
    measurement, _ = current_measurement(scene)
    if measurement is None:
        return None
    metres = check_unit_scale(shortest_decimal(scene.unit_settings.scale_length))
    size, camera = (measurement.width_px, measurement.height_px), rig.camera.data
    target = chosen_target() if "paths" in names else None
    return _Shown(
        names,
        measurement,
        scene_record(context),
        metres,
        _pose(rig.camera.matrix_world),
        _pose(rig.emitter.matrix_world),
        frame_edges(camera, *size, metres) if camera.type == "PERSP" else None,
        tuple(scene.cursor.location) if "cell" in names else (0.0, 0.0, 0.0),
        target and target["lines_m"],
        scene_system(scene) if "beams" in names else None,
        bpy.app.translations.locale,
    )


def overlay_lines(context: bpy.types.Context) -> tuple[list[Lines], list[tuple[Label, Any]]]:
    """Return the lines and labels that are switched on, in the axes of receiver and transmitter.

    The most important labels come first.
    """
    shown = _shown(context)
    if shown is None:
        return [], []
    measurement, record, edges = shown.measurement, shown.record, shown.edges
    longest_m = _longest_m(measurement, record)
    world = Matrix.Scale(1 / shown.metres, 4)
    receiver, transmitter = (Matrix(one) @ world for one in (shown.receiver, shown.transmitter))
    found: list[Lines] = []
    labels: list[tuple[Label, Any]] = []
    half_angle = np.pi if edges is None else math.atan(max(abs(edges[0]), abs(edges[1])))
    if "view" in shown.names and edges is not None:
        found.append(Lines("view", pyramid(edges, longest_m), receiver))
    if "cell" in shown.names:
        cursor = np.array(receiver.inverted() @ Vector(shown.cursor), dtype=np.float64)
        ends, label = _cell_at(cursor, measurement.radar, half_angle)
        found.append(Lines("cell", ends, receiver))
        labels.append((label, receiver))
    if "unambiguous" in shown.names:
        limit_m = measurement.radar.unambiguous_range_m
        found.append(Lines("unambiguous", segments(arc(limit_m, half_angle)), receiver))
        text = tr("{range} unambiguous", range=length_text(float(f"{limit_m:.3g}")))
        labels.append((Label((0.0, 0.0, -limit_m), text), receiver))
    if "rings" in shown.names:
        ranges = ring_ranges(longest_m)
        ends = np.concatenate([segments(arc(range_m, half_angle)) for range_m in ranges])
        found.append(Lines("rings", ends, receiver))
        labels += [(Label((0.0, 0.0, -r), length_text(r)), receiver) for r in ranges]
    if "velocities" in shown.names and record is not None and record.moving:
        places, velocities = np.stack([*record.moving.values()], axis=1)
        found.append(Lines("velocities", arrows(places, velocities), world))
        speeds = np.linalg.norm(velocities, axis=1)
        for row in np.argsort(-speeds, kind="stable").tolist():
            tip = tuple((places[row] + velocities[row]).tolist())
            labels.append((Label(tip, f"{speeds[row]:.3g} m/s"), world))
    if shown.paths:
        ends = np.concatenate([segments(np.array(line)) for line in shown.paths])
        found.append(Lines("paths", ends, world))
    if "elements" in shown.names and len(measurement.channels) > 1:
        for kind, ends in _array_marks(measurement).items():
            found.append(Lines(kind, ends, transmitter if kind == "transmitters" else receiver))
        across_mm, count = 2e3 * measurement.radar.array_reach_m, len(measurement.channels)
        text = tr("{count} channels within {size:.3g} mm", count=count, size=across_mm)
        above_m = measurement.radar.array_reach_m + measurement.waveform.wavelength_m / 2
        labels.append((Label((0.0, above_m, 0.0), text), receiver))
    system = shown.system
    for kind, matrix in (("transmitter", transmitter), ("receiver", receiver)):
        if system is not None and getattr(system.record, kind).kind not in ("isotropic", "table"):
            found.append(Lines(kind, longest_m * _beam(system, kind), matrix))
    return found, labels


def _cell_at(place: Real, radar: Any, half_angle: float) -> tuple[Real, Label]:
    """Return the outline of the range cell around a place in the receiver's axes, and
    its size [m].
    """
    thick_m = radar.waveform.range_resolution_m
    text = tr(
        "{range}: cell {thickness} x {rate:.3g} m/s",
        range=length_text(float(f"{np.linalg.norm(place):.4g}")),
        thickness=length_text(float(f"{thick_m:.3g}")),
        rate=radar.velocity_resolution_mps,
    )
    return range_cell(place, thick_m, half_angle), Label(tuple(place), text)


def _array_marks(measurement: Measurement) -> dict[str, Real]:
    """Return squares at the elements and crosses at the virtual ones, in the antennas' axes [m]."""
    both = [(one.tx.position_m, one.rx.position_m) for one in measurement.channels]
    transmitters, receivers = (np.array(list(dict.fromkeys(ends))) for ends in zip(*both))
    virtual = np.unique(np.sum(both, axis=1).round(9), axis=0)
    wave_m = measurement.waveform.wavelength_m
    return {
        "transmitters": marks(transmitters, wave_m / 6, False),
        "receivers": marks(receivers, wave_m / 8, False),
        "virtual": marks(virtual, wave_m / 16, True),
    }


def _longest_m(measurement: Any, record: Any) -> float:
    """Return the length of lines: the range limit, or else the extent of the scene [m]."""
    reach_m = 0.0 if record is None else record.extent.from_emitter_m
    return float(measurement.range_stop_m or reach_m or 100.0)


def _pose(matrix: Any) -> tuple[tuple[float, ...], ...]:
    """Rows of a pose without its scale."""
    place, turn, _ = matrix.decompose()
    return tuple(map(tuple, Matrix.Translation(place) @ turn.to_matrix().to_4x4()))


_beams: dict[tuple[int, str], tuple[RadarSystem, Real]] = {}


def _beam(system: RadarSystem, kind: str) -> Real:
    """The edge of a beam at a distance of 1 m; the last ones are kept."""
    key = (id(system), "transmitter" if system.transmitter == system.receiver else kind)
    if key not in _beams:
        if len(_beams) > _MOST_BEAMS:
            _beams.clear()
        antenna, axis = getattr(system, kind), np.array([0.0, 0.0, -1.0])
        if float(antenna.gain(axis)) < antenna.peak_gain * (1 - 1e-9):  # to look for it takes long
            axis = peak_direction(antenna)
        _beams[key] = system, beam(antenna, axis, 1.0)
    return _beams[key][1]


@functools.lru_cache(maxsize=1)
def _shader() -> Any:
    return gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")


class _Drawing(NamedTuple):
    """Overlays ready to be drawn: views draw them at every move of the mouse."""

    of: _Shown | None
    #: Colour, matrix and what Blender draws, by colour.
    lines: list[tuple[tuple[float, ...], Any, Any]]
    texts: list[str]
    #: Places of the texts [Blender units], (n, 3).
    places: Real


#: The last drawing, made again where `_Shown` differs.
_drawings: list[_Drawing] = []


def _drawing(context: bpy.types.Context) -> _Drawing:
    """What is drawn now."""
    shown = _shown(context)
    if _drawings and _drawings[0].of == shown:
        return _drawings[0]
    lines, labels = overlay_lines(context)
    batches = [
        batch_for_shader(_shader(), "LINES", {"pos": one.ends.astype(np.float32)}) for one in lines
    ]
    _drawings[:] = [
        _Drawing(
            shown,
            [(_COLOURS[o.kind], o.matrix, b) for o, b in zip(lines, batches, strict=True)],
            [label.text for label, _ in labels],
            np.array([matrix @ Vector(label.place) for label, matrix in labels]).reshape(-1, 3),
        )
    ]
    return _drawings[0]


def _draw_lines() -> None:
    context = bpy.context
    if not context.space_data.overlay.show_overlays:
        return
    try:
        drawing = _drawing(context)
    except RadarSimError:
        _drawings.clear()
        return  # the panels say what is missing
    shader = _shader()
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL")
    for colour, matrix, batch in drawing.lines:
        with gpu.matrix.push_pop():
            gpu.matrix.multiply_matrix(matrix)
            shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
            shader.uniform_float("lineWidth", _WIDTH_PX * context.preferences.system.ui_scale)
            shader.uniform_float("color", colour)
            batch.draw(shader)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")


def projected(places: Real, matrix: Any, width: float, height: float) -> tuple[Real, Mask]:
    """Return where places (n, 3) are in a view of this size, (n, 2) [px], and which are in it.

    matrix: from the world to the view, with its perspective, (4, 4).
    """
    x, y, _, w = (
        np.array(matrix, dtype=np.float64) @ np.column_stack([places, np.ones(len(places))]).T
    )
    ahead = w > 0
    scale = 0.5 / np.where(ahead, w, 1.0)
    found = np.column_stack([width * (0.5 + x * scale), height * (0.5 + y * scale)])
    inside = ((found >= 0) & (found <= (width, height))).all(axis=1)
    return found, ahead & inside


def without_overlap(places: Real, sizes: Real) -> list[int]:
    """Return which texts to draw: those that overlap no earlier text.

    places, sizes: lower left corners and sizes of their boxes, (n, 2) each [px].
    """
    kept: list[int] = []
    for index in range(len(places)):
        apart = np.abs(places[kept] - places[index]) >= np.where(
            places[kept] < places[index], sizes[kept], sizes[index]
        )
        if apart.any(axis=1).all():
            kept.append(index)
    return kept


def _draw_labels() -> None:
    context = bpy.context
    if not context.space_data.overlay.show_overlays or not _drawings:
        return
    drawing, region = _drawings[0], context.region
    blf.size(0, _FONT_PX * context.preferences.system.ui_scale)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    blf.enable(0, blf.SHADOW)  # readable on any theme
    blf.shadow(0, 5, 0.0, 0.0, 0.0, 1.0)
    matrix = context.region_data.perspective_matrix
    places, inside = projected(drawing.places, matrix, region.width, region.height)
    seen = np.flatnonzero(inside)[:_MOST_LABELS]
    texts = [drawing.texts[index] for index in seen.tolist()]
    sizes = np.array([blf.dimensions(0, text) for text in texts]).reshape(-1, 2)
    for index in without_overlap(places[seen], sizes):
        blf.position(0, *places[seen[index]], 0)
        blf.draw(0, texts[index])
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
    _drawings.clear()
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")
