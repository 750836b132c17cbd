# SPDX-License-Identifier: GPL-3.0-or-later
"""A measurement that a timer drives in Blender's window, so that the user interface responds.

Cycles renders in Blender's own render job (``INVOKE_DEFAULT``). Its handlers run in a worker thread
and only set a flag. `tick` does everything else in the main thread.
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
    """A prepared `MeasurementJob` that renders in steps.

    Parameters
    ----------
    job
        Prepared job; `close` restores the scene.
    preferences : bpy.types.Preferences
        Blender's render window is off during the measurement.
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
        """Do the next step without waiting.

        Returns
        -------
        bool
            Whether the run has ended.

        Raises
        ------
        RadarSimError
            A render failed, or a file cannot be written. Call `close` then.
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
