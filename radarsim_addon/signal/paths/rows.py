# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of the path table: read column by column, and with or without images of the antennas."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from ...array_types import Indices, Mask
from .table import PathRows

#: Columns by name, those of vectors with contiguous components.
Columns = Mapping[str, NDArray[Any]]
#: Rows that are read or written at a time.
_ROWS_AT_ONCE = 1 << 12


class PathColumns:
    """Rows of a table, read column by column, as an array of rows is: each is gathered when asked.

    A row is so long that gathering all of it, and reading a column of it, take ten times as long.

    Parameters
    ----------
    table
        Table, in memory or mapped.
    rows
        Numbers of rows, in any order and more than once, (n,).
    changed
        Columns of other values than the table's, by name.
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
        """Return rows of which columns may be replaced."""
        return PathColumns(self._table, self._rows, self._columns)


def read_columns(rows: PathRows, names: Sequence[str]) -> dict[str, NDArray[Any]]:
    """Return copies of some columns, of vectors with contiguous components.

    Rows are long: all columns of a part are read while it is in the processor's cache.

    Parameters
    ----------
    rows
        (n,).
    names
        Of the columns.

    Returns
    -------
    dict
        Column by name, (n,) or (n, 3).
    """
    kinds = [rows.dtype[name] for name in names]
    found = [np.empty((*kind.shape, rows.size), kind.base) for kind in kinds]
    for start in range(0, rows.size, _ROWS_AT_ONCE):
        part = rows[start : start + _ROWS_AT_ONCE]
        for name, column in zip(names, found, strict=True):
            column[..., start : start + part.size] = part[name].T
    return {name: column.T for name, column in zip(names, found, strict=True)}


def write_columns(rows: PathRows, columns: Mapping[str, Any]) -> None:
    """Set some columns, part by part as `read_columns` reads them.

    Parameters
    ----------
    rows
        (n,), which are changed.
    columns
        Values by column, (n,) or (n, 3), or one for all rows.
    """
    for start in range(0, rows.size, _ROWS_AT_ONCE):
        some = slice(start, start + _ROWS_AT_ONCE)
        part = rows[some]
        for name, values in columns.items():
            part[name] = values[some] if np.ndim(values) else values


def chosen_rows(columns: Columns, rows: Indices) -> Columns:
    """Return some rows of columns.

    Parameters
    ----------
    columns
        As from `read_columns`, of n rows.
    rows
        Numbers of different rows that rise, (m,).

    Returns
    -------
    dict
        Column by name, (m,) or (m, 3); those of all rows are the columns themselves.
    """
    if all(rows.size == len(column) for column in columns.values()):
        return columns
    return {name: column.T.take(rows, axis=-1).T for name, column in columns.items()}


def widened(rows: PathRows, dtype: np.dtype[np.void]) -> PathRows:
    """Return rows of a type with more columns, which are 0, behind those that they have.

    Parameters
    ----------
    rows
        (n,).
    dtype
        Its first columns are those of the rows.

    Returns
    -------
    ndarray
        (n,).

    Raises
    ------
    ValueError
        The type begins with other columns.
    """
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
    """Return whether rows have the columns of images.

    Parameters
    ----------
    rows
        (n,).

    Returns
    -------
    bool
    """
    return "transmitter_image" in (rows.dtype.names or ())


def has_curved_images(rows: AnyRows) -> bool:
    """Return whether rows have the columns of images in curved mirrors.

    Parameters
    ----------
    rows
        (n,).

    Returns
    -------
    bool
    """
    return "transmitter_plane" in (rows.dtype.names or ())


def scatterer_rows(rows: AnyRows) -> AnyRows:
    """Return rows whose order leaves out the mirrors of images.

    Parameters
    ----------
    rows
        (n,).

    Returns
    -------
    ndarray
        (n,), a copy where there are any mirrors.
    """
    if not has_images(rows) or not rows["mirrors"].any():
        return rows
    rows = rows.copy()
    rows["order"] = rows["order"] - rows["mirrors"]
    return rows
