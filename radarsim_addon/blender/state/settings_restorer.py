# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes to the user's scene that are remembered and taken back, last one first. No bpy needed.

The order matters: a Blender setting may limit what another one accepts (the media type limits the
file format, the file format limits the colour depth), so values go back in the reverse order of
their setting.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

_ABSENT = object()


class SettingsRestorer:
    """Sets values and restores all of them.

    Every change is undone even if undoing another one fails (an object that the user removed
    meanwhile); `restore` returns what could not be put back.
    """

    def __init__(self) -> None:
        self._undo: list[tuple[str, Callable[[], None]]] = []

    def set(self, owner: Any, name: str, value: Any) -> None:
        """Set an attribute, remembering the value it has now. Equal values are left alone.

        Raises
        ------
        AttributeError, TypeError, ValueError
            The owner has no such setting, or refuses the value. Nothing is recorded then.
        """
        before = _plain(getattr(owner, name))
        if before == value:
            return
        setattr(owner, name, value)
        self._undo.append((name, lambda: setattr(owner, name, before)))

    def set_if_present(self, owner: Any, name: str, value: Any) -> None:
        """Like `set`, for settings that only some Blender versions have."""
        if hasattr(owner, name):
            self.set(owner, name, value)

    def set_item(self, owner: Any, key: str, value: Any) -> None:
        """Set a custom property ``owner[key]``; absent ones are removed again on restore."""
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
        """Add any other step that takes a change back."""
        self._undo.append((name, undo))

    def restore(self) -> list[str]:
        """Take all changes back, last one first. May be called again; then it does nothing.

        Returns
        -------
        list of str
            One line for each setting that could not be restored.
        """
        failures = []
        while self._undo:
            name, undo = self._undo.pop()
            try:
                undo()
            # Blender raises ReferenceError for removed data, and several others for refused values;
            # one of them must not keep the remaining settings from being restored.
            except Exception as error:
                failures.append(f"{name}: {error}")
        return failures


def _plain(value: Any) -> Any:
    """Copy of a Blender array (colour, vector), which would otherwise follow later changes."""
    if isinstance(value, str | bytes | set) or not hasattr(value, "__len__"):
        return value
    return tuple(value)
