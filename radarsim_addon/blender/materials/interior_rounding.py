# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects so far away that Cycles rounds the depths of waves inside them.

Cycles takes a depth inside an object as the difference of two float32 distances from the start of
the ray. Where their rounding matters, plane-parallel walls absorb and delay at their faces (see
:func:`.nodes.layer.wall_at_face`), which know the thickness. Others are named with the error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from ...array_types import Real
from ...findings import Finding, finding
from ..nodes import attributes
from ..nodes.group_search import group_input
from ..nodes.materials import has_interior
from ..nodes.physical_material import EXTINCTION, SMOOTH_BELOW
from ..nodes.radar_material import INDEX, ROUGHNESS
from ..state import SettingsRestorer, evaluated_objects
from .assignments import SURFACE_TYPES, assigned_materials
from .layer_faces import ALL_FACES, LayerFaces
from .layers import FACES_LOSS_DB, MAX_LOSS_DB, delays, is_entered

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
    """How interiors are computed in a run.

    Attributes
    ----------
    delay
        Whether anything that waves pass delays them.
    sigma
        Standard deviation of an echo's length from the rounding of depths, over the length.
    absorption_sigma
        The same from absorption, which shares the range encoding's exponent [Blender units].
    findings
        Objects whose echoes these spoil.
    """

    delay: bool = False
    sigma: float = 0.0
    absorption_sigma: float = 0.0
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
    depsgraph: Any,
    antennas: Sequence[Sequence[float]],
    reach: float,
    wavelength: float,
    extinction_length: float,
    range_encoding_length: float,
    losses_db: dict[str, float],
) -> Interiors:
    """Let faces stand for the interiors of walls, until restored, where Cycles would round these.

    Parameters
    ----------
    recorder
        Records the changes, so that they can be restored.
    depsgraph : bpy.types.Depsgraph
        Up to date; layer normals are set.
    antennas
        Positions of receiver and transmitter, (3,) each [Blender units].
    reach
        Distance of the farthest point that echoes from the antennas [Blender units].
    wavelength, extinction_length
        Of physical and of simple Radar Materials [Blender units].
    range_encoding_length
        k of exp(-l/k) [Blender units].
    losses_db
        Two-way absorption of objects by name.

    Returns
    -------
    Interiors
        What is rounded still.
    """
    distance = reach + max(float(np.linalg.norm(place)) for place in antennas)
    depth = _DEPTH_ROUNDINGS * _EPS32 * distance
    nepers = _ABSORPTION_ROUNDINGS * _EPS32 * range_encoding_length * math.log(10) / 10
    delay, errors, walls = False, {}, []
    # asked once a material, not once an object
    passes, is_inside = cache(delays), cache(has_interior)
    is_whole, lengths = cache(is_entered), cache(_lengths)
    for one in assigned_materials(depsgraph):
        delay |= any(map(passes, one.materials))
        entered = [material for material in one.materials if is_inside(material)]
        loss_db = losses_db.get(one.item.name_full, 0.0)
        shell = attributes.OBJECT_SHELL_THICKNESS in one.item
        if not entered or shell or loss_db > MAX_LOSS_DB:  # nothing comes out
            continue
        per = [lengths(material, wavelength, extinction_length) for material in entered]
        error = _rounding(per, depth, nepers * loss_db)
        errors[one.item.name_full] = one.item, error
        plate = len(set(one.materials)) == 1 and is_whole(one.materials[0])
        if plate and _matters(error, wavelength) and _is_wall(one.item, depsgraph, loss_db):
            walls.append(one.item)
    rims = []
    if walls:
        boxes = _Boxes(depsgraph)
        for item in walls:
            if boxes.empty_inside(item, antennas):
                recorder.set_item(
                    item, attributes.OBJECT_LAYER_AT_FACES, [1.0, _middle(item, depsgraph), 0.0]
                )
                item.update_tag()
                del errors[item.name_full]
                if _echoes_from_its_rim(item, depsgraph):
                    loss_db = losses_db.get(item.name_full, 0.0)
                    rims.append(finding("rim-echoes-weak", item.name_full, power_db=loss_db))
    named = [one for one in errors.values() if _matters(one[1], wavelength)]
    if any(_is_flat(item) for item, _ in named):
        boxes = _Boxes(depsgraph)
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
    """Whether echoes are off by more than the tolerances."""
    return error.power_db > _TOLERANCE_DB or error.length > _TOLERANCE_WAVELENGTHS * wavelength


def _named(name: str, error: _Rounding, wavelength: float) -> Finding:
    """The finding about an object: a caution only where its errors are more than negligible."""
    wavelengths = error.length / wavelength
    said = finding(
        "interior-rounded", name, power_db=error.power_db, length_wavelengths=wavelengths
    )
    small = error.power_db < _DANGER_DB and wavelengths < _DANGER_WAVELENGTHS
    return said.as_information() if small else said


def _lengths(material: Any, wavelength: float, extinction_length: float) -> tuple[float, float]:
    """Loss [dB] and delay [Blender units] of a material, for each Blender unit of depth."""
    kappa, index = (_value(material, name) for name in (EXTINCTION, INDEX))
    per = wavelength if is_entered(material) else extinction_length
    return 4 * math.pi * kappa / per * 10 / math.log(10), index - 1


def _rounding(
    per_unit: Sequence[tuple[float, float]], depth: float, by_absorption: float
) -> _Rounding:
    """What an error of each depth [Blender units] makes of an echo, whichever material it is in."""
    power, length = (max(0.0, *numbers) for numbers in zip(*per_unit, strict=True))
    both_ways = math.sqrt(2) * depth
    return _Rounding(power * both_ways, length * both_ways, by_absorption)


def _value(material: Any, name: str) -> float:
    socket = group_input(material, name)
    return 0.0 if socket is None else float(socket.default_value)


def _is_wall(item: Any, depsgraph: Any, loss_db: float) -> bool:
    """Whether an object of one physical material is a plate whose faces can hold its absorption."""
    if attributes.OBJECT_LAYER_THICKNESS not in item:
        return False
    normal = np.array(item[attributes.OBJECT_LAYER_NORMAL], dtype=np.float64)
    low, _ = LayerFaces.read([item], depsgraph).planes(normal[None], ALL_FACES)
    return loss_db <= FACES_LOSS_DB and not np.isnan(low[0])


def _echoes_from_its_rim(item: Any, depsgraph: Any) -> bool:
    """Whether a rough wall has a rim that counts: waves inside it come back from there."""
    roughness = (_value(slot.material, ROUGHNESS) for slot in item.material_slots)
    normal = np.array(item[attributes.OBJECT_LAYER_NORMAL], dtype=np.float64)
    return max(roughness, default=0.0) > SMOOTH_BELOW and (
        LayerFaces.read([item], depsgraph).rim_fractions(normal[None])[0] > _LEAST_RIM
    )


def _is_flat(item: Any) -> bool:
    """Whether an object lies in one plane, normal to an axis of its own."""
    return bool(min(item.dimensions) <= _FLAT * max(item.dimensions))


def _middle(item: Any, depsgraph: Any) -> float:
    """Place of a layer's middle along its normal, in the object's own units."""
    normal = np.array(item[attributes.OBJECT_LAYER_NORMAL], dtype=np.float64)
    low, high = LayerFaces.read([item], depsgraph).planes(normal[None], ALL_FACES)
    return float(low[0] + high[0]) / 2


class _Boxes:
    """Bounding boxes of all surfaces and their instances at the depsgraph's moment."""

    def __init__(self, depsgraph: Any) -> None:
        poses, boxes, owners = [], [], []
        for one in evaluated_objects(depsgraph):
            if one.visible and one.original.type in SURFACE_TYPES and not one.original.hide_render:
                poses.append(one.matrix)
                boxes.append(one.box)
                owners.append(one.original.as_pointer())
        self._poses, self._own = np.array(poses), np.array(boxes)
        corners = np.einsum("nij,nkj->nki", self._poses[:, :3, :3], self._own)
        self._corners: Real = corners + self._poses[:, None, :3, 3]
        self._owners = np.array(owners)
        self._centres = self._corners.mean(axis=1)
        self._radii = np.linalg.norm(self._corners - self._centres[:, None], axis=2).max(axis=1)

    def empty_inside(self, item: Any, antennas: Sequence[Sequence[float]]) -> bool:
        """Whether no other object and no antenna reaches into an object's box, in any instance."""
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

    def nothing_behind(self, item: Any, antennas: Sequence[Sequence[float]]) -> bool:
        """Whether an object is flat, with all others and the antennas on one side of it."""
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
