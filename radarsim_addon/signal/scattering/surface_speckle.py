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

On a body that turns a scatterer lies within the box of its mesh: beyond the end of a rotor blade it
would be faster than all of the blade.

Cells as large as the pixels' footprints make speckle the same from view to view; finer cells would
be hit or missed by chance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...array_types import Complex, Indices, Integers, Real
from ...contract import FluctuationRecord, PathsRecord
from ...errors import ConfigError
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ...vectors import are_finite, distances
from ..paths import (
    AnyRows,
    PathColumns,
    PathRows,
    TableFootprints,
    has_images,
    images_of,
    iter_rows,
    scatterer_rows,
)
from .random_phases import hash_step
from .speckle_report import ENOUGH_SCATTERERS, SpeckleReport
from .surface_cells import Body, Hash, SurfaceCells
from .surface_fluctuations import SurfaceFluctuations

#: Footprints in the edge of a cell, at least: a cell then holds two paths or more.
_FOOTPRINTS = 1.5
#: Cells in the range resolution, at most, where the parts of a body do not move on their own: finer
#: ones gain nothing. Doppler resolves the parts of a body that turns.
_CELLS_IN_RESOLUTION = 8
#: Cells are at least as large as this, those of what is nearer than all scenes too [m].
_LEAST_CELL_M = 1e-12
#: Larger cells than this are a slip of the unit [m].
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
    """How n paths scatter: factors (n,) without the phase of the length over the scatterers, that
    length minus the path's own [m], the number of the cell, and the range rate by the motion of the
    clutter itself [m/s]; None: none moves.
    """

    factor: Complex
    longer_m: Real
    cell: Indices
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
        self._table, self._footprints, self._images = table, footprints, record.images
        self._wavenumber = 2 * math.pi * carrier_hz / SPEED_OF_LIGHT_MPS
        self._receiver_m = np.asarray(record.receiver.matrix_world, dtype=np.float64)[:3, 3]
        self._emitter_m = np.asarray(record.transmitter.matrix_world, dtype=np.float64)[:3, 3]
        self._orthographic = record.receiver.kind == "orthographic"
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
        self._placed: list[tuple[AnyRows, Indices]] = []
        self._keys, self._powers, self._ranges, self._leaders, places_m = self._add_up()
        self._scatterers_m, self._units, self._over_m = self._draw(places_m)
        # what is alike for all paths of a cell where no height is known
        self._even: Complex | None = None
        if not np.isfinite(self._heights).any():
            order = scatterer_rows(self._table[self._leaders])["order"]
            self._even = np.exp(1j * _even_phases(self._units, order))

    # -- cells -------------------------------------------------------------------------------------

    def _automatic_cell_m(self) -> float:
        """Power of two above the footprint that half of the power has at most."""
        # power by the power of two that is at least 1.5 footprints, from 2^-1074 on
        powers = np.zeros(_EXPONENTS)
        for rows in iter_rows(self._table):
            wanted_m = np.sqrt(rows["solid_angle_sr"]) * _FOOTPRINTS
            if not self._orthographic:  # whose pixels have areas
                wanted_m *= distances(rows["first_scatterer_m"], self._receiver_m)
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

    def known(self, rows: AnyRows) -> NDArray[np.bool_]:
        """Paths whose vertices are all known, (n,): those of one and two reflections."""
        order = scatterer_rows(rows)["order"]
        found = (order >= 1) & (order <= 2)
        for name in ("first_scatterer_m", "last_scatterer_m"):
            found &= are_finite(rows[name])
        return np.asarray(found)

    def _draw(self, places_m: Real) -> tuple[Real, Real, Real]:
        """Scatterers of first and last vertex, equal at order 1, (2, 3, keys) [m], their unit
        heights (2, keys) and the length over them (keys,) [m], of last vertices (keys, 3) [m].
        """
        rows = scatterer_rows(PathColumns(self._table, self._leaders))
        single = rows["order"] == 1
        for name in ("first_scatterer_m", "last_scatterer_m"):
            rows[name][single] = places_m[single]
        cells = self._cells.of(rows, False)
        points_m, heights = self._cells.scatterers(cells)
        scatterers_m, units = np.stack([points_m.T] * 2), np.stack([heights] * 2)
        two = np.flatnonzero(~single)
        if two.size:
            before = self._cells.of(rows[two], True)
            points_m, units[0, two] = self._cells.scatterers(before)
            scatterers_m[0][:, two] = points_m.T
        if self._fluctuations:
            self._texture, rates_mps = self._fluctuations.of_vertex(rows, cells, False)
            self._sway_mps = np.stack([np.zeros(single.size), rates_mps])
            if two.size:
                found = self._fluctuations.of_vertex(rows[two], before, True)
                self._texture[two] *= found[0]
                self._sway_mps[0, two] = found[1]
        first_m, last_m = (points_m.T for points_m in scatterers_m)
        return scatterers_m, units, self._length_m(first_m, last_m, rows)

    def _add_up(self) -> tuple[Hash, Real, Real, NDArray[np.intp], Real]:
        """Keys of all cells (sorted), the power over each, its one-way range, first row, and last
        vertex of that (keys, 3) [m]. Finds the coherent power by the number of the object [W].
        """
        keys = np.zeros(0, dtype=np.uint64)
        coherent_w = self._coherent_w = np.zeros(self._heights.size)
        powers, ranges, places_m = np.zeros(0), np.zeros(0), np.zeros((0, 3))
        leaders, start = np.zeros(0, dtype=np.intp), 0
        rows: AnyRows
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
            power = np.concatenate([powers, rows["power_w"]])
            length = np.concatenate([ranges, rows["length_m"] / 2])
            number = np.concatenate([leaders, number])
            point_m = np.concatenate([places_m, rows["last_scatterer_m"]])
            before = keys.size
            keys, place, back = np.unique(every, return_index=True, return_inverse=True)
            self._placed = [(own, back[:before][at]) for own, at in self._placed]
            if self._table.size <= _KEPT_ROWS:
                self._placed.append((rows, back[before:]))
            powers, ranges = np.bincount(back, power, minlength=keys.size), length[place]
            leaders, places_m = number[place], point_m[place]
        return keys, powers, ranges, leaders, places_m

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

    def _keys_of(self, rows: AnyRows) -> Hash:
        """Keys of the cells and of the images over which paths go."""
        keys = self._cells.keys(rows)
        if has_images(rows):
            over = rows["transmitter_image"].astype(np.uint16).astype(np.uint64) << np.uint64(32)
            over |= rows["receiver_image"].astype(np.uint16).astype(np.uint64)
            keys[over > 0] = hash_step(keys[over > 0] ^ over[over > 0])
        return keys

    def _antennas_m(self, rows: AnyRows) -> tuple[Real, Real]:
        """Places of receiver and transmitter, or of their images, (3,) or (n, 3) [m]."""
        images = images_of(rows, self._images)
        if images is None:
            return self._receiver_m, self._emitter_m
        return images.places(0, self._receiver_m), images.places(1, self._emitter_m)

    def _length_m(self, first_scatterer_m: Real, last_scatterer_m: Real, rows: AnyRows) -> Real:
        """Length over two points, or over one at order 1 [m]."""
        order, direction = rows["order"], rows["direction"]
        receiver_m, emitter_m = self._antennas_m(rows)
        length_m = distances(last_scatterer_m, emitter_m)
        two = np.flatnonzero(order == 2)
        length_m[two] += distances(last_scatterer_m[two], first_scatterer_m[two])
        if self._orthographic:
            return length_m + np.sum(direction * (first_scatterer_m - self._receiver_m), axis=-1)
        length_m += distances(first_scatterer_m, receiver_m)
        return length_m

    def _turns(self, rows: AnyRows) -> tuple[Real, Real]:
        """|u_in - u_out| at the first and at the last vertex."""
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

    def factors(self, rows: AnyRows) -> tuple[Complex, NDArray[np.bool_]]:
        """Complex factors of the amplitudes of rows at t, (n,), and which of them are known."""
        known = self.known(rows)
        result = np.ones(rows.size, dtype=np.complex128)
        found = self.scattering(rows[known])
        result[known] = self.factors_at_rest(found)
        return result, known

    def factors_at_rest(self, found: Scattering) -> Complex:
        """Factors with that phase, (n,): exact as long as path and scatterer move alike."""
        return np.asarray(found.factor * np.exp(-1j * self._wavenumber * found.longer_m))

    def scattering(self, rows: AnyRows) -> Scattering:
        """How rows scatter whose vertices are all known."""
        rows = scatterer_rows(rows)
        place = next((at for own, at in self._placed if own is rows), None)
        if place is None:
            place = np.searchsorted(self._keys, self._keys_of(rows))
        if self._orthographic:
            over_m = self._length_m(*self.scatterers_m(place), rows)
        else:
            over_m = self._over_m[place]
        own_m = self._length_m(rows["first_scatterer_m"], rows["last_scatterer_m"], rows)
        share = np.sqrt(rows["power_w"] / self._powers[place])
        sway_mps = None
        if self._fluctuations:
            share *= np.sqrt(self._texture[place])
            if self._sway_mps.any():
                turns = np.stack(self._turns(rows))
                sway_mps = np.sum(self._sway_mps[:, place] * turns, axis=0) / 2
        if self._even is not None:
            factor = share * self._even[place]
        else:
            factor = self._uneven(rows, share, self._units[:, place])
        return Scattering(factor, over_m - own_m, place, sway_mps)

    def scatterers_m(self, cells: Indices) -> tuple[Real, Real]:
        """Scatterers of first and last vertex of cells by their numbers, (n, 3) each [m]."""
        first_m, last_m = self._scatterers_m
        return first_m.take(cells, axis=1).T, last_m.take(cells, axis=1).T

    def leaders(self, cells: Indices) -> PathRows:
        """Rows of the table that lead cells, (n,)."""
        return self._table[self._leaders[cells]]

    def _uneven(self, rows: AnyRows, share: Real, units: Real) -> Complex:
        """share (exp(j kappa h) - m) / sqrt(1 - m^2) of unit heights (2, n)."""
        kappa_h = self._kappa_heights(rows)
        exponent = np.sum(kappa_h**2, axis=0) / 2
        even = np.isnan(kappa_h) | (exponent < _SMOOTH)
        # 1e3 standard deviations, modulo a cycle, are even over it
        phase = np.where(even, 2 * np.pi * (1e3 * units % 1.0), kappa_h * units).sum(axis=0)
        mean = np.where(even.any(axis=0), 0.0, np.exp(-exponent))
        return np.asarray(share * (np.exp(1j * phase) - mean) / np.sqrt(1 - mean**2))

    def _kappa_heights(self, rows: AnyRows) -> Real:
        """kappa h_rms at the first and the last vertex, (2, n): 0 without a vertex, NaN unknown."""
        heights_m = self._heights[np.stack([rows["first_object"], rows["last_object"]])]
        turns = np.stack(self._turns(rows))
        return np.where(turns > 0, self._wavenumber * turns * heights_m, 0.0)


def _power_of_two(least: float) -> float:
    """Return the power of two from `least` up."""
    return float(2.0 ** math.ceil(math.log2(least)))


def _unit(vectors: Real) -> Real:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(length > 0, vectors / length, 0.0)


def _even_phases(units: Real, order: Integers) -> Real:
    """Phases from unit heights (2, n) of 1e3 standard deviations, even over a cycle, (n,)."""
    turns = 1e3 * units[1]
    phases = 2 * np.pi * (turns - np.floor(turns))
    two = np.flatnonzero(order == 2)
    phases[two] += 2 * np.pi * (1e3 * units[0, two] % 1.0)
    return np.asarray(phases)
