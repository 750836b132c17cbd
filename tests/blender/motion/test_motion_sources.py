# SPDX-License-Identifier: GPL-3.0-or-later
"""What scripts and drivers move frame by frame, and hair and points that nodes move."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.signal import open_run
from radarsim_addon.signal.decoding import frame_paths
from radarsim_addon.signal.radar import Burst
from tests.blender import motion_helpers as mh
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender

CARRIER_HZ = 77e9
BURST = Burst(10_000.0, 64)
WITHIN = 1e-3


def recede(points: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """3 m/s along Y."""
    return points[:, None] + times_s[:, None] * np.array([0, 3.0, 0])


@pytest.mark.parametrize("how", ["driver", "handler", "shape key"])
def test_what_the_number_of_the_frame_moves(tmp_path: Path, how: str) -> None:
    """Blender holds it for each frame: the poses of whole frames tell the speed, and it is said."""
    mh.scene_at(20.0, 2.0)
    target = mh.facets("Target", [(0, 0, 0), (0.3, 0.2, -0.4)], 0.4)
    target.location = (0, 20, 0)

    def follow(scene: Any, depsgraph: Any = None) -> None:
        target.location.y = 20 + (scene.frame_current - 3) * 3 / 24

    if how != "handler":
        owner, path, index = target, "location", 1
        if how == "shape key":
            target.shape_key_add(name="Basis")
            owner = target.shape_key_add(name="Away")
            owner.slider_min = -1
            for point in owner.data:
                point.co.y += 1
            path, index = "value", -1
        curve = owner.driver_add(path, index).driver
        variable = curve.variables.new()
        variable.targets[0].id_type, variable.targets[0].id = "SCENE", bpy.context.scene
        variable.name, variable.targets[0].data_path = "number", "frame_current"
        curve.expression = f"{20 if how == 'driver' else 0} + (number - 3) * 3 / 24"
    with mh.handler(follow) if how == "handler" else contextlib.nullcontext():
        rows, paths, run = mh.measured(tmp_path, CARRIER_HZ, BURST, frame=3)
    assert rows.size > 10
    error = mh.iq_error(rows, paths, CARRIER_HZ, BURST, recede)
    assert error < WITHIN, error
    (said,) = [one for one in run.job.findings if one.code == "moves-at-whole-frames"]
    assert said.subjects == ("Target",)


#: Blender 4.5 makes point clouds by nodes only.
SCRIPTED = ["CURVES"] + ["POINTCLOUD"] * hasattr(bpy.types.PointCloud, "resize")


@pytest.mark.parametrize("kind", SCRIPTED)
def test_hair_and_points_that_nodes_move(tmp_path: Path, kind: str) -> None:
    """Blender makes no mesh of them; their points tell how they move."""
    mh.scene_at(20.0, 2.0)
    places = np.array([(x, 0.0, z) for x in np.linspace(-0.5, 0.5, 9) for z in (-0.5, 0.0, 0.5)])
    if kind == "CURVES":
        data = bpy.data.hair_curves.new("Hair")
        data.add_curves([3] * 9)
    else:
        data = bpy.data.pointclouds.new("Points")
        data.resize(len(places))
    for name, of, values in (
        ("position", "FLOAT_VECTOR", places),
        ("radius", "FLOAT", [0.05] * 27),
    ):
        held = data.attributes.get(name) or data.attributes.new(name, of, "POINT")
        held.data.foreach_set("vector" if of != "FLOAT" else "value", np.ravel(values).tolist())
    data.materials.append(ph.lambert(0.5))
    item = bpy.data.objects.new("Target", data)
    item.location = (0, 20, 0)
    bpy.context.scene.collection.objects.link(item)
    move_by_nodes(item, 3.0)
    rows, paths, _ = mh.measured(tmp_path, CARRIER_HZ, BURST)
    assert rows.size > 10
    error = mh.iq_error(rows, paths, CARRIER_HZ, BURST, recede)
    assert error < WITHIN, error


def move_by_nodes(item: Any, speed: float) -> None:
    """Geometry Nodes that move all points along Y, by the scene's seconds."""
    tree = bpy.data.node_groups.new("Move", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    kinds = (
        "NodeGroupInput",
        "GeometryNodeInputSceneTime",
        "ShaderNodeMath",
        "ShaderNodeCombineXYZ",
        "GeometryNodeSetPosition",
        "NodeGroupOutput",
    )
    begin, time, times, along, move, end = map(tree.nodes.new, kinds)
    times.operation, times.inputs[1].default_value = "MULTIPLY", speed
    tree.links.new(begin.outputs[0], move.inputs["Geometry"])
    tree.links.new(time.outputs["Seconds"], times.inputs[0])
    tree.links.new(times.outputs[0], along.inputs["Y"])
    tree.links.new(along.outputs[0], move.inputs["Offset"])
    tree.links.new(move.outputs[0], end.inputs[0])
    item.modifiers.new("Move", "NODES").node_group = tree


@pytest.mark.parametrize("number", ["frame_current", "frame_current_final"])
def test_rings_of_what_a_script_moves(tmp_path: Path, number: str) -> None:
    """Two snapshots within a frame see no motion where the script knows whole frames only."""
    mh.scene_at(20.0, 2.0)
    target = mh.facets("Target", [(0, 0, 0), (0.3, 0.2, -0.4)], 0.4)
    target.data.materials[0] = ph.rough_metal()

    def follow(scene: Any, depsgraph: Any = None) -> None:
        target.location.y = 20 + (getattr(scene, number) - 3) * 3 / 24

    with mh.handler(follow):
        job = rs.run(
            tmp_path, frames=(3,), snapshots=2, snapshot_interval_s=0.01, ring_step_m=100.0, rings=1
        )
        rates = frame_paths(open_run(tmp_path).frame(3)).range_rate_mps
    held = [one.subjects for one in job.findings if one.code == "rendered-at-whole-frames"]
    assert held == ([("Target",)] if number == "frame_current" else [])
    assert np.median(rates) == pytest.approx(0.0 if held else 3.0, abs=0.02)
