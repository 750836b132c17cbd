# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes to the user's scene that are recorded and taken back. Does not import bpy.

The last change is taken back first, because a Blender setting can limit another one: the media type
limits the file format, and the file format limits the colour depth.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import bpy

_ABSENT = object()
#: Path from a struct to one in it: names of attributes, and indices in collections.
_Path = tuple[str | int, ...]
#: Times that settings which limit one another are set: media type, format, depth, codec.
_PASSES = 4


class SettingsRestorer:
    """Sets values and restores all of them.

    A change that cannot be taken back, for example of an object that the user has removed, does
    not affect the others.
    """

    def __init__(self) -> None:
        self._undo: list[tuple[str, Callable[[], None]]] = []

    def set(self, owner: Any, name: str, value: Any) -> bool:
        """Set an attribute and record its former value, if they differ; return whether they do.

        Raises AttributeError, TypeError or ValueError if the owner has no such setting or does not
        accept the value. Nothing is recorded then.
        """
        before = _plain(getattr(owner, name))
        if before == value:
            return False
        setattr(owner, name, value)
        self._undo.append((name, lambda: setattr(owner, name, before)))
        return True

    def set_if_present(self, owner: Any, name: str, value: Any) -> None:
        """Set an attribute that only some Blender versions have."""
        if hasattr(owner, name):
            self.set(owner, name, value)

    def set_item(self, owner: Any, key: str, value: Any) -> None:
        """Set a custom property, ``owner[key] = value``; `restore` removes it if it was absent."""
        before = owner.get(key, _ABSENT)
        owner[key] = value

        def undo() -> None:
            if before is _ABSENT:
                if key in owner:
                    del owner[key]
            else:
                owner[key] = before

        self._undo.append((key, undo))

    def keep(self, owner: Any, *names: str) -> None:
        """Record settings that change from render to render, so that `restore` brings them back."""
        for name in names:
            before = _plain(getattr(owner, name))
            self._undo.append((name, partial(setattr, owner, name, before)))

    def keep_frame(self, scene: bpy.types.Scene) -> None:
        """Record the current frame, so that `restore` brings the scene back to it."""
        # Before frame 0 Blender's subframe is negative, and frame_set takes none that is.
        now = scene.frame_current + scene.frame_subframe
        whole = math.floor(now)
        self.on_restore("frame", lambda: scene.frame_set(whole, subframe=now - whole))

    def keep_all(self, owner: Any) -> None:
        """Record all settings of a struct and of the structs in it, so that `restore` brings them
        back.

        This is for structs in which one setting can change others.
        """
        before = list(_settings_of(owner))

        def undo() -> None:
            # Each struct is looked up again: some settings free the structs of others and make new
            # ones, and a kept reference would then be to freed memory.
            for _ in range(_PASSES):
                for path, name, value in before:
                    struct = _struct_at(owner, path)
                    if struct is not None and _read(struct, name) != value:
                        with contextlib.suppress(TypeError):  # not allowed yet
                            _write(struct, name, value)
                            if name == "points":
                                _struct_at(owner, path[:-2]).update()
            after = {(path, name): value for path, name, value in _settings_of(owner)}
            lost = [name for path, name, value in before if after.get((path, name)) != value]
            if lost:
                raise ValueError(f"{', '.join(lost)} cannot be set as before")

        self.on_restore(type(owner).__name__, undo)

    def on_restore(self, name: str, undo: Callable[[], None]) -> None:
        """Add a function that takes another change back, with the name of the change
        for messages.
        """
        self._undo.append((name, undo))

    def restore(self) -> list[str]:
        """Take all changes back, last one first; return a line for each that could not be restored.

        A second call does nothing.
        """
        failures = []
        while self._undo:
            name, undo = self._undo.pop()
            try:
                undo()
            # Blender raises ReferenceError for removed data, and several others for invalid values.
            # None of them may prevent the restoration of other settings.
            except Exception as error:
                failures.append(f"{name}: {error}")
        return failures


def _settings_of(owner: Any, path: _Path = ()) -> Iterator[tuple[_Path, str, Any]]:
    """Yield path, name and value of every setting of a struct and of the structs in it."""
    for item in owner.bl_rna.properties:
        value = getattr(owner, item.identifier)
        here = (*path, item.identifier)
        if item.type == "POINTER":
            if value is not None and item.identifier != "rna_type":
                yield from _settings_of(value, here)
        elif item.type == "COLLECTION":
            if item.identifier == "points":
                yield path, item.identifier, _read(owner, item.identifier)
            else:
                for index, part in enumerate(value):
                    yield from _settings_of(part, (*here, index))
        elif not item.is_readonly and value != "":
            # an enumeration that reads "" is unset, and cannot be set so
            yield path, item.identifier, _plain(value)


def _struct_at(owner: Any, path: _Path) -> Any:
    """Return the struct at a path, or None if there is none now."""
    for step in path:
        owner = getattr(owner, step) if isinstance(step, str) else owner[step]
        if owner is None:
            return None
    return owner


def _read(struct: Any, name: str) -> Any:
    """Return the value of a setting. For the points of a curve: location, handle type and selection
    of each.
    """
    value = getattr(struct, name)
    if name != "points":
        return _plain(value)
    return tuple((tuple(point.location), point.handle_type, point.select) for point in value)


def _write(struct: Any, name: str, value: Any) -> None:
    """Set a setting. The points of a curve first get their former number."""
    if name != "points":
        setattr(struct, name, value)
        return
    points = struct.points
    while len(points) > max(len(value), 2):  # a curve has two or more
        points.remove(points[-2])
    while len(points) < len(value):
        points.new(1.0, 1.0)
    for point, (location, handle, selected) in zip(points, value, strict=True):
        point.location, point.handle_type, point.select = location, handle, selected


def _plain(value: Any) -> Any:
    """Return a copy of a Blender array (colour, vector), which would follow later changes."""
    if isinstance(value, str | bytes | set) or not hasattr(value, "__len__"):
        return value
    return tuple(value)
