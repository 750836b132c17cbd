# SPDX-License-Identifier: GPL-3.0-or-later
"""One process at a time in an output folder: a lock file that says who is at work. No bpy.

Two runs in one folder would remove each other's temporary files and mix their frames. The file
holds the process, the machine and when the process began, so that one that a killed run left
behind is recognised and taken over.
"""

from __future__ import annotations

import ctypes
import json
import os
import socket
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Any

from ...errors import OutputError

LOCK_FILE = ".radarsim.lock"
#: Lock files are a hundred bytes; what is larger is none.
_MOST_BYTES = 4096
#: Tries to take over a stale lock, while others may try, too; and time between them [s].
_TRIES, _PAUSE_S = 40, 0.05
#: An empty file this old is none that is just being filled [s].
_FILLED_WITHIN_S = 1.0


class FolderLock:
    """Lock of an output folder; `release` may be called again.

    Parameters
    ----------
    folder
        Folder that exists and can be written to.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / LOCK_FILE
        self._held = False

    def acquire(self) -> None:
        """Take the lock; one whose process is gone is replaced.

        Raises
        ------
        OutputError
            Another process works in the folder, or one of another machine did and cannot be asked;
            or the file cannot be written.
        """
        mine = {"pid": os.getpid(), "host": socket.gethostname(), "began": process_began(None)}
        for _ in range(_TRIES):
            try:
                handle = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
            except FileExistsError:
                self._remove_stale(mine)
                time.sleep(_PAUSE_S)
                continue
            except OSError as error:
                raise OutputError(
                    f"Cannot write {self._path}: {error.strerror or error}. "
                    "Choose an output folder that is writable."
                ) from error
            with os.fdopen(handle, "w", encoding="utf-8") as stream:
                json.dump(mine, stream)
            self._held = True
            return
        raise OutputError(
            f"The lock {self._path} comes back as often as it is removed: other processes start in "
            "this folder. Choose another folder, or wait for them."
        )

    def release(self) -> None:
        """Give the lock back."""
        if self._held:
            self._held = False
            self._path.unlink(missing_ok=True)

    def __enter__(self) -> FolderLock:
        self.acquire()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.release()

    def _remove_stale(self, mine: dict[str, Any]) -> None:
        """Remove a lock whose process is gone; else say whose it is."""
        owner = self._owner()
        if owner is None:
            return  # it has just been given back, or is just being filled
        pid, host = owner.get("pid"), owner.get("host")
        if not isinstance(pid, int) or not isinstance(host, str):
            raise OutputError(
                f"{self._path} is not a lock of radarsim. Remove it if no other program needs it."
            )
        if host != mine["host"]:
            raise OutputError(
                f"Process {pid} on {host!r} works in the output folder {self._path.parent}, or was "
                f"killed there: this machine cannot tell. Choose another folder; if nothing runs "
                f"on {host!r} any more, remove {self._path}."
            )
        began = process_began(pid)
        if began is not None and owner.get("began") == began:
            who = "This program" if pid == mine["pid"] else f"Process {pid}"
            raise OutputError(
                f"{who} is rendering into the output folder {self._path.parent} already. Wait for "
                "it, stop it, or choose another folder."
            )
        try:
            self._path.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(
                f"The lock {self._path} of process {pid}, which is gone, cannot be removed: "
                f"{error.strerror or error}. Remove it."
            ) from error

    def _owner(self) -> dict[str, Any] | None:
        try:
            age_s = time.time() - self._path.stat().st_mtime
            with open(self._path, "rb") as stream:
                text = stream.read(_MOST_BYTES)
        except OSError:
            return None
        if not text:  # whoever made it was killed before it was filled, or is about to fill it
            host = socket.gethostname()
            return {"pid": 0, "host": host} if age_s > _FILLED_WITHIN_S else None
        try:
            found = json.loads(text)
        except ValueError:
            return {}
        return found if isinstance(found, dict) else {}


def process_began(pid: int | None) -> str | None:
    """What tells a process from a later one of the same number; None where it does not run.

    Parameters
    ----------
    pid
        Its number; None for this process.
    """
    number = os.getpid() if pid is None else pid
    if number <= 0:
        return None
    if sys.platform == "win32":
        return _began_windows(number)
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return None
    except OSError:
        pass  # it runs, for someone else
    try:  # Linux: start in ticks since the machine started, and which start that was
        fields = Path(f"/proc/{number}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="utf-8").strip()
    except OSError:
        return "running"
    return f"{boot} {fields[19]}"


def _began_windows(pid: int) -> str | None:
    """The same by the Windows API (os.kill would end the process there)."""
    if sys.platform != "win32":
        return None
    kernel = ctypes.WinDLL("kernel32", use_last_error=True)
    kernel.OpenProcess.restype = ctypes.c_void_p
    query_limited = 0x1000
    handle = kernel.OpenProcess(query_limited, False, pid)
    if not handle:
        return None
    try:
        times = [ctypes.c_uint64() for _ in range(4)]
        pointers = [ctypes.byref(value) for value in times]
        if not kernel.GetProcessTimes(ctypes.c_void_p(handle), *pointers):
            return "running"
        # A process that has ended is listed while someone holds a handle of it.
        return None if times[1].value else str(times[0].value)
    finally:
        kernel.CloseHandle(ctypes.c_void_p(handle))
