# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays from files: the numbers of numpy's own reader, and named refusals of all else."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.lib import format as npy_format

from radarsim_addon import arrays
from radarsim_addon.arrays import read_header, read_npy, read_npz

ROWS = np.array([(1, 2.5, b"a"), (2, -0.5, b"bc")], dtype=[("n", "<i4"), ("x", ">f8"), ("s", "S3")])
ARRAYS = {
    "plain": np.arange(6.0).reshape(2, 3),
    "fortran": np.asfortranarray(np.arange(24, dtype=np.int16).reshape(2, 3, 4)),
    "empty": np.zeros((0, 3), np.float32),
    "scalar": np.array(3 + 4j),
    "rows": ROWS,
    "text": np.array(["metre", "ä"]),
    "nothing": np.zeros(3, "V0"),
}


def with_header(shape: str, descr: str = "<f8", version: int = 1) -> bytes:
    text = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n".encode("latin1")
    length = len(text).to_bytes(2 if version == 1 else 4, "little")
    return b"\x93NUMPY" + bytes([version, 0]) + length + text + bytes(24)


def archive_of(path: Path, members: dict[str, bytes], compression: int) -> Path:
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.npy", data)
    return path


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_are_those_of_numpy(tmp_path: Path, name: str) -> None:
    np.save(tmp_path / "a.npy", ARRAYS[name])
    found, expected = read_npy(tmp_path / "a.npy"), np.load(tmp_path / "a.npy")
    assert found.dtype == expected.dtype and found.shape == expected.shape
    assert found.tobytes() == expected.tobytes()
    found[...] = found  # it can be written to


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_archives_are_those_of_numpy(tmp_path: Path, save: Any) -> None:
    save(tmp_path / "a.npz", **ARRAYS)
    found = read_npz(tmp_path / "a.npz")
    assert list(found) == list(ARRAYS)
    for name, array in ARRAYS.items():
        assert found[name].dtype == array.dtype and found[name].shape == array.shape
        assert found[name].tobytes() == array.tobytes()
    assert list(read_npz(tmp_path / "a.npz", ["rows"])) == ["rows"]
    with pytest.raises(ValueError, match="absent is missing"):
        read_npz(tmp_path / "a.npz", ["rows", "absent"])


def test_a_second_version_of_the_format_is_read() -> None:
    stream = io.BytesIO()
    npy_format.write_array_header_2_0(
        stream, npy_format.header_data_from_array_1_0(ARRAYS["plain"])
    )
    stream.seek(0)
    assert read_header(stream) == ((2, 3), False, np.dtype("<f8"), 48)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "no header of an array"),
        (b"\x93NUMPY\x03\x00", "NPY format"),
        (with_header("(" * 4000), "no header of an array"),
        (with_header("(" * 12_000), "no header of an array"),
        (with_header("(3\0,)"), "no header of an array"),
        (with_header("-" * 5000 + "3"), "no header of an array"),
        (with_header("(3,)", descr="|O"), "Python objects"),
        (with_header("(True,)"), "whole numbers from 0"),
        (with_header("(-3,)"), "whole numbers from 0"),
        (with_header(f"({10**20},)"), "claims 8[0-9]+ bytes .* holds 24"),
        (with_header(f"({10**20}, 0)"), "claims 0 bytes"),
        (with_header("(4,)"), "claims 32 bytes .* holds 24"),
        (with_header("(3,)", version=2), ""),
    ],
)
def test_headers_that_cannot_be_are_refused(tmp_path: Path, data: bytes, message: str) -> None:
    (tmp_path / "a.npy").write_bytes(data)
    path = archive_of(tmp_path / "a.npz", {"x": data}, zipfile.ZIP_DEFLATED)
    if not message:
        assert read_npy(tmp_path / "a.npy").tolist() == [0.0, 0.0, 0.0]
        return
    with pytest.raises(ValueError, match=message):
        read_npy(tmp_path / "a.npy")
    with pytest.raises(ValueError, match=f"x: .*{message}"):
        read_npz(path)


def test_archives_that_unpack_to_more_than_they_may(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With compression up to a limit, without it up to the size of the file."""
    monkeypatch.setattr(arrays, "_MOST_COMPRESSED", 10_000)
    stream = io.BytesIO()
    np.save(stream, np.zeros(2000))
    members = {"x": stream.getvalue()}
    bomb = archive_of(tmp_path / "bomb.npz", members, zipfile.ZIP_DEFLATED)
    assert bomb.stat().st_size < 1000
    with pytest.raises(ValueError, match=r"16128 bytes .* in a file of \d+; .* at most 10000"):
        read_npz(bomb)
    whole = archive_of(tmp_path / "whole.npz", members, zipfile.ZIP_STORED)
    assert read_npz(whole)["x"].shape == (2000,)
    monkeypatch.setattr(arrays, "_MOST", 16_000)
    with pytest.raises(ValueError, match="at most 16000"):
        read_npz(whole)


def test_an_array_that_ends_early_is_refused(tmp_path: Path) -> None:
    stream = io.BytesIO()
    np.save(stream, np.zeros(100))
    path = archive_of(tmp_path / "a.npz", {"x": stream.getvalue()[:-8]}, zipfile.ZIP_STORED)
    with pytest.raises(ValueError, match="x: its header claims 800 bytes"):
        read_npz(path)
