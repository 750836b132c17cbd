# SPDX-License-Identifier: GPL-3.0-or-later
"""What simple Radar Materials delay too much at a slant is said, and it is what a run shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import nodes
from radarsim_addon.physics.fresnel import excess_path_m
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.paths.test_paths_walls import medium, slab

pytestmark = pytest.mark.blender


@pytest.mark.parametrize("angle_deg", [30.0, 60.0])
def test_a_simple_wall_is_too_long_at_a_slant(tmp_path: Path, angle_deg: float) -> None:
    lengths_m = []
    for used in (False, True):
        rs.new_scene()
        ph.field_of_view(0.05)
        rs.add_plate(100.0)
        if used:
            slab(20.0, 0.2, angle_deg, nodes.make_material("Simple", 2.05, 0.0, 0.0, 0.5))
        run = ph.run_paths(tmp_path / str(used), width_px=4, height_px=4)
        rows = run.table()
        lengths_m.append(rows["length_m"][rows["last_scatterer_m"][:, 1] > 99].mean())
    (said,) = (one for one in run.job.findings if one.code == "interior-not-refracted")
    assert (said.severity, said.subjects) == ("info", ("Wall",))
    right_m = 2 * float(excess_path_m(2.05, 0.2, np.cos(np.radians(angle_deg))))
    too_long_m = lengths_m[1] - lengths_m[0] - right_m
    assert said.numbers[f"too_long_{angle_deg:.0f}_m"] == pytest.approx(too_long_m, rel=5e-3)


def test_physical_walls_and_opaque_ones_are_not_named(tmp_path: Path) -> None:
    rs.new_scene()
    slab(20.0, 0.2, 30.0, medium("Wall", 4.2))
    slab(30.0, 0.2, 30.0, ph.rough_metal())
    run = ph.run_paths(tmp_path, width_px=4, height_px=4)
    assert "interior-not-refracted" not in {one.code for one in run.job.findings}
