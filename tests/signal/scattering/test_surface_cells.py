# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells of speckle: scatterers of bodies that turn lie within their meshes' boxes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from radarsim_addon.signal.paths import PathRows
from radarsim_addon.signal.scattering.surface_speckle import Body, SurfaceCells

COLUMNS = ("first_object", "last_object")
#: A rotor's blade, 0.3 by 0.024 by 0.002 m, and twice as large in the world.
BOX = np.array([[-0.15, -0.012, -0.001], [0.15, 0.012, 0.001]])
ANGLE = 0.7


def pose() -> np.ndarray:
    cos, sin = 2 * math.cos(ANGLE), 2 * math.sin(ANGLE)
    return np.array([[cos, -sin, 0, 5], [sin, cos, 0, 60], [0, 0, 2, 3], [0, 0, 0, 1.0]])


def hits(count: int = 4000) -> tuple[PathRows, np.ndarray]:
    """Rows whose vertices lie on the blade, and their places in its own axes."""
    local = np.random.default_rng(1).uniform(BOX[0], BOX[1], (count, 3))
    rows = PathRows.zeros(count)
    rows["order"] = rows["first_object"] = rows["last_object"] = 1
    rows["last_scatterer_m"] = rows["first_scatterer_m"] = local @ pose()[:3, :3].T + pose()[:3, 3]
    return rows, local


def scatterers(body: Body, edge_m: float, coarse_m: float = 0.0) -> np.ndarray:
    """Scatterers of the hits' cells, in the blade's own axes."""
    cells = SurfaceCells({1: body}, COLUMNS, np.zeros(2), 3, edge_m, coarse_m)
    points_m, _ = cells.scatterers(cells.of(hits()[0], False))
    return np.asarray((points_m - pose()[:3, 3]) @ np.linalg.inv(pose()[:3, :3]).T)


@pytest.mark.parametrize("edge_m", [0.01, 0.13, 3.0])
def test_scatterers_lie_in_the_box(edge_m: float) -> None:
    inside = scatterers(Body("Blade", pose(), BOX, turns=True), edge_m)
    assert (inside >= BOX[0] - 1e-12).all() and (inside <= BOX[1] + 1e-12).all()
    # those whose cells lie inside are where they would be anyway
    free = scatterers(Body("Blade", pose(), turns=True), edge_m)
    well = (np.abs(hits()[1]) < BOX[1] - edge_m / 2).all(axis=1)
    np.testing.assert_allclose(inside[well], free[well], atol=1e-12)
    assert (np.abs(free) > BOX[1]).any()


def test_cells_of_the_range_resolution_only_where_nothing_turns() -> None:
    """An eighth of the range resolution hides what Doppler resolves."""
    for turns, edge_m in ((True, 0.01), (False, 0.13)):
        found = scatterers(Body("Blade", pose(), turns=turns), 0.01, 0.13)
        apart_m = 2 * np.linalg.norm(found - hits()[1], axis=1)
        assert 0.7 * edge_m < apart_m.max() < math.sqrt(3) * edge_m
