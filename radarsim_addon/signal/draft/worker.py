# SPDX-License-Identifier: GPL-3.0-or-later
"""The process that drafts for the window.

    python -m radarsim_addon.signal.draft.worker

reads meshes and scenes as messages from standard input and writes drafts of the newest scene to
standard output: coarse, then finer ones until the next scene comes. It ends with its input.
"""

from __future__ import annotations

import queue
import threading
import time
from typing import IO

from ...errors import RadarSimError
from ...messages import Message, open_messages, read_message, write_message
from ..scene import Mesh
from .draft import (
    FAULT,
    LEVELS,
    MESH,
    draft_message,
    make_draft,
    mesh_of,
    scene_of,
)
from .scene import DraftScene

#: Time without a newer scene after which a finer draft begins [s].
_CALM_S = 0.2
#: Time between two looks for it [s].
_LOOK_S = 0.005


class _Inbox:
    """Messages as they come: meshes are kept, and of scenes the newest one."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._messages: queue.SimpleQueue[Message | None] = queue.SimpleQueue()
        self.meshes: dict[int, Mesh] = {}
        threading.Thread(target=self._read, args=(stream,), daemon=True).start()

    def _read(self, stream: IO[bytes]) -> None:
        while (message := read_message(stream)) is not None:
            self._messages.put(message)
        self._messages.put(None)

    def has_news(self, timeout_s: float = 0.0) -> bool:
        """Return whether a message has arrived, or arrives within a time."""
        end_s = time.monotonic() + timeout_s
        while self._messages.empty() and time.monotonic() < end_s:
            time.sleep(_LOOK_S)
        return not self._messages.empty()

    def newest_scene(self) -> Message | None:
        """Wait for a scene; return the newest one, or None at the end of the input."""
        newest = None
        while newest is None or not self._messages.empty():
            message = self._messages.get()
            if message is None:
                return None
            if message.fields["kind"] == MESH:
                self.meshes[message.fields["key"]] = mesh_of(message)
            else:
                newest = message
        used = set(newest.fields["meshes"])
        self.meshes = {key: mesh for key, mesh in self.meshes.items() if key in used}
        return newest


def serve(reading: IO[bytes], writing: IO[bytes]) -> None:
    """Draft scenes until the input ends."""
    inbox = _Inbox(reading)
    while (message := inbox.newest_scene()) is not None:
        number = message.fields["number"]
        try:
            _draft(scene_of(message), number, inbox, writing)
        except RadarSimError as error:
            write_message(writing, {"kind": FAULT, "number": number, "text": str(error)}, {})


def _draft(scene: DraftScene, number: int, inbox: _Inbox, writing: IO[bytes]) -> None:
    """Write drafts of a scene, each finer than the one before, until a newer scene arrives."""
    triangles = sum(len(inbox.meshes[key].triangles) for key in scene.meshes)
    for index, level in enumerate(LEVELS):
        draft = make_draft(scene, inbox.meshes, level)
        fields, arrays = draft_message(draft, index, triangles)
        write_message(writing, {**fields, "number": number}, arrays)
        # while the scene changes, the window answers to each draft with the next scene
        if inbox.has_news(_CALM_S):
            return


if __name__ == "__main__":
    serve(*open_messages())
