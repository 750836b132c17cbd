# SPDX-License-Identifier: GPL-3.0-or-later
"""The radar's numbers and what follows from them. SI, float64; standard library only.

Sign convention, here and in every product: range rate is positive when the range grows
(receding), and Doppler is ``f_D = -2 (dr/dt) / lambda``: a receding target is at negative Doppler.
Eq. 12 of the paper carries the opposite sign, its Fig. 9 the one used here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..errors import ConfigError
from ..physics.constants import SPEED_OF_LIGHT_MPS

#: Relative slack when two numbers that should be equal come from a user interface in float32.
_SLACK = 1e-6
#: Above 10 THz it is no radar but a slip of the unit, such as hertz where gigahertz are asked for.
_HIGHEST_CARRIER_HZ = 1e13


def _positive(name: str, value: float, unit: str) -> None:
    if not (math.isfinite(value) and value > 0):
        raise ConfigError(f"{name} is {value!r}; expected a positive number of {unit}.")


@dataclass(frozen=True)
class Waveform:
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

    def __post_init__(self) -> None:
        _positive("Carrier frequency", self.carrier_hz, "hertz")
        _positive("Bandwidth", self.bandwidth_hz, "hertz")
        _positive("Chirp length", self.chirp_length_s, "seconds")
        _positive("Sampling rate", self.sampling_rate_hz, "hertz")
        if self.sampling_rate_hz < self.bandwidth_hz * (1 - _SLACK):
            raise ConfigError(
                f"Sampling rate {self.sampling_rate_hz:g} Hz is below the bandwidth "
                f"{self.bandwidth_hz:g} Hz: complex samples would alias. "
                "Raise the sampling rate or lower the bandwidth (FM rate x chirp length)."
            )
        if self.carrier_hz > _HIGHEST_CARRIER_HZ:
            raise ConfigError(
                f"Carrier frequency is {self.carrier_hz:g} Hz; expected at most "
                f"{_HIGHEST_CARRIER_HZ:g} Hz. Check the unit: the panel and --carrier-ghz take GHz."
            )
        if self.carrier_hz <= self.bandwidth_hz / 2:
            raise ConfigError(
                f"Carrier {self.carrier_hz:g} Hz is not above half the bandwidth "
                f"{self.bandwidth_hz:g} Hz; check the units (the panel takes GHz and MHz)."
            )

    @property
    def fm_rate_hz_per_s(self) -> float:
        """Chirp rate K = B / T_p [Hz/s]."""
        return self.bandwidth_hz / self.chirp_length_s

    @property
    def wavelength_m(self) -> float:
        """Carrier wavelength c / f0 [m]."""
        return SPEED_OF_LIGHT_MPS / self.carrier_hz

    @property
    def range_resolution_m(self) -> float:
        """c / 2B [m]; the unweighted half-power width is 0.886 of it."""
        return SPEED_OF_LIGHT_MPS / (2 * self.bandwidth_hz)

    @property
    def sample_spacing_m(self) -> float:
        """One-way range between two samples, c / 2 fs [m]."""
        return SPEED_OF_LIGHT_MPS / (2 * self.sampling_rate_hz)


@dataclass(frozen=True)
class Burst:
    """A train of equal pulses: ``pulses`` of them, ``prf_hz`` a second."""

    prf_hz: float
    pulses: int

    def __post_init__(self) -> None:
        _positive("PRF", self.prf_hz, "hertz")
        if not (isinstance(self.pulses, int) and self.pulses >= 1):
            raise ConfigError(f"Number of pulses is {self.pulses!r}; expected an integer from 1.")

    @property
    def unambiguous_range_m(self) -> float:
        """c / 2 PRF [m]."""
        return SPEED_OF_LIGHT_MPS / (2 * self.prf_hz)


@dataclass(frozen=True)
class Radar:
    """Waveform and burst together, checked against each other."""

    waveform: Waveform
    burst: Burst

    def __post_init__(self) -> None:
        interval_s = 1 / self.burst.prf_hz
        if self.waveform.chirp_length_s > interval_s * (1 + _SLACK):
            raise ConfigError(
                f"Chirp length {self.waveform.chirp_length_s:g} s is longer than the pulse "
                f"interval {interval_s:g} s (PRF {self.burst.prf_hz:g} Hz). "
                "Shorten the chirp or lower the PRF."
            )

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
