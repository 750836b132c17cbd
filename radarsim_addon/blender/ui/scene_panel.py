# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of the scene: a checklist with buttons that fix, materials, weather."""

from __future__ import annotations

import functools
import json
import math
import tempfile
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import bmesh
import bpy

from ...errors import ConfigError, RadarSimError, SceneError
from ...findings import Finding, finding, frequency_text, merge
from ...options import declared
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ...signal.radar import Weather
from ..headless import make_job
from ..materials import SURFACE_TYPES
from ..plan import Measurement, automatic_rings
from ..rig_settings import (
    MIRROR_PROPERTY,
    PROGRESS_PROPERTY,
    RADAR_SETTINGS,
    carrier_hz,
    read_path_options,
    set_values,
    settings,
)
from ..scene import active_radar, echoes, replace_material, suggest_materials
from ..state import context_snapshot
from .fields import (
    ICONS,
    ActiveRadarPanel,
    RadarPanel,
    active_group,
    draw_fields,
    draw_state,
    findings_text,
    label_of,
    letters_across,
    read_findings,
    report_findings,
    reported,
    shown_at_field,
    split,
    tr,
    translated,
    wrapped,
)
from .scene_reading import SceneRecord, current_measurement, quick_findings, scene_record

# -------------------------------------------------------------------------------------------------
# How long a run takes, before it is begun.
# -------------------------------------------------------------------------------------------------


#: Time beyond which a run is called long [s].
LONG_S = 900.0
#: Time of a frame besides its rays: preparation, table, motion [s].
_FRAME_S = 0.5


def effort(context: bpy.types.Context, measurement: Measurement) -> tuple[str, float]:
    """What a run takes, in words and in seconds: of rings the renders (0 s), of paths the time."""
    group = active_group(context.scene)
    try:
        if group.sampling_mode == "rings":
            record, rings = scene_record(context), measurement.rings
            if not rings and record is not None:
                rings = automatic_rings(measurement.ring_step_m, record.extent)
            if not rings:
                return tr("{count} renders per ring", count=measurement.renders(1)), 0.0
            count = measurement.renders(rings)
            return tr("{count} renders, {rings} rings", count=count, rings=rings), 0.0
        options = read_path_options(active_radar(context.scene))
    except RadarSimError:
        return tr("cannot measure"), 0.0
    rays = measurement.width_px * measurement.height_px * options.replicates
    per_ray_s = getattr(context.window_manager, PROGRESS_PROPERTY).seconds_per_ray
    looks = len(measurement.frames) * options.visibility_updates
    seconds = looks * (_FRAME_S + rays * options.max_reflections * per_ray_s)
    text = time_text(seconds)
    text = tr("at least {time}", time=text) if options.refines else tr("about {time}", time=text)
    return text, seconds


def time_text(seconds: float) -> str:
    """Return a time with a unit that suits it: "12 s", "3.4 min", "2.1 h"."""
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{max(seconds, 1.0):.0f} s"


def long_run(context: bpy.types.Context, measurement: Measurement) -> list[Finding]:
    """Return the finding of a run that takes long; empty if it does not."""
    seconds = effort(context, measurement)[1]
    if seconds <= LONG_S:
        return []
    draft = active_group(context.scene).quality == "draft"
    return [finding("run-takes-long", hours=seconds / 3600, draft=int(draft))]


# -------------------------------------------------------------------------------------------------
# Radar materials by the names of optical ones: suggestions in a list, and their assignment.
# -------------------------------------------------------------------------------------------------


class RADARSIM_OT_suggest_materials(bpy.types.Operator):
    """List the scene's optical materials with radar materials that fit their names"""

    bl_idname = "radarsim.suggest_materials"
    bl_label = "Assign by Name..."
    bl_options = {"REGISTER"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        rows = getattr(context.window_manager, PROGRESS_PROPERTY).suggestions
        with reported(self):
            snapshot = context_snapshot(context)
            found = suggest_materials(snapshot)
            rows.clear()
            for material, ready in found.items():
                row = rows.add()
                row.material, row.ready = material.name, ready or "KEEP"
            known = sum(ready is not None for ready in found.values())
            self.report({"INFO"}, f"Optical materials: {len(found)}, with a known name: {known}")
            return {"FINISHED"}
        return {"CANCELLED"}


class RADARSIM_OT_apply_materials(bpy.types.Operator):
    """Put the radar materials of the list in place of the optical ones, which stay in the file"""

    bl_idname = "radarsim.apply_materials"
    bl_label = "Apply"
    bl_options = {"REGISTER", "UNDO"}

    discard: bpy.props.BoolProperty(
        name="Discard", description="Close the list and change nothing", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(getattr(context.window_manager, PROGRESS_PROPERTY).suggestions)

    def execute(self, context: bpy.types.Context) -> set[str]:
        rows = getattr(context.window_manager, PROGRESS_PROPERTY).suggestions
        with reported(self):
            for row in () if self.discard else rows:
                material = bpy.data.materials.get(row.material)
                if material is not None and row.ready != "KEEP":
                    snapshot = context_snapshot(context)
                    replace_material(material, row.ready, carrier_hz(context.scene), snapshot)
            rows.clear()
            return {"FINISHED"}
        return {"CANCELLED"}


class RADARSIM_UL_suggestions(bpy.types.UIList):
    """Rows: optical material, radar material."""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: Any,
        item: Any,
        icon: int,
        owner: Any,
        name: str,
    ) -> None:
        row = layout.split(factor=0.5)
        row.label(text=item.material, icon="MATERIAL")
        row.prop(item, "ready", text="")


def draw_suggestions(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    """Draw the button that lists suggestions, and the list where there is one."""
    state = getattr(context.window_manager, PROGRESS_PROPERTY)
    layout.operator("radarsim.suggest_materials", icon="VIEWZOOM")
    if len(state.suggestions):
        layout.template_list(
            "RADARSIM_UL_suggestions", "", state, "suggestions", state, "suggestion", rows=4
        )
        row = layout.row(align=True)
        row.operator("radarsim.apply_materials", icon="CHECKMARK").discard = False
        row.operator("radarsim.apply_materials", text="", icon="X").discard = True


NAME_CLASSES: tuple[type, ...] = (
    RADARSIM_OT_suggest_materials,
    RADARSIM_OT_apply_materials,
    RADARSIM_UL_suggestions,
)


# -------------------------------------------------------------------------------------------------
# What a button next to a finding does: set numbers, select, repair, explain.
# -------------------------------------------------------------------------------------------------


#: Letters of a line of an explanation.
_LETTERS = 70
#: Letters that a button in a row, or its margins, take, and the least that its title has.
_BUTTON, _LEAST_TITLE = 3, 12
#: Names that a tooltip gives.
_MOST_NAMES = 3
#: Part of the pulse interval that a pulse is given where it has to become shorter.
_FILL = 0.95


class Fix(NamedTuple):
    """A button: operator, and its properties."""

    operator: str
    values: dict[str, Any]


def fixes_of(item: Finding, measurement: Measurement | None) -> list[Fix]:
    """Return the buttons of a finding that remove its cause."""
    found = []
    values = _values(item, measurement)
    if values:
        found.append(Fix("radarsim.set_values", {"values": json.dumps(values)}))
    if item.code in ("no-radar-material", "optical-material"):
        found.append(Fix("radarsim.suggest_materials", {}))
    if item.code in _NORMALS:
        names = json.dumps(item.subjects)
        found.append(Fix("radarsim.recalculate_normals", {"names": names}))
    return found


def _values(item: Finding, measurement: Measurement | None) -> dict[str, Any]:
    """Return settings that remove the cause of a finding; empty without any."""
    numbers = {name: _largest(value) for name, value in item.numbers.items()}
    if item.code == "scene-beyond-unambiguous-velocity" and measurement is not None:
        prf_hz = numbers["prf_hz"]
        shorter = _shorter_pulse(measurement, prf_hz)
        return {} if shorter is None else {"prf_hz": prf_hz, **shorter}
    if item.code == "scene-beyond-range-limits":
        return {"range_stop_m": float(f"{1.05 * numbers['farthest_m']:.2g}")}
    if item.code == "scene-beyond-unambiguous-range" and numbers.get("limit") == "PRF":
        prf_hz = SPEED_OF_LIGHT_MPS / (2 * numbers["farthest_m"])
        step_hz = 10 ** (math.floor(math.log10(prf_hz)) - 1)
        return {"prf_hz": float(math.floor(prf_hz / step_hz) * step_hz)}
    if item.code == "ring-step-below-resolution":
        return {"ring_step_m": numbers["range_resolution_m"]}
    if item.code in ("footprints-too-coarse", "objects-below-a-pixel") and numbers["width_px"]:
        return {name: int(numbers[name]) for name in ("width_px", "height_px")}
    if item.code == "run-takes-long" and not numbers["draft"]:
        return {"replicates": 2, "max_standard_error": 0.0, "time_limit_s": 0.0}
    return _CONSTANT.get(item.code, {})


#: Fixes that need no number of the finding.
_CONSTANT: dict[str, dict[str, Any]] = {
    "scene-beyond-rings": {"rings": 0},
    "single-snapshot": {"snapshots": 2},
    "short-snapshot-interval": {"snapshot_interval_s": 0.01},
}
#: Findings about the directions of normals.
_NORMALS = ("mesh-flipped", "mesh-inside-out")


def value_text(name: str, value: Any) -> str:
    """Return a setting and its value as the window shows them: "PRF 61.7 kHz"."""
    item = RADAR_SETTINGS[name]
    if value is None:
        text = tr("none")
    elif item.of.unit == "Hz":
        text = frequency_text(value)
    elif isinstance(value, float):
        text = f"{item.to_shown(value):.4g} {item.shown_unit}".rstrip()
    else:
        text = str(value)
    return f"{translated(label_of(item))} {text}"


def _largest(value: Any) -> Any:
    return max(value) if isinstance(value, list | tuple) else value


def _shorter_pulse(measurement: Measurement, prf_hz: float) -> dict[str, Any] | None:
    """Settings with which the pulse fits into 1 / PRF; None where nothing does by itself."""
    waveform: Any = measurement.waveform
    if waveform.duration_s <= 1 / prf_hz:
        return {}
    room_s = _FILL / prf_hz
    if waveform.kind == "lfm":
        return {"chirp_duration_s": float(f"{room_s:.3g}")}
    sampled_s = room_s - getattr(waveform, "idle_s", 0.0) - getattr(waveform, "adc_start_s", 0.0)
    if waveform.kind != "fmcw" or sampled_s <= 0:
        return None
    rate_hz = float(f"{1.005 * waveform.adc_samples / sampled_s:.3g}")
    return {"adc_rate_hz": rate_hz, "ramp_s": None}


class RADARSIM_OT_set_values(bpy.types.Operator):
    """Set the numbers of the active radar that remove the cause"""

    bl_idname = "radarsim.set_values"
    bl_label = "Fix Radar Settings"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    values: bpy.props.StringProperty(
        name="Values", description="Settings by their names, in SI, as JSON"
    )

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        values = json.loads(properties.values or "{}")
        texts = [value_text(name, value) for name, value in values.items()]
        return tr("Set {values}", values=", ".join(texts))

    def execute(self, context: bpy.types.Context) -> set[str]:
        with reported(self):
            try:
                values = json.loads(self.values)
            except ValueError as error:
                raise ConfigError(f"{self.values!r:.60} is no JSON; expected settings.") from error
            set_values(settings(active_radar(context.scene)), values)
            return {"FINISHED"}
        return {"CANCELLED"}


def _named(context: bpy.types.Context, names: str) -> list[Any]:
    """Objects of the view layer that a finding is about, by their name or that of a material."""
    wanted = {part for name in json.loads(names or "[]") for part in (name, *name.split(" and "))}
    return [
        item
        for item in context.view_layer.objects
        if item.name in wanted
        or any(slot.material and slot.material.name in wanted for slot in item.material_slots)
    ]


class RADARSIM_OT_select_subjects(bpy.types.Operator):
    """Select the objects that the finding is about"""

    bl_idname = "radarsim.select_subjects"
    bl_label = "Select Objects of a Finding"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    names: bpy.props.StringProperty(name="Names", description="Objects or materials, as JSON")

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        names = json.loads(properties.names or "[]")
        shown = ", ".join(map(repr, names[:_MOST_NAMES]))
        if len(names) <= _MOST_NAMES:
            return tr("Select {names}", names=shown)
        return tr("Select {names} and {count} more", names=shown, count=len(names) - _MOST_NAMES)

    def execute(self, context: bpy.types.Context) -> set[str]:
        with reported(self):
            found = _named(context, self.names)
            if not found:
                raise SceneError(
                    f"No object of this view layer is or uses one of {self.names}. It may be an "
                    "instance: select the object that makes it."
                )
            for item in context.view_layer.objects:
                item.select_set(item in found)
            context.view_layer.objects.active = found[0]
            return {"FINISHED"}
        return {"CANCELLED"}


class RADARSIM_OT_recalculate_normals(bpy.types.Operator):
    """Turn the faces of these meshes outwards"""

    bl_idname = "radarsim.recalculate_normals"
    bl_label = "Recalculate Normals of a Finding"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    names: bpy.props.StringProperty(name="Names", description="Objects, as JSON")

    def execute(self, context: bpy.types.Context) -> set[str]:
        if context.mode != "OBJECT":
            self.report(
                {"ERROR"}, "Leave Edit Mode first: its mesh would replace the repaired one."
            )
            return {"CANCELLED"}
        for mesh in {item.data for item in _named(context, self.names) if item.type == "MESH"}:
            faces = bmesh.new()
            faces.from_mesh(mesh)
            bmesh.ops.recalc_face_normals(faces, faces=faces.faces[:])
            faces.to_mesh(mesh)
            faces.free()
            mesh.update()
        progress, names = getattr(context.window_manager, PROGRESS_PROPERTY), json.loads(self.names)
        progress.checked = findings_text(
            [
                item
                for item in read_findings(progress.checked)
                if item.code not in _NORMALS or not set(item.subjects) <= set(names)
            ]
        )
        return {"FINISHED"}


class RADARSIM_OT_explain(bpy.types.Operator):
    """Say what was found, why it matters and what to do"""

    bl_idname = "radarsim.explain"
    bl_label = "Explain a Finding"
    bl_options = {"INTERNAL"}

    code: bpy.props.StringProperty(name="Code", description="Code of docs/findings.md")
    message: bpy.props.StringProperty(name="Message", description="Text of the finding")

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        return str(properties.message).rstrip(".")

    def execute(self, context: bpy.types.Context) -> set[str]:
        lines = textwrap.wrap(self.message, _LETTERS)
        if bpy.app.background or context.window is None:
            self.report({"INFO"}, self.message)
            return {"FINISHED"}

        def draw(menu: Any, _: Any) -> None:
            for line in lines:
                menu.layout.label(text=line)

        context.window_manager.popup_menu(draw, title=self.code, icon="INFO")
        return {"FINISHED"}


FIX_CLASSES: tuple[type, ...] = (
    RADARSIM_OT_set_values,
    RADARSIM_OT_select_subjects,
    RADARSIM_OT_recalculate_normals,
    RADARSIM_OT_explain,
)


class RADARSIM_OT_check_scene(bpy.types.Operator):
    """Check the scene as a run does before its first render: meshes, materials, motion, numbers"""

    bl_idname = "radarsim.check_scene"
    bl_label = "Check Scene"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return active_group(context.scene) is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        progress = getattr(context.window_manager, PROGRESS_PROPERTY)
        progress.checked = ""
        with reported(self):
            radar = active_radar(context.scene)
            with tempfile.TemporaryDirectory(prefix="radarsim_check_") as folder:
                run = Path(folder, "run")
                with make_job(context.scene, context.view_layer, run, radar=radar) as job:
                    found = job.findings
            progress.checked = findings_text(found)
            report_findings(self, found)
            count = sum(item.severity != "info" for item in found)
            self.report({"INFO"}, f"Checked: {count} findings" if count else "Checked: all is well")
            return {"FINISHED"}
        return {"CANCELLED"}


def known_findings(
    context: bpy.types.Context, measurement: Measurement, record: SceneRecord | None
) -> list[Finding]:
    """Return the findings of the settings as they are, and those of the last check."""
    quick = quick_findings(context.scene, measurement, record) + long_run(context, measurement)
    codes = {item.code for item in quick} | _QUICK
    checked = read_findings(getattr(context.window_manager, PROGRESS_PROPERTY).checked)
    return [*quick, *(item for item in merge(checked) if item.code not in codes)]


#: What the panel finds by itself at every change: an earlier check knows no better.
_QUICK = {
    "scene-beyond-unambiguous-velocity", "scene-beyond-unambiguous-range", "bursts-overlap",
    "scene-beyond-sampled-band", "scene-beyond-range-limits", "scene-beyond-rings",
    "no-radar-material", "medium-beyond-band", "one-range-cell", "low-time-bandwidth-product",
    "wavelength-exceeds-scene", "burst-exceeds-animation", "ring-step-below-resolution",
    "single-snapshot", "short-snapshot-interval", "footprints-too-coarse", "objects-below-a-pixel",
    "run-takes-long", "optical-material", "hidden-from-receiver", "rays-pass-through",
    "size-implausible", "lies-on-its-side", "scene-size-implausible",
}  # fmt: skip


def draw_rows(
    layout: bpy.types.UILayout, findings: Iterable[Finding], measurement: Measurement | None
) -> None:
    """Draw findings, a row each: a few words, at its end buttons that fix, select and explain."""
    for item in findings:
        row = layout.row()
        fixes = fixes_of(item, measurement)
        room = letters_across(bpy.context) - _BUTTON * (2 + len(fixes) + bool(item.subjects))
        lines = textwrap.wrap(translated(title_of(item.code)), max(room, _LEAST_TITLE))
        column = row.column(align=True)
        column.scale_y = 1.0 if len(lines) == 1 else 0.8
        for index, line in enumerate(lines):
            column.label(
                text=line, icon="BLANK1" if index else ICONS[item.severity], translate=False
            )
        buttons = row.row(align=True)
        buttons.alignment = "RIGHT"
        for fix in fixes:
            button = buttons.operator(fix.operator, text="", icon="MODIFIER")
            for name, value in fix.values.items():
                setattr(button, name, value)
        if item.subjects:
            icon = "RESTRICT_SELECT_OFF"
            button = buttons.operator("radarsim.select_subjects", text="", icon=icon)
            button.names = json.dumps(item.subjects)
        button = buttons.operator("radarsim.explain", text="", icon="QUESTION")
        button.code, button.message = item.code, item.message


def title_of(code: str) -> str:
    """Return a few words for a finding that a sidebar has room for: its code's own."""
    return code.removeprefix("scene-").replace("-", " ").capitalize()


def _all_known(context: bpy.types.Context) -> tuple[Measurement | None, SceneRecord | None, str]:
    """What is asked for, what is known of the scene, and why nothing can be measured."""
    measurement, wrong = current_measurement(context.scene)
    try:
        return measurement, None if measurement is None else scene_record(context), wrong
    except RadarSimError as error:
        return None, None, str(error)


def _count_text(kind: str, n: int) -> str:
    """How many findings of a severity there are."""
    if kind == "error":
        return tr("1 error") if n == 1 else tr("{n} errors", n=n)
    return tr("1 caution") if n == 1 else tr("{n} cautions", n=n)


class RADARSIM_PT_scene(ActiveRadarPanel, bpy.types.Panel):
    bl_label = "Scene"
    bl_idname = "RADARSIM_PT_scene"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        measurement, record, _ = _all_known(context)
        if measurement is None:
            draw_state(self, tr("cannot measure"))
            return
        found = known_findings(context, measurement, record)
        counts = {kind: sum(i.severity == kind for i in found) for kind in ("error", "caution")}
        texts = [_count_text(kind, n) for kind, n in counts.items() if n]
        draw_state(self, ", ".join(texts) or tr("ok"))

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        measurement, record, wrong = _all_known(context)
        if measurement is None:
            if not shown_at_field(active_group(context.scene), wrong):
                wrapped(context, layout, wrong, "ERROR")
            return
        if record is None:
            layout.label(text="Not read yet", icon="TIME")
        elif not record.surfaces:
            layout.label(text="No object has a surface", icon="ERROR")
        else:
            counts = {"count": record.measured, "total": record.surfaces}
            icon = "CHECKMARK" if record.assigned == record.surfaces else "INFO"
            text = tr("{count} of {total} objects are measured", **counts)
            layout.label(text=text, icon=icon, translate=False)
            counts = {"count": record.assigned, "total": record.measured}
            text = tr("{count} of these {total} have a Radar Material", **counts)
            layout.label(text=text, icon=icon, translate=False)
        draw_rows(layout, known_findings(context, measurement, record), measurement)
        layout.operator("radarsim.check_scene", icon="VIEWZOOM")
        draw_suggestions(context, layout)


class RADARSIM_PT_material(RadarPanel, bpy.types.Panel):
    bl_label = "Material"
    bl_idname = "RADARSIM_PT_material"
    bl_parent_id = "RADARSIM_PT_scene"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        item = context.active_object
        if item is not None and item.type == "MESH":
            known = tr("Radar Material") if echoes(item) else tr("no Radar Material")
            draw_state(self, known)

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        state = getattr(context.window_manager, PROGRESS_PROPERTY)
        column = layout.column(align=True)  # next to the list, the button's text would be cut
        column.prop(state, "preset", text="")
        button = column.operator("radarsim.assign_material", icon="MATERIAL")
        button.preset = state.preset
        item = context.active_object
        if item is not None and item.type in SURFACE_TYPES:
            split(layout).prop(item, MIRROR_PROPERTY)
        layout.operator("radarsim.add_asset_library", icon="ASSET_MANAGER")


class RADARSIM_PT_weather(ActiveRadarPanel, bpy.types.Panel):
    bl_label = "Weather"
    bl_idname = "RADARSIM_PT_weather"
    bl_parent_id = "RADARSIM_PT_scene"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        try:
            weather = settings(active_radar(context.scene)).record(Weather)
            taken = _attenuation_db_per_km(weather, carrier_hz(context.scene))
        except RadarSimError:
            draw_state(self, tr("beyond the models"))
            return
        draw_state(self, f"{taken:.3g} dB/km" if taken else tr("clear"))

    def draw(self, context: bpy.types.Context) -> None:
        layout, group = split(self.layout), active_group(context.scene)
        names = ["rain_mm_per_h"]
        if group.rain_mm_per_h:
            names += ["rain_polarisation", "rain_echo"]
            names += ["wind_x_mps", "wind_y_mps"] if group.rain_echo else []
        names += ["fog_g_per_m3", "gases"]
        if group.fog_g_per_m3 or group.gases:
            names.append("air_temperature_c")
        if group.gases:
            names += ["air_pressure_hpa", "vapour_g_per_m3"]
        draw_fields(layout, group, declared(Weather), *names)
        try:
            weather = settings(active_radar(context.scene)).record(Weather)
            _attenuation_db_per_km(weather, carrier_hz(context.scene))
        except RadarSimError as error:
            wrapped(context, layout, str(error), "ERROR")
        if group.rain_mm_per_h and not group.rain_echo:
            layout.label(text="The echo of rain is left out", icon="INFO")


@functools.lru_cache(maxsize=8)
def _attenuation_db_per_km(weather: Weather, carrier: float) -> float:
    return weather.attenuation_db_per_km(carrier)


#: Parents stand before their children.
CLASSES: tuple[type, ...] = (
    RADARSIM_OT_check_scene,
    RADARSIM_PT_scene,
    RADARSIM_PT_material,
    RADARSIM_PT_weather,
)
