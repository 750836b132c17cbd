# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths in scenes as users have them: instances, libraries, scales, large meshes."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import nodes
from radarsim_addon.signal.paths import PathRows
from tests.blender import path_helpers as ph
from tests.blender import path_scenes as ps
from tests.blender import radar_scenes as rs
from tests.blender.state.test_settings_restore import snapshot

pytestmark = pytest.mark.blender


# -- instances and libraries -----------------------------------------------------------------------


def assert_plates_seen(rows: PathRows, places: list[tuple[float, float, float]]) -> None:
    """Each row lies on one of the plates, all of them are seen, ranges are those of the plates."""
    planes = np.array([place[1] for place in places])
    which = np.argmin(np.abs(rows["last_scatterer_m"][:, 1:2] - planes), axis=1)
    assert set(which) == set(range(len(places)))
    cosine = rows["direction"][:, 1]
    np.testing.assert_allclose(rows["length_m"], 2 * planes[which] / cosine, rtol=1e-6)
    centre = np.array(places)[which]
    assert np.abs(rows["last_scatterer_m"] - centre)[:, [0, 2]].max() <= 1 + 1e-5
    assert not np.any(rows["flags"])


def test_collection_instances(tmp_path: Path) -> None:
    rs.new_scene()
    ph.field_of_view(40)
    collection = ps.plate_collection()
    for place in ps.PLACES:
        rs.instance_of(collection, place)
    run = ph.run_paths(tmp_path, width_px=48, height_px=48)
    rows = run.table()
    assert_plates_seen(rows, ps.PLACES)
    assert {run.record().objects[n - 1] for n in rows["last_object"]} == {"Plate"}


def test_instances_of_geometry_nodes(tmp_path: Path) -> None:
    """Instances on points, with a material that only the node tree sets."""
    rs.new_scene()
    ph.field_of_view(40)
    mesh = bpy.data.meshes.new("Points")
    mesh.from_pydata(ps.PLACES, [], [])
    host = bpy.data.objects.new("Host", mesh)
    bpy.context.scene.collection.objects.link(host)
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    new = tree.nodes.new
    given, result = new("NodeGroupInput"), new("NodeGroupOutput")
    grid, dress, scatter = (
        new("GeometryNodeMeshGrid"),
        new("GeometryNodeSetMaterial"),
        new("GeometryNodeInstanceOnPoints"),
    )
    grid.inputs["Size X"].default_value = grid.inputs["Size Y"].default_value = 2.0
    dress.inputs["Material"].default_value = ph.rough_metal()
    scatter.inputs["Rotation"].default_value = (math.pi / 2, 0, 0)
    tree.links.new(grid.outputs["Mesh"], dress.inputs["Geometry"])
    tree.links.new(given.outputs[0], scatter.inputs["Points"])
    tree.links.new(dress.outputs[0], scatter.inputs["Instance"])
    tree.links.new(scatter.outputs[0], result.inputs[0])
    host.modifiers.new("Scatter", "NODES").node_group = tree
    run = ph.run_paths(tmp_path, width_px=48, height_px=48)
    assert_plates_seen(run.table(), ps.PLACES)


def test_linked_library(tmp_path: Path) -> None:
    """A scene whose plates come from another file, with foreign and with Radar Materials."""
    rs.new_scene()
    collection = ps.plate_collection()
    foreign = ph.plate_at(0, 2.0, ph.principled("Foreign", (0.6, 0.5, 0.4)))
    foreign.name = "Foreign plate"
    bpy.context.scene.collection.objects.unlink(foreign)
    other = bpy.data.collections.new("Foreign")
    other.objects.link(foreign)
    library = tmp_path / "library.blend"
    bpy.data.libraries.write(str(library), {collection, other}, fake_user=True)
    rs.new_scene()
    ph.field_of_view(40)
    with bpy.data.libraries.load(str(library), link=True) as (_, target):
        target.collections = ["Plates", "Foreign"]
    mine, theirs = target.collections
    for collection, place in zip((mine, theirs, mine), ps.PLACES, strict=True):
        rs.instance_of(collection, place)
    bpy.context.scene.render.image_settings.file_format = "OPEN_EXR"
    bpy.context.scene.render.image_settings.file_format = "PNG"
    path = tmp_path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path))
    before = snapshot(bpy.context.scene)
    run = ph.run_paths(tmp_path / "run", width_px=48, height_px=48)
    after = snapshot(bpy.context.scene)
    for name in before.keys() | after.keys():
        assert after.get(name) == before.get(name), name
    rows, record = run.table(), run.record()
    assert_plates_seen(rows, ps.PLACES)
    assert record.range_encoding == "world"
    assert {record.objects[n - 1] for n in rows["last_object"]} == {
        "Plate [library.blend]",
        "Foreign plate [library.blend]",
    }


# -- scales ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("metres_per_unit", "size"),
    [(1.0, 1.0), (1.0, 1e-3), (1.0, 1e3), (0.01, 100.0), (0.001, 1.0), (1000.0, 1.0)],
    ids=["metres", "millimetres", "kilometres", "centimetre units", "millimetre units", "km units"],
)
@pytest.mark.parametrize("code", ["materials", "world"])
def test_scales(tmp_path: Path, metres_per_unit: float, size: float, code: str) -> None:
    """Order 1 and 2 of a floor and a wall: everything grows with the scene, to rounding."""
    rs.new_scene()
    scene = bpy.context.scene
    scene.unit_settings.scale_length = metres_per_unit
    ph.field_of_view(50)
    ph.radar_at((0, 0, 2 * size))
    x, near, end, top = 30 * size, -5 * size, 10 * size, 30 * size
    floor = nodes.make_material("Floor", 1e4, 1e4, 1.0, 0.0, penetrable=False)
    ph.quad("Floor", [(-x, near, 0), (x, near, 0), (x, end, 0), (-x, end, 0)], floor)
    wall = [(-x, end, 0), (x, end, 0), (x, end, top), (-x, end, top)]
    ph.quad("Wall", wall, ph.rough_metal())
    options = {"max_reflections": 2, "range_encoding": code, "mirror_images": 0}
    run = ph.run_paths(tmp_path, width_px=24, height_px=24, options=options)
    rows, record = run.table(), run.record()
    unit_m = size * metres_per_unit
    followed_w = record.total_power_w * (1 - record.truncated_reflections_fraction)
    assert rows["power_w"].sum() == pytest.approx(followed_w, rel=1e-5)
    direction = rows["direction"]
    image = direction * (10 / direction[:, 1:2])
    seen = image + np.array([0.0, 0.0, 2.0])
    one, two = rows["order"] == 1, rows["order"] == 2
    assert one.sum() > 150
    assert two.sum() > 150
    np.testing.assert_array_equal(two, seen[:, 2] < 0)
    last = np.where(two[:, None], seen * (1, 1, -1), seen)
    back = np.linalg.norm(last - (0, 0, 2), axis=1)
    length = (np.linalg.norm(image, axis=1) + back) * unit_m
    np.testing.assert_allclose(rows["length_m"], length, rtol=1e-6)
    np.testing.assert_allclose(rows["last_scatterer_m"], last * unit_m, atol=5e-5 * unit_m)
    reflectance = 0.9998
    lit = last[:, 1] / back
    # The lamp's watts are per Blender unit squared: powers in watts grow with the unit's square.
    want = reflectance / np.pi * lit * ph.irradiance(back * unit_m)
    np.testing.assert_allclose(ph.radiance(rows), want, rtol=1e-3)


# -- large -----------------------------------------------------------------------------------------


def test_a_million_triangles(tmp_path: Path) -> None:
    """A plate of 1.0e6 triangles measures as the same plate of two."""
    tables = []
    for divisions in (1, 708):
        rs.new_scene()
        bpy.ops.mesh.primitive_grid_add(
            x_subdivisions=divisions,
            y_subdivisions=divisions,
            size=8,
            location=(0, 10, 0),
            rotation=(math.pi / 2, 0, 0),
        )
        plate = bpy.context.object
        plate.data.materials.append(ph.rough_metal())
        triangles = 2 * len(plate.data.polygons)
        assert (triangles > 1_000_000) == (divisions > 1)
        # off the grid's lines: a shadow ray through a shared edge counts both its triangles
        ph.radar_at((0.0123, 0, 0.0077))
        run = ph.run_paths(tmp_path / str(divisions), width_px=48, height_px=48)
        tables.append(run.table())
    coarse, fine = tables
    assert coarse.size == fine.size
    np.testing.assert_allclose(fine["length_m"], coarse["length_m"], rtol=1e-6)
    np.testing.assert_allclose(fine["power_w"], coarse["power_w"], rtol=1e-5)
