# SPDX-License-Identifier: GPL-3.0-or-later
"""Tiles as a partition of the view, whatever is refined in it: no render."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("bpy")

from radarsim_addon.blender.paths.tiles import Area, Tile, add_inset_tiles, lay_in, pixels_across
from radarsim_addon.blender.plan import PathOptions
from radarsim_addon.blender.views import ViewWindow, replicate_seed

FRAME = ViewWindow(-0.31, 0.42, -0.17, 0.29, 53, 37)
PITCH_U = (FRAME.right - FRAME.left) / FRAME.width_px
PITCH_V = (FRAME.top - FRAME.bottom) / FRAME.height_px


def own(tile: Tile) -> np.ndarray:
    """Its own pixels as a mask."""
    shape = (tile.window.height_px, tile.window.width_px)
    return np.ones(shape, dtype=bool) if tile.own is None else tile.own


def times_covered(tiles: list[Tile], fine: int) -> np.ndarray:
    """How many tiles own each of `fine` x `fine` points of every pixel of the frame."""
    # Off the edges of pixels, whatever whole number they are cut into.
    u = FRAME.left + (np.arange(FRAME.width_px * fine) + 0.4142136) / fine * PITCH_U
    v = FRAME.top - (np.arange(FRAME.height_px * fine) + 0.4142136) / fine * PITCH_V
    count = np.zeros((v.size, u.size), dtype=int)
    for tile in tiles:
        w = tile.window
        col = np.floor((u - w.left) / (w.right - w.left) * w.width_px).astype(int)
        row = np.floor((w.top - v) / (w.top - w.bottom) * w.height_px).astype(int)
        rows = np.flatnonzero((row >= 0) & (row < w.height_px))
        cols = np.flatnonzero((col >= 0) & (col < w.width_px))
        count[np.ix_(rows, cols)] += own(tile)[np.ix_(row[rows], col[cols])]
    return count


def covered_area(tiles: list[Tile]) -> float:
    """Sum over the tiles of the area of their own pixels."""
    total = 0.0
    for tile in tiles:
        w = tile.window
        pixel = (w.right - w.left) / w.width_px * (w.top - w.bottom) / w.height_px
        total += pixel * np.count_nonzero(own(tile))
    return total


WHOLE = (FRAME.right - FRAME.left) * (FRAME.top - FRAME.bottom)


@pytest.mark.parametrize("most", [4, 10, 37, 64, 1000])
def test_tiles_cover_the_frame(most: int) -> None:
    """Every pixel of the frame is in exactly one tile, at its place; edges are shared exactly."""
    tiles = Tile(FRAME).split(most)
    for tile in tiles:
        w = tile.window
        assert max(w.width_px, w.height_px) <= most
        assert w.right - w.left == pytest.approx(w.width_px * PITCH_U, rel=1e-12)
        assert w.top - w.bottom == pytest.approx(w.height_px * PITCH_V, rel=1e-12)
    assert np.all(times_covered(tiles, 1) == 1)
    edges = {e for t in tiles for e in (t.window.left, t.window.right)}
    assert len(edges) == math.ceil(FRAME.width_px / most) + 1


def test_halves_cover_a_tile_down_to_the_finest() -> None:
    """Ten halvings: areas add up, neighbours share edges bit by bit, the pitch is halved."""
    tile = Tile(ViewWindow(0.1, 0.3, -0.2, 0.05, 70, 64))
    for _ in range(10):
        parts = [p.window for p in tile.halved()]
        whole = tile.window
        area = sum((p.right - p.left) * (p.top - p.bottom) for p in parts)
        expected = (whole.right - whole.left) * (whole.top - whole.bottom)
        assert area == pytest.approx(expected, rel=1e-9)
        assert (parts[0].left, parts[0].top) == (whole.left, whole.top)
        assert (parts[3].right, parts[3].bottom) == (whole.right, whole.bottom)
        assert parts[0].right == parts[1].left
        assert parts[0].bottom == parts[2].top
        for part in tile.halved():
            assert (part.window.width_px, part.window.height_px) == (70, 64)
            assert part.window.pitch == pytest.approx(whole.pitch / 2, rel=1e-6)
            assert part.level == tile.level + 1
        tile = tile.halved()[3]


def test_a_small_tile_is_halved_in_one_piece() -> None:
    (finer,) = Tile(FRAME).halved()
    assert (finer.window.width_px, finer.window.height_px) == (106, 74)
    assert finer.window.pitch == FRAME.pitch / 2
    assert (finer.window.left, finer.window.bottom) == (FRAME.left, FRAME.bottom)


def test_no_gap_and_no_overlap_whatever_is_laid_in() -> None:
    """Areas at random, in one another, across tiles and the frame's edge; some tiles halved."""
    rng = np.random.default_rng(4)
    for trial in range(12):
        tiles = Tile(FRAME).split(int(rng.integers(6, 40)))
        for _ in range(5):
            u, v = rng.uniform(FRAME.left, FRAME.right), rng.uniform(FRAME.bottom, FRAME.top)
            w, h = rng.uniform(0.001, 0.2, 2)
            pitch = FRAME.pitch / rng.choice([2, 3, 4, 6])
            tiles = lay_in(tiles, Area(u, u + w, v, v + h), pitch, 24, 5e-7, 12)
            chosen = tiles.pop(int(rng.integers(len(tiles))))
            tiles += chosen.halved()
        assert all(tile.own_pixels() for tile in tiles)
        assert np.all(times_covered(tiles, 7) == 1), trial
        assert covered_area(tiles) == pytest.approx(WHOLE, rel=1e-12)


def test_an_area_lies_within_its_tiles() -> None:
    """All of it is covered by pixels as fine as asked for, and little else is."""
    area = Area(0.1003, 0.1009, 0.0301, 0.0312)
    tiles = lay_in([Tile(FRAME)], area, area.shorter / 20, 4096, 5e-7, 12)
    assert len(tiles) == 2
    window = tiles[1].window
    assert window.left <= area.left
    assert window.right >= area.right
    assert window.bottom <= area.bottom
    assert window.top >= area.top
    assert window.right - window.left < 2.001 * PITCH_U
    assert window.pitch <= area.shorter / 20
    assert tiles[0].own_pixels() == FRAME.width_px * FRAME.height_px - round(
        (window.right - window.left) * (window.top - window.bottom) / PITCH_U / PITCH_V
    )
    # Fine as it is: it stays.
    assert lay_in(tiles[1:], area, area.shorter / 10, 256, 5e-7, 12) == tiles[1:]
    # Limits of the pitch and of the halvings.
    for finest, level in ((FRAME.pitch / 5, 12), (5e-7, 2)):
        limited = lay_in([Tile(FRAME)], area, area.shorter / 20, 4096, finest, level)
        assert limited[1].window.pitch >= FRAME.pitch / 5.0001


def test_small_objects_get_the_pixels_their_error_needs() -> None:
    """A side of s pixels is uncertain by at most half a pixel in one shift."""
    options = PathOptions(replicates=2, max_standard_error=0.02)
    across = pixels_across(options)
    assert math.sqrt(2 * 0.25 / 2) / across == pytest.approx(0.01)
    assert (
        pixels_across(PathOptions(replicates=2, max_standard_error=0.02, refine_for="ranges")) == 2
    )
    small, large = Area(0.1, 0.11, 0.0, 0.02), Area(-0.2, 0.3, -0.1, 0.2)
    tiles = add_inset_tiles([Tile(FRAME)], [large, small], FRAME, options)
    assert len(tiles) == 3
    assert all(tile.own_pixels() for tile in tiles)
    # The last is the finest: all of the object is in it.
    window = tiles[-1].window
    assert 0.01 / window.pitch >= across
    assert window.left <= 0.1 < 0.11 <= window.right
    assert window.bottom <= 0.0 < 0.02 <= window.top


def test_what_is_spent_on_small_objects_is_bounded() -> None:
    """A hundred share it; a point takes no more than an object. None slips between the rays."""
    options = PathOptions(replicates=2, max_standard_error=1e-3, tile_px=4096)
    row = [Area(x, x + 0.002, y, y + 0.002) for x in (0.1, 0.2) for y in np.arange(50) * 0.005]
    for areas in (row, [Area(0.1, 0.10002, 0.05, 0.05002)]):
        tiles = add_inset_tiles([Tile(FRAME)], areas, FRAME, options)
        assert np.all(times_covered(tiles, 3) == 1)
        assert sum(tile.own_pixels() for tile in tiles[1:]) < 1.5 * (1 << 18)
        for area in areas:
            u, v = (area.left + area.right) / 2, (area.bottom + area.top) / 2
            pitches = [t.window.pitch for t in tiles if owns(t, u, v)]
            assert len(pitches) == 1
            assert pitches[0] <= area.shorter / 2


def owns(tile: Tile, u: float, v: float) -> bool:
    """Whether a tile owns the pixel at a point."""
    w = tile.window
    if not (w.left <= u < w.right and w.bottom < v <= w.top):
        return False
    row = int((w.top - v) / (w.top - w.bottom) * w.height_px)
    return bool(own(tile)[row, int((u - w.left) / (w.right - w.left) * w.width_px)])


def test_seeds_tell_views_apart() -> None:
    """By place, pixels and shift, whatever the order; within what Cycles takes."""
    tiles = [t.window for tile in Tile(FRAME).split(16) for t in (tile, *tile.halved())]
    seeds = [replicate_seed(7, tile, shift) for tile in tiles for shift in range(8)]
    assert len(set(seeds)) == len(seeds)
    assert all(0 <= seed < 2**31 for seed in seeds)
    assert replicate_seed(7, tiles[0], 3) == seeds[3]
    assert replicate_seed(8, tiles[0], 3) != seeds[3]
