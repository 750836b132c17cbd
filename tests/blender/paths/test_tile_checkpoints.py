# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured tiles of an unfinished frame: which of them are in memory, which on disk. No render."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("bpy")

from radarsim_addon import contract
from radarsim_addon.blender.paths import measured_tiles
from radarsim_addon.blender.paths.measured_tiles import TileCheckpoints, TileRecord
from radarsim_addon.signal.paths import PATH_DTYPE, PathRows

COUNTS = (3, 0, 4)


def rows_of(seed: int) -> list[np.ndarray]:
    """Three replicates of a tile."""
    rng = np.random.default_rng(seed)
    found = []
    for count in COUNTS:
        rows = PathRows.zeros(count)
        rows["power_w"], rows["length_m"] = rng.random((2, count))
        found.append(rows)
    return found


def add(tiles: TileCheckpoints, seed: int, seconds: float = 0.0) -> str:
    """Measure a tile; its key."""
    key = tiles.key(seed)
    with tiles.writer(key) as part:
        for rows in rows_of(seed):
            part.add(rows)
    tiles.keep(key, TileRecord(list(COUNTS), {}, seconds=seconds))
    return key


def files(folder: Path) -> int:
    return len(list(folder.glob(f"{contract.TILES_DIR}/*")))


def powers(tiles: TileCheckpoints, key: str) -> list[float]:
    parts = [rows for rows in tiles.chunks(key, 7) if rows.size]
    assert {number for rows in parts for number in rows["tile"].tolist()} == {7}
    return PathRows.joined(parts)["power_w"].tolist()


@pytest.mark.parametrize("most", [1 << 20, 0])
def test_stopped_frames_leave_their_tiles(
    most: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In memory until the frame is stopped, or on disk at once where there is no memory for them;
    the next session finds the same rows either way."""
    monkeypatch.setattr(measured_tiles, "_MOST_HELD", most)
    tiles = TileCheckpoints(tmp_path, "stamp")
    keys = [add(tiles, seed) for seed in (1, 2)]
    assert files(tmp_path) == (0 if most else 4)
    expected = [PathRows.joined(rows_of(seed))["power_w"].tolist() for seed in (1, 2)]
    tiles.write()
    assert files(tmp_path) == 4
    later = TileCheckpoints(tmp_path, "stamp")
    for key, power_w in zip(keys, expected, strict=True):
        record = later.find(key)
        assert record is not None
        found = list(later.replicates(key, record))
        assert [rows.size for rows in found] == list(COUNTS)
        assert powers(tiles, key) == powers(later, key) == power_w
    other = TileCheckpoints(tmp_path, "other")
    assert other.find(other.key(1)) is None
    later.rows_file(keys[0]).write_bytes(b"damaged")
    assert later.find(keys[0]) is None
    later.remove()
    assert files(tmp_path) == 0


def test_a_whole_frame_leaves_nothing(tmp_path: Path) -> None:
    """Its rows come from memory."""
    tiles = TileCheckpoints(tmp_path, "stamp")
    key = add(tiles, 1)
    assert powers(tiles, key) == PathRows.joined(rows_of(1))["power_w"].tolist()
    assert not files(tmp_path)
    tiles.remove()
    tiles.write()
    assert not files(tmp_path)


def test_no_tile_is_in_memory_alone_for_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kill costs seconds: what took longer is written at once, all others with the next tile."""
    tiles = TileCheckpoints(tmp_path, "stamp")
    add(tiles, 1, seconds=4.0)
    assert files(tmp_path) == 0
    add(tiles, 2, seconds=60.0)
    assert files(tmp_path) == 2
    now_s = measured_tiles.time.monotonic()
    monkeypatch.setattr(measured_tiles.time, "monotonic", lambda: now_s + 21.0)
    add(tiles, 3)
    assert files(tmp_path) == 4


def test_the_oldest_tiles_go_to_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is in memory stays below the limit."""
    size = sum(COUNTS) * PATH_DTYPE.itemsize
    monkeypatch.setattr(measured_tiles, "_MOST_HELD", 2 * size)
    tiles = TileCheckpoints(tmp_path, "stamp")
    keys = [add(tiles, seed) for seed in (1, 2, 3)]
    assert files(tmp_path) == 2
    assert tiles.find(keys[0]) is not None
    assert tiles.find(keys[1]) is None


def test_a_tile_that_is_measured_takes_the_room_of_older_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The limit is that of both: the older one goes to disk before the new one is whole."""
    size = sum(COUNTS) * PATH_DTYPE.itemsize
    monkeypatch.setattr(measured_tiles, "_MOST_HELD", size + 3 * PATH_DTYPE.itemsize)
    tiles = TileCheckpoints(tmp_path, "stamp")
    key = add(tiles, 1)
    with tiles.writer("new") as part:
        part.add(PathRows.zeros(3))
        assert files(tmp_path) == 0
        part.add(PathRows.zeros(1))
        assert tiles.find(key) is not None
        assert len(part.rows) == 2
