# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands with workers as processes of their own, watched and killed."""

from __future__ import annotations

import io
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]


def start(*words: Any, stdout: Any = subprocess.DEVNULL) -> subprocess.Popen[str]:
    """A command of radarsim, under way; what it writes to standard error can be read."""
    return subprocess.Popen(
        [sys.executable, "-m", "radarsim_addon", *map(str, words)],
        cwd=ROOT,
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
    )


def finished(*words: Any) -> str:
    """Run a command to its end; return its standard output."""
    process = start(*words, stdout=subprocess.PIPE)
    out, error = process.communicate(timeout=600)
    assert process.returncode == 0, error
    return out


def children(process: subprocess.Popen[str]) -> list[int]:
    """Processes that a process has started and that run."""
    place = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    try:
        return [int(pid) for pid in place.read_text().split()]
    except OSError:
        return []


def runs(pid: int) -> bool:
    """Whether a process is there, and is more than an entry that nobody has read."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def products(folder: Path) -> dict[str, bytes]:
    """Content of all files of products, by their names."""
    return {path.name: path.read_bytes() for path in (folder / "products").iterdir()}


def differences(found: dict[str, bytes], expected: dict[str, bytes]) -> list[str]:
    """Files that are missing, too many or of other content, and where they differ."""
    said = [f"missing: {name}" for name in expected.keys() - found.keys()]
    said += [f"too many: {name}" for name in found.keys() - expected.keys()]
    for name in found.keys() & expected.keys():
        one, other = found[name], expected[name]
        if one != other:
            pairs = enumerate(zip(one, other, strict=False))
            at = next((n for n, (a, b) in pairs if a != b), min(len(one), len(other)))
            said.append(f"{name}: {_part(one, at)} instead of {_part(other, at)}, byte {at}")
            if name.endswith(".npz"):
                own, wanted = (dict(np.load(io.BytesIO(part))) for part in (one, other))
                said += _arrays(name, own, wanted)
    return sorted(said)


def _part(content: bytes, at: int) -> str:
    return f"{content[max(at - 80, 0) : at + 80]!r} of {len(content)} bytes"


def _arrays(name: str, found: dict[str, Any], expected: dict[str, Any]) -> list[str]:
    """Which arrays differ."""

    def same(one: Any, other: Any) -> bool:
        one, other = np.asarray(one), np.asarray(other)
        return (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes())

    return [
        f"{name} {key}: {found.get(key)!r} instead of {expected.get(key)!r}"
        for key in found | expected
        if not same(found.get(key), expected.get(key))
    ]


def written_ns(path: Path) -> int:
    """When a file was written; 0 if it has been renamed since it was listed."""
    try:
        return path.stat().st_mtime_ns
    except FileNotFoundError:
        return 0


def survive(words: list[Any], results: Path, pattern: str, kills: Iterator[str]) -> list[str]:
    """Run a command to its end while its workers are killed, and itself, after which it is given
    again. Each kill comes after a new result (a file of `pattern`). Returns the kills."""
    done, process, choose = [], start(*words), random.Random(1)
    deadline_s, seen_ns = time.monotonic() + 1200, 0
    for kill in kills:
        while process.poll() is None and not (
            (newest := max(map(written_ns, results.glob(pattern)), default=0)) > seen_ns
            and children(process)
        ):
            assert time.monotonic() < deadline_s
            time.sleep(0.02)
        if process.poll() is not None:
            break
        seen_ns = newest
        time.sleep(choose.random() * 0.2)
        if kill == "coordinator":
            process.kill()
            process.communicate()
            process = start(*words)
        else:
            pids = children(process)
            if not pids:
                continue
            os.kill(choose.choice(pids), signal.SIGKILL)
        done.append(kill)
    error = process.communicate(timeout=1200)[1]
    assert process.returncode == 0, error
    return done
