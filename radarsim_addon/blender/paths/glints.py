# SPDX-License-Identifier: GPL-3.0-or-later
"""Bright spots and smooth faces: echoes that depend on normals, which are known without rays.

Glints: a surface of RMS slope m returns exp(-t^2 / 2 m^2), with t the tangent of the angle between
its normal and the bisector of the directions to both antennas. On a sphere of radius a this is a
spot of standard deviation m a, however small. Rays of a coarse grid miss it, and then no error
estimate includes it. `find_glints` gives areas of the view and the pitch that resolves them, for
tiles of their own. `BrightParts` finds the triangles whose normals come near the bisector, halves
those that are large in the view, and takes the slope as linear over each part, so that its spot is
Gaussian.

Smooth faces: the lobe of a slope stands for heights of many wavelengths. A face of less than an
eighth of a wavelength reflects as a whole: its echo depends on area, curvature and wavelength, and
not on the slope of its polish. `SmoothFaces` finds those near normal incidence, and compares the
level of physical optics with the received power. Does not import bpy.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import Self

import numpy as np

from ... import contract
from ...arrays import Indices, Mask, Real, crosses, dots, norms
from ...findings import Finding, finding, finding_about
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ...physics.rcs import specular_face
from ...physics.rough import least_rms_height_m
from ...signal.scene import Surface, triangle_distances
from ...signal.tracing import GRAZING, BodyMesh, Obstacles, bisectors
from ..views import ViewWindow
from .tiles import Area

#: Reach of a lobe, in RMS slopes from the specular one: exp(-18).
_REACH = 6.0
#: Pitch of the grid over a spot's standard deviation: the power of a Gaussian spot is then right to
#: 1e-5. A grid of `_RESOLVED` is right to 3 %, and its replicates show the error.
_PITCH, _RESOLVED = 1.25, 2.0
#: Parts with less than this weight in the lobe, over that of the brightest, need no resolution.
_FAINT = 0.1
#: Bright flat facets are a glint if they cover less than this part of the object's box in the view.
_PART = 0.3
#: Pixels of a part of a surface above which it is halved; most halvings; most parts of surfaces.
_LARGE_PX, _HALVINGS, _MOST_PARTS = 4096.0, 16, 1 << 18
#: Halvings of parts that reach behind the receiver.
_AHEAD = 6
#: Parts are one area if that has at most so many times the parts' area, or so few pixels.
_LOOSE, _FEW_PX = 4.0, 1024.0
#: Glints that get tiles, and pixels of all of them (or of the frame, if it has more).
MOST_GLINTS, _PIXELS_FOR_ALL = 64, 1 << 18
#: Triangles of all bodies that are searched, largest bodies first; triangles at a time; triangles
#: that take as long as a shape.
_MOST_SEARCHED, _AT_ONCE, _PER_SHAPE = 1 << 24, 1 << 20, 1 << 13
#: Bodies that are searched, those that look largest: each takes 0.1 to 0.3 ms.
_MOST_LARGE = 2048
#: Bodies with bright spots that are looked at one by one, the brightest first.
_MOST_BODIES = 256
#: Pixels across of bright flat facets that the frame resolves.
_LARGE_FACETS = 16.0


@dataclass(frozen=True)
class Glint:
    """Areas of a glint in the view, the pitch that resolves it, its object, its echo up to a
    factor.
    """

    areas: tuple[Area, ...]
    pitch: float
    name: str
    echo: float

    @property
    def pixels(self) -> float:
        """Number of pixels of this pitch in the areas."""
        return sum((a.right - a.left) * a.stretch * (a.top - a.bottom) for a in self.areas) / (
            self.pitch**2
        )


def find_glints(
    obstacles: Obstacles,
    receiver: contract.ReceiverRecord,
    transmitters_m: Real,
    window: ViewWindow,
    hidden: Collection[int],
) -> tuple[list[Glint], list[Finding]]:
    """Find the glints that the pixels of a view do not resolve, strongest first.

    `transmitters_m` (n, 3) are the transmitter and its images in mirrors, `hidden` the numbers of
    objects that no ray meets. Returns at most `MOST_GLINTS`.
    """
    bodies = obstacles.model
    slopes = [np.array([one.glint_slope for one in every]) for every in bodies.surfaces]
    shiny = np.array([bool(np.any(own > 0)) for own in slopes], dtype=bool)
    chosen = np.flatnonzero(shiny[bodies.shape] & ~np.isin(bodies.number, sorted(hidden)))
    if not chosen.size:
        return [], []
    search = BrightParts(obstacles, receiver, window, slopes)
    chosen, skipped = search.affordable(search.in_view(chosen))
    found: list[Glint] = []
    for place_m in transmitters_m:
        own, others = search.glints(chosen, place_m)
        found += own
        skipped = np.union1d(skipped, others)
    room = float(max(_PIXELS_FOR_ALL, window.width_px * window.height_px))
    kept: list[Glint] = []
    left = [bodies.name(number) for number in bodies.number[skipped].tolist()]
    for one in sorted(found, key=lambda one: -one.echo):
        if len(kept) < MOST_GLINTS and one.pixels <= room:
            kept.append(one)
            room -= one.pixels
        else:
            left.append(one.name)
    if not left:
        return kept, []
    names = dict.fromkeys(left)
    return kept, [finding("glints-left-out", *names, count=len(left), traced=len(kept))]


@dataclass(frozen=True, eq=False)
class _Columns:
    """Columns of n rows each."""

    def take(self, chosen: Indices | Mask) -> Self:
        return type(self)(*(getattr(self, one.name)[chosen] for one in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))


@dataclass(frozen=True, eq=False)
class SurfaceParts(_Columns):
    """Triangles in the world: corners [m] and unit normals there, (n, 3, 3), RMS slope, index of
    the body, and whether the normals are those of a flat facet.
    """

    corners_m: Real
    normals: Real
    slope: Real
    body: Indices
    flat: Mask

    def halved(self, first: Indices) -> SurfaceParts:
        """Cut each triangle in two, at the middle of its side from corner `first` to the next
        corner.
        """
        order = (first[:, None] + np.arange(3)) % 3
        halves = []
        for column in (self.corners_m, self.normals):
            a, b, c = np.moveaxis(column[np.arange(len(order))[:, None], order], 1, 0)
            middle = (a + b) / 2
            corners = [(a, middle, c), (middle, b, c)]
            halves.append(np.concatenate([np.stack(one, axis=1) for one in corners]))
        others = (np.concatenate([one, one]) for one in (self.slope, self.body, self.flat))
        return SurfaceParts(*halves, *others)


@dataclass(frozen=True, eq=False)
class _Spots(_Columns):
    """Bright parts as the view shows them, in true lengths.

    `low` and `high` (n, 2) bound them, in true lengths over `stretch`; `deviation` is the least
    standard deviation of the spot on each, `weight` that of its brightest point in the lobe, `echo`
    its echo up to a factor; `centre` (n, 2), `spread` (n, 2, 2) and `solid` are mean, covariance
    and area of the part.
    """

    body: Indices
    flat: Mask
    low: Real
    high: Real
    stretch: Real
    deviation: Real
    weight: Real
    echo: Real
    centre: Real
    spread: Real
    solid: Real


class BrightParts:
    """Finds the bright parts of surfaces; `slopes` are the RMS slopes of each shape's materials."""

    def __init__(
        self,
        obstacles: Obstacles,
        receiver: contract.ReceiverRecord,
        window: ViewWindow,
        slopes: Sequence[Real],
    ) -> None:
        self._obstacles, self._bodies = obstacles, obstacles.model
        self._kind, self._window, self._slopes = receiver.kind, window, slopes
        pose = np.array(receiver.matrix_world, dtype=np.float64)
        self._turn, self._place_m = pose[:3, :3], pose[:3, 3]
        turn, box = self._bodies.pose[:, :3, :3], self._bodies.box
        self._middle_m = np.einsum("nij,nj->ni", turn, box.mean(axis=1))
        self._middle_m += self._bodies.pose[:, :3, 3]
        reach_m = np.abs(turn) @ ((box[:, 1] - box[:, 0]) / 2)[:, :, None]
        self._radius_m = norms(reach_m[:, :, 0])

    def in_view(self, chosen: Indices) -> Indices:
        """Return which of these bodies may be in the view."""
        if self._kind != "perspective":
            return chosen
        window = self._window
        edge = max(
            math.hypot(u, v)
            for u in (window.left, window.right)
            for v in (window.bottom, window.top)
        )
        local = (self._middle_m[chosen] - self._place_m) @ self._turn
        away_m = np.maximum(norms(local), 1e-300)
        angle = np.arccos(np.clip(-local[:, 2] / away_m, -1.0, 1.0))
        sine = self._radius_m[chosen] / away_m
        near = np.where(sine < 1, np.arcsin(np.minimum(sine, 1.0)), math.pi)
        return np.asarray(chosen[angle - near <= math.atan(edge)])

    def affordable(self, chosen: Indices, most: int = _MOST_LARGE) -> tuple[Indices, Indices]:
        """Return the bodies to search, which are those that look largest, and the bodies that are
        left out.
        """
        meshes = self._bodies.meshes
        faces = np.array([max(meshes.face_count(number), 1) for number in range(len(meshes))])
        away_m = norms(self._middle_m[chosen] - self._place_m)
        order = chosen[np.argsort(away_m / np.maximum(self._radius_m[chosen], 1e-300))]
        shape = self._bodies.shape[order]
        cost = faces[shape]
        cost[np.unique(shape, return_index=True)[1]] += _PER_SHAPE
        enough = int(np.searchsorted(np.cumsum(cost), _MOST_SEARCHED)) + 1
        enough = min(enough, most)
        return np.sort(order[:enough]), order[enough:]

    def glints(self, chosen: Indices, transmitter_m: Real) -> tuple[list[Glint], Indices]:
        """Return the glints of one transmitter that the view does not resolve, and the bodies that
        were left out because there are too many.
        """
        found: list[_Spots] = []
        for shape in np.unique(self._bodies.shape[chosen]).tolist():
            own = chosen[self._bodies.shape[chosen] == shape]
            for parts in self.candidates(shape, own, transmitter_m):
                found += [self._unresolved(one) for one in self._spots(parts, transmitter_m)]
        spots = _Spots.joined(found) if found else None
        if spots is None or not spots.body.size:
            return [], chosen[:0]
        bodies, place = np.unique(spots.body, return_inverse=True)
        order = np.argsort(-np.bincount(place, spots.echo), kind="stable")
        spots = spots.take(np.isin(spots.body, bodies[order[:_MOST_BODIES]]))
        glints = [
            glint
            for body in bodies[order[:_MOST_BODIES]].tolist()
            for group in _groups(spots.take(spots.body == body))
            for glint in self._glint(group)
        ]
        return glints, bodies[order[_MOST_BODIES:]]

    def _unresolved(self, spots: _Spots) -> _Spots:
        """Return the spots of all bodies that have at least one spot that may be a glint."""
        fine = self._window.pitch <= _RESOLVED * spots.deviation
        bodies, place = np.unique(spots.body, return_inverse=True)
        area = np.bincount(place, spots.solid, bodies.size)
        large = area > (_LARGE_FACETS * self._window.pitch) ** 2
        glints = ~fine | (spots.flat & ~large[place])
        return spots.take(np.bincount(place, glints, bodies.size)[place] > 0)

    def _glint(self, group: _Spots) -> list[Glint]:
        """Return the glint that neighbouring spots of one body form; an empty list if the view
        resolves it.
        """
        window = self._window
        # A thin triangle among others is as bright, but has no power to resolve.
        matters = group.weight >= _FAINT * group.weight.max()
        matters &= group.echo >= _FAINT * group.echo.max()
        deviation, pitch = float(group.deviation[matters].min()), _PITCH
        if group.flat[matters].all() and group.solid.sum() < _PART * self._box(group.body[0]):
            share = group.solid / group.solid.sum()
            off = group.centre - share @ group.centre
            spread = np.einsum("n,nij->ij", share, group.spread)
            spread += np.einsum("n,ni,nj->ij", share, off, off)
            across = float(_least_deviation(spread[None])[0])
            if across < deviation:  # edges of facets need more pixels than a smooth spot
                deviation, pitch = across, _PITCH / 2
        if window.pitch <= _RESOLVED * deviation:
            return []
        (left, bottom), (right, top) = group.low.min(axis=0), group.high.max(axis=0)
        stretch = float(group.stretch.max())
        areas = []
        for turn in (-2 * math.pi, 0.0, 2 * math.pi) if window.sphere else (0.0,):
            low, high = max(left + turn, window.left), min(right + turn, window.right)
            if low < high:
                areas.append(
                    Area(low, high, max(bottom, window.bottom), min(top, window.top), stretch)
                )
        name = self._bodies.name(int(self._bodies.number[group.body[0]]))
        return [Glint(tuple(areas), pitch * deviation, name, float(group.echo.sum()))]

    def area_m2(self, body: int) -> float:
        """Return the area of a body's surface [m^2]; the scale is taken to be the same along all
        axes.
        """
        mesh = self._obstacles.mesh(body)
        scale = abs(float(np.linalg.det(self._bodies.pose[body, :3, :3]))) ** (2 / 3)
        return 0.0 if mesh is None else scale * float(np.nansum(mesh.areas_m2))

    def _box(self, body: int) -> float:
        """Return the area of a body's box in the view; infinite if a part of it is behind the
        receiver.
        """
        pose, box = self._bodies.pose[body], self._bodies.box[body]
        corners = np.array(list(itertools.product(*box.T))) @ pose[:3, :3].T + pose[:3, 3]
        places, ahead = self.project(corners[None])
        if not ahead.all():
            return math.inf
        stretch = math.cos(places[0, :, 1].mean()) if self._window.sphere else 1.0
        return float(stretch * np.prod(np.ptp(places[0], axis=0)))

    # -- surfaces ----------------------------------------------------------------------------------

    def candidates(self, shape: int, own: Indices, transmitter_m: Real) -> Iterator[SurfaceParts]:
        """Yield the triangles that may be bright, of bodies that share one mesh."""
        mesh = self._obstacles.mesh(int(own[0]))
        if mesh is None:
            return
        slopes = self._slopes[shape]
        slope = slopes[np.minimum(mesh.slots, slopes.size - 1)]
        faces = np.flatnonzero((slope > 0) & (mesh.areas_m2 > 0))
        if not faces.size:
            return
        normals = mesh.normals[faces]
        spread = np.arctan(_REACH * slope[faces])
        if mesh.corner_normals is not None:
            turned = np.einsum("tci,ti->tc", mesh.corner_normals[faces], normals).min(axis=1)
            spread += np.arccos(np.clip(turned, -1.0, 1.0))
        inverse = np.linalg.pinv(self._bodies.pose[own, :3, :3])
        square = inverse @ inverse.transpose(0, 2, 1)
        scale = np.trace(square, axis1=1, axis2=2) / 3
        uneven = np.abs(square - scale[:, None, None] * np.eye(3)).max(axis=(1, 2)) > 1e-4 * scale
        receiver_m = self._receiver_m(self._middle_m[own])
        bisector, turns = bisectors(
            self._middle_m[own], self._radius_m[own], receiver_m, transmitter_m
        )
        turns[uneven] = math.pi  # normals do not turn with the body
        local = np.einsum("nij,nj->ni", inverse, bisector) / np.sqrt(scale)[:, None]
        limit = np.cos(np.minimum(float(spread.max()) + turns, math.pi))
        step = max(_AT_ONCE // faces.size, 1)
        for start in range(0, own.size, step):
            some = slice(start, start + step)
            cosine = local[some] @ normals.T
            if not mesh.closed:
                np.abs(cosine, out=cosine)
            body, face = np.nonzero(cosine >= limit[some, None])
            angle = np.arccos(np.clip(cosine[body, face], -1.0, 1.0))
            near = angle <= spread[face] + turns[some][body]
            body, face = start + body[near], faces[face[near]]
            if body.size:
                yield self._in_world(mesh, face, own[body], inverse[body], slope[face])

    def _in_world(
        self, mesh: BodyMesh, face: Indices, body: Indices, inverse: Real, slope: Real
    ) -> SurfaceParts:
        pose = self._bodies.pose[body]
        corners_m = mesh.vertices_m[mesh.triangles[face]] @ pose[:, :3, :3].transpose(0, 2, 1)
        corners_m += pose[:, None, :3, 3]
        flat = ~mesh.curved[face]
        facet = np.repeat(mesh.normals[face][:, None], 3, axis=1)
        normals = facet
        if mesh.corner_normals is not None:
            corner = mesh.corner_normals[face]
            missing = ~corner.any(axis=2)  # next to faces without an area
            normals = np.where((flat[:, None] | missing)[..., None], facet, corner)
        normals, facet = normals @ inverse, facet[:, 0]
        if not mesh.closed:  # a sheet has two sides
            middle_m = corners_m.mean(axis=1)
            towards = self._receiver_m(middle_m) - middle_m
            facet = np.einsum("ni,nij->nj", facet, inverse)
            normals = normals * np.where(dots(facet, towards) < 0, -1.0, 1.0)[:, None, None]
        normals = normals / np.linalg.norm(normals, axis=2)[:, :, None]
        return SurfaceParts(corners_m, normals, slope, body, flat)

    # -- the view ----------------------------------------------------------------------------------

    def _receiver_m(self, points_m: Real) -> Real:
        """Return the place to which the wave from each point goes, (..., 3) [m]."""
        if self._kind == "orthographic":  # a distance that stands for infinity [m]
            return np.asarray(points_m + 1e9 * self._turn[:, 2])
        return np.broadcast_to(self._place_m, points_m.shape)

    def project(self, points_m: Real) -> tuple[Real, Mask]:
        """Return the coordinates in the view of points (n, k, 3), (n, k, 2), and whether each point
        is in front of the receiver.
        """
        local = (points_m - self._place_m) @ self._turn
        across, up, depth = local[..., 0], local[..., 1], -local[..., 2]
        if self._kind == "equirectangular":
            angle = np.arctan2(across, depth)
            angle -= 2 * math.pi * np.rint((angle - angle[:, :1]) / (2 * math.pi))
            latitude = np.arctan2(up, np.hypot(across, depth))
            return np.stack([angle, latitude], axis=2), np.ones(depth.shape, dtype=bool)
        ahead = depth > 0
        if self._kind == "perspective":
            safe = np.where(ahead, depth, 1.0)
            across, up = across / safe, up / safe
        return np.stack([across, up], axis=2), ahead

    def _spots(self, parts: SurfaceParts, transmitter_m: Real) -> list[_Spots]:
        """Return the bright spots of triangles. Large triangles are halved until few pixels are
        left.
        """
        found = []
        for halving in range(_HALVINGS + 1):
            slopes, facing = self.slopes_of(parts, transmitter_m)
            parts, slopes = parts.take(facing), slopes[facing]
            least = triangle_distances(*np.moveaxis(slopes, 1, 0))
            bright = least <= _REACH * parts.slope
            parts = parts.take(bright)
            places, ahead = self.project(parts.corners_m)
            kept = ahead.any(axis=1)
            parts, places, ahead = parts.take(kept), places[kept], ahead[kept].all(axis=1)
            slopes, least = slopes[bright][kept], least[bright][kept]
            spots, longest = self._seen(parts, places, slopes, least, transmitter_m)
            met = ~ahead | self.meets(spots.low, spots.high)
            met &= spots.deviation > 0  # triangles without a width, and edge on
            across = (spots.high - spots.low) * np.stack([spots.stretch, np.ones(met.size)], axis=1)
            deviation = np.where(met, spots.deviation, np.inf)
            pixels = np.prod(across, axis=1) / (_PITCH * deviation) ** 2
            large = (pixels > _LARGE_PX) & (self._window.pitch > _RESOLVED * spots.deviation)
            large = met & (large | (~ahead & (halving < _AHEAD)))
            if halving == _HALVINGS or met.size > _MOST_PARTS:
                large[:] = False
            found.append(spots.take(met & ahead & ~large))
            if not large.any():
                break
            parts = parts.take(large).halved(longest[large])
        return found

    def meets(self, low: Real, high: Real) -> Mask:
        """Return whether boxes overlap the view, (n,). Their corners are (n, 2)."""
        window = self._window
        met = np.zeros(len(low), dtype=bool)
        for turn in (-2 * math.pi, 0.0, 2 * math.pi) if window.sphere else (0.0,):
            met |= (high[:, 0] + turn > window.left) & (low[:, 0] + turn < window.right)
        return met & (high[:, 1] > window.bottom) & (low[:, 1] < window.top)

    def slopes_of(self, parts: SurfaceParts, transmitter_m: Real) -> tuple[Real, Mask]:
        """Return the slopes of the bisector at the corners, (n, 3, 3), and whether each part faces
        both antennas.
        """
        bisector = np.zeros_like(parts.corners_m)
        facing = np.ones(parts.body.size, dtype=bool)
        for antenna_m in (self._receiver_m(parts.corners_m), transmitter_m):
            way = antenna_m - parts.corners_m
            way = way / np.linalg.norm(way, axis=2)[:, :, None]
            cosine = np.einsum("nci,nci->nc", way, parts.normals)
            facing &= cosine.max(axis=1, initial=-1.0) > GRAZING
            bisector += way
        along = np.einsum("nci,nci->nc", bisector, parts.normals)
        return bisector / np.maximum(along, GRAZING)[:, :, None] - parts.normals, facing

    def _seen(
        self, parts: SurfaceParts, places: Real, slopes: Real, least: Real, transmitter_m: Real
    ) -> tuple[_Spots, Indices]:
        """Return the spots of bright parts in the view, and the corner at which the longest side of
        each part begins.
        """
        stretch = np.ones(len(places))
        if self._window.sphere:
            stretch = np.maximum(np.cos(places[:, :, 1]).max(axis=1), 1e-6)
        true = places * np.stack([stretch, np.ones_like(stretch)], axis=1)[:, None]
        sides, turned = true[:, 1:] - true[:, :1], slopes[:, 1:] - slopes[:, :1]
        # slopes are linear over a part, so the spot is Gaussian: its covariance in the view
        square = np.einsum("nai,nbi->nab", turned, turned)
        room = 1e-9 * np.trace(square, axis1=1, axis2=2) + 1e-12 * parts.slope**2
        inverse = np.linalg.inv(square + room[:, None, None] * np.eye(2))
        spread = sides.transpose(0, 2, 1) @ (inverse @ sides)
        spread *= (parts.slope**2)[:, None, None]
        relative = least / parts.slope
        half = np.sqrt(np.maximum(_REACH**2 - relative**2, 0.0))[:, None]
        half = half * np.sqrt(np.diagonal(spread, axis1=1, axis2=2))
        # where the slope vanishes on the plane of the part
        weights = -(inverse @ (turned @ slopes[:, 0, :, None]))[:, :, 0]
        middle = true[:, 0] + np.einsum("na,nai->ni", weights, sides)
        lowest, highest = true.min(axis=1), true.max(axis=1)
        low = np.clip(middle - half, lowest, highest)
        high = np.clip(middle + half, lowest, highest)
        low[:, 0] /= stretch
        high[:, 0] /= stretch
        solid = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]) / 2
        spot = 2 * math.pi * np.sqrt(np.maximum(np.linalg.det(spread), 0.0))
        weight = np.exp(-(relative**2) / 2)
        away_m = norms(parts.corners_m.mean(axis=1) - transmitter_m)
        echo = weight * np.minimum(solid, spot) / (2 * parts.slope**2 * away_m**2)
        centre = true.mean(axis=1)
        around = true - centre[:, None]
        own_spread = np.einsum("nci,ncj->nij", around, around) / 12
        long = np.linalg.norm(np.roll(true, -1, axis=1) - true, axis=2).argmax(axis=1)
        return _Spots(
            parts.body, parts.flat, low, high, stretch, _least_deviation(spread), weight, echo,
            centre, own_spread, weight * solid,
        ), long  # fmt: skip


def _least_deviation(spread: Real) -> Real:
    """Return the standard deviation along the narrowest direction of covariances (n, 2,
    2), (n,).
    """
    half = np.trace(spread, axis1=1, axis2=2) / 2
    across = (spread[:, 0, 0] - spread[:, 1, 1]) / 2
    least = half - np.hypot(across, spread[:, 0, 1])
    # half - root loses its digits where the spot is long: the determinant keeps them
    determinant = spread[:, 0, 0] * spread[:, 1, 1] - spread[:, 0, 1] ** 2
    larger = np.maximum(half + np.hypot(across, spread[:, 0, 1]), 1e-300)
    return np.asarray(
        np.sqrt(np.maximum(np.where(determinant > 0, determinant / larger, least), 0.0))
    )


def _groups(spots: _Spots) -> Iterator[_Spots]:
    """Yield groups of neighbouring spots. The spots of a group fill their common box well, or the
    box has few pixels.
    """
    low, high = spots.low.min(axis=0), spots.high.max(axis=0)
    whole, own = np.prod(high - low), np.prod(spots.high - spots.low, axis=1).sum()
    few = _FEW_PX * (_PITCH * spots.deviation.min()) ** 2
    wider = int(np.argmax(high - low))
    first = (spots.low + spots.high)[:, wider] <= (low + high)[wider]
    if whole <= max(_LOOSE * own, few) or first.all() or not first.any():
        yield spots
        return
    yield from _groups(spots.take(first))
    yield from _groups(spots.take(~first))


# -------------------------------------------------------------------------------------------------
# Smooth faces near normal incidence: the level that physical optics gives them.
# -------------------------------------------------------------------------------------------------


#: RMS height over the wavelength from which on a surface is rough, less the rounding of a float32
#: Roughness.
_ROUGH = 0.125 * (1 - 1e-4)
#: RMS slopes from normal incidence within which a face returns most of its echo.
_NEAR = 2.0
#: Difference from the measured level of a curved face that is worth a caution [dB].
_DIFFERS_DB = 1.0
#: Objects that are looked at, the largest first.
_MOST_OBJECTS = 256
#: Normals and heights over the size of the body up to which triangles are in one plane.
_ALIKE, _LEVEL = 1e-4, 1e-5
#: Wavelengths across a face from which on physical optics describes it, and part of the area of its
#: body that a plane face has at least: those of a mesh that stands for a curved body are smaller.
_LEAST_ACROSS, _LEAST_PART = 1.0, 0.03
#: Slope over the RMS slope up to which a part of a curved surface holds the specular point.
_SPECULAR = 1e-3
#: Steps along the sides of parts at which the nearest point is looked for, if there are few parts.
_STEPS, _FEW = 8, 2000


@dataclass(frozen=True)
class _Face:
    """A face near normal incidence: index of its body, RMS slope, cross section of a conductor,
    full width of the beam of its echo, angle from its normal, a place on it, and whether the
    radar is within the beam. The beam of a curved face is pi.
    """

    body: int
    slope: float
    rcs_m2: float
    beam_rad: float
    aspect_rad: float
    place_m: Real
    in_beam: bool = True


class SmoothFaces:
    """The largest smooth face of each object in a view, found while the bodies are evaluated.

    Only objects of a single body: instances have one power for all of them.
    """

    def __init__(
        self,
        obstacles: Obstacles,
        receiver: contract.ReceiverRecord,
        transmitter: contract.TransmitterRecord,
        window: ViewWindow,
        carrier_hz: float,
    ) -> None:
        self._wavelength_m = wavelength_m = SPEED_OF_LIGHT_MPS / carrier_hz
        self._eirp_w = transmitter.eirp_w
        poses = (np.array(one.matrix_world, dtype=np.float64) for one in (transmitter, receiver))
        self._antennas_m = [pose[:3, 3] for pose in poses]
        #: By the object's number: cross section [m^2], face, and what `_height_m` says.
        self._faces: dict[int, tuple[float, _Face, float, bool]] = {}
        if receiver.kind == "orthographic":  # its powers tell no cross section
            return
        bodies = obstacles.model

        @cache
        def slope(one: Surface) -> float:
            smooth = _height_m(one, wavelength_m)[0] < _ROUGH * wavelength_m
            return one.glint_slope if smooth and one.reflectance > 0 else 0.0

        slopes = [np.array(list(map(slope, every))) for every in bodies.surfaces]
        shiny = np.array([bool(np.any(own > 0)) for own in slopes], dtype=bool)[bodies.shape]
        chosen = np.flatnonzero(shiny & (np.bincount(bodies.number)[bodies.number] == 1))
        if not chosen.size:
            return
        search = BrightParts(obstacles, receiver, window, slopes)
        chosen, _ = search.affordable(search.in_view(chosen), _MOST_OBJECTS)
        for shape in np.unique(bodies.shape[chosen]).tolist():
            own = chosen[bodies.shape[chosen] == shape]
            by_slope = dict(zip(slopes[shape].tolist(), bodies.surfaces[shape], strict=True))
            for parts in search.candidates(shape, own, self._antennas_m[0]):
                for face in _faces(search, parts, self._antennas_m, wavelength_m):
                    number, surface = int(bodies.number[face.body]), by_slope[face.slope]
                    rcs_m2 = face.rcs_m2 * surface.reflectance
                    if rcs_m2 > self._faces.get(number, (0.0,))[0]:
                        self._faces[number] = rcs_m2, face, *_height_m(surface, wavelength_m)

    def findings(self, power_w: Mapping[str, float], names: Sequence[str]) -> list[Finding]:
        """Compare the levels of the faces with the received power of objects, by name. Object n has
        the name `names[n - 1]`.
        """
        levels: dict[str, dict[str, float]] = {}
        unknown: dict[str, dict[str, float]] = {}
        for number, (rcs_m2, face, height_m, known) in self._faces.items():
            name = names[number - 1]
            if not power_w.get(name, 0.0) > 0:
                continue
            ways_m2 = math.prod(float(np.sum((face.place_m - m) ** 2)) for m in self._antennas_m)
            scale = (4 * math.pi) ** 3 * ways_m2 / (self._eirp_w * self._wavelength_m**2)
            expected_dbsm, measured_dbsm = (
                10 * math.log10(one) for one in (rcs_m2, power_w[name] * scale)
            )
            curved = face.beam_rad == math.pi
            # Right for curved faces, all of whose lobe returns: the optical limit. A plane is right
            # by chance, but if its height is unknown it does not matter which level it has.
            if (curved or (face.in_beam and not known)) and (
                abs(expected_dbsm - measured_dbsm) < _DIFFERS_DB
            ):
                continue
            (levels if known else unknown)[name] = {
                "height_m": height_m,
                "eighth_m": self._wavelength_m / 8,
                "aspect_deg": math.degrees(face.aspect_rad),
                "beam_deg": math.degrees(face.beam_rad),
                "measured_dbsm": measured_dbsm,
                "expected_dbsm": expected_dbsm,
            }
        findings = []
        if levels:
            findings.append(finding_about("smooth-face-level", levels))
        if unknown:
            findings.append(finding_about("face-height-unknown", unknown))
        return findings


def _height_m(surface: Surface, wavelength_m: float) -> tuple[float, bool]:
    """Return the RMS height of a surface [m], and whether it is known. If it is not, it is the
    least height that fits the slope.
    """
    if surface.rough.rms_height_m > 0:
        return surface.rough.rms_height_m, True
    return float(least_rms_height_m(surface.glint_slope, wavelength_m)), False


def _faces(
    search: BrightParts, parts: SurfaceParts, antennas_m: list[Real], wavelength_m: float
) -> Iterator[_Face]:
    """Yield the faces to which physical optics applies."""
    slopes, facing = search.slopes_of(parts, antennas_m[0])
    parts, slopes = parts.take(facing), slopes[facing]
    tangents, places_m = _nearest(search, parts, slopes)
    near = tangents <= _NEAR * parts.slope
    for plane in _planes(parts):
        first = int(plane[np.argmin(tangents[plane])])
        area_m2, lengths_m = _size(parts.corners_m[plane])
        small = lengths_m.min() < _LEAST_ACROSS * wavelength_m
        body = int(parts.body[first])
        if not near[first] or small or area_m2 < _LEAST_PART * search.area_m2(body):
            continue
        bends, _ = _bends(parts.corners_m[first], slopes[first])
        beam_rad, aspect_rad = wavelength_m / float(lengths_m.max()), math.atan(tangents[first])
        # A face wider than a Fresnel zone mirrors the radar from any place in front of it.
        mirrors = float(np.min(lengths_m**2) * np.abs(bends).min()) > wavelength_m
        yield _Face(
            body,
            float(parts.slope[first]),
            _level_m2(lengths_m, bends, wavelength_m),
            beam_rad,
            aspect_rad,
            places_m[first],
            mirrors or aspect_rad < beam_rad / 2,
        )
    least = triangle_distances(*np.moveaxis(slopes, 1, 0))
    curved = np.where(parts.flat, np.inf, least) <= _SPECULAR * parts.slope
    for first in np.flatnonzero(curved & near).tolist():
        bends, axes = _bends(parts.corners_m[first], slopes[first])
        body = int(parts.body[first])
        corners_m = parts.corners_m[(parts.body == body) & ~parts.flat].reshape(-1, 3)
        lengths_m = np.ptp(corners_m @ axes.T, axis=0)
        if lengths_m.min() < _LEAST_ACROSS * wavelength_m:
            continue
        rcs_m2 = _level_m2(lengths_m, bends, wavelength_m)
        place_m = places_m[first]
        yield _Face(body, float(parts.slope[first]), rcs_m2, math.pi, 0.0, place_m)


def _level_m2(lengths_m: Real, bends: Real, wavelength_m: float) -> float:
    (first_m, second_m), (first, second) = lengths_m.tolist(), bends.tolist()
    return float(specular_face(first_m, second_m, wavelength_m, first, second))


def _nearest(search: BrightParts, parts: SurfaceParts, slopes: Real) -> tuple[Real, Real]:
    """Return the point of each part where the wave is nearest to normal incidence.

    The results are the tangent of the angle from normal incidence, (n,), and the place of the
    point, (n, 3) [m]. Only points in the view count; without one, the tangent is infinite.
    """
    steps = _STEPS if len(slopes) <= _FEW else 3
    numbers = np.array([(i, j) for i in range(steps + 1) for j in range(steps + 1 - i)])
    weights = np.column_stack([numbers, steps - numbers.sum(axis=1)]) / steps
    points_m = np.einsum("wc,nci->nwi", weights, parts.corners_m)
    found = np.linalg.norm(np.einsum("wc,nci->nwi", weights, slopes), axis=2)
    places, ahead = search.project(points_m)
    flat = places.reshape(-1, 2)
    found[~(ahead & search.meets(flat, flat).reshape(ahead.shape))] = np.inf
    best = found.argmin(axis=1)[:, None]
    return (
        np.take_along_axis(found, best, axis=1)[:, 0],
        np.take_along_axis(points_m, best[:, :, None], axis=1)[:, 0],
    )


def _planes(parts: SurfaceParts) -> Iterator[Indices]:
    """Yield the indices of flat parts of one body that lie in one plane."""
    flat = np.flatnonzero(parts.flat)
    if not flat.size:
        return
    normals, corners_m = parts.normals[flat, 0], parts.corners_m[flat]
    # no common component of normals, as 0 or 1, is next to the limit of two steps
    steps = np.rint(normals / _ALIKE + 0.123)
    height_m = dots(normals, corners_m[:, 0])
    order = np.lexsort((height_m, *steps.T, parts.body[flat]))
    reach_m = np.linalg.norm(corners_m[:, 0] - corners_m[:, 1], axis=1)[order]
    apart = np.any(np.diff(steps[order], axis=0) != 0, axis=1)
    apart |= np.diff(parts.body[flat][order]) != 0
    apart |= np.diff(height_m[order]) > _LEVEL * np.maximum(reach_m[1:], reach_m[:-1])
    yield from np.split(flat[order], np.flatnonzero(apart) + 1)


def _size(corners_m: Real) -> tuple[float, Real]:
    """Return the area of a plane face [m^2], and the sides of a rectangle of the same area and
    aspect ratio, (2,) [m].
    """
    a, b, c = np.moveaxis(corners_m, 1, 0)
    areas_m2 = norms(crosses(b - a, c - a)) / 2
    area_m2 = float(areas_m2.sum())
    middle_m = areas_m2 @ corners_m.mean(axis=1) / area_m2
    off_m = np.concatenate([corners_m, corners_m.mean(axis=1, keepdims=True)], axis=1) - middle_m
    # second moments of triangles: those of corners, and of the middle with weight 9
    shares = np.array([1.0, 1.0, 1.0, 9.0]) / 12
    moments = np.einsum("n,c,nci,ncj->ij", areas_m2, shares, off_m, off_m) / area_m2
    _, middle, largest = np.linalg.eigvalsh(moments)
    ratio = math.sqrt(math.sqrt(largest / max(middle, 1e-12 * largest)))
    side_m = math.sqrt(area_m2)
    return area_m2, np.array([side_m * ratio, side_m / ratio])


def _bends(corners_m: Real, slopes: Real) -> tuple[Real, Real]:
    """Return the principal curvatures of a triangle, (2,) [1/m], and their axes. Slopes are linear
    over the triangle.
    """
    sides_m, turned = corners_m[1:] - corners_m[0], slopes[1:] - slopes[0]
    first = sides_m[0] / np.linalg.norm(sides_m[0])
    across = np.cross(*sides_m)
    axes = np.stack([first, np.cross(across / np.linalg.norm(across), first)])
    bend = np.linalg.solve(sides_m @ axes.T, turned @ axes.T)
    bends, turn = np.linalg.eigh((bend + bend.T) / 2)
    return bends, turn.T @ axes
