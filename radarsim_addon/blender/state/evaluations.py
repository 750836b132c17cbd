# SPDX-License-Identifier: GPL-3.0-or-later
"""The last snapshot of a scene, brought up to date.

Blender reports what each evaluation has changed. The next snapshot reads those objects again, and
walks through the scene only where instances may have changed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
from bpy.app.handlers import persistent

from .snapshot import Snapshot, is_there, materials_of, read_again, walk

# Blender looks each of them up by its name.
_Collection, _Scene, _Object = bpy.types.Collection, bpy.types.Scene, bpy.types.Object


class _Latest:
    """The last snapshot, and what Blender has evaluated since."""

    def __init__(self) -> None:
        self.snapshot: Snapshot | None = None
        #: Objects to be read again; True where more than their pose has changed.
        self.changed: dict[Any, bool] = {}
        #: Objects that may have other materials.
        self.shaded: set[Any] = set()
        self.layout_changed = self.scene_changed = self.evaluated = False

    def note(self, depsgraph: Any) -> None:
        """Note what Blender has just evaluated."""
        if self.snapshot is None or self.snapshot.depsgraph != depsgraph:
            return
        layout = self.snapshot.layout
        for update in depsgraph.updates:
            self.evaluated = True
            evaluated = update.id
            if isinstance(evaluated, _Collection):
                self.layout_changed = True
            elif isinstance(evaluated, _Scene):  # a setting, or what is hidden
                self.scene_changed = True
            elif isinstance(evaluated, _Object):
                item = evaluated.original
                geometry, there = update.is_updated_geometry, item in layout.row_of
                # A change of the scene reports all its objects, as shaded again.
                if geometry or update.is_updated_transform:
                    self.layout_changed |= item in layout.instanced
                    if there:
                        self.changed[item] = geometry or self.changed.get(item, False)
                if update.is_updated_shading:
                    self.shaded.add(item)
                self.scene_changed |= item in layout.instanced or not there

    def take(self, depsgraph: Any) -> Snapshot:
        """Return the snapshot of now."""
        last = self.snapshot
        followed = follow_evaluations()
        if last is not None and last.depsgraph == depsgraph and followed:
            try:
                last = self._brought_up_to_date(last)
            except ReferenceError:  # an object was removed
                last = walk(depsgraph)
        else:
            last = walk(depsgraph)
        self.snapshot, self.changed, self.shaded = last, {}, set()
        self.layout_changed = self.scene_changed = self.evaluated = False
        return last

    def _brought_up_to_date(self, last: Snapshot) -> Snapshot:
        if not self.evaluated:
            return last
        for shape in last.shapes if self.shaded else ():
            if shape.own and shape.original in self.shaded:
                shape.materials = materials_of(shape.original.evaluated_get(last.depsgraph))
        moved = self.scene_changed and not is_there(last.layout, last.depsgraph)
        if self.layout_changed or moved:
            return walk(last.depsgraph, last, self.changed)
        return read_again(last, self.changed)

    def forget(self) -> None:
        """Drop the snapshot."""
        self.snapshot = None


_latest = _Latest()


_watchers: list[Callable[[Any], None]] = []


def watch_evaluations(function: Callable[[Any], None]) -> Callable[[], None]:
    """Have a function called after each evaluation of Blender.

    Parameters
    ----------
    function
        Is given the depsgraph, or None where evaluations may have been missed.

    Returns
    -------
    callable
        Ends it; may be called again.
    """
    follow_evaluations()
    _watchers.append(function)

    def stop() -> None:
        if function in _watchers:
            _watchers.remove(function)

    return stop


@persistent
def _note_evaluation(_scene: Any, depsgraph: Any) -> None:
    _latest.note(depsgraph)
    for function in _watchers:
        function(depsgraph)


@persistent
def _forget(*_: Any) -> None:
    _latest.forget()


def follow_evaluations() -> bool:
    """Have Blender report evaluations.

    Returns
    -------
    bool
        Whether it did so before.
    """
    missing = [(hooks, function) for hooks, function in _reports() if function not in hooks]
    for hooks, function in missing:
        hooks.append(function)
    for watcher in _watchers if missing else ():
        watcher(None)
    return not missing


def ignore_evaluations() -> None:
    """Have Blender report evaluations no longer, until the next snapshot is taken."""
    for hooks, function in _reports():
        if function in hooks:
            hooks.remove(function)
    _latest.forget()


def read_all_again() -> None:
    """Have Blender evaluate all data again, and the next snapshot read all of it."""
    for name in dir(bpy.data):
        items = getattr(bpy.data, name)
        if isinstance(items, bpy.types.bpy_prop_collection):
            for item in items:
                item.update_tag()
                tree = getattr(item, "node_tree", None)
                if tree is not None:
                    tree.update_tag()
    _latest.forget()


def _reports() -> tuple[tuple[Any, Any], ...]:
    """Lists of handlers, and what belongs into each."""
    handlers = bpy.app.handlers
    return (
        (handlers.depsgraph_update_post, _note_evaluation),
        (handlers.frame_change_post, _note_evaluation),
        (handlers.load_pre, _forget),
        (handlers.undo_pre, _forget),
        (handlers.redo_pre, _forget),
    )


def take_snapshot(depsgraph: Any) -> Snapshot:
    """Return all objects and instances of a depsgraph.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.

    Returns
    -------
    Snapshot
        The same one until Blender evaluates something else.
    """
    return _latest.take(depsgraph)
