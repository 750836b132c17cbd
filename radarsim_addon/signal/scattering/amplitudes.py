# SPDX-License-Identifier: GPL-3.0-or-later
"""The complex amplitude of a path in a channel: the only place where amplitudes are decided.

**Phase convention.** Echoes carry exp(-j 2 pi f0 tau), that is exp(+j w t). Material and Fresnel
formulas are written with exp(-j w t) and n + jk, so `amplitude` conjugates reflection coefficients
Gamma and scattering matrices S. The factor exp(-j 2 pi f0 tau) itself belongs to the synthesis,
which knows lengths and amplitudes and nothing of materials, speckle or antennas.

**Gains** (`Link`) are those at the time of each pulse: at its middle for a pulse, in the middle of
the ramp for frequencies that come one after the other. The transmit gain is taken towards the last
vertex, the receive gain along the pixel's direction. Between the elements of an array the level's
dependence on distance is neglected, its dependence on direction is not.

**Random phases** (`path_phasors`). A pixel of a rough surface stands for many scatterers whose
heights differ by more than a wavelength: its phase is anything. With one phase for all,
neighbouring pixels of a smooth mesh would add up in phase, and the level of an echo would grow with
the number of pixels. With random phases the mean power is the sum of the powers, and the map shows
speckle as a radar's does. They are seeded, one for each path, constant over the pulses. Paths of a
table have scatterers that are tied to the surface instead (`surface_speckle`); random phases are
for rings, whose pixels know no surface, and for paths whose surface is unknown.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from ...arrays import Complex, Indices, Mask, Real, distances
from ...contract import AmplitudeModel, PathsRecord, ReceiverRecord, TransmitterRecord
from ...errors import ConfigError
from ...physics.antennas import to_antenna_frame
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..decoding import single_vertex_m
from ..motion import (
    AntennaMotion,
    BodyMotion,
    FrameMotion,
    LinearMotion,
    PathImages,
    PathMotion,
    axes_of,
    places_m,
    row_blocks,
)
from ..paths import (
    PathFlag,
    PathRows,
    Paths,
    SharedValues,
    has_images,
    images_of,
    motion_of_rows,
    path_power_w,
)
from ..radar import (
    SINGLE_CHANNEL,
    Channel,
    ConstantGain,
    Element,
    PeakedAntenna,
    RadarSystem,
    make_antenna,
    window_at,
)
from ..spectrum import AmplitudeHistory

_U64 = np.uint64


def path_phasors(paths: Paths, seed: int) -> Complex:
    """Return the complex factor of each path's amplitude.

    It is that of the surface's scatterers where the paths have one. Else exp(j phi), phi uniform
    and independent from path to path; phi depends on where the path was found (ring, row, column;
    the row of the table) and on the seed alone, so it is the same however the paths are split into
    parts.

    Parameters
    ----------
    paths
        Paths.
    seed
        Any whole number; another one is another realisation of the speckle.

    Returns
    -------
    ndarray
        Complex, (paths,).
    """
    if paths.phasors is not None and not np.isnan(paths.phasors).any():
        return paths.phasors
    state = np.full(len(paths), seed % 2**64, dtype=_U64)
    for part in (paths.ring, paths.row, paths.col):
        state = hash_step(state ^ part.astype(np.int64).view(_U64))
    random: Complex = np.exp(2j * np.pi * uniform(state))
    if paths.phasors is None:
        return random
    # NaN: the paths of which the surface's scatterers are not known
    return np.where(np.isnan(paths.phasors), random, paths.phasors)


def uniform(state: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Convert hashes to numbers in [0, 1). Their 53 bits are as many as a float64 has."""
    return np.asarray((state >> _U64(11)).astype(np.float64) / 2**53)


def hash_step(state: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Do one step of SplitMix64 (Steele, Lea, Flood 2014): every bit depends on every other."""
    with np.errstate(over="ignore"):
        state = state + _U64(0x9E3779B97F4A7C15)
        state = (state ^ (state >> _U64(30))) * _U64(0xBF58476D1CE4E5B9)
        state = (state ^ (state >> _U64(27))) * _U64(0x94D049BB133111EB)
    return np.asarray(state ^ (state >> _U64(31)))


#: Pulses over which a mean gain is taken, at most.
_MEAN_PULSES = 64
#: Of these, so many tell the mean of gains whose polynomial through them has last two coefficients
#: below these fractions of the gain: the next one is then below 1e-9.
_MEAN_NODES, _MEAN_TAIL = 5, (1e-5, 1e-8)


@dataclass(frozen=True)
class PathEnds:
    """Lengths, directions and vertices of n paths at t, for gains."""

    length_m: Real  #: total, (n,) [m]
    direction: Real  #: from the receiver to the first vertex, (n, 3)
    first_scatterer_m: Real  #: (n, 3) [m]; NaN: unknown
    last_scatterer_m: Real
    motion: PathMotion
    images: PathImages | None = None  #: of the antennas, over which the paths go

    @classmethod
    def of_paths(cls, paths: Paths) -> PathEnds:
        """Take the ends of paths. `ConfigError`: the paths have no directions."""
        geometry = paths.geometry
        if geometry is None:
            raise ConfigError(
                "These paths have no directions, so antennas cannot be applied to them. Render "
                "the run again with this version, or process it without a link budget."
            )
        return cls(
            paths.length_m,
            geometry.direction,
            geometry.first_scatterer_m,
            geometry.last_scatterer_m,
            paths.lengths,
            geometry.images,
        )

    @classmethod
    def of_rows(cls, rows: PathRows, scene: FrameMotion | None) -> PathEnds:
        """Take the ends of rows of a table, which move as the scene does."""
        motion: PathMotion = LinearMotion(rows["length_m"], rows["range_rate_mps"])
        if scene is not None:
            motion = motion_of_rows(rows, scene)
        return cls(
            rows["length_m"],
            rows["direction"],
            rows["first_scatterer_m"],
            rows["last_scatterer_m"],
            motion,
            None if scene is None else images_of(rows, scene.images),
        )

    def select(self, rows: NDArray[np.intp]) -> PathEnds:
        return PathEnds(
            self.length_m[rows],
            self.direction[rows],
            self.first_scatterer_m[rows],
            self.last_scatterer_m[rows],
            self.motion.select(rows),
            None if self.images is None else self.images.select(rows),
        )

    def unfolded(self, end: int, points_m: Real) -> Real:
        """Return first (`end` 0) or last (1) vertices as the antenna sees them, (n, 3) [m]."""
        return points_m if self.images is None else self.images.unfolded(end, points_m)


@dataclass(frozen=True)
class _MeanNodes:
    """A few times. Their values give the mean of a smooth function over many times."""

    times_s: Real  #: (nodes,) [s]
    #: The mean is the sum of weights times values, (nodes,).
    weights: Real
    #: The same for the last two coefficients of the Chebyshev polynomial through the values,
    #: (2, nodes).
    tail: Real

    @classmethod
    def of(cls, times_s: Real) -> _MeanNodes | None:
        """Choose nodes from rising times. None: there are too few times."""
        if times_s.size < 2 * _MEAN_NODES:
            return None
        chosen = np.rint(np.linspace(0, times_s.size - 1, _MEAN_NODES)).astype(np.intp)
        place = 2 * (times_s - times_s[0]) / (times_s[-1] - times_s[0]) - 1
        basis = np.polynomial.chebyshev.chebvander(place, _MEAN_NODES - 1)
        inverse = np.linalg.inv(basis[chosen])
        return cls(times_s[chosen], basis.mean(axis=0) @ inverse, inverse[-2:])

    def mean(self, values: Real) -> tuple[Real, Mask]:
        """Return the means of values (n, nodes), and a mask of the values that change smoothly,
        (n,) each.
        """
        tail = np.abs(np.einsum("nk,ck->cn", values, self.tail))
        smooth = tail <= np.multiply.outer(_MEAN_TAIL, np.abs(values).max(axis=1))
        return np.einsum("nk,k->n", values, self.weights), smooth.all(axis=0)


class Link:
    """Gains and powers of a link budget on paths between one receiver and one transmitter.

    `scene` is the motion during the burst; None: the antennas are stationary. `times_s` are the
    pulse times over which the mean gains of `apply` and `mean_factor` are taken, (pulses,); None:
    gains of the frame's time. `attenuation_db_per_km` is what the air takes, one way, over the
    whole band. A lamp without power is a `ConfigError`: there is nothing to scale.
    """

    def __init__(
        self,
        system: RadarSystem,
        camera: ReceiverRecord,
        emitter: TransmitterRecord,
        scene: FrameMotion | None = None,
        times_s: Real | None = None,
        attenuation_db_per_km: float = 0.0,
    ) -> None:
        if not emitter.eirp_w > 0:
            raise ConfigError(
                f"The emitter's power is {emitter.eirp_w:g} W; expected more than 0. Render with "
                "a lamp that shines: a system scales its power, it cannot make it."
            )
        self.system, self._scene = system, scene
        self.antennas = antenna_motion(camera, emitter, scene)
        self._neper_per_m = attenuation_db_per_km * math.log(10) / 1e4
        self._scale = system.record.transmit_power_w / (system.loss * emitter.eirp_w)
        self._mean_times_s = np.zeros(0)
        if times_s is not None and times_s.size > 1:
            places = np.linspace(0, times_s.size - 1, min(times_s.size, _MEAN_PULSES))
            self._mean_times_s = times_s[np.rint(places).astype(np.intp)]
        self._nodes = _MeanNodes.of(self._mean_times_s)
        self._patterns: dict[int, PeakedAntenna] = {}
        #: Mean gains of rows of the frame's table, NaN where unknown.
        self._kept = np.zeros(0)
        #: Paths given to `apply` whose last vertex was taken as that of a single reflection, their
        #: power, and that of all [W].
        self.guessed = 0
        self.guessed_w = self.seen_w = 0.0

    @property
    def receiver_m(self) -> Real:
        """Place of the receiver at the frame's time, (3,) [m]."""
        return self.antennas.receiver.pose[:3, 3]

    @property
    def emitter_m(self) -> Real:
        """Place of the transmitter at the frame's time, (3,) [m]."""
        return self.antennas.transmitter.pose[:3, 3]

    def transmit_gain(self, points_m: Real) -> Real:
        """Return G_t towards points (n, 3) [m] at the frame's time, (n,)."""
        return self.system.transmitter.gain(
            to_antenna_frame(self.antennas.transmitter.pose, points_m - self.emitter_m)
        )

    def receive_gain(self, direction: Real) -> Real:
        """Return G_r for rays that leave the receiver in these directions, (n, 3)."""
        return self.system.receiver.gain(to_antenna_frame(self.antennas.receiver.pose, direction))

    def factor(self, length_m: Real, direction: Real, last_scatterer_m: Real) -> Real:
        """Return P_t G_t G_r / (L EIRP) of each path at the frame's time, reduced by the
        attenuation of the air, (n,). An unknown last vertex is assumed where a single reflection of
        that length would be.
        """
        if not np.size(length_m):
            return np.ones(0)
        last_scatterer_m = self._last_vertices(length_m, direction, last_scatterer_m)
        gain = self.transmit_gain(last_scatterer_m) * self.receive_gain(direction)
        return np.asarray(self._scale * gain * self._air_gain(length_m), dtype=np.float64)

    def _air_gain(self, length_m: Real) -> Real:
        """Return the fraction of the power that remains after attenuation by the air, for total
        path lengths (n,).
        """
        # a length that is not finite is refused where it is used, and not for its power
        return np.exp(-self._neper_per_m * np.where(np.isfinite(length_m), length_m, 0.0))

    def ends_factor(self, ends: PathEnds) -> Real:
        """Return `factor` of path ends, (n,)."""
        last_m = ends.unfolded(1, ends.last_scatterer_m)
        return self.factor(ends.length_m, ends.direction, last_m)

    def varies(self, ends: PathEnds) -> Mask:
        """Return a mask of the paths whose gains change because bodies or antennas move or turn,
        (n,).
        """
        antennas, system = self.antennas, self.system
        moves = ends.motion.moving_vertices
        varies = np.zeros(ends.length_m.size, dtype=bool)
        if not isinstance(system.receiver, ConstantGain) and not antennas.orthographic:
            varies |= antennas.receiver.moving | moves[:, 0]
        if not isinstance(system.transmitter, ConstantGain):
            varies |= antennas.transmitter.moving | moves[:, 1]
        return varies

    def factors(
        self,
        ends: PathEnds,
        times_s: Real,
        channel: Channel = SINGLE_CHANNEL,
        shared: SharedValues | None = None,
        rows: NDArray[np.intp] | None = None,
    ) -> Real:
        """Return P_t G_t G_r / (L EIRP) of n paths, or of some rows of them, at any times [s] for a
        channel's elements, (n, times). Unknown vertices are assumed as in `factor`, and stationary.
        """
        rows = np.arange(ends.length_m.size) if rows is None else rows
        shared = SharedValues() if shared is None else shared

        def gains(end: int, element: Element, antenna: PeakedAntenna) -> Real:
            found = np.empty((rows.size, times_s.size))
            for part in row_blocks(rows.size, times_s.size):
                found[part] = self._end_gain(
                    ends.select(rows[part]), times_s, end, element, antenna
                )
            return found

        antennas, ends_gains = (self.system.receiver, self.system.transmitter), []
        for end, element in ((1, channel.tx), (0, channel.rx)):
            name = "gain", end, element.position_m, element.orientation, id(element.antenna)
            make = partial(gains, end, element, antennas[end])
            ends_gains.append(shared.of(name, times_s, rows, make))
        gain = ends_gains[0] * ends_gains[1]
        return np.asarray(self._scale * gain * self._air_gain(ends.length_m[rows])[:, None])

    def _end_gain(
        self, ends: PathEnds, times_s: Real, end: int, element: Element, antenna: PeakedAntenna
    ) -> Real:
        """Return the gain at the receiver (`end` 0) or the transmitter (1), (n, times)."""
        body = (self.antennas.receiver, self.antennas.transmitter)[end]
        if element.antenna is not None:
            key = id(element.antenna)
            if key not in self._patterns:
                self._patterns[key] = make_antenna(
                    element.antenna, self.system.wavelength_m, "Element's"
                )
            antenna = self._patterns[key]
        axes = axes_of(body, times_s)
        if end == 0 and self.antennas.orthographic:
            # rays along the boresight, which turns with the receiver
            towards = np.broadcast_to(-axes[:, :, 2], (ends.length_m.size, *axes.shape[:2]))
        else:
            points = self._vertices(ends, end)
            moved = ends.motion.displacements_m(times_s, slice(None), end, points)
            if ends.images is not None:
                points = ends.unfolded(end, points)
                moved = ends.images.unturned(end, moved)
            place_m = places_m(body, times_s, np.array(element.position_m))
            towards = points[:, None] + moved - place_m
        local = np.einsum("nti,tij->ntj", towards, axes @ element.rotation)
        return np.asarray(antenna.gain(local), dtype=np.float64)

    def _vertices(self, ends: PathEnds, end: int) -> Real:
        """Return the first or last vertices at t, (n, 3) [m], guessed where unknown."""
        if end == 1:
            return self._last_vertices(ends.length_m, ends.direction, ends.last_scatterer_m)
        first = ends.first_scatterer_m
        known = np.isfinite(first).all(axis=-1, keepdims=True)
        on_ray = self.receiver_m + ends.direction * ends.length_m[:, None] / 2
        return np.where(known, first, on_ray)

    def _last_vertices(self, length_m: Real, direction: Real, last_scatterer_m: Real) -> Real:
        """Return the last vertices, (n, 3) [m]. Unknown ones are assumed at the place of a single
        reflection.
        """
        unknown = ~np.isfinite(last_scatterer_m).all(axis=-1)
        if unknown.any():
            last_scatterer_m = np.array(last_scatterer_m)
            last_scatterer_m[unknown] = single_vertex_m(
                length_m[unknown], direction[unknown], self.receiver_m, self.emitter_m
            )
        if not np.isfinite(last_scatterer_m).all():
            # Shorter than the baseline by rounding: the scatterer lies between the antennas.
            bad = ~np.isfinite(last_scatterer_m).all(axis=-1)
            last_scatterer_m = np.where(bad[:, None], self.receiver_m + direction, last_scatterer_m)
        return last_scatterer_m

    def mean_factor(self, ends: PathEnds) -> Real:
        """Return the mean of `factors` over at most 64 pulses, (n,), to 1e-8 of it. Where nothing
        changes the gains, it is `factor` to the last bit.
        """
        gain = self.ends_factor(ends)
        if self._mean_times_s.size:
            rows = np.flatnonzero(self.varies(ends))
            if self._nodes is not None and rows.size:
                found = self.factors(ends.select(rows), self._nodes.times_s)
                gain[rows], smooth = self._nodes.mean(found)
                rows = rows[~smooth]
            if rows.size:
                gain[rows] = self.factors(ends.select(rows), self._mean_times_s).mean(axis=1)
        return gain

    def mean_factor_of_rows(self, rows: PathRows, number: Indices | None = None) -> Real:
        """Return `mean_factor` of rows of the frame's table, (n,). If their numbers in the table
        are given, in rising order, the gains are kept.
        """
        if number is None or not number.size:
            return self.mean_factor(PathEnds.of_rows(rows, self._scene))
        if number[-1] >= self._kept.size:
            more = max(int(number[-1]) + 1 - self._kept.size, self._kept.size)
            self._kept = np.concatenate([self._kept, np.full(more, np.nan)])
        gain = self._kept[number]
        new = np.isnan(gain)
        if new.any():
            own = rows if new.all() else rows[new]
            gain[new] = self.mean_factor(PathEnds.of_rows(own, self._scene))
            self._kept[number] = gain
        return gain

    def apply(self, paths: Paths, of_table: bool = False) -> Paths:
        """Return the paths with their mean gain over the burst. Paths `of_table` use the gains that
        were kept for its rows. `ConfigError`: the paths have no directions.
        """
        ends, gain = PathEnds.of_paths(paths), np.full(1, np.nan)
        straight = self._scene is not None or ends.images is None
        if of_table and straight and paths.row.max(initial=0) < self._kept.size:
            gain = self._kept[paths.row]
        if np.isnan(gain).any():
            gain = self.mean_factor(ends)
        result = dataclasses.replace(paths, gain=gain)
        power_w = path_power_w(result, self.system.wavelength_m)
        unknown = ~np.isfinite(ends.last_scatterer_m).all(axis=-1)
        self.guessed += int(np.count_nonzero(unknown))
        self.guessed_w += float(power_w[unknown].sum())
        self.seen_w += float(power_w.sum())
        return result


def antenna_motion(
    camera: ReceiverRecord, emitter: TransmitterRecord, scene: FrameMotion | None = None
) -> AntennaMotion:
    """Return the motion of a frame's antennas from their poses and the scene. Without a scene they
    are stationary.
    """

    def body(matrix: object, moving: BodyMotion | None) -> BodyMotion:
        if moving is not None and moving.moving:
            return moving
        return BodyMotion(np.asarray(matrix, dtype=np.float64))

    return AntennaMotion(
        body(camera.matrix_world, None if scene is None else scene.receiver),
        body(emitter.matrix_world, None if scene is None else scene.emitter),
        camera.kind == "orthographic",
    )


def path_amplitude(
    paths: Paths,
    wavelength_m: float,
    amplitude_model: AmplitudeModel = "radar-equation",
    receiver_gain: float = 1.0,
) -> Real:
    """Return the magnitude of each path's amplitude, without speckle.

    Parameters
    ----------
    paths
        n paths. Their ``gain`` is applied.
    wavelength_m
        Carrier wavelength [m].
    amplitude_model
        "radar-equation": sqrt(P) in sqrt(W), so that |amplitude|^2 is received power.
        "paper": B r^2 (Eq. 10, 14), blue taken as amplitude, one-way range squared; the same number
        in Blender units and in SI. It follows the radar equation in range for one object, not in
        size. The root of the paths' gain multiplies it.
    receiver_gain
        G_r, linear; used by "radar-equation" alone.

    Returns
    -------
    ndarray
        (n,), sqrt(W) for "radar-equation".

    Raises
    ------
    ConfigError
        The amplitude model is unknown.
    """
    if amplitude_model == "radar-equation":
        return np.sqrt(path_power_w(paths, wavelength_m, receiver_gain))
    if amplitude_model == "paper":
        amplitude = paths.radiance * paths.range_m**2
        return amplitude if paths.gain is None else amplitude * np.sqrt(paths.gain)
    raise ConfigError(
        f"Amplitude model {amplitude_model!r}; expected one of {get_args(AmplitudeModel)}."
    )


def amplitude_history(
    paths: Paths,
    channel: Channel,
    *,
    frequency_hz: float,
    pulses: int,
    amplitude_model: AmplitudeModel = "radar-equation",
    receiver_gain: float = 1.0,
    link: Link | None = None,
    speckle_seed: int | None = None,
    shared: SharedValues | None = None,
) -> AmplitudeHistory:
    """Return the amplitudes of n paths in a channel at any time of a burst, in sqrt(W). Arguments
    and errors are those of `amplitude`. The gains of a single pulse are those at the frame's time.
    """

    def without_link(paths: Paths) -> Complex:
        wavelength_m = SPEED_OF_LIGHT_MPS / frequency_hz
        found = path_amplitude(paths, wavelength_m, amplitude_model, receiver_gain)
        if paths.mirror_phase_rad is not None:
            found = found * np.exp(1j * paths.mirror_phase_rad)
        if speckle_seed is None:
            return found.astype(np.complex128)
        return np.asarray(found * path_phasors(paths, speckle_seed))

    if link is None:
        for element in (channel.tx, channel.rx):
            if element.antenna is not None or element.orientation != Element().orientation:
                raise ConfigError(
                    "An antenna element has a pattern or an orientation of its own, but there is "
                    "no link budget to apply gains with. Process with a link budget."
                )
        return AmplitudeHistory.of(without_link(paths))
    ends = PathEnds.of_paths(paths)
    if not channel.reference_gain:
        start_s = np.array([link.antennas.receiver.epoch_offset_s])
        paths = dataclasses.replace(paths, gain=link.factors(ends, start_s, channel, shared)[:, 0])
    elif paths.gain is None:
        paths = dataclasses.replace(paths, gain=link.ends_factor(ends))
    constant = without_link(paths)
    varies = link.varies(ends) if pulses > 1 else np.zeros(len(paths), dtype=bool)
    if not varies.any():
        return AmplitudeHistory.of(constant)
    base = without_link(dataclasses.replace(paths, gain=None))

    def at(times_s: Real, rows: NDArray[np.intp]) -> Complex:
        return np.asarray(
            base[rows, None] * np.sqrt(link.factors(ends, times_s, channel, shared, rows))
        )

    return AmplitudeHistory(constant, varies, at)


def amplitude(
    paths: Paths,
    channel: Channel = SINGLE_CHANNEL,
    times_s: Real | None = None,
    *,
    frequency_hz: float,
    amplitude_model: AmplitudeModel = "radar-equation",
    receiver_gain: float = 1.0,
    link: Link | None = None,
    speckle_seed: int | None = None,
) -> Complex:
    """Return the complex amplitude of paths in a channel at every pulse.

    Parameters
    ----------
    paths
        n paths. ``phasors``, from the scatterers of surfaces, are applied where they are known.
    channel
        Transmitting and receiving element.
    times_s
        Pulse times since the frame's time, (pulses,) [s]; None: that time alone.
    frequency_hz
        Carrier [Hz].
    amplitude_model, receiver_gain
        See `path_amplitude`.
    link
        Antennas and powers; None: the gains in ``paths.gain``, or none.
    speckle_seed
        Random phases, see `path_phasors`; None: none, and the
        phasors of surfaces are left out too.

    Returns
    -------
    ndarray
        (n, 1) where no amplitude changes from pulse to pulse, else (n, pulses): sqrt(W) for
        "radar-equation", without exp(-j 2 pi f0 tau).

    Raises
    ------
    ConfigError
        The amplitude model is unknown, the paths have no directions for antenna gains, or an
        element has a pattern and there is no link.
    """
    times_s = np.zeros(1) if times_s is None else np.atleast_1d(times_s)
    history = amplitude_history(
        paths, channel, frequency_hz=frequency_hz, pulses=times_s.size,
        amplitude_model=amplitude_model, receiver_gain=receiver_gain, link=link,
        speckle_seed=speckle_seed,
    )  # fmt: skip
    if not history.varies.any():
        return np.asarray(history.constant[:, None], dtype=np.complex128)
    values: Complex = np.repeat(
        history.constant.astype(np.complex128)[:, None], times_s.size, axis=1
    )
    rows = np.flatnonzero(history.varies)
    values[rows] = history.at(times_s, rows)
    return values


# -------------------------------------------------------------------------------------------------
# Paths that share scatterers add up coherently: over mirrors, and over the same two in reverse.
#
# **Mirrors** (`interference_factors`). Echoes of different scatterers have independent phases, so
# their expected powers add up. Paths over one scatterer, direct and over mirrors, have its phase in
# common. Their amplitudes a_i exp(j p_i) with p_i = mirror phase - k l_i interfere: the expected
# power is the sum over all pairs of a_i a_j cos(p_i - p_j) o(l_i - l_j) with the overlap o of their
# responses in range. Each path of a pair carries half of what both bring, so a path's own number
# may be negative; sums over a range cell are not, as far as it resolves no pair.
#
# **Reverses** (`reverse_factors`, `reverse_amplitudes`). A wave follows a path of two or more
# reflections in both directions, and the table has both, found separately: A, B where the receiver
# sees A, and B, A where it sees B. They have one phase of scattering, so both together have the
# mean power P_AB + P_BA + 2 o sqrt(P_AB P_BA) cos(k d), with d the length of the reverse less that
# of the path. Rays rarely find both paths of one pair of surface cells, so each path carries its
# half: its power is multiplied by 1 + o cos(k d). In echoes, the paths A, B and B, A have
# independent phases, and the amplitude has the root of this factor with the phase of 1 + o exp(-j k
# d). With antennas in one place, d = 0 and the factor is 2. With antennas apart, d changes over the
# surfaces by many wavelengths, and the mean power is the sum of both. An echo has one delay, so a
# taper over the band does not change the factor: o is that without taper.
# -------------------------------------------------------------------------------------------------

#: Points of a band in the overlap of two responses.
_BAND_POINTS = 257
#: Turns of the phase over the band from which on responses do not overlap (1 % without a taper),
#: and steps of the table in a turn, which leave 3e-5.
_MOST_TURNS, _STEPS = 32, 128


def interference_factors(
    rows: PathRows,
    power_w: Real,
    carrier_hz: float,
    range_resolution_m: float,
    range_taper: str = "none",
) -> Real:
    """Return the factors that turn the powers (n,) of single paths, with their gains, into expected
    powers. The rows must be whole tile replicates. The factor is 1 for a path that shares its
    scatterer with no other.
    """
    factors = np.ones(rows.size)
    if not has_images(rows):
        return factors
    shared = np.flatnonzero((rows["point"] > 0) & (power_w > 0))
    keys = [rows[name][shared] for name in ("point", "replicate", "tile")]
    shared = shared[np.lexsort(keys)]
    keys = [rows[name][shared] for name in ("point", "replicate", "tile")]
    wave = 2 * math.pi * carrier_hz / SPEED_OF_LIGHT_MPS
    length_m = rows["length_m"][shared]
    phase = rows["mirror_phase_rad"][shared] - wave * length_m
    amplitude = np.sqrt(power_w[shared])
    added, apart = np.zeros(shared.size), 0
    while True:
        apart += 1
        first = np.flatnonzero(
            np.logical_and.reduce([key[apart:] == key[: key.size - apart] for key in keys])
        )
        if not first.size:
            break
        other = first + apart
        both = np.cos(phase[first] - phase[other])
        both *= range_overlap(length_m[first] - length_m[other], range_resolution_m, range_taper)
        np.add.at(added, first, both * amplitude[other] / amplitude[first])
        np.add.at(added, other, both * amplitude[first] / amplitude[other])
    factors[shared] += added
    return factors


def range_overlap(apart_m: Real, range_resolution_m: float, taper: str = "none") -> Real:
    """Return the correlation of range responses whose total lengths differ."""
    # A difference d of the length turns the phase over the band by 2 pi B d / c.
    turns = np.abs(apart_m / (2 * range_resolution_m))
    return np.asarray(np.interp(turns, *_overlap_table(taper), right=0.0))


@lru_cache(maxsize=16)
def _overlap_table(taper: str) -> tuple[Real, Real]:
    """Return the turns of the phase over the band, and the correlation at them."""
    place = (np.arange(_BAND_POINTS) + 0.5) / _BAND_POINTS - 0.5
    weight = window_at(taper, place) ** 2
    grid = np.arange(_MOST_TURNS * _STEPS + 1) / _STEPS
    return grid, np.cos(2 * np.pi * grid[:, None] * place) @ weight / weight.sum()


def reverse_factors(
    rows: PathRows,
    record: PathsRecord,
    carrier_hz: float,
    range_resolution_m: float,
) -> Real:
    """Return the factors on the expected powers of rows of a table, (n,). They are 1 for paths
    without a reverse.
    """
    factors = np.ones(rows.size)
    chosen = np.flatnonzero(rows["flags"] & PathFlag.HAS_REVERSE)
    if record.receiver.kind == "orthographic" or not chosen.size:
        return factors
    mine = rows[chosen]
    receiver_m, transmitter_m = (
        np.asarray(one.matrix_world, dtype=np.float64)[:3, 3]
        for one in (record.receiver, record.transmitter)
    )
    if _in_one_place(receiver_m, transmitter_m, carrier_hz):
        factors[chosen] = 2.0
        return factors
    ends = mine["first_scatterer_m"], mine["last_scatterer_m"]
    longer_m, known = _longer_m(*ends, receiver_m, transmitter_m, images_of(mine, record.images))
    factors[chosen[known]] = _both(longer_m, carrier_hz, range_resolution_m).real[known]
    return factors


def reverse_amplitudes(
    paths: Paths,
    channel: Channel,
    antennas: AntennaMotion,
    carrier_hz: float,
    range_resolution_m: float,
) -> Complex | None:
    """Return the factors on the amplitudes of n speckled paths in a channel, with its elements at
    the frame's time. None: no path has a reverse.
    """
    chosen = np.flatnonzero(paths.flags & PathFlag.HAS_REVERSE)
    geometry = paths.geometry
    if antennas.orthographic or geometry is None or not chosen.size:
        return None
    now_s = np.zeros(1)
    receiver_m = places_m(antennas.receiver, now_s, np.asarray(channel.rx.position_m))[0]
    transmitter_m = places_m(antennas.transmitter, now_s, np.asarray(channel.tx.position_m))[0]
    factors = np.ones(len(paths), dtype=np.complex128)
    if _in_one_place(receiver_m, transmitter_m, carrier_hz):
        factors[chosen] = math.sqrt(2.0)
        return factors
    images = None if geometry.images is None else geometry.images.select(chosen)
    ends = geometry.first_scatterer_m[chosen], geometry.last_scatterer_m[chosen]
    longer_m, known = _longer_m(*ends, receiver_m, transmitter_m, images)
    both = _both(longer_m, carrier_hz, range_resolution_m)
    both *= np.sqrt(np.maximum(both.real, 0.0)) / np.maximum(np.abs(both), np.finfo(float).tiny)
    factors[chosen[known]] = both[known]
    return factors


def _in_one_place(receiver_m: Real, transmitter_m: Real, carrier_hz: float) -> bool:
    """Return True if all paths are as long as their reverses, to 2e-3 wavelengths."""
    apart_m = float(np.linalg.norm(receiver_m - transmitter_m))
    return apart_m * carrier_hz <= 1e-3 * SPEED_OF_LIGHT_MPS


def _both(longer_m: Real, carrier_hz: float, range_resolution_m: float) -> Complex:
    """Return 1 + o exp(-j k d), (n,); the real part is the factor on the power."""
    turned = np.exp(-2j * math.pi * carrier_hz / SPEED_OF_LIGHT_MPS * longer_m)
    return np.asarray(1 + range_overlap(longer_m, range_resolution_m) * turned)


def _longer_m(
    first_m: Real, last_m: Real, receiver_m: Real, transmitter_m: Real, images: PathImages | None
) -> tuple[Real, Mask]:
    """Return the length of each reverse minus that of its path, (n,) [m], 0 if unknown, and a mask
    of the known ones.
    """
    receiver_here, receiver_there = receiver_m, receiver_m
    transmitter_here, transmitter_there = transmitter_m, transmitter_m
    if images is not None:  # the reverse goes over the other antenna's mirrors
        receiver_here, receiver_there = (images.places(end, receiver_m) for end in (0, 1))
        transmitter_here, transmitter_there = (images.places(end, transmitter_m) for end in (1, 0))
    longer_m = distances(first_m, transmitter_there) - distances(first_m, receiver_here)
    longer_m += distances(last_m, receiver_there) - distances(last_m, transmitter_here)
    known = np.isfinite(longer_m)
    return np.where(known, longer_m, 0.0), known
