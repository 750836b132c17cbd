# SPDX-License-Identifier: GPL-3.0-or-later
"""What panels show of the scene: read after it changed and never while a panel is drawn."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any
from weakref import WeakKeyDictionary

import bpy
import numpy as np

from ...arrays import Mask, Real
from ...errors import RadarSimError
from ...findings import Finding, finding, merge
from ..materials import has_no_faces, media_beyond_their_band
from ..nodes import is_radar_material
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
    RADAR_PROPERTY,
    carrier_hz,
    read_measurement,
    settings,
)
from ..scene import (
    PixelSpans,
    Rig,
    active_radar,
    antennas_of,
    echoing_boxes,
    find_rig,
    frame_edges,
    keyed_speeds,
    keyed_step,
    limited_visibility,
    measure_pixel_spans,
    scene_extent,
)
from ..state import Snapshot, take_snapshot

#: Time after the last change at which a scene is read again [s].
_CALM_S = 0.2


@dataclass(frozen=True)
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
    #: Names of the objects without a Radar Material; empty where these are measured, too.
    bare: tuple[str, ...]
    #: Findings about objects that some kinds of rays do not meet.
    visibility: tuple[Finding, ...]
    #: What pixels span of the flat surfaces in view; None without a perspective.
    pixels: PixelSpans | None = None


_records: WeakKeyDictionary[Snapshot, dict[Any, SceneRecord]] = WeakKeyDictionary()
_latest: dict[str, SceneRecord] = {}


def scene_record(context: bpy.types.Context) -> SceneRecord | None:
    """Return what is known of the scene; None before it was first read.

    A scene that changed is read a moment later, and the panels are drawn again. A `RadarSimError`
    where the radar lacks a part.
    """
    snapshot = take_snapshot(context.evaluated_depsgraph_get())
    key = _key(context.scene)
    known = _records.setdefault(snapshot, {})
    if key not in known:
        if not bpy.app.background:
            if not bpy.app.timers.is_registered(_read_later):
                bpy.app.timers.register(_read_later, first_interval=_CALM_S)
            return _latest.get(context.scene.name)
        known[key] = _read(context.scene, snapshot, key)
    return known[key]


def _read_later() -> float | None:
    context = bpy.context
    try:
        key = _key(context.scene)
        snapshot = take_snapshot(context.evaluated_depsgraph_get())
        record = _read(context.scene, snapshot, key)
    except (RadarSimError, AttributeError, ReferenceError):
        return None  # the panels say what is missing
    _records.setdefault(snapshot, {})[key] = record
    _latest[context.scene.name] = record
    redraw_panels(context)
    return None


def redraw_panels(context: bpy.types.Context) -> None:
    """Draw the sidebars again; Blender does not do so by itself for our numbers."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def _key(scene: bpy.types.Scene) -> Any:
    """All that a record depends on besides the snapshot."""
    radar, render = active_radar(scene), scene.render
    view, group = settings(radar), getattr(radar, RADAR_PROPERTY)
    # Frames of the animation, which Time Stretching shows slower than the scene's.
    fps = render.fps / shortest_decimal(render.fps_base) * render.frame_map_old
    return (
        # Looking for the antennas takes as long as all else: they are found when a scene is read.
        (radar, group.camera, group.light, scene.camera, view.sampling_mode),
        check_unit_scale(shortest_decimal(scene.unit_settings.scale_length)),
        any_material_echoes(radar),
        fps / render.frame_map_new,
        view.pulses / view.prf_hz,
        scene.frame_current_final,
        view.width_px / view.height_px,
    )


def rig_of(scene: bpy.types.Scene, radar: Any) -> Rig:
    """Return the camera and the light of a radar; a `SceneError` where one is missing."""
    by_paths = settings(radar).sampling_mode == "paths"
    return find_rig(scene, **antennas_of(scene, radar), any_projection=by_paths)


def any_material_echoes(radar: Any) -> bool:
    """Return whether objects without a Radar Material may echo."""
    view = settings(radar)
    return bool(view.sampling_mode == "paths" and view.range_encoding != "materials")


def _read(scene: bpy.types.Scene, snapshot: Snapshot, key: Any) -> SceneRecord:
    """Walk through the scene."""
    (radar, *_), scale, any_material, fps, span_s, frame, _ = key
    rig = rig_of(scene, radar)
    extent = scene_extent(snapshot, rig, scale, any_material=any_material)
    boxes = echoing_boxes(snapshot, any_material=any_material)
    speeds = keyed_speeds(boxes, (rig.camera, rig.emitter), frame, fps, span_s)
    surfaces = boxes if any_material else echoing_boxes(snapshot, any_material=True)
    visibility = limited_visibility(snapshot)
    names, assigned, unseen = _assigned(surfaces, visibility)
    measured = {name for name in names if any_material or name in assigned} - unseen
    return SceneRecord(
        extent,
        {name: scale * speed for name, speed in speeds.items()},
        _moving(scene, speeds, frame, fps, scale),
        len(names),
        len(measured),
        len(measured & assigned),
        () if any_material else tuple(sorted(names - assigned)),
        tuple(visibility),
        _pixel_spans(radar, rig, boxes, scale),
    )


def _assigned(surfaces: Any, visibility: Iterable[Finding]) -> tuple[set[str], set[str], set[str]]:
    """Return the names of the objects with a surface, of those that have a Radar Material, and of
    those without a direct echo.
    """
    is_radar, shapes = cache(is_radar_material), surfaces.snapshot.shapes
    has = surfaces.snapshot.of_shapes([any(map(is_radar, one.materials)) for one in shapes])
    solid = surfaces.snapshot.of_shapes([not has_no_faces(one.original) for one in shapes])
    names, number = surfaces.labels()

    def some(kept: Mask) -> set[str]:
        return {names[n] for n in np.unique(number[kept[surfaces.rows]]).tolist()}

    hidden = {
        name for one in visibility if one.code == "hidden-from-receiver" for name in one.subjects
    }
    unseen = {name for name in names if hidden.intersection((name, *name.split("/")))}
    return some(solid), some(solid & has), unseen


def _pixel_spans(radar: Any, rig: Rig, boxes: Any, metres: float) -> PixelSpans | None:
    """What pixels span of the flat surfaces in view."""
    camera, view = rig.camera, settings(radar)
    if camera.data.type != "PERSP":
        return None
    edges = frame_edges(camera.data, view.width_px, view.height_px, metres)
    matrix = np.array(camera.matrix_world, dtype=np.float64)
    return measure_pixel_spans(boxes, matrix, edges, metres)


def _moving(
    scene: bpy.types.Scene, names: Iterable[str], frame: float, fps: float, metres: float
) -> dict[str, Real]:
    """Place and velocity of objects that F-curves move, by name, (2, 3) [m, m/s]."""
    found: dict[str, Real] = {}
    for name in names:
        item = scene.objects.get(name)
        if item is None:
            continue
        step = keyed_step(item, frame)
        if step is not None and step.any():
            place = np.array(item.matrix_world.translation, dtype=np.float64)
            found[name] = metres * np.stack([place, step * fps])
    return found


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
    found += media_beyond_their_band(carrier_hz(scene), view.beyond_band)
    if record is not None and record.bare:
        found.append(finding("no-radar-material", *record.bare))
    found += [] if record is None else record.visibility
    return merge(found)


def current_measurement(scene: bpy.types.Scene) -> tuple[Measurement | None, str]:
    """Return what the settings ask for, or None and what is wrong with them."""
    try:
        check_unit_scale(shortest_decimal(scene.unit_settings.scale_length))
        return read_measurement(scene), ""
    except RadarSimError as error:
        return None, str(error)
