# SPDX-License-Identifier: GPL-3.0-or-later
"""Two mirrors that meet at 60 degrees about a crooked axis, against the image method in numpy."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix

from tests.blender import crooked_scene as cs
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender

METRES_PER_UNIT = 0.5
#: The wedge's axes in the world: its edge is Z, it opens along +Y. All places are in these [m].
POSE = cs.matrix((3.0, -7.0, 11.0), (0.7, -0.4, 1.1), (1, 1, 1))
RADAR = np.array([0.8, 10.0, 0.3])
NORMALS = {"left": np.array([0.75**0.5, 0.5, 0.0]), "right": np.array([-(0.75**0.5), 0.5, 0.0])}
SCALES = {"left": (1.7, 0.6, 1.2), "right": (0.8, 2.0, -1.3)}
NEAR_M, FAR_M, HALF_M = 0.5, 30.0, 8.0
#: Plates across the opening: x, y, z of the middle, half a side.
PLATES = [(-2.0, 16.0, 0.4, 0.3), (1.5, 18.0, -0.6, 0.3), (0.2, 21.0, 1.5, 0.3)]
CHAINS = [(), ("left",), ("right",), ("left", "right"), ("right", "left")]


def add(name: str, corners: np.ndarray, material: Any, scale: Any) -> None:
    """A quadrilateral by its corners, as a mesh in axes that are turned and scaled unevenly."""
    world = cs.matrix((1.0, 2.0, 0.5), (0.3, -0.6, 0.9), scale)
    placed = (corners @ POSE[:3, :3].T + POSE[:3, 3]) / METRES_PER_UNIT
    own = (placed - world[:3, 3]) @ np.linalg.inv(world[:3, :3]).T
    ph.quad(name, [tuple(one) for one in own], material).matrix_world = Matrix(world)


def build(order: int, kind: str) -> None:
    """The scene, its objects made in this order or the other."""
    rs.new_scene().unit_settings.scale_length = METRES_PER_UNIT
    camera = bpy.context.scene.camera.data
    camera.type, camera.ortho_scale = kind, 12 / METRES_PER_UNIT
    ph.field_of_view(90)
    rig = POSE.copy()
    rig[:3, 3] = (POSE @ [*RADAR, 1])[:3] / METRES_PER_UNIT
    radar = bpy.data.objects["Radar"]
    radar.matrix_world = Matrix(rig) @ radar.matrix_basis
    wall, rough = ph.mirror(), ph.rough_metal()
    parts: list[tuple[str, np.ndarray, Any, Any]] = []
    for name, (x, y, _) in NORMALS.items():
        along = np.array([-y * np.sign(x), abs(x), 0.0])
        edges = [(NEAR_M, -1), (FAR_M, -1), (FAR_M, 1), (NEAR_M, 1)]
        corners = [at * along + (0, 0, side * HALF_M) for at, side in edges]
        parts.append((name, np.array(corners), wall, SCALES[name]))
    for number, (x, y, z, h) in enumerate(PLATES):
        corners = [(x + a * h, y, z + b * h) for a, b in [(-1, -1), (1, -1), (1, 1), (-1, 1)]]
        parts.append((f"Plate {number}", np.array(corners), rough, (0.5, 1.5, 1.0)))
    for part in parts[::order]:
        add(*part)


def upright(way: np.ndarray) -> np.ndarray:
    """Field of a vertical wave that goes along a unit vector of the wedge's axes."""
    level = np.cross(way, POSE[2, :3])
    return np.cross(level, way) / np.linalg.norm(level)


def one_way(point: np.ndarray, chain: tuple[str, ...]) -> tuple[float, float] | None:
    """Length from the radar over mirrors in their order to a point of a plate, and the part of the
    vertical field of a metal's mirrors, times the root of the cosine at the plate, over the length.
    """
    images = [RADAR]
    for name in chain:
        images.append(images[-1] - 2 * (images[-1] @ NORMALS[name]) * NORMALS[name])
    stations, at = [point], point
    for name, aim in zip(chain[::-1], images[:0:-1], strict=True):
        before, after = at @ NORMALS[name], aim @ NORMALS[name]
        if before <= 1e-9 or after >= 0:
            return None
        at = at + (aim - at) * before / (before - after)
        if not (NEAR_M < np.hypot(*at[:2]) < FAR_M and abs(at[2]) < HALF_M):
            return None
        stations.append(at)
    stations = [RADAR, *stations[::-1]]
    for a, b in itertools.pairwise(stations):
        for x, y, z, half in PLATES:
            if min(a[1], b[1]) + 1e-4 < y < max(a[1], b[1]) - 1e-4:
                there = a + (b - a) * (y - a[1]) / (b[1] - a[1])
                if abs(there[0] - x) < half and abs(there[2] - z) < half:
                    return None
    legs = np.diff(stations, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    field = upright(legs[0] / lengths[0])
    for name in chain:
        field = 2 * (field @ NORMALS[name]) * NORMALS[name] - field
    last = legs[-1] / lengths[-1]
    length = float(lengths.sum())
    return length, float(field @ upright(last) * np.sqrt(last[1]) / length)


def measured(folder: Path, order: int, kind: str) -> tuple[np.ndarray, list[tuple[str, ...]]]:
    """Rows of paths, and the mirrors of each image."""
    build(order, kind)
    run = ph.run_paths(
        folder,
        width_px=120,
        height_px=120,
        polarisation="vertical",
        options={"max_reflections": 3},
    )
    rows, record = run.table(), run.record()
    chains = [(), *(tuple(image.objects) for image in record.images)]
    assert sorted(chains) == sorted(CHAINS)
    return rows, chains


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_paths_over_both_mirrors(tmp_path: Path, kind: str) -> None:
    """All paths of each point, their lengths, powers and phases over those of the direct path.

    With another order of the objects they are the same.
    """
    rows, chains = measured(tmp_path / "one", 1, kind)
    points, of_point = np.unique(rows["last_scatterer_m"], axis=0, return_inverse=True)
    assert len(points) > 60
    for number, point in enumerate((points - POSE[:3, 3]) @ POSE[:3, :3]):
        mine = rows[of_point.reshape(-1) == number]
        ways = {chain: found for chain in CHAINS if (found := one_way(point, chain))}
        pairs = [(chains[row["receiver_image"]], chains[row["transmitter_image"]]) for row in mine]
        backs = [()] if kind == "ORTHO" else ways
        expected = [pair for pair in itertools.product(backs, ways) if sum(map(len, pair)) <= 2]
        assert sorted(pairs) == sorted(expected)
        direct = mine[pairs.index(((), ()))]
        for (back, there), row in zip(pairs, mine, strict=True):
            length_m = ways[back][0] + ways[there][0]
            if kind == "ORTHO":  # back to a plane
                length_m += point[1] - RADAR[1] - ways[()][0]
            field = ways[back][1] * ways[there][1] / ways[()][1] ** 2
            assert row["length_m"] == pytest.approx(length_m, abs=1e-5)
            assert row["power_w"] / direct["power_w"] == pytest.approx(field**2, rel=2e-3)
            turned = np.exp(1j * (row["mirror_phase_rad"] - direct["mirror_phase_rad"]))
            assert turned == pytest.approx(np.sign(field), abs=1e-3)
    if kind == "ORTHO":
        return
    other, _ = measured(tmp_path / "other", -1, kind)
    for name in ("length_m", "power_w"):
        np.testing.assert_allclose(np.sort(other[name]), np.sort(rows[name]), rtol=1e-6)
