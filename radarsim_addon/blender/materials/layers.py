# SPDX-License-Identifier: GPL-3.0-or-later
"""Find objects that are plane-parallel layers, and the direction of their faces.

A wave that crosses a layer at an angle is refracted. Absorption and delay inside depend on the
angle to the faces of the layer (see `nodes.physical_material`). A shader does not know these faces
inside an object, so `set_layer_normals` stores their normal as a custom property of the object, or,
for walls in several directions, the thickness of each. The absorption across objects, and thin
panes that are modelled by both of their sides, give findings.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from typing import Any
from weakref import WeakKeyDictionary

import bpy
import numpy as np

from ...arrays import Real
from ...findings import Finding, finding, finding_about
from ...signal.scene import (
    LAYER_SHARE,
    MIN_PLATE_FRACTION,
    MOST_TRIANGLES,
    ConvexBodies,
    Depths,
    LayerFaces,
    WallFaces,
    convex_bodies,
    depths_behind,
    find_walls,
)
from ..nodes import attributes
from ..state import SettingsRestorer, Snapshot, read_mesh
from .physical_materials import SHEET_THICKNESS, assigned_materials
from .surfaces import surfaces_of

_NAME = "radarsim walls"


def store_thickness(recorder: SettingsRestorer, item: bpy.types.Object, thickness: Real) -> bool:
    """Store the thickness of walls on the faces of an object's evaluated mesh, until restored.

    `thickness` is in the object's own units, for each polygon. Returns False for a linked object
    whose faces come from modifiers, because it cannot get another modifier.
    """
    if item.library is not None:
        return _store_in_mesh(recorder, item.data, thickness)
    mesh = bpy.data.meshes.new(_NAME)
    recorder.on_restore(_NAME, lambda: bpy.data.meshes.remove(mesh))
    mesh.vertices.add(len(thickness))
    held = mesh.attributes.new(attributes.FACE_WALL_THICKNESS, "FLOAT", "POINT")
    held.data.foreach_set("value", thickness.astype("f4"))
    holder = bpy.data.objects.new(_NAME, mesh)
    recorder.on_restore(_NAME, lambda: bpy.data.objects.remove(holder))
    holder.hide_render = True
    _draw_thickness(_add_modifier(recorder, item), holder)
    return True


def _store_in_mesh(recorder: SettingsRestorer, mesh: bpy.types.Mesh, thickness: Real) -> bool:
    """Store the thickness on the faces of a linked mesh, in memory. False if its faces differ in
    number.

    The values are set one by one, because foreach_set does not change linked data.
    """
    name = attributes.FACE_WALL_THICKNESS
    if len(mesh.polygons) != len(thickness):
        return False
    if name not in mesh.attributes:  # else by another object of this mesh
        held = mesh.attributes.new(name, "FLOAT", "FACE")
        for element, value in zip(held.data, thickness.tolist(), strict=True):
            element.value = value
        recorder.on_restore(name, lambda: mesh.attributes.remove(mesh.attributes[name]))
        mesh.update_tag()
    return True


def sharpen_edges(recorder: SettingsRestorer, item: bpy.types.Object, angle_deg: float) -> None:
    """End the smooth normals of an object at edges that are sharper than an angle, until restored.

    Imported custom normals are removed. Objects with unequal scales along their axes are shaded
    flat, because the scale changes their angles. A linked object keeps its normals if it has
    modifiers or custom normals; otherwise its mesh is changed in memory.
    """
    if item.library is not None:
        if not item.modifiers and "custom_normal" not in item.data.attributes:
            _sharpen_mesh(recorder, item.data, 0.0 if _is_distorted(item) else angle_deg)
        return
    tree = _add_modifier(recorder, item)
    kinds = (
        "NodeGroupInput",
        "GeometryNodeInputMeshEdgeAngle",
        "ShaderNodeMath",
        "GeometryNodeRemoveAttribute",
        "GeometryNodeSetShadeSmooth",
        "NodeGroupOutput",
    )
    begin, angle, above, remove, shade, end = map(tree.nodes.new, kinds)
    above.operation, shade.domain = "GREATER_THAN", "EDGE"
    above.inputs[1].default_value = math.radians(angle_deg)
    remove.inputs["Name"].default_value = "custom_normal"
    shade.inputs["Shade Smooth"].default_value = False
    if _is_distorted(item):
        shade.domain = "FACE"
        above.operation, above.inputs[1].default_value = "ADD", 1.0  # all
    for source, target in (
        (begin.outputs["Geometry"], remove.inputs["Geometry"]),
        (angle.outputs["Unsigned Angle"], above.inputs[0]),
        (above.outputs[0], shade.inputs["Selection"]),
        (remove.outputs["Geometry"], shade.inputs[0]),
        (shade.outputs[0], end.inputs["Geometry"]),
    ):
        tree.links.new(source, target)


def _is_distorted(item: bpy.types.Object) -> bool:
    """Return whether unequal scales along the axes change the angles of an object."""
    scale = item.matrix_world.to_scale()
    return bool(max(scale) > 1.01 * min(scale))


def _sharpen_mesh(recorder: SettingsRestorer, mesh: bpy.types.Mesh, angle_deg: float) -> None:
    """Mark the edges of a linked mesh with more than this angle as sharp, in memory."""
    name = "sharp_edge"
    faces = read_mesh(mesh)
    edge, normal = faces.corner_edges, np.repeat(faces.normals, faces.sides, axis=0)
    order = np.argsort(edge, kind="stable")
    one, other = order[:-1], order[1:]
    cosine = np.einsum("nx,nx->n", normal[one], normal[other])
    sharp = (edge[one] == edge[other]) & (cosine < math.cos(math.radians(angle_deg)))
    before = mesh.attributes.get(name)
    if before is None:  # else by another object of this mesh
        mesh.attributes.new(name, "BOOLEAN", "EDGE")
        recorder.on_restore(name, lambda: mesh.attributes.remove(mesh.attributes[name]))
    for index in np.unique(edge[one[sharp]]).tolist():  # foreach_set leaves linked data as it is
        recorder.set(mesh.edges[index], "use_edge_sharp", True)
    mesh.update_tag()


def _add_modifier(recorder: SettingsRestorer, item: bpy.types.Object) -> Any:
    """Give an object a modifier until restored; returns its tree, with sockets for geometry."""
    tree = bpy.data.node_groups.new(_NAME, "GeometryNodeTree")
    recorder.on_restore(_NAME, lambda: bpy.data.node_groups.remove(tree))
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    modifier = item.modifiers.new(_NAME, "NODES")
    recorder.on_restore(item.name, lambda: item.modifiers.remove(modifier))
    modifier.node_group = tree
    return tree


def _draw_thickness(tree: bpy.types.NodeTree, holder: Any) -> None:
    """Copy the values of the holder's points to the faces, by their number."""
    kinds = (
        "NodeGroupInput",
        "GeometryNodeObjectInfo",
        "GeometryNodeInputNamedAttribute",
        "GeometryNodeInputIndex",
        "GeometryNodeSampleIndex",
        "GeometryNodeStoreNamedAttribute",
        "NodeGroupOutput",
    )
    begin, held, named, index, sample, store, end = map(tree.nodes.new, kinds)
    held.inputs["Object"].default_value = holder
    named.data_type = sample.data_type = store.data_type = "FLOAT"
    sample.domain, store.domain = "POINT", "FACE"
    named.inputs["Name"].default_value = attributes.FACE_WALL_THICKNESS
    store.inputs["Name"].default_value = attributes.FACE_WALL_THICKNESS
    for source, target in (
        (begin.outputs["Geometry"], store.inputs["Geometry"]),
        (held.outputs["Geometry"], sample.inputs["Geometry"]),
        (named.outputs["Attribute"], sample.inputs["Value"]),
        (index.outputs["Index"], sample.inputs["Index"]),
        (sample.outputs["Value"], store.inputs["Value"]),
        (store.outputs["Geometry"], end.inputs["Geometry"]),
    ):
        tree.links.new(source, target)


#: Two-way absorption that Cycles can represent [dB]. For an echo of 1 W/(m^2 sr) without the wall,
#: measured power and range are correct up to 360 dB, and the range is lost from 372 dB. Blender up
#: to 4.5 returns zero from 122 dB.
MAX_LOSS_DB = 350.0
MAX_LOSS_DB_4_5 = 120.0
#: Two-way absorption that the two faces of a wall can hold in place of its volume [dB]: Cycles
#: drops what passes a face with less than 1e-5.
FACES_LOSS_DB = 100.0
#: Maximum fraction of the walls of a layer that lie across another direction.
_MOST_ACROSS = 0.01
#: Minimum fraction of the surface of an object that consists of walls: the rest are rims.
_WALL_SHARE = 0.75


def set_layer_normals(recorder: SettingsRestorer, snapshot: Snapshot) -> list[Finding]:
    """Set what is known of the walls of each object with a penetrable physical material.

    That is normal and thickness of a layer, or the common thickness of walls in several directions.
    Linked objects are changed in memory. Properties that the user has set do not change; a normal
    of [0, 0, 0] means that the object is no layer. Returns a finding about the objects that are
    none.
    """
    others: list[str] = []
    surfaces = surfaces_of(snapshot)
    items = [
        item
        for item, materials in assigned_materials(snapshot)
        if any(one.is_entered for one in surfaces.of(materials))
    ]
    faces = layer_faces(snapshot, items)
    given = [item.get(attributes.OBJECT_LAYER_NORMAL) for item in items]
    own = np.array([one is not None for one in given], dtype=bool)
    normals = faces.layer_normals()
    for row in np.flatnonzero(own).tolist():
        normals[row] = given[row] if np.any(given[row]) else np.nan
    low, high = faces.planes(normals, MIN_PLATE_FRACTION)
    massive = {item for bodies in convex_parts(snapshot) for item in bodies.without_walls()}
    for row, (item, thickness) in enumerate(zip(items, (high - low).tolist(), strict=True)):
        normal = None if np.isnan(normals[row, 0]) else normals[row]
        if own[row]:
            _set_thickness(recorder, item, thickness)
        elif normal is None or math.isnan(thickness):
            linear = snapshot.matrix_of(item)[:3, :3]
            walls = None if item in massive else find_walls(snapshot.mesh_of(item), linear)
            known = _set_what_is_found(recorder, item, linear, normal, walls)
            others += [] if known else [item.name_full]
        else:
            _set_layer(recorder, item, normal, thickness)
        if attributes.OBJECT_LAYER_NORMAL in item or attributes.OBJECT_SHELL_THICKNESS in item:
            # Cycles reads custom properties again only after a tag
            item.update_tag(refresh={"OBJECT"})
    if not others:
        return []
    return [
        finding(
            "not-a-layer",
            *others,
            least_fraction=LAYER_SHARE,
            least_walls=_WALL_SHARE,
            property=attributes.OBJECT_LAYER_NORMAL,
        )
    ]


def _set_what_is_found(
    recorder: SettingsRestorer,
    item: bpy.types.Object,
    linear: Real,
    normal: Real | None,
    walls: WallFaces | None,
) -> bool:
    """Set the walls of an object that is not a single plate. Return whether this describes all of
    its walls.
    """
    several = walls is not None and bool(walls.wall.any())
    if walls is not None and several and normal is not None:
        across = normal @ np.linalg.inv(linear)
        several = walls.across(across / np.linalg.norm(across)) > _MOST_ACROSS
    if walls is not None and several and walls.share >= _WALL_SHARE:
        one = walls.one_thickness
        if one is None and store_thickness(recorder, item, walls.thickness):
            one = float(np.median(walls.thickness[walls.wall]))
        if one is not None:
            recorder.set_item(item, attributes.OBJECT_SHELL_THICKNESS, one)
            return True
    if normal is not None:
        _set_layer(recorder, item, normal, math.nan)
    return normal is not None and not several


def _set_layer(
    recorder: SettingsRestorer, item: bpy.types.Object, normal: Real, thickness: float
) -> None:
    recorder.set_item(item, attributes.OBJECT_LAYER_NORMAL, [float(x) for x in normal])
    _set_thickness(recorder, item, thickness)


def _set_thickness(recorder: SettingsRestorer, item: bpy.types.Object, thickness: float) -> None:
    """Set the thickness of a plate, unless the user has set it. NaN: the object is not a plate."""
    if attributes.OBJECT_LAYER_THICKNESS not in item and not math.isnan(thickness):
        recorder.set_item(item, attributes.OBJECT_LAYER_THICKNESS, thickness)


def layer_faces(snapshot: Snapshot, items: Sequence[bpy.types.Object]) -> LayerFaces:
    """Return the polygons of objects, in which layers are looked for."""
    linear = [snapshot.matrix_of(item)[:3, :3] for item in items]
    meshes = [snapshot.mesh_of(item) for item in items]
    return LayerFaces.of_meshes(meshes, np.array(linear).reshape(-1, 3, 3))


def _depths_of(snapshot: Snapshot, item: bpy.types.Object) -> Depths | None:
    """Return the depths behind the largest triangles of an object; None without faces."""
    mesh = snapshot.mesh_of(item)
    if mesh is None or not len(mesh.sides):
        return None
    return depths_behind(mesh, snapshot.matrix_of(item)[:3, :3])


#: By snapshot.
_of_snapshots: WeakKeyDictionary[Snapshot, list[ConvexBodies]] = WeakKeyDictionary()


def convex_parts(snapshot: Snapshot) -> list[ConvexBodies]:
    """Return the objects with an interior that are small closed convex meshes, in groups."""
    if snapshot not in _of_snapshots:
        surfaces, bodies = surfaces_of(snapshot), []
        for item, materials in assigned_materials(snapshot):
            shape = snapshot.own_shapes.get(item)
            if shape is None or shape.kind != "MESH":
                continue
            if not any(one.has_interior for one in surfaces.of(materials)):
                continue
            if 3 < snapshot.face_count(shape) <= MOST_TRIANGLES:
                mesh = snapshot.mesh(shape)
                if mesh is not None:
                    bodies.append((item, mesh, snapshot.matrix_of(item)))
        _of_snapshots[snapshot] = list(convex_bodies(bodies))
    return _of_snapshots[snapshot]


def convex_objects(snapshot: Snapshot) -> set[Hashable]:
    """Return the original objects that have an interior and are small closed convex meshes."""
    return {item for part in convex_parts(snapshot) for item in part.items}


def thinnest(snapshot: Snapshot, item: bpy.types.Object) -> float:
    """Return the least depth behind the largest faces of an object, along their normals [Blender
    units].

    It is 0 if the mesh is open behind all of them.
    """
    depths = _depths_of(snapshot, item)
    if depths is None or not np.isfinite(depths.depth).any():
        return 0.0
    return float(depths.depth.min())


def interior_losses_db(wavelength: float, snapshot: Snapshot) -> dict[str, float]:
    """Return the two-way absorption [dB] of objects of physical materials, by full name.

    It is the absorption at the thinnest place of each object. `wavelength` is in Blender units.
    """
    surfaces = surfaces_of(snapshot)
    depths: dict[Hashable, float] = {}
    for bodies in convex_parts(snapshot):
        depths.update(zip(bodies.items, bodies.thinnest().tolist(), strict=True))
    losses = {}
    for item, materials in assigned_materials(snapshot):
        entered = [surface for surface in surfaces.of(materials) if surface.is_entered]
        if item.type != "MESH" or not entered:
            continue
        kappa = max((one.kappa for one in entered if one.kappa is not None), default=0.0)
        if kappa > 0:
            depth = depths[item] if item in depths else thinnest(snapshot, item)
            nepers = 2 * 4 * math.pi * kappa / wavelength * depth
            losses[item.name_full] = nepers * 10 / math.log(10)
    return losses


def beyond_float32(losses_db: dict[str, float]) -> list[Finding]:
    """Return findings on objects that absorb so much that float32 cannot hold the rest of the echo.

    `losses_db` comes from `interior_losses_db`. At most two `absorption-below-float32` result: one
    as information, one as a caution.
    """
    key = attributes.OBJECT_SHELL_THICKNESS
    information: dict[str, dict[str, float]] = {}
    caution: dict[str, dict[str, float]] = {}
    shells = {item.name_full for item in bpy.data.objects if key in item}
    for name, loss_db in losses_db.items():
        limit_db = MAX_LOSS_DB if bpy.app.version >= (5, 0, 0) else MAX_LOSS_DB_4_5
        if name in shells:
            limit_db = FACES_LOSS_DB
        if loss_db > limit_db:
            # no radar receives what is behind so much
            named = information if loss_db > MAX_LOSS_DB else caution
            named[name] = {"loss_db": loss_db, "limit_db": limit_db}
    said = []
    if information:
        said.append(finding_about("absorption-below-float32", information).as_information())
    if caution:
        said.append(finding_about("absorption-below-float32", caution))
    return said


#: Distance of two sides, in thicknesses of the pane, within which they are those of one pane.
_NEAR = 10.0
#: Fraction of the surface with another side from which on an object is named.
_LEAST_FRACTION = 0.1


def doubled_panes(snapshot: Snapshot, metres_per_unit: float) -> list[Finding]:
    """Return findings on thin sheets with another face right behind them, because the wave passes
    both.
    """
    named, surfaces = [], surfaces_of(snapshot)
    for item, materials in assigned_materials(snapshot):
        sheets = [one for one in materials if surfaces[one].kind == "sheet"]
        if item.type != "MESH" or not sheets:
            continue
        depths = _depths_of(snapshot, item)
        if depths is None:
            continue
        thickness_m = max(float(m.get(SHEET_THICKNESS, 0.0)) for m in sheets)
        with np.errstate(invalid="ignore"):
            near = depths.parallel & (depths.depth * metres_per_unit <= _NEAR * thickness_m)
        if depths.area[near].sum() > _LEAST_FRACTION * depths.area.sum():
            named.append(item.name)
    return [finding("pane-counts-twice", *named)] if named else []
