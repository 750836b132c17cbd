# SPDX-License-Identifier: GPL-3.0-or-later
"""Select and join the rows of dataclasses whose fields are columns, whatever fields there are."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence, Sized
from typing import Any, TypeVar, cast

import numpy as np

from ..motion import Rows

Table = TypeVar("Table")


def select_columns(table: Table, rows: Rows) -> Table:
    """Return some rows (mask, row numbers or slice) of every column of a dataclass.

    Columns are arrays (n, ...) and objects with a method `select`; other fields are kept.
    """
    columns = dict(vars(table))
    for name, column in columns.items():
        if isinstance(column, np.ndarray):
            columns[name] = column[rows]
        elif hasattr(column, "select"):
            columns[name] = column.select(rows)
    return type(table)(**columns)


def join_columns(tables: Sequence[Table], **joined: Any) -> Table:
    """Return the rows of several tables (one at least) of one type, one behind the other.

    Where a table has None for a column, it is filled with the field's metadata "absent"; without
    that the result has None, too. `joined` are fields that are no arrays, already joined.
    """
    kind: Any = type(tables[0])
    for item in dataclasses.fields(kind):
        if item.name in joined:
            continue
        columns = [getattr(table, item.name) for table in tables]
        if not all(column is None for column in columns) and "absent" in item.metadata:
            fill = item.metadata["absent"]
            columns = [
                np.full(len(cast(Sized, table)), fill) if column is None else column
                for table, column in zip(tables, columns, strict=True)
            ]
        known = all(column is not None for column in columns)
        joined[item.name] = np.concatenate(columns) if known else None
    return cast(Table, kind(**joined))
