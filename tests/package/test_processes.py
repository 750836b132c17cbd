# SPDX-License-Identifier: GPL-3.0-or-later
"""What killed processes leave behind goes at the next start; what belongs to others stays."""

from __future__ import annotations

import ctypes
import json
import os
import platform
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from radarsim_addon import atomic_files, processes
from radarsim_addon.atomic_files import AtomicFile, remove_abandoned

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals")

FOLDER = (
    "from radarsim_addon.processes import temporary_folder; print(temporary_folder(), flush=True)"
)
FILE = """
import sys
from pathlib import Path
from radarsim_addon.atomic_files import AtomicFile
print(AtomicFile(Path(sys.argv[1]) / "map.npz").temporary, flush=True)
"""
WRITES = """
import sys, time
from pathlib import Path
from radarsim_addon import __main__, atomic_files
from radarsim_addon.signal import pipeline

def main(words, others):
    with atomic_files.replaced(Path(words[0]) / "map.npz") as temporary:
        print(temporary, flush=True)
        time.sleep(60)

pipeline.main = main
sys.exit(__main__.main())
"""


@contextmanager
def running(program: str, folder: Path) -> Iterator[tuple[subprocess.Popen[str], Path]]:
    """A process at work, and the path that it has printed; it is killed in the end."""
    process = subprocess.Popen(
        [sys.executable, "-c", program + "\nimport time; time.sleep(60)", str(folder)],
        stdout=subprocess.PIPE, text=True, cwd=ROOT, env={**os.environ, "TMPDIR": str(folder)},
    )  # fmt: skip
    try:
        assert process.stdout is not None
        yield process, Path(process.stdout.readline().strip())
    finally:
        process.kill()
        process.wait()


def test_temporary_folders_of_killed_processes_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with running(FOLDER, tmp_path) as (_, theirs):
        (theirs / "view.exr").write_text("")
        session = tmp_path / "blender_a1b2c3"
        session.mkdir()
        (session / "radarsim_owner.json").write_text((theirs / "radarsim_owner.json").read_text())
        mine = processes.temporary_folder()
        assert theirs.is_dir() and session.is_dir()
    soon = processes.temporary_folder()
    assert theirs.is_dir()  # the last search was a moment ago
    processes._searched_s.clear()
    again = processes.temporary_folder()
    assert sorted(tmp_path.iterdir()) == sorted([mine, soon, again])


def test_folders_of_others_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of no owner, of another machine, behind a link, or with an owner that is no record."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    gone = processes.identity() | {"pid": 2**30}
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "radarsim_owner.json").write_text(json.dumps(gone))
    (tmp_path / "radarsim_link").symlink_to(outside)
    owners = {"a": None, "b": gone | {"host": "elsewhere"}, "c": [1], "d": "x", "blender": None}
    for name, owner in owners.items():
        folder = tmp_path / ("blender_x" if name == "blender" else f"radarsim_{name}")
        folder.mkdir()
        if owner is not None:
            (folder / "radarsim_owner.json").write_text(json.dumps(owner))
    before = sorted(tmp_path.rglob("*"))
    processes.remove_abandoned_folders()
    assert sorted(tmp_path.rglob("*")) == before
    (tmp_path / "radarsim_a" / "radarsim_owner.json").write_text(json.dumps(gone))
    processes._searched_s.clear()
    processes.remove_abandoned_folders()
    assert not (tmp_path / "radarsim_a").exists()


def test_temporary_files_of_killed_processes_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = AtomicFile(tmp_path / "map.npz")
    with running(FILE, tmp_path) as (_, theirs):
        assert theirs.is_file() and theirs.match(atomic_files.TEMPORARY_PATTERN)
        remove_abandoned(tmp_path)
        assert theirs.is_file()
    monkeypatch.setattr(socket, "gethostname", lambda: "elsewhere")
    processes._identity_of.cache_clear()
    remove_abandoned(tmp_path)
    assert theirs.is_file()
    monkeypatch.undo()
    processes._identity_of.cache_clear()
    remove_abandoned(tmp_path)
    assert list(tmp_path.iterdir()) == [mine.temporary]


def test_sigterm_leaves_nothing_half_written(tmp_path: Path) -> None:
    with running(WRITES, tmp_path) as (process, temporary):
        assert temporary.is_file()
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=20) == 143
    assert list(tmp_path.iterdir()) == []


def test_a_link_planted_while_a_file_is_written_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("mine")
    file = AtomicFile(tmp_path / "map.npz")
    file.temporary.write_text("new")
    (tmp_path / "map.npz").symlink_to(tmp_path / "precious")
    file.commit()
    assert (tmp_path / "map.npz").read_text() == "new" and not (tmp_path / "map.npz").is_symlink()
    assert (tmp_path / "precious").read_text() == "mine"


def test_a_full_disk_is_named(tmp_path: Path) -> None:
    error = atomic_files.cannot_write(tmp_path / "map.npz", OSError(28, "No space left on device"))
    place = tmp_path
    while not os.path.ismount(place):
        place = place.parent
    assert f"Make room on the disk {place} (" in str(error) and "MB free)" in str(error)


@pytest.mark.parametrize("library", [None, OSError, TypeError])
def test_another_c_library_is_left_as_it_is(
    monkeypatch: pytest.MonkeyPatch, library: type[Exception] | None
) -> None:
    """One without mallopt; one that cannot be opened (musl, Windows)."""
    asked: list[None] = []

    def load(name: None) -> object:
        asked.append(name)
        if library is not None:
            raise library
        return object()

    monkeypatch.setattr(ctypes, "CDLL", load)
    processes.keep_freed_memory()
    assert asked == [None]


def test_freed_memory_is_used_again() -> None:
    """Each larger block has pages of its own otherwise: counted by the system."""

    def faults(first: str) -> int:
        lines = (
            "import resource",
            "from radarsim_addon.processes import keep_freed_memory",
            first,
            "for size in range(1, 31): b'x' * (size << 20)",
            "print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)",
        )
        return int(subprocess.check_output([sys.executable, "-c", "\n".join(lines)], cwd=ROOT))

    kept = faults("keep_freed_memory()")
    if platform.libc_ver()[0] == "glibc":  # no other C library has mallopt
        assert kept < faults("") / 3
