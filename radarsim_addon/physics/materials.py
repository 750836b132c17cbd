# SPDX-License-Identifier: GPL-3.0-or-later
"""The library of materials: complex index of refraction by name and frequency.

>>> material("concrete", 5.3e9)                               # ITU-R P.2040-3
>>> material("sea_water", 5.3e9, temperature_c=10, salinity_psu=35)
>>> material("table", 5.3e9, path="my_measurement.csv")

The models are of four kinds: a user's numbers or CSV file, building materials and grounds of
Recommendation ITU-R P.2040, moist soil, and water.

P.2040, Table 3, has eps' = a f^b, sigma = c f^d [S/m], f in GHz; eps'' = sigma / (2 pi f eps_0).
The edition matters: P.2040-1 (2015) has other numbers for several materials (concrete 5.31 there,
5.24 here). The rows named `ITU_EDITION` are those of P.2040-2 (2021) and P.2040-3 (2023), which
agree. Asphalt concrete, vinyl tile and carpet tile were added with P.2040-4 (2025), whose text was
not at hand: they come from two implementations of it that agree, and carry `ITU_NEW_EDITION`.

Soil is that of Dobson et al. 1985 (1.4 to 18 GHz) and Peplinski et al. 1995 (0.3 to 1.3 GHz). The
two differ in the effective conductivity and, below 1.3 GHz, in a linear correction of eps'.
Published models of soil differ by 3 to 12 % in eps' (up to 40 % in eps'' of dry soil): the accuracy
of a soil's permittivity is that, not the digits printed.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Complex, Real, reals
from ..errors import ConfigError
from .checks import EDGE_SLACK, read_csv, real_array, require_one_shape
from .constants import VACUUM_PERMITTIVITY_F_PER_M, ZERO_CELSIUS_K

# -------------------------------------------------------------------------------------------------
# Material models: an equation, its source, and its band of validity.
#
# A `MaterialModel` gives the relative permittivity eps at a frequency, and n = sqrt(eps): all media
# are non-magnetic (mu = 1). Beyond its band it takes the nearest edge, continues its equation, or
# refuses; `out_of_band` tells what the choice may cost.
# -------------------------------------------------------------------------------------------------

BEYOND_BAND = ("hold", "extrapolate", "refuse")
"""What a model does outside its band: take the nearest edge, continue its equation, or raise."""


@dataclass(frozen=True)
class OutOfBand:
    """How far a model is from its band, and what that may cost.

    Attributes
    ----------
    edge_hz : nearest edge of the band [Hz]
    reflection_db
        Difference in reflection at normal incidence, held against extrapolated [dB, 0 or more].
    absorption_ratio : absorption per length, the larger of the two over the smaller
    """

    edge_hz: float
    reflection_db: float
    absorption_ratio: float

    @property
    def error_class(self) -> str:
        """'small' (0.5 dB, factor 1.25), 'moderate' (2 dB, factor 2) or 'large'."""
        for name, most_db, most_ratio in (("small", 0.5, 1.25), ("moderate", 2.0, 2.0)):
            if self.reflection_db <= most_db and self.absorption_ratio <= most_ratio:
                return name
        return "large"


@dataclass(frozen=True)
class Parameter:
    """One number that a model takes.

    Attributes
    ----------
    name, unit, meaning : texts for users
    default : value if none is given; None: it must be given
    minimum, maximum, above : closed bounds and open lower bound; None: no bound
    """

    name: str
    unit: str
    meaning: str
    default: float | None = None
    minimum: float | None = None
    maximum: float | None = None
    above: float | None = None


@dataclass(frozen=True)
class MaterialModel:
    """A medium's complex relative permittivity against frequency.

    Parameters
    ----------
    name, title : key in the registry, and name for people
    source, edition : publication of the equation or the numbers, and its edition
    bands_hz : intervals [Hz], both ends included, in which the source declares it valid
    permittivity_of
        Equation: (frequency_hz, **parameters) -> complex relative permittivity, without checks.
    parameters : its other parameters
    remedy : advice for frequencies outside the band
    """

    name: str
    title: str
    source: str
    edition: str
    bands_hz: tuple[tuple[float, float], ...]
    permittivity_of: Callable[..., Complex] = field(repr=False, compare=False)
    parameters: tuple[Parameter, ...] = ()
    remedy: str = (
        "Change the carrier, or give measured values with the model 'table' or a fixed value with "
        "'permittivity'."
    )

    @property
    def band_text(self) -> str:
        """The valid bands as text, in GHz."""
        return " and ".join(_interval_text(low, high) for low, high in self.bands_hz)

    def permittivity(
        self, frequency_hz: ArrayLike, beyond_band: str = "refuse", **parameters: ArrayLike
    ) -> Complex:
        """Return the complex relative permittivity at frequencies [Hz].

        `parameters` are values of the model's own by name; they broadcast with the frequency.
        ConfigError: a number outside the valid range, an unknown or missing parameter, or numbers
        for which the equation gives a medium that amplifies.
        """
        frequency = real_array("Frequency", frequency_hz, "Hz", above=0.0)
        values = self._values(parameters)
        require_one_shape(frequency_hz=frequency, **values)
        frequency = self._within_band(frequency, beyond_band)
        eps = np.asarray(self.permittivity_of(frequency, **values), dtype=np.complex128)
        given = ", ".join(f"{name} {value}" for name, value in values.items())
        if np.any(eps == 0):
            raise ConfigError(
                f"Material {self.name!r} with {given} has the index 0; expected n or k above 0 "
                "(vacuum is n = 1)."
            )
        if not np.all(np.isfinite(eps)) or np.any(eps.imag < 0):
            raise ConfigError(
                f"Material {self.name!r} ({self.source}) gives no passive permittivity with "
                f"{given}: its fit does not extend there. Use values nearer to its data, or the "
                "models 'table' or 'permittivity'."
            )
        return eps

    def index(
        self, frequency_hz: ArrayLike, beyond_band: str = "refuse", **parameters: ArrayLike
    ) -> Complex:
        """Return the complex index of refraction, n + jk = sqrt(eps), Re >= 0 and Im >= 0."""
        permittivity = self.permittivity(frequency_hz, beyond_band, **parameters)
        # A lossless plasma, eps = -a - j0, must not fall on the other side of the branch cut.
        root = np.sqrt(permittivity.real + 1j * np.abs(permittivity.imag))
        return np.asarray(root, dtype=np.complex128)

    def out_of_band(self, frequency_hz: float, **parameters: ArrayLike) -> OutOfBand | None:
        """Return how far a frequency [Hz] is from the band; None inside.

        The errors are infinite if the equation cannot be continued so far.
        """
        edge_hz = float(self._nearest(np.asarray(float(frequency_hz))))
        if abs(edge_hz - frequency_hz) <= EDGE_SLACK * edge_hz:
            return None
        held = complex(self.index(frequency_hz, "hold", **parameters))
        try:
            continued = complex(self.index(frequency_hz, "extrapolate", **parameters))
        except ConfigError:
            return OutOfBand(edge_hz, np.inf, np.inf)
        db = [10 * np.log10(max(abs((n - 1) / (n + 1)) ** 2, 1e-12)) for n in (held, continued)]
        low, high = sorted((held.imag, continued.imag))
        ratio = 1.0 if high == 0 else high / low if low > 0 else np.inf
        return OutOfBand(edge_hz, float(abs(db[0] - db[1])), float(ratio))

    def _values(self, given: dict[str, ArrayLike]) -> dict[str, Real]:
        known = {parameter.name: parameter for parameter in self.parameters}
        unknown = sorted(set(given) - set(known))
        if unknown:
            takes = ", ".join(f"{p.name} [{p.unit or '1'}]" for p in self.parameters) or "none"
            raise ConfigError(
                f"Material {self.name!r} has no parameter {unknown[0]!r}; its parameters: {takes}."
            )
        values = {}
        for parameter in self.parameters:
            value = given.get(parameter.name, parameter.default)
            if value is None:
                raise ConfigError(
                    f"Material {self.name!r} needs {parameter.name} [{parameter.unit or '1'}]: "
                    f"{parameter.meaning}. Give a value."
                )
            values[parameter.name] = real_array(
                f"{parameter.name} of material {self.name!r}",
                value,
                parameter.unit,
                parameter.minimum,
                parameter.maximum,
                parameter.above,
            )
        return values

    def _nearest(self, frequency: Real) -> Real:
        """Return the frequencies, or the nearest edge of a band for those outside all bands."""
        with np.errstate(divide="ignore"):
            edges = np.stack([np.clip(frequency, low, high) for low, high in self.bands_hz])
            near = np.argmin(np.abs(np.log(edges) - np.log(frequency)), axis=0)
        return np.asarray(np.take_along_axis(edges, near[None], axis=0)[0])

    def _within_band(self, frequency: Real, beyond_band: str) -> Real:
        if beyond_band not in BEYOND_BAND:
            raise ConfigError(
                f"Beyond band is {beyond_band!r}; expected one of {', '.join(BEYOND_BAND)}."
            )
        clipped = self._nearest(frequency)
        inside = np.abs(clipped - frequency) <= EDGE_SLACK * clipped
        if beyond_band == "extrapolate":
            return np.where(inside, clipped, frequency)
        if beyond_band == "refuse" and not np.all(inside):
            bad = frequency[~inside].flat[0]
            raise ConfigError(
                f"Material {self.name!r} is not defined at {bad / 1e9:g} GHz: {self.source} "
                f"({self.edition}) holds for {self.band_text}. {self.remedy}"
            )
        return clipped


def _interval_text(low_hz: float, high_hz: float) -> str:
    if low_hz <= 0 and np.isinf(high_hz):
        return "every frequency"
    if low_hz <= 0:
        return f"up to {high_hz / 1e9:g} GHz"
    return f"{low_hz / 1e9:g} to {high_hz / 1e9:g} GHz"


# -------------------------------------------------------------------------------------------------
# Pure water, sea water and ice: the complex relative permittivity, and the models with their bands.
#
# Frequencies are in Hz, temperatures in degC, salinity in psu.
# -------------------------------------------------------------------------------------------------


def debye_permittivity(
    frequency_hz: ArrayLike,
    static_permittivity: ArrayLike,
    infinite_permittivity: ArrayLike,
    relaxation_frequency_hz: ArrayLike,
) -> Complex:
    """Return eps_inf + (eps_s - eps_inf)/(1 - j f/f_r), f_r = 1/(2 pi tau) (Debye 1929).

    Parameters
    ----------
    frequency_hz, relaxation_frequency_hz : f and f_r
    static_permittivity, infinite_permittivity : eps_s and eps_inf

    Returns
    -------
    ndarray
    """
    f, static, infinite = reals(frequency_hz, static_permittivity, infinite_permittivity)
    ratio = f / np.asarray(relaxation_frequency_hz)
    return np.asarray(infinite + (static - infinite) / (1 - 1j * ratio), dtype=np.complex128)


def liebe_permittivity(frequency_hz: ArrayLike, temperature_c: ArrayLike) -> Complex:
    """Return the permittivity of pure water by Liebe, Hufford and Manabe 1991, eq. (1) to (4).

    ITU-R P.527-4 has the same.

    Parameters
    ----------
    frequency_hz, temperature_c

    Returns
    -------
    ndarray
    """
    theta = 300 / (np.asarray(temperature_c, dtype=np.float64) + ZERO_CELSIUS_K) - 1
    static = 77.66 + 103.3 * theta
    middle = 0.0671 * static
    infinite = 3.52 - 7.52 * theta
    first_hz = (20.20 - 146.4 * theta + 316 * theta**2) * 1e9
    return (
        debye_permittivity(frequency_hz, static, middle, first_hz)
        + debye_permittivity(frequency_hz, middle, infinite, 39.8 * first_hz)
        - middle
    )


def kaatze_permittivity(frequency_hz: ArrayLike, temperature_c: ArrayLike) -> Complex:
    """Return the permittivity of pure water by Kaatze 1989, one relaxation.

    J. Chem. Eng. Data 34, 371, eq. (5) to (7).

    Parameters
    ----------
    frequency_hz, temperature_c

    Returns
    -------
    ndarray
    """
    celsius = np.asarray(temperature_c, dtype=np.float64)
    static = 10 ** (1.94404 - 1.991e-3 * celsius)
    infinite = 5.77 - 2.74e-2 * celsius
    kelvin = celsius + ZERO_CELSIUS_K
    tau_s = 3.745e-15 * (1 + 7e-5 * (celsius - 27.5) ** 2) * np.exp(2.2957e3 / kelvin)
    return debye_permittivity(frequency_hz, static, infinite, 1 / (2 * np.pi * tau_s))


def klein_swift_permittivity(
    frequency_hz: ArrayLike, temperature_c: ArrayLike, salinity_psu: ArrayLike
) -> Complex:
    """Return the permittivity of sea water by Klein and Swift 1977 (IEEE Trans. AP-25, 104).

    Eq. (5), (8), (14), (17), (18).

    Parameters
    ----------
    frequency_hz, temperature_c, salinity_psu

    Returns
    -------
    ndarray
    """
    f, t, s = reals(frequency_hz, temperature_c, salinity_psu)
    static = (87.134 - 1.949e-1 * t - 1.276e-2 * t**2 + 2.491e-4 * t**3) * (
        1 + 1.613e-5 * s * t - 3.656e-3 * s + 3.210e-5 * s**2 - 4.232e-7 * s**3
    )
    tau_s = (1.768e-11 - 6.086e-13 * t + 1.104e-14 * t**2 - 8.111e-17 * t**3) * (
        1 + 2.282e-5 * s * t - 7.638e-4 * s - 7.760e-6 * s**2 + 1.105e-8 * s**3
    )
    delta = 25 - t
    beta = (
        2.033e-2
        + 1.266e-4 * delta
        + 2.464e-6 * delta**2
        - s * (1.849e-5 - 2.551e-7 * delta + 2.551e-8 * delta**2)
    )
    at_25_c = s * (0.182521 - 1.46192e-3 * s + 2.09324e-5 * s**2 - 1.28205e-7 * s**3)
    conductivity = at_25_c * np.exp(-delta * beta)
    relaxation = debye_permittivity(f, static, 4.9, 1 / (2 * np.pi * tau_s))
    return relaxation + 1j * conductivity / (2 * np.pi * f * VACUUM_PERMITTIVITY_F_PER_M)


def ice_permittivity(frequency_hz: ArrayLike, temperature_c: ArrayLike) -> Complex:
    """Return the permittivity of pure ice by Maetzler 2006.

    Thermal Microwave Radiation (IET), section 5.3.

    Parameters
    ----------
    frequency_hz, temperature_c

    Returns
    -------
    ndarray
    """
    f_hz, celsius = reals(frequency_hz, temperature_c)
    f_ghz = f_hz / 1e9
    kelvin = celsius + ZERO_CELSIUS_K
    theta = 300 / kelvin - 1
    alpha = (0.00504 + 0.0062 * theta) * np.exp(-22.1 * theta)
    resonance = np.exp(335 / kelvin)
    beta = (
        0.0207 / kelvin * resonance / (resonance - 1) ** 2
        + 1.16e-11 * f_ghz**2
        + np.exp(-9.963 + 0.0372 * celsius)
    )
    return np.asarray(
        3.1884 + 9.1e-4 * celsius + 1j * (alpha / f_ghz + beta * f_ghz), dtype=np.complex128
    )


def _temperature(default: float, minimum: float, maximum: float) -> Parameter:
    return Parameter("temperature_c", "degC", "temperature", default, minimum, maximum)


WATER_MODELS = (
    MaterialModel(
        name="water",
        title="Pure water",
        source="Liebe, Hufford, Manabe, Int. J. Infrared Millimeter Waves 12, 659",
        edition="1991, double Debye; as ITU-R P.527-4",
        bands_hz=((1e6, 1e12),),
        permittivity_of=liebe_permittivity,
        parameters=(_temperature(20.0, -4.0, 40.0),),
    ),
    MaterialModel(
        name="water_kaatze",
        title="Pure water, single relaxation",
        source="Kaatze, J. Chem. Eng. Data 34, 371",
        edition="1989",
        bands_hz=((1.1e9, 57e9),),
        permittivity_of=kaatze_permittivity,
        parameters=(_temperature(20.0, -4.1, 60.0),),
        remedy="Use the model 'water' (Liebe, up to 1 THz), or change the carrier.",
    ),
    MaterialModel(
        name="sea_water",
        title="Sea water",
        source="Klein and Swift, IEEE Trans. Antennas Propag. 25, 104",
        edition="1977",
        # Their fit was made for radiometers below X band; they doubt the relaxation above.
        bands_hz=((0.3e9, 10e9),),
        permittivity_of=klein_swift_permittivity,
        parameters=(
            _temperature(20.0, 0.0, 40.0),
            Parameter("salinity_psu", "psu", "salinity", 35.0, 4.0, 40.0),
        ),
    ),
    MaterialModel(
        name="ice",
        title="Pure ice",
        source="Maetzler, in Thermal Microwave Radiation (IET), section 5.3",
        edition="2006",
        bands_hz=((1e7, 3e12),),
        permittivity_of=ice_permittivity,
        # Below 240 K the real part no longer follows the straight line.
        parameters=(_temperature(-10.0, -33.15, 0.0),),
    ),
)


_ALL_HZ = ((0.0, np.inf),)

TABLE_COLUMNS = (
    ("frequency_ghz", "eps_real", "eps_imag"),
    ("frequency_hz", "eps_real", "eps_imag"),
    ("frequency_ghz", "n", "k"),
    ("frequency_hz", "n", "k"),
)
"""Headers that a material's CSV file may have."""


def _conductor_permittivity(
    frequency_hz: ArrayLike, conductivity_s_per_m: ArrayLike, relative_permittivity: ArrayLike = 1.0
) -> Complex:
    """Return eps' + j sigma/(2 pi f eps_0) (Balanis, Advanced Eng. Electromagnetics, 2-72)."""
    f, sigma, real = reals(frequency_hz, conductivity_s_per_m, relative_permittivity)
    loss = sigma / (2 * np.pi * f * VACUUM_PERMITTIVITY_F_PER_M)
    return np.asarray(real + 1j * loss, dtype=np.complex128)


def _vacuum(frequency_hz: Real) -> Complex:
    return np.ones(frequency_hz.shape, dtype=np.complex128)


def _given_permittivity(frequency_hz: Real, eps_real: Real, eps_imag: Real) -> Complex:
    return np.asarray(eps_real + 1j * eps_imag + 0 * frequency_hz, dtype=np.complex128)


def _given_index(frequency_hz: Real, n: Real, k: Real) -> Complex:
    return np.asarray((n + 1j * k) ** 2 + 0 * frequency_hz, dtype=np.complex128)


def _debye(
    frequency_hz: Real,
    static_permittivity: Real,
    infinite_permittivity: Real,
    relaxation_frequency_hz: Real,
    conductivity_s_per_m: Real,
) -> Complex:
    if np.any(static_permittivity < infinite_permittivity):
        raise ConfigError(
            f"Material 'debye' has the static permittivity {np.min(static_permittivity):g} below "
            f"the infinite one, {np.max(infinite_permittivity):g}: its relaxation amplifies. "
            "Exchange the two, or use the model 'permittivity'."
        )
    relaxation = debye_permittivity(
        frequency_hz, static_permittivity, infinite_permittivity, relaxation_frequency_hz
    )
    return relaxation + _conductor_permittivity(frequency_hz, conductivity_s_per_m, 0.0)


_CONDUCTIVITY = "conductivity_s_per_m"


_OWN, _CONSTANT = "values given by the user", "constant over frequency"
_GENERAL_MODELS = (
    MaterialModel("vacuum", "Vacuum, air", "definition", "exact", _ALL_HZ, _vacuum),
    MaterialModel(
        "permittivity",
        "Permittivity given",
        _OWN,
        _CONSTANT,
        _ALL_HZ,
        _given_permittivity,
        (
            Parameter("eps_real", "", "real part of the relative permittivity"),
            Parameter("eps_imag", "", "its imaginary part, loss >= 0", 0.0, 0.0),
        ),
    ),
    MaterialModel(
        "index",
        "Index of refraction given",
        _OWN,
        _CONSTANT,
        _ALL_HZ,
        _given_index,
        (
            Parameter("n", "", "real part of the index", None, 0.0),
            Parameter("k", "", "its imaginary part, loss >= 0", 0.0, 0.0),
        ),
    ),
    MaterialModel(
        "debye",
        "One Debye relaxation and a conductivity",
        "Debye, Polar Molecules",
        "1929",
        _ALL_HZ,
        _debye,
        (
            Parameter("static_permittivity", "", "permittivity at f = 0", None, 0.0),
            Parameter("infinite_permittivity", "", "permittivity far above f_r", None, 0.0),
            Parameter("relaxation_frequency_hz", "Hz", "f_r = 1/(2 pi tau)", None, above=0.0),
            Parameter(_CONDUCTIVITY, "S/m", "conductivity", 0.0, 0.0),
        ),
    ),
    MaterialModel(
        "conductor",
        "Conductor",
        "Ohm's law in Maxwell's equations",
        "conductivity constant over frequency",
        # Drude relaxation of metals lies in the terahertz; a constant sigma fails there.
        ((0.0, 1e12),),
        _conductor_permittivity,
        (
            Parameter(_CONDUCTIVITY, "S/m", "conductivity, copper 5.8e7", None, 0.0),
            Parameter("relative_permittivity", "", "real part of the permittivity", 1.0, 0.0),
        ),
    ),
)


def _table_model(path: str | Path) -> MaterialModel:
    """Return a medium measured by the user: a CSV file over frequency, rows in any order.

    The permittivity is interpolated linearly over log f: exact at the rows, passive between them.
    The
    band is that of the rows; one row holds at its own frequency only.
    """
    table = read_csv(path, TABLE_COLUMNS)
    columns = table.columns
    in_ghz = "frequency_ghz" in columns
    frequency = table.numbers("frequency_ghz" if in_ghz else "frequency_hz")
    frequency = frequency * (1e9 if in_ghz else 1.0)
    by_index = not {"eps_real", "eps_imag"} <= set(columns)
    real = table.numbers("n" if by_index else "eps_real")
    imag = table.numbers("k" if by_index else "eps_imag")
    name = table.path.name
    for line, f, loss in zip(table.lines, frequency, imag, strict=True):
        if f <= 0:
            raise ConfigError(f"{name}, line {line}: frequency {f:g} Hz; expected more than 0.")
        if loss < 0:
            raise ConfigError(
                f"{name}, line {line}: imaginary part {loss:g} means gain. With exp(-jwt) loss is "
                "positive; change the sign of the column."
            )
    eps = (real + 1j * imag) ** 2 if by_index else real + 1j * imag
    order = np.argsort(frequency, kind="stable")
    frequency, eps = frequency[order], eps[order]
    double = np.flatnonzero(np.diff(frequency) == 0)
    if double.size:
        raise ConfigError(
            f"{name} holds {frequency[double[0]] / 1e9:g} GHz twice; remove one of the rows."
        )
    log_frequency = np.log(frequency)

    def permittivity_of(frequency_hz: Real) -> Complex:
        at = np.log(frequency_hz)
        value = np.interp(at, log_frequency, eps.real) + 1j * np.interp(at, log_frequency, eps.imag)
        if len(eps) > 1:  # beyond the rows, on the line through the last two
            slopes = np.diff(eps) / np.diff(log_frequency)
            value = value + slopes[0] * np.minimum(at - log_frequency[0], 0.0)
            value = value + slopes[-1] * np.maximum(at - log_frequency[-1], 0.0)
        return np.asarray(value, dtype=np.complex128)

    return MaterialModel(
        name=f"table {name}",
        title=f"Table {name}",
        source=f"{len(frequency)} rows of {name}",
        edition="given by the user",
        bands_hz=((float(frequency[0]), float(frequency[-1])),),
        permittivity_of=permittivity_of,
        remedy="Change the carrier, or add rows to the table.",
    )


# -- ITU-R P.2040 ----------------------------------------------------------------------------------

ITU_EDITION = "P.2040-3, 2023, Table 3"
ITU_NEW_EDITION = "P.2040-4, 2025, Table 3, from secondary sources"


class _ItuRow(NamedTuple):
    """Coefficients in a band [GHz]: eps' = a f^b, sigma = c f^d, f in GHz, sigma in S/m."""

    low_ghz: float
    high_ghz: float
    a: float
    b: float
    c: float
    d: float


#: Bands of one material never overlap.
ITU_ROWS: dict[str, tuple[_ItuRow, ...]] = {
    "concrete": (_ItuRow(1, 100, 5.24, 0, 0.0462, 0.7822),),
    "brick": (_ItuRow(1, 40, 3.91, 0, 0.0238, 0.16),),
    "plasterboard": (_ItuRow(1, 100, 2.73, 0, 0.0085, 0.9395),),
    "wood": (_ItuRow(0.001, 100, 1.99, 0, 0.0047, 1.0718),),
    "glass": (
        _ItuRow(0.1, 100, 6.31, 0, 0.0036, 1.3394),
        _ItuRow(220, 450, 5.79, 0, 0.0004, 1.658),
    ),
    "ceiling_board": (
        _ItuRow(1, 100, 1.48, 0, 0.0011, 1.0750),
        _ItuRow(220, 450, 1.52, 0, 0.0029, 1.029),
    ),
    "chipboard": (_ItuRow(1, 100, 2.58, 0, 0.0217, 0.78),),
    "plywood": (_ItuRow(1, 40, 2.71, 0, 0.33, 0),),
    "marble": (_ItuRow(1, 60, 7.074, 0, 0.0055, 0.9262),),
    "floorboard": (_ItuRow(50, 100, 3.66, 0, 0.0044, 1.3515),),
    "metal": (_ItuRow(1, 100, 1, 0, 1e7, 0),),
    "very_dry_ground": (_ItuRow(1, 10, 3, 0, 0.00015, 2.52),),
    "medium_dry_ground": (_ItuRow(1, 10, 15, -0.1, 0.035, 1.63),),
    "wet_ground": (_ItuRow(1, 10, 30, -0.4, 0.15, 1.30),),
}

ITU_NEW_ROWS: dict[str, tuple[_ItuRow, ...]] = {
    "vinyl_tile": (_ItuRow(1, 40, 3.62, 0, 0.0051, 0.8422),),
    "carpet_tile": (_ItuRow(1, 40, 2.08, 0, 0.0009, 0.82),),
    "asphalt_concrete": (_ItuRow(1, 40, 4.83, 0, 0.0108, 1.3969),),
}


def _itu_permittivity(frequency_hz: Real, rows: tuple[_ItuRow, ...]) -> Complex:
    """Return P.2040 eq. (57) to (59) by the row of the nearest band, as the frequencies."""
    f_ghz = frequency_hz / 1e9
    eps = np.empty(f_ghz.shape, dtype=np.complex128)
    outside = [np.abs(np.log(np.clip(f_ghz, r.low_ghz, r.high_ghz) / f_ghz)) for r in rows]
    nearest = np.argmin(outside, axis=0)
    for number, row in enumerate(rows):
        conductivity = row.c * f_ghz**row.d
        loss = conductivity / (2 * np.pi * frequency_hz * VACUUM_PERMITTIVITY_F_PER_M)
        eps = np.where(nearest == number, row.a * f_ghz**row.b + 1j * loss, eps)
    return eps


def _itu_model(name: str, rows: tuple[_ItuRow, ...], edition: str) -> MaterialModel:
    remedy = (
        "Change the carrier, or use the model 'soil' (0.3 to 1.3 and 1.4 to 18 GHz), 'table' or "
        "'permittivity'."
        if name.endswith("_ground")
        else "Change the carrier, or use the model 'conductor'."
        if name == "metal"
        else MaterialModel.remedy
    )
    return MaterialModel(
        name=name,
        title=name.replace("_", " ").capitalize(),
        source="Recommendation ITU-R P.2040",
        edition=edition,
        bands_hz=tuple((row.low_ghz * 1e9, row.high_ghz * 1e9) for row in rows),
        permittivity_of=partial(_itu_permittivity, rows=rows),
        remedy=remedy,
    )


_ITU_MODELS = tuple(
    _itu_model(name, rows, edition)
    for table, edition in ((ITU_ROWS, ITU_EDITION), (ITU_NEW_ROWS, ITU_NEW_EDITION))
    for name, rows in table.items()
)


# -- soil ------------------------------------------------------------------------------------------

_SOLID_DENSITY_G_PER_CM3 = 2.664
_SOLID_PERMITTIVITY = 4.7
_SHAPE = 0.65
_WATER_INFINITE = 4.9
#: Between Peplinski's band and Dobson's.
_DIVIDE_HZ = 1.35e9


def soil_permittivity(
    frequency_hz: ArrayLike,
    moisture: ArrayLike,
    sand: ArrayLike,
    clay: ArrayLike,
    bulk_density_g_per_cm3: ArrayLike,
    temperature_c: ArrayLike,
) -> Complex:
    """Return the complex relative permittivity of moist mineral soil.

    Dobson et al. 1985 (IEEE Trans. GE-23, 35) eq. (28)-(31); Peplinski et al. 1995
    (IEEE Trans. GRS-33, 803) eq. (2)-(10).

    Parameters
    ----------
    frequency_hz : frequency [Hz]
    moisture : water by volume, fraction of 1
    sand, clay : fractions of 1 by weight
    bulk_density_g_per_cm3 : dry bulk density [g/cm^3]
    temperature_c : temperature [degC]

    Returns
    -------
    ndarray
        NaN if the fitted conductivity makes the free water amplify (very sandy soil at low
        frequency).
    """
    f, mv, s, c = reals(frequency_hz, moisture, sand, clay)
    density, t = reals(bulk_density_g_per_cm3, temperature_c)
    low_band = f < _DIVIDE_HZ

    beta_real = 1.2748 - 0.519 * s - 0.152 * c
    beta_imag = 1.33797 - 0.603 * s - 0.166 * c
    conductivity = np.where(
        low_band,
        0.0467 + 0.2204 * density - 0.4111 * s + 0.6614 * c,
        -1.645 + 1.939 * density - 2.25622 * s + 1.594 * c,
    )
    static = 87.134 - 1.949e-1 * t - 1.276e-2 * t**2 + 2.491e-4 * t**3
    omega_tau = f * (1.1109e-10 - 3.824e-12 * t + 6.938e-14 * t**2 - 5.096e-16 * t**3)
    water_real = _WATER_INFINITE + (static - _WATER_INFINITE) / (1 + omega_tau**2)
    solid_fraction = (_SOLID_DENSITY_G_PER_CM3 - density) / (_SOLID_DENSITY_G_PER_CM3 * mv)
    water_imag = omega_tau * (static - _WATER_INFINITE) / (1 + omega_tau**2) + (
        conductivity * solid_fraction / (2 * np.pi * f * VACUUM_PERMITTIVITY_F_PER_M)
    )
    real = (
        1
        + density / _SOLID_DENSITY_G_PER_CM3 * (_SOLID_PERMITTIVITY**_SHAPE - 1)
        + mv**beta_real * water_real**_SHAPE
        - mv
    ) ** (1 / _SHAPE)
    imag = mv ** (beta_imag / _SHAPE) * np.where(water_imag >= 0, water_imag, np.nan)
    real = np.where(low_band, 1.15 * real - 0.68, real)
    return np.asarray(real + 1j * imag, dtype=np.complex128)


def _checked_soil(frequency_hz: Real, **soil: Real) -> Complex:
    total = soil["sand"] + soil["clay"]
    if np.any(total > 1 + 1e-6):
        raise ConfigError(
            f"Sand and clay of material 'soil' add up to {np.max(total):g}; expected at most 1 "
            "(fractions by weight; the rest is silt). Divide percentages by 100."
        )
    return soil_permittivity(frequency_hz, **soil)


_SOIL_MODEL = MaterialModel(
    name="soil",
    title="Moist mineral soil",
    source="Dobson et al., IEEE Trans. GE-23, 35; Peplinski et al., GRS-33, 803",
    edition="1985 from 1.4 GHz; 1995 up to 1.3 GHz",
    bands_hz=((0.3e9, 1.3e9), (1.4e9, 18e9)),
    permittivity_of=_checked_soil,
    parameters=(
        Parameter("moisture", "m^3/m^3", "water by volume", None, 0.01, 0.5),
        Parameter("sand", "", "sand, fraction by weight", 0.4, 0.0, 1.0),
        Parameter("clay", "", "clay, fraction by weight", 0.2, 0.0, 1.0),
        Parameter("bulk_density_g_per_cm3", "g/cm^3", "dry bulk density", 1.3, 0.8, 2.0),
        Parameter("temperature_c", "degC", "temperature", 20.0, 0.0, 40.0),
    ),
)


# -- the library -----------------------------------------------------------------------------------

TABLE = "table"
"""Name under which a CSV file is read; it takes the one parameter ``path``."""


@lru_cache(maxsize=1)
def models() -> MappingProxyType[str, MaterialModel]:
    """Return all models of the library by name (read only)."""
    everything = (*_GENERAL_MODELS, *_ITU_MODELS, *WATER_MODELS, _SOIL_MODEL)
    return MappingProxyType({model.name: model for model in everything})


def material_model(name: str, path: str | Path | None = None) -> MaterialModel:
    """Return a model: its source, edition, band and parameters.

    Parameters
    ----------
    name : key of `models`, or 'table'
    path
        CSV file, for 'table' only. Columns frequency_ghz (or frequency_hz), and eps_real, eps_imag
        or
        n, k.

    Returns
    -------
    MaterialModel

    Raises
    ------
    ConfigError : unknown name, with the nearest ones; 'table' without `path`, another name with it
    """
    if name == TABLE:
        if path is None:
            raise ConfigError("Material 'table' has no path; give a CSV file over frequency.")
        return _table_model(path)
    if path is not None:
        raise ConfigError(f"Material {name!r} takes no path; only 'table' reads a file.")
    found = models().get(name)
    if found is None:
        near = difflib.get_close_matches(name, [*models(), TABLE], n=3)
        hint = f"did you mean {', '.join(near)}? " if near else ""
        raise ConfigError(
            f"There is no material {name!r}: {hint}Known: {', '.join(sorted([*models(), TABLE]))}."
        )
    return found


def material(
    name: str,
    frequency_hz: ArrayLike,
    *,
    path: str | Path | None = None,
    beyond_band: str = "refuse",
    **parameters: ArrayLike,
) -> Complex:
    """Return the complex index of refraction n + jk of a material of the library.

    Parameters
    ----------
    name, path : as for `material_model`
    frequency_hz : frequency [Hz], any shape
    beyond_band : outside the band: 'refuse', 'hold' its nearest edge or 'extrapolate'
    **parameters : values of the model's ``parameters`` by name; they broadcast with `frequency_hz`

    Returns
    -------
    ndarray : Im >= 0
    """
    return material_model(name, path).index(frequency_hz, beyond_band, **parameters)


def permittivity(
    name: str,
    frequency_hz: ArrayLike,
    *,
    path: str | Path | None = None,
    beyond_band: str = "refuse",
    **parameters: ArrayLike,
) -> Complex:
    """Return the complex relative permittivity of a material of the library.

    Parameters
    ----------
    name, frequency_hz, path, beyond_band, **parameters : as for `material`

    Returns
    -------
    ndarray : Im >= 0
    """
    return material_model(name, path).permittivity(frequency_hz, beyond_band, **parameters)
