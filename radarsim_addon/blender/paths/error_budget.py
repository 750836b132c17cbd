# SPDX-License-Identifier: GPL-3.0-or-later
"""Relative errors of a frame's powers, and the tiles that they come from. Does not import bpy.

Each tile is measured with several sub-pixel offsets of its grid; they are replicates, so their
scatter is the tile's own error (`CellGrid`). One replicate alone gives the error of objects, not of
range bins. `ErrorBudget` sums the cells of all tiles and weighs the *relative* error of each range
bin and of each object's power: a faint far target matters as much as strong near ground.

Small objects get tiles of their own. Each such tile costs renders of some milliseconds whatever it
holds, so if there are many, the tiles go to objects in sight (`in_sight`) whose error would be
largest (`rank_by_error`): those of fewest pixels, except faint ones.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ... import contract
from ...arrays import Indices, Mask, Real
from ...findings import Finding, finding
from ...signal.paths import (
    GridPlaces,
    PathFlag,
    PathRows,
    Places,
    edge_variances,
    lone_variances,
    power_of_range_bins,
    steps_of,
)
from ..scene import Poses
from ..views import View, ViewWindow
from .tiles import SMALL_PX, ViewBoxes, projected_bounds

#: Variance of the number of grid points in a convex shape of n of them on average, over sqrt(n): a
#: randomly shifted grid misses or gains points along the edge alone, whose length goes as sqrt(n)
#: (Kendall 1948: 0.0728 of the perimeter in grid steps, 4 sqrt(n) for a square).
_EDGE_VARIANCE = 0.29
#: Cells this far below the strongest one do not drive refinement [power ratio].
FAINTEST = 1e-8


@dataclass
class CellPowers:
    """Powers of one tile by cell (range bins, then objects).

    `cells` are the numbers of those that hold power; their mean over the replicates [W] and the
    variance of that mean, (n,) each.
    """

    cells: NDArray[np.int64]
    mean: Real
    variance: Real


@dataclass(frozen=True)
class ReplicatePowers:
    """Powers of one replicate of a tile: cells whose power is not zero, and their power [W],
    (n,).

    By object number: `hits` are its pixels as a fraction of one of all replicates, `edges` the
    least variance of its mean power by its edges, likewise (for one replicate alone, all of its
    variance).
    """

    cells: NDArray[np.int64]
    power: Real
    hits: Real
    edges: Real


@dataclass
class CellGrid:
    """Numbers of cells: range bins first, then objects. Without `ranges` the bins stay empty."""

    bin_m: float
    bins: int
    ranges: bool = True

    @property
    def first_object(self) -> int:
        """Cell of object 0, which stands for unknown objects. The cell before it holds everything
        beyond the range bins.
        """
        return self.bins + 1

    def replicate_powers(
        self, rows: PathRows, count: int, receiver: contract.ReceiverRecord | None = None
    ) -> ReplicatePowers:
        """Compute the powers of one replicate of a tile.

        The tile has `count` replicates, and each row holds its part of the mean over them. Without
        a receiver, the variance from object edges is unknown and left out.
        """
        return self.powers_of_views([rows], count, receiver)[0]

    def powers_of_views(
        self,
        views: Sequence[PathRows],
        count: int,
        receiver: contract.ReceiverRecord | None = None,
    ) -> list[ReplicatePowers]:
        """Compute the powers of several replicates, each as in `replicate_powers`."""
        rows = PathRows.joined(views)
        view = np.repeat(np.arange(len(views)), [own.size for own in views])
        power_w = rows["power_w"] * count
        grid = GridPlaces().of_views(np.arange(rows.size))
        by_bin = np.zeros((len(views), 1))
        if self.ranges:
            by_bin = self._by_bin(rows, view, len(views), count, receiver, grid)
        number = rows["last_object"].astype(np.int64)
        shape = len(views), int(number.max(initial=0)) + 1
        # objects of each view by numbers of their own
        place, size = view * shape[1] + number, math.prod(shape)
        by_object = np.bincount(place, power_w, size).reshape(shape)
        hits = np.bincount(place, minlength=size).reshape(shape) / count
        edges = np.zeros(size)
        if receiver is not None:
            label = np.where(number > 0, place, 0)
            if count > 1:
                least = edge_variances(rows, label, power_w, receiver, count, grid) / count
            else:
                least = lone_variances(rows, label, power_w, receiver, grid)
            edges[: least.size] = least
        found = []
        for each in zip(by_bin, by_object, hits, edges.reshape(shape), strict=True):
            bins, objects = map(np.flatnonzero, each[:2])
            cells = np.concatenate([bins, objects + self.first_object])
            powers_w = np.concatenate([each[0][bins], each[1][objects]])
            found.append(ReplicatePowers(cells, powers_w, *each[2:]))
        return found

    def _by_bin(
        self,
        rows: PathRows,
        view: Indices,
        views: int,
        count: int,
        receiver: contract.ReceiverRecord | None,
        grid: Places,
    ) -> Real:
        """Return the power in the range bins of each view. Each row is spread over the ranges of
        its pixel, as in the profile.
        """
        kept = np.flatnonzero(rows["flags"] & PathFlag.NO_RANGE == 0)
        if kept.size < rows.size:
            rows, view = rows[kept], view[kept]
        if receiver is None:
            size = self.bins + 1
            place = np.clip(rows["length_m"] / 2 / self.bin_m, 0, self.bins).astype(np.int64)
            by_bin = np.bincount(place + view * size, rows["power_w"], views * size)
            return by_bin.reshape(views, size) * count
        steps = steps_of(rows, receiver, count, grid)
        return power_of_range_bins(rows, steps, self.bin_m, self.bins, view, views) * count

    def powers(self, replicates: Sequence[ReplicatePowers]) -> CellPowers:
        """Return the mean and variance of each cell of a tile over the replicates of the tile."""
        count = len(replicates)
        cells = np.unique(np.concatenate([replicate.cells for replicate in replicates]))
        total = np.zeros((count, cells.size))
        hits = np.zeros(max(replicate.hits.size for replicate in replicates))
        edges = np.zeros(hits.size)
        for number, replicate in enumerate(replicates):
            total[number, np.searchsorted(cells, replicate.cells)] = replicate.power
            hits[: replicate.hits.size] += replicate.hits
            edges[: replicate.edges.size] += replicate.edges
        mean = total.mean(axis=0)
        # One replicate has no scatter; the variance of objects follows below.
        variance = total.var(axis=0, ddof=1) / count if count > 1 else np.zeros_like(mean)
        known_object = cells > self.first_object
        place = cells[known_object] - self.first_object
        hits = hits[place]
        # Replicates may agree by chance on an object of a few pixels, or with edges along them.
        least = (mean[known_object] / hits) ** 2 * _EDGE_VARIANCE * np.sqrt(hits) / count
        least = np.maximum(least, edges[place])
        variance[known_object] = np.maximum(variance[known_object], least)
        return CellPowers(cells, mean, variance)


@dataclass
class ErrorBudget:
    """Sums of the cells of all tiles, and the tiles that the error comes from.

    `first_object` is the number of the first cell that is an object; None if all are range bins.
    `by` says which of them count: "both", "ranges" or "objects".
    """

    first_object: int | None = None
    by: str = "both"
    powers: dict[int, CellPowers] = field(default_factory=dict)

    def totals(self) -> tuple[Real, Real]:
        """Return the mean and variance of each cell, added up over all tiles."""
        size = 1 + max((int(p.cells.max(initial=0)) for p in self.powers.values()), default=0)
        mean, variance = np.zeros(size), np.zeros(size)
        for part in self.powers.values():
            mean[part.cells] += part.mean
            variance[part.cells] += part.variance
        return mean, variance

    def relative_error(self) -> float:
        """Return the relative standard error of all cells: one half of it is for range bins, one
        half for objects.

        The weight of a range bin is the root of its power. With equal weights, noise in empty
        ranges would dominate; with the power as weight, only the strongest bins would count. All
        objects have the same weight, so that a small target counts as much as the ground below it.
        """
        mean, variance = self.totals()
        return math.sqrt(float(np.sum(variance * self._weights(mean))))

    def _weights(self, mean: Real) -> Real:
        """Return the weight that the variance of each cell has in the squared relative error."""
        number = np.arange(mean.size)
        first = mean.size if self.first_object is None else self.first_object
        strong = mean > FAINTEST * mean.max(initial=0.0)
        # The first object is the unknown one.
        bins, objects = strong & (number < first), strong & (number > first)
        weight = np.zeros_like(mean)
        counted = {"ranges": (bins,), "objects": (objects,)}.get(self.by, (bins, objects))
        groups = [group for group in counted if group.any()]
        for group in groups:
            importance = np.sqrt(mean[group]) if group is bins else np.ones(int(group.sum()))
            weight[group] = importance / importance.sum() / mean[group] ** 2 / len(groups)
        return weight

    def object_errors(self) -> dict[int, float]:
        """Return the relative standard error of the power of each object above `FAINTEST`, by its
        number.
        """
        mean, variance = self.totals()
        first = mean.size if self.first_object is None else self.first_object
        strong = mean > FAINTEST * mean.max(initial=0.0)
        return {
            int(cell) - first: float(math.sqrt(variance[cell]) / mean[cell])
            for cell in np.flatnonzero(strong)
            if cell > first
        }

    def squared_errors(self, tiles: Iterable[int]) -> dict[int, float]:
        """Return the part of the squared relative error that each of these tiles causes."""
        weight = self._weights(self.totals()[0])
        return {
            tile: float(np.sum(self.powers[tile].variance * weight[self.powers[tile].cells]))
            for tile in tiles
            if tile in self.powers
        }

    def worst(self, tiles: Iterable[int], share: float) -> list[int]:
        """Return the tiles that together cause the fraction `share` of the squared error, the worst
        tile first.
        """
        score = self.squared_errors(tiles)
        total = sum(score.values())
        chosen, carried = [], 0.0
        for tile in sorted(score, key=lambda t: (-score[t], t)):
            if carried >= share * total or score[tile] <= 0:
                break
            chosen.append(tile)
            carried += score[tile]
        return chosen


def uncertain_objects(
    errors: dict[int, float], names: Sequence[str], target: float
) -> list[Finding]:
    """Return a finding for each object whose relative error is above twice the target.

    The target is a mean over all objects, so single objects can have a much larger error.
    """
    return [
        finding(
            "object-error-above-target",
            names[number - 1],
            stderr_fraction=error,
            target_fraction=target,
        )
        for number, error in sorted(errors.items(), key=lambda item: -item[1])
        if error > 2 * target
    ]


# -------------------------------------------------------------------------------------------------
# Small objects: which get tiles of their own, and which no ray met.
# -------------------------------------------------------------------------------------------------


#: Most small objects that get tiles of their own.
MOST_TILED = 256
#: Pixels on each side of an object's own that are looked at, and the most across or down.
_BESIDE, _MOST_LOOKED = 1, 16
#: Objects of fewer pixels than this can lie between all rays of a view.
_SURELY_HIT_PX = 2.0


def small_boxes(boxes: ViewBoxes, frame: ViewWindow) -> ViewBoxes:
    """Return the boxes that are small in the frame. A box without extent has no echo, and is left
    out.
    """
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
    """Return whether the receiver may see a part of each small box in this part of the frame, (n,).

    The pixels on and around a box decide, or some of them if they are many. A box is in sight if
    the first surface in one of these pixels is the object itself, or is no nearer than the box.
    Only `opaque` objects hide others.
    """
    seen = np.zeros(len(boxes), dtype=bool)
    if view.position is None or view.object_index is None:
        return ~seen
    pose = np.array(receiver.matrix_world, dtype=np.float64)
    position_m = view.position.astype(np.float64) * metres_per_unit
    local = (position_m - pose[:3, 3]) @ pose[:3, :3]
    ortho = receiver.kind == "orthographic"
    reach = -local[..., 2] if ortho else np.linalg.norm(local, axis=-1)
    # The sky and objects that light passes through hide nothing.
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
    """Return the pixels from first to last that are in the view; some of them if they are many."""
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
    """Return the small boxes that get tiles: at most `most` of those in sight (`seen`, (n,)).

    About n rays meet an object that covers n pixels, so its relative error falls as 1/sqrt(n). All
    objects count alike in the error, so those of the fewest pixels come first. Objects that are far
    below the strongest echo of all `boxes` do not drive the refinement, and come last.
    """
    strongest = _echo(boxes, frame, receiver, transmitter_m).max(initial=0.0)
    faint = _echo(small, frame, receiver, transmitter_m) <= FAINTEST * strongest
    across, down = small.pixels(frame)
    order = np.lexsort((across * down, faint))
    return small.take(np.sort(order[seen[order]][:most]))


def _echo(
    boxes: ViewBoxes, frame: ViewWindow, receiver: contract.ReceiverRecord, transmitter_m: Real
) -> Real:
    """Return the echo of each box up to a common factor: solid angle over squared distance from the
    transmitter.
    """
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
    """Return findings for objects in sight that no ray met. `met` has the numbers of the others.

    Refinement follows echoes, so it never refines an object without an echo, and the error estimate
    does not contain its power. A larger object that no ray met is hidden by others: this is no
    finding.
    """
    boxes = projected_bounds(poses, names, receiver, met)
    # The side of fewer pixels decides whether it can slip through between rays.
    slips = np.minimum(*boxes.pixels(frame)) < _SURELY_HIT_PX
    small = [names[number - 1] for number in np.unique(boxes.number[slips])]
    return [finding("object-missed-by-rays", *small)] if small else []
