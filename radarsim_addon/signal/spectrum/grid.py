# SPDX-License-Identifier: GPL-3.0-or-later
"""Frequencies of a synthesis, delays that are received, shapes of pulses; and exact phases.

**Phases.** A path of 10 km at 77 GHz is 5e6 cycles: in a plain float64 product its phase has lost
seven of sixteen digits before the cosine is taken. `reduced_cycles` forms products in two parts
(Dekker, Numer. Math. 18, 224, 1971), so that the fraction of a cycle is that of the float64 length
to about 1e-15 cycles, up to 1e10 cycles.

**Meeting times.** A wave meets the path half its delay after it was emitted, and as much before it
is received. For a two-way length l(t) = l + r (t - t_m), r > 0 receding, that is

    c tau = l(t_m + s tau / 2),    tau = l / (c - s r / 2)

with s = 1 where t_m is a time of emission, -1 where it is one of reception (`Meeting`). It is exact
for a constant rate, one reflection and antennas at one place.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...arrays import Complex, Mask, Real
from ...errors import ConfigError, PathDataError
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..motion import Rows

#: Elements worked on at a time, so that temporaries stay in the processor's cache.
BLOCK = 1 << 13
#: Values of k next to one another whose phases have a value in common.
_NEAR = 32
#: Veltkamp's splitter: 2^27 + 1.
_SPLITTER = 134_217_729.0


@dataclass(frozen=True)
class CycleRate:
    """Cycles per metre of path, head + tail, about 80 bits: `head` has the leading 26, so that
    its product with half of a float64 is exact.
    """

    head: float
    tail: float

    @property
    def rate(self) -> float:
        return self.head + self.tail

    @classmethod
    def of(cls, frequency_hz: Fraction | float) -> CycleRate:
        """Return rate f / c of a frequency [1/m]."""
        exact = Fraction(frequency_hz) / Fraction(SPEED_OF_LIGHT_MPS)
        if exact == 0:
            return cls(0.0, 0.0)
        mantissa, exponent = math.frexp(float(exact))
        head = math.ldexp(round(math.ldexp(mantissa, 26)), exponent - 26)
        return cls(head, float(exact - Fraction(head)))


def reduced_cycles(length_m: Real, rate: CycleRate, out: Real | None = None) -> Real:
    """Return length x rate minus the nearest whole number, exact to about 1e-15. Write to `out` if
    given.
    """
    high = length_m * _SPLITTER
    rest = high - length_m
    high -= rest  # leading 26 bits of the length
    np.subtract(length_m, high, out=rest)
    cycles = np.multiply(high, rate.head, out=out)  # exact
    cycles -= np.rint(cycles, out=high)
    rest *= rate.head  # exact
    cycles += rest
    np.multiply(length_m, rate.tail, out=rest)
    cycles += rest
    cycles -= np.rint(cycles, out=high)
    return cycles


def reduce_cycles(cycles: Real) -> Real:
    """Subtract the nearest whole number, in place."""
    cycles -= np.rint(cycles)
    return cycles


def phasors(amplitude: NDArray[np.inexact[Any]], cycles: Real, out: Complex) -> Complex:
    """Write amplitude exp(j 2 pi cycles) to `out`. Overwrite `cycles`, which should be reduced."""
    cycles *= 2 * np.pi
    np.cos(cycles, out=out.real)
    np.sin(cycles, out=out.imag)
    out *= amplitude
    return out


def unit_phasors(cycles: Real) -> Complex:
    """Return exp(j 2 pi cycles). Overwrite the cycles."""
    return phasors(np.ones(1), reduce_cycles(cycles), np.empty(cycles.shape, dtype=np.complex128))


def phasor_lines(cycles: Real, step: Real, count: int) -> Complex:
    """Return exp(j 2 pi (cycles + k step)), (count, n), for k = -(count//2) and so on.

    They are put together from a few k and the distances from these, since a cosine takes ten times
    a product.
    """
    far, near = np.arange(-(count // 2), count - count // 2, _NEAR), np.arange(_NEAR)
    found = unit_phasors(far[:, None] * step + cycles)[:, None] * unit_phasors(near[:, None] * step)
    return np.asarray(found.reshape(-1, cycles.size)[:count])


@dataclass(frozen=True)
class Meeting:
    """Time at which the wave meets the path: after its emission (`side` 1), or before its reception
    (-1).
    """

    side: float

    def _halfway(self, rate_mps: Real) -> Real:
        return self.side * rate_mps / (2 * SPEED_OF_LIGHT_MPS)

    def seen_mps(self, rate_mps: Real) -> Real:
        """Return c times the rate of the delay, (n,) [m/s], from the rates of the lengths [m/s]."""
        return np.asarray(rate_mps / (1 - self._halfway(rate_mps)))

    def moved_m(self, length_m: Real, rate_mps: Real, later_s: Real | float = 0.0) -> Real:
        """Return c tau at `later_s` minus the length, (n,) [m]."""
        halfway = self._halfway(rate_mps)
        return np.asarray((rate_mps * later_s + length_m * halfway) / (1 - halfway))


EMISSION, RECEPTION = Meeting(1.0), Meeting(-1.0)


NodeWeights = Real | Complex
Weights = NDArray[np.inexact[Any]]
#: Further phase of a path, in cycles, from its delay [s]; vectorised.
ExtraCycles = Callable[[Real], Real]

#: Fraction of the tolerance for the interpolation between nodes; a digit costs one.
NODES_SHARE = 0.01
#: At 77 GHz and 10 us that is 1200 km/s; each two radians cost a transform.
_MOST_BEND_RAD = 1e4


class PulseShape:
    """A transmitted pulse, for motion while it is under way (see `PulseMotionTransform`): complex
    samples (n,) at `rate_hz`, the band of the grid of `count` >= n frequencies.
    """

    meeting = EMISSION  #: nodes are times of emission

    def __init__(self, samples: Complex, rate_hz: float, count: int) -> None:
        self._samples, self._count = samples, count
        middle = (samples.size - 1) / 2
        #: From the middle of the pulse to its ends [s].
        self.half_s = max(middle, 0.5) / rate_hz
        self._times: Real = np.asarray((np.arange(samples.size) - middle) / max(middle, 0.5))
        self._bases: dict[int, NodeWeights] = {}
        #: Spectrum of the pulse, frequencies ascending, and its root mean square.
        self.spectrum = self._spectrum(samples)
        self.rms = float(np.sqrt(np.mean(np.abs(self.spectrum) ** 2)))

    def _spectrum(self, samples: Complex) -> Complex:
        """Transform samples (..., n) about the middle of the pulse to (..., frequencies)."""
        middle = (self._samples.size - 1) / 2
        shift = np.exp(2j * np.pi * np.fft.fftfreq(self._count) * middle)
        return np.fft.fftshift(np.fft.fft(samples, self._count) * shift, axes=-1)

    def _basis(self, polynomials: Real) -> NodeWeights:
        """Return W_j, (nodes, frequencies), from the Lagrange polynomials (nodes, n) at the
        samples.
        """
        return self._spectrum(self._samples * polynomials)

    def _weights(self, nodes: int) -> NodeWeights:
        if nodes not in self._bases:
            self._bases[nodes] = self._basis(lagrange(chebyshev_nodes(nodes), self._times))
        return self._bases[nodes]

    def times_s(self, nodes: int) -> Real:
        """Return times u_j of the nodes from the middle of the pulse, (nodes,) [s]."""
        return self.half_s * chebyshev_nodes(nodes)

    def joined(self, spectra: Complex) -> Complex:
        """Return the spectra of the echoes from the spectra S at each node, (..., nodes,
        frequencies).
        """
        weights = self._weights(spectra.shape[-2])
        return np.asarray(np.einsum("...jf,jf->...f", spectra, weights))

    def nodes(self, rate_mps: Real, highest_hz: float, tolerance: float) -> int:
        """Return the number of nodes for paths with these rates of the length [m/s]."""
        fastest = float(np.abs(rate_mps).max(initial=0.0)) / SPEED_OF_LIGHT_MPS
        phase_rad = 2 * math.pi * highest_hz * fastest * self.half_s
        return nodes_for(phase_rad, NODES_SHARE * tolerance)

    def stretch(self, rate_mps: Real) -> Real:
        """Return 1 + beta, (n,): the duration of a pulse at reception over that at emission."""
        return np.asarray(1 + rate_mps / (SPEED_OF_LIGHT_MPS - rate_mps / 2))


class CodeShape(PulseShape):
    """A code that repeats without end, received for one of its periods; samples (n,).

    A sample received at t_m + u, u from the middle of the period, has the delay tau(t_m + u): S is
    that of all samples, each of which takes it at its own time. So the sums at the nodes are turned
    into samples, and these are weighted by L_j(u).
    """

    meeting = RECEPTION  #: nodes are times of reception

    def __init__(self, samples: Complex, rate_hz: float) -> None:
        super().__init__(samples, rate_hz, samples.size)

    def _spectrum(self, samples: Complex) -> Complex:
        return np.fft.fftshift(np.fft.fft(samples), axes=-1)

    def _basis(self, polynomials: Real) -> NodeWeights:
        return polynomials

    def joined(self, spectra: Complex) -> Complex:
        echoes = np.fft.ifft(np.fft.ifftshift(spectra * self.spectrum, axes=-1))
        weights = self._weights(spectra.shape[-2])
        return self._spectrum(np.einsum("...jt,jt->...t", echoes, weights))

    def stretch(self, rate_mps: Real) -> Real:
        """Return 1, because samples are taken at their own times."""
        return np.ones_like(rate_mps)


def chebyshev_nodes(count: int) -> Real:
    """Return zeros of T_count, within -1 and 1."""
    return np.asarray(np.cos(np.pi * (np.arange(count) + 0.5) / count))


def lagrange(nodes: Real, places: Real) -> Real:
    """Return Lagrange polynomials of nodes at places, all within -1 and 1, (nodes, places)."""
    vander = np.polynomial.chebyshev.chebvander
    inverse = np.linalg.inv(vander(nodes, nodes.size - 1))
    return np.asarray((vander(places, nodes.size - 1) @ inverse).T, dtype=np.float64)


def nodes_for(bend_rad: float, tolerance: float) -> int:
    """Number of Chebyshev nodes for exp(j L p), |p| <= 1, L = `bend_rad`, to be within the
    tolerance: M nodes leave 4 (L/2)^M / M! (the tail of the Jacobi-Anger series).
    """
    if not bend_rad <= _MOST_BEND_RAD:
        raise ConfigError(
            f"Motion turns the phase of an echo by {2 * bend_rad:.3g} rad within a pulse; at most "
            f"{2 * _MOST_BEND_RAD:g} can be followed. Look for an object that jumps or is faster "
            "than any can be, or render the frame again if its files are damaged."
        )
    nodes, left = 1, 4 * (bend_rad / 2)
    while left > tolerance or nodes < bend_rad / 2:
        nodes += 1
        left *= bend_rad / 2 / nodes
    return nodes


@dataclass(frozen=True)
class FrequencyGrid:
    """Regular frequencies f_n = start + n step, n = 0 ... count-1.

    Attributes
    ----------
    start_hz
        First frequency, carrier included [Hz].
    step_hz
        Step, of either sign [Hz].
    count
        Number of frequencies.
    centre_hz
        f at n = count//2, where it is known better than by start + n step; see `centred` [Hz].
    """

    start_hz: float
    step_hz: float
    count: int
    centre_hz: float | Fraction | None = None

    @classmethod
    def centred(cls, centre_hz: float | Fraction, step_hz: float, count: int) -> FrequencyGrid:
        """Return the grid with f = centre_hz, to the last digit, at n = count//2."""
        return cls(float(centre_hz - (count // 2) * step_hz), step_hz, count, centre_hz)

    def __post_init__(self) -> None:
        if not (isinstance(self.count, int) and self.count >= 1):
            raise ConfigError(f"Number of frequencies is {self.count!r}; expected 1 or more.")
        if not (math.isfinite(self.step_hz) and self.step_hz != 0):
            raise ConfigError(f"Frequency step is {self.step_hz!r} Hz; expected a number but 0.")
        if not math.isfinite(self.start_hz):
            raise ConfigError(f"First frequency is {self.start_hz!r} Hz; expected a number.")

    @property
    def exact_centre_hz(self) -> Fraction:
        """f at n = count//2, where the transforms have their zero [Hz]."""
        if self.centre_hz is not None:
            return Fraction(self.centre_hz)
        return Fraction(self.start_hz) + (self.count // 2) * Fraction(self.step_hz)

    @property
    def frequencies_hz(self) -> Real:
        """(count,) [Hz]."""
        return np.asarray(self.start_hz + self.step_hz * np.arange(self.count))

    @property
    def highest_hz(self) -> float:
        """Largest |f| [Hz]."""
        return max(abs(self.start_hz), abs(self.start_hz + self.step_hz * (self.count - 1)))


@dataclass(frozen=True)
class ReceiveWindow:
    """The delays that are received, and whether echoes of earlier pulses are among them.

    Attributes
    ----------
    first_s, last_s
        Delays that are received; a path adds nothing at pulses where its delay is another [s].
    period_s
        Pulse interval P: an echo later than P falls into a later pulse's window, at tau - qP.
        None: every echo is received after its own pulse [s].
    reference_hz
        Carrier. Oscillators run on between pulses, so folding keeps the carrier's phase:
        exp(-j 2 pi [f0 tau + (f - f0)(tau - qP)]) [Hz].
    """

    first_s: float = -math.inf
    last_s: float = math.inf
    period_s: float | None = None
    reference_hz: float = 0.0

    def __post_init__(self) -> None:
        if not self.first_s < self.last_s:
            raise ConfigError(
                f"Delays from {self.first_s!r} to {self.last_s!r} s; expected first < last."
            )
        if self.period_s is not None:
            if not (math.isfinite(self.period_s) and self.period_s > 0):
                raise ConfigError(f"Pulse interval is {self.period_s!r} s; expected more than 0.")
            if not math.isfinite(self.last_s - self.first_s):
                raise ConfigError("Folding needs a window of delays with two ends.")

    def orders(self, earliest_s: Real, latest_s: Real) -> tuple[Real, Real]:
        """Return the first and the last order q whose echo reaches the window, (n,).

        The echo has all delays from `earliest_s` to `latest_s` [s]; order q shifts it by q periods.
        """
        if self.period_s is None:
            heard = (latest_s > self.first_s) & (earliest_s < self.last_s)
            return np.zeros(heard.shape), np.where(heard, 0.0, -1.0)
        low = np.floor((earliest_s - self.last_s) / self.period_s) + 1
        high = np.ceil((latest_s - self.first_s) / self.period_s) - 1
        return low, np.maximum(high, low - 1)

    def covers(self, earliest_s: float, latest_s: float) -> bool:
        """Return whether each delay from the first to the last is received once, with order 0."""
        if not (earliest_s > self.first_s and latest_s < self.last_s):
            return False
        if self.period_s is None:
            return True
        return (
            latest_s - self.first_s <= self.period_s and earliest_s - self.last_s >= -self.period_s
        )


@dataclass(frozen=True)
class Ramp:
    """Frequencies that come one after the other: paths move from one to the next.

    Attributes
    ----------
    interval_s
        Time between two frequencies; n is sampled at t_m + (n - count//2) interval [s].
    video_hz_per_s
        K of the residual video phase, K tau^2 / 2 cycles, of a ramp mixed with itself; 0: none, as
        for tones that have settled [Hz/s].
    """

    interval_s: float
    video_hz_per_s: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.interval_s) and self.interval_s > 0):
            raise ConfigError(
                f"Time between frequencies is {self.interval_s!r} s; expected more than 0."
            )
        if not math.isfinite(self.video_hz_per_s):
            raise ConfigError(f"Slope of the ramp is {self.video_hz_per_s!r}; expected a number.")

    def half_s(self, count: int) -> float:
        """Return the time from the middle to the outer samples of the length, within the ramp on
        both sides [s].
        """
        return max((count - 1) // 2, 0.5) * self.interval_s

    def video_cycles(self, delay_s: Real) -> Real:
        """Return K tau^2 / 2 in the shape of the delays [s]."""
        return np.asarray(self.video_hz_per_s / 2 * delay_s**2)


@dataclass(frozen=True)
class SynthesisContext:
    """Numbers that every transform of a synthesis shares."""

    grid: FrequencyGrid
    listening: ReceiveWindow
    extra_cycles: ExtraCycles | None
    centre: CycleRate
    step: CycleRate
    shift_centre: float
    shift_step: float
    ramp: Ramp | None = None
    pulse: PulseShape | None = None

    @classmethod
    def of(
        cls,
        grid: FrequencyGrid,
        listening: ReceiveWindow,
        extra_cycles: ExtraCycles | None,
        ramp: Ramp | None = None,
        pulse: PulseShape | None = None,
    ) -> SynthesisContext:
        """Make the context of a grid and a window. `ConfigError`: a ramp with other phases or with
        folding.
        """
        if pulse is not None and (ramp is not None or extra_cycles is not None):
            raise ConfigError("A pulse goes with neither a ramp nor further phases.")
        if ramp is not None:
            if extra_cycles is not None or listening.period_s is not None:
                raise ConfigError("A ramp brings its own phase and does not fold in delay.")
            extra_cycles = ramp.video_cycles if ramp.video_hz_per_s != 0 else None
        period = Fraction(listening.period_s or 0.0)
        centre = (grid.exact_centre_hz - Fraction(listening.reference_hz)) * period
        step = Fraction(grid.step_hz) * period
        return cls(
            grid,
            listening,
            extra_cycles,
            CycleRate.of(grid.exact_centre_hz),
            CycleRate.of(Fraction(grid.step_hz)),
            float(centre - round(centre)),
            float(step - round(step)),
            ramp,
            pulse,
        )

    @property
    def meeting(self) -> Meeting | None:
        """Time at which waves meet paths that move during the pulse. None: stop and go."""
        if self.pulse is not None:
            return self.pulse.meeting
        return RECEPTION if self.ramp is not None else None


def received_rows(
    sums: SynthesisContext, length_m: Real
) -> tuple[slice | NDArray[np.intp], Real | None, int]:
    """Return the paths whose echoes are received at one pulse.

    The result is their rows, their orders q (None: all 0), and the number of paths. A row appears
    twice if its echo is in the window twice.
    """
    listening = sums.listening
    everything = slice(None), None, length_m.size
    if length_m.size == 0:
        return everything
    scale = 1 / SPEED_OF_LIGHT_MPS
    if listening.covers(float(length_m.min()) * scale, float(length_m.max()) * scale):
        return everything
    delay_s = length_m * scale
    low, high = listening.orders(delay_s, delay_s)
    copies = (high - low + 1).astype(np.intp)
    rows = np.repeat(np.arange(copies.size), copies)
    order = repeat_orders(low, copies)
    return rows, order if order.any() else None, int(np.count_nonzero(copies))


def repeat_orders(low: Real, copies: NDArray[np.intp]) -> Real:
    """Return the orders low, low + 1, ... of each row, one row after the other.

    A row has `copies` orders; the result has the shape (sum of copies,).
    """
    first = np.cumsum(copies) - copies
    return np.asarray(np.repeat(low - first, copies) + np.arange(int(copies.sum())))


def check_finite(
    values: Weights, rows: slice | NDArray[np.intp], what: str, first: int = 0
) -> None:
    """Raise `PathDataError`, with the row's number from `first`, where a value is NaN, infinite or
    above 1e30. `values` have the paths of `rows` along the first axis; `what` names them.
    """
    # larger numbers are of damaged files, and overflow in transforms; NaN compares false
    bad = ~(np.abs(values) <= 1e30)
    if not bad.any():
        return
    place = int(np.argwhere(bad)[0][0])
    number = place + rows.start if isinstance(rows, slice) else int(rows[place])
    value = values[place][bad[place]].flat[0]
    raise PathDataError(
        f"Row {first + number} of the paths has {what} {value}; expected a finite "
        "number of usual size. Leave the row out, or render its run again."
    )


# -------------------------------------------------------------------------------------------------
# Lengths and amplitudes of paths over a burst, as Chebyshev polynomials of slow time.
#
# Values are taken at Chebyshev nodes of the burst; the interpolating polynomial has the
# coefficients c_k of T_k. Since |T_k| <= 1, the coefficients beyond degree 1 bound the departure of
# a length from a constant range rate. Nodes are uneven, so periodic motion cannot hide between
# them; values at other times are compared with the polynomial as well.
#
# If antenna gains change during the burst, an amplitude is a(t) = sum_k c_k T_k(t): each term is
# one more transform of all pulses, weighted with T_k afterwards, or one more product per path and
# pulse. Amplitudes that no polynomial follows, as at nulls of a pattern, are taken at every pulse.
# -------------------------------------------------------------------------------------------------

Values = TypeVar("Values", Real, Complex)

#: Nodes of the fit: a polynomial of degree 15.
NODES = 16
#: Where the polynomial is compared with the motion, as shares of the burst; no node is there.
_CHECKS = np.array([0.0, 0.137, 0.4142, 0.7391, 1.0])


@dataclass(frozen=True)
class FittedMotion:
    """Lengths of rows as polynomials."""

    coefficients_m: Real  #: c_k of T_k, (rows, nodes) [m]
    linear: Mask  #: degree 1 is within the bound, (rows,)
    smooth: Mask  #: the whole polynomial is, (rows,)
    fastest_mps: Real  #: largest rate of the length between nodes, (rows,) [m/s]


class BurstBasis:
    """Chebyshev polynomials of degree below `count` over the time of two or more pulses."""

    def __init__(self, times_s: Real, count: int = NODES) -> None:
        self.count = count
        first_s, last_s = float(times_s.min()), float(times_s.max())
        self.middle_s = (first_s + last_s) / 2
        self.half_s = (last_s - first_s) / 2
        self.nodes_s: Real = self.middle_s + self.half_s * chebyshev_nodes(count)
        self.checks_s: Real = first_s + (last_s - first_s) * _CHECKS
        self._inverse = np.linalg.inv(self.at(self.nodes_s)).T
        self._at_checks = self.at(self.checks_s).T

    def at(self, times_s: Real) -> Real:
        """Return T_k at times [s], (times, count)."""
        place = np.clip((times_s - self.middle_s) / self.half_s, -1.0, 1.0)
        return np.asarray(
            np.polynomial.chebyshev.chebvander(place, self.count - 1), dtype=np.float64
        )

    def sample_times_s(self) -> Real:
        """Return times at which `fit` needs lengths: the nodes, then the checks [s]."""
        return np.concatenate([self.nodes_s, self.checks_s])

    def interpolate(self, values: Values) -> tuple[Values, Real]:
        """Fit values (rows, times) that are given at `sample_times_s`.

        Return the coefficients c_k of the Chebyshev polynomials, (rows, count), and the largest
        error of the fit at the last of these times, which serve as checks, (rows,).
        """
        coefficients = np.ascontiguousarray(values[:, : self.count]) @ self._inverse
        left = np.abs(coefficients @ self._at_checks - values[:, self.count :]).max(axis=1)
        return coefficients, left

    def fit(self, lengths_m: Real, displacement_error_bound_m: float) -> FittedMotion:
        """Fit lengths at `sample_times_s`, (rows, times) [m], and sort them by the bound [m]."""
        at_nodes = lengths_m[:, : self.count]
        # from the first node, so that a long path leaves no rounding in the higher coefficients
        offset_m = at_nodes[:, :1]
        coefficients, left_m = self.interpolate(lengths_m - offset_m)
        size = np.abs(coefficients)
        unseen_m = size[:, -3:].sum(axis=1) + left_m
        smooth = unseen_m <= displacement_error_bound_m / 2
        linear = smooth & (size[:, 2:].sum(axis=1) + unseen_m <= displacement_error_bound_m)
        coefficients[:, 0] += offset_m[:, 0]
        rates = np.abs(np.diff(at_nodes, axis=1) / np.diff(self.nodes_s))
        return FittedMotion(
            coefficients_m=coefficients,
            linear=linear,
            smooth=smooth,
            fastest_mps=rates.max(axis=1),
        )


#: Fraction of the tolerance for an amplitude, relative to the path's largest one: beams are also
#: looked at where they are weak, and a further digit costs two terms or so.
_SHARE = 1e-3
#: Nodes of their fit: beams have more bends than lengths.
AMPLITUDE_NODES = 32


@dataclass(frozen=True)
class AmplitudeHistory:
    """Complex amplitudes of n paths over a burst."""

    constant: Weights  #: amplitude where it does not vary, (n,)
    varies: Mask  #: (n,)
    #: From times [s] and indices of rows: amplitudes, (rows, times).
    at: Callable[[Real, NDArray[np.intp]], Complex]

    @classmethod
    def of(cls, amplitude: Weights) -> AmplitudeHistory:
        """Make the history of amplitudes (n,) that do not vary."""
        return cls(
            amplitude,
            np.zeros(amplitude.shape, dtype=bool),
            lambda times_s, rows: np.repeat(amplitude[rows, None], np.size(times_s), axis=1),
        )

    def select(self, rows: Rows, factor: Real | Complex | float = 1.0) -> AmplitudeHistory:
        """Return the history of some rows, times a factor, (rows,) or one."""
        index = np.arange(self.constant.size)[rows]
        factors = np.broadcast_to(factor, index.shape)
        return AmplitudeHistory(
            self.constant[index] * factors,
            self.varies[index],
            lambda times_s, own: self.at(times_s, index[own]) * factors[own, None],
        )


def fit_amplitudes(basis: BurstBasis, values: Complex, tolerance: float) -> tuple[Complex, Mask]:
    """Return coefficients c_k of T_k, (rows, count), of values (rows, times) at
    ``basis.sample_times_s()``, and a mask of the rows that they follow, (rows,). They are 0 from
    the first k that no fitted row needs.
    """
    coefficients, left = basis.interpolate(values)
    size = np.abs(coefficients)
    bound = _SHARE * tolerance * np.abs(values).max(axis=1)
    fits = size[:, -3:].sum(axis=1) + left <= bound / 2
    # what is dropped with the terms from k on
    tails = np.cumsum(size[:, ::-1], axis=1)[:, ::-1]
    needed = int(np.count_nonzero((tails[fits] > bound[fits, None] / 2).any(axis=0)))
    coefficients[:, max(needed, 1) :] = 0
    return np.asarray(coefficients), np.asarray(fits)


def used_terms(coefficients: Weights) -> Weights:
    """Return coefficients (rows, terms) without the last ones that are 0 in all rows."""
    used = np.flatnonzero(np.abs(coefficients).max(axis=0, initial=0.0) > 0)
    count = int(used[-1]) + 1 if used.size else 1
    found: Weights = np.asarray(coefficients)[..., :count]
    return found
