# SPDX-License-Identifier: GPL-3.0-or-later
"""Area clutter: the radar cross section of a unit of ground or sea, sigma0, by grazing angle.

>>> clutter_model("nrl_sea").sigma0_db(9.65e9, 0.02, "horizontal", sea_state=3)

A `ClutterModel` is an equation or a user's table. It has a band of frequencies and an interval of
grazing angles in which its source holds; a caller asks `is_valid`. Outside, the equation is
continued; a table holds its last row.

Clutter fluctuates in two ways. `texture` is a factor on sigma0 of mean 1 with a correlation length:
over speckle it makes the intensity K-distributed, log-normal with speckle, or Weibull.
`clutter_velocities` gives scatterers constant random velocities, so the echo of many has the
Doppler spectrum that the velocities are drawn from.
"""

from __future__ import annotations

import difflib
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Real
from ..errors import ConfigError
from .checks import EDGE_SLACK, CsvTable, read_csv, real_array
from .materials import Parameter

_COLUMNS = (("grazing_deg", "sigma0_db"), ("grazing_deg", "sigma0"))
#: What a cell of the column polarisation may hold.
_SIDE_OF_CELL = {
    **dict.fromkeys(("vv", "v"), "vertical"),
    **dict.fromkeys(("hh", "h"), "horizontal"),
    **dict.fromkeys(("", "any", "average"), "both"),
}
#: Values that a table may hold [dB]: beyond them it is nearly always in another unit.
_LIMITS_DB = (-150.0, 50.0)


@dataclass(frozen=True)
class ClutterTable:
    """Rows of sigma0, by polarisation and frequency.

    Attributes
    ----------
    path : the file
    rows : number of its rows
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
    ConfigError : a cell or a column that cannot be used; the message has file and line
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
    """Return a column whose values must all be above one number and at most another."""
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
        if name not in _SIDE_OF_CELL:
            raise ConfigError(
                f"{table.path.name}, line {line}: polarisation is {cell!r}; expected HH, VV or any."
            )
        found.append(_SIDE_OF_CELL[name])
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


CLUTTER_TABLE = "table"
"""Name under which a CSV file is read; it takes the one parameter ``path``."""
POLARISATIONS = ("average", "vertical", "horizontal")
"""Polarisations on both ways; "average" is the mean of sigma0 of the other two."""

#: Least grazing angle that an equation is evaluated at [rad]: 0 has no logarithm.
_LEAST_RAD = 1e-9


@dataclass(frozen=True)
class ClutterModel:
    """A model of sigma0, both ways in one polarisation.

    Attributes
    ----------
    name, title, source : key in the registry, name for people, publication
    band_hz : lowest and highest frequency [Hz]
    grazing_rad : smallest and largest grazing angle [rad]
    sigma0_db_of
        Equation: (frequency_hz, grazing_rad, "vertical" or "horizontal", **parameters) -> dB.
    parameters : its other parameters
    """

    name: str
    title: str
    source: str
    band_hz: tuple[float, float]
    grazing_rad: tuple[float, float]
    sigma0_db_of: Callable[..., Real] = field(repr=False, compare=False)
    parameters: tuple[Parameter, ...] = ()

    def sigma0_db(
        self,
        frequency_hz: float,
        grazing_rad: ArrayLike,
        polarisation: str = "average",
        **parameters: float,
    ) -> Real:
        """Return sigma0 [dB] at grazing angles of 0 to pi/2 [rad], in their shape.

        `polarisation` is one of `POLARISATIONS`; `parameters` are values of the model's own by
        name.
        """
        if polarisation not in POLARISATIONS:
            raise ConfigError(
                f"Polarisation {polarisation!r}; expected one of {', '.join(POLARISATIONS)}."
            )
        values = self._values(parameters)
        frequency = float(real_array("Frequency", frequency_hz, "Hz", above=0.0))
        grazing = real_array("Grazing angle", grazing_rad, "rad", 0.0, np.pi / 2)
        grazing = np.maximum(grazing, _LEAST_RAD)
        if polarisation != "average":
            return np.asarray(self.sigma0_db_of(frequency, grazing, polarisation, **values))
        both = [
            10 ** (self.sigma0_db_of(frequency, grazing, one, **values) / 10)
            for one in POLARISATIONS[1:]
        ]
        return np.asarray(10 * np.log10((both[0] + both[1]) / 2))

    def is_valid(self, frequency_hz: ArrayLike, grazing_rad: ArrayLike) -> NDArray[np.bool_]:
        """Return whether the source of the model holds at frequencies [Hz] and angles [rad]."""
        inside: NDArray[np.bool_] = np.asarray(True)
        for value, limits in ((frequency_hz, self.band_hz), (grazing_rad, self.grazing_rad)):
            low, high = limits[0] * (1 - EDGE_SLACK), limits[1] * (1 + EDGE_SLACK)
            inside = inside & (np.asarray(value) >= low) & (np.asarray(value) <= high)
        return np.asarray(inside)

    def _values(self, given: dict[str, float]) -> dict[str, float]:
        known = {parameter.name: parameter for parameter in self.parameters}
        unknown = sorted(set(given) - set(known))
        if unknown:
            raise ConfigError(
                f"Clutter {self.name!r} has no parameter {unknown[0]!r}; its parameters: "
                f"{', '.join(known) or 'none'}."
            )
        values = {}
        for one in self.parameters:
            value = given.get(one.name, one.default)
            if value is None:
                raise ConfigError(
                    f"Clutter {self.name!r} needs {one.name} [{one.unit or '1'}]: {one.meaning}."
                )
            what = f"{one.name} of clutter {self.name!r}"
            values[one.name] = float(real_array(what, value, one.unit, one.minimum, one.maximum))
        return values


def _constant_gamma_db(_f_hz: float, grazing_rad: Real, _side: str, gamma_db: float) -> Real:
    return np.asarray(gamma_db + 10 * np.log10(np.sin(grazing_rad)))


#: c1 to c5 of the NRL sea model; of the report's two prints the listing has more digits.
_NRL_SEA = {
    "horizontal": (-73.0, 20.781, 7.351, 25.65, 0.0054),
    "vertical": (-50.796, 25.93, 0.7093, 21.588, 0.00211),
}


def _nrl_sea_db(frequency_hz: float, grazing_rad: Real, side: str, sea_state: float) -> Real:
    """Evaluate Gregers-Hansen and Mital, eq. 7, with the constants of their listing."""
    c1, c2, c3, c4, c5 = _NRL_SEA[side]
    psi_deg = np.degrees(grazing_rad)
    by_frequency = (27.5 + c3 * psi_deg) * np.log10(frequency_hz / 1e9) / (1 + 0.95 * psi_deg)
    by_state = c4 * (1 + sea_state) ** (1 / (2 + 0.085 * psi_deg + 0.033 * sea_state))
    slant = c2 * np.log10(np.sin(grazing_rad))
    return np.asarray(c1 + slant + by_frequency + by_state + c5 * psi_deg**2)


_MODELS = (
    ClutterModel(
        "constant_gamma",
        "Constant gamma",
        "sigma0 = gamma sin(grazing angle)",
        (0.0, np.inf),
        (0.0, np.pi / 2),
        _constant_gamma_db,
        (Parameter("gamma_db", "dB", "sigma0 over the sine of the angle", -15.0, -80.0, 20.0),),
    ),
    ClutterModel(
        "nrl_sea",
        "Sea (NRL)",
        "Gregers-Hansen and Mital, NRL/MR/5310-12-9346 (2012), mean over look directions",
        (0.5e9, 35e9),
        (np.radians(0.1), np.radians(60.0)),
        _nrl_sea_db,
        (Parameter("sea_state", "", "Douglas sea state, 0 to 6", 3.0, 0.0, 6.0),),
    ),
)


def nathanson_sea(sea_state: int) -> str:
    """Return the file with Nathanson's measured sigma0 of the sea, for the model 'table'.

    It holds the frequencies with five angles at least: 0.5 to 35 GHz, fewer at sea states 0 and 6;
    0.1 to 60 degrees, in part from 1 degree on.

    Parameters
    ----------
    sea_state : Douglas sea state, 0 to 6, a whole number

    Returns
    -------
    str : path of the CSV file

    Raises
    ------
    ConfigError : another sea state
    """
    if sea_state not in range(7):
        raise ConfigError(f"Sea state is {sea_state!r}; expected a whole number from 0 to 6.")
    return str(Path(__file__).with_name("sea_tables") / f"sea_state_{int(sea_state)}.csv")


def clutter_models() -> MappingProxyType[str, ClutterModel]:
    """Return the models that need no file, by name (read only).

    Returns
    -------
    mapping of str to ClutterModel
    """
    return MappingProxyType({model.name: model for model in _MODELS})


def clutter_model(name: str, path: str | Path | None = None) -> ClutterModel:
    """Return a model.

    Parameters
    ----------
    name : key of `clutter_models`, or 'table'
    path : CSV file, for 'table' only, see `read_clutter_table`

    Returns
    -------
    ClutterModel

    Raises
    ------
    ConfigError : unknown name, with the nearest ones; 'table' without `path`, another name with it
    """
    if name == CLUTTER_TABLE:
        if not path:
            raise ConfigError("Clutter 'table' has no path; give a CSV file over grazing angle.")
        table = read_clutter_table(path)
        title, source = f"Table {table.path.name}", f"{table.rows} rows of {table.path.name}"
        return ClutterModel(
            CLUTTER_TABLE, title, source, table.band_hz, table.grazing_rad, table.sigma0_db
        )
    if path:
        raise ConfigError(f"Clutter {name!r} takes no path; only 'table' reads a file.")
    found = clutter_models().get(name)
    if found is None:
        known = [*clutter_models(), CLUTTER_TABLE]
        near = difflib.get_close_matches(name, known, n=2)
        hint = f"did you mean {', '.join(near)}? " if near else ""
        raise ConfigError(f"There is no clutter model {name!r}: {hint}Known: {', '.join(known)}.")
    return found


# -- fluctuation -----------------------------------------------------------------------------------

TEXTURES = ("none", "k", "lognormal", "weibull")
MOTIONS = ("none", "exponential", "gaussian", "sea")

#: Cosines that a Gaussian field is the sum of.
_COSINES = 128
_GRAVITY_MPS2 = 9.81
#: Surface tension of water over its density [m^3/s^2].
_TENSION = 7.4e-5
#: Probabilities away from 0 and 1, where quantiles are infinite.
_LEAST = 1e-12


def check_texture(kind: str, shape: float, length_m: float) -> None:
    """Check the numbers of a texture.

    Parameters
    ----------
    kind, shape, length_m : as for `texture`

    Raises
    ------
    ConfigError : an unknown kind, a number out of range
    """
    if kind not in TEXTURES:
        raise ConfigError(f"Texture is {kind!r}; expected one of {', '.join(TEXTURES)}.")
    if kind == "none":
        return
    highest = {"k": 1e3, "lognormal": 3.0, "weibull": 1.0}[kind]
    real_array(f"Shape of the texture {kind!r}", shape, "", minimum=0.05, maximum=highest)
    real_array("Length of the texture", length_m, "m", above=0.0)


def texture(points_m: Real, kind: str, shape: float, length_m: float, seed: int) -> Real:
    """Return factors of mean 1 on the power of scatterers at points of a surface.

    Parameters
    ----------
    points_m : in the surface's own coordinates, (n, 3) [m]
    kind
        One of `TEXTURES`: "k": gamma distribution of the order `shape` (nu); "lognormal": standard
        deviation `shape` of the natural logarithm; "weibull": with speckle the intensity has a
        Weibull distribution of the shape `shape`, at most 1, and a Rayleigh amplitude at 1.
    shape : see `kind`
    length_m : correlation length L: the field underneath has the correlation exp(-(r/L)^2) [m]
    seed : of the realisation

    Returns
    -------
    ndarray : (n,)
    """
    check_texture(kind, shape, length_m)
    if kind == "none":
        return np.ones(len(points_m))
    rng = np.random.default_rng(seed)
    field = _gaussian_field(points_m / length_m, rng)
    if kind == "lognormal":
        return np.asarray(np.exp(shape * field - shape**2 / 2))
    if kind == "k":
        from scipy.special import gammaincinv  # not at import: slow

        return np.asarray(gammaincinv(shape, _probability(field)) / shape)
    angle = np.pi * _probability(field)
    return _inverse_stable(angle, _gaussian_field(points_m / length_m, rng), shape)


def _gaussian_field(places: Real, rng: np.random.Generator) -> Real:
    """Return a unit Gaussian field of correlation exp(-r^2), (n,), from random Fourier features."""
    waves = rng.normal(0.0, math.sqrt(2.0), (_COSINES, 3))
    phases = rng.uniform(0.0, 2 * np.pi, _COSINES)
    found = np.zeros(len(places))
    for wave, phase in zip(waves, phases, strict=True):
        found += np.cos(places @ wave + phase)
    return found * math.sqrt(2 / _COSINES)


def _probability(field: Real) -> Real:
    from scipy.special import ndtr

    return np.asarray(np.clip(ndtr(field), _LEAST, 1 - _LEAST))


def _inverse_stable(angle: Real, field: Real, shape: float) -> Real:
    """Return 1/S of mean 1, with S one-sided stable (Kanter, Ann. Probab. 3, 697, 1975). Times an
    exponential, it has a Weibull distribution.
    """
    if shape == 1.0:
        return np.ones(angle.size)
    waiting = -np.log(_probability(field))
    log_stable = (
        np.log(np.sin(shape * angle))
        - np.log(np.sin(angle)) / shape
        + (1 - shape) / shape * (np.log(np.sin((1 - shape) * angle)) - np.log(waiting))
    )
    return np.asarray(np.exp(-log_stable - math.lgamma(1 + 1 / shape)))


def check_motion(kind: str, speed_mps: float, fraction: float) -> None:
    """Check the numbers of internal motion.

    Parameters
    ----------
    kind, speed_mps, fraction : as for `clutter_velocities`

    Raises
    ------
    ConfigError : an unknown kind, a number out of range
    """
    if kind not in MOTIONS:
        raise ConfigError(f"Clutter motion is {kind!r}; expected one of {', '.join(MOTIONS)}.")
    real_array("Speed of the clutter motion", speed_mps, "m/s", minimum=0.0, maximum=100.0)
    real_array("Fraction of the clutter motion", fraction, "", minimum=0.0, maximum=1.0)


def clutter_velocities(
    kind: str,
    speed_mps: float,
    fraction: float,
    draws: tuple[Real, Real],
    grazing_cosine: Real,
    wavelength_m: float,
) -> Real:
    """Return the velocities of scatterers along the line of sight, receding positive.

    Parameters
    ----------
    kind
        One of `MOTIONS`. "exponential": spectrum exp(-|v| / speed_mps), as Billingsley found over
        wooded land, and a `fraction` of the power that does not move. "gaussian": standard
        deviation `speed_mps`. "sea": both Bragg lines, approaching with the `fraction`, each
        with the standard deviation `speed_mps`.
    speed_mps, fraction : see `kind`
    draws : two numbers even over 0 to 1 for each scatterer, (n,) each
    grazing_cosine, wavelength_m : for "sea": cosine of the grazing angle, (n,), and wavelength [m]

    Returns
    -------
    ndarray : (n,) [m/s]
    """
    check_motion(kind, speed_mps, fraction)
    one, other = (np.clip(draw, _LEAST, 1 - _LEAST) for draw in draws)
    if kind == "none":
        return np.zeros(one.size)
    if kind == "exponential":
        # one draw for stillness and side, another for the speed
        side = np.where(one < fraction + (1 - fraction) / 2, -1.0, 1.0)
        return np.asarray(np.where(one < fraction, 0.0, -side * speed_mps * np.log(other)))
    from scipy.special import ndtri

    spread_mps = speed_mps * ndtri(other)
    if kind == "gaussian":
        return np.asarray(spread_mps)
    side = np.where(one < fraction, -1.0, 1.0)
    return np.asarray(side * bragg_velocity_mps(wavelength_m, grazing_cosine) + spread_mps)


def clutter_correlation(
    kind: str, speed_mps: float, fraction: float, lag_s: Real, wavelength_m: float
) -> Real:
    """Return the correlation of the echo of many scatterers with themselves, a time later.

    It is the characteristic function of the velocities; of "sea", that of each Bragg line about its
    own velocity.

    Parameters
    ----------
    kind, speed_mps, fraction : as for `clutter_velocities`
    lag_s : times, (n,) [s]
    wavelength_m : of the carrier [m]

    Returns
    -------
    ndarray : (n,), 1 at lag 0
    """
    turn = 4 * np.pi / wavelength_m * speed_mps * np.asarray(lag_s, dtype=np.float64)
    if kind == "none":
        return np.ones(turn.shape)
    if kind == "exponential":
        return np.asarray(fraction + (1 - fraction) / (1 + turn**2))
    return np.asarray(np.exp(-(turn**2) / 2))


def bragg_velocity_mps(wavelength_m: float, grazing_cosine: Real | float) -> Real:
    """Return the phase velocity of the sea waves that scatter back, along the line of sight.

    sqrt(g k_B + 7.4e-5 k_B^3) / (2 k), k_B = 2 k cos of the grazing angle, in deep water.

    Parameters
    ----------
    wavelength_m : of the carrier [m]
    grazing_cosine : cosine of the grazing angle

    Returns
    -------
    ndarray : [m/s]
    """
    k = 2 * np.pi / wavelength_m
    bragg = 2 * k * np.asarray(grazing_cosine, dtype=np.float64)
    return np.asarray(np.sqrt(_GRAVITY_MPS2 * bragg + _TENSION * bragg**3) / (2 * k))
