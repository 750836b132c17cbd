# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames in which nothing changes are written again without a render: the same files."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon import contract
from radarsim_addon.blender.paths.path_job import StillFrames
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


def scene() -> Any:
    """A plate before the radar, and one that lets nothing through behind it."""
    rs.new_scene()
    ph.plate_at(10, 4, ph.rough_metal())
    return bpy.data.objects["Plate"]


def measured(folder: Path) -> list[int]:
    """Number of renders of each of four frames."""
    options = {"max_reflections": 2, "replicates": 2}
    size = {"width_px": 16, "height_px": 16}
    run = ph.run_paths(folder, options=options, frames=(1, 2, 5, 6), **size)
    assert run.job.done == run.job.total
    frame = int(run.job.summary.split(":")[0].removeprefix("frame "))  # rendered last
    assert f": {run.record(frame).path_count:,} paths, standard error" in run.job.summary
    return [run.record(frame).renders for frame in (1, 2, 5, 6)]


def contents(folder: Path, frame: int) -> dict[str, Any]:
    """All files of a frame, without what its renders cost, the name of its run and the digest."""
    found: dict[str, Any] = {}
    for path in sorted((folder / contract.frame_dir(frame)).iterdir()):
        if path.suffix != ".json":
            found[path.name] = path.read_bytes()
            continue
        found[path.name] = json.loads(path.read_text())
        for name in ("renders", "render_time_s", "run_fingerprint", "record_sha256"):
            found[path.name].pop(name, None)
    return found


def test_frames_in_which_nothing_changes_are_written_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every file is that of a run that renders all frames."""
    scene()
    renders = measured(tmp_path / "still")
    assert renders[0] > 0
    assert renders[2:] == [0, 0]
    monkeypatch.setattr(StillFrames, "holds", lambda *_: False)
    scene()
    assert all(measured(tmp_path / "rendered"))
    for frame in (1, 2, 5, 6):
        files = [contents(tmp_path / name, frame) for name in ("still", "rendered")]
        assert len(files[0]) >= 4
        assert files[0] == files[1]


def keyed(item: Any) -> None:
    """Moves only long after the run."""
    for frame, y in ((100, 10.0), (110, 12.0)):
        item.location.y = y
        item.keyframe_insert("location", frame=frame)


def coloured(item: Any) -> None:
    """A value of its material has a driver, whose value stays."""
    tree = item.data.materials[0].node_tree
    curve = tree.driver_add(f'nodes["{tree.nodes[0].name}"].location', 0)
    curve.driver.expression = "frame"


def played(_: Any) -> None:
    """An image of the file changes with the frame."""
    bpy.data.images.new("clip", 4, 4).source = "SEQUENCE"


def handled(item: Any) -> None:
    """A script moves it at frames."""

    def move(_scene: Any, _depsgraph: Any) -> None:
        item.location.y = 10.0

    bpy.app.handlers.frame_change_post.append(move)


@pytest.mark.parametrize("change", [keyed, coloured, played, handled])
def test_frames_that_may_differ_are_rendered(change: Callable[[Any], None], tmp_path: Path) -> None:
    change(scene())
    before = list(bpy.app.handlers.frame_change_post)
    try:
        assert all(measured(tmp_path))
    finally:
        for one in before:
            if one.__module__ == __name__:
                bpy.app.handlers.frame_change_post.remove(one)


def test_what_a_user_changes_between_frames_is_rendered(tmp_path: Path) -> None:
    """The window lets a user work on the scene between two frames of a run."""
    plate = scene()
    with ph.job_for(tmp_path, frames=(1, 2, 3, 4, 5), width_px=16, height_px=16) as job:
        rendered = set()
        for task in job.pending():
            if task.frame == 4 and plate.location.y == 10.0:
                plate.location.y = 11.0
            job.start(task)
            job.render(task)
            job.finish(task)
            if task.request is not None:
                rendered.add(task.frame)
    assert 3 not in rendered
    assert 5 in rendered
