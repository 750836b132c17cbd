# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertices of paths in float64: known rays intersected again with the meshes that they met.

Cycles gives hit points in float32 of world coordinates, and traces rays in float32 of the distance
from the camera. The ray of a pixel is known in float64, and so is the mesh in the object's own
space; the hit point tells which triangle was met.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...array_types import Indices, Real
from ...signal.paths import PathFlag, PathRows, TriangleMesh
from ..motion import Bodies
from ..state import evaluated_mesh, evaluated_objects, read_triangles

_EPS32 = float(np.finfo(np.float32).eps) / 2
_EPS64 = float(np.finfo(np.float64).eps) / 2
#: Largest error of a hit point, in roundings of its distances from the origin and from the ray's
#: start (7 standard deviations of what was seen).
_ROUNDINGS = 4.0
#: Largest error of a vertex from the transmitter's colours, relative to the length of the path.
_COLOUR_ERROR = 4e-6
#: Path lengths are computed again where float32 may be off by more than this [wavelengths].
TOLERANCE_WAVELENGTHS = 1e-3


class HitPoints:
    """Meshes of a scene at one moment, and the rays that hit them.

    Parameters
    ----------
    bodies
        Those whose numbers the rows have.
    depsgraph : bpy.types.Depsgraph
        At that moment. It must not change while rows are refined.
    metres_per_unit
        Length of a Blender unit [m].
    wavelength_m
        Of the carrier.
    opaque
        Whether nothing in the scene lets power through, so that no path is delayed.
    """

    def __init__(
        self,
        bodies: Bodies,
        depsgraph: Any,
        metres_per_unit: float,
        wavelength_m: float,
        opaque: bool,
    ) -> None:
        self._bodies, self._depsgraph, self._units = bodies, depsgraph, metres_per_unit
        self._tolerance_m = TOLERANCE_WAVELENGTHS * wavelength_m
        self._opaque = opaque
        #: Mesh of each body, by the address of its data; 0: none.
        self._data: Indices = np.zeros(0, dtype=np.intp)
        self._meshes: dict[int, TriangleMesh | None] = {0: None}
        self._inverse: Real = np.zeros((0, 4, 4))
        self._stretch: Real = np.zeros(0)

    def refine(self, rows: PathRows, origin_m: Real, transmitter_m: Real) -> None:
        """Move vertices of labelled rows onto their triangles; change their lengths and sigmas.

        `origin_m` is where the rays start, (3,) or (n, 3).
        """
        origins_m = np.broadcast_to(origin_m, rows["direction"].shape)
        exact_length = rows["flags"] & PathFlag.ENCODED_LENGTH == 0
        one = np.flatnonzero((rows["order"] == 1) & exact_length)
        self._refine_order_1(rows, one, origins_m[one], transmitter_m)
        later = np.flatnonzero((rows["order"] > 1) & (rows["flags"] & PathFlag.MIXED == 0))
        self._refine_later(rows, later, origins_m[later], transmitter_m)

    def _refine_order_1(
        self, rows: PathRows, chosen: Indices, origins_m: Real, transmitter_m: Real
    ) -> None:
        points_m = rows["last_scatterer_m"][chosen]
        reach_m = _reach_m(points_m, origins_m)
        needed = 2 * reach_m > self._tolerance_m
        chosen, points_m, origins_m = chosen[needed], points_m[needed], origins_m[needed]
        mine = rows[chosen]
        way_m = self._hit(
            mine["last_body"], origins_m, mine["direction"], points_m, reach_m[needed]
        )
        hit = np.isfinite(way_m)
        chosen, way_m = chosen[hit], way_m[hit]
        found_m = origins_m[hit] + way_m[:, None] * rows["direction"][chosen]
        rows["last_scatterer_m"][chosen] = rows["first_scatterer_m"][chosen] = found_m
        back_m = np.linalg.norm(found_m - transmitter_m, axis=1)
        rows["length_m"][chosen] = way_m + back_m
        # Behind transparent surfaces a delay below the encoding's noise goes unnoticed.
        direct = rows["transparent_depth"][chosen] == 0
        rows["length_sigma_m"][chosen[direct]] = _sigma_m(found_m, way_m + back_m)[direct]

    def _refine_later(
        self, rows: PathRows, chosen: Indices, origins_m: Real, transmitter_m: Real
    ) -> None:
        """Orders above 1: the first vertex along its ray, the last one along the last segment."""
        needed = 4 * rows["length_sigma_m"][chosen] > self._tolerance_m
        chosen, origins_m = chosen[needed], origins_m[needed]
        mine = rows[chosen]
        coloured_m = _COLOUR_ERROR * mine["length_m"]
        first_m, last_m = mine["first_scatterer_m"], mine["last_scatterer_m"]
        way_m = self._hit(
            mine["first_body"],
            origins_m,
            mine["direction"],
            first_m,
            coloured_m + _reach_m(first_m, origins_m),
        )
        seen = np.isfinite(way_m)
        first_m = np.where(seen[:, None], origins_m + way_m[:, None] * mine["direction"], first_m)
        segment_m = last_m - transmitter_m
        share = self._hit(
            mine["last_body"],
            np.broadcast_to(transmitter_m, last_m.shape),
            segment_m,
            last_m,
            coloured_m + _reach_m(last_m, transmitter_m),
        )
        lit = np.isfinite(share)
        last_m = np.where(lit[:, None], transmitter_m + share[:, None] * segment_m, last_m)
        rows["first_scatterer_m"][chosen], rows["last_scatterer_m"][chosen] = first_m, last_m
        length_m = (
            way_m
            + np.linalg.norm(last_m - first_m, axis=1)
            + np.linalg.norm(last_m - transmitter_m, axis=1)
        )
        # What a pane between the vertices delays, geometry cannot see.
        known = seen & lit & (mine["order"] == 2) & self._opaque
        with np.errstate(invalid="ignore"):
            known &= np.abs(length_m - mine["length_m"]) <= 2 * coloured_m + 20 * mine[
                "length_sigma_m"
            ].astype(np.float64)
        sure = chosen[known]
        rows["length_m"][sure] = length_m[known]
        rows["length_sigma_m"][sure] = _sigma_m(last_m[known], length_m[known])
        rows["flags"][sure] &= ~np.uint16(PathFlag.ENCODED_LENGTH)

    # -- meshes ------------------------------------------------------------------------------------

    def _hit(
        self, bodies: Indices, origins_m: Real, directions: Real, near_m: Real, reach_m: Real
    ) -> Real:
        """Distances along rays in lengths of their directions, (n,); NaN where nothing is hit."""
        found = np.full(len(bodies), np.nan)
        known = np.flatnonzero((bodies > 0) & np.isfinite(near_m).all(axis=1))
        if not known.size:
            return found
        if not self._data.size:
            self._survey()
        data = self._data[bodies[known] - 1]
        for address in np.unique(data).tolist():
            mesh = self._mesh(address, int(bodies[known[data == address][0]]))
            if mesh is None:
                continue
            mine = known[data == address]
            part = bodies[mine] - 1
            # The mesh stays as it is, and the rays come into its space: so its shape stays exact.
            inverse = self._inverse[part]
            turn, move = inverse[:, :3, :3], inverse[:, :3, 3]
            found[mine] = mesh.hit(
                np.einsum("nij,nj->ni", turn, origins_m[mine]) + move,
                np.einsum("nij,nj->ni", turn, directions[mine]),
                np.einsum("nij,nj->ni", turn, near_m[mine]) + move,
                reach_m[mine] * self._stretch[part],
            )
        return found

    def _survey(self) -> None:
        """Find which mesh each body has; read those that geometry nodes made for instances."""
        place = {(part.name, part.key): index for index, part in enumerate(self._bodies.parts)}
        self._data = np.zeros(len(self._bodies.parts), dtype=np.intp)
        for one in evaluated_objects(self._depsgraph):
            index = place.get((one.original.name, one.key))
            if index is None or one.evaluated.data is None:
                continue
            address = one.evaluated.data.as_pointer()
            self._data[index] = address
            own = one.original.evaluated_get(self._depsgraph).data
            if address not in self._meshes and (own is None or own.as_pointer() != address):
                self._meshes[address] = self._read(one.evaluated)
        poses = np.stack([part.instance.pose for part in self._bodies.parts])
        flat = np.abs(np.linalg.det(poses)) < np.finfo(np.float64).tiny
        poses[flat] = np.eye(4)  # nothing is seen of it
        self._inverse = np.linalg.inv(poses)
        self._stretch = np.linalg.norm(self._inverse[:, :3, :3], ord=2, axis=(1, 2))
        self._data[flat] = 0

    def _mesh(self, address: int, body: int) -> TriangleMesh | None:
        if address not in self._meshes:
            original = self._bodies.originals[self._bodies.parts[body - 1].number]
            self._meshes[address] = self._read(original.evaluated_get(self._depsgraph))
        return self._meshes[address]

    def _read(self, evaluated: Any) -> TriangleMesh | None:
        with evaluated_mesh(evaluated) as mesh:
            if mesh is None:
                return None
            vertices, triangles = read_triangles(mesh)
        return TriangleMesh(vertices.astype(np.float64) * self._units, triangles)


def _reach_m(points_m: Real, start_m: Real) -> Real:
    """Largest error of hit points of rays from `start_m`, (n,)."""
    away_m = np.linalg.norm(points_m, axis=1) + np.linalg.norm(points_m - start_m, axis=1)
    return np.asarray(_ROUNDINGS * _EPS32 * away_m)


def _sigma_m(points_m: Real, length_m: Real) -> Real:
    """Standard deviation of lengths that were computed in float64, (n,)."""
    return np.asarray(_EPS64 * (0.5 * np.linalg.norm(points_m, axis=1) + 1.3 * length_m))
