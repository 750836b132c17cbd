# SPDX-License-Identifier: GPL-3.0-or-later
"""Timers that change data, whatever Blender notes of drawing.

Blender notes, once for all threads, that a panel is being drawn and must not change data. A render
that begins meanwhile may leave the note there for good: then timers could change nothing any more.
Properties of the window manager can be set even so, and their updates may change data.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import bpy

_PROPERTY = "radarsim_timer"
_calls: list[Callable[[], None]] = []
#: In what Blender says where it refuses to change data, of properties and of operators.
_REFUSALS = ("Writing to ID classes in this context", "can't modify blend data in this state")


def _run_calls(_: Any, __: Any) -> None:
    """Run what waits; the update of the property."""
    while _calls:
        _calls.pop()()


def may_write(timer: Callable[[], float | None]) -> Callable[[], float | None]:
    """Return a function for Blender's timers that does the same and may change data."""

    @functools.wraps(timer)
    def allowed() -> float | None:
        pauses_s: list[float | None] = []
        errors: list[Exception] = []

        def call() -> None:
            try:
                pauses_s.append(timer())
            except Exception as error:  # Blender would print it and go on
                errors.append(error)

        _calls.append(call)
        manager = bpy.context.window_manager
        setattr(manager, _PROPERTY, not getattr(manager, _PROPERTY))
        if errors:
            raise errors[0]
        return pauses_s[0]

    return allowed


def is_refused(error: BaseException) -> bool:
    """Return whether Blender refused to change data."""
    return any(text in str(error) for text in _REFUSALS)


def may_write_at_need(timer: Callable[[], float | None]) -> Callable[[], float | None]:
    """Return a function as that of `may_write`, for timers that run many times a second.

    Only what Blender refuses is done again in the update: this draws the whole window.
    """
    allowed = may_write(timer)

    @functools.wraps(timer)
    def tried() -> float | None:
        try:
            return timer()
        except (AttributeError, RuntimeError) as error:
            if not is_refused(error):
                raise
        return allowed()

    return tried


def register_timer_writes() -> None:
    """Register the property; a second call changes nothing."""
    if not hasattr(bpy.types.WindowManager, _PROPERTY):
        switch = bpy.props.BoolProperty(
            name="Timer",
            update=_run_calls,
            options={"SKIP_SAVE", "HIDDEN"},
            description="Set by timers that change data",
        )
        setattr(bpy.types.WindowManager, _PROPERTY, switch)


def unregister_timer_writes() -> None:
    """Take it back; a second call changes nothing."""
    if hasattr(bpy.types.WindowManager, _PROPERTY):
        delattr(bpy.types.WindowManager, _PROPERTY)
