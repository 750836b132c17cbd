# SPDX-License-Identifier: GPL-3.0-or-later
"""Material models: an equation, its source, and its band of validity.

A `MaterialModel` gives the relative permittivity eps at a frequency, and n = sqrt(eps): all media
are non-magnetic (mu = 1). Beyond its band it takes the nearest edge, continues its equation, or
refuses; `out_of_band` tells what the choice may cost.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Complex, Real
from ..errors import ConfigError
from .checks import EDGE_SLACK, real_array, require_one_shape

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
