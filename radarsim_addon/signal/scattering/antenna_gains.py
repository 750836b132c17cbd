# SPDX-License-Identifier: GPL-3.0-or-later
"""Antennas and power on paths: transmit gain at the last vertex, receive gain at the pixel."""

from __future__ import annotations

import dataclasses

import numpy as np

from ...array_types import Real
from ...contract import ReceiverRecord, TransmitterRecord
from ...errors import ConfigError
from ...physics.antennas import to_antenna_frame
from ..decoding import single_vertex_m
from ..paths import Paths, path_power_w
from ..radar import RadarSystem


class Link:
    """What a radar system makes of paths between one receiver and one emitter.

    Parameters
    ----------
    system
        Power budget.
    camera, emitter
        Poses at the frame's time, and the lamp's EIRP.

    Raises
    ------
    ConfigError
        The lamp has no power: there is nothing to scale.
    """

    def __init__(
        self, system: RadarSystem, camera: ReceiverRecord, emitter: TransmitterRecord
    ) -> None:
        if not emitter.eirp_w > 0:
            raise ConfigError(
                f"The emitter's power is {emitter.eirp_w:g} W; expected more than 0. Render with "
                "a lamp that shines: a system scales its power, it cannot make it."
            )
        self.system = system
        self._receiver_pose = np.asarray(camera.matrix_world, dtype=np.float64)
        self._emitter_pose = np.asarray(emitter.matrix_world, dtype=np.float64)
        self._scale = system.record.transmit_power_w / (system.loss * emitter.eirp_w)
        #: Paths given to `apply` whose last vertex was taken as that of a single reflection, their
        #: power, and that of all [W].
        self.guessed = 0
        self.guessed_w = self.seen_w = 0.0

    @property
    def receiver_m(self) -> Real:
        """Position of the receiver, (3,) [m]."""
        return self._receiver_pose[:3, 3]

    @property
    def emitter_m(self) -> Real:
        """Position of the emitter, (3,) [m]."""
        return self._emitter_pose[:3, 3]

    def transmit_gain(self, points_m: Real) -> Real:
        """G_t towards points (n, 3) [m]."""
        return self.system.transmitter.gain(
            to_antenna_frame(self._emitter_pose, points_m - self.emitter_m)
        )

    def receive_gain(self, direction: Real) -> Real:
        """G_r for rays that leave the receiver in these directions, (n, 3)."""
        return self.system.receiver.gain(to_antenna_frame(self._receiver_pose, direction))

    def factor(self, length_m: Real, direction: Real, last_scatterer_m: Real) -> Real:
        """P_t G_t G_r / (L EIRP) of each path, (n,).

        Where the last vertex is unknown it is taken to be where a single reflection of that length
        would lie.
        """
        if not np.size(length_m):
            return np.ones(0)
        unknown = ~np.isfinite(last_scatterer_m).all(axis=-1)
        if unknown.any():
            last_scatterer_m = np.array(last_scatterer_m)
            last_scatterer_m[unknown] = single_vertex_m(
                length_m[unknown], direction[unknown], self.receiver_m, self.emitter_m
            )
        if not np.isfinite(last_scatterer_m).all():
            # Shorter than the baseline by rounding: the scatterer lies between the antennas.
            bad = ~np.isfinite(last_scatterer_m).all(axis=-1)
            last_scatterer_m = np.where(bad[:, None], self.receiver_m + direction, last_scatterer_m)
        gain = self.transmit_gain(last_scatterer_m) * self.receive_gain(direction)
        return np.asarray(self._scale * gain, dtype=np.float64)

    def apply(self, paths: Paths) -> Paths:
        """The paths with their gain.

        Raises
        ------
        ConfigError
            The paths do not know their directions.
        """
        if paths.geometry is None:
            raise ConfigError(
                "These paths have no directions, so antennas cannot be applied to them. Render "
                "the run again with this version, or process it without a system."
            )
        geometry = paths.geometry
        gain = self.factor(paths.length_m, geometry.direction, geometry.last_scatterer_m)
        result = dataclasses.replace(paths, gain=gain)
        power_w = path_power_w(result, self.system.wavelength_m)
        unknown = ~np.isfinite(geometry.last_scatterer_m).all(axis=-1)
        self.guessed += int(np.count_nonzero(unknown))
        self.guessed_w += float(power_w[unknown].sum())
        self.seen_w += float(power_w.sum())
        return result
