# SPDX-License-Identifier: GPL-3.0-or-later
"""What a button next to a finding does: set numbers, select, repair, explain."""

from __future__ import annotations

import json
import math
import textwrap
from typing import Any, NamedTuple

import bmesh
import bpy

from ...errors import ConfigError, SceneError
from ...findings import Finding, frequency_text, length_text
from ..plan import Measurement
from ..rig_settings import set_values, settings
from ..scene import active_radar
from .shown_findings import reported
from .translations import tr

#: Letters of a line of an explanation.
_LETTERS = 70
#: Part of the pulse interval that a pulse is given where it has to become shorter.
_FILL = 0.95


class Fix(NamedTuple):
    """A button: operator, label, and the operator's properties."""

    operator: str
    label: str
    values: dict[str, Any]


def fixes_of(item: Finding, measurement: Measurement | None) -> list[Fix]:
    """Return the buttons of a finding; each but the explanation changes or selects something."""
    found = []
    values, label = _values(item, measurement)
    if values:
        found.append(Fix("radarsim.set_values", label, {"values": json.dumps(values)}))
    if item.code in ("no-radar-material", "optical-material"):
        found.append(Fix("radarsim.suggest_materials", "Assign by Name...", {}))
    if item.code in ("mesh-flipped", "mesh-inside-out"):
        names = json.dumps(item.subjects)
        found.append(Fix("radarsim.recalculate_normals", "Recalculate Normals", {"names": names}))
    return found


def _values(item: Finding, measurement: Measurement | None) -> tuple[dict[str, Any], str]:
    """Settings that remove the cause of a finding, and the label of their button."""
    numbers = {name: _largest(value) for name, value in item.numbers.items()}
    if item.code == "scene-beyond-unambiguous-velocity" and measurement is not None:
        prf_hz = numbers["prf_hz"]
        shorter = _shorter_pulse(measurement, prf_hz)
        label = tr("PRF {value}", value=frequency_text(prf_hz))
        return ({}, "") if shorter is None else ({"prf_hz": prf_hz, **shorter}, label)
    if item.code == "scene-beyond-range-limits":
        stop_m = float(f"{1.05 * numbers['farthest_m']:.2g}")
        return {"range_stop_m": stop_m}, tr("Stop {value}", value=length_text(stop_m))
    if item.code == "scene-beyond-unambiguous-range" and numbers.get("limit") == "PRF":
        prf_hz = 299_792_458.0 / (2 * numbers["farthest_m"])
        prf_hz = math.floor(prf_hz / 10 ** (step := math.floor(math.log10(prf_hz)) - 1)) * 10**step
        return {"prf_hz": float(prf_hz)}, tr("PRF {value}", value=frequency_text(prf_hz))
    if item.code == "ring-step-below-resolution":
        step_m = numbers["range_resolution_m"]
        return {"ring_step_m": step_m}, tr("Step {value}", value=length_text(step_m))
    if item.code in ("footprints-too-coarse", "objects-below-a-pixel") and numbers["width_px"]:
        sides = {name: int(numbers[name]) for name in ("width_px", "height_px")}
        return sides, tr(
            "Resolution {width} x {height}", width=sides["width_px"], height=sides["height_px"]
        )
    if item.code == "run-takes-long" and not numbers["draft"]:
        draft = {"replicates": 2, "max_standard_error": 0.0, "time_limit_s": 0.0}
        return draft, tr("Draft Quality")
    return _CONSTANT.get(item.code, ({}, ""))


#: Fixes that need no number of the finding.
_CONSTANT: dict[str, tuple[dict[str, Any], str]] = {
    "scene-beyond-rings": ({"rings": 0}, "Rings to the End"),
    "single-snapshot": ({"snapshots": 2}, "Two Snapshots"),
    "short-snapshot-interval": ({"snapshot_interval_s": 0.01}, "10 ms"),
}


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
    def description(cls, context: Any, properties: Any) -> str:
        values = json.loads(properties.values or "{}")
        texts = (f"{name} = {value}" for name, value in values.items())
        return tr("Set {values} (SI units)", values=", ".join(texts))

    def execute(self, context: Any) -> set[str]:
        with reported(self):
            try:
                values = json.loads(self.values)
            except ValueError as error:
                raise ConfigError(f"{self.values!r:.60} is no JSON; expected settings.") from error
            set_values(settings(active_radar(context.scene)), values)
            return {"FINISHED"}
        return {"CANCELLED"}


def _named(context: Any, names: str) -> list[Any]:
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

    def execute(self, context: Any) -> set[str]:
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

    def execute(self, context: Any) -> set[str]:
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
        return {"FINISHED"}


class RADARSIM_OT_explain(bpy.types.Operator):
    """Say what was found, why it matters and what to do"""

    bl_idname = "radarsim.explain"
    bl_label = "Explain a Finding"
    bl_options = {"INTERNAL"}

    code: bpy.props.StringProperty(name="Code", description="Code of docs/findings.md")
    message: bpy.props.StringProperty(name="Message", description="Text of the finding")

    @classmethod
    def description(cls, context: Any, properties: Any) -> str:
        return str(properties.message).rstrip(".")

    def execute(self, context: Any) -> set[str]:
        lines = textwrap.wrap(self.message, _LETTERS)
        if bpy.app.background or context.window is None:
            self.report({"INFO"}, self.message)
            return {"FINISHED"}

        def draw(menu: Any, _: Any) -> None:
            for line in lines:
                menu.layout.label(text=line)

        context.window_manager.popup_menu(draw, title=self.code, icon="INFO")
        return {"FINISHED"}


CLASSES: tuple[type, ...] = (
    RADARSIM_OT_set_values,
    RADARSIM_OT_select_subjects,
    RADARSIM_OT_recalculate_normals,
    RADARSIM_OT_explain,
)
