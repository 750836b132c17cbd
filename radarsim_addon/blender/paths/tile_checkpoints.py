# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured tiles of an unfinished frame, on disk.

They bound the memory that a frame takes, and a run that was stopped resumes from them. A tile is
its rows, as they are in memory, and a record next to them, written last: a tile with a record is
whole. Does not import bpy.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ... import contract
from ...atomic_files import cannot_write, refuse_links, replaced
from ...errors import RadarSimError
from ...sidecar import file_sha256, read_record, write_record
from ...signal.paths import PATH_DTYPE, PathRows
from .quality import QualitySums

#: Rows read at a time.
_CHUNK = 1 << 17


@dataclass(frozen=True)
class TileRecord:
    """What is known of a measured tile besides its rows.

    rows counts them replicate by replicate; quality and further are the sums of `QualitySums` (of
    the rows, and of what lies beyond the last order); renders and seconds are what it cost.
    """

    rows: list[int]
    sha256: str
    quality: dict[str, float]
    further: dict[str, float]
    seen: list[int] = field(default_factory=list)
    echoing: list[int] = field(default_factory=list)
    bodies: list[int] = field(default_factory=list)
    renders: int = 0
    seconds: float = 0.0
    schema: str = "radarsim/tile"
    schema_version: int = contract.SCHEMA_VERSION

    def sums(self) -> tuple[QualitySums, QualitySums]:
        """Quality of the rows, and what lies beyond the last order."""
        quality = QualitySums.from_numbers(
            self.quality, seen=self.seen, echoing=self.echoing, bodies=self.bodies
        )
        return quality, QualitySums.from_numbers(self.further)


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
        """To write a tile's rows with, replicate by replicate; an error leaves nothing."""
        refuse_links(self._folder, within=self._folder.parent)
        try:
            self._folder.mkdir(exist_ok=True)
        except OSError as error:
            raise cannot_write(self._folder, error) from error
        with replaced(self.rows_file(key)) as temporary, open(temporary, "wb") as stream:
            yield TileWriter(stream)

    def keep(self, key: str, record: TileRecord) -> None:
        """Say that a tile is whole."""
        write_record(self._folder / f"{key}.json", record)

    def replicates(self, key: str, record: TileRecord) -> Iterator[PathRows]:
        """Rows of a tile, one replicate after the other."""
        with open(self.rows_file(key), "rb") as stream:
            for count in record.rows:
                yield np.fromfile(stream, dtype=self._dtype, count=count)

    def chunks(self, key: str, tile: int) -> Iterator[PathRows]:
        """Rows of a tile in pieces, with the number that it has in this run."""
        with open(self.rows_file(key), "rb") as stream:
            while (rows := np.fromfile(stream, dtype=self._dtype, count=_CHUNK)).size:
                rows["tile"] = tile
                yield rows

    def remove(self) -> None:
        """Remove all tiles: the frame is whole, or not wanted any more."""
        shutil.rmtree(self._folder, ignore_errors=True)


class TileWriter:
    """Writes rows to a stream; `sha256` is that of all of them."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream, self._digest = stream, hashlib.sha256()

    def add(self, rows: PathRows) -> None:
        """Append the rows of a replicate."""
        data = np.ascontiguousarray(rows).view(np.uint8)
        self._digest.update(data)
        self._stream.write(data.data)

    @property
    def sha256(self) -> str:
        """Of what was written so far."""
        return self._digest.hexdigest()
