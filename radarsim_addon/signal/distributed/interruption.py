# SPDX-License-Identifier: GPL-3.0-or-later
"""Ctrl-C and SIGTERM while workers are at work."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from typing import Any


class Interrupted(KeyboardInterrupt):
    """Ctrl-C or SIGTERM, with the exit code that shells give it."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.exit_code = 128 + number


@contextlib.contextmanager
def stop_signals() -> Iterator[None]:
    """Raise `Interrupted` at Ctrl-C, SIGTERM and, where there is one, at a closed terminal."""

    def interrupt(number: int, _: Any) -> None:
        raise Interrupted(number)

    names = [name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {name: signal.signal(getattr(signal, name), interrupt) for name in names}
    try:
        yield
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)
