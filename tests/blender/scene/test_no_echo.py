# SPDX-License-Identifier: GPL-3.0-or-later
"""A frame without an echo names its cause, and the objects."""

from pathlib import Path

import bpy
import numpy as np
import pytest

from radarsim_addon.blender.scene.view_checks import surrounded
from radarsim_addon.findings import Finding
from radarsim_addon.signal import FrameResult, ProcessOptions, process_run
from radarsim_addon.signal.scene import RayMesh
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs


def findings_of(folder: Path) -> list[Finding]:
    """Errors of the measured scene, which processing repeats and adds nothing to."""
    errors = ph.run_paths(folder, width_px=8, height_px=8).record().findings
    events = process_run(folder, ProcessOptions(plots=False))
    (result,) = [event for event in events if isinstance(event, FrameResult)]
    assert [f.code for f in result.findings if f.severity == "error"] == [f.code for f in errors]
    return errors


def shader_material(kind: str) -> bpy.types.Material:
    """A material with one shader."""
    material = bpy.data.materials.new(kind)
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    output, shader = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new(kind)
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


@pytest.mark.parametrize("kind", ["ShaderNodeEmission", "ShaderNodeBackground"])
def test_shaders_that_reflect_nothing_are_named(tmp_path: Path, kind: str) -> None:
    rs.new_scene()
    screen = rs.add_plate(10.0, preset=None)
    screen.name = "Screen"
    screen.data.materials.append(shader_material(kind))
    (found,) = findings_of(tmp_path)
    assert (found.code, found.subjects) == ("shaders-reflect-nothing", ("Screen",))


def test_one_slot_that_reflects_nothing_is_not_the_cause(tmp_path: Path) -> None:
    """Half of the plate emits, the other half is a mirror that is turned away."""
    rs.new_scene()
    screen = ph.plate_at(10.0, 4.0, shader_material("ShaderNodeEmission"), tilt_deg=20.0)
    screen.name = "Screen"
    screen.data.materials.append(ph.mirror())
    mesh = screen.data
    mesh.clear_geometry()
    points = [(x, 0, z) for z in (-2, 2) for x in (-2, 0, 2)]
    mesh.from_pydata(points, [], [(0, 1, 4, 3), (1, 2, 5, 4)])
    mesh.polygons[1].material_index = 1
    found = ph.run_paths(tmp_path, width_px=8, height_px=8).record().findings
    causes = {one.code: one.subjects for one in found if one.severity == "error"}
    assert causes["surfaces-return-nothing"] == ("Screen",)
    assert "shaders-reflect-nothing" not in causes


def test_a_transmitter_inside_a_mesh_is_told_with_the_mesh(tmp_path: Path) -> None:
    rs.new_scene()
    rs.add_plate(10.0)
    bpy.ops.mesh.primitive_ico_sphere_add(radius=0.2, location=(3.0, 0.0, 0.0))
    bpy.context.object.name = "Radome"
    light = next(item for item in bpy.data.objects if item.type == "LIGHT")
    light.matrix_world.translation = (3.0, 0.0, 0.0)
    (found,) = findings_of(tmp_path)
    assert (found.code, found.subjects) == ("antenna-inside-mesh", ("Radome",))


def test_what_is_behind_the_radar_is_not_in_view(tmp_path: Path) -> None:
    rs.new_scene()
    rs.add_plate(-10.0).name = "Behind"
    (found,) = findings_of(tmp_path)
    assert (found.code, found.subjects) == ("nothing-in-view", ("Behind",))


def test_a_point_is_inside_a_cube_or_not() -> None:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], dtype="i4")
    points = np.random.default_rng(0).uniform(-0.5, 1.5, (200, 3))
    inside = surrounded(RayMesh(corners, triangles), points)
    expected = ((points > 0) & (points < 1)).all(axis=1)
    np.testing.assert_array_equal(inside, expected)
    # without a face it surrounds nothing
    assert not surrounded(RayMesh(corners, triangles[2:]), np.array([[0.5, 0.5, 0.5]])).any()
