# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions of bodies of which most are stationary: one of these has a pose and no more."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import overload

import numpy as np

from ...array_types import Mask, Real
from .body_motion import BodyMotion


class BodyMotions(Sequence[BodyMotion]):
    """Motions of n bodies; that of a stationary one is made when it is asked for.

    Attributes
    ----------
    poses
        Poses of all, (n, 4, 4), translation in metres; of `others` those in their motions count.
    others
        Motions by index of bodies that may move; all others are stationary.
    epoch_offset_s
        As `BodyMotion` has it, of the stationary ones [s].
    """

    def __init__(
        self, poses: Real, others: Mapping[int, BodyMotion], epoch_offset_s: float = 0.0
    ) -> None:
        self.poses, self.others, self.epoch_offset_s = poses, dict(others), epoch_offset_s

    def __len__(self) -> int:
        return len(self.poses)

    @overload
    def __getitem__(self, index: int) -> BodyMotion: ...
    @overload
    def __getitem__(self, index: slice) -> BodyMotions: ...
    def __getitem__(self, index: int | slice) -> BodyMotion | BodyMotions:
        chosen = range(len(self))[index]  # an IndexError beyond the end
        if isinstance(chosen, int):
            other = self.others.get(chosen)
            return other or BodyMotion(self.poses[chosen], epoch_offset_s=self.epoch_offset_s)
        others = {chosen.index(at): one for at, one in self.others.items() if at in chosen}
        return BodyMotions(self.poses[index], others, self.epoch_offset_s)

    def __iter__(self) -> Iterator[BodyMotion]:
        return (self[at] for at in range(len(self)))


def which_move(motions: Sequence[BodyMotion]) -> Mask:
    """Return which bodies move.

    Parameters
    ----------
    motions
        Of n bodies.

    Returns
    -------
    ndarray
        (n,).
    """
    if not isinstance(motions, BodyMotions):
        return np.array([motion.moving for motion in motions], dtype=bool)
    moves = np.zeros(len(motions), dtype=bool)
    moves[[index for index, motion in motions.others.items() if motion.moving]] = True
    return moves
