# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of many objects are rendered in fewer, larger tiles, with the same paths."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.paths import frame
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


def plates(count: int) -> None:
    """Plates side by side, that share a mesh."""
    rs.new_scene()
    first = ph.plate_at(20.0, 0.4, ph.lambert(0.5))
    for i in range(1, count):
        other = first.copy()
        other.location.x = 0.5 * ((i + 1) // 2) * (-1) ** i
        bpy.context.scene.collection.objects.link(other)


def sorted_rows(found: Any) -> Any:
    """Rows by azimuth and elevation of their pixels."""
    rows = found.table()
    return rows[np.lexsort(np.round(rows["direction"].T, 6))]


def test_many_objects_take_larger_tiles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A frame of 320 x 16 pixels: two tiles, and one where there are many objects."""
    plates(20)
    size = {"width_px": 320, "height_px": 16, "max_reflections": 1}
    few = ph.run_paths(tmp_path / "few", **size)
    monkeypatch.setattr(frame, "_MANY_BODIES", 10)
    many = ph.run_paths(tmp_path / "many", **size)
    refined = ph.run_paths(
        tmp_path / "refined", options={"max_standard_error": 0.9, "replicates": 2}, **size
    )
    chosen = ph.run_paths(tmp_path / "chosen", options={"tile_px": 128}, **size)
    assert [one.record().tiles for one in (few, many, chosen)] == [2, 1, 3]
    assert refined.record().tiles >= 2
    assert many.job.done == many.job.total
    one, other = sorted_rows(few), sorted_rows(many)
    assert one.size > 100
    # Blender keeps the shift of the camera in float32: a millionth of a pixel
    np.testing.assert_allclose(other["direction"], one["direction"], atol=5e-9)
    np.testing.assert_allclose(other["length_m"], one["length_m"], rtol=3e-8)
    np.testing.assert_allclose(other["power_w"], one["power_w"], rtol=1e-5)
