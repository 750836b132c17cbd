# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs repeated, stopped, continued and written over: the same paths, bit by bit."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon import contract
from radarsim_addon.blender.paths import frame
from radarsim_addon.blender.paths.tiles import Tile
from radarsim_addon.blender.views import PathClass, RenderRequest, ViewWindow, requests
from radarsim_addon.blender.views import view_scene as path_scene
from tests.blender import path_helpers as ph
from tests.blender import path_scenes as ps
from tests.blender import radar_scenes as rs

pytestmark = [pytest.mark.blender, pytest.mark.slow]


@pytest.mark.parametrize("mode", ["AUTO", "FIXED"])
def test_number_of_threads_changes_nothing(
    mode: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither the paths, by a bit, nor the user's setting, also the one that is not in force."""
    options = {"max_reflections": 2, "replicates": 2}
    tables = []
    for name, least in (("one", 1 << 30), ("all", 0)):
        monkeypatch.setattr(path_scene, "_ONE_THREAD_BELOW_PX", least)
        ps.furnished_scene(clutter=False)
        render = bpy.context.scene.render
        render.threads_mode, render.threads = "FIXED", 5
        render.threads_mode = mode
        run = ph.run_paths(tmp_path / name, options=options, width_px=40, height_px=40)
        tables.append((run.folder / contract.frame_dir(1) / contract.PATHS_TABLE).read_bytes())
        assert render.threads_mode == mode
        render.threads_mode = "FIXED"
        assert render.threads == 5
    assert tables[0] == tables[1]
    assert run.table().size > 500 and set(run.table()["order"]) == {1, 2}


def test_rows_of_replicates_together_or_one_by_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same table and errors, whether rows are finished view by view or of all at once."""
    found = []
    for name, pixels in (("each", 1), ("some", 2 * 40 * 40), ("all", 1 << 15)):
        monkeypatch.setattr(frame, "_PIXELS_TOGETHER", pixels)
        ps.furnished_scene(clutter=True)
        options = {"max_reflections": 2, "replicates": 3}
        run = ph.run_paths(tmp_path / name, options=options, width_px=40, height_px=40)
        table = (run.folder / contract.frame_dir(1) / contract.PATHS_TABLE).read_bytes()
        record = run.record()
        found.append((table, record.relative_error, record.length_sigma_m, record.findings))
    assert found[0] == found[1] == found[2]
    assert run.table().size > 500 and set(run.table()["replicate"]) == {0, 1, 2}


def test_a_small_render_between_large_ones_keeps_their_threads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another number of threads costs Cycles a new scene, so only many small renders get one."""
    monkeypatch.setattr(path_scene, "_ONE_THREAD_BELOW_PX", 100)
    monkeypatch.setattr(requests, "_ENOUGH_RAYS", 16)
    rs.new_scene()
    ph.plate_at(10, 4, ph.rough_metal())
    render = bpy.context.scene.render
    render.threads_mode, render.threads = "FIXED", 2
    sizes, used = [], []
    job = ph.job_for(tmp_path, frames=(1, 2), width_px=12, height_px=12)
    with job:
        for task in job.pending():
            job.start(task)
            job.render(task)
            if task.request is not None:
                sizes.append(render.resolution_x)
                used.append(render.threads)
            job.finish(task)
        assert sizes == [12, 4, 12, 4]
        assert used == [2, 2, 2, 2]
        small = ViewWindow(-0.1, 0.1, -0.1, 0.1, 4, 4)
        used.clear()
        for _ in range(12):
            job.path_scene.look(small, (0.0, 0.0), 0)
            job.path_scene.begin(RenderRequest(PathClass(order_max=1)), None)
            used.append(render.threads)
    assert used[0] == 2
    assert used[-1] == 1


def test_order_of_tiles_changes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lots are drawn by place, poses are read as they are rendered: the same rows, to the bit."""
    options = {"max_reflections": 2, "replicates": 2, "tile_px": 10}
    ps.furnished_scene(clutter=False)
    forwards = ph.run_paths(tmp_path / "a", options=options, width_px=24, height_px=24).table()
    split = Tile.split
    monkeypatch.setattr(Tile, "split", lambda tile, most: split(tile, most)[::-1])
    ps.furnished_scene(clutter=False)
    backwards = ph.run_paths(tmp_path / "b", options=options, width_px=24, height_px=24).table()
    tiles = backwards["tile"].max()
    assert tiles >= 8
    backwards["tile"] = tiles - backwards["tile"]
    order = np.argsort(backwards["tile"], kind="stable")
    assert backwards[order].tobytes() == forwards.tobytes()


def test_a_frame_that_was_stopped_goes_on(tmp_path: Path) -> None:
    """Finished tiles are taken as they are, parents that were refined too; the table is that of an
    uninterrupted run, bit by bit, also where a kept tile was damaged. Another seed has another.
    """
    options = {
        "max_reflections": 2,
        "replicates": 2,
        "max_standard_error": 0.05,
        "max_refinement_level": 1,
        "tile_px": 12,
    }
    size = {"width_px": 24, "height_px": 24}
    ps.furnished_scene(clutter=False)
    whole = ph.run_paths(tmp_path / "whole", options=options, **size)
    folder = tmp_path / "stopped"
    for limit in (60, 60):
        ph.run_paths(folder, identity="file", options=options, limit=limit, **size)
    tiles = sorted((folder / contract.frame_dir(1) / contract.TILES_DIR).glob("*.rows"))
    assert len(tiles) >= 3
    assert not list(folder.rglob("*.part*"))
    tiles[0].write_bytes(tiles[0].read_bytes()[:-1] + b"?")
    run = ph.run_paths(folder, identity="file", options=options, **size)
    table = Path(contract.frame_dir(1)) / contract.PATHS_TABLE
    assert (folder / table).read_bytes() == (whole.folder / table).read_bytes()
    ours, theirs = run.record(), whole.record()
    changed = {"render_time_s": ours.render_time_s, "run_fingerprint": ours.run_fingerprint}
    assert dataclasses.replace(theirs, **changed) == ours
    assert run.job.path_scene is not None
    assert run.job.path_scene.renders < theirs.renders - 20
    assert not tiles[1].parent.exists()
    assert (run.job.done, run.job.total) == (whole.job.done, whole.job.total)
    assert ours.finest_refinement_level > 0
    other = ph.run_paths(tmp_path / "other", options=options, seed=4, **size)
    assert (other.folder / table).read_bytes() != (whole.folder / table).read_bytes()


def test_small_scenes_need_no_scipy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Importing its trees and matrices takes a second, which is more than all else but Cycles."""

    class Forbidden(ModuleType):
        def __getattr__(self, name: str) -> None:
            raise AssertionError(f"{self.__name__} is used")

    for name in ("scipy", "scipy.spatial", "scipy.sparse"):
        monkeypatch.setitem(sys.modules, name, Forbidden(name))
    with pytest.raises(AssertionError, match="is used"):
        from scipy.spatial import cKDTree  # noqa: F401
    ps.furnished_scene(clutter=False)
    options = {"max_reflections": 2, "replicates": 1}
    table = ph.run_paths(tmp_path, options=options, width_px=16, height_px=16).table()
    assert np.all(table["last_body"][table["order"] == 2] > 0)


def test_a_stopped_run_goes_on(tmp_path: Path) -> None:
    """Whole frames are kept as they are, the frame that was cut off is made anew."""
    rs.new_scene()
    ph.plate_at(10, 4, ph.rough_metal())
    stopped = ph.run_paths(tmp_path, identity="file", frames=(1, 2, 3), limit=3)
    tables = sorted(tmp_path.glob("frames/*/paths.npz"))
    assert 0 < len(tables) < 3
    times = {path: path.stat().st_mtime_ns for path in tables}
    left_over = tmp_path / contract.frame_dir(3) / contract.TILES_DIR / "0.rows.part"
    left_over.parent.mkdir(parents=True, exist_ok=True)
    left_over.write_bytes(b"half")
    run = ph.run_paths(tmp_path, identity="file", frames=(1, 2, 3))
    assert len(list(tmp_path.glob("frames/*/paths.npz"))) == 3
    assert {path: path.stat().st_mtime_ns for path in tables} == times
    assert not list(tmp_path.rglob("*.part*"))
    # Steps: one replicate of one tile, and the table, of three frames.
    assert (run.job.done, run.job.total) == (6, 6)
    assert stopped.job.done < 6
    # A damaged table is made again, a good one is not.
    tables[0].write_bytes(tables[0].read_bytes()[:-1])
    run = ph.run_paths(tmp_path, identity="file", frames=(1, 2, 3))
    assert run.table(1).size == run.table(2).size
    assert tables[0].stat().st_mtime_ns != times[tables[0]]


def test_overwriting_keeps_nothing_of_the_other_run(tmp_path: Path) -> None:
    """A run of other options over an earlier one measures every frame anew."""
    rs.new_scene()
    ph.plate_at(10, 4, ph.rough_metal())
    ph.run_paths(tmp_path)
    run = ph.run_paths(tmp_path, overwrite=True, options={"replicates": 3})
    assert run.record().replicates == 3
    assert set(run.table()["replicate"]) == {0, 1, 2}
