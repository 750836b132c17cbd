# SPDX-License-Identifier: GPL-3.0-or-later
"""Processes told apart, and what those that were killed left in the system's temporary folder."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import gc
import json
import math
import os
import shutil
import socket
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

#: In a temporary folder: the process that it belongs to.
_OWNER = "radarsim_owner.json"
#: Names of the folders of radarsim, and of Blender's sessions.
_FOLDERS = ("radarsim_", "blender_")
#: Time between two searches for abandoned folders [s], and when each place was searched last.
_SEARCHES_S = 60.0
_searched_s: dict[str, float] = {}

#: Options of glibc's mallopt: the free memory from which on it goes back to the system, and the
#: size from which on an array has pages of its own; and their values [bytes].
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
_KEPT_BYTES, _OWN_PAGES_BYTES = 1 << 28, 1 << 25


def keep_freed_memory() -> None:
    """Let the C library keep memory of freed arrays (up to 32 MiB each, 256 MiB in all) for reuse.

    Otherwise each such array has pages of its own, which the system clears every time.
    Other C libraries than glibc are left as they are.
    """
    with contextlib.suppress(OSError, AttributeError, TypeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_TRIM_THRESHOLD, _KEPT_BYTES)
        mallopt(_MMAP_THRESHOLD, _OWN_PAGES_BYTES)


@contextlib.contextmanager
def importing() -> Iterator[None]:
    """Switch garbage collection off during imports. Later collections skip the imported objects."""
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


@functools.cache
def _identity_of(pid: int) -> dict[str, Any]:
    space = ""
    with contextlib.suppress(OSError):  # containers of one machine number processes apart
        space = os.readlink("/proc/self/ns/pid")
    return {"pid": pid, "host": socket.gethostname(), "space": space, "began": process_began(pid)}


def identity() -> dict[str, Any]:
    """Return a record that identifies this process among those of all machines."""
    return _identity_of(os.getpid())


def process_began(pid: object) -> str | None:
    """Return a text that distinguishes a process from a later one of the same number. None: it has
    ended.
    """
    if not isinstance(pid, int) or pid <= 0:
        return None
    if sys.platform == "win32":
        return _began_windows(pid)
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return None
    except OSError:
        pass  # it runs, for another user
    try:  # Linux: start in ticks since the machine started, and which start that was
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="utf-8").strip()
    except OSError:
        return "running"
    return f"{boot} {fields[19]}"


def is_gone(owner: object) -> bool:
    """Return True if a process of this machine, as `identity` returned it, has ended. False if that
    is unknown.
    """
    mine = identity()
    if not isinstance(owner, dict) or any(owner.get(k) != mine[k] for k in ("host", "space")):
        return False
    began = process_began(owner.get("pid"))
    return began is None or began != owner.get("began")


def temporary_folder() -> Path:
    """Make a folder in the system's temporary folder. Folders of killed processes are removed
    first.
    """
    remove_abandoned_folders()
    folder = Path(tempfile.mkdtemp(prefix=_FOLDERS[0]))
    own_folder(folder)
    return folder


def own_folder(folder: Path) -> None:
    """Note in a temporary folder that it is this process's, for when it is killed."""
    with contextlib.suppress(OSError), open(folder / _OWNER, "x", encoding="utf-8") as stream:
        json.dump(identity(), stream)


def remove_abandoned_folders(*, now: bool = False) -> None:
    """Remove temporary folders whose process was killed. Those of other users stay.

    At most once a minute, but `now`: in a long list of temporary files, a search takes as long as a
    render.
    """
    place, now_s = tempfile.gettempdir(), time.monotonic()
    if not now and now_s - _searched_s.get(place, -math.inf) < _SEARCHES_S:
        return
    _searched_s[place] = now_s
    names: list[str] = []
    with contextlib.suppress(OSError):  # some places can be written to, but not listed
        names = os.listdir(place)
    for folder in (Path(place, name) for name in names if name.startswith(_FOLDERS)):
        with contextlib.suppress(OSError, ValueError):
            owned = os.name != "posix" or folder.lstat().st_uid == os.geteuid()
            if owned and not folder.is_symlink() and not (folder / _OWNER).is_symlink():
                with open(folder / _OWNER, encoding="utf-8") as stream:
                    owner = json.loads(stream.read(4096))
                if is_gone(owner):
                    shutil.rmtree(folder, ignore_errors=True)


def _began_windows(pid: int) -> str | None:
    """Do the same with the Windows API: there, os.kill would end the process."""
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
