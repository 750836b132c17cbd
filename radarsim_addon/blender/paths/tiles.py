# SPDX-License-Identifier: GPL-3.0-or-later
"""The field of view as a partition: tiles, and tiles of finer pixels that replace parts of them.

Every pixel of every tile is either the tile's own or belongs to finer tiles that cover it exactly,
so the view has no gap and no overlap after any refinement. `add_inset_tiles` lays finer tiles over
the small objects in sight before anything is rendered (their boxes in the view are those of
`projected_bounds`): an object that slips between all rays of a tile leaves no trace there, not in
its error either, so refinement, which follows echoes, cannot find it. Does not import bpy.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ... import contract
from ...arrays import Indices, Mask, Real
from ..plan import FINEST_PITCH, PathOptions
from ..scene import Poses
from ..views import ViewWindow

#: Pixels up to which a tile is not worth cutting.
_WHOLE_UP_TO_PX = 1 << 13
#: Tolerance for rounding [pixels]: an area that crosses the edge of a pixel by less than this does
#: not include the next pixel.
_EDGE = 1e-6


@dataclass(frozen=True)
class Area:
    """A rectangle in the view, by its edges; `stretch` is as in `ViewWindow`."""

    left: float
    right: float
    bottom: float
    top: float
    stretch: float = 1.0

    @property
    def shorter(self) -> float:
        """Length of the shorter side, with `stretch` applied."""
        return min((self.right - self.left) * self.stretch, self.top - self.bottom)


@dataclass(frozen=True)
class Tile:
    """A window with pixels of one size.

    `level` is how often the frame's pixels were halved (rounded up); `own` says which of its pixels
    are the tile's, (height, width), None for all of them: finer tiles stand for the others.
    """

    window: ViewWindow
    level: int = 0
    own: Mask | None = None

    def own_pixels(self) -> int:
        """Return the number of pixels that belong to the tile."""
        if self.own is None:
            return self.window.width_px * self.window.height_px
        return int(np.count_nonzero(self.own))

    def finer(
        self, left: int, right: int, top: int, bottom: int, across: int, down: int | None = None
    ) -> Tile:
        """Return a part of the tile with finer pixels: columns left to right and rows top to
        bottom, both exclusive.

        Each pixel is cut into `across` columns, and into `down` rows (None: as many as columns).
        """
        down = across if down is None else down
        frame = self.window
        du, dv = frame.step_u, frame.step_v
        # Edges that are the window's are so to the bit.
        window = ViewWindow(
            frame.left + left * du,
            frame.right if right == frame.width_px else frame.left + right * du,
            frame.bottom if bottom == frame.height_px else frame.top - bottom * dv,
            frame.top - top * dv,
            (right - left) * across,
            (bottom - top) * down,
            frame.sphere,
        )
        own = None
        if self.own is not None:
            chosen = self.own[top:bottom, left:right]
            if not chosen.all():
                own = chosen.repeat(down, axis=0).repeat(across, axis=1)
        return Tile(window, self.level + math.ceil(math.log2(max(across, down))), own)

    def finer_parts(
        self, cols: tuple[int, int], rows: tuple[int, int], cuts: tuple[int, int], most_px: int
    ) -> list[Tile]:
        """Return the result of `finer` and then `split`, without a mask of the whole area.

        Around a small object far away, such a mask would have billions of pixels, nearly all of
        them in parts that are left out.
        """
        across, down = cuts
        whole = Tile(self.window, self.level).finer(*cols, *rows, across, down)
        parts = whole.split(most_px)
        if self.own is None:
            return parts
        chosen = self.own[slice(*rows), slice(*cols)]
        kept = []
        places = itertools.product(*map(itertools.pairwise, whole.edges(most_px)))
        for ((top, bottom), (left, right)), part in zip(places, parts, strict=True):
            coarse = chosen[top // down : -(-bottom // down), left // across : -(-right // across)]
            if coarse.all():
                kept.append(part)
            elif coarse.any():
                row, col = np.arange(top, bottom) // down, np.arange(left, right) // across
                kept.append(Tile(part.window, part.level, chosen[row[:, None], col]))
        return kept

    def edges(self, most_px: int) -> tuple[list[int], list[int]]:
        """Return the edges of rows and of columns of the parts that `split` makes."""
        height, width = self.window.height_px, self.window.width_px
        return _even_edges(height, most_px), _even_edges(width, most_px)

    def split(self, most_px: int) -> list[Tile]:
        """Return tiles of nearly equal size, with at most `most_px` pixels per side, that cover
        this tile.

        Parts without pixels that belong to the tile are left out.
        """
        rows, cols = self.edges(most_px)
        parts = [
            self.finer(left, right, top, bottom, 1)
            for top, bottom in itertools.pairwise(rows)
            for left, right in itertools.pairwise(cols)
        ]
        return [part for part in parts if part.own_pixels()]

    def halved(self) -> list[Tile]:
        """Return tiles with pixels of half the size that cover this tile.

        There are four, without those that own no pixels. A small tile stays one tile, because each
        render has an overhead of some milliseconds.
        """
        w, h = self.window.width_px, self.window.height_px
        double = self.finer(0, w, 0, h, 2)
        if 4 * w * h <= _WHOLE_UP_TO_PX:
            return [double]
        parts = [double.finer(left, left + w, top, top + h, 1) for top in (0, h) for left in (0, w)]
        return [part for part in parts if part.own_pixels()]


def lay_in(
    tiles: Sequence[Tile], area: Area, pitch: float, most_px: int, finest: float, most_level: int
) -> list[Tile]:
    """Return the tiles with finer tiles over an area. The coarse tiles lose their whole pixels
    there.

    `pitch` is the largest pixel pitch wanted in the area, in true length: near a pole, fewer cuts
    of longitude than of latitude reach it. `finest` is the least pitch. Tiles that are fine enough
    stay. The new tiles have at most `most_px` pixels per side and `most_level` halvings, and come
    last in the list.
    """
    kept, laid = [], []
    for tile in tiles:
        window = tile.window
        du, dv = window.step_u, window.step_v
        across, down = (
            min(
                math.ceil(step / pitch * (1 - 1e-9)),
                max(math.floor(step / finest * (1 + 1e-9)), 1),
                1 << max(most_level - tile.level, 0),
            )
            for step in (du * area.stretch, dv)
        )
        left = max(math.floor((area.left - window.left) / du + _EDGE), 0)
        right = min(math.ceil((area.right - window.left) / du - _EDGE), window.width_px)
        top = max(math.floor((window.top - area.top) / dv + _EDGE), 0)
        bottom = min(math.ceil((window.top - area.bottom) / dv - _EDGE), window.height_px)
        if max(across, down) < 2 or left >= right or top >= bottom:
            kept.append(tile)
            continue
        laid += tile.finer_parts((left, right), (top, bottom), (across, down), most_px)
        shape = (window.height_px, window.width_px)
        own = np.ones(shape, dtype=bool) if tile.own is None else tile.own.copy()
        own[top:bottom, left:right] = False
        rest = Tile(window, tile.level, own)
        if rest.own_pixels():
            kept.append(rest)
    return kept + laid


def _even_edges(count: int, most: int) -> list[int]:
    """Return the edges of the fewest pieces of at most `most`, of nearly equal size.

    A narrow rest would cost a render like any other piece.
    """
    pieces = -(-count // most)
    return [count * piece // pieces for piece in range(pieces + 1)]


# -------------------------------------------------------------------------------------------------
# Boxes of objects in a view of any kind.
# -------------------------------------------------------------------------------------------------


#: Boxes that are projected at a time; each takes some kilobytes.
_CHUNK = 1 << 14
#: Least stretch, the cosine of a latitude: a microradian off the pole.
_LEAST_STRETCH = 1e-6
_PAIRS = np.array(list(itertools.combinations(range(8), 2))).T


@dataclass(frozen=True)
class ViewBoxes:
    """Areas around n boxes that are in view, all fields (n, ...).

    Edges are in the camera's coordinates (`contract.ReceiverRecord`); longitudes may lie beyond pi
    where a box straddles the seam, see `areas`. `number` is the object's, from 1; `stretch` the
    most true length per unit of the first coordinate (cosine of the latitude, or 1); `centre_m` is
    in the camera's axes, `distance_m` its distance (orthographic: depth), `radius_m` half the
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
        return ViewBoxes(**{f.name: getattr(self, f.name)[chosen] for f in fields(self)})

    def pixels(self, window: ViewWindow) -> tuple[Real, Real]:
        """Return the width and the height of each box in pixels of a window."""
        return (self.right - self.left) / window.step_u, (self.top - self.bottom) / window.step_v

    def areas(self, window: ViewWindow) -> list[Area]:
        """Return the areas of the boxes in the window. A box across +-180 degrees of longitude has
        two.
        """
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
    """Return the areas around the boxes of all objects in view, except the numbers `left_out`.

    Objects around the receiver, or partly behind a perspective receiver, are left out, because they
    are near or not small. Object n has the name `names[n - 1]`.
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
        meets = np.zeros(left.shape, dtype=bool)
        for turn in (-2 * math.pi, 0.0, 2 * math.pi):
            meets |= (right + turn > receiver.left) & (left + turn < receiver.right)
        known &= meets
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
    """Return the corners of boxes in the axes of the camera, (n, 8, 3) [m].

    The boxes are (n, 2, 3), their poses (n, 4, 4).
    """
    which = np.array(list(itertools.product((0, 1), repeat=3)))
    corners = box[:, which, np.arange(3)]
    world = corners @ own[:, :3, :3].transpose(0, 2, 1) + own[:, None, :3, 3]
    return np.asarray((world - pose[:3, 3]) @ pose[:3, :3], dtype=np.float64)


def _on_sphere(local: Real) -> tuple[Real, Real, Real, Real, NDArray[np.bool_]]:
    """Return the limits of longitude and of latitude of boxes, and whether they are known, each
    (n,).

    An edge of a box is part of a great circle. Latitude may have an extreme within an edge,
    longitude does not. Diagonals lie within the box, so all pairs of corners are used. A box on the
    vertical axis has all longitudes, and contains the pole if it is wholly above or below the
    horizon; otherwise it counts as a box around the receiver.
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
    """Return the latitude at the extreme within each edge from a to b, or at an end, (n, edges).

    With p = a + t d, y/|p| is stationary where d_y p.p = y p.d. The squares of t cancel.
    """
    d = b - a
    squared, along, length = ((x * y).sum(axis=-1) for x, y in ((a, a), (a, d), (d, d)))
    above = a[..., 1] * along - d[..., 1] * squared
    below = d[..., 1] * along - a[..., 1] * length
    t = np.zeros_like(above)
    np.divide(above, below, out=t, where=below != 0)
    point = a + np.clip(t, 0.0, 1.0)[..., None] * d
    return np.asarray(np.arctan2(point[..., 1], np.hypot(point[..., 0], point[..., 2])))


# -------------------------------------------------------------------------------------------------
# Finer tiles laid over areas.
# -------------------------------------------------------------------------------------------------


#: Objects of fewer pixels across get tiles of their own; the measured error of larger ones shows
#: soon enough where to refine.
SMALL_PX = 8.0
#: Pixels across below which an object may slip between the rays.
_LEAST_ACROSS = 2.0
#: Pixels across where no error is asked for, and the most.
_USUAL_ACROSS, _MOST_ACROSS = 8.0, 256.0
#: Largest ratio of the pixels of a tile and those of a tile laid in it.
_STEP = 32.0
#: Pixels spent on all small objects together, if that is more than the frame has.
_PIXELS_FOR_ALL = 1 << 18


def pixels_across(options: PathOptions) -> float:
    """Return the pixels across the shorter side of an object at which the error of its edges is
    small enough.

    A side of s pixels, parallel to the grid, covers s columns, rounded up or down: the variance is
    at most 1/4. Two sides and S replicates give a relative standard error of at most sqrt(1 / (2
    S)) / s; slanted edges have less. The aim is half the error that the user asked for: pixels are
    cheap here, and the error that the replicates show is uncertain itself.
    """
    if options.refine_for == "ranges":
        return _LEAST_ACROSS
    if not options.max_standard_error:
        return _USUAL_ACROSS
    needed = math.sqrt(0.5 / options.replicates) / (options.max_standard_error / 2)
    return min(max(needed, _LEAST_ACROSS), _MOST_ACROSS)


def add_inset_tiles(
    tiles: Sequence[Tile], areas: Sequence[Area], frame: ViewWindow, options: PathOptions
) -> list[Tile]:
    """Return the tiles of a frame, with finer tiles over the areas of small objects."""
    small = [
        area
        for area in areas
        if area.shorter > 0
        and min((area.right - area.left) / frame.step_u, (area.top - area.bottom) / frame.step_v)
        < SMALL_PX
    ]
    most_px = max(_PIXELS_FOR_ALL, frame.width_px * frame.height_px) / max(len(small), 1)
    across = pixels_across(options)
    wanted = [(_affordable(area, frame.pitch, across, most_px), area) for area in small]
    return lay_in_steps(tiles, wanted, frame, options.tile_px, options.max_refinement_level)


def lay_in_steps(
    tiles: Sequence[Tile],
    wanted: Sequence[tuple[float, Area]],
    frame: ViewWindow,
    most_px: int,
    most_level: int = 40,
) -> list[Tile]:
    """Return the tiles, with tiles of the wanted pitches, or finer, over the wanted areas."""
    # Cuts take whole pixels of a tile: in steps, or a point would take many.
    steps = list(wanted)
    for pitch, area in wanted:
        while (pitch := pitch * _STEP) < frame.pitch:
            steps.append((pitch, area))
    found = list(tiles)
    # From coarse to fine: a small object in front of a less small one lies in its tile.
    for pitch, area in sorted(steps, key=lambda w: (-w[0], w[1].left, w[1].bottom, w[1].right)):
        found = lay_in(found, area, pitch, most_px, FINEST_PITCH, most_level)
    return found


def _affordable(area: Area, coarsest: float, across: float, most_px: float) -> float:
    """Return the pixel pitch that gives `across` pixels across an object. It is larger if that
    takes more than `most_px` pixels.
    """
    least = area.shorter / _LEAST_ACROSS
    pitch = min(area.shorter / across, least)
    while pitch < least:
        margin = 2 * min(_STEP * pitch, coarsest)
        width = (area.right - area.left) * area.stretch
        size = (width + margin) * (area.top - area.bottom + margin)
        if size <= most_px * pitch**2:
            break
        pitch = min(1.2 * pitch, least)
    return pitch
