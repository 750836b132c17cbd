# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames of many instances, of which few move: as if each body were looked at by itself."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from radarsim_addon.blender.motion import bodies
from radarsim_addon.blender.paths.path_job import StillFrames
from radarsim_addon.blender.plan import Extent
from radarsim_addon.blender.run import run_job
from radarsim_addon.blender.scene.ground_truth import Boxes, extent_of_boxes
from radarsim_addon.blender.state import Snapshot, forget_snapshot, take_snapshot
from radarsim_addon.contract import MOTION_FILE, STILL_BODIES_FILE, MotionRecord, frame_dir
from radarsim_addon.signal.motion import FrameMotion, read_motion
from radarsim_addon.signal.radar import Burst
from radarsim_addon.typed_json import file_sha256, read_record
from tests.blender import motion_helpers as mh
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

FRAMES = (1, 3, 4)
BURST = Burst(1000.0, 64)


def field(moves: bool = True, instances_move: bool = False) -> None:
    """Tiles on the vertices of a mesh before the radar, and a plate that moves over them."""
    rs.new_scene()
    ph.field_of_view(40)
    tile = ph.quad("Tile", [(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)], ph.lambert(0.5))
    places = [(2.5 * (i % 6) - 6, 30.0, 2.5 * (i // 6) - 6) for i in range(36)]
    mesh = bpy.data.meshes.new("Field")
    mesh.from_pydata(places, [], [])
    carrier = bpy.data.objects.new("Field", mesh)
    bpy.context.scene.collection.objects.link(carrier)
    tile.parent, carrier.instance_type = carrier, "VERTS"
    plate = ph.quad("Plate", [(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)], ph.lambert(0.5))
    for item, moving in ((plate, moves), (carrier, instances_move)):
        item.location.y = 20.0 if item is plate else 0.0
        if moving:
            rs.move_steadily(item, (1.0, 5.0, 0.0))


def measured(folder: Path) -> ph.PathRun:
    return ph.run_paths(
        folder, identity="file", frames=FRAMES, burst=BURST, width_px=32, height_px=32
    )


def motion_of(run: ph.PathRun, frame: int) -> FrameMotion:
    folder = run.folder / frame_dir(frame)
    return read_motion(folder, frame, file_sha256(folder / MOTION_FILE))


def alike(one: ph.PathRun, other: ph.PathRun) -> None:
    """Tables and motions of two runs are the same to the last bit."""
    for frame in FRAMES:
        assert one.table(frame).tobytes() == other.table(frame).tobytes()
        first, second = motion_of(one, frame), motion_of(other, frame)
        assert first.body_keys == second.body_keys
        assert len(set(first.body_keys)) > 20
        for mine, own in zip(first.bodies, second.bodies, strict=True):
            assert repr(mine) == repr(own)


def walk_again(view_layer: bpy.types.ViewLayer) -> Snapshot:
    """The snapshot of a view layer, of which nothing is known from before."""
    view_layer.update()
    forget_snapshot()
    return take_snapshot(view_layer.depsgraph)


@pytest.mark.parametrize("instances_move", [False, True])
def test_samples_are_those_of_a_walk_each_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, instances_move: bool
) -> None:
    field(instances_move=instances_move)
    run = measured(tmp_path / "few")
    moving = [one.moving for one in motion_of(run, 1).bodies]
    assert sum(moving) == (len(moving) if instances_move else 1)
    field(instances_move=instances_move)
    monkeypatch.setattr(run_job, "evaluated_snapshot", walk_again)
    alike(run, measured(tmp_path / "walks"))


def test_stationary_bodies_in_a_file_are_those_of_records(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    field()
    run = measured(tmp_path / "records")
    monkeypatch.setattr(bodies, "MANY", 20)
    field()
    other = measured(tmp_path / "file")
    alike(run, other)
    for one, many in ((run, False), (other, True)):
        folder = one.folder / frame_dir(1)
        assert (folder / STILL_BODIES_FILE).exists() == many
        record = read_record(folder / MOTION_FILE, MotionRecord)
        assert (len(record.bodies) == 1) == many


def test_a_frame_without_its_file_of_bodies_is_rendered_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bodies, "MANY", 20)
    field()
    measured(tmp_path)
    field()
    assert measured(tmp_path).job.path_scene.renders == 0, "all is there"
    path = tmp_path / frame_dir(3) / STILL_BODIES_FILE
    whole = path.read_bytes()
    for left in (None, whole[:-50], whole[:200] + b"?" + whole[201:]):
        path.unlink() if left is None else path.write_bytes(left)
        field()
        assert measured(tmp_path).job.path_scene.renders > 0
        assert path.read_bytes() == whole


def test_frames_without_motion_have_the_file_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bodies, "MANY", 20)
    field(moves=False)
    run = measured(tmp_path / "still")
    assert run.record(FRAMES[-1]).renders == 0
    monkeypatch.setattr(StillFrames, "holds", lambda *_: False)
    field(moves=False)
    alike(run, measured(tmp_path / "rendered"))


def farthest(boxes: Boxes, antennas: Any) -> Extent:
    """The extent from all corners."""
    corners = boxes.snapshot.corners[boxes.rows].reshape(-1, 3)
    away = [np.linalg.norm(corners - place, axis=1).max() for place in antennas]
    return Extent(
        from_emitter_m=float(away[1]),
        from_receiver_m=float(away[0]),
        baseline_m=float(np.linalg.norm(antennas[0] - antennas[1])),
        diameter_m=float(np.linalg.norm(np.ptp(corners, axis=0))),
    )


def test_the_extent_is_that_of_all_corners() -> None:
    rs.new_scene()
    rng = np.random.default_rng(3)
    for number in range(40):
        item = mh.facets(f"Box {number}", [(0, 0, 0), (0, 0.3, 0)], 1.0)
        item.location = rng.uniform(-30, 30, 3)
        item.rotation_euler = rng.uniform(0, 6, 3)
        item.scale = 10 ** rng.uniform(-2, 1.5, 3)
    snapshot = take_snapshot(bpy.context.evaluated_depsgraph_get())
    surfaces = [shape.kind == "MESH" for shape in snapshot.shapes]
    boxes = Boxes(snapshot, np.flatnonzero(snapshot.of_shapes(surfaces)))
    for reach in (0.0, 10.0, 100.0, 1e6):
        for _ in range(20):
            antennas = tuple(rng.normal(size=(2, 3)) * reach)
            found = extent_of_boxes(boxes, antennas, 1.0)
            assert dataclasses.astuple(found) == dataclasses.astuple(farthest(boxes, antennas))


def test_the_motion_file_stays_small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bodies, "MANY", 20)
    field()
    run = measured(tmp_path)
    text = (run.folder / frame_dir(1) / MOTION_FILE).read_text()
    assert [one["object"] for one in json.loads(text)["bodies"]] == ["Plate"]


def test_instances_have_the_name_of_now() -> None:
    """Names are kept from frame to frame, until someone renames what they come from."""
    field()
    layout = take_snapshot(bpy.context.evaluated_depsgraph_get()).layout
    rows = np.flatnonzero(layout.instancer >= 0)
    for name in ("Field", "Field", "Other"):
        bpy.data.objects[layout.instancers[0].name].name = name
        found = bodies._instance_names(layout, rows[::2])
        assert len(found) == 18
        assert all(one.split("/")[0] == name for one in found)
        assert len(set(found)) == 18
