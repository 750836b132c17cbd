# SPDX-License-Identifier: GPL-3.0-or-later
"""The radar's numbers and what follows from them. SI, float64; standard library only.

Sign convention, here and in every product: range rate is positive when the range grows
(receding), and Doppler is ``f_D = -2 (dr/dt) / lambda``: a receding target is at negative Doppler.
Eq. 12 of the paper carries the opposite sign, its Fig. 9 the one used here.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from ...errors import ConfigError
from ...options import check_settings, documented, setting
from ...physics.constants import SPEED_OF_LIGHT_MPS
from .channels import SINGLE_CHANNEL, Channel
from .waveform import AnyWaveform

#: Relative slack when two numbers that should be equal come from a user interface in float32.
_SLACK = 1e-6
#: Largest matrix of echoes, in complex samples (4 GiB).
MAX_SAMPLES = 2**28
#: What the error calls the time that a waveform takes.
_DURATION_NAMES = {
    "lfm": "Chirp of",
    "fmcw": "Chirp (ramp and idle time) of",
    "pmcw": "Train of codes of",
    "stepped": "Ramp of steps of",
}


@documented
@dataclass(frozen=True)
class Burst:
    """A train of equal pulses: ``pulses`` of them, ``prf_hz`` a second."""

    prf_hz: float = setting(
        "PRF",
        "Set the pulses per second; the unambiguous range is c / 2 PRF, the maximum unambiguous "
        "velocity wavelength x PRF / 4",
        unit="Hz",
        above=0.0,
        initial=1000.0,
    )
    pulses: int = setting(
        "Pulses",
        "Set the number of pulses of a burst; the velocity resolution is wavelength x PRF / "
        "2 pulses",
        minimum=1,
        maximum=1 << 22,
        soft_maximum=4096,
        initial=128,
    )

    def __post_init__(self) -> None:
        check_settings(self)

    @property
    def unambiguous_range_m(self) -> float:
        """c / 2 PRF [m]."""
        return SPEED_OF_LIGHT_MPS / (2 * self.prf_hz)


@dataclass(frozen=True)
class Radar:
    """Waveform, burst and channels together, checked against each other.

    Attributes
    ----------
    waveform, burst
        What every channel transmits.
    channels
        At least one; samples have them along their first axis.

    Raises
    ------
    ConfigError
        A pulse does not fit into the pulse interval, or a channel does not fit the burst.
    """

    waveform: AnyWaveform
    burst: Burst
    channels: tuple[Channel, ...] = (SINGLE_CHANNEL,)

    def __post_init__(self) -> None:
        interval_s = 1 / self.burst.prf_hz
        if self.waveform.duration_s > interval_s * (1 + _SLACK):
            what = _DURATION_NAMES.get(self.waveform.kind, "Waveform of")
            raise ConfigError(
                f"{what} {self.waveform.duration_s:g} s is longer than the pulse "
                f"interval {interval_s:g} s (PRF {self.burst.prf_hz:g} Hz). "
                "Shorten the chirp or lower the PRF."
            )
        if not self.channels:
            raise ConfigError("The radar has no channels; expected at least one.")
        for number, channel in enumerate(self.channels):
            self._check_channel(number, channel)
        self.check_size(self.waveform.sample_count)

    def check_size(self, samples: int) -> None:
        """Raise a ConfigError where a burst of so many samples for each pulse is too large."""
        # PMCW samples each code of a pulse
        rows = self.burst.pulses * len(self.channels) * getattr(self.waveform, "code_repeats", 1)
        if rows * samples > MAX_SAMPLES:
            raise ConfigError(
                f"A burst of {self.burst.pulses} pulses takes {rows} rows of {samples} samples, "
                f"{rows * samples:.3g} in all; expected at most {MAX_SAMPLES} (4 GiB). Choose "
                "fewer pulses, a lower sampling rate or shorter range limits."
            )

    def _check_channel(self, number: int, channel: Channel) -> None:
        interval_s, stop_s = (
            1 / self.burst.prf_hz,
            channel.start_offset_s + self.waveform.duration_s,
        )
        if stop_s > interval_s * (1 + _SLACK):
            raise ConfigError(
                f"The pulse of channel {number} ends {stop_s:g} s after the start of the pulse "
                f"interval of {interval_s:g} s. Start it earlier or lower the PRF."
            )
        if channel.active is not None and len(channel.active) != self.burst.pulses:
            raise ConfigError(
                f"Channel {number} says of {len(channel.active)} pulses whether it is active; "
                f"expected one value for each of the {self.burst.pulses} pulses."
            )

    def with_pulses(self, pulses: int) -> Radar:
        """Return the radar with the first `pulses` pulses of its burst."""
        channels = tuple(
            dataclasses.replace(c, active=None if c.active is None else c.active[:pulses])
            for c in self.channels
        )
        return Radar(self.waveform, dataclasses.replace(self.burst, pulses=pulses), channels)

    @property
    def unambiguous_range_m(self) -> float:
        """Where echoes begin to fold: c / 2 PRF or the waveform's own limit, the lesser [m]."""
        return min(self.burst.unambiguous_range_m, self.waveform.unambiguous_range_m)

    @property
    def max_unambiguous_velocity_mps(self) -> float:
        """Largest unambiguous |range rate|, lambda PRF / 4 [m/s]."""
        return self.waveform.wavelength_m * self.burst.prf_hz / 4

    def prf_for_hz(self, velocity_mps: float) -> float:
        """PRF that holds range rates up to +- `velocity_mps`, rounded up to three digits [Hz]."""
        prf_hz = 4 * abs(velocity_mps) / self.waveform.wavelength_m
        step_hz = 10.0 ** (math.floor(math.log10(max(prf_hz, 1.0))) - 2)
        return math.ceil(prf_hz / step_hz) * step_hz

    @property
    def velocity_resolution_mps(self) -> float:
        """lambda PRF / (2 M) [m/s] for M pulses."""
        return self.waveform.wavelength_m * self.burst.prf_hz / (2 * self.burst.pulses)

    def doppler_hz(self, range_rate_mps: float) -> float:
        """Doppler shift of a range rate: -2 v / lambda [Hz] (receding is negative)."""
        return -2 * range_rate_mps / self.waveform.wavelength_m
