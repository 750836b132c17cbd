# SPDX-License-Identifier: GPL-3.0-or-later
"""Find meshes for which Cycles would lose track of the objects that contain a ray.

Cycles keeps a stack of the volumes that a ray has entered. It is wrong, without a message, for an
object with an interior that is open or has flipped faces, for faces of two objects that coincide
exactly (touching cubes, a box on a plane), and for more than 31 nested objects.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...array_types import Indices, Real
from ...findings import Finding, finding
from ...vectors import crosses
from ..materials import convex_objects
from ..nodes.materials import has_interior
from ..state import read_numbers, take_snapshot

#: Maximum number of volumes that Cycles tracks along a ray.
_MOST_NESTED = 31
#: Faces with a smaller distance, relative to the scene's size, coincide. A gap of ten times this
#: distance is sufficient.
_COINCIDENT = 2e-7
#: Maximum number of faces of one object in one plane that are compared with another object.
_MOST_FACES = 4000
#: Time in which Cycles tests an object against one with an interior, and when to say so [s].
_TEST_S, _LONG_S = 2e-9, 2.0
#: Maximum number of objects with an interior for the check of nesting.
_MOST_BOXES = 4000
#: Pairs of boxes that are compared at once, about.
_MOST_PAIRS = 1 << 20


@dataclass(frozen=True)
class Faces:
    """Faces of one object or instance in world space.

    `entered`: it has an interior. Planes normal.x = offset, shapes (n, 3) and (n,). Lowest and
    highest corner of each face, (n, 3). `defect` as `_mesh_defect` returns it, or "inside out".
    """

    name: str
    entered: bool
    normal: Real
    offset: Real
    low: Real
    high: Real
    defect: str = ""


def check_meshes(depsgraph: Any) -> list[Finding]:
    """Find meshes of a scene that Cycles cannot trace as objects with an interior.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.

    Returns
    -------
    list of Finding
        Empty if no object has an interior.
    """
    snapshot = take_snapshot(depsgraph)
    layout, shapes = snapshot.layout, snapshot.shapes
    has = cache(has_interior)
    meshes = [shape.kind == "MESH" and not shape.original.hide_render for shape in shapes]
    rows = np.flatnonzero(snapshot.of_shapes(meshes))
    entered = snapshot.of_shapes([any(map(has, shape.materials)) for shape in shapes])[rows]
    if not entered.any():
        return []
    solid = [shape.kind == "MESH" and snapshot.face_count(shape) > 0 for shape in shapes]
    count = int(snapshot.of_shapes(solid)[rows].sum())
    near = _near_an_interior(snapshot.corners_of(rows), entered)
    rows, entered = rows[near], entered[near]
    corners = snapshot.corners_of(rows)
    reach = float(np.abs(corners).max())
    pairs = _overlapping(corners.min(axis=1), corners.max(axis=1), _COINCIDENT * reach)
    alone = np.ones(len(rows), dtype=bool)
    alone[pairs[entered[pairs].any(axis=1)]] = False
    # What is convex and touches nothing is known to be sound.
    convex = convex_objects(depsgraph)
    sound = snapshot.of_shapes([shape.own and shape.original in convex for shape in shapes])[rows]
    read: dict[int, _Shape | None] = {}
    found, names = [], []
    for row, inside, known in zip(
        rows.tolist(), entered.tolist(), (alone & sound).tolist(), strict=True
    ):
        number = int(layout.shape[row])
        name = shapes[number].original.name_full + (
            " (instance)" if layout.instancer[row] >= 0 else ""
        )
        if not known:
            if number not in read:
                with snapshot.mesh(shapes[number]) as mesh:
                    read[number] = None if mesh is None else _shape(mesh, inside)
            shape = read[number]
            faces = None if shape is None else _faces(shape, snapshot.matrix(row), name, inside)
            if faces is None:
                continue
            found.append(faces)
        if inside:
            names.append(name)
    slow = _slow_for_cycles(names, count)
    if not found:
        return slow
    return [*_defects(found), *_coincident_faces(found, reach), *_nested_too_deep(found), *slow]


def _near_an_interior(corners: Real, entered: NDArray[np.bool_]) -> Indices:
    """Return the indices of boxes (n, 8, 3) that touch that of an object with an interior."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    margin = _COINCIDENT * float(np.abs(corners).max())
    near = entered.copy()
    others = np.flatnonzero(~entered)
    if not others.size:
        return np.arange(len(corners))
    axis = int(np.ptp(low[others], axis=0).argmax())
    others = others[np.argsort(low[others, axis], kind="stable")]
    widest = float((high - low)[others, axis].max(initial=0.0))
    for index in np.flatnonzero(entered).tolist():
        bounds = low[index, axis] - widest - margin, high[index, axis] + margin
        some = others[slice(*np.searchsorted(low[others, axis], bounds))]
        meets = np.all(low[some] <= high[index] + margin, axis=1)
        near[some[meets & np.all(high[some] >= low[index] - margin, axis=1)]] = True
    return np.flatnonzero(near)


class _Shape(NamedTuple):
    """A mesh in its own axes: vertices of all corners, first corner and normal of each face."""

    at_corner: Real
    start: Indices
    normal: Real
    defect: str


def _shape(mesh: Any, entered: bool) -> _Shape | None:
    """Return a mesh as numbers; its defect is looked for where waves enter. None without faces."""
    corners = len(mesh.loops)
    if not len(mesh.polygons):
        return None
    points = read_numbers(mesh.vertices, "co", 3).astype(np.float64)
    start = read_numbers(mesh.polygons, "loop_start", dtype=np.int32).ravel()
    corner = read_numbers(mesh.loops, "vertex_index", dtype=np.int32).ravel()
    normal = read_numbers(mesh.polygons, "normal", 3).astype(np.float64)
    at_corner = points[corner]
    defect = ""
    if entered:
        following = corner.copy()
        following[:-1] = corner[1:]
        following[np.append(start[1:], corners) - 1] = corner[start]
        flat = float((np.abs(normal @ normal[0]) < 1 - 1e-6).sum()) == 0
        defect = _mesh_defect(corner, following, flat)
        if not defect and not flat:
            defect = _inside_out(at_corner, start)
    return _Shape(at_corner, start, normal, defect)


def _faces(shape: _Shape, matrix: Real, name: str, entered: bool) -> Faces | None:
    """Return the faces of an object or instance in world space; None where it is flattened."""
    linear = matrix[:3, :3]
    if np.linalg.det(linear) == 0:
        return None
    at_corner = shape.at_corner @ linear.T + matrix[:3, 3]
    normal = shape.normal @ np.linalg.inv(linear)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    low = np.minimum.reduceat(at_corner, shape.start, axis=0)
    high = np.maximum.reduceat(at_corner, shape.start, axis=0)
    offset = np.einsum("ij,ij->i", normal, at_corner[shape.start])
    return Faces(name, entered, normal, offset, low, high, shape.defect)


def _mesh_defect(corner: NDArray[np.int32], following: NDArray[np.int32], flat: bool) -> str:
    """Return why a mesh does not enclose a volume: "open", "flipped" or "" if it does.

    Edges run from `corner` to `following` in the direction of each face. A mesh in one plane,
    `flat`, bounds a half-space and need not be closed.
    """
    size = int(max(corner.max(), following.max())) + 1
    directed = corner.astype(np.int64) * size + following
    opposite = following.astype(np.int64) * size + corner
    directed.sort()
    opposite.sort()
    if np.any(directed[1:] == directed[:-1]):
        return "flipped"
    if flat:
        return ""
    # A closed and consistent mesh has each edge once in each direction.
    return "" if np.array_equal(directed, opposite) else "open"


def _inside_out(at_corner: Real, start: Indices) -> str:
    """Return "inside out" if the normals of a closed mesh point inwards: its volume is negative."""
    centre = at_corner.mean(axis=0)
    end = np.append(start[1:], len(at_corner))
    volume = 0.0
    # A fan of triangles around the first corner of each face; faces of equal size together.
    for sides in np.unique(end - start):
        first = start[end - start == sides]
        origin = at_corner[first] - centre
        for step in range(1, int(sides) - 1):
            second, third = at_corner[first + step] - centre, at_corner[first + step + 1] - centre
            volume += float(np.einsum("ij,ij->", origin, crosses(second, third)))
    return "inside out" if volume < 0 else ""


def _slow_for_cycles(entered: list[str], total: int) -> list[Finding]:
    """Find whether Cycles, which tests each object against each interior, takes long to begin."""
    seconds = len(entered) * total * _TEST_S
    if seconds < _LONG_S:
        return []
    numbers = {"count": len(entered), "total": total, "seconds": seconds}
    return [finding("many-interiors", *dict.fromkeys(entered), **numbers)]


def _defects(found: list[Faces]) -> list[Finding]:
    names = {
        defect: [item.name for item in found if item.defect == defect]
        for defect in ("open", "flipped", "inside out")
    }
    findings = []
    if names["open"]:
        findings.append(finding("mesh-open", *names["open"]))
    if names["flipped"]:
        findings.append(finding("mesh-flipped", *names["flipped"]))
    if names["inside out"]:
        findings.append(finding("mesh-inside-out", *names["inside out"]))
    return findings


def _coincident_faces(found: list[Faces], reach: float) -> list[Finding]:
    """Find pairs of objects, one with an interior, that have a part of a plane in common.

    `reach`: the largest coordinate of the scene.
    """
    tolerance = _COINCIDENT * max(reach, 1e-30)
    normal = np.concatenate([item.normal for item in found])
    offset = np.concatenate([item.offset for item in found])
    owner = np.repeat(np.arange(len(found)), [len(item.offset) for item in found])
    sign = np.where(normal[np.arange(len(normal)), np.abs(normal).argmax(axis=1)] < 0, -1.0, 1.0)
    normal, offset = normal * sign[:, None], offset * sign
    entered = np.array([item.entered for item in found])
    boxes = np.concatenate([np.stack([item.low, item.high], axis=1) for item in found])
    pairs: set[tuple[int, int]] = set()
    # Two grids, offset by half a step: values near an edge of one are inside a step of the other.
    for shift in (0.0, 0.5):
        key = np.column_stack(
            [np.round(normal * 1e4), np.floor(offset / (20 * tolerance) + shift)]
        ).astype(np.int64)
        order = np.lexsort(key.T)
        edges = np.flatnonzero(np.any(np.diff(key[order], axis=0) != 0, axis=1)) + 1
        begin, end = np.append(0, edges), np.append(edges, len(order))
        owners = owner[order]
        # Only planes with two owners can coincide.
        least = np.minimum.reduceat(owners, begin)
        most = np.maximum.reduceat(owners, begin)
        for group in np.flatnonzero(least != most):
            members = order[begin[group] : end[group]]
            _pairs_in_plane(members, owner, offset, boxes, entered, tolerance, pairs)
    named = sorted(" and ".join(sorted((found[a].name, found[b].name))) for a, b in pairs if a != b)
    return [finding("coincident-faces", *named, least_gap=50 * tolerance)] if named else []


def _pairs_in_plane(
    members: Indices,
    owner: Indices,
    offset: Real,
    boxes: Real,
    entered: NDArray[np.bool_],
    tolerance: float,
    pairs: set[tuple[int, int]],
) -> None:
    """Add pairs of owners whose faces in one plane overlap; boxes of faces are (n, 2, 3)."""
    members = members[np.argsort(owner[members], kind="stable")]
    owners, start = np.unique(owner[members], return_index=True)
    low = np.minimum.reduceat(boxes[members, 0], start)
    high = np.maximum.reduceat(boxes[members, 1], start)
    faces = np.split(members, start[1:])
    for i, j in _overlapping(low, high, tolerance).tolist():
        a, b = sorted((int(owners[i]), int(owners[j])))
        if not (entered[a] or entered[b]) or (a, b) in pairs:
            continue
        mine, others = faces[i][:_MOST_FACES], faces[j][:_MOST_FACES]
        if len(mine) * len(others) > _MOST_FACES * 100:
            others = others[:: len(mine) * len(others) // (_MOST_FACES * 100) + 1]
        shared = np.minimum(boxes[mine, 1][:, None], boxes[others, 1][None])
        shared -= np.maximum(boxes[mine, 0][:, None], boxes[others, 0][None])
        # Overlap along at least two directions: faces that touch at an edge do not coincide.
        wide = (shared > 100 * tolerance).sum(axis=-1) >= 2
        apart = np.any(shared < -tolerance, axis=-1)
        near = np.abs(offset[mine][:, None] - offset[others][None]) <= tolerance
        if np.any(wide & ~apart & near):
            pairs.add((a, b))


def _overlapping(low: Real, high: Real, tolerance: float) -> Indices:
    """Return the pairs of boxes (n, 3) that overlap, (k, 2): a sweep along the longest axis."""
    axis = int(np.ptp(low, axis=0).argmax())
    order = np.argsort(low[:, axis])
    low, high = low[order], high[order]
    place = np.arange(len(order))
    end = np.searchsorted(low[:, axis], high[:, axis] + tolerance, side="right")
    ahead = np.maximum(end - place - 1, 0)
    before = np.cumsum(ahead)
    found = [np.empty((0, 2), dtype=np.intp)]
    parts = np.searchsorted(before, np.arange(0, int(before[-1:].sum()), _MOST_PAIRS))
    for start, stop in itertools.pairwise([*parts.tolist(), len(order)]):
        counts = ahead[start:stop]
        first = np.repeat(place[start:stop], counts)
        second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(counts) - counts, counts)
        meets = np.all(low[second] <= high[first] + tolerance, axis=1)
        meets &= np.all(high[second] >= low[first] - tolerance, axis=1)
        found.append(order[np.stack([first[meets], second[meets]], axis=1)])
    return np.concatenate(found)


def _nested_too_deep(found: list[Faces]) -> list[Finding]:
    """Find where the boxes of more than 31 objects with an interior share a point."""
    boxes = [item for item in found if item.entered]
    if not _MOST_NESTED < len(boxes) <= _MOST_BOXES:
        return []
    low = np.array([item.low.min(axis=0) for item in boxes])
    high = np.array([item.high.max(axis=0) for item in boxes])
    # A deepest common point is at a corner of lower sides; centres find all kinds of nesting.
    for points in (low, (low + high) / 2):
        inside = [int(np.all((low <= p) & (p <= high), axis=1).sum()) for p in points]
        if max(inside) > _MOST_NESTED:
            name = boxes[int(np.argmax(inside))].name
            return [
                finding("interiors-nested-too-deep", name, count=max(inside), limit=_MOST_NESTED)
            ]
    return []
