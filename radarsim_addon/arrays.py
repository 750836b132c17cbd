# SPDX-License-Identifier: GPL-3.0-or-later
"""Types of numpy arrays, vectors of three components, and arrays of .npy and .npz files.

Vectors are (n, 3), and sums run column by column: numpy's own reductions over an axis of three take
about ten times as long. The order of the sums is the same, so the results have the same bits.

Files may come from anywhere: no pickles, and no more is read than the file holds. ValueError for
content that is no plain array; zipfile and zlib raise further errors on damaged archives, so
readers of .npz files catch all.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy_format
from numpy.typing import ArrayLike, NDArray

Real = NDArray[np.float64]
Single = NDArray[np.float32]
Complex = NDArray[np.complex128]
Mask = NDArray[np.bool_]
Integers = NDArray[np.int64]
Int32 = NDArray[np.int32]
Indices = NDArray[np.intp]


def reals(*values: ArrayLike) -> list[Real]:
    """Return numbers and arrays as float64."""
    return [np.asarray(value, dtype=np.float64) for value in values]


# -- vectors ---------------------------------------------------------------------------------------


def dots(a: Real, b: Real) -> Real:
    """Return the scalar product of each pair of vectors, (n,); one of the two may be (3,)."""
    return _products(np.asarray(a).T, np.asarray(b).T)


def norms(vectors: Real) -> Real:
    """Return the lengths of vectors, (n,)."""
    squares = _products(vectors.T, vectors.T)
    return np.asarray(np.sqrt(squares, out=squares))


def distances(a: Real, b: Real) -> Real:
    """Return the distance of each pair of points, (n,); one of the two may be (3,)."""
    (x, y, z), (p, q, r) = np.asarray(a).T, np.asarray(b).T
    away = np.stack([x - p, y - q, z - r])
    return norms(away.T)


def crosses(a: Real, b: Real) -> Real:
    """Return the cross product of each pair of vectors, (n, 3)."""
    (x, y, z), (p, q, r) = np.asarray(a).T, np.asarray(b).T
    return np.stack([y * r - z * q, z * p - x * r, x * q - y * p]).T


def largest(vectors: Real) -> Real:
    """Return the largest magnitude of each vector's components, (n,); NaN where one is NaN."""
    x, y, z = np.abs(vectors.T)
    return np.asarray(np.maximum(np.maximum(x, y), z))


def are_finite(vectors: Real) -> Mask:
    """Return which vectors have finite components alone, (n,)."""
    x, y, z = vectors.T
    return np.asarray(np.isfinite(x) & np.isfinite(y) & np.isfinite(z))


def take_rows(vectors: Real, rows: Indices) -> Real:
    """Return some rows of (n, 3), with contiguous columns."""
    return np.asarray(vectors.T.take(rows, axis=1).T)


def turned(turn: Real, vectors: Real) -> Real:
    """Return matrices, (3, 3) or one each, (3, 3, n), times vectors, (3, n)."""
    product = np.empty(vectors.shape)
    for row, factors in zip(product, turn, strict=True):
        # many poses do not turn at all
        used = [(f, v) for f, v in zip(factors, vectors, strict=True) if np.any(f)]
        row[:] = 0.0
        if used:
            np.multiply(*used[0], out=row)
        for factor, vector in used[1:]:
            row += factor * vector
    return product


def _products(a: Real, b: Real) -> Real:
    """Sum of the products of three components each, (3, n) or (3,)."""
    found = np.asarray(a[0] * b[0])
    term = np.asarray(a[1] * b[1])
    found += term
    found += np.multiply(a[2], b[2], out=term)
    return found


# -- files -----------------------------------------------------------------------------------------

#: Sizes that an archive may claim [bytes]: with compression, and in all.
_MOST_COMPRESSED, _MOST = 1 << 28, 1 << 34
#: Bytes that are copied at a time.
_CHUNK = 1 << 24
_HEADERS = {
    (1, 0): npy_format.read_array_header_1_0,
    (2, 0): npy_format.read_array_header_2_0,
}


def read_header(stream: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    """Return shape, whether in Fortran's order, type, and size [bytes] of the array to come."""
    try:
        version = npy_format.read_magic(stream)
        if version not in _HEADERS:
            raise ValueError(f"NPY format {version}; expected 1.0 or 2.0")
        shape, fortran, dtype = _HEADERS[version](stream)
    # numpy parses the header with ast and tokenize: damaged ones raise what these raise
    # (TokenError, RecursionError, MemoryError...), not ValueError alone.
    except (Exception, MemoryError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(f"no header of an array: {reason}") from error
    if dtype.hasobject:
        raise ValueError("it holds Python objects; expected numbers")
    if not all(type(count) is int and count >= 0 for count in shape):
        raise ValueError(f"it claims the shape {str(shape)[:80]}; expected whole numbers from 0")
    return shape, fortran, dtype, math.prod(shape) * dtype.itemsize


def _read_array(stream: IO[bytes], room: int) -> NDArray[Any]:
    """Read one array from a stream of `room` bytes."""
    shape, fortran, dtype, size = read_header(stream)
    left = room - stream.tell()
    if size > left or max(shape, default=0) > _MOST:
        raise ValueError(
            f"its header claims {size} bytes (shape {str(shape)[:80]}, {str(dtype)[:40]}); the "
            f"file holds {left}"
        )
    data, read = bytearray(size), 0
    while read < size:
        part = stream.read(min(size - read, _CHUNK))
        if not part:
            raise ValueError(f"it ends after {read} of {size} bytes")
        data[read : read + len(part)] = part
        read += len(part)
    if not size:
        return np.zeros(shape, dtype)
    return np.frombuffer(data, dtype).reshape(shape, order="F" if fortran else "C")


def read_npy(path: Path) -> NDArray[Any]:
    """Return the array of an .npy file."""
    with open(path, "rb") as stream:
        return _read_array(stream, path.stat().st_size)


def read_npz(path: Path, names: Collection[str] | None = None) -> dict[str, NDArray[Any]]:
    """Return arrays of an .npz file by name. With `names`, read these arrays alone.

    radarsim does not compress such files. An archive may hold 256 MiB, or as much as its file.
    """
    with zipfile.ZipFile(path) as archive:
        members = {
            item.filename.removesuffix(".npy"): item
            for item in archive.infolist()
            if names is None or item.filename.removesuffix(".npy") in names
        }
        claimed = sum(item.file_size for item in members.values())
        most = min(max(path.stat().st_size, _MOST_COMPRESSED), _MOST)
        if claimed > most:
            raise ValueError(
                f"it holds {claimed} bytes when uncompressed, in a file of {path.stat().st_size}; "
                f"expected at most {most}"
            )
        found = {}
        for name, item in members.items():
            with archive.open(item) as stream:
                try:
                    found[name] = _read_array(stream, item.file_size)
                except ValueError as error:
                    raise ValueError(f"{name}: {error}") from error
    for name in names or ():
        if name not in found:
            raise ValueError(f"{name} is missing")
    return found
