# SPDX-License-Identifier: GPL-3.0-or-later
"""Drivers that Blender does not evaluate are named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.scene import disabled_drivers
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


def drive(owner: Any, path: str, expression: str) -> Any:
    curve = owner.driver_add(path, 0 if path == "location" else -1)
    curve.driver.expression = expression
    return curve


@pytest.mark.parametrize("trusted", [False, True])
def test_drivers_of_a_file_without_its_scripts(tmp_path: Path, trusted: bool) -> None:
    """Simple expressions are always evaluated, Python only in a trusted file, wrong ones never."""
    rs.new_scene()
    names = ("Simple", "Python", "Wrong", "Muted")
    plates = {name: rs.add_plate(10.0 + n) for n, name in enumerate(names)}
    for name, plate in plates.items():
        plate.name = name
    python = "bpy.data.scenes[0].frame_current * 0.01"
    drive(plates["Simple"], "location", "frame / 100")
    drive(plates["Python"], "location", python)
    drive(plates["Wrong"], "location", "nonsense(")
    drive(plates["Muted"], "location", "nonsense(").mute = True
    light = bpy.data.lights["Radar Emitter"]
    drive(light, "volume_factor", python)
    path = tmp_path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=trusted)
    job = rs.run(tmp_path / "run")
    (found,) = [item for item in job.run_findings if item.code == "driver-disabled"]
    stopped = {"Wrong"} if trusted else {"Python", "Wrong", "Radar Emitter"}
    assert set(found.subjects) == stopped
    assert found.numbers["count"] == len(stopped)
    moved = bpy.data.objects["Python"].location.x != 0.0
    assert moved == trusted, "what the finding says"


def test_no_driver_no_finding() -> None:
    rs.new_scene()
    plate = rs.add_plate(10.0)
    drive(plate, "location", "frame / 100")
    bpy.context.view_layer.update()
    assert disabled_drivers() == []
