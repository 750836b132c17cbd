# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits are crossed: just below and just above."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest

from radarsim_addon.blender.scene import finite_checks, mesh_checks, rig, view_checks
from radarsim_addon.blender.state import evaluated_snapshot, read_mesh
from radarsim_addon.errors import SceneError
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


def _tilted(tilt_rad: float) -> bool:
    """Whether two triangles of 1 km within 5 m coincide."""
    flat = np.array([[0.0, 0, 0], [1000, 0, 0], [0, 1000, 0]])
    pair = np.stack([flat, flat + [0, 0, 1] * flat[:, :1] * np.tan(tilt_rad)])
    return bool(mesh_checks._coincide(pair[None], np.array([5.0]))[0])


def _nested(count: int) -> bool:
    item: Any = SimpleNamespace(name="a", entered=True, low=np.zeros(3), high=np.ones(3))
    return bool(mesh_checks._nested_too_deep([item] * count))


def _bent(angle_deg: float) -> bool:
    mesh = bpy.data.meshes.new("bent")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    angle_rad = np.radians(angle_deg)
    mesh.normals_split_custom_set([(np.sin(angle_rad), 0, np.cos(angle_rad))] * 3)
    return mesh_checks._bent(read_mesh(mesh)) > 0


def _flat(thickness: float) -> bool:
    """Whether a box of 2 x 1 below the receiver is a flat surface."""
    bits = np.array([[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]])
    corners = (np.concatenate([bits, bits + np.array([1, 0, 0])]) - 0.5) * [2, 1, thickness]
    boxes: Any = SimpleNamespace(
        rows=np.zeros(1, dtype=np.intp),
        corners=corners[None],
        snapshot=SimpleNamespace(label=lambda row: "box"),
    )
    pose = np.eye(4)
    pose[2, 3] = 10.0
    return bool(
        rs.finished(view_checks.measure_pixel_spans(boxes, pose, (-1, 1, -1, 1), 1.0)).surfaces
    )


def _far(coordinate: float) -> bool:
    return _refuses(finite_checks.check_vertices, "a", np.array([[coordinate, 0, 0]]), 1.0)


def _scaled(deviation: float) -> bool:
    pose = np.diag([1 + deviation, 1, 1, 1])
    return _refuses(rig.check_scale, SimpleNamespace(name="a"), pose)


def _refuses(check: Any, *values: Any) -> bool:
    try:
        check(*values)
    except SceneError:
        return True
    return False


@pytest.mark.parametrize(
    ("decides", "on", "off"),
    [
        pytest.param(_tilted, 0.9e-3, 1.1e-3, id="parallel"),
        pytest.param(_nested, 4000, 4001, id="most-boxes"),
        pytest.param(_bent, 26.0, 24.0, id="normal-off-face"),
        pytest.param(_flat, 0.19, 0.21, id="flat"),
        pytest.param(_far, 1.1e18, 0.9e18, id="coordinate"),
        pytest.param(_scaled, 1.1e-4, 0.4e-4, id="antenna-scale"),
    ],
)
def test_limit_decides(decides: Any, on: float, off: float) -> None:
    assert decides(on)
    assert not decides(off)


@pytest.mark.parametrize(("tilt_deg", "level"), [(0.9, True), (1.1, False)])
def test_level_ground(tilt_deg: float, level: bool, empty_scene: Any) -> None:
    bpy.ops.mesh.primitive_plane_add(size=10, rotation=(np.radians(tilt_deg), 0, 0))
    snapshot = evaluated_snapshot(bpy.context.view_layer)
    assert _refuses(view_checks.ground_below, snapshot, np.array([0, 0, 5.0])) != level


@pytest.mark.parametrize(("fraction", "named"), [(0.06, True), (0.04, False)])
def test_bent_fraction(
    fraction: float, named: bool, empty_scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    bpy.ops.mesh.primitive_plane_add()
    monkeypatch.setattr(mesh_checks, "_bent", lambda mesh: fraction)
    found = mesh_checks.check_normals(evaluated_snapshot(bpy.context.view_layer))
    assert bool(found) == named
