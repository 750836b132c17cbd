# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of 2501 objects in a real window, with the tab open and the live preview on.

blender --python many.py -- FOLDER
"""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
from robot import Robot

FOLDER = Path(sys.argv[sys.argv.index("--") + 1])
#: Objects, of which one in so many is animated, and their distance [m].
SIDE, ANIMATED, APART_M = 50, 4, 3.0
#: Edits of each kind.
EDITS = 3


def module(name: str) -> Any:
    """A module of the add-on, whatever the extension's package is called."""
    (found,) = [one for one in sys.modules if one.endswith(f"blender.{name}")]
    return sys.modules[found]


def add_objects() -> Any:
    """A square of cubes, each with a mesh of its own; returns the cube from which they are made."""
    cube = bpy.data.objects["Cube"]
    material = cube.active_material
    cube.display_type = "BOUNDS"  # software OpenGL draws faces slowly
    for number in range(SIDE * SIDE):
        item = bpy.data.objects.new(f"Cube {number}", cube.data.copy())
        item.location = (number % SIDE - SIDE / 2) * APART_M, number // SIDE * APART_M + 10, 0
        item.display_type = "BOUNDS"
        bpy.context.scene.collection.objects.link(item)
        if number % ANIMATED == 0:
            item.keyframe_insert("location", frame=1)
            item.location.z = 3.0
            item.keyframe_insert("location", frame=20)
    assert material is not None
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.radarsim.assign_material()
    bpy.ops.object.select_all(action="DESELECT")
    return cube


class Stopwatch:
    """Processor time of each call of some functions in the window's thread [ms], by name.

    Python looks for garbage among all that Blender and its add-ons hold, once in a while: this time
    counts for itself.
    """

    def __init__(self) -> None:
        self.spent_ms: dict[str, list[float]] = {}
        self._collected_s = self._collecting_s = 0.0
        gc.callbacks.append(self._note_collection)

    def _note_collection(self, phase: str, about: dict[str, int]) -> None:
        if phase == "start":
            self._collecting_s = time.thread_time()
        else:
            spent_s = time.thread_time() - self._collecting_s
            self._collected_s += spent_s
            self.spent_ms.setdefault("garbage collection", []).append(1e3 * spent_s)

    def watch(self, owner: Any, name: str) -> None:
        """Take the time of a function or method from now on."""
        function = getattr(owner, name)

        def timed(*words: Any, **options: Any) -> Any:
            start_s = time.thread_time() - self._collected_s
            try:
                return function(*words, **options)
            finally:
                spent_ms = 1e3 * (time.thread_time() - self._collected_s - start_s)
                self.spent_ms.setdefault(name, []).append(spent_ms)

        setattr(owner, name, timed)

    def longest(self) -> dict[str, float]:
        """The longest call of each since the last time that this was asked."""
        found = {name: round(max(times), 2) for name, times in self.spent_ms.items()}
        self.spent_ms = {}
        return found


def script(robot: Robot) -> Any:
    result = robot.result
    cube = add_objects()
    bpy.ops.radarsim.setup_rig()
    yield from robot.open_tab("Radar")
    reading, live, snapshot = module("ui.scene_reading"), module("ui.live_preview"), module(
        "state.snapshot"
    )  # fmt: skip
    bpy.context.window_manager.radarsim_live = True
    drafts = live.current_preview().statistics
    yield from robot.wait(lambda: drafts.drafts >= 1, "the first draft", 120)
    watch = Stopwatch()
    for owner, name in (
        (reading, "_read_slice"), (live, "_tick"), (live, "_draw"), (snapshot._Latest, "note"),
    ):  # fmt: skip
        watch.watch(owner, name)
    if bpy.app.timers.is_registered(live._tick.__closure__[0].cell_contents):
        bpy.app.timers.unregister(live._tick.__closure__[0].cell_contents)
    bpy.app.timers.register(live._tick)

    state = reading._reader
    added: list[Any] = []

    def add() -> None:
        item = bpy.data.objects.new("More", cube.data.copy())
        item.location = 0.0, 8.0 + len(added), 0.0
        bpy.context.scene.collection.objects.link(item)
        added.append(item)

    def remove() -> None:
        bpy.data.objects.remove(added.pop())

    def move() -> None:
        bpy.data.objects["Cube 7"].location.z += 0.1

    edits: dict[str, Callable[[], None]] = {
        "nothing": lambda: None, "move": move, "add": add, "remove": remove,
        "undo": lambda: bpy.ops.ed.undo_push(message="more"),
    }  # fmt: skip
    result["longest_ms"] = {}
    for what, edit in edits.items():
        watch.longest()
        for _ in range(EDITS):
            edit()
            bpy.context.view_layer.update()  # Blender's own work is not counted
            before = state.of
            yield 1.0
            yield from robot.wait(lambda: not (state.changed or state.reading), "the record", 60)
            result.setdefault("read_again", {})[what] = state.of is not before
            yield 1.0
        result["longest_ms"][what] = watch.longest()
        robot.log(f"{what}: {result['longest_ms'][what]}")
    yield from robot.shot("many")
    result["objects"] = len(bpy.context.scene.objects)
    result["fault"] = live.current_preview().fault


if __name__ == "__main__":
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.system.viewport_aa = "OFF"
    Robot(FOLDER).run(script)
