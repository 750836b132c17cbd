# SPDX-License-Identifier: GPL-3.0-or-later
"""Frequencies of a synthesis, and which delays are listened to at them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...array_types import Real
from ...errors import ConfigError, PathDataError
from ...physics.constants import SPEED_OF_LIGHT_MPS
from .meeting import RECEPTION, Meeting
from .phase import CycleRate
from .pulse_shape import PulseShape

Weights = NDArray[np.inexact[Any]]

#: Further phase of a path, in cycles, from its delay [s]; vectorised.
ExtraCycles = Callable[[Real], Real]


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
        """The grid with f = centre_hz, to the last digit, at n = count//2."""
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
    """Which delays are received, and whether echoes of earlier pulses are among them.

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
        """First and last q, (n,), for which some delay between the two [s] is in the window."""
        if self.period_s is None:
            heard = (latest_s > self.first_s) & (earliest_s < self.last_s)
            return np.zeros(heard.shape), np.where(heard, 0.0, -1.0)
        low = np.floor((earliest_s - self.last_s) / self.period_s) + 1
        high = np.ceil((latest_s - self.first_s) / self.period_s) - 1
        return low, np.maximum(high, low - 1)

    def covers(self, earliest_s: float, latest_s: float) -> bool:
        """Whether all delays between the two are received, once, after their own pulse."""
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
        """From the middle to where lengths are sampled, within the ramp on both sides [s]."""
        return max((count - 1) // 2, 0.5) * self.interval_s

    def video_cycles(self, delay_s: Real) -> Real:
        """K tau^2 / 2 [cycles], of the shape of the delays [s]."""
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
        """For a grid and a window; a ramp takes no other phases and no folding (`ConfigError`)."""
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
        """When waves meet paths that move while the pulse is under way; None: stop and go."""
        if self.pulse is not None:
            return self.pulse.meeting
        return RECEPTION if self.ramp is not None else None


def place(
    sums: SynthesisContext, length_m: Real
) -> tuple[slice | NDArray[np.intp], Real | None, int]:
    """Rows of the paths whose echoes are received at one pulse, their orders q, and how many paths
    are among them. A row is repeated where its echo stands in the window twice; q is None where all
    are 0.
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
    """Return low, low + 1, ... of each row.

    Parameters
    ----------
    low, copies
        First order of each row and how many it has, (n,).

    Returns
    -------
    ndarray
        Orders, (sum of copies,), row after row.
    """
    first = np.cumsum(copies) - copies
    return np.asarray(np.repeat(low - first, copies) + np.arange(int(copies.sum())))


#: Larger numbers are of damaged files, and overflow in transforms.
_MOST = 1e30


def check_finite(
    values: Weights, rows: slice | NDArray[np.intp], what: str, first: int = 0
) -> None:
    """Check that no value is NaN or infinite.

    Parameters
    ----------
    values
        Rows of the paths along the first axis.
    rows
        Rows of the paths that the values belong to.
    what
        Name of the value, for the message.
    first
        Number of the first row.

    Raises
    ------
    PathDataError
        Names the row.
    """
    bad = ~(np.abs(values) <= _MOST)  # also what is not a number
    if not bad.any():
        return
    place = int(np.argwhere(bad)[0][0])
    number = place + rows.start if isinstance(rows, slice) else int(rows[place])
    value = values[place][bad[place]].flat[0]
    raise PathDataError(
        f"Row {first + number} of the paths has {what} {value}; expected a finite "
        "number of usual size. Leave the row out, or render its run again."
    )
