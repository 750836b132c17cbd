# SPDX-License-Identifier: GPL-3.0-or-later
"""A new radar is where the user looks from, or outside the scene, and looks at the selection."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix, Vector

from radarsim_addon.blender.ui.operators import radar_pose
from tests.blender import render_helpers as rh

pytestmark = pytest.mark.blender


def seen_by(radar: Any) -> str:
    """Name of the object that the boresight meets first."""
    bpy.context.view_layer.update()
    forward = radar.matrix_world.to_3x3() @ Vector((0, 0, -1))
    origin = radar.matrix_world.translation
    depsgraph = bpy.context.evaluated_depsgraph_get()
    met, *_, item, _ = bpy.context.scene.ray_cast(depsgraph, origin, forward)
    return item.name if met else ""


def view_from(eye: tuple[float, float, float], at: Vector) -> Any:
    """A 3D view, as far as it is asked."""
    turn = (at - Vector(eye)).to_track_quat("-Z", "Y")
    matrix = Matrix.Translation(eye) @ turn.to_matrix().to_4x4()
    return SimpleNamespace(
        view_rotation=turn, view_matrix=matrix.inverted(), view_perspective="PERSP"
    )


def context_with(view: Any) -> Any:
    return SimpleNamespace(scene=bpy.context.scene, space_data=SimpleNamespace(region_3d=view))


def test_default_scene(addon: Any) -> None:
    """The cursor is in the middle of the default cube."""
    bpy.ops.wm.read_factory_settings()
    assert bpy.ops.radarsim.setup_rig() == {"FINISHED"}
    radar = bpy.data.objects["Radar"]
    assert max(abs(x) for x in radar.location) > 1.0  # half the cube
    assert seen_by(radar) == "Cube"


def test_view_and_selection() -> None:
    rh.new_scene()
    left, right = (rh.add_box((x - 1, 9, -1), (x + 1, 11, 1), rh.lambert(0.5)) for x in (-20, 20))
    left.select_set(False)
    right.select_set(True)
    bpy.context.view_layer.update()
    eye = (3.0, -15.0, 4.0)
    found = radar_pose(context_with(view_from(eye, Vector((0, 10, 0)))))
    assert found is not None
    assert (found[0] - Vector(eye)).length < 1e-5
    forward = found[1].to_matrix() @ Vector((0, 0, -1))
    wanted = (Vector((20, 10, 0)) - Vector(eye)).normalized()
    assert (forward - wanted).length < 1e-5
    # From inside the other box: outside of all, in the direction of the view, never within.
    inside = radar_pose(context_with(view_from((-20.0, 10.0, 0.5), Vector((0, 10, 0)))))
    assert inside is not None
    assert inside[0].x < -25
    assert radar_pose(context_with(None))[0].y < -25  # type: ignore[index]


def test_without_objects_the_cursor_counts(addon: Any) -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert radar_pose(context_with(None)) is None
