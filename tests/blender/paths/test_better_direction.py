# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of a narrow and a wide lobe are sampled from the narrow one, for both directions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from radarsim_addon.blender import nodes
from radarsim_addon.blender.materials import read_surface
from radarsim_addon.signal.paths import PathFlag
from tests.blender import path_helpers as ph
from tests.blender.paths.test_reverse_marks import corner
from tests.blender.slab_scene import physical_material

pytestmark = pytest.mark.blender


def metal(roughness: float = 0.4) -> Any:
    """Rough metal, which scatters alike in both directions."""
    return nodes.make_material("Metal", 1e4, 1e4, 1.0, roughness, penetrable=False)


def second_reflections(
    folder: Path, right: Callable[[], Any], smooth: bool = False
) -> tuple[Any, Any]:
    """Rows that begin at the wall on the right, and those that end there."""
    corner(right)
    if smooth:
        bpy.data.objects["Right"].data.polygons.foreach_set("use_smooth", [True])
    run = ph.run_paths(
        folder, width_px=64, height_px=64, options={"max_reflections": 2, "mirror_images": 0}
    )
    rows = run.table()[run.table()["order"] == 2]
    number = run.record().objects.index("Right") + 1
    return rows[rows["first_object"] == number], rows[rows["last_object"] == number]


def test_both_directions_are_those_from_the_narrow_lobe(tmp_path: Path) -> None:
    begins, ends = second_reflections(tmp_path / "run", metal)
    assert begins.size > 50
    # the wall across is wider than the view: what begins there has a reverse where it is seen
    np.testing.assert_allclose(ends["power_w"], begins["power_w"][: ends.size], rtol=0)
    for name in ("scatterer_m", "object", "body", "surface_point"):
        for one, other in (("first", "last"), ("last", "first")):
            np.testing.assert_array_equal(ends[f"{one}_{name}"], begins[f"{other}_{name}"])
    np.testing.assert_array_equal(ends["length_m"], begins["length_m"])
    assert (ends["flags"] & PathFlag.HAS_REVERSE).all()
    ahead = ends["first_scatterer_m"] / np.linalg.norm(ends["first_scatterer_m"], axis=1)[:, None]
    np.testing.assert_allclose(ends["direction"], ahead, atol=1e-12)


@pytest.mark.parametrize("case", ["smooth", "alike"])
def test_other_pairs_keep_both_directions(tmp_path: Path, case: str) -> None:
    right = metal if case == "smooth" else lambda: ph.lambert(0.6)
    begins, ends = second_reflections(tmp_path / "run", right, smooth=case == "smooth")
    assert ends.size > 10
    assert not np.isin(ends["power_w"], begins["power_w"]).any()


def test_which_lobes_scatter_alike_in_both_directions() -> None:
    assert read_surface(metal()).reciprocal_lobe == pytest.approx(0.16)
    assert read_surface(ph.lambert(0.3)).reciprocal_lobe == np.inf
    assert read_surface(metal(0.0)).reciprocal_lobe == 0.0
    # Fresnel's equations at the angle of the ray from the receiver
    brick = nodes.make_material("Brick", 2.0, 0.1, 0.5, 0.4, penetrable=False)
    assert read_surface(brick).reciprocal_lobe == 0.0
    # of GGX the width is the square of Blender's roughness
    assert read_surface(physical_material(4.0, 2.0, 0.3)).reciprocal_lobe == pytest.approx(0.09)
