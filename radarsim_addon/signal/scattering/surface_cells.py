# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells of surfaces, fixed to bodies, each with a scatterer; see :mod:`.surface_speckle`."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...array_types import Indices, Integers, Real
from ..paths import AnyRows
from .random_phases import hash_step, uniform

Hash = NDArray[np.uint64]

#: Axes of the world, in which poses are at its origin.
_WORLD = np.eye(3)
#: Where the origin lies in its cell: at no simple fraction of it.
_OFFSET = np.array([0.4142135623730950, 0.7320508075688772, 0.2360679774997896])


def distinct(keys: Hash) -> tuple[Hash, Indices, Indices]:
    """The keys that there are, sorted, where each comes first, and the place of every key among
    them: `numpy.unique`, without its stable sort.
    """
    order = np.argsort(keys)
    ranked = keys[order]
    starts = np.flatnonzero(np.append(True, ranked[1:] != ranked[:-1])[: keys.size])
    place = np.empty(keys.size, dtype=np.intp)
    place[order] = np.repeat(np.arange(starts.size), np.diff(starts, append=keys.size))
    if not starts.size:
        return ranked, starts, place
    return ranked[starts], np.minimum.reduceat(order, starts), place


@dataclass(frozen=True)
class Body:
    """A body to which cells are fixed: its unique name, and its pose (4, 4) [m].

    `box`: lowest and highest corner of its mesh in its own axes (2, 3) [m at scale 1]; None:
    scatterers may lie anywhere in their cells. `turns`: its parts have different velocities.
    """

    name: str
    pose: Real
    box: Real | None = None
    turns: bool = False

    @property
    def extent_m(self) -> Real:
        """Lowest and highest coordinate along the axes of `rotation`, (2, 3) [m]."""
        if self.box is None:
            return np.array([[-np.inf] * 3, [np.inf] * 3])
        corners = np.array(list(itertools.product(*self.box.T)))
        corners_m = corners @ self.pose[:3, :3].T @ self.rotation
        return np.array([corners_m.min(axis=0), corners_m.max(axis=0)])

    @property
    def rotation(self) -> Real:
        """The nearest rotation to the pose's axes, (3, 3); a mirror stays one."""
        left, _, right = np.linalg.svd(self.pose[:3, :3])
        return np.asarray(left @ right, dtype=np.float64)


@dataclass(frozen=True)
class Cells:
    """Cells of n vertices: hashes, bodies, poses and edges [m], (n,), numbers along the axes,
    (3, n).
    """

    state: Hash
    corner: Real
    body: Integers
    pose: Integers
    edge_m: Real


class SurfaceCells:
    """Cells of an edge [m], or of their object's where that is larger (`lengths_m` by its number),
    and at least of `coarse_m` on bodies that do not turn.

    `bodies` go by the numbers in the table's columns `columns`, of first and last vertex.
    """

    def __init__(
        self,
        bodies: Mapping[int, Body],
        columns: tuple[str, str],
        lengths_m: Real,
        seed: int,
        edge_m: float,
        coarse_m: float = 0.0,
    ) -> None:
        self._columns, self._lengths_m = columns, lengths_m
        # numbers of no body are in world space, at 0 and at the end
        self._most = max(bodies, default=0) + 1
        self._starts = np.full(self._most + 1, np.uint64(seed % 2**64))
        self._pose = np.zeros(self._most + 1, dtype=np.intp)
        self._poses = [(_WORLD, np.zeros(3))]
        self._edges_m = np.full(self._most + 1, max(edge_m, coarse_m))
        self._extents_m = np.tile(np.array([-np.inf, np.inf])[:, None, None], (3, self._most + 1))
        known = {self._poses[0][0].tobytes() + self._poses[0][1].tobytes(): 0}
        for number, body in bodies.items():
            name = hashlib.sha256(body.name.encode()).digest()[:8]
            self._starts[number] ^= np.uint64(int.from_bytes(name))
            self._extents_m[:, :, number] = body.extent_m
            if body.turns:
                self._edges_m[number] = edge_m
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
        length_m = self._lengths_m[rows["first_object" if first else "last_object"]]
        edge_m = np.maximum(self._edges_m[body], length_m)
        pose, state = self._pose[body], self._starts[body]
        corner = np.array(rows["first_scatterer_m" if first else "last_scatterer_m"].T, order="C")
        for mine, rotation, origin_m in self._by_pose(pose):
            if rotation is _WORLD:
                continue
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
        return Cells(state, corner, body, pose, edge_m)

    def _by_pose(self, pose: Integers) -> Iterator[tuple[Integers | slice, Real, Real]]:
        """Rows, rotation and origin of each pose."""
        found = np.flatnonzero(np.bincount(pose))
        for number in found.tolist():
            mine = slice(None) if found.size == 1 else np.flatnonzero(pose == number)
            yield mine, *self._poses[number]

    def local_m(self, cells: Cells) -> Real:
        """Scatterers of cells in the axes of their bodies, within those, (n, 3) [m]."""
        draw, points_m = cells.state, np.empty((cells.state.size, 3))
        held = np.flatnonzero(np.isfinite(self._extents_m[0, 0, cells.body]))
        for axis, corner in enumerate(cells.corner):
            draw = hash_step(draw)
            starts_m = corner - _OFFSET[axis]
            points_m[:, axis] = cells.edge_m * (uniform(draw) + starts_m)
            if held.size:
                within_m = np.stack([starts_m[held], starts_m[held] + 1]) * cells.edge_m[held]
                low_m, high_m = np.clip(within_m, *self._extents_m[:, axis, cells.body[held]])
                points_m[held, axis] = low_m + uniform(draw[held]) * (high_m - low_m)
        return points_m

    @property
    def largest_m(self) -> float:
        """Largest edge of a cell [m]."""
        return float(max(self._edges_m.max(), self._lengths_m.max()))

    def centres_m(self, cells: Cells) -> Real:
        """Centres of cells, (n, 3) [m]."""
        return self._in_world(cells, ((cells.corner - _OFFSET[:, None] + 0.5) * cells.edge_m).T)

    def _in_world(self, cells: Cells, points_m: Real) -> Real:
        """Points in the axes of the cells' bodies in world space, in place."""
        for mine, rotation, origin_m in self._by_pose(cells.pose):
            if rotation is _WORLD:
                continue
            if not np.array_equal(rotation, _WORLD):
                points_m[mine] = points_m[mine] @ rotation.T
            points_m[mine] += origin_m
        return points_m

    def scatterers(self, cells: Cells) -> tuple[Real, Real]:
        """Scatterers (n, 3) [m] and unit Gaussian heights (n,) of cells."""
        return self._in_world(cells, self.local_m(cells)), self.heights(cells.state)

    @staticmethod
    def heights(states: Hash) -> Real:
        """Unit Gaussian heights from hashes, (n,)."""
        first_draw = hash_step(states ^ np.uint64(0x5851F42D4C957F2D))
        second_draw = hash_step(first_draw)
        # Box and Muller; 1 - u is never 0
        return np.asarray(
            np.sqrt(-2 * np.log(1 - uniform(first_draw))) * np.cos(2 * np.pi * uniform(second_draw))
        )

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
