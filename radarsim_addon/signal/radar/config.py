# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of a radar and what follows from them: waveform, burst, channels. SI, float64.

Sign convention, here and in every product: range rate is positive when the range grows (receding),
and Doppler is ``f_D = -2 (dr/dt) / lambda``, so a receding target is at negative Doppler. Eq. 12 of
the paper carries the opposite sign, its Fig. 9 the one used here.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Protocol

import numpy as np

from ...arrays import Complex, Mask, Real
from ...contract import AntennaRecord
from ...errors import ConfigError
from ...options import check_settings, documented, setting
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
    "digits": 2,
}
SAMPLING_RATE: dict[str, Any] = {
    "label": "Sampling rate",
    "help": "Set the complex samples per second; at least the bandwidth",
    "shown_in": "MHz",
    "above": 0.0,
    "initial": 60e6,
    "digits": 2,
}


def check_carrier(carrier_hz: float, bandwidth_hz: float) -> None:
    if carrier_hz <= bandwidth_hz / 2:
        raise ConfigError(
            f"Carrier {carrier_hz:g} Hz is not above half the bandwidth "
            f"{bandwidth_hz:g} Hz; check the units (the panel takes GHz and MHz)."
        )


class AnyWaveform(Protocol):
    """Numbers that all waveforms have.

    Two families differ in what the receiver samples. "pulse": the echo against fast time, at
    `sampling_rate_hz`; a matched filter makes the range profile. "line": the scene's response at
    evenly spaced frequencies (de-chirped FMCW, stepped frequency, the spectrum of a periodic code);
    a Fourier transform makes the profile, which repeats with `unambiguous_range_m`.
    """

    @property
    def kind(self) -> str:
        """Name of the kind in files, such as "lfm"."""

    @property
    def family(self) -> Literal["pulse", "line"]:
        """Family, see the class."""

    @property
    def carrier_hz(self) -> float:
        """Middle of the band [Hz]."""

    @property
    def bandwidth_hz(self) -> float:
        """Band that the waveform uses [Hz]."""

    @property
    def sampling_rate_hz(self) -> float:
        """Samples per second of the raw record [Hz]."""

    @property
    def sample_count(self) -> int:
        """Samples of one pulse, or of one row that the receiver samples."""

    @property
    def duration_s(self) -> float:
        """Time that one pulse, chirp, ramp or train of codes takes, pauses included [s]."""

    @property
    def wavelength_m(self) -> float:
        """c / f0 [m]."""

    @property
    def range_resolution_m(self) -> float:
        """c / 2B [m]."""

    @property
    def sample_spacing_m(self) -> float:
        """One-way range between two independent samples of the profile [m]."""

    @property
    def unambiguous_range_m(self) -> float:
        """Range with which the profile repeats or ends [m]; infinite for single pulses."""


class WaveformNumbers:
    """Numbers of all waveforms that follow from carrier and bandwidth."""

    @property
    def wavelength_m(self: AnyWaveform) -> float:
        return SPEED_OF_LIGHT_MPS / self.carrier_hz

    @property
    def range_resolution_m(self: AnyWaveform) -> float:
        """c / 2B [m]; the unweighted half-power width is 0.886 of it."""
        return SPEED_OF_LIGHT_MPS / (2 * self.bandwidth_hz)


class PulseNumbers(WaveformNumbers):
    """Numbers of the family "pulse"."""

    family: ClassVar[Literal["pulse", "line"]] = "pulse"

    @property
    def sample_spacing_m(self: AnyWaveform) -> float:
        """One-way range between two samples, c / 2 fs [m]."""
        return SPEED_OF_LIGHT_MPS / (2 * self.sampling_rate_hz)

    @property
    def unambiguous_range_m(self) -> float:
        """Infinite, since only the PRF limits it: see `Radar.unambiguous_range_m`."""
        return math.inf


Vector = tuple[float, float, float]


def _numbers(values: object) -> Real:
    """Return numbers as an array; an empty one where they are none."""
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        return np.empty(0)


@dataclass(frozen=True)
class Element:
    """One antenna element of the transmitter or of the receiver.

    Attributes
    ----------
    position_m
        Phase centre, from the antenna's origin and in its axes: x right, y up, z back [m].
    orientation
        Rotation (3, 3) from the element's axes to the antenna's.
    antenna
        Pattern of the element; None: that of the link budget.
    polarisation
        Label such as "H" or "V"; "" where polarisation is not modelled.

    Raises
    ------
    ConfigError
        A number is not finite, or the orientation is not a rotation.
    """

    position_m: Vector = (0.0, 0.0, 0.0)
    orientation: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    antenna: AntennaRecord | None = None
    polarisation: str = ""

    def __post_init__(self) -> None:
        place_m, turn = _numbers(self.position_m), _numbers(self.orientation)
        if place_m.shape != (3,) or not np.isfinite(place_m).all():
            raise ConfigError(
                f"Position of an antenna element is {self.position_m!r:.60}; expected three finite "
                "numbers of metres."
            )
        if turn.shape != (3, 3) or not (
            np.allclose(turn @ turn.T, np.eye(3), rtol=0, atol=1e-6) and np.linalg.det(turn) > 0
        ):
            raise ConfigError(
                f"Orientation of an antenna element is {self.orientation!r:.60}; expected a "
                "rotation matrix of three rows."
            )
        # Lists of a file become tuples, so that equal elements are equal.
        object.__setattr__(self, "position_m", tuple(place_m.tolist()))
        object.__setattr__(self, "orientation", tuple(map(tuple, turn.tolist())))

    @property
    def displaced(self) -> bool:
        """True if the phase centre is not at the antenna's origin."""
        return any(self.position_m)

    @property
    def rotation(self) -> Real:
        """The orientation, (3, 3)."""
        return np.asarray(self.orientation, dtype=np.float64)


@dataclass(frozen=True)
class Channel:
    """One transmitting and one receiving element, and when they are used.

    Attributes
    ----------
    tx, rx
        Transmitting and receiving element.
    start_offset_s
        Start of each of the channel's pulses after that of the burst's pulse, 0 or more [s].
    active
        Whether the channel is used, one value per pulse; None: at every pulse.
    code_turns
        Phases of the transmitter in the slots of a cycle, in cycles, where all transmitters send at
        once; the burst counts cycles then. Empty: it sends alone, once in each pulse interval.

    Raises
    ------
    ConfigError
        The offset is negative or not finite, or a phase is not finite.
    """

    tx: Element = Element()
    rx: Element = Element()
    start_offset_s: float = 0.0
    active: tuple[bool, ...] | None = None
    code_turns: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not (math.isfinite(self.start_offset_s) and self.start_offset_s >= 0):
            raise ConfigError(
                f"Start offset of a channel is {self.start_offset_s!r} s; expected 0 or more."
            )
        if not all(math.isfinite(turns) for turns in self.code_turns):
            raise ConfigError(
                f"Code of a channel is {self.code_turns!r:.60}; expected finite numbers of cycles."
            )

    @property
    def displaced(self) -> bool:
        """True if path lengths differ from those between the antennas' origins."""
        return self.tx.displaced or self.rx.displaced

    @property
    def reference_gain(self) -> bool:
        """True if both elements have the gains of the antennas at their origins."""
        return self.tx == Element(polarisation=self.tx.polarisation) and self.rx == Element(
            polarisation=self.rx.polarisation
        )

    @property
    def code(self) -> Complex:
        """Factors of the transmitter in the slots of a cycle, (slots,)."""
        return np.exp(2j * np.pi * np.array(self.code_turns or (0.0,)))

    def active_mask(self, pulses: int) -> Mask:
        """Return a mask of the pulses that use the channel, (pulses,)."""
        if self.active is None:
            return np.ones(pulses, dtype=bool)
        return np.asarray(self.active, dtype=bool)


#: The channel of a radar with one antenna each.
SINGLE_CHANNEL = Channel()


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
            stop_s = channel.start_offset_s + self.waveform.duration_s
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
        self._check_codes()
        self.check_size(self.waveform.sample_count)

    def _check_codes(self) -> None:
        lengths = sorted({len(channel.code_turns) for channel in self.channels})
        if lengths == [0]:
            return
        codes = {channel.tx: channel.code for channel in self.channels}
        orthogonal = len(lengths) == 1
        if orthogonal:
            matrix = np.array(list(codes.values()))
            across = np.abs(matrix @ matrix.conj().T - lengths[0] * np.eye(len(matrix)))
            orthogonal = across.max() <= 1e-6 * lengths[0]
        if not orthogonal:
            raise ConfigError(
                f"The codes of {len(codes)} transmitters have {lengths} slots and are not "
                "orthogonal. Give all transmitters codes of one length whose products add up to 0."
            )
        if getattr(self.waveform, "real_adc", False):
            raise ConfigError(
                "Transmitters that send at once need a complex ADC: a real one mixes each code "
                "with its conjugate. Set the ADC to complex, or let the transmitters send in turn."
            )
        needed_s, interval_s = lengths[0] * self.waveform.duration_s, 1 / self.burst.prf_hz
        if needed_s > interval_s * (1 + _SLACK):
            raise ConfigError(
                f"A cycle of {lengths[0]} slots takes {needed_s * 1e6:.4g} us, and the pulse "
                f"interval is {interval_s * 1e6:.4g} us. Lower the PRF to at most "
                f"{math.floor(1 / needed_s):g} Hz, or shorten the chirp."
            )

    @property
    def slots(self) -> int:
        """Pulses of a cycle in which all transmitters send at once, each with its code; 1: they
        send in turn.
        """
        return max(len(self.channels[0].code_turns), 1)

    @property
    def sent(self) -> Radar:
        """The radar as it sends: one pulse in each slot, for each transmitter by itself."""
        if self.slots == 1:
            return self
        burst = dataclasses.replace(
            self.burst, pulses=self.burst.pulses * self.slots, prf_hz=self.burst.prf_hz * self.slots
        )
        channels = tuple(Channel(channel.tx, channel.rx) for channel in self.channels)
        return Radar(self.waveform, burst, channels)

    def check_size(self, samples: int) -> None:
        """Raise a ConfigError where a burst of so many samples per pulse is too large."""
        # PMCW samples each code of a pulse
        rows = self.burst.pulses * len(self.channels) * getattr(self.waveform, "code_repeats", 1)
        if rows * samples > MAX_SAMPLES:
            raise ConfigError(
                f"A burst of {self.burst.pulses} pulses takes {rows} rows of {samples} samples, "
                f"{rows * samples:.3g} in all; expected at most {MAX_SAMPLES} (4 GiB). Choose "
                "fewer pulses, a lower sampling rate or shorter range limits."
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
        """Range beyond which echoes fold: the smaller one of c / 2 PRF and the limit of the
        waveform [m].
        """
        return min(self.burst.unambiguous_range_m, self.waveform.unambiguous_range_m)

    @property
    def array_reach_m(self) -> float:
        """Distance of the outermost element from its antenna's origin [m]."""
        return max(math.hypot(*end.position_m) for one in self.channels for end in (one.tx, one.rx))

    @property
    def range_period_m(self) -> float:
        """Range with which echoes repeat: c / 2 PRF of pulses, that of the waveform of stepped
        frequency and PMCW, infinite of FMCW, whose filter takes away what is beyond [m].
        """
        if self.waveform.kind == "fmcw":
            return math.inf
        limit: Burst | AnyWaveform = self.waveform if self.waveform.family == "line" else self.burst
        return limit.unambiguous_range_m

    @property
    def max_unambiguous_velocity_mps(self) -> float:
        """Largest unambiguous |range rate|, lambda PRF / 4 [m/s]."""
        return self.waveform.wavelength_m * self.burst.prf_hz / 4

    def prf_for_hz(self, velocity_mps: float) -> float:
        """Return the PRF at which range rates up to +- `velocity_mps` do not fold, rounded up to
        three digits [Hz].
        """
        prf_hz = 4 * abs(velocity_mps) / self.waveform.wavelength_m
        step_hz = 10.0 ** (math.floor(math.log10(max(prf_hz, 1.0))) - 2)
        return math.ceil(prf_hz / step_hz) * step_hz

    @property
    def velocity_resolution_mps(self) -> float:
        """lambda PRF / (2 M) [m/s] for M pulses."""
        return self.waveform.wavelength_m * self.burst.prf_hz / (2 * self.burst.pulses)

    def doppler_hz(self, range_rate_mps: float) -> float:
        """Return the Doppler shift of a range rate: -2 v / lambda [Hz] (receding is negative)."""
        return -2 * range_rate_mps / self.waveform.wavelength_m
