# SPDX-License-Identifier: GPL-3.0-or-later
"""All numbers in the files of a run, each under the name of its file and its place in there.

Nothing of the package is imported: what is read must not depend on the version that is compared.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Values = NDArray[Any]


class Place(NamedTuple):
    """Where numbers come from: file relative to the case's folder, and the place in it.

    The key is a column, a dataset, a channel, or a path like ``objects[0].nearest_range_m``.
    """

    file: str
    key: str

    def __str__(self) -> str:
        return f"{self.file}: {self.key}" if self.key else self.file


#: Columns of a table of paths, as the checkout's own reader gives them.
COLUMNS_FILE = "path_columns.npz"
#: Files whose numbers are in other files too, or that hold none: their endings.
NOT_READ = {
    "paths.npy": f"table of paths; its columns are in {COLUMNS_FILE}",
    "paths.npz": f"table of paths; its columns are in {COLUMNS_FILE}",
    ".blend": "scene that a script built; what was measured of it is compared",
    ".png": "picture of numbers that are compared",
    ".gif": "picture of numbers that are compared",
}


def flatten_json(data: Any, key: str = "") -> Iterator[tuple[str, Values]]:
    """Numbers and texts of parsed JSON by their place; lists of numbers are one array each.

    Parameters
    ----------
    data
        What ``json.loads`` gives. null is NaN.
    key
        Place of `data`.

    Yields
    ------
    tuple
        Place, and the array there: numbers, truth values, or texts. Of a list of anything else
        the length is told too: one that grew would otherwise hold nothing but new names.
    """
    if isinstance(data, dict):
        for name, value in data.items():
            yield from flatten_json(value, f"{key}.{name}" if key else str(name))
        return
    if isinstance(data, list):
        whole = _as_array(data)
        if whole is not None:
            yield key, whole
            return
        yield f"{key}.length", np.array(len(data))
        for number, value in enumerate(data):
            yield from flatten_json(value, f"{key}[{number}]")
        return
    yield key, np.array(np.nan if data is None else data)


def _as_array(data: list[Any]) -> Values | None:
    """A list, or lists of equal lengths, of numbers; None where it is something else, or empty."""
    if not data:
        return None
    leaves: list[Any] = []

    def shape(item: Any) -> tuple[int, ...] | None:
        if not isinstance(item, list):
            leaves.append(item)
            return ()
        inner = {shape(part) for part in item}
        if len(inner) > 1 or None in inner:
            return None
        return (len(item), *(inner.pop() if inner else ()))

    found = shape(data)
    if found is None or not all(leaf is None or isinstance(leaf, int | float) for leaf in leaves):
        return None
    values = [np.nan if leaf is None else leaf for leaf in leaves]
    return np.array(values).reshape(found)


def _columns(name: str, values: Values) -> Iterator[tuple[str, Values]]:
    """Columns of a structured array, or the array itself."""
    if values.dtype.names is None:
        yield name, values
        return
    for column in values.dtype.names:
        yield (f"{name}.{column}" if name else column), values[column]


def _read_npy(path: Path) -> Iterator[tuple[str, Values]]:
    yield from _columns("", np.load(path, allow_pickle=False))


def _read_npz(path: Path) -> Iterator[tuple[str, Values]]:
    with np.load(path, allow_pickle=False) as arrays:
        for name in arrays.files:
            yield from _columns(name, arrays[name])


def _read_json(path: Path) -> Iterator[tuple[str, Values]]:
    yield from flatten_json(json.loads(path.read_text(encoding="utf-8")))


def _read_csv(path: Path) -> Iterator[tuple[str, Values]]:
    with path.open(encoding="utf-8", newline="") as stream:
        lines = [line for line in csv.reader(stream) if line and not line[0].startswith("#")]
    if not lines:
        return
    for name, *column in zip(*lines):
        try:
            yield name, np.array([float(cell) for cell in column])
        except ValueError:
            yield name, np.array(column)


def _read_exr(path: Path) -> Iterator[tuple[str, Values]]:
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as picture:
        for name, channel in picture.channels().items():
            yield name, np.array(channel.pixels)


def _read_hdf5(path: Path) -> Iterator[tuple[str, Values]]:
    import h5py

    found: list[tuple[str, Values]] = []

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            # Texts come as Python objects, which no record can hold.
            text = h5py.check_string_dtype(item.dtype) is not None
            values = np.asarray(item.asstr()[()]).astype(str) if text else np.asarray(item[()])
            found.append((name, values))
        for label, value in item.attrs.items():
            found.extend(_hdf5_attribute(f"{name}@{label}", value))

    with h5py.File(path, "r") as file:
        visit("", file)
        file.visititems(visit)
    yield from found


def _hdf5_attribute(key: str, value: Any) -> Iterator[tuple[str, Values]]:
    """Numbers of an attribute; JSON in a text is taken apart, references to axes are left out."""
    if isinstance(value, str):
        try:
            yield from flatten_json(json.loads(value), key)
        except json.JSONDecodeError:
            yield key, np.array(value)
        return
    values = np.asarray(value)
    if values.dtype.kind in "biufc":
        yield key, values


def _read_sigmf(path: Path) -> Iterator[tuple[str, Values]]:
    meta = json.loads(path.with_suffix(".sigmf-meta").read_text(encoding="utf-8"))
    kinds = {"cf32_le": "<c8", "rf32_le": "<f4", "cf64_le": "<c16", "rf64_le": "<f8"}
    yield "samples", np.fromfile(path, kinds[meta["global"]["core:datatype"]])


_READERS: dict[str, Callable[[Path], Iterator[tuple[str, Values]]]] = {
    ".npy": _read_npy,
    ".npz": _read_npz,
    ".json": _read_json,
    ".csv": _read_csv,
    ".exr": _read_exr,
    ".h5": _read_hdf5,
    ".hdf5": _read_hdf5,
    ".sigmf-data": _read_sigmf,
    ".sigmf-meta": _read_json,
}


def read_folder(folder: Path) -> dict[Place, Values]:
    """Everything in the files of a folder and those below it.

    Raises
    ------
    ValueError
        A file of a kind that cannot be read here: its numbers would go unseen.
    """
    found: dict[Place, Values] = {}
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        name = path.relative_to(folder).as_posix()
        if path.name.endswith(tuple(NOT_READ)):
            continue
        reader = _READERS.get(path.suffix)
        if reader is None:
            raise ValueError(
                f"{name}: files of the kind {path.suffix!r} cannot be compared. Add a reader to "
                "scripts/comparison/reading.py, or name the kind in NOT_READ with a reason."
            )
        for key, values in reader(path):
            found[Place(name, key)] = values
    return found
