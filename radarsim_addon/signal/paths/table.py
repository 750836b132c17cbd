# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of propagation paths on disk: one row a path, a plain numpy structured array.

``numpy.load("paths.npy", mmap_mode="r")`` opens it; nothing is pickled. Tables are written in
parts and joined without holding them in memory, so a run may be larger than the machine.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy_format
from numpy.typing import NDArray

from ...errors import FrameFileError, OutputError
from ...old_names import todays_name

PathRows = NDArray[np.void]

#: Columns of the table. SI, world space; float64 wherever phase depends on it.
PATH_DTYPE = np.dtype(
    [
        # received power for an isotropic receiver at the run's carrier, this path's share [W]
        ("power_w", "<f8"),
        # total optical length: receiver, scatterers, emitter [m]
        ("length_m", "<f8"),
        # one standard deviation of length_m from float32 in the render [m]
        ("length_sigma_m", "<f4"),
        # rate of the one-way range length/2, receding positive [m/s]; 0 where unknown
        ("range_rate_mps", "<f8"),
        # number of reflections, and of transparent surfaces passed on the receiver's side
        ("order", "<u2"),
        ("transparent_depth", "<u2"),
        # first and last scatterer [m], equal at order 1; NaN where unknown
        ("first_scatterer_m", "<f8", (3,)),
        ("last_scatterer_m", "<f8", (3,)),
        # from the receiver towards the first scatterer, unit vector
        ("direction", "<f8", (3,)),
        # share of the solid angle that the path stands for [sr]
        ("solid_angle_sr", "<f8"),
        # numbers of the objects at the last and first scatterer in the sidecar's list; 0: unknown
        ("last_object", "<i4"),
        ("first_object", "<i4"),
        # numbers of the bodies (objects or instances) there in the frame's motion file, and of the
        # tracks of points on surfaces that deform; 0: unknown, and none
        ("last_body", "<i4"),
        ("first_body", "<i4"),
        ("last_surface_point", "<i4"),
        ("first_surface_point", "<i4"),
        # view (tile) and sub-pixel shift: shifts of one tile are replicates of one another
        ("tile", "<i4"),
        ("replicate", "<i4"),
        ("flags", "<u2"),
    ]
)


#: Refuse headers that claim more rows than this: 5e9 rows are about a terabyte.
MAX_ROWS = 5_000_000_000


def write_table(path: Path, parts: Iterable[PathRows]) -> int:
    """Write rows as one ``.npy`` file under a temporary name, then rename.

    Parameters
    ----------
    path
        File to make.
    parts
        Arrays of `PATH_DTYPE`; only one is in memory at a time.

    Returns
    -------
    int
        Number of rows.

    Raises
    ------
    OutputError
        The folder is missing, read-only or full. Nothing half-written is left.
    """
    temporary = path.with_name(path.name + ".part")
    rows = 0
    try:
        with open(temporary, "wb") as stream:
            _write_header(stream, MAX_ROWS)  # room for any count; overwritten below
            start = stream.tell()
            for part in parts:
                if part.dtype != PATH_DTYPE:
                    raise TypeError(f"rows of {part.dtype}; expected PATH_DTYPE")
                stream.write(np.ascontiguousarray(part).tobytes())
                rows += part.size
            stream.seek(0)
            _write_header(stream, rows)
            if stream.tell() != start:
                raise AssertionError("the header changed its length")
        os.replace(temporary, path)
    except OSError as error:
        raise OutputError(
            f"Cannot write {path}: {error.strerror or error}. "
            "Choose an output folder that exists, is writable and has room."
        ) from error
    finally:
        temporary.unlink(missing_ok=True)
    return rows


def _write_header(stream: Any, rows: int) -> None:
    header = npy_format.header_data_from_array_1_0(np.empty(0, dtype=PATH_DTYPE))
    # Digits are padded so that the header has one length whatever the count.
    header["shape"] = (rows,)
    text = repr(header)
    padding = len(str(MAX_ROWS)) - len(str(rows))
    body = (text + " " * padding).encode("latin1")
    # Format 1.0 of numpy's NPY specification: magic, version, length, dict, padding to 64 bytes.
    fixed = 10
    total = -(-(fixed + len(body) + 1) // 64) * 64
    body += b" " * (total - fixed - len(body) - 1) + b"\n"
    stream.write(b"\x93NUMPY\x01\x00" + len(body).to_bytes(2, "little") + body)


def open_table(path: Path) -> PathRows:
    """Open a table memory-mapped: rows are read when they are used.

    Raises
    ------
    FrameFileError
        The file is missing, truncated, no table of paths, or of other columns.
    """
    try:
        with open(path, "rb") as stream:
            version = npy_format.read_magic(stream)
            if version != (1, 0):
                raise ValueError(f"NPY format {version}")
            shape, fortran, dtype = npy_format.read_array_header_1_0(stream)
            start = stream.tell()
    except FileNotFoundError as error:
        raise FrameFileError(
            f"{path} is missing. Render the run again: it goes on where files are missing."
        ) from error
    # numpy parses the header with ast and tokenize: damaged ones raise what these raise
    # (TokenError, RecursionError, TypeError...), not ValueError alone.
    except Exception as error:
        raise FrameFileError(
            f"{path} cannot be read as a table of paths ({error}). Remove it and render the run "
            "again: it goes on where files are missing."
        ) from error
    if _todays(dtype) != PATH_DTYPE or fortran or len(shape) != 1 or shape[0] > MAX_ROWS:
        raise FrameFileError(
            f"{path} holds an array of shape {shape} with other columns than a table of paths. "
            "It was not written by this version of radarsim: render the run again."
        )
    expected = start + shape[0] * PATH_DTYPE.itemsize
    size = path.stat().st_size
    if size != expected:
        raise FrameFileError(
            f"{path} has {size} bytes; its {shape[0]} rows take {expected}: it is truncated. "
            "Remove it and render the run again."
        )
    if shape[0] == 0:
        return np.empty(0, dtype=PATH_DTYPE)
    return np.memmap(path, dtype=PATH_DTYPE, mode="r", offset=start, shape=shape)


def _todays(dtype: np.dtype[np.void]) -> np.dtype[np.void]:
    """Columns of an older table by the names of today."""
    names = [todays_name(name, PATH_DTYPE.names or ()) for name in dtype.names or ()]
    return np.dtype([(name, dtype[i]) for i, name in enumerate(names)])


def iter_rows(table: PathRows, rows: int = 1 << 18) -> Iterator[PathRows]:
    """A table in chunks, copied into memory one at a time."""
    for start in range(0, table.size, rows):
        yield np.array(table[start : start + rows])
