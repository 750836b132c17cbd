# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene of triangles, and its paths of one reflection as rows of a path table.

Surfaces are as bright as by the closed forms that the materials' shader nodes follow.

The first triangle that each ray of a perspective view meets is found by projection. All rays begin
at one point. A triangle with corners a, b, c is met by the direction d where d . (b x c), d . (c x
a) and d . (a x b) have one sign; these three are proportional to the weights of the corners, and no
triangle needs to be cut at the plane of the view. Only pixels within the projected box of a
triangle are tried. Nothing is built in advance, so a scene that moves or deforms costs no more than
one that does not. View axes are Blender's: x to the right, y up, looking along -z.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
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


#: Triangles, and pairs of triangle and pixel, that are tried at once: a few megabytes.
_TRIANGLES, _PAIRS = 1 << 15, 1 << 17


@dataclass(frozen=True)
class ViewGrid:
    """Pixels of a perspective view: its edges at distance 1, columns and rows; row 0 is the top
    one.
    """

    left: float
    right: float
    bottom: float
    top: float
    columns: int
    rows: int

    def places(self, column: Indices, row: Indices) -> tuple[Real, Real]:
        """Return x and y of the centres of pixels at distance 1, each (n,)."""
        across = (self.right - self.left) / self.columns
        down = (self.top - self.bottom) / self.rows
        x, y = self.left + (column + 0.5) * across, self.top - (row + 0.5) * down
        return np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)


@dataclass(frozen=True)
class FirstHits:
    """The first triangle along n rays that meet one."""

    #: row * columns + column, ascending, (n,).
    pixel: Indices
    #: Number of the triangle, (n,).
    triangle: Indices
    #: Of its corners, adding up to 1, (n, 3).
    weights: Real
    #: Along -z of the view, (n,).
    distance: Real


def first_hits(points: Real, triangles: Indices, grid: ViewGrid) -> FirstHits:
    """Return the first triangle along the ray through the centre of each pixel, seen from either
    side.

    `points` (points, 3) are corners in view axes, `triangles` (triangles, 3) numbers of corners.
    """
    pixels = grid.columns * grid.rows
    nearest = np.full(pixels, np.inf)
    triangle = np.full(pixels, -1, dtype=np.intp)
    weights = np.zeros((pixels, 3))
    ahead = -points[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        projected = points[:, 0] / ahead, points[:, 1] / ahead
    for start in range(0, len(triangles), _TRIANGLES):
        part = triangles[start : start + _TRIANGLES]
        boxes = _boxes(part, ahead, projected, grid)
        kept = np.flatnonzero((boxes[1] > 0) & (boxes[3] > 0))
        boxes = boxes[:, kept]
        counts = boxes[1] * boxes[3]
        ends = np.cumsum(counts)
        first = 0
        while first < kept.size:
            before = ends[first] - counts[first]
            last = max(int(np.searchsorted(ends, before + _PAIRS, side="right")), first + 1)
            some = kept[first:last]
            corners = points[part[some]]
            pixel, number, weight, distance = _tried(corners, boxes[:, first:last], grid)
            np.minimum.at(nearest, pixel, distance)
            won = nearest[pixel] == distance
            triangle[pixel[won]] = start + some[number[won]]
            weights[pixel[won]] = weight[won]
            first = last
    seen = np.flatnonzero(triangle >= 0)
    return FirstHits(seen, triangle[seen], weights[seen], nearest[seen])


def _boxes(
    triangles: Indices, ahead: Real, projected: tuple[Real, Real], grid: ViewGrid
) -> Indices:
    """Return first column, columns, first row and rows of the pixels that triangles may cover, (4,
    n).
    """
    distance = [ahead[triangles[:, corner]] for corner in range(3)]
    in_front = np.minimum(np.minimum(distance[0], distance[1]), distance[2]) > 0
    behind = np.maximum(np.maximum(distance[0], distance[1]), distance[2]) <= 0
    found = np.empty((4, len(triangles)), dtype=np.intp)
    limits = (
        (projected[0], grid.left, (grid.right - grid.left) / grid.columns, grid.columns),
        (projected[1], grid.top, (grid.bottom - grid.top) / grid.rows, grid.rows),
    )
    for axis, (place, origin, step, count) in enumerate(limits):
        with np.errstate(invalid="ignore"):
            at = (place - origin) / step - 0.5
            ends = [at[triangles[:, corner]] for corner in range(3)]
            low = np.minimum(np.minimum(ends[0], ends[1]), ends[2])
            high = np.maximum(np.maximum(ends[0], ends[1]), ends[2])
        # one that reaches behind the view may cover any pixel
        low = np.where(in_front, np.clip(np.ceil(low), 0, count), 0)
        high = np.where(in_front, np.clip(np.floor(high), -1, count - 1), count - 1)
        found[2 * axis] = low
        found[2 * axis + 1] = np.where(behind, 0, np.maximum(high - low + 1, 0))
    return found


def _tried(corners: Real, boxes: Indices, grid: ViewGrid) -> tuple[Indices, Indices, Real, Real]:
    """Return pixels of triangles (n, 3, 3), their triangles' numbers, weights and distances."""
    columns = boxes[1]
    counts = columns * boxes[3]
    number = np.repeat(np.arange(counts.size), counts)
    place = np.arange(number.size) - np.repeat(np.cumsum(counts) - counts, counts)
    row, column = np.divmod(place, columns[number])
    row, column = row + boxes[2][number], column + boxes[0][number]
    x, y = grid.places(column, row)
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normals = [crosses(b, c), crosses(c, a), crosses(a, b)]
    volume = dots(a, normals[0])
    side = np.sign(volume)
    parts = []
    inside: Mask = side[number] != 0
    for normal in normals:
        p, q, r = (normal * side[:, None])[number].T
        parts.append(p * x + q * y - r)
        inside &= parts[-1] >= 0
    total = parts[0] + parts[1] + parts[2]
    inside &= total > 0
    number, total = number[inside], total[inside]
    weights = np.stack([part[inside] / total for part in parts], axis=1)
    pixel = (row * grid.columns + column)[inside]
    return pixel, number, weights, np.abs(volume)[number] / total


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
    """All m triangles of a scene: corners in the receiver's axes, one after the other."""

    #: (v, 3) [m] and (m, 3).
    points: Real
    triangles: Indices
    #: Object, and number of the surface, of each triangle, (m,).
    item: Indices
    surface: Indices
    #: Shading normals at the corners of k triangles in the mesh's axes, (k, 3, 3).
    normals: Single
    #: Row of `normals` of each triangle, (m,); -1 for flat ones.
    normal_row: Indices

    @classmethod
    def of(cls, scene: DraftScene, meshes: Mapping[int, DraftMesh]) -> SceneTriangles:
        """Gather the meshes of a scene that are not behind the receiver."""
        to_receiver = np.linalg.inv(np.array(scene.receiver.matrix_world)) @ scene.matrices
        none = np.zeros(0, dtype=np.intp)
        points, triangles = [np.zeros((0, 3))], [none.reshape(0, 3)]
        items, surfaces, normal_rows = [none], [none], [none]
        normals = [np.zeros((0, 3, 3), dtype=np.float32)]
        count = smooth = 0
        for item, key in enumerate(scene.meshes):
            mesh, matrix, slots = meshes[key], to_receiver[item], np.array(scene.slots[item])
            here = mesh.points.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
            if not (here[:, 2] < 0).any():
                continue
            size = len(mesh.triangles)
            points.append(here)
            triangles.append(mesh.triangles.astype(np.intp) + count)
            items.append(np.full(size, item))
            surfaces.append(slots[np.minimum(mesh.slots, slots.size - 1)])
            row = np.full(size, -1, dtype=np.intp)
            if mesh.normals.size:
                row = np.arange(smooth, smooth + size)
                normals.append(mesh.normals)
                smooth += size
            normal_rows.append(row)
            count += len(here)
        return cls(
            np.concatenate(points),
            np.concatenate(triangles),
            np.concatenate(items),
            np.concatenate(surfaces),
            np.concatenate(normals),
            np.concatenate(normal_rows),
        )

    def __len__(self) -> int:
        return len(self.triangles)


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
