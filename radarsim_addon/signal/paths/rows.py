# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of the path table: read column by column, and with or without images of the antennas."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from ...array_types import Indices, Mask
from .table import PathRows


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
            # vectors with contiguous components
            self._columns[key] = self._table[key].T.take(self._rows, axis=-1).T
        return self._columns[key]

    def __setitem__(self, name: str, column: NDArray[Any]) -> None:
        self._columns[name] = column

    def copy(self) -> PathColumns:
        """Return rows of which columns may be replaced."""
        return PathColumns(self._table, self._rows, self._columns)


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
