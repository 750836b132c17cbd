# SPDX-License-Identifier: GPL-3.0-or-later
"""Which paths of a frame are clutter, and how the scatterers of their surfaces move.

A path is clutter where all of its known scatterers lie on objects with a clutter model, texture or
motion of their own. Expected power sorts it into planes: 0 is no clutter, 1 has scatterers that do
not move by themselves (rain too: its drops have range rates), each further one a kind of motion.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from ...array_types import Integers, Real
from ...contract import FluctuationRecord
from ...physics.clutter_statistics import bragg_velocity_mps, clutter_correlation
from ..decoding import FrameInput
from ..paths import PathRows
from .frame_speckle import numbered_objects
from .surface_fluctuations import grazing_cosines

STILL_PLANE = 1


class ClutterSurfaces:
    """Objects of a frame that are clutter.

    Parameters
    ----------
    frame_input
        Frame of the sampling mode "paths".
    rain
        Whether there is clutter of no object, too.

    Attributes
    ----------
    names
        Of the objects.
    planes
        Number of planes: 1 without any clutter.
    """

    def __init__(self, frame_input: FrameInput, *, rain: bool = False) -> None:
        objects = frame_input.table.record.objects
        self._wavelength_m = frame_input.radar.waveform.wavelength_m
        self._plane = np.zeros(len(objects) + 1, dtype=np.int64)
        self._motions: list[FluctuationRecord] = []
        names = []
        for number, item in numbered_objects(frame_input.ground_truth, objects):
            if item.clutter is None and item.fluctuation is None:
                continue
            names.append(objects[number - 1])
            self._plane[number] = self._plane_of(item.fluctuation or FluctuationRecord())
        self.names = frozenset(names)
        self.planes = STILL_PLANE + 1 + len(self._motions) if names or rain else 1

    def _plane_of(self, fluctuation: FluctuationRecord) -> int:
        if fluctuation.motion == "none":
            return STILL_PLANE
        motion = dataclasses.replace(
            fluctuation, texture="none", texture_shape=0.0, texture_length_m=0.0
        )
        if motion not in self._motions:
            self._motions.append(motion)
        return STILL_PLANE + 1 + self._motions.index(motion)

    def planes_of(self, rows: PathRows) -> Integers:
        """Plane of each row, (n,)."""
        last, first = rows["last_object"], rows["first_object"]
        first = np.where(first == 0, last, first)  # if only the last vertex is known
        clutter = (self._plane[last] > 0) & (self._plane[first] > 0)
        return np.where(clutter, self._plane[last], 0)

    def lines(self, plane: int, rows: PathRows) -> list[tuple[float, Real]]:
        """Return the lines of the spectrum of a plane: fraction of the power, and range rates
        that the motion adds to rows [m/s], (n,). One line, or both Bragg lines of a sea.
        """
        motion = self._motions[plane - STILL_PLANE - 1] if plane > STILL_PLANE else None
        if motion is None or motion.motion != "sea":
            return [(1.0, np.zeros(rows.size))]
        bragg_mps = bragg_velocity_mps(self._wavelength_m, grazing_cosines(rows))
        part = motion.motion_fraction
        return [(part, -bragg_mps), (1 - part, bragg_mps)]

    def correlations(self, lag_s: Real) -> list[Real]:
        """Correlation of the echoes of each plane at lags [s], about its lines, (lags,) each."""
        still = [np.ones(lag_s.size)] * min(self.planes, STILL_PLANE + 1)
        return still + [
            clutter_correlation(
                one.motion, one.motion_speed_mps, one.motion_fraction, lag_s, self._wavelength_m
            )
            for one in self._motions
        ]
