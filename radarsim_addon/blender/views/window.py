# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of the receiver's image that one render contains, and its seed. No bpy."""

from __future__ import annotations

import hashlib
import math
import struct
from dataclasses import dataclass, replace

from ...contract import ReceiverRecord

#: Rays that are enough for a sum, and pixels per side of those that share a ray, at most.
_ENOUGH_RAYS, _MOST_SHARED = 4096, 4


@dataclass(frozen=True)
class ViewWindow:
    """A part of the field of view: its edges in the camera's coordinates, and its pixels.

    Attributes
    ----------
    left, right, bottom, top
        Edges: tangents, metres (orthographic), or longitude and latitude [rad] (`sphere`).
    width_px, height_px
        Pixels.
    sphere
        Whether the coordinates are longitude and latitude.
    """

    left: float
    right: float
    bottom: float
    top: float
    width_px: int
    height_px: int
    sphere: bool = False

    @classmethod
    def of(cls, receiver: ReceiverRecord, width_px: int, height_px: int) -> ViewWindow:
        """Return all that a receiver sees."""
        sphere = receiver.kind == "equirectangular"
        edges = receiver.left, receiver.right, receiver.bottom, receiver.top
        return cls(*edges, width_px, height_px, sphere)

    @property
    def step_u(self) -> float:
        """Step of the first coordinate from pixel to pixel."""
        return (self.right - self.left) / self.width_px

    @property
    def step_v(self) -> float:
        """Step of the second coordinate from pixel to pixel."""
        return (self.top - self.bottom) / self.height_px

    @property
    def stretch(self) -> float:
        """Most true length per unit of the first coordinate."""
        if not self.sphere:
            return 1.0
        return math.cos(min(max(0.0, self.bottom), self.top))

    @property
    def pitch(self) -> float:
        """Largest true step of a pixel."""
        return max(self.step_u * self.stretch, self.step_v)

    def edges_of(
        self, offset_px: tuple[float, float], across: int, down: int
    ) -> tuple[float, float, float, float]:
        """Return left, right, bottom and top of so many pixels from the upper left corner, moved by
        fractions of a pixel.
        """
        left = self.left + offset_px[0] * self.step_u
        top = self.top + offset_px[1] * self.step_v
        return left, left + across * self.step_u, top - down * self.step_v, top

    def with_few_rays(self) -> ViewWindow:
        """Return the window with as many pixels as are enough for a sum."""
        rays = self.width_px * self.height_px
        side = min(max(math.isqrt(rays // _ENOUGH_RAYS), 1), _MOST_SHARED)
        return replace(
            self, width_px=-(-self.width_px // side), height_px=-(-self.height_px // side)
        )


def replicate_seed(seed: int, window: ViewWindow, replicate: int) -> int:
    """Return Cycles' seed for one replicate of a tile. It does not depend on the tiles' order.

    Parameters
    ----------
    seed
        Seed of the run.
    window
        The tile.
    replicate
        Number of the replicate, from 0.

    Returns
    -------
    int
        From 0 to 2**31 - 1.
    """
    edges = (window.left, window.right, window.bottom, window.top)
    key = struct.pack("<4q4d", seed, replicate, window.width_px, window.height_px, *edges)
    return int.from_bytes(hashlib.blake2b(key, digest_size=4).digest(), "little") >> 1
