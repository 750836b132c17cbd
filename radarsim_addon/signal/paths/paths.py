# SPDX-License-Identifier: GPL-3.0-or-later
"""Propagation paths of a render: one row for each pixel with an echo.

A pixel of solid angle dOmega that sees the radiance L receives L A_e dOmega, with A_e = lambda^2
G_r/(4 pi). This is the radar equation summed over pixels: the 1/R^2 of the return leg is in dOmega.

The length of a path between the elements of a channel is, at each moment and with spherical
wavefronts,

    l_ij = l - |rx - P_first| - |P_last - tx| + |rx_j - P_first| + |P_last - tx_i|

The differences are computed without cancellation, so l_ij has as many digits as l.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Sequence, Sized
from dataclasses import astuple, dataclass, field, replace
from functools import partial
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...arrays import Complex, Int32, Integers, Real
from ...errors import ConfigError
from ..motion import (
    AntennaMotion,
    JoinedMotion,
    KinematicMotion,
    LinearMotion,
    PathImages,
    PathMotion,
    Rows,
    axes_of,
    join_motion,
    leg_change,
    places_m,
    row_blocks,
)
from ..radar import Channel, Element

Flags = NDArray[np.uint16]
Table = TypeVar("Table")


class PathFlag:
    """Bits of the column ``flags`` of the path table and of `Paths.flags`.

    Plain integers and not an `enum.IntFlag`, whose members numpy would promote to int64.
    """

    ENCODED_LENGTH = 1
    """The length is that of the range encoding in float32: a vertex of the path is unknown."""

    NO_FIRST_VERTEX = 2
    """The scatterer nearest to the receiver is unknown (more than two reflections)."""

    MIXED = 4
    """Several ranges in the pixel (|G B/R^2 - 1| above a tolerance): its range is their mixture."""

    NO_RANGE = 8
    """Light without range encoding, or beyond its reach: the length is 0 and no map contains it."""

    SINGLE_SNAPSHOT = 16
    """No echo in the second snapshot, or no second snapshot: range rate unknown, taken as 0."""

    RANGE_RATE_REJECTED = 32
    """The range changed faster than the limit allows: another surface; range rate taken as 0."""

    CROSSED_SHELL = 64
    """The echo moved into the neighbouring ring between the snapshots, and was found there."""

    HAS_REVERSE = 128
    """Its first and last scatterer scatter in many directions: the wave also takes the reverse way,
    a path of its own. `power_w` is that of one of the two."""


#: Value of each flag by its name in files.
PATH_FLAGS = {name.lower(): flag for name, flag in vars(PathFlag).items() if name.isupper()}


@dataclass(frozen=True)
class PathGeometry:
    """Geometry of n paths at the frame's time t, in world space; NaN where unknown.

    Antenna patterns depend on the directions at both antennas, speckle on the place on the surface,
    motion on the objects that the paths touch.
    """

    #: Reflections, and transparent surfaces passed on the receiver's side, (n,).
    order: Int32
    transparent_depth: Int32
    #: First and last scatterer, equal at order 1, (n, 3) [m].
    first_scatterer_m: Real
    last_scatterer_m: Real
    #: From the receiver towards the first scatterer, unit vectors, (n, 3).
    direction: Real
    #: Numbers in the frame's list of objects, from 1; 0: unknown, (n,).
    first_object: Int32
    last_object: Int32
    #: Images of the antennas over which the paths go.
    images: PathImages | None = None

    def select(self, rows: Rows) -> PathGeometry:
        return select_columns(self, rows)


@dataclass(frozen=True)
class PathCounts:
    """Number of paths, of those with a `PathFlag`, and of pixels that are no paths.

    Attributes
    ----------
    paths
        Paths with a length.
    mixed, single_snapshot, range_rate_rejected, crossed_shell
        Paths with the flag of that name.
    range_encoding_underflow, no_range_encoding
        Pixels with an echo and without a length: too far for the range encoding, and light that
        does not carry it.
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

    @property
    def text(self) -> str:
        """The number of all paths, as a measurement counts them, and of those without a length."""
        without = self.range_encoding_underflow + self.no_range_encoding
        more = f", {without:,} of them without a length" if without else ""
        return f"{self.paths + without:,} paths{more}"

    @classmethod
    def of(cls, flags: Flags, **left_out: int) -> PathCounts:
        """Count paths by their flags, (n,). `left_out` are counts that do not follow from flags."""
        flagged = {
            name: int(np.count_nonzero(flags & PATH_FLAGS[name]))
            for name in cls.__dataclass_fields__
            if name in PATH_FLAGS
        }
        return cls(paths=int(flags.size), **flagged, **left_out)


@dataclass(frozen=True)
class Paths:
    """Propagation paths, one per row; all arrays of one length. ``paths[a:b]`` is `select`.

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
        Factor of the power by a link budget, the mean over the burst; None: 1.
    phasors
        Complex factors of the amplitudes from the surface's scatterers (speckle); NaN where
        unknown, None: none.
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
    geometries = [t.geometry for t in tables if t.geometry is not None]
    if len(geometries) < len(tables):
        return None
    images = [one.images for one in geometries]
    known = next((one for one in images if one is not None), None)
    over = None if known is None else known.join(images, [len(t) for t in tables])
    return join_columns(geometries, images=over)


def select_columns(table: Table, rows: Rows) -> Table:
    """Return some rows of every column of a dataclass.

    Columns are arrays (n, ...) and objects with a method `select`; other fields are kept.
    """
    columns = dict(vars(table))
    for name, column in columns.items():
        if isinstance(column, np.ndarray):
            columns[name] = column[rows]
        elif hasattr(column, "select"):
            columns[name] = column.select(rows)
    return type(table)(**columns)


def join_columns(tables: Sequence[Table], **joined: object) -> Table:
    """Return the rows of one or more tables of the same type, one after another.

    If a table has None for a column, the field's metadata "absent" fills it; without that metadata,
    the result is None. `joined` are fields that are not arrays, already joined.
    """
    kind: Any = type(tables[0])
    for item in dataclasses.fields(kind):
        if item.name in joined:
            continue
        columns = [getattr(table, item.name) for table in tables]
        if not all(column is None for column in columns) and "absent" in item.metadata:
            fill = item.metadata["absent"]
            columns = [
                np.full(len(cast(Sized, table)), fill) if column is None else column
                for table, column in zip(tables, columns, strict=True)
            ]
        known = all(column is not None for column in columns)
        joined[item.name] = np.concatenate(columns) if known else None
    return cast(Table, kind(**joined))


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


#: Fraction of the received power below which paths cause no finding. If 1 W is received, this is
#: thermal noise in a bandwidth of 2.5 Hz: no burst shorter than 0.4 s shows weaker echoes.
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


#: Bytes of values that the channels of an array share, at most.
MOST_SHARED = 1 << 29


class SharedValues:
    """Values of single elements, which several channels of the same paths use: each is computed
    once. `channels` of one or none keep nothing.
    """

    def __init__(self, channels: int = 1) -> None:
        self._kept: dict[tuple[object, ...], Real] = {}
        self._left = MOST_SHARED if channels > 1 else 0

    def of(self, name: object, times_s: Real, rows: Rows, make: Callable[[], Real]) -> Real:
        """Return the values (rows, times) of a name; `make` computes them at first. They must not
        be changed.
        """
        chosen = (rows.start, rows.stop) if isinstance(rows, slice) else rows.tobytes()
        key = (name, times_s.tobytes(), chosen)
        if key in self._kept:
            return self._kept[key]
        found = make()
        if found.nbytes <= self._left:
            self._kept[key] = found
            self._left -= found.nbytes
        return found


@dataclass(frozen=True)
class ChannelMotion:
    """`PathMotion` of paths between two elements (`channel`) of the antennas.

    `reference` is the motion of the same paths between the origins of the antennas, and `antennas`
    that of the origins. The vertices at t are (n, 3) [m]. `images` are those over which the paths
    go.
    """

    reference: PathMotion
    channel: Channel
    antennas: AntennaMotion
    first_scatterer_m: Real
    last_scatterer_m: Real
    images: PathImages | None = None
    shared: SharedValues = field(default_factory=SharedValues)

    @property
    def moving(self) -> NDArray[np.bool_]:
        turns = (self.antennas.receiver.moving and self.channel.rx.displaced) or (
            self.antennas.transmitter.moving and self.channel.tx.displaced
        )
        return np.asarray(self.reference.moving | self.moving_vertices.any(axis=-1) | turns)

    @property
    def moving_vertices(self) -> NDArray[np.bool_]:
        return self.reference.moving_vertices

    @property
    def scatterers_move(self) -> NDArray[np.bool_]:
        return self.reference.scatterers_move

    def lengths_m(self, times_s: Real, rows: Rows) -> Real:
        times_s, part = np.atleast_1d(times_s), id(self.reference)
        lengths = np.array(
            self.shared.of(part, times_s, rows, lambda: self.reference.lengths_m(times_s, rows))
        )
        for end, element in enumerate((self.channel.rx, self.channel.tx)):
            if element.displaced:
                name = part, end, element.position_m
                leg = partial(self._leg_changes, times_s, rows, end, element)
                lengths += self.shared.of(name, times_s, rows, leg)
        return lengths

    def _leg_changes(self, times_s: Real, rows: Rows, end: int, element: Element) -> Real:
        index = np.arange(self.first_scatterer_m.shape[0])[rows]
        change = np.empty((index.size, times_s.size))
        for part in row_blocks(index.size, times_s.size):
            change[part] = self._leg_change(times_s, index[part], end, element)
        return change

    def _leg_change(
        self, times_s: Real, rows: NDArray[np.intp], end: int, element: Element
    ) -> Real:
        """Return the length of a leg to the element less that to the origin, (rows, times) [m]."""
        body = (self.antennas.receiver, self.antennas.transmitter)[end]
        points = (self.first_scatterer_m, self.last_scatterer_m)[end][rows]
        offset_m = axes_of(body, times_s) @ np.asarray(element.position_m)
        moved = self.reference.displacements_m(times_s, rows, end, points)
        if self.images is not None:
            images = self.images.select(rows)
            points, moved = images.unfolded(end, points), images.unturned(end, moved)
        arm = points[:, None] + moved
        arm = arm - places_m(body, times_s)
        if end == 0 and self.antennas.orthographic:
            # rays along the boresight: a plane wavefront
            return np.broadcast_to(
                np.einsum("ti,ti->t", offset_m, axes_of(body, times_s)[:, :, 2]), arm.shape[:2]
            )
        flat = np.broadcast_to(-offset_m, arm.shape).reshape(-1, 1, 3)
        return leg_change(arm.reshape(-1, 3), flat).reshape(arm.shape[:2])

    def displacements_m(self, times_s: Real, rows: Rows, end: int, points_m: Real) -> Real:
        return self.reference.displacements_m(times_s, rows, end, points_m)

    def select(self, rows: Rows) -> ChannelMotion:
        return ChannelMotion(
            self.reference.select(rows),
            self.channel,
            self.antennas,
            self.first_scatterer_m[rows],
            self.last_scatterer_m[rows],
            None if self.images is None else self.images.select(rows),
        )


def channel_lengths(
    paths: Paths,
    channel: Channel,
    antennas: AntennaMotion | None = None,
    shared: SharedValues | None = None,
) -> PathMotion:
    """Return the lengths over a burst of paths between the elements of a channel.

    Where an element is away from its origin, the motion of the antennas and of the paths' vertices
    must be known.
    """
    if not channel.displaced:
        return paths.lengths
    if antennas is None:
        raise ConfigError(
            "Elements away from the antenna's origin need the antennas' poses, which are unknown. "
            "Give them: antennas=scattering.antenna_motion(receiver, transmitter)."
        )
    geometry = paths.geometry
    known = np.zeros(len(paths), dtype=bool)
    if geometry is not None:
        known = np.ones(len(paths), dtype=bool)
        if channel.rx.displaced:
            known &= np.isfinite(geometry.first_scatterer_m).all(axis=-1)
        if channel.tx.displaced:
            known &= np.isfinite(geometry.last_scatterer_m).all(axis=-1)
    if geometry is None or not known.all():
        raise ConfigError(
            f"{np.count_nonzero(~known)} of {len(paths)} paths have no known first or last "
            "scatterer, so that their lengths to displaced antenna elements cannot be computed. "
            "Measure by paths, or leave those paths out."
        )
    lengths, start, found = paths.lengths, 0, []
    for part in lengths.parts if isinstance(lengths, JoinedMotion) else (lengths,):
        if isinstance(part, LinearMotion) and part.moving.any():
            raise ConfigError(
                f"{np.count_nonzero(part.moving)} paths move at a range rate alone, so that their "
                "lengths to displaced antenna elements are not known. Measure by paths, with "
                "motion."
            )
        rows = slice(start, start + part.moving.size)
        first, last = geometry.first_scatterer_m[rows], geometry.last_scatterer_m[rows]
        if isinstance(part, KinematicMotion):
            # for speckle, the length is that over the scatterers of the surface
            first, last = part.first_scatterer_m, part.last_scatterer_m
        images = None if geometry.images is None else geometry.images.select(rows)
        found.append(
            ChannelMotion(part, channel, antennas, first, last, images, shared or SharedValues())
        )
        start = rows.stop
    return join_motion(found)
