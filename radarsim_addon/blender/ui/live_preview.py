# SPDX-License-Identifier: GPL-3.0-or-later
"""Live preview: profile and map in a corner of the 3D view while the user moves things.

A timer reads what has changed in slices and sends it to a process of its own, which drafts. The
window only reads, sends and draws. The switch is a property without a place in any file.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...errors import RadarSimError
from ...messages import Message
from ...signal.draft import DRAFT, LEVELS
from ..rig_settings import TEXT_CONTEXT
from ..state import Snapshot, part_of_snapshot
from .fields import is_refused, may_write_at_need, tr
from .live_picture import draw_live, forget_drawing
from .live_scene import LiveReader, LiveScene
from .worker_process import WorkerProcess

LIVE_PROPERTY = "radarsim_live"
#: Times to the next look at the scene: while it changes, and while nothing happens [s].
_SOON_S, _CALM_S = 0.01, 0.05
#: Settings, which Blender does not report, are read again after this time [s].
_SETTINGS_S = 0.5
#: Time after which a slice ends with the mesh that is being read [s].
_SLICE_S = 0.008


@dataclass
class _Statistics:
    """Slices of the timer, drafts that have come, those of them that were the first after a change,
    and drawings.
    """

    slices: int = 0
    drafts: int = 0
    first_drafts: int = 0
    drawings: int = 0


class LivePreview:
    """One preview, from the switch to the next switch."""

    def __init__(self) -> None:
        self._process = WorkerProcess("signal.draft.worker")
        self._reader = LiveReader()
        self._reading: Iterator[Message | LiveScene | None] | None = None
        self._snapshot: Snapshot | None = None
        self._sent: LiveScene | None = None
        self._ready: LiveScene | None = None
        self._number = 0
        self._waiting = False
        self._read_s = 0.0
        self._refused = False
        self.draft: Message | None = None
        self.fault = ""
        self.statistics = _Statistics()

    def tick(self, context: bpy.types.Context) -> float:
        """Do one step; return the time to the next step [s].

        If Blender refuses to change data, the error is raised once, and the step runs again where
        Blender allows it.
        """
        try:
            pause_s = self._step(context)
            self._refused = False
        except (RadarSimError, AttributeError, RuntimeError) as error:  # the latter are Blender's
            self.pause()
            tried_again, self._refused = self._refused, is_refused(error)
            if self._refused and not tried_again:
                raise
            if isinstance(error, AttributeError) and not self._refused:
                raise
            self._show_fault(context, str(error).strip())
            pause_s = _SETTINGS_S
        except ReferenceError:  # an object was removed while it was read
            self.pause()
            pause_s = _SOON_S
        self.statistics.slices += 1
        return pause_s

    def _step(self, context: bpy.types.Context) -> float:
        if bpy.app.is_job_running("RENDER"):
            self.pause()
            return _SETTINGS_S
        self._receive(context)
        snapshot = part_of_snapshot(context)  # evaluates an edit, which may take longer
        deadline_s = time.perf_counter() + _SLICE_S
        while snapshot is None:
            if time.perf_counter() > deadline_s:
                return _SOON_S
            snapshot = part_of_snapshot(context)
        if self._reading is not None and snapshot is not self._snapshot:
            self._reading = None  # what was read is of a scene that is no more
        due = time.monotonic() - self._read_s > _SETTINGS_S
        if self._reading is None and self._ready is None and not self._waiting:
            if snapshot is self._snapshot and not due:
                return _CALM_S
            self._snapshot, self._reading = snapshot, self._reader.read(context)
        while self._reading is not None:
            found = next(self._reading)
            if isinstance(found, LiveScene):
                self._reading, self._read_s = None, time.monotonic()
                if found.same(self._sent):
                    self._sent = found  # notes may be others
                else:
                    self._ready = found
            elif found is not None:
                self._process.send(found)
            if time.perf_counter() > deadline_s:
                break
        if self._ready is not None and not self._waiting:
            self._send(self._ready)
        return _SOON_S if self._reading is not None or self._waiting else _CALM_S

    def _send(self, scene: LiveScene) -> None:
        self._sent, self._ready, self._waiting = scene, None, True
        self._number += 1
        self._process.send(
            Message({**scene.message.fields, "number": self._number}, scene.message.arrays)
        )

    def _receive(self, context: bpy.types.Context) -> None:
        """Take the newest draft. A draft of an earlier scene is out of date."""
        for message in self._process.received():
            if message.fields["number"] != self._number:
                continue
            if message.fields["kind"] == DRAFT:
                self._count(message)
                self.draft, self.fault = message, ""
                _redraw(context)
            else:
                self._show_fault(context, message.fields["text"])
            self._waiting = False
        words = self._process.last_words
        if words is not None and not self.fault:
            self._waiting = True  # for ever
            self._show_fault(context, tr("The preview's process has ended: {words}", words=words))

    def _count(self, draft: Message) -> None:
        self.statistics.drafts += 1
        self.statistics.first_drafts += draft.fields["level"] == 0

    def _show_fault(self, context: bpy.types.Context, text: str) -> None:
        if text != self.fault:
            self.fault, self.draft = text, None
            _redraw(context)

    @property
    def notes(self) -> tuple[str, ...]:
        """Return notes on what the draft of this scene leaves out."""
        return () if self._sent is None else self._sent.notes

    def lines(self) -> list[str]:
        """Texts above the axes."""
        title = tr("Live preview, draft: one reflection, no walls")
        if self.draft is None:
            return [title, self.fault or tr("reading the scene")]
        fields = self.draft.fields
        error_db = max(fields["peak_error_db"], 0.1)
        state = tr(
            "{rays} rays, sampling error {error_db:.1f} dB at the peak",
            rays=fields["rays"],
            error_db=error_db,
        )
        if fields["level"] + 1 < len(LEVELS):
            state += tr(", refining")
        lines = [title, state]
        if fields["noise_w"] > 0:
            pulse_db, map_db = (
                10 * math.log10(fields[name]) for name in ("noise_w", "map_noise_w")
            )
            lines.append(
                tr(
                    "noise (dashed) {pulse_db:.1f} dBW in a pulse, {map_db:.1f} dBW in the map",
                    pulse_db=pulse_db,
                    map_db=map_db,
                )
            )
        if math.isfinite(fields["gaps_from_m"]):
            lines.append(
                tr("gaps between rays from {range_m:.3g} m", range_m=fields["gaps_from_m"])
            )
        if self._sent is not None:
            some, every = fields["pulses"], self._sent.pulses
            if some < every:
                lines.append(tr("map of {some} of {all} pulses", some=some, all=every))
        return [*lines, *self.notes]

    def pause(self) -> None:
        """Forget the scene. It is read again at the next suitable time."""
        self._reading = self._snapshot = self._ready = self._sent = None
        self._reader = LiveReader()
        self._waiting = False
        self._number += 1  # what is under way is out of date

    def close(self) -> None:
        """End the process."""
        self._process.close()


def _redraw(context: bpy.types.Context) -> None:
    """Draw the 3D views again, without their sidebars."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            for region in area.regions if area.type == "VIEW_3D" else ():
                if region.type == "WINDOW":
                    region.tag_redraw()


_preview: LivePreview | None = None
_handles: list[Any] = []


def current_preview() -> LivePreview | None:
    """The preview that is on; None while it is off."""
    return _preview


def start_live() -> None:
    """Switch the preview on; a second call changes nothing. Raises a `RadarSimError`."""
    global _preview
    if _preview is not None:
        return
    _preview = LivePreview()
    for handlers, function in _hooks():
        handlers.append(function)
    bpy.app.timers.register(_tick, first_interval=_SOON_S)
    if not bpy.app.background:
        draw = bpy.types.SpaceView3D.draw_handler_add
        _handles.append(draw(_draw, (), "WINDOW", "POST_PIXEL"))


def stop_live() -> None:
    """Switch the preview off and leave nothing behind; a second call changes nothing."""
    global _preview
    for handlers, function in _hooks():
        if function in handlers:
            handlers.remove(function)
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")
    forget_drawing()
    if _preview is not None:
        preview, _preview = _preview, None
        preview.close()


@may_write_at_need
def _tick() -> float | None:
    return None if _preview is None else _preview.tick(bpy.context)


def _draw() -> None:
    context = bpy.context
    if _preview is not None and context.space_data.overlay.show_overlays:
        draw_live(context, _preview.draft, _preview.lines())
        _preview.statistics.drawings += 1


@persistent
def _on_load(*_: Any) -> None:
    stop_live()


@persistent
def _on_undo(*_: Any) -> None:
    if _preview is not None:  # objects are others afterwards
        _preview.pause()


def _hooks() -> tuple[tuple[list[Callable[..., None]], Callable[..., None]], ...]:
    """Return Blender's lists of handlers, each with the handler to add while the preview is on."""
    handlers = bpy.app.handlers
    return (
        (handlers.load_pre, _on_load),
        (handlers.undo_pre, _on_undo),
        (handlers.redo_pre, _on_undo),
        (handlers.render_init, _on_undo),
    )


def _is_on(_: Any) -> bool:
    return _preview is not None


def _switch(_: Any, on: bool) -> None:
    if on:
        start_live()
    else:
        stop_live()


def register_live() -> None:
    """Add the switch; a second call changes nothing."""
    switch = bpy.props.BoolProperty(
        name="Live Preview",
        get=_is_on,
        set=_switch,
        options={"SKIP_SAVE"},
        translation_context=TEXT_CONTEXT,
        description="Draw a draft of profile and map in the 3D view while you move things. The "
        "draft has paths of one reflection only: no multipath, nothing inside or behind walls, no "
        "mirrors, no random noise. Velocities come from keyframes only",
    )
    setattr(bpy.types.WindowManager, LIVE_PROPERTY, switch)


def unregister_live() -> None:
    """Switch the preview off and remove the switch; a second call changes nothing."""
    stop_live()
    if hasattr(bpy.types.WindowManager, LIVE_PROPERTY):
        delattr(bpy.types.WindowManager, LIVE_PROPERTY)
