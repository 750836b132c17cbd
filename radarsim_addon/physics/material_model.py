# SPDX-License-Identifier: GPL-3.0-or-later
"""Material models: an equation, its source, and its band of validity.

Convention everywhere: exp(-j w t), so a passive medium has Im(eps) >= 0 and Im(n) >= 0.
All media are non-magnetic (mu = 1): n = sqrt(eps).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..array_types import Complex, Real
from ..errors import ConfigError
from .checks import EDGE_SLACK, real_array, require_one_shape


@dataclass(frozen=True)
class Parameter:
    """One number that a model takes.

    Attributes
    ----------
    name, unit, meaning : Texts for users
    default : Value if none is given; None: it must be given
    minimum, maximum : Closed bounds; None: no bound
    above : Open lower bound; None: no bound
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
    name : Key in the registry
    title : Name for people
    source, edition : Publication of the equation or the numbers, and its edition
    bands_hz : Frequency intervals [Hz], both ends included, in which the source declares it valid
    permittivity_of
        Equation: (frequency_hz, **parameters) -> complex relative permittivity, without checks.
    parameters : Its other parameters
    remedy : Advice for frequencies outside the band
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

    def permittivity(self, frequency_hz: ArrayLike, **parameters: ArrayLike) -> Complex:
        """Return the complex relative permittivity.

        Parameters
        ----------
        frequency_hz : Frequency [Hz], any shape; parameters broadcast with it
        **parameters : Values of the model's `parameters` by name

        Returns
        -------
        ndarray : Complex, of the broadcast shape

        Raises
        ------
        ConfigError
            Frequency or a parameter outside the valid range, NaN, an unknown or missing parameter,
            or numbers for which the equation gives a medium that amplifies.
        """
        frequency = real_array("Frequency", frequency_hz, "Hz", above=0.0)
        values = self._values(parameters)
        require_one_shape(frequency_hz=frequency, **values)
        frequency = self._within_band(frequency)
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

    def index(self, frequency_hz: ArrayLike, **parameters: ArrayLike) -> Complex:
        """Return the complex index of refraction, n + jk = sqrt(eps), Re >= 0 and Im >= 0."""
        return _passive_index(self.permittivity(frequency_hz, **parameters))

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

    def _within_band(self, frequency: Real) -> Real:
        inside = np.zeros(frequency.shape, dtype=bool)
        clipped = frequency
        for low, high in self.bands_hz:
            here = (frequency >= low * (1 - EDGE_SLACK)) & (frequency <= high * (1 + EDGE_SLACK))
            clipped = np.where(here & ~inside, np.clip(frequency, low, high), clipped)
            inside |= here
        if not np.all(inside):
            bad = frequency[~inside].flat[0]
            raise ConfigError(
                f"Material {self.name!r} is not defined at {bad / 1e9:g} GHz: {self.source} "
                f"({self.edition}) holds for {self.band_text}. {self.remedy}"
            )
        return clipped


def _passive_index(permittivity: Complex) -> Complex:
    """Return n + jk = sqrt(eps), the root of a passive medium: Re >= 0 and Im >= 0."""
    # A lossless plasma, eps = -a - j0, must not fall on the other side of the branch cut.
    root = np.sqrt(permittivity.real + 1j * np.abs(permittivity.imag))
    return np.asarray(root, dtype=np.complex128)


def _interval_text(low_hz: float, high_hz: float) -> str:
    if low_hz <= 0 and np.isinf(high_hz):
        return "every frequency"
    if low_hz <= 0:
        return f"up to {high_hz / 1e9:g} GHz"
    return f"{low_hz / 1e9:g} to {high_hz / 1e9:g} GHz"
