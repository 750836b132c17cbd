# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators: they turn named errors into reports and leave the work to others."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import bpy
import numpy as np
from mathutils import Euler, Vector

from ...errors import ConfigError, OutputError, RadarSimError, RenderError
from ...findings import Finding
from ...signal.pictures import COVERAGE_PICTURE, coverage_message
from ...signal.pipeline import write_coverage
from ...signal.radar import coverage_curve
from ...terminal import ProgressLine, progress_text
from ..headless import make_job, quiet_blender, scene_coverage
from ..materials import SURFACE_TYPES
from ..nodes import PRESETS, assign_radar_material
from ..paths import PathJob
from ..plan import CoverageRequest, Task, radar_preset
from ..rig_settings import (
    PROGRESS_PROPERTY,
    apply_preset,
    output_folder,
    settings,
)
from ..run import MeasurementJob
from ..scene import active_radar, setup_rig
from ..state import SettingsRestorer
from .fields import findings_text, report_findings, reported, tr
from .panels import preset_choice
from .picture_images import COVERAGE_IMAGE, draw_image, show_images, start_drawing
from .results_panel import chosen_processing
from .scene_reading import redraw_panels
from .shown_results import ProcessingJob, check_own_run, note_measured, show_run

# -------------------------------------------------------------------------------------------------
# What the long operators share: a timer, progress in the panel, Esc, a clean end.
# -------------------------------------------------------------------------------------------------


#: Seconds between two looks at a running job.
_TICK_S = 0.01
#: Events that pass through while a job runs: looking around. Others could change what is measured.
_HARMLESS_EVENTS = ("MOUSEMOVE", "INBETWEEN", "WHEEL", "MIDDLEMOUSE", "TRACKPAD", "NDOF", "TIMER")


class TimedOperator(bpy.types.Operator):
    """Common part of the two long operators: timer, progress in the panel, Esc, clean end."""

    bl_options = {"REGISTER"}
    _timer: Any = None

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return not getattr(context.window_manager, PROGRESS_PROPERTY).running

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.app.background:
            return self.execute(context)
        with reported(self):
            progress = getattr(context.window_manager, PROGRESS_PROPERTY)
            progress.findings = findings_text(self._start(context))
            try:
                window = context.window
                self._timer = context.window_manager.event_timer_add(_TICK_S, window=window)
                progress.running = True
                context.window_manager.modal_handler_add(self)
            except BaseException:
                self._end(context, tr("Failed"))
                raise
            return {"RUNNING_MODAL"}
        return {"CANCELLED"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC" and event.value == "PRESS":
            return self._escape(context)
        if event.type != "TIMER":  # looking around passes; what could change the scene does not
            return {"PASS_THROUGH" if event.type.startswith(_HARMLESS_EVENTS) else "RUNNING_MODAL"}
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
            return self._conclude(context)
        self._show(context, *self._state())
        return {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender closes the window or loads another file."""
        self._end(context, tr("Stopped"))

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Do all of it at once."""
        raise NotImplementedError

    def _start(self, context: bpy.types.Context) -> list[Finding]:
        """Begin; return the findings before."""
        raise NotImplementedError

    def _tick(self) -> bool:
        """Do the next step; return whether it was the last one."""
        raise NotImplementedError

    def _state(self) -> tuple[float, str]:
        """Fraction that is done, and its text."""
        raise NotImplementedError

    def _escape(self, context: bpy.types.Context) -> set[str]:
        """The user pressed Esc."""
        raise NotImplementedError

    def _conclude(self, context: bpy.types.Context) -> set[str]:
        """The last step is done."""
        raise NotImplementedError

    def _show(self, context: bpy.types.Context, fraction: float, text: str) -> None:
        progress = getattr(context.window_manager, PROGRESS_PROPERTY)
        if progress.text != text:
            progress.fraction, progress.text = fraction, text
            context.workspace.status_text_set(tr("{text}  (Esc stops)", text=text))
            redraw_panels(context)

    def _end(self, context: bpy.types.Context, text: str) -> None:
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
        progress = getattr(context.window_manager, PROGRESS_PROPERTY)
        progress.running = False
        progress.text = text
        if context.workspace is not None:
            context.workspace.status_text_set(None)
        redraw_panels(context)


# -------------------------------------------------------------------------------------------------
# A measurement that a timer drives in Blender's window, so that the user interface responds.
#
# Cycles renders in Blender's own render job (``INVOKE_DEFAULT``). Its handlers run in a worker
# thread and only set a flag. `tick` does everything else in the main thread.
# -------------------------------------------------------------------------------------------------


#: Number of timer ticks after which a render that neither ended nor runs has failed.
_PATIENCE_TICKS = 500
#: Number of timer ticks for which the end waits for icons of materials.
_ICON_TICKS = 3000
#: Time during which short renders may block the user interface [s].
_BLOCKING_S = 0.2


def _icons_are_drawn() -> bool:
    return bool(bpy.app.is_job_running("RENDER_PREVIEW"))


def _evaluate_shown(scene_name: str) -> None:
    """Evaluate what has changed in the scene that windows show.

    Blender would do so after this tick, while the render's thread sorts the objects of the same
    view layer.
    """
    for window in bpy.context.window_manager.windows:
        if window.scene.name == scene_name:
            window.view_layer.update()


class InteractiveRender:
    """A prepared `MeasurementJob` that renders in steps; `close` restores the scene.

    Blender's render window is off meanwhile.
    """

    def __init__(self, job: MeasurementJob, preferences: bpy.types.Preferences) -> None:
        self.job = job
        self.closed = False
        self.stop_reason = ""
        self._tasks: Iterator[Task] = job.pending()
        self._task: Task | None = None
        self._ended = ""
        self._idle_ticks = 0
        self._refused_ticks = 0
        self._icon_ticks = 0
        self._recorder = SettingsRestorer()
        self._recorder.set(preferences.view, "render_display_type", "NONE")
        self._hook(bpy.app.handlers.render_complete, self._on_complete)
        self._hook(bpy.app.handlers.render_cancel, self._on_cancel)
        for handlers in (
            bpy.app.handlers.save_pre,
            bpy.app.handlers.load_pre,
            bpy.app.handlers.undo_pre,
            bpy.app.handlers.redo_pre,
        ):
            self._hook(handlers, self._on_file_change)

    def _hook(self, handlers: Any, function: Any) -> None:
        # Loading a file removes handlers that are not persistent, so removal must not fail.
        handlers.append(function)
        self._recorder.on_restore(
            "handler", lambda: handlers.remove(function) if function in handlers else None
        )

    def _on_complete(self, *_: Any) -> None:
        self._ended = "complete"

    def _on_cancel(self, *_: Any) -> None:
        self._ended = "cancel"

    def _on_file_change(self, *_: Any) -> None:
        # The file on disk, or the undo step, must contain the user's settings.
        self.stop_reason = "the file was saved, loaded or undone"
        self.close()

    @property
    def rendering(self) -> object | None:
        """Task of Blender's render job; None between two renders."""
        return self._task

    def request_stop(self, reason: str) -> None:
        """Stop after the current render."""
        self.stop_reason = self.stop_reason or reason

    def tick(self) -> bool:
        """Do the next step without waiting; return whether the run has ended.

        RadarSimError: a render failed, or a file cannot be written. Call `close` then.
        """
        if self.closed:
            return True
        if not self._may_write():
            return False
        ended = self._tick_blocking() if self.job.blocking else self._tick_job()
        return ended and self._may_end()

    def _tick_job(self) -> bool:
        """Begin a render in Blender's job, or look whether it has ended."""
        if self._task is not None:
            if bpy.app.is_job_running("RENDER") or not self._render_has_ended():
                return False
            task, self._task = self._task, None
            if self._ended == "cancel":
                self.request_stop("cancelled")
            else:
                self.job.finish(task)
        if self.stop_reason:
            return True
        if bpy.app.is_job_running("RENDER"):
            return False  # a render of the user
        task = next(self._tasks, None)  # type: ignore[assignment]
        if task is None:
            return True
        self._begin(task)
        return False

    def _tick_blocking(self) -> bool:
        """Render for a short time between two checks of the user's events."""
        deadline_s = time.monotonic() + _BLOCKING_S
        while not self.stop_reason and time.monotonic() < deadline_s:
            task = next(self._tasks, None)
            if task is None:
                return True
            self.job.start(task)
            self.job.render(task)
            self.job.finish(task)
            if self.job.pausing:  # the user interface says what comes before it begins
                break
        return bool(self.stop_reason)

    def _may_end(self) -> bool:
        """Return whether the user's render engine may be set again.

        While Cycles draws icons of materials, this would block Blender for good: both wait for
        Python. The icons are drawn between two ticks.
        """
        self._icon_ticks += 1
        return not _icons_are_drawn() or self._icon_ticks > _ICON_TICKS

    def _may_write(self) -> bool:
        """Return whether Blender allows scripts to change data now.

        It does not while a script draws. This state is common to all threads, so a render that ends
        in another thread can set it for this one. The next tick starts with a clean state.
        """
        try:
            self.job.touch()
        except AttributeError:
            self._refused_ticks += 1
            return self._refused_ticks > _PATIENCE_TICKS
        self._refused_ticks = 0
        return True

    def _render_has_ended(self) -> bool:
        if self._ended:
            return True
        self._idle_ticks += 1
        if self._idle_ticks > _PATIENCE_TICKS:
            raise RenderError(
                "Cycles stopped without a message, so the frame is incomplete. Render an image of "
                "this scene with Cycles to check that it works, then start the run again."
            )
        return False

    def _begin(self, task: Task) -> None:
        self.job.start(task)
        self._task = task
        self._ended = ""
        self._idle_ticks = 0
        _evaluate_shown(self.job.scene_name)
        try:
            result = bpy.ops.render.render("INVOKE_DEFAULT", scene=self.job.scene_name)
        except RuntimeError as error:
            raise RenderError(
                f"Cycles cannot start: {str(error).strip()} Render an image of this scene with "
                "Cycles to check that it works."
            ) from error
        if "CANCELLED" in result:
            raise RenderError(
                "Blender did not start the render. Close other renders, then start the run again."
            )

    def close(self) -> None:
        """Restore scene, preferences and handlers. A second call changes nothing."""
        if self.closed:
            return
        self.closed = True
        self.job.restore()
        self.job.unrestored += self._recorder.restore()


# -------------------------------------------------------------------------------------------------
# Where a new radar goes: to the user's view, looking at the selected objects.
# -------------------------------------------------------------------------------------------------


#: Distance from the centre of a scene, over its radius, at which the scene fills the new camera.
_AWAY = 3.0


def radar_pose(context: bpy.types.Context) -> tuple[Vector, Euler] | None:
    """Return location and rotation of a new radar that looks at the selected objects.

    It is at the eye of the 3D view, or, where that is inside an object, outside the scene. Without
    a selection it looks at all objects; None in a scene without surfaces.
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
    """Centre and radius of the box around objects."""
    corners = [item.matrix_world @ Vector(corner) for item in items for corner in item.bound_box]
    low = Vector(tuple(map(min, *corners)))
    high = Vector(tuple(map(max, *corners)))
    return (low + high) / 2, (high - low).length / 2


def _within(place: Vector, items: list[Any]) -> bool:
    """Whether a place is inside the box of an object."""
    for item in items:
        local = item.matrix_world.inverted_safe() @ place
        sides = zip(*item.bound_box, strict=True)
        if all(min(side) <= x <= max(side) for side, x in zip(sides, local, strict=True)):
            return True
    return False


def _looking(direction: Vector) -> Euler:
    """Rotation of an empty whose -Z points along a direction, +Y up."""
    return direction.to_track_quat("-Z", "Y").to_euler()


#: Rays of a run whose time says what a ray costs.
_MANY_RAYS = 100_000


class RADARSIM_OT_setup_rig(bpy.types.Operator):
    """Add a radar at your view, looking at the selected objects: receiver and transmitter"""

    bl_idname = "radarsim.setup_rig"
    bl_label = "Set Up Radar"
    bl_options = {"REGISTER", "UNDO"}

    preset: preset_choice("Radar to begin with")

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


class RADARSIM_OT_watch_escape(bpy.types.Operator):
    """Hear Esc while Blender's own render job runs"""

    # Blender's render operator swallows Esc for as long as its job exists, and the job heeds it
    # only until Cycles has looked for the last time: between the two an Esc would be lost. The
    # newest handler is asked first, so each render gets one of these on top of Blender's.

    bl_idname = "radarsim.watch_escape"
    bl_label = "Watch for Esc"
    bl_options = {"INTERNAL"}

    run: ClassVar[InteractiveRender | None] = None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self._run = type(self).run
        self._task = self._run.rendering if self._run else None
        if self._task is None:
            return {"CANCELLED"}
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        assert self._run is not None
        if self._run.closed or self._run.rendering is not self._task:
            return {"FINISHED", "PASS_THROUGH"}
        if event.type == "ESC" and event.value == "PRESS":
            self._run.request_stop("stopped by Esc")
        return {"PASS_THROUGH"}


class RADARSIM_OT_render_frames(TimedOperator):
    """Measure every radar frame, by rings or by paths. Replaces the last run of this scene"""

    bl_idname = "radarsim.render_frames"
    bl_label = "Render Radar Frames"

    _run: InteractiveRender
    _began_s = 0.0
    _watched: object | None = None

    def _start(self, context: bpy.types.Context) -> list[Finding]:
        if bpy.app.is_job_running("RENDER"):
            raise RenderError("Another render is running. Wait for its end, or stop it.")
        job = _job_of(context)
        job.prepare()
        self._began_s = time.monotonic()
        try:
            self._run = InteractiveRender(job, context.preferences)
        except BaseException:
            job.restore()
            raise
        return job.findings

    def _tick(self) -> bool:
        ended = self._run.tick()
        # A watcher is added on top of the handler of a render that has just begun.
        if not ended and self._run.rendering not in (None, self._watched):
            RADARSIM_OT_watch_escape.run = self._run
            bpy.ops.radarsim.watch_escape("INVOKE_DEFAULT")
            RADARSIM_OT_watch_escape.run = None
            self._watched = self._run.rendering
        return ended

    def _state(self) -> tuple[float, str]:
        job = self._run.job
        text = progress_text(job.done, job.total, job.seconds_left, job.unit)
        return job.fraction, f"{text} ({job.stage})" if job.stage else text

    def _escape(self, context: bpy.types.Context) -> set[str]:
        self._run.request_stop("stopped by Esc")
        return {"RUNNING_MODAL"}

    def _conclude(self, context: bpy.types.Context) -> set[str]:
        job, reason = self._run.job, self._run.stop_reason
        if reason:
            text = tr(
                "{done} of {total} {unit} done, {reason}; the next run measures all again",
                done=job.done, total=job.total, unit=job.unit, reason=reason,
            )  # fmt: skip
            self._end(context, text)
            self.report({"WARNING"}, text)
            return {"CANCELLED"}
        text = tr("{total} {unit} in {folder}", total=job.total, unit=job.unit, folder=job.folder)
        if job.summary:
            text = f"{job.summary}. {text}"
        # Some is known only at the end: what was left out, what was not met by any ray.
        progress = getattr(context.window_manager, PROGRESS_PROPERTY)
        progress.findings = findings_text(job.findings)
        if isinstance(job, PathJob):
            took_s = time.monotonic() - self._began_s
            if job.rays > _MANY_RAYS and not job.options.refines:
                progress.seconds_per_ray = took_s / job.rays
        self._end(context, text)
        self.report({"INFO"}, text)
        return {"FINISHED"}

    def _end(self, context: bpy.types.Context, text: str) -> None:
        if not self._run.closed:  # else the file was saved, loaded or undone
            self._run.close()
            note_measured(context, self._run.job.fingerprint)
        for failure in self._run.job.unrestored:
            self.report({"WARNING"}, f"Not restored: {failure}")
        super()._end(context, text)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Without a window: all renders, one after the other, with a progress line."""
        with reported(self):
            with quiet_blender() as stream, _job_of(context) as job:
                report_findings(self, job.run_findings)
                line = ProgressLine(stream, job.unit)
                line.show(job.done, job.total, None)
                for task in job.pending():
                    job.start(task)
                    job.render(task)
                    job.finish(task)
                    line.show(job.done, job.total, job.seconds_left)
            note_measured(context, job.fingerprint)
            report_findings(self, job.frame_findings, job.frames)
            self.report({"INFO"}, f"{job.total} {job.unit} in {job.folder}")
            return {"FINISHED"}
        return {"CANCELLED"}


class RADARSIM_OT_process_last_run(TimedOperator):
    """Process the run in the output folder as set in Results; show its pictures as images"""

    bl_idname = "radarsim.process_last_run"
    bl_label = "Process Last Run"

    _job: ProcessingJob
    _images: list[Any]
    _drawing: Iterator[list[Any]] | None = None

    def _start(self, context: bpy.types.Context) -> list[Finding]:
        folder = output_folder(active_radar(context.scene))
        fingerprint = check_own_run(context.scene, folder)
        apart = not bpy.app.background
        self._job = ProcessingJob(folder, apart, chosen_processing(context))
        self._job.result.fingerprint = fingerprint
        self._job.result.scene_uid = context.scene.session_uid
        self._images = []
        start_drawing()
        return []

    def _tick(self) -> bool:
        if self._drawing is None:
            if self._job.step():
                self._drawing = show_run(bpy.context, self._job.result)
            return False
        drawn = next(self._drawing, None)
        self._images += drawn or []
        return drawn is None

    def _state(self) -> tuple[float, str]:
        return self._job.fraction, self._job.text

    def _escape(self, context: bpy.types.Context) -> set[str]:
        self._end(context, "Processing stopped")
        return {"CANCELLED"}

    def _end(self, context: bpy.types.Context, text: str) -> None:
        self._job.close()
        super()._end(context, text)

    def _conclude(self, context: bpy.types.Context) -> set[str]:
        self._end(context, self._job.text)
        self._report_end()
        show_images(context, self._images)
        return {"FINISHED"}

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

    def _report_end(self) -> None:
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


def _job_of(context: bpy.types.Context) -> MeasurementJob:
    """The job that a scene's settings ask for; a `RadarSimError` where they do not fit together."""
    radar = active_radar(context.scene)
    return make_job(
        context.scene,
        context.view_layer,
        output_folder(radar),
        radar=radar,
        overwrite=settings(radar).overwrite,
    )


CLASSES: tuple[type, ...] = (
    RADARSIM_OT_setup_rig,
    RADARSIM_OT_assign_material,
    RADARSIM_OT_watch_escape,
    RADARSIM_OT_render_frames,
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
