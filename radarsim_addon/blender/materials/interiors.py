# SPDX-License-Identifier: GPL-3.0-or-later
"""Interiors of objects for a run: where waves enter and come out again, and where they do not.

A material whose Volume socket is not connected is made opaque (`settle_interiors`).
`overlapping_shells` and `found_inside` name what lies inside walls: other parts of a mesh, other
objects, antennas.

`settle_interiors_far_away` is about rounding. Cycles takes a depth inside an object as the
difference of two float32 distances from the start of the ray. Where this rounding matters, the
absorption and delay of plane-parallel walls are computed at their faces from the wall's thickness
(see `nodes.physical_material.wall_at_face`). For all other objects, a finding gives the name and
the error.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple

import bpy
import numpy as np

from ...arrays import Mask, Real, dots, norms
from ...errors import ConfigError
from ...findings import Finding, finding
from ...signal.scene import ALL_FACES, SMOOTH_BELOW, Mesh, RayMesh, Surface
from ..nodes import attributes
from ..nodes.materials import (
    disconnect_volume,
    transmission_inputs,
    volume_link,
)
from ..state import (
    SettingsRestorer,
    Snapshot,
)
from .layers import FACES_LOSS_DB, MAX_LOSS_DB, layer_faces
from .physical_materials import SURFACE_TYPES, assigned_materials
from .surfaces import read_surface, surfaces_of


def settle_interiors(recorder: SettingsRestorer, materials: Iterable[Any]) -> list[Finding]:
    """Make Radar Materials opaque, until they are restored, if their Volume is not connected.

    Without the Volume of the Material Output, Cycles does not attenuate waves inside the object.
    The Volume of materials that are opaque anyway is disconnected, because it costs render time.
    `materials` are those of the rendered objects, evaluated at the carrier.

    Returns a finding with the materials that the missing Volume makes opaque. Raises ConfigError if
    two materials, one with Volume, share the node that would be changed.
    """
    closed: list[Any] = []
    opaque: list[Any] = []
    entered: dict[int, Any] = {}
    for material in sorted(materials, key=lambda item: item.name_full):
        link = volume_link(material)
        if read_surface(material).is_opaque:
            opaque.append(material)
            if link is not None:
                disconnect_volume(recorder, material, link)
        elif link is not None:
            entered |= {socket.as_pointer(): material for socket in _transmissions(material)}
        elif _transmissions(material):
            closed.append(material)
    # Also what the surface of a metal lets in (0.3 % at grazing incidence) ends in its skin.
    for material in (*closed, *opaque):
        for socket in _transmissions(material):
            other = entered.get(socket.as_pointer())
            if other is not None:
                raise ConfigError(
                    f"Materials {material.name!r} and {other.name!r} use one node group, but only "
                    f"{other.name!r} has its Volume connected. Connect Volume in both, or make the "
                    "group a single-user copy in one of them."
                )
            recorder.set(socket, "default_value", 0.0)
    names = [material.name for material in closed]
    return [finding("opaque-without-volume", *names)] if names else []


def _transmissions(material: bpy.types.Material) -> list[Any]:
    return [socket for socket in transmission_inputs(material) if socket is not None]


#: Fraction of a surface inside another part of its mesh, and inside a wall, that is named.
_LEAST_BURIED, _LEAST_INSIDE = 0.005, 0.1
#: Error of spreading from which on an antenna in a medium is named [dB].
_LEAST_DB = 0.02
#: Triangles of an object that are looked at, the largest ones.
_TRIANGLES = 500
#: Points of an object that may lie in a wall, and faces that a ray may pass, at most.
_POINTS, _MOST_FACES = 64, 64


def overlapping_shells(snapshot: Snapshot) -> list[Finding]:
    """Return findings on meshes with an interior whose parts overlap one another."""
    found = []
    surfaces = surfaces_of(snapshot)
    for item, materials in assigned_materials(snapshot):
        if item.type != "MESH" or not any(one.has_interior for one in surfaces.of(materials)):
            continue
        mesh = snapshot.mesh_of(item)
        if mesh is None or len(mesh.sides) <= 6:  # a box, or less, has no parts
            continue
        fraction = _buried(mesh)
        if fraction > _LEAST_BURIED:
            found.append(finding("shells-overlap", item.name, fraction=fraction))
    return found


def _buried(mesh: Mesh) -> float:
    """Return the fraction of a surface whose outer side is inside another part of the same mesh."""
    place, outward, area = _largest(mesh.vertices[mesh.triangles])
    with np.errstate(invalid="ignore"):
        behind = mesh.rays.normals_of(mesh.rays.first(place, outward)[0])
        buried = dots(behind, outward) > 0
    return float(area[buried].sum() / max(area.sum(), 1e-300))


def _largest(triangles: Real) -> tuple[Real, Real, Real]:
    """Return the centres, unit normals and areas of the largest of these triangles (n, 3, 3)."""
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    double = norms(across)
    chosen = np.argsort(-double, kind="stable")[:_TRIANGLES]
    chosen = chosen[double[chosen] > 0]
    return triangles[chosen].mean(axis=1), across[chosen] / double[chosen, None], double[chosen] / 2


def found_inside(snapshot: Snapshot, antennas: Sequence[Real]) -> list[Finding]:
    """Return findings on objects and antennas that are inside walls or other interiors.

    The finding `inside-a-wall` names each object or antenna with its wall, for walls that absorb
    and delay where a ray crosses a face. There is one `antenna-in-medium` for each object around an
    antenna, with its index and the largest error of the spreading loss. `antennas` are (3,) each
    [Blender units].
    """
    snapshot, places = snapshot, np.asarray(antennas, dtype=np.float64)
    surfaces = surfaces_of(snapshot)
    low, high = snapshot.corners.min(axis=1), snapshot.corners.max(axis=1)
    found = []
    if names := list(_in_walls(snapshot, places, low, high)):
        found.append(finding("inside-a-wall", *names))
    within = ((places[:, None] > low) & (places[:, None] < high)).all(axis=2).any(axis=0)
    for row in np.flatnonzero(within & snapshot.layout.visible).tolist():
        shape = snapshot.shapes[snapshot.layout.shape[row]]
        entered = [one for one in surfaces.of(shape.materials) if one.has_interior]
        if not entered or shape.kind != "MESH" or not _is_surface(shape):
            continue
        count = int(np.sum(_Wall(snapshot, row).holds(places)))
        index = max((one.n for one in entered if one.n is not None), default=1.0)
        if count and abs(power_db := 20 * count * math.log10(index)) > _LEAST_DB:
            label = snapshot.label(row)
            found.append(finding("antenna-in-medium", label, index=index, power_db=power_db))
    return found


def _in_walls(snapshot: Snapshot, antennas: Real, low: Real, high: Real) -> dict[str, None]:
    """Return the names of objects and antennas inside walls that absorb at their faces, each with
    its wall.
    """
    visible = snapshot.layout.visible
    walls = np.flatnonzero(visible & snapshot.of_shapes([_at_faces(s) for s in snapshot.shapes]))
    shown = visible & snapshot.of_shapes([_is_surface(shape) for shape in snapshot.shapes])
    names: dict[str, None] = {}
    for row in walls.tolist():
        wall = _Wall(snapshot, row)
        if np.any(wall.holds(antennas)):
            names[f"the radar in {snapshot.label(row)}"] = None
        for other, points in _near(snapshot, row, shown, low, high):
            if np.mean(wall.holds(points)) > _LEAST_INSIDE:
                names[f"{snapshot.label(other)} in {snapshot.label(row)}"] = None
    return names


def _is_surface(shape: Any) -> bool:
    return shape.original.type in SURFACE_TYPES and not shape.original.hide_render


def _at_faces(shape: Any) -> bool:
    item = shape.original
    there = attributes.OBJECT_SHELL_THICKNESS in item or attributes.OBJECT_LAYER_AT_FACES in item
    return there and _is_surface(shape)


def _near(
    snapshot: Snapshot, row: int, shown: Mask, low: Real, high: Real
) -> Iterator[tuple[int, Real]]:
    """Yield the objects whose box overlaps that of a row, each with points of its
    surface, (n, 3).
    """
    meets = np.all((low <= high[row]) & (high >= low[row]), axis=1)
    for other in np.flatnonzero(meets & shown).tolist():
        if other == row:
            continue
        mesh = snapshot.mesh(snapshot.shapes[snapshot.layout.shape[other]])
        if mesh is None or not len(mesh.sides):
            continue
        matrix = snapshot.matrix(other)
        points = (mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3])[mesh.triangles].mean(axis=1)
        yield other, points[:: -(-len(points) // _POINTS)]


class _Wall:
    """The mesh of an object or instance."""

    def __init__(self, snapshot: Snapshot, row: int) -> None:
        matrix = snapshot.matrix(row)
        mesh = snapshot.mesh(snapshot.shapes[snapshot.layout.shape[row]])
        self._place = matrix[:3, 3]
        none = np.empty((0, 3))
        found = (none, none.astype(int)) if mesh is None else (mesh.vertices, mesh.triangles)
        self._rays = RayMesh(found[0] @ matrix[:3, :3].T, found[1])

    def holds(self, points: Real) -> Mask:
        """Whether points (n, 3) are inside."""
        along = np.array([0.3713907, 0.5570860, 0.7427814])  # along no edge
        return self._rays.holds(points - self._place, along, _MOST_FACES)


# Objects so far away that Cycles rounds the depths of waves inside them.

_EPS32 = float(np.finfo(np.float32).eps) / 2
#: Standard deviation of a depth, in float32 roundings of the distance (rms of walls at 5 and 20 km,
#: 0 and 30 degrees: 1.8).
_DEPTH_ROUNDINGS = 2.0
#: Error of the logarithm of an encoding that shares an exponent with two-way absorption, in
#: roundings of this exponent.
_ABSORPTION_ROUNDINGS = 2.0
#: Errors of an echo through one object, from which on its faces take the place of its volume, or
#: it is named: two-way power [dB], and two-way length [wavelengths].
_TOLERANCE_DB, _TOLERANCE_WAVELENGTHS = 0.005, 0.02
#: The same errors up to which an object is named for information only: less than calibration is
#: known to, and the part of a wavelength from which on phases of a table are called unreliable.
_DANGER_DB, _DANGER_WAVELENGTHS = 0.1, 0.05
#: Fraction of a wall's surface that is its rim from which on its echoes from inside are named.
_LEAST_RIM = 0.01
#: Part of a wall's thickness by which others may reach into it and still only touch it.
_TOUCHING = 1e-3
#: Thickness of the box of an object that counts as flat, relative to its largest edge.
_FLAT = 1e-6


class Interiors(NamedTuple):
    """How interiors are computed in a run."""

    #: Whether anything that waves pass delays them.
    delay: bool = False
    #: Standard deviation of an echo's length from the rounding of depths, over the length.
    sigma: float = 0.0
    #: The same from absorption, which shares the range encoding's exponent [Blender units].
    absorption_sigma: float = 0.0
    #: Objects whose echoes these spoil.
    findings: Sequence[Finding] = ()


class _Rounding(NamedTuple):
    """Errors of echoes through an object, two ways: power [dB], and lengths [Blender units]."""

    power_db: float
    by_depth: float
    by_absorption: float

    @property
    def length(self) -> float:
        return math.hypot(self.by_depth, self.by_absorption)


def settle_interiors_far_away(
    recorder: SettingsRestorer,
    snapshot: Snapshot,
    antennas: Sequence[Sequence[float]],
    reach: float,
    wavelength: float,
    extinction_length: float,
    range_encoding_length: float,
    losses_db: dict[str, float],
) -> Interiors:
    """Use the faces of walls in place of their interiors, until restored, if Cycles would round the
    depth inside too much.

    Layer normals must be set before. `antennas` are (3,) each. `reach` is the distance from them to
    the farthest point that echoes. `wavelength` applies to physical Radar Materials,
    `extinction_length` to simple ones. `range_encoding_length` is k of exp(-l/k). All are in
    Blender units. `losses_db` has the two-way absorption of objects by name. Returns the rounding
    errors that remain.
    """
    distance = reach + max(float(np.linalg.norm(place)) for place in antennas)
    depth = _DEPTH_ROUNDINGS * _EPS32 * distance
    nepers = _ABSORPTION_ROUNDINGS * _EPS32 * range_encoding_length * math.log(10) / 10
    delay, errors, walls = False, {}, []
    surfaces, lengths = surfaces_of(snapshot), cache(_lengths)
    for one in assigned_materials(snapshot):
        known = surfaces.of(one.materials)
        delay |= any(surface.delays for surface in known)
        entered = [surface for surface in known if surface.has_interior]
        loss_db = losses_db.get(one.item.name_full, 0.0)
        shell = attributes.OBJECT_SHELL_THICKNESS in one.item
        if not entered or shell or loss_db > MAX_LOSS_DB:  # nothing comes out
            continue
        per = [lengths(surface, wavelength, extinction_length) for surface in entered]
        error = _rounding(per, depth, nepers * loss_db)
        errors[one.item.name_full] = one.item, error
        plate = len(set(one.materials)) == 1 and known[0].is_entered
        if plate and _matters(error, wavelength) and loss_db <= FACES_LOSS_DB:
            middle = _middle_of_plate(one.item, snapshot)
            if not math.isnan(middle):
                walls.append((one.item, middle))
    rims = []
    if walls:
        boxes = _Boxes(snapshot)
        for item, middle in walls:
            if boxes.empty_inside(item, antennas):
                recorder.set_item(item, attributes.OBJECT_LAYER_AT_FACES, [1.0, middle, 0.0])
                item.update_tag()
                del errors[item.name_full]
                if _echoes_from_its_rim(item, snapshot):
                    loss_db = losses_db.get(item.name_full, 0.0)
                    rims.append(finding("rim-echoes-weak", item.name_full, power_db=loss_db))
    named = [one for one in errors.values() if _matters(one[1], wavelength)]
    if any(_is_flat(item) for item, _ in named):
        boxes = _Boxes(snapshot)
        named = [one for one in named if not boxes.nothing_behind(one[0], antennas)]
    found = [_named(item.name_full, error, wavelength) for item, error in named] + rims
    left = [error for _, error in errors.values()]
    sigma = max((error.by_depth for error in left), default=0.0)
    return Interiors(
        delay,
        sigma / (2 * distance) if distance else 0.0,
        max((error.by_absorption for error in left), default=0.0),
        found,
    )


def _matters(error: _Rounding, wavelength: float) -> bool:
    return error.power_db > _TOLERANCE_DB or error.length > _TOLERANCE_WAVELENGTHS * wavelength


def _named(name: str, error: _Rounding, wavelength: float) -> Finding:
    """Return the finding on the rounding error of an object. It is only information if the error is
    negligible.
    """
    wavelengths = error.length / wavelength
    said = finding(
        "interior-rounded", name, power_db=error.power_db, length_wavelengths=wavelengths
    )
    small = error.power_db < _DANGER_DB and wavelengths < _DANGER_WAVELENGTHS
    return said.as_information() if small else said


def _lengths(surface: Surface, wavelength: float, extinction_length: float) -> tuple[float, float]:
    """Return the loss [dB] and the delay [Blender units] of a material per Blender unit
    of depth.
    """
    per = wavelength if surface.is_entered else extinction_length
    return 4 * math.pi * surface.index.imag / per * 10 / math.log(10), surface.index.real - 1


def _rounding(
    per_unit: Sequence[tuple[float, float]], depth: float, by_absorption: float
) -> _Rounding:
    """Return the error of an echo that an error of each depth [Blender units] causes, for the worst
    of the materials.
    """
    power, length = (max(0.0, *numbers) for numbers in zip(*per_unit, strict=True))
    both_ways = math.sqrt(2) * depth
    return _Rounding(power * both_ways, length * both_ways, by_absorption)


def _middle_of_plate(item: bpy.types.Object, snapshot: Snapshot) -> float:
    """Return the coordinate of the middle of a plate along its normal, in its own units; NaN for
    other objects.
    """
    if attributes.OBJECT_LAYER_THICKNESS not in item:
        return math.nan
    normal = np.array(item[attributes.OBJECT_LAYER_NORMAL], dtype=np.float64)
    low, high = layer_faces(snapshot, [item]).planes(normal[None], ALL_FACES)
    return float(low[0] + high[0]) / 2


def _echoes_from_its_rim(item: bpy.types.Object, snapshot: Snapshot) -> bool:
    """Return whether a rough wall has so large a rim that waves inside the wall return from it."""
    roughness = (read_surface(slot.material).roughness or 0.0 for slot in item.material_slots)
    normal = np.array(item[attributes.OBJECT_LAYER_NORMAL], dtype=np.float64)
    return max(roughness, default=0.0) > SMOOTH_BELOW and (
        layer_faces(snapshot, [item]).rim_fractions(normal[None])[0] > _LEAST_RIM
    )


def _is_flat(item: bpy.types.Object) -> bool:
    """Return whether an object lies in one plane that is normal to one of its own axes."""
    return bool(min(item.dimensions) <= _FLAT * max(item.dimensions))


class _Boxes:
    """Bounding boxes of all surfaces and their instances at the snapshot's moment."""

    def __init__(self, snapshot: Snapshot) -> None:
        shown = snapshot.of_shapes([_is_surface(shape) for shape in snapshot.shapes])
        rows = np.flatnonzero(snapshot.layout.visible & shown)
        shapes = snapshot.layout.shape[rows]
        self._poses, self._corners = snapshot.matrices_of(rows), snapshot.corners_of(rows)
        self._own = np.array([shape.box for shape in snapshot.shapes])[shapes]
        self._owners = np.array([one.original.as_pointer() for one in snapshot.shapes])[shapes]
        self._centres = self._corners.mean(axis=1)
        self._radii = np.linalg.norm(self._corners - self._centres[:, None], axis=2).max(axis=1)

    def empty_inside(self, item: bpy.types.Object, antennas: Sequence[Sequence[float]]) -> bool:
        """Return whether no other object and no antenna reaches into the box of an object, in all
        its instances.
        """
        places = np.asarray(antennas, dtype=np.float64)[:, None]
        for mine in np.flatnonzero(self._owners == item.as_pointer()):
            apart = np.linalg.norm(self._centres - self._centres[mine], axis=1)
            near = np.flatnonzero(apart < self._radii + self._radii[mine])
            others = np.concatenate(
                [self._corners[near[near != mine]], np.repeat(places, 8, axis=1)]
            )
            inverse = np.linalg.inv(self._poses[mine])
            inside = np.einsum("ij,nkj->nki", inverse[:3, :3], others) + inverse[:3, 3]
            low, high = self._own[mine].min(axis=0), self._own[mine].max(axis=0)
            gap = _TOUCHING * float((high - low).min())
            reaches = (inside.max(axis=1) > low + gap) & (inside.min(axis=1) < high - gap)
            if reaches.all(axis=1).any():
                return False
        return True

    def nothing_behind(self, item: bpy.types.Object, antennas: Sequence[Sequence[float]]) -> bool:
        """Return whether an object is flat and has all other objects and the antennas
        on one side.
        """
        if not _is_flat(item):
            return False
        others = np.concatenate([self._corners.reshape(-1, 3), antennas])
        for mine in np.flatnonzero(self._owners == item.as_pointer()):
            size = np.ptp(self._own[mine], axis=0)
            axis = int(np.argmin(size))
            inverse = np.linalg.inv(self._poses[mine])
            heights = others @ inverse[axis, :3] + inverse[axis, 3] - self._own[mine][0, axis]
            gap = _FLAT * float(size.max())
            if heights.min() < -gap and heights.max() > gap:
                return False
        return True
