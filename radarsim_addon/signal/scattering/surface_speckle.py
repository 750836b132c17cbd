# SPDX-License-Identifier: GPL-3.0-or-later
"""Speckle that belongs to the surface: scatterers tied to the objects' own coordinates.

A rough surface is cut into cells of an edge c in the axes of its object. Each cell has a scatterer
at a random place in it, of random height h: both come from a hash of seed, object and cell, so they
are the same at every pulse, in every frame and view, and for every grid of pixels. With the
wavevector change kappa = k |u_in - u_out| (2 k cos for a facet that mirrors back) a path has

    sqrt(P) g (exp(j kappa h) - m) / sqrt(1 - m^2) exp(-j k (l_c - l))

of zero mean, m = exp(-(kappa h_rms)^2 / 2). It goes over the scatterer, whose path has the length
l_c instead of l. All paths of one cell meet there; g = sqrt(P / P_cell) keeps their power, so the
mean power is the sum of the powers however fine the pixels are. Where the height is unknown m = 0:
fully developed speckle. The scatterer moves with its body, and all paths of its cell move with it:
on a body that turns they would else drift out of phase.

A surface of small height also has a coherent part, m^2 = exp(-(2 k h cos)^2) of the power (Ament
1953). It is left out: as a sum over pixel centres its level grows with the number of pixels in a
Fresnel zone, by 6 dB for each doubling of the resolution.

Cells as large as the pixels' footprints make speckle the same from view to view; finer cells would
be hit or missed by chance.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...array_types import Complex, Real
from ...contract import PathsRecord
from ...errors import ConfigError
from ...findings import Finding, finding
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..paths import PathRows, TableFootprints, iter_rows
from .random_phases import hash_step, uniform

Hash = NDArray[np.uint64]

#: Footprints in the edge of a cell, at least: a cell then holds two paths or more.
_FOOTPRINTS = 1.5
#: Cells in the range resolution, at most: finer ones gain nothing.
_CELLS_IN_RESOLUTION = 8
#: Larger cells than this are a slip of the unit [m].
_LARGEST_CELL_M = 1e6
#: Where the origin lies in its cell: at no simple fraction of it.
_OFFSET = np.array([0.4142135623730950, 0.7320508075688772, 0.2360679774997896])
#: Smaller exponents of m leave too few digits of exp(j kappa h) - m: phases are then even.
_SMOOTH = 1e-6
#: Coherent fractions of the power that are worth a word.
_COHERENT = 0.01
#: Scatterers in a resolution cell from which its intensity is taken to be exponential.
ENOUGH_SCATTERERS = 40


@dataclass(frozen=True)
class Roughness:
    """Rms height and correlation length of a surface [m]; correlation length 0: unknown."""

    rms_height_m: float
    correlation_length_m: float = 0.0


@dataclass(frozen=True)
class Body:
    """What cells are fixed to: a name that nothing else has, and its pose (4, 4) [m]."""

    name: str
    pose: Real

    @property
    def rotation(self) -> Real:
        """The nearest rotation to the pose's axes, (3, 3); a mirror stays one."""
        left, _, right = np.linalg.svd(self.pose[:3, :3])
        return np.asarray(left @ right, dtype=np.float64)


@dataclass(frozen=True)
class SpeckleReport:
    """What the cells of a frame are like.

    Attributes
    ----------
    cell_m
        Edge of a cell [m]; larger where a material's correlation length is.
    cells
        Cells that paths hit.
    median_scatterers
        Effective number of scatterers in a range cell, (sum P)^2 / sum P^2 over its cells: the
        median over the power.
    undersampled_power_fraction
        Fraction of the power in range cells of fewer than `ENOUGH_SCATTERERS`.
    coherent_power_fraction
        Fraction of the power that the roughness leaves coherent, mean of m^2: not formed as such.
    coherent_objects
        Names of the objects of which more than 1 % of the power is.
    """

    cell_m: float
    cells: int
    median_scatterers: float
    undersampled_power_fraction: float
    coherent_power_fraction: float = 0.0
    coherent_objects: tuple[str, ...] = ()

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


@dataclass(frozen=True)
class Scattering:
    """How n paths scatter: factors (n,) without the phase of the length over the scatterers,
    scatterers of first and last vertex, equal at order 1, (n, 3) [m], length over them minus the
    path's own [m], and the row of the table that leads the cell.
    """

    factor: Complex
    first_scatterer_m: Real
    last_scatterer_m: Real
    longer_m: Real
    leader: NDArray[np.intp]


class SurfaceSpeckle:
    """Amplitude factors of the paths of one frame, from a seed.

    `bodies` and `roughness` (objects left out are fully rough) go by the numbers in the table, from
    1; `body_columns` are those of first and last vertex. `resolution_m` is for statistics and the
    finest cell, `cell_m` a cell's edge [m]; None: a power of two from the footprints. `footprints`
    spreads the rows over what their pixels cover; None: rows are points.
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
    ) -> None:
        self._footprints = footprints
        self._table, self._bodies, self._columns = table, dict(bodies), body_columns
        self._wavenumber = 2 * math.pi * carrier_hz / SPEED_OF_LIGHT_MPS
        self._seed = np.uint64(seed % 2**64)
        self._receiver_m = np.asarray(record.receiver.matrix_world, dtype=np.float64)[:3, 3]
        self._emitter_m = np.asarray(record.transmitter.matrix_world, dtype=np.float64)[:3, 3]
        self._orthographic = record.receiver.kind == "orthographic"
        self._resolution_m = resolution_m
        self._heights = np.full(len(record.objects) + 1, np.nan)
        self._lengths = np.zeros(len(record.objects) + 1)
        for number, surface in (roughness or {}).items():
            self._heights[number] = surface.rms_height_m
            self._lengths[number] = surface.correlation_length_m
        self._names = {
            number: np.uint64(int.from_bytes(hashlib.sha256(body.name.encode()).digest()[:8]))
            for number, body in self._bodies.items()
        }
        if cell_m is not None and not (math.isfinite(cell_m) and 0 < cell_m <= _LARGEST_CELL_M):
            raise ConfigError(
                f"Edge of a speckle cell is {cell_m!r} m; expected more than 0 and at most "
                f"{_LARGEST_CELL_M:g} m, or none for one that fits the pixels."
            )
        self.cell_m = self._automatic_cell_m() if cell_m is None else cell_m
        self._objects = record.objects
        self._keys, self._powers, self._ranges, self._leaders, self._coherent_w = self._add_up()

    # -- cells -------------------------------------------------------------------------------------

    def _automatic_cell_m(self) -> float:
        """Power of two above the footprint that half of the power has at most."""
        least_m = self._resolution_m / _CELLS_IN_RESOLUTION
        footprints, powers = [np.zeros(0)], [np.zeros(0)]
        for rows in iter_rows(self._table):
            reach_m = np.ones(rows.size)
            if not self._orthographic:  # whose pixels have areas
                reach_m = np.linalg.norm(rows["first_scatterer_m"] - self._receiver_m, axis=-1)
            known = np.isfinite(reach_m)
            footprints.append((np.sqrt(rows["solid_angle_sr"]) * reach_m)[known])
            powers.append(rows["power_w"][known])
        footprint, power = np.concatenate(footprints), np.concatenate(powers)
        wanted_m = least_m
        if power.sum() > 0:
            order = np.argsort(footprint)
            middle = np.searchsorted(np.cumsum(power[order]), power.sum() / 2)
            wanted_m = max(least_m, _FOOTPRINTS * float(footprint[order[middle]]))
        return float(2.0 ** math.ceil(math.log2(wanted_m)))

    def _vertices(self, rows: PathRows, first: bool) -> tuple[Hash, Real, Real]:
        """Hash, scatterer (n, 3) [m] and unit Gaussian height of the cells of a vertex."""
        points = rows["first_scatterer_m"] if first else rows["last_scatterer_m"]
        numbers = rows[self._columns[0] if first else self._columns[1]]
        objects = rows["first_object"] if first else rows["last_object"]
        state = np.zeros(rows.size, dtype=np.uint64)
        scatterer = np.array(points)
        edge = np.maximum(self.cell_m, self._lengths[objects])
        for number in np.unique(numbers):
            mine = np.flatnonzero(numbers == number)
            body = self._bodies.get(int(number))
            rotation, origin_m = np.eye(3), np.zeros(3)
            name = np.uint64(0)
            if body is not None:
                rotation, origin_m = body.rotation, body.pose[:3, 3]
                name = self._names[int(number)]
            local = (points[mine] - origin_m) @ rotation / edge[mine, None]
            # Faces lie on round coordinates more often than not: no border of cells may.
            cell = np.floor(local + _OFFSET)
            # Mixed before the cells come in: seed 1 must not be seed 0 with its cells swapped.
            hashed = hash_step(np.full(mine.size, self._seed ^ name, dtype=np.uint64))
            for axis in range(3):
                hashed = hash_step(hashed ^ cell[:, axis].astype(np.int64).view(np.uint64))
            draw = hashed
            place = np.empty((mine.size, 3))
            for axis in range(3):
                draw = hash_step(draw)
                place[:, axis] = uniform(draw)
            place += cell - _OFFSET
            scatterer[mine] = (edge[mine, None] * place) @ rotation.T + origin_m
            state[mine] = hashed
        first_draw = hash_step(state ^ np.uint64(0x5851F42D4C957F2D))
        second_draw = hash_step(first_draw)
        # Box and Muller; 1 - u is never 0
        height = np.sqrt(-2 * np.log(1 - uniform(first_draw))) * np.cos(
            2 * np.pi * uniform(second_draw)
        )
        return state, scatterer, height

    def known(self, rows: PathRows) -> NDArray[np.bool_]:
        """Paths whose vertices are all known, (n,): those of one and two reflections."""
        finite = np.isfinite(rows["last_scatterer_m"]).all(axis=-1) & np.isfinite(
            rows["first_scatterer_m"]
        ).all(axis=-1)
        return np.asarray(finite & (rows["order"] >= 1) & (rows["order"] <= 2))

    def _path_keys(self, rows: PathRows, first: Hash, last: Hash) -> Hash:
        """One number for all paths over the same cells, in the same way."""
        way = rows["order"].astype(np.uint64) << np.uint64(32)
        way |= rows["transparent_depth"].astype(np.uint64)
        return hash_step(hash_step(first ^ way) ^ last)

    def _add_up(self) -> tuple[Hash, Real, Real, NDArray[np.intp], Real]:
        """Keys of all cells (sorted), the power over each, its one-way range and first row;
        coherent power by the number of the object [W].
        """
        keys = np.zeros(0, dtype=np.uint64)
        coherent_w = np.zeros(self._heights.size)
        powers, ranges = np.zeros(0), np.zeros(0)
        leaders, start = np.zeros(0, dtype=np.intp), 0
        for rows in iter_rows(self._table):
            number = np.arange(start, start + rows.size)
            start += rows.size
            if self._footprints is not None:
                index, rows = self._footprints.points(number)
                number = number[index]
            known = self.known(rows)
            number, rows = number[known], rows[known]
            left = np.nan_to_num(np.exp(-np.sum(self._kappa_heights(rows) ** 2, axis=0)))
            coherent_w += np.bincount(rows["last_object"], rows["power_w"] * left, coherent_w.size)
            found = self._path_keys(
                rows, self._vertices(rows, True)[0], self._vertices(rows, False)[0]
            )
            every = np.concatenate([keys, found])
            power = np.concatenate([powers, rows["power_w"]])
            length = np.concatenate([ranges, rows["length_m"] / 2])
            number = np.concatenate([leaders, number])
            keys, place, back = np.unique(every, return_index=True, return_inverse=True)
            powers, ranges = np.bincount(back, power, minlength=keys.size), length[place]
            leaders = number[place]
        return keys, powers, ranges, leaders, coherent_w

    def report(self) -> SpeckleReport:
        """How many scatterers share a range cell."""
        if not self._powers.sum() > 0:
            return SpeckleReport(self.cell_m, int(self._keys.size), 0.0, 0.0)
        number = np.floor(self._ranges / self._resolution_m).astype(np.int64)
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

    # -- paths -------------------------------------------------------------------------------------

    def _length_m(
        self, first_scatterer_m: Real, last_scatterer_m: Real, order: Real, direction: Real
    ) -> Real:
        """Length over two points, or over one at order 1 [m]."""
        if self._orthographic:
            back = np.sum(direction * (first_scatterer_m - self._receiver_m), axis=-1)
        else:
            back = np.linalg.norm(first_scatterer_m - self._receiver_m, axis=-1)
        between = np.where(
            order == 2, np.linalg.norm(last_scatterer_m - first_scatterer_m, axis=-1), 0.0
        )
        return np.asarray(
            back + between + np.linalg.norm(last_scatterer_m - self._emitter_m, axis=-1)
        )

    def _turns(self, rows: PathRows) -> tuple[Real, Real]:
        """|u_in - u_out| at the first and at the last vertex."""
        into_first = rows["direction"]
        out_last = _unit(self._emitter_m - rows["last_scatterer_m"])
        between = _unit(rows["last_scatterer_m"] - rows["first_scatterer_m"])
        two = (rows["order"] == 2)[:, None]
        first = np.where(two, into_first - between, 0.0)
        last = np.where(two, between, into_first) - out_last
        return np.linalg.norm(first, axis=-1), np.linalg.norm(last, axis=-1)

    def factors(self, rows: PathRows) -> tuple[Complex, NDArray[np.bool_]]:
        """Complex factors of the amplitudes of rows at t, (n,), and which of them are known."""
        known = self.known(rows)
        result = np.ones(rows.size, dtype=np.complex128)
        found = self.scattering(rows[known])
        result[known] = self.factors_at_rest(found)
        return result, known

    def factors_at_rest(self, found: Scattering) -> Complex:
        """Factors with that phase, (n,): exact as long as path and scatterer move alike."""
        return np.asarray(found.factor * np.exp(-1j * self._wavenumber * found.longer_m))

    def scattering(self, rows: PathRows) -> Scattering:
        """How rows scatter whose vertices are all known."""
        first, first_scatterer_m, first_height = self._vertices(rows, True)
        last, last_scatterer_m, last_height = self._vertices(rows, False)
        order = rows["order"]
        one = (order == 1)[:, None]
        first_scatterer_m = np.where(one, last_scatterer_m, first_scatterer_m)
        over_m = self._length_m(first_scatterer_m, last_scatterer_m, order, rows["direction"])
        own_m = self._length_m(
            rows["first_scatterer_m"], rows["last_scatterer_m"], order, rows["direction"]
        )
        place = np.searchsorted(self._keys, self._path_keys(rows, first, last))
        share = np.sqrt(rows["power_w"] / self._powers[place])
        kappa_h = self._kappa_heights(rows)
        exponent = np.sum(kappa_h**2, axis=0) / 2
        even = np.isnan(kappa_h) | (exponent < _SMOOTH)
        units = np.stack([first_height, last_height])
        # 1e3 standard deviations, modulo a cycle, are even over it
        phase = np.where(even, 2 * np.pi * (1e3 * units % 1.0), kappa_h * units).sum(axis=0)
        mean = np.where(even.any(axis=0), 0.0, np.exp(-exponent))
        factor = share * (np.exp(1j * phase) - mean) / np.sqrt(1 - mean**2)
        return Scattering(
            factor, first_scatterer_m, last_scatterer_m, over_m - own_m, self._leaders[place]
        )

    def _kappa_heights(self, rows: PathRows) -> Real:
        """kappa h_rms at the first and the last vertex, (2, n): 0 without a vertex, NaN unknown."""
        heights_m = self._heights[np.stack([rows["first_object"], rows["last_object"]])]
        turns = np.stack(self._turns(rows))
        return np.where(turns > 0, self._wavenumber * turns * heights_m, 0.0)


def _unit(vectors: Real) -> Real:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(length > 0, vectors / length, 0.0)
