# SPDX-License-Identifier: GPL-3.0-or-later
"""Curved mirrors of a scene: smooth patches over the triangles of meshes that are shaded smooth."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...array_types import Integers, Real
from ...findings import Finding, finding
from ...physics.mirrors import MirrorMaterial
from ...physics.smooth_patches import SmoothPatches
from ...vectors import norms
from .mirror_meshes import MirroringMesh, mirroring_meshes
from .mirrors import FLAT
from .obstacles import Obstacles

#: Least radius of curvature for rays, over the wavelength: k a = 10.
_LEAST_RADIUS = 10 / (2 * math.pi)
#: How far corners may lie in front of another one, over their extent, and how many of those are
#: asked about at most, for a surface to count as convex: normals of meshes are not exact.
_BEHIND, _MOST_ASKED = 1e-3, 256


@dataclass(frozen=True, eq=False)
class CurvedMirrors:
    """Patches that mirror, of all bodies: k of each.

    `body` is the number of the body, from 1, `size_m` the longest edge of each patch, `lift_m` its
    height over the triangle, `material` its number in `materials`, `names` the objects.
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
        """Names of the objects with the mirrors."""
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
        """Return what to say of patches that lie far off their triangles."""
        far = self.lift_m > FLAT * wavelength_m
        names = dict.fromkeys(self.names[body] for body in np.unique(self.body[far]).tolist())
        height_m = float(self.lift_m.max())
        return [finding("mirror-rounded", *names, height_m=height_m)] if names else []


def find_curved_mirrors(
    obstacles: Obstacles, wavelength_m: float
) -> tuple[CurvedMirrors | None, list[Finding]]:
    """Find the curved surfaces that mirror; None without any.

    Returns also what there is to say of those whose reflection is not known.
    """
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
    """Patches over some triangles of a mesh, and which of them tell the surface well enough."""
    normals = one.mesh.corner_normals
    assert normals is not None  # some triangles are curved
    turned = normals[kept].astype(np.float64) @ np.linalg.inv(one.pose[:3, :3])
    turned /= np.linalg.norm(turned, axis=2)[:, :, None]
    patches, error_m = SmoothPatches.of_mesh(
        one.corners_m[kept], turned, one.mesh.triangles[kept].astype(np.int64)
    )
    bent = np.linalg.norm(patches.shape, axis=(2, 3)).max(axis=1, initial=0.0)
    usable = (error_m <= FLAT * wavelength_m) & (bent * _LEAST_RADIUS * wavelength_m <= 1)
    outward = np.einsum("kij,kj->ki", turned, one.across_m2[kept]) > 0
    return patches, usable & outward.all(axis=1)


def _left_out(areas_m2: dict[str, Real]) -> list[Finding]:
    """What to say of objects with areas that are left out: those and the whole, by name."""
    names = [name for name, (missing, _) in areas_m2.items() if missing > 0]
    if not names:
        return []
    missing, whole = np.sum([areas_m2[name] for name in names], axis=0)
    return [finding("mirror-curved", *names, fraction=float(missing / whole))]
