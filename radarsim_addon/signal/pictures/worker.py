# SPDX-License-Identifier: GPL-3.0-or-later
"""The process that draws pictures of frames for the window.

    python -m radarsim_addon.signal.pictures.worker

reads requests as messages from standard input and answers each with a PNG file and the place of its
axes. Of requests for the same place that wait, only the last one is drawn. It ends with its input.
"""

from __future__ import annotations

import importlib
import queue
import threading
from typing import IO

from ...messages import Message, open_messages, read_message, write_message
from .view_pictures import answer_request


def serve(reading: IO[bytes], writing: IO[bytes]) -> None:
    """Answer requests until the input ends. A later request with the same `place` replaces a
    waiting one.
    """
    requests: queue.SimpleQueue[Message | None] = queue.SimpleQueue()

    def read() -> None:
        while (message := read_message(reading)) is not None:
            requests.put(message)
        requests.put(None)

    threading.Thread(target=read, daemon=True).start()
    importlib.import_module("matplotlib.figure")  # slow: before the first request
    waiting: dict[str, Message] = {}
    ended = False
    while not ended or waiting:
        while not ended and (not waiting or not requests.empty()):
            message = requests.get()
            if message is None:
                ended = True
                break
            late = waiting.pop(message.fields["place"], None)
            if late is not None:
                write_message(writing, {"number": late.fields["number"], "late": True}, {})
            waiting[message.fields["place"]] = message
        if waiting:
            write_message(writing, *answer_request(waiting.pop(next(iter(waiting)))))


if __name__ == "__main__":
    serve(*open_messages())
