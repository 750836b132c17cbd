# SPDX-License-Identifier: GPL-3.0-or-later
"""A run that stays open while frames of it are measured in any order, for a coordinator."""

from __future__ import annotations

import argparse
import sys
import time
from typing import Any

from ...findings import finding_lines, to_json
from ..run import FramesHeldError
from .console import quiet_blender
from .session import check_workers, limit_threads, open_job

#: Time after which a frame of another process is looked at again [s].
_PAUSE_S = 0.2


class FrameRenderer:
    """Measures frames of the run of a command line; see :class:`radarsim_addon.frame_worker`.

    Parameters
    ----------
    arguments
        Of ``radarsim render``, parsed.
    joins
        Whether the run's plan is there, written by the worker that was asked for `about`.
    """

    def __init__(self, arguments: argparse.Namespace, joins: bool) -> None:
        self._stopping = False
        with quiet_blender():
            self._job = open_job(arguments)
            limit_threads()
            check_workers(opened_here=arguments.blend is not None)
            self._job.joins, self._job.own_frames = joins, ()
            self._job.overwrite &= not joins  # who has planned the run has removed the earlier one
            self._job.prepare()

    def about(self) -> dict[str, Any]:
        """Return the frames, the folder, and findings of the run."""
        job = self._job
        lines = finding_lines(job.run_findings, job.frames)
        return {"frames": list(job.frames), "folder": str(job.folder), "lines": lines}

    def do(self, frame: int) -> dict[str, Any]:
        """Measure a frame, unless it is done or another process has it."""
        job = self._job
        job.frame_findings = []
        try:
            with quiet_blender():
                job.take([frame])
                if job.done == job.total:
                    return {"earlier": True}
                for task in job.pending():
                    if self._stopping:
                        sys.exit()
                    job.start(task)
                    job.render(task)
                    job.finish(task)
        except FramesHeldError:
            job.frame_lost = True
        if job.frame_lost:
            time.sleep(_PAUSE_S)
            return {"held": True}
        return {"findings": [to_json(item) for item in job.frame_findings]}

    def stop(self) -> None:
        """End after the running step: Cycles swallows exceptions in the middle of a render."""
        self._stopping = True

    def close(self) -> None:
        """Give back the scene and what is claimed."""
        self._job.restore()
