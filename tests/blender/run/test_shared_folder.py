# SPDX-License-Identifier: GPL-3.0-or-later
"""Several processes measure one run; each frame is measured once, and the plan is one."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("bpy")

from radarsim_addon import contract
from radarsim_addon.blender.run import shared_folder
from radarsim_addon.blender.run.shared_folder import Lease, Leases, SharedFolder
from radarsim_addon.errors import OutputError
from radarsim_addon.signal.runs.exr import read_exr
from radarsim_addon.typed_json import read_record
from tests.blender import radar_scenes as rs
from tests.signal.synthetic import Setup, run_record

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[3]
PLAN = dataclasses.replace(run_record(Setup(frames=(1, 2, 3))), extra={"resumable": True})


def opened(folder: Path, plan: contract.RunRecord = PLAN, overwrite: bool = False) -> SharedFolder:
    """A folder that this process works in."""
    shared = SharedFolder(folder)
    shared.open(plan, overwrite)
    return shared


def run_file(folder: Path) -> contract.RunRecord:
    return read_record(folder / contract.RUN_FILE, contract.RunRecord)


# -- the plan --------------------------------------------------------------------------------------
def test_the_first_writes_the_plan_and_others_join(tmp_path: Path) -> None:
    first = opened(tmp_path)
    frames = first.claimed([1, 2, 3])
    assert next(frames) == 1
    written = (tmp_path / contract.RUN_FILE).stat().st_mtime_ns
    second = opened(tmp_path, dataclasses.replace(PLAN, blend_file="copy.blend"))
    assert (tmp_path / contract.RUN_FILE).stat().st_mtime_ns == written
    assert next(second.claimed([1, 2, 3])) == 2
    assert not list(tmp_path.glob("run.*.lease"))


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("change", [{"fingerprint": "other"}, {"frames": [1, 2, 3, 4]}])
def test_another_run_is_refused_while_one_is_at_work(
    tmp_path: Path, change: dict[str, Any], overwrite: bool
) -> None:
    """Also with overwrite; and allowed when the other has ended, by the usual rules."""
    other = dataclasses.replace(PLAN, **change)
    frames = opened(tmp_path).claimed([1, 2, 3])
    next(frames)
    with pytest.raises(OutputError, match=f"process {os.getpid()} on .* another run"):
        opened(tmp_path, other, overwrite)
    assert run_file(tmp_path).frames == [1, 2, 3]
    frames.close()
    opened(tmp_path, other, overwrite=True)
    assert run_file(tmp_path).fingerprint == other.fingerprint


@pytest.mark.parametrize("change", [{"fingerprint": "other"}, {"frames": [7, 8, 9]}])
def test_a_replaced_plan_ends_the_work(tmp_path: Path, change: dict[str, Any]) -> None:
    """Between two frames nothing is claimed: another may begin there, and is noticed."""
    first = opened(tmp_path)
    assert not first.workers()
    opened(tmp_path, dataclasses.replace(PLAN, **change), overwrite=True)
    with pytest.raises(OutputError, match=r"another plan into .*run\.json has changed"):
        next(first.claimed([1, 2, 3]))
    assert not first.workers()


def test_a_resumed_run_with_the_same_plan_disturbs_nobody(tmp_path: Path) -> None:
    first = opened(tmp_path)
    opened(tmp_path)
    assert next(first.claimed([1])) == 1


def test_nobody_claims_while_the_folder_is_opened(tmp_path: Path) -> None:
    """Whoever opens it may be removing frames."""
    shared = opened(tmp_path)
    opening = tmp_path / "run.000001.lease"
    opening.write_text('{"pid": 1, "host": "elsewhere"}')
    os.utime(opening, (time.time() - 58,) * 2)  # stale in two seconds
    start_s = time.monotonic()
    assert next(shared.claimed([1])) == 1
    assert time.monotonic() - start_s > 1.5


def test_a_claim_that_the_opener_did_not_see_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was made after the opener had looked, and its owner looked after the opener had ended."""
    first, second = opened(tmp_path), SharedFolder(tmp_path)
    claim, open_folder = first._leases.claim, shared_folder.open_folder
    leases: list[Lease | None] = []

    def opened_meanwhile(name: str) -> Lease | None:
        monkeypatch.undo()

        def claimed_meanwhile(*arguments: Any) -> None:
            leases.append(claim(name))
            open_folder(*arguments)

        monkeypatch.setattr(shared_folder, "open_folder", claimed_meanwhile)
        second.open(PLAN, False)
        return leases[0]

    monkeypatch.setattr(first._leases, "claim", opened_meanwhile)
    one, two = first.claimed([1, 2]), second.claimed([1, 2])
    assert (next(one), next(two)) == (1, 2)
    assert first.keeps_frame() and second.keeps_frame()


def test_leases_of_the_dead_are_tidied_up(tmp_path: Path) -> None:
    opened(tmp_path)
    left = tmp_path / "frame_0009.000001.lease"
    left.write_text('{"pid": 1073741824, "host": "elsewhere"}')
    os.utime(left, (time.time() - 70,) * 2)
    opened(tmp_path)
    assert not left.exists()


# -- frames ----------------------------------------------------------------------------------------
def test_frames_are_shared(tmp_path: Path) -> None:
    """What another holds comes last, and is left to it where it does not let go."""
    first, second = opened(tmp_path), opened(tmp_path)
    one = first.claimed([1, 2, 3])
    assert next(one) == 1
    two = second.claimed([1, 2, 3])
    assert [next(two), next(two)] == [2, 3]
    with pytest.raises(StopIteration) as end:
        next(two)
    assert end.value.value == [1]
    assert second.holders([1, 2, 3]) == first.holders([1]) != []
    # what is given back meanwhile is taken in the end
    two = second.claimed([1, 2, 3])
    assert [next(two), next(two), next(one), next(two)] == [2, 3, 2, 1]
    assert list(two) == []


def test_a_run_of_which_nothing_is_left_is_refused(tmp_path: Path) -> None:
    first, second = opened(tmp_path), opened(tmp_path)
    frames = first.claimed([1])
    next(frames)
    with pytest.raises(OutputError, match=rf"process {os.getpid()} on .* already"):
        next(second.claimed([1]))
    first.close()
    first.close()
    assert next(second.claimed([1])) == 1


def test_a_late_worker_does_not_keep_its_frame(tmp_path: Path) -> None:
    first, second = opened(tmp_path), opened(tmp_path)
    frames = first.claimed([1, 2])
    next(frames)
    assert first.keeps_frame()
    (lease,) = tmp_path.glob("*.lease")
    os.utime(lease, (1.0, 1.0))
    others = second.claimed([1])
    assert next(others) == 1
    assert not first.keeps_frame() and second.keeps_frame()
    assert next(frames) == 2
    assert first.keeps_frame()


# -- jobs ------------------------------------------------------------------------------------------
def scene_of_plate() -> None:
    rs.new_scene()
    rs.add_plate(6, 4)


def test_runs_claim_their_frames(tmp_path: Path) -> None:
    """While they go on; afterwards, and where one could not begin, the folder is free."""
    scene_of_plate()
    lease = Leases(tmp_path).claim("frame_0001")
    assert lease is not None
    with lease, pytest.raises(OutputError, match=f"process {os.getpid()} on"):
        rs.run(tmp_path)
    rs.run(tmp_path, identity="file")
    with pytest.raises(OutputError, match="another run"):
        rs.run(tmp_path, identity="file", samples=2)
    assert not list(tmp_path.rglob("*.lease"))


def test_a_frame_that_was_taken_over_is_not_written(tmp_path: Path) -> None:
    """The late process discards the render, leaves the frame, and measures the next one."""
    scene_of_plate()
    done = []
    with rs.job_for(tmp_path, frames=(1, 2)) as job:
        for task in job.pending():
            job.start(task)
            job.render(task)
            if task.frame == 1:
                (lease,) = tmp_path.glob("*.lease")
                os.utime(lease, (1.0, 1.0))
                assert Leases(tmp_path).claim("frame_0001") is not None
            job.finish(task)
            done.append((task.frame, shared_folder.is_done(tmp_path, task, job.fingerprint)))
    assert done[0] == (1, False)
    assert [frame for frame, _ in done].count(1) == 1
    assert {frame for frame, whole in done if whole} == {2}
    assert not list((tmp_path / contract.frame_dir(1)).glob("ring_*"))


MEASURE = """
import sys, time
from pathlib import Path
from tests.blender import path_helpers as ph, radar_scenes as rs
folder, kind, go = Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3])
rs.new_scene()
plate = rs.add_plate(6, 4)
rs.move_steadily(plate, (0.0, 2.0, 0.0))
changes = {"frames": (1, 2, 3, 4, 5), "width_px": 16, "height_px": 16}
if kind == "rings":
    job = rs.job_for(folder, **changes)
else:
    scene = ph.bpy.context.scene
    job = ph.PathJob(scene, scene.view_layers[0], rs.measurement(**changes), folder,
                     ph.PathOptions(replicates=2))
print("ready", file=sys.stderr, flush=True)
while not go.exists():
    time.sleep(0.01)
job.identity = "file"
with job:
    for task in job.pending():
        job.start(task)
        job.render(task)
        job.finish(task)
        print(f"task {task.exr_path}", file=sys.stderr, flush=True)
        time.sleep(0.05)
for item in job.findings:
    print("found", item.code, file=sys.stderr, flush=True)
"""


def content(path: Path) -> bytes:
    """Pixels of an image, whose header says when it was rendered; else all bytes."""
    if path.suffix == ".exr":
        return b"".join(plane.tobytes() for plane in read_exr(path).values())
    return path.read_bytes()


def tasks(text: str) -> list[str]:
    return [line for line in text.splitlines() if line.startswith("task")]


def measured_by_two(folder: Path, kind: str, go: Path) -> list[list[str]]:
    """Renders that each of two processes made."""
    command = [sys.executable, "-c", MEASURE, str(folder), kind, str(go)]
    children = [
        subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        for _ in range(2)
    ]
    try:
        for child in children:
            assert child.stderr is not None
            while child.stderr.readline() != "ready\n":
                assert child.poll() is None
        go.touch()
        texts = [child.communicate(timeout=240)[1] for child in children]
        assert [child.returncode for child in children] == [0, 0], texts
    finally:
        for child in children:
            child.kill()
            child.wait()
    return [tasks(text) for text in texts]


@pytest.mark.parametrize(("kind", "files"), [("rings", "*.exr"), ("paths", "paths.npz")])
def test_two_processes_measure_what_one_would(
    tmp_path: Path,
    kind: str,
    files: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """All frames once, and the same bytes."""
    folders = [tmp_path / "alone", tmp_path / "shared"]
    for folder in folders:
        folder.mkdir()
    go = tmp_path / "go"
    both = measured_by_two(folders[1], kind, go)
    monkeypatch.setattr(sys, "argv", ["-c", str(folders[0]), kind, str(go)])
    exec(MEASURE, {})
    alone = tasks(capsys.readouterr().err)
    assert all(both), "one process did all frames"
    assert sorted(both[0] + both[1]) == sorted(alone)
    one, two = ({p.relative_to(f): content(p) for p in f.rglob(files)} for f in folders)
    assert len(one) >= 5 and one == two
    assert not [*folders[1].rglob("*.lease"), *folders[1].rglob("*.part*")]
