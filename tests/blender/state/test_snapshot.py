# SPDX-License-Identifier: GPL-3.0-or-later
"""The snapshot of a scene is what a walk through it finds, whatever has been evaluated since."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest

from radarsim_addon.blender.state import (
    Shape,
    Snapshot,
    evaluated_mesh,
    evaluated_objects,
    part_of_snapshot,
    read_numbers,
    snapshot,
    take_snapshot,
)
from tests.blender import motion_helpers as mh
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs


def compare_meshes(found: Snapshot, shape: Shape, evaluated: Any) -> None:
    """The mesh of a shape is what Blender gives property by property."""
    ours = found.mesh(shape)
    with evaluated_mesh(evaluated) as mesh:
        assert (ours is None) == (mesh is None)
        assert found.face_count(shape) == (0 if mesh is None else len(mesh.polygons))
        if ours is None or mesh is None:
            return
        mesh.calc_loop_triangles()
        faces, polygons, loops = mesh.loop_triangles, mesh.polygons, mesh.loops
        pairs = [
            (ours.vertices, read_numbers(mesh.vertices, "co", 3)),
            (ours.triangles, read_numbers(faces, "vertices", 3, np.int32)),
            (ours.polygons, read_numbers(faces, "polygon_index", 1, np.int32)[:, 0]),
            (ours.corner_edges, read_numbers(loops, "edge_index", 1, np.int32)[:, 0]),
            (ours.sides, read_numbers(polygons, "loop_total", 1, np.int32)[:, 0]),
            (ours.slots, read_numbers(polygons, "material_index", 1, np.int32)[:, 0]),
        ]
        for mine, own in pairs:
            np.testing.assert_array_equal(mine, own)
        normals = read_numbers(faces, "split_normals", 9).reshape(-1, 3, 3)
        np.testing.assert_allclose(ours.triangle_normals, normals, rtol=0, atol=1e-6)
        own = read_numbers(polygons, "normal", 3)
        np.testing.assert_allclose(ours.normals, own, rtol=0, atol=1e-6)
        area, centre = read_numbers(polygons, "area"), read_numbers(polygons, "center", 3)
        np.testing.assert_allclose(ours.areas, area[:, 0], rtol=1e-5, atol=1e-12)
        np.testing.assert_allclose(ours.centers, centre, rtol=1e-5, atol=1e-5)


def checked() -> Snapshot:
    """The snapshot of now, compared with each object and instance in Blender's order."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    found = take_snapshot(depsgraph)
    rows = 0
    for row, one in enumerate(evaluated_objects(depsgraph)):
        shape = found.shapes[found.layout.shape[row]]
        assert found.label(row) == one.label
        assert found.layout.key(row) == one.key
        assert found.layout.visible[row] == one.visible
        np.testing.assert_array_equal(found.matrices[row], one.matrix)
        np.testing.assert_array_equal(shape.box, one.box)
        compare_meshes(found, shape, one.evaluated)
        assert (shape.original, shape.kind) == (one.original, one.evaluated.type)
        slots = one.evaluated.material_slots
        assert shape.materials == tuple(s.material and s.material.original for s in slots)
        corners = one.box @ one.matrix[:3, :3].T + one.matrix[:3, 3]
        np.testing.assert_allclose(found.corners[row], corners, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(found.matrix(row), one.matrix)
        away = np.linalg.norm(corners - found.spheres[row, :3], axis=1)
        assert away.max() == pytest.approx(found.spheres[row, 3], abs=1e-12)
        assert found.largest[row] == np.abs(one.matrix).max()
        rows += 1
    assert rows == len(found.matrices)
    some = np.random.default_rng(rows).permutation(rows)[: rows // 2]
    np.testing.assert_array_equal(found.matrices_of(some), found.matrices[some])
    np.testing.assert_array_equal(found.corners_of(some), found.corners[some])
    assert found.layout.keys(some) == [found.layout.key(row) for row in some.tolist()]
    return found


def box(name: str, location: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
    item = mh.facets(name, [(0, 0, 0)], 1.0)
    item.location = location
    return item


def carriers(count: int) -> None:
    """Instances by vertices, by geometry nodes, and of a collection."""
    points = bpy.data.meshes.new("Points")
    points.from_pydata([(2.0 * i, 10.0, 0.0) for i in range(count)], [], [])
    by_vertices = bpy.data.objects.new("Vertices", points)
    by_nodes = bpy.data.objects.new("Nodes", points)
    for item in (by_vertices, by_nodes):
        bpy.context.scene.collection.objects.link(item)
    by_vertices.instance_type = "VERTS"
    box("Child").parent = by_vertices
    tree = bpy.data.node_groups.new("Points", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    source, target = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    cube = tree.nodes.new("GeometryNodeMeshCube")
    instance = tree.nodes.new("GeometryNodeInstanceOnPoints")
    tree.links.new(source.outputs[0], instance.inputs["Points"])
    tree.links.new(cube.outputs[0], instance.inputs["Instance"])
    tree.links.new(instance.outputs[0], target.inputs[0])
    by_nodes.modifiers.new("Points", "NODES").node_group = tree
    collection = bpy.data.collections.new("Group")
    member = box("Member")
    bpy.context.scene.collection.objects.unlink(member)
    collection.objects.link(member)
    for number in range(2):
        empty = mh.empty(f"Group {number}", (number, 5.0, 0.0))
        empty.instance_type, empty.instance_collection = "COLLECTION", collection


def moving() -> None:
    """A parent with a child, a constraint, a driver and a modifier that moves vertices."""
    parent = mh.empty("Parent", (0.0, 0.0, 0.0))
    mh.key(parent, "location", (1, (0, 0, 0)), (9, (3, 1, 0)))
    box("Follower").parent = parent
    box("Constrained").constraints.new("COPY_LOCATION").target = parent
    box("Driven").driver_add("location", 0).driver.expression = "frame * 2"
    box("Waving").modifiers.new("Wave", "WAVE")


def subdivide(item: Any) -> None:
    item.modifiers.new("Array", "ARRAY")


CHANGES: dict[str, Callable[[dict[str, Any]], Any]] = {
    "nothing": lambda o: None,
    "a frame": lambda o: bpy.context.scene.frame_set(4),
    "half a frame": lambda o: bpy.context.scene.frame_set(4, subframe=0.5),
    "moved": lambda o: setattr(o["Still"], "location", (1, 2, 3)),
    "an instanced object": lambda o: setattr(o["Child"].data.vertices[0], "co", (9, 9, 9)),
    "an instancer": lambda o: setattr(o["Vertices"], "location", (1, 2, 3)),
    "a member of a collection": lambda o: setattr(o["Member"], "location", (1, 2, 3)),
    "a vertex": lambda o: setattr(o["Still"].data.vertices[0], "co", (9, 9, 9)),
    "a modifier": lambda o: subdivide(o["Still"]),
    "a material": lambda o: o["Still"].data.materials.append(ph.lambert(0.1)),
    "a new object": lambda o: box("New"),
    "a removed object": lambda o: bpy.data.objects.remove(o["Still"]),
    "hidden": lambda o: setattr(o["Still"], "hide_viewport", True),
    "one for another": lambda o: (o["Still"].hide_set(True), o["Hidden"].hide_set(False)),
    "a hidden member": lambda o: setattr(o["Member"], "hide_viewport", True),
    "no instances": lambda o: setattr(o["Group 0"], "instance_type", "NONE"),
    "more instances": lambda o: o["Vertices"].data.vertices.add(3),
}


@pytest.mark.parametrize("what", CHANGES)
def test_a_snapshot_is_what_a_walk_finds(what: str) -> None:
    rs.new_scene()
    carriers(5)
    moving()
    box("Still")
    box("Hidden").hide_set(True)
    objects = {item.name: item for item in bpy.data.objects}
    before = checked()
    CHANGES[what](objects)
    for mesh in bpy.data.meshes:
        if what in ("an instanced object", "a vertex", "more instances"):
            mesh.update()
    after = checked()
    assert (after is before) == (what == "nothing")
    assert checked() is after
    bpy.context.scene.frame_set(6)
    checked()


def test_a_move_after_an_edit_keeps_the_edit() -> None:
    """Blender reports both evaluations one after the other, before the next snapshot."""
    rs.new_scene()
    still = box("Still")
    checked()
    still.data.vertices[0].co = (9, 9, 9)
    still.data.update()
    bpy.context.view_layer.update()
    still.location = (1, 2, 3)
    bpy.context.view_layer.update()
    checked()


def test_what_only_moves_is_read_without_a_walk(monkeypatch: pytest.MonkeyPatch) -> None:
    rs.new_scene()
    carriers(50)
    moving()
    first = checked()
    walks: list[Any] = []
    monkeypatch.setattr(snapshot, "walk", lambda *given: walks.append(given))
    for frame in (2, 3, 4):
        bpy.context.scene.frame_set(frame)
        bpy.context.scene["setting"] = frame
        bpy.context.scene.update_tag()
        found = checked()
        assert found is not first
        assert found.layout is first.layout
        assert found.walked is first.walked, "poses of stationary objects are not copied"
        assert 0 < found.moved.size < 10
    assert walks == []


def test_the_mesh_of_instances_is_found_after_others_were_added() -> None:
    """Instances of another mesh come before them then."""
    rs.new_scene()
    carriers(3)
    take_snapshot(bpy.context.evaluated_depsgraph_get())  # whose meshes nobody has read
    points = bpy.data.objects["Vertices"]
    points.data = points.data.copy()
    points.data.vertices.add(5)
    points.data.update()
    found = checked()
    (shape,) = (one for one in found.shapes if not one.own)
    mesh = found.mesh(shape)
    assert mesh is not None
    assert mesh.vertices.shape == (8, 3)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), 1.0)  # the cube of the nodes


def test_meshes_of_all_kinds() -> None:
    """Custom normals, polygons of many sides, quads with a corner inwards, edges without faces."""
    rs.new_scene()
    bpy.ops.mesh.primitive_cone_add(vertices=7, end_fill_type="NGON")
    bpy.ops.object.shade_smooth()
    box("Bent")
    bent = bpy.data.objects["Bent"].data
    bent.normals_split_custom_set([(0.6, 0.0, 0.8)] * len(bent.loops))
    places = [(0, 0, 0), (4, 2, 0), (0, 4, 0), (1, 2, 0), (9, 9, 9)]
    for shift in range(4):
        mesh = bpy.data.meshes.new("Arrow")
        corners = np.roll(range(4), shift).tolist()
        mesh.from_pydata(places, [(0, 4)], [corners, [*corners[:2], 4]])
        bpy.context.scene.collection.objects.link(bpy.data.objects.new("Arrow", mesh))
    bpy.data.meshes["Arrow"].materials.append(None)
    bpy.data.meshes["Arrow"].materials.append(bpy.data.materials.new("Second"))
    bpy.data.meshes["Arrow"].polygons[1].material_index = 1
    checked()


def changing_grids() -> None:
    """Meshes that modifiers, shape keys, textures, drivers and nodes change from frame to frame."""
    scene, holder = bpy.context.scene, mh.empty("Holder", (0, 0, 0))
    mh.key(holder, "location", (1, (0, 0, 0)), (20, (3, 1, 2)))
    texture = bpy.data.textures.new("Texture", "CLOUDS")
    mh.key(texture, "noise_scale", (1, 0.1), (20, 1.0))

    def grid(name: str, kind: str = "", **values: Any) -> Any:
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=20, y_subdivisions=20)
        bpy.context.object.name = name
        if not kind:
            return bpy.context.object
        modifier = bpy.context.object.modifiers.new(name, kind)
        for key, value in values.items():
            setattr(modifier, key, value)
        return modifier

    grid("Wave", "WAVE", height=1.0)
    grid("Build", "BUILD", frame_duration=20)
    grid("Texture", "DISPLACE", texture=texture)
    object_texture = bpy.data.textures.new("Of object", "CLOUDS")
    settings = {"texture_coords": "OBJECT", "texture_coords_object": holder}
    grid("Place", "DISPLACE", texture=object_texture, **settings)
    grid("Hook", "HOOK", object=holder).vertex_indices_set(range(200))
    keyed = grid("Keys")
    keyed.shape_key_add(name="Basis")
    shape = keyed.shape_key_add(name="Up")
    shape.data[5].co.z = 3.0
    mh.key(shape, "value", (1, 0.0), (20, 1.0))
    driver = grid("Driver", "SIMPLE_DEFORM").driver_add("angle").driver
    variable = driver.variables.new()
    variable.type, variable.targets[0].id_type = "SINGLE_PROP", "SCENE"
    variable.targets[0].id, variable.targets[0].data_path = scene, "frame_current"
    driver.expression = f"{variable.name} / 10"
    tree = bpy.data.node_groups.new("Time", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    kinds = (
        "NodeGroupInput", "GeometryNodeInputSceneTime", "ShaderNodeCombineXYZ",
        "GeometryNodeSetPosition", "NodeGroupOutput",
    )  # fmt: skip
    begin, time, vector, place, end = map(tree.nodes.new, kinds)
    for source, target in (
        (begin.outputs[0], place.inputs[0]),
        (time.outputs[0], vector.inputs[2]),
        (vector.outputs[0], place.inputs["Offset"]),
        (place.outputs[0], end.inputs[0]),
    ):
        tree.links.new(source, target)
    grid("Nodes", "NODES", node_group=tree)


def test_meshes_that_change_with_time_are_read_again() -> None:
    """Of each object, what is kept is what Blender evaluates at the frame."""
    rs.new_scene()
    changing_grids()
    before: dict[str, Any] = {}
    changed = set()
    for frame in (1, 5, 14):
        bpy.context.scene.frame_set(frame)
        found = take_snapshot(bpy.context.evaluated_depsgraph_get())
        for shape in found.shapes:
            mesh, name = found.mesh(shape), shape.original.name
            if mesh is None:
                continue
            with evaluated_mesh(found.evaluated(shape.original)) as shown:
                assert shown is not None
                own = read_numbers(shown.vertices, "co", 3)
            np.testing.assert_array_equal(mesh.vertices, own, name)
            if not np.array_equal(before.get(name, own), own):
                changed.add(name)
            before[name] = own
    assert changed == {"Wave", "Build", "Texture", "Place", "Hook", "Keys", "Driver", "Nodes"}


def test_a_mesh_of_which_only_instances_are_there_is_read_again() -> None:
    """Blender puts a new mesh where it has freed another one, so its address tells nothing."""
    rs.new_scene()
    holder = bpy.data.collections.new("Holder")
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    holder.objects.link(cube)
    bpy.context.scene.collection.objects.unlink(cube)
    rs.instance_of(holder)
    smoother = cube.modifiers.new("Smoother", "SUBSURF")
    seen, addresses = 0, set()
    for step in range(40):
        smoother.levels = 1 + step % 3
        (shape,) = (one for one in checked().shapes if one.original == cube)
        mesh = checked().mesh(shape)
        assert mesh is not None
        assert len(mesh.sides) == 6 * 4**smoother.levels, step
        seen += shape.address in addresses
        addresses.add(shape.address)
    assert seen, "no address came twice, so nothing was tested"


def test_another_file_has_another_snapshot() -> None:
    rs.new_scene()
    box("One")
    checked()
    rs.new_scene()
    box("Other")
    assert "Other" in {shape.original.name for shape in checked().shapes}


def test_an_object_that_changed_and_was_removed_is_gone() -> None:
    """Between two snapshots, as between two redraws of a panel."""
    rs.new_scene()
    kept, lost = box("Kept"), box("Lost", (5.0, 0.0, 0.0))
    bpy.context.view_layer.update()
    first = checked()
    lost.data.materials.append(bpy.data.materials.new("Other"))
    bpy.context.view_layer.update()
    bpy.data.objects.remove(lost)
    bpy.context.view_layer.update()
    found = checked()
    assert len(found.shapes) == len(first.shapes) - 1
    assert kept in [shape.original for shape in found.shapes]


def test_a_walk_is_made_in_parts() -> None:
    """A redrawn panel or a timer asks for one part after the other; all ask for the same walk."""
    rs.new_scene()
    cubes = [box(f"Cube {number}", (3.0 * number, 0.0, 0.0)) for number in range(300)]
    first = checked()
    box("New", (0.0, 5.0, 0.0))
    bpy.data.objects.remove(cubes[7])
    parts = 1
    while (found := part_of_snapshot(bpy.context)) is None:
        parts += 1
    assert parts > 300 // snapshot._ROWS
    assert checked() is found and part_of_snapshot(bpy.context) is found
    kept = set(map(id, first.shapes)) & set(map(id, found.shapes))
    assert len(kept) == len(first.shapes) - 1, "unchanged shapes are kept, with their meshes"


def test_a_walk_that_an_edit_interrupts_begins_again_and_ends() -> None:
    rs.new_scene()
    cubes = [box(f"Cube {number}", (3.0 * number, 0.0, 0.0)) for number in range(200)]
    checked()
    for number in range(10):
        box(f"New {number}", (0.0, 5.0 + number, 0.0))
        found = part_of_snapshot(bpy.context)
        if found is not None:
            break
        part_of_snapshot(bpy.context)
        cubes[3].location.z += 1.0
    assert found is not None and number == snapshot._RESTARTS + 1
    assert checked() is found
    # half way, the whole is asked for
    bpy.data.objects.remove(cubes[5])
    assert part_of_snapshot(bpy.context) is None
    assert len(checked().shapes) == len(found.shapes) - 1
