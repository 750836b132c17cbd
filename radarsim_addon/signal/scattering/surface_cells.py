# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells of surfaces, fixed to bodies, each with a scatterer; see :mod:`.surface_speckle`."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...array_types import Indices, Integers, Real
from ..paths import AnyRows
from .random_phases import hash_step, uniform

Hash = NDArray[np.uint64]

_WORLD = np.eye(3)
#: Where the origin lies in its cell: at no simple fraction of it.
_OFFSET = np.array([0.4142135623730950, 0.7320508075688772, 0.2360679774997896])


@dataclass(frozen=True)
class Body:
    """What cells are fixed to: a name that nothing else has, and its pose (4, 4) [m]."""

    name: str
    pose: Real

    @property
    def rotation(self) -> Real:
        """The nearest rotation to the pose's axes, (3, 3); a mirror stays one."""
        left, _, right = np.linalg.svd(self.pose[:3, :3])
        return np.asarray(left @ right, dtype=np.float64)


@dataclass(frozen=True)
class Cells:
    """Cells of n vertices: hashes, poses and edges [m], (n,), numbers along the axes, (3, n)."""

    state: Hash
    corner: Real
    pose: Integers
    edge_m: Real


class SurfaceCells:
    """Cells of an edge [m], or of their object's where that is larger (`lengths_m` by its number).

    `bodies` go by the numbers in the table's columns `columns`, of first and last vertex.
    """

    def __init__(
        self,
        bodies: Mapping[int, Body],
        columns: tuple[str, str],
        lengths_m: Real,
        seed: int,
        edge_m: float,
    ) -> None:
        self._columns = columns
        self._edges_m = np.maximum(edge_m, lengths_m)
        # numbers of no body are in world space, at 0 and at the end
        self._most = max(bodies, default=0) + 1
        self._starts = np.full(self._most + 1, np.uint64(seed % 2**64))
        self._pose = np.zeros(self._most + 1, dtype=np.intp)
        self._poses = [(np.eye(3), np.zeros(3))]
        known = {self._poses[0][0].tobytes() + self._poses[0][1].tobytes(): 0}
        for number, body in bodies.items():
            name = hashlib.sha256(body.name.encode()).digest()[:8]
            self._starts[number] ^= np.uint64(int.from_bytes(name))
            pose = body.rotation, np.ascontiguousarray(body.pose[:3, 3])
            key = pose[0].tobytes() + pose[1].tobytes()
            if key not in known:
                known[key] = len(self._poses)
                self._poses.append(pose)
            self._pose[number] = known[key]
        # Mixed before the cells come in: seed 1 must not be seed 0 with its cells swapped.
        self._starts = hash_step(self._starts)

    def of(self, rows: AnyRows, first: bool) -> Cells:
        """Cells of a vertex of rows whose vertices are all known."""
        body = np.clip(rows[self._columns[0 if first else 1]], 0, self._most)
        edge_m = self._edges_m[rows["first_object" if first else "last_object"]]
        pose, state = self._pose[body], self._starts[body]
        corner = np.array(rows["first_scatterer_m" if first else "last_scatterer_m"].T, order="C")
        for mine, rotation, origin_m in self._by_pose(pose):
            arm_m = corner[:, mine] - origin_m[:, None]
            if not np.array_equal(rotation, _WORLD):
                arm_m = (np.ascontiguousarray(arm_m.T) @ rotation).T
            corner[:, mine] = arm_m
        corner /= edge_m
        # Faces lie on round coordinates more often than not: no border of cells may.
        corner += _OFFSET[:, None]
        np.floor(corner, out=corner)
        for place in corner:
            state = hash_step(state ^ place.astype(np.int64).view(np.uint64))
        return Cells(state, corner, pose, edge_m)

    def _by_pose(self, pose: Integers) -> Iterator[tuple[Integers | slice, Real, Real]]:
        """Rows, rotation and origin of each pose."""
        found = np.unique(pose)
        for number in found.tolist():
            mine = slice(None) if found.size == 1 else np.flatnonzero(pose == number)
            yield mine, *self._poses[number]

    def local_m(self, cells: Cells) -> Real:
        """Scatterers of cells in the axes of their bodies, (n, 3) [m]."""
        draw, points_m = cells.state, np.empty((cells.state.size, 3))
        for axis, corner in enumerate(cells.corner):
            draw = hash_step(draw)
            points_m[:, axis] = cells.edge_m * (uniform(draw) + (corner - _OFFSET[axis]))
        return points_m

    def scatterers(self, cells: Cells) -> tuple[Real, Real]:
        """Scatterers (n, 3) [m] and unit Gaussian heights (n,) of cells."""
        points_m = self.local_m(cells)
        for mine, rotation, origin_m in self._by_pose(cells.pose):
            if not np.array_equal(rotation, _WORLD):
                points_m[mine] = points_m[mine] @ rotation.T
            points_m[mine] += origin_m
        first_draw = hash_step(cells.state ^ np.uint64(0x5851F42D4C957F2D))
        second_draw = hash_step(first_draw)
        # Box and Muller; 1 - u is never 0
        height = np.sqrt(-2 * np.log(1 - uniform(first_draw))) * np.cos(
            2 * np.pi * uniform(second_draw)
        )
        return points_m, height

    def keys(self, rows: AnyRows) -> Hash:
        """One number for all paths over the same cells, in the same way."""
        apart, last = self.apart(rows), self.of(rows, False).state
        first = last.copy()
        if apart.size:
            first[apart] = self.of(rows[apart], True).state
        way = rows["order"].astype(np.uint64) << np.uint64(32)
        way |= rows["transparent_depth"].astype(np.uint64)
        return hash_step(hash_step(first ^ way) ^ last)

    def apart(self, rows: AnyRows) -> Indices:
        """Rows whose first vertex is another than the last: none of those of one reflection."""
        same = rows["first_object"] == rows["last_object"]
        same &= rows[self._columns[0]] == rows[self._columns[1]]
        for first_m, last_m in zip(rows["first_scatterer_m"].T, rows["last_scatterer_m"].T):
            same &= first_m == last_m
        return np.flatnonzero(~same)
