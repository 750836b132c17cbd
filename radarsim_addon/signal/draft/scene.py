# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene of triangles, and its paths of one reflection as rows of a path table.

Surfaces are as bright as by the closed forms that the materials' shader nodes follow
(`Surface.brightness`). All surfaces block the ways from receiver and transmitter, also those that
waves pass. The trees in which rays find triangles stay with the meshes: a scene that moves needs no
new ones.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Indices, Mask, Real, crosses, dots, norms
from ...contract import LinkBudget, ReceiverRecord, TransmitterRecord
from ...physics.radar_equation import lambert_radiance, received_power_w
from ..decoding import pixel_rays
from ..motion import BodyMotion, BodyMotions, FrameMotion, Segment
from ..paths import PathRows, motion_of_rows, replicate_offset_px
from ..radar import Radar, Weather
from ..scene import Angles, Mesh, RayScene, Surface, barycentric

#: Distance between antennas at one place, relative to the longest range.
_TOGETHER = 1e-6


@dataclass(frozen=True)
class DraftScene:
    """A scene at one moment: n objects and instances."""

    radar: Radar
    #: None: the transmitter's EIRP goes in all directions.
    link_budget: LinkBudget | None
    weather: Weather
    polarisation: str
    receiver: ReceiverRecord
    transmitter: TransmitterRecord
    range_limits_m: tuple[float, float]
    #: Materials at the carrier.
    surfaces: Sequence[Surface]
    #: Key of the mesh of each object, n.
    meshes: Sequence[int]
    #: From the axes of each mesh to the world in metres, (n, 4, 4).
    matrices: Real
    #: For each object the number in `surfaces` of each material slot, at least one; -1: no echo.
    slots: Sequence[Sequence[int]]
    #: Whether rays from the receiver meet an object, and those from the transmitter, (2, n).
    met: Mask
    #: What moves each object within `interval_s`, world space in metres, (n + 2, 4, 4); the last
    #: two are those of receiver and transmitter.
    moves: Real
    interval_s: float

    def rays(self, meshes: Mapping[int, Mesh]) -> RayScene:
        """Return what rays meet, of meshes by their keys."""
        boxes = np.array([meshes[key].rays.box for key in self.meshes]).reshape(-1, 2, 3)
        keys = np.array(self.meshes, dtype=np.intp)
        return RayScene(self.matrices, boxes, keys, lambda key: meshes[key].rays)

    def motion(self) -> FrameMotion:
        """Return the motion of antennas and objects."""
        antennas = [np.array(one.matrix_world) for one in (self.receiver, self.transmitter)]
        poses = np.concatenate([self.matrices, antennas])
        moving = np.flatnonzero((self.moves != np.eye(4)).any(axis=(1, 2)))
        bodies = BodyMotions(poses, {at: self._moving(at, poses[at]) for at in moving.tolist()})
        return FrameMotion(
            span_s=self.interval_s,
            receiver=bodies[-2],
            emitter=bodies[-1],
            orthographic=self.receiver.kind == "orthographic",
            bodies=bodies[:-2],
        )

    def _moving(self, index: int, pose: Real) -> BodyMotion:
        """Return the motion of a body over the interval: its axes and place change linearly."""
        move = self.moves[index]
        ends = np.array([pose[:3, 3], (move @ pose)[:3, 3]]), np.array([np.eye(3), move[:3, :3]])
        place, turn = (np.stack([(a + b) / 2, (b - a) / 2]) for a, b in ends)
        segment = Segment(0.0, self.interval_s, place, linear=turn.reshape(2, 9))
        return BodyMotion(pose, (segment,))


def draft_rows(
    scene: DraftScene, meshes: Mapping[int, Mesh], columns: int, rows: int, replicates: int
) -> PathRows:
    """Return the paths of one reflection as rows of a path table, of one tile, replicate by
    replicate.

    Each replicate is a grid of columns x rows rays, moved by fractions of a pixel.
    """
    rays, size = scene.rays(meshes), (columns, rows)
    numbers = range(replicates)
    parts = [_replicate(scene, meshes, rays, size, number, replicates) for number in numbers]
    table = PathRows.joined(parts)
    table["range_rate_mps"] = motion_of_rows(table, scene.motion()).range_rates_mps()
    return table


def _replicate(
    scene: DraftScene,
    meshes: Mapping[int, Mesh],
    scene_rays: RayScene,
    size: tuple[int, int],
    number: int,
    count: int,
) -> PathRows:
    """Return the rows of one of `count` replicates."""
    receiver = _moved(scene.receiver, size, replicate_offset_px(number))
    transmitter_m = np.array(scene.transmitter.matrix_world)[:3, 3]
    rays = pixel_rays(receiver, *size)
    direction = rays.direction.reshape(-1, 3)
    origin_m = np.broadcast_to(rays.origin_m, rays.direction.shape).reshape(-1, 3)
    item, face, way_m = scene_rays.first(origin_m, direction, scene.met[0])
    met = np.flatnonzero(item >= 0)
    item, direction, way_m = item[met], direction[met], way_m[met]
    points_m = origin_m[met] + way_m[:, None] * direction
    surface, angles, there_m = _surfaces(scene, meshes, item, face[met], points_m, direction)
    brightness = np.zeros(met.size)
    carrier_hz = scene.radar.waveform.carrier_hz
    for one in np.unique(surface[surface >= 0]).tolist():
        mine = surface == one
        some = Angles(*(getattr(angles, each.name)[mine] for each in dataclasses.fields(Angles)))
        brightness[mine] = scene.surfaces[one].brightness(some, carrier_hz, scene.polarisation)
    lit = np.flatnonzero(brightness > 0)
    if _may_shade(scene, receiver.kind):
        blocked = scene_rays.blocked(transmitter_m, points_m[lit], scene.met[1])
        lit = lit[~blocked]
    solid_angle_sr = rays.solid_angle_sr.ravel()[met[lit]] / count
    # as bright as a Lambert surface of this albedo at normal incidence
    radiance = lambert_radiance(brightness[lit] / 4, scene.transmitter.eirp_w, there_m[lit])
    power_w = received_power_w(radiance, solid_angle_sr, scene.radar.waveform.wavelength_m)
    table = PathRows.zeros(lit.size)
    table["power_w"], table["solid_angle_sr"] = power_w, solid_angle_sr
    table["length_m"] = (way_m + there_m)[lit]
    table["direction"] = direction[lit]
    table["order"], table["replicate"] = 1, number
    for end in ("first", "last"):
        table[f"{end}_scatterer_m"] = points_m[lit]
        table[f"{end}_object"] = table[f"{end}_body"] = item[lit] + 1
    return table


def _moved(
    receiver: ReceiverRecord, size: tuple[int, int], offset: tuple[float, float]
) -> ReceiverRecord:
    """Return the receiver with its frame moved by fractions of a pixel, across and up."""
    across = (receiver.right - receiver.left) / size[0] * offset[0]
    up = (receiver.top - receiver.bottom) / size[1] * offset[1]
    return dataclasses.replace(
        receiver,
        left=receiver.left + across,
        right=receiver.right + across,
        bottom=receiver.bottom + up,
        top=receiver.top + up,
    )


def _may_shade(scene: DraftScene, kind: str) -> bool:
    """Return whether something may lie between the transmitter and what the receiver sees."""
    receiver, transmitter = (
        np.array(one.matrix_world)[:3, 3] for one in (scene.receiver, scene.transmitter)
    )
    apart_m = float(np.linalg.norm(receiver - transmitter))
    together = kind != "orthographic" and apart_m <= _TOGETHER * scene.range_limits_m[1]
    seen, shading = scene.met
    return not together or bool((shading & ~seen).any())


def _surfaces(
    scene: DraftScene,
    meshes: Mapping[int, Mesh],
    item: Indices,
    face: Indices,
    points_m: Real,
    direction: Real,
) -> tuple[Indices, Angles, Real]:
    """Return the number of the surface that each of n rays meets, the angles there, and the
    distances from the transmitter [m].

    The rays meet `item` and `face`; `direction` has their unit vectors (n, 3).
    """
    surface = np.zeros(item.size, dtype=np.intp)
    flat, normal = np.zeros((2, item.size, 3))
    for one in np.unique(item).tolist():
        mine = np.flatnonzero(item == one)
        mesh, matrix = meshes[scene.meshes[one]], scene.matrices[one]
        slots = np.array(scene.slots[one])
        faces, along = face[mine], direction[mine]
        surface[mine] = slots[np.minimum(mesh.slots[mesh.polygons[faces]], slots.size - 1)]
        corners = mesh.vertices[mesh.triangles[faces]] @ matrix[:3, :3].T + matrix[:3, 3]
        across = crosses(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        flat[mine] = normal[mine] = _against(across, along)
        if mesh.corner_normals is not None:
            weights = barycentric(points_m[mine], corners)
            shading = mesh.corner_normals[mesh.triangle_corners[faces]]
            own = np.einsum("nc,nci->ni", weights, shading) @ np.linalg.pinv(matrix[:3, :3])
            normal[mine] = _against(own, along)
    away_m = np.array(scene.transmitter.matrix_world)[:3, 3] - points_m
    there_m = norms(away_m)
    to_transmitter = away_m / there_m[:, None]
    half = to_transmitter - direction
    half /= np.maximum(norms(half), 1e-300)[:, None]
    angles = Angles(
        dots(normal, to_transmitter),
        np.clip(-dots(normal, direction), 0.0, 1.0),
        np.clip(dots(normal, half), 0.0, 1.0),
        np.clip(dots(half, to_transmitter), 0.0, 1.0),
        -dots(flat, direction),
    )
    return surface, angles, there_m


def _against(normals: Real, direction: Real) -> Real:
    """Return unit vectors along the normals that point to the side from which the rays come, (n,
    3).
    """
    length = np.maximum(norms(normals), 1e-300) * np.where(dots(normals, direction) > 0, -1, 1)
    return np.asarray(normals / length[:, None])
