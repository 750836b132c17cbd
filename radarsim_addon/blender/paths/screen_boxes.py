# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the boxes of objects lie in a view of any kind. Does not import bpy."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ... import contract
from ...array_types import Indices, Real
from ..scene import Poses
from ..views import ViewWindow
from .tiles import Area

#: Boxes that are looked at at once; each takes some kilobytes.
_CHUNK = 1 << 14
#: Least cosine of a latitude that stretches are told from: a microradian off the pole.
_LEAST_STRETCH = 1e-6
_PAIRS = np.array(list(itertools.combinations(range(8), 2))).T


@dataclass(frozen=True)
class ViewBoxes:
    """Areas around n boxes that are in view, all fields (n, ...).

    Edges are in the camera's coordinates (`contract.ReceiverRecord`); longitudes may lie beyond pi
    where a box straddles the seam, see :meth:`areas`. `number` is the object's, from 1; `stretch`
    the most true length per unit of the first coordinate (cosine of the latitude, or 1); `centre_m`
    is in the camera's axes, `distance_m` its distance (orthographic: depth), `radius_m` half the
    diagonal.
    """

    number: NDArray[np.intp]
    left: Real
    right: Real
    bottom: Real
    top: Real
    stretch: Real
    centre_m: Real
    distance_m: Real
    radius_m: Real

    def __len__(self) -> int:
        return int(self.number.size)

    def take(self, chosen: NDArray[np.bool_] | Indices) -> ViewBoxes:
        """These of the boxes."""
        return ViewBoxes(**{f.name: getattr(self, f.name)[chosen] for f in fields(self)})

    def pixels(self, window: ViewWindow) -> tuple[Real, Real]:
        """Pixels of a window across each box, and down."""
        return (self.right - self.left) / window.step_u, (self.top - self.bottom) / window.step_v

    def areas(self, window: ViewWindow) -> list[Area]:
        """Areas in the window; a box across +-180 degrees of longitude has two."""
        turns = (-2 * math.pi, 0.0, 2 * math.pi) if window.sphere else (0.0,)
        return [
            Area(
                float(self.left[i] + turn),
                float(self.right[i] + turn),
                float(self.bottom[i]),
                float(self.top[i]),
                float(self.stretch[i]),
            )
            for i in range(len(self))
            for turn in turns
            if self.right[i] + turn > window.left and self.left[i] + turn < window.right
        ]


def projected_bounds(
    poses: Poses,
    names: Sequence[str],
    receiver: contract.ReceiverRecord,
    left_out: Collection[int] = (),
) -> ViewBoxes:
    """Areas around the boxes of all that is shown and in view, but for the numbers `left_out`.

    Left out, too, is what is around the receiver or partly behind a perspective one: near or not
    small. `names` are those of the object numbers, from 1.
    """
    numbers = poses.numbered(names)
    shown = np.argsort(numbers, kind="stable")
    shown = shown[~np.isin(numbers[shown], [0, *left_out])]
    starts = range(0, len(shown), _CHUNK) or (0,)
    chunks = (shown[start : start + _CHUNK] for start in starts)
    parts = [_boxes_in_view(numbers[some], poses, some, receiver) for some in chunks]
    return ViewBoxes(
        **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(ViewBoxes)}
    )


def _boxes_in_view(
    number: Indices, poses: Poses, chosen: Indices, receiver: contract.ReceiverRecord
) -> ViewBoxes:
    count = len(number)
    pose = np.array(receiver.matrix_world, dtype=np.float64)
    local = _corners(poses.box[chosen], poses.pose[chosen], pose)
    depth = -local[..., 2]
    centre = (local.min(axis=1) + local.max(axis=1)) / 2
    distance = np.linalg.norm(centre, axis=1)
    stretch = np.ones(count)
    if receiver.kind == "equirectangular":
        left, right, bottom, top, known = _on_sphere(local)
        nearest = np.clip(0.0, bottom, top)  # to the equator
        stretch = np.maximum(np.cos(nearest), _LEAST_STRETCH)
        known &= _meets_turned(left, right, receiver)
    else:
        u, v = local[..., 0], local[..., 1]
        if receiver.kind == "perspective":
            known = depth.min(axis=1) > 0
            safe = np.where(known[:, None], depth, 1.0)
            u, v = u / safe, v / safe
        else:
            known = depth.max(axis=1) > 0
            distance = -centre[:, 2]
        left, right = u.min(axis=1), u.max(axis=1)
        bottom, top = v.min(axis=1), v.max(axis=1)
        known &= (right > receiver.left) & (left < receiver.right)
    known &= (top > receiver.bottom) & (bottom < receiver.top)
    radius = np.linalg.norm(local.max(axis=1) - local.min(axis=1), axis=1) / 2
    boxes = ViewBoxes(number, left, right, bottom, top, stretch, centre, distance, radius)
    return boxes.take(known)


def _corners(box: Real, own: Real, pose: Real) -> Real:
    """Corners of boxes (n, 2, 3) of poses (n, 4, 4) in the camera's axes, (n, 8, 3) [m]."""
    which = np.array(list(itertools.product((0, 1), repeat=3)))
    corners = box[:, which, np.arange(3)]
    world = corners @ own[:, :3, :3].transpose(0, 2, 1) + own[:, None, :3, 3]
    return np.asarray((world - pose[:3, 3]) @ pose[:3, :3], dtype=np.float64)


def _on_sphere(local: Real) -> tuple[Real, Real, Real, Real, NDArray[np.bool_]]:
    """Longitudes from and to, latitudes from and to, and whether these are known, each (n,).

    A convex body's edges are great circles. Longitudes have no extreme within one, latitudes do.
    Diagonals lie within the body, so all pairs of corners are taken. A body on the axis has all
    longitudes, and the pole where it is on one side of the horizon; else it is as good as around
    the receiver.
    """
    angle = np.sort(np.arctan2(local[..., 0], -local[..., 2]), axis=1)
    gap = np.diff(angle, axis=1, append=angle[:, :1] + 2 * math.pi)
    last = np.argmax(gap, axis=1)  # the body ends there, and begins after the gap
    rows = np.arange(len(local))
    widest = gap[rows, last]
    left = angle[rows, (last + 1) % 8]
    right = left + (2 * math.pi - widest)
    latitude = np.arctan2(local[..., 1], np.hypot(local[..., 0], local[..., 2]))
    bottom, top = latitude.min(axis=1), latitude.max(axis=1)
    inner = _latitudes_within(local[:, _PAIRS[0]], local[:, _PAIRS[1]])
    bottom, top = np.minimum(bottom, inner.min(axis=1)), np.maximum(top, inner.max(axis=1))
    on_axis = widest <= math.pi * (1 + 1e-12)
    above, below = (local[..., 1] > 0).all(axis=1), (local[..., 1] < 0).all(axis=1)
    left, right = np.where(on_axis, -math.pi, left), np.where(on_axis, math.pi, right)
    top = np.where(on_axis & above, math.pi / 2, top)
    bottom = np.where(on_axis & below, -math.pi / 2, bottom)
    return left, right, bottom, top, ~on_axis | above | below


def _latitudes_within(a: Real, b: Real) -> Real:
    """Latitude where it is stationary along the edges from a to b, or at an end; (n, edges).

    With p = a + t d, y/|p| is stationary where d_y p.p = y p.d, of which the squares of t cancel.
    """
    d = b - a
    squared, along, length = ((x * y).sum(axis=-1) for x, y in ((a, a), (a, d), (d, d)))
    above = a[..., 1] * along - d[..., 1] * squared
    below = d[..., 1] * along - a[..., 1] * length
    t = np.zeros_like(above)
    np.divide(above, below, out=t, where=below != 0)
    point = a + np.clip(t, 0.0, 1.0)[..., None] * d
    return np.asarray(np.arctan2(point[..., 1], np.hypot(point[..., 0], point[..., 2])))


def _meets_turned(left: Real, right: Real, receiver: contract.ReceiverRecord) -> NDArray[np.bool_]:
    met = np.zeros(left.shape, dtype=bool)
    for turn in (-2 * math.pi, 0.0, 2 * math.pi):
        met |= (right + turn > receiver.left) & (left + turn < receiver.right)
    return met
