# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes of files that a user, a program or a disk could make; all from one generator."""

from __future__ import annotations

import csv
import io
import json
import random
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy_format

NUMBERS: list[Any] = [
    0, -0.0, 1, -1, 2, 3, 0.1, 400, 4194304, 9e18, 1e-12, 1e-30, 1e-300, 5e-324, 1e6, 1e9, 8e9,
    1e12, 1e20, 1e38, 1e154, 1e300, 1.7e308, -1e308, 2**31, 2**32 + 1, 2**53 + 1, 2**63, 2**64,
    -(2**31), 10**30, 10**400, float("nan"), float("inf"), float("-inf"),
]  # fmt: skip
TEXTS = [
    "", "a", "x" * 1_000_000, "../../no/such", "/dev/zero", "\x1b[2Jgone", "\ud800", "a\0b",
    "nan", "1e9", "-1", "paths", "rings", "equirectangular", "orthographic", "fmcw", "lfm", "pmcw",
    "stepped", "barker", "arbitrary", "array", "table", "gaussian", "\u202etxt", "{}", "%s%n",
]  # fmt: skip
OTHERS: list[Any] = [None, True, False, [], {}, [[]], [1, 2, 3], {"a": 1}, [0.0] * 1000]


def value(rng: random.Random, before: Any = None) -> Any:
    """Another value in the place of one."""
    if isinstance(before, int | float) and not isinstance(before, bool) and rng.random() < 0.4:
        scaled = before * 10.0 ** rng.randint(-15, 15) * rng.choice([1, 1, -1])
        whole = isinstance(before, int) and abs(scaled) < 1e300 and rng.random() < 0.9
        return int(scaled) if whole else scaled
    return rng.choice(rng.choice([NUMBERS, NUMBERS, TEXTS, OTHERS]))


def _places(data: Any) -> list[tuple[Any, Any]]:
    """Every container in parsed JSON, with each of its keys."""
    found = []
    items: Any = data.items() if isinstance(data, dict) else enumerate(data)
    for key, item in list(items):
        found.append((data, key))
        if isinstance(item, dict | list):
            found += _places(item)
    return found


def _change(rng: random.Random, data: Any) -> None:
    """One change somewhere in parsed JSON."""
    places = _places(data)
    if not places:
        return
    owner, key = rng.choice(places)
    what = rng.randrange(10)
    if what < 6:
        owner[key] = value(rng, owner[key])
    elif what == 6:
        del owner[key]
    elif what == 7:
        other, place = rng.choice(places)
        owner[key] = json.loads(json.dumps(other[place]))
    elif isinstance(owner, dict):
        owner[rng.choice([*TEXTS, *owner])] = value(rng)
    elif len(owner) < 5000:
        owner.extend(owner * rng.choice([1, 1, 20]))


def change_json(rng: random.Random, path: Path) -> None:
    """Other values, lost and unknown keys, other lengths of lists, deep nesting."""
    data = json.loads(path.read_text("utf-8"))
    if rng.random() < 0.02:
        path.write_text("[" * 200_000 + "]" * rng.choice([0, 200_000]))
        return
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        if isinstance(data, dict | list):
            _change(rng, data)
    text = json.dumps(data, ensure_ascii=rng.random() < 0.9)
    if rng.random() < 0.02:
        text = text.replace("1", "9" * 5000, 1)
    path.write_bytes(text.encode("utf-8", "surrogatepass"))


def change_bytes(rng: random.Random, path: Path) -> None:
    """Flipped, lost, repeated and foreign bytes; an empty file, a folder, no file."""
    data = bytearray(path.read_bytes())
    what, at = rng.randrange(10), rng.randrange(len(data) + 1)
    if what < 4:
        for _ in range(rng.choice([1, 1, 3, 30])):
            place = rng.randrange(len(data))
            data[place] ^= 1 << rng.randrange(8)
    elif what < 6:
        del data[at:]
    elif what == 6:
        data[at:at] = rng.randbytes(rng.choice([1, 8, 1000]))
    elif what == 7:
        data[at : at + 64] = bytes(min(64, len(data) - at))
    elif what == 8:
        data += data[-1000:] * rng.choice([1, 50])
    path.unlink()
    if what == 9 and rng.random() < 0.7:
        what = rng.randrange(3)
        if what < 2:
            (path.touch, path.mkdir)[what]()
        return
    path.write_bytes(data)


def _spoil(rng: random.Random, array: Any) -> Any:
    """An array with other values, another shape or another type."""
    array = np.array(array)
    what = rng.randrange(8)
    if array.dtype.names:
        name = rng.choice(array.dtype.names)
        array[name] = _spoil_values(rng, array[name])
    elif what < 5:
        array = _spoil_values(rng, array)
    elif what == 5:
        array = array.reshape(-1)[: rng.randrange(array.size + 1)]
    elif what == 6:
        array = np.zeros(rng.choice([(0,), (), (1, 1, 1, 1), (10**6,)]), array.dtype)
    else:
        array = array.astype(rng.choice(["U8", "f2", "i1", "c16", "?"]))
    return array


def _spoil_values(rng: random.Random, array: Any) -> Any:
    flat = array.copy().reshape(-1)
    if flat.size:
        chosen = slice(None) if rng.random() < 0.3 else rng.randrange(flat.size)
        number = rng.choice([*NUMBERS[:-4], np.nan, np.inf])
        with np.errstate(all="ignore"):
            if flat.dtype.kind in "iu":
                ends = np.iinfo(flat.dtype)
                number = min(max(int(np.nan_to_num(float(number))), ends.min), ends.max)
            flat[chosen] = number
    return flat.reshape(array.shape)


#: Shapes in headers that numpy's parser, or an allocation, cannot take.
SHAPES = [
    "(" * 150 + "3," + ")" * 150, "(" * 4000, "(3\0,)", "(10**9,)", f"({10**20},)",
    f"({10**20}, 0)", "(-3,)", "(True,)", "(3.0,)", "3", "('3',)", "{}", "-" * 5000 + "3",
]  # fmt: skip


def _strange_npy(rng: random.Random, array: Any) -> bytes:
    """An array whose header was written by hand."""
    descr = npy_format.dtype_to_descr(np.asarray(array).dtype)
    text = f"{{'descr': {descr!r}, 'fortran_order': False, 'shape': {rng.choice(SHAPES)}, }}\n"
    head = text.encode("latin1")
    version = rng.choice([b"\x01\x00", b"\x01\x00", b"\x02\x00", b"\x03\x00", b"\x09\x00"])
    length = len(head).to_bytes(2 if version[0] == 1 else 4, "little")
    return b"\x93NUMPY" + version + length + head + np.asarray(array).tobytes()


def change_npy(rng: random.Random, path: Path) -> None:
    """Other values, other columns, more rows claimed than there are, strange headers."""
    array = np.load(path)
    if rng.random() < 0.7:
        if rng.random() < 0.2:
            array = np.repeat(array[:1], rng.choice([0, 1, 3]))
        np.save(path, _spoil(rng, array))
        return
    if rng.random() < 0.5:
        path.write_bytes(_strange_npy(rng, array))
        return
    header = npy_format.header_data_from_array_1_0(array)
    header["shape"] = rng.choice(
        [(2**31,), (10**12,), (2**62,), (-1,), (array.size + 1,), (2, 2), ()]
    )
    if rng.random() < 0.3:
        header["descr"] = rng.choice(["|O", "<f8", "<U1000000", "|V0", "<M8[s]"])
    stream = io.BytesIO()
    npy_format.write_array_header_1_0(stream, header)
    path.write_bytes(stream.getvalue() + array.tobytes())


def change_npz(rng: random.Random, path: Path) -> None:
    """Other arrays, lost arrays, strange headers, archives that unpack to gigabytes."""
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    name = rng.choice(list(arrays))
    if rng.random() < 0.25:
        _strange_npz(rng, path, arrays, name)
        return
    if rng.random() < 0.2:
        del arrays[name]
    else:
        arrays[name] = _spoil(rng, arrays[name])
    (np.savez_compressed if rng.random() < 0.3 else np.savez)(path, **arrays)


def _strange_npz(rng: random.Random, path: Path, arrays: dict[str, Any], name: str) -> None:
    """One array has a strange header, or is followed by 600 MB of zeros."""
    bomb = rng.random() < 0.2
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for key, array in arrays.items():
            with archive.open(f"{key}.npy", "w") as stream:
                if key == name and not bomb:
                    stream.write(_strange_npy(rng, array))
                    continue
                npy_format.write_array(stream, np.asarray(array))
                for _ in range(600 if key == name else 0):
                    stream.write(bytes(10**6))


def change_exr(rng: random.Random, path: Path) -> None:
    """Other pixels or channels, in a file that is whole."""
    from radarsim_addon.signal.runs import read_exr, write_exr

    images: dict[str, Any] = dict(read_exr(path))
    name = rng.choice(list(images))
    if rng.random() < 0.1:
        del images[name]
    elif rng.random() < 0.1:
        images = {key: plane[:1] for key, plane in images.items()}
    else:
        with np.errstate(all="ignore"):
            images[name] = _spoil_values(rng, images[name])
    write_exr(path, images)


def change_csv(rng: random.Random, path: Path) -> None:
    """Other cells, lines and separators."""
    rows = list(csv.reader(path.read_text("utf-8").splitlines()))
    for _ in range(rng.choice([1, 1, 3])):
        row = rng.choice(rows)
        if row:
            row[rng.randrange(len(row))] = str(value(rng))[: rng.choice([100_000, 200_000])]
    if rng.random() < 0.2:
        rows += [rng.choice(rows)] * rng.choice([1, 20_000])
    if rng.random() < 0.2:
        rng.shuffle(rows)
    text = "\n".join(rng.choice([",", ",", ",", ";"]).join(row) for row in rows)
    path.write_bytes(text.encode("utf-8", "surrogatepass"))


BY_SUFFIX: dict[str, Callable[[random.Random, Path], None]] = {
    ".json": change_json,
    ".npy": change_npy,
    ".npz": change_npz,
    ".exr": change_exr,
    ".csv": change_csv,
}


def change_file(rng: random.Random, path: Path, within: Path) -> None:
    """One change of a file: of its content as its kind has it, or of its bytes.

    Words of a command line may name any file of the machine: nothing outside `within` is touched.
    """
    if not path.resolve().is_relative_to(within.resolve()):
        raise ValueError(f"{path} is not in {within}")
    if path.is_file() and path.stat().st_size:
        try:
            if rng.random() < 0.8:
                BY_SUFFIX[path.suffix](rng, path)
                return
        except Exception:  # it was changed before, and cannot be read any more
            pass
        if path.is_file() and path.stat().st_size:
            change_bytes(rng, path)
