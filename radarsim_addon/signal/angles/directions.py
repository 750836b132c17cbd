# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions of echoes from the phases of an array's channels.

A point at P, in the axes of the receiver, has in channel c a phase -2 pi (l_c - l) / lambda with
l_c = |P - rx_c| + |P - tx_c|, and l the length between the antennas' origins. Its range is known
from the map, so these are the phases of spherical wavefronts: near field included, and transmitters
away from the receivers. In TDM a channel's pulses start later by its offset, so that a Doppler
frequency f adds 2 pi f offset. f is sampled once per pulse interval, so it is ambiguous by
multiples of the PRF: each is tried, and the one whose phases fit the channels best is taken.

`bartlett`, `capon` and `music` are spectra over directions, `esprit` gives directions of a row of
equal spacing without a search, `count_sources` the number of sources by the minimum description
length (Van Trees, Optimum Array Processing, chapters 6 to 9; Wax and Kailath, IEEE TASSP 33, 387,
1985). `DirectionFinder` finds the sources of one cell of a map: the strongest is subtracted and the
next one looked for, then all are fitted together again by least squares, which for white noise is
the maximum of the likelihood (Stoica and Nehorai, IEEE TASSP 37, 720, 1989).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from ...arrays import Complex, Integers, Real
from ...errors import ConfigError
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..motion import AntennaMotion, axes_of, places_m
from ..radar import FmcwWaveform, Radar

#: Directions of the search, per beam width: the loss between two of them is below 0.3 dB.
_PER_BEAM = 3.0
#: An extent below this part of a wavelength measures no angle.
_LEAST_EXTENT = 0.25
#: Sources of one cell at most.
MAX_SOURCES = 2
#: Least fraction of the residual power, after the sources found so far, that one more source must
#: explain. A smaller one is taken as the error of a target that is no point.
_EXPLAINED = 0.7
#: Where sources leave more than the first fraction of the amplitudes, other folds are tried whose
#: beams have more than the second fraction of the strongest one's amplitude. One is taken that
#: leaves less than the third fraction of what is left.
_MUCH, _WORTH, _BETTER = 0.2, 0.6, 0.7
#: Beam widths below which two directions fit the roughness of one target, not two targets.
_RESOLVED = 0.25
#: Folds of the Doppler that are tried at most, where slots are very short.
_MOST_FOLDS = 256
#: Directions are fitted to 1e-10 beam widths.
_FIT: dict[str, Any] = {"method": "lm", "xtol": 1e-10, "ftol": 1e-15, "max_nfev": 200}
#: A grating lobe is a direction whose phases agree with another's to this part of the power.
_ALIKE = 0.95


@dataclass(frozen=True, eq=False)
class ArrayGeometry:
    """Places of the elements of n channels, in the axes of the receiver at one moment.

    Attributes
    ----------
    receiver_m, transmitter_m
        Elements of each channel, (n, 3) [m].
    origin_m
        Origin of the transmitting antenna, (3,) [m].
    offset_s
        Start of each channel's pulses after that of the burst's, (n,) [s].
    wavelength_m, prf_hz
        Wavelength of the carrier [m], pulses a second of each channel [Hz].
    chirp_hz_per_m
        How far the frequency of an FMCW echo is below the carrier, per metre of its range: a more
        distant echo was sent earlier in the ramp [Hz/m]. 0 for other waveforms.
    """

    receiver_m: Real
    transmitter_m: Real
    origin_m: Real
    offset_s: Real
    wavelength_m: float
    prf_hz: float
    chirp_hz_per_m: float = 0.0

    @classmethod
    def of(cls, radar: Radar, antennas: AntennaMotion, time_s: float = 0.0) -> ArrayGeometry:
        """Return the places of a radar's channels at a time of the burst [s].

        Directions of a burst are those in its middle, half way between the slots.
        """
        at = np.array([time_s])
        (receiver, transmitter), origins = (
            [function(body, at)[0] for body in (antennas.receiver, antennas.transmitter)]
            for function in (axes_of, places_m)
        )
        turn = receiver.T @ transmitter
        origin_m = receiver.T @ (origins[1] - origins[0])
        tx_m, rx_m = (
            np.array([getattr(one, end).position_m for one in radar.channels])
            for end in ("tx", "rx")
        )
        waveform, slope = radar.waveform, 0.0
        if isinstance(waveform, FmcwWaveform):
            slope = waveform.slope_hz_per_s * 2 / SPEED_OF_LIGHT_MPS
        return cls(
            rx_m,
            tx_m @ turn.T + origin_m,
            origin_m,
            np.array([one.start_offset_s for one in radar.channels]),
            waveform.wavelength_m,
            radar.burst.prf_hz,
            slope,
        )

    @property
    def virtual_m(self) -> Real:
        """Places of the virtual elements, their middle at 0, (n, 3) [m]."""
        virtual = self.receiver_m + self.transmitter_m - self.origin_m
        return np.asarray(virtual - virtual.mean(axis=0))

    @property
    def extent_wavelengths(self) -> Real:
        """Size of the virtual array to the right and upwards, (2,)."""
        return np.asarray(np.ptp(self.virtual_m[:, :2], axis=0) / self.wavelength_m)

    @property
    def reach_m(self) -> float:
        """Lower limit of the range of an echo: half the distance between both antennas, or the
        distance of the outermost element from its antenna's origin, the larger one [m].
        """
        places = np.vstack([self.receiver_m, self.transmitter_m - self.origin_m, self.origin_m / 2])
        return float(np.linalg.norm(places, axis=1).max())

    @property
    def measures(self) -> tuple[bool, bool]:
        """Whether the array measures azimuth, and elevation."""
        right, up = self.extent_wavelengths > _LEAST_EXTENT
        return bool(right), bool(up)

    def steering(self, directions: Real, range_m: float = math.inf) -> Complex:
        """Return the phase factors of the channels for echoes of some directions.

        Parameters
        ----------
        directions
            Unit vectors from the receiver, (k, 3).
        range_m
            One-way range, half the length of the path [m]; infinite: plane wavefronts.

        Returns
        -------
        ndarray
            (k, n), of magnitude 1.

        Raises
        ------
        ConfigError
            The range is within the array.
        """
        directions = np.atleast_2d(directions)
        if math.isinf(range_m):
            towards = directions @ (self.receiver_m + self.transmitter_m - self.origin_m).T
            return np.asarray(np.exp(2j * np.pi / self.wavelength_m * towards))
        # |P| + |P - origin| = 2 range along each direction
        there_m = 2 * range_m - directions @ self.origin_m
        if not range_m > self.reach_m:
            raise ConfigError(
                f"An echo at a range of {range_m:g} m is within the array, which reaches "
                f"{self.reach_m:g} m. Put the array's elements closer together, or the scene "
                "farther away."
            )
        reach_m = (4 * range_m**2 - self.origin_m @ self.origin_m) / (2 * there_m)
        points_m = reach_m[:, None] * directions
        length_m = np.zeros((len(points_m), len(self.receiver_m)))
        for elements_m in (self.receiver_m, self.transmitter_m):
            length_m += np.linalg.norm(points_m[:, None] - elements_m, axis=2)
        waves_per_m = 1 / self.wavelength_m - self.chirp_hz_per_m * range_m / SPEED_OF_LIGHT_MPS
        return np.asarray(np.exp(-2j * np.pi * waves_per_m * (length_m - 2 * range_m)))

    def doppler_phases(self, doppler_hz: Real | float) -> Complex:
        """Return the phase factors of the channels' offsets at some Doppler, (..., n)."""
        return np.asarray(np.exp(2j * np.pi * np.multiply.outer(doppler_hz, self.offset_s)))

    def search_directions(self) -> Real:
        """Return unit vectors all over the half space before the array, (k, 3)."""
        axes = []
        for measured, extent in zip(self.measures, self.extent_wavelengths, strict=True):
            count = 2 * math.ceil(_PER_BEAM * extent) + 1 if measured else 1
            axes.append(np.linspace(-1, 1, count) if measured else np.zeros(1))
        right, up = (one.ravel() for one in np.meshgrid(*axes, indexing="ij"))
        inside = right**2 + up**2 <= 1
        return unit_vectors(right[inside], up[inside])

    def unambiguous_sines(self) -> tuple[float, float]:
        """Return the largest sine of azimuth and of elevation without a grating lobe before the
        array, 1 where there is none.
        """
        found = []
        for axis, measured in enumerate(self.measures):
            if not measured:
                found.append(1.0)
                continue
            extent = float(self.extent_wavelengths[axis])
            apart = np.linspace(0, 2, 8 * math.ceil(2 * extent) + 1)
            places = self.virtual_m[:, axis] / self.wavelength_m
            alike = np.abs(np.exp(2j * np.pi * np.outer(apart, places)).mean(axis=1)) ** 2
            # past the first minimum, the main lobe
            beyond = int(np.argmax(np.diff(alike) > 0))
            edges = np.concatenate([[0.0], alike, [0.0]])
            tops = (alike >= edges[:-2]) & (alike >= edges[2:]) & (alike > _ALIKE)
            lobes = np.flatnonzero(tops & (np.arange(alike.size) > beyond))
            found.append(min(float(apart[lobes[0]]) / 2, 1.0) if lobes.size else 1.0)
        return found[0], found[1]


def unit_vectors(right: Real, up: Real) -> Real:
    """Return unit vectors before the antenna from their parts to the right and upwards, (k, 3)."""
    ahead = np.sqrt(np.maximum(1 - np.square(right) - np.square(up), 0.0))
    return np.stack([right, up, -ahead], axis=-1)


def angles_deg(direction: Real) -> tuple[float, float]:
    """Return azimuth (to the right) and elevation (upwards) of a unit vector [degrees]."""
    right, up, back = direction.tolist()
    return (
        math.degrees(math.atan2(right, -back)),
        math.degrees(math.atan2(up, math.hypot(right, back))),
    )


# -- spectra and estimators of a covariance --------------------------------------------------------


def bartlett(covariance: Complex, steering: Complex) -> Real:
    """Return the power of beams, a^H R a / n^2.

    Parameters
    ----------
    covariance
        Mean of x x^H over snapshots, (n, n).
    steering
        Phase factors of directions, (k, n), see `ArrayGeometry.steering`.

    Returns
    -------
    ndarray
        (k,); for one echo of power P in each channel its maximum is P.
    """
    count = steering.shape[1]
    return np.asarray(_quadratic(covariance, steering) / count**2)


def capon(covariance: Complex, steering: Complex, loading: float = 1e-6) -> Real:
    """Return the power of the beams of least output, 1 / (a^H R^-1 a).

    Parameters
    ----------
    covariance, steering
        As for `bartlett`.
    loading
        Part of the mean power that is added to the diagonal, so that few snapshots will do.

    Returns
    -------
    ndarray
        (k,).
    """
    count = len(covariance)
    loaded = covariance + loading * np.trace(covariance).real / count * np.eye(count)
    return np.asarray(1 / _quadratic(np.linalg.inv(loaded), steering))


def music(covariance: Complex, steering: Complex, sources: int) -> Real:
    """Return n / (a^H E E^H a) with the noise's eigenvectors E.

    Parameters
    ----------
    covariance, steering
        As for `bartlett`.
    sources
        Number of sources, below n.

    Returns
    -------
    ndarray
        (k,); peaks, not powers.

    Raises
    ------
    ConfigError
        No source, or as many as channels.
    """
    count = _checked_sources(covariance, sources)
    noise = np.linalg.eigh(covariance)[1][:, : count - sources]
    apart = np.sum(np.abs(steering.conj() @ noise) ** 2, axis=1)
    return np.asarray(count / np.maximum(apart, np.finfo(np.float64).tiny))


def esprit(covariance: Complex, spacing_wavelengths: float, sources: int) -> Real:
    """Return the directions of sources for a row of equal spacing, without a search.

    Parameters
    ----------
    covariance
        Mean of x x^H over snapshots, (n, n), the elements in order along the row.
    spacing_wavelengths
        Distance of neighbouring virtual elements, in wavelengths.
    sources
        Number of sources, below n.

    Returns
    -------
    ndarray
        Parts of the unit vectors along the row (sine of the angle off broadside), ascending,
        (sources,). Beyond 0.5 / spacing they are ambiguous.

    Raises
    ------
    ConfigError
        No source, or as many as channels.
    """
    count = _checked_sources(covariance, sources)
    signal = np.linalg.eigh(covariance)[1][:, count - sources :]
    turn = np.linalg.lstsq(signal[:-1], signal[1:], rcond=None)[0]
    phases = np.angle(np.linalg.eigvals(turn))
    return np.sort(phases / (2 * np.pi * spacing_wavelengths))


def _checked_sources(covariance: Complex, sources: int) -> int:
    count = len(covariance)
    if not 0 < sources < count:
        raise ConfigError(f"{sources} sources of {count} channels; expected 1 to {count - 1}.")
    return count


def count_sources(covariance: Complex, snapshots: int) -> int:
    """Return the number of sources by the minimum description length (Wax and Kailath, 1985).

    Parameters
    ----------
    covariance
        Mean of x x^H over snapshots, (n, n).
    snapshots
        Number of snapshots.

    Returns
    -------
    int
        0 to n - 1.
    """
    count = len(covariance)
    levels = np.maximum(np.linalg.eigvalsh(covariance)[::-1], np.finfo(np.float64).tiny)
    costs = []
    for sources in range(count):
        rest = levels[sources:]
        ratio = np.log(rest).mean() - math.log(rest.mean())
        free = sources * (2 * count - sources)
        costs.append(-snapshots * rest.size * ratio + free * math.log(snapshots) / 2)
    return int(np.argmin(costs))


def covariance_of(snapshots: Complex, subarray: int | None = None) -> Complex:
    """Return the covariance of snapshots.

    Parameters
    ----------
    snapshots
        Values of n channels, (n, m).
    subarray
        Neighbouring elements of a row over whose places the covariance is averaged, forwards and
        backwards: echoes of one radar are coherent with one another, and only such averaging tells
        them apart (Pillai and Kwon, IEEE TASSP 37, 8, 1989). None: all elements, not averaged.

    Returns
    -------
    ndarray
        (n, n), or (subarray, subarray).

    Raises
    ------
    ConfigError
        A subarray of no element, or of more than there are.
    """
    count = snapshots.shape[0]
    size = count if subarray is None else subarray
    if not 1 <= size <= count:
        raise ConfigError(f"A subarray of {size} elements of {count}; expected 1 to {count}.")
    total = np.zeros((size, size), dtype=np.complex128)
    for first in range(count - size + 1):
        part = snapshots[first : first + size]
        total += part @ part.conj().T
    total /= snapshots.shape[1] * (count - size + 1)
    return np.asarray((total + total[::-1, ::-1].conj()) / 2 if subarray is not None else total)


def _quadratic(matrix: Complex, steering: Complex) -> Real:
    return np.asarray(np.sum((steering.conj() @ matrix) * steering, axis=1).real)


# -- sources of one cell of a map ------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Source:
    """An echo in one cell of a map.

    Attributes
    ----------
    direction
        Unit vector in the receiver's axes, (3,).
    amplitude
        Its amplitude in each channel.
    fold
        Multiples of the PRF by which its Doppler is beyond the map's.
    weights
        Factors of the channels whose sum is a beam in its direction, of gain 1 there and 0 towards
        the others of its cell, (n,).
    among
        Whether others are in the same cell.
    """

    direction: Real
    amplitude: complex
    fold: int
    weights: Complex
    among: bool = False


class DirectionFinder:
    """Finds the sources of cells; keeps the directions of the search."""

    def __init__(self, geometry: ArrayGeometry) -> None:
        self.geometry = geometry
        self._directions = geometry.search_directions()
        self._plane = geometry.steering(self._directions)
        self._free = np.flatnonzero(geometry.measures)
        slots = np.unique(np.round(geometry.offset_s * geometry.prf_hz, 9))
        # Phases repeat where the multiple times the shortest slot, in pulse intervals, is whole.
        count = min(round(1 / float(np.diff(slots).min(initial=1.0))), _MOST_FOLDS)
        #: Multiples of the PRF that the offsets tell apart, the smallest speeds first.
        self.folds: Integers = np.array(sorted(range(-(count // 2), (count + 1) // 2), key=abs))

    def find(
        self, samples: Complex, range_m: float, doppler_hz: float, least_w: float, most: int
    ) -> list[Source]:
        """Return the sources of one cell, the strongest first.

        Parameters
        ----------
        samples
            Values of the channels in the cell, (n,).
        range_m, doppler_hz
            Of the cell; the Doppler's phases are taken off.
        least_w
            Power |amplitude|^2 below which an echo is noise; the first one is returned anyway.
        most
            Number of sources at most.
        """
        starts = self._strongest(samples, range_m, doppler_hz, self.folds)
        fold, best = (
            starts[0][0],
            self._sources(samples, starts[0], range_m, doppler_hz, least_w, most),
        )
        # Of two targets, the beam of another fold may be the strongest: what is left tells them.
        much = _MUCH * np.linalg.norm(samples)
        for start in starts[1:] if most > 1 and np.linalg.norm(best[2]) > much else []:
            other = self._sources(samples, start, range_m, doppler_hz, least_w, most)
            if np.linalg.norm(other[2]) < _BETTER * np.linalg.norm(best[2]):
                fold, best = start[0], other
        places, amplitudes, _ = best
        offsets = self._offsets(doppler_hz, np.array([fold]))[0]
        directions = unit_vectors(*places.T)
        weights = np.linalg.pinv((self.geometry.steering(directions, range_m) * offsets).T)
        return [
            Source(directions[n], complex(amplitudes[n]), fold, weights[n], len(places) > 1)
            for n in np.argsort(-np.abs(amplitudes)).tolist()
        ]

    def _sources(
        self,
        samples: Complex,
        start: tuple[int, Real],
        range_m: float,
        doppler_hz: float,
        least_w: float,
        most: int,
    ) -> tuple[Real, Complex, Complex]:
        """Return places and amplitudes of the sources of one fold, and what they leave."""
        fold, place = start
        turned = samples * self._offsets(doppler_hz, np.array([fold]))[0].conj()
        places, amplitudes, rest = self._fitted(turned, [place], range_m)
        # each takes a direction and an amplitude: more unknowns than channels have no solution
        for _ in range(1, min(most, len(samples) // (2 + self._free.size))):
            ((_, place),) = self._strongest(rest, range_m, 0.0, np.zeros(1, dtype=np.intp))
            trial = self._fitted(turned, [*places, place], range_m)
            explained = 1 - (np.linalg.norm(trial[2]) / (np.linalg.norm(rest) or 1.0)) ** 2
            weak = np.abs(trial[1]).min() ** 2 < least_w
            if weak or explained < _EXPLAINED or not self.are_apart(trial[0]):
                break
            places, amplitudes, rest = trial
        return places, amplitudes, rest

    def are_apart(self, directions: Real | Sequence[Real]) -> bool:
        """Return whether directions (k, 2 or 3) are so far apart that they are several."""
        places = np.asarray(directions)
        scaled = places[:, self._free] * self.geometry.extent_wavelengths[self._free]
        apart = np.linalg.norm(scaled[:, None] - scaled, axis=2)
        return bool((apart[np.triu_indices(len(places), 1)] >= _RESOLVED).all())

    def _strongest(
        self, samples: Complex, range_m: float, doppler_hz: float, folds: Integers
    ) -> list[tuple[int, Real]]:
        """Return folds, and parts to the right and upwards of the strongest beam of the search of
        each, the strongest first. Folds of much weaker beams are left out.
        """
        # what turns spherical into plane wavefronts, as it is straight ahead
        ahead = np.array([[0.0, 0.0, -1.0]])
        curved = (self.geometry.steering(ahead) / self.geometry.steering(ahead, range_m))[0]
        turned = samples * self._offsets(doppler_hz, folds).conj()
        power = np.abs((turned * curved) @ self._plane.conj().T)
        places, best = power.argmax(axis=1), power.max(axis=1)
        return [
            (int(folds[n]), self._directions[places[n]][:2])
            for n in np.argsort(-best, kind="stable").tolist()
            if best[n] >= _WORTH * best.max()
        ]

    def _offsets(self, doppler_hz: float, folds: Integers) -> Complex:
        all_hz = np.asarray(doppler_hz + folds * self.geometry.prf_hz, dtype=np.float64)
        return self.geometry.doppler_phases(all_hz)

    def _fitted(
        self, samples: Complex, places: list[Real], range_m: float
    ) -> tuple[Real, Complex, Complex]:
        """Return places and amplitudes of sources that fit the samples best, and what they leave.

        Amplitudes are linear: of each trial of the places they are the best ones (variable
        projection; Golub and Pereyra, SIAM J. Numer. Anal. 10, 413, 1973).
        """
        start = np.array(places)
        free = self._free
        scale = 1 / self.geometry.extent_wavelengths[free]
        unit = float(np.linalg.norm(samples)) or 1.0

        def places_of(steps: Real) -> Real:
            moved = start.copy()
            moved[:, free] += steps.reshape(len(start), free.size) * scale
            length = np.maximum(1.0, np.hypot(*moved.T))[:, None]
            return np.asarray(moved / length)  # not behind the array

        def solved(at: Real) -> tuple[Complex, Complex]:
            phases = self.geometry.steering(unit_vectors(*at.T), range_m).T
            amplitudes = np.linalg.lstsq(phases, samples, rcond=None)[0]
            return amplitudes, samples - phases @ amplitudes

        def left(steps: Real) -> Real:
            rest = solved(places_of(steps))[1] / unit
            return np.concatenate([rest.real, rest.imag])

        at = start
        if free.size:
            at = places_of(least_squares(left, np.zeros(start[:, free].size), **_FIT).x)
        return at, *solved(at)
