# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of the scene: a checklist with buttons that fix, materials, weather."""

from __future__ import annotations

import functools
import json
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import bpy

from ...errors import RadarSimError
from ...findings import Finding, merge
from ...options import declared
from ...signal.radar import Weather
from ..headless import make_job
from ..materials import SURFACE_TYPES
from ..plan import Measurement
from ..rig_settings import MIRROR_PROPERTY, PROGRESS_PROPERTY, carrier_hz, settings
from ..scene import active_radar, echoes
from .fields import (
    ActiveRadarPanel,
    RadarPanel,
    active_group,
    draw_fields,
    draw_state,
    shown_at_field,
    split,
    wrapped,
)
from .fixes import fixes_of
from .material_names import draw_suggestions
from .run_time import long_run
from .scene_reading import SceneRecord, current_measurement, quick_findings, scene_record
from .shown_findings import ICONS, findings_text, read_findings, report_findings, reported
from .translations import tr


class RADARSIM_OT_check_scene(bpy.types.Operator):
    """Check the scene as a run does before its first render: meshes, materials, motion, numbers"""

    bl_idname = "radarsim.check_scene"
    bl_label = "Check Scene"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        running = getattr(context.window_manager, PROGRESS_PROPERTY).running
        return not running and active_group(context.scene) is not None

    def execute(self, context: Any) -> set[str]:
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
    context: Any, measurement: Measurement, record: SceneRecord | None
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
    "run-takes-long",
}  # fmt: skip


def draw_rows(layout: Any, findings: Iterable[Finding], measurement: Measurement | None) -> None:
    """Draw findings: a line of a few words, and buttons that fix, select and explain."""
    for item in findings:
        column = layout.column(align=True)
        column.label(text=title_of(item.code), icon=ICONS[item.severity])
        for fix in fixes_of(item, measurement):
            button = column.operator(fix.operator, text=fix.label, icon="MODIFIER")
            for name, value in fix.values.items():
                setattr(button, name, value)
        row = column.row(align=True)
        if item.subjects:
            more = f" + {len(item.subjects) - 1}" if len(item.subjects) > 1 else ""
            button = row.operator(
                "radarsim.select_subjects",
                text=item.subjects[0] + more,
                icon="RESTRICT_SELECT_OFF",
                translate=False,
            )
            button.names = json.dumps(item.subjects)
        button = row.operator("radarsim.explain", text="Explain", icon="QUESTION")
        button.code, button.message = item.code, item.message


def title_of(code: str) -> str:
    """Return a few words for a finding that a sidebar has room for: its code's own."""
    return code.removeprefix("scene-").replace("-", " ").capitalize()


def _all_known(context: Any) -> tuple[Measurement | None, SceneRecord | None, str]:
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

    def draw_header_preset(self, context: Any) -> None:
        measurement, record, _ = _all_known(context)
        if measurement is None:
            draw_state(self, tr("cannot measure"))
            return
        found = known_findings(context, measurement, record)
        counts = {kind: sum(i.severity == kind for i in found) for kind in ("error", "caution")}
        texts = [_count_text(kind, n) for kind, n in counts.items() if n]
        draw_state(self, ", ".join(texts) or tr("ok"))

    def draw(self, context: Any) -> None:
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

    def draw_header_preset(self, context: Any) -> None:
        item = context.active_object
        if item is not None and item.type == "MESH":
            known = tr("Radar Material") if echoes(item) else tr("no Radar Material")
            draw_state(self, f"{item.name}: {known}")

    def draw(self, context: Any) -> None:
        layout = self.layout
        state = getattr(context.window_manager, PROGRESS_PROPERTY)
        row = layout.row(align=True)
        row.prop(state, "preset", text="")
        button = row.operator("radarsim.assign_material", icon="MATERIAL")
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

    def draw_header_preset(self, context: Any) -> None:
        try:
            weather = settings(active_radar(context.scene)).record(Weather)
            taken = _attenuation_db_per_km(weather, carrier_hz(context.scene))
        except RadarSimError:
            draw_state(self, tr("beyond the models"))
            return
        draw_state(self, f"{taken:.3g} dB/km" if taken else tr("clear"))

    def draw(self, context: Any) -> None:
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
