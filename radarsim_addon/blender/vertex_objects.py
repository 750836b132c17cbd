# SPDX-License-Identifier: GPL-3.0-or-later
"""Which object the last vertex of a path with several reflections lies on.

Cycles tells the object of the first surface seen; of later ones only the place is known, from the
emitter's colours. Boxes decide where they can, distances from the surfaces where boxes overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from mathutils.bvhtree import BVHTree
from numpy.typing import NDArray

from ..signal.pathtable import PathRows
from .object_motion import Poses, Shown, beside_box

#: How far from a surface a last vertex may lie, relative to the path's length: vertices from the
#: emitter's colours are known to 1e-6 of the scene's size.
_ON_SURFACE_WITHIN = 2e-5


class VertexObjects:
    """Surfaces of a scene at one moment.

    Parameters
    ----------
    names
        Objects in the order of their numbers, from 1.
    poses
        Where they are.
    depsgraph : bpy.types.Depsgraph
        At that moment.
    metres_per_unit
        Scale.
    """

    def __init__(
        self, names: Sequence[str], poses: Poses, depsgraph: Any, metres_per_unit: float
    ) -> None:
        self._metres_per_unit = metres_per_unit
        numbers = {name: number for number, name in enumerate(names, start=1)}
        self._surfaces: dict[int, Any] = {}
        rendered = set()
        for item in depsgraph.object_instances:
            original = item.object.original
            number = numbers.get(original.name)
            if number is None or original.hide_render:
                continue
            rendered.add(original.name)
            if number not in self._surfaces and original.type == "MESH":
                self._surfaces[number] = BVHTree.FromObject(original, depsgraph)
        self._parts: list[tuple[int, Shown]] = [
            (numbers[name], shown)
            for name, instances in poses.objects.items()
            if name in rendered
            for shown in instances.values()
        ]

    def label(self, rows: PathRows) -> None:
        """Fill in ``object`` where it is unknown and the last vertex is known."""
        known = np.isfinite(rows["last_m"]).all(axis=-1)
        todo = np.flatnonzero((rows["order"] > 1) & (rows["object"] == 0) & known)
        if not todo.size:
            return
        points = np.array(rows["last_m"][todo])
        allowed = _ON_SURFACE_WITHIN * rows["length_m"][todo]
        inside = np.stack(
            [
                np.linalg.norm(beside_box(shown, points)[1], axis=-1) <= allowed
                for _, shown in self._parts
            ]
        )
        numbers = np.array([number for number, _ in self._parts], dtype=np.int32)
        count = inside.sum(axis=0)
        found = np.where(count == 1, numbers[np.argmax(inside, axis=0)], 0)
        least = np.where(count > 1, allowed, -1.0)
        for index, (number, shown) in enumerate(self._parts):
            if number not in self._surfaces:
                continue
            for place in np.flatnonzero(inside[index] & (count > 1)):
                distance = self._distance_m(number, shown, points[place])
                if distance <= least[place]:
                    found[place], least[place] = number, distance
        rows["object"][todo] = found

    def _distance_m(self, number: int, shown: Shown, point: NDArray[np.float64]) -> float:
        """Distance of a point from an object's surface [m]."""
        local = beside_box(shown, point[None])[0][0] / self._metres_per_unit
        _, _, _, distance = self._surfaces[number].find_nearest(tuple(local))
        if distance is None:
            return float("inf")
        scale = float(np.linalg.norm(shown.pose[:3, :3], axis=0).max())
        return float(distance) * scale * self._metres_per_unit
