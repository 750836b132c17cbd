# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the panel Results: what is shown of a run, and how it is processed."""

from __future__ import annotations

from typing import Any

import bpy

from ..rig_settings import PROGRESS_PROPERTY
from .fields import active_group
from .result_pictures import KINDS
from .shown_results import (
    RESULTS_PROPERTY,
    chosen_row,
    draw_pictures,
    follow_objects,
    ignore_objects,
    show_frame,
    show_picture,
    shown_run,
    shown_view,
)
from .timer_writes import may_write, register_timer_writes, unregister_timer_writes

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


def _picture_chosen(state: Any, context: Any) -> None:
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


def _detector_chosen(state: Any, context: Any) -> None:
    """Without noise a detector finds the sidelobes of the strong targets: it is switched on."""
    group = active_group(context.scene)
    if state.cfar != "OFF" and group is not None and group.use_link_budget:
        state.thermal_noise = True
    _process_again()


def _span_chosen(_: Any, context: Any) -> None:
    draw_pictures(context)


def _chosen_row(_: Any) -> int:
    return chosen_row()


def _shown_frame(_: Any) -> int:
    view = shown_view()
    return 0 if view is None else view.frame


class TargetRow(bpy.types.PropertyGroup):
    """A row of the list of targets; its name is that of the object."""

    text: bpy.props.StringProperty(name="Numbers", description="Range, range rate, SNR, RCS")


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
        name="Dynamic Range [dB]",
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


def chosen_processing(context: Any) -> list[str]:
    """Return how the tab wants a run processed, as options of `radarsim process`."""
    state = getattr(context.window_manager, RESULTS_PROPERTY)
    words = ["--thermal-noise"] if state.thermal_noise else []
    if state.cfar != "OFF":
        words += ["--cfar", state.cfar, "--pfa", state.pfa]
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
