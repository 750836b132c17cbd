# SPDX-License-Identifier: GPL-3.0-or-later
"""Lengths of paths of two reflections: their errors against those that are stated."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("bpy")

from radarsim_addon.blender.paths import hit_points
from radarsim_addon.signal.paths.table import PathRows

pytestmark = pytest.mark.blender

ROWS = 4000
WALL_M, FLOOR = 50.0, np.array([0.0, 0.0, 1.0])


class Corner:
    """A wall (body 1) at y = 50 m and the floor (body 2), as rays meet them."""

    def hit(
        self, bodies: Any, origins_m: Any, directions: Any, near_m: Any, reach_m: Any
    ) -> tuple[Any, Any]:
        normal = np.where((bodies == 1)[:, None], np.array([0.0, 1.0, 0.0]), FLOOR)
        offset_m = np.where(bodies == 1, WALL_M, 0.0)
        way = (offset_m - (origins_m * normal).sum(-1)) / (directions * normal).sum(-1)
        off_m = np.linalg.norm(origins_m + way[:, None] * directions - near_m, axis=1)
        way[off_m > reach_m] = np.nan
        # normals of any length
        return way, np.where(np.isnan(way)[:, None], np.nan, 3.0 * normal)


@pytest.mark.parametrize(
    ("height_m", "least_refined"),
    [(20.0, 0.99), (4.0, 0.5), (1.0, 0.02)],
    ids=["steep", "slanted", "grazing"],
)
def test_errors_of_lengths_are_those_stated(height_m: float, least_refined: float) -> None:
    """The transmitter is above the floor, which it sees at 1.3 to 4 degrees from 1 m."""
    rng = np.random.default_rng(1)
    receiver = transmitter = np.array([0.0, 0.0, height_m])
    first = np.stack([rng.uniform(-9, 9, ROWS), np.full(ROWS, WALL_M), rng.uniform(1, 9, ROWS)], 1)
    last = np.stack([rng.uniform(-9, 9, ROWS), rng.uniform(15, 45, ROWS), np.zeros(ROWS)], 1)
    length_m = sum(
        np.linalg.norm(part, axis=1)
        for part in (first - receiver, last - first, transmitter - last)
    )
    rows = PathRows.zeros(ROWS)
    rows["order"], rows["first_body"], rows["last_body"] = 2, 1, 2
    way = first - receiver
    rows["direction"] = way / np.linalg.norm(way, axis=1)[:, None]
    rows["first_scatterer_m"] = first.astype(np.float32)
    sigma_m = hit_points._COLOUR_ERROR * length_m[:, None]
    rows["last_scatterer_m"] = last + sigma_m * rng.standard_normal((ROWS, 3))
    rows["length_sigma_m"] = 1e-4
    rows["length_m"] = length_m + 1e-4 * rng.standard_normal(ROWS)

    points = hit_points.HitPoints.__new__(hit_points.HitPoints)
    points._surfaces, points._tolerance_m = Corner(), 1e-6
    points._opaque, points._ways = True, None
    points.refine(rows, receiver, transmitter)
    # At grazing incidence most rays miss the face by more than the largest error: their lengths
    # stay those that the colours encode.
    refined = rows["length_sigma_m"] < 9e-5
    assert refined.mean() > least_refined
    z = (rows["length_m"] - length_m) / rows["length_sigma_m"]
    rms = np.sqrt(np.mean(z[refined] ** 2))
    assert rms == pytest.approx(1.0, abs=4 / np.sqrt(2 * refined.sum()))
    np.testing.assert_allclose(rows["last_scatterer_m"][refined, 2], 0.0, atol=1e-12)
