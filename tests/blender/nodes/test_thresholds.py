# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits are crossed: just below and just above."""

from __future__ import annotations

import pytest

pytest.importorskip("bpy")

from radarsim_addon.signal.scene import is_conductor

pytestmark = pytest.mark.blender


@pytest.mark.parametrize(
    ("enters", "opaque"),
    [(7000.0, 9000.0), (10 + 95j, 10 + 105j)],  # 4/n = 5e-4, the half of 1e-3; kappa 100
)
def test_conductors(enters: complex, opaque: complex) -> None:
    assert not is_conductor(complex(enters))
    assert is_conductor(complex(opaque))
