# SPDX-License-Identifier: GPL-3.0-or-later
"""A street between two walls that mirror, rendered, against an image-method tracer."""

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
from tests.signal.tracing.street import (
    CHAINS,
    INDEX,
    PLATES,
    RADAR,
    WALL_Y,
    WALL_Z,
    WALLS,
    one_way,
    ways,
)  # fmt: skip

pytestmark = pytest.mark.blender


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
