# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of propagation paths: one row per path, stored in columns.

In memory, `PathRows` has a column for each quantity. On disk, a table is a ``.npz`` archive without
compression, with one ``.npy`` member after another for the columns. ``numpy.load`` opens it, and
`open_table` maps its columns into memory. Nothing is pickled. Tables are written in parts, of which
only one is in memory, so a run may be larger than the memory of the machine. Each column has its
own digest.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
import os
import struct
import zipfile
import zlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import IO, Any, BinaryIO, Protocol, overload

import numpy as np
from numpy.typing import NDArray

from ...arrays import Indices, Mask, read_header
from ...atomic_files import replaced
from ...contract import (
    ColumnGroupRecord,
    ColumnRecord,
    PathsRecord,
    ReceiverRecord,
    TransmitterRecord,
)
from ...errors import FrameFileError


def _group(version: int, *columns: tuple[object, ...]) -> ColumnGroupRecord:
    return ColumnGroupRecord(version, [ColumnRecord(*column) for column in columns])  # type: ignore[arg-type]


#: Columns of the table by group: name, dtype, unit, meaning, shape. SI, world space; float64
#: wherever phase depends on it. A reader ignores groups that it does not know, so a later version
#: may add one (`scattering`); columns of another meaning make another version of their group.
COLUMN_GROUPS = {
    "power": _group(
        1,
        ("power_w", "<f8", "W", "power of this path at an isotropic receiver, at the carrier"),
        ("solid_angle_sr", "<f8", "sr", "part of the field of view; orthographic: area over 1 m^2"),
    ),
    "geometry": _group(
        1,
        ("length_m", "<f8", "m", "optical length: receiver, scatterers, transmitter"),
        ("length_sigma_m", "<f4", "m", "standard deviation of length_m, from float32"),
        ("order", "<u2", "1", "number of reflections"),
        ("transparent_depth", "<u2", "1", "transparent surfaces passed on the receiver's side"),
        ("first_scatterer_m", "<f8", "m", "scatterer nearest to the receiver; NaN: unknown", [3]),
        ("last_scatterer_m", "<f8", "m", "scatterer nearest to the transmitter; NaN: unknown", [3]),
        ("direction", "<f8", "1", "unit vector from the receiver to the first scatterer", [3]),
    ),
    "motion": _group(
        1,
        ("range_rate_mps", "<f8", "m/s", "rate of length_m / 2, receding positive; 0: unknown"),
        ("last_body", "<i4", "1", "body at the last scatterer, from 1 in motion.json; 0: unknown"),
        ("first_body", "<i4", "1", "body at the first scatterer, likewise"),
        ("last_surface_point", "<i4", "1", "point there on a deforming surface, from 1; 0: none"),
        ("first_surface_point", "<i4", "1", "point at the first scatterer, likewise"),
    ),
    "labels": _group(
        1,
        ("last_object", "<i4", "1", "object at the last scatterer, from 1 in objects; 0: unknown"),
        ("first_object", "<i4", "1", "object at the first scatterer, likewise"),
        ("tile", "<i4", "1", "tile of the field of view"),
        ("replicate", "<i4", "1", "number of the sub-pixel offset of the tile"),
        ("flags", "<u2", "1", "sum of the values in flags"),
    ),
}  # fmt: skip

#: Columns of tables with paths over images of the antennas; others have none of them.
IMAGE_GROUP = "scattering"
_IMAGE_COLUMNS = (
    ("transmitter_image", "<i2", "1", "image of the transmitter the path goes to, from 1; 0: none"),
    ("receiver_image", "<i2", "1", "image of the receiver it comes from, likewise"),
    ("mirrors", "<u2", "1", "reflections that are those of the images; order includes them"),
    ("mirror_phase_rad", "<f8", "rad", "phase of their reflection coefficients, as of echoes"),
    ("point", "<i4", "1", "paths of one tile, replicate and point share a scatterer; 0: none do"),
)  # fmt: skip
_PLANE = "unit normal and offset [m] of the plane that touches the curved mirror"
IMAGE_COLUMNS = _group(1, *_IMAGE_COLUMNS)
#: The same of tables with curved mirrors: images below 0 are those in the planes of their rows.
CURVED_IMAGE_COLUMNS = _group(
    2,
    *_IMAGE_COLUMNS,
    ("transmitter_plane", "<f8", "1", f"{_PLANE} of a transmitter_image below 0", [4]),
    ("receiver_plane", "<f8", "1", f"{_PLANE} of a receiver_image below 0", [4]),
)


def _dtype(columns: Iterable[ColumnRecord]) -> np.dtype[np.void]:
    return np.dtype([(column.name, column.dtype, tuple(column.shape)) for column in columns])


#: A row of the table as this version writes it.
PATH_DTYPE = _dtype(column for group in COLUMN_GROUPS.values() for column in group.columns)
#: A row of a table with images.
IMAGE_DTYPE = _dtype(
    column for group in (*COLUMN_GROUPS.values(), IMAGE_COLUMNS) for column in group.columns
)
#: A row of a table with images in curved mirrors.
CURVED_IMAGE_DTYPE = _dtype(
    column for group in (*COLUMN_GROUPS.values(), CURVED_IMAGE_COLUMNS) for column in group.columns
)


def column_groups(columns: Collection[str]) -> dict[str, ColumnGroupRecord]:
    """Return the column groups of a table, by name, from the names of its columns."""
    if "transmitter_image" not in columns:
        return COLUMN_GROUPS
    # the end vertices of version 2 are seen over mirrors
    geometry = dataclasses.replace(COLUMN_GROUPS["geometry"], version=2)
    images = CURVED_IMAGE_COLUMNS if "transmitter_plane" in columns else IMAGE_COLUMNS
    return {**COLUMN_GROUPS, "geometry": geometry, IMAGE_GROUP: images}


class Digest(Protocol):
    """A hash to which data are added."""

    def update(self, data: bytes | memoryview, /) -> None: ...


class PathRows:
    """Rows of paths, as columns by name, (n,), or (n, k) with contiguous components.

    A slice is a view: writing to its columns changes these rows, too. A choice by numbers or by a
    mask is a copy. Columns of a table on disk are read when they are first used. One row, by its
    number, is a read-only mapping.
    """

    def __init__(
        self,
        columns: Mapping[str, NDArray[Any]],
        source: PathRows | None = None,
        rows: Indices | None = None,
    ) -> None:
        self._columns = dict(columns)
        #: The table on disk, and the numbers of its rows that these are.
        self._source, self._rows = source, rows
        self.size = len(next(iter(self._columns.values()))) if rows is None else rows.size

    @classmethod
    def zeros(cls, count: int, dtype: np.dtype[np.void] = PATH_DTYPE) -> PathRows:
        """Return rows of zeros; `dtype` has the names and types of the columns."""
        kinds = {name: dtype[name] for name in dtype.names or ()}
        return cls({n: np.zeros((*k.shape, count), k.base).T for n, k in kinds.items()})

    @classmethod
    def joined(cls, parts: Sequence[PathRows]) -> PathRows:
        """Return the rows of all parts, at least one, one behind the other."""
        if len(parts) == 1:
            return parts[0]
        names = parts[0].names
        if any(one.names != names for one in parts):
            raise TypeError(f"Rows of different columns: {[one.names for one in parts]}")
        return cls({n: np.concatenate([one[n].T for one in parts], -1).T for n in names})

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._columns) if self._source is None else self._source.names

    @cached_property
    def dtype(self) -> np.dtype[np.void]:
        """Names and types of the columns, as of a row."""
        table = self if self._source is None else self._source
        return np.dtype([(n, one.dtype, one.shape[1:]) for n, one in table._columns.items()])

    @property
    def nbytes(self) -> int:
        return self.size * self.dtype.itemsize

    @cached_property
    def _is_on_disk(self) -> bool:
        return not all(one.flags.writeable for one in self._columns.values())

    def __len__(self) -> int:
        return self.size

    @overload
    def __getitem__(self, key: str) -> NDArray[Any]: ...
    @overload
    def __getitem__(self, key: int) -> Mapping[str, Any]: ...
    @overload
    def __getitem__(self, key: Indices | Mask | slice) -> PathRows: ...
    def __getitem__(self, key: str | int | Indices | Mask | slice) -> Any:
        if isinstance(key, str):
            if key not in self._columns and self._source is not None and self._rows is not None:
                self._columns[key] = _taken(self._source[key], self._rows)
            return self._columns[key]
        if isinstance(key, slice):
            columns = {name: column[key] for name, column in self._columns.items()}
            if self._rows is None:
                return PathRows(columns)
            return PathRows(columns, self._source, self._rows[key])
        if isinstance(key, int | np.integer):
            return MappingProxyType({name: self[name][key] for name in self.names})
        rows: Indices = np.flatnonzero(key) if key.dtype == bool else key  # type: ignore[assignment]
        if self._rows is not None:
            columns = {name: column[rows] for name, column in self._columns.items()}
            return PathRows(columns, self._source, self._rows[rows])
        if self._is_on_disk:
            return PathRows({}, self, rows)
        return PathRows({n: one.T.take(rows, axis=-1).T for n, one in self._columns.items()})

    def __setitem__(self, name: str, values: Any) -> None:
        column = self[name]
        if values is not column:  # it is, where `rows[name] += ...`
            column[...] = values

    def __iter__(self) -> Iterator[Mapping[str, Any]]:
        return (self[number] for number in range(self.size))

    def __array__(self, *_: object, **__: object) -> NDArray[Any]:
        raise TypeError("Rows of paths are no array: take a column, or copy().")

    def copy(self, *names: str) -> PathRows:
        """Return a copy of the rows with their own arrays, with the given columns only [all]."""
        names = names or self.names
        return PathRows({name: np.array(self[name].T, order="C").T for name in names})

    def chosen(self, rows: Indices, *names: str) -> PathRows:
        """Return some rows, by rising numbers, with the given columns only [all].

        If all rows are chosen, the columns are views.
        """
        columns = {name: self[name] for name in names or self.names}
        if rows.size < self.size:
            columns = {name: one.T.take(rows, axis=-1).T for name, one in columns.items()}
        return PathRows(columns)

    def replaced(self, **columns: NDArray[Any]) -> PathRows:
        """Return the same rows, in which some columns are replaced by others."""
        if self._source is not None:
            return PathRows({**self._columns, **columns}, self._source, self._rows)
        if self._is_on_disk:
            return PathRows(columns, self, np.arange(self.size))
        return PathRows({**self._columns, **columns})

    def widened(self, dtype: np.dtype[np.void]) -> PathRows:
        """Return the rows with the additional columns of a type, which are 0."""
        columns = {name: self[name] for name in self.names}
        if more := [name for name in dtype.names or () if name not in columns]:
            columns |= PathRows.zeros(self.size, dtype[more])._columns
        return PathRows(columns)

    def write(self, stream: IO[bytes], digest: Digest) -> None:
        """Write the rows to a file of parts, from which `read` returns them."""
        count = np.array([self.size], dtype="<u8")
        for column in (count, *(self[name].T for name in self.names)):
            data = _bytes_of(column)
            stream.write(data)
            digest.update(data)

    @classmethod
    def read(cls, stream: BinaryIO, dtype: np.dtype[np.void]) -> PathRows | None:
        """Return the next part of a file; None at its end."""
        header = stream.read(8)
        if not header:
            return None
        (count,) = struct.unpack("<Q", header)
        columns = {}
        for name in dtype.names or ():
            kind = dtype[name]
            values = np.fromfile(stream, kind.base, count * math.prod(kind.shape))
            columns[name] = values.reshape(*kind.shape, count).T
        return cls(columns)

    def equals(self, other: PathRows) -> bool:
        """Return whether the columns have the same names and bytes."""
        return self.dtype == other.dtype and self.tobytes() == other.tobytes()

    def tobytes(self) -> bytes:
        """Return the bytes of all columns, one after another."""
        return b"".join(self[name].tobytes() for name in self.names)


#: If fewer than one row in so many is wanted from the disk, rows are read one by one.
_SPARSE = 64


def _taken(column: NDArray[Any], rows: Indices) -> NDArray[Any]:
    """Return some rows of a column on disk. Rows close together are read as one piece."""
    first, stop = (int(rows.min()), int(rows.max()) + 1) if rows.size else (0, 0)
    if stop - first > _SPARSE * rows.size:
        return np.asarray(column[rows])
    return np.asarray(column[first:stop].T.take(rows - first, axis=-1).T)


def _bytes_of(column: NDArray[Any]) -> memoryview:
    return np.ascontiguousarray(column).reshape(-1).view(np.uint8).data


def iter_rows(table: PathRows, rows: int = 1 << 18) -> Iterator[PathRows]:
    """Yield a table in chunks of at most `rows` rows, which are views."""
    for start in range(0, table.size, rows):
        yield table[start : start + rows]


def has_images(rows: PathRows) -> bool:
    return "transmitter_image" in rows.names


def has_curved_images(rows: PathRows) -> bool:
    return "transmitter_plane" in rows.names


def scatterer_rows(rows: PathRows) -> PathRows:
    """Return rows whose order does not count the mirrors of images."""
    if not has_images(rows) or not rows["mirrors"].any():
        return rows
    return rows.replaced(order=rows["order"] - rows["mirrors"])


# -- files -----------------------------------------------------------------------------------------

#: Refuse headers that claim more rows than this: 5e9 rows are about a terabyte.
MAX_ROWS = 5_000_000_000
#: Bytes after which a large table is sent to the disk, while more rows are computed.
_SYNC_EVERY = 1 << 27
#: Data of columns begin at multiples of so many bytes.
_ALIGNED = 64
#: 1 January 1980, where dates of archives begin.
_DATE = 0x21


@dataclass(frozen=True)
class TableFile:
    """A table that was written: its number of rows, and a digest for each column."""

    rows: int
    column_sha256: dict[str, str]


@dataclass(frozen=True)
class _Member:
    """A column in an archive that is being written."""

    name: str
    #: Bytes before the data: the archive's header, of `local` bytes with the name, then numpy's.
    header: bytes
    local: int
    #: Where the header and the data begin, and the size of the data [bytes].
    offset: int
    start: int
    size: int

    def directory(self, crc: int) -> bytes:
        """Return the member's entry in the directory (APPNOTE 6.3.9, 4.3.12, with ZIP64)."""
        whole = len(self.header) - self.local + self.size
        name = f"{self.name}.npy".encode()
        big = 0xFFFFFFFF
        fields = (45, 45, 0, 0, 0, _DATE, crc, big, big, len(name), 28, 0, 0, 0, 0, big)
        return (
            struct.pack("<4s6H3L5H2L", b"PK\x01\x02", *fields)
            + name
            + struct.pack("<2H3Q", 1, 24, whole, whole, self.offset)
        )


def _members(dtype: np.dtype[np.void], rows: int) -> list[_Member]:
    """Return the place of each column in the file of a table with this number of rows."""
    members, offset = [], 0
    for column in dtype.names or ():
        kind, name = dtype[column], f"{column}.npy".encode()
        size = rows * kind.itemsize
        local = 30 + len(name) + 20
        text = repr(
            {"descr": kind.base.str, "fortran_order": False, "shape": (rows, *kind.shape)}
        ).encode("latin1")
        padding = -(offset + local + 10 + len(text) + 1) % _ALIGNED
        text += b" " * padding + b"\n"
        numpy_header = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text
        whole, big = len(numpy_header) + size, 0xFFFFFFFF
        fields = (45, 0, 0, 0, _DATE, 0, big, big, len(name), 20)
        header = (
            struct.pack("<4s5H3L2H", b"PK\x03\x04", *fields)
            + name
            + struct.pack("<2H2Q", 1, 16, whole, whole)
            + numpy_header
        )
        members.append(_Member(column, header, local, offset, offset + len(header), size))
        offset += len(header) + size
    return members


def _write_directory(stream: IO[bytes], members: Sequence[_Member], crcs: Sequence[int]) -> None:
    """Write checksums into the headers, and the archive's directory after the columns."""
    for member, crc in zip(members, crcs, strict=True):
        stream.seek(member.offset + 14)
        stream.write(struct.pack("<L", crc))
    start = members[-1].start + members[-1].size
    stream.seek(start)
    entries = b"".join(m.directory(crc) for m, crc in zip(members, crcs, strict=True))
    stream.write(entries)
    end, count, most = start + len(entries), len(members), 0xFFFFFFFF
    sizes = (count, count, len(entries), start)
    stream.write(struct.pack("<4sQ2H2L4Q", b"PK\x06\x06", 44, 45, 45, 0, 0, *sizes))
    stream.write(struct.pack("<4sLQL", b"PK\x06\x07", 0, end, 1))
    stream.write(struct.pack("<4s4H2LH", b"PK\x05\x06", 0, 0, count, count, most, most, 0))


def write_table(
    path: Path, parts: Iterable[PathRows], rows: int, dtype: np.dtype[np.void] = PATH_DTYPE
) -> TableFile:
    """Write parts with `rows` rows in total as one file, under a temporary name that is then
    changed.

    `dtype` has the columns of all parts. Only one part is in memory at a time.
    """
    members, found, unsynced = _members(dtype, rows), 0, 0
    digests = [hashlib.sha256() for _ in members]
    crcs = [zlib.crc32(member.header[member.local :]) for member in members]
    with (
        replaced(path) as temporary,
        open(temporary, "wb") as stream,
        ThreadPoolExecutor(1, "radarsim table") as background,
    ):
        for member in members:
            stream.seek(member.offset)
            stream.write(member.header)
        syncs = list[Future[None]]()
        for part in parts:
            if not isinstance(part, PathRows) or part.dtype != dtype:
                raise TypeError(f"rows of {part.dtype}; expected PATH_DTYPE, or that with images")
            if found + part.size > rows:
                raise AssertionError(f"{found + part.size} rows; expected {rows}")
            for number, member in enumerate(members):
                stream.seek(member.start + found * dtype[member.name].itemsize)
                data = _bytes_of(part[member.name])
                stream.write(data)
                digests[number].update(data)
                crcs[number] = zlib.crc32(data, crcs[number])
            found += part.size
            unsynced += part.nbytes
            if unsynced >= _SYNC_EVERY and (not syncs or syncs[-1].done()):
                syncs.append(background.submit(os.fsync, stream.fileno()))
                unsynced = 0
        for sync in syncs:
            sync.result()
        if rows != found:
            raise AssertionError(f"{found} rows; expected {rows}")
        _write_directory(stream, members, crcs)
    names = (member.name for member in members)
    return TableFile(found, {n: d.hexdigest() for n, d in zip(names, digests, strict=True)})


def open_table(
    path: Path,
    listed: Mapping[str, ColumnGroupRecord] | None = None,
    needed: Collection[str] = tuple(COLUMN_GROUPS),
) -> PathRows:
    """Open a memory-mapped table, with the columns of the groups that this version supports.

    `listed` are the groups that its sidecar names (empty or None: they follow from the columns). A
    table without one of the `needed` groups is refused.
    """
    try:
        columns = _map_columns(path)
    except FileNotFoundError as error:
        raise FrameFileError(
            f"{path} is missing. Render the run again: radarsim render measures what is missing."
        ) from error
    # zipfile and struct raise errors of many kinds on damaged files
    except Exception as error:
        raise FrameFileError(
            f"{path} cannot be read as a table of paths ({error}). Remove it and render the run "
            "again: radarsim render measures what is missing."
        ) from error
    return PathRows({name: columns[name] for name in _known_columns(path, columns, listed, needed)})


def _map_columns(path: Path) -> dict[str, NDArray[Any]]:
    """Return the columns of an archive, mapped into memory and read-only."""
    columns: dict[str, NDArray[Any]] = {}
    with open(path, "rb") as stream, zipfile.ZipFile(stream) as archive:
        size = os.fstat(stream.fileno()).st_size
        whole = np.memmap(path, np.uint8, mode="r") if size else np.empty(0, np.uint8)
        for item in archive.infolist():
            if item.compress_type != zipfile.ZIP_STORED or item.flag_bits & 1:
                raise ValueError(f"{item.filename[:60]} is compressed or encrypted")
            stream.seek(item.header_offset)
            header = stream.read(30)
            if len(header) < 30 or header[:4] != b"PK\x03\x04":
                raise ValueError(f"{item.filename[:60]} has no header")
            stream.seek(sum(struct.unpack("<2H", header[26:])), os.SEEK_CUR)
            begin = stream.tell()
            shape, fortran, dtype, count = read_header(stream)
            start = stream.tell()
            if fortran or not shape or len(shape) > 2 or shape[0] > MAX_ROWS:
                raise ValueError(f"{item.filename[:60]} has the shape {str(shape)[:80]}")
            if start + count > size or item.file_size != start - begin + count:
                raise ValueError(f"{item.filename[:60]} is truncated")
            column = whole[start : start + count].view(dtype).reshape(shape)
            columns[item.filename.removesuffix(".npy")] = column.view(np.ndarray)
    counts = {len(column) for column in columns.values()}
    if len(counts) != 1:
        raise ValueError(f"it holds {len(columns)} columns of {sorted(counts)[:5]} rows")
    return columns


def has_digests(table: PathRows, column_sha256: Mapping[str, str]) -> bool:
    """Return whether these are the digests of the columns of a table."""
    return all(
        hashlib.sha256(_bytes_of(table[name])).hexdigest() == column_sha256.get(name)
        for name in table.names
    )


def _known_columns(
    path: Path,
    columns: Mapping[str, NDArray[Any]],
    listed: Mapping[str, ColumnGroupRecord] | None,
    needed: Collection[str],
) -> list[str]:
    """Return the columns of the supported groups."""
    found: list[str] = []
    # Without the columns of images, the ends of their paths would be misread.
    images = not listed or listed.get("geometry", COLUMN_GROUPS["geometry"]).version != 1
    for name, group in column_groups(columns if images else ()).items():
        fault = _fault(group, columns, listed.get(name) if listed else group)
        if not fault:
            found += [column.name for column in group.columns]
        elif name in needed or name == IMAGE_GROUP:
            raise FrameFileError(
                f"{path} has no usable column group {name!r}: {fault}. Update radarsim, or render "
                "the run again."
            )
    return found


def _fault(
    group: ColumnGroupRecord,
    columns: Mapping[str, NDArray[Any]],
    listed: ColumnGroupRecord | None,
) -> str:
    """Return the reason why a group cannot be read; empty if it can."""
    if listed is None:
        return "its sidecar does not list it"
    if listed.version != group.version:
        return f"it is of version {listed.version}, this radarsim reads version {group.version}"
    for column in group.columns:
        if column.name not in columns:
            return f"the column {column.name!r} is missing"
        there = columns[column.name]
        if (there.dtype, there.shape[1:]) != (np.dtype(column.dtype), tuple(column.shape)):
            return (
                f"the column {column.name!r} is {there.dtype} of shape {there.shape[1:]}, expected "
                f"{column.dtype} of {tuple(column.shape)}"
            )
    return ""


# -- records ---------------------------------------------------------------------------------------


def unrendered_record(
    receiver: ReceiverRecord,
    transmitter: TransmitterRecord,
    carrier_hz: float,
    rows: PathRows,
    objects: Sequence[str],
    replicates: int = 1,
) -> PathsRecord:
    """Return the record of a table of single reflections that was not rendered, of frame 0.

    Only the arguments are known. Rows number the objects from 1.
    """
    return PathsRecord(
        frame=0,
        time_s=0.0,
        metres_per_unit=1.0,
        range_encoding_length_m=0.0,
        extinction_length_m=0.0,
        range_encoding="materials",
        coloured=False,
        amplitude_channel="mean",
        carrier_hz=carrier_hz,
        receiver=receiver,
        transmitter=transmitter,
        width_px=0,
        height_px=0,
        max_reflections=1,
        max_unfollowed_fraction=0.0,
        seed=0,
        tiles=1,
        replicates=replicates,
        finest_refinement_level=0,
        renders=0,
        render_time_s=0.0,
        path_count=rows.size,
        objects=list(objects),
        total_power_w=float(rows["power_w"].sum()),
        truncated_reflections_fraction=0.0,
        truncated_transparency_fraction=0.0,
        mixed_power_fraction=0.0,
        unranged_power_fraction=0.0,
        mixed_bias_bound_m=0.0,
        length_sigma_m=0.0,
        length_sigma_wavelengths=0.0,
        relative_error=0.0,
        stop_reason="",
        table_file="",
        column_sha256={},
    )
