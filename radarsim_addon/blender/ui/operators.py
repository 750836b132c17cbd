# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators: they turn named errors into reports and leave the work to others."""

from __future__ import annotations

from typing import Any, ClassVar

import bpy

from ...errors import RadarSimError
from ...findings import Finding
from ..headless import ProgressLine, make_job, progress_text, quiet_blender
from ..nodes import PRESETS, assign_radar_material
from ..rig_settings import PROGRESS_PROPERTY, migrate_scene, output_folder, settings
from ..run import MeasurementJob
from ..scene import active_radar, setup_rig
from .interactive import InteractiveRender
from .results import ProcessingJob, show_images
from .shown_findings import findings_text, report_findings

#: Seconds between two looks at a running job.
TICK_S = 0.01
#: Events that pass through while a job runs: looking around. Others could change what is measured.
_HARMLESS_EVENTS = ("MOUSEMOVE", "INBETWEEN", "WHEEL", "MIDDLEMOUSE", "TRACKPAD", "NDOF", "TIMER")


class RADARSIM_OT_setup_rig(bpy.types.Operator):
    """Add a radar: receiver and transmitter under one empty, at the 3D cursor"""

    bl_idname = "radarsim.setup_rig"
    bl_label = "Set Up Radar"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        try:
            empty = setup_rig(context.scene, tuple(context.scene.cursor.location))
            migrate_scene(context.scene)  # settings of 0.1 that had no radar to go to
        except RadarSimError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for item in context.selected_objects:
            item.select_set(False)
        empty.select_set(True)
        context.view_layer.objects.active = empty
        return {"FINISHED"}


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
    def poll(cls, context: Any) -> bool:
        return bool(context.selected_objects)

    def execute(self, context: Any) -> set[str]:
        try:
            assign_radar_material(context.selected_objects, self.preset)
        except RadarSimError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class _TimedOperator:
    """Common part of the two long operators: timer, progress in the panel, Esc, clean end."""

    _timer: Any = None

    def _begin(self, context: Any, findings: list[Finding]) -> set[str]:
        self._timer = context.window_manager.event_timer_add(TICK_S, window=context.window)
        progress = getattr(context.window_manager, PROGRESS_PROPERTY)
        progress.running = True
        progress.findings = findings_text(findings)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def _show(self, context: Any, fraction: float, text: str) -> None:
        progress = getattr(context.window_manager, PROGRESS_PROPERTY)
        if progress.text != text:
            progress.fraction, progress.text = fraction, text
            context.workspace.status_text_set(f"{text}  (Esc stops)")
            redraw_panels(context)

    def _end(self, context: Any, text: str) -> None:
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
        progress = getattr(context.window_manager, PROGRESS_PROPERTY)
        progress.running = False
        progress.text = text
        if context.workspace is not None:
            context.workspace.status_text_set(None)
        redraw_panels(context)


class RADARSIM_OT_watch_escape(bpy.types.Operator):
    """Hear Esc while Blender's own render job runs"""

    # Blender's render operator swallows Esc for as long as its job exists, and the job heeds it
    # only until Cycles has looked for the last time: between the two an Esc would be lost. The
    # newest handler is asked first, so each render gets one of these on top of Blender's.

    bl_idname = "radarsim.watch_escape"
    bl_label = "Watch for Esc"
    bl_options = {"INTERNAL"}

    run: ClassVar[InteractiveRender | None] = None

    def invoke(self, context: Any, event: Any) -> set[str]:
        self._run = type(self).run
        self._task = self._run.rendering if self._run else None
        if self._task is None:
            return {"CANCELLED"}
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        assert self._run is not None
        if self._run.closed or self._run.rendering is not self._task:
            return {"FINISHED", "PASS_THROUGH"}
        if event.type == "ESC" and event.value == "PRESS":
            self._run.request_stop("stopped by Esc")
        return {"PASS_THROUGH"}


class RADARSIM_OT_render_frames(_TimedOperator, bpy.types.Operator):
    """Measure every radar frame, by rings or by paths. Goes on with a stopped run"""

    bl_idname = "radarsim.render_frames"
    bl_label = "Render Radar Frames"
    bl_options = {"REGISTER"}

    _run: InteractiveRender | None = None
    _watched: object | None = None

    @classmethod
    def poll(cls, context: Any) -> bool:
        return not getattr(context.window_manager, PROGRESS_PROPERTY).running

    def invoke(self, context: Any, event: Any) -> set[str]:
        if bpy.app.background:
            return self.execute(context)
        if bpy.app.is_job_running("RENDER"):
            self.report({"ERROR"}, "Another render is running. Wait for its end, or stop it.")
            return {"CANCELLED"}
        try:
            job = job_of(context)
            job.prepare()
        except RadarSimError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        try:
            self._run = InteractiveRender(job, context.preferences)
            return self._begin(context, job.findings)
        except BaseException:
            job.restore()
            raise

    def modal(self, context: Any, event: Any) -> set[str]:
        run = self._run
        assert run is not None
        if event.type == "ESC" and event.value == "PRESS":
            run.request_stop("stopped by Esc")
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return pass_harmless(event)
        try:
            ended = run.tick()
        except RadarSimError as error:
            self._finish(context, f"Failed: {error}")
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        except BaseException:
            self._finish(context, "Failed")
            raise
        if not ended:
            job = run.job
            self._watch_escape(run)
            text = progress_text(job.done, job.total, job.seconds_left, job.unit)
            self._show(context, job.fraction, text)
            return {"PASS_THROUGH"}
        return self._conclude(context, run)

    def _watch_escape(self, run: InteractiveRender) -> None:
        """Put a watcher on top of the handler of a render that has just begun."""
        if run.rendering is not None and run.rendering is not self._watched:
            RADARSIM_OT_watch_escape.run = run
            bpy.ops.radarsim.watch_escape("INVOKE_DEFAULT")
            RADARSIM_OT_watch_escape.run = None
            self._watched = run.rendering

    def _conclude(self, context: Any, run: InteractiveRender) -> set[str]:
        job = run.job
        if run.stop_reason:
            text = (
                f"{job.done} of {job.total} {job.unit} done, {run.stop_reason}; "
                "start again to go on"
            )
            self._finish(context, text)
            self.report({"WARNING"}, text)
            return {"CANCELLED"}
        text = f"{job.total} {job.unit} in {job.folder}"
        if job.summary:
            text = f"{job.summary}. {text}"
        # Some is known only at the end: what was left out, what was not met by any ray.
        progress = getattr(context.window_manager, PROGRESS_PROPERTY)
        progress.findings = findings_text(job.findings)
        self._finish(context, text)
        self.report({"INFO"}, text)
        return {"FINISHED"}

    def _finish(self, context: Any, text: str) -> None:
        if self._run is not None:
            self._run.close()
            for failure in self._run.job.unrestored:
                self.report({"WARNING"}, f"Not restored: {failure}")
        self._end(context, text)

    def cancel(self, context: Any) -> None:
        """Blender closes the window or loads another file."""
        self._finish(context, "Stopped; start again to go on")

    def execute(self, context: Any) -> set[str]:
        """Without a window: all renders, one after the other, with a progress line."""
        try:
            with quiet_blender() as stream, job_of(context) as job:
                report_findings(self, job.run_findings)
                line = ProgressLine(stream, job.unit)
                line.show(job.done, job.total, None)
                for task in job.pending():
                    job.start(task)
                    job.render(task)
                    job.finish(task)
                    line.show(job.done, job.total, job.seconds_left)
        except RadarSimError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        report_findings(self, job.frame_findings, job.frames)
        self.report({"INFO"}, f"{job.total} {job.unit} in {job.folder}")
        return {"FINISHED"}


class RADARSIM_OT_process_last_run(_TimedOperator, bpy.types.Operator):
    """Process the run in the output folder; show range-Doppler map and range profile as images"""

    bl_idname = "radarsim.process_last_run"
    bl_label = "Process Last Run"
    bl_options = {"REGISTER"}

    _job: ProcessingJob | None = None

    @classmethod
    def poll(cls, context: Any) -> bool:
        return not getattr(context.window_manager, PROGRESS_PROPERTY).running

    def invoke(self, context: Any, event: Any) -> set[str]:
        if bpy.app.background:
            return self.execute(context)
        try:
            self._job = ProcessingJob(output_folder(active_radar(context.scene)))
        except RadarSimError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return self._begin(context, [])

    def modal(self, context: Any, event: Any) -> set[str]:
        assert self._job is not None
        if event.type == "ESC" and event.value == "PRESS":
            self._end(context, "Processing stopped")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return pass_harmless(event)
        try:
            ended = self._job.step()
        except RadarSimError as error:
            self._end(context, f"Failed: {error}")
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        except BaseException:
            self._end(context, "Failed")
            raise
        if not ended:
            self._show(context, self._job.fraction, self._job.text)
            return {"PASS_THROUGH"}
        self._end(context, self._job.text)
        self._report_end()
        show_images(context, self._job.images)
        return {"FINISHED"}

    def execute(self, context: Any) -> set[str]:
        """Without a window: at once."""
        try:
            self._job = ProcessingJob(output_folder(active_radar(context.scene)))
            while not self._job.step():
                pass
        except RadarSimError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self._report_end()
        return {"FINISHED"}

    def _report_end(self) -> None:
        assert self._job is not None
        report_findings(self, self._job.findings, self._job.frames)
        self.report({"INFO"}, self._job.text)

    def cancel(self, context: Any) -> None:
        """Blender closes the window or loads another file."""
        self._end(context, "Processing stopped")


class RADARSIM_OT_open_output(bpy.types.Operator):
    """Open the output folder in the system's file manager"""

    bl_idname = "radarsim.open_output"
    bl_label = "Open Output Folder"

    def execute(self, context: Any) -> set[str]:
        try:
            folder = output_folder(active_radar(context.scene))
        except RadarSimError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if not folder.is_dir():
            self.report({"ERROR"}, f"{folder} does not exist yet. Render radar frames first.")
            return {"CANCELLED"}
        bpy.ops.wm.path_open(filepath=str(folder))
        return {"FINISHED"}


def job_of(context: Any) -> MeasurementJob:
    """The job that a scene's settings ask for.

    Raises
    ------
    ConfigError, OutputError
        The settings do not fit together, or name no output folder.
    """
    radar = active_radar(context.scene)
    return make_job(
        context.scene,
        context.view_layer,
        output_folder(radar),
        radar=radar,
        overwrite=settings(radar).overwrite,
    )


def pass_harmless(event: Any) -> set[str]:
    """Let looking around through; keep what could change the scene from it."""
    if event.type.startswith(_HARMLESS_EVENTS):
        return {"PASS_THROUGH"}
    return {"RUNNING_MODAL"}


def redraw_panels(context: Any) -> None:
    """Draw the sidebars again; Blender does not do so by itself for our numbers."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


CLASSES: tuple[type, ...] = (
    RADARSIM_OT_setup_rig,
    RADARSIM_OT_assign_material,
    RADARSIM_OT_watch_escape,
    RADARSIM_OT_render_frames,
    RADARSIM_OT_process_last_run,
    RADARSIM_OT_open_output,
)
