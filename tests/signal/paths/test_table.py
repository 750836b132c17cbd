# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of paths on disk: round trip, parts, and every way in which a file can be wrong."""

from __future__ import annotations

import io
import threading
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.errors import FrameFileError, OutputError
from radarsim_addon.signal.paths import (
    PATH_DTYPE,
    PathRows,
    TableFile,
    iter_rows,
    table,
    write_table,
)
from radarsim_addon.signal.paths.table import MAX_ROWS, open_table
from radarsim_addon.typed_json import file_sha256


def random_rows(count: int, seed: int = 0) -> PathRows:
    """Rows of random numbers in every column, some of them NaN."""
    rng = np.random.default_rng(seed)
    rows = np.zeros(count, dtype=PATH_DTYPE)
    for name in PATH_DTYPE.names or ():
        column = rows[name]
        if column.dtype.kind == "f":
            rows[name] = rng.normal(size=column.shape)
        else:
            rows[name] = rng.integers(0, 1000, column.shape)
    rows["first_scatterer_m"][::3] = np.nan
    return rows


@pytest.mark.parametrize("sizes", [(), (0,), (1,), (3, 0, 5), (1000, 1, 999)])
def test_round_trip(tmp_path: Path, sizes: tuple[int, ...]) -> None:
    """Whatever the parts, numpy reads one array of all rows, and so do we."""
    path = tmp_path / "paths.npy"
    parts = [random_rows(size, seed) for seed, size in enumerate(sizes)]
    written = write_table(path, iter(parts))
    assert written == TableFile(sum(sizes), file_sha256(path))
    assert write_table(path, iter(parts), rows=sum(sizes)) == written
    want = np.concatenate([np.empty(0, PATH_DTYPE), *parts])
    for found in (open_table(path), np.load(path, allow_pickle=False)):
        assert found.dtype == PATH_DTYPE
        assert found.tobytes() == want.tobytes()
    if sum(sizes):  # an empty file cannot be mapped
        assert np.load(path, mmap_mode="r").shape == (sum(sizes),)
    assert list(tmp_path.iterdir()) == [path]


def test_chunks_cover_the_table(tmp_path: Path) -> None:
    path = tmp_path / "paths.npy"
    rows = random_rows(1003)
    write_table(path, [rows])
    chunks = list(iter_rows(open_table(path), 100))
    assert [chunk.size for chunk in chunks] == [100] * 10 + [3]
    assert np.concatenate(chunks).tobytes() == rows.tobytes()


def test_parts_are_streamed(tmp_path: Path) -> None:
    """Sixty parts of 4 MB are written and read with the memory of two."""
    part = random_rows(4_000_000 // PATH_DTYPE.itemsize)

    def parts() -> Iterator[PathRows]:
        for _ in range(60):
            yield part.copy()

    path = tmp_path / "paths.npy"
    tracemalloc.start()
    try:
        count = write_table(path, parts()).rows
        total = sum(float(chunk["power_w"].sum()) for chunk in iter_rows(open_table(path), 10_000))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert count == 60 * part.size
    assert total == pytest.approx(60 * part["power_w"].sum())
    assert peak < 4 * part.nbytes


def test_a_failing_part_leaves_nothing(tmp_path: Path) -> None:
    """An earlier table stays as it was, and no half-written one beside it."""
    path = tmp_path / "paths.npy"
    write_table(path, [random_rows(5)])
    before = path.read_bytes()

    def parts() -> Iterator[PathRows]:
        yield random_rows(7)
        raise RuntimeError("the render failed")

    with pytest.raises(RuntimeError, match="the render failed"):
        write_table(path, parts())
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_the_disk_takes_large_tables_while_they_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Table and digest are those of one that is written at once; a full disk is a named error."""
    path, part, meanwhile = tmp_path / "paths.npy", random_rows(50), list[int]()
    at_once = write_table(path, [part] * 6, rows=300)
    whole = path.read_bytes()

    def sync(descriptor: int) -> None:
        if threading.current_thread() is not threading.main_thread():
            meanwhile.append(descriptor)
            if fault:
                raise fault

    fault: OSError | None = None
    monkeypatch.setattr(table, "_SYNC_EVERY", 100 * PATH_DTYPE.itemsize)
    monkeypatch.setattr("os.fsync", sync)
    assert write_table(path, [part] * 6, rows=300) == at_once
    assert path.read_bytes() == whole
    assert 1 <= len(meanwhile) <= 3
    fault = OSError(28, "No space left on device")
    with pytest.raises(OutputError, match="No space"):
        write_table(path, [part] * 6, rows=300)
    assert path.read_bytes() == whole
    assert list(tmp_path.iterdir()) == [path]


def test_fewer_rows_than_told_leave_no_table(tmp_path: Path) -> None:
    """Its header would claim rows that are not there."""
    with pytest.raises(AssertionError, match="7 rows; expected 8"):
        write_table(tmp_path / "paths.npy", [random_rows(7)], rows=8)
    assert not list(tmp_path.iterdir())


def test_rows_of_other_columns_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="PATH_DTYPE"):
        write_table(tmp_path / "paths.npy", [np.zeros(3)])  # type: ignore[list-item]
    assert list(tmp_path.iterdir()) == []


def test_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="Cannot write"):
        write_table(tmp_path / "no" / "paths.npy", [random_rows(1)])


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(FrameFileError, match="missing"):
        open_table(tmp_path / "paths.npy")


def test_truncation_is_found_at_any_place(tmp_path: Path) -> None:
    path = tmp_path / "paths.npy"
    write_table(path, [random_rows(40)])
    whole = path.read_bytes()
    for size in [*range(0, 600, 7), len(whole) // 2, len(whole) - 1]:
        path.write_bytes(whole[:size])
        with pytest.raises(FrameFileError):
            open_table(path)
    path.write_bytes(whole + b"\0")
    with pytest.raises(FrameFileError, match="rows take"):
        open_table(path)


def npy_bytes(array: np.ndarray, allow_pickle: bool = False) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=allow_pickle)
    return stream.getvalue()


@pytest.mark.parametrize(
    "content",
    [
        b"not a table at all",
        npy_bytes(np.zeros(10)),
        npy_bytes(np.zeros((3, 4), dtype=PATH_DTYPE)),
        npy_bytes(np.zeros(4, dtype=PATH_DTYPE.descr[:-1])),
        npy_bytes(np.array([{"a": 1}], dtype=object), allow_pickle=True),
        b"\x93NUMPY\x01\x00\xff\xff" + b"{" * 65535,
        b"\x93NUMPY\x01\x00\x20\x00" + b"('" * 16,
        b"\x93NUMPY\x09\x00\x10\x00" + b" " * 16,
    ],
    ids=["text", "floats", "two axes", "a column less", "pickle", "braces", "open", "version"],
)
def test_foreign_files_are_named_errors(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "paths.npy"
    path.write_bytes(content)
    with pytest.raises(FrameFileError, match=r"paths\.npy"):
        open_table(path)


def test_huge_and_negative_counts_allocate_nothing(tmp_path: Path) -> None:
    """A header that claims more rows than there are must not make numpy ask for them."""
    path = tmp_path / "paths.npy"
    write_table(path, [random_rows(3)])
    whole = path.read_bytes()
    length = int.from_bytes(whole[8:10], "little")
    for claim in ("10", f"{MAX_ROWS}", f"{2**62}", "9" * 30, "-1", "True", "2.5", "None"):
        header = whole[10 : 10 + length].replace(b"(3,)", f"({claim},)".encode())
        size = len(header).to_bytes(2, "little")
        path.write_bytes(whole[:8] + size + header + whole[10 + length :])
        with pytest.raises(FrameFileError):
            open_table(path)


def test_no_damage_of_the_header_escapes(tmp_path: Path) -> None:
    """Any byte of the header changed: a named error, or (in the padding) the same rows."""
    path = tmp_path / "paths.npy"
    rows = random_rows(3)
    write_table(path, [rows])
    whole = path.read_bytes()
    header = len(whole) - rows.nbytes
    rng = np.random.default_rng(1)
    for place in range(0, header, 2):
        for value in (*b"\0'(}#9", int(rng.integers(256))):
            damaged = bytearray(whole)
            damaged[place] = value
            path.write_bytes(damaged)
            try:
                found = open_table(path)
            except FrameFileError:
                continue
            assert found.dtype == PATH_DTYPE
            assert found.tobytes() == rows.tobytes()
