# SPDX-License-Identifier: GPL-3.0-or-later
"""Antennas by name and parameters, as a user writes them and as ``run.json`` keeps them.

===========  =====================================================================================
kind         parameters (those with * must be given)
===========  =====================================================================================
isotropic    gain_dbi (0): the same gain in all directions, whatever it is
cosine       exponent* or beamwidth_deg*: cos^q of the angle from boresight, nothing behind
gaussian     azimuth_beamwidth_deg*, elevation_beamwidth_deg*
aperture     width_m*, height_m*: uniformly lit rectangle (sinc^2)
array        columns*, rows (1); column_spacing_m or column_spacing_wavelengths (0.5), the same for
             row_...; column_taper, row_taper ("uniform"); steer_azimuth_deg, steer_elevation_deg
             (0); element_exponent (1; null: isotropic elements)
table        file (CSV, see `physics.antenna_table.read_pattern`), or azimuth_deg, elevation_deg and
             gain_db [azimuth][elevation] themselves
===========  =====================================================================================

Beamwidths are full widths at half power. Cosine, gaussian, aperture and array take gain_dbi too,
the gain at the pattern's peak: the difference to the directivity is the antenna's losses. Left out,
the antenna has no losses.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...array_types import Real
from ...contract import AntennaRecord
from ...errors import ConfigError
from ...physics.antenna_table import TableAntenna, read_pattern
from ...physics.antennas import Antenna, Aperture, CosinePower, Gaussian
from ...physics.arrays import PlanarArray
from ...physics.checks import real_array
from ...physics.radar_equation import to_db

#: A gain may exceed the directivity of the modelled beam by this: data sheets round, and real beams
#: have other shapes [dB].
_GAIN_SLACK_DB = 1.0


class PeakedAntenna(Antenna, Protocol):
    """An antenna that knows the gain at its peak."""

    @property
    def peak_gain(self) -> float:
        """Largest gain, linear; that in the steered direction for an array."""
        ...


@dataclass(frozen=True)
class Scaled:
    """Another antenna's gain times a factor."""

    antenna: PeakedAntenna
    factor: float

    @property
    def peak_gain(self) -> float:
        """Gain at the pattern's peak."""
        return self.factor * self.antenna.peak_gain

    def gain(self, directions: ArrayLike) -> Real:
        """Power gain over isotropic, linear, (...) for directions (..., 3)."""
        return self.factor * self.antenna.gain(directions)


@dataclass(frozen=True)
class ConstantGain:
    """The same gain in all directions: what the radar equation with one number for G means."""

    gain_dbi: float = 0.0

    @property
    def peak_gain(self) -> float:
        """The gain, linear."""
        return float(10 ** (self.gain_dbi / 10))

    def gain(self, directions: ArrayLike) -> Real:
        """Power gain over isotropic, linear, (...) for directions (..., 3)."""
        return np.full(np.shape(directions)[:-1], self.peak_gain)


class _Parameters:
    """Takes parameters out one by one, so that those nobody knows are left over."""

    def __init__(self, record: AntennaRecord, whose: str) -> None:
        self.where = f"{whose} antenna of kind {record.kind!r}"
        self._left = dict(record.parameters)
        self._known: list[str] = []

    def has(self, name: str) -> bool:
        return self._left.get(name) is not None

    def take(self, name: str, default: Any = None) -> Any:
        self._known.append(name)
        value = self._left.pop(name, None)
        return default if value is None else value

    def number(self, name: str, unit: str, default: float | None = None) -> float:
        value = self.take(name, default)
        expected = f"expected a number of {unit}" if unit else "expected a number"
        if value is None:
            raise ConfigError(f"{self.where} lacks {name}; {expected}.")
        if isinstance(value, bool | str):
            raise ConfigError(f"{self.where}: {name} is {value!r}; {expected}.")
        array = real_array(f"{self.where}: {name}", value, unit)
        if array.ndim:
            raise ConfigError(f"{self.where}: {name} is a list; {expected}.")
        return float(array)

    def whole(self, name: str, default: int | None = None) -> int:
        value = self.number(name, "elements", default)
        if value != int(value):
            raise ConfigError(f"{self.where}: {name} is {value:g}; expected a whole number.")
        return int(value)

    def finish(self) -> None:
        if self._left:
            raise ConfigError(
                f"{self.where} has the unknown parameter {sorted(self._left)[0]!r}; it takes "
                f"{', '.join(dict.fromkeys(self._known))}."
            )


def make_antenna(
    record: AntennaRecord, wavelength_m: float, whose: str = "Transmitter's"
) -> PeakedAntenna:
    """The antenna that a record describes.

    Parameters
    ----------
    record
        Kind and parameters.
    wavelength_m
        Of the carrier [m]; apertures and arrays depend on it.
    whose
        For messages.

    Raises
    ------
    ConfigError
        Unknown kind or parameter, one that is missing or out of range, a gain more than 1 dB above
        the directivity, a table that cannot be read.
    """
    maker = _MAKERS.get(record.kind)
    if maker is None:
        raise ConfigError(
            f"{whose} antenna is of kind {record.kind!r}; expected one of {', '.join(KINDS)}."
        )
    parameters = _Parameters(record, whose)
    antenna = maker(parameters, wavelength_m)
    parameters.finish()
    return antenna


def self_contained(record: AntennaRecord, folder: Path | None = None) -> AntennaRecord:
    """The record with the contents of the file that it names, if it names one.

    Parameters
    ----------
    record
        Antenna.
    folder
        What a relative name is relative to; None: the working folder.

    Raises
    ------
    ConfigError
        The file cannot be read.
    """
    name = record.parameters.get("file")
    if record.kind != "table" or not name:
        return record
    path = Path(str(name))
    table = read_pattern(path if folder is None else folder / path)
    others = {key: value for key, value in record.parameters.items() if key != "file"}
    arrays = {key: getattr(table, key).tolist() for key in ("azimuth_deg", "elevation_deg")}
    return AntennaRecord("table", {**others, **arrays, "gain_db": table.gain_db.tolist()})


def _isotropic(given: _Parameters, _: float) -> PeakedAntenna:
    return ConstantGain(given.number("gain_dbi", "dBi", 0.0))


def _cosine(given: _Parameters, _: float) -> PeakedAntenna:
    if given.has("beamwidth_deg") and given.has("exponent"):
        raise ConfigError(f"{given.where} has beamwidth_deg and exponent; expected one of them.")
    if given.has("beamwidth_deg"):
        width_rad = np.radians(given.number("beamwidth_deg", "degrees"))
        antenna = CosinePower.from_beamwidth(float(width_rad))
    else:
        antenna = CosinePower(given.number("exponent", ""))
    for name in ("beamwidth_deg", "exponent"):
        given.take(name)
    return _with_gain(given, antenna, antenna.peak_gain)


def _gaussian(given: _Parameters, _: float) -> PeakedAntenna:
    widths = []
    for axis in ("azimuth", "elevation"):
        name = f"{axis}_beamwidth_deg"
        widths.append(given.number(name, "degrees"))
        if not 0 < widths[-1] <= 180:
            raise ConfigError(
                f"{given.where}: {name} is {widths[-1]:g}; expected more than 0, up to 180 degrees."
            )
    antenna = Gaussian(*(float(np.radians(width)) for width in widths))
    return _with_gain(given, antenna, antenna.peak_gain)


def _aperture(given: _Parameters, wavelength_m: float) -> PeakedAntenna:
    width_m, height_m = given.number("width_m", "m"), given.number("height_m", "m")
    antenna = Aperture(width_m, height_m, wavelength_m)
    return _with_gain(given, antenna, antenna.peak_gain)


def _array(given: _Parameters, wavelength_m: float) -> PeakedAntenna:
    spacing = {}
    for axis in ("column", "row"):
        metres, waves = f"{axis}_spacing_m", f"{axis}_spacing_wavelengths"
        if given.has(metres) and given.has(waves):
            raise ConfigError(f"{given.where} has {metres} and {waves}; expected one of them.")
        in_waves = given.number(waves, "wavelengths", 0.5)
        spacing[axis] = given.number(metres, "m", in_waves * wavelength_m)
    isotropic = "element_exponent" in given._left and not given.has("element_exponent")
    exponent = given.number("element_exponent", "", 1.0)
    antenna = PlanarArray(
        columns=given.whole("columns"),
        rows=given.whole("rows", 1),
        column_spacing_m=spacing["column"],
        row_spacing_m=spacing["row"],
        wavelength_m=wavelength_m,
        steer_azimuth_rad=float(np.radians(given.number("steer_azimuth_deg", "degrees", 0.0))),
        steer_elevation_rad=float(np.radians(given.number("steer_elevation_deg", "degrees", 0.0))),
        column_taper=_taper(given.take("column_taper", "uniform")),
        row_taper=_taper(given.take("row_taper", "uniform")),
        element_exponent=None if isotropic else exponent,
    )
    return _with_gain(given, antenna, antenna.peak_gain)


def _taper(value: Any) -> str | tuple[float, ...]:
    return value if isinstance(value, str) else tuple(np.atleast_1d(real_array("Taper", value)))


def _table(given: _Parameters, _: float) -> PeakedAntenna:
    if given.has("file"):
        return read_pattern(str(given.take("file")))
    given.take("file")
    arrays = [given.take(name) for name in ("azimuth_deg", "elevation_deg", "gain_db")]
    if any(array is None for array in arrays):
        raise ConfigError(
            f"{given.where} lacks its table: give 'file', a CSV with the columns azimuth_deg, "
            "elevation_deg, gain_db, or cut, angle_deg, gain_db."
        )
    azimuth, elevation, gain_db = (real_array(given.where, array) for array in arrays)
    return _reopened(azimuth, elevation, gain_db)


def _reopened(azimuth: Real, elevation: Real, gain_db: Real) -> TableAntenna:
    """A table from its own arrays, which may have been closed over +-180 degrees before."""
    inside = (azimuth >= -180 - 1e-9) & (azimuth <= 180 + 1e-9)
    if gain_db.shape == (azimuth.size, elevation.size):
        azimuth, gain_db = azimuth[inside], gain_db[inside]
    return TableAntenna(azimuth, elevation, gain_db)


def _with_gain(given: _Parameters, antenna: PeakedAntenna, directivity: float) -> PeakedAntenna:
    """With the given peak gain, if there is one."""
    wanted_dbi = given.number("gain_dbi", "dBi", float(to_db(directivity)))
    excess_db = wanted_dbi - float(to_db(directivity))
    if excess_db > _GAIN_SLACK_DB:
        raise ConfigError(
            f"{given.where} has a gain of {wanted_dbi:g} dBi, but a beam of this shape has a "
            f"directivity of {float(to_db(directivity)):.2f} dBi: no antenna gains more than "
            "that. Narrow the beam, lower gain_dbi, or leave it out."
        )
    return antenna if excess_db == 0 else Scaled(antenna, float(10 ** (excess_db / 10)))


_MAKERS: dict[str, Callable[[_Parameters, float], PeakedAntenna]] = {
    "isotropic": _isotropic,
    "cosine": _cosine,
    "gaussian": _gaussian,
    "aperture": _aperture,
    "array": _array,
    "table": _table,
}

KINDS = tuple(_MAKERS)
"""Kinds of antennas."""
