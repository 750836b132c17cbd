# SPDX-License-Identifier: GPL-3.0-or-later
"""Views of a scene by the receiver that need no render: pixels, missing echoes, the ground.

`measure_pixel_spans` measures what a pixel spans of range on flat surfaces in view, and how small
objects in view are. `no_echo_findings` finds why a frame has no echo: an antenna inside a mesh,
nothing in view, shaders that reflect nothing. `ground_below` finds the level surface straight below
a radar.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from types import MappingProxyType

import bpy
import numpy as np

from ...arrays import Mask, Real
from ...errors import SceneError
from ...findings import Finding, finding
from ...signal.scene import Mesh, RayMesh
from ..materials import SURFACE_TYPES, assigned_materials
from ..nodes.shader_trees import reflects
from ..state import Snapshot
from .ground_truth import Boxes, antenna_positions
from .rig import Rig

#: Thickness of a flat surface over the shorter of its sides.
_FLAT = 0.2
#: Places at which a surface is looked at: distances from the foot of the radar, and directions.
_PLACES = 64
#: Flat surfaces that are looked at: the largest.
_MOST_SURFACES = 16
#: Directions that no modelled face is parallel to; a point inside has an odd number of faces in
#: each of them, forwards and backwards.
_DIRECTIONS = np.array([[0.71, 0.23, 0.66], [-0.37, 0.83, 0.42], [0.19, -0.58, -0.79]])
#: Largest tilt of the ground that counts as level.
_LEVEL_RAD = math.radians(1.0)


@dataclass(frozen=True)
class PixelSpans:
    """What pixels meet, for a frame whose pixels are `width` / pixels across wide at distance 1."""

    #: Width of the frame at distance 1.
    width: float = 0.0
    #: By the name of a flat surface: places (2, n), their range and the range that a pixel spans
    #: there over its width at distance 1, both [m].
    surfaces: Mapping[str, Real] = field(default_factory=lambda: MappingProxyType({}))
    #: Largest angular size of each object, as a width at distance 1, by name.
    sizes: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    def longest_m(self, width_px: int, limit_m: float) -> dict[str, tuple[float, float]]:
        """Return the largest range step of a pixel on each surface, and its range, both [m].

        Surfaces without a place up to `limit_m` are left out.
        """
        found = {}
        for name, (range_m, span_m) in self.surfaces.items():
            near = range_m <= limit_m
            if near.any():
                worst = int(np.argmax(np.where(near, span_m, 0.0)))
                step_m = float(span_m[worst]) * self.width / width_px
                found[name] = step_m, float(range_m[worst])
        return found


@dataclass(frozen=True)
class GroundBelow:
    """A level surface straight below a point, Blender units."""

    #: Name of the object.
    name: str
    #: Of the face below the point, or None.
    material: bpy.types.Material
    #: World z of the surface.
    height: float
    #: Bounding box in the world, (8, 3).
    corners: Real


def measure_pixel_spans(
    boxes: Boxes, matrix: Real, edges: tuple[float, ...], metres: float
) -> Generator[None, None, PixelSpans]:
    """Measure boxes of what can echo as a perspective receiver sees them; yield before parts of a
    few milliseconds.

    `matrix` is the pose of the receiver, (4, 4) [Blender units], which looks along -Z; `edges` are
    left, right, bottom and top of its frame at distance 1; `metres` are those of a Blender unit.
    """
    if not boxes.rows.size:
        return PixelSpans(edges[1] - edges[0])
    yield
    turned = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
    corners = (boxes.corners - matrix[:3, 3]) @ turned * metres  # in the receiver's axes [m]
    centres = corners.mean(axis=1)
    radius_m = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1)
    seen = np.flatnonzero(_in_view(centres, edges) & (radius_m > 0))
    angles = 2 * radius_m[seen] / np.linalg.norm(centres[seen], axis=1)
    sizes: dict[str, float] = {}
    for row, size in zip(boxes.rows[seen].tolist(), angles.tolist(), strict=True):
        label = boxes.snapshot.label(row)
        sizes[label] = max(size, sizes.get(label, 0.0))
    yield
    surfaces = {}
    sides = np.stack([corners[:, corner] - corners[:, 0] for corner in (4, 3, 1)], axis=1)
    lengths = np.linalg.norm(sides, axis=2)
    thin = np.sort(lengths, axis=1)
    flat = np.flatnonzero((thin[:, 0] <= _FLAT * thin[:, 1]) & (thin[:, 1] > 0))
    for row in flat[np.argsort(-radius_m[flat])][:_MOST_SURFACES].tolist():
        yield
        places = _places(centres[row], sides[row], lengths[row], edges)
        if places.size:
            surfaces[boxes.snapshot.label(int(boxes.rows[row]))] = places
    return PixelSpans(edges[1] - edges[0], surfaces, sizes)


def _in_view(points: Real, edges: tuple[float, ...]) -> Mask:
    """Return which points in the receiver's axes (n, 3) are in its frame, (n,)."""
    left, right, bottom, top = edges
    ahead = -points[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = points[:, 0] / ahead, points[:, 1] / ahead
    inside = (x >= left) & (x <= right) & (y >= bottom) & (y <= top)
    return np.asarray((ahead > 0) & inside)


def _places(centre: Real, sides: Real, lengths: Real, edges: tuple[float, ...]) -> Real:
    """Ranges of places in view on a flat box, and what a pixel spans there, (2, n) [m]."""
    long = np.argsort(lengths)[1:].tolist()
    first, second = (sides[axis] / lengths[axis] for axis in long)
    normal = np.cross(first, second)
    normal /= np.linalg.norm(normal)
    height = abs(float(centre @ normal))
    foot = (centre @ normal) * normal
    far = np.linalg.norm(centre - foot) + np.linalg.norm(lengths) / 2
    away = np.geomspace(max(far * 1e-4, 1e-6), far, _PLACES)
    turn = np.linspace(0, 2 * np.pi, _PLACES, endpoint=False)
    along = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * np.cross(normal, first)
    points = (foot + away[:, None, None] * along).reshape(-1, 3)
    from_centre = points - centre
    on_it = np.all(
        [abs(from_centre @ side) <= lengths[axis] / 2 for axis, side in zip(long, (first, second))],
        axis=0,
    )
    kept = on_it & _in_view(points, edges)
    if height <= 1e-9 * far or not kept.any():  # seen edge-on: it is in no pixel
        return np.zeros((2, 0))
    points = points[kept]
    range_m = np.linalg.norm(points, axis=1)
    # Tangent of the angle to the normal.
    tangent = np.sqrt(np.maximum(range_m**2 - height**2, 0.0)) / height
    # A pixel of width w at distance 1 turns the ray by w cos(angle off the axis), at most.
    span_m = range_m * tangent * (-points[:, 2] / range_m)
    return np.stack([range_m, span_m])


def no_echo_findings(snapshot: Snapshot, rig: Rig, seen: Sequence[str]) -> list[Finding]:
    """Find why a receiver whose rays met the objects `seen` received no echo: one error or more.

    Only for such frames, because it looks at every triangle of what may surround an antenna.
    """
    surrounding = _surrounding(snapshot, rig)
    if surrounding:
        return [finding("antenna-inside-mesh", *surrounding)]
    assigned = {one.item.name_full: one.materials for one in assigned_materials(snapshot)}
    if not seen:
        return [finding("nothing-in-view", *sorted(assigned)) if assigned else finding("no-echo")]
    reflect = cache(reflects)  # the links of a socket take a walk over all links of its tree
    dark = [n for n in seen if n in assigned and not any(map(reflect, assigned[n] or (None,)))]
    found = [finding("shaders-reflect-nothing", *dark)] if dark else []
    others = [name for name in seen if name not in dark]
    return found + ([finding("surfaces-return-nothing", *others)] if others else [])


def _surrounding(snapshot: Snapshot, rig: Rig) -> list[str]:
    """Return the closed meshes that contain one of the antennas, but not the other."""
    antennas = np.stack(antenna_positions(snapshot, rig))
    found = []
    low, high = snapshot.corners.min(axis=1), snapshot.corners.max(axis=1)
    within = ((antennas[:, None] >= low) & (antennas[:, None] <= high)).all(axis=2)
    for row in np.flatnonzero(within.any(axis=0) & snapshot.layout.visible).tolist():
        shape = snapshot.shapes[snapshot.layout.shape[row]]
        item, mesh = shape.original, snapshot.mesh(shape)
        if item.hide_render or item.type not in SURFACE_TYPES or item == rig.emitter or not mesh:
            continue
        matrix = snapshot.matrix(row)
        rays = mesh.rays.turned(matrix[:3, :3])
        one, other = within[:, row] & surrounded(rays, antennas - matrix[:3, 3])
        if one != other:
            found.append(snapshot.label(row))
    return found


def surrounded(rays: RayMesh, points: Real) -> Mask:
    """Return which points (n, 3) a mesh closes around, (n,), as rays in six directions agree."""
    return np.all([rays.holds(points, d, len(rays)) for d in (*_DIRECTIONS, *-_DIRECTIONS)], axis=0)


def ground_below(snapshot: Snapshot, point: Real, name: str | None = None) -> GroundBelow:
    """Find the ground: of the objects straight below a point (3,) the one with the largest area.

    Of the object, or of the one with this name, it is the highest face below the point in the world
    [Blender units]. `SceneError` if nothing is below the point, or the face is not level.
    """
    found: list[tuple[float, float, GroundBelow, float]] = []
    low, high = snapshot.corners.min(axis=1)[:, :2], snapshot.corners.max(axis=1)[:, :2]
    above = ((low <= point[:2]) & (point[:2] <= high)).all(axis=1)
    for row in np.flatnonzero(above & snapshot.layout.visible).tolist():
        shape = snapshot.shapes[snapshot.layout.shape[row]]
        item = shape.original
        if item.hide_render or name not in (None, item.name) or shape.kind not in SURFACE_TYPES:
            continue
        face = _face_below(snapshot.mesh(shape), snapshot.matrix(row), point)
        if face is not None:
            height, slot, tilt_rad = face
            area = float(np.prod(high[row] - low[row]))
            material = (
                shape.materials[min(slot, len(shape.materials) - 1)] if shape.materials else None
            )
            ground = GroundBelow(
                item.name, material, height, snapshot.corners_of(np.array([row]))[0]
            )
            found.append((area, height, ground, tilt_rad))
    if not found:
        what = "No surface" if name is None else f"No face of {name!r}"
        raise SceneError(
            f"{what} is straight below the radar at ({', '.join(f'{x:g}' for x in point)}), so "
            "there is no ground to reflect. Put a ground under the radar, or name it by --ground."
        )
    _, _, ground, tilt_rad = max(found, key=lambda one: one[:2])
    if tilt_rad > _LEVEL_RAD:
        raise SceneError(
            f"The ground {ground.name!r} is tilted by {math.degrees(tilt_rad):.3g} degrees below "
            "the radar; expected a level one. Name a level object by --ground, such as a plane "
            "at the mean height of waves."
        )
    return ground


def _face_below(mesh: Mesh | None, matrix: Real, point: Real) -> tuple[float, int, float] | None:
    """Height, material slot and tilt [rad] of the highest face below a point; None without one."""
    if mesh is None:
        return None
    corners = (mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3])[mesh.triangles]
    sides = corners[:, 1:] - corners[:, :1]
    normals = np.cross(sides[:, 0], sides[:, 1])
    flat = corners[:, :, :2] - point[:2]
    after = np.roll(flat, -1, axis=1)
    turns = flat[..., 0] * after[..., 1] - flat[..., 1] * after[..., 0]
    inside = (np.all(turns >= 0, axis=1) | np.all(turns <= 0, axis=1)) & (normals[:, 2] != 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        away = np.einsum("ij,ij->i", corners[:, 0] - point, normals) / normals[:, 2]
    below = np.flatnonzero(inside & (away < 0))
    if not below.size:
        return None
    top = below[np.argmax(away[below])]
    cosine = abs(normals[top, 2]) / np.linalg.norm(normals[top])
    return (
        float(point[2] + away[top]),
        int(mesh.slots[mesh.polygons[top]]),
        math.acos(min(1.0, float(cosine))),
    )
