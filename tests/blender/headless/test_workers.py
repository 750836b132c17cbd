# SPDX-License-Identifier: GPL-3.0-or-later
"""Rendering by workers: the same bytes as by one process, also when some are killed."""

from __future__ import annotations

import json
import os
import shutil
import signal
import time
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import rig_settings as properties
from radarsim_addon.blender.headless import FrameRenderer
from radarsim_addon.blender.plan import parse_render_arguments
from radarsim_addon.blender.run import run_job
from scripts.benchmarks.worker_costs import dask_cluster
from tests.blender import radar_scenes as rs
from tests.blender.headless.conftest import Command
from tests.worker_processes import (
    children,
    differences,
    finished,
    products,
    runs,
    start,
    survive,
)

pytestmark = [
    pytest.mark.blender,
    pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="finds workers by /proc"),
]

#: Frames, and kills of workers and of coordinators; `make chaos` sets 60, 40 and 5.
FRAMES, KILLS, COORDINATOR_KILLS = (
    int(number) for number in os.environ.get("RADARSIM_KILLS", "6,2,1").split(",")
)
WORDS = ["--sampling-mode", "paths", "--replicates", 2, "--resolution", "16x16"]


@pytest.fixture(scope="module")
def blend(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scene") / "scene.blend"
    properties.register()
    try:
        rs.new_scene()
        rs.move_steadily(rs.add_plate(10.0, preset="ground"), (0, 5, 0))
        bpy.context.scene.frame_end = 100
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    finally:
        properties.unregister()
    return path


@pytest.fixture(scope="module")
def alone(blend: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run by one process."""
    folder = tmp_path_factory.mktemp("alone") / "run"
    finished("render", blend, "--out", folder, "--frames", f"1:{FRAMES}", *WORDS)
    finished("process", folder, "--no-plots", "--cfar", "ca")
    return folder


def tables(folder: Path) -> dict[str, bytes]:
    """All that was measured, but for the time that it took."""
    found = {}
    for path in (folder / "frames").rglob("*"):
        if path.is_file():
            name, content = str(path.relative_to(folder)), path.read_bytes()
            if path.name == "paths.json":
                content = json.dumps(
                    json.loads(content) | {"render_time_s": 0, "record_sha256": ""}
                ).encode()
            found[name] = content
    return found


def assert_same(folder: Path, alone: Path) -> None:
    assert not differences(tables(folder), tables(alone))
    assert (folder / "run.json").read_bytes() == (alone / "run.json").read_bytes()
    assert not list(folder.rglob("*.lease")) + list(folder.rglob("*.part*"))


def mixed(workers: int, coordinators: int) -> list[str]:
    """Kills, those of the coordinator evenly between the others."""
    every = (workers + coordinators) // (coordinators + 1)
    kills = ["worker"] * workers
    for number in range(coordinators):
        kills.insert((number + 1) * every, "coordinator")
    return kills


def test_killed_workers_and_coordinators_change_no_byte(
    blend: Path, alone: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    render = ["render", blend, "--out", folder, "--frames", f"1:{FRAMES}", *WORDS, "--workers", 2]
    process = ["process", folder, "--no-plots", "--cfar", "ca", "--workers", 2]
    kills = mixed(KILLS, COORDINATOR_KILLS)
    rendering = kills[: -(len(kills) // 3)]
    done = survive(render, folder, "frames/*/paths.json", iter(rendering))
    assert_same(folder, alone)
    later = kills[len(rendering) :]
    processing = survive(process, folder, "products/*_summary.json", iter(later))
    assert not differences(products(folder), products(alone))
    print(f"killed: {done.count('worker')} + {processing.count('worker')} workers, ", end="")
    print(f"{done.count('coordinator')} + {processing.count('coordinator')} coordinators")
    assert "worker" in done


def test_a_signal_ends_all_workers_and_the_command_resumes(
    blend: Path, alone: Path, tmp_path: Path
) -> None:
    """SIGTERM; tests/signal/pipeline/test_process_workers.py sends SIGINT."""
    folder = tmp_path / "run"
    words = ["render", blend, "--out", folder, "--frames", f"1:{FRAMES}", *WORDS, "--workers", 2]
    process = start(*words)
    while process.poll() is None and not list(folder.glob("frames/*/paths.json")):
        time.sleep(0.02)
    workers = children(process)
    process.send_signal(signal.SIGTERM)
    error = process.communicate(timeout=120)[1]
    assert process.returncode == 128 + signal.SIGTERM, error
    assert "the same command resumes the run" in error
    assert workers and not any(map(runs, workers))
    assert not list(folder.rglob("*.lease"))
    assert "100 %" in finished(*words)
    assert_same(folder, alone)


def test_shards_make_one_run(here: Command, blend: Path, alone: Path, tmp_path: Path) -> None:
    """Into folders of their own, or into one; merged they are the run of one process."""
    words = [blend, "--frames", f"1:{FRAMES}", *WORDS, "--process", "--shard"]
    parts = [tmp_path / f"part {index}" for index in (1, 2)]
    for index, part in enumerate(parts, 1):
        assert here(*words, f"{index}/2", "--out", part).returncode == 0
        assert not (part / "products/range_doppler.gif").exists()
    out = finished("merge", tmp_path / "run", *parts)
    assert f"{FRAMES} of {FRAMES} frames" in out
    assert not differences(tables(tmp_path / "run"), tables(alone))
    own = products(tmp_path / "run")
    of_one = products(alone)
    assert len([name for name in own if name.endswith("_map.npz")]) == FRAMES
    assert all(own[name] == of_one[name] for name in own if name.endswith("_map.npz"))
    # what is merged is a whole run: nothing is left to do
    again = here(blend, "--out", tmp_path / "run", "--frames", f"1:{FRAMES}", *WORDS)
    assert ", 0 %" not in again.stdout and "100 %" in again.stdout
    assert not differences(tables(tmp_path / "run"), tables(alone))


def test_dask_workers_change_no_byte(blend: Path, alone: Path, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    folder = tmp_path / "run"
    with dask_cluster(tmp_path) as address:
        words: list[Any] = ["--frames", f"1:{FRAMES}", *WORDS, "--dask", address]
        finished("render", blend, "--out", folder, *words)
        finished("process", folder, "--no-plots", "--cfar", "ca", "--dask", address)
    assert_same(folder, alone)
    assert not differences(products(folder), products(alone))


def test_who_joins_a_run_does_not_look_at_all_its_frames_again(
    blend: Path, alone: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The range window comes from the plan, which is of all frames; another plan is not joined."""
    looked: list[object] = []
    survey = run_job.MeasurementJob._survey
    monkeypatch.setattr(
        run_job.MeasurementJob, "_survey", lambda job: (looked.append(job), survey(job))[1]
    )
    folder = shutil.copytree(alone, tmp_path / "run")
    try:
        for joins, frames, count in ((True, FRAMES, 0), (False, FRAMES, 1), (True, 2, 1)):
            looked.clear()
            words = [blend, "--out", folder, "--frames", f"1:{frames}", *WORDS]
            worker = FrameRenderer(parse_render_arguments([str(word) for word in words]), joins)
            assert worker.do(1) == {"earlier": True, "findings": []}
            worker.close()
            assert len(looked) == count
    finally:
        properties.unregister()
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
