# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene of triangles, and its paths of one reflection as rows of a path table.

Surfaces are as bright as by the closed forms that the materials' shader nodes follow. The trees in
which rays find triangles stay with the meshes: a scene that moves needs no new ones.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from ...arrays import Indices, Int32, Mask, Real, Single, crosses, distances, dots, norms
from ...contract import LinkBudget, ReceiverRecord, TransmitterRecord
from ...physics.clutter import clutter_model
from ...physics.fresnel import unpolarised_reflectance
from ...physics.radar_equation import lambert_radiance, received_power_w
from ...physics.rough import facet_brightness, slope_from_roughness
from ..decoding import pixel_rays
from ..paths import PathRows, replicate_offset_px
from ..radar import Radar, Weather
from ..scene import RayMesh, RayScene, barycentric

SurfaceKind = Literal["silent", "lambert", "simple", "physical"]


@dataclass(frozen=True)
class Angles:
    """Cosines of n rays at a surface, each (n,)."""

    #: Of the angles from the shading normal.
    to_transmitter: Real
    to_receiver: Real
    #: From the shading normal to the facet half way between both antennas.
    to_facet: Real
    #: From that facet's normal to an antenna.
    at_facet: Real
    #: From the normal of the triangle to the receiver.
    to_receiver_flat: Real


@dataclass(frozen=True)
class DraftSurface:
    """A material at the carrier."""

    #: "silent" returns nothing; "lambert" is diffuse; "simple" and "physical" are the two groups of
    #: Radar Materials.
    kind: SurfaceKind
    #: Complex index n + j kappa.
    n: float = 1.0
    kappa: float = 0.0
    #: Of "simple": fraction in the specular lobe; roughness of Cycles, 0 for a mirror.
    specularity: float = 0.0
    roughness: float = 0.0
    #: Of "lambert".
    albedo: float = 0.0
    #: Clutter model of "physical" with its file; "" for none.
    clutter: str = ""
    clutter_path: str = ""
    clutter_parameters: dict[str, float] = field(default_factory=dict)
    polarisation: str = "average"

    def brightness(self, angles: Angles, carrier_hz: float) -> Real:
        """Return 4 pi f cos_in of n rays, f the BRDF, as of `facet_brightness`, (n,) [m^2/m^2]."""
        lambert = 4 * np.maximum(angles.to_transmitter, 0.0)
        if self.kind == "silent":
            return np.zeros(lambert.shape)
        if self.kind == "lambert":
            return np.asarray(self.albedo * lambert)
        index = complex(self.n, self.kappa)
        facets = np.zeros(lambert.shape)
        if self.roughness > 0:
            slope = slope_from_roughness(self.roughness)
            facets = facet_brightness(
                slope, angles.to_transmitter, angles.to_receiver, angles.to_facet
            )
        if self.kind == "simple":
            part = self.specularity
            reflected = unpolarised_reflectance(index, angles.to_receiver)
            return np.asarray(reflected * (part * facets + (1 - part) * lambert))
        total = unpolarised_reflectance(index, angles.at_facet) * facets
        return np.asarray(total + self._clutter(angles, carrier_hz))

    def _clutter(self, angles: Angles, carrier_hz: float) -> Real:
        """Return sigma0 over the cosine of the triangle, which a pixel's area cancels, (n,)."""
        if not self.clutter:
            return np.zeros(angles.to_receiver.shape)
        model = clutter_model(self.clutter, self.clutter_path or None)
        grazing_rad = np.arcsin(np.clip(angles.to_receiver, 0.0, 1.0))
        level_db = model.sigma0_db(
            carrier_hz, grazing_rad, self.polarisation, **self.clutter_parameters
        )
        return np.asarray(10 ** (level_db / 10) / np.maximum(angles.to_receiver_flat, 1e-12))


@dataclass(frozen=True)
class DraftMesh:
    """A mesh in its own axes, Blender units."""

    #: Vertices (v, 3), and three of them for each triangle, (m, 3).
    points: Single
    triangles: Int32
    #: Material slot of each triangle, (m,).
    slots: Int32
    #: Shading normals at the corners of triangles, (m, 3, 3); empty where the mesh is flat.
    normals: Single

    @cached_property
    def rays(self) -> RayMesh:
        """The mesh for rays."""
        return RayMesh(self.points, self.triangles)


@dataclass(frozen=True)
class DraftPolygons:
    """A mesh of triangles and quads in its own axes, as Blender stores it: quick to read."""

    #: Vertices, (v, 3).
    points: Single
    #: Vertex of each corner, polygon after polygon, (c,).
    corners: Int32
    #: First corner of each polygon, (p,), which has three or four of them.
    starts: Int32
    #: Material slot of each polygon, (p,); empty: the first one for all.
    slots: Int32
    #: Shading normals of the corners, (c, 3); empty where the mesh is flat.
    normals: Single

    def triangulated(self) -> DraftMesh:
        """Return the mesh as triangles; quads are cut from their first corner to their third.

        One that has a corner inwards is cut from its second corner to its fourth.
        """
        starts = self.starts.astype(np.intp)
        sides = np.diff(np.append(starts, self.corners.size))
        quads = np.flatnonzero(sides == 4)
        places = starts[quads][:, None] + np.arange(4)
        places = np.where(self._bent(places)[:, None], np.roll(places, -1, axis=1), places)
        whole = np.flatnonzero(sides == 3)
        polygon = np.concatenate([whole, quads, quads])
        corner = np.concatenate(
            [starts[whole][:, None] + np.arange(3), places[:, [0, 1, 2]], places[:, [0, 2, 3]]]
        )
        slots = self.slots[polygon] if self.slots.size else np.zeros(polygon.size, dtype=np.int32)
        normals = self.normals[corner] if self.normals.size else np.zeros((0, 3, 3), np.float32)
        return DraftMesh(self.points, self.corners[corner], slots, normals)

    def _bent(self, places: Indices) -> Mask:
        """Return whether a quad's second and fourth corner lie on one side of the line between
        others.
        """
        first, second, third, fourth = self.points[self.corners[places]].transpose(1, 0, 2)
        along = third - first
        return np.asarray(dots(crosses(second - first, along), crosses(fourth - first, along)) > 0)


@dataclass(frozen=True)
class DraftScene:
    """A scene at one moment: n objects and instances."""

    radar: Radar
    #: None: the transmitter's EIRP goes in all directions.
    link_budget: LinkBudget | None
    weather: Weather
    #: Perspective.
    receiver: ReceiverRecord
    transmitter: TransmitterRecord
    range_limits_m: tuple[float, float]
    #: Materials at the carrier.
    surfaces: Sequence[DraftSurface]
    #: Key of the mesh of each object, n.
    meshes: Sequence[int]
    #: From the axes of each mesh to the world in metres, (n, 4, 4).
    matrices: Real
    #: For each object the number in `surfaces` of each material slot, at least one.
    slots: Sequence[Sequence[int]]
    #: What moves each object within `interval_s`, world space in metres, (n + 2, 4, 4); the last
    #: two are those of receiver and transmitter.
    moves: Real
    interval_s: float


@dataclass(frozen=True)
class SceneTriangles:
    """The triangles of a scene, and what rays meet among them."""

    #: Mesh of each object.
    meshes: Sequence[DraftMesh]
    rays: RayScene

    @classmethod
    def of(cls, scene: DraftScene, meshes: Mapping[int, DraftMesh]) -> SceneTriangles:
        """Gather the meshes of a scene."""
        own = [meshes[key] for key in scene.meshes]
        boxes = np.array([mesh.rays.box for mesh in own]).reshape(-1, 2, 3)
        keys = np.array(scene.meshes, dtype=np.intp)
        return cls(own, RayScene(scene.matrices, boxes, keys, lambda key: meshes[key].rays))

    def __len__(self) -> int:
        return sum(len(mesh.triangles) for mesh in self.meshes)


def draft_rows(
    scene: DraftScene, triangles: SceneTriangles, columns: int, rows: int, replicates: int
) -> PathRows:
    """Return the paths of one reflection as rows of a path table, of one tile, replicate by
    replicate.

    Each replicate is a grid of columns x rows rays, moved by fractions of a pixel.
    """
    parts = [
        _replicate(scene, triangles, (columns, rows), number, replicates)
        for number in range(replicates)
    ]
    return PathRows.joined(parts)


def _replicate(
    scene: DraftScene, triangles: SceneTriangles, size: tuple[int, int], number: int, count: int
) -> PathRows:
    """Return the rows of one of `count` replicates."""
    receiver = _moved(scene.receiver, size, replicate_offset_px(number))
    rays = pixel_rays(receiver, *size)
    direction = rays.direction.reshape(-1, 3)
    item, face, way = triangles.rays.first(rays.origin_m, direction)
    pixel = np.flatnonzero(item >= 0)
    direction, solid_angle_sr = direction[pixel], rays.solid_angle_sr.ravel()[pixel] / count
    points_m = rays.origin_m + way[pixel, None] * direction
    places = _Places.of(scene, triangles.meshes, item[pixel], face[pixel], points_m)
    angles = places.angles(direction)
    brightness = np.zeros(pixel.size)
    carrier_hz = scene.radar.waveform.carrier_hz
    for one in np.unique(places.surface):
        mine = places.surface == one
        some = Angles(*(getattr(angles, f.name)[mine] for f in dataclasses.fields(Angles)))
        brightness[mine] = scene.surfaces[one].brightness(some, carrier_hz)
    echoing = np.flatnonzero(brightness > 0)
    table = PathRows.zeros(echoing.size)
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


@dataclass(frozen=True)
class _Places:
    """Where n rays hit: object, surface, place and normals in world space, distances [m]."""

    item: Indices
    surface: Indices
    points_m: Real
    normal: Real
    flat_normal: Real
    to_transmitter: Real
    from_transmitter_m: Real
    from_receiver_m: Real

    @classmethod
    def of(
        cls,
        scene: DraftScene,
        meshes: Sequence[DraftMesh],
        item: Indices,
        face: Indices,
        points_m: Real,
    ) -> _Places:
        receiver_m = np.array(scene.receiver.matrix_world)[:3, 3]
        surface = np.zeros(item.size, dtype=np.intp)
        flat, normal = np.zeros((2, item.size, 3))
        for one in np.unique(item).tolist():
            mine = np.flatnonzero(item == one)
            mesh, matrix, slots = meshes[one], scene.matrices[one], np.array(scene.slots[one])
            surface[mine] = slots[np.minimum(mesh.slots[face[mine]], slots.size - 1)]
            corners = mesh.points[mesh.triangles[face[mine]]] @ matrix[:3, :3].T + matrix[:3, 3]
            away = receiver_m - points_m[mine]
            across = crosses(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            flat[mine] = normal[mine] = _towards(across, away)
            if mesh.normals.size:
                weights = barycentric(points_m[mine], corners)
                own = np.einsum("nc,nci->ni", weights, mesh.normals[face[mine]])
                normal[mine] = _towards(own @ np.linalg.pinv(matrix[:3, :3]), away)
        away = np.array(scene.transmitter.matrix_world)[:3, 3] - points_m
        there_m = norms(away)
        return cls(
            item, surface, points_m, normal, flat, away / there_m[:, None], there_m,
            distances(points_m, receiver_m),
        )  # fmt: skip

    def angles(self, direction: Real) -> Angles:
        """Return the cosines at the surfaces of rays that leave the receiver in these
        directions.
        """
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
        """Return the rate of half the length of each path, (n,)."""
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
    """Return unit vectors along normals, on the side of the viewer, (n, 3)."""
    length = np.maximum(norms(normals), 1e-300) * np.where(dots(normals, viewer) < 0, -1, 1)
    return np.asarray(normals / length[:, None])
