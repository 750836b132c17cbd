# SPDX-License-Identifier: GPL-3.0-or-later
"""Calls that are made in a thread of their own, while Cycles renders. Does not import bpy."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

#: Calls that wait besides the one that is made: what they hold is in memory.
_WAITING = 1


class Background:
    """Makes calls one after the other; they must not use Blender.

    The error of a call is raised by a later `do` or `wait`. Calls after it are not made. Without
    `threaded`, `do` makes each call itself.
    """

    def __init__(self, threaded: bool) -> None:
        self._threaded = threaded
        self._pool: ThreadPoolExecutor | None = None
        self._calls: deque[Future[None]] = deque()
        self._failed = False

    def do(self, call: Callable[..., None], *arguments: Any) -> None:
        """Make a call soon."""
        if not self._threaded:
            call(*arguments)
            return
        while len(self._calls) > _WAITING:
            self._calls.popleft().result()
        if self._pool is None:
            self._pool = ThreadPoolExecutor(1, "radarsim rows")
        self._calls.append(self._pool.submit(self._make, call, arguments))

    def _make(self, call: Callable[..., None], arguments: tuple[Any, ...]) -> None:
        if self._failed:
            return
        try:
            call(*arguments)
        except BaseException:
            self._failed = True
            raise

    def wait(self) -> None:
        """Return when all calls have been made."""
        while self._calls:
            self._calls.popleft().result()

    def end(self) -> None:
        """Make the calls that wait, and end the thread; errors are not raised."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None
        self._calls.clear()
