# SPDX-License-Identifier: GPL-3.0-or-later
"""Channels of a radar: pairs of a transmitting and a receiving antenna element, and their times."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...array_types import Mask, Real
from ...contract import AntennaRecord
from ...errors import ConfigError

Vector = tuple[float, float, float]

#: Largest departure of an orientation from a rotation.
_ROTATION_SLACK = 1e-6


@dataclass(frozen=True)
class Element:
    """One antenna element of the transmitter or of the receiver.

    Attributes
    ----------
    position_m
        Phase centre, from the antenna's origin and in its axes: x right, y up, z back [m].
    orientation
        Rotation (3, 3) from the element's axes to the antenna's.
    antenna
        Pattern of the element; None: that of the link budget.
    polarisation
        Label such as "H" or "V"; "" where polarisation is not modelled.

    Raises
    ------
    ConfigError
        A number is not finite, or the orientation is not a rotation.
    """

    position_m: Vector = (0.0, 0.0, 0.0)
    orientation: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    antenna: AntennaRecord | None = None
    polarisation: str = ""

    def __post_init__(self) -> None:
        if np.shape(self.position_m) != (3,) or not np.isfinite(self.position_m).all():
            raise ConfigError(
                f"Position of an antenna element is {self.position_m!r}; expected three finite "
                "numbers of metres."
            )
        turn = np.asarray(self.orientation, dtype=np.float64)
        if turn.shape != (3, 3) or not (
            np.allclose(turn @ turn.T, np.eye(3), rtol=0, atol=_ROTATION_SLACK)
            and np.linalg.det(turn) > 0
        ):
            raise ConfigError(
                f"Orientation of an antenna element is {self.orientation!r}; expected a rotation "
                "matrix of three rows."
            )

    @property
    def displaced(self) -> bool:
        """Whether the phase centre is away from the antenna's origin."""
        return any(self.position_m)

    @property
    def rotation(self) -> Real:
        """The orientation, (3, 3)."""
        return np.asarray(self.orientation, dtype=np.float64)


@dataclass(frozen=True)
class Channel:
    """One transmitting and one receiving element, and when they are used.

    Attributes
    ----------
    tx, rx
        Transmitting and receiving element.
    start_offset_s
        Start of each of the channel's pulses after that of the burst's pulse, 0 or more [s].
    active
        Whether the channel is used, one value per pulse; None: at every pulse.

    Raises
    ------
    ConfigError
        The offset is negative or not finite.
    """

    tx: Element = Element()
    rx: Element = Element()
    start_offset_s: float = 0.0
    active: tuple[bool, ...] | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.start_offset_s) and self.start_offset_s >= 0):
            raise ConfigError(
                f"Start offset of a channel is {self.start_offset_s!r} s; expected 0 or more."
            )

    @property
    def displaced(self) -> bool:
        """Whether path lengths differ from those between the antennas' origins."""
        return self.tx.displaced or self.rx.displaced

    @property
    def reference_gain(self) -> bool:
        """Whether both elements have the gains of the antennas at their origins."""
        return self.tx == Element(polarisation=self.tx.polarisation) and self.rx == Element(
            polarisation=self.rx.polarisation
        )

    def active_mask(self, pulses: int) -> Mask:
        """Whether the channel is used at each pulse, (pulses,)."""
        if self.active is None:
            return np.ones(pulses, dtype=bool)
        return np.asarray(self.active, dtype=bool)


#: The channel of a radar with one antenna each.
SINGLE_CHANNEL = Channel()
