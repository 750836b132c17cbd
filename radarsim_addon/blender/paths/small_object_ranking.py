# SPDX-License-Identifier: GPL-3.0-or-later
"""Which small objects get tiles of their own where there are more of them than that is good for.

Each such tile costs renders of some milliseconds whatever it holds. So they go to those whose echo
counts, that are not hidden, and whose error would be largest: those of fewest pixels. Does not
import bpy.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from ... import contract
from ...array_types import Mask, Real
from ...findings import Finding, finding
from ..scene import Poses
from ..views import View, ViewWindow
from .error_budget import FAINTEST
from .inset_tiles import SMALL_PX
from .screen_boxes import ViewBoxes, projected_bounds

#: So many small objects get tiles of their own at most.
MOST_TILED = 256
#: Pixels on each side of an object's own that are looked at, and the most across or down.
_BESIDE, _MOST_LOOKED = 1, 16
#: Objects of fewer pixels than this can lie between all rays of a view.
_SURELY_HIT_PX = 2.0


def small_boxes(boxes: ViewBoxes, frame: ViewWindow) -> ViewBoxes:
    """Those that are small in the frame; a box of no extent has no echo."""
    across, down = boxes.pixels(frame)
    least = np.minimum(across, down)
    return boxes.take((least > 0) & (least < SMALL_PX))


def in_sight(
    boxes: ViewBoxes,
    receiver: contract.ReceiverRecord,
    window: ViewWindow,
    view: View,
    opaque: frozenset[int],
    metres_per_unit: float,
) -> Mask:
    """Whether something of each small box may be seen in a part of the frame, (n,).

    Told from the surfaces that its rays met first on and around the box: none of them may be nearer
    and hide it (`opaque`: objects that nothing passes through). Of many pixels, some are looked at.
    """
    seen = np.zeros(len(boxes), dtype=bool)
    if view.position is None or view.object_index is None:
        return ~seen
    pose = np.array(receiver.matrix_world, dtype=np.float64)
    position_m = view.position.astype(np.float64) * metres_per_unit
    local = (position_m - pose[:3, 3]) @ pose[:3, :3]
    ortho = receiver.kind == "orthographic"
    reach = -local[..., 2] if ortho else np.linalg.norm(local, axis=-1)
    # What light passes, and the sky, hide nothing.
    hides = np.isin(view.object_index, sorted(opaque)) & np.isfinite(reach)
    reach = np.where(hides, reach, np.inf)
    nearest = boxes.distance_m - boxes.radius_m
    for turn in (-2 * math.pi, 0.0, 2 * math.pi) if window.sphere else (0.0,):
        left = np.floor((boxes.left + turn - window.left) / window.step_u) - _BESIDE
        right = np.ceil((boxes.right + turn - window.left) / window.step_u) + _BESIDE
        top = np.floor((window.top - boxes.top) / window.step_v) - _BESIDE
        bottom = np.ceil((window.top - boxes.bottom) / window.step_v) + _BESIDE
        met = (right > 0) & (left < window.width_px) & (bottom > 0) & (top < window.height_px)
        for i in np.flatnonzero(met & ~seen):
            rows = _pixels(top[i], bottom[i], window.height_px)
            cols = _pixels(left[i], right[i], window.width_px)
            index = np.ix_(rows, cols)
            own = view.object_index[index] == boxes.number[i]
            seen[i] = bool(np.any(own | (reach[index] >= nearest[i])))
    return seen


def _pixels(first: float, last: float, count: int) -> NDArray[np.intp]:
    """Pixels from first to last, within the view; some of them where they are many."""
    low, high = max(int(first), 0), min(int(last), count)
    return np.unique(np.linspace(low, high - 1, min(high - low, _MOST_LOOKED)).astype(np.intp))


def rank_by_error(
    small: ViewBoxes,
    seen: Mask,
    boxes: ViewBoxes,
    frame: ViewWindow,
    receiver: contract.ReceiverRecord,
    transmitter_m: Real,
    most: int,
) -> ViewBoxes:
    """The small boxes that get tiles: at most so many of those in sight (`seen`, (n,)).

    An object that covers n pixels on average is met by n rays give or take: its relative error
    goes as 1/sqrt(n), and all objects count alike in the error (`ErrorBudget.relative_error`). So
    those of fewest pixels come first, but after them what is so far below the strongest echo of all
    `boxes` that it does not drive refinement.
    """
    strongest = _echo(boxes, frame, receiver, transmitter_m).max(initial=0.0)
    faint = _echo(small, frame, receiver, transmitter_m) <= FAINTEST * strongest
    across, down = small.pixels(frame)
    order = np.lexsort((across * down, faint))
    return small.take(np.sort(order[seen[order]][:most]))


def _echo(
    boxes: ViewBoxes, frame: ViewWindow, receiver: contract.ReceiverRecord, transmitter_m: Real
) -> Real:
    """Echo of each box up to a factor: solid angle over squared distance from the transmitter."""
    across, down = boxes.pixels(frame)
    pose = np.array(receiver.matrix_world, dtype=np.float64)
    away = np.linalg.norm(boxes.centre_m - (transmitter_m - pose[:3, 3]) @ pose[:3, :3], axis=1)
    return np.asarray(across * down * boxes.stretch / np.maximum(away, boxes.radius_m) ** 2)


def missed_objects_findings(
    poses: Poses,
    names: Sequence[str],
    met: Collection[int],
    receiver: contract.ReceiverRecord,
    frame: ViewWindow,
) -> list[Finding]:
    """Find objects that no ray met (numbers not in `met`) although they are in sight.

    Refinement follows echoes: what gave none is never refined, and its power is missing from the
    error estimate too. Larger objects that were not met are hidden by others: nothing is said.
    """
    boxes = projected_bounds(poses, names, receiver, met)
    # The side of fewer pixels decides whether it can slip through between rays.
    slips = np.minimum(*boxes.pixels(frame)) < _SURELY_HIT_PX
    small = [names[number - 1] for number in np.unique(boxes.number[slips])]
    return [finding("object-missed-by-rays", *small)] if small else []
