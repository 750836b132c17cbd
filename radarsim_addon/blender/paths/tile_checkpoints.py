# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured tiles of an unfinished frame, the last ones in memory, the others on disk.

Files bound the memory that a frame takes, and a run that was stopped resumes from them. A tile is
its rows, as they are in memory, and a record next to them, written last: a tile with a record is
whole. Tiles are written when they take too much memory, after some seconds, or when the run is
stopped: a frame that takes no longer than that leaves no files of them. Does not import bpy.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ... import contract
from ...atomic_files import cannot_write, refuse_links, replaced
from ...errors import RadarSimError
from ...sidecar import file_sha256, read_record, write_record
from ...signal.paths import PATH_DTYPE, PathRows, iter_rows
from .quality import QualitySums

#: Rows read at a time.
_CHUNK = 1 << 17
#: Most memory that tiles take [bytes], and the longest time that they are in memory alone [s]: what
#: a process that is killed loses. Writing and reading them again takes longer than their sums.
_MOST_HELD, _LONGEST_HELD_S = 192 << 20, 20.0


@dataclass(frozen=True)
class TileRecord:
    """What is known of a measured tile besides its rows.

    rows counts them replicate by replicate; quality are the sums of `QualitySums`; renders and
    seconds are what it cost; sha256 is that of the file of its rows.
    """

    rows: list[int]
    quality: dict[str, float]
    seen: list[int] = field(default_factory=list)
    echoing: list[int] = field(default_factory=list)
    bodies: list[int] = field(default_factory=list)
    renders: int = 0
    seconds: float = 0.0
    sha256: str = ""
    schema: str = "radarsim/tile"
    schema_version: int = contract.SCHEMA_VERSION

    def sums(self) -> QualitySums:
        """Quality of the rows."""
        return QualitySums.from_numbers(
            self.quality, seen=self.seen, echoing=self.echoing, bodies=self.bodies
        )


@dataclass
class _Held:
    """A tile in memory: its rows by replicate, when they were there, its record once it is whole.

    Of a tile too large for that, whose rows are on disk: their digest.
    """

    rows: list[PathRows]
    since_s: float
    sha256: str = ""
    record: TileRecord | None = None


class TileCheckpoints:
    """Tiles of one frame, in a folder in the frame's.

    `stamp` is all that rows depend on besides the scene (see the run's fingerprint) and the tile,
    `dtype` their type.
    """

    def __init__(
        self, frame_folder: Path, stamp: str, dtype: np.dtype[np.void] = PATH_DTYPE
    ) -> None:
        self._folder = frame_folder / contract.TILES_DIR
        fields = [one.name for one in dataclasses.fields(TileRecord)]
        self._dtype = dtype
        self._held: dict[str, _Held] = {}
        self._stamp = f"{stamp} {dtype.descr} {fields}"

    def key(self, *numbers: Any) -> str:
        """Name of a tile by what determines its rows."""
        text = f"{self._stamp} {numbers!r}".encode()
        return hashlib.blake2b(text, digest_size=12).hexdigest()

    def find(self, key: str) -> TileRecord | None:
        """Record of a tile that is there and whole, byte for byte."""
        try:
            record = read_record(self._folder / f"{key}.json", TileRecord)
            whole = file_sha256(self.rows_file(key)) == record.sha256
        except (RadarSimError, OSError):
            return None
        return record if whole else None

    def rows_file(self, key: str) -> Path:
        """Where a tile's rows are."""
        return self._folder / f"{key}.rows"

    @contextlib.contextmanager
    def writer(self, key: str) -> Iterator[TileWriter]:
        """To add a tile's rows with, replicate by replicate; an error leaves nothing."""
        with contextlib.ExitStack() as stack:

            def open_file() -> BinaryIO:
                refuse_links(self._folder, within=self._folder.parent)
                try:
                    self._folder.mkdir(exist_ok=True)
                except OSError as error:
                    raise cannot_write(self._folder, error) from error
                # no sync: who finds a tile compares its digest
                temporary = stack.enter_context(replaced(self.rows_file(key), sync=False))
                return stack.enter_context(open(temporary, "wb"))

            writer = TileWriter(open_file, lambda size: self._write_oldest(_MOST_HELD - size))
            yield writer
        self._held[key] = _Held(writer.rows, time.monotonic(), writer.sha256)

    def keep(self, key: str, record: TileRecord) -> None:
        """Say that a tile is whole; write those that are not to be in memory any longer."""
        self._held[key].record = record
        now_s = time.monotonic()
        for name, held in list(self._held.items()):
            since_s = min(held.since_s, now_s - record.seconds) if name == key else held.since_s
            if held.sha256 or now_s - since_s > _LONGEST_HELD_S:
                self._write(name)
        self._write_oldest(_MOST_HELD)

    def _write_oldest(self, most: int) -> None:
        """Write tiles until those that are whole take at most so many bytes of memory."""
        sizes = {key: sum(rows.nbytes for rows in held.rows) for key, held in self._held.items()}
        size = sum(sizes.values())
        for key, own in sizes.items():
            if size <= most:
                return
            size -= own
            self._write(key)

    def write(self) -> None:
        """Write all whole tiles that are in memory; what cannot be written is measured again."""
        with contextlib.suppress(OSError, RadarSimError):
            for key in [key for key, held in self._held.items() if held.record is not None]:
                self._write(key)

    def _write(self, key: str) -> None:
        held = self._held.pop(key)
        assert held.record is not None
        digest = held.sha256
        if not digest:
            with self.writer(key) as part:
                part.rows = held.rows
                part.spill()
            digest = self._held.pop(key).sha256
        record = dataclasses.replace(held.record, sha256=digest)
        write_record(self._folder / f"{key}.json", record, sync=False)

    def replicates(self, key: str, record: TileRecord) -> Iterator[PathRows]:
        """Rows of a tile, one replicate after the other."""
        with open(self.rows_file(key), "rb") as stream:
            for count in record.rows:
                yield np.fromfile(stream, dtype=self._dtype, count=count)

    def chunks(self, key: str, tile: int) -> Iterator[PathRows]:
        """Rows of a tile in pieces, with the number that it has in this run.

        They may be changed: afterwards nothing is written of tiles in memory.
        """
        if key in self._held:
            held = self._held[key].rows
            if len(held) > 1 and sum(rows.size for rows in held) <= _CHUNK:
                held = [np.concatenate(held)]
            for rows in held:
                rows["tile"] = tile
                yield from iter_rows(rows, _CHUNK)
            return
        with open(self.rows_file(key), "rb") as stream:
            while (rows := np.fromfile(stream, dtype=self._dtype, count=_CHUNK)).size:
                rows["tile"] = tile
                yield rows

    def remove(self) -> None:
        """Remove all tiles: the frame is whole, or not wanted any more."""
        self._held.clear()
        shutil.rmtree(self._folder, ignore_errors=True)


class TileWriter:
    """Collects the rows of a tile, in a file where they are too many for memory.

    `open_file` opens it, `make_room` is told how many bytes the rows take; `rows` are those in
    memory, by replicate.
    """

    def __init__(self, open_file: Callable[[], BinaryIO], make_room: Callable[[int], None]) -> None:
        self._open_file, self._make_room = open_file, make_room
        self._stream: BinaryIO | None = None
        self._digest = hashlib.sha256()
        self.rows: list[PathRows] = []

    def add(self, rows: PathRows) -> None:
        """Append the rows of a replicate."""
        self.rows.append(rows)
        size = sum(part.nbytes for part in self.rows)
        if self._stream is not None or size > _MOST_HELD:
            self.spill()
        else:
            self._make_room(size)

    def spill(self) -> None:
        """Write the rows in memory to the file."""
        if self._stream is None:
            self._stream = self._open_file()
        for rows in self.rows:
            data = np.ascontiguousarray(rows).view(np.uint8)
            self._digest.update(data)
            self._stream.write(data.data)
        self.rows = []

    @property
    def sha256(self) -> str:
        """Of what is in the file; empty without one."""
        return "" if self._stream is None else self._digest.hexdigest()
