# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators: they turn named errors into reports and leave the work to others."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Euler, Vector

from ...errors import ConfigError, OutputError, RadarSimError
from ...signal.pictures import COVERAGE_PICTURE, coverage_message
from ...signal.pipeline import write_coverage
from ...signal.radar import coverage_curve
from ...terminal import ProgressLine
from ..headless import expected_size, save_copy, scene_coverage
from ..materials import SURFACE_TYPES
from ..nodes import PRESETS, assign_radar_material
from ..plan import CoverageRequest, radar_preset
from ..rig_settings import (
    PROGRESS_PROPERTY,
    apply_preset,
    output_folder,
    read_measurement,
    settings,
)
from ..scene import active_radar, setup_rig
from .fields import findings_text, report_findings, reported, tr
from .live_preview import LIVE_PROPERTY
from .measuring import WindowRun, add_run, advance, current_run, end_runs, show_state
from .panels import preset_choice
from .picture_images import COVERAGE_IMAGE, draw_image, show_images, start_drawing
from .results_panel import chosen_processing
from .scene_reading import redraw_panels
from .shown_results import ProcessingJob, check_own_run, note_copied, show_run

#: Seconds between two looks at a running job.
_TICK_S = 0.01

# -------------------------------------------------------------------------------------------------
# Where a new radar goes: to the user's view, looking at the selected objects.
# -------------------------------------------------------------------------------------------------


#: Distance from the centre of a scene, over its radius, at which the scene fills the new camera.
_AWAY = 3.0


def radar_pose(context: bpy.types.Context) -> tuple[Vector, Euler] | None:
    """Return location and rotation of a new radar that looks at the selected objects.

    The radar is at the eye of the 3D view, or outside the scene if the eye is inside an object.
    Without a selection, it looks at all objects. None if the scene has no surfaces.
    """
    surfaces = [
        item
        for item in context.scene.objects
        if item.type in SURFACE_TYPES and not item.hide_render
    ]
    if not surfaces:
        return None
    centre, radius = _sphere(surfaces)
    target, _ = _sphere([item for item in surfaces if item.select_get()] or surfaces)
    view = getattr(context.space_data, "region_3d", None)
    backwards = Vector((0.0, -1.0, 0.0))
    if view is not None:
        backwards = view.view_rotation @ Vector((0.0, 0.0, 1.0))
        eye = view.view_matrix.inverted().translation
        if view.view_perspective != "ORTHO" and not _within(eye, surfaces) and eye != target:
            return eye, _looking(target - eye)
    place = centre + backwards * max(_AWAY * radius, 1.0)
    return place, _looking(target - place)


def _sphere(items: list[Any]) -> tuple[Vector, float]:
    """Return the centre and the radius of the box around objects."""
    corners = [item.matrix_world @ Vector(corner) for item in items for corner in item.bound_box]
    low = Vector(tuple(map(min, *corners)))
    high = Vector(tuple(map(max, *corners)))
    return (low + high) / 2, (high - low).length / 2


def _within(place: Vector, items: list[Any]) -> bool:
    """Return whether a place is inside the box of an object."""
    for item in items:
        local = item.matrix_world.inverted_safe() @ place
        sides = zip(*item.bound_box, strict=True)
        if all(min(side) <= x <= max(side) for side, x in zip(sides, local, strict=True)):
            return True
    return False


def _show_radar(context: bpy.types.Context, radar: Any) -> None:
    """Move the user's view back until it shows the radar and the scene; switch on the preview."""
    view = getattr(context.space_data, "region_3d", None)
    if view is None or bpy.app.background:
        return
    chosen = [item for item in context.scene.objects if item.type in SURFACE_TYPES]
    shown = [item for item in chosen if not item.hide_render and item.visible_get()]
    for item in shown:
        item.select_set(True)
    region = next(one for one in context.area.regions if one.type == "WINDOW")
    with context.temp_override(region=region):
        bpy.ops.view3d.view_selected()
    for item in shown:
        item.select_set(item == radar)
    setattr(context.window_manager, LIVE_PROPERTY, True)


def _looking(direction: Vector) -> Euler:
    """Return the rotation of an empty whose -Z axis points along a direction, with +Y up."""
    return direction.to_track_quat("-Z", "Y").to_euler()


class RADARSIM_OT_setup_rig(bpy.types.Operator):
    """Add a radar at your view, looking at the selected objects: receiver and transmitter"""

    bl_idname = "radarsim.setup_rig"
    bl_label = "Set Up Radar"
    bl_options = {"REGISTER", "UNDO"}

    preset: preset_choice("Radar to begin with")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the preset."""

        def draw(menu: Any, _: bpy.types.Context) -> None:
            menu.layout.operator_context = "EXEC_REGION_WIN"
            menu.layout.operator_enum(self.bl_idname, "preset")

        context.window_manager.popup_menu(draw, title=self.bl_label, icon="OUTLINER_OB_CAMERA")
        return {"FINISHED"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        with reported(self):
            pose = radar_pose(context)
            empty = setup_rig(context.scene, tuple(context.scene.cursor.location))
            if pose is not None:
                empty.location, empty.rotation_euler = pose
            apply_preset(context.scene, empty, radar_preset(self.preset))
            for item in context.selected_objects:
                item.select_set(False)
            empty.select_set(True)
            context.view_layer.objects.active = empty
            _show_radar(context, empty)
            return {"FINISHED"}
        return {"CANCELLED"}


class RADARSIM_OT_assign_material(bpy.types.Operator):
    """Give the selected objects the Radar Material of the chosen preset"""

    bl_idname = "radarsim.assign_material"
    bl_label = "Assign to Selected"
    bl_options = {"REGISTER", "UNDO"}

    preset: bpy.props.EnumProperty(
        name="Preset",
        items=tuple((name, preset.label, preset.description) for name, preset in PRESETS.items()),
        description="Material for the selected objects",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(context.selected_objects)

    def execute(self, context: bpy.types.Context) -> set[str]:
        with reported(self):
            assign_radar_material(context.selected_objects, self.preset)
            return {"FINISHED"}
        return {"CANCELLED"}


class _MeasuringOperator(bpy.types.Operator):
    """An operator that measures a copy of the scene."""

    bl_options = {"REGISTER"}
    #: Whether the run is processed and shown at its end.
    _shows = False

    _timer: Any = None
    _run: WindowRun | None = None
    _announced = False

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        running = getattr(context.window_manager, PROGRESS_PROPERTY).running
        return not running or current_run() is not None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.app.background:
            return self.execute(context)
        with reported(self):
            _check_settings(context)
            size = expected_size() / 1e6
            text = tr("Saving a copy of the scene, about {size:.0f} MB", size=size)
            context.workspace.status_text_set(text)
            manager = context.window_manager
            self._timer = manager.event_timer_add(_TICK_S, window=context.window)
            manager.modal_handler_add(self)
            return {"RUNNING_MODAL"}
        return {"CANCELLED"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC" and event.value == "PRESS":
            if self._run is None:
                context.workspace.status_text_set(None)
                return self._leave(context, {"CANCELLED"})
            self._run.stop()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self._run is None:
            if not self._announced:  # what comes is drawn before it begins
                self._announced = True
                return {"PASS_THROUGH"}
            with reported(self):
                self._run = _copied(context)
                add_run(self._run)
                return {"PASS_THROUGH"}
            context.workspace.status_text_set(None)
            return self._leave(context, {"CANCELLED"})
        if not self._run.ended:
            return {"PASS_THROUGH"}
        self._leave(context, set())
        with reported(self):
            found = self._report_end(self._run)
            if self._shows and found == {"FINISHED"}:
                self._show(context)
            return found
        return {"CANCELLED"}

    def _show(self, context: bpy.types.Context) -> None:
        """Process the run, unless another run measures, because that run may replace it."""
        run = self._run
        assert run is not None
        advance()
        if current_run() is not None:
            self.report({"INFO"}, "Another run measures: its results are shown at its end")
        elif context.scene.session_uid != run.measured.settings[0]:
            self.report({"INFO"}, "The run is of another scene: open it and press Process Last Run")
        else:
            show_state(run)
            bpy.ops.radarsim.process_last_run("INVOKE_DEFAULT", folder=str(run.folder))

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender closes the window or loads another file: the run continues."""
        self._leave(context, set())

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Wait for the end of the run, with lines of progress."""
        with reported(self):
            _check_settings(context)
            run = _copied(context)
            add_run(run)
            line = None
            try:
                while not run.ended:
                    advance()
                    if run.began:
                        line = line or ProgressLine(sys.stdout, run.unit)
                        line.show(run.done, run.total, run.seconds_left)
                    time.sleep(_TICK_S)
            finally:
                end_runs()
            found = self._report_end(run)
            report_findings(self, run.findings, run.frames)
            if self._shows and found == {"FINISHED"}:
                found = bpy.ops.radarsim.process_last_run(folder=str(run.folder))
            return found
        return {"CANCELLED"}

    def _report_end(self, run: WindowRun) -> set[str]:
        if run.error is not None:
            raise run.error
        self.report({"WARNING" if run.stopped else "INFO"}, run.text)
        return {"CANCELLED" if run.stopped else "FINISHED"}

    def _leave(self, context: bpy.types.Context, result: set[str]) -> set[str]:
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
        return result


class RADARSIM_OT_render_frames(_MeasuringOperator):
    """Measure every radar frame of a copy of the scene. Replaces the last run of this scene"""

    bl_idname = "radarsim.render_frames"
    bl_label = "Render Radar Frames"


class RADARSIM_OT_measure_and_show(_MeasuringOperator):
    """Measure every radar frame, process the run, and show its map beside the scene"""

    bl_idname = "radarsim.measure_and_show"
    bl_label = "Measure and Show"

    _shows = True


class RADARSIM_OT_stop_run(bpy.types.Operator):
    """Stop what runs now: the run that measures, or its processing"""

    bl_idname = "radarsim.stop_run"
    bl_label = "Cancel"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(getattr(context.window_manager, PROGRESS_PROPERTY).running)

    def execute(self, context: bpy.types.Context) -> set[str]:
        run = current_run()
        if run is not None:
            run.stop()
        else:
            RADARSIM_OT_process_last_run.stops = True
        return {"FINISHED"}


class RADARSIM_OT_process_last_run(bpy.types.Operator):
    """Process the run in the output folder as set in Results; show its pictures as images"""

    bl_idname = "radarsim.process_last_run"
    bl_label = "Process Last Run"
    bl_options = {"REGISTER"}

    folder: bpy.props.StringProperty(
        name="Folder",
        options={"HIDDEN", "SKIP_SAVE"},
        description="Folder of the run; empty: the output folder of the radar",
    )

    #: Whether the user wants the processing to end.
    stops = False

    _job: ProcessingJob
    _images: list[Any]
    _drawing: Iterator[list[Any]] | None = None
    _timer: Any = None

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return not getattr(context.window_manager, PROGRESS_PROPERTY).running

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.app.background:
            return self.execute(context)
        with reported(self):
            self._start(context)
            manager = context.window_manager
            progress = getattr(manager, PROGRESS_PROPERTY)
            progress.running, progress.fraction, progress.text = True, 0.0, self._job.text
            self._timer = manager.event_timer_add(_TICK_S, window=context.window)
            manager.modal_handler_add(self)
            return {"RUNNING_MODAL"}
        return {"CANCELLED"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if (event.type == "ESC" and event.value == "PRESS") or self.stops:
            self._end(context, tr("Processing stopped"))
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            ended = self._tick()
        except RadarSimError as error:
            self._end(context, tr("Failed: {error}", error=error))
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        except BaseException:
            self._end(context, tr("Failed"))
            raise
        if ended:
            self._end(context, self._job.text)
            self._report_end()
            show_images(context, self._images)
            return {"FINISHED"}
        progress = getattr(context.window_manager, PROGRESS_PROPERTY)
        if progress.text != self._job.text:
            progress.fraction, progress.text = self._job.fraction, self._job.text
            text = tr("{text}  (Esc stops)", text=self._job.text)
            context.workspace.status_text_set(text)
            redraw_panels(context)
        return {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender closes the window or loads another file."""
        self._end(context, tr("Stopped"))

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Without a window: at once."""
        with reported(self):
            self._start(context)
            with contextlib.closing(self._job):
                while not self._tick():
                    pass
            self._report_end()
            return {"FINISHED"}
        return {"CANCELLED"}

    def _start(self, context: bpy.types.Context) -> None:
        folder = Path(self.folder) if self.folder else output_folder(active_radar(context.scene))
        fingerprint = check_own_run(context.scene, folder)
        apart = not bpy.app.background
        self._job = ProcessingJob(folder, apart, chosen_processing(context))
        self._job.result.fingerprint = fingerprint
        self._job.result.scene_uid = context.scene.session_uid
        self._images = []
        RADARSIM_OT_process_last_run.stops = False
        getattr(context.window_manager, PROGRESS_PROPERTY).processed = ""
        start_drawing()

    def _tick(self) -> bool:
        """Do the next step; return whether it was the last one."""
        if self._drawing is None:
            if self._job.step():
                self._drawing = show_run(bpy.context, self._job.result)
            return False
        drawn = next(self._drawing, None)
        self._images += drawn or []
        return drawn is None

    def _end(self, context: bpy.types.Context, text: str) -> None:
        self._job.close()
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
        progress = getattr(context.window_manager, PROGRESS_PROPERTY)
        progress.running, progress.text = False, text
        if context.workspace is not None:
            context.workspace.status_text_set(None)
        redraw_panels(context)

    def _report_end(self) -> None:
        progress = getattr(bpy.context.window_manager, PROGRESS_PROPERTY)
        progress.processed = findings_text(self._job.findings)
        report_findings(self, self._job.findings, self._job.frames)
        self.report({"INFO"}, self._job.text)


class RADARSIM_OT_open_output(bpy.types.Operator):
    """Open the output folder in the system's file manager"""

    bl_idname = "radarsim.open_output"
    bl_label = "Open Output Folder"

    def execute(self, context: bpy.types.Context) -> set[str]:
        with reported(self):
            folder = output_folder(active_radar(context.scene))
            if not folder.is_dir():
                raise OutputError(f"{folder} does not exist yet. Render radar frames first.")
            bpy.ops.wm.path_open(filepath=str(folder))
            return {"FINISHED"}
        return {"CANCELLED"}


def _check_settings(context: bpy.types.Context) -> None:
    """Check the settings, as far as that takes no time; a `RadarSimError` if they contradict one
    another.
    """
    radar = active_radar(context.scene)
    output_folder(radar)
    read_measurement(context.scene, radar)


def _copied(context: bpy.types.Context) -> WindowRun:
    """Save a copy of the scene as it is now, and return its run."""
    radar = active_radar(context.scene)
    overwrite = settings(radar).overwrite
    copy = save_copy(context.scene, context.view_layer, radar, overwrite)
    return WindowRun(copy, note_copied(context))


CLASSES: tuple[type, ...] = (
    RADARSIM_OT_setup_rig,
    RADARSIM_OT_assign_material,
    RADARSIM_OT_render_frames,
    RADARSIM_OT_measure_and_show,
    RADARSIM_OT_stop_run,
    RADARSIM_OT_process_last_run,
    RADARSIM_OT_open_output,
)


# -------------------------------------------------------------------------------------------------
# Operator that draws the coverage diagram of the active radar over its ground.
# -------------------------------------------------------------------------------------------------


class RADARSIM_OT_coverage(bpy.types.Operator):
    """Draw the echo of a target over the ground below the radar: height against range"""

    bl_idname = "radarsim.coverage"
    bl_label = "Coverage Diagram"
    bl_options = {"REGISTER"}

    lowest: bpy.props.FloatProperty(
        name="Lowest Target [m]", default=0.0, min=0.0, description="Set the first height"
    )
    highest: bpy.props.FloatProperty(
        name="Highest Target [m]", default=60.0, min=0.0, description="Set the last height"
    )
    nearest: bpy.props.FloatProperty(
        name="Nearest Range [m]", default=500.0, min=0.0, description="Set the first range"
    )
    farthest: bpy.props.FloatProperty(
        name="Farthest Range [m]", default=20_000.0, min=0.0, description="Set the last range"
    )
    steps: bpy.props.IntProperty(
        name="Steps", default=400, min=2, max=1500, description="Set the steps of both axes"
    )
    flat: bpy.props.BoolProperty(
        name="Flat Earth",
        default=False,
        description="Take the Earth for flat, as a render does. Off: 4/3 of its radius",
    )
    folder: bpy.props.StringProperty(
        name="Folder",
        default="//",
        subtype="DIR_PATH",
        description="Write picture and numbers there; // is the folder of the .blend file",
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return context.window_manager.invoke_props_dialog(self)  # type: ignore[no-any-return]

    def execute(self, context: bpy.types.Context) -> set[str]:
        with reported(self):
            if self.folder.startswith("//") and not bpy.data.filepath:
                raise OutputError(
                    f"The folder {self.folder!r} is relative to the .blend file, which was never "
                    "saved. Save the file, or choose an absolute folder."
                )
            found = scene_coverage(context.scene, context.view_layer, self._request())
            folder = Path(bpy.path.abspath(self.folder))
            files = write_coverage(found, folder, picture=False)
            report_findings(self, list(found.findings))
            self.report({"INFO"}, f"Wrote {', '.join(map(str, files))}")
            fields, arrays = coverage_message(found, coverage_curve(found))
            fields["file"] = str(folder / COVERAGE_PICTURE)
            draw_image(COVERAGE_IMAGE, fields, arrays, _show_coverage)
            return {"FINISHED"}
        return {"CANCELLED"}

    def _request(self) -> CoverageRequest:
        for name, low, high in (
            ("heights", self.lowest, self.highest),
            ("ranges", self.nearest, self.farthest),
        ):
            if not low < high:
                raise ConfigError(
                    f"The {name} go from {low:g} to {high:g} m; expected the first below the last."
                )
        return CoverageRequest(
            np.linspace(self.lowest, self.highest, self.steps + 1),
            np.linspace(self.nearest, self.farthest, self.steps + 1),
            flat=self.flat,
        )


def _show_coverage(image: Any) -> None:
    if image is not None and not bpy.app.background:
        show_images(bpy.context, [image])


COVERAGE_CLASSES: tuple[type, ...] = (RADARSIM_OT_coverage,)
