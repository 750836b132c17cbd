# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways between places and an antenna over mirrors: a chain of planes, or one curved mirror.

`ImageChain` and `CurvedMirrors` find where the ways are reflected; both return `Ways`, which say
what lies on them, what the mirrors do to the field, and how a beam widens.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np

from ...arrays import Indices, Mask, Real, crosses, distances, dots, norms, take_rows
from ...contract import ImageRecord
from ...findings import Finding, finding
from ...physics.mirrors import Reflected, co_polar, reflected_ways, reflected_widths, sent_fields
from .mirrors import FLAT, MirrorFaces, Plane
from .obstacles import Obstacles
from .specular_points import SmoothPatches, SpecularSearch

#: A point lies in the plane of a mirror if its height over the plane, divided by the length of the
#: way to it, is below this.
_LEAST_HEIGHT = 1e-6
#: Least radius of curvature for rays, over the wavelength: k a = 10.
_LEAST_RADIUS = 10 / (2 * math.pi)
#: For a surface to count as convex: how far corners may lie in front of another one, over their
#: extent, because normals of meshes are not exact; and how many are tried at most.
_BEHIND, _MOST_ASKED = 1e-3, 256
#: Width of a beam, over that behind a plane, below which the mirror focuses.
_LEAST_WIDTH = 0.5
#: Length of a cross product of unit vectors below which they are parallel.
_PARALLEL = 1e-9


@dataclass(frozen=True, eq=False)
class Ways:
    """Ways from places over m mirrors to an antenna: n of each, sorted by the number of the place.

    `stations_m` (m + 1, n, 3) are the points on the mirrors, from the place on, and the antenna.
    `normals` (m, n, 3) are unit vectors across the mirrors there, `face` (m, n) their numbers in
    `faces`. `beam_m2` is the area at the place of a beam of 1 sr from the antenna. The mesh may be
    off the smooth surface by `lift_m`, and the points by `room_m` of those that rays meet.
    """

    faces: MirrorFaces
    place: Indices
    stations_m: Real
    normals: Real
    face: Indices
    length_m: Real
    beam_m2: Real
    lift_m: Real
    room_m: Real

    @property
    def body(self) -> Indices:
        """Numbers of the bodies with the mirrors, (m, n)."""
        return np.asarray(self.faces.body[self.face])

    def take(self, kept: Indices | Mask) -> Ways:
        return Ways(
            self.faces,
            self.place[kept],
            self.stations_m[:, kept],
            self.normals[:, kept],
            self.face[:, kept],
            self.length_m[kept],
            self.beam_m2[kept],
            self.lift_m[kept],
            self.room_m[kept],
        )

    def reflected(self, polarisation: str, wavelength_m: float) -> Reflected:
        """Return the waves from the antenna at the places, in one polarisation.

        The field goes from mirror to mirror as a vector. A scatterer receives the part of it that
        has the polarisation of the run.
        """
        *points_m, from_m = self.stations_m
        fields = None
        for met_m, normals, face in zip(points_m[::-1], self.normals[::-1], self.face[::-1]):
            incoming = met_m - from_m
            incoming /= norms(incoming)[:, None]
            fields = sent_fields(incoming, polarisation) if fields is None else fields
            material = self.faces.material[face]
            for number in np.unique(material).tolist():
                mine = np.flatnonzero(material == number)
                fields[:, mine] = self.faces.materials[number].reflect(
                    fields[:, mine], incoming[mine], normals[mine], wavelength_m
                )
            onward, from_m = reflected_ways(incoming, normals), met_m
        assert fields is not None
        return co_polar(fields, onward, polarisation)

    def blocked(self, places_m: Real, obstacles: Obstacles) -> tuple[Mask, Mask]:
        """Return whether something opaque blocks each way from the places, and whether only open
        objects do, (n,) each.
        """
        blocked = np.zeros(self.place.size, dtype=bool)
        through, at_m = blocked.copy(), take_rows(places_m, self.place)
        # The mesh lies below the smooth surface where it is convex, and above it elsewhere.
        raised_m = self.stations_m.copy()
        raised_m[:-1] += 2 * self.lift_m[:, None] * self.normals
        for next_m in raised_m:
            left = np.flatnonzero(~blocked)
            opaque, on_through = obstacles.block(at_m[left], next_m[left])
            blocked[left], through[left] = opaque, through[left] | on_through
            at_m = next_m
        return blocked, through & ~blocked


# -- planes ----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class ImageChain:
    """Planes in the order from an antenna, and its images in the first, the first two...

    `places_m` (planes + 1, 3) begins with the antenna itself.
    """

    planes: tuple[Plane, ...]
    places_m: Real

    @classmethod
    def of(cls, planes: Sequence[Plane], antenna_m: Real) -> ImageChain:
        places_m = [antenna_m]
        for plane in planes:
            places_m.append(plane.image_m(places_m[-1]))
        return cls(tuple(planes), np.stack(places_m))

    @property
    def count(self) -> int:
        return len(self.planes)

    @property
    def image_m(self) -> Real:
        """Place of the last image, (3,) [m]."""
        return np.asarray(self.places_m[-1])

    @property
    def objects(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(name for plane in self.planes for name in plane.objects))

    @property
    def record(self) -> ImageRecord:
        return ImageRecord(
            [plane.normal.tolist() for plane in self.planes],
            [plane.offset_m for plane in self.planes],
            list(self.objects),
            [own[0] if len(own := plane.bodies) == 1 else 0 for plane in self.planes],
        )

    def ways(self, places_m: Real) -> Ways:
        """Return the ways from places (n, 3) that meet all planes within their faces."""
        place, at_m = np.arange(len(places_m)), places_m
        met: list[tuple[Real, Indices]] = []
        for plane, image_m in zip(self.planes[::-1], self.places_m[:0:-1], strict=True):
            way_m = image_m - at_m
            above = np.flatnonzero(plane.heights_m(at_m) > _LEAST_HEIGHT * norms(way_m))
            face, share = plane.rays.first(take_rows(at_m, above), take_rows(way_m, above))
            there = share < 1
            kept = above[there]
            met = [(one[kept], other[kept]) for one, other in met]
            at_m = take_rows(at_m, kept) + share[there, None] * take_rows(way_m, kept)
            place = place[kept]
            met.append((at_m, plane.own[face[there]]))
        points_m, face = (np.stack(column) for column in zip(*met, strict=True))
        normals = np.array([plane.normal for plane in self.planes[::-1]])[:, None]
        antenna_m = np.broadcast_to(self.places_m[0], points_m[:1].shape)
        length_m = distances(take_rows(places_m, place), self.image_m)
        none = np.zeros(place.size)
        return Ways(
            self.planes[0].faces,
            place,
            np.concatenate([points_m, antenna_m]),
            np.broadcast_to(normals, points_m.shape),
            face,
            length_m,
            length_m**2,
            none,
            none,
        )


def image_chains(
    planes: Sequence[Plane], antenna: int, antenna_m: Real, most: int, pairs: bool
) -> tuple[list[ImageChain], list[ImageChain]]:
    """Return the images of an antenna, by its number, and the images beyond the limit.

    With `pairs`, images over two planes in a row follow. The first ones are those in which the
    antenna sees most.
    """
    first = [ImageChain.of([plane], antenna_m) for plane in planes]
    if not pairs:
        return first, []
    sights_sr = [plane.sight_sr[antenna] for plane in planes]
    ranked = sorted(
        itertools.permutations(range(len(planes)), 2),
        key=lambda pair: -sights_sr[pair[0]] * sights_sr[pair[1]],
    )
    second = [
        ImageChain.of([planes[i], planes[j]], antenna_m)
        for i, j in ranked
        if planes[j].heights_m(first[i].image_m[None])[0] > 0
    ]
    free = most - len(first)
    return first + second[:free], second[free:]


# -- curved mirrors --------------------------------------------------------------------------------


class CurvedMirrors:
    """Smooth patches over curved faces, by their numbers, that mirror an antenna.

    A curved mirror has no image that all places share: `SpecularSearch` finds the points of
    reflection. Beams that it focuses are left out, because rays tell too little of them.
    """

    count = 1

    def __init__(
        self, faces: MirrorFaces, own: Indices, patches: SmoothPatches, antenna_m: Real
    ) -> None:
        self._faces, self.own, self._patches = faces, own, patches
        self._antenna_m, self._search = antenna_m, SpecularSearch(patches, antenna_m)
        self.objects = faces.objects(own)
        edges_m = patches.corners_m - np.roll(patches.corners_m, 1, axis=1)
        self._size_m = np.sqrt(np.sum(edges_m**2, axis=2)).max(axis=1)
        self._lift_m = np.abs(patches.lift_m(np.full((len(patches), 3), 1 / 3))) / 2
        #: Bodies that focus on the way to a place.
        self.focusing: set[int] = set()

    def to(self, antenna_m: Real) -> CurvedMirrors:
        """Return the mirrors for another antenna. They share the search tree."""
        other = copy(self)
        other._antenna_m, other._search = antenna_m, self._search.to(antenna_m)
        return other

    @property
    def bodies(self) -> list[int]:
        found: list[int] = np.unique(self._faces.body[self.own]).tolist()
        return found

    @property
    def see_each_other(self) -> bool:
        """Return whether waves may go from one mirror to another, or to another part of the same
        mirror.
        """
        if len(self.bodies) > 1:
            return True
        corners_m, normals = self._patches.corners_m.reshape(-1, 3), self._patches.normals[:, 0]
        room_m = _BEHIND * float(np.ptp(corners_m, axis=0).max())
        every = max(len(normals) // _MOST_ASKED, 1)
        return any(
            float((corners_m @ normal).max() - corner @ normal) > room_m
            for corner, normal in zip(corners_m[::3][::every], normals[::every], strict=True)
        )

    def rounded(self, wavelength_m: float) -> list[Finding]:
        """Find patches that lie far off their triangles."""
        names = self._faces.objects(self.own[self._lift_m > FLAT * wavelength_m])
        height_m = float(self._lift_m.max())
        return [finding("mirror-rounded", *names, height_m=height_m)] if names else []

    def ways(self, places_m: Real) -> Ways:
        """Return all ways from places (n, 3), except those with a focus."""
        found = self._search.find(places_m)
        before_m = distances(found.points_m, self._antenna_m)
        after_m = distances(found.points_m, places_m[found.place])
        incoming = (found.points_m - self._antenna_m) / before_m[:, None]
        across = crosses(incoming, found.normals)
        straight = norms(across) < _PARALLEL
        axes = np.eye(3)[np.abs(incoming[straight]).argmin(axis=1)]
        across[straight] = crosses(incoming[straight], axes)
        across /= norms(across)[:, None]
        along = crosses(found.normals, across)
        patches = self._patches.select(found.patch)
        curvature = patches.curvature(found.weights, found.normals, along, across)
        cosine = -dots(incoming, found.normals)
        widths = reflected_widths(curvature, cosine, before_m, after_m)
        wide = widths[:, 0] >= _LEAST_WIDTH * (1 + after_m / before_m)
        face = self.own[found.patch]
        self.focusing.update(np.unique(self._faces.body[face[~wide]]).tolist())
        antenna_m = np.broadcast_to(self._antenna_m, found.points_m.shape)
        return Ways(
            self._faces,
            found.place,
            np.stack([found.points_m, antenna_m]),
            found.normals[None],
            face[None],
            before_m + after_m,
            before_m**2 * np.prod(widths, axis=1),
            self._lift_m[found.patch],
            self._size_m[found.patch],
        ).take(wide)


def find_curved_mirrors(
    faces: MirrorFaces, antenna_m: Real, wavelength_m: float
) -> tuple[CurvedMirrors | None, list[Finding]]:
    """Return the curved surfaces that mirror; None if there are none."""
    curved = np.flatnonzero(faces.curved)
    own = curved[faces.material[curved] >= 0]
    normals, across_m2 = faces.normals[own], faces.across_m2[own]
    patches, error_m = SmoothPatches.of_mesh(faces.corners_m[own], normals, faces.vertex[own])
    # The larger of both principal curvatures [1/m], (|k1 + k2| + |k1 - k2|) / 2, from the sum of
    # squares and the trace: numpy's norms of so many small matrices cost a decomposition each.
    squares = np.einsum("...ij,...ij->...", patches.shape, patches.shape)
    sums = np.abs(np.einsum("...ii->...", patches.shape))
    apart = np.sqrt(np.maximum(2 * squares - sums**2, 0.0))
    bent = ((sums + apart) / 2).max(axis=1, initial=0.0)
    usable = (error_m <= FLAT * wavelength_m) & (bent * _LEAST_RADIUS * wavelength_m <= 1)
    usable &= (np.einsum("kij,kj->ki", normals, across_m2) > 0).all(axis=1)
    own, patches = own[usable], patches.select(np.flatnonzero(usable))
    mirrors = CurvedMirrors(faces, own, patches, antenna_m) if own.size else None
    # objects of which some is left out
    area_m2 = norms(faces.across_m2)
    bodies = max(faces.names, default=0) + 1
    whole_m2, own_m2 = (np.bincount(faces.body[n], area_m2[n], bodies) for n in (curved, own))
    short = {faces.names[body] for body in np.flatnonzero(whole_m2 > own_m2).tolist()}
    if not short:
        return mirrors, []
    theirs = [body for body, name in faces.names.items() if name in short]
    names = dict.fromkeys(faces.names[body] for body in theirs)
    fraction = 1 - float(own_m2[theirs].sum() / whole_m2[theirs].sum())
    return mirrors, [finding("mirror-curved", *names, fraction=fraction)]
