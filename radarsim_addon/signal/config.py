# SPDX-License-Identifier: GPL-3.0-or-later
"""The radar's numbers and what follows from them. SI, float64; standard library only.

Sign convention, here and in every product: range rate is positive when the range grows
(receding), and Doppler is ``f_D = -2 (dr/dt) / lambda``: a receding target is at negative Doppler.
Eq. 12 of the paper carries the opposite sign, its Fig. 9 the one used here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal, Protocol

from ..errors import ConfigError
from ..physics.constants import SPEED_OF_LIGHT_MPS

#: Relative slack when two numbers that should be equal come from a user interface in float32.
_SLACK = 1e-6
#: What the error calls the time that a waveform takes.
_DURATION_NAMES = {
    "lfm": "Chirp length",
    "fmcw": "Chirp (ramp and idle time) of",
    "pmcw": "Train of codes of",
    "stepped": "Ramp of steps of",
}
#: Above 10 THz it is no radar but a slip of the unit, such as hertz where gigahertz are asked for.
_HIGHEST_CARRIER_HZ = 1e13


def check_positive(name: str, value: float, unit: str) -> None:
    """A finite number above 0, or a ConfigError that names it."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and math.isfinite(value) and value > 0):
        raise ConfigError(f"{name} is {value!r}; expected a positive number of {unit}.")


def check_count(name: str, value: object, least: int, most: int) -> None:
    """A whole number within limits, or a ConfigError that names it."""
    if not (isinstance(value, int) and not isinstance(value, bool) and least <= value <= most):
        raise ConfigError(f"{name} is {value!r}; expected a whole number from {least} to {most}.")


def check_carrier(carrier_hz: float, bandwidth_hz: float) -> None:
    """Carrier and bandwidth that fit together, or a ConfigError that names the likely slip."""
    if carrier_hz > _HIGHEST_CARRIER_HZ:
        raise ConfigError(
            f"Carrier frequency is {carrier_hz:g} Hz; expected at most "
            f"{_HIGHEST_CARRIER_HZ:g} Hz. Check the unit: the panel and --carrier-ghz take GHz."
        )
    if carrier_hz <= bandwidth_hz / 2:
        raise ConfigError(
            f"Carrier {carrier_hz:g} Hz is not above half the bandwidth "
            f"{bandwidth_hz:g} Hz; check the units (the panel takes GHz and MHz)."
        )


class AnyWaveform(Protocol):
    """What all waveforms have in common, see :mod:`.waveform_pulses`,
    :mod:`.waveform_lines`.

    Two families differ in what the receiver samples. "pulse": the echo against fast time, at
    `sampling_rate_hz`; a matched filter makes the range profile. "line": the scene's response at
    evenly spaced frequencies (de-chirped FMCW, stepped frequency, the spectrum of a periodic
    code); a Fourier transform makes the profile, which repeats with `unambiguous_range_m`.
    """

    @property
    def kind(self) -> str:
        """Name of the kind in files, such as "lfm"."""
        ...

    @property
    def family(self) -> Literal["pulse", "line"]:
        """See the class."""
        ...

    @property
    def carrier_hz(self) -> float:
        """Middle of the band [Hz]."""
        ...

    @property
    def bandwidth_hz(self) -> float:
        """Band that the waveform uses [Hz]."""
        ...

    @property
    def sampling_rate_hz(self) -> float:
        """Samples a second of the raw record [Hz]."""
        ...

    @property
    def duration_s(self) -> float:
        """Time that one pulse, chirp, ramp or train of codes takes, pauses included [s]."""
        ...

    @property
    def wavelength_m(self) -> float:
        """c / f0 [m]."""
        ...

    @property
    def range_resolution_m(self) -> float:
        """c / 2B [m]."""
        ...

    @property
    def sample_spacing_m(self) -> float:
        """One-way range between two independent samples of the profile [m]."""
        ...

    @property
    def unambiguous_range_m(self) -> float:
        """Range with which the profile repeats or ends [m]; infinite for single pulses."""
        ...


class WaveformNumbers:
    """What follows for all waveforms from carrier and bandwidth."""

    @property
    def wavelength_m(self: AnyWaveform) -> float:
        """Carrier wavelength c / f0 [m]."""
        return SPEED_OF_LIGHT_MPS / self.carrier_hz

    @property
    def range_resolution_m(self: AnyWaveform) -> float:
        """c / 2B [m]; the unweighted half-power width is 0.886 of it."""
        return SPEED_OF_LIGHT_MPS / (2 * self.bandwidth_hz)


class PulseNumbers(WaveformNumbers):
    """What follows for the family "pulse"."""

    family: ClassVar[Literal["pulse", "line"]] = "pulse"

    @property
    def sample_spacing_m(self: AnyWaveform) -> float:
        """One-way range between two samples, c / 2 fs [m]."""
        return SPEED_OF_LIGHT_MPS / (2 * self.sampling_rate_hz)

    @property
    def unambiguous_range_m(self) -> float:
        """Infinite: what limits it is the PRF, see `Radar.unambiguous_range_m`."""
        return math.inf


@dataclass(frozen=True)
class Waveform(PulseNumbers):
    """A linear FM pulse.

    Parameters
    ----------
    carrier_hz
        Carrier frequency f0 [Hz].
    bandwidth_hz
        Swept bandwidth B [Hz].
    chirp_length_s
        Pulse length T_p [s].
    sampling_rate_hz
        Complex (I/Q) sampling rate [Hz]; at least the bandwidth.
    """

    carrier_hz: float
    bandwidth_hz: float
    chirp_length_s: float
    sampling_rate_hz: float

    kind: ClassVar[str] = "lfm"

    def __post_init__(self) -> None:
        check_positive("Carrier frequency", self.carrier_hz, "hertz")
        check_positive("Bandwidth", self.bandwidth_hz, "hertz")
        check_positive("Chirp length", self.chirp_length_s, "seconds")
        check_positive("Sampling rate", self.sampling_rate_hz, "hertz")
        if self.sampling_rate_hz < self.bandwidth_hz * (1 - _SLACK):
            raise ConfigError(
                f"Sampling rate {self.sampling_rate_hz:g} Hz is below the bandwidth "
                f"{self.bandwidth_hz:g} Hz: complex samples would alias. "
                "Raise the sampling rate or lower the bandwidth (FM rate x chirp length)."
            )
        if not self._samples >= 2:
            raise ConfigError(
                f"Chirp of {self.chirp_length_s:g} s holds {self._samples:.3g} samples at "
                f"{self.sampling_rate_hz:g} Hz; expected at least 2. Lengthen the chirp or raise "
                "the sampling rate, and check their units (the panel takes us and MHz)."
            )
        check_carrier(self.carrier_hz, self.bandwidth_hz)

    @property
    def _samples(self) -> float:
        # a tiny slack: 2.5e-6 * 60e6 is 149.99999999999997
        return self.chirp_length_s * self.sampling_rate_hz * (1 + 1e-9)

    @property
    def sample_count(self) -> int:
        """Whole samples in the pulse, at least 2."""
        return math.floor(self._samples)

    @property
    def duration_s(self) -> float:
        """Pulse length [s]."""
        return self.chirp_length_s

    @property
    def fm_rate_hz_per_s(self) -> float:
        """Chirp rate K = B / T_p [Hz/s]."""
        return self.bandwidth_hz / self.chirp_length_s


@dataclass(frozen=True)
class Burst:
    """A train of equal pulses: ``pulses`` of them, ``prf_hz`` a second."""

    prf_hz: float
    pulses: int

    def __post_init__(self) -> None:
        check_positive("PRF", self.prf_hz, "hertz")
        if not (isinstance(self.pulses, int) and self.pulses >= 1):
            raise ConfigError(f"Number of pulses is {self.pulses!r}; expected an integer from 1.")

    @property
    def unambiguous_range_m(self) -> float:
        """c / 2 PRF [m]."""
        return SPEED_OF_LIGHT_MPS / (2 * self.prf_hz)


@dataclass(frozen=True)
class Radar:
    """Waveform and burst together, checked against each other."""

    waveform: AnyWaveform
    burst: Burst

    def __post_init__(self) -> None:
        interval_s = 1 / self.burst.prf_hz
        if self.waveform.duration_s > interval_s * (1 + _SLACK):
            what = _DURATION_NAMES.get(self.waveform.kind, "Waveform of")
            raise ConfigError(
                f"{what} {self.waveform.duration_s:g} s is longer than the pulse "
                f"interval {interval_s:g} s (PRF {self.burst.prf_hz:g} Hz). "
                "Shorten the chirp or lower the PRF."
            )

    @property
    def unambiguous_range_m(self) -> float:
        """Where echoes begin to fold: c / 2 PRF or the waveform's own limit, the lesser [m]."""
        return min(self.burst.unambiguous_range_m, self.waveform.unambiguous_range_m)

    @property
    def max_velocity_mps(self) -> float:
        """Largest unambiguous |range rate|, lambda PRF / 4 [m/s]."""
        return self.waveform.wavelength_m * self.burst.prf_hz / 4

    @property
    def velocity_resolution_mps(self) -> float:
        """lambda PRF / (2 M) [m/s] for M pulses."""
        return self.waveform.wavelength_m * self.burst.prf_hz / (2 * self.burst.pulses)

    def doppler_hz(self, range_rate_mps: float) -> float:
        """Doppler shift of a range rate: -2 v / lambda [Hz] (receding is negative)."""
        return -2 * range_rate_mps / self.waveform.wavelength_m
