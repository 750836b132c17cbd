# SPDX-License-Identifier: GPL-3.0-or-later
"""Every smooth preset and library material in the furnace, in all polarisations: 1e-3.

The cases of the validation's report, and their bounds.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("bpy")

from radarsim_addon.blender import nodes
from radarsim_addon.blender.materials.physical_materials import ASSETS
from scripts.validation.case import Bench, Check
from scripts.validation.energy_slabs import (
    SUM,
    SUM_BOUND,
    library_faces,
    library_slabs,
    simple_slabs,
)

pytestmark = [pytest.mark.blender, pytest.mark.slow]

SMOOTH = [asset.name for asset in ASSETS if not asset.rms_height_m]


@pytest.mark.parametrize(
    ("case", "names", "points"),
    [
        # Three angles in three polarisations; the library at a fourth in 'average'.
        (simple_slabs, list(nodes.PRESETS), 9),
        (library_slabs, SMOOTH, 10),
        (library_faces, [], 0),
    ],
)
def test_power_is_conserved(
    tmp_path: Path, case: Callable[[Bench], list[Check]], names: list[str], points: int
) -> None:
    checks = case(Bench(tmp_path))
    sums = [check for check in checks if SUM in check.name]
    assert len(sums) == len(names)
    for name, check in zip(names, sums, strict=True):
        assert name in check.name
        assert (check.points, check.bound) == (points, SUM_BOUND)
    assert SUM_BOUND == 1e-3
    assert [f"{c.name}: {c.error:.2g}" for c in checks if not c.passed] == []
    assert "largest share" in checks[-1].name
