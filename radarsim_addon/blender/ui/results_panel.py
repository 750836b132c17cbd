# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel of the results: pictures, processing, and the list of targets."""

from __future__ import annotations

from typing import Any

import bpy

from ..rig_settings import settings
from ..scene import active_radar
from .fields import RadarPanel, active_group, draw_number, draw_state, split
from .frame_views import Target
from .shown_results import (
    RESULTS_PROPERTY,
    age_of_results,
    choose_row,
    chosen_target,
    show_frame,
    shown_run,
    shown_view,
    uncertain_text,
)
from .translations import tr


class RADARSIM_OT_select_target(bpy.types.Operator):
    """Select the object of a target of the list, draw its paths, and mark it in the map"""

    bl_idname = "radarsim.select_target"
    bl_label = "Select Radar Target"
    bl_options = {"REGISTER", "UNDO"}

    row: bpy.props.IntProperty(name="Row", min=0, description="Row of the list, from 0")

    @classmethod
    def poll(cls, context: Any) -> bool:
        return shown_view() is not None

    def execute(self, context: Any) -> set[str]:
        if choose_row(context, self.row) is None:
            self.report({"ERROR"}, f"The list of targets has no row {self.row}.")
            return {"CANCELLED"}
        select_chosen(self, context)
        return {"FINISHED"}


def select_chosen(operator: Any, context: Any) -> None:
    """Select the object of the chosen target; an operator's report where that is not possible."""
    target = chosen_target()
    item = None if target is None else _object_of(context, target)
    if item is None:
        name = "" if target is None else target["name"]
        said = f"{name!r} is not in this view layer" if name else "No object is known there"
        operator.report({"INFO"}, f"{said}; the target is marked in the map.")
        return
    for other in context.view_layer.objects:
        other.select_set(other == item)
    context.view_layer.objects.active = item


def _object_of(context: Any, target: Target) -> Any:
    """The object of the scene that a target is on; that of an instance is "Instancer/Name"."""
    for name in (target["name"], target["name"].partition("/")[0]):
        item = context.view_layer.objects.get(name)
        if item is not None and item.visible_get():
            return item
    return None


class RADARSIM_OT_step_frame(bpy.types.Operator):
    """Show the next or the previous processed frame"""

    bl_idname = "radarsim.step_frame"
    bl_label = "Step Radar Frame"
    bl_options = {"REGISTER"}

    step: bpy.props.IntProperty(name="Step", default=1, description="Frames forward; -1 is back")

    @classmethod
    def poll(cls, context: Any) -> bool:
        return shown_view() is not None

    def execute(self, context: Any) -> set[str]:
        run, view = shown_run(), shown_view()
        assert run is not None and view is not None
        frames = sorted(run.frames)
        place = frames.index(view.frame) + self.step
        show_frame(context, frames[min(max(place, 0), len(frames) - 1)])
        return {"FINISHED"}


class RADARSIM_UL_targets(bpy.types.UIList):
    """Rows: object, and its numbers."""

    def draw_item(
        self, context: Any, layout: Any, data: Any, item: Any, icon: int, owner: Any, name: str
    ) -> None:
        row = layout.split(factor=0.3)
        row.label(text=item.name, translate=False)
        row.label(text=item.text, translate=False)


class RADARSIM_PT_results(RadarPanel, bpy.types.Panel):
    bl_label = "Results"
    bl_idname = "RADARSIM_PT_results"

    def draw_header_preset(self, context: Any) -> None:
        view = shown_view()
        if view is not None:
            draw_state(
                self, tr("frame {n}, {count} targets", n=view.frame, count=len(view.targets))
            )

    def draw(self, context: Any) -> None:
        layout = split(self.layout)
        layout.operator("radarsim.process_last_run", icon="GRAPH")
        state = getattr(context.window_manager, RESULTS_PROPERTY)
        run, view = shown_run(), shown_view()
        age = age_of_results()
        if age:
            layout.label(text=age, icon="ERROR")
        if run is not None and view is not None:
            if len(run.frames) > 1:
                row = layout.row(align=True)
                row.operator("radarsim.step_frame", text="", icon="TRIA_LEFT").step = -1
                row.prop(state, "frame", text="")
                row.operator("radarsim.step_frame", text="", icon="TRIA_RIGHT").step = 1
            layout.prop(state, "picture")
            layout.prop(state, "span_db")
        _draw_processing(context, layout, state)
        if view is not None and len(state.rows):
            layout.template_list(
                "RADARSIM_UL_targets", "", state, "rows", state, "row", rows=min(len(state.rows), 6)
            )
            _draw_chosen(layout)
        if run is not None:
            row = layout.row(align=True)
            row.operator("radarsim.save_picture", text="Save Picture...", icon="FILE_IMAGE")
            row.operator("radarsim.save_animation", text="Animation...", icon="RENDER_ANIMATION")
        layout.operator("radarsim.open_output", icon="FILE_FOLDER")
        layout.operator("radarsim.coverage", icon="IPO_SINE")


def _draw_processing(context: Any, layout: Any, state: Any) -> None:
    """Settings that process the run again."""
    column = layout.column()
    if active_group(context.scene) is not None:
        row = column.row()
        row.active = bool(settings(active_radar(context.scene)).use_link_budget)
        row.prop(state, "thermal_noise")
    column.prop(state, "cfar")
    if state.cfar != "OFF":
        column.prop(state, "pfa")
    if state.picture != "SPECTROGRAM":
        return
    column.prop(state, "window_pulses")
    column.prop(state, "overlap", slider=True)
    column.row().prop(state, "source", expand=True)
    if state.source == "RANGES":
        column.prop(state, "range_start")
        column.prop(state, "range_stop")
    elif state.source == "OBJECT":
        column.prop_search(state, "object_name", bpy.data, "objects")


def _draw_chosen(layout: Any) -> None:
    """Numbers of the chosen target."""
    target = chosen_target()
    if target is None:
        return
    column = layout.column(align=True)
    draw_number(column, "Target", target["name"] or tr("no object known"))
    draw_number(column, "Range", f"{target['range_m']:.5g} m")
    draw_number(column, "Range Rate", f"{target['velocity_mps'] + 0.0:+.4g} m/s")
    for label, key, unit in (
        (tr("Power"), "power_dbm", "dBm"), (tr("RCS"), "rcs_dbsm", "dBsm"),
        (tr("SNR in Map"), "snr_db", "dB"),
    ):  # fmt: skip
        value = target[key]  # type: ignore[literal-required]
        if value is not None:
            draw_number(column, label, f"{value:.1f} {unit}{uncertain_text(target)}")


CLASSES: tuple[type, ...] = (
    RADARSIM_OT_select_target,
    RADARSIM_OT_step_frame,
    RADARSIM_UL_targets,
)
