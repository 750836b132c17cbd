# SPDX-License-Identifier: GPL-3.0-or-later
"""Every smooth preset and library material in the furnace: 1e-3.

The cases of the validation's report, and their bounds. The shaders are the same for all materials,
so that one that lets waves through and one that does not are seen in all polarisations.
"""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("bpy")

from radarsim_addon.blender import nodes
from scripts.validation.case import Bench
from scripts.validation.energy_slabs import (
    SMOOTH,
    SUM,
    SUM_BOUND,
    library_faces,
    library_slabs,
    simple_slabs,
)

pytestmark = [pytest.mark.blender, pytest.mark.slow]


@pytest.mark.parametrize("case", ["presets", "library", "rough"])
def test_power_is_conserved(tmp_path: Path, case: str) -> None:
    bench, points = Bench(tmp_path), {}
    if case == "presets":
        whole = dict.fromkeys(("glass", "metal"), 9)  # three angles in three polarisations
        checks, points = simple_slabs(bench, [*whole]), dict.fromkeys(nodes.PRESETS, 1) | whole
    elif case == "library":
        whole = dict.fromkeys(("Glass", "Steel"), 10)  # and a fourth angle in 'average'
        checks, points = library_slabs(bench, [*whole]), dict.fromkeys(SMOOTH, 2) | whole
    else:
        checks = library_faces(bench, (30.0, 85.0))
    sums = [check for check in checks if SUM in check.name]
    for (name, count), check in zip(points.items(), sums, strict=True):
        assert name in check.name
        assert (check.points, check.bound) == (count, SUM_BOUND)
    assert SUM_BOUND == 1e-3
    assert [f"{c.name}: {c.error:.2g}" for c in checks if not c.passed] == []
    assert "largest share" in checks[-1].name
