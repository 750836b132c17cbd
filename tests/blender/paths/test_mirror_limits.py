# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a planar mirror gives no path: obstacles, ends, unsuitable materials; what says so."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon.signal.paths import IMAGE_DTYPE

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import nodes
from radarsim_addon.blender.materials import read_surface
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.mirror_scenes import HEIGHT_M, RANGE_M, box, measure, scene
from tests.blender.paths.test_paths_walls import medium, passage

pytestmark = pytest.mark.blender


@pytest.mark.parametrize(
    ("name", "low", "high", "blocks"),
    [
        ("between scatterer and mirror", (-9, 30, 1), (9, 31, 2.5), True),
        ("below the plane", (-9, 1, -9), (9, 35, -1), False),
    ],
)
def test_obstacles(
    tmp_path: Path,
    name: str,
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    blocks: bool,
) -> None:
    scene(view_deg=2.0)
    box(name, low, high)
    rows = measure(tmp_path, pixels=32).table()
    plate = rows[(rows["last_object"] == list_of_objects().index("Plate") + 1)]
    assert np.any(plate["order"] == 1)
    assert np.any(plate["transmitter_image"] == 1) != blocks


def list_of_objects() -> list[str]:
    """Names in the order of their numbers."""
    return sorted(item.name for item in bpy.data.objects if item.type == "MESH")


def test_mirror_patch_ends_and_sides(tmp_path: Path) -> None:
    """A patch that ends before the point of reflection, and one that the radar sees from below."""
    for number, (low, high, height, count) in enumerate(
        ((-5, 15, 0.0, 0), (15, 25, 0.0, 1), (15, 25, 8.0, 1), (15, 25, 4.0, 0))
    ):
        scene(view_deg=2.0)
        ground = bpy.data.objects["Ground"]
        for vertex, y in zip(ground.data.vertices, (low, low, high, high), strict=True):
            vertex.co.y, vertex.co.z = y, height
        rows = measure(tmp_path / str(number), pixels=16).table()
        images = rows["transmitter_image"] if rows.dtype == IMAGE_DTYPE else np.zeros(1)
        assert np.any(images == 1) == bool(count), (low, high, height)


def test_an_orthographic_receiver_is_named(tmp_path: Path) -> None:
    scene(view_deg=4.0)
    bpy.context.scene.camera.data.type = "ORTHO"
    codes = {item.code for item in measure(tmp_path, pixels=16).record().findings}
    assert "mirror-ways-not-in-phase" in codes


def test_nothing_is_rendered_without_a_mirror(tmp_path: Path) -> None:
    scene(ph.rough_metal, view_deg=4.0)
    on = measure(tmp_path / "on", pixels=32)
    off = measure(tmp_path / "off", pixels=32, mirror_images=0)
    assert on.table().tobytes() == off.table().tobytes()
    assert on.record().renders == off.record().renders
    assert "scattering" not in on.record().column_groups


def test_what_is_left_out_is_said(tmp_path: Path) -> None:
    def codes(name: str, **options: Any) -> set[str]:
        run = measure(tmp_path / name, pixels=16, **options)
        found = {item.code for item in run.record().findings if "mirror" in item.code}
        return found - {"mirror-phases-apart"}  # of metal, with both polarisations

    scene(view_deg=4.0)
    assert codes("all") == set()
    assert codes("two", max_reflections=2) == {"mirror-both-ways-left-out"}
    assert codes("one", max_reflections=1) == {"mirrors-need-reflections"}
    assert codes("none", mirror_images=0) == {"mirrors-left-out"}
    bpy.ops.mesh.primitive_uv_sphere_add(location=(3, 30, 4))
    bpy.context.object.data.materials.append(ph.mirror())
    bpy.ops.object.shade_smooth()
    assert codes("sphere") == {"mirror-rounded", "mirror-curved-in-a-row"}


def textured_mirror() -> Any:
    """A mirror whose index is set by a node."""
    material = ph.mirror()
    tree = material.node_tree
    group = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeGroup")
    value = tree.nodes.new("ShaderNodeValue")
    value.outputs[0].default_value = 1e4
    tree.links.new(value.outputs[0], group.inputs["Index of Refraction"])
    return material


def two_closures(kind: str, roughness: float) -> Any:
    return ph.shader_material(
        "Two", ("ShaderNodeBsdfDiffuse", {}), (kind, {"Roughness": roughness})
    )


WITHOUT = {"mirror-without-image"}


@pytest.mark.parametrize(
    ("ground", "options", "expected"),
    [
        (lambda: ph.principled("G", (0.5, 0.5, 0.5), 0.0), {}, WITHOUT),
        (lambda: ph.principled("G", (0.5, 0.5, 0.5), 0.01), {}, set()),
        (
            lambda: ph.principled("G", (0.5, 0.5, 0.5), 0.0),
            {"max_reflections": 1},
            {"mirrors-need-reflections"},
        ),
        # absorbs: no path over it exists
        (
            lambda: ph.principled("G", (0.5, 0.5, 0.5), 0.0),
            {"range_encoding": "materials"},
            set(),
        ),
        (lambda: two_closures("ShaderNodeBsdfAnisotropic", 0.0), {}, WITHOUT),
        (lambda: two_closures("ShaderNodeBsdfMetallic", 0.0), {}, WITHOUT),
        (lambda: two_closures("ShaderNodeBsdfMetallic", 0.3), {}, set()),
        (textured_mirror, {}, WITHOUT),
    ],
)
def test_mirrors_without_an_image_are_named(
    tmp_path: Path, ground: Any, options: dict[str, Any], expected: set[str]
) -> None:
    scene(ground, view_deg=4.0)
    run = measure(tmp_path, pixels=16, **{"range_encoding": "world", **options})
    found = {item.code: item for item in run.record().findings if "mirror" in item.code}
    assert set(found) == expected
    assert all(item.subjects == ("Ground",) for item in found.values())
    assert not run.record().images


def in_a_group(inside: str) -> Any:
    """A material whose BSDF, of the default inputs but a roughness of 0, is in a node group."""
    tree = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    tree.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    shader, end = tree.nodes.new(inside), tree.nodes.new("NodeGroupOutput")
    shader.inputs["Roughness"].default_value = 0.0
    tree.links.new(shader.outputs[0], end.inputs[0])
    material = ph.shader_material("Grouped", ("ShaderNodeBsdfDiffuse", {}))
    nodes_of = material.node_tree.nodes
    group = nodes_of.new("ShaderNodeGroup")
    group.node_tree = tree
    output = next(node for node in nodes_of if node.bl_idname == "ShaderNodeOutputMaterial")
    material.node_tree.links.new(group.outputs[0], output.inputs["Surface"])
    return material


@pytest.mark.parametrize(
    ("inputs", "expected"),
    [
        ({"Roughness": 0.0}, True),
        ({"Roughness": 0.0, "Specular IOR Level": 0.0}, False),
        ({"Roughness": 0.0, "Specular IOR Level": 0.0, "Metallic": 1.0}, True),
        ({"Coat Weight": 0.5, "Coat Roughness": 0.0}, True),
        ({"Coat Weight": 0.0, "Coat Roughness": 0.0}, False),
        ({"Coat Weight": 0.5}, False),  # a roughness of 0.03
    ],
)
def test_lobes_of_principled(inputs: dict[str, float], expected: bool) -> None:
    rs.new_scene()
    material = ph.principled("P", (0.5, 0.5, 0.5))
    node = next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    assert read_surface(material).is_mirror_like == expected
    if "Roughness" in inputs:
        value = material.node_tree.nodes.new("ShaderNodeValue")
        material.node_tree.links.new(value.outputs[0], node.inputs["Roughness"])
        assert not read_surface(material).is_mirror_like


def test_lobes_in_groups_and_of_radar_materials() -> None:
    rs.new_scene()
    assert read_surface(in_a_group("ShaderNodeBsdfGlass")).is_mirror_like
    assert not read_surface(in_a_group("ShaderNodeBsdfDiffuse")).is_mirror_like
    assert read_surface(ph.mirror()).is_mirror_like
    assert not read_surface(ph.rough_metal()).is_mirror_like
    assert not read_surface(None).is_mirror_like


def test_a_plane_edge_on_is_not_named(tmp_path: Path) -> None:
    """A Radar Material there has no image either: `test_mirror_patch_ends_and_sides`."""
    scene(lambda: ph.principled("G", (0.5, 0.5, 0.5), 0.0), view_deg=4.0)
    for vertex in bpy.data.objects["Ground"].data.vertices:
        vertex.co.z = HEIGHT_M
    run = measure(tmp_path, pixels=16, range_encoding="world")
    assert not [item for item in run.record().findings if "mirror" in item.code]


def test_a_pane_on_the_way_is_said(tmp_path: Path) -> None:
    scene(view_deg=4.0)
    pane = nodes.make_material("Pane", 1.5, 0.0, 0.0, 0.5)
    box("Pane", (-9, 30, 1), (9, 31, 2.5)).data.materials[0] = pane
    run = measure(tmp_path, pixels=32)
    found = {item.code: item for item in run.record().findings}
    assert float(str(found["mirror-way-through"].numbers["fraction"])) > 0.1
    rows = run.table()
    assert not np.any((rows["transmitter_image"] == 1) & (rows["order"] == 2))


def test_the_scene_comes_back(tmp_path: Path) -> None:
    scene(view_deg=4.0)
    before = {(kind, item.name) for kind in ("objects", "meshes", "collections", "lights")
              for item in getattr(bpy.data, kind)}  # fmt: skip
    hidden = {item.name: item.hide_render for item in bpy.data.objects}
    measure(tmp_path, pixels=16)
    after = {(kind, item.name) for kind in ("objects", "meshes", "collections", "lights")
             for item in getattr(bpy.data, kind)}  # fmt: skip
    assert after == before
    assert {item.name: item.hide_render for item in bpy.data.objects} == hidden


def test_a_wall_next_to_its_edge_in_a_mirror(tmp_path: Path) -> None:
    """The plate seen in the ground, all of it through a wall; the upper half is lit over the wall.

    Rays pass the wall by chance, so the power has the standard error of their number.
    """
    powers, rays = [], 0
    for walled in (False, True):
        scene(view_deg=2.0)
        bpy.data.objects["Radar"].rotation_euler.x -= math.atan2(2 * HEIGHT_M, RANGE_M)
        if walled:
            wall = box("Wall", (-3, 30, 0.05), (3, 30.05, HEIGHT_M))
            wall.data.materials[0] = medium("Wall", 4.2)
        rows = measure(tmp_path / f"{walled}", pixels=48, max_reflections=2, replicates=4).table()
        rows = rows[(rows["order"] == 2) & (rows["last_scatterer_m"][:, 1] > RANGE_M - 0.1)]
        low = rows["last_scatterer_m"][:, 2] < HEIGHT_M
        powers.append([rows["power_w"][low].sum(), rows["power_w"][~low].sum()])
        rays = rays or rows.size / 2
    once = passage(4.2, 0.05, math.degrees(math.atan2(2 * HEIGHT_M, RANGE_M)))[0].mean()
    error = math.sqrt((1 - once) / (once * rays))
    assert error < 0.03
    ratios = np.divide(powers[1], powers[0])
    np.testing.assert_allclose(ratios, [once**2, once], rtol=3 * error)
