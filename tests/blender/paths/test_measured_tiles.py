# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums and rows of tiles in a thread of their own: order, errors, what is left: no render."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon.errors import OutputError

pytest.importorskip("bpy")

from radarsim_addon.blender.paths.error_budget import CellGrid, ErrorBudget
from radarsim_addon.blender.paths.measured_tiles import (
    Background,
    MeasuredTiles,
    NewTile,
    QualitySums,
    TileCheckpoints,
)
from radarsim_addon.blender.paths.tiles import Tile
from radarsim_addon.blender.views import TracedReplicate, View, ViewWindow
from radarsim_addon.contract import ReceiverRecord
from radarsim_addon.signal.paths import PathRows

RECEIVER = ReceiverRecord("perspective", np.eye(4).tolist(), -1.0, 1.0, -1.0, 1.0, 0.0)
TILE = Tile(ViewWindow(-1.0, 1.0, -1.0, 1.0, 4, 4))


def rows_of(count: int) -> PathRows:
    rows = PathRows.zeros(count)
    rows["length_m"], rows["power_w"], rows["last_object"] = 20.0, 1 / count, 1
    rows["order"], rows["solid_angle_sr"], rows["last_body"] = 1, 0.25, 1
    rows["direction"] = [0.0, 0.0, -1.0]
    return rows


def measured_tiles(
    folder: Path, threaded: bool
) -> tuple[MeasuredTiles, TileCheckpoints, ErrorBudget]:
    parts, grid = TileCheckpoints(folder, "stamp"), CellGrid(1.0, 20)
    budget = ErrorBudget(grid.first_object)
    return MeasuredTiles(parts, grid, budget, RECEIVER, 2, threaded), parts, budget


def test_calls_are_made_in_order_and_few_wait() -> None:
    """A third call waits until the first one has ended."""
    background, made, go = Background(threaded=True), list[int](), threading.Event()

    def call(number: int) -> None:
        assert go.wait(10)
        made.append(number)

    background.do(call, 0)
    background.do(call, 1)
    later = threading.Thread(target=lambda: [background.do(call, n) for n in (2, 3)])
    later.start()
    later.join(0.05)
    assert later.is_alive()
    go.set()
    later.join(10)
    background.wait()
    background.end()
    assert made == [0, 1, 2, 3]


def test_after_an_error_no_call_is_made() -> None:
    """It is raised by `wait`; the calls after it would add to something incomplete."""
    background, made = Background(threaded=True), list[int]()

    def fail() -> None:
        raise OutputError("the disk is full")

    background.do(fail)
    background.do(made.append, 1)
    with pytest.raises(OutputError, match="full"):
        background.wait()
    background.end()
    assert not made


@pytest.mark.parametrize("threaded", [True, False])
def test_what_was_added_is_there_after_waiting(tmp_path: Path, threaded: bool) -> None:
    """Rows in the order of the tiles, their power, and the error budget; nothing on disk yet."""
    tiles, _, budget = measured_tiles(tmp_path, threaded)
    for number, count in ((0, 5), (1, 3)):
        new = NewTile(number, TILE, f"key {number}")
        for _ in range(2):
            tiles.add_rows(new, [rows_of(count)])
        tiles.keep(new, 7, 0.5)
    tiles.wait()
    tiles.end()
    assert [rows.size for rows in tiles.chunks()] == [10, 6]
    assert [set(rows["tile"].tolist()) for rows in tiles.chunks()] == [{0}, {1}]
    assert list(budget.powers) == [0, 1]
    assert tiles.quality()._row_w == pytest.approx(4.0)


@pytest.mark.parametrize("threaded", [True, False])
def test_a_tile_that_was_stopped_leaves_nothing(tmp_path: Path, threaded: bool) -> None:
    """The one before it is kept, as a resumed run finds it."""
    tiles, parts, _ = measured_tiles(tmp_path, threaded)
    whole, stopped = (NewTile(number, TILE, f"key {number}") for number in (0, 1))
    for _ in range(2):
        tiles.add_rows(whole, [rows_of(5)])
    tiles.keep(whole, 7, 0.5)
    tiles.add_rows(stopped, [rows_of(4)])
    tiles.drop(stopped, KeyboardInterrupt())
    parts.write()
    later = TileCheckpoints(tmp_path, "stamp")
    assert later.find("key 1") is None
    record = later.find("key 0")
    assert record is not None
    again, _, budget = measured_tiles(tmp_path, threaded)
    again.take_again(0, dataclasses.replace(TILE), "key 0", record)
    again.wait()
    again.end()
    assert list(budget.powers) == [0]
    assert again.quality()._row_w == pytest.approx(2.0)


@pytest.mark.parametrize("threaded", [True, False])
def test_rows_that_cannot_be_written_are_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, threaded: bool
) -> None:
    """With the disk full the frame ends with a named error, and no tile that lacks rows is left."""
    monkeypatch.setattr("radarsim_addon.blender.paths.measured_tiles._MOST_HELD", 0)
    tiles, parts, budget = measured_tiles(tmp_path / "missing" / "frame", threaded)
    new = NewTile(0, TILE, "key")
    with pytest.raises(OutputError):
        tiles.add_rows(new, [rows_of(5)])
        tiles.keep(new, 7, 0.5)
        tiles.wait()
    tiles.drop(new, KeyboardInterrupt())
    assert not budget.powers
    assert parts.find("key") is None


class _Watched(QualitySums):
    """Sums that note which of them are set."""

    def __setattr__(self, name: str, value: Any) -> None:
        super().__setattr__(name, value)
        vars(self).setdefault("noted", set()).add(name)

    def changed_by(self, call: Callable[[], None]) -> set[str]:
        """Which sums a call changes."""
        self.noted: set[str] = set()
        members = {k: set(v) for k, v in vars(self).items() if isinstance(v, set)}
        call()
        grown = {k for k, v in members.items() if k != "noted" and vars(self)[k] != v}
        return (self.noted - {"noted"}) | grown


def test_views_and_rows_change_different_sums() -> None:
    """They are added in two threads, and a sum that both change could lose a part."""
    sums = _Watched()
    nothing = np.zeros((1, 2))
    seen = View(nothing, nothing, nothing, object_index=np.array([[1, 2]], dtype=np.int32))
    traced = TracedReplicate(open_view=seen, total=2.0, strongest=1.0, coloured=True)
    of_views = sums.changed_by(lambda: sums.add_view(traced, 0.5))
    of_rows = sums.changed_by(lambda: sums.add_rows(rows_of(3), RECEIVER))
    assert {"total_w", "coloured", "seen"} <= of_views
    assert {"_row_w", "echoing", "bodies"} <= of_rows
    assert not of_views & of_rows
