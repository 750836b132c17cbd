# SPDX-License-Identifier: GPL-3.0-or-later
"""Speckle that belongs to the surface: scatterers tied to the objects' own coordinates.

A rough surface is cut into cells of an edge c in the axes of its object (`SurfaceCells`). Each cell
has a scatterer at a random place in it, of random height h: both come from a hash of seed, object
and cell, so they are the same at every pulse, in every frame and view, and for every grid of
pixels. With the wavevector change kappa = k |u_in - u_out| (2 k cos for a facet that mirrors back)
a path has

    sqrt(P) g (exp(j kappa h) - m) / sqrt(1 - m^2) exp(-j k (l_c - l))

of zero mean, m = exp(-(kappa h_rms)^2 / 2). Its phase is that of a path via the cell's scatterer,
of length l_c instead of l. All paths of one cell use this scatterer; P_cell is the sum of their
powers P. With g = sqrt(P / P_cell), the mean power of a cell is P_cell, however fine the pixels
are. Where the height is unknown m = 0: fully developed speckle.

The scatterer moves with its body, and all paths of its cell move with it: on a body that turns they
would otherwise lose their common phase. On a body that turns, the scatterer is kept inside the box
of the mesh: beyond the tip of a rotor blade it would move faster than any point of the blade. On a
stationary body all paths of a cell have one delay, that of the power-weighted mean of their
lengths. If each path kept its own delay, a receiver that resolves these delays in part would lose
power. A cell that is deeper than the range resolution is split into parts of that depth, each with
its own scatterer.

A surface of small height also has a coherent part, m^2 = exp(-(2 k h_rms cos)^2) of the power
(Ament 1953). It is left out: as a sum over pixel centres its level grows with the number of pixels
in a Fresnel zone, by 6 dB for each doubling of the resolution.

Cells as large as the pixels' footprints make speckle the same from view to view; finer cells would
be hit or missed by chance.

Clutter that fluctuates (`SurfaceFluctuations`) has two parts: a texture (a field in the object's
own coordinates) and scatterers with velocities. The scatterers keep their velocities from frame to
frame.

`SurfaceSpeckle` goes through the table once: it adds up the power of each cell (`_add_up`), draws
the cells' scatterers (`_draw`), then gives rows their factors (`scattering`).
"""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import Complex, Indices, Integers, Real, are_finite, distances, take_rows
from ...contract import FluctuationRecord, PathsRecord
from ...errors import ConfigError
from ...findings import Finding, finding
from ...physics.clutter import clutter_velocities, texture
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..paths import (
    PathRows,
    TableFootprints,
    has_images,
    images_of,
    iter_rows,
    scatterer_rows,
)
from .amplitudes import hash_step, uniform


class VertexView:
    """Lengths and deflections of paths over given vertices, seen from the antennas of a table."""

    def __init__(self, record: PathsRecord) -> None:
        self.receiver_m = np.asarray(record.receiver.matrix_world, dtype=np.float64)[:3, 3]
        self.emitter_m = np.asarray(record.transmitter.matrix_world, dtype=np.float64)[:3, 3]
        self.orthographic = record.receiver.kind == "orthographic"
        self._images = record.images

    def _antennas_m(self, rows: PathRows) -> tuple[Real, Real]:
        """Return places of receiver and transmitter, or of their images, (3,) or (n, 3) [m]."""
        images = images_of(rows, self._images)
        if images is None:
            return self.receiver_m, self.emitter_m
        return images.places(0, self.receiver_m), images.places(1, self.emitter_m)

    def length_m(
        self, first_scatterer_m: Real, last_scatterer_m: Real, rows: PathRows, images: bool = True
    ) -> Real:
        """Return the length over two points, or over one at order 1 [m]. Without `images`, paths go
        straight to the antennas.
        """
        order, direction = rows["order"], rows["direction"]
        receiver_m, emitter_m = self.receiver_m, self.emitter_m
        if images:
            receiver_m, emitter_m = self._antennas_m(rows)
        length_m = distances(last_scatterer_m, emitter_m)
        two = np.flatnonzero(order == 2)
        length_m[two] += distances(last_scatterer_m[two], first_scatterer_m[two])
        if self.orthographic:
            return length_m + np.sum(direction * (first_scatterer_m - self.receiver_m), axis=-1)
        length_m += distances(first_scatterer_m, receiver_m)
        return length_m

    def turns(self, rows: PathRows) -> tuple[Real, Real]:
        """Return |u_in - u_out| at the first and at the last vertex."""
        receiver_m, emitter_m = self._antennas_m(rows)
        into_first = rows["direction"]
        if receiver_m.ndim > 1:
            over = rows["receiver_image"] != 0
            straight = _unit(rows["first_scatterer_m"] - receiver_m)
            into_first = np.where(over[:, None], straight, into_first)
        out_last = _unit(emitter_m - rows["last_scatterer_m"])
        between = _unit(rows["last_scatterer_m"] - rows["first_scatterer_m"])
        two = (rows["order"] == 2)[:, None]
        first = np.where(two, into_first - between, 0.0)
        last = np.where(two, between, into_first) - out_last
        return np.linalg.norm(first, axis=-1), np.linalg.norm(last, axis=-1)


def _unit(vectors: Real) -> Real:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(length > 0, vectors / length, 0.0)


Hash = NDArray[np.uint64]

#: Axes of the world, in which poses are at its origin.
_WORLD = np.eye(3)
#: Where the origin lies in its cell: at no simple fraction of it.
_OFFSET = np.array([0.4142135623730950, 0.7320508075688772, 0.2360679774997896])


def distinct(keys: Hash) -> tuple[Hash, Indices, Indices]:
    """Return the sorted distinct keys, the first place of each, and the number of every key among
    them. This is `numpy.unique` without its stable sort.
    """
    order = np.argsort(keys)
    ranked = keys[order]
    starts = np.flatnonzero(np.append(True, ranked[1:] != ranked[:-1])[: keys.size])
    place = np.empty(keys.size, dtype=np.intp)
    place[order] = np.repeat(np.arange(starts.size), np.diff(starts, append=keys.size))
    if not starts.size:
        return ranked, starts, place
    return ranked[starts], np.minimum.reduceat(order, starts), place


@dataclass(frozen=True)
class Body:
    """A body to which cells are fixed."""

    name: str  #: unique
    pose: Real  #: (4, 4) [m]
    #: Lowest and highest corner of its mesh in its own axes (2, 3) [m at scale 1]; None: scatterers
    #: may lie anywhere in their cells.
    box: Real | None = None
    turns: bool = False  #: its parts have different velocities

    @property
    def extent_m(self) -> Real:
        """Lowest and highest coordinate along the axes of `rotation`, (2, 3) [m]."""
        if self.box is None:
            return np.array([[-np.inf] * 3, [np.inf] * 3])
        corners = np.array(list(itertools.product(*self.box.T)))
        corners_m = corners @ self.pose[:3, :3].T @ self.rotation
        return np.array([corners_m.min(axis=0), corners_m.max(axis=0)])

    @property
    def rotation(self) -> Real:
        """The nearest rotation to the pose's axes, (3, 3); a mirror stays one."""
        left, _, right = np.linalg.svd(self.pose[:3, :3])
        return np.asarray(left @ right, dtype=np.float64)


@dataclass(frozen=True)
class Cells:
    """Cells of n vertices."""

    state: Hash  #: (n,)
    corner: Real  #: numbers of the cells along the axes, (3, n)
    body: Integers  #: (n,)
    pose: Integers  #: (n,)
    edge_m: Real  #: (n,) [m]


class SurfaceCells:
    """Cells of an edge [m], or of their object's where that is larger (`lengths_m` by its number),
    and at least of `coarse_m` on bodies that do not turn. `bodies` go by the numbers in the table's
    columns `columns`, of first and last vertex.
    """

    def __init__(
        self,
        bodies: Mapping[int, Body],
        columns: tuple[str, str],
        lengths_m: Real,
        seed: int,
        edge_m: float,
        coarse_m: float = 0.0,
    ) -> None:
        self._columns, self._lengths_m = columns, lengths_m
        # numbers of no body are in world space, at 0 and at the end
        self._most = max(bodies, default=0) + 1
        self._starts = np.full(self._most + 1, np.uint64(seed % 2**64))
        self._pose = np.zeros(self._most + 1, dtype=np.intp)
        self._poses = [(_WORLD, np.zeros(3))]
        self._edges_m = np.full(self._most + 1, max(edge_m, coarse_m))
        self._extents_m = np.tile(np.array([-np.inf, np.inf])[:, None, None], (3, self._most + 1))
        known = {self._poses[0][0].tobytes() + self._poses[0][1].tobytes(): 0}
        for number, body in bodies.items():
            name = hashlib.sha256(body.name.encode()).digest()[:8]
            self._starts[number] ^= np.uint64(int.from_bytes(name))
            self._extents_m[:, :, number] = body.extent_m
            if body.turns:
                self._edges_m[number] = edge_m
            pose = body.rotation, np.ascontiguousarray(body.pose[:3, 3])
            key = pose[0].tobytes() + pose[1].tobytes()
            if key not in known:
                known[key] = len(self._poses)
                self._poses.append(pose)
            self._pose[number] = known[key]
        # Mixed before the cells come in: seed 1 must not be seed 0 with its cells swapped.
        self._starts = hash_step(self._starts)

    def of(self, rows: PathRows, first: bool) -> Cells:
        """Return for each row the cell of the surface in which its first or last vertex lies.

        The body and place of each vertex must be known.
        """
        body = np.clip(rows[self._columns[0 if first else 1]], 0, self._most)
        length_m = self._lengths_m[rows["first_object" if first else "last_object"]]
        edge_m = np.maximum(self._edges_m[body], length_m)
        pose, state = self._pose[body], self._starts[body]
        corner = np.array(rows["first_scatterer_m" if first else "last_scatterer_m"].T, order="C")
        for mine, rotation, origin_m in self._by_pose(pose):
            if rotation is _WORLD:
                continue
            arm_m = corner[:, mine] - origin_m[:, None]
            if not np.array_equal(rotation, _WORLD):
                arm_m = (np.ascontiguousarray(arm_m.T) @ rotation).T
            corner[:, mine] = arm_m
        corner /= edge_m
        # Faces lie on round coordinates more often than not: no border of cells may.
        corner += _OFFSET[:, None]
        np.floor(corner, out=corner)
        for place in corner:
            state = hash_step(state ^ place.astype(np.int64).view(np.uint64))
        return Cells(state, corner, body, pose, edge_m)

    def _by_pose(self, pose: Integers) -> Iterator[tuple[Integers | slice, Real, Real]]:
        """Yield rows, rotation and origin of each pose."""
        found = np.flatnonzero(np.bincount(pose))
        for number in found.tolist():
            mine = slice(None) if found.size == 1 else np.flatnonzero(pose == number)
            yield mine, *self._poses[number]

    def local_m(self, cells: Cells) -> Real:
        """Return the scatterers of cells in the axes of their bodies, inside these bodies, (n, 3)
        [m].
        """
        draw, points_m = cells.state, np.empty((cells.state.size, 3))
        held = np.flatnonzero(np.isfinite(self._extents_m[0, 0, cells.body]))
        for axis, corner in enumerate(cells.corner):
            draw = hash_step(draw)
            starts_m = corner - _OFFSET[axis]
            points_m[:, axis] = cells.edge_m * (uniform(draw) + starts_m)
            if held.size:
                within_m = np.stack([starts_m[held], starts_m[held] + 1]) * cells.edge_m[held]
                low_m, high_m = np.clip(within_m, *self._extents_m[:, axis, cells.body[held]])
                points_m[held, axis] = low_m + uniform(draw[held]) * (high_m - low_m)
        return points_m

    @property
    def largest_m(self) -> float:
        """Largest edge of a cell [m]."""
        return float(max(self._edges_m.max(), self._lengths_m.max()))

    def centres_m(self, cells: Cells) -> Real:
        """Return centres of cells, (n, 3) [m]."""
        return self._in_world(cells, ((cells.corner - _OFFSET[:, None] + 0.5) * cells.edge_m).T)

    def _in_world(self, cells: Cells, points_m: Real) -> Real:
        """Transform points from the axes of the cells' bodies to world space, in place."""
        for mine, rotation, origin_m in self._by_pose(cells.pose):
            if rotation is _WORLD:
                continue
            if not np.array_equal(rotation, _WORLD):
                points_m[mine] = points_m[mine] @ rotation.T
            points_m[mine] += origin_m
        return points_m

    def scatterers(self, cells: Cells) -> tuple[Real, Real]:
        """Return scatterers (n, 3) [m] and unit Gaussian heights (n,) of cells."""
        return self._in_world(cells, self.local_m(cells)), self.heights(cells.state)

    @staticmethod
    def heights(states: Hash) -> Real:
        """Return unit Gaussian heights from hashes, (n,)."""
        first_draw = hash_step(states ^ np.uint64(0x5851F42D4C957F2D))
        second_draw = hash_step(first_draw)
        # Box and Muller; 1 - u is never 0
        return np.asarray(
            np.sqrt(-2 * np.log(1 - uniform(first_draw))) * np.cos(2 * np.pi * uniform(second_draw))
        )

    def keys(self, rows: PathRows) -> Hash:
        """Return one number for all paths over the same cells, in the same way."""
        apart, last = self.apart(rows), self.of(rows, False).state
        first = last.copy()
        if apart.size:
            first[apart] = self.of(rows[apart], True).state
        way = rows["order"].astype(np.uint64) << np.uint64(32)
        way |= rows["transparent_depth"].astype(np.uint64)
        return hash_step(hash_step(first ^ way) ^ last)

    def apart(self, rows: PathRows) -> Indices:
        """Return the rows whose first vertex differs from the last one. Rows of one reflection are
        not among them.
        """
        same = rows["first_object"] == rows["last_object"]
        same &= rows[self._columns[0]] == rows[self._columns[1]]
        for first_m, last_m in zip(rows["first_scatterer_m"].T, rows["last_scatterer_m"].T):
            same &= first_m == last_m
        return np.flatnonzero(~same)


#: Tells these draws from those of places and heights.
_DRAWS = np.uint64(0xD1B54A32D192ED03)


def grazing_cosines(rows: PathRows) -> Real:
    """Return the cosines of the grazing angles of rows, (n,). Surfaces with motion of their own are
    level, so the grazing angle is the elevation of the ray.
    """
    return np.asarray(np.sqrt(np.maximum(1 - rows["direction"][:, 2] ** 2, 0.0)))


class SurfaceFluctuations:
    """Draws texture and velocities; `surfaces` goes by the number of the object, from 1."""

    def __init__(
        self,
        cells: SurfaceCells,
        surfaces: Mapping[int, FluctuationRecord],
        seed: int,
        wavelength_m: float,
    ) -> None:
        self._cells, self._surfaces = cells, surfaces
        self._seed, self._wavelength_m = seed, wavelength_m

    def __bool__(self) -> bool:
        return bool(self._surfaces)

    def of_vertex(self, rows: PathRows, cells: Cells, first: bool) -> tuple[Real, Real]:
        """Return, for the cells of a vertex of rows, factors on the power and velocities along the
        line of sight [m/s], (n,) each. They are 1 and 0 at surfaces that do not fluctuate.
        """
        factors, rates_mps = np.ones(rows.size), np.zeros(rows.size)
        objects = rows["first_object" if first else "last_object"]
        counts = (rows["order"] > 1) if first else np.ones(rows.size, dtype=bool)
        own_m = self._cells.local_m(cells)
        draw = hash_step(cells.state ^ _DRAWS)
        draws = uniform(draw), uniform(hash_step(draw))
        cosine = grazing_cosines(rows)
        for number, surface in self._surfaces.items():
            mine = np.flatnonzero((objects == number) & counts)
            if not mine.size:
                continue
            factors[mine] = texture(
                own_m[mine],
                surface.texture,
                surface.texture_shape,
                surface.texture_length_m,
                self._seed + number,
            )
            rates_mps[mine] = clutter_velocities(
                surface.motion,
                surface.motion_speed_mps,
                surface.motion_fraction,
                (draws[0][mine], draws[1][mine]),
                cosine[mine],
                self._wavelength_m,
            )
        return factors, rates_mps


#: Scatterers in a resolution cell from which its intensity is taken to be exponential.
ENOUGH_SCATTERERS = 40


@dataclass(frozen=True)
class SpeckleReport:
    """Statistics of the cells of a frame."""

    cell_m: float  #: edge of a cell [m]; larger where a material's correlation length is
    cells: int  #: that paths hit
    #: Effective number of scatterers in a range cell, (sum P)^2 / sum P^2 over its cells: the
    #: median over the power.
    median_scatterers: float
    undersampled_power_fraction: float  #: in range cells of fewer than `ENOUGH_SCATTERERS`
    #: Fraction of the power that the roughness leaves coherent, mean of m^2: not formed as such.
    coherent_power_fraction: float = 0.0
    coherent_objects: tuple[str, ...] = ()  #: names; more than 1 % of the power is theirs

    @property
    def findings(self) -> list[Finding]:
        """Too few scatterers for speckle, and coherent parts left out, where it is so."""
        found = []
        if self.undersampled_power_fraction >= 0.2:
            found.append(
                finding(
                    "few-scatterers",
                    fraction=self.undersampled_power_fraction,
                    enough=ENOUGH_SCATTERERS,
                    median=self.median_scatterers,
                )
            )
        if self.coherent_objects:
            found.append(
                finding(
                    "coherent-part-not-formed",
                    *self.coherent_objects,
                    fraction=self.coherent_power_fraction,
                )
            )
        return found


#: Footprints in the edge of a cell, at least: a cell then holds two paths or more.
_FOOTPRINTS = 1.5
#: Cells in the range resolution, at most, where the parts of a body do not move on their own: finer
#: ones gain nothing. Doppler resolves the parts of a body that turns.
_CELLS_IN_RESOLUTION = 8
#: Cells are at least as large as this, those of what is nearer than all scenes too [m].
_LEAST_CELL_M = 1e-12
#: Larger cells than this are a unit error [m].
_LARGEST_CELL_M = 1e6
#: Smaller exponents of m leave too few digits of exp(j kappa h) - m: phases are then even.
_SMOOTH = 1e-6
#: Coherent fractions of the power that are worth a word.
_COHERENT = 0.01
#: Rows of a table whose cells are kept.
_KEPT_ROWS = 1 << 20
#: Powers of two of float64, and some more.
_EXPONENTS = 2200


@dataclass(frozen=True)
class Roughness:
    """Rms height and correlation length of a surface [m]; correlation length 0: unknown."""

    rms_height_m: float
    correlation_length_m: float = 0.0


@dataclass(frozen=True)
class Scattering:
    """Scattering of n paths; each field is (n,)."""

    factor: Complex  #: without the phase of the length over the scatterers
    longer_m: Real  #: length over the scatterers, minus the path's own [m]
    common_m: Real  #: mean length of the cell's paths, minus the path's own [m]
    cell: Indices  #: its number
    #: Range rate by the motion of the clutter itself [m/s]; None: none moves.
    sway_mps: Real | None = None


class SurfaceSpeckle:
    """Amplitude factors of the paths of one frame, from a seed.

    `bodies` and `roughness` (objects left out are fully rough) go by the numbers in the table, from
    1; `body_columns` are those of first and last vertex. `resolution_m` is for statistics and the
    finest cell, `cell_m` a cell's edge [m]; None: a power of two from the footprints. `footprints`
    spreads the rows over what their pixels cover; None: rows are points. `fluctuations` are of
    objects whose clutter has texture or moves.
    """

    def __init__(
        self,
        record: PathsRecord,
        table: PathRows,
        bodies: Mapping[int, Body],
        body_columns: tuple[str, str],
        carrier_hz: float,
        resolution_m: float,
        seed: int,
        roughness: Mapping[int, Roughness] | None = None,
        cell_m: float | None = None,
        footprints: TableFootprints | None = None,
        fluctuations: Mapping[int, FluctuationRecord] | None = None,
    ) -> None:
        self._table, self._footprints = table, footprints
        self._wavenumber = 2 * math.pi * carrier_hz / SPEED_OF_LIGHT_MPS
        self._view = VertexView(record)
        self._resolution_m = resolution_m
        self._heights = np.full(len(record.objects) + 1, np.nan)
        lengths_m = np.zeros(len(record.objects) + 1)
        for number, surface in (roughness or {}).items():
            self._heights[number] = surface.rms_height_m
            lengths_m[number] = surface.correlation_length_m
        if cell_m is not None and not (math.isfinite(cell_m) and 0 < cell_m <= _LARGEST_CELL_M):
            raise ConfigError(
                f"Edge of a speckle cell is {cell_m!r} m; expected more than 0 and at most "
                f"{_LARGEST_CELL_M:g} m, or none for one that fits the pixels."
            )
        coarse_m = 0.0
        if cell_m is None:
            cell_m = self._automatic_cell_m()
            coarse_m = _power_of_two(resolution_m / _CELLS_IN_RESOLUTION)
        self.cell_m = max(cell_m, coarse_m)
        self._cells = SurfaceCells(bodies, body_columns, lengths_m, seed, cell_m, coarse_m)
        self._fluctuations = SurfaceFluctuations(
            self._cells, fluctuations or {}, seed, SPEED_OF_LIGHT_MPS / carrier_hz
        )
        #: Of each key, where there are any: texture (keys,), velocities of both vertices.
        self._texture, self._sway_mps = np.ones(0), np.zeros((2, 0))
        self._objects = record.objects
        #: Rows that come again for their echoes, and their cells.
        self._placed: list[tuple[PathRows, Indices]] = []
        self._keys, self._powers, self._leaders, places_m = self._add_up()
        self._scatterers_m, self._units, self._over_m = self._draw(places_m)
        # what is alike for all paths of a cell where no height is known
        self._even: Complex | None = None
        if not np.isfinite(self._heights).any():
            order = scatterer_rows(self._table[self._leaders])["order"]
            self._even = np.exp(1j * _even_phases(self._units, order))

    def _automatic_cell_m(self) -> float:
        """Return the power of two above a footprint that covers half of the power."""
        # power by the power of two that is at least 1.5 footprints, from 2^-1074 on
        powers = np.zeros(_EXPONENTS)
        for rows in iter_rows(self._table):
            wanted_m = np.sqrt(rows["solid_angle_sr"]) * _FOOTPRINTS
            if not self._view.orthographic:  # whose pixels have areas
                wanted_m *= distances(rows["first_scatterer_m"], self._view.receiver_m)
            known = np.flatnonzero(np.isfinite(wanted_m))
            half, exponent = np.frexp(np.maximum(wanted_m[known], _LEAST_CELL_M))
            exponent -= half == 0.5
            powers += np.bincount(
                exponent + _EXPONENTS // 2, rows["power_w"][known], minlength=_EXPONENTS
            )
        reached = np.cumsum(powers)
        if not reached[-1] > 0:
            return _power_of_two(self._resolution_m / _CELLS_IN_RESOLUTION)
        middle = int(np.searchsorted(reached, reached[-1] / 2))
        return float(2.0 ** (middle - _EXPONENTS // 2))

    def known(self, rows: PathRows) -> NDArray[np.bool_]:
        """Return a mask of the paths of one or two reflections with known vertices, (n,)."""
        order = scatterer_rows(rows)["order"]
        found = (order >= 1) & (order <= 2)
        for name in ("first_scatterer_m", "last_scatterer_m"):
            found &= are_finite(rows[name])
        return np.asarray(found)

    def _draw(self, places_m: Real) -> tuple[Real, Real, Real]:
        """Draw the scatterers of first and last vertex, equal at order 1, (2, 3, keys) [m], their
        unit heights (2, keys), and the length over them (keys,) [m], from last vertices (keys, 3)
        [m].
        """
        rows = scatterer_rows(self._table[self._leaders])
        single = rows["order"] == 1
        for name in ("first_scatterer_m", "last_scatterer_m"):
            if single.all():
                rows[name] = places_m
            else:
                rows[name][single] = places_m[single]
        cells = self._cells.of(rows, False)
        apart = dataclasses.replace(cells, state=self._apart(cells.state, rows))
        points_m, heights = self._cells.scatterers(apart)
        scatterers_m, units = np.stack([points_m.T] * 2), np.stack([heights] * 2)
        two = np.flatnonzero(~single)
        if two.size:
            before = self._cells.of(rows[two], True)
            scatterers_m[0][:, two] = self._cells.scatterers(before)[0].T
            # Another height than as the last vertex: the phases of A, B and of B, A would be
            # equal, and both would interfere twice, here and by `reverse_amplitudes`.
            units[0, two] = self._cells.heights(hash_step(before.state))
        if self._fluctuations:
            self._texture, rates_mps = self._fluctuations.of_vertex(rows, cells, False)
            self._sway_mps = np.stack([np.zeros(single.size), rates_mps])
            if two.size:
                found = self._fluctuations.of_vertex(rows[two], before, True)
                self._texture[two] *= found[0]
                self._sway_mps[0, two] = found[1]
        first_m, last_m = (points_m.T for points_m in scatterers_m)
        return scatterers_m, units, self._view.length_m(first_m, last_m, rows)

    def _add_up(self) -> tuple[Hash, Real, NDArray[np.intp], Real]:
        """Return, for each occupied cell, its key (sorted), the power over it, and its first row
        with that row's last vertex (keys, 3) [m].

        Also finds the coherent power by the number of the object [W], and the means over the power
        of lengths, and of what they are longer than the way over their vertices [m].
        """
        keys = np.zeros(0, dtype=np.uint64)
        coherent_w = self._coherent_w = np.zeros(self._heights.size)
        sums, places_m = np.zeros((3, 0)), np.zeros((0, 3))
        leaders, start = np.zeros(0, dtype=np.intp), 0
        for rows in iter_rows(self._table):
            number = np.arange(start, start + rows.size)
            start += rows.size
            if self._footprints is not None:
                index, rows = self._footprints.points(number)
                number = number[index]
            known = self.known(rows)
            number, rows = number[known], rows if known.all() else rows[known]
            rows = scatterer_rows(rows)
            if np.isfinite(self._heights).any():
                left = np.nan_to_num(np.exp(-np.sum(self._kappa_heights(rows) ** 2, axis=0)))
                coherent_w += np.bincount(
                    rows["last_object"], rows["power_w"] * left, coherent_w.size
                )
            found = self._keys_of(rows)
            every = np.concatenate([keys, found])
            own_m = self._view.length_m(rows["first_scatterer_m"], rows["last_scatterer_m"], rows)
            power_w, length_m = rows["power_w"], rows["length_m"]
            parts = power_w, power_w * length_m, power_w * (length_m - own_m)
            number = np.concatenate([leaders, number])
            point_m = np.concatenate([places_m, rows["last_scatterer_m"]])
            before = keys.size
            keys, place, back = distinct(every)
            self._placed = [(own, back[:before][at]) for own, at in self._placed]
            if self._table.size <= _KEPT_ROWS:
                self._placed.append((rows, back[before:]))
            pairs = map(np.concatenate, zip(sums, parts, strict=True))
            sums = np.stack([np.bincount(back, one, minlength=keys.size) for one in pairs])
            leaders, places_m = number[place], take_rows(point_m, place)
        with np.errstate(invalid="ignore"):
            self._mean_m, self._longer_m = sums[1:] / sums[0]
        return keys, sums[0], leaders, places_m

    def report(self) -> SpeckleReport:
        """Return statistics of the scatterers in a range cell."""
        if not self._powers.sum() > 0:
            return SpeckleReport(self.cell_m, int(self._keys.size), 0.0, 0.0)
        number = np.floor(self._mean_m / 2 / self._resolution_m).astype(np.int64)
        _, where = np.unique(number, return_inverse=True)
        power = np.bincount(where, self._powers)
        square = np.bincount(where, self._powers**2)
        held = power > 0
        power, effective = power[held], power[held] ** 2 / square[held]
        order = np.argsort(effective)
        share = np.cumsum(power[order]) / power.sum()
        middle = min(int(np.searchsorted(share, 0.5)), share.size - 1)
        coherent = self._coherent_w / power.sum()
        return SpeckleReport(
            self.cell_m,
            int(self._keys.size),
            float(effective[order[middle]]),
            float(power[effective < ENOUGH_SCATTERERS].sum() / power.sum()),
            float(coherent.sum()),
            tuple(self._objects[n - 1] for n in np.flatnonzero(coherent > _COHERENT)),
        )

    def _keys_of(self, rows: PathRows) -> Hash:
        """Return keys of the cells and of the images over which paths go."""
        keys = self._apart(self._cells.keys(rows), rows)
        if has_images(rows):
            over = rows["transmitter_image"].astype(np.uint16).astype(np.uint64) << np.uint64(32)
            over |= rows["receiver_image"].astype(np.uint16).astype(np.uint64)
            keys[over > 0] = hash_step(keys[over > 0] ^ over[over > 0])
        return keys

    def _apart(self, states: Hash, rows: PathRows) -> Hash:
        """Return the states of the cells of rows. A cell deeper than the resolution has a state for
        each part of that depth.
        """
        # the ways over two vertices in cells differ by twice the sum of their diagonals
        if 2 * math.sqrt(3) * self._cells.largest_m <= self._resolution_m:
            return states
        first_m, last_m = (
            self._cells.centres_m(self._cells.of(rows, one)) for one in (True, False)
        )
        single = (rows["order"] == 1)[:, None]
        middle_m = self._view.length_m(np.where(single, last_m, first_m), last_m, rows, False)
        own_m = rows["first_scatterer_m"], rows["last_scatterer_m"]
        deeper_m = self._view.length_m(*own_m, rows, False) - middle_m
        part = np.rint(deeper_m / (2 * self._resolution_m)).astype(np.int64).view(np.uint64)
        return np.where(part == 0, states, hash_step(states ^ part))

    def factors_at_rest(self, found: Scattering) -> Complex:
        """Return factors with the phase of the length, (n,). They are exact if path and scatterer
        move alike.
        """
        return np.asarray(found.factor * np.exp(-1j * self._wavenumber * found.longer_m))

    def scattering(self, rows: PathRows) -> Scattering:
        """Return the scattering of rows with known vertices."""
        rows = scatterer_rows(rows)
        place = next((at for own, at in self._placed if own is rows), None)
        if place is None:
            place = np.searchsorted(self._keys, self._keys_of(rows))
        longer_m = self._over_m[place] + self._longer_m[place] - rows["length_m"]
        common_m = self._mean_m[place] - rows["length_m"]
        share = np.sqrt(rows["power_w"] / self._powers[place])
        sway_mps = None
        if self._fluctuations:
            share *= np.sqrt(self._texture[place])
            if self._sway_mps.any():
                turns = np.stack(self._view.turns(rows))
                sway_mps = np.sum(self._sway_mps[:, place] * turns, axis=0) / 2
        if self._even is not None:
            factor = share * self._even[place]
        else:
            factor = self._uneven(rows, share, self._units[:, place])
        return Scattering(factor, longer_m, common_m, place, sway_mps)

    def scatterers_m(self, cells: Indices) -> tuple[Real, Real]:
        """Return scatterers of first and last vertex of cells by their numbers, (n, 3) each [m]."""
        first_m, last_m = self._scatterers_m
        return first_m.take(cells, axis=1).T, last_m.take(cells, axis=1).T

    def leaders(self, cells: Indices) -> PathRows:
        """Return rows of the table that lead cells, (n,)."""
        return self._table[self._leaders[cells]]

    def _uneven(self, rows: PathRows, share: Real, units: Real) -> Complex:
        """Return share (exp(j kappa h) - m) / sqrt(1 - m^2) of unit heights (2, n)."""
        kappa_h = self._kappa_heights(rows)
        exponent = np.sum(kappa_h**2, axis=0) / 2
        even = np.isnan(kappa_h) | (exponent < _SMOOTH)
        # 1e3 standard deviations, modulo a cycle, are even over it
        phase = np.where(even, 2 * np.pi * (1e3 * units % 1.0), kappa_h * units).sum(axis=0)
        mean = np.where(even.any(axis=0), 0.0, np.exp(-exponent))
        return np.asarray(share * (np.exp(1j * phase) - mean) / np.sqrt(1 - mean**2))

    def _kappa_heights(self, rows: PathRows) -> Real:
        """Return kappa h_rms at the first and the last vertex, (2, n). 0: no such vertex; NaN:
        unknown.
        """
        heights_m = self._heights[np.stack([rows["first_object"], rows["last_object"]])]
        turns = np.stack(self._view.turns(rows))
        return np.where(turns > 0, self._wavenumber * turns * heights_m, 0.0)


def _power_of_two(least: float) -> float:
    """Return the smallest power of two that is at least `least`."""
    return float(2.0 ** math.ceil(math.log2(least)))


def _even_phases(units: Real, order: Integers) -> Real:
    """Return phases that are uniform over a cycle, (n,): unit heights (2, n) times 1e3 standard
    deviations.
    """
    turns = 1e3 * units[1]
    phases = 2 * np.pi * (turns - np.floor(turns))
    two = np.flatnonzero(order == 2)
    phases[two] += 2 * np.pi * (1e3 * units[0, two] % 1.0)
    return np.asarray(phases)
