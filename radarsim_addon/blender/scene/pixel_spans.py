# SPDX-License-Identifier: GPL-3.0-or-later
"""What a pixel spans of range on flat surfaces in view, and how small objects in view are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from ...array_types import Real
from .ground_truth import Boxes

#: Thickness of a flat surface over the shorter of its sides.
_FLAT = 0.2
#: Places at which a surface is looked at: distances from the foot of the radar, and directions.
_PLACES = 64
#: Flat surfaces that are looked at: the largest.
_MOST_SURFACES = 16


@dataclass(frozen=True)
class PixelSpans:
    """What pixels meet, for a frame whose pixels are `width` / pixels across wide at distance 1.

    Attributes
    ----------
    width
        Width of the frame at distance 1.
    surfaces
        By the name of a flat surface: places (2, n), their range and the range that a pixel spans
        there over its width at distance 1, both [m].
    sizes
        Largest angular size of each object, as a width at distance 1, by name.
    """

    width: float = 0.0
    surfaces: Mapping[str, Real] = field(default_factory=lambda: MappingProxyType({}))
    sizes: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    def longest_m(self, width_px: int, limit_m: float) -> dict[str, tuple[float, float]]:
        """Return the largest range step of a pixel on each surface, and its range, up to a range.

        Both in metres; surfaces without a place up to `limit_m` are left out.
        """
        found = {}
        for name, (range_m, span_m) in self.surfaces.items():
            near = range_m <= limit_m
            if near.any():
                worst = int(np.argmax(np.where(near, span_m, 0.0)))
                step_m = float(span_m[worst]) * self.width / width_px
                found[name] = step_m, float(range_m[worst])
        return found


def measure_pixel_spans(
    boxes: Boxes, matrix: Real, edges: tuple[float, ...], metres: float
) -> PixelSpans:
    """Measure boxes as a perspective receiver sees them.

    Parameters
    ----------
    boxes
        Of what can echo.
    matrix
        Pose of the receiver, (4, 4) [Blender units]; it looks along -Z.
    edges
        Left, right, bottom and top of its frame at distance 1.
    metres
        Metres per Blender unit.

    Returns
    -------
    PixelSpans
    """
    if not boxes.rows.size:
        return PixelSpans(edges[1] - edges[0])
    turned = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
    corners = (boxes.corners - matrix[:3, 3]) @ turned * metres  # in the receiver's axes [m]
    centres = corners.mean(axis=1)
    radius_m = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1)
    seen = np.flatnonzero(_in_view(centres, edges) & (radius_m > 0))
    labels = [boxes.snapshot.label(row) for row in boxes.rows.tolist()]
    sizes: dict[str, float] = {}
    for row in seen.tolist():
        size = float(2 * radius_m[row] / np.linalg.norm(centres[row]))
        sizes[labels[row]] = max(size, sizes.get(labels[row], 0.0))
    surfaces = {}
    sides = np.stack([corners[:, corner] - corners[:, 0] for corner in (4, 3, 1)], axis=1)
    lengths = np.linalg.norm(sides, axis=2)
    thin = np.sort(lengths, axis=1)
    flat = np.flatnonzero((thin[:, 0] <= _FLAT * thin[:, 1]) & (thin[:, 1] > 0))
    for row in flat[np.argsort(-radius_m[flat])][:_MOST_SURFACES].tolist():
        places = _places(centres[row], sides[row], lengths[row], edges)
        if places.size:
            surfaces[labels[row]] = places
    return PixelSpans(edges[1] - edges[0], surfaces, sizes)


def _in_view(
    points: Real, edges: tuple[float, ...]
) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Whether points in the receiver's axes (n, 3) are in its frame, (n,)."""
    left, right, bottom, top = edges
    ahead = -points[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = points[:, 0] / ahead, points[:, 1] / ahead
    inside = (x >= left) & (x <= right) & (y >= bottom) & (y <= top)
    return np.asarray((ahead > 0) & inside)


def _places(centre: Real, sides: Real, lengths: Real, edges: tuple[float, ...]) -> Real:
    """Ranges of places in view on a flat box, and what a pixel spans there, (2, n) [m]."""
    long = np.argsort(lengths)[1:].tolist()
    first, second = (sides[axis] / lengths[axis] for axis in long)
    normal = np.cross(first, second)
    normal /= np.linalg.norm(normal)
    height = abs(float(centre @ normal))
    foot = (centre @ normal) * normal
    far = np.linalg.norm(centre - foot) + np.linalg.norm(lengths) / 2
    away = np.geomspace(max(far * 1e-4, 1e-6), far, _PLACES)
    turn = np.linspace(0, 2 * np.pi, _PLACES, endpoint=False)
    along = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * np.cross(normal, first)
    points = (foot + away[:, None, None] * along).reshape(-1, 3)
    from_centre = points - centre
    on_it = np.all(
        [abs(from_centre @ side) <= lengths[axis] / 2 for axis, side in zip(long, (first, second))],
        axis=0,
    )
    kept = on_it & _in_view(points, edges)
    if height <= 1e-9 * far or not kept.any():  # seen edge-on: it is in no pixel
        return np.zeros((2, 0))
    points = points[kept]
    range_m = np.linalg.norm(points, axis=1)
    tangent = (
        np.sqrt(np.maximum(range_m**2 - height**2, 0.0)) / height
    )  # of the angle to the normal
    # A pixel of width w at distance 1 turns the ray by w cos(angle off the axis), at most.
    span_m = range_m * tangent * (-points[:, 2] / range_m)
    return np.stack([range_m, span_m])
