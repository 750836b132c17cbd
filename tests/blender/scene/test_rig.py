# SPDX-License-Identifier: GPL-3.0-or-later
"""The radar in the scene: setting up, finding, refusing."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix

from radarsim_addon.blender.scene import rig, rigid_pose
from radarsim_addon.blender.scene.poses import frame_edges
from radarsim_addon.errors import SceneError
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


def test_set_up_makes_one_radar_that_moves_as_one() -> None:
    scene = rs.new_scene()
    empty = bpy.data.objects["Radar"]
    found = rig.find_rig(scene)
    assert found.camera.parent == found.emitter.parent == empty
    assert scene.camera == found.camera
    assert found.emitter.data.type == "POINT"
    assert found.emitter.data.shadow_soft_size == 0.0
    assert found.emitter.data.use_shadow
    empty.location = (1, 2, 3)
    empty.rotation_euler = (0.3, 0.2, 0.1)
    bpy.context.view_layer.update()
    for item in (found.camera, found.emitter):
        assert tuple(item.matrix_world.translation) == (1, 2, 3)


def test_set_up_looks_level_along_y() -> None:
    scene = rs.new_scene()
    bpy.context.view_layer.update()
    axes = np.array(scene.camera.matrix_world)[:3, :3]
    np.testing.assert_allclose(-axes[:, 2], (0, 1, 0), atol=1e-7)
    np.testing.assert_allclose(axes[:, 1], (0, 0, 1), atol=1e-7)


def test_set_up_keeps_a_camera_and_adds_a_second_radar() -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    own = bpy.data.objects.new("Own", bpy.data.cameras.new("Own"))
    scene.collection.objects.link(own)
    scene.camera = own
    rig.setup_rig(scene)
    assert scene.camera == own
    assert rig.find_rig(scene).camera.name == "Radar Receiver"
    second = rig.setup_rig(scene)
    assert [radar.name for radar in rig.radars(scene)] == ["Radar", second.name]
    if hasattr(scene, rig.ACTIVE_RADAR_PROPERTY):  # another test has registered the settings
        setattr(scene, rig.ACTIVE_RADAR_PROPERTY, None)
    with pytest.raises(SceneError, match="2 transmitters"):
        rig.active_radar(scene)
    found = rig.find_rig(scene, **rig.antennas_of(scene, second))
    assert found.camera.parent == found.emitter.parent == second
    bpy.data.objects.remove(found.emitter)
    assert rig.active_radar(scene).name == "Radar"
    with pytest.raises(SceneError, match="has no transmitter"):
        rig.antennas_of(scene, second)


def test_no_emitter(tmp_path: Path) -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with pytest.raises(SceneError, match=r"no transmitter.*Set Up Radar"):
        rs.run(tmp_path)


def test_a_plain_lamp_is_no_emitter() -> None:
    scene = rs.new_scene()
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    scene.collection.objects.link(lamp)
    assert rig.find_rig(scene).emitter.name == "Radar Emitter"
    with pytest.raises(SceneError, match="'Lamp' is not a transmitter"):
        rig.find_rig(scene, emitter=lamp)


def test_no_camera(tmp_path: Path) -> None:
    scene = rs.new_scene()
    bpy.data.objects.remove(scene.camera)
    with pytest.raises(SceneError, match=r"no camera.*Set Up Radar.*add_radar.*radarsim render"):
        rs.run(tmp_path)


def test_several_emitters_need_a_choice() -> None:
    scene = rs.new_scene()
    first = bpy.data.objects["Radar Emitter"]
    second = first.copy()
    scene.collection.objects.link(second)
    with pytest.raises(SceneError, match="2 transmitters"):
        rig.find_rig(scene)
    assert rig.find_rig(scene, emitter=second).emitter == second
    first.hide_render = True
    assert rig.find_rig(scene).emitter == second
    second.hide_render = True
    with pytest.raises(SceneError, match="is hidden from renders"):
        rig.find_rig(scene)


@pytest.mark.parametrize("kind", ["ORTHO", "PANO"])
def test_other_cameras_are_refused(kind: str) -> None:
    scene = rs.new_scene()
    scene.camera.data.type = kind
    with pytest.raises(SceneError, match=f"of type {kind}"):
        rig.find_rig(scene)


@pytest.mark.parametrize("scale", [(2, 2, 2), (1, 1, 1.01), (-1, 1, 1)])
@pytest.mark.parametrize("name", ["Radar", "Radar Receiver", "Radar Emitter"])
def test_scaled_antennas_are_refused(
    tmp_path: Path, name: str, scale: tuple[float, float, float]
) -> None:
    rs.new_scene()
    bpy.data.objects[name].scale = scale
    with pytest.raises(SceneError, match=r"scaled.*Apply"):
        rs.run(tmp_path)


def test_poses_are_rigid_and_in_metres() -> None:
    turn = Matrix.Rotation(0.7, 4, (1, 2, 3)) @ Matrix.Rotation(-2.0, 4, "Z")
    pose = rigid_pose(Matrix.Translation((1.5, -2, 4)) @ turn, 100.0)
    np.testing.assert_allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), atol=1e-15)
    np.testing.assert_allclose(pose[:3, :3], np.array(turn)[:3, :3], atol=3e-7)
    assert pose[:3, 3].tolist() == [150.0, -200.0, 400.0]


@pytest.mark.parametrize("size", [(64, 64), (80, 48), (48, 80)])
@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
def test_frustum_is_blenders(size: tuple[int, int], fit: str) -> None:
    """Against Camera.view_frame, which is float32."""
    scene = rs.new_scene()
    camera = scene.camera.data
    camera.sensor_fit, camera.sensor_width, camera.sensor_height = fit, 30.0, 20.0
    camera.angle = math.radians(40)
    camera.shift_x, camera.shift_y = 0.1, -0.25
    scene.render.resolution_x, scene.render.resolution_y = size
    corners = np.array([tuple(c) for c in camera.view_frame(scene=scene)])
    tangents = corners[:, :2] / -corners[:, 2:]
    left, right, bottom, top = frame_edges(camera, *size, 1.0)
    low, high = tangents.min(axis=0), tangents.max(axis=0)
    np.testing.assert_allclose((left, bottom), low, atol=1e-6)
    np.testing.assert_allclose((right, top), high, atol=1e-6)
