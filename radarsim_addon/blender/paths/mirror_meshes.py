# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes with materials that mirror, planar or curved."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from ...array_types import Indices, Integers, Mask, Real
from ...physics.mirrors import MirrorMaterial
from ...vectors import crosses
from ..materials import is_mirror_like, mirror_choice, mirror_of
from .obstacles import BodyMesh, Obstacles


@dataclass(frozen=True, eq=False)
class MirroringMesh:
    """Mesh of a body with materials that mirror, in the world: k triangles.

    `body` is its number, from 1. `across_m2` (k, 3) are twice the triangles' areas along their
    normals. `smooth` (k,) tells which have a mirror-like material, `mirrored` (k,) which of them
    one whose reflection is known. `choice` is what the user marked the object as.
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
        """Return the materials of mirroring triangles."""
        found = (self.slots[own] for own in self.slot[triangles].tolist())
        return [one for one in found if one is not None]


def mirroring_objects(obstacles: Obstacles) -> list[str]:
    """Return the names of the objects whose meshes `mirroring_meshes` has, each once.

    Meshes are read only where some of an object's materials mirror and others do not.
    """
    bodies = obstacles.bodies
    mirrors = cache(lambda one: mirror_of(one) is not None or is_mirror_like(one))
    named: dict[int, bool] = {}
    for index in np.sort(np.unique(bodies.shape, return_index=True)[1]).tolist():
        number = int(bodies.shape[index])
        shape = bodies.snapshot.shapes[number]
        smooth = np.array([mirrors(one) for one in shape.materials], dtype=bool)
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
    every = {one for shape in shapes for one in shape.materials}
    mirrors = {one: mirror_of(one) for one in every}
    like = {one: mirrors[one] is not None or is_mirror_like(one) for one in every}
    smooth_slots = [np.array([like[one] for one in shape.materials], bool) for shape in shapes]
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
        slots = [mirrors[one] for one in shapes[number].materials]
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
