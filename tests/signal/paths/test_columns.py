# SPDX-License-Identifier: GPL-3.0-or-later
"""Column groups of the table: older, later and larger tables; select and join of all columns."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.errors import FrameFileError
from radarsim_addon.signal import PathFlag, Paths, frame_paths, make_paths, open_run
from radarsim_addon.signal.decoding import table_paths
from radarsim_addon.signal.motion import LinearMotion, PathImages
from radarsim_addon.signal.paths import (
    COLUMN_GROUPS,
    PATH_DTYPE,
    PATH_FLAGS,
    PathGeometry,
    PathRows,
    open_frame_table,
    open_table,
)
from radarsim_addon.signal.paths import table as table_module
from radarsim_addon.typed_json import read_record, write_record
from tests.signal.path_runs import camera, plate, pose, trace, write_run
from tests.signal.paths.test_table import random_rows


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run of one plate."""
    receiver = camera(pose((0, 0, 0)))
    transmitter = contract.TransmitterRecord(pose((0.3, 0, 0)), 1.0)
    rows = trace([plate("Plate", (0, 50, 0), 20.0)], receiver, transmitter, 16)
    return write_run(tmp_path / "run", rows, ["Plate"], receiver, transmitter, range_limits_m=100.0)


def replace_table(run: Path, columns: Mapping[str, np.ndarray], **changes: Any) -> Path:
    """Put other columns into a run, whose sidecar says so."""
    frame = run / contract.frame_dir(1)
    np.savez(frame / contract.PATHS_TABLE, **columns)  # type: ignore[arg-type]
    record = read_record(frame / contract.PATHS_FILE, contract.PathsRecord)
    digests = {name: hashlib.sha256(one.tobytes()).hexdigest() for name, one in columns.items()}
    count = len(columns["power_w"]) if "power_w" in columns else record.path_count
    record = dataclasses.replace(record, column_sha256=digests, path_count=count, **changes)
    write_record(frame / contract.PATHS_FILE, record)
    return frame


def columns_of(rows: PathRows, without: str = "") -> dict[str, np.ndarray]:
    """Columns as numpy stores them, without those of a group."""
    left_out = [one.name for one in COLUMN_GROUPS[without].columns] if without else []
    return {n: np.array(rows[n], order="C") for n in rows.names if n not in left_out}


def arrays(paths: Paths) -> dict[str, np.ndarray]:
    """All numbers of paths."""
    found = {k: v for k, v in vars(paths).items() if isinstance(v, np.ndarray)}
    assert paths.geometry is not None
    found |= {k: v for k, v in vars(paths.geometry).items() if k != "images"}
    images = paths.geometry.images
    return found if images is None else {**found, "images": images.numbers}


def test_the_sidecar_describes_the_table(run: Path) -> None:
    """Every column of the file is in one group, with the dtype of the file, and has a meaning."""
    frame = run / contract.frame_dir(1)
    groups = json.loads((frame / contract.PATHS_FILE).read_text())["column_groups"]
    described = [column for group in groups.values() for column in group["columns"]]
    dtype = np.dtype([(c["name"], c["dtype"], tuple(c["shape"])) for c in described])
    table = np.load(frame / contract.PATHS_TABLE)
    found = [(name, table[name].dtype.str, table[name].shape[1:]) for name in table.files]
    assert np.dtype(found) == dtype == PATH_DTYPE
    assert set(groups) == {"geometry", "power", "motion", "labels"}
    assert all(column["meaning"] and column["unit"] for column in described)
    for column in described:  # names carry their unit
        suffix = column["unit"].replace("m/s", "mps").lower()
        assert suffix == "1" or column["name"].endswith(f"_{suffix}") or "_sigma_" in column["name"]


def test_flags_have_one_value_everywhere(run: Path) -> None:
    frame = run / contract.frame_dir(1)
    flags = json.loads((frame / contract.PATHS_FILE).read_text())["flags"]
    assert flags == PATH_FLAGS
    assert flags["mixed"] == PathFlag.MIXED == 4
    assert len(set(flags.values())) == len(flags)
    assert all(value.bit_count() == 1 for value in flags.values())
    before = open_frame_table(frame, 1)[1]
    rows = before.copy()
    rows["flags"][:3] = PathFlag.MIXED | PathFlag.ENCODED_LENGTH
    replace_table(run, columns_of(rows))
    paths = frame_paths(open_run(run).frame(1))
    np.testing.assert_array_equal(paths.flags, rows["flags"])
    assert paths.counts.mixed == 3


def test_unknown_groups_and_columns_are_ignored(run: Path) -> None:
    frame = open_run(run).frame(1)
    before = frame_paths(frame)
    rows = open_frame_table(frame.path, 1)[1]
    more = {"scatter_class": np.ones(rows.size, "u1"), "normal": np.ones((rows.size, 3), "f4")}
    wide = more | columns_of(rows)
    extra = contract.ColumnGroupRecord(7, [contract.ColumnRecord("normal", "<f4", "1", "?", [3])])
    replace_table(run, wide, column_groups={"scattering": extra, **COLUMN_GROUPS})
    _, table = open_frame_table(frame.path, 1)
    assert table.names == PATH_DTYPE.names
    after = frame_paths(frame)
    for name, column in arrays(before).items():
        np.testing.assert_array_equal(arrays(after)[name], column)


@pytest.mark.parametrize("group", list(COLUMN_GROUPS))
def test_a_missing_group_is_named(run: Path, group: str) -> None:
    frame = run / contract.frame_dir(1)
    rows = open_frame_table(frame, 1)[1].copy()
    listed = {name: columns for name, columns in COLUMN_GROUPS.items() if name != group}
    replace_table(run, columns_of(rows, group), column_groups=listed)
    with pytest.raises(FrameFileError, match=f"'{group}': its sidecar does not list it"):
        open_frame_table(frame, 1)
    with pytest.raises(FrameFileError, match=f"'{group}': the column .* is missing"):
        open_table(frame / contract.PATHS_TABLE)
    table = open_table(frame / contract.PATHS_TABLE, listed, needed=listed)
    assert table.names == tuple(columns_of(rows, group))


def test_groups_of_another_version_are_not_read(run: Path) -> None:
    later = dict(COLUMN_GROUPS, motion=dataclasses.replace(COLUMN_GROUPS["motion"], version=2))
    frame = run / contract.frame_dir(1)
    rows = open_frame_table(frame, 1)[1].copy()
    replace_table(run, columns_of(rows), column_groups=later)
    with pytest.raises(FrameFileError, match=r"'motion': it is of version 2, .* version 1"):
        open_frame_table(frame, 1)
    others = [name for name in COLUMN_GROUPS if name != "motion"]
    table = open_table(frame / contract.PATHS_TABLE, later, others)
    assert "last_body" not in table.names
    np.testing.assert_array_equal(table["length_m"], rows["length_m"])


def test_columns_of_another_type_are_refused(tmp_path: Path) -> None:
    columns = columns_of(random_rows(3))
    columns["length_m"] = columns["length_m"].astype("f4")
    np.savez(tmp_path / "paths.npz", **columns)  # type: ignore[arg-type]
    with pytest.raises(FrameFileError, match=r"'length_m' is float32 .*, expected <f8"):
        open_table(tmp_path / "paths.npz")


@pytest.mark.skipif(sys.platform == "win32", reason="files are not sparse unless asked for")
def test_more_rows_than_32_bits_count(run: Path, tmp_path: Path) -> None:
    """A sparse file of 2^31 + 5 rows: the last ones are found, and numbered."""
    path = tmp_path / "paths.npz"
    last = random_rows(2)
    last["flags"] = 0
    last["order"], last["last_body"], last["last_surface_point"] = 1, 0, 0
    rows, first = 2**31 + 5, 2**31 + 3
    members = table_module._members(PATH_DTYPE, rows)
    with open(path, "wb") as stream:
        for member in members:
            stream.seek(member.offset)
            stream.write(member.header)
            stream.seek(member.start + first * PATH_DTYPE[member.name].itemsize)
            stream.write(np.ascontiguousarray(last[member.name]).tobytes())
        table_module._write_directory(stream, members, [0] * len(members))
    table = open_table(path)
    assert table.size == rows
    np.testing.assert_array_equal(table[first:]["length_m"], last["length_m"])
    record, _ = open_frame_table(run / contract.frame_dir(1), 1)
    (paths,) = table_paths(record, table[first:], None, first_row=first)
    assert paths.row.tolist() == [2**31 + 3, 2**31 + 4]
    np.testing.assert_array_equal(table[paths.row]["length_m"], last["length_m"])


def some_paths(count: int, seed: int, *, full: bool = True) -> Paths:
    """Paths with random numbers in every column."""
    rng = np.random.default_rng(seed)

    def real(*shape: int) -> np.ndarray:
        return rng.normal(size=(count, *shape))

    def whole() -> np.ndarray:
        return rng.integers(0, 9, count)

    paths = make_paths(real(), real(), real(), real())
    if not full:
        return paths
    floor = contract.ImageRecord([[0.0, 0.0, 1.0]], [-1.0], ["Floor"])
    images = PathImages.of([floor], rng.integers(0, 2, (count, 2)))
    geometry = PathGeometry(whole(), whole(), real(3), real(3), real(3), whole(), whole(), images)
    return dataclasses.replace(
        paths,
        **{name: whole() for name in ("ring", "row", "col")},
        flags=rng.integers(0, 128, count).astype(np.uint16),
        geometry=geometry,
        motion=LinearMotion(real(), real()),
        gain=real(),
        phasors=real() + 1j * real(),
        mirror_phase_rad=real(),
    )


@pytest.mark.parametrize(
    "rows",
    [slice(2, 7), slice(None, None, -2), np.arange(10) % 3 == 0, np.array([7, 1, 1]), [4, 0]],
)
def test_all_columns_are_selected_alike(rows: Any) -> None:
    paths = some_paths(10, 1)
    assert all(value is not None for value in vars(paths).values())
    for chosen in (paths.select(rows), paths[rows]):
        for name, column in arrays(paths).items():
            np.testing.assert_array_equal(arrays(chosen)[name], column[rows])
        times_s = np.array([0.0, 2.0])
        np.testing.assert_array_equal(
            chosen.lengths.lengths_m(times_s, slice(None)),
            paths.lengths.lengths_m(times_s, slice(None))[rows],
        )
        assert chosen.counts.paths == len(chosen)
        assert chosen.counts.mixed == np.count_nonzero(paths.flags[rows] & PathFlag.MIXED)
        crossed = np.count_nonzero(paths.flags[rows] & PathFlag.CROSSED_SHELL)
        assert chosen.counts.crossed_shell == crossed


def test_a_single_number_is_no_selection() -> None:
    with pytest.raises(TypeError, match="expected a slice"):
        some_paths(3, 1)[1]  # type: ignore[index]


def test_join_undoes_slicing() -> None:
    paths = some_paths(10, 2)
    whole = Paths.join([paths[:4], paths[4:4], paths[4:]])
    for name, column in arrays(paths).items():
        np.testing.assert_array_equal(arrays(whole)[name], column)
    times_s = np.array([0.0, 2.0])
    np.testing.assert_array_equal(
        whole.lengths.lengths_m(times_s, slice(None)), paths.lengths.lengths_m(times_s, slice(None))
    )
    assert whole.counts == paths[:].counts


def test_images_are_joined_with_paths_without() -> None:
    over, whole = some_paths(4, 5), some_paths(3, 6)
    assert over.geometry is not None
    assert whole.geometry is not None
    straight = dataclasses.replace(whole, geometry=dataclasses.replace(whole.geometry, images=None))
    both = Paths.join([straight, over])[2:6]
    assert both.geometry is not None
    assert both.geometry.images is not None
    expected = over.geometry.images.numbers[:3]
    np.testing.assert_array_equal(both.geometry.images.numbers, [[0, 0], *expected])
    point_m = np.array([1.0, 2.0, 3.0])
    places = both.geometry.images.places(1, point_m)
    lowered = np.where(expected[:, 1] > 0, -5.0, 3.0)  # over the floor at z = -1
    np.testing.assert_allclose(places[:, 2], [3.0, *lowered])


def test_join_fills_what_one_part_does_not_have() -> None:
    full, plain = some_paths(3, 3), some_paths(2, 4, full=False)
    both = Paths.join([plain, full])
    assert both.geometry is None
    assert both.gain is not None
    assert both.phasors is not None
    assert full.gain is not None
    np.testing.assert_array_equal(both.gain, [1, 1, *full.gain])
    assert np.isnan(both.phasors[:2]).all()
    np.testing.assert_array_equal(both.phasors[2:], full.phasors)
    assert both.mirror_phase_rad is not None
    assert both.mirror_phase_rad[:2].tolist() == [0, 0]
    moved = both.lengths.lengths_m(np.array([1.0]), slice(None))[:2, 0]
    np.testing.assert_array_equal(moved, plain.length_m + 2 * plain.range_rate_mps)
    again = Paths.join([plain, plain])
    assert (again.gain, again.phasors, again.motion) == (None, None, None)
