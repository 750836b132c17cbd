# SPDX-License-Identifier: GPL-3.0-or-later
"""Tiles of a frame that were measured: their sums, the powers of their cells, and their rows.

Without Blender's window, a separate thread computes sums and powers and writes rows while Cycles
renders.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from ...contract import ReceiverRecord
from ...signal.paths import PathRows
from .background import Background
from .error_budget import CellGrid, ErrorBudget, ReplicatePowers
from .quality import QualitySums
from .tile_checkpoints import TileCheckpoints, TileRecord, TileWriter
from .tiles import Tile


@dataclass(frozen=True)
class MeasuredTile:
    """A measured tile, the key of its stored rows, the number of rows, and their sums."""

    tile: Tile
    key: str
    rows: int
    quality: QualitySums


@dataclass
class NewTile:
    """A tile whose replicates are being measured: sums over its views, and rows by replicate."""

    number: int
    tile: Tile
    key: str
    quality: QualitySums = field(default_factory=QualitySums)
    powers: list[ReplicatePowers] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)
    writer: TileWriter | None = None
    open: contextlib.ExitStack = field(default_factory=contextlib.ExitStack)


class MeasuredTiles:
    """Measured tiles by number.

    `parts` stores the rows; each tile has `count` replicates. `budget` gets the powers of the cells
    of `grid`. If `threaded`, a separate thread does this. After :meth:`wait`, all that was added is
    in `tiles` and in `budget`.
    """

    def __init__(
        self,
        parts: TileCheckpoints,
        grid: CellGrid,
        budget: ErrorBudget,
        receiver: ReceiverRecord,
        count: int,
        threaded: bool,
    ) -> None:
        self._parts, self._grid, self._budget = parts, grid, budget
        self._receiver, self._count = receiver, count
        self._background = Background(threaded)
        self.tiles: dict[int, MeasuredTile] = {}

    def add_rows(self, new: NewTile, views: Sequence[PathRows]) -> None:
        """Add the rows of replicates, which nobody changes any more."""
        self._background.do(self._add_rows, new, views)

    def _add_rows(self, new: NewTile, views: Sequence[PathRows]) -> None:
        new.powers += self._grid.powers_of_views(views, self._count, self._receiver)
        for rows in views:
            new.quality.add_rows(rows, self._receiver)
            new.sizes.append(rows.size)
            if new.writer is None:
                new.writer = new.open.enter_context(self._parts.writer(new.key))
            new.writer.add(rows)

    def keep(self, new: NewTile, renders: int, seconds: float) -> None:
        """Say that all replicates are there; they took so many renders, and so long."""
        self._background.do(self._keep, new, renders, seconds)

    def _keep(self, new: NewTile, renders: int, seconds: float) -> None:
        new.open.close()
        sums = new.quality
        record = TileRecord(
            new.sizes,
            sums.numbers(),
            sorted(sums.seen),
            sorted(sums.echoing),
            sorted(sums.bodies),
            renders,
            seconds,
        )
        self._parts.keep(new.key, record)
        self._take(new.number, new.tile, new.key, record, new.powers)

    def drop(self, new: NewTile, error: BaseException) -> None:
        """Leave nothing of a tile that could not be measured."""
        self._background.end()
        with contextlib.suppress(BaseException):
            new.open.__exit__(type(error), error, error.__traceback__)

    def take_again(self, number: int, tile: Tile, key: str, record: TileRecord) -> None:
        """Take a tile that an earlier session measured."""
        self._background.do(self._take_again, number, tile, key, record)

    def _take_again(self, number: int, tile: Tile, key: str, record: TileRecord) -> None:
        replicates = self._parts.replicates(key, record)
        count, receiver = self._count, self._receiver
        powers = [self._grid.replicate_powers(rows, count, receiver) for rows in replicates]
        self._take(number, tile, key, record, powers)

    def _take(
        self,
        number: int,
        tile: Tile,
        key: str,
        record: TileRecord,
        powers: Sequence[ReplicatePowers],
    ) -> None:
        self.tiles[number] = MeasuredTile(tile, key, sum(record.rows), record.sums())
        self._budget.powers[number] = self._grid.powers(powers)

    def remove(self, number: int) -> None:
        """Leave out a tile: finer ones stand for it."""
        del self.tiles[number], self._budget.powers[number]

    def wait(self) -> None:
        """Return when all is computed and written; raises what failed."""
        self._background.wait()

    def end(self) -> None:
        """End the thread; what failed is not raised."""
        self._background.end()

    def quality(self) -> QualitySums:
        """Sums over all tiles."""
        return QualitySums.joined(measured.quality for measured in self.tiles.values())

    def chunks(self) -> Iterator[PathRows]:
        """All rows, a part at a time."""
        for number, measured in self.tiles.items():
            yield from self._parts.chunks(measured.key, number)
