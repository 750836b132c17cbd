# SPDX-License-Identifier: GPL-3.0-or-later
"""Finer tiles laid over the small objects in sight before anything is rendered.

Does not import bpy.

An object that slips between all rays of a tile leaves no trace there, not in its error either; so
refinement, which follows echoes, cannot find it. Where objects are is known without rendering.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..plan import FINEST_PITCH, PathOptions
from ..views import ViewWindow
from .tiles import Area, Tile, lay_in

#: Objects of fewer pixels across get tiles of their own; the measured error of larger ones says
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
    """Pixels across the shorter side of an object at which its edges are sure enough.

    A side of s pixels, parallel to the grid, holds s rounded up or down of its columns: a variance
    of at most 1/4. Two sides and S replicates make a relative standard error of at most
    sqrt(1 / (2 S)) / s; slanted edges are better. Half the error asked for is planned for: pixels
    are cheap here, and what the replicates say of the error has an error of its own.
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
    """Return the partition with finer tiles over the areas of objects that are small in it."""
    small = [area for area in areas if area.shorter > 0 and _least_px(area, frame) < SMALL_PX]
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
    """Return the partition with tiles of these pitches, or finer, over areas."""
    # What is cut out of a tile is whole pixels of it: in steps, or a point would take many.
    steps = list(wanted)
    for pitch, area in wanted:
        while (pitch := pitch * _STEP) < frame.pitch:
            steps.append((pitch, area))
    found = list(tiles)
    # From coarse to fine: a small object in front of a less small one lies in its tile.
    for pitch, area in sorted(steps, key=lambda w: (-w[0], w[1].left, w[1].bottom, w[1].right)):
        found = lay_in(found, area, pitch, most_px, FINEST_PITCH, most_level)
    return found


def _least_px(area: Area, frame: ViewWindow) -> float:
    """Pixels of the frame across the side that has fewer."""
    return min((area.right - area.left) / frame.step_u, (area.top - area.bottom) / frame.step_v)


def _affordable(area: Area, coarsest: float, across: float, most_px: float) -> float:
    """Pixel pitch that gives so many pixels across an object, or as many as may be spent."""
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
