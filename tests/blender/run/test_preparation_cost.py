# SPDX-License-Identifier: GPL-3.0-or-later
"""What preparation asks does not grow with what the scene has many of."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.nodes import groups
from radarsim_addon.physics import mirrors
from scripts.make_canyon import add_box
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.slab_scene import physical_material

pytestmark = pytest.mark.blender


def cost(folder: Path, count: int, monkeypatch: pytest.MonkeyPatch) -> tuple[int, int]:
    """Searches in node trees before the first render, and reflections computed for mirrors."""
    rs.new_scene()
    material = physical_material(2.3, 0.01)
    for i in range(count):
        box = add_box(f"Box {i}", (3.0 * i, 20.0, 0.0), (3.0 * i + 1, 21.0, 1.5))
        box.data.materials.append(material)
    searches: list[Any] = []
    reflections: list[Any] = []
    follow, bright = groups._follow, mirrors.MirrorMaterial.reflection
    monkeypatch.setattr(groups, "_follow", lambda at: (searches.append(at), follow(at))[1])
    monkeypatch.setattr(
        mirrors.MirrorMaterial,
        "reflection",
        lambda *given: (reflections.append(given), bright(*given))[1],
    )
    with ph.job_for(folder, max_reflections=2) as job:
        next(iter(job.pending()))
    monkeypatch.undo()
    return len(searches), len(reflections)


def test_materials_are_asked_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """25 boxes of one material against 5."""
    few, many = (cost(tmp_path / str(n), n, monkeypatch) for n in (5, 25))
    assert many[0] == few[0] > 0
    assert many[1] <= few[1] <= 1
