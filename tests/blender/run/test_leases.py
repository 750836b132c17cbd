# SPDX-License-Identifier: GPL-3.0-or-later
"""One process at a time works on a part of a folder; what a dead one left is taken over."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from radarsim_addon.blender.run.shared_folder import Lease, Leases
from radarsim_addon.errors import OutputError
from radarsim_addon.processes import identity, process_began

ROOT = Path(__file__).resolve().parents[3]
POSIX = pytest.mark.skipif(os.name != "posix", reason="signals")


def file_of(folder: Path, name: str = "frame_0001") -> Path:
    (path,) = folder.glob(f"{name}.*.lease")
    return path


def write(folder: Path, *, age_s: float = 0.0, **changes: object) -> Path:
    """A lease of another process, last renewed some time ago."""
    path = folder / "frame_0001.000001.lease"
    path.write_text(json.dumps(identity() | {"token": "another"} | changes), encoding="utf-8")
    os.utime(path, (time.time() - age_s,) * 2)
    return path


def claimed(leases: Leases, name: str = "frame_0001") -> Lease:
    lease = leases.claim(name)
    assert lease is not None
    return lease


def test_one_at_a_time(tmp_path: Path) -> None:
    """Held while held, gone afterwards; other names are free."""
    first, second = Leases(tmp_path), Leases(tmp_path)
    with claimed(first):
        assert second.claim("frame_0001") is None
        assert first.claim("frame_0001") is None
        assert f"process {os.getpid()} on" in str(second.holder("frame_0001"))
        with claimed(second, "frame_0002"):
            assert list(first.holders()) == ["frame_0001", "frame_0002"]
    assert list(tmp_path.iterdir()) == []
    assert first.holder("frame_0001") is None
    with claimed(second):
        pass


def test_a_name_that_begins_like_another_is_another(tmp_path: Path) -> None:
    leases = Leases(tmp_path)
    with claimed(leases, "frame_1000"), claimed(leases, "frame_10001"):
        assert len(leases.holders()) == 2


def test_a_lease_is_renewed(tmp_path: Path) -> None:
    """By a thread, so that a long render keeps it; not after it was released."""
    leases = Leases(tmp_path, beat_s=0.02)
    lease = claimed(leases)
    path = file_of(tmp_path)
    os.utime(path, (1.0, 1.0))
    deadline_s = time.monotonic() + 10
    while path.stat().st_mtime < 2 and time.monotonic() < deadline_s:
        time.sleep(0.02)
    assert path.stat().st_mtime > time.time() - 60
    lease.release()
    lease.release()
    assert list(tmp_path.iterdir()) == []
    assert not lease.renew()


@pytest.mark.parametrize(
    ("age_s", "changes", "free"),
    [
        (0.0, {}, False),
        (0.0, {"host": "elsewhere"}, False),
        (50.0, {"host": "elsewhere"}, False),
        (70.0, {"host": "elsewhere"}, True),
        (70.0, {}, True),  # it runs, but is stopped
        (0.0, {"pid": 2**30}, True),
        (0.0, {"began": "another start of the machine 17"}, True),
        (0.0, {"pid": 2**30, "space": "another container"}, False),
        (-20.0, {"host": "elsewhere"}, False),
        # A clock was wrong when it was left: a living owner would have renewed it since.
        (-3600.0, {"host": "elsewhere"}, True),
        (-1e9, {"host": "elsewhere"}, True),
    ],
)
def test_a_stale_lease_is_taken_over(
    tmp_path: Path, age_s: float, changes: dict[str, object], free: bool
) -> None:
    path = write(tmp_path, age_s=age_s, **changes)
    leases = Leases(tmp_path)
    assert (leases.holder("frame_0001") is None) == free
    lease = leases.claim("frame_0001")
    assert (lease is not None) == free
    assert path.exists() != free
    if lease is not None:
        assert lease.renew()
        lease.release()
        assert list(tmp_path.iterdir()) == []


def test_age_is_by_the_clock_of_the_file_server(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A machine whose clock is an hour off takes nothing over that is alive."""
    write(tmp_path, host="elsewhere")
    now = time.time
    monkeypatch.setattr(time, "time", lambda: now() + 3600)
    assert Leases(tmp_path).claim("frame_0001") is None


def test_a_late_owner_learns_that_it_has_lost(tmp_path: Path) -> None:
    """And neither renews nor removes the lease of its successor."""
    late, quick = Leases(tmp_path), Leases(tmp_path)
    lost = claimed(late)
    os.utime(file_of(tmp_path), (1.0, 1.0))
    lease = claimed(quick)
    assert not lost.renew()
    lost.release()
    assert lease.renew()
    # nor does it where generations have begun again
    lease.release()
    with claimed(quick):
        assert file_of(tmp_path).name == "frame_0001.000001.lease"
        assert not lost.renew()
        lost.release()
        assert file_of(tmp_path).exists()


def test_a_removed_folder_ends_the_lease(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    leases = Leases(folder)
    lease = claimed(leases)
    file_of(folder).unlink()
    folder.rmdir()
    assert not lease.renew()
    lease.release()
    with pytest.raises(OutputError, match="who works in the output folder"):
        leases.claim("frame_0001")
    assert not folder.exists()


@pytest.mark.parametrize("text", ["[]", "not JSON", '{"pid": "1"}'])
def test_a_strange_file_is_not_removed(tmp_path: Path, text: str) -> None:
    path = tmp_path / "frame_0001.000001.lease"
    path.write_text(text)
    with pytest.raises(OutputError, match="not a lease of radarsim"):
        Leases(tmp_path).claim("frame_0001")
    assert path.read_text() == text


def test_killed_before_it_was_filled(tmp_path: Path) -> None:
    path = tmp_path / "frame_0001.000001.lease"
    path.touch()
    assert Leases(tmp_path).claim("frame_0001") is None
    os.utime(path, (time.time() - 70,) * 2)
    with claimed(Leases(tmp_path)):
        pass


def test_processes_are_told_apart() -> None:
    mine = identity()
    assert mine["pid"] == os.getpid() and mine["host"] == socket.gethostname()
    assert mine["began"] == process_began(os.getpid())
    assert process_began(2**30) is process_began(0) is None


# -- several processes -----------------------------------------------------------------------------
@contextmanager
def process(code: str, *arguments: object) -> Iterator[Any]:
    """Another Python with the package."""
    with subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        cwd=ROOT,
        stderr=subprocess.PIPE,
        text=True,
    ) as child:
        try:
            yield child
        finally:
            child.kill()


HOLD = """
import sys, time
from pathlib import Path
from radarsim_addon.blender.run.shared_folder import Leases
lease = Leases(Path(sys.argv[1]), beat_s=0.05).claim("frame_0001")
print("held", file=sys.stderr, flush=True)
sys.stdin.read() if len(sys.argv) < 3 else time.sleep(float(sys.argv[2]))
print("still mine" if lease.renew() else "lost", file=sys.stderr, flush=True)
"""


def test_a_living_process_keeps_others_out(tmp_path: Path) -> None:
    """Its number is named; killed, it leaves a lease that is taken over at once."""
    with process(HOLD, tmp_path, 60) as child:
        assert child.stderr.readline() == "held\n"
        assert Leases(tmp_path).claim("frame_0001") is None
        assert f"process {child.pid} on" in str(Leases(tmp_path).holder("frame_0001"))
        child.kill()
        child.wait()
        assert file_of(tmp_path).exists()
        with claimed(Leases(tmp_path)):
            pass


@POSIX
def test_a_stopped_process_finds_itself_late(tmp_path: Path) -> None:
    """Ctrl-Z, or a laptop asleep: its lease becomes stale, and it must not publish afterwards."""
    with process(HOLD, tmp_path, 3) as child:
        assert child.stderr.readline() == "held\n"
        os.kill(child.pid, signal.SIGSTOP)
        time.sleep(0.5)
        others = Leases(tmp_path, stale_s=0.4)
        lease = claimed(others)
        os.kill(child.pid, signal.SIGCONT)
        assert child.stderr.readline() == "lost\n"
        assert lease.renew()
        lease.release()


WORK = """
import os, sys, time
from pathlib import Path
from radarsim_addon.blender.run.shared_folder import Leases
folder = Path(sys.argv[1])
leases = Leases(folder)
todo = [f"frame_{n:04d}" for n in range(40)]
(folder / f"{os.getpid()}.ready").touch()
while len(list(folder.glob("*.ready"))) < 3:  # on a busy machine one would do all
    time.sleep(0.005)
while todo:
    left = []
    for name in todo:
        if (folder / f"{name}.done").exists():
            continue
        lease = leases.claim(name)
        if lease is None:
            left.append(name)
            continue
        with lease:
            if not (folder / f"{name}.done").exists():
                busy = folder / f"{name}.busy"
                os.close(os.open(busy, os.O_CREAT | os.O_EXCL))  # fails if another works on it
                time.sleep(0.005)
                busy.unlink()
                (folder / f"{name}.done").touch(exist_ok=False)
                print(name, file=sys.stderr, flush=True)
    todo = left
"""


def test_processes_share_the_work(tmp_path: Path) -> None:
    """Each part is done once, whoever does it."""
    with (
        process(WORK, tmp_path) as one,
        process(WORK, tmp_path) as two,
        process(WORK, tmp_path) as three,
    ):
        done = [child.communicate(timeout=60)[1].split() for child in (one, two, three)]
    assert [child.returncode for child in (one, two, three)] == [0, 0, 0]
    assert sorted(name for names in done for name in names) == [f"frame_{n:04d}" for n in range(40)]
    assert sum(bool(names) for names in done) > 1
    assert not list(tmp_path.glob("*.lease")) and not list(tmp_path.glob("*.busy"))
