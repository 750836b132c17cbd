# SPDX-License-Identifier: GPL-3.0-or-later
"""sigma0 from a user's CSV file over grazing angle, and if it has them, frequency, polarisation."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..array_types import Real
from ..errors import ConfigError
from .checks import CsvTable, read_csv

_COLUMNS = (("grazing_deg", "sigma0_db"), ("grazing_deg", "sigma0"))
#: What a cell of the column polarisation may hold.
_SIDES = {"vv": "vertical", "v": "vertical", "hh": "horizontal", "h": "horizontal"}
_BOTH = ("", "any", "average")
#: Values that a table may hold [dB]: beyond them it is nearly always in another unit.
_LIMITS_DB = (-150.0, 50.0)


@dataclass(frozen=True)
class ClutterTable:
    """Rows of sigma0, by polarisation and frequency.

    Attributes
    ----------
    path
        The file.
    rows
        Number of its rows.
    curves
        For "vertical" and "horizontal": frequencies [Hz] in rising order, 0 for all, each with
        grazing angles [rad], in rising order, and sigma0 [dB], (rows,) each.
    """

    path: Path
    rows: int
    curves: dict[str, list[tuple[float, Real, Real]]]

    @property
    def band_hz(self) -> tuple[float, float]:
        """Frequencies for which there are rows of all polarisations [Hz]."""
        limits = [(curves[0][0], curves[-1][0]) for curves in self.curves.values()]
        low, high = max(low for low, _ in limits), min(high for _, high in limits)
        return (low, high) if low > 0 else (0.0, np.inf)

    @property
    def grazing_rad(self) -> tuple[float, float]:
        """Grazing angles for which all curves have values [rad]."""
        angles = [angle for curves in self.curves.values() for _, angle, _ in curves]
        return max(float(one[0]) for one in angles), min(float(one[-1]) for one in angles)

    def sigma0_db(self, frequency_hz: float, grazing_rad: Real, polarisation: str) -> Real:
        """Return sigma0 [dB], linear in dB over the logarithms of angle and frequency."""
        curves = self.curves[polarisation]
        values = [np.interp(np.log(grazing_rad), np.log(angle), db) for _, angle, db in curves]
        if len(curves) == 1:
            return np.asarray(values[0])
        known_hz = [known for known, _, _ in curves]
        at = np.interp(np.log(frequency_hz), np.log(known_hz), np.arange(len(known_hz)))
        below = min(int(at), len(curves) - 2)
        part = at - below
        return np.asarray((1 - part) * values[below] + part * values[below + 1])


def read_clutter_table(path: str | Path) -> ClutterTable:
    """Read a table of sigma0.

    Parameters
    ----------
    path
        Columns grazing_deg, and sigma0_db or sigma0 (as a ratio); if they are needed frequency_ghz
        and polarisation (HH, VV or any). The angles of one frequency and polarisation rise from row
        to row.

    Returns
    -------
    ClutterTable
        Values between rows are linear in dB over the logarithms of angle and frequency. Beyond
        them the nearest row holds.

    Raises
    ------
    ConfigError
        A cell that is no finite number, an angle out of 0 to 90 degrees or out of order, sigma0 not
        above 0 or out of -150 to 50 dB, a frequency not above 0, an unknown polarisation or
        column, or a polarisation without rows; the message has file and line.
    """
    table = read_csv(path, _COLUMNS)
    known = {*itertools.chain(*_COLUMNS), "frequency_ghz", "polarisation"}
    if unknown := sorted(set(table.columns) - known):
        raise ConfigError(
            f"{table.path.name} has a column {unknown[0]!r}, whose meaning is not known; expected "
            f"{', '.join(sorted(known))}. Rename the column, or remove it."
        )
    if {"sigma0_db", "sigma0"} <= set(table.columns):
        raise ConfigError(
            f"{table.path.name} has the columns sigma0_db and sigma0; expected one of them."
        )
    grazing_deg = _checked(table, "grazing_deg", "degrees", 0.0, 90.0)
    if "sigma0_db" in table.columns:
        db = _checked(table, "sigma0_db", "dB", _LIMITS_DB[0] - 1e-9, _LIMITS_DB[1])
    else:
        most = 10 ** (_LIMITS_DB[1] / 10)
        db = 10 * np.log10(_checked(table, "sigma0", "(sigma0 is a ratio)", 0.0, most))
    frequency_hz = np.zeros(len(table.lines))
    if "frequency_ghz" in table.columns:
        frequency_hz = _checked(table, "frequency_ghz", "GHz", 0.0, 1e6) * 1e9
    sides = _polarisations(table)
    curves = {}
    for side in ("vertical", "horizontal"):
        mine = np.array([one in (side, "both") for one in sides])
        if not mine.any():
            raise ConfigError(
                f"{table.path.name} has no rows for {side} polarisation. Add them, or write 'any' "
                "in the column polarisation."
            )
        curves[side] = [
            _curve(table, mine & (frequency_hz == known), known, grazing_deg, db)
            for known in np.unique(frequency_hz[mine])
        ]
    return ClutterTable(table.path, len(table.lines), curves)


def _checked(table: CsvTable, column: str, unit: str, above: float, maximum: float) -> Real:
    """Return a column after a check that all of it is above one number and at most another."""
    values = table.numbers(column)
    for line, value in zip(table.lines, values, strict=True):
        if not above < value <= maximum:
            raise ConfigError(
                f"{table.path.name}, line {line}: {column} is {value:g}; expected more than "
                f"{above:g} and at most {maximum:g} {unit}."
            )
    return values


def _polarisations(table: CsvTable) -> list[str]:
    found = []
    cells = table.columns.get("polarisation", [""] * len(table.lines))
    for line, cell in zip(table.lines, cells, strict=True):
        name = cell.strip().lower()
        if name not in _SIDES and name not in _BOTH:
            raise ConfigError(
                f"{table.path.name}, line {line}: polarisation is {cell!r}; expected HH, VV or any."
            )
        found.append(_SIDES.get(name, "both"))
    return found


def _curve(
    table: CsvTable, rows: np.ndarray, frequency_hz: float, grazing_deg: Real, db: Real
) -> tuple[float, Real, Real]:
    numbers = np.flatnonzero(rows)
    falls = np.flatnonzero(np.diff(grazing_deg[numbers]) <= 0)
    if falls.size:
        line = table.lines[numbers[falls[0] + 1]]
        raise ConfigError(
            f"{table.path.name}, line {line}: grazing_deg is "
            f"{grazing_deg[numbers[falls[0] + 1]]:g} after {grazing_deg[numbers[falls[0]]]:g}; "
            "expected rising angles for each frequency and polarisation. Sort the rows."
        )
    return float(frequency_hz), np.radians(grazing_deg[numbers]), db[numbers]
