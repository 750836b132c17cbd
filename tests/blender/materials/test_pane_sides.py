# SPDX-License-Identifier: GPL-3.0-or-later
"""A thin sheet on a box, whose two sides each count as the whole pane, is named."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.physics.fresnel import slab_power
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.paths.test_paths_walls import WAVELENGTH_M, medium
from tests.blender.render_helpers import add_box

pytestmark = pytest.mark.blender

EPS, PANE_M = 6.31 + 0.11j, 0.008


def behind(folder: Path, depth_m: float | None) -> tuple[float, set[str]]:
    """Power of a plate behind a pane, a box of a depth or one face (0) [W]; findings."""
    rs.new_scene()
    ph.field_of_view(0.2)
    rs.add_plate(30.0)
    if depth_m is not None:
        glass = medium("Glass", EPS, sheet_thickness_m=PANE_M)
        if depth_m:
            add_box((-2.1, 10, -2.2), (1.9, 10 + depth_m, 1.8), glass)
        else:
            ph.quad("Pane", [(-2, 10, -2.1), (2.2, 10, -2.1), (2.2, 10, 2), (-2, 10, 2)], glass)
    run = ph.run_paths(folder, width_px=4, height_px=4)
    rows = run.table()
    power_w = float(rows["power_w"][rows["last_scatterer_m"][:, 1] > 29].sum())
    return power_w, {item.code for item in run.job.findings}


@pytest.mark.parametrize(("depth_m", "sides"), [(0.0, 1), (PANE_M, 2), (1.5, 2)])
def test_both_sides_of_a_pane(tmp_path: Path, depth_m: float, sides: int) -> None:
    """The closed form of one pane or two: two that are far apart are meant as two."""
    bare_w, _ = behind(tmp_path / "bare", None)
    power_w, codes = behind(tmp_path / "pane", depth_m)
    once: Any = slab_power(np.sqrt(EPS), PANE_M, WAVELENGTH_M, 1.0).transmitted_s
    got_db = 10 * math.log10(power_w / bare_w)
    assert got_db == pytest.approx(sides * 20 * math.log10(float(once)), abs=0.02)
    assert ("pane-counts-twice" in codes) == (depth_m == PANE_M)
