# SPDX-License-Identifier: GPL-3.0-or-later
"""Ring sampling: one Cycles render for each ring and snapshot, written as an EXR file.

Every EXR is rendered to a temporary name, checked, renamed, and gets its sidecar last: whatever
moment a run is killed at, a file with a sidecar is whole, and the next run resumes there.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import bpy

from ...atomic_files import AtomicFile
from ...errors import RadarSimError, RenderError
from ...findings import Finding, finding, merge
from ...sidecar import write_record
from ..materials import found_inside
from ..plan import Task, instant_at
from ..run import MeasurementJob, output_folder, run_files
from ..scene import check_particles_are_baked, moved_by_scripts
from ..scene import ground_truth as ground_truth
from ..state import take_snapshot
from ..views import Region, set_border
from .exr_check import verify_exr
from .render_result import save_render
from .ring_regions import regions_by_ring


class RingJob(MeasurementJob):
    """A run that measures rings, the sampling mode of the paper.

    Parameters
    ----------
    *arguments, **keywords
        Those of `MeasurementJob`.
    """

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        super().__init__(*arguments, **keywords)
        self._pending: list[Task] = []
        self._scene_written: int | None = None
        self._regions: list[Region] | None = None

    def _config_findings(self) -> list[Finding]:
        found = [*super()._config_findings(), *merge(self._inside_by_frame())]
        held = self._held_by_scripts()
        return [*found, finding("rendered-at-whole-frames", *held)] if held else found

    def _refuse_unmeasurable(self, depsgraph: Any) -> None:
        super()._refuse_unmeasurable(depsgraph)
        if self._measurement.snapshots > 1:
            check_particles_are_baked(
                take_snapshot(depsgraph),
                "Without the motion of particles, take one snapshot (--snapshots 1).",
            )

    def _held_by_scripts(self) -> list[str]:
        """Objects that scripts hold between the snapshots of the first frame, and move after it."""
        first, *later = self.plan.instants(self._measurement.frames[0])
        if not later or not moved_by_scripts():
            return []
        moments = (first, *later, instant_at(first.frame + 1.0, self._fps()))
        then, soon, next_frame = (
            {one.name: one.matrix_world.copy() for one in self._show(at).objects} for at in moments
        )
        return [n for n, at in then.items() if at == soon.get(n) and at != next_frame.get(n, at)]

    def _inside_by_frame(self) -> Iterator[Finding]:
        """What is inside walls and other interiors in each frame; sidecars hold no findings."""
        assert self._settings is not None
        if not self._settings.interiors.delay:  # nothing has an interior
            return
        for frame in self._measurement.frames:
            depsgraph = self._show(self.plan.instants(frame)[0])
            antennas = ground_truth.antenna_positions(depsgraph, self.rig)
            for one in found_inside(depsgraph, antennas):
                yield one.in_frame(frame)

    def _plan_renders(self) -> None:
        tasks = list(self.plan.tasks(self.own_frames))
        self._pending = [task for task in tasks if not self._is_done(task)]
        self.total = len(tasks)
        self.done = self.total - len(self._pending)

    def _is_done(self, task: Task) -> bool:
        return output_folder.is_done(self.folder, task, self.fingerprint)

    def pending(self) -> Iterator[Task]:
        """Renders that are still to be made, in order."""
        groups = itertools.groupby(self._pending, key=lambda task: task.frame)
        tasks = {frame: list(group) for frame, group in groups}
        for frame in self._claimed(list(tasks)):
            self.frame_lost = False
            for task in tasks[frame]:
                if self._is_done(task):  # by another process, meanwhile
                    self.done += 1
                elif not self.frame_lost:
                    yield task

    def start(self, task: Task) -> None:
        """Set time and ring for a render, and note where the antennas are."""
        assert self._settings is not None
        if self._scene_written != task.frame:
            output_folder.make_frame_folder(self.folder, task.frame)
            self._write_scene(task.frame)
            self._scene_written = task.frame
            self._records = None  # of another moment
        if self._records is None or not self._time.shows(task.instant):
            depsgraph = self._show(task.instant)
            self._records = self._antenna_records(depsgraph, self.plan.metres_per_unit)
            self._regions = regions_by_ring(depsgraph, self.plan, *self._records)
        self._settings.set_ring(task.ring_min_m, task.ring_max_m)
        render = self._scene.render
        render.use_border = self._regions is not None
        if self._regions is not None:
            size_px = self._measurement.width_px, self._measurement.height_px
            set_border(render, self._regions[task.ring], *size_px)

    def render(self, task: Task) -> None:
        """Render and wait for the end (not for use in the UI)."""
        try:
            result = bpy.ops.render.render(scene=self._scene.name)
        except RuntimeError as error:
            raise RenderError(
                f"Cycles failed at {task.exr_path}: {str(error).strip()} "
                "Render an ordinary image of this scene with Cycles to see whether that works."
            ) from error
        if "FINISHED" not in result:
            raise RenderError(f"The render of {task.exr_path} was cancelled. Start it again.")

    def finish(self, task: Task) -> None:
        """Write, check and rename the EXR, then write its sidecar; nothing half-written stays."""
        assert self._records is not None
        final = self.folder / task.exr_path
        # Blender would make the folder again, without the rest of the run.
        output_folder.check_there(self.folder, task.frame)
        try:
            file = AtomicFile(final)
            try:
                save_render(self._scene, file.temporary)
                verify_exr(file.temporary, self._measurement.width_px, self._measurement.height_px)
                if not self.keeps_frame():  # another process has taken over: it renders this one
                    return
                file.commit()
            finally:
                file.discard()
            record = run_files.render_record(
                self.plan, task, *self._records, final, self.versions, self.fingerprint
            )
            write_record(self.folder / task.sidecar_path, record)
        except RadarSimError:
            output_folder.check_there(self.folder, task.frame)
            raise
        self._rendered += 1
        self.done += 1
