# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of the scene without rendering it: its extent, and where its objects truly are."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ... import contract
from ...array_types import Real
from ...sidecar import file_sha256
from ..materials import SURFACE_TYPES, roughness_of, slot_materials
from ..nodes.groups import KIND_PROPERTY
from ..plan import Extent
from .finite_checks import check_meshes_finite
from .isolation import ABSORBER_NAME, animation_curves, echoes
from .nearest import nearest_distance
from .visibility import rendered_objects


@dataclass(frozen=True)
class _EvaluatedObject:
    """One object, or one instance of it, as the depsgraph shows it."""

    name: str
    key: tuple[int, ...]
    evaluated: Any
    matrix: Real  # (4, 4), Blender units


def _shown_surfaces(depsgraph: Any) -> Iterator[_EvaluatedObject]:
    rendered = rendered_objects(depsgraph.view_layer)
    for item in depsgraph.object_instances:
        evaluated = item.object
        if evaluated.type not in SURFACE_TYPES or not item.show_self:
            continue
        original = evaluated.original
        if original.hide_render:
            continue
        if (item.parent.original if item.is_instance else original) not in rendered:
            continue
        name = original.name
        if item.is_instance:
            name = f"{item.parent.original.name}/{name}"
        key = tuple(item.persistent_id) if item.is_instance else ()
        yield _EvaluatedObject(name, key, evaluated, np.array(item.matrix_world, dtype=np.float64))


def _corners(shown: _EvaluatedObject) -> Real:
    """Bounding box, shape (8, 3), world space, Blender units."""
    box = np.array([tuple(corner) for corner in shown.evaluated.bound_box], dtype=np.float64)
    return np.asarray(box @ shown.matrix[:3, :3].T + shown.matrix[:3, 3])


def check_surfaces(depsgraph: Any) -> None:
    """Refuse surfaces whose place or shape is not finite at the depsgraph's time.

    Raises
    ------
    SceneError
        By the object's name.
    """
    check_meshes_finite((s.name, s.evaluated, s.matrix) for s in _shown_surfaces(depsgraph))


def scene_extent(
    depsgraph: Any, rig: Any, metres_per_unit: float, any_material: bool = False
) -> Extent:
    """How far what can echo reaches at the depsgraph's time, through instances.

    Bounding boxes are used: never too small, at most a little too large.
    """
    receiver = _origin(rig.camera, depsgraph)
    transmitter = _origin(rig.emitter, depsgraph)
    boxes = [
        _corners(s)
        for s in _shown_surfaces(depsgraph)
        if any_material or echoes(s.evaluated.original)
    ]
    if not boxes:
        return Extent(baseline_m=float(np.linalg.norm(receiver - transmitter)) * metres_per_unit)
    corners = np.concatenate(boxes)

    def farthest(origin: Real) -> float:
        return float(np.linalg.norm(corners - origin, axis=1).max())

    return Extent(
        from_emitter_m=farthest(transmitter) * metres_per_unit,
        from_receiver_m=farthest(receiver) * metres_per_unit,
        baseline_m=float(np.linalg.norm(receiver - transmitter)) * metres_per_unit,
        diameter_m=float(np.linalg.norm(np.ptp(corners, axis=0))) * metres_per_unit,
    )


def _origin(item: Any, depsgraph: Any) -> Real:
    return np.array(item.evaluated_get(depsgraph).matrix_world, dtype=np.float64)[:3, 3]


# -- labels of a radar frame -----------------------------------------------------------------------


@dataclass(frozen=True)
class ObjectPositions:
    """Distances of the objects' origins from the receiver at one moment, by name and instance."""

    origin_range_m: dict[tuple[str, tuple[int, ...]], float]


def origin_positions(depsgraph: Any, rig: Any, metres_per_unit: float) -> ObjectPositions:
    """Origins at the depsgraph's time; the difference of two moments gives range rates."""
    receiver = _origin(rig.camera, depsgraph)
    return ObjectPositions(
        {
            (s.name, s.key): float(np.linalg.norm(s.matrix[:3, 3] - receiver)) * metres_per_unit
            for s in _shown_surfaces(depsgraph)
        }
    )


def object_records(
    depsgraph: Any,
    rig: Any,
    metres_per_unit: float,
    later: ObjectPositions | None = None,
    interval_s: float = 0.0,
) -> list[contract.ObjectRecord]:
    """Where the objects are at the depsgraph's time.

    Instances of one object by one instancer share a record, that of the nearest of them, named
    ``instancer/object``. Objects that are not rendered are not in the list.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
    rig : Rig
    metres_per_unit
        Metres per Blender unit.
    later
        Origins `interval_s` later; None where there is one pass only.
    interval_s
        Time between the two moments [s].
    """
    receiver = _origin(rig.camera, depsgraph)
    nearest: dict[str, tuple[float, contract.ObjectRecord]] = {}
    for shown in _shown_surfaces(depsgraph):
        known = nearest.get(shown.name)
        corners = _corners(shown) - receiver
        centre = corners.mean(axis=0)
        # No point of the box is nearer than this; it spares most instances the exact distance.
        least = np.linalg.norm(centre) - np.linalg.norm(corners - centre, axis=1).max()
        if known is not None and known[0] <= least:
            continue
        distance = _surface_distance(shown, receiver)
        if distance is None or (known is not None and known[0] <= distance):
            continue
        origin_m = float(np.linalg.norm(shown.matrix[:3, 3] - receiver)) * metres_per_unit
        rate = None
        if later is not None and interval_s > 0:
            origin_later_m = later.origin_range_m.get((shown.name, shown.key))
            if origin_later_m is not None:
                rate = (origin_later_m - origin_m) / interval_s
        materials = [
            material.name
            for material in slot_materials(shown.evaluated)
            if material is not None and material.name != ABSORBER_NAME
        ]
        rms_height_m, correlation_length_m = roughness_of(shown.evaluated)
        nearest[shown.name] = (
            distance,
            contract.ObjectRecord(
                name=shown.name,
                nearest_range_m=distance * metres_per_unit,
                origin_range_m=origin_m,
                range_rate_mps=rate,
                materials=materials,
                collections=collections_of(shown.evaluated.original),
                rms_height_m=rms_height_m,
                correlation_length_m=correlation_length_m,
            ),
        )
    return [record for _, (_, record) in sorted(nearest.items())]


def collections_of(item: Any) -> list[str]:
    """Names of the collections that hold an object, their parents included, sorted."""
    held = set(item.users_collection)
    while True:
        parents = {
            outer
            for outer in bpy.data.collections
            if outer not in held and any(child in held for child in outer.children)
        }
        if not parents:
            break
        held |= parents
    # The scene's own root collection is not among those of the file.
    return sorted(held_by.name for held_by in held if held_by.name in bpy.data.collections)


def _surface_distance(shown: _EvaluatedObject, point: Real) -> float | None:
    """Least distance of a point from the evaluated surface, Blender units; None without faces."""
    mesh = shown.evaluated.to_mesh()
    if mesh is None:
        return None
    try:
        vertices, triangles = _mesh_arrays(mesh)
    finally:
        shown.evaluated.to_mesh_clear()
    if len(triangles) == 0:
        return None
    world = vertices @ shown.matrix[:3, :3].T + (shown.matrix[:3, 3] - point)
    return nearest_distance(world, triangles)


def _mesh_arrays(mesh: Any) -> tuple[Real, NDArray[np.int32]]:
    mesh.calc_loop_triangles()
    vertices = np.empty(len(mesh.vertices) * 3, dtype=np.float32)
    mesh.vertices.foreach_get("co", vertices)
    triangles = np.empty(len(mesh.loop_triangles) * 3, dtype=np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    return vertices.astype(np.float64).reshape(-1, 3), triangles.reshape(-1, 3)


# -- what the scene is, for the fingerprint --------------------------------------------------------


def file_digest(just_opened: bool = False) -> str | None:
    """Hash of the saved .blend and its libraries; None where there are unsaved changes.

    `just_opened` is for callers that know there are none: as a module, Blender up to 5.0 calls
    every file changed.
    """
    if not bpy.data.filepath or (bpy.data.is_dirty and not just_opened):
        return None
    paths = [Path(bpy.data.filepath)]
    paths += [Path(bpy.path.abspath(library.filepath)) for library in bpy.data.libraries]
    digest = hashlib.sha256()
    for path in paths:
        try:
            digest.update(file_sha256(path).encode())
        except OSError:
            return None
    return "file:" + digest.hexdigest()


def animation_digest() -> str:
    """Hash of all key frames in the file."""
    digest = hashlib.sha256()
    for item in bpy.data.objects:
        for curve in animation_curves(item.animation_data):
            digest.update(f"{item.name}.{curve.data_path}[{curve.array_index}]".encode())
            for point in curve.keyframe_points:
                numbers = (*point.co, *point.handle_left, *point.handle_right)
                digest.update(f"{numbers}{point.interpolation}".encode())
    return "keys:" + digest.hexdigest()


def geometry_digest(depsgraph: Any, rig: Any) -> str:
    """Hash of what is seen at the depsgraph's time: geometry, places, materials, antennas."""
    digest = hashlib.sha256()
    for item in (rig.camera, rig.emitter):
        evaluated = item.evaluated_get(depsgraph)
        digest.update(np.array(evaluated.matrix_world).tobytes())
    camera, lamp = rig.camera.data, rig.emitter.data
    digest.update(
        repr((camera.lens, camera.sensor_fit, camera.sensor_width, camera.sensor_height)).encode()
    )
    digest.update(repr((camera.shift_x, camera.shift_y, lamp.energy)).encode())
    hashed: dict[int, bytes] = {}
    for shown in _shown_surfaces(depsgraph):
        digest.update(repr((shown.name, shown.key)).encode() + shown.matrix.tobytes())
        pointer = shown.evaluated.data.as_pointer()
        if pointer not in hashed:
            hashed[pointer] = _mesh_digest(shown.evaluated)
        digest.update(hashed[pointer])
        for material in slot_materials(shown.evaluated):
            digest.update(_material_text(material).encode())
    return "scene:" + digest.hexdigest()


def _mesh_digest(evaluated: Any) -> bytes:
    mesh = evaluated.to_mesh()
    if mesh is None:
        return b""
    try:
        vertices, triangles = _mesh_arrays(mesh)
    finally:
        evaluated.to_mesh_clear()
    return hashlib.sha256(vertices.tobytes() + triangles.tobytes()).digest()


def _material_text(material: Any) -> str:
    if material is None or material.node_tree is None:
        return repr(None if material is None else material.name)
    return "\n".join([material.name, *_tree_text(material.node_tree)])


def _tree_text(tree: Any) -> list[str]:
    """Values and links of a node tree, and of the groups in it that are not ours."""
    parts = []
    for node in tree.nodes:
        inner = getattr(node, "node_tree", None)
        if inner is not None and KIND_PROPERTY not in inner:
            parts += [inner.name, *_tree_text(inner)]
        for socket in node.inputs:
            value = getattr(socket, "default_value", None)
            if value is not None and not isinstance(value, str | float | int | bool):
                value = tuple(value) if hasattr(value, "__len__") else None
            parts.append(f"{node.bl_idname}.{socket.identifier}={value!r}")
    parts += [
        f"{link.from_node.bl_idname}.{link.from_socket.identifier}>{link.to_socket.identifier}"
        for link in tree.links
    ]
    return parts
