# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders as a table of propagation paths: one row for each pixel with an echo.

A pixel of solid angle dOmega that sees radiance L receives L A_e dOmega, A_e = lambda^2 G_r/(4 pi)
(the radar equation summed over pixels: the return leg's 1/R^2 is in dOmega).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from ...array_types import Real
from ...contract import AmplitudeModel
from ...errors import ConfigError
from ..motion import LinearMotion, PathMotion, join_motion
from .flags import Flags, PathFlag
from .geometry import PathGeometry, join_geometry


@dataclass(frozen=True)
class PathCounts:
    """How many pixels with an echo there were, and what was wrong with some of them."""

    paths: int = 0
    mixed: int = 0
    single_snapshot: int = 0
    range_rate_rejected: int = 0
    crossed: int = 0
    range_encoding_underflow: int = 0
    no_range_encoding: int = 0

    def __add__(self, other: PathCounts) -> PathCounts:
        return PathCounts(
            *(getattr(self, name) + getattr(other, name) for name in self.__dataclass_fields__)
        )


@dataclass(frozen=True)
class Paths:
    """Propagation paths, one a row; all arrays of one length.

    Attributes
    ----------
    radiance
        L [W m^-2 sr^-1].
    solid_angle_sr
        Solid angle of the pixel [sr].
    length_m
        Total length at t, from camera over the scatterers to the emitter [m].
    range_rate_mps
        Rate of the one-way range length/2, receding positive [m/s]; 0 where unknown (see flags).
    ring, row, col
        Where the path was found; for paths from a table row is the table's row, the others 0.
    flags
        PathFlag.MIXED, PathFlag.SINGLE_SNAPSHOT, PathFlag.RANGE_RATE_REJECTED,
        PathFlag.CROSSED_SHELL of :mod:`.decoding.snapshot_rate`.
    counts
        Of all pixels, those without a path included.
    geometry
        Vertices and directions; None where they are not known.
    motion
        Lengths over the burst; None: constant range rates, see `lengths`.
    gain
        What a radar system makes of the power, see :mod:`.scattering.antenna_gains`; None: 1.
    phasors
        Complex factors of the amplitudes from the surface's scatterers, see
        :mod:`.scattering.surface_speckle`; NaN where unknown, None: none.
    """

    radiance: Real
    solid_angle_sr: Real
    length_m: Real
    range_rate_mps: Real
    ring: NDArray[np.int32]
    row: NDArray[np.int32]
    col: NDArray[np.int32]
    flags: Flags
    counts: PathCounts = field(default_factory=PathCounts)
    geometry: PathGeometry | None = None
    motion: PathMotion | None = None
    gain: Real | None = None
    phasors: NDArray[np.complex128] | None = None

    def __len__(self) -> int:
        return int(self.radiance.size)

    @property
    def range_m(self) -> Real:
        """One-way range at t, half the total length [m]."""
        return self.length_m / 2

    @property
    def lengths(self) -> PathMotion:
        """Lengths over the burst: `motion`, or constant range rates where there is none."""
        return self.motion or LinearMotion(self.length_m, self.range_rate_mps)

    def select(self, keep: NDArray[np.bool_] | slice) -> Paths:
        """The rows that `keep` names, with counts of these rows alone."""
        rows = (
            self.radiance[keep],
            self.solid_angle_sr[keep],
            self.length_m[keep],
            self.range_rate_mps[keep],
            self.ring[keep],
            self.row[keep],
            self.col[keep],
            self.flags[keep],
        )
        return Paths(
            *rows,
            counts=count_flags(rows[-1]),
            geometry=None if self.geometry is None else self.geometry.select(keep),
            motion=None if self.motion is None else self.motion.select(keep),
            gain=None if self.gain is None else self.gain[keep],
            phasors=None if self.phasors is None else self.phasors[keep],
        )


def count_flags(
    flags: Flags, range_encoding_underflow: int = 0, no_range_encoding: int = 0
) -> PathCounts:
    def number(flag: int) -> int:
        return int(np.count_nonzero(flags & flag))

    return PathCounts(
        paths=int(flags.size),
        mixed=number(PathFlag.MIXED),
        single_snapshot=number(PathFlag.SINGLE_SNAPSHOT),
        range_rate_rejected=number(PathFlag.RANGE_RATE_REJECTED),
        crossed=number(PathFlag.CROSSED_SHELL),
        range_encoding_underflow=range_encoding_underflow,
        no_range_encoding=no_range_encoding,
    )


def make_paths(
    radiance: Real | float,
    length_m: Real | float,
    range_rate_mps: Real | float = 0.0,
    solid_angle_sr: Real | float = 1.0,
) -> Paths:
    """Paths from plain numbers or 1-D arrays, for tests and for targets without a render."""
    columns = np.broadcast_arrays(
        *(
            np.atleast_1d(np.asarray(a, dtype=np.float64))
            for a in (radiance, solid_angle_sr, length_m, range_rate_mps)
        )
    )
    radiance_, solid, length, rate = (np.array(column) for column in columns)
    zeros = np.zeros(radiance_.size, dtype=np.int32)
    flags = np.zeros(radiance_.size, dtype=np.uint8)
    return Paths(radiance_, solid, length, rate, zeros, zeros, zeros, flags, count_flags(flags))


def join_paths(parts: Iterable[Paths]) -> Paths:
    """One table of several; an empty one of none."""
    tables = list(parts)
    if not tables:
        return make_paths(np.empty(0), np.empty(0))
    others = {"counts", "geometry", "motion", "gain", "phasors"}
    names = [name for name in Paths.__dataclass_fields__ if name not in others]
    columns = {name: np.concatenate([getattr(t, name) for t in tables]) for name in names}
    geometries = [t.geometry for t in tables if t.geometry is not None]
    motion = None
    if any(t.motion is not None for t in tables):
        motion = join_motion([t.lengths for t in tables])
    gain = None
    if any(t.gain is not None for t in tables):
        gain = np.concatenate([np.ones(len(t)) if t.gain is None else t.gain for t in tables])
    phasors = None
    if any(t.phasors is not None for t in tables):
        phasors = np.concatenate(
            [np.full(len(t), np.nan + 0j) if t.phasors is None else t.phasors for t in tables]
        )
    return Paths(
        **columns,
        counts=sum((t.counts for t in tables), PathCounts()),
        geometry=join_geometry(geometries) if len(geometries) == len(tables) else None,
        motion=motion,
        gain=gain,
        phasors=phasors,
    )


def path_power_w(paths: Paths, wavelength_m: float, receiver_gain: float = 1.0) -> Real:
    """Power that each path brings to the receiver's terminals [W].

    P = L A_e dOmega with A_e = G_r lambda^2 / (4 pi). Transmit power and gain are in L already:
    the lamp's power is the EIRP P_t G_t. Paths with a ``gain`` have those of a radar system.

    Parameters
    ----------
    paths
        Paths.
    wavelength_m
        Carrier wavelength [m].
    receiver_gain
        G_r, linear, over isotropic.
    """
    aperture_m2 = receiver_gain * wavelength_m**2 / (4 * math.pi)
    power_w = paths.radiance * aperture_m2 * paths.solid_angle_sr
    return power_w if paths.gain is None else power_w * paths.gain


def path_amplitude(
    paths: Paths,
    wavelength_m: float,
    amplitude_model: AmplitudeModel = "radar-equation",
    receiver_gain: float = 1.0,
) -> Real:
    """Amplitude of each path in the echo.

    Parameters
    ----------
    paths
        Paths.
    wavelength_m
        Carrier wavelength [m].
    amplitude_model
        "radar-equation": sqrt(P) in sqrt(W), so that |amplitude|^2 is received power.
        "paper": B r^2 (Eq. 10, 14): blue is taken as amplitude, weighted with the square of the
        one-way range. B r^2 is the same number in Blender units (B per unit^2, r in units) and in
        SI (L per m^2, r in m). Follows the radar equation in R for one object, not in its size.
        Times the root of the paths' gain, so that patterns read the same in dB.
    receiver_gain
        G_r, linear; used by "radar-equation" alone.

    Returns
    -------
    ndarray
        (n,), sqrt(W) for "radar-equation".

    Raises
    ------
    ConfigError
        Unknown weighting.
    """
    if amplitude_model == "radar-equation":
        return np.sqrt(path_power_w(paths, wavelength_m, receiver_gain))
    if amplitude_model == "paper":
        amplitude = paths.radiance * paths.range_m**2
        return amplitude if paths.gain is None else amplitude * np.sqrt(paths.gain)
    raise ConfigError(f"Weighting {amplitude_model!r}; expected one of {get_args(AmplitudeModel)}.")
