# SPDX-License-Identifier: GPL-3.0-or-later
"""Straight rays against triangle meshes: the face that Embree finds, and its place in float64.

Embree computes in float32. `RayMesh` therefore moves a mesh into a cube of side 2 and begins each
ray where it enters the mesh's box, so that coordinates are rounded to 1e-7 of the mesh's size,
however far away the ray begins. Where the ray meets the plane of the face that Embree names is
computed again in float64.

`CLEAR` is the one tolerance. A ray does not meet a face that it begins on within `CLEAR`, and a way
between two points is not blocked by the faces that they lie on. Within `CLEAR` of an edge, Embree
may name the face on the other side of it. In its robust mode no ray passes between two faces at
their common edge, but of the rays aimed at a corner one in 500 passes between all faces there,
because each edge rounds differently. Embree therefore looks for faces along a ray that is moved
aside by `CLEAR`: of 187 320 rays aimed at corners none was lost then, without it 320.

`RayScene` has bodies that share meshes, each with a pose: a tree of their boxes finds which bodies
a ray may meet, and the ray is moved into the mesh's own axes.

Literature: Wald et al., Embree: a kernel framework for efficient CPU ray tracing, 2014; Woop et
al., Watertight ray/triangle intersection, 2013; Ericson, Real-time collision detection, 2005.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Indices, Mask, Real, are_finite, crosses, dots, norms, take_rows, turned
from ...errors import MissingDependencyError

#: Distance along a ray up to which its ends lie on a face, as a fraction of the mesh's half extent
#: (rounded up to a power of two): 16 roundings of float32, more than the start and direction of a
#: ray and Embree's test of an edge add up to.
CLEAR = 1e-6
#: How far Embree's rays are moved aside, in a direction that no face is likely to have.
_ASIDE = CLEAR * np.array([0.62, 0.37, 0.69])
#: How far before the mesh's box a ray begins, and after it ends, as the same fraction.
_AROUND = 1.0 / 64
#: Distance within which the nearest face is looked for first, as the same fraction, and how many
#: times as far each time after.
_NEAR, _FARTHER = 1e-5, 64.0
#: How far outside a face a ray may pass it, as a fraction of its sides: rounding of float64.
_OUTSIDE = 1e-9
#: Cosine between a ray and a face below which their plane may meet far outside the face.
_ALONG = 1e-3


@cache
def _device() -> Any:
    try:
        from embreex.rtcore import EmbreeDevice  # 40 ms: most uses of the package cast no ray
    except ImportError as error:
        raise MissingDependencyError(
            "embreex is not installed; it finds what rays meet. Install it with 'pip install "
            "embreex', or in Blender the extension from the zip for your platform."
        ) from error
    return EmbreeDevice()


class RayMesh:
    """A triangle mesh that tells which faces rays meet, and which face is nearest to a point.

    `vertices` (v, 3) and `triangles` (m, 3) are in any one unit. Faces without area and with places
    that are not finite are met by no ray. A ray parameter t stands for origin + t * direction.
    """

    def __init__(self, vertices: NDArray[Any], triangles: NDArray[Any]) -> None:
        self._vertices = np.asfortranarray(vertices, dtype=np.float64).reshape(-1, 3)
        self._triangles = np.asarray(triangles).reshape(-1, 3)
        corners = self._corners()
        with np.errstate(invalid="ignore", over="ignore"):
            area = norms(crosses(corners[1] - corners[0], corners[2] - corners[0]))
        #: Faces that rays may meet, in order.
        self._faces = np.flatnonzero((area > 0) & np.isfinite(area))
        used = self._triangles[self._faces]
        #: Lowest and highest place of the faces that rays may meet, (2, 3).
        self.box = np.zeros((2, 3))
        if len(used):
            there = np.zeros(len(self._vertices), dtype=bool)
            there[used] = True
            places = self._vertices[there]
            self.box = np.stack([places.min(axis=0), places.max(axis=0)])
        self._centre = self.box.mean(axis=0)
        half = float(np.ptp(self.box, axis=0).max()) / 2
        # a power of two, so that nothing is rounded
        self._scale = 2.0 ** math.ceil(math.log2(half)) if half > 0 else 1.0
        self._cube_box = (self.box - self._centre) / self._scale + [[-CLEAR], [CLEAR]]

    def __len__(self) -> int:
        return len(self._triangles)

    def turned(self, linear: Real) -> RayMesh:
        """Return the mesh in other axes, by a matrix (3, 3)."""
        return RayMesh(self._vertices @ linear.T, self._triangles)

    def normals_of(self, faces: Indices) -> Real:
        """Return the unit normals of faces that were met, by the order of their corners, (n, 3);
        NaN for -1.
        """
        found = np.full((len(faces), 3), np.nan)
        met = faces >= 0
        found[met] = self._shapes[3:6].take(np.searchsorted(self._faces, faces[met]), axis=1).T
        return found

    @cached_property
    def _shapes(self) -> Real:
        """Of the faces that rays may meet: first corner, unit normal, `across_1` and `across_2`.

        Products of these two with a place in the plane, from the first corner, are the coefficients
        of both edges.
        """
        a, b, c = ((each - self._centre) / self._scale for each in self._corners(self._faces))
        normal = crosses(b - a, c - a)
        square = dots(normal, normal)
        across_1, across_2 = crosses(c - a, normal).T / square, crosses(normal, b - a).T / square
        return np.concatenate([a.T, normal.T / np.sqrt(square), across_1, across_2])

    @cached_property
    def _tree(self) -> Any:
        device = _device()
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        tree = EmbreeScene(device, robust=True)
        with np.errstate(invalid="ignore", over="ignore"):
            places = ((self._vertices - self._centre) / self._scale).astype(np.float32)
        # no face has the vertices that are not finite
        TriangleMesh(tree, np.nan_to_num(places), self._triangles[self._faces].astype(np.int32))
        return tree

    def first(self, origins: Real, directions: Real) -> tuple[Indices, Real]:
        """Return the first face that each ray meets, -1 for none, and its ray parameter, infinite
        for none, (n,) each.

        `origins` are (n, 3) or (3,), `directions` of any length, (n, 3).
        """
        starts, along, size = self._moved(origins, directions)
        face, way = self._cast(starts, along, np.full(len(size), CLEAR), np.full(len(size), np.inf))
        return face, np.where(face >= 0, way, np.inf) / np.where(face >= 0, size, 1.0)

    def blocked(self, starts: Real, ends: Real) -> Mask:
        """Return whether a face lies on each way between two points, (n,).

        `starts` are (n, 3) or (3,), `ends` (n, 3). Faces that an end lies on do not count.
        """
        begins, along, size = self._moved(starts, ends - starts)
        return self._cast(begins, along, np.full(len(size), CLEAR), size - CLEAR)[0] >= 0

    def crossings(
        self, origins: Real, directions: Real, most: int
    ) -> Iterator[tuple[Indices, Indices, Real]]:
        """Yield the next face that each ray passes, in order, `most` times at most.

        Each time: the rays that meet one, the faces, and the ray parameters, (k,) each. A ray that
        passes an edge passes one of its faces.
        """
        starts, along, size = self._moved(origins, directions)
        rays, least = np.arange(len(size)), np.full(len(size), CLEAR)
        for _ in range(most):
            face, way = self._cast(starts[rays], along[rays], least, np.full(rays.size, np.inf))
            met = np.flatnonzero(face >= 0)
            if not met.size:
                return
            rays, least = rays[met], way[met] + CLEAR
            yield rays, face[met], way[met] / size[rays]

    def holds(self, points: Real, direction: Real, most: int) -> Mask:
        """Return whether points (n, 3) are inside: a ray from each along a direction (3,) passes an
        odd number of faces, of which `most` are counted.
        """
        inside = np.zeros(len(points), dtype=bool)
        for rays, _, _ in self.crossings(points, np.tile(direction, (len(points), 1)), most):
            inside[rays] ^= True
        return inside

    def _moved(self, origins: Real, directions: Real) -> tuple[Real, Real, Real]:
        """Return rays in the cube: origins, unit vectors, and the lengths of the directions."""
        away = directions / self._scale
        with np.errstate(invalid="ignore"):
            size = norms(away)
        starts = np.broadcast_to((origins - self._centre) / self._scale, away.shape)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asfortranarray(starts), away / size[:, None], size

    def _cast(self, starts: Real, along: Real, least: Real, most: Real) -> tuple[Indices, Real]:
        """Return the first face of each ray in the cube between two ways along it, and the way."""
        face, way = np.full(len(starts), -1), np.full(len(starts), np.inf)
        if not self._faces.size:
            return face, way
        enter, leave = _through_box(starts, along, *self._cube_box[:, :, None])
        first = np.maximum(enter - _AROUND, least - CLEAR)
        last = np.minimum(leave, most) + _AROUND
        asked = np.flatnonzero((enter <= leave) & (first < last))
        hits = np.zeros(len(starts), dtype=np.intp)
        for turn, aside in enumerate((1.0, 0.0, -1.0)):
            if not asked.size:
                break
            some = (take_rows(starts, asked), take_rows(along, asked), least[asked], most[asked])
            found, ways, sure = self._look(*some, first[asked], last[asked], aside * _ASIDE)
            face[asked], way[asked] = found, ways
            # Past an edge: where the ray itself goes decides, else two of three rays.
            hits[asked] += found >= 0
            asked = asked[~sure & (hits[asked] > 0 if turn else True)]
        return face, way

    def _look(
        self, starts: Real, along: Real, least: Real, most: Real, at: Real, last: Real, aside: Real
    ) -> tuple[Indices, Real, Mask]:
        """As `_cast`, from one way along each ray to another, by rays that are moved `aside`; and
        whether the ray itself meets the face that was found.
        """
        face, way = np.full(len(starts), -1), np.full(len(starts), np.inf)
        sure = np.zeros(len(starts), dtype=bool)
        left, step = np.arange(len(starts)), CLEAR
        while left.size:
            begins, rays = take_rows(starts, left), take_rows(along, left)
            found = self._tree.run(
                (begins + at[:, None] * rays + aside).astype(np.float32, order="C"),
                rays.astype(np.float32, order="C"),
                dists=(last - at).astype(np.float32),
                output=True,
            )
            met = np.flatnonzero(found["primID"] >= 0)
            left, number = left[met], found["primID"][met]
            there, within = self._places(take_rows(begins, met), take_rows(rays, met), number)
            counts = (there > least[left]) & (there < most[left])
            face[left[counts]], way[left[counts]] = self._faces[number[counts]], there[counts]
            sure[left] = within
            # Embree has no least distance: leave behind the face that the ray begins on
            again = np.flatnonzero(there <= least[left])
            sure[left[again]] = False
            at = at[met[again]] + found["tfar"][met[again]] + step
            last, left = last[met[again]], left[again]
            inside = np.flatnonzero(at < last)
            left, at, last, step = left[inside], at[inside], last[inside], 2 * step
        return face, way, sure

    def _places(self, starts: Real, along: Real, number: Indices) -> tuple[Real, Mask]:
        """Return how far along rays in the cube the planes of faces are, one face each, and whether
        the rays meet them within the face, (n,) each.
        """
        shape = self._shapes.take(number, axis=1)
        normals, across_1, across_2 = (shape[i : i + 3].T for i in (3, 6, 9))
        arm = starts - shape[:3].T
        cosine = dots(along, normals)
        with np.errstate(divide="ignore", invalid="ignore"):
            way = -dots(arm, normals) / cosine
        # A ray along a face meets its plane far away, or nowhere: the face's extent limits it.
        flat = np.flatnonzero(np.abs(cosine) < _ALONG)
        if flat.size:
            ways = [
                dots((corner - self._centre) / self._scale - starts[flat], along[flat])
                for corner in self._corners(self._faces[number[flat]])
            ]
            low, high = np.min(ways, axis=0), np.max(ways, axis=0)
            way[flat] = np.clip(np.where(np.isnan(way[flat]), low, way[flat]), low, high)
        arm += way[:, None] * along
        u, v = dots(arm, across_1), dots(arm, across_2)
        return way, np.minimum(np.minimum(u, v), 1 - u - v) >= -_OUTSIDE

    def _corners(self, faces: Indices | slice = slice(None)) -> tuple[Real, ...]:
        """Return the corners of faces, three times (n, 3)."""
        return tuple(take_rows(self._vertices, each) for each in self._triangles[faces].T)

    # -- nearest face ------------------------------------------------------------------------------

    @cached_property
    def _boxes(self) -> _BoxTree:
        a, b, c = self._corners()
        return _BoxTree(np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c))

    def near(self, points: Real, within: Real | float = np.inf) -> tuple[Indices, Real]:
        """Return the face nearest to each point (n, 3) and its distance, (n,) each.

        -1 and infinite where none is as near as `within`, (n,) or one for all. Faces without area
        count as lines or points.
        """
        face, best = np.full(len(points), -1), np.full(len(points), np.inf)
        within = np.broadcast_to(within, len(points))
        left = np.flatnonzero(are_finite(points))
        # most points lie on the mesh, and what is that near is found fast
        reach = _NEAR * self._scale
        while left.size and len(self._boxes):
            limit = np.minimum(reach, within[left])
            for row, near in self._boxes.nearest(points[left], limit):
                row = left[row]
                distance = triangle_distances(*(each - points[row] for each in self._corners(near)))
                begins = np.flatnonzero(np.diff(row, prepend=-1))
                least = np.minimum.reduceat(distance, begins) if row.size else distance
                least = np.repeat(least, np.diff(begins, append=row.size))
                nearest = np.flatnonzero(
                    (distance == least) & (distance <= np.minimum(reach, within[row]))
                )
                face[row[nearest]], best[row[nearest]] = near[nearest], distance[nearest]
            left = left[(face[left] < 0) & (limit < within[left])]
            reach *= _FARTHER
        return face, best


def barycentric(points: Real, corners: Real) -> Real:
    """Return weights, (n, 3), of points (n, 3) projected on triangles (n, 3, 3); their sum is 1."""
    edge_1, edge_2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    arm = points - corners[:, 0]
    d11 = np.sum(edge_1 * edge_1, axis=-1)
    d12 = np.sum(edge_1 * edge_2, axis=-1)
    d22 = np.sum(edge_2 * edge_2, axis=-1)
    d1, d2 = np.sum(arm * edge_1, axis=-1), np.sum(arm * edge_2, axis=-1)
    area = d11 * d22 - d12**2
    safe = np.where(area > 0, area, 1.0)
    second = np.where(area > 0, (d22 * d1 - d12 * d2) / safe, 0.0)
    third = np.where(area > 0, (d11 * d2 - d12 * d1) / safe, 0.0)
    return np.stack([1 - second - third, second, third], axis=-1)


def triangle_distances(a: Real, b: Real, c: Real) -> Real:
    """Return the distance of the origin from each triangle by its corners, (n,).

    It is the distance from the plane if the projection of the origin is inside the triangle, else
    that from the nearest edge.
    """
    normal = crosses(b - a, c - a)
    area2 = dots(normal, normal)
    # The projection of the origin is `foot`. It is inside if it is left of all three edges.
    with np.errstate(divide="ignore", invalid="ignore"):
        height = dots(a, normal) / np.sqrt(area2)
        foot = normal * (dots(a, normal) / area2)[:, None]
    inside = area2 > 0
    for start, end in ((a, b), (b, c), (c, a)):
        inside &= dots(crosses(end - start, foot - start), normal) >= 0
    edges = np.minimum.reduce([_segment_distances(*ends) for ends in ((a, b), (b, c), (c, a))])
    return np.asarray(np.where(inside, np.abs(height), edges))


def _segment_distances(start: Real, end: Real) -> Real:
    along = end - start
    length2 = dots(along, along)
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = -dots(start, along) / length2
    fraction = np.clip(np.where(length2 > 0, fraction, 0.0), 0.0, 1.0)
    return norms(start + fraction[:, None] * along)


# -- bodies ----------------------------------------------------------------------------------------

#: Boxes of a node of the tree, and nodes at its top, at most.
_BRANCHES, _TOP = 4, 16
#: Pairs of a ray and a box, or of a point and a face, that are looked at at once, about.
_PAIRS = 1 << 18
#: Room about the box of a body, relative to its size and to its coordinates.
_ROOM, _ROUNDING = 2e-6, 1e-12
#: Volume of a pose over the cube of its size below which a body is flat: its inverse rounds.
_FLAT = 1e-9


class RayScene:
    """n bodies that share meshes: what rays meet in the space around them.

    `poses` (n, 4, 4) lead from the axes of the meshes into the space of the rays, `boxes` (n, 2, 3)
    are around the meshes in their own axes, and `shapes` (n,) are the numbers, from 0, by which
    `mesh` gives them: it is called when a ray comes into a box. None: rays meet nothing.
    """

    def __init__(
        self, poses: Real, boxes: Real, shapes: Indices, mesh: Callable[[int], RayMesh | None]
    ) -> None:
        self._mesh, self._mesh_numbers = mesh, np.asarray(shapes)
        self._linear = linear = poses[:, :3, :3]
        size = np.abs(linear).max(axis=(1, 2), initial=0.0)
        flat = np.abs(np.linalg.det(linear)) <= _FLAT * size**3
        #: A flat body has no way back into its mesh's axes, but a mesh of its own in the world's.
        self._shapes = np.where(flat, -1 - np.arange(len(poses)), shapes)
        self._flat: dict[int, RayMesh | None] = {}
        inverse = np.linalg.inv(np.where(flat[:, None, None], np.eye(3), linear))
        #: (3, 3, n) and (n, 3)
        self._turn, self._place = inverse.transpose(1, 2, 0).copy(), poses[:, :3, 3]
        middle = np.einsum("nij,nj->ni", linear, boxes.mean(axis=1)) + self._place
        half = np.einsum("nij,nj->ni", np.abs(linear), (boxes[:, 1] - boxes[:, 0]) / 2)
        half += _ROOM * half.max(axis=1, initial=0.0)[:, None]
        half += _ROUNDING * np.abs(middle).max(axis=1, initial=0.0)[:, None]
        self._tree = _BoxTree(middle - half, middle + half)

    def first(
        self, origins: Real, directions: Real, among: Mask | None = None
    ) -> tuple[Indices, Indices, Real]:
        """Return the first body and face that each ray meets, -1 for none, and its ray parameter,
        infinite for none, (n,) each.

        `origins` are (n, 3) or (3,), `directions` of any length, (n, 3). `among` (bodies,) are
        those that count (None: all).
        """
        origins = np.broadcast_to(origins, directions.shape)
        body, face = np.full((2, len(directions)), -1)
        way = np.full(len(directions), np.inf)
        for ray, box, enter in self._tree.passed(origins, directions, np.inf):
            kept = slice(None) if among is None else among[box]
            pairs = ray[kept], box[kept], enter[kept]
            for rays, bodies in _in_order(pairs, lambda rays, enter: enter < way[rays]):
                for mesh, some, start, along in self._by_mesh(origins, directions, rays, bodies):
                    faces, ways = mesh.first(start, along)
                    # one ray may come into several bodies of a mesh
                    order = np.lexsort((ways, rays[some]))
                    order = order[np.diff(rays[some][order], prepend=-1) > 0]
                    order = order[ways[order] < way[rays[some[order]]]]
                    ray = rays[some[order]]
                    body[ray], face[ray], way[ray] = bodies[some[order]], faces[order], ways[order]
        return body, face, way

    def blocked(self, starts: Real, ends: Real, among: Mask | None = None) -> Mask:
        """Return whether a face lies on each way between two points (n, 3), (n,).

        `among` (bodies,) are those that count (None: all). Faces that an end lies on do not count.
        """
        found = np.zeros(len(ends), dtype=bool)
        starts, ways = np.broadcast_to(starts, ends.shape), ends - starts
        for ray, box, enter in self._tree.passed(starts, ways, 1.0):
            kept = slice(None) if among is None else among[box]
            pairs = ray[kept], box[kept], enter[kept]
            for rays, bodies in _in_order(pairs, lambda rays, enter: ~found[rays]):
                for mesh, some, start, along in self._by_mesh(starts, ways, rays, bodies):
                    found[rays[some[mesh.blocked(start, start + along)]]] = True
        return found

    def _by_mesh(
        self, origins: Real, directions: Real, rays: Indices, bodies: Indices
    ) -> Iterator[tuple[RayMesh, Indices, Real, Real]]:
        """Yield each mesh that rays may meet, which pairs of these are of it, and their rays in its
        own axes.
        """
        turn, place = self._turn.take(bodies, axis=2), take_rows(self._place, bodies)
        starts = turned(turn, (take_rows(origins, rays) - place).T).T
        along = turned(turn, take_rows(directions, rays).T).T
        shapes = self._shapes[bodies]
        order = np.argsort(shapes, kind="stable")
        for some in np.split(order, np.flatnonzero(np.diff(shapes[order])) + 1):
            mesh = self._mesh_of(int(shapes[some[0]])) if some.size else None
            if mesh is not None:
                yield mesh, some, take_rows(starts, some), take_rows(along, some)

    def _mesh_of(self, shape: int) -> RayMesh | None:
        if shape >= 0:
            return self._mesh(shape)
        body = -1 - shape
        if body not in self._flat:
            mesh = self._mesh(int(self._mesh_numbers[body]))
            self._flat[body] = None if mesh is None else mesh.turned(self._linear[body])
        return self._flat[body]


class _BoxTree:
    """A tree of boxes along the axes: which of them rays pass, and which may be nearest to points.

    Boxes that are not finite are left out.
    """

    def __init__(self, low: Real, high: Real) -> None:
        finite = np.flatnonzero(are_finite(low) & are_finite(high))
        self._order = finite[along_curve((low[finite] + high[finite]) / 2)]
        #: From the boxes to the top, each (2, 3, k).
        self._levels = [np.stack([low[self._order].T, high[self._order].T])]
        while self._levels[-1].shape[2] > _TOP:
            below = self._levels[-1]
            begins = np.arange(0, below.shape[2], _BRANCHES)
            ends = (np.minimum, np.maximum)
            self._levels.append(
                np.stack([f.reduceat(b, begins, axis=1) for f, b in zip(ends, below, strict=True)])
            )

    def passed(
        self, origins: Real, directions: Real, most: float
    ) -> Iterator[tuple[Indices, Indices, Real]]:
        """Yield, in blocks of rays: the rays, the boxes that they pass before the ray parameter
        `most`, and the parameters at which they enter them.
        """

        def through(ray: Indices, low: Real, high: Real) -> tuple[Mask, Real]:
            enter, leave = _through_box(
                take_rows(origins, ray), take_rows(directions, ray), low, high
            )
            enter = np.maximum(enter, 0.0)
            return (enter <= leave) & (enter <= most), enter

        return self._pairs(np.arange(len(origins)), through)

    def __len__(self) -> int:
        return len(self._order)

    def nearest(self, points: Real, within: Real) -> Iterator[tuple[Indices, Indices]]:
        """Yield points and the boxes in which what is nearest to them may lie, in blocks of points.

        Each box is the smallest one around something. None are farther away than `within`, (n,).
        """
        bound = np.square(within)

        def closer(row: Indices, low: Real, high: Real) -> tuple[Mask, Real]:
            least, most = np.zeros((2, row.size))
            for place, below, above in zip(take_rows(points, row).T, low, high, strict=True):
                one, other = below - place, place - above
                least += np.square(np.maximum(np.maximum(one, other), 0.0))
                most += np.square(np.minimum(one, other))
            if row.size:  # everything in a box is nearer than its farthest corner
                begins = np.flatnonzero(np.diff(row, prepend=-1))
                at = row[begins]
                bound[at] = np.minimum(bound[at], np.minimum.reduceat(most, begins))
            return least <= bound[row] * (1 + _ROUNDING), least

        finite = np.flatnonzero(are_finite(points))
        return ((row, box) for row, box, _ in self._pairs(finite, closer))

    def _pairs(
        self, rows: Indices, chosen: Callable[[Indices, Real, Real], tuple[Mask, Real]]
    ) -> Iterator[tuple[Indices, Indices, Real]]:
        """Yield rows and boxes that `chosen` takes, and its number for them; all boxes of a row at
        once, by row.

        `chosen` is asked of rows and low and high corners, (3, n), of boxes or of what is around
        several.
        """
        top = np.arange(self._levels[-1].shape[2])
        step = max(_PAIRS // (4 * _TOP), 1)
        for start in range(0, len(rows) if top.size else 0, step):
            some = rows[start : start + step]
            left = [(len(self._levels) - 1, np.repeat(some, top.size), np.tile(top, some.size))]
            while left:
                level, row, node = left.pop()
                taken, number = chosen(row, *self._levels[level].take(node, axis=2))
                row, node, number = row[taken], node[taken], number[taken]
                if level == 0:
                    yield row, self._order[node], number
                    continue
                level -= 1
                child = (_BRANCHES * node[:, None] + np.arange(_BRANCHES)).ravel()
                there = np.flatnonzero(child < self._levels[level].shape[2])
                row, node = np.repeat(row, _BRANCHES)[there], child[there]
                cut = int(np.searchsorted(row, row[row.size // 2])) if row.size > 2 * _PAIRS else 0
                left += [(level, row[cut:], node[cut:])]
                left += [(level, row[:cut], node[:cut])] if cut else []


def _through_box(origins: Real, directions: Real, low: Real, high: Real) -> tuple[Real, Real]:
    """Return the ray parameters at which rays (n, 3) enter and leave boxes, (3, n) or (3, 1).

    A ray passes its box if it does not leave before it enters. NaN where the ray has one.
    """
    enter, leave = np.full(len(origins), -np.inf), np.full(len(origins), np.inf)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for origin, direction, below, above in zip(origins.T, directions.T, low, high, strict=True):
            one, other = (below - origin) / direction, (above - origin) / direction
            # 0 / 0 is on the border of the box: it says nothing
            np.fmax(enter, np.fmin(one, other), out=enter)
            np.fmin(leave, np.fmax(one, other), out=leave)
    lost = ~(are_finite(origins) & are_finite(directions))
    enter[lost] = leave[lost] = np.nan
    return enter, leave


def _in_order(
    pairs: tuple[Indices, Indices, Real], wanted: Callable[[Indices, Real], Mask]
) -> Iterator[tuple[Indices, Indices]]:
    """Yield rays and the boxes that they pass, those that each enters first, then more at once.

    `wanted` tells of rays, and where they enter, whether they still look for something.
    """
    ray, box, enter = pairs
    order = np.lexsort((enter, ray))
    ray, box, enter = ray[order], box[order], enter[order]
    begins = np.flatnonzero(np.diff(ray, prepend=-1))
    rank = np.arange(ray.size) - np.repeat(begins, np.diff(begins, append=ray.size))
    size = 1
    while ray.size:
        now = rank < size
        tried = now & wanted(ray, enter)
        yield ray[tried], box[tried]
        left = ~now & wanted(ray, enter)
        ray, box, enter, rank = ray[left], box[left], enter[left], rank[left]
        size *= 2


def along_curve(places: Real) -> Indices:
    """Return the order of places (n, 3) along a curve on which neighbours are near (Morton's)."""
    if not len(places):
        return np.zeros(0, dtype=np.intp)
    low = places.min(axis=0)
    extent = float((places - low).max()) or 1.0
    cells = ((places - low) / extent * ((1 << 20) - 1)).astype(np.uint64)
    code = np.zeros(len(places), dtype=np.uint64)
    for bit in range(20):
        for axis in range(3):
            code |= (cells[:, axis] >> np.uint64(bit) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return np.argsort(code, kind="stable")
