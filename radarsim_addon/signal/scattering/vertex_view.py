# SPDX-License-Identifier: GPL-3.0-or-later
"""Lengths and deflections of paths over given vertices, seen from the antennas of a table."""

from __future__ import annotations

import numpy as np

from ...array_types import Real
from ...contract import PathsRecord
from ...vectors import distances
from ..paths import AnyRows, images_of


class VertexView:
    """The antennas of a table at its time, and their images."""

    def __init__(self, record: PathsRecord) -> None:
        self.receiver_m = np.asarray(record.receiver.matrix_world, dtype=np.float64)[:3, 3]
        self.emitter_m = np.asarray(record.transmitter.matrix_world, dtype=np.float64)[:3, 3]
        self.orthographic = record.receiver.kind == "orthographic"
        self._images = record.images

    def _antennas_m(self, rows: AnyRows) -> tuple[Real, Real]:
        """Places of receiver and transmitter, or of their images, (3,) or (n, 3) [m]."""
        images = images_of(rows, self._images)
        if images is None:
            return self.receiver_m, self.emitter_m
        return images.places(0, self.receiver_m), images.places(1, self.emitter_m)

    def length_m(
        self, first_scatterer_m: Real, last_scatterer_m: Real, rows: AnyRows, images: bool = True
    ) -> Real:
        """Length over two points, or over one at order 1 [m]; without `images` straight to the
        antennas.
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

    def turns(self, rows: AnyRows) -> tuple[Real, Real]:
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


def _unit(vectors: Real) -> Real:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(length > 0, vectors / length, 0.0)
