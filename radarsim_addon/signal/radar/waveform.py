# SPDX-License-Identifier: GPL-3.0-or-later
"""What all waveforms share: their numbers and the checks of them."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal, Protocol

from ...errors import ConfigError
from ...physics.constants import SPEED_OF_LIGHT_MPS

#: More samples of one pulse, chirp or code than this is a unit error.
MAX_WAVEFORM_SAMPLES = 1 << 22

# Settings of several waveforms. Above 10 THz a carrier is a unit error, such as hertz in place of
# gigahertz.
CARRIER: dict[str, Any] = {
    "label": "Carrier",
    "help": "Set the middle of the band: wavelength, Doppler and the index of physical materials",
    "shown_in": "GHz",
    "above": 0.0,
    "maximum": 1e13,
    "soft_maximum": 300e9,
    "initial": 5.3e9,
    "hint": "Check the unit: the panel and --carrier-ghz take GHz.",
}
BANDWIDTH: dict[str, Any] = {
    "label": "Bandwidth",
    "help": "Set the swept bandwidth B; the range resolution is c / 2B",
    "shown_in": "MHz",
    "above": 0.0,
    "initial": 50e6,
}
SAMPLING_RATE: dict[str, Any] = {
    "label": "Sampling rate",
    "help": "Set the complex samples per second; at least the bandwidth",
    "shown_in": "MHz",
    "above": 0.0,
    "initial": 60e6,
}


def check_carrier(carrier_hz: float, bandwidth_hz: float) -> None:
    """Raise a ConfigError unless the carrier is above half the bandwidth."""
    if carrier_hz <= bandwidth_hz / 2:
        raise ConfigError(
            f"Carrier {carrier_hz:g} Hz is not above half the bandwidth "
            f"{bandwidth_hz:g} Hz; check the units (the panel takes GHz and MHz)."
        )


class AnyWaveform(Protocol):
    """What all waveforms have in common, see :mod:`.radar.pulses`,
    :mod:`.radar.continuous_wave`.

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
    def sample_count(self) -> int:
        """Samples of one pulse, or of one row that the receiver samples."""
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
