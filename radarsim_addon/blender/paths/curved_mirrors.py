# SPDX-License-Identifier: GPL-3.0-or-later
"""Curved mirrors of a scene, and paths over them to scatterers that one pixel sees.

`find_curved_mirrors` lays smooth patches over the triangles of meshes that are shaded smooth. A
curved mirror has no image that all scatterers share, so nothing is rendered: `CurvedPaths` finds
the points of reflection by Newton (`physics.specular_points`). The power over the mirror is that of
the direct path times the ratio of the irradiances at a Lambert surface: spreading by geometric
optics, cosines, and the mirror's reflectance. Beams that the mirror focuses are left out: rays tell
too little of them.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass

import numpy as np

from ...arrays import Indices, Integers, Mask, Real, crosses, distances, dots, norms
from ...findings import Finding, finding
from ...physics.mirrors import MirrorMaterial, Reflected, reflected_widths
from ...physics.specular_points import SmoothPatches, SpecularPoints, SpecularSearch
from ...signal.paths import PathRows
from .hit_points import HitPoints
from .mirrors import FLAT, MirroringMesh, MirrorPolarisation, alike_in_both, mirroring_meshes
from .obstacles import Obstacles

#: Least radius of curvature for rays, over the wavelength: k a = 10.
_LEAST_RADIUS = 10 / (2 * math.pi)
#: For a surface to count as convex: how far corners may lie in front of another one, over their
#: extent, because normals of meshes are not exact; and how many are tried at most.
_BEHIND, _MOST_ASKED = 1e-3, 256
#: Width of a beam, over that behind a plane, below which the mirror focuses.
_LEAST_WIDTH = 0.5
#: Power over that of the direct path below which a path over a mirror is left out.
_LEAST_POWER = 1e-6
#: Length of a cross product of unit vectors below which they are parallel.
_PARALLEL = 1e-9


@dataclass(frozen=True, eq=False)
class CurvedMirrors:
    """Patches that mirror, of all bodies: k of each.

    `body` is the number of the body, from 1, `size_m` the longest edge of each patch, `lift_m` its
    height over the triangle, `material` its number in `materials`, `names` the objects by body.
    """

    patches: SmoothPatches
    body: Integers
    size_m: Real
    lift_m: Real
    material: Integers
    materials: tuple[MirrorMaterial, ...]
    names: dict[int, str]

    @property
    def objects(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(self.names.values()))

    @property
    def rough_objects(self) -> tuple[str, ...]:
        """Names of the objects with an RMS height."""
        rough = np.array([one.rms_height_m > 0 for one in self.materials])[self.material]
        return tuple(dict.fromkeys(self.names[n] for n in np.unique(self.body[rough]).tolist()))

    @property
    def see_each_other(self) -> bool:
        """Whether waves may go from a mirror to another one, or to another part of it."""
        if len(self.names) > 1:
            return True
        corners_m, normals = self.patches.corners_m.reshape(-1, 3), self.patches.normals[:, 0]
        room_m = _BEHIND * float(np.ptp(corners_m, axis=0).max())
        every = max(len(normals) // _MOST_ASKED, 1)
        return any(
            float((corners_m @ normal).max() - corner @ normal) > room_m
            for corner, normal in zip(corners_m[::3][::every], normals[::every], strict=True)
        )

    def rounded(self, wavelength_m: float) -> list[Finding]:
        """Find patches that lie far off their triangles."""
        far = self.lift_m > FLAT * wavelength_m
        names = dict.fromkeys(self.names[body] for body in np.unique(self.body[far]).tolist())
        height_m = float(self.lift_m.max())
        return [finding("mirror-rounded", *names, height_m=height_m)] if names else []


def find_curved_mirrors(
    obstacles: Obstacles, wavelength_m: float
) -> tuple[CurvedMirrors | None, list[Finding]]:
    """Find the curved surfaces that mirror; None without any."""
    parts: list[SmoothPatches] = []
    bodies: list[Integers] = []
    materials: list[MirrorMaterial] = []
    names: dict[int, str] = {}
    left: dict[str, Real] = {}
    for one in mirroring_meshes(obstacles):
        curved = one.smooth & one.mesh.curved
        if not curved.any():
            continue
        area_m2 = norms(one.across_m2)
        kept = np.flatnonzero(curved & one.mirrored & (area_m2 > 0))
        patches, usable = _patches(one, kept, wavelength_m)
        whole_m2, own_m2 = area_m2[curved].sum(), area_m2[kept[usable]].sum()
        left[one.name] = left.get(one.name, 0.0) + np.array([whole_m2 - own_m2, whole_m2])
        if not usable.any():
            continue
        own = one.materials_of(kept[usable])
        names[one.body] = one.name
        patches = patches.select(np.flatnonzero(usable))
        sides = [patches] if one.mesh.closed else [patches, patches.flipped()]
        parts += sides
        bodies += [np.full(len(patches), one.body)] * len(sides)
        materials += own * len(sides)
    findings = _left_out(left)
    if not parts:
        return None, findings
    every = SmoothPatches.joined(parts)
    different = tuple(dict.fromkeys(materials))
    numbers = {one: number for number, one in enumerate(different)}
    edges_m = every.corners_m - np.roll(every.corners_m, 1, axis=1)
    lift_m = np.abs(every.lift_m(np.full((len(every), 3), 1 / 3))) / 2
    mirrors = CurvedMirrors(
        every,
        np.concatenate(bodies),
        np.sqrt(np.sum(edges_m**2, axis=2)).max(axis=1),
        lift_m,
        np.array([numbers[one] for one in materials]),
        different,
        names,
    )
    return mirrors, findings


def _patches(one: MirroringMesh, kept: Integers, wavelength_m: float) -> tuple[SmoothPatches, Real]:
    """Patches over some triangles of a mesh, and which of them describe the surface well enough."""
    normals = one.mesh.corner_normals
    assert normals is not None  # some triangles are curved
    turned = normals[kept].astype(np.float64) @ np.linalg.inv(one.pose[:3, :3])
    turned /= np.linalg.norm(turned, axis=2)[:, :, None]
    patches, error_m = SmoothPatches.of_mesh(
        one.corners_m[kept], turned, one.mesh.triangles[kept].astype(np.int64)
    )
    # The larger of both principal curvatures [1/m], (|k1 + k2| + |k1 - k2|) / 2, from the sum of
    # squares and the trace: numpy's norms of so many small matrices cost a decomposition each.
    squares = np.einsum("...ij,...ij->...", patches.shape, patches.shape)
    sums = np.abs(np.einsum("...ii->...", patches.shape))
    apart = np.sqrt(np.maximum(2 * squares - sums**2, 0.0))
    bent = ((sums + apart) / 2).max(axis=1, initial=0.0)
    usable = (error_m <= FLAT * wavelength_m) & (bent * _LEAST_RADIUS * wavelength_m <= 1)
    outward = np.einsum("kij,kj->ki", turned, one.across_m2[kept]) > 0
    return patches, usable & outward.all(axis=1)


def _left_out(areas_m2: dict[str, Real]) -> list[Finding]:
    """Find the objects with areas that are left out; `areas_m2` are those and the whole, by
    name.
    """
    names = [name for name, (missing, _) in areas_m2.items() if missing > 0]
    if not names:
        return []
    missing, whole = np.sum([areas_m2[name] for name in names], axis=0)
    return [finding("mirror-curved", *names, fraction=float(missing / whole))]


@dataclass(frozen=True)
class _Ways:
    """Ways from places over mirrors to the antenna: n of each.

    `beams` is the ratio of areas of a beam, at the place and on the mirror.
    """

    found: SpecularPoints
    incoming: Real
    cosine: Real
    before_m: Real
    after_m: Real
    beams: Real


class CurvedPaths:
    """Finds paths between scatterers and an antenna over the curved mirrors of a frame.

    `hits` finds normals. `lobes` is the width of the narrowest lobe by the body's number; 0: no
    path over mirrors. The scatterers are seen from `receiver_m`, (3,) [m].
    """

    def __init__(
        self,
        mirrors: CurvedMirrors,
        obstacles: Obstacles,
        hits: HitPoints,
        lobes: Real,
        receiver_m: Real,
        antenna_m: Real,
        polarisation: str,
        wavelength_m: float,
    ) -> None:
        self.mirrors, self._obstacles = mirrors, obstacles
        self._hits, self._lobes, self._receiver_m = hits, lobes, receiver_m
        self._antenna_m, self._polarisation = antenna_m, polarisation
        self._wavelength_m = wavelength_m
        self._search = SpecularSearch(mirrors.patches, antenna_m)
        #: Bodies that focus on the way to a scatterer, and those that scatter otherwise towards a
        #: mirror.
        self.focusing: set[int] = set()
        self.narrow: set[int] = set()
        self.turned = MirrorPolarisation()

    def to(self, antenna_m: Real) -> CurvedPaths:
        """Return the paths to another antenna, with the same tree and sets of bodies."""
        other = copy(self)
        other._antenna_m, other._search = antenna_m, self._search.to(antenna_m)
        return other

    def over(self, rows: PathRows, end: int, direct_m: Real) -> tuple[PathRows, float]:
        """Return the paths via curved mirrors to the scatterers of direct paths.

        Those go straight to the place `direct_m` (3,) at an end, 0 receiver, 1 transmitter. Also
        returns the power of paths that are left out because open objects lie on the way [W].
        """
        places_m = rows["last_scatterer_m"]
        ways = self._ways(places_m)
        found = ways.found
        place = found.place
        normals = self._hits.normals(rows["last_body"], self._receiver_m, places_m)[place]
        normals[dots(normals, self._receiver_m - places_m[place]) < 0] *= -1
        onto = found.points_m - places_m[place]
        straight_m = direct_m - places_m[place]
        away_m = norms(straight_m)
        cosines = dots(normals, onto) / ways.after_m
        cosines /= dots(normals, straight_m) / away_m
        reflected = self._reflection(ways)
        bodies, power_w = self.mirrors.body[found.patch], rows["power_w"][place]
        for body in np.unique(bodies).tolist():
            mine = bodies == body
            part = Reflected(*(column[mine] for column in reflected))
            self.turned.add((self.mirrors.names[body],), power_w[mine], part)
        power, phase_rad = reflected.power.copy(), reflected.phase_rad
        power *= cosines * (away_m / ways.before_m) ** 2 / ways.beams
        seen = power > _LEAST_POWER  # NaN: not
        blocked, through = self._blocked(ways, places_m, rows["last_body"], seen)
        made = rows[place]
        made["power_w"] *= power
        made["mirror_phase_rad"] -= phase_rad  # echoes carry exp(+j w t)
        made["length_m"] += ways.before_m + ways.after_m - away_m
        made["order"] += 1
        made["mirrors"] += 1
        offset_m = dots(found.normals, found.points_m)
        name = ("receiver", "transmitter")[end]
        made[f"{name}_plane"] = np.column_stack([found.normals, offset_m])
        through_w = float(made["power_w"][seen & through].sum())
        kept = seen & ~blocked & ~through
        made, place = made[kept], place[kept]
        first = np.searchsorted(place, place)
        made[f"{name}_image"] = first - np.arange(place.size) - 1
        alike = self.alike(made, found.points_m[kept])
        self.narrow.update(np.unique(made["last_body"][~alike]).tolist())
        return made[alike], through_w

    def alike(self, rows: PathRows, points_m: Real) -> Mask:
        """Whether surfaces scatter nearly alike towards the antenna and points (n, 3), (n,)."""
        lobe = self._lobes[rows["last_body"]]
        return alike_in_both(rows["last_scatterer_m"], self._antenna_m, points_m, lobe)

    def met(self, rows: PathRows) -> tuple[Mask, Real]:
        """Return which rows come over a mirror to their last scatterer, (n,), and where their
        reflection is, (n, 3) [m].
        """
        ways = self._ways(rows["last_scatterer_m"])
        found = ways.found
        away_m = distances(found.points_m, rows["first_scatterer_m"][found.place])
        same = self.mirrors.body[found.patch] == rows["first_body"][found.place]
        same &= away_m <= self.mirrors.size_m[found.patch]
        met, points_m = np.zeros(rows.size, dtype=bool), np.full((rows.size, 3), np.nan)
        met[found.place[same]] = True
        points_m[found.place[same]] = found.points_m[same]
        return met, points_m

    def _ways(self, places_m: Real) -> _Ways:
        """Return all ways from places (n, 3), except those with a focus."""
        found = self._search.find(places_m)
        ends_m = places_m[found.place]
        before_m = distances(found.points_m, self._antenna_m)
        after_m = distances(found.points_m, ends_m)
        incoming = (found.points_m - self._antenna_m) / before_m[:, None]
        cosine = -dots(incoming, found.normals)
        across = crosses(incoming, found.normals)
        straight = norms(across) < _PARALLEL
        axes = np.eye(3)[np.abs(incoming[straight]).argmin(axis=1)]
        across[straight] = crosses(incoming[straight], axes)
        across /= norms(across)[:, None]
        along = crosses(found.normals, across)
        patches = self.mirrors.patches.select(found.patch)
        curvature = patches.curvature(found.weights, found.normals, along, across)
        widths = reflected_widths(curvature, cosine, before_m, after_m)
        wide = widths[:, 0] >= _LEAST_WIDTH * (1 + after_m / before_m)
        self.focusing.update(np.unique(self.mirrors.body[found.patch[~wide]]).tolist())
        beams = np.prod(widths, axis=1)
        kept = (one[wide] for one in (incoming, cosine, before_m, after_m, beams))
        return _Ways(found.select(wide), *kept)

    def _reflection(self, ways: _Ways) -> Reflected:
        """Waves after the mirrors, of the polarisation of the run."""
        number = self.mirrors.material[ways.found.patch]
        found = np.zeros((4, number.size))
        for material, mirror in enumerate(self.mirrors.materials):
            mine = np.flatnonzero(number == material)
            found[:, mine] = mirror.reflection(
                ways.incoming[mine],
                ways.found.normals[mine],
                self._polarisation,
                self._wavelength_m,
            )
        return Reflected(*found)

    def _blocked(
        self, ways: _Ways, places_m: Real, bodies: Indices, asked: Mask
    ) -> tuple[Mask, Mask]:
        """Whether something opaque, or only something open, lies on ways, (n,) each."""
        found = ways.found
        blocked = np.zeros(found.place.size, dtype=bool)
        through = blocked.copy()
        chosen = np.flatnonzero(asked)
        patch, place = found.patch[chosen], found.place[chosen]
        # The mesh lies below the smooth surface where it is convex, and above it elsewhere.
        raised_m = found.points_m[chosen]
        raised_m = raised_m + 2 * self.mirrors.lift_m[patch, None] * found.normals[chosen]
        ends_m = np.broadcast_to(self._antenna_m, raised_m.shape)
        for start_m, end_m, own in (
            (places_m[place], raised_m, bodies[place]),
            (raised_m, ends_m, self.mirrors.body[patch]),
        ):
            left = np.flatnonzero(~blocked[chosen])
            opaque, on_through = self._obstacles.block(start_m[left], end_m[left], own[left])
            blocked[chosen[left]] = opaque
            through[chosen[left]] |= on_through
        return blocked, through & ~blocked
