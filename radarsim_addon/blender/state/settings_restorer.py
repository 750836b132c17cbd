# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes to the user's scene that are recorded and taken back. Does not import bpy.

The last change is taken back first, because a Blender setting can limit another one: the media type
limits the file format, and the file format limits the colour depth.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

_ABSENT = object()


class SettingsRestorer:
    """Sets values and restores all of them.

    A change that cannot be taken back, for example of an object that the user has removed, does
    not affect the others.
    """

    def __init__(self) -> None:
        self._undo: list[tuple[str, Callable[[], None]]] = []

    def set(self, owner: Any, name: str, value: Any) -> None:
        """Set an attribute and record its former value, if they differ.

        Parameters
        ----------
        owner : bpy.types.bpy_struct
        name, value
            Attribute and new value.

        Raises
        ------
        AttributeError, TypeError, ValueError
            The owner has no such setting, or does not accept the value. Nothing is recorded then.
        """
        before = _plain(getattr(owner, name))
        if before == value:
            return
        setattr(owner, name, value)
        self._undo.append((name, lambda: setattr(owner, name, before)))

    def set_if_present(self, owner: Any, name: str, value: Any) -> None:
        """Set an attribute that only some Blender versions have; parameters as `set`."""
        if hasattr(owner, name):
            self.set(owner, name, value)

    def set_item(self, owner: Any, key: str, value: Any) -> None:
        """Set a custom property, ``owner[key] = value``; `restore` removes it if it was absent.

        Parameters
        ----------
        owner : bpy.types.ID
        key, value
            As above.
        """
        before = owner.get(key, _ABSENT)
        owner[key] = value

        def undo() -> None:
            if before is _ABSENT:
                if key in owner:
                    del owner[key]
            else:
                owner[key] = before

        self._undo.append((key, undo))

    def on_restore(self, name: str, undo: Callable[[], None]) -> None:
        """Add a step that takes another change back.

        Parameters
        ----------
        name
            Name of the change, for messages.
        undo
            Takes it back.
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


def _plain(value: Any) -> Any:
    """Return a copy of a Blender array (colour, vector), which would follow later changes."""
    if isinstance(value, str | bytes | set) or not hasattr(value, "__len__"):
        return value
    return tuple(value)
