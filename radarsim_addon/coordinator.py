# SPDX-License-Identifier: GPL-3.0-or-later
"""A command whose frames are done by workers: processes of this machine, or a Dask cluster.

`run_frames` takes the words of a command and the numbers of frames, shows progress and findings,
and gives each frame's answer (plain JSON) in the order of completion. What a frame is, and how it
is done, does not matter here (see `frame_worker`).

`LocalWorkers` are processes of this machine. They read frames from standard input and answer in
JSON lines. A worker that loses its coordinator reads the end of its input: it ends after its frame.
`DaskWorkers` are those of a Dask cluster, whose own requeueing of lost tasks is used; each keeps
the run open between its frames. `scheduled` gives frames that fail or whose worker is lost out
again.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import queue
import secrets
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Protocol, TextIO, TypeAlias

from . import errors
from .errors import ConfigError, MissingDependencyError, WorkerError
from .findings import Finding, finding_lines, from_json, merge
from .options import Share
from .terminal import ProgressLine, printable

#: Errors of a frame after which it is set aside.
MAX_FAILURES = 3
#: Workers that a frame may lose in a row. Nobody kills ten by accident: it crashes them.
_MAX_LOST = 10
#: Answer of a worker, plain JSON; "error" and "message" where it failed, "held" where another
#: process has the frame.
Reply: TypeAlias = dict[str, Any]


class Workers(Protocol):
    """Workers that do one frame at a time each."""

    def free(self) -> int:
        """Return how many frames more may be given out."""

    def submit(self, frame: int) -> None:
        """Give out a frame."""

    def wait(self) -> list[tuple[int, Reply | None]]:
        """Wait for answers; None where the frame's worker was lost."""


def scheduled(workers: Workers, frames: Iterable[int]) -> Generator[Reply, None, dict[int, str]]:
    """Give out all frames and yield the answers. Return the frames that were set aside, with the
    reason.

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


#: What makes the libraries of a worker use one thread.
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
#: Time that a worker has to end its step when it is asked to stop [s].
_GRACE_S = 60.0
_MAX_STARTS = 10


class _Child:
    """A worker process. `frame` is the frame that it does now, or None for the run as a whole."""

    def __init__(self, command: Sequence[str], replies: queue.Queue[tuple[_Child, str]]) -> None:
        package_parent = str(Path(__file__).resolve().parents[1])
        paths = [package_parent, *filter(None, [os.environ.get("PYTHONPATH")])]
        self._log: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            env=os.environ | _ONE_THREAD | {"PYTHONPATH": os.pathsep.join(paths)},
            start_new_session=True,  # Ctrl-C goes to the coordinator alone
        )
        self.frame: int | None = None
        self.busy = self.answered = False
        threading.Thread(target=self._read, args=(replies,), daemon=True).start()

    def _read(self, replies: queue.Queue[tuple[_Child, str]]) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if line.startswith(b"{"):  # else Blender's own words
                replies.put((self, line.decode()))
        self.process.wait()
        replies.put((self, ""))

    def ask(self, frame: int | None) -> None:
        """Send a frame to the worker. None: it answers with a description of the run."""
        self.frame, self.busy = frame, True
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):  # killed meanwhile: its output ends, too
            self.process.stdin.write(json.dumps(frame).encode() + b"\n")
            self.process.stdin.flush()

    def dismiss(self, stop: bool) -> None:
        """Let it end after its frame; `stop`: after its step."""
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):
            self.process.stdin.close()
        if stop:
            self.process.terminate()

    def last_words(self) -> str:
        """Return the end of its standard error."""
        self._log.seek(max(0, self._log.seek(0, os.SEEK_END) - 2000))
        return self._log.read().decode(errors="replace").strip()

    def close(self) -> None:
        """See it end, if need be by force."""
        try:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(_GRACE_S)
        finally:
            self.process.kill()
            self._log.close()


class LocalWorkers:
    """`count` processes of `command`; who is lost is replaced when there is a frame for it."""

    def __init__(self, command: Sequence[str], count: int) -> None:
        self._command, self._count = command, count
        self._children: list[_Child] = []
        self._replies: queue.Queue[tuple[_Child, str]] = queue.Queue()

    def open(self) -> Reply:
        """Start the workers. Return the description of the run that one of them gives.

        The others load their modules meanwhile.
        """
        for _ in range(_MAX_STARTS):
            asked = self._idle()
            asked.ask(None)
            while len(self._children) < self._count:
                self._children.append(_Child(self._command, self._replies))
            child, reply = self._next()
            while child is not asked:  # killed while it had nothing to do
                child, reply = self._next()
            child.busy = False
            if reply is not None:
                return reply
        raise WorkerError(f"{_MAX_STARTS} worker processes were killed before they answered.")

    def free(self) -> int:
        return self._count - sum(child.busy for child in self._children)

    def submit(self, frame: int) -> None:
        self._idle().ask(frame)

    def wait(self) -> list[tuple[int, Reply | None]]:
        child, reply = self._next()
        busy, child.busy = child.busy, False
        # else killed while it had nothing to do
        return [(child.frame, reply)] if busy and child.frame is not None else []

    def _next(self) -> tuple[_Child, Reply | None]:
        """Return the next answer; None where its worker ended without one."""
        child, line = self._replies.get()
        if line:
            child.answered = True
            return child, json.loads(line)
        self._children.remove(child)
        words = child.last_words()
        child.close()
        code = child.process.returncode
        if not child.answered and code >= 0:  # it ended by itself, as the next one would
            raise WorkerError(
                f"A worker process ended with exit code {code} before it began. {words}\n"
                "Run the same command without --workers to see why."
            )
        return child, None

    def close(self, stop: bool) -> None:
        """End all workers after their frames; `stop`: after the step that they are doing."""
        for child in self._children:
            child.dismiss(stop)
        try:
            for child in self._children:
                child.close()
        finally:
            for child in self._children:
                child.process.kill()
            self._children.clear()

    def _idle(self) -> _Child:
        for child in self._children:
            if not child.busy:
                return child
        self._children.append(_Child(self._command, self._replies))
        return self._children[-1]

    def __enter__(self) -> LocalWorkers:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close(stop=kind is not None)


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
        """Return the description of the run that one of the workers gives.

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
        """Wait until a condition holds. WorkerError: the cluster has no worker for too long."""
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
        future = self._client.submit(do_frame, *self._task, frame, pure=False)
        self._frames[future] = frame
        self._answers.add(future)

    def wait(self) -> list[tuple[int, Reply | None]]:
        self._wait_for(self._answers.has_ready)
        batch = self._answers.next_batch(block=True)
        return [(self._frames.pop(future), self._reply(future)) for future in batch]

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


#: Module of the package that does a frame, and that a worker process runs.
_WORKER_MODULE = f"{__package__}.frame_worker"
#: Findings that are kept apart; more become one for each code.
_MAX_FINDINGS = 1000


def run_frames(
    words: Sequence[str],
    share: Share,
    stream: TextIO,
    show: Callable[[Reply], None] = lambda reply: None,
    command: Sequence[str] | None = None,
    about: Reply | None = None,
) -> Reply:
    """Do all frames of a command line by workers. Return the description of the run.

    `show` is called with each answer. `command` starts a worker process of this machine; None: by
    Python. `about` has "frames", all that the command line names; None: the first worker is asked
    before the others begin. WorkerError after the last frame, where some were set aside.
    """
    folder = os.getcwd()
    local = command or [sys.executable, "-m", _WORKER_MODULE, folder, *words]
    with ExitStack() as stack:
        stack.enter_context(stop_signals())
        workers: LocalWorkers | DaskWorkers
        if share.dask is not None:
            workers = DaskWorkers(share.dask, _WORKER_MODULE, folder, words)
        else:
            workers = LocalWorkers(local, share.workers or 1)
        stack.enter_context(workers)
        about = workers.open() if about is None else about
        if "error" in about:
            raise as_error(about)
        for line in about.get("lines", ()):
            print(f"radarsim: {line}", file=stream, flush=True)
        frames = share.part(about["frames"])
        _Count(frames, stream, show).run(scheduled(workers, frames))
    return about


class Interrupted(KeyboardInterrupt):
    """Ctrl-C or SIGTERM, with the exit code that shells give it."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.exit_code = 128 + number


@contextlib.contextmanager
def stop_signals() -> Iterator[None]:
    """Raise `Interrupted` at Ctrl-C, SIGTERM and, where there is one, at a closed terminal."""

    def interrupt(number: int, _: object) -> None:
        raise Interrupted(number)

    names = [name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {name: signal.signal(getattr(signal, name), interrupt) for name in names}
    if hasattr(signal, "SIGPIPE"):  # Blender's Python does not ignore it, and workers may end
        before["SIGPIPE"] = signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    try:
        yield
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)


class _Count:
    """Counts answers, shows how far they are, and keeps findings and frames set aside."""

    def __init__(
        self, frames: Sequence[int], stream: TextIO, show: Callable[[Reply], None]
    ) -> None:
        self._frames, self._stream, self._show = frames, stream, show
        self._progress = ProgressLine(stream, "frames")
        self._findings: list[Finding] = []
        self._done = self._new = 0
        self._aside: dict[int, str] = {}

    def run(self, replies: Iterable[Reply]) -> None:
        """Take all answers; WorkerError in the end where frames were set aside."""
        start_s = time.monotonic()
        self._progress.show(0, len(self._frames), None)
        try:
            for reply in replies:
                self._take(reply)
                left = len(self._frames) - self._done
                pace_s = (time.monotonic() - start_s) / self._new if self._new else None
                left_s = None if pace_s is None else pace_s * left
                self._progress.show(self._done, len(self._frames), left_s)
        finally:  # of the frames that are done, whatever ended the run
            for line in finding_lines(self._findings, self._frames):
                print(f"radarsim: {line}", file=self._stream, flush=True)
        if self._aside:
            reasons = "".join(
                f"\n  frame {frame}: {printable(reason.strip().splitlines()[-1])}"
                for frame, reason in sorted(self._aside.items())
            )
            raise WorkerError(
                f"{len(self._aside)} of {len(self._frames)} frames failed {MAX_FAILURES} times and "
                "were set aside; the others are done. Correct what is said here and give the same "
                f"command again, which does these alone:{reasons}"
            )

    def _take(self, reply: Reply) -> None:
        self._done += 1
        self._new += not reply.get("earlier")
        if "set_aside" in reply:
            self._aside[reply["frame"]] = str(reply["set_aside"])
            return
        where = f"the answer of frame {reply['frame']}"
        self._findings += [from_json(item, where) for item in reply.get("findings", ())]
        if len(self._findings) > _MAX_FINDINGS:
            self._findings = merge(self._findings)
        self._show(reply)
