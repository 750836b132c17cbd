# SPDX-License-Identifier: GPL-3.0-or-later
"""Planar mirrors of a scene, and the images of the transmitter in them."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from ...array_types import Indices, Integers, Real
from ...findings import Finding, finding
from ...physics.mirrors import MirrorMaterial, Reflected, mirror_matrix
from ...vectors import dots, norms
from ..materials import mirror_choice
from .mirror_meshes import mirroring_meshes
from .obstacles import Obstacles

#: A patch is planar where it leaves its plane by less than this part of the wavelength.
FLAT = 1 / 50
#: Planes that are looked for; what else mirrors is left out and counted.
_MOST_PLANES = 64
#: What is added to the solid angle of mirrors that the user wants first [sr]: more than any has.
_FIRST_SR = 1e3
#: Level that turned waves may change before a finding tells it [dB].
TURNED_DB = 0.5
#: How far a point of a triangle may lie outside of it, over its own size: rounding.
_EDGE = 1e-9


@dataclass(frozen=True, eq=False)
class Mirror:
    """Triangles in one plane that mirror the transmitter: those that face it.

    `normal` points to the side of the transmitter, `offset_m` is the plane's; `triangles_m`
    (k, 3, 3), `body` and `material` belong to each triangle. `sight_sr` is the solid angle of the
    triangles from the transmitter, times what their materials reflect at normal incidence, and
    more of objects that the user wants first.
    """

    normal: Real
    offset_m: float
    triangles_m: Real
    body: Integers
    material: list[MirrorMaterial]
    objects: tuple[str, ...]
    sight_sr: float

    def image_m(self, point_m: Real) -> Real:
        """Return the image of a point, (3,) [m]."""
        turned, shift_m = mirror_matrix(self.normal, self.offset_m)
        return np.asarray(turned @ point_m + shift_m)

    def heights_m(self, points_m: Real) -> Real:
        """Return the distances of points (n, 3) from the plane, on the transmitter's side, (n,)."""
        return dots(points_m, self.normal) - self.offset_m

    @property
    def own_body(self) -> int:
        """Number of the body with the mirror, from 1; 0: several bodies share the plane."""
        return int(self.body[0]) if np.all(self.body == self.body[0]) else 0

    @property
    def is_rough(self) -> bool:
        """Whether a material has an RMS height."""
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
    """Find the planes that mirror the transmitter, those in which it sees most first.

    Returns at most `most` of them, and what there is to say of those left out.
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

        A target that keeps every polarisation sends the turned wave back to the mirror, which
        turns it again. Over that of the direct path, the amplitude of this path is at most the
        fraction of the power that is turned.
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
    """Find the faces; add objects that are curved, and whose material has no image."""
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
    """What a mirror reflects at normal incidence."""
    along = np.array([[0.0, 0.0, -1.0]])
    return float(material.reflection(along, -along[0], "average", math.inf)[0][0])


def _area(a: Real, b: Real) -> Real:
    """Twice the signed area between vectors in a plane, (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
