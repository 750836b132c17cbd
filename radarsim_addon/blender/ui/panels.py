# SPDX-License-Identifier: GPL-3.0-or-later
"""Sidebar tab "Radar" of the 3D view, in the order of work. Panels draw; they change nothing."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

from ...errors import RadarSimError
from ...findings import length_text
from ...options import declared
from ..plan import DEFAULT_PRESET, PRESETS, Measurement, radar_preset
from ..rig_settings import (
    EIRP_PROPERTY,
    PROGRESS_PROPERTY,
    RADAR_PROPERTY,
    RADAR_SETTINGS,
    TEXT_CONTEXT,
    WAVEFORMS,
    apply_preset,
    load_preset,
    read_preset,
    save_preset,
)
from ..rig_settings import output_folder as folder_of_run
from ..scene import ACTIVE_RADAR_PROPERTY, active_radar, radars
from .fields import (
    ActiveRadarPanel,
    RadarPanel,
    active_group,
    draw_fields,
    draw_number,
    draw_quantity,
    draw_state,
    misfit,
    read_findings,
    reported,
    shown_at_field,
    split,
    tr,
    wrapped,
)
from .live_preview import LIVE_PROPERTY
from .results_panel import RADARSIM_PT_results
from .scene_panel import LONG_S, draw_rows, effort
from .scene_reading import current_measurement, shown_rig

# -------------------------------------------------------------------------------------------------
# Radar presets in Blender's own menu: those of radarsim, and those that the user saved.
# -------------------------------------------------------------------------------------------------


#: Folder below Blender's `presets`.
_FOLDER = "radarsim"


def preset_choice(description: str) -> Any:
    """Return a property that names one of radarsim's presets."""
    return bpy.props.EnumProperty(
        name="Preset",
        items=tuple((name, item.label, item.description) for name, item in PRESETS.items()),
        default=DEFAULT_PRESET,
        description=description,
    )


class _OnRadar(bpy.types.Operator):
    """An operator on the active radar."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return active_group(context.scene) is not None


class RADARSIM_OT_apply_preset(_OnRadar):
    """Replace waveform, antennas, link budget, range limits and field of view of the radar"""

    bl_idname = "radarsim.apply_preset"
    bl_label = "Apply Radar Preset"
    bl_options = {"REGISTER", "UNDO"}

    preset: preset_choice("Radar that the active one becomes")

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        return radar_preset(properties.preset).description

    def execute(self, context: bpy.types.Context) -> set[str]:
        with reported(self):
            apply_preset(context.scene, active_radar(context.scene), radar_preset(self.preset))
            return {"FINISHED"}
        return {"CANCELLED"}


class RADARSIM_OT_load_preset(_OnRadar):
    """Make the active radar the one that was saved"""

    bl_idname = "radarsim.load_preset"
    bl_label = "Load Radar Preset"
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(
        name="File", subtype="FILE_PATH", description="File of a saved radar"
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        with reported(self):
            preset = load_preset(Path(self.filepath))
            apply_preset(context.scene, active_radar(context.scene), preset)
            return {"FINISHED"}
        return {"CANCELLED"}


class RADARSIM_OT_save_preset(AddPresetBase, _OnRadar):
    """Save the active radar as a preset, or remove a saved one"""

    bl_idname = "radarsim.save_preset"
    bl_label = "Save Radar Preset"
    bl_options = {"REGISTER"}

    preset_menu = "RADARSIM_PT_presets"
    preset_subdir = _FOLDER

    def add(self, context: bpy.types.Context, filepath: str) -> None:
        """Write the file; Blender's preset system chose its name."""
        radar = active_radar(context.scene)
        save_preset(Path(filepath), read_preset(context.scene, radar, self.name))


class RADARSIM_PT_presets(PresetPanel, RadarPanel, bpy.types.Panel):
    bl_label = "Radar Presets"
    bl_idname = "RADARSIM_PT_presets"
    bl_options = {"INSTANCED"}
    preset_subdir = _FOLDER
    preset_operator = "radarsim.load_preset"
    preset_add_operator = "radarsim.save_preset"

    def draw(self, context: bpy.types.Context) -> None:
        column = self.layout.column(align=True)
        column.emboss = "PULLDOWN_MENU"
        for name, preset in PRESETS.items():
            button = column.operator("radarsim.apply_preset", text=preset.label)
            button.preset = name
        self.layout.separator()
        if bpy.utils.preset_paths(_FOLDER):
            PresetPanel.draw(self, context)
            return
        # Nobody has saved a radar yet: Blender's own menu would name a missing path.
        name = context.window_manager.preset_name
        row = self.layout.row(align=True)
        row.prop(context.window_manager, "preset_name", text="")
        row.operator("radarsim.save_preset", text="", icon="ADD").name = name


CLASSES: tuple[type, ...] = (
    RADARSIM_OT_apply_preset,
    RADARSIM_OT_load_preset,
    RADARSIM_OT_save_preset,
    RADARSIM_PT_presets,
)


class RADARSIM_PT_rig(RadarPanel, bpy.types.Panel):
    bl_label = "Radar"
    bl_idname = "RADARSIM_PT_rig"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        if active_group(context.scene) is not None:
            RADARSIM_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = split(self.layout), context.scene
        # To look for radars takes long in a large scene: not where one is chosen.
        if getattr(scene, ACTIVE_RADAR_PROPERTY) is None and not radars(scene):
            layout.operator("radarsim.setup_rig", icon="OUTLINER_OB_CAMERA")
        else:
            row = layout.row(align=True)
            row.prop(scene, ACTIVE_RADAR_PROPERTY)
            row.operator("radarsim.setup_rig", text="", icon="ADD")
        try:
            radar = active_radar(scene)
            rig = shown_rig(scene, radar)
        except RadarSimError as error:
            wrapped(context, layout, str(error), "INFO")
            return
        group = getattr(radar, RADAR_PROPERTY)
        column = layout.column()
        if group.waveform_kind != "file":
            draw_fields(column, group, RADAR_SETTINGS, "carrier_hz")
        camera = rig.camera.data
        if camera.type == "PERSP":
            column.prop(camera, "angle", text="Field of View", text_ctxt=TEXT_CONTEXT)
            draw_number(column, "Width by Height", _field_of_view(camera, group))
        draw_fields(column, group, RADAR_SETTINGS, "range_start_m", "range_stop_m")
        if not group.use_link_budget:
            draw_quantity(column, rig.emitter.data, EIRP_PROPERTY, "EIRP", "dBm")


def _field_of_view(camera: Any, group: Any) -> str:
    """Both angles of a perspective camera that fits its longer side."""
    sides = (group.width_px, group.height_px)
    longer = {"HORIZONTAL": sides[0], "VERTICAL": sides[1]}.get(camera.sensor_fit, max(sides))
    half = math.tan(camera.angle / 2)
    angles = [2 * math.degrees(math.atan(half * side / longer)) for side in sides]
    return f"{angles[0]:.3g} x {angles[1]:.3g} deg"


class RADARSIM_PT_antenna_objects(ActiveRadarPanel, bpy.types.Panel):
    bl_label = "Receiver and Transmitter"
    bl_idname = "RADARSIM_PT_antenna_objects"
    bl_parent_id = "RADARSIM_PT_rig"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, group = split(self.layout), active_group(context.scene)
        column = layout.column()
        column.prop(group, "camera")
        column.prop(group, "light")
        try:
            rig = shown_rig(context.scene, active_radar(context.scene))
        except RadarSimError as error:
            wrapped(context, layout, str(error), "ERROR")
            return
        draw_number(column, "In Use", rig.camera.name)
        draw_number(column, "", rig.emitter.name)
        if group.use_link_budget:  # its watts cancel: they are the light level of the renders
            column.prop(rig.emitter.data, "energy", text="Light")


class RADARSIM_PT_waveform(ActiveRadarPanel, bpy.types.Panel):
    bl_label = "Waveform"
    bl_idname = "RADARSIM_PT_waveform"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        measurement, _ = current_measurement(context.scene)
        if measurement is not None:
            radar = measurement.radar
            resolution = _length(radar.waveform.range_resolution_m)
            draw_state(self, f"{resolution}, ±{radar.max_unambiguous_velocity_mps:.3g} m/s")

    def draw(self, context: bpy.types.Context) -> None:
        layout, group = split(self.layout), active_group(context.scene)
        layout.prop(group, "waveform_kind", text="Kind")
        measurement, wrong = current_measurement(context.scene)
        after = {} if measurement is None else _derived(measurement)
        if group.waveform_kind == "file":
            draw_fields(layout, group, RADAR_SETTINGS, "waveform_file", after=after)
        else:
            own = declared(WAVEFORMS[group.waveform_kind])
            names = [
                name
                for name in own
                if name != "carrier_hz" and (name not in _RARE or misfit(group, own[name]))
            ]
            draw_fields(layout, group, own, *names, after=after)
        if group.waveform_kind == "lfm":
            draw_quantity(layout, group, "fm_rate_mhz_per_us", "FM Rate", "MHz/us")
        labels = {"pulses": tr("Chirps")} if group.waveform_kind == "fmcw" else {}
        draw_fields(layout, group, RADAR_SETTINGS, "prf_hz", "pulses", after=after, labels=labels)
        draw_fields(layout, group, RADAR_SETTINGS, "array")
        if group.array in ("3x4", "12x16") or group.array_schedule != "tdm":
            draw_fields(layout, group, RADAR_SETTINGS, "array_schedule")
        if measurement is None and not shown_at_field(group, wrong):
            wrapped(context, layout, wrong, "ERROR")


#: Settings of FMCW that few radars need.
_RARE = ("adc_start_s", "ramp_s", "idle_s", "real_adc")


class RADARSIM_PT_receiver(ActiveRadarPanel, bpy.types.Panel):
    bl_label = "Receiver"
    bl_idname = "RADARSIM_PT_receiver"
    bl_parent_id = "RADARSIM_PT_waveform"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        group = active_group(context.scene)
        return group is not None and group.waveform_kind == "fmcw"

    def draw(self, context: bpy.types.Context) -> None:
        layout, group = split(self.layout), active_group(context.scene)
        draw_fields(layout, group, RADAR_SETTINGS, *_RARE)


def _derived(measurement: Measurement) -> dict[str, list[tuple[str, str]]]:
    """Derived numbers (name, value) by the setting that they stand below."""
    radar = measurement.radar
    waveform = radar.waveform
    resolution = [(tr("Range Resolution"), _length(waveform.range_resolution_m))]
    longest = [(tr("Longest Range"), _length(radar.unambiguous_range_m))]
    speed = f"±{radar.max_unambiguous_velocity_mps:.3g} m/s"
    burst_ms = radar.burst.pulses / radar.burst.prf_hz * 1e3
    found = {
        "prf_hz": [(tr("Unambiguous"), speed)],
        "pulses": [
            (tr("Velocity Resolution"), f"{radar.velocity_resolution_mps:.3g} m/s"),
            (tr("Burst"), f"{burst_ms:.3g} ms"),
        ],
    }
    below = {
        "lfm": ("bandwidth_hz", "prf_hz"), "fmcw": ("bandwidth_hz", "adc_samples"),
        "stepped": ("steps", "step_hz"), "pmcw": ("chip_duration_s", "code_degree"),
        "barker": ("chip_duration_s", "prf_hz"),
    }.get(waveform.kind, ("waveform_file", "waveform_file"))  # fmt: skip
    for name, lines in zip(below, (resolution, longest), strict=True):
        found[name] = [*found.get(name, []), *lines]
    return found


def _length(metres: float) -> str:
    """A length with three digits."""
    return length_text(float(f"{metres:.3g}"))


class RADARSIM_PT_render(ActiveRadarPanel, bpy.types.Panel):
    bl_label = "Measure"
    bl_idname = "RADARSIM_PT_render"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        measurement, _ = current_measurement(context.scene)
        if measurement is not None:
            draw_state(self, effort(context, measurement)[0])

    def draw(self, context: bpy.types.Context) -> None:
        layout, group = split(self.layout), active_group(context.scene)
        if group.sampling_mode == "paths":
            layout.row().prop(group, "quality", expand=True)
            if group.quality == "error":
                draw_fields(layout, group, RADAR_SETTINGS, "max_standard_error", "time_limit_s")
        fields = ["frame_mode", "width_px", "height_px", "output_folder", "overwrite"]
        if group.frame_mode == "range":
            fields[1:1] = ["frame_start", "frame_end", "frame_step"]
        draw_fields(layout, group, RADAR_SETTINGS, *fields)
        measurement, wrong = current_measurement(context.scene)
        if measurement is None:
            elsewhere = shown_at_field(group, wrong)
            text = tr("A red field above holds a value that cannot be") if elsewhere else wrong
            wrapped(context, layout, text, "ERROR")
        else:
            text, seconds = effort(context, measurement)
            if seconds > LONG_S:
                row = layout.row(align=True)
                row.label(text=text, icon="ERROR", translate=False)
                row.prop_enum(group, "quality", "draft")
        try:
            folder_of_run(active_radar(context.scene))
        except RadarSimError:
            # An error of the operator says more; a file that was never saved is the usual cause.
            layout.label(text="No place for the run yet", icon="ERROR")
            layout.operator("wm.save_mainfile", text="Save the File...", icon="FILE_TICK")
        layout.prop(context.window_manager, LIVE_PROPERTY)
        progress = getattr(context.window_manager, PROGRESS_PROPERTY)
        row = layout.row(align=True)
        row.scale_y = 1.4
        if progress.running:  # in the button's place, so that nothing moves
            percent = tr("{percent:.0f} %", percent=progress.fraction * 100)
            row.progress(factor=progress.fraction, text=percent)
            row.operator("radarsim.stop_run", text="", icon="CANCEL")
            layout.label(text=progress.text, translate=False)
        else:
            row.operator("radarsim.measure_and_show", icon="RENDER_ANIMATION")
            wrapped(context, layout, progress.text or tr("Not measured yet"), "INFO")
        draw_rows(layout, read_findings(progress.findings), measurement)


class RADARSIM_PT_advanced(ActiveRadarPanel, bpy.types.Panel):
    bl_label = "Advanced"
    bl_idname = "RADARSIM_PT_advanced"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, group = split(self.layout), active_group(context.scene)
        layout.row().prop(group, "sampling_mode", expand=True)
        draw_fields(layout, group, RADAR_SETTINGS, *_SAMPLING[group.sampling_mode], "seed")


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


class RADARSIM_PT_media(ActiveRadarPanel, bpy.types.Panel):
    bl_label = "Waves in Materials"
    bl_idname = "RADARSIM_PT_media"
    bl_parent_id = "RADARSIM_PT_advanced"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, group = split(self.layout), active_group(context.scene)
        draw_fields(layout, group, RADAR_SETTINGS, "polarisation", "beyond_band", "extinction")
        if group.extinction == "length":
            draw_fields(layout, group, RADAR_SETTINGS, "extinction_length_m")


#: What the radar is; its link budget stands below these.
RADAR_CLASSES: tuple[type, ...] = (RADARSIM_PT_rig, RADARSIM_PT_antenna_objects)
#: What a run is, after waveform and scene.
RUN_CLASSES: tuple[type, ...] = (
    RADARSIM_PT_receiver,
    RADARSIM_PT_render,
    RADARSIM_PT_results,
    RADARSIM_PT_advanced,
    RADARSIM_PT_media,
)
