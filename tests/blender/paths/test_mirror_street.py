# SPDX-License-Identifier: GPL-3.0-or-later
"""A street between two walls that mirror, against an image-method tracer written here."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix

from radarsim_addon.blender.materials import physical_materials as pm
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender

INDEX = 2.3 + 0.1j
RADAR = np.array([0.7, 0.0, 0.0])
#: Walls at x, facing inwards, over y and z.
WALLS = {"left": (-5.0, 1.0), "right": (4.0, -1.0)}
WALL_Y, WALL_Z = (4.0, 26.0), (-3.0, 3.0)
#: Plates across the street: x, y, z of the middle, half a side.
PLATES = [(1.0, 30.0, 0.0, 0.15), (-3.0, 44.0, 0.0, 0.2), (2.6, 37.0, 0.0, 0.2)]
CHAINS = [(), ("left",), ("right",), ("left", "right"), ("right", "left")]


def across(point: np.ndarray, wall: str) -> np.ndarray:
    """Image of a point in a wall."""
    return np.array([2 * WALLS[wall][0] - point[0], point[1], point[2]])


def ways(antenna: np.ndarray, point: np.ndarray, chain: tuple[str, ...]) -> list[np.ndarray] | None:
    """Points from an antenna over walls in their order to a point; None where there is no way."""
    images = [antenna]
    for wall in chain:
        images.append(across(images[-1], wall))
    stations, at = [point], point
    for number in range(len(chain) - 1, -1, -1):
        x, facing = WALLS[chain[number]]
        aim = images[number + 1]
        if (at[0] - x) * facing <= 1e-9 or (aim[0] - x) * facing >= 0:
            return None
        at = at + (aim - at) * (x - at[0]) / (aim[0] - at[0])
        if not (WALL_Y[0] <= at[1] <= WALL_Y[1] and WALL_Z[0] <= at[2] <= WALL_Z[1]):
            return None
        stations.append(at)
    stations.append(antenna)
    for a, b in itertools.pairwise(stations):
        for x, y, z, half in PLATES:
            if min(a[1], b[1]) + 1e-6 < y < max(a[1], b[1]) - 1e-6:
                there = a + (b - a) * (y - a[1]) / (b[1] - a[1])
                if abs(there[0] - x) < half and abs(there[2] - z) < half:
                    return None
    return stations[::-1]


def one_way(stations: list[np.ndarray]) -> tuple[float, complex]:
    """Length, and field at a plate across the street over that without spreading."""
    legs = [b - a for a, b in itertools.pairwise(stations)]
    length = float(sum(np.linalg.norm(leg) for leg in legs))
    field = complex(np.sqrt(abs(legs[-1][1]) / np.linalg.norm(legs[-1])) / length)
    for leg in legs[:-1]:
        cosine = abs(leg[0]) / np.linalg.norm(leg)
        root = np.sqrt(INDEX**2 - (1 - cosine**2))
        field *= (cosine - root) / (cosine + root)  # vertical field along the wall
    return length, field


@pytest.mark.parametrize("transmitter", [RADAR, np.array([-1.2, 6.0, 0.8])], ids=["mono", "bi"])
def test_all_paths_of_a_street(tmp_path: Path, transmitter: np.ndarray) -> None:
    rs.new_scene()
    ph.field_of_view(30)
    ph.radar_at(tuple(RADAR))
    bpy.context.view_layer.update()
    if transmitter is not RADAR:
        bpy.data.objects["Radar Emitter"].matrix_world = Matrix.Translation(transmitter)
    wall = pm.make_physical_material(
        "Wall", "index", carrier_hz=5.3e9, n=INDEX.real, k=INDEX.imag, penetrable=False
    )
    for name, (x, _) in WALLS.items():
        (near, far), (low, high) = WALL_Y, WALL_Z
        ph.quad(name, [(x, near, low), (x, far, low), (x, far, high), (x, near, high)], wall)
    rough = ph.rough_metal()
    for number, (x, y, z, h) in enumerate(PLATES):
        corners = [(x - h, y, z - h), (x + h, y, z - h), (x + h, y, z + h), (x - h, y, z + h)]
        ph.quad(f"Plate {number}", corners, rough)
    run = ph.run_paths(
        tmp_path,
        width_px=256,
        height_px=256,
        polarisation="vertical",
        options={"max_reflections": 3},
    )
    rows, record = run.table(), run.record()
    chain_of = [()] + [
        tuple("left" if normal[0] > 0 else "right" for normal in image.normals)
        for image in record.images
    ]
    assert sorted(chain_of) == sorted(CHAINS)
    assert not [item for item in record.findings if "mirror" in item.code]
    assert {int(n) for n in rows["last_object"]} == {
        record.objects.index(f"Plate {number}") + 1 for number in range(3)
    }
    found, missing, error_m, error_db = 0, 0, 0.0, 0.0
    # the paths of one point, each alone where a point has one only
    keys = np.where(rows["point"] > 0, rows["point"].astype(int), -1 - np.arange(rows.size))
    groups = [rows[keys == key] for key in np.unique(keys)]
    assert len(groups) > 10
    for mine in groups:
        point = mine[0]["last_scatterer_m"]
        paths: dict[tuple[tuple[str, ...], ...], np.ndarray] = {
            (chain_of[row["receiver_image"]], chain_of[row["transmitter_image"]]): row
            for row in mine
        }
        assert len(paths) == len(mine)
        known = [
            {
                chain: one_way(way)
                for chain in CHAINS
                if (way := ways(end, point, chain)) is not None
            }
            for end in (RADAR, transmitter)
        ]
        expected = {pair for pair in itertools.product(*known) if sum(map(len, pair)) <= 2}
        missing += len(expected ^ set(paths))
        fields = {pair: known[0][pair[0]][1] * known[1][pair[1]][1] for pair in expected}
        first = next(iter(sorted(expected & set(paths), key=lambda pair: sum(map(len, pair)))))
        for pair in expected & set(paths):
            length = sum(known[end][pair[end]][0] for end in (0, 1))
            error_m = max(error_m, abs(paths[pair]["length_m"] - length))
            ratio = fields[pair] / fields[first]
            power = paths[pair]["power_w"] / paths[first]["power_w"]
            error_db = max(error_db, abs(10 * np.log10(power / abs(ratio) ** 2)))
            turned_rad = paths[pair]["mirror_phase_rad"] - paths[first]["mirror_phase_rad"]
            assert abs(np.angle(np.exp(1j * turned_rad) * ratio / abs(ratio))) < 1e-3
            found += 1
    assert found > 4 * len(groups)
    assert missing == 0
    assert error_m < 1e-5
    assert error_db < 0.05
    # and nothing is there twice: what other pixels see in the walls is left out
    assert found == rows.size
