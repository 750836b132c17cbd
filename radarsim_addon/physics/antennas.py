# SPDX-License-Identifier: GPL-3.0-or-later
"""Antenna patterns: power gain against direction.

Directions are unit vectors in the antenna's own frame, which is that of Blender's cameras and
lights: boresight along -Z, +X to the right, +Y up, seen from behind the antenna.

    azimuth   = atan2(x, -z)   positive to the right, -180 to 180 degrees
    elevation = asin(y)        positive up, -90 to 90 degrees

Gain is linear, over isotropic; a lossless antenna's gain is its directivity, 4 pi over the
integral of the pattern over the sphere. Callers need only ``antenna.gain(directions)``.
Arrays are in arrays.py, tables in antenna_table.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..array_types import Real
from ..errors import ConfigError
from .checks import real_array


@cache
def gauss_legendre(count: int) -> tuple[Real, Real]:
    """Nodes and weights on [-1, 1], (count,) each: found once, as it takes as long as a frame."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    nodes.setflags(write=False)
    weights.setflags(write=False)
    return nodes, weights


class Antenna(Protocol):
    """An object with a gain against direction."""

    def gain(self, directions: ArrayLike) -> Real:
        """Return the power gain over isotropic, linear, (...), in directions (..., 3)."""
        ...


def direction_from_angles(azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> Real:
    """Return unit vectors in the antenna's frame.

    Parameters
    ----------
    azimuth_rad, elevation_rad
        Angles of any shapes that broadcast [rad].

    Returns
    -------
    ndarray
        Directions, (..., 3).
    """
    azimuth, elevation = np.broadcast_arrays(
        np.asarray(azimuth_rad, dtype=np.float64), np.asarray(elevation_rad, dtype=np.float64)
    )
    flat = np.cos(elevation)
    return np.stack([flat * np.sin(azimuth), np.sin(elevation), -flat * np.cos(azimuth)], axis=-1)


def angles_from_direction(directions: ArrayLike) -> tuple[Real, Real]:
    """Return azimuth and elevation of vectors.

    Parameters
    ----------
    directions
        Vectors of any length in the antenna's frame, (..., 3).

    Returns
    -------
    azimuth, elevation
        Angles, (...) [rad].
    """
    x, y, z = np.moveaxis(unit_directions(directions), -1, 0)
    # hypot keeps the digits near the poles, where asin(y) loses them.
    return np.arctan2(x, -z), np.arctan2(y, np.hypot(x, z))


def unit_directions(directions: ArrayLike) -> Real:
    """Scale vectors to length 1.

    Parameters
    ----------
    directions
        Vectors, (..., 3).

    Returns
    -------
    ndarray
        Unit vectors, (..., 3).

    Raises
    ------
    ConfigError
        NaN, a vector of length zero, or a last axis other than 3.
    """
    vectors = real_array("Direction", directions)
    if vectors.ndim == 0 or vectors.shape[-1] != 3:
        raise ConfigError(f"Directions have the shape {vectors.shape}; expected [..., 3].")
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    if np.any(length == 0):
        raise ConfigError("A direction has length zero; expected a vector from the antenna.")
    return np.asarray(vectors / length, dtype=np.float64)


def to_antenna_frame(matrix_world: ArrayLike, directions_world: ArrayLike) -> Real:
    """Rotate world directions into the frame of an antenna.

    Parameters
    ----------
    matrix_world
        Pose of the antenna, (4, 4) or (3, 3). Only its rotation is used; a scale has no effect.
    directions_world
        Directions in the world, (..., 3).

    Returns
    -------
    ndarray
        Unit vectors, (..., 3).

    Raises
    ------
    ConfigError
        The matrix has another shape, or a direction is NaN or zero.
    """
    matrix = real_array("Pose matrix", matrix_world)
    if matrix.shape not in ((3, 3), (4, 4)):
        raise ConfigError(f"Pose matrix has the shape {matrix.shape}; expected 4x4.")
    rotation = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
    return unit_directions(directions_world) @ rotation


def two_way_gain(transmit: Antenna, receive: Antenna, directions: ArrayLike) -> Real:
    """Return the product of both gains: the monostatic two-way pattern.

    Parameters
    ----------
    transmit, receive : Antennas
    directions
        Directions in the common frame, (..., 3).

    Returns
    -------
    ndarray
        Gain over isotropic, squared, (...).
    """
    return transmit.gain(directions) * receive.gain(directions)


def sphere_mean(antenna: Antenna, latitudes: int = 181, longitudes: int = 360) -> float:
    """Return the mean gain over the sphere: 1 for a lossless antenna.

    Parameters
    ----------
    antenna
        Antenna to integrate.
    latitudes, longitudes
        Nodes per hemisphere and around boresight; use several per sidelobe for large apertures.

    Returns
    -------
    float
        Mean gain, linear.

    Notes
    -----
    Gauss-Legendre in the cosine of the angle from boresight, each hemisphere separately since many
    patterns end at 90 degrees; equal steps around boresight.
    """
    nodes, weights = gauss_legendre(latitudes)
    phi = 2 * np.pi * (np.arange(longitudes) + 0.5) / longitudes
    total = 0.0
    for centre in (-0.5, 0.5):
        for cosine, weight in zip(centre + nodes / 2, weights / 2, strict=True):
            sine = np.sqrt((1 - cosine) * (1 + cosine))
            ring = np.stack(
                [sine * np.cos(phi), sine * np.sin(phi), np.full_like(phi, -cosine)], axis=-1
            )
            total += weight * float(np.mean(antenna.gain(ring)))
    return total / 2


def _positive(name: str, value: float, unit: str, maximum: float | None = None) -> float:
    return float(real_array(name, value, unit, None, maximum, above=0.0))


@dataclass(frozen=True)
class Isotropic:
    """The same gain in all directions.

    Parameters
    ----------
    efficiency
        Radiated over accepted power, 0 to 1.
    """

    efficiency: float = 1.0

    def __post_init__(self) -> None:
        _positive("Efficiency", self.efficiency, "", 1.0)

    def gain(self, directions: ArrayLike) -> Real:
        """Return the power gain, (...), in directions (..., 3)."""
        return np.full(unit_directions(directions).shape[:-1], float(self.efficiency))


@dataclass(frozen=True)
class CosinePower:
    """Power pattern cos^q of the angle from boresight, 0 behind.

    Parameters
    ----------
    exponent
        q, 0 or more. Directivity 2 (q + 1) (Balanis, Antenna Theory, problem 2.20; exact).
    efficiency
        Radiated over accepted power, 0 to 1.
    """

    exponent: float
    efficiency: float = 1.0

    def __post_init__(self) -> None:
        real_array("Exponent", self.exponent, "", minimum=0.0)
        _positive("Efficiency", self.efficiency, "", 1.0)

    @classmethod
    def from_beamwidth(cls, half_power_rad: float, efficiency: float = 1.0) -> CosinePower:
        """Return the pattern with a full width at half power.

        Parameters
        ----------
        half_power_rad
            Full width, more than 0 and less than pi [rad].
        efficiency
            Radiated over accepted power, 0 to 1.

        Returns
        -------
        CosinePower
            The pattern.

        Raises
        ------
        ConfigError
            The width is not between 0 and pi.
        """
        half = _positive("Beamwidth", half_power_rad, "rad") / 2
        if half >= np.pi / 2:
            raise ConfigError(
                f"Beamwidth {half_power_rad:g} rad is not below pi; use Isotropic, or give degrees "
                "as radians."
            )
        return cls(float(np.log(0.5) / np.log(np.cos(half))), efficiency)

    @property
    def peak_gain(self) -> float:
        """Gain on boresight."""
        return 2 * (self.exponent + 1) * self.efficiency

    @property
    def half_power_beamwidth_rad(self) -> float:
        """Full width at half power, 2 acos(2^(-1/q)); pi for q = 0."""
        return 2 * float(np.arccos(0.5 ** (1 / self.exponent))) if self.exponent else float(np.pi)

    def gain(self, directions: ArrayLike) -> Real:
        """Return the power gain, (...), in directions (..., 3)."""
        cosine = -unit_directions(directions)[..., 2]
        ahead = np.maximum(cosine, 0.0) ** self.exponent
        return np.asarray(np.where(cosine > 0, self.peak_gain * ahead, 0.0), dtype=np.float64)


@dataclass(frozen=True)
class Gaussian:
    """exp(-4 ln2 ((az/az_3dB)^2 + (el/el_3dB)^2)) in azimuth and elevation.

    Parameters
    ----------
    azimuth_beamwidth_rad, elevation_beamwidth_rad
        Full widths at half power, up to pi [rad].
    efficiency
        Radiated over accepted power, 0 to 1.
    """

    azimuth_beamwidth_rad: float
    elevation_beamwidth_rad: float
    efficiency: float = 1.0

    def __post_init__(self) -> None:
        _positive("Azimuth beamwidth", self.azimuth_beamwidth_rad, "rad", np.pi)
        _positive("Elevation beamwidth", self.elevation_beamwidth_rad, "rad", np.pi)
        _positive("Efficiency", self.efficiency, "", 1.0)

    @cached_property
    def peak_gain(self) -> float:
        """4 pi over the integral of the pattern, times efficiency.

        About 16 ln2 / (az_3dB el_3dB) for narrow beams.
        """
        # Separable in (azimuth, elevation): two line integrals, over the part that matters.
        nodes, weights = gauss_legendre(200)

        def line(width: float, limit: float, cosine: bool) -> float:
            reach = min(limit, 4 * width)
            at = reach * nodes
            value = np.exp(-4 * np.log(2) * (at / width) ** 2)
            return float(reach * np.sum(weights * value * (np.cos(at) if cosine else 1.0)))

        azimuth = line(self.azimuth_beamwidth_rad, np.pi, False)
        elevation = line(self.elevation_beamwidth_rad, np.pi / 2, True)
        return float(4 * np.pi / (azimuth * elevation) * self.efficiency)

    def gain(self, directions: ArrayLike) -> Real:
        """Return the power gain, (...), in directions (..., 3)."""
        azimuth, elevation = angles_from_direction(directions)
        exponent = (azimuth / self.azimuth_beamwidth_rad) ** 2 + (
            elevation / self.elevation_beamwidth_rad
        ) ** 2
        return np.asarray(self.peak_gain * np.exp(-4 * np.log(2) * exponent), dtype=np.float64)


@dataclass(frozen=True)
class Aperture:
    """Uniformly lit rectangular aperture: sinc^2(W x/lambda) sinc^2(H y/lambda) ahead, 0 behind.

    x and y are the direction's components to the right and up (Balanis, Antenna Theory, 12.5.1,
    without obliquity factor). Half-power width 2 asin(0.4429 lambda/W); directivity tends to 4 pi W
    H / lambda^2.

    Parameters
    ----------
    width_m, height_m
        W and H [m].
    wavelength_m
        lambda [m].
    efficiency
        Radiated over accepted power, 0 to 1.
    """

    width_m: float
    height_m: float
    wavelength_m: float
    efficiency: float = 1.0

    def __post_init__(self) -> None:
        _positive("Aperture width", self.width_m, "m")
        _positive("Aperture height", self.height_m, "m")
        _positive("Wavelength", self.wavelength_m, "m")
        _positive("Efficiency", self.efficiency, "", 1.0)

    @cached_property
    def peak_gain(self) -> float:
        """4 pi over the integral of the pattern over the half space ahead, times efficiency."""
        a, b = self.width_m / self.wavelength_m, self.height_m / self.wavelength_m
        # The integral over the hemisphere is that over the unit disc of dx dy / sqrt(1-x^2-y^2). By
        # Parseval it is a mean over separations in the aperture of sinc(2 r), r in wavelengths:
        # smooth, whatever the size; (1-|u|)(1-|v|) is the aperture's autocorrelation.
        u, u_weight = _panels(a)
        v, v_weight = _panels(b)
        u_weight, v_weight = u_weight * (1 - u), v_weight * (1 - v)
        # Row by row: a kilometre of aperture must not fill the memory.
        rows = (float(np.sinc(2 * np.hypot(a * at, b * v)) @ v_weight) for at in u)
        integral = 2 * np.pi * 4 * sum(w * row for w, row in zip(u_weight, rows, strict=True))
        return float(4 * np.pi / integral * self.efficiency)

    def gain(self, directions: ArrayLike) -> Real:
        """Return the power gain, (...), in directions (..., 3)."""
        x, y, z = np.moveaxis(unit_directions(directions), -1, 0)
        field = np.sinc(self.width_m / self.wavelength_m * x) * np.sinc(
            self.height_m / self.wavelength_m * y
        )
        return np.asarray(np.where(z < 0, self.peak_gain * field**2, 0.0), dtype=np.float64)


def _panels(size: float) -> tuple[Real, Real]:
    """Return Gauss-Legendre nodes and weights on [0, 1], 10 per wavelength of `size`."""
    count = int(np.ceil(size)) + 1
    nodes, weights = gauss_legendre(10)
    starts = np.arange(count)[:, None] / count
    return (starts + (nodes + 1) / (2 * count)).ravel(), np.tile(weights / (2 * count), count)
