# SPDX-License-Identifier: GPL-3.0-or-later
"""Workers of a Dask cluster. Its own requeueing of lost tasks is used; see `schedule` for the rest.

Each worker process keeps the run open between its frames, and does one frame at a time.
"""

from __future__ import annotations

import contextlib
import importlib
import secrets
import threading
import time
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any

from ...errors import ConfigError, MissingDependencyError, WorkerError
from .schedule import Reply

#: Frames under way per thread of the cluster: the next one is there when one ends.
_DEPTH = 2
_TIMEOUT_S = 30.0
#: Time without any worker after which the run ends: batch systems start workers late [s].
_PATIENCE_S = 300.0
#: Time between two looks for answers [s].
_POLL_S = 0.01
_LOCK = threading.Lock()


def do_frame(
    module: str, folder: str, words: Sequence[str], command: str, frame: int | None
) -> Reply:
    """Do a frame in this process of the cluster: `module` has a function `run_frame`."""
    with _LOCK:
        reply: Reply = importlib.import_module(module).run_frame(folder, words, frame, command)
        return reply


class DaskWorkers:
    """Workers of the cluster whose scheduler has an address, such as ``tcp://head:8786``."""

    def __init__(self, address: str, module: str, folder: str, words: Sequence[str]) -> None:
        try:
            self._dask: Any = importlib.import_module("distributed")
        except ModuleNotFoundError as error:
            raise MissingDependencyError(
                f"Dask cannot be imported ({error}). Install it with pip install 'radarsim[dask]'."
            ) from error
        # A worker process outlives the command: the next call must not find its run open.
        self._task = (module, folder, tuple(words), secrets.token_hex(8))
        try:
            self._client = self._dask.Client(address, timeout=_TIMEOUT_S, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise ConfigError(
                f"No Dask scheduler answers at {address!r} ({error}). Start one with dask "
                "scheduler, and give the address that it prints."
            ) from error
        self._frames: dict[Any, int] = {}
        self._answers = self._dask.as_completed(loop=self._client.loop, raise_errors=False)
        self._address, self._slots = address, 0
        self._counted_s, self._seen_s = -float("inf"), time.monotonic()

    def open(self) -> Reply:
        """Return what one of the workers answers about the run.

        Dask gives it to the next worker where one ends without an answer.
        """
        future = self._client.submit(do_frame, *self._task, None, pure=False)
        self._wait_for(future.done)
        reply = self._reply(future)
        if reply is None:
            last = getattr(getattr(future.exception(), "last_worker", None), "address", "unknown")
            raise WorkerError(
                f"Workers of the Dask cluster at {self._address!r} ended while they opened the "
                f"run; the last one was {last}. Look into its log, or run the same command without "
                "--dask to see why."
            )
        return reply

    def free(self) -> int:
        """Return how many frames more may be given out."""
        self._count()
        return max(1, self._slots) - len(self._frames)

    def _count(self) -> None:
        """Count the threads of the cluster, once a second: workers come and go."""
        now_s = time.monotonic()
        if now_s > self._counted_s + 1.0:
            with contextlib.suppress(OSError, TimeoutError):  # of a scheduler that is gone
                self._slots = _DEPTH * sum(self._client.nthreads().values())
            self._counted_s = now_s
            if self._slots:
                self._seen_s = now_s

    def _wait_for(self, ready: Callable[[], bool]) -> None:
        """Wait; WorkerError where the cluster has no worker for too long."""
        while not ready():
            time.sleep(_POLL_S)
            self._count()
            if time.monotonic() > self._seen_s + _PATIENCE_S:
                raise WorkerError(
                    f"The Dask cluster at {self._address!r} had no worker for {_PATIENCE_S:g} s. "
                    "The frames that are done are whole: start workers with dask worker, look into "
                    "the logs of those that ended, and give the same command again."
                )

    def submit(self, frame: int) -> None:
        """Give out a frame."""
        future = self._client.submit(do_frame, *self._task, frame, pure=False)
        self._frames[future] = frame
        self._answers.add(future)

    def wait(self) -> list[tuple[int, Reply | None]]:
        """Wait for answers; None where the frame's workers were lost."""
        return [(self._frames.pop(future), self._reply(future)) for future in self._batch()]

    def _batch(self) -> list[Any]:
        self._wait_for(self._answers.has_ready)
        found: list[Any] = self._answers.next_batch(block=True)
        return found

    def _reply(self, future: Any) -> Reply | None:
        if future.status == "finished":
            reply: Reply = future.result()
            return reply
        error = future.exception() if future.status == "error" else None
        if error is None or isinstance(error, self._dask.KilledWorker):
            if self._client.status != "running":
                raise WorkerError(
                    "The Dask scheduler has gone. The frames that are done are whole: start it "
                    "again, and give the same command to resume the run."
                )
            return None
        return {"error": type(error).__name__, "message": str(error)}

    def __enter__(self) -> DaskWorkers:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._client.cancel(list(self._frames))
        self._client.close()
