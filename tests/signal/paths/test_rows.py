# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of paths as columns: selections, views and copies, parts, and rows with more columns."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.signal.paths import (
    CURVED_IMAGE_DTYPE,
    IMAGE_DTYPE,
    PATH_DTYPE,
    PathRows,
    open_table,
    scatterer_rows,
    write_table,
)

_ROWS = 1001


@pytest.fixture(params=["in memory", "on disk"])
def rows(request: pytest.FixtureRequest, tmp_path: Path) -> PathRows:
    """Rows with other bytes in each column."""
    rng = np.random.default_rng(1)
    found = PathRows.zeros(_ROWS)
    for name in found.names:
        found[name] = rng.integers(0, 1000, found[name].shape)
    if request.param == "in memory":
        return found
    write_table(tmp_path / "paths.npz", [found], _ROWS)
    return open_table(tmp_path / "paths.npz")


@pytest.mark.parametrize(
    "chosen",
    [
        slice(3, 900, 7),
        np.array([7, 3, 3, 999, 12]),
        np.array([0, 1000]),
        np.arange(_ROWS) % 3 == 0,
        np.zeros(0, dtype=np.intp),
    ],
)
def test_selections_are_those_of_each_column(rows: PathRows, chosen: np.ndarray) -> None:
    some = rows[chosen]
    again = some[np.arange(some.size)[::2]]
    for name in rows.names:
        np.testing.assert_array_equal(some[name], rows[name][chosen])
        np.testing.assert_array_equal(again[name], rows[name][chosen][::2])
        assert some[name].dtype == rows[name].dtype
    assert len(some) == some.size == rows["order"][chosen].size
    assert some.dtype == again.dtype == PATH_DTYPE
    assert some.nbytes == some.size * PATH_DTYPE.itemsize


def test_one_row_is_read(rows: PathRows) -> None:
    row = rows[17]
    with pytest.raises(TypeError, match="does not support item assignment"):
        row["length_m"] = 1.0  # type: ignore[index]
    assert row["length_m"] == rows["length_m"][17]
    np.testing.assert_array_equal(row["direction"], rows["direction"][17])


def test_only_slices_are_views(rows: PathRows) -> None:
    rows = rows.copy()
    before = rows["power_w"].copy()
    rows[5:9]["power_w"] *= 2
    part = rows[np.array([1, 2])]
    part["power_w"] = -1.0
    part["direction"][:] = -1.0
    before[5:9] *= 2
    np.testing.assert_array_equal(rows["power_w"], before)
    assert np.all(rows["direction"] >= 0)


def test_selections_of_a_table_on_disk_are_copies(rows: PathRows) -> None:
    part = rows[np.array([4, 2])]
    part["power_w"] *= 3
    np.testing.assert_array_equal(part["power_w"], 3 * rows["power_w"][[4, 2]])
    np.testing.assert_array_equal(part[::-1]["power_w"], 3 * rows["power_w"][[2, 4]])
    np.testing.assert_array_equal(part[np.array([1])]["power_w"], 3 * rows["power_w"][[2]])


def test_a_table_on_disk_cannot_be_written_to(tmp_path: Path) -> None:
    write_table(tmp_path / "paths.npz", [PathRows.zeros(2)], 2)
    table = open_table(tmp_path / "paths.npz")
    with pytest.raises(ValueError, match="read-only"):
        table["power_w"] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        table[:1]["power_w"] = 1.0


def test_copies_and_other_columns_leave_the_rows(rows: PathRows) -> None:
    power_w = np.arange(float(rows.size))
    other = rows.replaced(power_w=power_w)
    np.testing.assert_array_equal(other["power_w"], power_w)
    np.testing.assert_array_equal(other["length_m"], rows["length_m"])
    np.testing.assert_array_equal(other[np.array([8, 3])]["power_w"], [8, 3])
    some = rows.copy("length_m", "direction")
    assert some.names == ("length_m", "direction")
    assert some["direction"].T.flags.c_contiguous
    some["length_m"] = -1.0
    assert np.all(rows["length_m"] >= 0)


def test_chosen_rows_have_the_named_columns(rows: PathRows) -> None:
    numbers = np.flatnonzero(rows["length_m"] > 500)
    some = rows.chosen(numbers, "length_m", "direction")
    assert some.names == ("length_m", "direction")
    for name in some.names:
        np.testing.assert_array_equal(some[name], rows[name][numbers])
    every = rows.chosen(np.arange(rows.size))
    assert np.shares_memory(every["length_m"], rows["length_m"])


def test_parts_are_joined(rows: PathRows) -> None:
    whole = PathRows.joined([rows[:400], rows[400:400], rows[400:]])
    assert whole.equals(rows)
    with pytest.raises(TypeError, match="different columns"):
        PathRows.joined([rows, rows.copy("length_m")])


@pytest.mark.parametrize("dtype", [PATH_DTYPE, IMAGE_DTYPE, CURVED_IMAGE_DTYPE])
def test_wider_rows_keep_their_columns_and_have_0_in_the_others(
    rows: PathRows, dtype: np.dtype[np.void]
) -> None:
    wide = rows[::2].copy().widened(dtype)
    assert wide.dtype == dtype
    for name in wide.names:
        own = rows[name][::2] if name in rows.names else 0
        np.testing.assert_array_equal(wide[name], np.broadcast_to(own, wide[name].shape))


def test_order_of_scatterers_leaves_out_mirrors(rows: PathRows) -> None:
    assert scatterer_rows(rows) is rows
    wide = rows.copy().widened(IMAGE_DTYPE)
    wide["order"], wide["mirrors"] = 3, np.arange(_ROWS) % 2
    np.testing.assert_array_equal(scatterer_rows(wide)["order"], 3 - np.arange(_ROWS) % 2)
    assert np.all(wide["order"] == 3)


def test_parts_of_a_file_are_read_again(rows: PathRows, tmp_path: Path) -> None:
    digest = hashlib.sha256()
    path = tmp_path / "rows"
    with open(path, "wb") as stream:
        for part in (rows[:3], rows[:0], rows[3:].copy()):
            part.write(stream, digest)
    assert hashlib.sha256(path.read_bytes()).hexdigest() == digest.hexdigest()
    with open(path, "rb") as stream:
        found = [PathRows.read(stream, PATH_DTYPE) for _ in range(4)]
    assert found[3] is None
    parts = [one for one in found if one is not None]
    assert [one.size for one in parts] == [3, 0, _ROWS - 3]
    assert PathRows.joined(parts).equals(rows)
