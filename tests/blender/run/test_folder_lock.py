# SPDX-License-Identifier: GPL-3.0-or-later
"""One run at a time in an output folder."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("bpy")

from radarsim_addon.blender.run.folder_lock import LOCK_FILE, FolderLock, process_began
from radarsim_addon.errors import OutputError
from tests.blender import radar_scenes as rs


def write(folder: Path, **changes: object) -> Path:
    """A lock file of this process, with changes."""
    mine = {"pid": os.getpid(), "host": socket.gethostname(), "began": process_began(None)}
    path = folder / LOCK_FILE
    path.write_text(json.dumps(mine | changes), encoding="utf-8")
    return path


def test_one_at_a_time(tmp_path: Path) -> None:
    """Held while held, gone afterwards, and only given back by who has it."""
    first, second = FolderLock(tmp_path), FolderLock(tmp_path)
    with first:
        with pytest.raises(OutputError, match="already"):
            second.acquire()
        second.release()
        assert (tmp_path / LOCK_FILE).is_file()
    assert not (tmp_path / LOCK_FILE).exists()
    with second:
        pass


def test_a_living_process_keeps_others_out(tmp_path: Path) -> None:
    """Its number and the folder are named; killed, it leaves a lock that is taken over."""
    code = (
        "import sys, time; from pathlib import Path;"
        "from radarsim_addon.blender.run.folder_lock import FolderLock;"
        "FolderLock(Path(sys.argv[1])).acquire(); print('held', flush=True); time.sleep(60)"
    )
    root = Path(__file__).resolve().parents[3]
    with subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)], cwd=root, stdout=subprocess.PIPE, text=True
    ) as child:
        try:
            assert child.stdout is not None
            assert child.stdout.readline() == "held\n"
            with pytest.raises(OutputError, match=f"Process {child.pid} is rendering"):
                FolderLock(tmp_path).acquire()
        finally:
            child.kill()
            child.wait()
    assert (tmp_path / LOCK_FILE).is_file()
    with FolderLock(tmp_path):
        pass


@pytest.mark.parametrize("left", [{"pid": 2**30}, {"began": "another start of the machine 17"}])
def test_what_a_killed_run_left_is_taken_over(tmp_path: Path, left: dict[str, object]) -> None:
    """Also where its number was given to another process since."""
    path = write(tmp_path, **left)
    with FolderLock(tmp_path):
        assert json.loads(path.read_text())["pid"] == os.getpid()
    assert not path.exists()


def test_another_machine_cannot_be_asked(tmp_path: Path) -> None:
    path = write(tmp_path, host="elsewhere")
    with pytest.raises(OutputError, match=r"'elsewhere'.*remove .*lock"):
        FolderLock(tmp_path).acquire()
    assert path.is_file()


@pytest.mark.parametrize("text", ["[]", "not JSON", '{"pid": "1"}'])
def test_a_strange_file_is_not_removed(tmp_path: Path, text: str) -> None:
    path = tmp_path / LOCK_FILE
    path.write_text(text)
    with pytest.raises(OutputError, match="not a lock of radarsim"):
        FolderLock(tmp_path).acquire()
    assert path.read_text() == text


def test_killed_before_it_was_filled(tmp_path: Path) -> None:
    path = tmp_path / LOCK_FILE
    path.touch()
    os.utime(path, (time.time() - 60,) * 2)
    with FolderLock(tmp_path):
        pass


def test_runs_lock_their_folder(tmp_path: Path) -> None:
    """While they go on; afterwards, and where one could not begin, the folder is free."""
    rs.new_scene()
    rs.add_plate(10, 4)
    with FolderLock(tmp_path), pytest.raises(OutputError, match="already"):
        rs.run(tmp_path)
    rs.run(tmp_path)
    assert not (tmp_path / LOCK_FILE).exists()
    with pytest.raises(OutputError, match="another run"):
        rs.run(tmp_path, samples=2)
    assert not (tmp_path / LOCK_FILE).exists()
