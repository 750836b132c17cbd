# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel of the results: pictures, processing, and the list of targets."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import blf
import bpy

from ...signal.pictures import Target
from ..rig_settings import PROGRESS_PROPERTY, settings
from ..scene import active_radar
from .fields import (
    RadarPanel,
    active_group,
    draw_number,
    draw_state,
    may_write,
    read_findings,
    register_timer_writes,
    split,
    tr,
    unregister_timer_writes,
)
from .picture_images import axes_of, fault_of_pictures
from .result_pictures import KINDS, NEAR_PX, nearest_frame, nearest_target, read_out
from .scene_panel import draw_rows
from .shown_results import (
    RESULTS_PROPERTY,
    age_of_results,
    choose_row,
    chosen_row,
    chosen_target,
    draw_pictures,
    follow_objects,
    has_unseen_run,
    ignore_objects,
    show_frame,
    show_picture,
    shown_run,
    shown_view,
    target_text,
    uncertain_text,
)

# -------------------------------------------------------------------------------------------------
# Settings of the panel Results: what is shown of a run, and how it is processed.
# -------------------------------------------------------------------------------------------------


#: Time after the last change at which a run is processed again [s].
_CALM_S = 0.4


def _process_again(_: Any = None, __: Any = None) -> None:
    """Process the run again a moment after the last change; in the background a script does."""
    if bpy.app.background or shown_run() is None:
        return
    if bpy.app.timers.is_registered(_process_now):
        bpy.app.timers.unregister(_process_now)
    bpy.app.timers.register(_process_now, first_interval=_CALM_S)


@may_write
def _process_now() -> float | None:
    manager = bpy.context.window_manager
    if getattr(manager, PROGRESS_PROPERTY).running:
        return _CALM_S
    window = manager.windows[0]
    area = next((one for one in window.screen.areas if one.type == "VIEW_3D"), None)
    if area is not None:
        region = next(one for one in area.regions if one.type == "WINDOW")
        with bpy.context.temp_override(window=window, area=area, region=region):
            bpy.ops.radarsim.process_last_run("INVOKE_DEFAULT")
    return None


def _picture_chosen(state: Any, context: bpy.types.Context) -> None:
    run, view = shown_run(), shown_view()
    if run is None or view is None:
        return
    if KINDS[state.picture].needs in view.arrays:
        show_picture(context, state.picture)
    else:
        _process_again()


def _frame_chosen(_: Any, number: int) -> None:
    show_frame(bpy.context, number)


def _row_chosen(_: Any, row: int) -> None:
    bpy.ops.radarsim.select_target("EXEC_DEFAULT", True, row=row)


def _detector_chosen(state: Any, context: bpy.types.Context) -> None:
    """Without noise a detector finds the sidelobes of the strong targets: it is switched on."""
    group = active_group(context.scene)
    if state.cfar != "OFF" and group is not None and group.use_link_budget:
        state.thermal_noise = True
    _process_again()


def _span_chosen(_: Any, context: bpy.types.Context) -> None:
    draw_pictures(context)


def _chosen_row(_: Any) -> int:
    return chosen_row()


def _shown_frame(_: Any) -> int:
    view = shown_view()
    return 0 if view is None else view.frame


class TargetRow(bpy.types.PropertyGroup):
    """A row of the list of targets; its name is that of the object."""

    range_text: bpy.props.StringProperty(name="Range", description="One-way range [m]")
    rate_text: bpy.props.StringProperty(name="Range Rate", description="Range rate [m/s]")
    snr_text: bpy.props.StringProperty(name="SNR", description="SNR in the map [dB]")
    rcs_text: bpy.props.StringProperty(name="RCS", description="Radar cross section [dBsm]")


class RadarResults(bpy.types.PropertyGroup):
    """What is shown of the last run, and how it is processed; no file keeps it."""

    picture: bpy.props.EnumProperty(
        name="Picture",
        items=tuple((name, kind.label, kind.tooltip) for name, kind in KINDS.items()),
        update=_picture_chosen,
        options={"SKIP_SAVE"},
        description="Choose the picture in the Image Editor",
    )
    frame: bpy.props.IntProperty(
        name="Frame",
        get=_shown_frame,
        set=_frame_chosen,
        options={"SKIP_SAVE"},
        description="Choose the processed frame that is shown",
    )
    span_db: bpy.props.FloatProperty(
        name="Range of dB",
        default=80.0,
        min=10.0,
        max=200.0,
        step=500,
        precision=0,
        update=_span_chosen,
        options={"SKIP_SAVE"},
        description="Set the decibels from the strongest cell to the lowest colour",
    )
    thermal_noise: bpy.props.BoolProperty(
        name="Thermal Noise",
        update=_process_again,
        options={"SKIP_SAVE"},
        description="Add the thermal noise of the run's link budget; processes the run again",
    )
    cfar: bpy.props.EnumProperty(
        name="Detector",
        items=(
            ("OFF", "None", "Detect nothing; the list holds the objects of the frame"),
            ("ca", "Cell Averaging", "Compare each cell with the mean of the cells around it"),
            ("os", "Ordered Statistic", "Less disturbed by neighbours and edges of clutter"),
        ),
        update=_detector_chosen,
        options={"SKIP_SAVE"},
        description="Choose the detector (CFAR); processes the run again, with thermal noise",
    )
    pfa: bpy.props.EnumProperty(
        name="False Alarms",
        items=tuple(
            (f"1e-{n}", f"1e-{n}", f"One false alarm in 1e{n} cells") for n in (3, 4, 6, 8, 10)
        ),
        default="1e-6",
        update=_process_again,
        options={"SKIP_SAVE"},
        description="Choose the false alarms per cell; processes the run again",
    )
    parts: bpy.props.BoolProperty(
        name="Parts",
        update=_process_again,
        options={"SKIP_SAVE"},
        description="List parts of objects, such as the wheels of a car, by themselves",
    )
    window_pulses: bpy.props.IntProperty(
        name="Window [pulses]",
        default=64,
        min=2,
        max=1 << 16,
        update=_process_again,
        options={"SKIP_SAVE"},
        description="Set the pulses of a window of the spectrogram; processes the run again",
    )
    overlap: bpy.props.FloatProperty(
        name="Overlap",
        default=0.75,
        min=0.0,
        max=0.99,
        update=_process_again,
        options={"SKIP_SAVE"},
        description="Set the fraction that neighbouring windows have in common",
    )
    source: bpy.props.EnumProperty(
        name="Echoes",
        items=(
            ("ALL", "All", "Echoes of all ranges"),
            ("RANGES", "Ranges", "Echoes between two ranges"),
            ("OBJECT", "Object", "Paths that end on one object"),
        ),
        update=_process_again,
        options={"SKIP_SAVE"},
        description="Choose the echoes of the spectrogram",
    )
    range_start: bpy.props.FloatProperty(
        name="Range Start [m]",
        min=0.0,
        update=_process_again,
        options={"SKIP_SAVE"},
        description="Set the one-way range at which the spectrogram begins [m]",
    )
    range_stop: bpy.props.FloatProperty(
        name="Range Stop [m]",
        default=100.0,
        min=0.0,
        update=_process_again,
        options={"SKIP_SAVE"},
        description="Set the one-way range at which the spectrogram ends [m]",
    )
    object_name: bpy.props.StringProperty(
        name="Object",
        update=_process_again,
        options={"SKIP_SAVE"},
        description="Choose the object or collection of the spectrogram",
    )
    rows: bpy.props.CollectionProperty(
        type=TargetRow, options={"SKIP_SAVE"}, description="Targets of the frame"
    )
    row: bpy.props.IntProperty(
        name="Target",
        get=_chosen_row,
        set=_row_chosen,
        options={"SKIP_SAVE"},
        description="Select the object of this target, and draw its paths",
    )


def chosen_processing(context: bpy.types.Context) -> list[str]:
    """Return how the tab wants a run processed, as options of `radarsim process`."""
    state = getattr(context.window_manager, RESULTS_PROPERTY)
    words = ["--thermal-noise"] if state.thermal_noise else []
    if state.cfar != "OFF":
        words += ["--cfar", state.cfar, "--pfa", state.pfa]
    if state.parts:
        words.append("--parts")
    if state.picture == "SPECTROGRAM":
        words += ["--spectrogram", str(state.window_pulses)]
        words += ["--spectrogram-overlap", f"{state.overlap:.4g}"]
        if state.source == "RANGES":
            limits = f"{state.range_start:.9g}:{state.range_stop:.9g}"
            words += ["--spectrogram-range-limits", limits]
        elif state.source == "OBJECT" and state.object_name:
            words.append(f"--spectrogram-object={state.object_name}")
    return words


def register_results() -> None:
    """Register the state of the results; a second call changes nothing."""
    register_timer_writes()
    if not TargetRow.is_registered:
        bpy.utils.register_class(TargetRow)
        bpy.utils.register_class(RadarResults)
        pointer = bpy.props.PointerProperty(type=RadarResults, name="Radar results")
        setattr(bpy.types.WindowManager, RESULTS_PROPERTY, pointer)
    follow_objects()


def unregister_results() -> None:
    """Take it back; a second call changes nothing."""
    ignore_objects()
    if bpy.app.timers.is_registered(_process_now):
        bpy.app.timers.unregister(_process_now)
    if TargetRow.is_registered:
        delattr(bpy.types.WindowManager, RESULTS_PROPERTY)
        bpy.utils.unregister_class(RadarResults)
        bpy.utils.unregister_class(TargetRow)
    unregister_timer_writes()


# -------------------------------------------------------------------------------------------------
# A click on a target in a picture of the results selects its object and draws its paths. The values
# under the mouse are written into the picture.
# -------------------------------------------------------------------------------------------------


#: Pictures in which targets have places.
_KINDS = ("MAP", "PROFILE", "SPECTROGRAM", "RANGE_TIME")
_ITEMS = tuple((name, KINDS[name].label, KINDS[name].tooltip) for name in _KINDS)
_keys: list[tuple[Any, Any]] = []
_handles: list[Any] = []


def _kind_of(context: bpy.types.Context) -> str:
    """The kind of picture that the editor under the mouse shows; empty if a click means nothing."""
    space = context.space_data
    image = space.image if space is not None and space.type == "IMAGE_EDITOR" else None
    name = "" if image is None else image.name
    return next((kind for kind in _KINDS if KINDS[kind].image == name), "")


class RADARSIM_OT_pick_target(bpy.types.Operator):
    """Choose the target next to the mouse: select its object, draw its paths, show its numbers"""

    bl_idname = "radarsim.pick_target"
    bl_label = "Pick Radar Target"
    bl_options = {"REGISTER", "UNDO"}

    kind: bpy.props.EnumProperty(
        name="Picture",
        items=_ITEMS,
        description="Choose the picture that the place is in",
    )
    x: bpy.props.FloatProperty(
        name="X", min=0.0, max=1.0, description="Set the place from the left edge to the right one"
    )
    y: bpy.props.FloatProperty(
        name="Y", min=0.0, max=1.0, description="Set the place from the lower edge to the upper one"
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return shown_view() is not None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        kind = _kind_of(context)
        if not kind:
            return {"PASS_THROUGH"}
        mouse = event.mouse_region_x, event.mouse_region_y
        self.kind = kind
        self.x, self.y = x, y = context.region.view2d.region_to_view(*mouse)
        axes = axes_of(KINDS[kind].image)
        if axes is None or not axes.holds(x, y):
            return {"PASS_THROUGH"}
        done = self.execute(context)
        return done if done == {"FINISHED"} else {*done, "PASS_THROUGH"}  # for Blender's own tools

    def execute(self, context: bpy.types.Context) -> set[str]:
        run, view = shown_run(), shown_view()
        assert run is not None and view is not None
        if bpy.app.background:
            draw_pictures(context, {self.kind})
        axes = axes_of(KINDS[self.kind].image)
        if axes is None:
            self.report({"INFO"}, "The picture is not drawn yet. Try again in a moment.")
            return {"CANCELLED"}
        if self.kind == "RANGE_TIME":  # each frame has its own targets
            time_s, _ = axes.value(self.x, self.y)
            view = run.view(run.frames[nearest_frame(run.profiles, time_s)])
        row, away_px = nearest_target(self.kind, axes, view, self.x, self.y)
        if away_px > NEAR_PX:
            self.report({"INFO"}, "No target of the list is near the mouse. Click on a target.")
            return {"CANCELLED"}
        target = choose_row(context, row, view.frame)
        assert target is not None
        select_chosen(self, context)
        self.report({"INFO"}, f"{target['name'] or 'Target'}: {target_text(target)}")
        return {"FINISHED"}


class RADARSIM_OT_read_out(bpy.types.Operator):
    """Write the values under the mouse into a picture of the results"""

    bl_idname = "radarsim.read_out"
    bl_label = "Read Radar Picture"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(_kind_of(context)) and shown_view() is not None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        kind, view = _kind_of(context), shown_view()
        axes = axes_of(KINDS[kind].image) if kind else None
        assert view is not None
        mouse = context.region.view2d.region_to_view(event.mouse_region_x, event.mouse_region_y)
        text = "" if axes is None else read_out(kind, axes, view, *mouse)
        pointer = context.area.as_pointer()
        if _read_out.get(pointer, "") != text:
            _read_out[pointer] = text
            context.region.tag_redraw()
        return {"PASS_THROUGH"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        return {"CANCELLED"}  # there is no mouse


#: What is written into the Image Editors, by their addresses.
_read_out: dict[int, str] = {}
_READ_OUT_PX = 12


def _draw_read_out() -> None:
    context = bpy.context
    text = _read_out.get(context.area.as_pointer(), "") if _kind_of(context) else ""
    if not text:
        return
    scale = context.preferences.system.ui_scale
    blf.size(0, _READ_OUT_PX * scale)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    blf.enable(0, blf.SHADOW)  # readable on the picture and beside it
    blf.shadow(0, 5, 0.0, 0.0, 0.0, 1.0)
    blf.position(0, 10 * scale, 10 * scale, 0)
    blf.draw(0, text)
    blf.disable(0, blf.SHADOW)


PICKING_CLASSES: tuple[type, ...] = (RADARSIM_OT_pick_target, RADARSIM_OT_read_out)


def follow_clicks() -> None:
    """Choose targets by clicks in Image Editors; a second call changes nothing."""
    keys = bpy.context.window_manager.keyconfigs.addon
    if _keys or keys is None:
        return
    keymap = keys.keymaps.new(name="Image", space_type="IMAGE_EDITOR")
    for operator, kind, value in (
        ("radarsim.pick_target", "LEFTMOUSE", "PRESS"), ("radarsim.read_out", "MOUSEMOVE", "ANY")
    ):  # fmt: skip
        _keys.append((keymap, keymap.keymap_items.new(operator, kind, value)))
    add = bpy.types.SpaceImageEditor.draw_handler_add
    _handles.append(add(_draw_read_out, (), "WINDOW", "POST_PIXEL"))


def ignore_clicks() -> None:
    """Take it back; a second call changes nothing."""
    while _keys:
        keymap, item = _keys.pop()
        keymap.keymap_items.remove(item)
    while _handles:
        bpy.types.SpaceImageEditor.draw_handler_remove(_handles.pop(), "WINDOW")
    _read_out.clear()


class RADARSIM_OT_select_target(bpy.types.Operator):
    """Select the object of a target of the list, draw its paths, and mark it in the map"""

    bl_idname = "radarsim.select_target"
    bl_label = "Select Radar Target"
    bl_options = {"REGISTER", "UNDO"}

    row: bpy.props.IntProperty(name="Row", min=0, description="Row of the list, from 0")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return shown_view() is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        if choose_row(context, self.row) is None:
            self.report({"ERROR"}, f"The list of targets has no row {self.row}.")
            return {"CANCELLED"}
        select_chosen(self, context)
        return {"FINISHED"}


def select_chosen(operator: bpy.types.Operator, context: bpy.types.Context) -> None:
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


def _object_of(context: bpy.types.Context, target: Target) -> Any:
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
    def poll(cls, context: bpy.types.Context) -> bool:
        return shown_view() is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        run, view = shown_run(), shown_view()
        assert run is not None and view is not None
        frames = sorted(run.frames)
        place = frames.index(view.frame) + self.step
        show_frame(context, frames[min(max(place, 0), len(frames) - 1)])
        return {"FINISHED"}


class RADARSIM_UL_targets(bpy.types.UIList):
    """Rows: object, and its numbers."""

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
        texts = [getattr(item, f"{key}_text") for key in _columns_of(data)]
        _draw_columns(layout, item.name, texts)


#: Columns of the list besides the name, and the units in their heads.
_COLUMNS = {"range": "m", "rate": "m/s", "snr": "dB", "rcs": "dBsm"}
#: Rows that are looked at for what they have.
_FIRST_ROWS = 50


def _columns_of(state: Any) -> list[str]:
    """Columns in which a row of the list has something."""
    rows = list(itertools.islice(state.rows, _FIRST_ROWS))
    return [key for key in _COLUMNS if any(getattr(row, f"{key}_text") for row in rows)]


def _draw_columns(layout: bpy.types.UILayout, name: str, texts: Sequence[str]) -> None:
    """Draw a row of the list: the name, and numbers that end below each other."""
    row = layout.split(factor=0.32)
    row.label(text=name, translate=False)
    cells = row.grid_flow(row_major=True, columns=len(texts), even_columns=True, align=True)
    for text in texts:
        cell = cells.row()
        cell.alignment = "RIGHT"
        cell.label(text=text, translate=False)


class RADARSIM_PT_results(RadarPanel, bpy.types.Panel):
    bl_label = "Results"
    bl_idname = "RADARSIM_PT_results"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        view = shown_view()
        if view is not None:
            count = len(view.targets)
            text = tr("frame {n}, 1 target", n=view.frame)
            if count != 1:
                text = tr("frame {n}, {count} targets", n=view.frame, count=count)
            draw_state(self, text)

    def draw(self, context: bpy.types.Context) -> None:
        layout = split(self.layout)
        row = layout.row(align=True)
        row.operator("radarsim.process_last_run", icon="GRAPH")
        row.operator("radarsim.workspace", text="", icon="WORKSPACE")
        state = getattr(context.window_manager, RESULTS_PROPERTY)
        run, view = shown_run(), shown_view()
        age = age_of_results()
        if age:
            layout.label(text=age, icon="ERROR")
        if has_unseen_run():
            layout.label(text="This file has a run: process it to see it", icon="INFO")
        fault = fault_of_pictures()
        if run is not None and view is not None:
            if fault:
                layout.label(text=fault, icon="ERROR")
            if len(run.frames) > 1:
                row = layout.row(align=True)
                row.operator("radarsim.step_frame", text="", icon="TRIA_LEFT").step = -1
                row.prop(state, "frame", text="")
                row.operator("radarsim.step_frame", text="", icon="TRIA_RIGHT").step = 1
            layout.prop(state, "picture")
            layout.prop(state, "span_db")
        _draw_processing(context, layout, state)
        progress = getattr(context.window_manager, PROGRESS_PROPERTY)
        draw_rows(layout, read_findings(progress.processed), None)
        if view is not None and len(state.rows):
            _draw_columns(layout, tr("Target"), [_COLUMNS[key] for key in _columns_of(state)])
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


def _draw_processing(context: bpy.types.Context, layout: bpy.types.UILayout, state: Any) -> None:
    """Settings that process the run again."""
    column = layout.column()
    if active_group(context.scene) is not None:
        row = column.row()
        row.active = bool(settings(active_radar(context.scene)).use_link_budget)
        row.prop(state, "thermal_noise")
    column.prop(state, "cfar")
    if state.cfar != "OFF":
        column.prop(state, "pfa")
    column.prop(state, "parts")
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


def _draw_chosen(layout: bpy.types.UILayout) -> None:
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
        (tr("SNR in Map"), "snr_db", "dB"), (tr("Azimuth"), "azimuth_deg", "°"),
        (tr("Elevation"), "elevation_deg", "°"),
    ):  # fmt: skip
        value = target[key]  # type: ignore[literal-required]
        if value is not None:
            doubt = "" if unit == "°" else uncertain_text(target)
            draw_number(column, label, f"{value:.1f} {unit}{doubt}")


CLASSES: tuple[type, ...] = (
    RADARSIM_OT_select_target,
    RADARSIM_OT_step_frame,
    RADARSIM_UL_targets,
)
