# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies (objects or instances) on which the scatterers of paths lie.

While a frame is measured, all rendered bodies have numbers. Their order is the same in each
measurement of the same scene, so that tiles of an interrupted run remain valid.

Cycles identifies the object of the first surface only. For later surfaces, and for instances, only
the position is known. Bounding boxes identify the body; where they overlap, distances from the
surfaces do. `pairs_near` first finds pairs of points and bodies that may touch, by spheres around
the boxes. Few of many instances move from frame to frame, so the search trees of the others are
kept.

`write_bodies` makes the records of the bodies of a frame's motion file; many stationary ones are in
a file of their own.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ...arrays import Indices, Mask, Real, are_finite, norms, turned
from ...contract import BodyRecord
from ...signal.motion import BodyMotions, StillBodies, body_record, write_still_bodies
from ...signal.paths import PathRows
from ...signal.scene import Meshes, SceneModel
from ...typed_json import file_sha256
from ..materials import surfaces_of
from ..scene import InstancePose, Poses, distance_from_box, instance_name
from ..state import Key, Layout

Pairs = tuple[Indices, Indices]
#: Boxes up to which each is compared with each point.
_FEW = 32
#: Part of the bodies that may have changed before the trees are made again.
_MOST_CHANGED = 0.1
#: Largest distance of a scatterer from its surface, relative to the path length. Positions from the
#: transmitter's colours are known to 1e-6 of the scene's size.
_ON_SURFACE_WITHIN = 2e-5
#: Pairs that are compared at once.
_PAIRS = 1 << 18
#: How much farther than asked for surfaces are looked for: what is as far is found for certain.
_BEYOND = 2.0
#: Stationary bodies from which on they are in a file of their own: a record of each takes longer.
MANY = 256


@dataclass(frozen=True)
class Part:
    """One object or instance."""

    #: Number and name of the object.
    number: int
    name: str
    #: Key and pose of the instance.
    key: Key
    instance: InstancePose
    #: Its row in the snapshot.
    row: int


class Bodies(SceneModel):
    """The scene as it was read, with what tells on which of its bodies a scatterer lies.

    `row` (n,) is that of each body in the `snapshot`; shapes have the snapshot's numbers.
    """

    def __init__(self, names: Sequence[str], poses: Poses, metres_per_unit: float) -> None:
        assert poses.snapshot is not None
        self.snapshot = snapshot = poses.snapshot
        numbers = {name: number for number, name in enumerate(names, start=1)}
        #: Original objects that are rendered, by number.
        self.originals: dict[int, Any] = {
            numbers[name]: item for name, item in poses.rendered.items() if name in numbers
        }
        number = poses.numbered(names)
        number[~np.isin(number, list(self.originals))] = 0
        self._order = order = _body_order(poses, number)
        self.row, shapes = poses.rows[order], snapshot.shapes
        surfaces = surfaces_of(snapshot)
        super().__init__(
            names,
            number[order],
            poses.pose[order],
            poses.box[order],
            snapshot.layout.shape[self.row],
            [tuple(surfaces.of(one.materials)) for one in shapes],
            Meshes(
                lambda number: snapshot.mesh(shapes[number]),
                lambda number: snapshot.face_count(shapes[number]),
                len(shapes),
            ),
            metres_per_unit,
        )
        #: Body of each object that is a single one, by the object's number; 0: none, or several.
        self._lone_body = np.zeros(len(names) + 1, dtype=np.int32)
        once, first, count = np.unique(self.number, return_index=True, return_counts=True)
        self._lone_body[once[count == 1]] = first[count == 1] + 1

    def __getitem__(self, index: int) -> Part:
        """Return body number `index` + 1."""
        number = int(self.number[index])
        row = int(self.row[index])
        instance = InstancePose(self.pose[index], self.box[index])
        return Part(number, self.name(number), self.snapshot.layout.key(row), instance, row)

    def __iter__(self) -> Iterator[Part]:
        return (self[index] for index in range(len(self)))

    def label(self, rows: PathRows) -> None:
        """Fill in the bodies of rows, and the objects that are unknown although the scatterer is
        known.
        """
        self._label_end(rows, "last_scatterer_m", "last_object", "last_body", slice(None))
        one = rows["order"] == 1
        some = slice(None) if one.all() else one  # columns that are copied whole take less time
        rows["first_object"][some] = rows["last_object"][some]
        rows["first_body"][some] = rows["last_body"][some]
        later = np.flatnonzero(~one)
        self._label_end(rows, "first_scatterer_m", "first_object", "first_body", later)

    def _label_end(
        self, rows: PathRows, points: str, objects: str, bodies: str, among: Indices | slice
    ) -> None:
        there = are_finite(rows[points][among])
        wanted = np.flatnonzero(there) if isinstance(among, slice) else among[there]
        numbers = rows[objects][wanted]
        body = self._lone_body[numbers]
        rows[bodies][wanted] = body
        left = np.flatnonzero(body == 0)
        wanted, numbers = wanted[left], numbers[left]
        for number in np.unique(numbers).tolist():
            mine = wanted[numbers == number]
            position = np.array(rows[points][mine])
            allowed = _ON_SURFACE_WITHIN * np.maximum(rows["length_m"][mine], 1e-9)
            parts = np.arange(len(self)) if number == 0 else self.of_number(number)
            if number and not parts.size:
                continue
            found = self._find(position, allowed, parts)
            if number:
                lost = np.flatnonzero(found < 0)
                found[lost] = [self._nearest_box(point, parts) for point in position[lost]]
            met = found >= 0
            rows[bodies][mine[met]] = found[met] + 1
            rows[objects][mine[met]] = self.number[found[met]]

    def _find(self, points: Real, allowed: Real, parts: Indices) -> Indices:
        """Return the index of the body on which each point lies; -1 if there is none."""
        found = np.full(len(points), -1)
        if not (len(points) and parts.size):
            return found
        here = slice(int(parts[0]), int(parts[-1]) + 1)  # parts follow one another
        pose, box, reach_m = self.pose[here], self.box[here], float(allowed.max())
        row, part = pairs_near(self.snapshot.layout, here, pose, box, points, reach_m)
        index = parts[part]
        inside = np.zeros(row.size, dtype=bool)
        for start in range(0, row.size, _PAIRS):
            some = slice(start, start + _PAIRS)
            outside = self._outside(points[row[some]], index[some])
            inside[some] = norms(outside) <= allowed[row[some]]
        row, index = row[inside], index[inside]
        order = np.lexsort((index, row))
        row, index = row[order], index[order]
        count = np.bincount(row, minlength=len(points))
        only = count[row] == 1
        found[row[only]] = index[only]
        least = np.array(allowed)
        at, body = row[~only], index[~only]
        for one in np.unique(body).tolist():  # of those as near as one another the last counts
            mine = at[body == one]
            distance = self._distances_m(one, points[mine], least[mine])
            nearer = distance <= least[mine]
            found[mine[nearer]], least[mine[nearer]] = one, distance[nearer]
        return found

    def _outside(self, points: Real, index: Indices) -> Real:
        """Return the vector from the box of a body to each point, in world axes, (n, 3) [m]; 0
        inside the box.
        """
        bodies, each = np.unique(index, return_inverse=True)
        pose = self.pose[bodies]
        flat = np.linalg.det(pose) == 0  # no point lies on it
        inverse = np.linalg.inv(np.where(flat[:, None, None], np.eye(4), pose))
        # component by component: einsum takes several times as long
        inwards, outwards = (
            each_pose[:, :3].transpose(1, 2, 0).take(each, axis=2) for each_pose in (inverse, pose)
        )
        local = turned(inwards[:, :3], points.T) + inwards[:, 3]
        low, high = self.box[bodies].transpose(1, 2, 0).take(each, axis=2)
        off = np.maximum(np.maximum(low - local, local - high), 0.0)
        off[:, flat[each]] = np.inf
        with np.errstate(invalid="ignore"):
            return turned(outwards[:, :3], off).T

    def _nearest_box(self, point: Real, parts: Indices) -> int:
        """Return the index of the body whose box is nearest to a point."""
        points = np.broadcast_to(point, (parts.size, 3))
        return int(parts[norms(self._outside(points, parts)).argmin()])

    def _distances_m(self, index: int, points: Real, within_m: Real) -> Real:
        """Return the distance of each point from the mesh of a body, (n,) [m].

        It is infinite beyond `within_m`, (n,), and for bodies without a mesh (curves, texts), so
        that meshes nearby have priority.
        """
        shape, instance = int(self.shape[index]), InstancePose(self.pose[index], self.box[index])
        known = self.snapshot.shapes[shape]
        mesh = self.meshes[shape] if known.original.type == "MESH" else None
        if mesh is None:
            return np.full(len(points), np.inf)
        # one product a point: those of several round otherwise
        local = distance_from_box(instance, points[:, None])[0][:, 0] / self.metres_per_unit
        metres = float(np.linalg.norm(instance.pose[:3, :3], axis=0).max()) * self.metres_per_unit
        reach = within_m * (_BEYOND / metres if metres > 0 else np.inf)
        return mesh.rays.near(local, reach)[1] * metres


class Parts:
    """Some of the bodies, (n,); a `Part` is made when it is asked for, as there may be thousands.

    `index` is that of each one in `bodies`, `number` that of its object.
    """

    def __init__(self, bodies: Bodies, index: Indices) -> None:
        self.bodies, self.index = bodies, index
        self.number = bodies.number[index]

    def __len__(self) -> int:
        return int(self.index.size)

    def __getitem__(self, at: int) -> Part:
        """Return the body at a place in this list, counted from 0."""
        return self.bodies[int(self.index[at])]

    def __iter__(self) -> Iterator[Part]:
        return (self[at] for at in range(len(self)))

    @property
    def names(self) -> list[str]:
        """Name of the object of each body."""
        return [self.bodies.name(number) for number in self.number.tolist()]


#: Order of the bodies by their layout, for the numbers of their objects.
_orders: WeakKeyDictionary[Layout, tuple[Indices, Indices]] = WeakKeyDictionary()


def _body_order(poses: Poses, number: Indices) -> Indices:
    """Return the indices of poses that have an object number, sorted by this number.

    Instances of one object are sorted by the text of their key.
    """
    assert poses.snapshot is not None
    layout = poses.snapshot.layout
    known = _orders.get(layout)
    if known is not None and np.array_equal(known[0], number):
        return known[1]
    kept = np.flatnonzero(number)
    repeated = np.bincount(number)[number[kept]] > 1
    text = np.full(kept.size, "", dtype=object)
    text[repeated] = [str(key) for key in layout.keys(poses.rows[kept[repeated]])]
    order = kept[np.lexsort((text.astype(str), number[kept]))]
    _orders[layout] = number, order
    return order


def write_bodies(
    folder: Path, parts: Parts, motions: BodyMotions, deforming: Container[str]
) -> tuple[list[BodyRecord], str, str]:
    """Return the records of the bodies, and the name and digest of the file of stationary bodies.

    Many stationary bodies go into this file instead of the records; for few of them, there is no
    file, and its name is empty. `deforming` has the names of the objects whose surfaces deform.
    """
    names, bodies = parts.names, parts.bodies
    rows, boxes = bodies.row[parts.index], bodies.box[parts.index]
    instances = _instance_names(bodies.snapshot.layout, rows)
    still = np.array([name not in deforming for name in names], dtype=bool)
    for at, motion in motions.others.items():
        if motion.moving or motion.noise_m or motion.displacement_error_bound_m:
            still[at] = False
    chosen = np.flatnonzero(still)
    file = digest = ""
    if len(chosen) < MANY:
        still[:] = False
    else:
        poses = motions.poses[chosen]
        for at, motion in motions.others.items():
            poses[chosen == at] = motion.pose
        path = write_still_bodies(
            folder,
            StillBodies(
                1 + chosen,
                poses,
                [names[at] for at in chosen.tolist()],
                instances[chosen].tolist(),
            ),
        )
        file, digest = path.name, file_sha256(path)
    records = [
        body_record(names[at], instances[at], motions[at], names[at] in deforming, boxes[at])
        for at in np.flatnonzero(~still).tolist()
    ]
    return records, file, digest


#: Names of the instances of a layout, (rows,), None where not asked for; and of its instancers.
_names: WeakKeyDictionary[Layout, tuple[list[str], NDArray[np.object_]]] = WeakKeyDictionary()


def _instance_names(layout: Layout, rows: Indices) -> NDArray[np.object_]:
    """Return the names of the instances in some rows, (n,). They are cached, because most stay the
    same from frame to frame.
    """
    owners = [item.name_full for item in layout.instancers]
    known = _names.get(layout)
    if known is None or known[0] != owners:  # someone has renamed them
        known = _names[layout] = owners, np.full(layout.shape.size, None, dtype=object)
    names = known[1]
    new = rows[names[rows] == None]  # noqa: E711
    names[new] = [instance_name(key) for key in layout.keys(new)]
    return np.asarray(names[rows])


@dataclass(frozen=True)
class _Spheres:
    """Spheres around n boxes."""

    #: Poses (n, 4, 4) and boxes (n, 2, 3) [m] that they are of.
    pose: Real
    box: Real
    #: Centres (n, 3) and radii (n,) [m].
    centre: Real
    radius: Real
    #: Indices of boxes of similar size, each with a search tree of their centres if there is one.
    groups: list[tuple[Indices, Any]]

    def changed(self, pose: Real, box: Real) -> Mask:
        """Return which of the n bodies have a pose or a box that differs from the one
        here, (n,).
        """
        differs = pose != self.pose
        # any() over 16 values each takes several times as long
        found = differs.reshape(-1, 16).view(np.uint64).any(axis=1)
        return np.asarray(found | (box != self.box).any(axis=(1, 2)))


_kept: WeakKeyDictionary[Layout, dict[tuple[int, int], _Spheres]] = WeakKeyDictionary()


def pairs_near(
    layout: Layout, bodies: slice, pose: Real, box: Real, points: Real, margin_m: float
) -> Pairs:
    """Return the pairs of a point and a body where the point is in the sphere around the body's
    box.

    `bodies` is the slice of the bodies of the layout to which `pose` (n, 4, 4) and `box` (n, 2, 3)
    belong; their spheres are cached. `points` is (k, 3) [m], and `margin_m` is added to each
    radius. Body indices count from 0. Some pairs may be farther apart.
    """
    kept = _kept.setdefault(layout, {})
    spheres = kept.get((bodies.start, bodies.stop))
    changed = np.ones(len(pose), dtype=bool)
    if spheres is not None:
        changed = spheres.changed(pose, box)
    if spheres is None or changed.sum() > max(_FEW, _MOST_CHANGED * len(pose)):
        spheres, changed = _spheres(pose, box), np.zeros(len(pose), dtype=bool)
        if len(pose) >= _FEW:
            kept[bodies.start, bodies.stop] = spheres
    found = list(_pairs_in_groups(spheres, points, margin_m))
    if changed.any():
        found = [(row[~changed[part]], part[~changed[part]]) for row, part in found]
        loose = np.flatnonzero(changed)
        now = _spheres(pose[loose], box[loose])
        found += [(row, loose[part]) for row, part in _pairs_in_groups(now, points, margin_m)]
    rows, parts = zip(*found, strict=True)
    return np.concatenate(rows), np.concatenate(parts)


def _spheres(pose: Real, box: Real) -> _Spheres:
    centre = np.einsum("nij,nj->ni", pose[:, :3, :3], box.mean(axis=1)) + pose[:, :3, 3]
    half = (box[:, 1] - box[:, 0]) / 2
    reach = np.einsum("nij,nj->ni", np.abs(pose[:, :3, :3]), half)
    radius = np.linalg.norm(reach, axis=1)
    # One tree for each power of two of the radius: boxes of similar size have few neighbours.
    size = np.ceil(np.log2(np.maximum(radius, np.finfo(np.float64).tiny)))
    groups = [np.flatnonzero(size == one) for one in np.unique(size)]
    trees = [_tree(centre[here]) if here.size >= _FEW else None for here in groups]
    # copies: whoever changes theirs would not be noticed
    return _Spheres(pose.copy(), box.copy(), centre, radius, list(zip(groups, trees, strict=True)))


def _tree(places: Real) -> Any:
    """Return a search tree of places."""
    from scipy.spatial import cKDTree  # a second of processor time: most scenes need none

    return cKDTree(places, balanced_tree=False)


def _pairs_in_groups(spheres: _Spheres, points: Real, margin_m: float) -> Iterator[Pairs]:
    """Yield the pairs of each group. Their distance is at most about the radius of the largest
    sphere of the group.
    """
    of_points = None
    for here, tree in spheres.groups:
        radius = spheres.radius[here] + margin_m
        if tree is not None:
            of_points = _tree(points) if of_points is None else of_points
            reach_m = float(radius.max())
            pairs = of_points.sparse_distance_matrix(tree, reach_m, output_type="ndarray")
            yield pairs["i"], here[pairs["j"]]
            continue
        for start in range(0, here.size, _FEW):
            some = slice(start, start + _FEW)
            apart = np.linalg.norm(points - spheres.centre[here[some], None], axis=2)
            part, row = np.nonzero(apart <= radius[some, None])
            yield row, here[part + start]
