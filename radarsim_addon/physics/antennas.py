# SPDX-License-Identifier: GPL-3.0-or-later
"""Antenna patterns: power gain against direction.

Directions are unit vectors in the antenna's own frame, which is that of Blender's cameras and
lights: boresight along -Z, +X to the right, +Y up, seen from behind the antenna.

    azimuth   = atan2(x, -z)   positive to the right, -180 to 180 degrees
    elevation = asin(y)        positive up, -90 to 90 degrees

Gain is linear, over isotropic. A lossless antenna's gain is its directivity, 4 pi over the integral
of the pattern over the sphere: each class scales its pattern by that integral, in closed form or by
quadrature. There are simple patterns, arrays that are steered by phase (`PlanarArray`), and
patterns from CSV files (`read_pattern`). Callers need only ``antenna.gain(directions)``: directions
(..., 3), gain (...).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Real, reals
from ..errors import ConfigError
from .checks import CsvTable, read_csv, real_array


@cache
def gauss_legendre(count: int) -> tuple[Real, Real]:
    """Return nodes and weights on [-1, 1]; cached, as finding them takes as long as a frame.

    Parameters
    ----------
    count : number of nodes

    Returns
    -------
    tuple of ndarray : (count,) each, read only
    """
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
    """Return unit vectors.

    Parameters
    ----------
    azimuth_rad, elevation_rad : angles of any shapes that broadcast [rad]

    Returns
    -------
    ndarray : directions, (..., 3)
    """
    azimuth, elevation = np.broadcast_arrays(*reals(azimuth_rad, elevation_rad))
    flat = np.cos(elevation)
    return np.stack([flat * np.sin(azimuth), np.sin(elevation), -flat * np.cos(azimuth)], axis=-1)


def angles_from_direction(directions: ArrayLike) -> tuple[Real, Real]:
    """Return azimuth and elevation of vectors.

    Parameters
    ----------
    directions : vectors of any length, (..., 3)

    Returns
    -------
    azimuth, elevation : angles, (...) [rad]
    """
    x, y, z = np.moveaxis(unit_directions(directions), -1, 0)
    # hypot keeps the digits near the poles, where asin(y) loses them.
    return np.arctan2(x, -z), np.arctan2(y, np.hypot(x, z))


def unit_directions(directions: ArrayLike) -> Real:
    """Scale vectors to length 1.

    Parameters
    ----------
    directions : vectors, (..., 3)

    Returns
    -------
    ndarray : unit vectors, (..., 3)

    Raises
    ------
    ConfigError : a vector of length zero, or a last axis other than 3
    """
    vectors = real_array("Direction", directions)
    if vectors.ndim == 0 or vectors.shape[-1] != 3:
        raise ConfigError(f"Directions have the shape {vectors.shape}; expected [..., 3].")
    # by components: numpy is slow along an axis of three
    x, y, z = columns = np.moveaxis(vectors, -1, 0)
    length = np.sqrt(x * x + y * y + z * z)
    if np.any(length == 0):
        raise ConfigError("A direction has length zero; expected a vector from the antenna.")
    return np.moveaxis(np.asarray(columns / length), 0, -1)


def to_antenna_frame(matrix_world: ArrayLike, directions_world: ArrayLike) -> Real:
    """Rotate world directions into the frame of an antenna.

    Parameters
    ----------
    matrix_world : pose of the antenna, (4, 4) or (3, 3); a scale has no effect
    directions_world : directions in the world, (..., 3)

    Returns
    -------
    ndarray : unit vectors, (..., 3)

    Raises
    ------
    ConfigError : the matrix has another shape
    """
    matrix = real_array("Pose matrix", matrix_world)
    if matrix.shape not in ((3, 3), (4, 4)):
        raise ConfigError(f"Pose matrix has the shape {matrix.shape}; expected 4x4.")
    rotation = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
    return unit_directions(directions_world) @ rotation


def sphere_mean(antenna: Antenna, latitudes: int = 181, longitudes: int = 360) -> float:
    """Return the mean gain over the sphere: 1 for a lossless antenna.

    Gauss-Legendre in the cosine of the angle from boresight, each hemisphere separately since many
    patterns end at 90 degrees; equal steps around boresight.

    Parameters
    ----------
    antenna : antenna to integrate
    latitudes, longitudes
        Nodes per hemisphere and around boresight; several per sidelobe for large apertures.

    Returns
    -------
    float
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
    efficiency : radiated over accepted power, 0 to 1; the same in all classes
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
    exponent : q, 0 or more; directivity 2 (q + 1) (Balanis, Antenna Theory, problem 2.20; exact)
    efficiency : see `Isotropic`
    """

    exponent: float
    efficiency: float = 1.0

    def __post_init__(self) -> None:
        real_array("Exponent", self.exponent, "", minimum=0.0)
        _positive("Efficiency", self.efficiency, "", 1.0)

    @classmethod
    def from_beamwidth(cls, half_power_rad: float, efficiency: float = 1.0) -> CosinePower:
        """Return the pattern with a full width at half power, above 0 and below pi [rad]."""
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

    def gain(self, directions: ArrayLike) -> Real:
        """Return the power gain, (...), in directions (..., 3)."""
        cosine = -unit_directions(directions)[..., 2]
        ahead = np.maximum(cosine, 0.0) ** self.exponent
        return np.asarray(np.where(cosine > 0, self.peak_gain * ahead, 0.0))


@dataclass(frozen=True)
class Gaussian:
    """exp(-4 ln2 ((az/az_3dB)^2 + (el/el_3dB)^2)) in azimuth and elevation.

    Parameters
    ----------
    azimuth_beamwidth_rad, elevation_beamwidth_rad : full widths at half power, up to pi [rad]
    efficiency : see `Isotropic`
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
        """Gain on boresight, about 16 ln2 / (az_3dB el_3dB) for narrow beams."""
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
        return np.asarray(self.peak_gain * np.exp(-4 * np.log(2) * exponent))


@dataclass(frozen=True)
class Aperture:
    """Uniformly lit rectangular aperture: sinc^2(W x/lambda) sinc^2(H y/lambda) ahead, 0 behind.

    x and y are the direction's components to the right and up (Balanis, Antenna Theory, 12.5.1,
    without obliquity factor). Half-power width 2 asin(0.4429 lambda/W); directivity tends to 4 pi W
    H / lambda^2.

    Parameters
    ----------
    width_m, height_m, wavelength_m : W, H and lambda [m]
    efficiency : see `Isotropic`
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
        """Gain on boresight."""
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
        return np.asarray(np.where(z < 0, self.peak_gain * field**2, 0.0))


def _panels(size: float) -> tuple[Real, Real]:
    """Return Gauss-Legendre nodes and weights on [0, 1], 10 per wavelength of `size`."""
    count = int(np.ceil(size)) + 1
    nodes, weights = gauss_legendre(10)
    starts = np.arange(count)[:, None] / count
    return (starts + (nodes + 1) / (2 * count)).ravel(), np.tile(weights / (2 * count), count)


# -- arrays ----------------------------------------------------------------------------------------

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
    count : number of elements

    Returns
    -------
    ndarray : amplitudes, (count,)

    Raises
    ------
    ConfigError : unknown name, wrong number of weights, NaN, or a sum of zero
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
        from scipy.signal import windows  # not at import: slow

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
    columns, rows : elements to the right and up
    column_spacing_m, row_spacing_m : distances between them [m]
    wavelength_m : wavelength [m]
    steer_azimuth_rad, steer_elevation_rad : direction of the beam, up to pi/2 [rad]
    column_taper, row_taper : as for `taper_weights`
    element_exponent
        Element's power pattern cos^q ahead and 0 behind, q from 0 to `MAX_ELEMENT_EXPONENT`; None:
        isotropic on both sides.
    efficiency : see `Isotropic`
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
        """Return the power gain, (...), in directions (..., 3)."""
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
        return np.asarray(self._scale * pattern)


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
    nodes, weights = gauss_legendre(24)

    def kernel(separation: Real) -> Real:
        # 24 nodes carry three waves of a panel to 1e-16
        panels = 5 + int(np.ceil(np.max(separation) / 3))
        starts = np.arange(panels)[:, None] / panels
        angle = (np.pi / 2 * (starts + (nodes + 1) / (2 * panels))).ravel()
        weight = np.tile(np.pi / 2 * weights / (2 * panels), panels) * np.cos(angle) ** (q + 1)
        waves = np.cos(2 * np.pi * separation[:, None] * np.sin(angle))
        return np.asarray(2 * around * (waves @ weight))

    return kernel


# -- tables ----------------------------------------------------------------------------------------

PATTERN_COLUMNS = ("azimuth_deg", "elevation_deg", "gain_db")
CUT_COLUMNS = ("cut", "angle_deg", "gain_db")

#: Angles that differ by less are one row of the grid [deg].
_SAME_ANGLE_DEG = 1e-6
#: How far the cuts may disagree on boresight [dB].
_CUTS_AGREE_DB = 0.5


@dataclass(frozen=True, eq=False)
class TableAntenna:
    """Gain on a grid of azimuth and elevation, bilinear in dB between.

    For a beam of half-power width b in steps h the error is at most 3 (h/b)^2 dB per axis.

    Parameters
    ----------
    azimuth_deg, elevation_deg
        Increasing angles, (A,) and (E,) [deg]. A grid of azimuths over the full circle is closed.
    gain_db : gain over isotropic, (A, E) [dBi]

    Attributes
    ----------
    outside_db
        Gain outside the grid [dBi]: the smallest of the table, because measured patterns usually
        end at the noise of the measurement.
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
        return np.asarray(np.where(inside_a & inside_e, value, self.outside_db))

    def gain(self, directions: ArrayLike) -> Real:
        """Return the power gain, (...), in directions (..., 3)."""
        return np.asarray(10 ** (self.gain_dbi(directions) / 10))


def _centred(azimuth: Real, gain_db: Real) -> tuple[Real, Real]:
    """Convert azimuths of 0 to 360 degrees to -180 to 180, and their rows."""
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
