# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of the window: each measures a copy of the scene in a process of its own, one at a time.

A run that is started while another one measures waits with its copy. Runs belong to the session:
they continue while the user edits, renders, saves, or opens another file. They end with Blender.
"""

from __future__ import annotations

import atexit
import contextlib
import threading
import time
from pathlib import Path

import bpy

from ... import errors
from ...errors import RadarSimError, RenderError
from ...findings import Finding, from_json
from ...messages import Message
from ...processes import remove_abandoned_folders
from ...terminal import progress_text
from ..headless import SceneCopy
from ..rig_settings import PROGRESS_PROPERTY
from .fields import findings_text, tr
from .scene_reading import redraw_panels
from .shown_results import MeasuredScene, note_measured
from .worker_process import WorkerProcess

#: Time between two looks for messages [s].
_LOOK_S = 0.05
#: Time that a stopped process has to end its step before it is killed [s].
_GRACE_S = 3.0


class WindowRun:
    """A run of a copy: `step` until `ended`; then `error`, `stopped`, or what was measured."""

    def __init__(self, copy: SceneCopy, measured: MeasuredScene) -> None:
        self.copy, self.measured = copy, measured
        self.ended = self.stopped = False
        self.error: RadarSimError | None = None
        self.text = tr("Waiting for the run before")
        self.fraction = 0.0
        self.findings: list[Finding] = []
        self.frames: list[int] = []
        self.done = self.total = 0
        self.unit, self.folder = "steps", Path()
        self.seconds_left: float | None = None
        #: Time per ray and reflection, where the run says what it costs.
        self.seconds_per_ray: float | None = None
        self.began = self._closed = False
        self._worker: WorkerProcess | None = None
        #: When a stopped process is killed; 0 for one that is not stopped.
        self._kill_at_s = 0.0

    def step(self) -> None:
        """Start the process, or take what it has written. Nothing here waits."""
        try:
            if self._worker is None:
                self._start()
            self._look()
        except RadarSimError as error:
            self.error = error
        except OSError as error:
            self.error = RenderError(f"The process that measures cannot start: {error}.")
        if self.error is not None or self.stopped:
            self._end()

    def _look(self) -> None:
        worker = self._worker
        assert worker is not None
        code, words = worker.exit_code, worker.last_words
        for message in worker.received():
            self._take(message)
        if self.ended or self.stopped:
            return
        is_over = code is not None and worker.is_read
        if self._kill_at_s:
            self.stopped = is_over or time.monotonic() > self._kill_at_s
        elif is_over and code is not None:
            raise _ended_by_itself(code, words)

    def _start(self) -> None:
        size, took_s = self.copy.size_bytes / 1e6, self.copy.took_s
        self.text = tr(
            "Opening the copy of {size:.0f} MB, saved in {seconds:.1f} s", size=size, seconds=took_s
        )
        self._worker = WorkerProcess("blender.headless.window_worker", in_blender=True)
        self._worker.send(self.copy.order)

    def stop(self) -> None:
        """Have the process end after its step, for which it has a short time.

        It ends at once if it has not begun, or the second time.
        """
        if self.ended:
            return
        if self._worker is None or not self.began or self._kill_at_s:
            self.stopped = True
            self._end()
        else:
            self._kill_at_s = time.monotonic() + _GRACE_S
            self._worker.send(Message({"kind": "stop"}, {}))

    def close(self, wait: bool = True) -> None:
        """End the process and remove the copy; a second call changes nothing.

        It takes time to free gigabytes of memory and files; a thread does it without `wait`.
        """
        self.ended = True
        worker, self._worker = self._worker, None
        if not self._closed:
            self._closed = True
            if wait:
                _clean(worker, self.copy)
                return
            _cleaners[:] = [one for one in _cleaners if one.is_alive()]
            _cleaners.append(threading.Thread(target=_clean, args=(worker, self.copy)))
            _cleaners[-1].start()

    def _end(self) -> None:
        self.close(wait=False)
        if self.stopped:
            self.text = tr(
                "{done} of {total} {unit} done, stopped; the next run measures all again",
                done=self.done, total=self.total, unit=self.unit,
            )  # fmt: skip
        elif self.error is not None:
            self.text = tr("Failed: {error}", error=self.error)

    def _take(self, message: Message) -> None:
        fields = message.fields
        kind = fields.pop("kind")
        if "findings" in fields:
            self.findings = [from_json(item, "Findings") for item in fields["findings"]]
        if kind in ("began", "progress", "stopped"):
            self.done, self.total = fields.get("done", 0), fields["total"]
        if kind == "began":
            self.began = True
            note_measured(self.measured, fields["fingerprint"])
            self.unit, self.folder = fields["unit"], Path(fields["folder"])
            self.frames = fields["frames"]
        elif kind == "progress":
            self.fraction, self.seconds_left = fields["fraction"], fields["seconds_left"]
        if kind in ("began", "progress") and not self._kill_at_s:
            text = progress_text(self.done, self.total, self.seconds_left, self.unit)
            stage = fields.get("stage")
            self.text = f"{text} ({stage})" if stage else text
        elif kind == "fault":
            raise getattr(errors, fields["name"], RadarSimError)(fields["text"])
        elif kind == "stopped":
            self.stopped = True
        elif kind == "end":
            self.total = self.done = fields["total"]
            self.fraction, self.seconds_per_ray = 1.0, fields["seconds_per_ray"]
            values = {"total": self.total, "unit": self.unit, "folder": self.folder}
            self.text = tr("{total} {unit} in {folder}", **values)
            if fields["summary"]:
                self.text = f"{fields['summary']}. {self.text}"
            self._end()


def _clean(worker: WorkerProcess | None, copy: SceneCopy) -> None:
    if worker is not None:
        worker.close()
        remove_abandoned_folders(now=True)  # what a killed process had in the temporary folder
    copy.close()


def _ended_by_itself(code: int, words: str | None) -> RenderError:
    """Error for a process that ended without a last message."""
    if code < 0:
        return RenderError(
            f"The process that measures was ended by signal {-code}. The system does so where "
            "memory is full. Close other programs, or measure with fewer pixels or less geometry."
        )
    return RenderError(
        f"The process that measures ended with code {code}: {words}. `radarsim render` of the "
        "saved file shows all of its output."
    )


# -- the runs of the session -----------------------------------------------------------------------

_runs: list[WindowRun] = []
#: Threads that remove what runs have left.
_cleaners: list[threading.Thread] = []


def add_run(run: WindowRun) -> None:
    """Measure a copy when the runs before are done."""
    _runs.append(run)
    if not bpy.app.background and not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=0.0, persistent=True)


def current_run() -> WindowRun | None:
    """The run that measures now; None without one."""
    return _runs[0] if _runs else None


def advance() -> None:
    """Start the next run, or take what its process has written."""
    while _runs and _runs[0].ended:
        _runs.pop(0)
    if _runs:
        _runs[0].step()


def _tick() -> float | None:
    before = current_run()
    advance()
    run = current_run()
    if before is not None:
        show_state(run or before)
    return None if run is None else _LOOK_S


def show_state(run: WindowRun) -> None:
    """Show in the panel and the status bar how far a run is."""
    manager = bpy.context.window_manager
    progress = getattr(manager, PROGRESS_PROPERTY)
    waiting = len(_runs) - 1
    text = run.text + (tr("; {count} more wait", count=waiting) if waiting > 0 else "")
    if (progress.running, progress.text) == (not run.ended, text):
        return
    progress.running, progress.fraction, progress.text = not run.ended, run.fraction, text
    progress.findings = findings_text(run.findings)
    if not run.ended:
        progress.processed = ""
    if run.seconds_per_ray is not None:
        progress.seconds_per_ray = run.seconds_per_ray
    for window in manager.windows:
        window.workspace.status_text_set(None if run.ended else text)
    redraw_panels(bpy.context)


def end_runs() -> None:
    """End all runs: Blender quits, or the add-on is disabled. A second call changes nothing."""
    while _runs:
        _runs.pop().close()
    while _cleaners:
        _cleaners.pop().join()
    with contextlib.suppress(ValueError):
        bpy.app.timers.unregister(_tick)


atexit.register(end_runs)
