# SPDX-License-Identifier: GPL-3.0-or-later
"""Sidebar tab "Radar" of the 3D view. Panels draw; they change nothing."""

from __future__ import annotations

import textwrap
from typing import Any

import bpy

from ...errors import RadarSimError
from ...signal.radar import length_text
from ..plan import (
    Extent,
    Measurement,
    automatic_rings,
    check_unit_scale,
    derive,
    shortest_decimal,
    warnings_for,
)
from ..scene import echoes, find_rig, scene_extent
from ..settings import PROGRESS_PROPERTY, SCENE_PROPERTY, WAVEFORM_SETTINGS, read_path_options
from ..settings import radar as properties

#: Instances looked at while drawing; larger scenes show their number of rings when rendering.
_DRAWN_INSTANCES = 2000


class _RadarPanel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Radar"


class RADARSIM_PT_rig(_RadarPanel, bpy.types.Panel):
    bl_label = "Rig"
    bl_idname = "RADARSIM_PT_rig"

    def draw(self, context: Any) -> None:
        layout = self.layout
        settings = getattr(context.scene, SCENE_PROPERTY)
        layout.operator("radarsim.setup_rig", icon="OUTLINER_OB_CAMERA")
        column = layout.column(align=True)
        column.prop(settings, "camera")
        column.prop(settings, "emitter")
        try:
            rig = find_rig(context.scene, settings.camera, settings.emitter, _any_camera(settings))
        except RadarSimError as error:
            wrapped(context, layout, str(error), "INFO")
            return
        layout.label(text=f"{rig.camera.name} and {rig.emitter.name}", icon="CHECKMARK")
        # With a power budget the lamp's power cancels: it is the light level of the renders.
        layout.prop(rig.emitter.data, "energy", text="Lamp" if settings.use_system else "EIRP")


class RADARSIM_PT_material(_RadarPanel, bpy.types.Panel):
    bl_label = "Material"
    bl_idname = "RADARSIM_PT_material"

    def draw(self, context: Any) -> None:
        layout = self.layout
        settings = getattr(context.scene, SCENE_PROPERTY)
        layout.prop(settings, "preset", text="")
        layout.operator("radarsim.assign_material", icon="MATERIAL")
        layout.operator("radarsim.add_asset_library", icon="ASSET_MANAGER")
        item = context.active_object
        if item is not None and item.type == "MESH":
            known = echoes(item)
            layout.label(
                text=f"{item.name}: " + ("Radar Material" if known else "no Radar Material"),
                icon="CHECKMARK" if known else "INFO",
            )
        layout.prop(settings, "polarisation")
        column = layout.column(align=True)
        column.label(text="Extinction is normalised to:")
        column.row(align=True).prop(settings, "extinction", expand=True)
        if settings.extinction == "LENGTH":
            column.prop(settings, "extinction_length_m")
            if not settings.extinction_length_m:
                column.label(text="0: one Blender unit")


class RADARSIM_PT_waveform(_RadarPanel, bpy.types.Panel):
    bl_label = "Waveform"
    bl_idname = "RADARSIM_PT_waveform"

    def draw(self, context: Any) -> None:
        layout = self.layout
        settings = getattr(context.scene, SCENE_PROPERTY)
        column = layout.column(align=True)
        column.prop(settings, "waveform_kind", text="")
        column.prop(settings, "carrier_ghz")
        if settings.waveform_kind == "lfm":
            column.row().prop(settings, "sweep_by", expand=True)
            by_rate = settings.sweep_by == "FM_RATE"
            column.prop(settings, "fm_rate_mhz_per_us" if by_rate else "bandwidth_mhz")
        for name in WAVEFORM_SETTINGS[settings.waveform_kind]:
            column.prop(settings, name)
        column.prop(settings, "prf_hz")
        column.prop(settings, "pulses")
        measurement = _measurement(context, layout)
        if measurement is None:
            return
        numbers = derive(measurement, max(measurement.rings, 1))
        box = layout.box().column(align=True)
        box.label(text=f"Range resolution: {numbers.range_resolution_m:.4g} m")
        box.label(text=f"Unambiguous range: {length_text(numbers.unambiguous_range_m)}")
        box.label(text=f"Max. velocity: {numbers.max_unambiguous_velocity_mps:.4g} m/s")
        box.label(text=f"Velocity resolution: {numbers.velocity_resolution_mps:.4g} m/s")
        box.label(text=f"Burst: {numbers.burst_s * 1e3:.4g} ms")


class RADARSIM_PT_rings(_RadarPanel, bpy.types.Panel):
    bl_label = "Acquisition"
    bl_idname = "RADARSIM_PT_rings"

    def draw(self, context: Any) -> None:
        layout = self.layout
        settings = getattr(context.scene, SCENE_PROPERTY)
        layout.row().prop(settings, "sampling_mode", expand=True)
        if settings.sampling_mode == "PATHS":
            _draw_paths(layout, settings)
            return
        column = layout.column(align=True)
        column.row().prop(settings, "ring_mode", expand=True)
        column.prop(settings, "ring_step_m")
        if settings.ring_mode == "COUNT":
            column.prop(settings, "ring_count")


def _draw_paths(layout: Any, settings: Any) -> None:
    column = layout.column(align=True)
    column.prop(settings, "path_order")
    column.prop(settings, "path_replicates")
    column.prop(settings, "path_error_percent")
    if settings.path_error_percent:
        column.prop(settings, "path_refine_by")
    column.prop(settings, "path_budget_s")
    column = layout.column(align=True)
    column.prop(settings, "path_motion")
    if settings.path_motion != "off":
        column.prop(settings, "path_motion_samples")
    column.prop(settings, "path_visibility_updates")
    column.prop(settings, "path_code")
    column.prop(settings, "path_amplitude")


class RADARSIM_PT_passes(_RadarPanel, bpy.types.Panel):
    bl_label = "Passes"
    bl_idname = "RADARSIM_PT_passes"

    @classmethod
    def poll(cls, context: Any) -> bool:
        # Paths take Doppler from the motion of what they touch.
        return getattr(context.scene, SCENE_PROPERTY).sampling_mode == "RINGS"

    def draw(self, context: Any) -> None:
        layout = self.layout
        settings = getattr(context.scene, SCENE_PROPERTY)
        column = layout.column(align=True)
        column.row().prop(settings, "snapshots", expand=True)
        if settings.snapshots == "2":
            column.prop(settings, "snapshot_interval_ms")
        column.prop(settings, "max_bounces")


class RADARSIM_PT_render(_RadarPanel, bpy.types.Panel):
    bl_label = "Render"
    bl_idname = "RADARSIM_PT_render"

    def draw(self, context: Any) -> None:
        layout = self.layout
        settings = getattr(context.scene, SCENE_PROPERTY)
        column = layout.column(align=True)
        column.prop(settings, "frame_mode")
        if settings.frame_mode == "RANGE":
            column.prop(settings, "frame_start")
            column.prop(settings, "frame_end")
            column.prop(settings, "frame_step")
        row = layout.row(align=True)
        row.prop(settings, "width_px")
        row.prop(settings, "height_px")
        row = layout.row(align=True)
        if settings.sampling_mode == "RINGS":
            row.prop(settings, "samples")
        row.prop(settings, "seed")
        layout.prop(settings, "output_dir", text="")
        layout.prop(settings, "overwrite")
        if settings.sampling_mode == "RINGS":
            shown = _draw_plan(context, layout)
        else:
            shown = _draw_path_plan(context, layout, settings)
        layout.operator("radarsim.render_frames", icon="RENDER_ANIMATION")
        _draw_progress(context, layout, shown)


class RADARSIM_PT_results(_RadarPanel, bpy.types.Panel):
    bl_label = "Results"
    bl_idname = "RADARSIM_PT_results"

    def draw(self, context: Any) -> None:
        layout = self.layout
        layout.operator("radarsim.process_last_run", icon="GRAPH")
        layout.operator("radarsim.open_output", icon="FILE_FOLDER")


def _draw_plan(context: Any, layout: Any) -> list[str]:
    """Number of renders, and warnings where numbers do not fit together; returns the warnings."""
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
    numbers = derive(measurement, rings)
    box = layout.box().column(align=True)
    box.label(text=f"{numbers.renders} renders")
    box.label(text=f"{rings} rings to {length_text(numbers.covered_range_m)}")
    if farthest_m is not None:
        box.label(text=f"Scene reaches {length_text(farthest_m)}")
    return _draw_warnings(context, layout, measurement, rings, farthest_m)


def _draw_warnings(
    context: Any, layout: Any, measurement: Measurement, rings: int, farthest_m: float | None
) -> list[str]:
    """Warnings where numbers do not fit together; returns them."""
    scene = context.scene
    frame_s = shortest_decimal(scene.render.fps_base) / scene.render.fps
    interval_s = None
    if len(measurement.frames) > 1:
        interval_s = (measurement.frames[1] - measurement.frames[0]) * frame_s
    found = warnings_for(
        measurement,
        rings,
        farthest_m,
        interval_s,
        getattr(scene, SCENE_PROPERTY).sampling_mode.lower(),
        (scene.frame_end - scene.frame_start) * frame_s,
    )
    for warning in found:
        wrapped(context, layout, warning, "ERROR")
    return found


def _draw_path_plan(context: Any, layout: Any, settings: Any) -> list[str]:
    """What the acquisition "paths" will do; how many renders it takes shows as they are made."""
    measurement = _measurement(context, layout)
    if measurement is None:
        return []
    try:
        options = read_path_options(settings)
        extent = _extent(context)
    except RadarSimError as error:
        wrapped(context, layout, str(error), "ERROR")
        return []
    rays = measurement.width_px * measurement.height_px * options.replicates
    box = layout.box().column(align=True)
    box.label(text=f"{len(measurement.frames)} frames, {rays:,} rays each at first")
    box.label(text="Tiles are refined" if options.refines else "No refinement")
    farthest_m = extent.from_emitter_m or None if extent is not None else None
    return _draw_warnings(context, layout, measurement, 1, farthest_m)


def _draw_progress(context: Any, layout: Any, shown: list[str]) -> None:
    """How far the run is; its warnings, but for those that are `shown` already."""
    progress = getattr(context.window_manager, PROGRESS_PROPERTY)
    if progress.running:
        layout.progress(factor=progress.fraction, text=f"{progress.fraction * 100:.0f} %")
        layout.label(text=progress.text)
        layout.label(text="Esc stops", icon="EVENT_ESC")
    elif progress.text:
        wrapped(context, layout, progress.text, "INFO")
    for warning in progress.warnings.splitlines():
        if warning not in shown:
            wrapped(context, layout, warning, "ERROR")


def _measurement(context: Any, layout: Any) -> Measurement | None:
    """The scene's settings, or their error drawn."""
    try:
        return properties.read_measurement(context.scene)
    except RadarSimError as error:
        wrapped(context, layout, str(error), "ERROR")
        return None


def _extent(context: Any) -> Extent | None:
    """How far the scene reaches now; None without a radar, or in a scene too large to look at.

    With paths, where objects of any material may echo, all that is rendered counts.

    Raises
    ------
    ConfigError
        The scene's Unit Scale is no positive number.
    """
    settings = getattr(context.scene, SCENE_PROPERTY)
    try:
        rig = find_rig(context.scene, settings.camera, settings.emitter, _any_camera(settings))
    except RadarSimError:
        return None
    scale = check_unit_scale(shortest_decimal(context.scene.unit_settings.scale_length))
    depsgraph = context.evaluated_depsgraph_get()
    if len(depsgraph.object_instances) > _DRAWN_INSTANCES:
        return None
    return scene_extent(depsgraph, rig, scale, any_material=settings.sampling_mode == "PATHS")


def _any_camera(settings: Any) -> bool:
    return bool(settings.sampling_mode == "PATHS")


def wrapped(context: Any, layout: Any, text: str, icon: str) -> None:
    """A sentence over as many lines as the sidebar's width needs."""
    letters = max(16, int(context.region.width / (7 * context.preferences.system.ui_scale)) - 4)
    column = layout.column(align=True)
    for index, line in enumerate(textwrap.wrap(text, letters)):
        column.label(text=line, icon=icon if index == 0 else "BLANK1")


#: What the radar is; the power budget stands below these.
RADAR_CLASSES: tuple[type, ...] = (RADARSIM_PT_rig, RADARSIM_PT_material, RADARSIM_PT_waveform)
#: What a run is.
RUN_CLASSES: tuple[type, ...] = (
    RADARSIM_PT_rings,
    RADARSIM_PT_passes,
    RADARSIM_PT_render,
    RADARSIM_PT_results,
)
