# SPDX-License-Identifier: GPL-3.0-or-later
"""Linear and planar arrays: uniform or tapered, steered by phase."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..array_types import Real
from ..errors import ConfigError, MissingDependencyError
from .antennas import direction_from_angles, unit_directions
from .checks import real_array

TAPERS = ("uniform", "hamming", "hann", "taylor", "chebyshev")
"""Amplitude tapers by name; the last two come from scipy."""
MAX_ELEMENT_EXPONENT = 1000.0
"""Largest power of the cosine of an element. Its gain is 33 dBi; narrower ones are integrated with
errors."""


def taper_weights(taper: str | tuple[float, ...], count: int) -> Real:
    """Return the amplitudes of the elements of an array.

    Parameters
    ----------
    taper
        Name of `TAPERS` ('taylor' is nbar 4, -35 dB; 'chebyshev' -50 dB), or one weight per
        element.
    count
        Number of elements.

    Returns
    -------
    ndarray
        Amplitudes, (count,).

    Raises
    ------
    ConfigError
        Unknown name, wrong number of weights, NaN, or a sum of zero.
    MissingDependencyError : 'taylor' or 'chebyshev' without scipy
    """
    if not isinstance(taper, str):
        weights = real_array("Taper", taper)
        if weights.shape != (count,):
            raise ConfigError(
                f"Taper has {weights.size} weights; expected {count}, one per element."
            )
    elif taper == "uniform" or count == 1:
        weights = np.ones(count)
    elif taper == "hamming":
        weights = np.hamming(count)
    elif taper == "hann":
        # Without the zeros at both ends, which would be elements that do nothing.
        weights = np.hanning(count + 2)[1:-1]
    elif taper in ("taylor", "chebyshev"):
        try:
            from scipy.signal import windows
        except ImportError:
            raise MissingDependencyError(
                f"Taper {taper!r} needs scipy, which is not installed; use 'hamming', or give the "
                "weights one by one."
            ) from None
        made = (
            windows.taylor(count, nbar=4, sll=35, norm=False)
            if taper == "taylor"
            else windows.chebwin(count, at=50)
        )
        weights = np.asarray(made, dtype=np.float64)
    else:
        raise ConfigError(f"Taper is {taper!r}; expected one of {', '.join(TAPERS)}, or weights.")
    if not abs(weights.sum()) > 0:
        raise ConfigError(
            "The weights of the taper add up to zero, so the array has no gain on boresight. Give "
            "weights with a sum other than zero."
        )
    return weights


#: Time of the gain's integral: elements times wavelengths; some seconds for as many.
_MOST_WORK = 1e7


@dataclass(frozen=True)
class PlanarArray:
    """Grid of equal elements in the plane across boresight; one row is a linear array.

    |AF|^2 times the element's power pattern, scaled to 4 pi over its integral (mutual coupling is
    left out). AF = AF_x AF_y, AF_x = sum_m w_m exp(j k d_x m (x - x_0)), x the direction's
    component to the right, x_0 that of the steered direction (Balanis, Antenna Theory, 6.10).

    Parameters
    ----------
    columns, rows
        Elements to the right and up.
    column_spacing_m, row_spacing_m
        Distances between them [m].
    wavelength_m
        Wavelength [m].
    steer_azimuth_rad, steer_elevation_rad
        Direction of the beam [rad].
    column_taper, row_taper
        Name of `TAPERS` or one weight per element.
    element_exponent
        Element's power pattern cos^q ahead and 0 behind, q from 0 to `MAX_ELEMENT_EXPONENT`; None:
        isotropic on both sides.
    efficiency
        Radiated over accepted power, 0 to 1.
    """

    columns: int
    rows: int
    column_spacing_m: float
    row_spacing_m: float
    wavelength_m: float
    steer_azimuth_rad: float = 0.0
    steer_elevation_rad: float = 0.0
    column_taper: str | tuple[float, ...] = "uniform"
    row_taper: str | tuple[float, ...] = "uniform"
    element_exponent: float | None = 1.0
    efficiency: float = 1.0

    def __post_init__(self) -> None:
        for name, count in (("columns", self.columns), ("rows", self.rows)):
            if not (isinstance(count, int) and count >= 1):
                raise ConfigError(f"Array has {count!r} {name}; expected an integer from 1 up.")
        real_array("Column spacing", self.column_spacing_m, "m", above=0.0)
        real_array("Row spacing", self.row_spacing_m, "m", above=0.0)
        real_array("Wavelength", self.wavelength_m, "m", above=0.0)
        self._check_size()
        real_array("Steering azimuth", self.steer_azimuth_rad, "rad", -np.pi / 2, np.pi / 2)
        real_array("Steering elevation", self.steer_elevation_rad, "rad", -np.pi / 2, np.pi / 2)
        real_array("Efficiency", self.efficiency, "", None, 1.0, above=0.0)
        if self.element_exponent is not None:
            real_array("Element exponent", self.element_exponent, "", 0.0, MAX_ELEMENT_EXPONENT)
        taper_weights(self.column_taper, self.columns)
        taper_weights(self.row_taper, self.rows)

    def _check_size(self) -> None:
        elements = self.columns * self.rows
        if elements <= _MOST_WORK:
            sides = [
                (count - 1) * spacing / self.wavelength_m for _, count, spacing in self._axes()
            ]
            if elements * max(math.hypot(*sides), 1.0) <= _MOST_WORK:
                return
        raise ConfigError(
            f"Array of {self.columns} x {self.rows} elements is too large for its gain to be "
            f"computed; expected at most {_MOST_WORK:g} for elements times diagonal in wavelengths "
            "(200 x 200 elements half a wavelength apart have 5.6e6)."
        )

    @property
    def grating_lobes(self) -> bool:
        """Whether another full lobe is in visible space, ahead or at its edge."""
        steered = direction_from_angles(self.steer_azimuth_rad, self.steer_elevation_rad)
        for axis, count, spacing in self._axes():
            step = self.wavelength_m / spacing
            if count > 1 and abs(steered[axis]) + 1 >= step * (1 - 1e-12):
                return True
        return False

    def _axes(self) -> tuple[tuple[int, int, float], tuple[int, int, float]]:
        return (0, self.columns, self.column_spacing_m), (1, self.rows, self.row_spacing_m)

    @cached_property
    def _weights(self) -> tuple[Real, Real]:
        return (
            taper_weights(self.column_taper, self.columns),
            taper_weights(self.row_taper, self.rows),
        )

    @cached_property
    def _scale(self) -> float:
        """Efficiency times 4 pi over the integral of element pattern times |AF|^2.

        |AF|^2 is a sum over separations of elements; the integral of cos^q exp(j k.r) over the half
        space depends on |r| alone. Exact, and no sphere has to be sampled.
        """
        steered = direction_from_angles(self.steer_azimuth_rad, self.steer_elevation_rad)
        factors, offsets = [], []
        for (axis, count, spacing), weights in zip(self._axes(), self._weights, strict=True):
            lag = np.arange(count)
            correlation = np.correlate(weights, weights, "full")[count - 1 :]
            phase = 2 * np.pi * spacing / self.wavelength_m * lag * steered[axis]
            factors.append(correlation * np.cos(phase) * np.where(lag == 0, 1, 2))
            offsets.append(lag * spacing / self.wavelength_m)
        separation = np.hypot(offsets[0][:, None], offsets[1][None, :])
        kernel = _element_kernel(self.element_exponent)
        integral = sum(
            float(factor * (kernel(row) @ factors[1]))
            for factor, row in zip(factors[0], separation, strict=True)
        )
        return 4 * np.pi / integral * self.efficiency

    @property
    def peak_gain(self) -> float:
        """Gain in the steered direction."""
        return float(
            self.gain(direction_from_angles(self.steer_azimuth_rad, self.steer_elevation_rad))
        )

    def gain(self, directions: ArrayLike) -> Real:
        """Return the power gain, (...), in directions (..., 3) of the antenna's frame."""
        unit = unit_directions(directions)
        steered = direction_from_angles(self.steer_azimuth_rad, self.steer_elevation_rad)
        pattern = np.ones(unit.shape[:-1])
        for (axis, _, spacing), weights in zip(self._axes(), self._weights, strict=True):
            phase = 2 * np.pi * spacing / self.wavelength_m * (unit[..., axis] - steered[axis])
            pattern = pattern * np.abs(_polynomial(weights, np.exp(1j * phase))) ** 2
        if self.element_exponent is not None:
            ahead = -unit[..., 2]
            element = np.maximum(ahead, 0.0) ** self.element_exponent
            pattern = np.where(ahead > 0, pattern * element, 0.0)
        return np.asarray(self._scale * pattern, dtype=np.float64)


def _polynomial(weights: Real, z: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return sum_m w_m z^m by Horner: memory does not grow with the elements."""
    total = np.full(z.shape, weights[-1], dtype=np.complex128)
    for weight in weights[-2::-1]:
        total = total * z + weight
    return total


def _element_kernel(exponent: float | None) -> Callable[[Real], Real]:
    """Return the integral of the element pattern times exp(j k.r) over directions."""
    if exponent is None:
        return lambda separation: np.asarray(4 * np.pi * np.sinc(2 * separation), dtype=np.float64)
    q = float(exponent)
    # Split off the component along r: B_q int cos^(q+1)(b) cos(2 pi r sin b) db over +-pi/2.
    around = math.sqrt(np.pi) * math.exp(math.lgamma((q + 1) / 2) - math.lgamma(q / 2 + 1))
    nodes, weights = np.polynomial.legendre.leggauss(24)

    def kernel(separation: Real) -> Real:
        # 24 nodes carry three waves of a panel to 1e-16
        panels = 5 + int(np.ceil(np.max(separation) / 3))
        starts = np.arange(panels)[:, None] / panels
        angle = (np.pi / 2 * (starts + (nodes + 1) / (2 * panels))).ravel()
        weight = np.tile(np.pi / 2 * weights / (2 * panels), panels) * np.cos(angle) ** (q + 1)
        waves = np.cos(2 * np.pi * separation[:, None] * np.sin(angle))
        return np.asarray(2 * around * (waves @ weight), dtype=np.float64)

    return kernel
