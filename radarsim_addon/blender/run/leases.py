# SPDX-License-Identifier: GPL-3.0-or-later
"""Leases: which process works on which part of a run's folder. Does not import bpy.

A lease is a file that exactly one process can create. Its owner renews it every 10 s; one that was
not renewed for 60 s, by the clock of the file server, is stale. It may be followed by a lease of
the next generation, which makes it void. So processes on several machines share a folder without a
lock, and what a killed process left behind is taken over. On the owner's own machine, a lease whose
process is gone is stale at once.
"""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...errors import OutputError
from ...processes import identity, is_gone

BEAT_S, STALE_S = 10.0, 60.0
"""Time between two renewals of a lease, and the age from which it is stale [s]."""

_SUFFIX = ".lease"
#: Leases are some hundred bytes; what is larger is none.
_MAX_BYTES = 4096
#: Tries to create a lease, while others try, too; and the time between them [s].
_TRIES, _PAUSE_S = 40, 0.02


@dataclass(frozen=True)
class _Seen:
    """A lease file as it was found: generation, content, and the server's time of its renewal."""

    generation: int
    path: Path
    content: bytes
    renewed_s: float


class Lease:
    """A lease that this process owns; see :meth:`Leases.claim`."""

    def __init__(self, leases: Leases, name: str, path: Path, content: bytes) -> None:
        self.name = name
        self._leases, self._path, self._content = leases, path, content

    def renew(self) -> bool:
        """Renew the lease; False where another process has taken over."""
        try:
            # Of one open file: where another replaces it meanwhile, this one is nobody's.
            with open(self._path, "rb+") as stream:
                if stream.read(_MAX_BYTES) != self._content:
                    return False
                stream.seek(0)
                stream.write(self._content)
                stream.flush()
                os.fsync(stream.fileno())
            return self._leases.newest(self.name) == self._path
        except FileNotFoundError:
            return False
        except OSError as error:
            raise _unusable(self._path, error) from error

    def release(self) -> None:
        """Give the lease back. May be called again."""
        self._leases.forget(self)
        with contextlib.suppress(OSError, OutputError):  # else it becomes stale
            if self.renew():
                self._path.unlink()

    def __enter__(self) -> Lease:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


class Leases:
    """Leases in a folder; `stale_s` is the age from which one that nobody renews is stale [s]."""

    def __init__(self, folder: Path, beat_s: float = BEAT_S, stale_s: float = STALE_S) -> None:
        self._folder, self._beat_s, self._stale_s = folder, beat_s, stale_s
        self._held: list[Lease] = []
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None

    def claim(self, name: str) -> Lease | None:
        """Take the lease of a name, such as "frame_0001"; None where another process holds it.

        It is renewed until it is released.
        """
        content = json.dumps(identity() | {"token": secrets.token_hex(16)}).encode()
        for _ in range(_TRIES):
            seen = self._seen(name)
            if seen is not None and not self._is_stale(seen):
                return None
            generation = 1 if seen is None else seen.generation + 1
            path = self._folder / f"{name}.{generation:06d}{_SUFFIX}"
            try:
                handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
            except FileExistsError:
                time.sleep(_PAUSE_S)
                continue
            except OSError as error:
                raise _unusable(path, error) from error
            with os.fdopen(handle, "wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            # What was stale must still be there: else its successor has come and gone meanwhile,
            # and the generations have begun again.
            if self.newest(name) != path or not _still_there(seen):
                path.unlink(missing_ok=True)
                time.sleep(_PAUSE_S)
                continue
            for _, older in self._files(name)[:-1]:
                with contextlib.suppress(OSError):
                    older.unlink(missing_ok=True)
            lease = Lease(self, name, path, content)
            self._keep(lease)
            return lease
        return None

    def holder(self, name: str) -> str | None:
        """Return who holds a lease, such as "process 12 on tower"; None where nobody does."""
        seen = self._seen(name)
        if seen is None or self._is_stale(seen):
            return None
        owner = _owner(seen)
        return f"process {owner.get('pid', '?')} on {owner.get('host', '?')}"

    def holders(self) -> dict[str, str]:
        """Return who holds which lease of the folder, by the lease's name."""
        names = {path.name.split(".")[0] for path in self._folder.glob(f"*{_SUFFIX}")}
        found = {name: self.holder(name) for name in sorted(names)}
        return {name: who for name, who in found.items() if who is not None}

    def newest(self, name: str) -> Path | None:
        """Return the file of the lease's last generation."""
        files = self._files(name)
        return files[-1][1] if files else None

    def forget(self, lease: Lease) -> None:
        """Renew a lease no more."""
        with self._lock:
            if lease in self._held:
                self._held.remove(lease)
            if not self._held:
                self._stopped.set()
                self._thread = None

    # -- renewal -----------------------------------------------------------------------------------

    def _keep(self, lease: Lease) -> None:
        with self._lock:
            self._held.append(lease)
            if self._thread is None:
                self._stopped = threading.Event()
                self._thread = threading.Thread(
                    target=self._renew_all, args=(self._stopped,), daemon=True, name="leases"
                )
                self._thread.start()

    def _renew_all(self, stopped: threading.Event) -> None:
        while not stopped.wait(self._beat_s):
            with self._lock:
                held = list(self._held)
            for lease in held:
                with contextlib.suppress(OutputError):  # the owner finds out before it publishes
                    lease.renew()

    # -- files -------------------------------------------------------------------------------------

    def _files(self, name: str) -> list[tuple[int, Path]]:
        """Generations of a lease, the oldest first."""
        found = []
        for path in self._folder.glob(f"{name}.*{_SUFFIX}"):
            digits = path.name[len(name) + 1 : -len(_SUFFIX)]
            if digits.isdecimal():
                found.append((int(digits), path))
        return sorted(found)

    def _seen(self, name: str) -> _Seen | None:
        for generation, path in reversed(self._files(name)):
            found = _read(path)
            if found is not None:
                return _Seen(generation, path, *found)
        return None

    def _is_stale(self, seen: _Seen) -> bool:
        """Whether a lease's process is gone, or has not renewed it for too long."""
        age_s = self._server_time_s() - seen.renewed_s
        # One that is dated in the future was left when a clock was wrong: its owner would have
        # renewed it. One without content has just been created, or its owner was killed then.
        return is_gone(_owner(seen)) or abs(age_s) > self._stale_s

    def _server_time_s(self) -> float:
        """The file server's time: that of a file which is just being written."""
        probe = self._folder / f".clock-{secrets.token_hex(8)}.part"
        try:
            with open(probe, "xb") as stream:
                stream.write(b"\0")
                stream.flush()
                os.fsync(stream.fileno())
                return os.fstat(stream.fileno()).st_mtime
        except OSError as error:
            raise _unusable(probe, error) from error
        finally:
            with contextlib.suppress(OSError):
                probe.unlink(missing_ok=True)


def _read(path: Path) -> tuple[bytes, float] | None:
    """Content of a lease and the time of its renewal; None where there is none."""
    try:
        with open(path, "rb") as stream:  # a network file system looks again only when it opens
            return stream.read(_MAX_BYTES), os.fstat(stream.fileno()).st_mtime
    except FileNotFoundError:
        return None
    except OSError as error:
        raise _unusable(path, error) from error


def _still_there(seen: _Seen | None) -> bool:
    """Whether a stale lease has not been followed by another yet."""
    found = None if seen is None else _read(seen.path)
    return seen is None or (found is not None and found[0] == seen.content)


def _owner(seen: _Seen) -> dict[str, Any]:
    if not seen.content:
        return {}
    try:
        found = json.loads(seen.content)
    except ValueError:
        found = None
    if not isinstance(found, dict) or not isinstance(found.get("pid"), int):
        raise OutputError(
            f"{seen.path} is not a lease of radarsim. Remove it if no other program needs it."
        )
    return found


def _unusable(path: Path, error: OSError) -> OutputError:
    return OutputError(
        f"Cannot use {path}, which shows who works in the output folder: "
        f"{error.strerror or error}. Choose an output folder that is there and is writable."
    )
