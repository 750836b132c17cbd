# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of paths on disk: round trip, parts, and every way in which a file can be wrong."""

from __future__ import annotations

import hashlib
import io
import itertools
import threading
import tracemalloc
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon.errors import FrameFileError, OutputError
from radarsim_addon.signal.paths import (
    IMAGE_DTYPE,
    PATH_DTYPE,
    PathRows,
    has_digests,
    iter_rows,
    table,
    write_table,
)
from radarsim_addon.signal.paths.table import open_table


def random_rows(count: int, seed: int = 0) -> PathRows:
    """Rows of random numbers in every column, some of them NaN."""
    rng = np.random.default_rng(seed)
    rows = PathRows.zeros(count)
    for name in rows.names:
        column = rows[name]
        if column.dtype.kind == "f":
            rows[name] = rng.normal(size=column.shape)
        else:
            rows[name] = rng.integers(0, 1000, column.shape)
    rows["first_scatterer_m"][::3] = np.nan
    return rows


@pytest.mark.parametrize("sizes", [(), (0,), (1,), (3, 0, 5), (1000, 1, 999)])
def test_round_trip(tmp_path: Path, sizes: tuple[int, ...]) -> None:
    """Whatever the parts, numpy reads the columns of all rows, and so do we."""
    path = tmp_path / "paths.npz"
    parts = [random_rows(size, seed) for seed, size in enumerate(sizes)]
    written = write_table(path, iter(parts), sum(sizes))
    want = PathRows.joined([PathRows.zeros(0), *parts])
    table = open_table(path)
    assert table.dtype == PATH_DTYPE and table.equals(want)
    assert written.rows == table.size == sum(sizes)
    assert has_digests(table, written.column_sha256)
    with np.load(path, allow_pickle=False) as archive:
        assert archive.files == list(PATH_DTYPE.names or ())
        for name in archive.files:
            assert archive[name].tobytes() == want[name].tobytes()
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        assert all(item.compress_type == zipfile.ZIP_STORED for item in archive.infolist())
    assert list(tmp_path.iterdir()) == [path]


def test_columns_are_aligned(tmp_path: Path) -> None:
    write_table(tmp_path / "paths.npz", [random_rows(3)], 3)
    table = open_table(tmp_path / "paths.npz")
    assert all(table[name].flags.aligned and table[name].flags.c_contiguous for name in table.names)


@pytest.mark.parametrize("name", PATH_DTYPE.names or ())
def test_a_changed_number_has_another_digest(tmp_path: Path, name: str) -> None:
    path, rows = tmp_path / "paths.npz", random_rows(9)
    written = write_table(path, [rows], 9)
    rows[name][4] = 3
    write_table(path, [rows], 9)
    table = open_table(path)
    assert not has_digests(table, written.column_sha256)
    own = hashlib.sha256(table[name].tobytes()).hexdigest()
    assert has_digests(table, {**written.column_sha256, name: own})


def test_chunks_cover_the_table(tmp_path: Path) -> None:
    path = tmp_path / "paths.npz"
    rows = random_rows(1003)
    write_table(path, [rows], 1003)
    chunks = list(iter_rows(open_table(path), 100))
    assert [chunk.size for chunk in chunks] == [100] * 10 + [3]
    assert PathRows.joined(chunks).equals(rows)


def test_parts_are_streamed(tmp_path: Path) -> None:
    """Sixty parts of 4 MB are written and read with the memory of two."""
    part = random_rows(4_000_000 // PATH_DTYPE.itemsize)

    def parts() -> Iterator[PathRows]:
        for _ in range(60):
            yield part.copy()

    path = tmp_path / "paths.npz"
    tracemalloc.start()
    try:
        count = write_table(path, parts(), 60 * part.size).rows
        total = sum(float(chunk["power_w"].sum()) for chunk in iter_rows(open_table(path), 10_000))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert count == 60 * part.size
    assert total == pytest.approx(60 * part["power_w"].sum())
    assert peak < 4 * part.nbytes


def test_a_failing_part_leaves_nothing(tmp_path: Path) -> None:
    """An earlier table stays as it was, and no half-written one beside it."""
    path = tmp_path / "paths.npz"
    write_table(path, [random_rows(5)], 5)
    before = path.read_bytes()

    def parts() -> Iterator[PathRows]:
        yield random_rows(7)
        raise RuntimeError("the render failed")

    with pytest.raises(RuntimeError, match="the render failed"):
        write_table(path, parts(), 14)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_the_disk_takes_large_tables_while_they_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Table and digests are those of one that is written at once; a full disk is a named error."""
    path, part, meanwhile = tmp_path / "paths.npz", random_rows(50), list[int]()
    at_once = write_table(path, [part] * 6, 300)
    whole = path.read_bytes()

    def sync(descriptor: int) -> None:
        if threading.current_thread() is not threading.main_thread():
            meanwhile.append(descriptor)
            if fault:
                raise fault

    fault: OSError | None = None
    monkeypatch.setattr(table, "_SYNC_EVERY", 100 * PATH_DTYPE.itemsize)
    monkeypatch.setattr("os.fsync", sync)
    assert write_table(path, [part] * 6, 300) == at_once
    assert path.read_bytes() == whole
    assert 1 <= len(meanwhile) <= 3
    fault = OSError(28, "No space left on device")
    with pytest.raises(OutputError, match="No space"):
        write_table(path, [part] * 6, 300)
    assert path.read_bytes() == whole
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("told", [8, 6])
def test_another_number_of_rows_than_told_leaves_no_table(tmp_path: Path, told: int) -> None:
    with pytest.raises(AssertionError, match=f"7 rows; expected {told}"):
        write_table(tmp_path / "paths.npz", [random_rows(7)], told)
    assert not list(tmp_path.iterdir())


def test_rows_of_other_columns_are_refused(tmp_path: Path) -> None:
    for other in (np.zeros(3), PathRows.zeros(3, IMAGE_DTYPE)):
        with pytest.raises(TypeError, match="PATH_DTYPE"):
            write_table(tmp_path / "paths.npz", [other], 3)  # type: ignore[list-item]
    assert list(tmp_path.iterdir()) == []


def test_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="Cannot write"):
        write_table(tmp_path / "no" / "paths.npz", [random_rows(1)], 1)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(FrameFileError, match="missing"):
        open_table(tmp_path / "paths.npz")


def test_truncation_is_found_at_any_place(tmp_path: Path) -> None:
    path = tmp_path / "paths.npz"
    write_table(path, [random_rows(40)], 40)
    whole = path.read_bytes()
    for size in [*range(0, 600, 7), len(whole) // 2, *range(len(whole) - 300, len(whole), 7)]:
        path.write_bytes(whole[:size])
        with pytest.raises(FrameFileError):
            open_table(path)


def columns_of(rows: PathRows) -> dict[str, np.ndarray]:
    return {name: np.ascontiguousarray(rows[name]) for name in rows.names}


def archive_of(**changes: Any) -> bytes:
    """An archive of numpy's of four rows, with other columns in place of some; None: without."""
    columns = columns_of(random_rows(4)) | changes
    stream = io.BytesIO()
    np.savez(stream, **{k: v for k, v in columns.items() if v is not None})
    return stream.getvalue()


def compressed() -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, **columns_of(random_rows(4)))  # type: ignore[arg-type]
    return stream.getvalue()


def npy_bytes(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"not a table at all", "not a zip file"),
        (b"", "not a zip file"),
        (npy_bytes(np.zeros(10)), "not a zip file"),
        (compressed(), "compressed"),
        (archive_of(power_w=np.zeros((4, 4, 4))), "shape"),
        (archive_of(power_w=np.float64(1)), "shape"),
        (archive_of(direction=np.zeros((4, 3), order="F")), "shape"),
        (archive_of(power_w=np.zeros(5)), r"rows"),
        (archive_of(flags=None), "'flags' is missing"),
        (archive_of(direction=np.zeros((4, 2))), "'direction' is float64 of shape"),
        (archive_of(note=np.array([{"a": 1}] * 4, dtype=object)), "Python objects"),
    ],
)
def test_foreign_files_are_named_errors(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "paths.npz"
    path.write_bytes(content)
    with pytest.raises(FrameFileError, match=rf"paths\.npz .*{said}"):
        open_table(path)


def test_huge_and_negative_counts_allocate_nothing(tmp_path: Path) -> None:
    """A header that claims more rows than there are must not make numpy ask for them."""
    path = tmp_path / "paths.npz"
    write_table(path, [random_rows(3)], 3)
    whole = path.read_bytes()
    for claim in ("9,", "-1,", "3.5,", "()", "0,", "4, 2", "9" * 12 + ","):
        header = f"({claim})".encode()
        place = whole.index(b"(3,)")
        end = whole.index(b"\n", place)
        text = (header + whole[place + 4 : end]).ljust(end - place)[: end - place]
        path.write_bytes(whole[:place] + text + whole[end:])
        with pytest.raises(FrameFileError):
            open_table(path)


def test_no_damage_of_a_header_escapes(tmp_path: Path) -> None:
    """Any byte outside the numbers changed: a named error, or the same rows."""
    path = tmp_path / "paths.npz"
    rows = random_rows(3)
    written = write_table(path, [rows], 3)
    whole = path.read_bytes()
    members = table._members(PATH_DTYPE, 3)
    places = [*range(members[0].start), *range(members[-1].start + members[-1].size, len(whole))]
    rng = np.random.default_rng(1)
    values = itertools.cycle(b"\0'(}#9")  # the headers of the columns are alike
    for place in places[::2]:
        for value in (next(values), next(values), int(rng.integers(256))):
            damaged = bytearray(whole)
            damaged[place] = value
            path.write_bytes(damaged)
            try:
                found = open_table(path)
            except FrameFileError:
                continue
            assert found.dtype == PATH_DTYPE
            assert found.equals(rows) or not has_digests(found, written.column_sha256)
