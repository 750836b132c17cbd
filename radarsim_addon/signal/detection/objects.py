# SPDX-License-Identifier: GPL-3.0-or-later
"""Received power and radar cross section of objects, from their paths.

The cross section inverts the radar equation path by path,

    sigma = sum_i P_i (4 pi)^3 R_t,i^2 R_r,i^2 / (EIRP G_r lambda^2),

R_t,i from transmitter to the path's last vertex, R_r,i from receiver to its first: monostatic and
bistatic alike. Gains are those of the render (EIRP in all directions, G_r = 1), so antennas have no
effect. It is the expected (speckle-averaged) cross section of the visible part of an object,
including losses in walls before it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from ...arrays import Indices, Integers, Mask, Real, distances
from ...contract import PathsRecord, ReceiverRecord
from ...errors import ConfigError
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..decoding import FrameInput, as_input
from ..paths import (
    MOST_UNCERTAIN,
    GridPlaces,
    PathRows,
    Paths,
    Places,
    edge_variances,
    has_images,
    lone_variances,
    usable,
)
from ..runs import RadarFrame
from ..scattering import Link, interference_factors, reverse_factors

#: Names in the message of a name that is unknown.
_NAMES_SHOWN = 10
#: Rows of a tile whose replicates are treated together.
_SMALL_TILE = 1 << 16


@dataclass(frozen=True)
class ObjectEcho:
    """Echo of an object, or of a group of objects.

    Powers [W] and cross sections [m^2] have their standard errors; range and rate of the one-way
    range at t are means weighted by power, without parts where the object itself has an echo.
    `paths` counts rows of the table, all replicates together. `multi_object_power_w`, of paths that
    also touch other objects (first or last vertex), is not in `power_w`.
    """

    name: str
    paths: int
    power_w: float
    power_error_w: float
    rcs_m2: float
    rcs_error_m2: float
    range_m: float
    multi_object_power_w: float
    range_rate_mps: float = 0.0

    @property
    def power_dbm(self) -> float:
        return 10 * math.log10(self.power_w * 1e3) if self.power_w > 0 else -math.inf

    @property
    def power_error(self) -> float:
        """Relative standard error of the power; 0 without power."""
        return self.power_error_w / self.power_w if self.power_w > 0 else 0.0

    @property
    def uncertain(self) -> bool:
        """True if too few rays met the object to determine its power."""
        return self.power_error > MOST_UNCERTAIN

    @property
    def rcs_dbsm(self) -> float:
        return 10 * math.log10(self.rcs_m2) if self.rcs_m2 > 0 else -math.inf


def object_echoes(
    frame: RadarFrame | FrameInput,
    carrier_hz: float,
    link: Link | None = None,
    groups: Mapping[str, Sequence[str]] | None = None,
) -> list[ObjectEcho]:
    """Return power and cross section of every object, or group, with an echo, strongest first.

    Without `groups` the parts of an object, such as the wheels of a car, are counted with it;
    ``open_frame(frame).by_parts()`` as the frame has each part by itself. Without a link budget the
    powers are those of the render: its EIRP, and G_r = 1.
    """
    return received_echoes(frame, carrier_hz, link, groups)[0]


def received_echoes(
    frame: RadarFrame | FrameInput,
    carrier_hz: float,
    link: Link | None = None,
    groups: Mapping[str, Sequence[str]] | None = None,
) -> tuple[list[ObjectEcho], float]:
    """Return `object_echoes`, and the expected power of all paths together [W]."""
    frame_input = as_input(frame)
    table, waveform = frame_input.table, frame_input.radar.waveform
    record = table.record
    is_part = np.zeros(len(record.objects) + 1, dtype=bool)
    if groups is None:
        is_part[1:] = [name != whole for name, whole in frame_input.whole_names.items()]
        joined: dict[str, list[str]] = {}
        for name, whole in frame_input.whole_names.items():
            joined.setdefault(whole, []).append(name)
        groups = joined
    names = list(groups)
    received_w = 0.0
    owners = _owners(record.objects, groups)
    sums = _Sums(owners, len(names), record.replicates, record.receiver, is_part)
    for start, stop in _tile_edges(table.rows):
        rows = table.rows[start:stop]
        kept = usable(rows)
        number = start + np.flatnonzero(kept)
        rows = rows if kept.all() else rows[kept]
        power = path_power_w(rows, record, carrier_hz, link, waveform.range_resolution_m, number)
        received_w += float(power.sum())
        sums.add_tile(rows, power, path_rcs_m2(rows, record), table.grids, number)
    return sorted(sums.echoes(names), key=lambda echo: -echo.power_w), received_w


class _Sums:
    """Sums over tiles: the mean of the replicates, and the variance of that mean.

    All are by group, from 1; what has none is at 0. An object with parts is where it is itself, and
    has its own rate: the rotors of a drone, whose rates differ, add power.
    """

    def __init__(
        self,
        owners: list[Integers],
        groups: int,
        replicates: int,
        camera: ReceiverRecord,
        is_part: Mask,
    ) -> None:
        self._owners, self._size = owners, groups + 1
        self._replicates, self._camera = replicates, camera
        self._mean, self._variance = np.zeros((2, 2, self._size))
        self._paths = np.zeros(self._size, dtype=np.int64)
        self._range, self._rate, self._shared = np.zeros((3, self._size))
        self._is_part = is_part
        #: Power, range and rate of objects without their parts.
        self._alone = np.zeros((3, self._size))

    def add_tile(
        self, rows: PathRows, power: Real, rcs: Real, grids: GridPlaces, number: Indices
    ) -> None:
        """Add rows of one tile, with their numbers in the table."""
        last, first = rows["last_object"], rows["first_object"]
        first = np.where(first == 0, last, first)  # if only the last vertex is known
        for owner in self._owners:
            ends = owner[last], owner[first]
            label = np.where(ends[0] == ends[1], ends[0], 0)
            apart = np.flatnonzero(ends[0] != ends[1])
            for end in ends:
                self._shared += self._by_group(end[apart], power[apart])
            self._paths += np.bincount(label, minlength=self._size)
            self._range += self._by_group(label, power * rows["length_m"] / 2)
            self._rate += self._by_group(label, power * rows["range_rate_mps"])
            if self._is_part.any():
                alone = np.where(self._is_part[last] | self._is_part[first], 0, label)
                values = power, power * rows["length_m"] / 2, power * rows["range_rate_mps"]
                self._alone += [self._by_group(alone, value) for value in values]
            if self._replicates == 1:
                self._add_lone(rows, label, power, rcs, grids.of_views(number))
            else:
                self._add_replicates(rows, label, power, rcs, grids, number)

    def _by_group(self, label: Integers, value: Real) -> Real:
        return np.bincount(label, value, self._size).astype(np.float64, copy=False)

    def _add_lone(
        self, rows: PathRows, label: Integers, power: Real, rcs: Real, grid: Places
    ) -> None:
        """Add a tile of one replicate. Its variance comes from edges, and from differences between
        neighbouring pixels.
        """
        self._mean += [self._by_group(label, value) for value in (power, rcs)]
        found = lone_variances(rows, label, np.stack([power, rcs]), self._camera, grid)
        self._variance[:, : found.shape[1]] += found

    def _add_replicates(
        self,
        rows: PathRows,
        label: Integers,
        power: Real,
        rcs: Real,
        grids: GridPlaces,
        number: Indices,
    ) -> None:
        count = self._replicates
        least = self._least_relative(rows, label, power, grids, number)
        place = label * count + rows["replicate"]
        for mean, variance, value in zip(self._mean, self._variance, (power, rcs), strict=True):
            sums = count * np.bincount(place, value, self._size * count)
            by_replicate = sums.reshape(self._size, count)
            own = by_replicate.mean(axis=1)
            mean += own
            variance += np.maximum(by_replicate.var(axis=1, ddof=1) / count, least * own**2)

    def _least_relative(
        self, rows: PathRows, label: Integers, power: Real, grids: GridPlaces, number: Indices
    ) -> Real:
        """Return the least relative variance of the power of each group in a tile.

        It comes from object edges parallel to the pixel grid, for which all replicates may agree on
        a wrong power.
        """
        count, size = self._replicates, self._size
        total = self._by_group(label, power)
        relative = count * power / np.where(total > 0, total, 1.0)[label]
        replicate = rows["replicate"].astype(np.int64)
        # of few rows numpy is all overhead: groups of all replicates have numbers of their own
        apart = np.where(label > 0, label + size * replicate, 0)
        step = count if rows.size <= _SMALL_TILE else 1
        variance = np.zeros(count * size)
        for first in range(0, count, step):
            own = np.flatnonzero((replicate >= first) & (replicate < first + step))
            mine = rows if own.size == rows.size else rows[own]
            pixels = grids.of_views(number[own])
            found = edge_variances(mine, apart[own], relative[own], self._camera, count, pixels)
            variance[: found.size] += found
        return np.asarray((variance / count).reshape(count, size).sum(axis=0))

    def echoes(self, names: Sequence[str]) -> list[ObjectEcho]:
        errors = np.sqrt(self._variance)
        weight, range_m, rate_mps = self._mean[0], self._range, self._rate
        if self._is_part.any():
            known = self._alone[0] > 0
            weight, range_m, rate_mps = np.where(known, self._alone, [weight, range_m, rate_mps])
        return [
            ObjectEcho(
                name=name,
                paths=int(self._paths[i]),
                power_w=float(self._mean[0, i]),
                power_error_w=float(errors[0, i]),
                rcs_m2=float(self._mean[1, i]),
                rcs_error_m2=float(errors[1, i]),
                range_m=float(range_m[i] / weight[i]) if weight[i] else 0.0,
                multi_object_power_w=float(self._shared[i]),
                range_rate_mps=float(rate_mps[i] / weight[i]) if weight[i] else 0.0,
            )
            for i, name in enumerate(names, start=1)
            if self._paths[i] or self._shared[i]
        ]


def _owners(objects: Sequence[str], groups: Mapping[str, Sequence[str]]) -> list[Integers]:
    """Return the group of each object, (objects + 1,), once for each set of groups that do not
    overlap.

    Groups have numbers from 1; 0: no group. Objects have numbers from 1; 0: unknown.
    """
    numbers = {name: number for number, name in enumerate(objects, start=1)}
    found: list[Integers] = []
    for group, names in enumerate(groups.values(), start=1):
        mine = [numbers[name] for name in names if name in numbers]
        owner = next((one for one in found if not one[mine].any()), None)
        if owner is None:
            owner = np.zeros(len(objects) + 1, dtype=np.int64)
            found.append(owner)
        owner[mine] = group
    return found


def _tile_edges(table: PathRows) -> list[tuple[int, int]]:
    """Return the first and the last row of each tile. The rows of a tile follow one another."""
    if table.size == 0:
        return []
    tile = np.asarray(table["tile"])
    edges = np.concatenate([[0], np.flatnonzero(np.diff(tile)) + 1, [tile.size]])
    return [(int(a), int(b)) for a, b in itertools.pairwise(edges)]


def path_power_w(
    rows: PathRows,
    record: PathsRecord,
    carrier_hz: float,
    link: Link | None = None,
    range_resolution_m: float = math.inf,
    number: Indices | None = None,
) -> Real:
    """Return each row's expected power at a carrier, with the gains of a link budget, which keeps
    them by the rows' numbers in the table.

    Paths over one scatterer interfere as far as a range resolution does not tell them apart.
    """
    power = rows["power_w"] * (record.carrier_hz / carrier_hz) ** 2
    if link is not None:
        power = power * link.mean_factor_of_rows(rows, number)
    if has_images(rows):
        power = power * interference_factors(rows, power, carrier_hz, range_resolution_m)
    power = power * reverse_factors(rows, record, carrier_hz, range_resolution_m)
    return np.asarray(power, dtype=np.float64)


def path_rcs_m2(rows: PathRows, record: PathsRecord) -> Real:
    """Return each row's contribution to the cross section of its object, (n,).

    A path and its reverse add up coherently.
    """
    receiver_m = np.asarray(record.receiver.matrix_world)[:3, 3]
    emitter_m = np.asarray(record.transmitter.matrix_world)[:3, 3]
    there = distances(rows["last_scatterer_m"], emitter_m) ** 2
    back = distances(rows["first_scatterer_m"], receiver_m) ** 2
    # Without vertices the mean range replaces them.
    there = np.where(np.isfinite(there), there, rows["length_m"] ** 2 / 4)
    back = np.where(np.isfinite(back), back, rows["length_m"] ** 2 / 4)
    if record.receiver.kind == "orthographic":
        back = np.ones_like(back)  # its pixels are areas: they contain no 1/R^2
    wavelength_m = SPEED_OF_LIGHT_MPS / record.carrier_hz
    scale = (4 * np.pi) ** 3 / (record.transmitter.eirp_w * wavelength_m**2)
    found = np.asarray(scale * rows["power_w"] * there * back, dtype=np.float64)
    if has_images(rows):  # of the object alone, without mirrors
        found[rows["mirrors"] > 0] = 0.0
    return found * reverse_factors(rows, record, record.carrier_hz, math.inf)


def matching_objects(frame: RadarFrame | FrameInput, pattern: str) -> list[str]:
    """Return the objects of a frame by name, by the name of a collection, or by a pattern with *
    and ?. With an object come its parts.
    """
    frame_input = as_input(frame)
    record, scene = frame_input.table.record, frame_input.ground_truth
    collections: dict[str, set[str]] = {}
    for item in scene.objects if scene is not None else []:
        for name in item.collections:
            collections.setdefault(name, set()).add(item.name.rsplit("/", 1)[-1])
    found = [
        name
        for name, whole in frame_input.whole_names.items()
        if fnmatchcase(name, pattern) or fnmatchcase(whole, pattern)
    ]
    if not found:
        inside = {
            item
            for name, items in collections.items()
            if fnmatchcase(name, pattern)
            for item in items
        }
        found = [name for name in record.objects if name in inside]
    if not found:
        names = [*record.objects, *sorted(collections)]
        more = f" and {len(names) - _NAMES_SHOWN} more" if len(names) > _NAMES_SHOWN else ""
        known = ", ".join(map(repr, names[:_NAMES_SHOWN])) + more
        raise ConfigError(
            f"No object or collection of frame {record.frame} is called {pattern!r}; there are "
            f"{known}. Give one of these names; it may contain * and ?."
        )
    return found


def paths_of_objects(frame_input: FrameInput, paths: Paths, names: Collection[str]) -> Paths:
    """Return the paths whose first or last scatterer is on one of some objects."""
    table = frame_input.table
    chosen = [n for n, name in enumerate(table.record.objects, start=1) if name in names]
    rows = table.rows[paths.row]
    return paths[np.isin(rows["first_object"], chosen) | np.isin(rows["last_object"], chosen)]
