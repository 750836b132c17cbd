# SPDX-License-Identifier: GPL-3.0-or-later
"""Planar mirrors of a scene, the images of the transmitter in them, and paths back over them.

`find_mirrors` joins smooth flat faces that face the transmitter into planes, those in which it sees
most first. An `ImageChain` is the transmitter's image in one of them, or in two in a row. A render
with the transmitter in the place of the image gives paths over the mirrors as far as the way from
the last scatterer meets them (`ways_over`) with nothing in between (`find_blocked`); the mirrors
change power, phase and polarisation (`reflection`).

`add_reverse_paths` adds the paths that come back over mirrors, for antennas in one place. A radar
that sees a point also receives it over every mirror that lights it, and all these paths add up in
phase. Renders give the way there: direct, with the power d, and over mirror k, m_k. The reverse
path has the same power, and over mirrors on both ways it is m_k m_l / d: exact where the surface
scatters alike in all directions (Lambert), and nearly so where its lobe is much wider than the
angle between the two directions (`alike_in_both`). All these paths are of one point, so their
phases are those of their lengths and mirrors. The point that another pixel sees in the mirror is
left out: it would be the same path a second time.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from ... import contract
from ...arrays import Indices, Integers, Mask, Real, crosses, distances, dots, norms, take_rows
from ...contract import ReceiverRecord
from ...findings import Finding, finding
from ...physics.mirrors import (
    MirrorMaterial,
    Reflected,
    co_polar,
    mirror_matrix,
    reflected_ways,
    sent_fields,
)
from ...signal.motion import PathImages
from ...signal.paths import PathRows, has_curved_images, planes_of
from ...signal.scene import Surface
from ..materials import mirror_choice, surfaces_of
from .obstacles import BodyMesh, Obstacles

# -------------------------------------------------------------------------------------------------
# Both ways of a point that one pixel sees, over mirrors or not.
# -------------------------------------------------------------------------------------------------


#: Distance of the antennas over that of a scatterer up to which both ways are one.
ONE_PLACE = 0.01
#: Error of the power over mirrors on both ways that is accepted, as a fraction: 0.2 dB.
_LOBE_ERROR = 0.05


def add_reverse_paths(
    rows: PathRows,
    images: PathImages,
    receiver_m: Real,
    transmitter_m: Real,
    reflections: int,
) -> PathRows:
    """Return rows of a tile replicate with the paths that come back over mirrors.

    Those with a `point` are of one scattering at it: the direct one, and those with an image of the
    transmitter. Points without a direct path become 0. Paths of more than `reflections` are left
    out.
    """
    read = rows.copy("point", "transmitter_image", "last_body")
    point, body, to_image = read["point"], read["last_body"], read["transmitter_image"]
    direct = np.flatnonzero((point > 0) & (to_image == 0))
    over = np.flatnonzero((point > 0) & (to_image != 0))
    direct = direct[np.argsort(point[direct], kind="stable")]
    points = point[direct]
    place = np.minimum(np.searchsorted(points, point[over]), max(points.size - 1, 0))
    paired = np.zeros(over.size, dtype=bool)
    if points.size:
        paired = points[place] == point[over]
        paired &= body[direct[place]] == body[over]
    rows["point"][over[~paired]] = 0
    over, base = over[paired], direct[place[paired]]
    both = [rows]
    if reflections >= 2:
        back = rows[over]
        _come_back(back, back)
        back["transmitter_image"] = 0
        both.append(measured(back, images, receiver_m, transmitter_m))
    to_image = to_image[over]
    # numpy's own `unique` takes long for many numbers
    numbers = np.arange(to_image.min(initial=0), to_image.max(initial=0) + 1)
    for image in numbers.tolist() if reflections >= 3 else []:
        # all paths to this image, with every mirror on the way back
        first = np.flatnonzero(to_image == image)
        if not first.size:
            continue
        own = np.full(int(rows["point"].max()) + 1, -1)
        own[rows["point"][over[first]]] = over[first]
        to = own[rows["point"][over]]
        known = np.flatnonzero(to >= 0)
        back, there = rows[over[known]], rows[to[known]]
        there["power_w"] *= back["power_w"] / rows["power_w"][base[known]]
        _come_back(there, back)
        for name in ("mirror_phase_rad", "mirrors"):
            there[name] += back[name]
        there["order"] += back["mirrors"]
        kept = there["order"] <= reflections
        both.append(measured(there[kept], images, receiver_m, transmitter_m))
    alone = np.zeros(rows.size, dtype=bool)
    alone[direct] = True
    alone[base] = False
    rows["point"][alone] = 0
    return PathRows.joined(both)


def _come_back(rows: PathRows, over: PathRows) -> None:
    """Let paths come back to the receiver over the mirrors that others take to the transmitter."""
    rows["receiver_image"] = over["transmitter_image"]
    if has_curved_images(rows):
        rows["receiver_plane"] = over["transmitter_plane"]


def measured(rows: PathRows, images: PathImages, receiver_m: Real, transmitter_m: Real) -> PathRows:
    """Put lengths and directions of paths with one scattering into rows over images."""
    numbers = np.stack([rows["receiver_image"], rows["transmitter_image"]], axis=-1)
    over = images.of_paths(numbers, planes_of(rows))
    point_m = rows["last_scatterer_m"]
    length_m = distances(point_m, over.places(0, receiver_m))
    length_m += distances(point_m, over.places(1, transmitter_m))
    rows["length_m"] = length_m
    direction = over.unfolded(0, point_m) - receiver_m
    rows["direction"] = direction / norms(direction)[:, None]
    return rows


def alike_in_both(points_m: Real, antenna_m: Real, image_m: Real, lobe: Real) -> Mask:
    """Whether points scatter nearly alike towards an antenna and its image, (n,).

    `lobe` is the width alpha of the narrowest lobe of each point's surface: infinite for Lambert, 0
    where unknown. A Gaussian lobe of facets has the error exp(angle^2 / (2 alpha^2)) at most.
    """
    to_antenna, to_image = antenna_m - points_m, image_m - points_m
    cosine = dots(to_antenna, to_image) / (norms(to_antenna) * norms(to_image))
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    with np.errstate(divide="ignore"):
        return np.asarray(angle**2 / (2 * lobe**2) <= _LOBE_ERROR)


def in_view(points_m: Real, receiver: ReceiverRecord) -> Mask:
    """Whether points (n, 3) [m] lie in the directions that a receiver renders, (n,)."""
    pose = np.asarray(receiver.matrix_world, dtype=np.float64)
    x, y, z = ((points_m - pose[:3, 3]) @ pose[:3, :3]).T
    if receiver.kind == "equirectangular":
        u, v = np.arctan2(x, -z), np.arctan2(y, np.hypot(x, z))
        middle = (receiver.left + receiver.right) / 2
        u = middle + (u - middle + math.pi) % (2 * math.pi) - math.pi
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            u, v = np.where(z < 0, x / -z, np.nan), y / -z
    across = (u >= receiver.left) & (u <= receiver.right)
    return np.asarray(across & (v >= receiver.bottom) & (v <= receiver.top))


# -------------------------------------------------------------------------------------------------
# Meshes with materials that mirror, planar or curved; planes of the planar ones.
# -------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class MirroringMesh:
    """Mesh of a body with materials that mirror, in the world: k triangles.

    `body` is its number, from 1. `across_m2` (k, 3) are twice the triangles' areas along their
    normals. `smooth` (k,): with a mirror-like material; `mirrored` (k,): with one whose reflection
    is known. `choice` is the user's mark of the object.
    """

    body: int
    name: str
    mesh: BodyMesh
    pose: Real
    corners_m: Real
    across_m2: Real
    smooth: Mask
    mirrored: Mask
    slot: Integers
    slots: list[MirrorMaterial | None]
    choice: str

    def materials_of(self, triangles: Indices) -> list[MirrorMaterial]:
        found = (self.slots[own] for own in self.slot[triangles].tolist())
        return [one for one in found if one is not None]


def _mirrors(surface: Surface) -> bool:
    return surface.mirror is not None or surface.is_mirror_like


def mirroring_objects(obstacles: Obstacles) -> list[str]:
    """Return the names of the objects whose meshes `mirroring_meshes` has, each once.

    Meshes are read only where some of an object's materials mirror and others do not.
    """
    bodies = obstacles.bodies
    surfaces = surfaces_of(bodies.snapshot)
    named: dict[int, bool] = {}
    for index in np.sort(np.unique(bodies.shape, return_index=True)[1]).tolist():
        number = int(bodies.shape[index])
        shape = bodies.snapshot.shapes[number]
        smooth = np.array([_mirrors(one) for one in surfaces.of(shape.materials)], dtype=bool)
        named[number] = bool(smooth.any()) and mirror_choice(shape.original) != "never"
        if named[number] and not smooth.all():
            mesh = obstacles.mesh(index)
            slots = () if mesh is None else np.minimum(mesh.slots, smooth.size - 1)
            named[number] = mesh is not None and bool(smooth[slots].any())
        elif named[number]:
            named[number] = bodies.snapshot.face_count(shape) > 0
    shapes = bodies.snapshot.shapes
    return list(dict.fromkeys(shapes[n].original.name_full for n, yes in named.items() if yes))


def mirroring_meshes(obstacles: Obstacles) -> Iterator[MirroringMesh]:
    """Yield the meshes of all bodies with materials that mirror, and no mark against it."""
    bodies = obstacles.bodies
    shapes = bodies.snapshot.shapes
    surfaces = surfaces_of(bodies.snapshot)
    known = [surfaces.of(shape.materials) for shape in shapes]
    smooth_slots = [np.array(list(map(_mirrors, every)), dtype=bool) for every in known]
    mirroring = np.array([slots.any() for slots in smooth_slots], dtype=bool)
    for index in np.flatnonzero(mirroring[bodies.shape]).tolist():
        number = int(bodies.shape[index])
        original = bodies.originals[int(bodies.number[index])]
        choice = mirror_choice(original)
        if choice == "never":
            continue
        mesh = obstacles.mesh(index)
        if mesh is None:
            continue
        slots = [one.mirror for one in known[number]]
        slot = np.minimum(mesh.slots, len(slots) - 1)
        pose = bodies.pose[index]
        corners = mesh.vertices_m[mesh.triangles] @ pose[:3, :3].T + pose[:3, 3]
        across = crosses(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        across *= np.sign(np.linalg.det(pose[:3, :3]))
        yield MirroringMesh(
            index + 1,
            original.name_full,
            mesh,
            pose,
            corners,
            across,
            smooth_slots[number][slot],
            np.array([one is not None for one in slots])[slot],
            slot,
            slots,
            choice,
        )


#: A patch is planar where it leaves its plane by less than this fraction of the wavelength.
FLAT = 1 / 50
#: Planes that are looked for; other faces are left out and counted.
_MOST_PLANES = 64
#: Added to the solid angle of mirrors that the user wants first [sr]: more than any has.
_FIRST_SR = 1e3
#: Change of a level by turned waves above which there is a finding [dB].
TURNED_DB = 0.5
#: How far a point of a triangle may lie outside of it, over its own size: rounding.
_EDGE = 1e-9


@dataclass(frozen=True, eq=False)
class Mirror:
    """Triangles in one plane that mirror the transmitter, on the side that faces it.

    `normal` points to the transmitter's side. `triangles_m` (k, 3, 3), `body` and `material` belong
    to each triangle. `sight_sr` is the triangles' solid angle from the transmitter, times the
    reflectance of their materials at normal incidence; more for objects that the user wants first.
    """

    normal: Real
    offset_m: float
    triangles_m: Real
    body: Integers
    material: list[MirrorMaterial]
    objects: tuple[str, ...]
    sight_sr: float

    def image_m(self, point_m: Real) -> Real:
        turned, shift_m = mirror_matrix(self.normal, self.offset_m)
        return np.asarray(turned @ point_m + shift_m)

    def heights_m(self, points_m: Real) -> Real:
        """Distances of points (n, 3) from the plane, on the transmitter's side, (n,)."""
        return dots(points_m, self.normal) - self.offset_m

    @property
    def own_body(self) -> int:
        """Number of the body with the mirror, from 1; 0: several bodies share the plane."""
        return int(self.body[0]) if np.all(self.body == self.body[0]) else 0

    @property
    def is_rough(self) -> bool:
        return any(one.rms_height_m > 0 for one in self.material)

    @cached_property
    def _flat(self) -> tuple[Real, Real]:
        """Two axes in the plane (2, 3), and the triangles in them (k, 3, 2)."""
        first = np.cross(self.normal, np.eye(3)[np.argmin(np.abs(self.normal))])
        first /= np.linalg.norm(first)
        axes = np.stack([first, np.cross(self.normal, first)])
        return axes, self.triangles_m @ axes.T

    def triangle_at(self, points_m: Real) -> Indices:
        """Return the triangle that each point of the plane (n, 3) lies in, (n,); -1: none."""
        axes, triangles = self._flat
        points = points_m @ axes.T
        found = np.full(len(points), -1)
        for number, (a, b, c) in enumerate(triangles):
            area = _area(b - a, c - a)
            if area == 0:
                continue
            inside = found < 0
            low, high = np.min((a, b, c), axis=0) - _EDGE, np.max((a, b, c), axis=0) + _EDGE
            for at, least, most in zip(points.T, low, high, strict=True):
                inside &= (at >= least) & (at <= most)
            for one, other in ((a, b), (b, c), (c, a)):
                inside &= _area(other - one, points - one) / area >= -_EDGE
            found[inside] = number
        return found


def find_mirrors(
    obstacles: Obstacles, transmitter_m: Real, wavelength_m: float, most: int
) -> tuple[list[Mirror], list[Finding]]:
    """Find the planes that mirror the transmitter, at most `most`, those in which it sees most
    first.
    """
    found: list[Mirror] = []
    without: list[str] = []
    curved: list[str] = []
    parts = _faces(obstacles, transmitter_m, curved, without)
    left = np.ones(len(parts.sight_sr), dtype=bool)
    while left.any() and len(found) < max(_MOST_PLANES, most):
        first = np.argmax(np.where(left, parts.sight_sr, -1.0))
        normal = parts.normals[first]
        offset_m = float(parts.triangles_m[first].mean(axis=0) @ normal)
        away_m = np.abs(parts.triangles_m @ normal - offset_m).max(axis=1)
        here = np.flatnonzero(
            left & (away_m <= FLAT * wavelength_m) & (parts.normals @ normal > 1 - 1e-6)
        )
        left[here] = False
        left[first] = False
        found.append(
            Mirror(
                normal,
                offset_m,
                parts.triangles_m[here],
                parts.body[here],
                [parts.material[index] for index in here.tolist()],
                tuple(dict.fromkeys(parts.names[index] for index in here.tolist())),
                float(parts.sight_sr[here].sum()),
            )
        )
    found.sort(key=lambda mirror: -mirror.sight_sr)
    findings = []
    if without:
        findings.append(finding("mirror-without-image", *dict.fromkeys(without)))
    wanted = [
        one.name for one in obstacles.bodies.originals.values() if mirror_choice(one) == "first"
    ]
    if in_vain := set(wanted).difference(parts.names, curved):
        findings.append(finding("mirror-first-without-image", *sorted(in_vain)))
    beyond = found[most:]
    if beyond:
        names = dict.fromkeys(name for mirror in beyond for name in mirror.objects)
        findings.append(
            finding(
                "mirrors-left-out",
                *names,
                count=len(beyond) + int(np.count_nonzero(left)),
                most=most,
            )
        )
    return found[:most], findings


class MirrorPolarisation:
    """Power that mirrors turn into the other polarisation, and by which their two polarisations
    differ in phase, by the objects with the mirrors.
    """

    def __init__(self) -> None:
        self._sums: dict[tuple[str, ...], Real] = {}

    def add(self, objects: tuple[str, ...], power_w: Real, found: Reflected) -> None:
        """Add paths: powers as if the mirrors reflected all, and what the mirrors do."""
        sums = self._sums.setdefault(objects, np.zeros(4))
        sums += power_w.sum(), power_w @ found.turned, power_w @ found.power, power_w @ found.apart

    def phases(self) -> list[Finding]:
        """Find the mirrors whose phases for the two polarisations change lobes and nulls.

        Next to an equal direct path, an error of the phase of d changes the sum by 2 |sin(d/2)|.
        """
        apart_rad = {
            names: 2 * math.asin(math.sqrt(min(apart_w / power_w, 1.0)))
            for names, (whole_w, _, power_w, apart_w) in self._sums.items()
            if 20 * math.log10(1 + 2 * math.sqrt(apart_w / max(whole_w, math.ulp(0)))) > TURNED_DB
        }
        if not apart_rad:
            return []
        objects = dict.fromkeys(name for names in apart_rad for name in names)
        apart_deg = math.degrees(max(apart_rad.values()))
        return [finding("mirror-phases-apart", *objects, apart_deg=apart_deg)]

    def finding(self) -> list[Finding]:
        """Find the mirrors that turn enough to change the level of a target, and by how much.

        A target that keeps every polarisation sends the turned wave back to the mirror, which turns
        it again. Relative to the direct path, the amplitude of this path is at most the turned
        fraction of the power.
        """
        found = {
            names: turned_w / power_w
            for names, (power_w, turned_w, _, _) in self._sums.items()
            if 20 * math.log10(1 + turned_w / max(power_w, math.ulp(0))) > TURNED_DB
        }
        if not found:
            return []
        most = max(found.values())
        return [
            finding(
                "mirror-turns-polarisation",
                *dict.fromkeys(name for names in found for name in names),
                fraction=most,
                higher_db=20 * math.log10(1 + most),
                lower_db=-20 * math.log10(max(1 - most, 1e-3)),
            )
        ]


@dataclass(frozen=True)
class _Faces:
    """Flat faces that face the transmitter and mirror: k of each."""

    triangles_m: Real
    normals: Real
    sight_sr: Real
    body: Integers
    material: list[MirrorMaterial]
    names: list[str]


def _faces(
    obstacles: Obstacles, transmitter_m: Real, curved: list[str], without: list[str]
) -> _Faces:
    """Find the faces; add the names of objects that are curved, and whose material has no image."""
    columns = defaultdict(list)
    names: list[str] = []
    bodies: list[int] = []
    materials: list[MirrorMaterial] = []
    for one in mirroring_meshes(obstacles):
        mesh, corners, across, smooth = one.mesh, one.corners_m, one.across_m2, one.smooth
        if np.any(smooth & mesh.curved):
            curved.append(one.name)
        double_m2 = norms(across)
        away_m = transmitter_m - corners.mean(axis=1)
        facing = dots(across, away_m)
        if not mesh.closed:  # a sheet has two sides
            across, facing = across * np.sign(facing)[:, None], np.abs(facing)
        smooth = smooth & ~mesh.curved & (facing > 0) & (double_m2 > 0)
        if np.any(smooth & ~one.mirrored):
            without.append(one.name)
        kept = np.flatnonzero(smooth & one.mirrored)
        chosen = one.materials_of(kept)
        bright = np.array([_brightness(one) for one in chosen])
        columns["triangles"].append(corners[kept])
        columns["normals"].append(across[kept] / double_m2[kept, None])
        sight_sr = bright * facing[kept] / 2 / norms(away_m[kept]) ** 3
        columns["sight"].append(sight_sr + (_FIRST_SR if one.choice == "first" else 0.0))
        bodies += [one.body] * kept.size
        materials += chosen
        names += [one.name] * kept.size
    if not names:
        return _Faces(np.empty((0, 3, 3)), np.empty((0, 3)), np.empty(0), np.zeros(0, int), [], [])
    joined = {key: np.concatenate(parts) for key, parts in columns.items()}
    return _Faces(
        joined["triangles"], joined["normals"], joined["sight"], np.array(bodies), materials, names
    )


@cache
def _brightness(material: MirrorMaterial) -> float:
    """Reflectance of a mirror at normal incidence."""
    along = np.array([[0.0, 0.0, -1.0]])
    return float(material.reflection(along, -along[0], "average", math.inf)[0][0])


def _area(a: Real, b: Real) -> Real:
    """Twice the signed area between vectors in a plane, (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


# -------------------------------------------------------------------------------------------------
# Images of the transmitter over one mirror, or over two in a row, and the ways to them.
# -------------------------------------------------------------------------------------------------


#: Height over a mirror, relative to the way to it, below which a point is on its plane.
_LEAST_HEIGHT = 1e-6


@dataclass(frozen=True, eq=False)
class ImageChain:
    """Mirrors in the order from the transmitter, and its images in the first, the first two...

    `places_m` (mirrors + 1, 3) begins with the transmitter itself.
    """

    mirrors: tuple[Mirror, ...]
    places_m: Real

    @property
    def image_m(self) -> Real:
        """Place of the last image, (3,) [m]."""
        return np.asarray(self.places_m[-1])

    @property
    def objects(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(name for mirror in self.mirrors for name in mirror.objects))

    @property
    def record(self) -> contract.ImageRecord:
        return contract.ImageRecord(
            [mirror.normal.tolist() for mirror in self.mirrors],
            [mirror.offset_m for mirror in self.mirrors],
            list(self.objects),
            [mirror.own_body for mirror in self.mirrors],
        )

    def over(self, mirror: Mirror) -> ImageChain | None:
        """Return the chain with another mirror behind; None if the last image is not in front of
        it.
        """
        last_m = self.image_m
        if mirror is self.mirrors[-1] or mirror.heights_m(last_m[None])[0] <= 0:
            return None
        places_m = np.vstack([self.places_m, mirror.image_m(last_m)])
        return replace(self, mirrors=(*self.mirrors, mirror), places_m=places_m)


@dataclass(frozen=True)
class WaysOver:
    """The ways of some rows to the transmitter over a chain of mirrors.

    `rows` (n,) meet all mirrors: at `met_m`, from the scatterer on, (mirrors, n, 3), in `triangle`
    of each mirror, (mirrors, n).
    """

    rows: Indices
    met_m: Real
    triangle: Indices

    def of(self, kept: Mask) -> WaysOver:
        return WaysOver(self.rows[kept], self.met_m[:, kept], self.triangle[:, kept])


def first_images(mirrors: Sequence[Mirror], transmitter_m: Real) -> list[ImageChain]:
    return [
        ImageChain((one,), np.stack([transmitter_m, one.image_m(transmitter_m)])) for one in mirrors
    ]


def second_images(chains: Sequence[ImageChain]) -> list[ImageChain]:
    """Return the chains of two of these mirrors, those in which most is seen first."""
    pairs = [
        (one.mirrors[0].sight_sr * other.mirrors[0].sight_sr, one.over(other.mirrors[0]))
        for one in chains
        for other in chains
    ]
    ranked = sorted(pairs, key=lambda pair: -pair[0])
    return [chain for _, chain in ranked if chain is not None]


def ways_over(chain: ImageChain, points_m: Real) -> WaysOver:
    """Find where ways from points (n, 3) to the transmitter meet the mirrors of a chain."""
    rows, at_m = np.arange(len(points_m)), points_m
    met: list[Real] = []
    triangles: list[Indices] = []
    for number in range(len(chain.mirrors) - 1, -1, -1):
        mirror, image_m = chain.mirrors[number], chain.places_m[number + 1]
        way_m = image_m - at_m
        over_m, under_m = mirror.heights_m(at_m), mirror.heights_m(chain.places_m[number][None])
        above = np.flatnonzero(over_m > _LEAST_HEIGHT * norms(way_m))
        share = over_m[above] / (over_m[above] + under_m)
        place_m = take_rows(at_m, above) + share[:, None] * take_rows(way_m, above)
        triangle = mirror.triangle_at(place_m)
        there = np.flatnonzero(triangle >= 0)
        kept = above[there]
        met, triangles = [one[kept] for one in met], [one[kept] for one in triangles]
        at_m = take_rows(place_m, there)
        rows = rows[kept]
        met.append(at_m)
        triangles.append(triangle[there])
    return WaysOver(rows, np.stack(met), np.stack(triangles))


def find_blocked(
    chain: ImageChain, ways: WaysOver, points_m: Real, bodies: Indices, obstacles: Obstacles
) -> tuple[Mask, Mask]:
    """Whether something opaque, or only something open, lies on ways from points on bodies, (n,)
    each.
    """
    blocked = np.zeros(len(points_m), dtype=bool)
    through = blocked.copy()
    at_m, own = points_m, bodies
    stations = [*ways.met_m, np.broadcast_to(chain.places_m[0], points_m.shape)]
    for number, next_m in enumerate(stations):
        left = np.flatnonzero(~blocked)
        blocked[left], on_through = obstacles.block(at_m[left], next_m[left], own[left])
        through[left] |= on_through
        if number < len(chain.mirrors):
            own = chain.mirrors[-1 - number].body[ways.triangle[number]]
        at_m = next_m
    return blocked, through & ~blocked


def reflection(
    chain: ImageChain, ways: WaysOver, polarisation: str, wavelength_m: float
) -> Reflected:
    """Return the waves of a polarisation behind the mirrors, where they meet the scatterers.

    The field goes from mirror to mirror as a vector. A scatterer takes the part of it with the
    polarisation of the run.
    """
    from_m = np.broadcast_to(chain.places_m[0], (ways.rows.size, 3))
    fields, onward = np.zeros((0, ways.rows.size, 3), dtype=np.complex128), from_m
    for number, mirror in enumerate(chain.mirrors):
        met_m, triangle = ways.met_m[-1 - number], ways.triangle[-1 - number]
        incoming = met_m - from_m
        incoming = incoming / norms(incoming)[:, None]
        if number == 0:
            fields = sent_fields(incoming, polarisation)
        groups: dict[MirrorMaterial, list[int]] = {}
        for index, material in enumerate(mirror.material):
            groups.setdefault(material, []).append(index)
        for material, numbers in groups.items():
            mine = np.flatnonzero(np.isin(triangle, numbers))
            fields[:, mine] = material.reflect(
                fields[:, mine], incoming[mine], mirror.normal, wavelength_m
            )
        onward, from_m = reflected_ways(incoming, mirror.normal), met_m
    return co_polar(fields, onward, polarisation)
