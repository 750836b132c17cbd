# SPDX-License-Identifier: GPL-3.0-or-later
"""The records of one render: its request, with path class and region, and the resulting view.

A `ViewWindow` is the part of the receiver's image that a tile covers. A `RenderRequest` names a
`PathClass` and a `Region` of the window, and a `View` has the light of these paths. Does not import
bpy.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
import struct
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...arrays import Indices, Real, Single
from ...contract import ReceiverRecord

#: Rays that suffice for a sum, and the most pixels per side that share a ray.
_ENOUGH_RAYS, _MOST_SHARED = 4096, 4


@dataclass(frozen=True)
class ViewWindow:
    """A part of the field of view: its edges in the camera's coordinates, and its pixels.

    The edges are tangents, metres (orthographic), or longitude and latitude [rad] (`sphere`).
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
        """Return the window of the whole receiver."""
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
        """Largest true length per unit of the first coordinate."""
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
        """Return the edges of so many pixels from the upper left corner, offset by `offset_px`."""
        left = self.left + offset_px[0] * self.step_u
        top = self.top + offset_px[1] * self.step_v
        return left, left + across * self.step_u, top - down * self.step_v, top

    def with_few_rays(self) -> ViewWindow:
        """Return the window with as few pixels as suffice for a sum."""
        rays = self.width_px * self.height_px
        side = min(max(math.isqrt(rays // _ENOUGH_RAYS), 1), _MOST_SHARED)
        return replace(
            self, width_px=-(-self.width_px // side), height_px=-(-self.height_px // side)
        )


@dataclass(frozen=True)
class PathClass:
    """Paths that the transmitter lights, by their reflections and passed transparent surfaces.

    Both limits are inclusive; None is no limit.
    """

    #: Reflections.
    order_min: int = 1
    order_max: int | None = None
    #: Transparent surfaces passed on the receiver's side.
    depth_min: int = 0
    depth_max: int | None = None
    #: Camera rays pass Radar Materials with certainty (with the transmission as their weight)
    #: while fewer transparent surfaces than this lie behind them. None: lobes are chosen at random.
    surface_depth: int | None = None


@dataclass(frozen=True)
class Region:
    """A rectangle of the pixels of a view; row 0 is the top one."""

    #: First column, and the one after the last.
    left: int
    right: int
    #: First row, and the one after the last.
    top: int
    bottom: int


@dataclass(frozen=True)
class VertexMark:
    """Light from the surfaces at which the paths of a class have their last vertex.

    It is a light group of its own, so the transmitter's light does not change. The ratio of the
    colours of a render with `place` to those of a white one gives the place of the vertex.
    """

    #: The path class: reflections, and transparent surfaces passed on the receiver's side.
    order: int
    depth: int
    #: The colours tell where the surface is; else they are white. Both are dimmed by the way from
    #: the receiver to the surface, by the same factor in all renders with the same paths.
    place: bool


@dataclass(frozen=True)
class RenderRequest:
    """What one render must show."""

    #: Paths that echo.
    path_class: PathClass
    #: With range encoding; a plain render tells the amplitude.
    encoded: bool = True
    #: The colours of the transmitter's light give the place that it lights: the last vertex.
    vertex: bool = False
    #: Pixels that can hold a path (the others are 0 in the view); None: all.
    region: Region | None = None
    #: Range encoding in blue, too.
    all_channels: bool = False
    #: Red, green and blue are the two polarisations instead of the range encoding: see
    #: `attributes.ATTR_BY_POLARISATION`.
    by_polarisation: bool = False
    #: Last vertices that are marked in the same render; None: none.
    mark: VertexMark | None = None
    #: Orders of which the same render makes a second view, of the same rays; the transparent
    #: surfaces are those of `path_class`. For scenes that have a second view.
    beyond: PathClass | None = None


@dataclass(frozen=True)
class View:
    """The result of one render, arrays of h x w pixels; float32 as Cycles computes them."""

    #: Light of the radar's transmitter, per square Blender unit.
    red: Real | Single
    green: Real | Single
    blue: Real | Single
    #: First surface seen, world space in Blender units, (h, w, 3); NaN where there is none.
    position: Real | Single | None = None
    #: Its object's number in the run's list, 0 where there is none.
    object_index: NDArray[np.int32] | None = None
    #: Light of the vertices that the request has marked; None where it has none.
    marks: View | None = None
    #: Light of the transmitter in the second view, if one was asked for.
    beyond: View | None = None

    def only(self, pixels: NDArray[np.bool_]) -> View:
        """Return the view without the light outside these pixels; seen surfaces stay."""
        red, green, blue = (np.where(pixels, c, 0.0) for c in (self.red, self.green, self.blue))
        return dataclasses.replace(self, red=red, green=green, blue=blue)

    def turned(self) -> View:
        """Return the light as seen by an upside-down camera."""
        red, green, blue = (c[::-1, ::-1] for c in (self.red, self.green, self.blue))
        return View(red, green, blue)

    def channels(self) -> Real:
        """Return red, green and blue, (3, h, w)."""
        return np.stack([self.red, self.green, self.blue], dtype=np.float64)

    def colours(self, pixels: Indices) -> Real:
        """Return red, green and blue of pixels, counted row by row, (3, n)."""
        planes = (self.red, self.green, self.blue)
        return np.stack([plane.take(pixels) for plane in planes], dtype=np.float64)


def replicate_seed(seed: int, window: ViewWindow, replicate: int) -> int:
    """Return Cycles' seed for one replicate of a tile. It does not depend on the order of tiles."""
    edges = (window.left, window.right, window.bottom, window.top)
    key = struct.pack("<4q4d", seed, replicate, window.width_px, window.height_px, *edges)
    return int.from_bytes(hashlib.blake2b(key, digest_size=4).digest(), "little") >> 1


def variance_of_sum(power: Real) -> float:
    """Return the variance of the sum of an image (h, w) with one ray per pixel.

    Neighbouring pixels have nearly the same expectation. Half the squared difference of two pixels
    is therefore their variance, or more (successive differences: Wolter, Introduction to Variance
    Estimation, 2007, ch. 8, for systematic samples). The error of a single pixel may be its value.
    """
    if power.size == 1:
        return float(power[0, 0] ** 2)
    steps = [np.diff(power, axis=axis) for axis in (0, 1)]
    pairs = sum(step.size for step in steps)
    squares = sum(float(np.sum(step**2)) for step in steps)
    return power.size * squares / (2 * pairs)


def bounding_region(pixels: NDArray[np.bool_]) -> Region | None:
    """Return the smallest region with all these pixels; None if it would save little."""
    rows, cols = np.flatnonzero(pixels.any(axis=1)), np.flatnonzero(pixels.any(axis=0))
    if not rows.size:
        return Region(0, 1, 0, 1)
    region = Region(int(cols[0]), int(cols[-1]) + 1, int(rows[0]), int(rows[-1]) + 1)
    area = (region.right - region.left) * (region.bottom - region.top)
    return None if area > 0.85 * pixels.size else region
