# SPDX-License-Identifier: GPL-3.0-or-later
"""Hands and eyes in a real Blender window: runs inside Blender, under Xvfb.

A script is a generator that yields seconds to wait; between its steps Blender's own event loop
runs. The mouse and the keys are real X events (xdotool); a button is found by moving the mouse
over the sidebar and asking Blender what lies under it, as a user would by looking. A heartbeat
timer, independent of the script, measures how long the window does not respond.
"""

from __future__ import annotations

import ctypes
import json
import math
import os
import subprocess
import time
import traceback
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any, ClassVar

import bpy
import numpy as np

Steps = Generator[float, None, Any]

#: Seconds between two beats of the heartbeat, and between two looks at what is awaited.
BEAT_S, LOOK_S = 0.05, 0.01
#: Longer than the delay of any timer of the add-on.
SETTLE_S = 0.5
#: Longest time for which the robot waits until Blender has noticed the mouse.
NOTICE_S = 0.5
#: Pixels between two places where the mouse is put when a button is searched; a button has 20.
SCAN_PX = 16
#: Clicks of the wheel between two looks at the sidebar.
WHEEL_CLICKS = 8


class ROBOT_OT_step(bpy.types.Operator):
    """Go on with the script"""

    # Modal, and not Blender's timers: Blender notes that a panel is being drawn, so that data must
    # not be changed, once for all threads. A render that begins meanwhile leaves the note there:
    # then timers can change nothing any more. Modal operators still can.

    bl_idname = "robot.step"
    bl_label = "Step"
    bl_options: ClassVar[set[str]] = {"INTERNAL"}

    advance: ClassVar[Callable[[], float | None] | None] = None
    due_s: ClassVar[float] = 0.0
    last_s: ClassVar[float] = 0.0
    #: Where Blender saw the mouse last.
    mouse: ClassVar[tuple[int, int]] = (-1, -1)
    running: ClassVar[int] = 0
    _number = 0
    _timer: Any = None

    def invoke(self, context: Any, event: Any) -> set[str]:
        kind = type(self)
        kind.running += 1
        self._number, kind.last_s = kind.running, time.monotonic()
        self._timer = context.window_manager.event_timer_add(LOOK_S, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        kind = type(self)
        if self._number != kind.running:  # another one has taken its place
            context.window_manager.event_timer_remove(self._timer)
            return {"CANCELLED", "PASS_THROUGH"}
        kind.last_s = time.monotonic()
        kind.mouse = event.mouse_x, event.mouse_y
        if event.type == "TIMER" and kind.last_s >= kind.due_s:
            kind.due_s = math.inf  # no step within a step
            assert kind.advance is not None
            wait_s = kind.advance()
            kind.last_s = time.monotonic()
            kind.due_s = math.inf if wait_s is None else kind.last_s + wait_s
        return {"PASS_THROUGH"}


class Pointer:
    """The mouse, by X's own events: to start xdotool takes as long as a search of ten places."""

    def __init__(self) -> None:
        self._x11, self._test = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
        self._x11.XOpenDisplay.restype = ctypes.c_void_p
        self._display = ctypes.c_void_p(self._x11.XOpenDisplay(None))

    def move(self, x: int, y: int) -> None:
        """Move to a place of the screen, from its upper left corner [px]."""
        self._test.XTestFakeMotionEvent(self._display, -1, x, y, ctypes.c_ulong(0))
        self._x11.XFlush(self._display)

    def click(self, button: int, times: int = 1) -> None:
        """Press and release a button: 1 is the left one, 4 and 5 are the wheel."""
        for _ in range(times):
            for pressed in (1, 0):
                self._test.XTestFakeButtonEvent(self._display, button, pressed, ctypes.c_ulong(0))
        self._x11.XFlush(self._display)


class Robot:
    """Runs a script in the window and writes what it found to `folder`/result.json."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.result: dict[str, Any] = {"error": "", "shots": [], "log": []}
        self.window = bpy.context.window_manager.windows[0]
        self._last_beat: float | None = None
        self._last_thread_s = 0.0
        self._own_s: list[float] = []
        self._gaps: list[float] | None = None
        self._found: dict[str, int] = {}
        self._last = 0
        self._start_s = time.monotonic()
        self._pointer = Pointer()

    # -- running ---------------------------------------------------------------------------------
    def run(self, script: Callable[[Robot], Steps]) -> None:
        """Start the script once Blender's window stands; Blender quits when it has ended."""
        steps = script(self)

        def advance() -> float | None:
            try:
                return next(steps)
            except StopIteration:
                self._quit()
            except BaseException:
                self.result["error"] = traceback.format_exc()
                subprocess.run(["import", "-window", "root", str(self.folder / "error.png")])
                self._quit()
            return None

        def tick() -> float:
            """Start it, again after a file was loaded or while a popup takes all events."""
            if time.monotonic() - ROBOT_OT_step.last_s > 2:
                try:
                    with bpy.context.temp_override(window=self.window):
                        bpy.ops.robot.step("INVOKE_DEFAULT")
                except RuntimeError as error:  # a timer that raises is never called again
                    self.log(f"the script waits: {error}")
            return 0.5

        ROBOT_OT_step.advance = advance
        bpy.utils.register_class(ROBOT_OT_step)
        bpy.app.timers.register(tick, first_interval=1.5, persistent=True)
        bpy.app.timers.register(self._beat, first_interval=1.5, persistent=True)

    def _beat(self) -> float:
        now = time.monotonic()
        if self._last_beat is not None and self._gaps is not None:
            self._gaps.append(now - self._last_beat)
            self._own_s.append(time.thread_time() - self._last_thread_s)
        self._last_beat, self._last_thread_s = now, time.thread_time()
        return BEAT_S

    def _quit(self) -> None:
        temporary = self.folder / "result.json.part"
        temporary.write_text(json.dumps(self.result, indent=1, default=str), encoding="utf-8")
        os.replace(temporary, self.folder / "result.json")
        bpy.ops.wm.quit_blender()

    def log(self, text: str) -> None:
        """Note a line in the result and on the terminal."""
        line = f"{time.monotonic() - self._start_s:6.1f} s  {text}"
        self.result["log"].append(line)
        print("robot:", line, flush=True)

    # -- looking ---------------------------------------------------------------------------------
    def shot(self, name: str) -> Steps:
        """Take a screenshot of the whole screen; Blender's event loop runs meanwhile."""
        path = self.folder / f"{name}.png"
        taken = subprocess.Popen(["import", "-window", "root", str(path)])
        self.result["shots"].append(path.name)
        yield from self.wait(lambda: taken.poll() is not None, f"screenshot {name}")

    def start_watching(self) -> None:
        """Measure from now on how long the event loop does not respond."""
        self._gaps, self._own_s = [], []

    def stop_watching(self) -> dict[str, float]:
        """Longest gap between two heartbeats [s], and their number, since start_watching."""
        gaps, self._gaps = self._gaps or [], None
        return {
            "longest_gap_s": max(gaps, default=0.0),
            # Processor time of the window's own thread, whatever else the machine does.
            "longest_own_s": max(self._own_s, default=0.0),
            "beats": len(gaps),
            "time_s": sum(gaps),
        }

    def wait(self, condition: Callable[[], Any], what: str, timeout_s: float = 60.0) -> Steps:
        """Wait until `condition()` is true."""
        start_s = time.monotonic()
        while not condition():
            if time.monotonic() > start_s + timeout_s:
                raise TimeoutError(f"{what} did not happen within {timeout_s:g} s")
            yield LOOK_S
        self.log(f"{what}: {time.monotonic() - start_s:.1f} s")

    def settle(self) -> Steps:
        """Wait until the window has been drawn after what its timers do a moment later."""
        yield SETTLE_S
        for _ in range(3):  # turns of the event loop, each of which ends with a drawing
            yield 0.0

    def modal_operators(self) -> list[str]:
        """Names of the operators that are running in the window."""
        running = (operator.bl_idname for operator in self.window.modal_operators)
        return [name for name in running if name != ROBOT_OT_step.__name__]

    # -- the sidebar -----------------------------------------------------------------------------
    @property
    def view(self) -> Any:
        """The 3D view."""
        return max(
            (area for area in self.window.screen.areas if area.type == "VIEW_3D"),
            key=lambda area: area.width * area.height,
        )

    @property
    def sidebar(self) -> Any:
        """The 3D view's sidebar region."""
        return next(region for region in self.view.regions if region.type == "UI")

    def open_tab(self, name: str) -> Steps:
        """Open the sidebar and choose a tab, as N and a click would."""
        self.view.spaces.active.show_region_ui = True
        yield from self.settle()  # the region gets its width with the next redraw
        self.sidebar.active_panel_category = name
        self.view.tag_redraw()
        yield from self.settle()

    # -- mouse and keys --------------------------------------------------------------------------
    def move(self, x: int, y: int) -> None:
        """Move the mouse; Blender counts pixels from below, X from above."""
        self._pointer.move(x, self.window.height - y)

    def go(self, x: int, y: int) -> Steps:
        """Move the mouse, and wait until Blender has noticed it."""
        # Twice, since a button wakes up by a movement and not by a place.
        self.move(x - 1, y)
        self.move(x, y)
        start_s = time.monotonic()
        while True:
            yield 0.0
            seen = ROBOT_OT_step.mouse
            if max(abs(seen[0] - x), abs(seen[1] - y)) < 2 and seen[0] >= x:
                break
            if time.monotonic() > start_s + NOTICE_S:
                break  # a popup takes all events
        yield 0.0

    def turn_wheel(self, clicks: int) -> Steps:
        """Turn the mouse wheel: down by a positive number of clicks, else up."""
        self._pointer.click(5 if clicks > 0 else 4, abs(clicks))
        yield 0.1
        yield 0.0

    def press(self, key: str) -> None:
        """Press and release a key."""
        subprocess.run(["xdotool", "key", key], check=True)

    def under_mouse(self) -> str:
        """The operator or property of the button under the mouse; empty where there is none."""
        manager = bpy.context.window_manager
        manager.clipboard = ""
        with bpy.context.temp_override(window=self.window, area=self.view, region=self.sidebar):
            for copy in (bpy.ops.ui.copy_python_command_button, bpy.ops.ui.copy_data_path_button):
                if copy.poll():
                    copy()
        return str(manager.clipboard)

    def find(self, wanted: str, across: float = 0.5) -> Steps:
        """Search the sidebar for a button at a fraction of its width; its place is the value.

        Where it was found last is tried first, then what is seen, from the last button downwards;
        then the sidebar is scrolled by the wheel: to its end, and once more from its top on.
        """
        # Away from the sidebar first: a busy Blender still shows the button of a while ago.
        yield from self._leave_sidebar()
        tried: set[int] = set()
        lines = [self._found[wanted]] if wanted in self._found else []
        for line in lines:
            yield from self._bring_into_view(line)
        for upwards in (False, True):
            if upwards:
                yield from self.turn_wheel(-80)
            while True:
                for line in [*lines, *sorted(self._lines(), key=lambda one: one < self._last)]:
                    place = self._place(line, across)
                    if line in tried or place is None:
                        continue
                    tried.add(line)
                    yield from self.go(*place)
                    if wanted in self.under_mouse():
                        yield from self.go(place[0] - 1, place[1])
                        yield 0.1
                        if wanted in self.under_mouse():
                            self._found[wanted] = self._last = line
                            return place
                before = self._lines()
                yield from self.turn_wheel(WHEEL_CLICKS)
                if self._lines() == before:  # the end of the sidebar
                    break
        raise LookupError(f"no button of the sidebar is {wanted!r}")

    def _bring_into_view(self, line: int) -> Steps:
        """Scroll the sidebar until a line of it is in view, as far as there are lines."""
        region, before = self.sidebar, None
        yield from self.go(region.x + region.width // 2, region.y + region.height // 2)
        while self._place(line) is None and self._lines() != before:
            before = self._lines()
            yield from self.turn_wheel(4 if line > before[-1] else -4)

    def _lines(self) -> range:
        """Lines of the sidebar, `SCAN_PX` high and counted from its top, that are in view."""
        region = self.sidebar
        top = region.view2d.region_to_view(0, region.height - 12)[1]
        return range(math.ceil(-top / SCAN_PX), int((region.height - 24 - top) / SCAN_PX) + 1)

    def _place(self, line: int, across: float = 0.5) -> tuple[int, int] | None:
        """Where a line is in the window; None: out of view."""
        region = self.sidebar
        y = region.view2d.view_to_region(0, -line * SCAN_PX, clip=False)[1]
        inside = 12 <= y <= region.height - 12
        return (region.x + int(across * region.width), region.y + y) if inside else None

    def click_image(self, area: Any, place: tuple[float, float]) -> Steps:
        """Click in an Image Editor of the window, at a place of its image: fractions from below."""
        region = next(one for one in area.regions if one.type == "WINDOW")
        x, y = region.view2d.view_to_region(*place)
        yield from self.go(region.x + x, region.y + y)
        self._pointer.click(1)
        yield 0.3

    def drag(self, start: tuple[float, float], stop: tuple[float, float]) -> Steps:
        """Move the mouse from one place of the window to another with the left button pressed.

        Blender gives no event to the script meanwhile, so that another process drags.
        """
        yield from self.go(round(start[0]), round(start[1]))
        yield 0.3
        words = ["xdotool", "mousedown", "1", "sleep", "0.2"]
        for part in range(1, 11):
            x, y = (round(a + part / 10 * (b - a)) for a, b in zip(start, stop, strict=True))
            words += ["mousemove", str(x), str(self.window.height - y), "sleep", "0.05"]
        dragging = subprocess.Popen([*words, "sleep", "0.2", "mouseup", "1"])
        yield from self.wait(lambda: dragging.poll() is not None, "the drag", 20)
        yield 0.3

    def _leave_sidebar(self) -> Steps:
        view = self.view
        for number in range(100):
            place = view.x + view.width // 3 + number % 2, view.y + view.height // 2
            yield from self.go(*place)
            if not self.under_mouse():
                return
        raise TimeoutError("Blender took no notice of the mouse for 10 s")

    def click_until(self, wanted: str, condition: Callable[[], Any], what: str) -> Steps:
        """Click a button, again where nothing came of it: as a user would.

        Blender keeps drawing a button grey, and refuses it, while the mouse rests on it from
        before it could be pressed.
        """
        for _ in range(4):
            yield from self.click(wanted)
            try:
                yield from self.wait(condition, what, 8)
                return
            except TimeoutError:
                self.log(f"{what}: the click was not taken")
                yield from self._leave_sidebar()
        raise TimeoutError(f"{what} did not happen after four clicks on {wanted}")

    def click(self, wanted: str, across: float = 0.5) -> Steps:
        """Find a button and click it with the left mouse button."""
        x, y = yield from self.find(wanted, across)
        self.log(f"click {wanted} at {x}, {y}")
        self._pointer.click(1)
        yield 0.2
        return x, y


def thread_time_of(state: Any, name: str, value: Any) -> float:
    """Processor time of this thread for what a setting of the panel does [s]."""
    start_s = time.thread_time()
    setattr(state, name, value)
    return time.thread_time() - start_s


def pictures_fit() -> bool:
    """Return whether all Image Editors show their images whole, pixel by pixel."""
    areas = [a for w in bpy.context.window_manager.windows for a in w.screen.areas]
    shown = [a for a in areas if a.type == "IMAGE_EDITOR" and a.spaces.active.image is not None]
    return bool(shown) and all(
        abs(area.spaces.active.zoom[0] - 1) < 2e-3
        and area.spaces.active.image.size[0] <= area.width
        for area in shown
    )


def ring_in(image: Any) -> tuple[float, float]:
    """Place of the white ring in the plotting area of a map: fractions from below."""
    width, height = image.size
    pixels = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    white = pixels.reshape(height, width, 4).min(axis=2) > 0.95
    white[: int(0.11 * height)] = white[int(0.88 * height) :] = False
    white[:, : int(0.1 * width)] = white[:, int(0.83 * width) :] = False
    y, x = np.argwhere(white).mean(axis=0)
    return float(x + 0.5) / width, float(y + 0.5) / height
