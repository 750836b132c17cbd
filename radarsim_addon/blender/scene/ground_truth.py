# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of a scene that need no render: extent, ground truth of objects, fingerprint."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ... import contract
from ...array_types import Real
from ...sidecar import file_sha256
from ..materials import SURFACE_TYPES, roughness_of, slot_materials
from ..nodes.groups import KIND_PROPERTY
from ..plan import Extent
from ..state import EvaluatedObject, Key, evaluated_mesh, evaluated_objects, read_triangles
from .finite_checks import check_meshes_finite
from .isolation import ABSORBER_NAME, animation_curves, echoes
from .nearest import nearest_distance
from .rig import Rig
from .visibility import rendered_objects


def _rendered_surfaces(depsgraph: Any) -> Iterator[EvaluatedObject]:
    rendered = rendered_objects(depsgraph.view_layer)
    for one in evaluated_objects(depsgraph):
        if one.evaluated.type not in SURFACE_TYPES or not one.visible or one.original.hide_render:
            continue
        if (one.instancer or one.original) in rendered:
            yield one


def _corners(one: EvaluatedObject) -> Real:
    """Return the bounding box in world space, shape (8, 3), Blender units."""
    return np.asarray(one.box @ one.matrix[:3, :3].T + one.matrix[:3, 3])


def check_surfaces(depsgraph: Any) -> None:
    """Check that all rendered surfaces are finite at the depsgraph's time; `SceneError` if not."""
    check_meshes_finite(_rendered_surfaces(depsgraph))


def scene_extent(
    depsgraph: Any, rig: Rig, metres_per_unit: float, any_material: bool = False
) -> Extent:
    """Return the distances of the surfaces that can echo, at the depsgraph's time.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.
    rig
        Antennas.
    metres_per_unit
        Metres per Blender unit.
    any_material
        Include surfaces without a Radar Material.

    Returns
    -------
    Extent
        Distances of bounding boxes, so never too small [m]. Only the baseline if nothing can echo.
    """
    boxes = echoing_boxes(depsgraph, any_material)
    return extent_of_boxes(boxes, antenna_positions(depsgraph, rig), metres_per_unit)


#: Corners of bounding boxes in world space, (8, 3) [Blender units], by label and instance.
Boxes = list[tuple[tuple[str, Key], Real]]


def echoing_boxes(depsgraph: Any, any_material: bool) -> Boxes:
    """Return the boxes of the surfaces that can echo; of all surfaces with `any_material`."""
    return [
        ((one.label, one.key), _corners(one))
        for one in _rendered_surfaces(depsgraph)
        if any_material or echoes(one.original)
    ]


def antenna_positions(depsgraph: Any, rig: Rig) -> tuple[Real, Real]:
    """Return the places of receiver and transmitter, (3,) each [Blender units]."""
    return _origin(rig.camera, depsgraph), _origin(rig.emitter, depsgraph)


def extent_of_boxes(boxes: Boxes, antennas: tuple[Real, Real], metres_per_unit: float) -> Extent:
    """Return `scene_extent` from boxes, and the places of receiver and transmitter."""
    receiver, transmitter = antennas
    baseline_m = float(np.linalg.norm(receiver - transmitter)) * metres_per_unit
    if not boxes:
        return Extent(baseline_m=baseline_m)
    corners = np.concatenate([box for _, box in boxes])

    def farthest_m(origin: Real) -> float:
        return float(np.linalg.norm(corners - origin, axis=1).max()) * metres_per_unit

    return Extent(
        from_emitter_m=farthest_m(transmitter),
        from_receiver_m=farthest_m(receiver),
        baseline_m=baseline_m,
        diameter_m=float(np.linalg.norm(np.ptp(corners, axis=0))) * metres_per_unit,
    )


def _origin(item: Any, depsgraph: Any) -> Real:
    return np.array(item.evaluated_get(depsgraph).matrix_world, dtype=np.float64)[:3, 3]


# -- ground truth ----------------------------------------------------------------------------------


#: Distances of the objects' origins from the receiver [m], by label and instance.
_OriginRanges = dict[tuple[str, Key], float]


def origin_ranges(depsgraph: Any, rig: Rig, metres_per_unit: float) -> _OriginRanges:
    """Return the ranges of all origins at the depsgraph's time."""
    receiver = _origin(rig.camera, depsgraph)
    return {
        (one.label, one.key): _origin_range(one, receiver) * metres_per_unit
        for one in _rendered_surfaces(depsgraph)
    }


def object_records(
    depsgraph: Any,
    rig: Rig,
    metres_per_unit: float,
    later: _OriginRanges | None = None,
    interval_s: float = 0.0,
) -> list[contract.ObjectRecord]:
    """Return the ground truth of all rendered objects at the depsgraph's time, sorted by name.

    All instances of one object by one instancer have one record, that of the nearest instance, with
    the name ``instancer/object``. `later` has the origins `interval_s` later [s], for range rates.
    """
    receiver = _origin(rig.camera, depsgraph)
    nearest: dict[str, tuple[float, contract.ObjectRecord]] = {}
    collections = _collections_of_objects()
    for one in _rendered_surfaces(depsgraph):
        known = nearest[one.label][0] if one.label in nearest else math.inf
        corners = _corners(one) - receiver
        centre = corners.mean(axis=0)
        # No point of the box is nearer than this, so most instances need no exact distance.
        lower_bound = np.linalg.norm(centre) - np.linalg.norm(corners - centre, axis=1).max()
        if known <= lower_bound:
            continue
        distance = _surface_distance(one, receiver)
        if distance is None or known <= distance:
            continue
        origin_m = _origin_range(one, receiver) * metres_per_unit
        origin_later_m = None if later is None else later.get((one.label, one.key))
        rate_mps = None
        if origin_later_m is not None and interval_s > 0:
            rate_mps = (origin_later_m - origin_m) / interval_s
        held_by = collections.get(one.original.name_full, [])
        record = _object_record(one, held_by, distance * metres_per_unit, origin_m, rate_mps)
        nearest[one.label] = (distance, record)
    return [record for _, (_, record) in sorted(nearest.items())]


def _object_record(
    one: EvaluatedObject,
    collections: list[str],
    nearest_m: float,
    origin_m: float,
    rate_mps: float | None,
) -> contract.ObjectRecord:
    rms_height_m, correlation_length_m = roughness_of(one.evaluated)
    return contract.ObjectRecord(
        name=one.label,
        nearest_range_m=nearest_m,
        origin_range_m=origin_m,
        range_rate_mps=rate_mps,
        materials=[
            material.name
            for material in slot_materials(one.evaluated)
            if material is not None and material.name != ABSORBER_NAME
        ],
        collections=collections,
        rms_height_m=rms_height_m,
        correlation_length_m=correlation_length_m,
    )


def _origin_range(one: EvaluatedObject, receiver: Real) -> float:
    return float(np.linalg.norm(one.matrix[:3, 3] - receiver))


def _collections_of_objects() -> dict[str, list[str]]:
    """Return the names of the collections that hold each object, also indirectly, sorted.

    One pass over the file's collections: an object's own list of its users takes a walk each.
    """
    holding: dict[str, set[str]] = {}
    for collection in bpy.data.collections:
        for item in collection.all_objects:
            holding.setdefault(item.name_full, set()).add(collection.name)
    return {name: sorted(held) for name, held in holding.items()}


def _surface_distance(one: EvaluatedObject, point: Real) -> float | None:
    """Return the distance of a point from the surface, Blender units; None without faces."""
    with evaluated_mesh(one.evaluated) as mesh:
        if mesh is None:
            return None
        vertices, triangles = read_triangles(mesh)
    if not len(triangles):
        return None
    world = vertices.astype(np.float64) @ one.matrix[:3, :3].T + (one.matrix[:3, 3] - point)
    return nearest_distance(world, triangles)


# -- fingerprint -----------------------------------------------------------------------------------


def file_digest(just_opened: bool = False) -> str | None:
    """Return a hash of the saved .blend and its libraries; None if there are unsaved changes.

    `just_opened`: there are none. Blender up to 5.0, as a module, reports each file as changed.
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
    """Return a hash of all keyframes in the file."""
    digest = hashlib.sha256()
    for item in bpy.data.objects:
        for curve in animation_curves(item.animation_data):
            digest.update(f"{item.name}.{curve.data_path}[{curve.array_index}]".encode())
            for point in curve.keyframe_points:
                numbers = (*point.co, *point.handle_left, *point.handle_right)
                digest.update(f"{numbers}{point.interpolation}".encode())
    return "keys:" + digest.hexdigest()


def geometry_digest(depsgraph: Any, rig: Rig) -> str:
    """Return a hash of geometry, poses, materials and antennas at the depsgraph's time."""
    digest = hashlib.sha256()
    for item in (rig.camera, rig.emitter):
        evaluated = item.evaluated_get(depsgraph)
        digest.update(np.array(evaluated.matrix_world).tobytes())
    camera, light = rig.camera.data, rig.emitter.data
    digest.update(
        repr((camera.lens, camera.sensor_fit, camera.sensor_width, camera.sensor_height)).encode()
    )
    digest.update(repr((camera.shift_x, camera.shift_y, light.energy)).encode())
    hashed: dict[int, bytes] = {}
    for one in _rendered_surfaces(depsgraph):
        # Only the numbers of the instance: the label already has the instancer.
        digest.update(repr((one.label, one.key[1:])).encode() + one.matrix.tobytes())
        pointer = one.evaluated.data.as_pointer()
        if pointer not in hashed:
            hashed[pointer] = _mesh_digest(one.evaluated)
        digest.update(hashed[pointer])
        for material in slot_materials(one.evaluated):
            digest.update(_material_text(material).encode())
    return "scene:" + digest.hexdigest()


def _mesh_digest(evaluated: Any) -> bytes:
    with evaluated_mesh(evaluated) as mesh:
        if mesh is None:
            return b""
        vertices, triangles = read_triangles(mesh)
    return hashlib.sha256(vertices.astype(np.float64).tobytes() + triangles.tobytes()).digest()


def _material_text(material: Any) -> str:
    if material is None or material.node_tree is None:
        return repr(None if material is None else material.name)
    return "\n".join([material.name, *_tree_text(material.node_tree)])


def _tree_text(tree: Any) -> list[str]:
    """Return the values and links of a node tree, and of groups that radarsim did not make."""
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
