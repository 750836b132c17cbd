# SPDX-License-Identifier: GPL-3.0-or-later
"""The link budget (transmit power, antennas, losses, noise) and the weather along the paths.

Without a link budget a path brings the power that a transmitter of the Point light's EIRP in all
directions gives to an isotropic receiver. With one, the power of each path is that times

    P_t G_t(direction at the transmitter) G_r(direction at the receiver) / (L EIRP of the light),

so that no new render is needed: the light's watts are the light level of the renders and cancel.

Each kind of antenna is a dataclass that declares its parameters, as a user writes them and as
``run.json`` keeps them: beamwidths are full widths at half power, ``peak_gain_dbi`` is the gain at
the pattern's peak (the difference to the directivity is the antenna's losses; None: no losses).
docs/settings.md lists them all. Gains are linear over isotropic, of directions (..., 3) in the
antenna's axes.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, get_args

import numpy as np
from numpy.typing import ArrayLike

from ...arrays import Real
from ...contract import AntennaRecord, LinkBudget
from ...errors import ConfigError
from ...findings import Finding, finding
from ...options import check_settings, choices_from, documented, setting
from ...physics.antennas import (
    MAX_ELEMENT_EXPONENT,
    Antenna,
    Aperture,
    CosinePower,
    Gaussian,
    PlanarArray,
    TableAntenna,
    angles_from_direction,
    direction_from_angles,
    read_pattern,
)
from ...physics.checks import real_array
from ...physics.radar_equation import from_db, noise_power_w, to_db
from ...physics.weather import (
    Polarisation,
    fog_attenuation_db_per_km,
    gas_attenuation_db_per_km,
    rain_attenuation_db_per_km,
    rain_reflectivity_per_m,
)
from ...typed_json import from_json, read_json


class PeakedAntenna(Antenna, Protocol):
    """An antenna with a known gain at its peak."""

    @property
    def peak_gain(self) -> float:
        """Largest gain, linear; that in the steered direction for an array."""


@dataclass(frozen=True)
class _Scaled:
    """Another antenna's gain times a factor."""

    antenna: PeakedAntenna
    factor: float

    @property
    def peak_gain(self) -> float:
        return self.factor * self.antenna.peak_gain

    def gain(self, directions: ArrayLike) -> Real:
        return self.factor * self.antenna.gain(directions)


@dataclass(frozen=True)
class ConstantGain:
    """The same gain in all directions: the G of the radar equation."""

    #: Gain over isotropic [dBi].
    gain_dbi: float = 0.0

    @property
    def peak_gain(self) -> float:
        return float(10 ** (self.gain_dbi / 10))

    def gain(self, directions: ArrayLike) -> Real:
        return np.full(np.shape(directions)[:-1], self.peak_gain)


def make_antenna(
    record: AntennaRecord, wavelength_m: float, whose: str = "Transmitter's"
) -> PeakedAntenna:
    """Return the antenna that a record describes, at a wavelength [m]; `whose` is for messages."""
    kind = PATTERNS.get(record.kind)
    where = f"{whose} antenna"
    if kind is None:
        raise ConfigError(
            f"{where} is of kind {record.kind!r}; expected one of {', '.join(PATTERNS)}."
        )
    # null in a file means: as if it were left out; element_exponent alone has a meaning for it
    given = {
        name: value
        for name, value in record.parameters.items()
        if value is not None or name == "element_exponent"
    }
    where = f"{where} of kind {record.kind!r}"
    pattern: Pattern = from_json(kind, given, where)
    try:
        return pattern.antenna(wavelength_m)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from error


def self_contained(record: AntennaRecord, folder: Path | None = None) -> AntennaRecord:
    """Return a record in which the contents of a table replace the name of its file.

    The name is relative to `folder` (None: the working folder). Other records do not change.
    """
    name = record.parameters.get("file")
    if record.kind != "table" or not name:
        return record
    path = Path(str(name))
    table = read_pattern(path if folder is None else folder / path)
    others = {key: value for key, value in record.parameters.items() if key != "file"}
    arrays = {key: getattr(table, key).tolist() for key in ("azimuth_deg", "elevation_deg")}
    return AntennaRecord("table", {**others, **arrays, "gain_db": table.gain_db.tolist()})


class Pattern(Protocol):
    """A kind of antenna with its parameters; the declared ones are settings."""

    def antenna(self, wavelength_m: float) -> PeakedAntenna:
        """Return the antenna at a wavelength [m]."""


@documented
@dataclass(frozen=True)
class IsotropicPattern:
    """The same gain in all directions."""

    gain_dbi: float = setting("Gain", "Set the gain in every direction", 0.0, unit="dBi", digits=2)

    def antenna(self, _: float) -> PeakedAntenna:
        return ConstantGain(self.gain_dbi)


_PEAK_GAIN: dict[str, Any] = {
    "label": "Peak gain",
    "help": "Set the gain at the peak, losses of the antenna included. None: no losses",
    "default": None,
    "unit": "dBi",
    "initial": 20.0,
    "digits": 2,
}


def _beamwidth(plane: str, initial: float) -> Any:
    return setting(
        f"{plane} beamwidth", f"Set the full width at half power in {plane.lower()}", unit="deg",
        above=0.0, maximum=180.0, initial=initial, digits=2,
    )  # fmt: skip


@documented
@dataclass(frozen=True)
class CosinePattern:
    """A power of the cosine of the angle from boresight, nothing behind."""

    beamwidth_deg: float | None = setting(
        "Beamwidth", "Set the full width at half power", None, unit="deg", above=0.0,
        maximum=180.0, initial=60.0, on=True, digits=2,
    )  # fmt: skip
    exponent: float | None = setting(
        "Exponent", "Set the power of the cosine, in place of a beamwidth", None, minimum=0.0,
        initial=2.0,
    )  # fmt: skip
    peak_gain_dbi: float | None = setting(**_PEAK_GAIN)

    def antenna(self, _: float) -> PeakedAntenna:
        if (self.beamwidth_deg is None) == (self.exponent is None):
            raise ConfigError("Expected one of beamwidth_deg and exponent; set one of them.")
        if self.beamwidth_deg is not None:
            antenna = CosinePower.from_beamwidth(float(np.radians(self.beamwidth_deg)))
        else:
            antenna = CosinePower(float(self.exponent or 0.0))
        return _with_gain(antenna, self.peak_gain_dbi)


@documented
@dataclass(frozen=True)
class GaussianPattern:
    """A Gaussian beam."""

    azimuth_beamwidth_deg: float = _beamwidth("Azimuth", 10.0)
    elevation_beamwidth_deg: float = _beamwidth("Elevation", 20.0)
    peak_gain_dbi: float | None = setting(**_PEAK_GAIN)

    def antenna(self, _: float) -> PeakedAntenna:
        widths_deg = (self.azimuth_beamwidth_deg, self.elevation_beamwidth_deg)
        antenna = Gaussian(*(float(np.radians(width)) for width in widths_deg))
        return _with_gain(antenna, self.peak_gain_dbi)


@documented
@dataclass(frozen=True)
class AperturePattern:
    """A uniformly lit rectangle."""

    width_m: float = setting(
        "Width", "Set the size along the antenna's X", unit="m", above=0.0, initial=0.3
    )
    height_m: float = setting(
        "Height", "Set the size along the antenna's Y", unit="m", above=0.0, initial=0.2
    )
    peak_gain_dbi: float | None = setting(**_PEAK_GAIN)

    def antenna(self, wavelength_m: float) -> PeakedAntenna:
        return _with_gain(Aperture(self.width_m, self.height_m, wavelength_m), self.peak_gain_dbi)


def _spacing(axis: str, unit: str) -> Any:
    in_waves = unit == "wavelengths"
    return setting(
        f"{axis} spacing in {'wavelengths' if in_waves else 'metres'}",
        "Set the distance of elements" + ("" if in_waves else ", in place of wavelengths"), None,
        unit="" if in_waves else "m", above=0.0, initial=0.5 if in_waves else 0.01, on=in_waves,
    )  # fmt: skip


def _steering(axis: str, positive: str) -> Any:
    return setting(
        f"Steer {axis}", f"Set where the beam points, positive {positive}", 0.0, unit="deg",
        minimum=-90.0, maximum=90.0, digits=2,
    )  # fmt: skip


_TAPER: dict[str, Any] = {
    "help": "Choose the amplitudes of the elements",
    "default": "uniform",
    "choices": (
        ("uniform", "Uniform", "All elements alike: -13.3 dB sidelobes"),
        ("hamming", "Hamming", "-42.7 dB sidelobes"),
        ("hann", "Hann", "-31.5 dB sidelobes, falling"),
        ("taylor", "Taylor", "-35 dB sidelobes"),
        ("chebyshev", "Chebyshev", "-50 dB sidelobes"),
    ),
    "lists": True,
}


@documented
@dataclass(frozen=True)
class ArrayPattern:
    """A grid of elements, steered by phase."""

    columns: int = setting(
        "Columns", "Set the elements along X", minimum=1, soft_maximum=128, initial=8
    )
    rows: int = setting("Rows", "Set the elements along Y", 1, minimum=1, soft_maximum=128)
    column_spacing_wavelengths: float | None = _spacing("Column", "wavelengths")
    column_spacing_m: float | None = _spacing("Column", "m")
    row_spacing_wavelengths: float | None = _spacing("Row", "wavelengths")
    row_spacing_m: float | None = _spacing("Row", "m")
    column_taper: str = setting("Column taper", **_TAPER)
    row_taper: str = setting("Row taper", **_TAPER)
    steer_azimuth_deg: float = _steering("azimuth", "to the right")
    steer_elevation_deg: float = _steering("elevation", "up")
    element_exponent: float | None = setting(
        "Element exponent", "Set the power of the cosine of each element. None: isotropic", 1.0,
        minimum=0.0, maximum=MAX_ELEMENT_EXPONENT,
    )  # fmt: skip
    peak_gain_dbi: float | None = setting(**_PEAK_GAIN)

    def antenna(self, wavelength_m: float) -> PeakedAntenna:
        spacing_m = {}
        for axis in ("column", "row"):
            metres, waves = f"{axis}_spacing_m", f"{axis}_spacing_wavelengths"
            in_m, in_waves = getattr(self, metres), getattr(self, waves)
            if in_m is not None and in_waves is not None:
                raise ConfigError(f"It has {metres} and {waves}; expected one of them.")
            in_waves = 0.5 if in_waves is None else in_waves
            spacing_m[axis] = in_waves * wavelength_m if in_m is None else in_m
        antenna = PlanarArray(
            columns=self.columns,
            rows=self.rows,
            column_spacing_m=spacing_m["column"],
            row_spacing_m=spacing_m["row"],
            wavelength_m=wavelength_m,
            steer_azimuth_rad=float(np.radians(self.steer_azimuth_deg)),
            steer_elevation_rad=float(np.radians(self.steer_elevation_deg)),
            column_taper=_taper(self.column_taper),
            row_taper=_taper(self.row_taper),
            element_exponent=self.element_exponent,
        )
        return _with_gain(antenna, self.peak_gain_dbi)


def _taper(value: ArrayLike) -> str | tuple[float, ...]:
    return value if isinstance(value, str) else tuple(np.atleast_1d(real_array("Taper", value)))


@documented
@dataclass(frozen=True)
class TablePattern:
    """Gains over azimuth and elevation, from a file or given."""

    file: str = setting(
        "File",
        "Read the gains (CSV: azimuth_deg, elevation_deg, gain_db; or cut, angle_deg, gain_db)",
        "",
        path="FILE",
    )
    azimuth_deg: ArrayLike | None = None
    elevation_deg: ArrayLike | None = None
    gain_db: ArrayLike | None = None

    def antenna(self, _: float) -> PeakedAntenna:
        if self.file:
            return read_pattern(self.file)
        arrays = [self.azimuth_deg, self.elevation_deg, self.gain_db]
        if any(array is None for array in arrays):
            raise ConfigError(
                "It lacks its table: give 'file', a CSV with the columns azimuth_deg, "
                "elevation_deg, gain_db, or cut, angle_deg, gain_db."
            )
        azimuth, elevation, gain_db = (
            real_array("Table", one) for one in arrays if one is not None
        )
        # its own arrays may have been closed over +-180 degrees before
        inside = (azimuth >= -180 - 1e-9) & (azimuth <= 180 + 1e-9)
        if gain_db.shape == (azimuth.size, elevation.size):
            azimuth, gain_db = azimuth[inside], gain_db[inside]
        return TableAntenna(azimuth, elevation, gain_db)


def _with_gain(antenna: PeakedAntenna, wanted_dbi: float | None) -> PeakedAntenna:
    """Return the antenna with the given peak gain, if there is one."""
    directivity_dbi = float(to_db(antenna.peak_gain))
    if wanted_dbi is None:
        return antenna
    excess_db = wanted_dbi - directivity_dbi
    # 1 dB of slack: data sheets round, and real beams have other shapes
    if excess_db > 1.0:
        raise ConfigError(
            f"It has a gain of {wanted_dbi:g} dBi, but a beam of this shape has a "
            f"directivity of {directivity_dbi:.2f} dBi: no antenna gains more than "
            "that. Narrow the beam, lower peak_gain_dbi, or leave it out."
        )
    return antenna if excess_db == 0 else _Scaled(antenna, float(10 ** (excess_db / 10)))


#: Kinds of antennas by name.
PATTERNS: dict[str, Any] = {
    "isotropic": IsotropicPattern,
    "cosine": CosinePattern,
    "gaussian": GaussianPattern,
    "aperture": AperturePattern,
    "array": ArrayPattern,
    "table": TablePattern,
}


def peak_direction(antenna: Antenna) -> Real:
    """Find the direction of the largest gain, (3,): a coarse search over the sphere, then finer
    ones.
    """
    centre, reach = (0.0, 0.0), np.pi
    for _ in range(12):
        azimuth = centre[0] + np.linspace(-reach, reach, 81)
        elevation = np.clip(centre[1] + np.linspace(-reach, reach, 81) / 2, -np.pi / 2, np.pi / 2)
        grid = np.meshgrid(azimuth, elevation, indexing="ij")
        gain = antenna.gain(direction_from_angles(*grid))
        # Among equals the nearest to boresight: an isotropic antenna has no peak.
        near = gain * (1 - 1e-9 * (grid[0] ** 2 + grid[1] ** 2))
        best = np.unravel_index(np.argmax(near), gain.shape)
        centre, reach = (float(grid[0][best]), float(grid[1][best])), reach / 3
    return direction_from_angles(*centre)


def cut_dbi(antenna: Antenna, angle_rad: Real, plane: str, through: Real | None = None) -> Real:
    """Return the gain in a plane: "azimuth" (one elevation) or "elevation" (one azimuth), (n,)
    [dBi].

    The angles (n,) run from -pi to pi; elevations beyond 90 degrees continue behind. The direction
    `through` gives the other angle (None: boresight).
    """
    azimuth, elevation = angles_from_direction([0.0, 0.0, -1.0] if through is None else through)
    if plane == "azimuth":
        directions = direction_from_angles(angle_rad, np.full_like(angle_rad, elevation))
    else:
        level = direction_from_angles(azimuth, 0.0)
        directions = np.cos(angle_rad)[:, None] * level
        directions[:, 1] = np.sin(angle_rad)
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10(antenna.gain(directions)), dtype=np.float64)


def half_power_width_rad(antenna: Antenna, plane: str) -> float:
    """Return the full width at half power of the cut through the peak; 2 pi where the gain never
    falls to half.
    """
    angle = np.linspace(-math.pi, math.pi, 72001)
    gain = cut_dbi(antenna, angle, plane, peak_direction(antenna))
    peak = int(np.argmax(gain - 1e-9 * np.abs(angle)))
    low = gain < gain[peak] - 10 * math.log10(2)
    right = np.flatnonzero(low[peak:])
    left = np.flatnonzero(low[peak::-1])
    if not right.size or not left.size:
        return 2 * math.pi
    return float((right[0] + left[0]) * (angle[1] - angle[0]))


#: A file with two antenna tables of a degree's step has about 2 MB.
_MAX_BYTES = 64 * 1024 * 1024


@dataclass(frozen=True)
class RadarSystem:
    """A checked link budget with its antennas at a wavelength [m]; each antenna looks along the -z
    of the light or camera, y up.
    """

    record: LinkBudget
    transmitter: PeakedAntenna
    receiver: PeakedAntenna
    wavelength_m: float

    @property
    def loss(self) -> float:
        """Product of all losses, linear, 1 or more."""
        record = self.record
        total_db = record.transmit_loss_db + record.receive_loss_db + record.other_loss_db
        return float(from_db(total_db))

    def noise_power_w(self, bandwidth_hz: float) -> float:
        """Return the thermal noise in a bandwidth at the receiver's input, k (T_a + (F-1) T_0) B
        [W].
        """
        record = self.record
        return float(
            noise_power_w(bandwidth_hz, record.noise_figure_db, record.antenna_temperature_k)
        )


def make_system(record: LinkBudget, wavelength_m: float) -> RadarSystem:
    """Check a link budget and make its antennas for a wavelength [m]."""
    check_settings(record)
    return RadarSystem(
        record,
        make_antenna(record.transmitter, wavelength_m, "Transmitter's"),
        make_antenna(record.receiver, wavelength_m, "Receiver's"),
        wavelength_m,
    )


def read_system(path: str | Path) -> LinkBudget:
    """Read a link budget from JSON, with the contents of antenna tables that it names by "file",
    relative to the JSON file. From a ``run.json``, that of the run.
    """
    path = Path(path)
    data: Any = read_json(path, _MAX_BYTES, "Give a JSON file with a link budget.", ConfigError)
    if data.get("schema") == "radarsim/run":
        data = data.get("link_budget")
        if data is None:
            raise ConfigError(
                f"{path} is a run without a link budget; expected one with a link budget."
            )
    if isinstance(data, dict):
        data = {k: value for k, value in data.items() if k not in ("schema", "schema_version")}
    record = from_json(LinkBudget, data, str(path))
    return dataclasses.replace(
        record,
        transmitter=self_contained(record.transmitter, path.parent),
        receiver=self_contained(record.receiver, path.parent),
    )


@documented
@dataclass(frozen=True)
class Weather:
    """The weather along all paths; the default is clear air that takes nothing."""

    rain_mm_per_h: float = setting(
        "Rain", "Attenuate all paths by rain of this rate (ITU-R P.838-3)", 0.0, unit="mm/h",
        minimum=0.0, maximum=500.0,
    )  # fmt: skip
    fog_g_per_m3: float = setting(
        "Fog", "Attenuate all paths by fog of this liquid water content (ITU-R P.840-8)", 0.0,
        unit="g/m^3", minimum=0.0, maximum=10.0,
    )  # fmt: skip
    gases: bool = setting(
        "Gases", "Attenuate all paths by oxygen and water vapour (ITU-R P.676-12)", False
    )
    rain_polarisation: Polarisation = setting(
        "Rain polarisation", "Choose the polarisation that rain attenuates", "average",
        choices=choices_from(get_args(Polarisation)),
    )  # fmt: skip
    rain_echo: bool = setting(
        "Rain echo", "Add the echo of the rain itself within the field of view", False
    )
    wind_x_mps: float = setting(
        "Wind along X", "Let the rain drift along the world's X", 0.0, unit="m/s",
        minimum=-100.0, maximum=100.0,
    )  # fmt: skip
    wind_y_mps: float = setting(
        "Wind along Y", "Let the rain drift along the world's Y", 0.0, unit="m/s",
        minimum=-100.0, maximum=100.0,
    )  # fmt: skip
    air_temperature_c: float = setting(
        "Air temperature", "Set the temperature of air and fog", 15.0, unit="degC",
        minimum=-20.0, maximum=50.0,
    )  # fmt: skip
    air_pressure_hpa: float = setting(
        "Air pressure", "Set the pressure of the dry air", 1013.25, unit="hPa",
        minimum=0.0, maximum=1100.0,
    )  # fmt: skip
    vapour_g_per_m3: float = setting(
        "Water vapour", "Set the density of water vapour", 7.5, unit="g/m^3",
        minimum=0.0, maximum=50.0,
    )  # fmt: skip

    def __post_init__(self) -> None:
        check_settings(self)

    def attenuation_db_per_km(self, carrier_hz: float) -> float:
        """Return the attenuation of a kilometre of path, one way.

        Parameters
        ----------
        carrier_hz
            Carrier [Hz]; the attenuation is the same over the whole band.

        Returns
        -------
        float
            Rain, fog and gases together [dB/km].

        Raises
        ------
        ConfigError
            The carrier is out of the band of a model that is in use.
        """
        parts, rain, fog = [], self.rain_mm_per_h, self.fog_g_per_m3
        if rain:
            parts.append(rain_attenuation_db_per_km(carrier_hz, rain, self.rain_polarisation))
        if fog:
            parts.append(fog_attenuation_db_per_km(carrier_hz, fog, self.air_temperature_c))
        if self.gases:
            air = self.air_pressure_hpa, self.air_temperature_c, self.vapour_g_per_m3
            parts.append(gas_attenuation_db_per_km(carrier_hz, *air))
        return float(sum(map(float, parts)))

    def findings(self, carrier_hz: float) -> list[Finding]:
        """Return the effects of this weather on powers. Empty in clear air."""
        taken = self.attenuation_db_per_km(carrier_hz)
        found = [finding("weather-attenuates", attenuation_db_per_km=taken)] if taken > 0 else []
        if self.rain_mm_per_h > 0:
            eta = rain_reflectivity_per_m(carrier_hz, self.rain_mm_per_h)
            level_db = float(10 * np.log10(eta))
            numbers = {"rain_mm_per_h": self.rain_mm_per_h, "reflectivity_db": level_db}
            found.append(
                finding("rain-echo", **numbers)
                if self.rain_echo
                else finding("rain-echo-left-out", **numbers)
            )
        return found
