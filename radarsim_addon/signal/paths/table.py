# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of propagation paths on disk: one row per path, a plain numpy structured array.

``numpy.load("paths.npy", mmap_mode="r")`` opens it; nothing is pickled. Tables are written in parts
and joined without holding them in memory, so a run may be larger than the machine. Rows are long:
columns are read part by part, or gathered on access, while a part is in the processor's cache.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.lib import format as npy_format
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
from ...typed_json import file_sha256

PathRows = NDArray[np.void]
#: Columns by name, those of vectors with contiguous components.
Columns = Mapping[str, NDArray[Any]]


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
#: Refuse headers that claim more rows than this: 5e9 rows are about a terabyte.
MAX_ROWS = 5_000_000_000
#: Bytes of a large table after which the disk begins to take them, while others are computed.
_SYNC_EVERY = 1 << 27


def column_groups(columns: Collection[str]) -> dict[str, ColumnGroupRecord]:
    """Return the column groups of a table with these columns, by name."""
    if "transmitter_image" not in columns:
        return COLUMN_GROUPS
    # the end vertices of version 2 are seen over mirrors
    geometry = dataclasses.replace(COLUMN_GROUPS["geometry"], version=2)
    images = CURVED_IMAGE_COLUMNS if "transmitter_plane" in columns else IMAGE_COLUMNS
    return {**COLUMN_GROUPS, "geometry": geometry, IMAGE_GROUP: images}


@dataclass(frozen=True)
class TableFile:
    """A table that was written."""

    rows: int
    sha256: str


def write_table(
    path: Path,
    parts: Iterable[PathRows],
    dtype: np.dtype[np.void] = PATH_DTYPE,
    rows: int | None = None,
) -> TableFile:
    """Write rows as one ``.npy`` file under a temporary name, then rename.

    `parts` are arrays of `dtype`, of which only one is in memory at a time. With `rows`, the number
    of all, the file need not be read again for its digest.
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
    """Return the header of a table, of one length whatever the number of rows."""
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
    """Open a table memory-mapped, with the columns of the groups that this version knows.

    `listed` are its groups by its sidecar (empty or None: from the columns alone); without one
    of the `needed` groups the table is refused.
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
    """Return shape, columns, and first byte of the rows."""
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
    """Return where the columns of the known groups are in a row of the file."""
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
    """Return why a group cannot be read; empty where it can."""
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
    """Yield a table in chunks of at most `rows` rows: views, not to be written to."""
    for start in range(0, table.size, rows):
        yield np.asarray(table[start : start + rows])


#: Rows that are read or written at a time.
_ROWS_AT_ONCE = 1 << 12


class PathColumns:
    """Some rows of a table, by number, in any order and more than once; each column is gathered on
    first access.

    A row is so long that gathering all of it, and reading a column of it, take ten times as long.
    `changed` are columns of other values than the table's.
    """

    def __init__(
        self, table: PathRows, rows: Indices, changed: Mapping[str, NDArray[Any]] | None = None
    ) -> None:
        # a column that is taken from is copied whole first
        first, stop = (int(rows.min()), int(rows.max()) + 1) if rows.size else (0, 0)
        self._table, self._rows = np.asarray(table)[first:stop], rows - first
        self._columns = dict(changed or {})
        self.dtype, self.size = table.dtype, rows.size

    @overload
    def __getitem__(self, key: str) -> NDArray[Any]: ...
    @overload
    def __getitem__(self, key: Indices | Mask | slice) -> PathColumns: ...
    def __getitem__(self, key: str | Indices | Mask | slice) -> NDArray[Any] | PathColumns:
        if not isinstance(key, str):
            changed = {name: column[key] for name, column in self._columns.items()}
            return PathColumns(self._table, self._rows[key], changed)
        if key not in self._columns:
            # Vectors with contiguous components. `take` would gather from the table a slow copy.
            column = np.array(self._table[key].T, order="C")
            self._columns[key] = column.take(self._rows, axis=-1).T
        return self._columns[key]

    def __setitem__(self, name: str, column: NDArray[Any]) -> None:
        self._columns[name] = column

    def copy(self) -> PathColumns:
        """Return the same rows; columns of the copy may be replaced."""
        return PathColumns(self._table, self._rows, self._columns)


def read_columns(rows: PathRows, names: Sequence[str]) -> dict[str, NDArray[Any]]:
    """Return copies of some columns, (n,) or (n, 3), of vectors with contiguous components."""
    kinds = [rows.dtype[name] for name in names]
    found = [np.empty((*kind.shape, rows.size), kind.base) for kind in kinds]
    for start in range(0, rows.size, _ROWS_AT_ONCE):
        part = rows[start : start + _ROWS_AT_ONCE]
        for name, column in zip(names, found, strict=True):
            column[..., start : start + part.size] = part[name].T
    return {name: column.T for name, column in zip(names, found, strict=True)}


def write_columns(rows: PathRows, columns: Mapping[str, Any]) -> None:
    """Set some columns of rows to values (n,) or (n, 3), or to one value for all rows."""
    for start in range(0, rows.size, _ROWS_AT_ONCE):
        some = slice(start, start + _ROWS_AT_ONCE)
        part = rows[some]
        for name, values in columns.items():
            part[name] = values[some] if np.ndim(values) else values


def chosen_rows(columns: Columns, rows: Indices) -> Columns:
    """Return some rows of columns, by numbers that rise; of all rows, the columns themselves."""
    if all(rows.size == len(column) for column in columns.values()):
        return columns
    return {name: column.T.take(rows, axis=-1).T for name, column in columns.items()}


def widened(rows: PathRows, dtype: np.dtype[np.void]) -> PathRows:
    """Return rows of a type with more columns, which are 0, behind those that they have."""
    if dtype.descr[: len(rows.dtype.descr)] != rows.dtype.descr:
        raise ValueError("A wider row must begin with the same columns.")
    # each row as one piece: column by column takes ten times as long
    piece = np.dtype(
        {"names": ["own"], "formats": [rows.dtype], "offsets": [0], "itemsize": dtype.itemsize}
    )
    wide = np.zeros(rows.shape, dtype=dtype)
    wide.view(piece)["own"] = rows
    return wide


#: Rows that are read and not written to.
AnyRows = PathRows | PathColumns


def has_images(rows: AnyRows) -> bool:
    return "transmitter_image" in (rows.dtype.names or ())


def has_curved_images(rows: AnyRows) -> bool:
    return "transmitter_plane" in (rows.dtype.names or ())


def scatterer_rows(rows: AnyRows) -> AnyRows:
    """Return rows whose order leaves out the mirrors of images; a copy where there are any."""
    if not has_images(rows) or not rows["mirrors"].any():
        return rows
    rows = rows.copy()
    rows["order"] = rows["order"] - rows["mirrors"]
    return rows


def unrendered_record(
    receiver: ReceiverRecord,
    transmitter: TransmitterRecord,
    carrier_hz: float,
    rows: PathRows,
    objects: Sequence[str],
    replicates: int = 1,
) -> PathsRecord:
    """Return the record of a table of single reflections that no render has made, of frame 0: only
    the arguments are known. Rows number the objects from 1.
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
        table_sha256="",
    )
