# SPDX-License-Identifier: GPL-3.0-or-later
"""Find meshes that Cycles would trace wrongly: interiors that do not close, and bent normals.

Cycles keeps a stack of the volumes that a ray has entered. It is wrong, without a message, for an
object with an interior that is open or has flipped faces, for faces of two objects that coincide
exactly (touching cubes, a box on a plane), and for more than 31 nested objects. `check_meshes`
finds these among the objects whose boxes touch one with an interior.

Meshes that are shaded smooth across sharp edges, as imported buildings often are, have normals that
are bent over whole faces, and reflection, Fresnel's equations and walls follow normals. Walls get
sharp edges during a run (`sharpen_walls`); others are named (`check_normals`).
"""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import Indices, Int32, Mask, Real, crosses, dots
from ...findings import Finding, finding
from ...signal.scene import Mesh
from ..materials import assigned_materials, convex_objects, sharpen_edges, surfaces_of
from ..nodes import attributes
from ..state import SettingsRestorer, Snapshot
from .ground_truth import triangles_about
from .visibility import rendered_rows

#: Maximum number of volumes that Cycles tracks along a ray.
_MOST_NESTED = 31
#: Faces with a smaller distance, relative to their largest coordinate, coincide: Cycles computes in
#: float32. They must overlap by ten times this distance. The finding recommends 50 times.
_COINCIDENT, _LEAST_OVERLAP, _GAP = 2e-7, 10.0, 50.0
#: Largest angle between the planes of faces that coincide [rad].
_PARALLEL_RAD = 1e-3
#: Time in which Cycles tests an object against one with an interior, and when to say so [s].
_TEST_S, _LONG_S = 2e-9, 2.0
#: Maximum number of objects with an interior for the check of nesting.
_MOST_BOXES = 4000
#: Pairs of boxes that are compared at once, about.
_MOST_PAIRS = 1 << 18
#: Angle between a normal and its face from which on it counts: spheres of 12 segments stay below.
_OFF_DEG = 25.0
#: Fraction of the surface with such normals above which an object is named.
_LEAST_FRACTION = 0.05
#: Angle between the faces at an edge above which walls are no curved surface: cylinders of 10
#: segments stay below, oriels are above.
_EDGE_DEG = 40.0


@dataclass(frozen=True)
class _Item:
    """One object or instance in world space [Blender units]."""

    name: str
    #: It has an interior.
    entered: bool
    #: Lowest and highest corner of its box, (3,).
    low: Real
    high: Real
    #: Those that may coincide with another object, (n, 3, 3).
    triangles: Real
    #: As `_mesh_defect` returns it.
    defect: str = ""


def check_meshes(snapshot: Snapshot) -> list[Finding]:
    """Return findings on meshes that Cycles cannot trace as objects with an interior."""
    layout, shapes = snapshot.layout, snapshot.shapes
    surfaces = surfaces_of(snapshot)
    rows = rendered_rows(snapshot)
    rows = rows[snapshot.of_shapes([shape.kind == "MESH" for shape in shapes])[rows]]
    of_shapes = [any(s.has_interior for s in surfaces.of(shape.materials)) for shape in shapes]
    entered = snapshot.of_shapes(of_shapes)[rows]
    if not entered.any():
        return []
    solid = [shape.kind == "MESH" and snapshot.face_count(shape) > 0 for shape in shapes]
    count = int(snapshot.of_shapes(solid)[rows].sum())
    near = _near_an_interior(snapshot.corners_of(rows), entered)
    rows, entered = rows[near], entered[near]
    corners = snapshot.corners_of(rows)
    low, high = corners.min(axis=1), corners.max(axis=1)
    margin = _COINCIDENT * float(np.abs(corners).max())
    pairs = np.concatenate([*_overlapping(low - margin, high + margin)])
    pairs = pairs[entered[pairs].any(axis=1)]
    alone = np.ones(len(rows), dtype=bool)
    alone[pairs] = False
    # What is convex and touches nothing is known to be sound.
    convex = convex_objects(snapshot)
    sound = snapshot.of_shapes([shape.own and shape.original in convex for shape in shapes])[rows]
    shared_low, shared_high = _shared_boxes(low - margin, high + margin, pairs)
    defects: dict[int, str] = {}
    found, names = [], []
    for index in range(len(rows)):
        row, inside = int(rows[index]), bool(entered[index])
        number = int(layout.shape[row])
        name = shapes[number].original.name_full + (
            " (instance)" if layout.instancer[row] >= 0 else ""
        )
        if inside:
            names.append(name)
        if (alone[index] and sound[index]) or not snapshot.face_count(shapes[number]):
            continue
        if np.linalg.det(snapshot.matrix(row)[:3, :3]) == 0:  # flattened
            continue
        if inside and number not in defects:
            mesh = snapshot.mesh(shapes[number])
            defects[number] = "" if mesh is None else _mesh_defect(mesh)
        triangles = np.empty((0, 3, 3))
        if not alone[index]:
            (triangles,) = triangles_about(snapshot, [row], np.zeros(3))
            inner, outer = triangles.min(axis=1), triangles.max(axis=1)
            meets = (inner <= shared_high[index]) & (outer >= shared_low[index])
            triangles = triangles[meets.all(axis=1)]
        defect = defects[number] if inside else ""
        found.append(_Item(name, inside, low[index], high[index], triangles, defect))
    slow = _slow_for_cycles(names, count)
    return [*_defects(found), *_coincident_faces(found), *_nested_too_deep(found), *slow]


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


def _overlapping(low: Real, high: Real) -> Iterator[Indices]:
    """Yield the pairs of boxes (n, 3) that overlap, (k, 2), found by a sweep along the longest
    axis.

    The sweep runs in strips along the second axis. A box is in all strips that it touches. A pair
    counts in the first strip that contains both.
    """
    yield np.empty((0, 2), dtype=np.intp)
    if len(low) < 2:
        return
    side, axis = np.ptp(low, axis=0).argsort(kind="stable")[-2:]
    lowest, highest = low.min(axis=0), high.max(axis=0)
    width = 2 * float((high - low)[:, side].mean())
    width = max(width, float(highest[side] - lowest[side]) / len(low), np.finfo(np.float64).tiny)
    first = ((low[:, side] - lowest[side]) / width).astype(np.intp)
    counts = ((high[:, side] - lowest[side]) / width).astype(np.intp) - first + 1
    box = np.repeat(np.arange(len(low)), counts)
    strip = first[box] + np.arange(len(box)) - np.repeat(np.cumsum(counts) - counts, counts)
    length = 2 * float(highest[axis] - lowest[axis]) or 1.0
    begin = strip * length + (low[box, axis] - lowest[axis])
    order = begin.argsort(kind="stable")
    box, strip, begin = box[order], strip[order], begin[order]
    end = strip * length + (high[box, axis] - lowest[axis])
    place = np.arange(len(box))
    ahead = np.maximum(np.searchsorted(begin, end, side="right") - place - 1, 0)
    before = np.cumsum(ahead)
    parts = np.searchsorted(before, np.arange(0, int(before[-1]), _MOST_PAIRS))
    for start, stop in itertools.pairwise([*parts.tolist(), len(box)]):
        own = ahead[start:stop]
        one = np.repeat(place[start:stop], own)
        other = one + 1 + np.arange(len(one)) - np.repeat(np.cumsum(own) - own, own)
        pair = np.stack([box[one], box[other]], axis=1)
        meets = strip[one] == first[pair].max(axis=1)
        meets &= np.all(low[pair[:, 1]] <= high[pair[:, 0]], axis=1)
        meets &= np.all(high[pair[:, 1]] >= low[pair[:, 0]], axis=1)
        yield pair[meets]


def _shared_boxes(low: Real, high: Real, pairs: Indices) -> tuple[Real, Real]:
    """Return, for each box (n, 3), the box around its overlaps with all of its partners."""
    first, second = np.concatenate([pairs, pairs[:, ::-1]]).T
    lowest, highest = np.full(low.shape, np.inf), np.full(low.shape, -np.inf)
    np.minimum.at(lowest, first, np.maximum(low[first], low[second]))
    np.maximum.at(highest, first, np.minimum(high[first], high[second]))
    return lowest, highest


def _mesh_defect(mesh: Mesh) -> str:
    """Return why a mesh does not enclose a volume: "open", "flipped" or "inside out"; "" if it
    does.
    """
    start, corner, normal = mesh.first_corners, mesh.corner_vertices, mesh.normals
    following = corner.copy()
    following[:-1] = corner[1:]
    following[np.append(start[1:], len(corner)) - 1] = corner[start]
    flat = float((np.abs(normal @ normal[0]) < 1 - 1e-6).sum()) == 0
    defect = _edge_defect(corner, following, flat)
    return defect if defect or flat else _inside_out(mesh.vertices[corner], start)


def _edge_defect(corner: Int32, following: Int32, flat: bool) -> str:
    """Return "open" or "flipped" if the edges of a mesh do not enclose a volume, else "".

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


def _inside_out(at_corner: Real, start: Int32) -> str:
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
    """Warn if Cycles, which tests each object against each interior, takes long to begin."""
    seconds = len(entered) * total * _TEST_S
    if seconds < _LONG_S:
        return []
    numbers = {"count": len(entered), "total": total, "seconds": seconds}
    return [finding("many-interiors", *dict.fromkeys(entered), **numbers)]


def _defects(found: list[_Item]) -> list[Finding]:
    names: defaultdict[str, list[str]] = defaultdict(list)
    for item in found:
        names[item.defect].append(item.name)
    findings = []
    if "open" in names:
        findings.append(finding("mesh-open", *names["open"]))
    if "flipped" in names:
        findings.append(finding("mesh-flipped", *names["flipped"]))
    if "inside out" in names:
        findings.append(finding("mesh-inside-out", *names["inside out"]))
    return findings


def _coincident_faces(found: list[_Item]) -> list[Finding]:
    """Find pairs of objects, one with an interior, whose faces overlap in one plane."""
    some = [item for item in found if len(item.triangles)]
    if not some:
        return []
    triangles = np.concatenate([item.triangles for item in some])
    owner = np.repeat(np.arange(len(some)), [len(item.triangles) for item in some])
    entered = np.array([item.entered for item in some])
    tolerance = _COINCIDENT * np.abs(triangles).max(axis=(1, 2))
    margin = tolerance[:, None]
    known: set[int] = set()
    low, high = triangles.min(axis=1) - margin, triangles.max(axis=1) + margin
    for both in _overlapping(low, high):
        owners = np.sort(owner[both], axis=1)
        code = owners[:, 0] * len(some) + owners[:, 1]
        new = (owners[:, 0] != owners[:, 1]) & entered[owners].any(axis=1)
        new &= ~np.isin(code, list(known))
        both = both[new]
        here = _coincide(triangles[both], tolerance[both].max(axis=1))
        known.update(code[new][here].tolist())
    if not known:
        return []
    pairs = [tuple(some[n] for n in divmod(one, len(some))) for one in known]
    named = sorted(" and ".join(sorted(item.name for item in pair)) for pair in pairs)
    reach = max(float(np.abs([item.low, item.high]).max()) for pair in pairs for item in pair)
    return [finding("coincident-faces", *named, least_gap=_GAP * _COINCIDENT * reach)]


def _coincide(pairs: Real, tolerance: Real) -> Mask:
    """Return which pairs of triangles (n, 2, 3, 3) lie in one plane and overlap with an area."""
    edges = np.roll(pairs, -1, axis=2) - pairs
    normals = np.cross(edges[:, :, 0], edges[:, :, 1])
    areas = np.linalg.norm(normals, axis=-1)
    normals /= np.maximum(areas, np.finfo(np.float64).tiny)[..., None]
    # The plane of the larger triangle is the better known one.
    number, larger = np.arange(len(pairs)), areas.argmax(axis=1)
    normal, place = normals[number, larger], pairs[number, larger, 0]
    heights = np.einsum("nci,ni->nc", pairs[number, 1 - larger] - place[:, None], normal)
    tilt = np.linalg.norm(np.cross(normals[:, 0], normals[:, 1]), axis=-1)
    found = (np.abs(heights).max(axis=1) <= tolerance) & (tilt <= _PARALLEL_RAD)
    found &= areas.all(axis=1)
    some = np.flatnonzero(found)
    # Two triangles overlap if their projections on the normals of all six edges do.
    across = np.cross(edges[some], normals[some, :, None]).reshape(-1, 6, 3)
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    along = np.einsum("nkci,nai->nkac", pairs[some], across)
    low, high = along.min(axis=-1), along.max(axis=-1)
    shared = np.minimum(high[:, 0], high[:, 1]) - np.maximum(low[:, 0], low[:, 1])
    found[some] = shared.min(axis=1) > _LEAST_OVERLAP * tolerance[some]
    return np.asarray(found)


def _nested_too_deep(found: list[_Item]) -> list[Finding]:
    """Find where the boxes of more than 31 objects with an interior share a point."""
    boxes = [item for item in found if item.entered]
    if not _MOST_NESTED < len(boxes) <= _MOST_BOXES:
        return []
    low, high = (np.array([getattr(item, end) for item in boxes]) for end in ("low", "high"))
    # A deepest common point is at a corner of lower sides; centres find all kinds of nesting.
    for points in (low, (low + high) / 2):
        inside = [int(np.all((low <= p) & (p <= high), axis=1).sum()) for p in points]
        if max(inside) > _MOST_NESTED:
            name = boxes[int(np.argmax(inside))].name
            return [
                finding("interiors-nested-too-deep", name, count=max(inside), limit=_MOST_NESTED)
            ]
    return []


def sharpen_walls(recorder: SettingsRestorer, snapshot: Snapshot) -> None:
    """End the smooth normals of walls at their edges, until restored.

    The walls must be set for the run.
    """
    known = attributes.OBJECT_LAYER_NORMAL, attributes.OBJECT_SHELL_THICKNESS
    assigned, surfaces = assigned_materials(snapshot), surfaces_of(snapshot)
    walls = [
        one.item
        for one in assigned
        if any(name in one.item and np.any(one.item[name]) for name in known)
        and any(surface.is_entered for surface in surfaces.of(one.materials))
    ]
    of_walls = set(walls)
    others = {one.item.data for one in assigned if one.item not in of_walls}
    for item in walls:
        if item.library is not None and item.data in others:  # whose normals stay
            continue
        if _bent(snapshot.mesh_of(item)) > 0:
            sharpen_edges(recorder, item, _EDGE_DEG)


def check_normals(snapshot: Snapshot) -> list[Finding]:
    """Find the rendered meshes whose normals are far from those of their faces."""
    found: dict[str, float] = {}
    for shape in snapshot.shapes:
        if shape.kind != "MESH" or shape.original.hide_render:
            continue
        fraction = _bent(snapshot.mesh(shape))
        if fraction > _LEAST_FRACTION:
            found[shape.original.name_full] = fraction
    if not found:
        return []
    fraction = max(found.values())
    return [finding("smooth-across-edges", *found, fraction=fraction, angle_deg=_OFF_DEG)]


def _bent(mesh: Mesh | None) -> float:
    """Return the fraction of a mesh's surface with normals that are far from its faces'."""
    if mesh is None or mesh.corner_normals is None:
        return 0.0
    across = np.repeat(mesh.normals, mesh.sides, axis=0)
    area = np.repeat(mesh.areas / mesh.sides, mesh.sides)
    cosine = dots(mesh.corner_normals, across)
    off = (cosine < math.cos(math.radians(_OFF_DEG))) & (area > 0)
    return float(area[off].sum() / max(area.sum(), 1e-300))
