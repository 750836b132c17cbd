# SPDX-License-Identifier: GPL-3.0-or-later
"""A render job driven by a timer in Blender's window, so that the user interface stays alive.

Cycles renders in Blender's own render job (``INVOKE_DEFAULT``). Its handlers run in a worker
thread: they only set a flag; everything else is done by `tick`, in the main thread.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import bpy

from ...errors import RenderError
from ..plan import Task
from ..run import MeasurementJob
from ..state import SettingsRestorer

#: Timer ticks after which a render that neither ended nor runs is given up.
_PATIENCE_TICKS = 500
#: Time that short renders may keep the user interface from events.
_BLOCKING_S = 0.2


class InteractiveRender:
    """A prepared `MeasurementJob`, one render after the other.

    Parameters
    ----------
    job
        Prepared job; `close` restores it.
    preferences : bpy.types.Preferences
        Render windows are kept shut meanwhile.
    """

    def __init__(self, job: MeasurementJob, preferences: Any) -> None:
        self.job = job
        self.closed = False
        self.stop_reason = ""
        self._tasks: Iterator[Task] = job.pending()
        self._task: Task | None = None
        self._ended = ""
        self._idle_ticks = 0
        self._refused_ticks = 0
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
        # Loading a file would drop handlers that are not persistent, and fail their removal.
        handlers.append(function)
        self._recorder.on_restore(
            "handler", lambda: handlers.remove(function) if function in handlers else None
        )

    def _on_complete(self, *_: Any) -> None:
        self._ended = "complete"

    def _on_cancel(self, *_: Any) -> None:
        self._ended = "cancel"

    def _on_file_change(self, *_: Any) -> None:
        # The file on disk, or the undo step, must hold the user's settings and not ours.
        self.stop_reason = "the file was saved, loaded or undone"
        self.close()

    @property
    def rendering(self) -> object | None:
        """What is being rendered by Blender's render job; None between two renders."""
        return self._task

    def request_stop(self, reason: str) -> None:
        """Stop as soon as the running render has ended."""
        self.stop_reason = self.stop_reason or reason

    def tick(self) -> bool:
        """Do what can be done now without waiting. Returns whether the run has ended.

        Raises
        ------
        RadarSimError
            A render failed, or a file cannot be written. Call `close` then.
        """
        if self.closed:
            return True
        if not self._may_write():
            return False
        if self.job.blocking:
            return self._tick_blocking()
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
            return False  # somebody else's
        task = next(self._tasks, None)  # type: ignore[assignment]
        if task is None:
            return True
        self._begin(task)
        return False

    def _tick_blocking(self) -> bool:
        """As many short renders as fit between two looks at the user's events."""
        deadline_s = time.monotonic() + _BLOCKING_S
        while not self.stop_reason and time.monotonic() < deadline_s:
            task = next(self._tasks, None)
            if task is None:
                return True
            self.job.start(task)
            self.job.render(task)
            self.job.finish(task)
        return bool(self.stop_reason)

    def _may_write(self) -> bool:
        """Whether Blender lets scripts change data just now.

        It does not while a script draws, and its note of that is one for all threads: a render
        that ends in another thread can set it while we run. The next tick begins with a clean note.
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
                "Cycles stopped without saying why. Render an ordinary image of this scene with "
                "Cycles to see whether that works; then start again: the run goes on."
            )
        return False

    def _begin(self, task: Task) -> None:
        self.job.start(task)
        self._task = task
        self._ended = ""
        self._idle_ticks = 0
        try:
            result = bpy.ops.render.render("INVOKE_DEFAULT", scene=self.job.scene_name)
        except RuntimeError as error:
            raise RenderError(f"Cycles cannot start: {str(error).strip()}") from error
        if "CANCELLED" in result:
            raise RenderError(
                "Blender refused to start a render. Close other renders, then start again: "
                "the run goes on where it stopped."
            )

    def close(self) -> None:
        """Give everything back: scene, preferences, handlers. May be called again."""
        if self.closed:
            return
        self.closed = True
        self.job.restore()
        self.job.unrestored += self._recorder.restore()
