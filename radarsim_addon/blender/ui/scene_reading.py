# SPDX-License-Identifier: GPL-3.0-or-later
"""What panels and overlays show of the scene: its latest record. Drawing reads nothing.

A timer reads the scene once edits are calm, in slices of a few milliseconds (`_read_slice`), and
has the panels drawn again. Blender reports what it evaluates; settings, which it does not report,
are compared whenever a panel is drawn.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import bpy
import numpy as np

from ...arrays import Real
from ...errors import RadarSimError, SceneError
from ...findings import Finding, finding, merge
from ..materials import (
    SURFACE_TYPES,
    foreign_objects,
    has_no_faces,
    media_beyond_their_band,
    slot_materials,
)
from ..nodes import is_radar_material
from ..nodes.shader_trees import is_fog
from ..plan import (
    Extent,
    Measurement,
    automatic_rings,
    check_unit_scale,
    config_findings,
    find_coarse_pixels,
    shortest_decimal,
)
from ..rig_settings import (
    PROGRESS_PROPERTY,
    RADAR_PROPERTY,
    carrier_hz,
    read_measurement,
    settings,
)
from ..scene import (
    Boxes,
    PixelSpans,
    Rig,
    active_radar,
    antenna_positions,
    antennas_of,
    echoing_boxes,
    extent_of_boxes,
    find_rig,
    frame_edges,
    hidden_objects,
    is_transmitter,
    keyed_speeds,
    keyed_step,
    measure_pixel_spans,
    nothing_moves,
    ray_flags,
    rendered_objects,
    sizes_in_parts,
    visibility_in_parts,
)
from ..state import Shape, Snapshot, context_snapshot, part_of_snapshot, watch_evaluations
from .fields import is_refused, may_write_at_need

#: Time after the last change at which a scene is read again, and from slice to slice [s].
_CALM_S, _PAUSE_S = 0.2, 0.005
#: Time after which a slice ends with the part that is being read [s].
_SLICE_S = 0.006
#: Objects of one part: whose F-curves are read, and whose materials are looked at.
_KEYED, _SHAPES = 2, 128


@dataclass(frozen=True, eq=False)
class SceneRecord:
    """What the checklist, the time estimate and the overlays read."""

    #: How far the scene reaches.
    extent: Extent
    #: Largest |range rate| of what F-curves move, in a burst at this frame, by object [m/s].
    speeds_mps: Mapping[str, float]
    #: Place and velocity of these objects, by name, each (2, 3) [m, m/s].
    moving: Mapping[str, Real]
    #: Number of objects with a surface that renders; all instances of an object are one.
    surfaces: int
    #: How many of them can return a direct echo.
    measured: int
    #: How many of the measured ones have a Radar Material.
    assigned: int
    #: Names of the objects without a Radar Material that are therefore not measured.
    bare: tuple[str, ...]
    #: Names of the objects that are measured with the powers of optical materials.
    optical: tuple[str, ...]
    #: Names of the materials of what is measured.
    materials: tuple[str, ...]
    #: Findings about objects that some kinds of rays do not meet.
    visibility: tuple[Finding, ...]
    #: Findings about sizes and up axes that do not fit the names of objects.
    sizes: tuple[Finding, ...]
    #: What pixels span of the flat surfaces in view; None without a perspective.
    pixels: PixelSpans | None = None


@dataclass
class _Reader:
    """What was read last, and what is being read."""

    #: By scene: the settings of a reading, and its record or why there is none.
    latest: dict[int, tuple[Any, SceneRecord | str]] = field(default_factory=dict)
    #: By radar: the antennas that were found last.
    rigs: dict[int, Rig] = field(default_factory=dict)
    #: Whether Blender has evaluated something since the last part was read, and when.
    changed: bool = True
    changed_s: float = -math.inf
    #: Snapshot and settings that are read or were read last.
    of: tuple[Snapshot, Any] | None = None
    reading: Iterator[SceneRecord | None] | None = None
    #: Ends the reports of evaluations.
    stop: Callable[[], None] | None = None


_reader = _Reader()


def scene_record(context: bpy.types.Context) -> SceneRecord | None:
    """Return what was last read of the scene; None before that.

    A scene that has changed is read once edits are calm, and the panels are drawn again. A
    `RadarSimError` where the radar lacks a part.
    """
    if _reader.stop is None:
        _reader.stop = watch_evaluations(_note)
    key = _key(context.scene)
    of, found = _reader.latest.get(context.scene.session_uid, (None, None))
    waits = bpy.app.background or bpy.app.timers.is_registered(_read_slice)
    if (_reader.changed or of != key) and not waits:
        bpy.app.timers.register(_read_slice, first_interval=_CALM_S)
    if isinstance(found, str):
        raise SceneError(found)
    return found


def read_now(context: bpy.types.Context) -> None:
    """Read all of the scene at once, if it has changed, for `scene_record`."""
    if _begin(context, context_snapshot(context)):
        while not _read_part(context.scene):
            pass


def _note(depsgraph: Any) -> None:
    """Note an evaluation; None: some may have been missed. Renders have depsgraphs of their own."""
    if depsgraph is None or depsgraph.mode == "VIEWPORT":
        _reader.changed, _reader.changed_s = True, time.monotonic()


@may_write_at_need
def _read_slice() -> float | None:
    """Read for some milliseconds; return the time to the next slice [s], None at the end."""
    calm_in_s = _reader.changed_s + _CALM_S - time.monotonic()
    if _reader.changed and calm_in_s > 0:
        return calm_in_s
    context = bpy.context
    try:
        snapshot = part_of_snapshot(context)  # evaluates an edit, which may take longer
        end_s = time.perf_counter() + _SLICE_S
        while snapshot is None:
            if time.perf_counter() >= end_s:
                return _PAUSE_S
            snapshot = part_of_snapshot(context)
        ended = not _begin(context, snapshot) or _read_part(context.scene)
        while not ended and time.perf_counter() < end_s:
            ended = _read_part(context.scene)
    except ReferenceError:  # an object was removed while it was read
        ended = False
    except AttributeError as error:
        if is_refused(error):
            raise
        return None  # the extension was disabled
    if ended:
        _redraw_record(context)
    return None if ended else _PAUSE_S


def _begin(context: bpy.types.Context, snapshot: Snapshot) -> bool:
    """Begin to read the scene if it has changed; return whether there is something to be read."""
    scene = context.scene
    if current_measurement(scene)[0] is None:
        return False  # the panels say what is wrong
    now = snapshot, _key(scene)
    if _reader.of is None or _reader.of[0] is not now[0] or _reader.of[1] != now[1]:
        _reader.of, _reader.reading = now, _read(scene, now[0])
    _reader.changed = False
    return _reader.reading is not None


def _read_part(scene: bpy.types.Scene) -> bool:
    """Read one part of the scene; return whether it was the last."""
    assert _reader.of is not None and _reader.reading is not None
    try:
        found: SceneRecord | str | None = next(_reader.reading)
    except RadarSimError as error:
        found = str(error)
    except BaseException:
        _reader.of = None  # what has failed cannot go on
        raise
    if found is not None:
        _reader.latest[scene.session_uid], _reader.reading = (_reader.of[1], found), None
    return found is not None


def redraw_panels(context: bpy.types.Context) -> None:
    """Draw the 3D views and their sidebars again; Blender does not do so for our numbers."""
    for area in _views(context):
        area.tag_redraw()


def _views(context: bpy.types.Context) -> list[Any]:
    """3D views of all windows."""
    areas = (area for one in context.window_manager.windows for area in one.screen.areas)
    return [area for area in areas if area.type == "VIEW_3D"]


def _redraw_record(context: bpy.types.Context) -> None:
    """Draw what shows the record: sidebars, and the views where overlays depend on it.

    To draw a view of a large scene takes long.
    """
    measurement, _ = current_measurement(context.scene)
    moving = getattr(context.window_manager, PROGRESS_PROPERTY).overlay_velocities
    if moving or measurement is None or not measurement.range_stop_m:
        redraw_panels(context)
        return
    for area in _views(context):
        for region in area.regions:
            if region.type == "UI":
                region.tag_redraw()


def _key(scene: bpy.types.Scene) -> Any:
    """All that a record depends on besides the snapshot."""
    radar = active_radar(scene)
    view, group = settings(radar), getattr(radar, RADAR_PROPERTY)
    return (
        scene.session_uid,
        *(item and item.session_uid for item in (radar, group.camera, group.light, scene.camera)),
        check_unit_scale(shortest_decimal(scene.unit_settings.scale_length)),
        any_material_echoes(radar),
        _timing(scene, view),
        view.sampling_mode,
        view.width_px / view.height_px,
    )


def _timing(scene: bpy.types.Scene, view: Any) -> tuple[float, float, float]:
    """Frame, frames of the animation per second, and duration of a burst [s].

    Time Stretching shows the animation slower than the scene's frames.
    """
    render = scene.render
    fps = render.fps / shortest_decimal(render.fps_base) * render.frame_map_old
    return scene.frame_current_final, fps / render.frame_map_new, view.pulses / view.prf_hz


def rig_of(scene: bpy.types.Scene, radar: Any) -> Rig:
    """Return the camera and the light of a radar; a `SceneError` where one is missing."""
    by_paths = settings(radar).sampling_mode == "paths"
    return find_rig(scene, **antennas_of(scene, radar), any_projection=by_paths)


def shown_rig(scene: bpy.types.Scene, radar: Any) -> Rig:
    """Return `rig_of`, for drawing: objects are searched for antennas only where those that were
    found last no longer fit, and whenever the scene is read.
    """
    known = _reader.rigs.get(radar.session_uid)
    with contextlib.suppress(ReferenceError):
        if known is not None and _fits(scene, radar, known):
            return known
    _reader.rigs[radar.session_uid] = found = rig_of(scene, radar)
    return found


def _fits(scene: bpy.types.Scene, radar: Any, rig: Rig) -> bool:
    """Return whether a rig still has what `rig_of` asks for, if nothing was added."""
    group, (camera, emitter) = getattr(radar, RADAR_PROPERTY), (rig.camera, rig.emitter)
    return (
        group.camera in (None, camera)
        and group.light in (None, emitter)
        and (camera == scene.camera or camera.parent == emitter.parent)
        and radar in (emitter.parent, emitter)
        and is_transmitter(emitter)
        and emitter.data.energy > 0
        and not emitter.hide_render
        and (camera.data.type == "PERSP" or settings(radar).sampling_mode == "paths")
        and all(item.name in scene.objects for item in (camera, emitter))
    )


def any_material_echoes(radar: Any) -> bool:
    """Return whether objects without a Radar Material may echo."""
    view = settings(radar)
    return bool(view.sampling_mode == "paths" and view.range_encoding != "materials")


# -- the record ------------------------------------------------------------------------------------


def _read(scene: bpy.types.Scene, snapshot: Snapshot) -> Iterator[SceneRecord | None]:
    """Yield the record of a scene, and None after each part before."""
    radar = active_radar(scene)
    any_material = any_material_echoes(radar)
    metres = check_unit_scale(shortest_decimal(scene.unit_settings.scale_length))
    _reader.rigs[radar.session_uid] = rig = rig_of(scene, radar)
    yield None
    surfaces = echoing_boxes(snapshot, any_material=True)
    yield None
    boxes = surfaces if any_material else echoing_boxes(snapshot, any_material=False)
    yield None
    extent = extent_of_boxes(boxes, antenna_positions(snapshot, rig), metres)
    yield None
    frame, fps, span_s = _timing(scene, settings(radar))
    speeds: dict[str, float] = {}
    moving: dict[str, Real] = {}
    for part in _keyed_parts(boxes, rig):
        yield None
        found = keyed_speeds(part, (rig.camera, rig.emitter), frame, fps, span_s)
        speeds |= {name: metres * speed for name, speed in found.items()}
        for row in part.rows.tolist() if found else ():
            item = snapshot.shapes[snapshot.layout.shape[row]].original
            step = keyed_step(item, frame)
            if step is not None and step.any():
                place = snapshot.matrix(row)[:3, 3]
                moving[snapshot.label(row)] = metres * np.stack([place, step * fps])
    yield None
    visibility = yield from visibility_in_parts(snapshot, surfaces.rows)
    yield None
    objects = yield from _objects(surfaces, visibility)
    sizes = yield from sizes_in_parts(surfaces, metres)
    yield None
    pixels = yield from _pixel_spans(radar, rig, boxes, metres)
    yield None
    measured = {
        name: one for name, one in objects.items() if one.seen and (any_material or one.is_radar)
    }
    yield SceneRecord(
        extent,
        speeds,
        moving,
        len(objects),
        len(measured),
        sum(one.is_radar for one in measured.values()),
        () if any_material else tuple(sorted(n for n, one in objects.items() if not one.is_radar)),
        tuple(sorted({o.name for o in measured.values() if any_material and o.is_optical})),
        tuple(sorted({name for one in measured.values() for name in one.materials})),
        tuple(visibility),
        tuple(merge(sizes)),
        pixels,
    )


def _keyed_parts(boxes: Boxes, rig: Rig) -> Iterator[Boxes]:
    """Yield the boxes of a few objects after the other, without those that cannot have a rate."""
    snapshot, layout = boxes.snapshot, boxes.snapshot.layout
    rows = boxes.rows[layout.instancer[boxes.rows] < 0]
    if nothing_moves(rig.camera) and nothing_moves(rig.emitter):
        owners = [snapshot.shapes[index].original for index in layout.shape[rows].tolist()]
        rows = rows[np.array([not nothing_moves(item) for item in owners], dtype=bool)]
    for start in range(0, rows.size, _KEYED):
        yield Boxes(snapshot, rows[start : start + _KEYED])


@dataclass(frozen=True)
class _Surface:
    """What counts of an object with a surface, and of its instances by one instancer."""

    name: str
    #: Whether rays from the receiver meet it, and it may return something.
    seen: bool
    is_radar: bool
    #: Whether a face has another material than a Radar Material, or none.
    is_optical: bool
    materials: tuple[str, ...]


def _objects(
    surfaces: Boxes, visibility: Iterable[Finding]
) -> Generator[None, None, dict[str, _Surface]]:
    """Yield after parts; return the objects of these surfaces, and those that the viewport hides,
    by label.
    """
    snapshot, layer = surfaces.snapshot, surfaces.snapshot.view_layer
    is_radar = cache(is_radar_material)
    known = cache(lambda material: is_radar_material(material) or is_fog(material))
    labels, number = surfaces.labels()
    yield None
    unseen = {
        name for one in visibility if one.code == "hidden-from-receiver" for name in one.subjects
    }
    found: dict[str, _Surface] = {}
    pairs = np.unique(np.column_stack([number, snapshot.layout.shape[surfaces.rows]]), axis=0)
    for count, (index, shape_index) in enumerate(pairs.tolist()):
        if count % _SHAPES == 0:
            yield None
        label, shape = labels[index], snapshot.shapes[shape_index]
        if has_no_faces(shape.original) or _is_all_fog(shape.materials):
            continue
        before = found.get(label)  # Geometry Nodes give instances other data
        found[label] = _Surface(
            shape.original.name,
            unseen.isdisjoint((label, *label.split("/"))),
            any(map(is_radar, shape.materials)) or (before is not None and before.is_radar),
            _is_optical(snapshot, shape, known) or (before is not None and before.is_optical),
            tuple(one.name for one in shape.materials if one is not None),
        )
    yield None
    hidden = hidden_objects(snapshot, rendered_objects(layer))
    flags = ray_flags(hidden, layer)
    for item, (seen, _, echoing) in zip(hidden, flags.T.tolist(), strict=True):
        slots = slot_materials(item)
        if item.type in SURFACE_TYPES and not (has_no_faces(item) or _is_all_fog(slots)):
            found[item.name_full] = _Surface(
                item.name,
                seen and echoing,
                any(map(is_radar, slots)),
                not all(map(known, slots or (None,))),
                tuple(one.name for one in slots if one is not None),
            )
    return found


def _is_all_fog(slots: tuple[Any, ...]) -> bool:
    """Whether an object with these materials has volumes and no surface: it is not measured."""
    return bool(slots) and all(map(is_fog, slots))


def _is_optical(snapshot: Snapshot, shape: Shape, known: Callable[[Any], bool]) -> bool:
    """Whether a face of a shape has a material that is not known, or none."""
    slots = [known(one) for one in shape.materials or (None,)]
    if not any(slots) and shape.kind != "CURVES":  # faces decide only where slots differ
        return snapshot.face_count(shape) > 0
    alone = dataclasses.replace(snapshot, shapes=[shape])
    return not all(slots) and any(True for _ in foreign_objects(alone, known))


def _pixel_spans(
    radar: Any, rig: Rig, boxes: Boxes, metres: float
) -> Generator[None, None, PixelSpans | None]:
    """Yield before parts; return what pixels span of the flat surfaces in view."""
    camera, view = rig.camera, settings(radar)
    if camera.data.type != "PERSP":
        return None
    edges = frame_edges(camera.data, view.width_px, view.height_px, metres)
    matrix = np.array(camera.matrix_world, dtype=np.float64)
    return (yield from measure_pixel_spans(boxes, matrix, edges, metres))


def quick_findings(
    scene: bpy.types.Scene, measurement: Measurement, record: SceneRecord | None
) -> list[Finding]:
    """Return what is known to mislead without a look at meshes, one finding a code."""
    view = settings(active_radar(scene))
    extent = Extent() if record is None else record.extent
    farthest_m = extent.from_emitter_m or None
    frame_s = shortest_decimal(scene.render.fps_base) / scene.render.fps
    frames = measurement.frames
    by_rings = view.sampling_mode == "rings"
    found = config_findings(
        measurement,
        (measurement.rings or automatic_rings(measurement.ring_step_m, extent)) if by_rings else 1,
        farthest_m,
        (frames[1] - frames[0]) * frame_s if len(frames) > 1 else None,
        view.sampling_mode,
        (scene.frame_end - scene.frame_start) * frame_s,
        {} if record is None else record.speeds_mps,
    )
    if record is not None and record.pixels is not None:
        across, pixels = measurement.width_px, record.pixels
        limit_m = measurement.range_stop_m or np.inf
        if measurement.radar.waveform.kind == "fmcw":  # beyond, nothing is received
            limit_m = min(limit_m, measurement.radar.unambiguous_range_m)
        sizes_px = {name: size * across / pixels.width for name, size in pixels.sizes.items()}
        steps_m = pixels.longest_m(across, limit_m)
        found += find_coarse_pixels(measurement, view.sampling_mode, steps_m, sizes_px)
    if record is None:
        return merge(found)
    materials = [one for one in map(bpy.data.materials.get, record.materials) if one is not None]
    found += media_beyond_their_band(carrier_hz(scene), view.beyond_band, materials)
    if record.bare:
        found.append(finding("no-radar-material", *record.bare))
    if record.optical:
        found.append(finding("optical-material", *record.optical))
    return merge([*found, *record.visibility, *record.sizes])


def current_measurement(scene: bpy.types.Scene) -> tuple[Measurement | None, str]:
    """Return what the settings ask for, or None and what is wrong with them."""
    try:
        check_unit_scale(shortest_decimal(scene.unit_settings.scale_length))
        return read_measurement(scene), ""
    except RadarSimError as error:
        return None, str(error)
