# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces of a scene that mirror: their faces in the world, and the planes of the flat ones."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Indices, Integers, Mask, Real, crosses, dots, norms
from ...findings import Finding, finding
from ...physics.mirrors import MirrorMaterial, mirror_matrix
from ..scene import RayMesh
from .obstacles import Obstacles

#: A patch is planar where it leaves its plane by less than this fraction of the wavelength.
FLAT = 1 / 50
#: Planes that are looked for; other faces are left out and counted.
_MOST_PLANES = 64
#: Added to the solid angle of mirrors that the user wants first [sr]: more than any has.
_FIRST_SR = 1e3


@dataclass(frozen=True, eq=False)
class MirrorFaces:
    """Triangles that mirror, in the world: k of each. A sheet has two, one for each side.

    `across_m2` are twice the areas along the normals of the mirroring side, `normals` unit vectors
    at the corners: those of smooth shading where it is `curved`. Corners with the same `vertex` are
    one. `body` is the number of the body, from 1, `material` that in `materials`; -1: what it
    reflects is not known. `names` are those of the objects by body.
    """

    materials: tuple[MirrorMaterial, ...]
    names: dict[int, str]
    corners_m: Real
    across_m2: Real
    normals: Real
    vertex: Integers
    curved: Mask
    body: Integers
    material: Integers

    def objects(self, chosen: Indices | Mask) -> tuple[str, ...]:
        """Return the names of the objects that faces belong to."""
        bodies, first = np.unique(self.body[chosen], return_index=True)
        return tuple(dict.fromkeys(self.names[n] for n in bodies[np.argsort(first)].tolist()))


def mirror_faces(obstacles: Obstacles, unwanted: Collection[int] = ()) -> MirrorFaces:
    """Return the faces of a scene that mirror, without those of unwanted objects, by number."""
    model = obstacles.model
    none = np.zeros(0, dtype=np.int64)
    corner = np.zeros((0, 3, 3))
    parts: list[tuple[NDArray[Any], ...]] = [
        (corner, corner[:, 0], corner, none.reshape(-1, 3), none > 0, none, none)
    ]
    materials: dict[MirrorMaterial, int] = {}
    names: dict[int, str] = {}
    vertices = 0
    smooth_shapes = np.array([any(s.mirrors for s in every) for every in model.surfaces], bool)
    mirroring = smooth_shapes[model.shape] & ~np.isin(model.number, [0, *unwanted])
    for index in np.flatnonzero(mirroring).tolist():
        mesh, surfaces = obstacles.mesh(index), model.surfaces[model.shape[index]]
        if mesh is None:
            continue
        slots, turn = np.minimum(mesh.slots, len(surfaces) - 1), model.pose[index, :3, :3]
        known = [one.mirror for one in surfaces]
        material = [-1 if m is None else materials.setdefault(m, len(materials)) for m in known]
        smooth = np.array([one.mirrors for one in surfaces], dtype=bool)
        here = np.flatnonzero(smooth[slots] & (mesh.areas_m2 > 0))
        corners_m = mesh.vertices_m[mesh.triangles[here]] @ turn.T + model.pose[index, :3, 3]
        across = crosses(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])
        across *= np.sign(np.linalg.det(turn))
        there = norms(across) > 0  # a pose may leave no area
        here, corners_m, across = here[there], corners_m[there], across[there]
        if not here.size:
            continue
        names[index + 1] = model.name(int(model.number[index]))
        curved = mesh.curved[here]
        normals = np.repeat((across / norms(across)[:, None])[:, None], 3, axis=1)
        if mesh.corner_normals is not None and curved.any():
            shaded = mesh.corner_normals[here[curved]].astype(np.float64) @ np.linalg.inv(turn)
            normals[curved] = shaded / np.linalg.norm(shaded, axis=2)[:, :, None]
        vertex = vertices + mesh.triangles[here].astype(np.int64)
        vertices += len(mesh.vertices_m)
        others = (vertex, curved, np.full(here.size, index + 1), np.array(material)[slots[here]])
        for side in (1.0,) if mesh.closed else (1.0, -1.0):
            parts.append((corners_m, side * across, side * normals, *others))
    columns = (np.concatenate(column) for column in zip(*parts, strict=True))
    return MirrorFaces(tuple(materials), names, *columns)


def mirroring_objects(obstacles: Obstacles, unwanted: Collection[int]) -> dict[str, None]:
    """Return the names of the objects that have faces that mirror.

    Meshes are read only if some of an object's surfaces mirror and others do not.
    """
    model = obstacles.model
    names: dict[str, None] = {}
    for index in np.sort(np.unique(model.shape, return_index=True)[1]).tolist():
        number, shape = int(model.number[index]), int(model.shape[index])
        smooth = np.array([one.mirrors for one in model.surfaces[shape]], dtype=bool)
        if not smooth.any() or number in {0, *unwanted}:
            continue
        there = model.meshes.face_count(shape) > 0
        if not smooth.all():
            mesh = obstacles.mesh(index)
            slots = () if mesh is None else np.minimum(mesh.slots, smooth.size - 1)
            there = bool(smooth[np.array(slots, dtype=np.intp)].any())
        names |= {model.name(number): None} if there else {}
    return names


@dataclass(frozen=True, eq=False)
class Plane:
    """Faces in one plane, by their numbers, that mirror on the side of its normal.

    `sight_sr` is their solid angle from each antenna, times their reflectance at normal incidence;
    more for objects that the user wants first.
    """

    normal: Real
    offset_m: float
    faces: MirrorFaces
    own: Indices
    sight_sr: Real

    def image_m(self, point_m: Real) -> Real:
        turned, shift_m = mirror_matrix(self.normal, self.offset_m)
        return np.asarray(turned @ point_m + shift_m)

    def heights_m(self, points_m: Real) -> Real:
        """Return the distances of points (n, 3) from the plane, positive on the side that mirrors,
        (n,).
        """
        return dots(points_m, self.normal) - self.offset_m

    @property
    def objects(self) -> tuple[str, ...]:
        return self.faces.objects(self.own)

    @property
    def bodies(self) -> list[int]:
        """Numbers of the bodies with faces in the plane, from 1."""
        found: list[int] = np.unique(self.faces.body[self.own]).tolist()
        return found

    @cached_property
    def rays(self) -> RayMesh:
        """The faces, for rays that meet the plane."""
        corners_m = self.faces.corners_m[self.own].reshape(-1, 3)
        return RayMesh(corners_m, np.arange(len(corners_m)).reshape(-1, 3))


def find_planes(
    faces: MirrorFaces,
    antennas_m: Sequence[Real],
    wavelength_m: float,
    most: int,
    wanted: Collection[str] = (),
) -> tuple[list[list[Plane]], list[Finding]]:
    """Return at most `most` planes that mirror each antenna.

    Planes of objects that the user wants first come first, then those in which the antenna sees
    most.
    """
    flat = np.flatnonzero(~faces.curved)
    middles_m, across_m2 = faces.corners_m[flat].mean(axis=1), faces.across_m2[flat]
    solid_sr = np.zeros((len(antennas_m), flat.size))
    for row, antenna_m in zip(solid_sr, antennas_m, strict=True):
        away_m = antenna_m - middles_m
        row[:] = np.maximum(dots(across_m2, away_m), 0.0) / 2 / norms(away_m) ** 3
    seen = np.any(solid_sr > 0, axis=0)
    known = seen & (faces.material[flat] >= 0)
    own, solid_sr, across_m2 = flat[known], solid_sr[:, known], across_m2[known]
    bright = np.array([_brightness(one) for one in faces.materials])
    leads = np.isin(faces.body[own], [n for n, name in faces.names.items() if name in wanted])
    sight_sr = solid_sr * bright[faces.material[own]] + _FIRST_SR * (leads & (solid_sr > 0))
    corners_m, normals = faces.corners_m[own], across_m2 / norms(across_m2)[:, None]
    planes: list[Plane] = []
    left, largest_sr = np.ones(own.size, dtype=bool), sight_sr.max(axis=0, initial=0.0)
    while left.any() and len(planes) < max(_MOST_PLANES, most):
        first = np.argmax(np.where(left, largest_sr, -1.0))
        normal = normals[first]
        offset_m = float(corners_m[first].mean(axis=0) @ normal)
        away_m = np.abs(corners_m @ normal - offset_m).max(axis=1)
        here = left & (away_m <= FLAT * wavelength_m) & (normals @ normal > 1 - 1e-6)
        left &= ~here
        left[first] = False
        planes.append(Plane(normal, offset_m, faces, own[here], sight_sr[:, here].sum(axis=1)))
    images: list[list[Plane]] = []
    beyond: dict[Plane, None] = {}
    for number in range(len(antennas_m)):
        ranked = sorted(planes, key=lambda plane: -plane.sight_sr[number])
        ranked = [plane for plane in ranked if plane.sight_sr[number] > 0]
        images.append(ranked[:most])
        beyond |= dict.fromkeys(ranked[most:])
    found = []
    if unknown := faces.objects(flat[seen & ~known]):
        found.append(finding("mirror-without-image", *unknown))
    useful = {*faces.objects(own), *faces.objects(faces.curved)}
    if in_vain := set(wanted) - useful:
        found.append(finding("mirror-first-without-image", *sorted(in_vain)))
    if beyond:
        names = dict.fromkeys(name for plane in beyond for name in plane.objects)
        count = len(beyond) + int(np.count_nonzero(left))
        found.append(finding("mirrors-left-out", *names, count=count, most=most))
    return images, found


def _brightness(material: MirrorMaterial) -> float:
    """Return the reflectance of a mirror at normal incidence."""
    along = np.array([[0.0, 0.0, -1.0]])
    return float(material.reflection(along, -along[0], "average", math.inf)[0][0])
