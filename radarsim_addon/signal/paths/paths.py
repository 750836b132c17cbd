# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders as a table of propagation paths: one row for each pixel with an echo.

A pixel of solid angle dOmega that sees radiance L receives L A_e dOmega, A_e = lambda^2 G_r/(4 pi)
(the radar equation summed over pixels: the return leg's 1/R^2 is in dOmega).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from ...array_types import Complex, Integers, Real
from ..motion import LinearMotion, PathMotion, Rows, join_motion
from .columns import join_columns, select_columns
from .flags import PATH_FLAGS, Flags
from .geometry import PathGeometry


@dataclass(frozen=True)
class PathCounts:
    """How many paths there were, how many of them bear a `PathFlag`, and how many were left out.

    Attributes
    ----------
    paths
        Paths with a length.
    mixed, single_snapshot, range_rate_rejected, crossed_shell
        Those of them with the flag of that name.
    range_encoding_underflow, no_range_encoding
        Pixels with an echo and without a length, which are no paths: too far for the range
        encoding, and light that does not carry it.
    """

    paths: int = 0
    mixed: int = 0
    single_snapshot: int = 0
    range_rate_rejected: int = 0
    crossed_shell: int = 0
    range_encoding_underflow: int = 0
    no_range_encoding: int = 0

    def __add__(self, other: PathCounts) -> PathCounts:
        return PathCounts(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))

    @classmethod
    def of(cls, flags: Flags, **left_out: int) -> PathCounts:
        """Count paths by their flags, (n,); `left_out` are the counts that flags do not tell."""
        flagged = {
            name: int(np.count_nonzero(flags & PATH_FLAGS[name]))
            for name in cls.__dataclass_fields__
            if name in PATH_FLAGS
        }
        return cls(paths=int(flags.size), **flagged, **left_out)


@dataclass(frozen=True)
class Paths:
    """Propagation paths, one a row; all arrays of one length. ``paths[a:b]`` is `select`.

    Attributes
    ----------
    radiance
        L [W m^-2 sr^-1].
    solid_angle_sr
        Solid angle of the pixel [sr].
    length_m
        Total length at t, from receiver over the scatterers to the transmitter [m].
    range_rate_mps
        Rate of the one-way range length/2, receding positive [m/s]; 0 where unknown (see flags).
    ring, row, col
        Where the path was found; for paths from a table row is the table's row, the others 0.
    flags
        Sums of `PathFlag`.
    counts
        Of all pixels, those without a path included.
    geometry
        Vertices and directions; None where they are not known.
    motion
        Lengths over the burst; None: constant range rates, see `lengths`.
    gain
        What a radar system makes of the power, the mean over the burst, see
        :mod:`.scattering.antenna_gains`; None: 1.
    phasors
        Complex factors of the amplitudes from the surface's scatterers, see
        :mod:`.scattering.surface_speckle`; NaN where unknown, None: none.
    mirror_phase_rad
        Phases of the amplitudes from mirrors, as echoes have them [rad]; None: 0.
    """

    radiance: Real
    solid_angle_sr: Real
    length_m: Real
    range_rate_mps: Real
    ring: Integers
    row: Integers
    col: Integers
    flags: Flags
    counts: PathCounts = field(default_factory=PathCounts)
    geometry: PathGeometry | None = None
    motion: PathMotion | None = None
    gain: Real | None = field(default=None, metadata={"absent": 1.0})
    phasors: Complex | None = field(default=None, metadata={"absent": complex(math.nan)})
    mirror_phase_rad: Real | None = field(default=None, metadata={"absent": 0.0})

    def __len__(self) -> int:
        return int(self.radiance.size)

    def __getitem__(self, rows: Rows) -> Paths:
        return self.select(rows)

    @property
    def range_m(self) -> Real:
        """One-way range at t, half the total length, (n,) [m]."""
        return self.length_m / 2

    @property
    def lengths(self) -> PathMotion:
        """Lengths over the burst: `motion`, or constant range rates where there is none."""
        return self.motion or LinearMotion(self.length_m, self.range_rate_mps)

    def lengths_at_m(self, times_s: ArrayLike) -> Real:
        """Return the total lengths of all paths at some moments, such as those of the pulses.

        Parameters
        ----------
        times_s
            Times after the frame's time t, (times,) [s]; see :func:`.echoes.pulse_times_s`.

        Returns
        -------
        ndarray
            (n, times) [m]; half of it is the one-way range.
        """
        return self.lengths.lengths_m(np.atleast_1d(np.asarray(times_s, float)), slice(None))

    def select(self, rows: Rows) -> Paths:
        """Return some rows, with counts of these rows alone.

        Parameters
        ----------
        rows
            Mask (n,), row numbers (m,) or slice.

        Raises
        ------
        TypeError
            A single number: paths are not iterated one by one.
        """
        if np.ndim(rows) != (0 if isinstance(rows, slice) else 1):  # type: ignore[arg-type]
            raise TypeError(f"Rows {rows!r:.60}; expected a slice, a mask or row numbers.")
        chosen = select_columns(self, rows)
        return replace(chosen, counts=PathCounts.of(chosen.flags))

    @classmethod
    def join(cls, parts: Iterable[Paths]) -> Paths:
        """Return the rows of all parts in order; no parts give no rows.

        Geometry is known where all parts have one. Where some parts have a motion, a gain or
        phasors, the others get constant range rates, 1 and NaN.
        """
        tables = list(parts) or [make_paths(np.empty(0), np.empty(0))]
        moving = any(t.motion is not None for t in tables)
        return join_columns(
            tables,
            counts=sum((t.counts for t in tables), PathCounts()),
            geometry=_joined_geometry(tables),
            motion=join_motion([t.lengths for t in tables]) if moving else None,
        )


def _joined_geometry(tables: Sequence[Paths]) -> PathGeometry | None:
    """Geometry of all rows of some tables; None where one has none."""
    geometries = [t.geometry for t in tables if t.geometry is not None]
    if len(geometries) < len(tables):
        return None
    images = [one.images for one in geometries]
    known = next((one for one in images if one is not None), None)
    over = None if known is None else known.join(images, [len(t) for t in tables])
    return join_columns(geometries, images=over)


def make_paths(
    radiance: Real | float,
    length_m: Real | float,
    range_rate_mps: Real | float = 0.0,
    solid_angle_sr: Real | float = 1.0,
) -> Paths:
    """Return paths from plain numbers or 1-D arrays, for tests and targets without a render.

    Parameters
    ----------
    radiance
        L [W m^-2 sr^-1].
    length_m
        Total length, receiver to scatterer to transmitter [m].
    range_rate_mps
        Rate of the one-way range, receding positive [m/s].
    solid_angle_sr
        Solid angle that each path stands for [sr].

    Returns
    -------
    Paths
        As many rows as the arguments have together by numpy's rules of broadcasting.
    """
    columns = np.broadcast_arrays(
        *(
            np.atleast_1d(np.asarray(a, dtype=np.float64))
            for a in (radiance, solid_angle_sr, length_m, range_rate_mps)
        )
    )
    radiance_, solid, length, rate = (np.array(column) for column in columns)
    zeros = np.zeros(radiance_.size, dtype=np.int64)
    flags = np.zeros(radiance_.size, dtype=np.uint16)
    return Paths(radiance_, solid, length, rate, zeros, zeros, zeros, flags, PathCounts.of(flags))


#: Fraction of the received power below which paths cause no finding. Where 1 W is received, this
#: is thermal noise in a bandwidth of 2.5 Hz: no burst shorter than 0.4 s shows weaker echoes.
NEGLIGIBLE_FRACTION = 1e-20


def path_power_w(paths: Paths, wavelength_m: float, receiver_gain: float = 1.0) -> Real:
    """Return the power that each path brings to the receiver's terminals.

    P = L A_e dOmega with A_e = G_r lambda^2 / (4 pi). Transmit power and gain are in L already:
    the Point light's power is the EIRP P_t G_t. Paths with a ``gain`` have those of a radar system.

    Parameters
    ----------
    paths
        Paths.
    wavelength_m
        Carrier wavelength [m].
    receiver_gain
        G_r, linear, over isotropic.

    Returns
    -------
    ndarray
        (n,) [W].
    """
    aperture_m2 = receiver_gain * wavelength_m**2 / (4 * math.pi)
    power_w = paths.radiance * aperture_m2 * paths.solid_angle_sr
    return power_w if paths.gain is None else power_w * paths.gain
