# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies (objects or instances) on which the scatterers of paths lie.

While a frame is measured, all rendered bodies have numbers. Their order is the same in each
measurement of the same scene, so that tiles of an interrupted run remain valid.

Cycles identifies the object of the first surface only. For later surfaces, and for instances, only
the position is known. Bounding boxes identify the body; where they overlap, distances from the
surfaces do.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mathutils.bvhtree import BVHTree

from ...array_types import Indices, Real
from ...signal.paths import PathRows
from ...vectors import are_finite
from ..scene import InstancePose, Poses, distance_from_box
from ..state import Key

#: Largest distance of a scatterer from its surface, relative to the path length. Positions from the
#: transmitter's colours are known to 1e-6 of the scene's size.
_ON_SURFACE_WITHIN = 2e-5


@dataclass(frozen=True)
class Part:
    """One object or instance: number and name of the object, key and pose of the instance."""

    number: int
    name: str
    key: Key
    instance: InstancePose


class Bodies:
    """Surfaces of a scene at one moment.

    Parameters
    ----------
    names
        Objects in the order of their numbers, from 1.
    poses
        Poses of the objects.
    depsgraph : bpy.types.Depsgraph
        At that moment; it must not change while rows are labelled.
    metres_per_unit
        Length of a Blender unit [m].
    """

    def __init__(
        self, names: Sequence[str], poses: Poses, depsgraph: Any, metres_per_unit: float
    ) -> None:
        self._metres_per_unit = metres_per_unit
        self._depsgraph = depsgraph
        numbers = {name: number for number, name in enumerate(names, start=1)}
        #: Original objects that are rendered, by number.
        self.originals: dict[int, Any] = {
            numbers[name]: item for name, item in poses.rendered.items() if name in numbers
        }
        self._surfaces: dict[int, Any] = {}
        parts = [
            Part(numbers[name], name, key, instance)
            for name, instances in poses.objects.items()
            if numbers.get(name) in self.originals
            for key, instance in instances.items()
        ]
        #: Body number n is parts[n - 1].
        self.parts = sorted(parts, key=lambda part: (part.number, str(part.key)))
        self._of_number: dict[int, list[int]] = {}
        for index, part in enumerate(self.parts):
            self._of_number.setdefault(part.number, []).append(index)
        #: Body of each object that is a single one, by the object's number; 0: none, or several.
        self._lone_body = np.zeros(len(names) + 1, dtype=np.int32)
        for number, indices in self._of_number.items():
            if len(indices) == 1:
                self._lone_body[number] = indices[0] + 1

    def label(self, rows: PathRows) -> None:
        """Fill in bodies, and objects that are unknown though the scatterer is known."""
        self._label_end(rows, "last_scatterer_m", "last_object", "last_body", np.arange(rows.size))
        one = rows["order"] == 1
        rows["first_object"][one] = rows["last_object"][one]
        rows["first_body"][one] = rows["last_body"][one]
        self._label_end(
            rows, "first_scatterer_m", "first_object", "first_body", np.flatnonzero(~one)
        )

    def _label_end(
        self, rows: PathRows, points: str, objects: str, bodies: str, wanted: Indices
    ) -> None:
        wanted = wanted[are_finite(rows[points][wanted])]
        numbers = rows[objects][wanted]
        body = self._lone_body[numbers]
        rows[bodies][wanted] = body
        left = np.flatnonzero(body == 0)
        wanted, numbers = wanted[left], numbers[left]
        for number in np.unique(numbers).tolist():
            mine = wanted[numbers == number]
            position = np.array(rows[points][mine])
            allowed = _ON_SURFACE_WITHIN * np.maximum(rows["length_m"][mine], 1e-9)
            if number == 0:
                found = self._find(position, allowed, range(len(self.parts)))
            else:
                parts = self._of_number.get(number, [])
                if not parts:
                    continue
                found = np.full(mine.size, parts[0])
                if len(parts) > 1:
                    found = self._find(position, allowed, parts)
                    lost = np.flatnonzero(found < 0)
                    found[lost] = self._nearest_box(position[lost], parts)
            met = found >= 0
            rows[bodies][mine[met]] = found[met] + 1
            rows[objects][mine[met]] = [self.parts[index].number for index in found[met]]

    def _find(self, points: Real, allowed: Real, parts: Sequence[int]) -> Indices:
        """Return the index of the part on which each point lies; -1 for none."""
        candidates: list[tuple[int, Indices]] = []
        count = np.zeros(len(points), dtype=np.intp)
        found = np.full(len(points), -1)
        for index, near in self._near(points, allowed, parts):
            outside = np.linalg.norm(
                distance_from_box(self.parts[index].instance, points[near])[1], axis=-1
            )
            inside = near[outside <= allowed[near]]
            if inside.size:
                candidates.append((index, inside))
                count[inside] += 1
                found[inside] = index
        least = np.where(count > 1, allowed, -1.0)
        found[count > 1] = -1
        for index, inside in candidates:
            for row in inside[count[inside] > 1]:
                distance = self._distance_m(self.parts[index], points[row])
                if distance <= least[row]:
                    found[row], least[row] = index, distance
        return found

    def _near(
        self, points: Real, allowed: Real, parts: Sequence[int]
    ) -> Iterator[tuple[int, Indices]]:
        """Yield points within the boxes of parts along the axis of the largest spread."""
        if not len(points):
            return
        axis = int(np.argmax(np.ptp(points, axis=0)))
        order = np.argsort(points[:, axis], kind="stable")
        sorted_m = points[order, axis]
        margin = float(allowed.max())
        for index in parts:
            instance = self.parts[index].instance
            centre = instance.pose[:3, :3] @ instance.box.mean(axis=0) + instance.pose[:3, 3]
            half = np.abs(instance.pose[:3, :3]) @ (instance.box[1] - instance.box[0]) / 2
            low = np.searchsorted(sorted_m, centre[axis] - half[axis] - margin)
            high = np.searchsorted(sorted_m, centre[axis] + half[axis] + margin)
            if high > low:
                yield index, order[low:high]

    def _nearest_box(self, points: Real, parts: Sequence[int]) -> Indices:
        """Return the index of the part whose box is nearest to each point."""
        best = np.full(len(points), parts[0])
        least = np.full(len(points), np.inf)
        if not len(points):
            return best
        for index in parts:
            distance = np.linalg.norm(
                distance_from_box(self.parts[index].instance, points)[1], axis=-1
            )
            nearer = distance < least
            best[nearer], least[nearer] = index, distance[nearer]
        return best

    def _distance_m(self, part: Part, point: Real) -> float:
        """Return the distance of a point from the mesh of an object [m].

        Infinite without a mesh (curves, texts), so that meshes nearby have priority.
        """
        surface = self._surface(part.number)
        if surface is None:
            return float("inf")
        local = distance_from_box(part.instance, point[None])[0][0] / self._metres_per_unit
        _, _, _, distance = surface.find_nearest(tuple(local))
        if distance is None:
            return float("inf")
        scale = float(np.linalg.norm(part.instance.pose[:3, :3], axis=0).max())
        return float(distance) * scale * self._metres_per_unit

    def _surface(self, number: int) -> Any:
        if number not in self._surfaces:
            original = self.originals[number]
            self._surfaces[number] = None
            if original.type == "MESH":
                self._surfaces[number] = BVHTree.FromObject(original, self._depsgraph)
        return self._surfaces[number]
