# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured or computed antenna patterns from CSV files."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..array_types import Real
from ..errors import ConfigError
from .antennas import angles_from_direction
from .checks import CsvTable, read_csv, real_array

PATTERN_COLUMNS = ("azimuth_deg", "elevation_deg", "gain_db")
CUT_COLUMNS = ("cut", "angle_deg", "gain_db")

#: Angles that differ by less are one row of the grid [deg].
_SAME_ANGLE_DEG = 1e-6
#: How far the cuts may disagree on boresight [dB].
_CUTS_AGREE_DB = 0.5


@dataclass(frozen=True, eq=False)
class TableAntenna:
    """Gain on a grid of azimuth and elevation, bilinear in dB between.

    Parameters
    ----------
    azimuth_deg, elevation_deg
        Increasing angles, (A,) and (E,) [deg]. A grid of azimuths over the full circle is closed.
    gain_db
        Gain over isotropic, (A, E) [dBi].

    Attributes
    ----------
    outside_db
        Gain outside the grid [dBi]: the smallest of the table, because measured patterns usually
        end at the noise of the measurement.

    Notes
    -----
    The error of linear interpolation of a beam of half-power width b at steps h is at most 3
    (h/b)^2 dB
    per axis.
    """

    azimuth_deg: Real
    elevation_deg: Real
    gain_db: Real
    outside_db: float = field(init=False)

    def __post_init__(self) -> None:
        azimuth = real_array("Azimuth", self.azimuth_deg, "degrees", -180.0, 360.0)
        elevation = real_array("Elevation", self.elevation_deg, "degrees", -90.0, 90.0)
        gain_db = real_array("Gain", self.gain_db, "dB", maximum=100.0)
        if azimuth.ndim != 1 or elevation.ndim != 1 or min(azimuth.size, elevation.size) < 2:
            raise ConfigError("A pattern needs at least 2 azimuths and 2 elevations, each a list.")
        if gain_db.shape != (azimuth.size, elevation.size):
            raise ConfigError(
                f"Gain has the shape {gain_db.shape}; expected {(azimuth.size, elevation.size)} "
                "(azimuths, elevations)."
            )
        if np.any(np.diff(azimuth) <= 0) or np.any(np.diff(elevation) <= 0):
            raise ConfigError("Azimuths and elevations of a pattern must increase.")
        azimuth, gain_db = _centred(azimuth, gain_db)
        object.__setattr__(self, "outside_db", float(gain_db.min()))
        azimuth, gain_db = _closed(azimuth, gain_db)
        for name, value in (
            ("azimuth_deg", azimuth),
            ("elevation_deg", elevation),
            ("gain_db", gain_db),
        ):
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    @property
    def peak_gain(self) -> float:
        """Largest gain of the table, linear."""
        return float(10 ** (self.gain_db.max() / 10))

    def gain_dbi(self, directions: ArrayLike) -> Real:
        """Return the gain [dBi], (...), in directions (..., 3) of the antenna's frame."""
        azimuth, elevation = angles_from_direction(directions)
        along_a, weight_a, inside_a = _locate(self.azimuth_deg, np.degrees(azimuth))
        along_e, weight_e, inside_e = _locate(self.elevation_deg, np.degrees(elevation))
        table = self.gain_db
        near = table[along_a, along_e] * (1 - weight_e) + table[along_a, along_e + 1] * weight_e
        far = (
            table[along_a + 1, along_e] * (1 - weight_e)
            + table[along_a + 1, along_e + 1] * weight_e
        )
        value = near * (1 - weight_a) + far * weight_a
        return np.asarray(np.where(inside_a & inside_e, value, self.outside_db), dtype=np.float64)

    def gain(self, directions: ArrayLike) -> Real:
        """Return the power gain, linear, (...), in directions (..., 3) of the antenna's frame."""
        return np.asarray(10 ** (self.gain_dbi(directions) / 10), dtype=np.float64)


def _centred(azimuth: Real, gain_db: Real) -> tuple[Real, Real]:
    """Convert azimuths of 0 to 360 degrees to -180 to 180."""
    turned = np.where(azimuth > 180 + _SAME_ANGLE_DEG, azimuth - 360, azimuth)
    order = np.argsort(turned, kind="stable")
    turned, gain_db = turned[order], gain_db[order]
    double = np.flatnonzero(np.diff(turned) < _SAME_ANGLE_DEG)
    for row in double:
        if not np.allclose(gain_db[row], gain_db[row + 1], atol=0.01):
            raise ConfigError(
                f"Gain at azimuth {turned[row]:g} degrees is given twice (a full turn apart) and "
                "differs; remove one."
            )
    return np.delete(turned, double), np.delete(gain_db, double, axis=0)


def _closed(azimuth: Real, gain_db: Real) -> tuple[Real, Real]:
    """Repeat the first and last azimuth across +-180 degrees if the circle is full."""
    gap = azimuth[0] + 360 - azimuth[-1]
    if gap < _SAME_ANGLE_DEG or gap > 1.5 * np.diff(azimuth).max():
        return azimuth.copy(), gain_db.copy()
    return (
        np.concatenate([[azimuth[-1] - 360], azimuth, [azimuth[0] + 360]]),
        np.concatenate([gain_db[-1:], gain_db, gain_db[:1]]),
    )


def _locate(grid: Real, at: Real) -> tuple[NDArray[np.intp], Real, NDArray[np.bool_]]:
    """Return the cell below, the weight of its upper edge, and whether the grid extends there."""
    cell = np.clip(np.searchsorted(grid, at, side="right") - 1, 0, grid.size - 2)
    weight = (at - grid[cell]) / (grid[cell + 1] - grid[cell])
    inside = (at >= grid[0] - _SAME_ANGLE_DEG) & (at <= grid[-1] + _SAME_ANGLE_DEG)
    return cell, np.clip(weight, 0.0, 1.0), inside


def read_pattern(path: str | Path) -> TableAntenna:
    """Read an antenna pattern from CSV.

    Parameters
    ----------
    path
        Either the full pattern, columns azimuth_deg, elevation_deg, gain_db, each pair of azimuth
        and elevation once, rows in any order; or two principal cuts, columns cut, angle_deg,
        gain_db with cut 'azimuth' (at elevation 0) or 'elevation' (at azimuth 0).

    Returns
    -------
    TableAntenna
        From two cuts it is G(az, el) = G_az(az) + G_el(el) - G(0, 0) in dB, the usual product, good
        near the principal planes.

    Raises
    ------
    ConfigError
        A value is unreadable, missing, double or out of range; the message has file and line.
    """
    table = read_csv(path, (PATTERN_COLUMNS, CUT_COLUMNS))
    if set(PATTERN_COLUMNS) <= set(table.columns):
        return _full_pattern(table)
    return _from_cuts(table)


def _full_pattern(table: CsvTable) -> TableAntenna:
    azimuth, elevation = table.numbers("azimuth_deg"), table.numbers("elevation_deg")
    gain = table.numbers("gain_db")
    azimuths, elevations = np.unique(azimuth), np.unique(elevation)
    grid = np.full((azimuths.size, elevations.size), np.nan)
    places = zip(
        np.searchsorted(azimuths, azimuth),
        np.searchsorted(elevations, elevation),
        gain,
        table.lines,
        strict=True,
    )
    for a, e, value, line in places:
        if not np.isnan(grid[a, e]):
            raise ConfigError(
                f"{table.path.name}, line {line}: azimuth {azimuths[a]:g}, elevation "
                f"{elevations[e]:g} degrees is given twice; remove one row."
            )
        grid[a, e] = value
    if np.isnan(grid).any():
        a, e = np.argwhere(np.isnan(grid))[0]
        raise ConfigError(
            f"{table.path.name}: azimuth {azimuths[a]:g}, elevation {elevations[e]:g} degrees is "
            f"missing; expected a full grid of {azimuths.size} x {elevations.size} rows, found "
            f"{gain.size}."
        )
    return TableAntenna(azimuths, elevations, grid)


def _from_cuts(table: CsvTable) -> TableAntenna:
    angle, gain = table.numbers("angle_deg"), table.numbers("gain_db")
    names = [cell.lower() for cell in table.columns["cut"]]
    for name, line in zip(names, table.lines, strict=True):
        if name not in ("azimuth", "elevation"):
            raise ConfigError(
                f"{table.path.name}, line {line}: cut is {name!r}; expected azimuth or elevation."
            )
    cuts, on_boresight = [], []
    for name in ("azimuth", "elevation"):
        chosen = np.array([other == name for other in names])
        at, value = angle[chosen], gain[chosen]
        order = np.argsort(at)
        at, value = at[order], value[order]
        if at.size < 2 or np.any(np.diff(at) == 0) or not at[0] <= 0 <= at[-1]:
            raise ConfigError(
                f"{table.path.name}: the {name} cut has {at.size} rows; expected at least 2, every "
                "angle once, on both sides of 0 degrees."
            )
        cuts.append((at, value))
        on_boresight.append(float(np.interp(0.0, at, value)))
    if abs(on_boresight[0] - on_boresight[1]) > _CUTS_AGREE_DB:
        raise ConfigError(
            f"{table.path.name}: at 0 degrees the azimuth cut has {on_boresight[0]:g} dB and the "
            f"elevation cut {on_boresight[1]:g} dB; expected the same gain within "
            f"{_CUTS_AGREE_DB:g} dB. Give both cuts through boresight, and both in dBi."
        )
    (azimuth, along_a), (elevation, along_e) = cuts
    boresight_db = (on_boresight[0] + on_boresight[1]) / 2
    return TableAntenna(azimuth, elevation, along_a[:, None] + along_e[None, :] - boresight_db)
