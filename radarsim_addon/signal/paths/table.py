# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of propagation paths on disk: one row a path, a plain numpy structured array.

``numpy.load("paths.npy", mmap_mode="r")`` opens it; nothing is pickled. Tables are written in
parts and joined without holding them in memory, so a run may be larger than the machine.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.lib import format as npy_format
from numpy.typing import NDArray

from ...array_files import read_header
from ...atomic_files import replaced
from ...contract import ColumnGroupRecord, ColumnRecord
from ...errors import FrameFileError
from ...sidecar import file_sha256

PathRows = NDArray[np.void]


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
#: Version of the geometry of a table with images: its end vertices are seen over mirrors.
_GEOMETRY_WITH_IMAGES = 2

#: Refuse headers that claim more rows than this: 5e9 rows are about a terabyte.
MAX_ROWS = 5_000_000_000
#: Bytes of a large table after which the disk begins to take them, while others are computed.
_SYNC_EVERY = 1 << 27


def column_groups(columns: Collection[str]) -> dict[str, ColumnGroupRecord]:
    """Return the column groups of a table.

    Parameters
    ----------
    columns
        Names of its columns.

    Returns
    -------
    dict
        Group by name.
    """
    if "transmitter_image" not in columns:
        return COLUMN_GROUPS
    geometry = dataclasses.replace(COLUMN_GROUPS["geometry"], version=_GEOMETRY_WITH_IMAGES)
    images = CURVED_IMAGE_COLUMNS if "transmitter_plane" in columns else IMAGE_COLUMNS
    return {**COLUMN_GROUPS, "geometry": geometry, IMAGE_GROUP: images}


@dataclass(frozen=True)
class TableFile:
    """A table that was written.

    Attributes
    ----------
    rows
        Number of its rows.
    sha256
        Digest of the file, in hexadecimal digits.
    """

    rows: int
    sha256: str


def write_table(
    path: Path,
    parts: Iterable[PathRows],
    dtype: np.dtype[np.void] = PATH_DTYPE,
    rows: int | None = None,
) -> TableFile:
    """Write rows as one ``.npy`` file under a temporary name, then rename.

    Parameters
    ----------
    path
        File to make.
    parts
        Arrays of `dtype`; only one is in memory at a time.
    dtype
        `PATH_DTYPE`; `IMAGE_DTYPE` or `CURVED_IMAGE_DTYPE` with images.
    rows
        Number of all rows; None: unknown, and the file is read once more for its digest.

    Returns
    -------
    TableFile

    Raises
    ------
    OutputError
        The folder is missing, read-only or full. Nothing half-written is left.
    """
    found, digest = 0, hashlib.sha256()
    with (
        replaced(path) as temporary,
        open(temporary, "wb") as stream,
        ThreadPoolExecutor(1, "radarsim table") as background,
    ):
        header = _header(MAX_ROWS if rows is None else rows, dtype)  # room for any number
        stream.write(header)
        digest.update(header)
        syncs, unsynced = list[Future[None]](), 0
        for part in parts:
            if part.dtype != dtype:
                raise TypeError(f"rows of {part.dtype}; expected PATH_DTYPE, or that with images")
            data = np.ascontiguousarray(part).view(np.uint8).data
            stream.write(data)
            digest.update(data)
            found += part.size
            unsynced += data.nbytes
            if unsynced >= _SYNC_EVERY and (not syncs or syncs[-1].done()):
                syncs.append(background.submit(os.fsync, stream.fileno()))
                unsynced = 0
        for sync in syncs:
            sync.result()
        if rows is None:
            stream.seek(0)
            stream.write(_header(found, dtype))
        elif rows != found:
            raise AssertionError(f"{found} rows; expected {rows}")
    return TableFile(found, file_sha256(path) if rows is None else digest.hexdigest())


def _header(rows: int, dtype: np.dtype[np.void]) -> bytes:
    """The header of a table, of one length whatever the number of rows."""
    header = npy_format.header_data_from_array_1_0(np.empty(0, dtype=dtype))
    header["shape"] = (rows,)
    text = repr(header)
    padding = len(str(MAX_ROWS)) - len(str(rows))
    body = (text + " " * padding).encode("latin1")
    # Format 1.0 of numpy's NPY specification: magic, version, length, dict, padding to 64 bytes.
    fixed = 10
    total = -(-(fixed + len(body) + 1) // 64) * 64
    body += b" " * (total - fixed - len(body) - 1) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(body).to_bytes(2, "little") + body


def open_table(
    path: Path,
    listed: Mapping[str, ColumnGroupRecord] | None = None,
    needed: Collection[str] = tuple(COLUMN_GROUPS),
) -> PathRows:
    """Open a table memory-mapped: rows are read when they are used.

    Parameters
    ----------
    path
        Table.
    listed
        Groups that the table has by its sidecar; empty or None: told from its columns alone.
    needed
        Groups without which the table is of no use to the caller.

    Returns
    -------
    ndarray
        (rows,), with the columns of the groups that this version knows.

    Raises
    ------
    FrameFileError
        The file is missing, truncated, no table of paths, or lacks a needed group.
    """
    shape, dtype, start = _read_header(path)
    columns = _known_columns(path, dtype, listed, needed)
    expected = start + shape[0] * dtype.itemsize
    size = path.stat().st_size
    if size != expected:
        raise FrameFileError(
            f"{path} has {size} bytes; its {shape[0]} rows take {expected}: it is truncated. "
            "Remove it and render the run again."
        )
    if shape[0] == 0:
        return np.empty(0, dtype=columns)
    return np.memmap(path, dtype=columns, mode="r", offset=start, shape=shape)


def _read_header(path: Path) -> tuple[tuple[int], np.dtype[np.void], int]:
    """Shape, columns, and first byte of the rows."""
    try:
        with open(path, "rb") as stream:
            shape, fortran, dtype, _ = read_header(stream)
            start = stream.tell()
    except FileNotFoundError as error:
        raise FrameFileError(
            f"{path} is missing. Render the run again: radarsim render measures what is missing."
        ) from error
    except (OSError, ValueError) as error:
        raise FrameFileError(
            f"{path} cannot be read as a table of paths ({error}). Remove it and render the run "
            "again: radarsim render measures what is missing."
        ) from error
    names = dtype.names or ()
    if not names or fortran or len(shape) != 1 or not 0 <= shape[0] <= MAX_ROWS:
        raise FrameFileError(
            f"{path} holds an array of shape {shape} and {len(names)} columns; expected a table of "
            f"paths with at most {MAX_ROWS} rows. Remove it and render the run again."
        )
    return shape, dtype, start


def _known_columns(
    path: Path,
    dtype: np.dtype[np.void],
    listed: Mapping[str, ColumnGroupRecord] | None,
    needed: Collection[str],
) -> np.dtype[np.void]:
    """Where the columns of the known groups are in a row of the file."""
    found: list[str] = []
    # Without the columns of images, the ends of their paths would be misread.
    images = not listed or listed.get("geometry", COLUMN_GROUPS["geometry"]).version != 1
    for name, group in column_groups(dtype.names or () if images else ()).items():
        fault = _fault(group, dtype, listed.get(name) if listed else group)
        if not fault:
            found += [column.name for column in group.columns]
        elif name in needed or name == IMAGE_GROUP:
            raise FrameFileError(
                f"{path} has no usable column group {name!r}: {fault}. Update radarsim, or render "
                "the run again."
            )
    return dtype[found] if found != list(dtype.names or ()) else dtype


def _fault(
    group: ColumnGroupRecord, dtype: np.dtype[np.void], listed: ColumnGroupRecord | None
) -> str:
    """Why a group cannot be read; empty where it can."""
    if listed is None:
        return "its sidecar does not list it"
    if listed.version != group.version:
        return f"it is of version {listed.version}, this radarsim reads version {group.version}"
    for column in group.columns:
        expected = np.dtype((column.dtype, tuple(column.shape)))
        if column.name not in (dtype.names or ()):
            return f"the column {column.name!r} is missing"
        if dtype[column.name] != expected:
            return f"the column {column.name!r} is {dtype[column.name]}, expected {expected}"
    return ""


def iter_rows(table: PathRows, rows: int = 1 << 18) -> Iterator[PathRows]:
    """Yield a table in chunks of at most `rows` rows: views, not to be written to.

    Parameters
    ----------
    table
        Rows, (n,), in memory or mapped.
    rows
        Most rows of a chunk.

    Yields
    ------
    ndarray
    """
    for start in range(0, table.size, rows):
        yield np.asarray(table[start : start + rows])
