# SPDX-License-Identifier: GPL-3.0-or-later
"""Sidebar tab "Radar" of the 3D view. Panels draw; they change nothing."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import bpy

from ...errors import RadarSimError
from ...findings import Finding, length_text, merge
from ...options import declared
from ..materials import media_beyond_their_band
from ..plan import (
    Extent,
    Measurement,
    automatic_rings,
    check_unit_scale,
    config_findings,
    shortest_decimal,
)
from ..rig_settings import (
    PROGRESS_PROPERTY,
    RADAR_PROPERTY,
    RADAR_SETTINGS,
    WAVEFORMS,
    beyond_band,
    carrier_hz,
    read_measurement,
    read_path_options,
    settings,
)
from ..scene import (
    ACTIVE_RADAR_PROPERTY,
    Rig,
    active_radar,
    antennas_of,
    echoes,
    echoing_boxes,
    find_rig,
    keyed_speeds,
    radars,
    scene_extent,
)
from ..state import Snapshot, take_snapshot
from .fields import ActiveRadarPanel, RadarPanel, active_group, draw_fields, wrapped
from .material_names import draw_suggestions
from .preset_menu import RADARSIM_PT_presets
from .shown_findings import draw_findings, read_findings

#: How far the scene reaches, by what has been evaluated: panels draw at every move of the mouse.
_extents: WeakKeyDictionary[Snapshot, dict[Any, Extent]] = WeakKeyDictionary()
#: The same of speeds.
_keyed_speeds: WeakKeyDictionary[Snapshot, dict[Any, dict[str, float]]] = WeakKeyDictionary()


class RADARSIM_PT_rig(RadarPanel, bpy.types.Panel):
    bl_label = "Radar"
    bl_idname = "RADARSIM_PT_rig"

    def draw_header_preset(self, context: Any) -> None:
        if active_group(context.scene) is not None:
            RADARSIM_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: Any) -> None:
        layout = self.layout
        layout.operator("radarsim.setup_rig", icon="OUTLINER_OB_CAMERA")
        if len(radars(context.scene)) > 1:
            layout.prop(context.scene, ACTIVE_RADAR_PROPERTY)
        try:
            radar = active_radar(context.scene)
            group = getattr(radar, RADAR_PROPERTY)
            column = layout.column(align=True)
            column.prop(group, "camera")
            column.prop(group, "light")
            rig = _rig(context.scene, radar)
        except RadarSimError as error:
            wrapped(context, layout, str(error), "INFO")
            return
        layout.label(text=f"{rig.camera.name} and {rig.emitter.name}", icon="CHECKMARK")
        # With a link budget the light's power cancels: it is the light level of the renders.
        text = "Light" if group.use_link_budget else "EIRP"
        layout.prop(rig.emitter.data, "energy", text=text)
        draw_fields(layout, group, RADAR_SETTINGS, "range_start_m", "range_stop_m")


class RADARSIM_PT_material(RadarPanel, bpy.types.Panel):
    bl_label = "Material"
    bl_idname = "RADARSIM_PT_material"

    def draw(self, context: Any) -> None:
        layout = self.layout
        state = getattr(context.window_manager, PROGRESS_PROPERTY)
        column = layout.column(align=True)
        column.prop(state, "preset", text="")
        button = column.operator("radarsim.assign_material", icon="MATERIAL")
        button.preset = state.preset
        draw_suggestions(context, layout)
        layout.operator("radarsim.add_asset_library", icon="ASSET_MANAGER")
        item = context.active_object
        if item is not None and item.type == "MESH":
            known = echoes(item)
            layout.label(
                text=f"{item.name}: " + ("Radar Material" if known else "no Radar Material"),
                icon="CHECKMARK" if known else "INFO",
            )
        group = active_group(context.scene)
        if group is None:
            return
        layout.prop(group, "polarisation")
        layout.prop(group, "beyond_band")
        column = layout.column(align=True)
        column.label(text="Extinction is normalised to:")
        column.row(align=True).prop(group, "extinction", expand=True)
        if group.extinction == "length":
            column.prop(group, "extinction_length_m")
            if not group.extinction_length_m:
                column.label(text="0: one Blender unit")


class RADARSIM_PT_waveform(ActiveRadarPanel, bpy.types.Panel):
    bl_label = "Waveform"
    bl_idname = "RADARSIM_PT_waveform"

    def draw(self, context: Any) -> None:
        layout = self.layout
        group = active_group(context.scene)
        layout.prop(group, "waveform_kind", text="")
        if group.waveform_kind == "file":
            draw_fields(layout, group, RADAR_SETTINGS, "carrier_hz", "waveform_file")
        else:
            draw_fields(layout, group, declared(WAVEFORMS[group.waveform_kind]))
        if group.waveform_kind == "lfm":
            layout.prop(group, "fm_rate_mhz_per_us")
        draw_fields(layout, group, RADAR_SETTINGS, "prf_hz", "pulses")
        scene = context.scene
        outside = media_beyond_their_band(carrier_hz(scene), beyond_band(scene))
        draw_findings(context, layout, merge(outside))
        measurement = _measurement(context, layout)
        if measurement is None:
            return
        radar = measurement.radar
        box = layout.box().column(align=True)
        box.label(text=f"Range resolution: {radar.waveform.range_resolution_m:.4g} m")
        box.label(text=f"Unambiguous range: {length_text(radar.unambiguous_range_m)}")
        box.label(text=f"Max. velocity: {radar.max_unambiguous_velocity_mps:.4g} m/s")
        box.label(text=f"Velocity resolution: {radar.velocity_resolution_mps:.4g} m/s")
        box.label(text=f"Burst: {radar.burst.pulses / radar.burst.prf_hz * 1e3:.4g} ms")


class RADARSIM_PT_rings(ActiveRadarPanel, bpy.types.Panel):
    bl_label = "Sampling"
    bl_idname = "RADARSIM_PT_rings"

    def draw(self, context: Any) -> None:
        layout = self.layout
        group = active_group(context.scene)
        layout.row().prop(group, "sampling_mode", expand=True)
        draw_fields(layout, group, RADAR_SETTINGS, *_SAMPLING[group.sampling_mode])


#: Settings of a sampling mode, in the order of the panel.
_SAMPLING = {
    "rings": (
        "rings", "ring_step_m", "max_reflections", "snapshots", "snapshot_interval_s", "samples",
    ),
    "paths": (
        "max_reflections", "replicates", "max_standard_error", "refine_for", "time_limit_s",
        "motion", "motion_samples", "visibility_updates", "range_encoding", "amplitude_channel",
    ),
}  # fmt: skip


class RADARSIM_PT_render(ActiveRadarPanel, bpy.types.Panel):
    bl_label = "Render"
    bl_idname = "RADARSIM_PT_render"

    def draw(self, context: Any) -> None:
        layout = self.layout
        group = active_group(context.scene)
        fields = ["frame_mode", "width_px", "height_px", "seed", "output_folder", "overwrite"]
        if group.frame_mode == "range":
            fields[1:1] = ["frame_start", "frame_end", "frame_step"]
        draw_fields(layout, group, RADAR_SETTINGS, *fields)
        if group.sampling_mode == "rings":
            shown = _draw_plan(context, layout)
        else:
            shown = _draw_path_plan(context, layout)
        layout.operator("radarsim.render_frames", icon="RENDER_ANIMATION")
        _draw_progress(context, layout, shown)


class RADARSIM_PT_results(RadarPanel, bpy.types.Panel):
    bl_label = "Results"
    bl_idname = "RADARSIM_PT_results"

    def draw(self, context: Any) -> None:
        layout = self.layout
        layout.operator("radarsim.process_last_run", icon="GRAPH")
        layout.operator("radarsim.open_output", icon="FILE_FOLDER")


def _draw_plan(context: Any, layout: Any) -> list[Finding]:
    """Number of renders, and findings where numbers do not fit together; returns the findings."""
    measurement = _measurement(context, layout)
    if measurement is None:
        return []
    rings = measurement.rings
    try:
        extent = _extent(context)
        if not rings and extent is not None:
            rings = automatic_rings(measurement.ring_step_m, extent)
    except RadarSimError as error:
        wrapped(context, layout, str(error), "ERROR")
        return []
    farthest_m = extent.from_emitter_m or None if extent is not None else None
    if not rings:
        layout.label(text=f"{measurement.renders(1)} renders for each ring")
        return []
    box = layout.box().column(align=True)
    box.label(text=f"{measurement.renders(rings)} renders")
    box.label(text=f"{rings} rings to {length_text(rings * measurement.ring_step_m)}")
    if farthest_m is not None:
        box.label(text=f"Scene reaches {length_text(farthest_m)}")
    return _draw_findings(context, layout, measurement, rings, farthest_m)


def _draw_findings(
    context: Any, layout: Any, measurement: Measurement, rings: int, farthest_m: float | None
) -> list[Finding]:
    """Findings where numbers do not fit together; returns them."""
    scene = context.scene
    frame_s = shortest_decimal(scene.render.fps_base) / scene.render.fps
    interval_s = None
    if len(measurement.frames) > 1:
        interval_s = (measurement.frames[1] - measurement.frames[0]) * frame_s
    found = config_findings(
        measurement,
        rings,
        farthest_m,
        interval_s,
        settings(active_radar(scene)).sampling_mode,
        (scene.frame_end - scene.frame_start) * frame_s,
        _speeds(context, measurement),
    )
    draw_findings(context, layout, found)
    return found


def _draw_path_plan(context: Any, layout: Any) -> list[Finding]:
    """What the acquisition "paths" will do; how many renders it takes shows as they are made."""
    measurement = _measurement(context, layout)
    if measurement is None:
        return []
    try:
        options = read_path_options(active_radar(context.scene))
        extent = _extent(context)
    except RadarSimError as error:
        wrapped(context, layout, str(error), "ERROR")
        return []
    rays = measurement.width_px * measurement.height_px * options.replicates
    box = layout.box().column(align=True)
    box.label(text=f"Frames: {len(measurement.frames)}, of {rays:,} rays at first")
    box.label(text="Tiles are refined" if options.refines else "No refinement")
    farthest_m = extent.from_emitter_m or None if extent is not None else None
    return _draw_findings(context, layout, measurement, 1, farthest_m)


def _draw_progress(context: Any, layout: Any, shown: list[Finding]) -> None:
    """How far the run is; its findings without those that are `shown` already."""
    progress = getattr(context.window_manager, PROGRESS_PROPERTY)
    if progress.running:
        layout.progress(factor=progress.fraction, text=f"{progress.fraction * 100:.0f} %")
        layout.label(text=progress.text)
        layout.label(text="Esc stops", icon="EVENT_ESC")
    elif progress.text:
        wrapped(context, layout, progress.text, "INFO")
    draw_findings(
        context, layout, [item for item in read_findings(progress.findings) if item not in shown]
    )


def _measurement(context: Any, layout: Any) -> Measurement | None:
    """The scene's settings, or their error drawn."""
    try:
        return read_measurement(context.scene)
    except RadarSimError as error:
        wrapped(context, layout, str(error), "ERROR")
        return None


def _extent(context: Any) -> Extent | None:
    """How far the scene reaches now; None without a radar.

    With paths, where objects of any material may echo, all that is rendered counts.

    Raises
    ------
    ConfigError
        The scene's Unit Scale is no positive number.
    """
    try:
        radar = active_radar(context.scene)
        rig = _rig(context.scene, radar)
    except RadarSimError:
        return None
    scale = check_unit_scale(shortest_decimal(context.scene.unit_settings.scale_length))
    depsgraph = context.evaluated_depsgraph_get()
    key = (radar, rig, scale, _by_paths(radar))
    known = _extents.setdefault(take_snapshot(depsgraph), {})
    if key not in known:
        known[key] = scene_extent(depsgraph, rig, scale, any_material=key[-1])
    return known[key]


def _speeds(context: Any, measurement: Measurement) -> dict[str, float]:
    """Largest |range rate| of what F-curves move, in a burst at this frame, by object [m/s]."""
    scene, burst = context.scene, measurement.burst
    try:
        radar = active_radar(scene)
        rig = _rig(scene, radar)
        scale = check_unit_scale(shortest_decimal(scene.unit_settings.scale_length))
    except RadarSimError:
        return {}
    depsgraph = context.evaluated_depsgraph_get()
    fps = scene.render.fps / shortest_decimal(scene.render.fps_base)
    span_s, frame = burst.pulses / burst.prf_hz, scene.frame_current_final
    key = (rig, scale, _by_paths(radar), fps, span_s, frame)
    known = _keyed_speeds.setdefault(take_snapshot(depsgraph), {})
    if key not in known:
        found = echoing_boxes(depsgraph, any_material=_by_paths(radar))
        speeds = keyed_speeds(found, (rig.camera, rig.emitter), frame, fps, span_s)
        known[key] = {name: scale * speed for name, speed in speeds.items()}
    return known[key]


def _by_paths(radar: Any) -> bool:
    return bool(settings(radar).sampling_mode == "paths")


def _rig(scene: Any, radar: Any) -> Rig:
    return find_rig(scene, **antennas_of(scene, radar), any_projection=_by_paths(radar))


#: What the radar is; the power budget stands below these.
RADAR_CLASSES: tuple[type, ...] = (RADARSIM_PT_rig, RADARSIM_PT_material, RADARSIM_PT_waveform)
#: What a run is.
RUN_CLASSES: tuple[type, ...] = (
    RADARSIM_PT_rings,
    RADARSIM_PT_render,
    RADARSIM_PT_results,
)
