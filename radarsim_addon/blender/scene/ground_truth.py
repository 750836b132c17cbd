# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of a scene that need no render: extent and ground truth of objects.

`scene_extent` bounds the distances of what can echo by bounding boxes (`Boxes`). `object_records`
measures the exact distance of each object from the receiver: by boxes first, then, for the nearest
instance, by all triangles.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import bpy
import numpy as np

from ... import contract
from ...arrays import Indices, Real, distances
from ...findings import Finding, finding
from ...signal.scene import triangle_distances
from ..materials import SURFACE_TYPES, clutter_name, fluctuation_of, roughness_of
from ..nodes import is_radar_material
from ..nodes.shader_trees import displaces
from ..plan import Extent
from ..state import Snapshot, slot_materials
from .rig import Rig
from .visibility import ABSORBER_NAME, echoes, rendered_rows

#: What centres, radii and distances of boxes may be off by rounding, relative to coordinates.
_MARGIN = 1e-12


@dataclass(frozen=True)
class Boxes:
    """Bounding boxes of surfaces: rows of a snapshot."""

    snapshot: Snapshot
    rows: Indices

    @property
    def corners(self) -> Real:
        """Corners in world space, (n, 8, 3) [Blender units]."""
        return self.snapshot.corners_of(self.rows)

    def spheres(self, *places: Real) -> tuple[Real, Real]:
        """Return the centres (n, 3) and radii (n,) of spheres around the boxes [Blender units].

        The radii have a margin for the rounding of distances from the origin and from `places`.
        """
        spheres = self.snapshot.spheres[self.rows]
        largest = np.abs([spheres.max(initial=0.0), spheres.min(initial=0.0), *np.ravel(places)])
        return spheres[:, :3], spheres[:, 3] + _MARGIN * largest.max()

    def labels(self) -> tuple[list[str], Indices]:
        """Return the different labels of the surfaces, and the number of each surface's label,
        (n,).
        """
        layout = self.snapshot.layout
        pairs = layout.shape[self.rows] * (len(layout.instancers) + 1) + layout.instancer[self.rows]
        _, first, inverse = np.unique(pairs, return_index=True, return_inverse=True)
        names = [self.snapshot.label(row) for row in self.rows[first].tolist()]
        numbers = {name: number for number, name in enumerate(dict.fromkeys(names))}
        return list(numbers), np.array([numbers[name] for name in names], dtype=np.intp)[inverse]

    def pairs(self, later: Boxes) -> tuple[Indices, Indices]:
        """Return the rows of surfaces that occur in both, in this one and in `later`."""
        if self.snapshot.layout is later.snapshot.layout:
            if np.array_equal(self.rows, later.rows):
                return self.rows, self.rows
            both = np.intersect1d(self.rows, later.rows, assume_unique=True)
            return both, both
        there = {(later.snapshot.label(r), later.snapshot.layout.key(r)): r for r in later.rows}
        found = [
            (row, there[key])
            for row in self.rows
            if (key := (self.snapshot.label(row), self.snapshot.layout.key(row))) in there
        ]
        first, second = np.array(found, dtype=np.intp).reshape(-1, 2).T
        return first, second


def scene_extent(
    snapshot: Snapshot, rig: Rig, metres_per_unit: float, any_material: bool = False
) -> Extent:
    """Return the distances of the surfaces that can echo, or of all, at the moment of the snapshot.

    They follow from bounding boxes, so they are never too small. If nothing can echo, there is only
    the baseline.
    """
    boxes = echoing_boxes(snapshot, any_material)
    return extent_of_boxes(boxes, antenna_positions(snapshot, rig), metres_per_unit)


def echoing_boxes(snapshot: Snapshot, any_material: bool) -> Boxes:
    """Return the boxes of the surfaces that can echo, or of all, at the moment of the snapshot."""
    rows = rendered_rows(snapshot)
    if not any_material:
        is_radar = cache(is_radar_material)
        # The evaluated slots of a surface, which are known, hold what its own ones do.
        echoing = [
            (shape.own and any(map(is_radar, shape.materials))) or echoes(shape.original, is_radar)
            for shape in snapshot.shapes
        ]
        rows = rows[snapshot.of_shapes(echoing)[rows]]
    return Boxes(snapshot, rows)


def extent_of_boxes(boxes: Boxes, antennas: tuple[Real, Real], metres_per_unit: float) -> Extent:
    """Return `scene_extent` for boxes. `antennas` are the places of receiver and transmitter."""
    receiver, transmitter = antennas
    baseline_m = float(np.linalg.norm(receiver - transmitter)) * metres_per_unit
    if not boxes.rows.size:
        return Extent(baseline_m=baseline_m)
    centre, radius = boxes.spheres(receiver, transmitter)

    def corners(middle: Real) -> Real:
        """Return the corners, (m, 3), of all boxes that may reach the farthest.

        `middle` is the distance of their centres, measured in the same way.
        """
        far = middle + radius >= middle.max()
        return boxes.snapshot.corners_of(boxes.rows[far]).reshape(-1, 3)

    def farthest_m(origin: Real) -> float:
        away = np.linalg.norm(centre - origin, axis=1)
        return float(np.linalg.norm(corners(away) - origin, axis=1).max()) * metres_per_unit

    span = [
        corners(middle)[:, axis].max() - corners(-middle)[:, axis].min()
        for axis, middle in enumerate(centre.T)
    ]
    return Extent(
        from_emitter_m=farthest_m(transmitter),
        from_receiver_m=farthest_m(receiver),
        baseline_m=baseline_m,
        diameter_m=float(np.linalg.norm(span)) * metres_per_unit,
    )


def antenna_positions(snapshot: Snapshot, rig: Rig) -> tuple[Real, Real]:
    """Return the places of receiver and transmitter, (3,) each [Blender units]."""
    return _origin(rig.camera, snapshot), _origin(rig.emitter, snapshot)


def _axes_of(item: bpy.types.Object, snapshot: Snapshot) -> Real:
    """Return the directions of an object's own axes in the world as columns, (3, 3)."""
    axes = np.array(snapshot.evaluated(item).matrix_world, dtype=np.float64)[:3, :3]
    return np.asarray(axes / np.linalg.norm(axes, axis=0))


def _origin(item: bpy.types.Object, snapshot: Snapshot) -> Real:
    return np.array(snapshot.evaluated(item).matrix_world, dtype=np.float64)[:3, 3]


def rendered_surfaces(snapshot: Snapshot) -> Boxes:
    return echoing_boxes(snapshot, any_material=True)


def object_records(
    snapshot: Snapshot,
    rig: Rig,
    metres_per_unit: float,
    later: tuple[Boxes, Real] | None = None,
    interval_s: float = 0.0,
) -> list[contract.ObjectRecord]:
    """Return the ground truth of all rendered objects at the moment of the snapshot, sorted by
    name.

    All instances of one object by one instancer share one record, that of the nearest instance,
    with the name ``instancer/object``. For range rates, `later` has the surfaces and the place of
    the receiver `interval_s` later [s].
    """
    found, receiver = rendered_surfaces(snapshot), _origin(rig.camera, snapshot)
    snapshot = found.snapshot
    collections = _collections_of_objects()
    after: dict[int, int] = {}
    if later is not None:
        here, there = found.pairs(later[0])
        after = dict(zip(here.tolist(), there.tolist(), strict=True))
    nearest = _nearest_instances(found, receiver)
    rows = [row for row, _ in nearest]
    centres = _centres(snapshot, rows)
    ranges_m = (distances(centres, receiver) * metres_per_unit).tolist()
    motion: dict[int, dict[str, Any]] = {}
    if later is not None and interval_s > 0:
        known = [number for number, row in enumerate(rows) if row in after]
        then = _centres(later[0].snapshot, [after[rows[number]] for number in known])
        then_m = distances(then, later[1]) * metres_per_unit
        velocity_mps = (then - centres[known]) * metres_per_unit / interval_s
        for number, range_m, velocity in zip(known, then_m.tolist(), velocity_mps, strict=True):
            motion[rows[number]] = {
                "range_rate_mps": (range_m - ranges_m[number]) / interval_s,
                "velocity_mps": velocity.tolist(),
            }
    right, up, back = ((centres - receiver) @ _axes_of(rig.camera, snapshot)).T
    azimuth_deg = np.degrees(np.arctan2(right, -back)).tolist()
    elevation_deg = np.degrees(np.arctan2(up, np.hypot(right, back))).tolist()
    records = []
    said_by, of_whole = cache(_said_by_materials), cache(whole_of)
    for number, (row, distance) in enumerate(nearest):
        shape = snapshot.shapes[snapshot.layout.shape[row]]
        displaced = any(map(displaces, shape.materials))
        records.append(
            contract.ObjectRecord(
                name=snapshot.label(row),
                nearest_range_m=None if displaced else distance * metres_per_unit,
                centre_range_m=ranges_m[number],
                centre_m=(centres[number] * metres_per_unit).tolist(),
                azimuth_deg=azimuth_deg[number],
                elevation_deg=elevation_deg[number],
                part_of=of_whole(shape.original)
                if snapshot.label(row) == shape.original.name_full
                else "",
                **motion.get(row, {"range_rate_mps": None}),
                collections=collections.get(shape.original.name_full, []),
                **said_by(shape.materials),
            )
        )
    return sorted(records, key=lambda record: record.name)


def whole_of(item: bpy.types.Object) -> str:
    """Return the name of the farthest surface or armature that an object is parented to.

    Empty without any. Empties on the way join nothing, and clutter has no parts.
    """
    whole, parent = "", item.parent
    if clutter_name(slot_materials(item)) is not None:
        return whole
    while parent is not None:
        if parent.type in SURFACE_TYPES or parent.type == "ARMATURE":
            if clutter_name(slot_materials(parent)) is not None:
                break
            whole = parent.name_full
        parent = parent.parent
    return whole


def _nearest_instances(found: Boxes, receiver: Real) -> list[tuple[int, float]]:
    """Return the row and the distance of the nearest instance with faces, for each label."""
    snapshot = found.snapshot
    # No point of a box is nearer than this, so most instances need no exact distance.
    centre, radius = found.spheres(receiver)
    least = np.linalg.norm(centre - receiver, axis=1) - radius
    order = np.argsort(least, kind="stable")
    label = found.labels()[1][order]
    order = order[np.argsort(label, kind="stable")]
    groups = np.split(order, np.flatnonzero(np.diff(np.sort(label))) + 1) if order.size else []
    firsts = (int(found.rows[instances[0]]) for instances in groups)
    exact = nearest_distances(triangles_about(snapshot, firsts, receiver))
    nearest = []
    for instances, distance in zip(groups, exact.tolist(), strict=True):
        best = (distance, int(found.rows[instances[0]]))
        for index in instances[1:]:
            if least[index] > best[0]:
                break
            row = int(found.rows[index])
            (other,) = nearest_distances(triangles_about(snapshot, [row], receiver)).tolist()
            best = min(best, (other, row))
        if math.isfinite(best[0]):
            nearest.append((best[1], best[0]))
    return nearest


def _centres(snapshot: Snapshot, rows: Sequence[int]) -> Real:
    """Return the centres of boxes in the world, (n, 3) [Blender units]."""
    corners = snapshot.corners_of(np.array(rows, dtype=np.intp)).reshape(-1, 8, 3)
    return np.asarray(corners.mean(axis=1))


def _said_by_materials(materials: tuple[Any, ...]) -> dict[str, Any]:
    """Return the fields of an object's record that follow from its materials."""
    held = [one.name for one in materials if one is not None and one.name != ABSORBER_NAME]
    rms_height_m, correlation_length_m = roughness_of(materials)
    return {
        "materials": held,
        "rms_height_m": rms_height_m,
        "correlation_length_m": correlation_length_m,
        "fluctuation": fluctuation_of(materials),
        "clutter": clutter_name(materials),
    }


def _collections_of_objects() -> dict[str, list[str]]:
    """Return the names of the collections that hold each object, also indirectly, sorted.

    This takes one pass over the collections of the file. To ask each object for its collections
    would take one pass each.
    """
    holding: dict[str, set[str]] = {}
    for collection in bpy.data.collections:
        for item in collection.all_objects:
            holding.setdefault(item.name_full, set()).add(collection.name)
    return {name: sorted(held) for name, held in holding.items()}


def displaced_surfaces(snapshot: Snapshot) -> list[Finding]:
    """Return a finding on rendered objects that Cycles displaces, because their meshes do not show
    it.
    """
    found = rendered_surfaces(snapshot)
    shapes = found.snapshot.shapes
    displaced = found.snapshot.of_shapes([any(map(displaces, one.materials)) for one in shapes])
    names = {found.snapshot.label(row) for row in found.rows[displaced[found.rows]].tolist()}
    return [finding("displaced-by-shader", *sorted(names))] if names else []


#: Triangles that are placed at once, about.
_TOGETHER = 1 << 16


def triangles_about(snapshot: Snapshot, rows: Iterable[int], point: Real) -> Iterator[Real]:
    """Yield corners of the triangles of each surface relative to a point, (m, 3, 3)."""
    waiting: list[tuple[int, Any, Any]] = []
    size = 0
    for row in rows:
        mesh = snapshot.mesh(snapshot.shapes[snapshot.layout.shape[row]])
        none = np.empty((0, 3))
        found = (none, none.astype(int)) if mesh is None else (mesh.vertices, mesh.triangles)
        waiting.append((row, *found))
        size += len(found[1])
        if size > _TOGETHER:
            yield from _corners_about(snapshot, waiting, point)
            waiting, size = [], 0
    yield from _corners_about(snapshot, waiting, point)


def _corners_about(
    snapshot: Snapshot, surfaces: list[tuple[int, Any, Any]], point: Real
) -> list[Real]:
    """Return `triangles_about` for rows with their vertices and triangles. Meshes of equal size
    take one pass.
    """
    alike: defaultdict[tuple[int, int], list[int]] = defaultdict(list)
    for number, (_, vertices, triangles) in enumerate(surfaces):
        alike[len(vertices), len(triangles)].append(number)
    found: list[Real] = [np.empty((0, 3, 3))] * len(surfaces)
    for (points, faces), numbers in alike.items():
        rows, vertices, triangles = zip(*(surfaces[number] for number in numbers), strict=True)
        matrices = snapshot.matrices_of(np.array(rows, dtype=np.intp))
        own = np.concatenate(vertices, dtype=np.float64).reshape(len(numbers), points, 3)
        world = own @ matrices[:, :3, :3].transpose(0, 2, 1)
        world += (matrices[:, :3, 3] - point)[:, None]
        of_each = np.concatenate(triangles).reshape(len(numbers), faces, 3)
        corners = world[np.arange(len(numbers))[:, None, None], of_each]
        for number, one in zip(numbers, corners, strict=True):
            found[number] = one
    return found


#: Number of triangles per block, to limit memory.
_BLOCK = 1 << 17


def nearest_distances(surfaces: Iterable[Real]) -> Real:
    """Return the distance of the origin from each of n surfaces, (n,); infinite without triangles.

    A surface is the corners of its triangles, (m, 3, 3).
    """
    found: list[float] = []
    waiting: list[Real] = []
    owners: list[int] = []
    size = 0

    def measure() -> None:
        corners = np.concatenate(waiting)
        starts = np.cumsum([0, *(len(part) for part in waiting)])[:-1]
        least = np.minimum.reduceat(triangle_distances(*corners.transpose(1, 0, 2)), starts)
        for owner, distance in zip(owners, least.tolist(), strict=True):
            found[owner] = min(found[owner], distance)
        waiting.clear()
        owners.clear()

    for owner, corners in enumerate(surfaces):
        found.append(np.inf)
        for start in range(0, len(corners), _BLOCK):
            part = corners[start : start + _BLOCK]
            if size + len(part) > _BLOCK and waiting:
                measure()
                size = 0
            waiting.append(part)
            owners.append(owner)
            size += len(part)
    if waiting:
        measure()
    return np.array(found)
