# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim render``: measure the radar frames of a .blend file without a window."""

from __future__ import annotations

import argparse
import os
import signal as signals
import sys
import time
import traceback
from collections.abc import Sequence
from typing import Any

from ...errors import RadarSimError
from ...findings import Finding, exit_code, finding_lines, to_json
from ...options import share_of
from ...signal.runs import done_before_text, frame_findings, open_run
from ...terminal import ProgressLine, error_line
from ..run import FramesHeldError, MeasurementJob
from .console import quiet_blender
from .session import check_workers, leave_blender, limit_threads, open_job


class _StopRequest:
    """Ctrl-C or SIGTERM: the first one stops after the current render, a second one at once.

    KeyboardInterrupt cannot be raised: the Python part of Cycles catches it during a render and
    continues.
    """

    def __init__(self) -> None:
        self.asked = False
        #: Exit code after a signal, as in shells: 128 + the number of the signal.
        self.code = 128 + signals.SIGINT
        for number in (signals.SIGINT, signals.SIGTERM):
            signals.signal(number, self._on_signal)

    def _on_signal(self, number: int, _: Any) -> None:
        self.code = 128 + number
        if self.asked:
            os._exit(self.code)
        self.asked = True
        print("\nradarsim: stopping after this step (Ctrl-C again: at once)", file=sys.stderr)


def run_and_leave(arguments: argparse.Namespace) -> None:
    """Render, then end the process with the exit code of the command."""
    try:
        code = run(arguments, _StopRequest())
    except Exception:
        traceback.print_exc()  # a defect; Blender would print it and quit with 0
        code = 1
    leave_blender(code)


def run(arguments: argparse.Namespace, stop: _StopRequest) -> int:
    """Render, and process if the command line says so. Return the exit code."""
    try:
        return measure(arguments, stop)
    except RadarSimError as error:
        return _fail(error_line(error), error.exit_code)
    except KeyboardInterrupt:
        return _fail(
            "radarsim: Interrupted; the same command resumes the run (without --overwrite).",
            stop.code,
        )


def measure(arguments: argparse.Namespace, stop: _StopRequest) -> int:
    """Measure what the command line names; return the exit code.

    Raises KeyboardInterrupt at Ctrl-C, after the current step.
    """
    with quiet_blender() as stream:
        job, share = open_job(arguments), share_of(arguments)
        job.own_frames = () if arguments.plan_only else share.part(job.frames)
        if share.shard is not None:
            check_workers(opened_here=arguments.blend is not None)
            job.joins = True
            limit_threads()
        job.prepare()
        try:
            for line in _change_lines(job):
                print(f"radarsim: {line}", file=stream, flush=True)
            _print_findings(job.run_findings, job.frames, stream)
            if arguments.plan_only:
                return 0
            earlier = _done_frames(job)
            if earlier:
                text = done_before_text(open_run(job.folder), earlier)
                print(f"radarsim: {text}", file=stream, flush=True)
            progress = ProgressLine(stream, job.unit)
            progress.show(job.done, job.total, None)
            try:
                for task in job.pending():
                    if stop.asked:
                        raise KeyboardInterrupt
                    job.start(task)
                    job.render(task)
                    job.finish(task)
                    progress.show(job.done, job.total, job.seconds_left)
                progress.show(job.done, job.total, None)
            finally:  # of the frames that are done, whatever ended the run
                found = [*frame_findings(job.folder, earlier), *job.frame_findings]
                _print_findings(found, job.frames, stream)
        finally:
            job.leave()
        if job.summary:
            print(f"radarsim: {job.summary}", file=stream, flush=True)
        print(f"radarsim: wrote {job.folder}", file=stream, flush=True)
        done = 0
        held = any(item.code == "frames-left-to-others" for item in job.frame_findings)
        if arguments.process and held and not share.shard and open_run(job.folder).missing():
            text = "not processed: other processes still measure frames; the last one processes all"
            print(f"radarsim: {text}", file=stream, flush=True)
        elif arguments.process and job.own_frames:
            done = process(job, stream, stop, animate=False if share.shard else None)
        found = [*job.run_findings, *frame_findings(job.folder, job.own_frames)]
        if found or done:
            text = f"`radarsim info {job.folder}` gives causes and remedies"
            print(f"radarsim: {text}", file=stream, flush=True)
        return max(done, exit_code(found, job.own_frames))


def _change_lines(job: MeasurementJob) -> list[str]:
    """Return lines about settings that differ from those of the run that was in the folder."""
    return job.changes and [
        "changed since the run in this folder:",
        *("  " + c for c in job.changes),
    ]


def _done_frames(job: MeasurementJob) -> list[int]:
    """Return the job's frames that were measured before."""
    run = open_run(job.folder)
    return [frame for frame in job.own_frames if not run.frame(frame).missing()]


def _print_findings(findings: list[Finding], frames: Sequence[int], stream: Any) -> None:
    for line in finding_lines(findings, frames):
        print(f"radarsim: {line}", file=stream, flush=True)


def process(job: MeasurementJob, stream: Any, stop: _StopRequest, animate: bool | None) -> int:
    """Process the frames of a job. Print findings whose codes were not printed after the render.

    `animate` says whether animations are made; None is the default. Return the exit code.
    """
    # a render without processing does not need it
    from ...signal.pipeline import FrameResult, ProcessOptions, frame_lines, kept_lines, process_run

    options = ProcessOptions(animate=animate)
    rendered = [*job.findings, *frame_findings(job.folder, job.own_frames)]
    printed = {item.code for item in rendered}
    findings: list[Finding] = []
    frames: list[int] = []
    try:
        for event in process_run(job.folder, options, frames=job.own_frames, resume=True):
            if stop.asked:
                raise KeyboardInterrupt
            if isinstance(event, FrameResult):
                print("\n".join(frame_lines(event)), file=stream, flush=True)
                findings += event.findings
                frames.append(event.frame)
            elif event.kept is not None:
                print("\n".join(kept_lines(event.kept)), file=stream, flush=True)
                findings += event.kept.findings
                frames.append(event.kept.frame)
    finally:
        _print_findings([i for i in findings if i.code not in printed], frames, stream)
    print(f"radarsim: processed into {job.folder / 'products'}", file=stream, flush=True)
    return exit_code(findings, frames)


def _fail(line: str, code: int) -> int:
    print(line, file=sys.stderr, flush=True)
    return code


#: Time after which a frame of another process is checked again [s].
_PAUSE_S = 0.2


class FrameRenderer:
    """A run that stays open while its frames are measured in any order; see `frame_worker`.

    `arguments` are those of ``radarsim render``. `joins` says whether the plan of the run exists
    already, because the first worker has written it in `about`.
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
        lines = [*_change_lines(job), *finding_lines(job.run_findings, job.frames)]
        return {"frames": list(job.frames), "folder": str(job.folder), "lines": lines}

    def do(self, frame: int) -> dict[str, Any]:
        """Measure a frame, unless it is done or another process measures it."""
        job = self._job
        job.frame_findings = []
        try:
            with quiet_blender():
                job.take([frame])
                if job.done == job.total:
                    found = frame_findings(job.folder, [frame])
                    return {"earlier": True, "findings": [to_json(item) for item in found]}
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
        """Stop after the current step: Cycles catches exceptions during a render."""
        self._stopping = True

    def close(self) -> None:
        """Restore the scene and release the claimed frame."""
        self._job.restore()
