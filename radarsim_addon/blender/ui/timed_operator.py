# SPDX-License-Identifier: GPL-3.0-or-later
"""What the long operators share: a timer, progress in the panel, Esc, a clean end."""

from __future__ import annotations

from typing import Any

import bpy

from ...errors import RadarSimError
from ...findings import Finding
from ..rig_settings import PROGRESS_PROPERTY
from .scene_reading import redraw_panels
from .shown_findings import findings_text, reported
from .translations import tr

#: Seconds between two looks at a running job.
_TICK_S = 0.01
#: Events that pass through while a job runs: looking around. Others could change what is measured.
_HARMLESS_EVENTS = ("MOUSEMOVE", "INBETWEEN", "WHEEL", "MIDDLEMOUSE", "TRACKPAD", "NDOF", "TIMER")


class TimedOperator(bpy.types.Operator):
    """Common part of the two long operators: timer, progress in the panel, Esc, clean end."""

    bl_options = {"REGISTER"}
    _timer: Any = None

    @classmethod
    def poll(cls, context: Any) -> bool:
        return not getattr(context.window_manager, PROGRESS_PROPERTY).running

    def invoke(self, context: Any, event: Any) -> set[str]:
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

    def modal(self, context: Any, event: Any) -> set[str]:
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

    def cancel(self, context: Any) -> None:
        """Blender closes the window or loads another file."""
        self._end(context, tr("Stopped"))

    def execute(self, context: Any) -> set[str]:
        """Do all of it at once."""
        raise NotImplementedError

    def _start(self, context: Any) -> list[Finding]:
        """Begin; return the findings before."""
        raise NotImplementedError

    def _tick(self) -> bool:
        """Do the next step; return whether it was the last one."""
        raise NotImplementedError

    def _state(self) -> tuple[float, str]:
        """Fraction that is done, and its text."""
        raise NotImplementedError

    def _escape(self, context: Any) -> set[str]:
        """The user pressed Esc."""
        raise NotImplementedError

    def _conclude(self, context: Any) -> set[str]:
        """The last step is done."""
        raise NotImplementedError

    def _show(self, context: Any, fraction: float, text: str) -> None:
        progress = getattr(context.window_manager, PROGRESS_PROPERTY)
        if progress.text != text:
            progress.fraction, progress.text = fraction, text
            context.workspace.status_text_set(tr("{text}  (Esc stops)", text=text))
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
