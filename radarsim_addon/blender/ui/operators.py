# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators: they turn named errors into reports and leave the work to others."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from typing import Any, ClassVar

import bpy

from ...errors import OutputError, RenderError
from ...findings import Finding
from ...progress import ProgressLine, progress_text
from ..headless import make_job, quiet_blender
from ..nodes import PRESETS, assign_radar_material
from ..paths import PathJob
from ..plan import radar_preset
from ..rig_settings import (
    PROGRESS_PROPERTY,
    apply_preset,
    output_folder,
    settings,
)
from ..run import MeasurementJob
from ..scene import active_radar, setup_rig
from .interactive import InteractiveRender
from .picture_images import show_images
from .placement import radar_pose
from .preset_menu import preset_choice
from .result_settings import chosen_processing
from .results import ProcessingJob
from .shown_findings import findings_text, report_findings, reported
from .shown_results import check_own_run, note_measured, show_run
from .timed_operator import TimedOperator
from .translations import tr

#: Rays of a run whose time says what a ray costs.
_MANY_RAYS = 100_000


class RADARSIM_OT_setup_rig(bpy.types.Operator):
    """Add a radar at your view, looking at the selected objects: receiver and transmitter"""

    bl_idname = "radarsim.setup_rig"
    bl_label = "Set Up Radar"
    bl_options = {"REGISTER", "UNDO"}

    preset: preset_choice("Radar to begin with")

    def execute(self, context: Any) -> set[str]:
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
    def poll(cls, context: Any) -> bool:
        return bool(context.selected_objects)

    def execute(self, context: Any) -> set[str]:
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


class RADARSIM_OT_render_frames(TimedOperator):
    """Measure every radar frame, by rings or by paths. Replaces the last run of this scene"""

    bl_idname = "radarsim.render_frames"
    bl_label = "Render Radar Frames"

    _run: InteractiveRender
    _began_s = 0.0
    _watched: object | None = None

    def _start(self, context: Any) -> list[Finding]:
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

    def _escape(self, context: Any) -> set[str]:
        self._run.request_stop("stopped by Esc")
        return {"RUNNING_MODAL"}

    def _conclude(self, context: Any) -> set[str]:
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

    def _end(self, context: Any, text: str) -> None:
        if not self._run.closed:  # else the file was saved, loaded or undone
            self._run.close()
            note_measured(context, self._run.job.fingerprint)
        for failure in self._run.job.unrestored:
            self.report({"WARNING"}, f"Not restored: {failure}")
        super()._end(context, text)

    def execute(self, context: Any) -> set[str]:
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

    def _start(self, context: Any) -> list[Finding]:
        folder = output_folder(active_radar(context.scene))
        fingerprint = check_own_run(context.scene, folder)
        apart = not bpy.app.background
        self._job = ProcessingJob(folder, apart, chosen_processing(context))
        self._job.result.fingerprint = fingerprint
        self._job.result.scene_uid = context.scene.session_uid
        self._images = []
        return []

    def _tick(self) -> bool:
        if self._drawing is None:
            if self._job.step():
                self._drawing = show_run(bpy.context, self._job.result)
            return False
        drawn = next(self._drawing, None)  # a picture takes some hundredths of a second
        self._images += drawn or []
        return drawn is None

    def _state(self) -> tuple[float, str]:
        return self._job.fraction, self._job.text

    def _escape(self, context: Any) -> set[str]:
        self._end(context, "Processing stopped")
        return {"CANCELLED"}

    def _end(self, context: Any, text: str) -> None:
        self._job.close()
        super()._end(context, text)

    def _conclude(self, context: Any) -> set[str]:
        self._end(context, self._job.text)
        self._report_end()
        show_images(context, self._images)
        return {"FINISHED"}

    def execute(self, context: Any) -> set[str]:
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

    def execute(self, context: Any) -> set[str]:
        with reported(self):
            folder = output_folder(active_radar(context.scene))
            if not folder.is_dir():
                raise OutputError(f"{folder} does not exist yet. Render radar frames first.")
            bpy.ops.wm.path_open(filepath=str(folder))
            return {"FINISHED"}
        return {"CANCELLED"}


def _job_of(context: Any) -> MeasurementJob:
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
