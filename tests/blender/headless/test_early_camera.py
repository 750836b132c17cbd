# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera that renders paths is there before Blender sorts a file's objects; nothing sees it."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.headless import make_job
from radarsim_addon.blender.headless.session import open_job
from radarsim_addon.blender.nodes import attributes
from radarsim_addon.blender.plan import parse_render_arguments
from radarsim_addon.contract import PATHS_TABLE, frame_dir
from radarsim_addon.signal import open_run
from radarsim_addon.signal.paths import open_table
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender
OPTIONS = ("--sampling-mode", "paths", "--width", "16", "--height", "16", "--replicates", "2")


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    """A file with two plates, which have numbers of their own."""
    rs.new_scene()
    ph.radar_at((0.0, 0.0, 0.0))
    for name, y in (("Near", 8.0), ("Far", 12.0)):
        item = ph.plate_at(y, 3.0, ph.rough_metal())
        item.name, item.pass_index = name, 7
    return save(tmp_path)


def save(folder: Path) -> Path:
    path = folder / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def opened(path: Path, *words: str) -> Any:
    """The job of a command line."""
    words = (str(path), *(words or OPTIONS), "--out", str(path.parent / "run"))
    return open_job(parse_render_arguments(list(words)))


def measured(job: Any) -> Any:
    """Rows of the first frame, fingerprint, and whether the user's scene is as before."""
    with job:
        for task in job.pending():
            job.start(task)
            job.render(task)
            job.finish(task)
    assert job.unrestored == []
    rows = open_table(job.folder / frame_dir(1) / PATHS_TABLE).copy()
    return rows, open_run(job.folder).record.fingerprint


def test_results_are_those_without_it_and_the_scene_is_restored(
    saved: Path, tmp_path: Path
) -> None:
    job = opened(saved)
    scene, own = bpy.context.scene, bpy.context.scene.camera
    assert job.view_camera is not None and own == job.view_camera.item
    assert [bpy.data.objects[name].pass_index for name in ("Far", "Near")] == [1, 2]
    rows, fingerprint = measured(job)
    assert rows.size > 100
    assert scene.camera.name == "Radar Receiver"
    assert not any("temporary" in item.name for item in bpy.data.objects)
    assert {bpy.data.objects[name].pass_index for name in ("Far", "Near")} == {7}
    bpy.ops.wm.open_mainfile(filepath=str(saved), load_ui=False)
    given = {"sampling_mode": "paths", "width_px": 16, "height_px": 16, "replicates": 2}
    scene = bpy.context.scene
    later = make_job(scene, bpy.context.view_layer, tmp_path / "later", given=given)
    later.identity = job.identity
    assert later.view_camera is None
    other, other_fingerprint = measured(later)
    assert rows.equals(other) and fingerprint == other_fingerprint


def test_objects_are_sorted_once(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The camera and the numbers tag nothing when the scene is prepared."""
    changed: list[str] = []

    @bpy.app.handlers.persistent
    def note(scene: Any, depsgraph: Any) -> None:
        changed.extend(
            update.id.name for update in depsgraph.updates if update.is_updated_transform
        )

    job = opened(saved)
    bpy.app.handlers.depsgraph_update_post.append(note)
    try:
        with job:
            bpy.context.view_layer.update()
    finally:
        bpy.app.handlers.depsgraph_update_post.remove(note)
    assert "Near" not in changed and "Far" not in changed


def with_nodes() -> None:
    """An object whose Geometry Nodes read the active camera."""
    group = bpy.data.node_groups.new("Faces the camera", "GeometryNodeTree")
    group.nodes.new("GeometryNodeInputActiveCamera")
    bpy.data.objects["Near"].modifiers.new("Nodes", "NODES").node_group = group


def with_driver(path: str) -> None:
    """An object whose height follows a property of the scene or of an object."""
    variable = bpy.data.objects["Near"].driver_add("location", 2).driver.variables.new()
    target = variable.targets[0]
    if "camera" in path:
        target.id_type = "SCENE"
        target.id = bpy.context.scene
    else:
        target.id = bpy.data.objects["Far"]
    target.data_path = path


def by_scene_alone() -> None:
    """The receiver is the scene's camera, and nothing else says so."""
    light = next(item for item in bpy.data.objects if item.type == "LIGHT")
    light.parent = None


@pytest.mark.parametrize(
    "change",
    [
        with_nodes,
        lambda: with_driver("camera.location.x"),
        lambda: with_driver("pass_index"),
        by_scene_alone,
        lambda: bpy.data.objects.remove(bpy.data.objects["Radar Receiver"]),
    ],
)
def test_where_something_would_notice_it_comes_later(
    saved: Path, change: Callable[[], None]
) -> None:
    change()
    path = save(saved.parent)
    camera = bpy.context.scene.camera
    name = camera and camera.name
    job = None
    with contextlib.suppress(Exception):
        job = opened(path)
    assert job is None or job.view_camera is None
    assert (bpy.context.scene.camera and bpy.context.scene.camera.name) == name
    assert {bpy.data.objects[one].pass_index for one in ("Far", "Near")} == {7}
    assert attributes.ATTR_ORDER_MIN not in bpy.context.scene


def test_rings_have_none(saved: Path) -> None:
    assert opened(saved, "--sampling-mode", "rings").view_camera is None
    assert not bpy.app.handlers.load_post or all(
        "early" not in one.__module__ for one in bpy.app.handlers.load_post
    )
