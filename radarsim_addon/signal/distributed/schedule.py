# SPDX-License-Identifier: GPL-3.0-or-later
"""Which frame is done when, and what happens to frames that fail or whose worker is lost."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Generator, Iterable
from typing import Any, Protocol, TypeAlias

from ... import errors

MAX_FAILURES = 3
"""Errors of a frame after which it is set aside."""
#: Workers that a frame may lose in a row. Nobody kills ten by accident: it crashes them.
_MAX_LOST = 10

Reply: TypeAlias = dict[str, Any]
"""Answer of a worker, plain JSON; "error" and "message" where it failed, "held" where another
process has the frame."""


class Workers(Protocol):
    """Workers that do one frame at a time each."""

    def free(self) -> int:
        """Return how many frames more may be given out."""

    def submit(self, frame: int) -> None:
        """Give out a frame."""

    def wait(self) -> list[tuple[int, Reply | None]]:
        """Wait for answers; None where the frame's worker was lost."""


def scheduled(workers: Workers, frames: Iterable[int]) -> Generator[Reply, None, dict[int, str]]:
    """Have all frames done; yield the answers, return those that were set aside with the reason.

    A frame whose worker was lost, or that another process holds, comes again after the others. Its
    own errors are counted. OutputError: the output folder cannot be used, which no frame can help.
    """
    waiting, running = deque(frames), 0
    failures, lost = Counter[int](), Counter[int]()
    set_aside: dict[int, str] = {}
    while waiting or running:
        while waiting and workers.free() > 0:
            workers.submit(waiting.popleft())
            running += 1
        for frame, reply in workers.wait():
            running -= 1
            reason = None
            if reply is None:
                lost[frame] += 1
                if lost[frame] >= _MAX_LOST:
                    reason = f"its worker ended {_MAX_LOST} times without an answer"
            elif "error" in reply:
                if reply["error"] == errors.OutputError.__name__:
                    raise as_error(reply)
                failures[frame] += 1
                if failures[frame] >= MAX_FAILURES:
                    reason = f"{reply['error']}: {reply['message']}"
            elif not reply.get("held"):
                lost[frame] = 0
                yield reply
                continue
            if reason is None:
                waiting.append(frame)
            else:
                set_aside[frame] = reason
                yield {"frame": frame, "set_aside": reason}
    return set_aside


def as_error(reply: Reply) -> errors.RadarSimError:
    """Return the named error that a worker answered."""
    kind = getattr(errors, str(reply["error"]), None)
    if isinstance(kind, type) and issubclass(kind, errors.RadarSimError):
        return kind(str(reply["message"]))
    return errors.WorkerError(f"A worker failed, {reply['error']}: {reply['message']}")
