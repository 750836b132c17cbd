# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns of long rows, read part by part, and rows with more columns."""

from __future__ import annotations

import numpy as np
import pytest

from radarsim_addon.signal.paths import (
    CURVED_IMAGE_DTYPE,
    IMAGE_DTYPE,
    PATH_DTYPE,
    PathColumns,
    PathRows,
    chosen_rows,
    read_columns,
    widened,
    write_columns,
)

#: Not a multiple of the rows that are read at a time.
_ROWS = 10_001


@pytest.fixture
def rows() -> PathRows:
    """Rows with other bytes in each column."""
    rng = np.random.default_rng(1)
    found = np.zeros(_ROWS, dtype=PATH_DTYPE)
    for name in PATH_DTYPE.names or ():
        found[name] = rng.integers(0, 1000, found[name].shape)
    return found


@pytest.mark.parametrize("count", [0, 1, _ROWS])
def test_columns_are_copies_with_contiguous_components(rows: PathRows, count: int) -> None:
    some = rows[:count]
    read = read_columns(some, PATH_DTYPE.names or ())
    for name, column in read.items():
        np.testing.assert_array_equal(column, some[name])
        assert column.dtype == some[name].dtype and column.T.flags.c_contiguous
        assert not np.shares_memory(column, rows)


def test_written_columns_are_those_that_are_read(rows: PathRows) -> None:
    read = read_columns(rows, PATH_DTYPE.names or ())
    found = np.zeros(_ROWS, dtype=PATH_DTYPE)
    write_columns(found, {**read, "tile": 3})
    rows["tile"] = 3
    np.testing.assert_array_equal(found, rows)


def test_chosen_rows_are_those_of_the_table(rows: PathRows) -> None:
    read = read_columns(rows, ("length_m", "direction"))
    numbers = np.flatnonzero(rows["length_m"] > 500)
    for name, column in chosen_rows(read, numbers).items():
        np.testing.assert_array_equal(column, rows[name][numbers])
        assert column.T.flags.c_contiguous
    assert chosen_rows(read, np.arange(rows.size)) is read


def test_columns_are_read_in_any_order_of_rows(rows: PathRows) -> None:
    numbers = np.array([7, 3, 3, 9000, 12])
    columns = PathColumns(rows, numbers)
    for name in ("length_m", "direction", "flags"):
        np.testing.assert_array_equal(columns[name], rows[name][numbers])


@pytest.mark.parametrize("dtype", [PATH_DTYPE, IMAGE_DTYPE, CURVED_IMAGE_DTYPE])
def test_wider_rows_keep_their_columns_and_have_0_in_the_others(
    rows: PathRows, dtype: np.dtype[np.void]
) -> None:
    wide = widened(rows[::2], dtype)
    assert wide.dtype == dtype
    for name in dtype.names or ():
        own = rows[name][::2] if name in (PATH_DTYPE.names or ()) else 0
        np.testing.assert_array_equal(wide[name], np.broadcast_to(own, wide[name].shape))
    wide["power_w"] = -1
    assert np.all(rows["power_w"] >= 0)


def test_rows_that_do_not_begin_alike_are_not_widened(rows: PathRows) -> None:
    other = np.dtype(list(reversed(PATH_DTYPE.descr)))
    with pytest.raises(ValueError, match="begin with the same columns"):
        widened(rows, other)
