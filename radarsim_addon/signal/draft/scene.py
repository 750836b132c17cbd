# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene of triangles, and its paths of one reflection as rows of a path table."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...array_types import Indices, Int32, Real, Single
from ...contract import LinkBudget, ReceiverRecord, TransmitterRecord
from ...physics.radar_equation import lambert_radiance, received_power_w
from ...vectors import crosses, distances, dots, norms
from ..decoding import pixel_rays
from ..paths import PATH_DTYPE, PathRows, replicate_offset_px
from ..radar import Radar, Weather
from .ray_hits import FirstHits, ViewGrid, first_hits
from .surfaces import Angles, DraftSurface


@dataclass(frozen=True)
class DraftMesh:
    """A mesh in its own axes, Blender units.

    Attributes
    ----------
    points, triangles
        Vertices (v, 3), and three of them for each triangle, (m, 3).
    slots
        Material slot of each triangle, (m,).
    normals
        Shading normals at the corners of triangles, (m, 3, 3); empty where the mesh is flat.
    """

    points: Single
    triangles: Int32
    slots: Int32
    normals: Single


@dataclass(frozen=True)
class DraftScene:
    """A scene at one moment: n objects and instances.

    Attributes
    ----------
    radar, link_budget, weather
        What measures; without a link budget the transmitter's EIRP goes in all directions.
    receiver, transmitter
        Antennas; the receiver is perspective.
    range_limits_m
        One-way ranges (start, stop) [m].
    surfaces
        Materials at the carrier.
    meshes
        Key of the mesh of each object, n.
    matrices
        From the axes of each mesh to the world in metres, (n, 4, 4).
    slots
        For each object the number in `surfaces` of each material slot, at least one.
    moves
        What moves each object within `interval_s`, world space in metres, (n + 2, 4, 4); the last
        two are those of receiver and transmitter.
    interval_s
        Time of `moves` [s].
    """

    radar: Radar
    link_budget: LinkBudget | None
    weather: Weather
    receiver: ReceiverRecord
    transmitter: TransmitterRecord
    range_limits_m: tuple[float, float]
    surfaces: Sequence[DraftSurface]
    meshes: Sequence[int]
    matrices: Real
    slots: Sequence[Sequence[int]]
    moves: Real
    interval_s: float


@dataclass(frozen=True)
class SceneTriangles:
    """All triangles of a scene: corners in the receiver's axes [m], one after the other.

    Attributes
    ----------
    points, triangles
        (v, 3) [m] and (m, 3).
    item
        Object of each triangle, (m,).
    surface
        Number of its surface, (m,).
    normals
        Shading normals at the corners of k triangles in the mesh's axes, (k, 3, 3).
    normal_row
        Row of `normals` of each triangle, (m,); -1 for flat ones.
    """

    points: Real
    triangles: Indices
    item: Indices
    surface: Indices
    normals: Single
    normal_row: Indices

    @classmethod
    def of(cls, scene: DraftScene, meshes: Mapping[int, DraftMesh]) -> SceneTriangles:
        """Gather the meshes of a scene."""
        to_receiver = np.linalg.inv(np.array(scene.receiver.matrix_world)) @ scene.matrices
        parts = _Parts()
        for item, key in enumerate(scene.meshes):
            parts.add(item, meshes[key], to_receiver[item], np.array(scene.slots[item]))
        return parts.joined()

    def __len__(self) -> int:
        return len(self.triangles)


@dataclass
class _Parts:
    """Arrays of `SceneTriangles` object by object."""

    points: list[Real] = field(default_factory=list)
    triangles: list[Indices] = field(default_factory=list)
    item: list[Indices] = field(default_factory=list)
    surface: list[Indices] = field(default_factory=list)
    normals: list[Single] = field(default_factory=list)
    normal_row: list[Indices] = field(default_factory=list)
    count: int = 0
    smooth: int = 0

    def add(self, item: int, mesh: DraftMesh, matrix: Real, slots: Indices) -> None:
        here = mesh.points.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        if not (here[:, 2] < 0).any():  # behind the receiver
            return
        size = len(mesh.triangles)
        self.points.append(here)
        self.triangles.append(mesh.triangles.astype(np.intp) + self.count)
        self.item.append(np.full(size, item))
        self.surface.append(slots[np.minimum(mesh.slots, slots.size - 1)])
        row = np.full(size, -1, dtype=np.intp)
        if mesh.normals.size:
            row = np.arange(self.smooth, self.smooth + size)
            self.normals.append(mesh.normals)
            self.smooth += size
        self.normal_row.append(row)
        self.count += len(here)

    def joined(self) -> SceneTriangles:
        none = np.zeros(0, dtype=np.intp)
        return SceneTriangles(
            np.concatenate([np.zeros((0, 3)), *self.points]),
            np.concatenate([none.reshape(0, 3), *self.triangles]),
            np.concatenate([none, *self.item]),
            np.concatenate([none, *self.surface]),
            np.concatenate([np.zeros((0, 3, 3), dtype=np.float32), *self.normals]),
            np.concatenate([none, *self.normal_row]),
        )


def draft_rows(
    scene: DraftScene, triangles: SceneTriangles, columns: int, rows: int, replicates: int
) -> PathRows:
    """Return the paths of one reflection as rows of a path table.

    Parameters
    ----------
    scene, triangles
        The scene and its triangles.
    columns, rows
        Rays across and up.
    replicates
        Number of grids of rays, each moved by fractions of a pixel.

    Returns
    -------
    ndarray
        (paths,), of one tile, replicate by replicate.
    """
    parts = [
        _replicate(scene, triangles, (columns, rows), number, replicates)
        for number in range(replicates)
    ]
    return np.concatenate(parts)


def _replicate(
    scene: DraftScene, triangles: SceneTriangles, size: tuple[int, int], number: int, count: int
) -> PathRows:
    """Rows of one of `count` replicates."""
    receiver = _moved(scene.receiver, size, replicate_offset_px(number))
    grid = ViewGrid(receiver.left, receiver.right, receiver.bottom, receiver.top, *size)
    hits = first_hits(triangles.points, triangles.triangles, grid)
    rays = pixel_rays(receiver, *size)
    direction = rays.direction.reshape(-1, 3)[hits.pixel]
    solid_angle_sr = rays.solid_angle_sr.ravel()[hits.pixel] / count
    places = _Places.of(scene, triangles, hits)
    angles = places.angles(direction)
    brightness = np.zeros(hits.pixel.size)
    surface = triangles.surface[hits.triangle]
    carrier_hz = scene.radar.waveform.carrier_hz
    for one in np.unique(surface):
        mine = surface == one
        some = Angles(*(getattr(angles, f.name)[mine] for f in dataclasses.fields(Angles)))
        brightness[mine] = scene.surfaces[one].brightness(some, carrier_hz)
    echoing = np.flatnonzero(brightness > 0)
    table = np.zeros(echoing.size, dtype=PATH_DTYPE)
    # as bright as a Lambert surface of this albedo at normal incidence
    radiance = lambert_radiance(brightness / 4, scene.transmitter.eirp_w, places.from_transmitter_m)
    power_w = received_power_w(radiance, solid_angle_sr, scene.radar.waveform.wavelength_m)
    columns = {
        "power_w": power_w,
        "solid_angle_sr": solid_angle_sr,
        "length_m": places.from_receiver_m + places.from_transmitter_m,
        "range_rate_mps": places.rates_mps(scene, direction),
        "first_scatterer_m": places.points_m,
        "last_scatterer_m": places.points_m,
        "direction": direction,
        "last_object": places.item + 1,
        "first_object": places.item + 1,
    }
    for name, values in columns.items():
        table[name] = values[echoing]
    table["order"], table["replicate"] = 1, number
    return table


def _moved(
    receiver: ReceiverRecord, size: tuple[int, int], offset: tuple[float, float]
) -> ReceiverRecord:
    """The receiver with its frame moved by fractions of a pixel, across and up."""
    across = (receiver.right - receiver.left) / size[0] * offset[0]
    up = (receiver.top - receiver.bottom) / size[1] * offset[1]
    return dataclasses.replace(
        receiver,
        left=receiver.left + across,
        right=receiver.right + across,
        bottom=receiver.bottom + up,
        top=receiver.top + up,
    )


@dataclass(frozen=True)
class _Places:
    """Where n rays hit: object, place and normals in world space, distances [m]."""

    item: Indices
    points_m: Real
    normal: Real
    flat_normal: Real
    to_transmitter: Real
    from_transmitter_m: Real
    from_receiver_m: Real

    @classmethod
    def of(cls, scene: DraftScene, triangles: SceneTriangles, hits: FirstHits) -> _Places:
        pose = np.array(scene.receiver.matrix_world)
        corners = triangles.points[triangles.triangles[hits.triangle]]
        local = np.einsum("nc,nci->ni", hits.weights, corners)
        flat = crosses(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        flat = _towards(flat, -local) @ pose[:3, :3].T
        points = local @ pose[:3, :3].T + pose[:3, 3]
        item = triangles.item[hits.triangle]
        normal = flat.copy()
        row = triangles.normal_row[hits.triangle]
        smooth = np.flatnonzero(row >= 0)
        if smooth.size:
            own = np.einsum("nc,nci->ni", hits.weights[smooth], triangles.normals[row[smooth]])
            turned = np.linalg.pinv(scene.matrices[:, :3, :3])[item[smooth]]  # used transposed
            own = np.einsum("nji,nj->ni", turned, own)
            normal[smooth] = _towards(own, -local[smooth] @ pose[:3, :3].T)
        away = np.array(scene.transmitter.matrix_world)[:3, 3] - points
        there_m = norms(away)
        return cls(
            item, points, normal, flat, away / there_m[:, None], there_m,
            distances(points, pose[:3, 3]),
        )  # fmt: skip

    def angles(self, direction: Real) -> Angles:
        """Cosines at the surfaces of rays that leave the receiver in these directions."""
        half = self.to_transmitter - direction
        half /= np.maximum(norms(half), 1e-300)[:, None]
        return Angles(
            dots(self.normal, self.to_transmitter),
            np.clip(-dots(self.normal, direction), 0.0, 1.0),
            np.clip(dots(self.normal, half), 0.0, 1.0),
            np.clip(dots(half, self.to_transmitter), 0.0, 1.0),
            -dots(self.flat_normal, direction),
        )

    def rates_mps(self, scene: DraftScene, direction: Real) -> Real:
        """Rate of half the length of each path, (n,) [m/s]."""
        moves = (scene.moves - np.eye(4)) / scene.interval_s
        own = moves[self.item]
        velocity = np.einsum("nij,nj->ni", own[:, :3, :3], self.points_m) + own[:, :3, 3]
        receiver, transmitter = (
            move[:3, :3] @ np.array(pose)[:3, 3] + move[:3, 3]
            for move, pose in (
                (moves[-2], scene.receiver.matrix_world),
                (moves[-1], scene.transmitter.matrix_world),
            )
        )
        back = dots(velocity - receiver, direction)
        return np.asarray((back - dots(velocity - transmitter, self.to_transmitter)) / 2)


def _towards(normals: Real, viewer: Real) -> Real:
    """Unit vectors along normals, on the side of the viewer, (n, 3)."""
    length = np.maximum(norms(normals), 1e-300) * np.where(dots(normals, viewer) < 0, -1, 1)
    return np.asarray(normals / length[:, None])
