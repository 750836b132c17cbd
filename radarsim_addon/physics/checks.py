# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of numbers that come from users, and a reader of small CSV tables with named errors."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Real
from ..atomic_files import TextTooLongError, read_text
from ..errors import ConfigError

#: Relative slack at the ends of a closed interval: numbers arrive through float32 properties.
EDGE_SLACK = 1e-6
#: Maximum size of a table [bytes]: a sphere in steps of a quarter of a degree has 30 MB.
_MAX_TABLE_BYTES = 1 << 26


def real_array(
    name: str,
    value: ArrayLike,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    above: float | None = None,
) -> Real:
    """Return a value as float64 array after a check of its range.

    Parameters
    ----------
    name : for the message
    value : number or array; all elements must be finite
    unit : for the message
    minimum, maximum
        Closed bounds; None: no bound. Values beyond one by up to `EDGE_SLACK` of it are set to it.
    above : open lower bound; None: no bound

    Returns
    -------
    ndarray : the numbers, in the shape of `value`

    Raises
    ------
    ConfigError : a value is no number, not finite or out of range; the message has the first one
    """
    of_unit = f" of {unit}" if unit else ""
    try:
        if np.asarray(value).dtype.kind not in "iuf":  # a text or a truth value is no number
            raise TypeError("no real numbers")
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ConfigError(f"{name} is {value!r}; expected a number{of_unit}.") from None
    suffix = f" {unit}" if unit else ""
    interval = " to ".join(f"{end:g}" for end in (minimum, maximum) if end is not None) + suffix
    if minimum is None or maximum is None:
        interval = f"at {'most' if minimum is None else 'least'} {interval}"
    if not np.all(np.isfinite(array)):
        bad = array[~np.isfinite(array)].flat[0]
        raise ConfigError(f"{name} holds {bad}; expected finite numbers{of_unit}.")
    if above is not None and np.any(array <= above):
        raise ConfigError(
            f"{name} is {array.min():g}{suffix}; expected more than {above:g}{suffix}."
        )
    if minimum is not None:
        if np.any(array < minimum - EDGE_SLACK * abs(minimum)):
            raise ConfigError(f"{name} is {array.min():g}{suffix}; expected {interval}.")
        array = np.maximum(array, minimum)
    if maximum is not None:
        if np.any(array > maximum + EDGE_SLACK * abs(maximum)):
            raise ConfigError(f"{name} is {array.max():g}{suffix}; expected {interval}.")
        array = np.minimum(array, maximum)
    return array


def require_one_shape(**arrays: NDArray[Any]) -> None:
    """Check that the arguments broadcast against each other.

    Parameters
    ----------
    **arrays : arrays by the name that the message uses

    Raises
    ------
    ConfigError : they do not; the message has the name and shape of each
    """
    try:
        np.broadcast_shapes(*(array.shape for array in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ConfigError(
            f"The shapes do not fit together: {shapes}. Expected equal lengths, or single numbers."
        ) from None


def passive_index(index: ArrayLike) -> NDArray[np.complex128]:
    """Return an index of refraction n + jk as complex array after a check.

    Parameters
    ----------
    index : n + jk, any shape, finite, not zero, k >= 0

    Returns
    -------
    ndarray

    Raises
    ------
    ConfigError : NaN or Inf, zero, or gain, which is nearly always the other sign convention
    """
    array = np.array(index, dtype=np.complex128)
    if not np.all(np.isfinite(array)):
        raise ConfigError(
            f"Index of refraction holds {array[~np.isfinite(array)].flat[0]}; "
            "expected finite numbers. Give n + jk of the medium."
        )
    if np.any(array == 0):
        raise ConfigError(
            "Index of refraction is 0; expected n + jk other than zero (vacuum is 1)."
        )
    if np.any(array.imag < 0):
        bad = array[array.imag < 0].flat[0]
        raise ConfigError(
            f"Index of refraction is {bad:g}: it amplifies. With the convention exp(-jwt) a lossy "
            "medium has Im >= 0; take the complex conjugate of an index written n - jk."
        )
    return array


def direction_cosine(cos_incidence: ArrayLike) -> Real:
    """Return a cosine of the angle of incidence as array after a check.

    Parameters
    ----------
    cos_incidence : cosine, any shape, 0 to 1

    Returns
    -------
    ndarray
    """
    return real_array("Cosine of the angle of incidence", cos_incidence, "", 0.0, 1.0)


@dataclass(frozen=True)
class CsvTable:
    """Cells of a CSV file.

    Attributes
    ----------
    path : the file
    columns : cells of each column by its name in lower case
    lines : line of the file that each row comes from
    """

    path: Path
    columns: dict[str, list[str]]
    lines: list[int]

    def numbers(self, column: str) -> Real:
        """Return a column as float64; ConfigError with file and line for a cell that is none."""
        values = []
        for cell, line in zip(self.columns[column], self.lines, strict=True):
            try:
                value = float(cell)
            except ValueError:
                value = np.nan
            if not np.isfinite(value):
                raise ConfigError(
                    f"{self.path.name}, line {line}: {column} is {cell!r}; "
                    "expected a finite number."
                )
            values.append(value)
        return np.array(values, dtype=np.float64)


def read_csv(path: str | Path, choices: Sequence[Sequence[str]]) -> CsvTable:
    """Read a CSV file whose header holds all columns of one of `choices`.

    Parameters
    ----------
    path
        Comma-separated, UTF-8 with or without byte-order mark; blank lines and lines that start
        with # are skipped; columns in any order, names in any case.
    choices : alternative sets of column names

    Returns
    -------
    CsvTable : its cells

    Raises
    ------
    ConfigError
        File missing or unreadable, not text, without a suitable header, or with ragged rows.
    """
    path = Path(path)
    wanted = " or ".join(", ".join(choice) for choice in choices)
    try:
        text = read_text(path, _MAX_TABLE_BYTES)
    except FileNotFoundError:
        raise ConfigError(f"Table {path} does not exist; check the path.") from None
    except UnicodeDecodeError:
        raise ConfigError(f"Table {path} is not UTF-8 text; save it as CSV (UTF-8).") from None
    except TextTooLongError as error:
        raise ConfigError(
            f"Table {path} cannot be read: {error}. Remove rows; values between are interpolated."
        ) from error
    except OSError as error:
        raise ConfigError(f"Table {path} cannot be read: {error.strerror}.") from error
    rows = []
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            try:
                rows += [(number, row) for row in csv.reader([line])]
            except csv.Error as error:
                raise ConfigError(
                    f"{path.name}, line {number}, cannot be read as CSV: {error}. "
                    "Correct or remove the line."
                ) from None
    if not rows:
        raise ConfigError(f"{path.name} is empty; expected a header line: {wanted}.")
    header = [cell.strip().lower() for cell in rows[0][1]]
    if not any(set(choice) <= set(header) for choice in choices):
        raise ConfigError(
            f"{path.name}, line {rows[0][0]}: the columns are {', '.join(header)}; "
            f"expected {wanted}. Add a header line with these names, separated by commas."
        )
    if len(set(header)) != len(header):
        raise ConfigError(
            f"{path.name}, line {rows[0][0]}: a column name occurs twice; remove one column."
        )
    for number, row in rows[1:]:
        if len(row) != len(header):
            raise ConfigError(
                f"{path.name}, line {number}: {len(row)} cells; expected {len(header)} "
                f"({', '.join(header)})."
            )
    if len(rows) == 1:
        raise ConfigError(f"{path.name} has a header and no rows; expected at least one row.")
    columns = {
        name: [row[position].strip() for _, row in rows[1:]] for position, name in enumerate(header)
    }
    return CsvTable(path, columns, [number for number, _ in rows[1:]])
