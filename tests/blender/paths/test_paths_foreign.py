# SPDX-License-Identifier: GPL-3.0-or-later
"""What does not belong to the measurement stays out of it, and is given back as it was."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from tests.blender import path_helpers as ph
from tests.blender import path_scenes as ps
from tests.blender import radar_scenes as rs
from tests.blender.paths.test_paths_walls import medium, passage, slab
from tests.blender.state.test_settings_restore import snapshot

pytestmark = pytest.mark.blender


def test_the_output_of_cycles_tells_fog_from_a_surface(tmp_path: Path) -> None:
    """One material is a surface in Cycles and fog in EEVEE, the other the reverse."""
    rs.new_scene()
    for x, surface in ((-1.0, "CYCLES"), (1.0, "EEVEE")):
        material = ph.lambert(0.5, f"Surface in {surface}")
        tree = material.node_tree
        output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
        output.target = surface
        mist = tree.nodes.new("ShaderNodeVolumePrincipled")
        other = tree.nodes.new("ShaderNodeOutputMaterial")
        other.target = "EEVEE" if surface == "CYCLES" else "CYCLES"
        tree.links.new(mist.outputs[0], other.inputs["Volume"])
        plate = ph.plate_at(10.0, 1.0, material)
        plate.location.x, plate.name = x, surface
    run = ph.run_paths(tmp_path, width_px=16, height_px=16)
    (said,) = [one for one in run.job.findings if one.code == "object-without-surface"]
    assert said.subjects == ("EEVEE",)
    assert {run.record().objects[one - 1] for one in run.table()["last_object"]} == {"CYCLES"}


def test_lights_sky_and_fog_stay_out(tmp_path: Path) -> None:
    """Bit for bit the table of the same scene without them, orders 1 and 2, all put back."""
    options = {"max_reflections": 2}
    size = {"width_px": 24, "height_px": 24}
    ps.furnished_scene(clutter=False)
    clean = ph.run_paths(tmp_path / "clean", options=options, **size).table()
    ps.furnished_scene(clutter=True)
    scene = bpy.context.scene
    scene.frame_set(7, subframe=0.25)
    layer = scene.view_layers[0]
    with bpy.context.temp_override(scene=scene, view_layer=layer):
        bpy.ops.scene.view_layer_add_lightgroup(name="Theirs")
        bpy.ops.scene.view_layer_add_lightgroup(name="Others")
    layer.active_lightgroup_index = 0
    bpy.data.objects["POINT"].lightgroup = "Theirs"
    for number, item in enumerate(bpy.data.objects):
        item.pass_index = 100 + number
    before = snapshot(scene)
    run = ph.run_paths(tmp_path / "cluttered", options=options, **size)
    after = snapshot(scene)
    for name in before.keys() | after.keys():
        assert after.get(name) == before.get(name), name
    rows = run.table()
    assert rows.size == clean.size
    for name in rows.names:
        np.testing.assert_array_equal(rows[name], clean[name], err_msg=name)
    assert {1, 2} == set(rows["order"])
    assert any("Zz fog" in item.subjects for item in run.job.findings)


def test_an_error_in_a_render_puts_all_back(tmp_path: Path) -> None:
    ps.furnished_scene(clutter=True)
    scene = bpy.context.scene
    before = snapshot(scene)
    from radarsim_addon.blender.paths import PathJob
    from radarsim_addon.blender.plan import PathOptions

    with (
        pytest.raises(RuntimeError, match="power cut"),
        PathJob(
            scene, scene.view_layers[0], rs.measurement(), tmp_path, PathOptions(replicates=1)
        ) as job,
    ):
        for number, task in enumerate(job.pending()):
            job.start(task)
            if number == 3:
                raise RuntimeError("power cut")
            job.render(task)
            job.finish(task)
    after = snapshot(scene)
    for name in before.keys() | after.keys():
        assert after.get(name) == before.get(name), name


@pytest.mark.parametrize("foreign", [False, True])
def test_walls_are_passed_by_chance_only_next_to_foreign_materials(
    tmp_path: Path, foreign: bool
) -> None:
    """5 cm without loss at 37 degrees: the power is that of (1 - R)^2 both ways, with the standard
    error of rays that each pass with this chance.
    """
    powers, counts = [], []
    for wall in (False, True):
        rs.new_scene()
        ph.field_of_view(2.0)
        ph.plate_at(100.0, 3.0, ph.rough_metal())
        if wall:
            slab(20.0, 0.05, 37.0, medium("Wall", 4.2))
        if foreign:  # next to the way
            corners = [(30, 10, 0), (31, 10, 0), (31, 10, 1), (30, 10, 1)]
            ph.quad("Other", corners, ph.principled("Grey", (0.4, 0.4, 0.4)))
        rows = ph.run_paths(tmp_path / f"{wall}", width_px=32, height_px=32).table()
        rows = rows[rows["last_scatterer_m"][:, 1] > 99]
        powers.append(rows["power_w"].sum())
        counts.append(rows.size)
    once = passage(4.2, 0.05, 37.0)[0].mean()
    error = math.sqrt((1 - once) / (once * counts[0])) if foreign else 0.0
    assert powers[1] / powers[0] == pytest.approx(once**2, rel=4 * error + 2e-3)
    passed = counts[1] / counts[0]
    assert passed == pytest.approx(once if foreign else 1.0, abs=4 * error * once)
