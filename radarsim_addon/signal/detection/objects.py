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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np
from numpy.typing import NDArray

from ...array_types import Real
from ...contract import PathsRecord, ReceiverRecord
from ...errors import ConfigError
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..decoding import FrameInput, as_input
from ..paths import PathRows, edge_variances, lone_variances, usable
from ..runs import RadarFrame
from ..scattering import Link

#: Names in the message of a name that is unknown.
_NAMES_SHOWN = 10


@dataclass(frozen=True)
class ObjectEcho:
    """Echo of an object, or of a group of objects.

    Powers in W, cross sections in m^2, each with its standard error; range and rate of the one-way
    range at t are means weighted by power. `paths` counts rows of the table, all replicates
    together. `multi_object_power_w` is that of paths that also touch other objects (first or last
    vertex); it is not in `power_w`.
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
        """Power over 1 mW [dB]."""
        return 10 * math.log10(self.power_w * 1e3) if self.power_w > 0 else -math.inf

    @property
    def rcs_dbsm(self) -> float:
        """Cross section over 1 m^2 [dB]."""
        return 10 * math.log10(self.rcs_m2) if self.rcs_m2 > 0 else -math.inf


def path_rcs_m2(rows: PathRows, record: PathsRecord) -> Real:
    """Return each row's contribution to the cross section of its object, (n,) [m^2]."""
    receiver_m = np.asarray(record.receiver.matrix_world)[:3, 3]
    emitter_m = np.asarray(record.transmitter.matrix_world)[:3, 3]
    there = np.sum((rows["last_scatterer_m"] - emitter_m) ** 2, axis=-1)
    back = np.sum((rows["first_scatterer_m"] - receiver_m) ** 2, axis=-1)
    # Without vertices the mean range replaces them.
    there = np.where(np.isfinite(there), there, rows["length_m"] ** 2 / 4)
    back = np.where(np.isfinite(back), back, rows["length_m"] ** 2 / 4)
    if record.receiver.kind == "orthographic":
        back = np.ones_like(back)  # its pixels are areas: they contain no 1/R^2
    wavelength_m = SPEED_OF_LIGHT_MPS / record.carrier_hz
    scale = (4 * np.pi) ** 3 / (record.transmitter.eirp_w * wavelength_m**2)
    return np.asarray(scale * rows["power_w"] * there * back, dtype=np.float64)


def path_power_w(
    rows: PathRows, record: PathsRecord, carrier_hz: float, link: Link | None = None
) -> Real:
    """Return each row's received power at a carrier [W], with the gains of a link budget."""
    power = rows["power_w"] * (record.carrier_hz / carrier_hz) ** 2
    if link is not None:
        power = power * link.mean_factor_of_rows(rows)
    return np.asarray(power, dtype=np.float64)


def object_echoes(
    frame: RadarFrame | FrameInput,
    carrier_hz: float,
    link: Link | None = None,
    groups: Mapping[str, Sequence[str]] | None = None,
) -> list[ObjectEcho]:
    """Compute power and cross section of every object with an echo.

    Parameters
    ----------
    frame
        A radar frame with the sampling mode "paths".
    carrier_hz
        Carrier [Hz].
    link
        Link budget, for the powers; None: EIRP of the render, G_r = 1.
    groups
        Names of objects that are taken together, by the group's name; None: each object separately.

    Returns
    -------
    list of ObjectEcho
        Strongest first.

    Raises
    ------
    ConfigError
        The frame was measured by rings, whose paths have no objects.
    FrameFileError, SchemaError
        The table is missing or damaged.
    """
    table = as_input(frame).table
    record = table.record
    if groups is None:
        groups = {name: [name] for name in record.objects}
    member = _membership(record.objects, groups)
    names = list(groups)
    sums = _Sums(len(names), record.replicates, record.receiver)
    for start, stop in _tile_edges(table.rows):
        rows = np.array(table.rows[start:stop])
        rows = rows[usable(rows)]
        power = path_power_w(rows, record, carrier_hz, link)
        sums.add_tile(rows, power, path_rcs_m2(rows, record), member)
    return sorted(sums.echoes(names), key=lambda echo: -echo.power_w)


def _membership(objects: Sequence[str], groups: Mapping[str, Sequence[str]]) -> NDArray[np.bool_]:
    """Whether an object (from 1; 0 is unknown) is in a group, (groups, objects + 1)."""
    numbers = {name: number for number, name in enumerate(objects, start=1)}
    member = np.zeros((len(groups), len(objects) + 1), dtype=np.bool_)
    for place, names in enumerate(groups.values()):
        member[place, [numbers[name] for name in names if name in numbers]] = True
    return member


class _Sums:
    """Sums over tiles: the mean of the replicates, and the variance of that mean."""

    def __init__(self, groups: int, replicates: int, camera: ReceiverRecord) -> None:
        self._replicates, self._camera = replicates, camera
        self._mean = np.zeros((2, groups))
        self._variance = np.zeros((2, groups))
        self._paths = np.zeros(groups, dtype=np.int64)
        self._range = np.zeros(groups)
        self._rate = np.zeros(groups)
        self._shared = np.zeros(groups)

    def add_tile(self, rows: PathRows, power: Real, rcs: Real, member: NDArray[np.bool_]) -> None:
        last, first = rows["last_object"], rows["first_object"]
        first = np.where(first == 0, last, first)  # if only the last vertex is known
        for group in np.flatnonzero(member[:, np.unique([*last, *first])].any(axis=1)):
            touched_last, touched_first = member[group][last], member[group][first]
            mine = touched_last & touched_first
            self._shared[group] += power[touched_last ^ touched_first].sum()
            self._paths[group] += np.count_nonzero(mine)
            self._range[group] += power[mine] @ rows["length_m"][mine] / 2
            self._rate[group] += power[mine] @ rows["range_rate_mps"][mine]
            if self._replicates == 1:
                for place, value in enumerate((power[mine], rcs[mine])):
                    self._add_lone(place, int(group), rows[mine], value)
                continue
            least = self._least_relative(rows[mine], power[mine])
            for place, value in enumerate((power, rcs)):
                by_replicate = self._replicates * np.bincount(
                    rows["replicate"][mine], value[mine], minlength=self._replicates
                )
                self._mean[place, group] += by_replicate.mean()
                scatter = by_replicate.var(ddof=1) / self._replicates
                self._variance[place, group] += max(scatter, least * by_replicate.mean() ** 2)

    def _add_lone(self, place: int, group: int, rows: PathRows, value: Real) -> None:
        """Add a tile of one replicate: its edges, and the differences between neighbours."""
        self._mean[place, group] += value.sum()
        label = np.ones(value.size, dtype=np.int64)
        self._variance[place, group] += lone_variances(rows, label, value, self._camera)[-1]

    def _least_relative(self, rows: PathRows, power: Real) -> float:
        """Return the smallest relative variance of the sum of these rows of a tile.

        It comes from edges along the grid of the tile, on which the replicates may agree.
        """
        total = power.sum()
        if not total > 0:
            return 0.0
        variance = 0.0
        for replicate in range(self._replicates):
            own = rows["replicate"] == replicate
            label = np.ones(np.count_nonzero(own), dtype=np.int64)
            value = self._replicates * power[own] / total
            found = edge_variances(rows[own], label, value, self._camera, self._replicates)
            variance += float(found[-1]) / self._replicates
        return variance

    def echoes(self, names: Sequence[str]) -> list[ObjectEcho]:
        errors = np.sqrt(self._variance)
        return [
            ObjectEcho(
                name=name,
                paths=int(self._paths[i]),
                power_w=float(self._mean[0, i]),
                power_error_w=float(errors[0, i]),
                rcs_m2=float(self._mean[1, i]),
                rcs_error_m2=float(errors[1, i]),
                range_m=float(self._range[i] / self._mean[0, i]) if self._mean[0, i] else 0.0,
                multi_object_power_w=float(self._shared[i]),
                range_rate_mps=float(self._rate[i] / self._mean[0, i]) if self._mean[0, i] else 0.0,
            )
            for i, name in enumerate(names)
            if self._paths[i] or self._shared[i]
        ]


def _tile_edges(table: PathRows) -> list[tuple[int, int]]:
    """Return first and last row of each tile: rows of one tile are adjacent."""
    if table.size == 0:
        return []
    tile = np.asarray(table["tile"])
    edges = np.concatenate([[0], np.flatnonzero(np.diff(tile)) + 1, [tile.size]])
    return [(int(a), int(b)) for a, b in itertools.pairwise(edges)]


def matching_objects(frame: RadarFrame | FrameInput, pattern: str) -> list[str]:
    """Return the objects of a frame by name, by the name of a collection, or by a pattern.

    Parameters
    ----------
    frame
        Radar frame with the sampling mode "paths".
    pattern
        Name, which may contain * and ?.

    Returns
    -------
    list of str
        Names of objects.

    Raises
    ------
    ConfigError
        No object or collection has that name.
    """
    frame_input = as_input(frame)
    record, scene = frame_input.table.record, frame_input.ground_truth
    collections: dict[str, set[str]] = {}
    for item in scene.objects if scene is not None else []:
        for name in item.collections:
            collections.setdefault(name, set()).add(item.name.rsplit("/", 1)[-1])
    found = [name for name in record.objects if fnmatchcase(name, pattern)]
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
