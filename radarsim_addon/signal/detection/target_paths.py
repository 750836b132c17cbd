# SPDX-License-Identifier: GPL-3.0-or-later
"""Which paths make a target of a map, and on which object they end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...array_types import Integers, Real
from ...contract import ImageRecord
from ...physics.mirrors import mirror_matrix
from ..decoding import FrameInput
from ..paths import PathRows, has_images, iter_rows, usable
from ..scattering import Link
from .objects import path_power_w

#: A path that is further than this from a target, in resolution cells, has no part in it.
_REACH_CELLS = 1.5


@dataclass(frozen=True)
class TargetPaths:
    """Paths of a target of a map, the strongest first.

    Attributes
    ----------
    object_name
        Object that the largest part of their power comes from; "": unknown.
    lines_m
        Corners of each path: receiver, mirrors, scatterers, transmitter, (k, 3) [m]. Scatterers
        between the first and the last are not known and left out.
    power_w
        Power of each path, (n,) [W].
    """

    object_name: str
    lines_m: list[Real]
    power_w: Real


class PathFinder:
    """Finds the paths of a frame that make a target.

    Parameters
    ----------
    frame_input
        Radar frame with the sampling mode "paths".
    link
        Link budget, for the powers; None: EIRP of the render, G_r = 1.

    Raises
    ------
    ConfigError
        The frame was measured by rings, whose paths have no objects.
    """

    def __init__(self, frame_input: FrameInput, link: Link | None = None) -> None:
        self._input, self._radar = frame_input, frame_input.radar
        table, waveform = frame_input.table, self._radar.waveform
        self._record, self._rows = table.record, table.rows
        later_s = (self._radar.burst.pulses - 1) / 2 / self._radar.burst.prf_hz
        columns = []
        for rows in iter_rows(self._rows):
            power = path_power_w(
                rows, self._record, waveform.carrier_hz, link, waveform.range_resolution_m
            )
            power = np.where(usable(rows), power, 0.0)
            range_m = rows["length_m"] / 2 + later_s * rows["range_rate_mps"]
            columns.append(np.stack([range_m, rows["range_rate_mps"], power]).astype(np.float32))
        joined = np.concatenate(columns, axis=1) if columns else np.zeros((3, 0), np.float32)
        period_m = self._radar.burst.unambiguous_range_m
        if waveform.family == "line":
            period_m = waveform.unambiguous_range_m
        self._range_m = joined[0] % np.float32(period_m) if np.isfinite(period_m) else joined[0]
        self._rate_mps, self._power_w = joined[1], joined[2]
        self._order = np.argsort(self._range_m, kind="stable")
        self._sorted_m = self._range_m[self._order]

    def of_target(self, range_m: float, velocity_mps: float, most: int = 12) -> TargetPaths:
        """Return the paths of a target of the map.

        Parameters
        ----------
        range_m, velocity_mps
            Its place in the map: range in the middle of the burst, and range rate, which may have
            folded [m, m/s].
        most
            Most paths of the answer; the object is that of all of them.

        Returns
        -------
        TargetPaths
            Paths within 1.5 resolution cells of it, maybe none.
        """
        radar = self._radar
        reach_m = _REACH_CELLS * radar.waveform.range_resolution_m
        first, last = np.searchsorted(self._sorted_m, [range_m - reach_m, range_m + reach_m])
        near = self._order[first:last]
        interval_mps = 2 * radar.max_unambiguous_velocity_mps
        apart_mps = np.abs(self._rate_mps[near] - velocity_mps) % interval_mps
        apart_mps = np.minimum(apart_mps, interval_mps - apart_mps)
        reach_mps = _REACH_CELLS * radar.velocity_resolution_mps
        inside = apart_mps <= reach_mps
        near, apart_mps = near[inside], apart_mps[inside]
        # what is next to the peak counts less
        weight = np.exp(
            -2 * ((self._range_m[near] - range_m) / reach_m) ** 2 - 2 * (apart_mps / reach_mps) ** 2
        )
        return self._answer(near, self._power_w[near] * weight, most)

    def of_object(self, name: str, most: int = 12) -> TargetPaths:
        """Return the strongest paths whose first or last scatterer is on an object.

        Parameters
        ----------
        name
            Name of the object in the frame.
        most
            Most paths of the answer.

        Returns
        -------
        TargetPaths
            None where the object has no echo.
        """
        if name not in self._record.objects:
            return TargetPaths("", [], np.zeros(0))
        number = self._record.objects.index(name) + 1
        ends = self._rows["first_object"] == number
        ends |= self._rows["last_object"] == number
        mine = np.flatnonzero(ends)
        found = self._answer(mine, self._power_w[mine], most)
        return TargetPaths(name, found.lines_m, found.power_w)

    def _answer(self, rows: Integers, weight: Real, most: int) -> TargetPaths:
        rows, weight = rows[weight > 0], weight[weight > 0]
        names = self._record.objects
        if not rows.size:
            return TargetPaths("", [], np.zeros(0))
        # the radar sees what the wave comes from last
        seen = self._rows["first_object"][rows]
        seen = np.where(seen == 0, self._rows["last_object"][rows], seen)
        by_object = np.bincount(seen, weight, len(names) + 1)
        strongest = int(np.argmax(by_object[1:])) + 1 if names else 0
        name = names[strongest - 1] if by_object[strongest] > 0 and strongest else ""
        chosen = rows[np.argsort(-weight, kind="stable")[:most]]
        lines = [self._line(self._rows[row]) for row in chosen]
        return TargetPaths(name, lines, np.asarray(self._power_w[chosen], dtype=np.float64))

    def _line(self, row: PathRows) -> Real:
        """Corners of a path, from the receiver to the transmitter."""
        receiver = np.asarray(self._input.receiver.matrix_world)[:3, 3]
        transmitter = np.asarray(self._input.transmitter.matrix_world)[:3, 3]
        first, last = row["first_scatterer_m"], row["last_scatterer_m"]
        images: list[ImageRecord | None] = [None, None]
        if has_images(row):
            for end, name in enumerate(("receiver_image", "transmitter_image")):
                images[end] = self._record.images[row[name] - 1] if row[name] else None
        there = mirror_corners(receiver, images[0], first)
        back = mirror_corners(transmitter, images[1], last)
        scatterers = [first] if np.array_equal(first, last) else [first, last]
        corners = np.array([receiver, *there, *scatterers, *back[::-1], transmitter])
        return np.asarray(corners[np.isfinite(corners).all(axis=1)], dtype=np.float64)


def mirror_corners(antenna_m: Real, image: ImageRecord | None, scatterer_m: Real) -> Sequence[Real]:
    """Return where a path meets the mirrors of an image, from antenna to scatterer [m]."""
    if image is None:
        return ()
    planes = list(zip(image.normals, image.offsets_m, strict=True))
    seen = [antenna_m]  # the antenna over the first 0, 1, ... mirrors
    for normal, offset_m in planes:
        turn, shift = mirror_matrix(normal, offset_m)
        seen.append(turn @ seen[-1] + shift)
    corners: list[Real] = []
    at = scatterer_m
    for (normal, offset_m), apparent in zip(reversed(planes), reversed(seen[1:]), strict=True):
        toward = apparent - at
        at = at + (offset_m - np.dot(normal, at)) / np.dot(normal, toward) * toward
        corners.insert(0, at)
    return corners
