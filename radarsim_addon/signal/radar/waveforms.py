# SPDX-License-Identifier: GPL-3.0-or-later
"""Waveforms of both families, frozen, in SI and checked on construction; each is an `AnyWaveform`.

`replica_spectrum` and `matched_filter` follow from the pulses, windows are at the end.

Pulses: phase-coded, given samples, linear FM. Lines, where the receiver samples frequencies: FMCW
with de-chirp, stepped frequency, PMCW. The receiver of a line waveform observes the frequency f0 +
(k - (N-1)/2) df at the time t0 + k dt of each pulse.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, Protocol, runtime_checkable

import numpy as np

from ...arrays import Complex, Real
from ...errors import ConfigError
from ...options import check_settings, documented, setting
from ...physics.constants import SPEED_OF_LIGHT_MPS
from .config import (
    _SLACK,
    BANDWIDTH,
    CARRIER,
    MAX_WAVEFORM_SAMPLES,
    SAMPLING_RATE,
    AnyWaveform,
    PulseNumbers,
    WaveformNumbers,
    check_carrier,
)

#: Barker codes by length (Skolnik, Radar Handbook, ch. 8); sidelobes of the aperiodic
#: autocorrelation are at most 1 in magnitude.
BARKER = {
    2: "+-",
    3: "++-",
    4: "++-+",
    5: "+++-+",
    7: "+++--+-",
    11: "+++---+--+-",
    13: "+++++--++-+-+",
}

#: Exponents, apart from the degree and 0, of one primitive polynomial over GF(2) for each degree
#: (Peterson and Weldon, Error-Correcting Codes, appendix C).
_PRIMITIVE = {
    2: (1,), 3: (1,), 4: (1,), 5: (2,), 6: (1,), 7: (1,), 8: (4, 3, 2), 9: (4,), 10: (3,),
    11: (2,), 12: (6, 4, 1), 13: (4, 3, 1), 14: (10, 6, 1), 15: (1,), 16: (12, 3, 1),
}  # fmt: skip


def barker(length: int) -> tuple[int, ...]:
    """Return the Barker code of a length, (length,)."""
    if length not in BARKER:
        raise ConfigError(
            f"Barker code of length {length!r}; there are codes of {', '.join(map(str, BARKER))}."
        )
    return tuple(1 if sign == "+" else -1 for sign in BARKER[length])


def m_sequence(degree: int) -> tuple[int, ...]:
    """Return a maximum-length sequence, (2**degree - 1,).

    Its periodic autocorrelation is N at lag 0 and -1 at every other (Golomb, Shift Register
    Sequences).
    """
    if not isinstance(degree, int) or degree not in _PRIMITIVE:
        raise ConfigError(
            f"Degree of the m-sequence is {degree!r}; expected a whole number from "
            f"{min(_PRIMITIVE)} to {max(_PRIMITIVE)} (a code of 2^degree - 1 chips)."
        )
    # s[n + degree] = s[n] + sum s[n + e] mod 2
    state = [1] * degree
    taps = (0, *_PRIMITIVE[degree])
    bits = []
    for _ in range(2**degree - 1):
        bits.append(state[0])
        state = [*state[1:], sum(state[tap] for tap in taps) % 2]
    return tuple(1 - 2 * bit for bit in bits)


#: Setting of the waveforms that are made of chips.
CHIP: dict[str, Any] = {
    "label": "Chip duration",
    "help": "Set the duration of one phase; the bandwidth is its inverse",
    "shown_in": "ns",
    "digits": 2,
    "above": 0.0,
    "initial": 20e-9,
}


class ChipNumbers:
    """Numbers that follow from the duration of a chip [s] and its samples."""

    chip_duration_s: float
    samples_per_chip: int

    @property
    def bandwidth_hz(self) -> float:
        """Chip rate [Hz]."""
        return 1 / self.chip_duration_s

    @property
    def sampling_rate_hz(self) -> float:
        return self.samples_per_chip / self.chip_duration_s

    def sampled(self, code: Sequence[int]) -> Complex:
        """Return the samples of a code of +1 and -1, (chips x samples_per_chip,)."""
        samples = np.repeat(np.asarray(code), self.samples_per_chip)
        return np.asarray(samples, dtype=np.complex128)


@documented
@dataclass(frozen=True)
class PhaseCodedPulse(ChipNumbers, PulseNumbers):
    """A pulse of chips of phase 0 or pi, after a Barker code."""

    carrier_hz: float = setting(**CARRIER)
    chip_duration_s: float = setting(**CHIP)
    code_length: int = setting(
        "Code length",
        "Choose the Barker code by its number of chips",
        13,
        choices=tuple(
            (str(n), f"Barker {n}", f"Sidelobes of 1/{n}") for n in (2, 3, 4, 5, 7, 11, 13)
        ),
    )
    samples_per_chip: int = setting(
        "Samples per chip", "Set the complex samples per chip", 2, minimum=1, maximum=1024,
        window=False,
    )  # fmt: skip

    kind: ClassVar[str] = "barker"

    def __post_init__(self) -> None:
        check_settings(self)
        check_carrier(self.carrier_hz, self.bandwidth_hz)

    @property
    def sample_count(self) -> int:
        """Samples of the pulse."""
        return self.code_length * self.samples_per_chip

    @property
    def duration_s(self) -> float:
        """Pulse length [s]."""
        return self.code_length * self.chip_duration_s

    def replica_samples(self) -> Complex:
        """Return the transmitted samples, (chips x samples_per_chip,)."""
        return self.sampled(barker(self.code_length))


@documented
@dataclass(frozen=True)
class ArbitraryPulse(PulseNumbers):
    """A pulse of given complex samples, such as `load_samples` reads from a file.

    Parameters
    ----------
    samples
        Complex samples, (n,); scaled so that the mean of |w|^2 is 1.
    source
        Name of the file, for records.
    """

    carrier_hz: float = setting(**CARRIER)
    sampling_rate_hz: float = setting(**SAMPLING_RATE)
    samples: Complex = field(repr=False, compare=False)  # type: ignore[misc]
    band_hz: float | None = setting(
        "Bandwidth", "Set the band that the samples use", None, shown_in="MHz", above=0.0,
        window=False,
    )  # fmt: skip
    source: str = ""

    kind: ClassVar[str] = "arbitrary"

    def __post_init__(self) -> None:
        check_settings(self)
        if self.band_hz is not None and self.band_hz > self.sampling_rate_hz * (1 + 1e-6):
            raise ConfigError(
                f"Bandwidth {self.band_hz:g} Hz is above the sampling rate "
                f"{self.sampling_rate_hz:g} Hz; complex samples carry no more than that."
            )
        samples = np.array(self.samples, dtype=np.complex128)
        if samples.ndim != 1 or not 2 <= samples.size <= MAX_WAVEFORM_SAMPLES:
            raise ConfigError(
                f"Waveform samples have the shape {samples.shape}; expected one row of 2 to "
                f"{MAX_WAVEFORM_SAMPLES} complex numbers."
            )
        with np.errstate(over="ignore", invalid="ignore"):  # refused below
            power = float(np.mean(np.abs(samples) ** 2))
        if not (math.isfinite(power) and power > 0):
            raise ConfigError(
                f"Waveform samples have the mean power {power}; expected finite samples that are "
                "not all zero."
            )
        samples /= math.sqrt(power)
        samples.setflags(write=False)
        object.__setattr__(self, "samples", samples)
        check_carrier(self.carrier_hz, self.bandwidth_hz)

    @property
    def bandwidth_hz(self) -> float:
        """`band_hz`, or the sampling rate [Hz]."""
        return self.sampling_rate_hz if self.band_hz is None else self.band_hz

    @property
    def sample_count(self) -> int:
        """Samples of the pulse."""
        return self.samples.size

    @property
    def duration_s(self) -> float:
        """Pulse length [s]."""
        return self.samples.size / self.sampling_rate_hz

    def replica_samples(self) -> Complex:
        """Return the transmitted samples, mean power 1."""
        return self.samples


@documented
@dataclass(frozen=True)
class Waveform(PulseNumbers):
    """A linear FM pulse."""

    carrier_hz: float = setting(**CARRIER)
    bandwidth_hz: float = setting(**BANDWIDTH)
    chirp_duration_s: float = setting(
        "Chirp duration",
        "Set the duration of a pulse; at most the pulse interval 1 / PRF",
        shown_in="us",
        digits=2,
        above=0.0,
        initial=2.5e-6,
    )
    sampling_rate_hz: float = setting(**SAMPLING_RATE)

    kind: ClassVar[str] = "lfm"

    def __post_init__(self) -> None:
        check_settings(self)
        if self.sampling_rate_hz < self.bandwidth_hz * (1 - _SLACK):
            raise ConfigError(
                f"Sampling rate {self.sampling_rate_hz:g} Hz is below the bandwidth "
                f"{self.bandwidth_hz:g} Hz: complex samples would alias. "
                "Raise the sampling rate or lower the bandwidth (FM rate x chirp length)."
            )
        if not 2 <= self._samples <= MAX_WAVEFORM_SAMPLES:
            raise ConfigError(
                f"Chirp of {self.chirp_duration_s:g} s holds {self._samples:.3g} samples at "
                f"{self.sampling_rate_hz:g} Hz; expected 2 to {MAX_WAVEFORM_SAMPLES}. Change the "
                "chirp's duration or the sampling rate, and check their units (the panel takes us "
                "and MHz)."
            )
        check_carrier(self.carrier_hz, self.bandwidth_hz)

    @property
    def _samples(self) -> float:
        # a tiny slack: 2.5e-6 * 60e6 is 149.99999999999997
        return self.chirp_duration_s * self.sampling_rate_hz * (1 + 1e-9)

    @property
    def sample_count(self) -> int:
        """Whole samples in the pulse, at least 2."""
        return math.floor(self._samples)

    @property
    def duration_s(self) -> float:
        """Pulse length [s]."""
        return self.chirp_duration_s

    @property
    def fm_rate_hz_per_s(self) -> float:
        """Chirp rate K = B / T_p [Hz/s]."""
        return self.bandwidth_hz / self.chirp_duration_s


class LineNumbers(WaveformNumbers):
    """Numbers of the family "line" that follow from the grid of frequencies.

    Frequency k of `grid_count` is f0 + (k - grid_middle) grid_step_hz, observed at the time
    `grid_start_s` + k `grid_interval_s` of each pulse.
    """

    family: ClassVar[Literal["pulse", "line"]] = "line"

    @property
    def sample_count(self: LineWaveform) -> int:
        return self.grid_count

    @property
    def sample_spacing_m(self: LineWaveform) -> float:
        """One-way range between two independent samples, c / (2 N df) [m]."""
        return SPEED_OF_LIGHT_MPS / (2 * self.grid_count * self.grid_step_hz)

    @property
    def range_period_m(self: LineWaveform) -> float:
        return SPEED_OF_LIGHT_MPS / (2 * self.grid_step_hz)

    @property
    def grid_middle(self: LineWaveform) -> float:
        return (self.grid_count - 1) / 2

    @property
    def grid_middle_s(self: LineWaveform) -> float:
        return self.grid_start_s + self.grid_middle * self.grid_interval_s


@runtime_checkable
class LineWaveform(AnyWaveform, Protocol):
    """A waveform of the family "line", see :class:`LineNumbers`."""

    @property
    def grid_count(self) -> int:
        """Number N of frequencies."""

    @property
    def grid_step_hz(self) -> float:
        """Distance df of two frequencies [Hz]."""

    @property
    def grid_start_s(self) -> float:
        """Time of the first frequency in each pulse [s]."""

    @property
    def grid_interval_s(self) -> float:
        """Time between two frequencies [s]; 0: all at once."""

    @property
    def grid_middle(self) -> float:
        """Index of the carrier in the grid, (N-1)/2; a half between two frequencies."""

    @property
    def grid_middle_s(self) -> float:
        """Time of the middle of the band in each pulse [s]."""

    @property
    def range_period_m(self) -> float:
        """Range after which the profile repeats, c / 2 df [m]."""


@documented
@dataclass(frozen=True)
class FmcwWaveform(LineNumbers):
    """Linear FMCW with de-chirp: the beat of each chirp is sampled."""

    carrier_hz: float = setting(**CARRIER)
    bandwidth_hz: float = setting(**BANDWIDTH)
    adc_samples: int = setting(
        "ADC samples",
        "Set the samples per chirp",
        minimum=2,
        maximum=MAX_WAVEFORM_SAMPLES,
        soft_maximum=4096,
        initial=256,
    )
    adc_rate_hz: float = setting(
        "ADC rate",
        "Set the samples per second of the ADC; the chirp lasts samples / rate",
        shown_in="MHz",
        digits=2,
        above=0.0,
        initial=10e6,
    )
    adc_start_s: float = setting(
        "ADC start", "Set the time from the start of the ramp to the first sample", 0.0,
        shown_in="us", digits=2, minimum=0.0,
    )  # fmt: skip
    ramp_s: float | None = setting(
        "Ramp", "Set the duration of the ramp. None: it ends with the last sample", None,
        shown_in="us", digits=2, above=0.0, initial=30e-6,
    )  # fmt: skip
    idle_s: float = setting(
        "Idle time", "Set the least pause between two chirps; ramp and pause fit into 1 / PRF", 0.0,
        shown_in="us", digits=2, minimum=0.0,
    )  # fmt: skip
    real_adc: bool = setting(
        "Real ADC", "Use one channel in place of I and Q: half the range, 3 dB less SNR", False
    )

    kind: ClassVar[str] = "fmcw"

    def __post_init__(self) -> None:
        check_settings(self)
        sampled_s = self.adc_start_s + self.adc_samples / self.sampling_rate_hz
        if self.ramp_s is not None and not self.ramp_s >= sampled_s * (1 - 1e-6):
            raise ConfigError(
                f"Ramp of {self.ramp_s!r} s ends before the ADC, which samples until "
                f"{sampled_s:g} s after its start. Lengthen the ramp, sample faster or less."
            )
        check_carrier(self.carrier_hz, self.bandwidth_hz)

    @property
    def sampling_rate_hz(self) -> float:
        """`adc_rate_hz` [Hz]."""
        return self.adc_rate_hz

    @property
    def slope_hz_per_s(self) -> float:
        """Chirp rate K = B fs / N [Hz/s]."""
        return self.bandwidth_hz * self.sampling_rate_hz / self.adc_samples

    @property
    def duration_s(self) -> float:
        """Duration of ramp and idle time together [s]."""
        sampled_s = self.adc_start_s + self.adc_samples / self.sampling_rate_hz
        return (sampled_s if self.ramp_s is None else self.ramp_s) + self.idle_s

    @property
    def unambiguous_range_m(self) -> float:
        """Range whose beat is at the end of the ADC's band: c fs / 2K, half of it with a real ADC
        [m].
        """
        whole_m = SPEED_OF_LIGHT_MPS * self.sampling_rate_hz / (2 * self.slope_hz_per_s)
        return whole_m / 2 if self.real_adc else whole_m

    @property
    def grid_count(self) -> int:
        """Frequencies: one per ADC sample."""
        return self.adc_samples

    @property
    def grid_step_hz(self) -> float:
        """Climb of the ramp between two samples, K / fs [Hz]."""
        return self.bandwidth_hz / self.adc_samples

    @property
    def grid_start_s(self) -> float:
        """The first sample, from the start of the ramp [s]."""
        return self.adc_start_s

    @property
    def grid_interval_s(self) -> float:
        """1 / fs [s]."""
        return 1 / self.sampling_rate_hz


@documented
@dataclass(frozen=True)
class SteppedWaveform(LineNumbers):
    """Stepped frequency: N tones, one complex sample of each."""

    carrier_hz: float = setting(**CARRIER)
    step_hz: float = setting(
        "Frequency step", "Set the distance of two tones; the range repeats with c / 2 step",
        shown_in="kHz", digits=2, above=0.0, initial=500e3,
    )  # fmt: skip
    steps: int = setting(
        "Steps",
        "Set the number of tones; the bandwidth is steps x step",
        minimum=2,
        maximum=MAX_WAVEFORM_SAMPLES,
        soft_maximum=4096,
        initial=128,
    )
    step_time_s: float = setting(
        "Time per step", "Set the time per step; the receiver averages over it",
        shown_in="us", digits=2, above=0.0, initial=5e-6,
    )  # fmt: skip

    kind: ClassVar[str] = "stepped"

    def __post_init__(self) -> None:
        check_settings(self)
        check_carrier(self.carrier_hz, self.bandwidth_hz)

    @property
    def bandwidth_hz(self) -> float:
        """N steps [Hz]."""
        return self.steps * self.step_hz

    @property
    def sampling_rate_hz(self) -> float:
        """One sample per step [Hz]."""
        return 1 / self.step_time_s

    @property
    def duration_s(self) -> float:
        """Duration of all steps together [s]."""
        return self.steps * self.step_time_s

    @property
    def unambiguous_range_m(self) -> float:
        """c / 2 step [m]."""
        return SPEED_OF_LIGHT_MPS / (2 * self.step_hz)

    @property
    def grid_count(self) -> int:
        """Number of steps."""
        return self.steps

    @property
    def grid_step_hz(self) -> float:
        """Distance of two steps [Hz]."""
        return self.step_hz

    @property
    def grid_start_s(self) -> float:
        """The first sample is taken in the middle of the first step [s]."""
        return self.step_time_s / 2

    @property
    def grid_interval_s(self) -> float:
        """Time per step [s]."""
        return self.step_time_s


@documented
@dataclass(frozen=True)
class PmcwWaveform(ChipNumbers, LineNumbers):
    """Phase-modulated continuous wave: an m-sequence sent over and over."""

    carrier_hz: float = setting(**CARRIER)
    chip_duration_s: float = setting(**CHIP)
    code_degree: int = setting(
        "Code degree",
        "Set the degree of the m-sequence: 2^degree - 1 chips; the range repeats with the code",
        minimum=2,
        maximum=16,
        initial=10,
    )
    code_repeats: int = setting(
        "Code repeats",
        "Set the codes that are added up for one pulse of the burst",
        1,
        minimum=1,
        maximum=1 << 16,
        soft_maximum=1024,
        initial=8,
    )
    samples_per_chip: int = setting(
        "Samples per chip", "Set the complex samples per chip", 1, minimum=1, maximum=64,
        window=False,
    )  # fmt: skip

    kind: ClassVar[str] = "pmcw"

    def __post_init__(self) -> None:
        check_settings(self)
        m_sequence(self.code_degree)
        check_carrier(self.carrier_hz, self.bandwidth_hz)

    @property
    def code_length(self) -> int:
        """Chips of the code."""
        return int(2**self.code_degree - 1)

    @property
    def code_s(self) -> float:
        """Length of one code [s]."""
        return self.code_length * self.chip_duration_s

    @property
    def duration_s(self) -> float:
        """Duration of all repeats of the code together [s]."""
        return self.code_repeats * self.code_s

    @property
    def unambiguous_range_m(self) -> float:
        """c / 2 times the length of the code [m]."""
        return SPEED_OF_LIGHT_MPS * self.code_s / 2

    @property
    def grid_count(self) -> int:
        """Samples, and so frequencies, of one code."""
        return self.code_length * self.samples_per_chip

    @property
    def grid_step_hz(self) -> float:
        """Lines of a periodic code: 1 / its length [Hz]."""
        return 1 / self.code_s

    @property
    def grid_start_s(self) -> float:
        """Sampling begins with the code [s]."""
        return 0.0

    @property
    def grid_interval_s(self) -> float:
        """0: a code holds all its frequencies at once [s]."""
        return 0.0

    @property
    def grid_middle(self) -> float:
        """N // 2, where a discrete Fourier transform has frequency 0."""
        return self.grid_count // 2

    def replica_samples(self) -> Complex:
        """Return one code, (chips x samples_per_chip,)."""
        return self.sampled(m_sequence(self.code_degree))


# isinstance by class: looking up each name of the protocol takes a hundred times as long
for _kind in (FmcwWaveform, SteppedWaveform, PmcwWaveform):
    LineWaveform.register(_kind)


# -------------------------------------------------------------------------------------------------
# Transmitted pulses, their spectra, matched filters, and windows.
#
# The chirp is a sampled one, as a digital generator plays it: w(t) = exp(j pi K t^2) at t_n = (n -
# (N-1)/2)/fs, |t_n| <= T_p/2 (Eq. 10-11, time counted from the middle of the pulse, so that the
# instantaneous frequency runs over -B/2 ... B/2). Between samples every pulse is the band-limited
# interpolation of these, which makes W(f) sum a_i exp(-j 2 pi (f0+f) tau_i) exact for every delay.
#
# Windows are closed forms of a continuous position. Their names: "none", "hann", "hamming" or
# "hamming:0.75", "blackman", "kaiser:2.5" (beta), "taylor:4:-35" (nbar, sidelobe level in dB).
# -------------------------------------------------------------------------------------------------

WINDOW_NAMES = ("none", "hann", "hamming", "blackman", "kaiser:beta", "taylor:nbar:sll_db")


def window_at(spec: str, position: Real) -> Real:
    """Return a window at positions within its extent.

    Parameters
    ----------
    spec
        Name and parameters, such as "hann" or "taylor:4:-35", see the module.
    position
        From -1/2 to 1/2, any shape. Outside, the window is 0.

    Returns
    -------
    ndarray
        Same shape; 1 at the centre for all but Taylor (whose mean is 1).

    Raises
    ------
    ConfigError
        Unknown name, or parameters that do not fit.
    """
    name, *texts = spec.lower().split(":")
    try:
        numbers = [float(text) for text in texts]
    except ValueError:
        numbers = [math.nan]
    inside = np.abs(position) <= 0.5
    angle = 2 * np.pi * position
    if name in ("none", "rectangular") and not numbers:
        value = np.ones_like(angle)
    elif name == "hann" and not numbers:
        value = 0.5 + 0.5 * np.cos(angle)
    elif name == "hamming" and (not numbers or (len(numbers) == 1 and 0.5 <= numbers[0] <= 1)):
        alpha = numbers[0] if numbers else 0.54
        value = alpha + (1 - alpha) * np.cos(angle)
    elif name == "blackman" and not numbers:
        value = 0.42 + 0.5 * np.cos(angle) + 0.08 * np.cos(2 * angle)
    elif name == "kaiser" and len(numbers) == 1 and 0 <= numbers[0] <= 100:
        bell = np.sqrt(np.maximum(1 - (2 * position) ** 2, 0.0))
        value = np.i0(numbers[0] * bell) / np.i0(numbers[0])
    elif name == "taylor" and len(numbers) == 2 and numbers[0] >= 1 and numbers[0] % 1 == 0:
        value = _taylor(angle, int(numbers[0]), abs(numbers[1]))
    else:
        raise ConfigError(
            f"Window {spec!r} is unknown; expected one of {', '.join(WINDOW_NAMES)}, "
            "for example 'hamming', 'kaiser:2.5' or 'taylor:4:-35'."
        )
    return np.where(inside, value, 0.0)


def slow_time_window(spec: str, pulses: int) -> Real:
    """Return a window over a train of pulses.

    Parameters
    ----------
    spec
        Name of the window, see :func:`window_at`.
    pulses
        Number of pulses.

    Returns
    -------
    ndarray
        (pulses,), sampled at the middle of each pulse interval.
    """
    return window_at(spec, (np.arange(pulses) - (pulses - 1) / 2) / pulses)


def _taylor(angle: Real, nbar: int, sidelobe_db: float) -> Real:
    """Evaluate the Taylor window (Carrara, Goodman, Majewski, Spotlight SAR, appendix D)."""
    if not 0 < sidelobe_db <= 200 or nbar > 1000:
        raise ConfigError(
            f"Taylor window with nbar {nbar} and {sidelobe_db} dB; expected nbar up to 1000 and a "
            "sidelobe level of a few tens of dB, for example 'taylor:4:-35'."
        )
    a_squared = (math.acosh(10 ** (sidelobe_db / 20)) / math.pi) ** 2
    sigma_squared = nbar**2 / (a_squared + (nbar - 0.5) ** 2)
    value = np.ones_like(angle)
    for m in range(1, nbar):
        top, bottom = 1.0, 1.0
        for n in range(1, nbar):
            top *= 1 - m**2 / sigma_squared / (a_squared + (n - 0.5) ** 2)
            if n != m:
                bottom *= 1 - m**2 / n**2
        value += (-1) ** (m + 1) * top / bottom * np.cos(m * angle)
    return value


def replica(waveform: AnyWaveform) -> Complex:
    """Return the samples w(t_n): exp(j pi K t_n^2) of a chirp, the chips of a code, or a file's.

    Parameters
    ----------
    waveform
        Waveform of the family "pulse", or PMCW.

    Returns
    -------
    ndarray
        Complex, (sample_count,), mean power 1.

    Raises
    ------
    ConfigError
        The waveform has no pulse.
    """
    if isinstance(waveform, PhaseCodedPulse | ArbitraryPulse | PmcwWaveform):
        return waveform.replica_samples()
    if not isinstance(waveform, Waveform):
        raise ConfigError(
            f"A waveform of kind {waveform.kind!r} has no pulse to correlate with; its range "
            "profile is a Fourier transform of its samples."
        )
    count = waveform.sample_count
    times_s = np.asarray((np.arange(count) - (count - 1) / 2) / waveform.sampling_rate_hz)
    samples: Complex = np.exp(1j * np.pi * waveform.fm_rate_hz_per_s * times_s**2)
    return samples


def frequencies_hz(waveform: AnyWaveform, size: int) -> Real:
    """Return the baseband frequencies of a transform of `size` samples, in FFT order [Hz]."""
    return np.fft.fftfreq(size, 1 / waveform.sampling_rate_hz)


def replica_spectrum(waveform: AnyWaveform, size: int) -> Complex:
    """Return the spectrum W(f) = sum_n w(t_n) exp(-j 2 pi f t_n) of the pulse.

    Parameters
    ----------
    waveform
        Waveform of the family "pulse", or PMCW.
    size
        Samples of the transform, at least those of the pulse.

    Returns
    -------
    ndarray
        Complex, (size,), at :func:`frequencies_hz`.

    Raises
    ------
    ConfigError
        The waveform has no pulse.
    ValueError
        The pulse has more samples than the transform.
    """
    samples = replica(waveform)
    if samples.size > size:
        raise ValueError(f"a chirp of {samples.size} samples needs a transform at least as long")
    middle_s = (samples.size - 1) / 2 / waveform.sampling_rate_hz
    shift = np.exp(2j * np.pi * frequencies_hz(waveform, size) * middle_s)
    spectrum: Complex = np.fft.fft(samples, size) * shift
    return spectrum


def matched_filter(waveform: AnyWaveform, size: int, window: str = "none") -> Complex:
    """Return conj(W(f)) times a window over the band, with unit response to a unit path.

    Parameters
    ----------
    waveform
        Of the family "pulse".
    size
        Length of the transform.
    window
        Window over |f| <= B/2, see :func:`window_at`; frequencies outside the band are
        cut. A phase code has its sidelobes from the code, and no window.

    Returns
    -------
    ndarray
        (size,), in FFT order: the inverse FFT of W times this peaks at exactly 1.
    """
    spectrum = replica_spectrum(waveform, size)
    if isinstance(waveform, PhaseCodedPulse):
        plain = np.conj(spectrum) / np.mean(np.abs(spectrum) ** 2)
        return np.asarray(plain, dtype=np.complex128)
    position = frequencies_hz(waveform, size) / waveform.bandwidth_hz
    # A bin at the band's edge counts with its fraction inside; otherwise the width of the response
    # would depend on where the bins lie.
    bin_width = waveform.sampling_rate_hz / size / waveform.bandwidth_hz
    share = np.clip((0.5 - np.abs(position)) / bin_width + 0.5, 0.0, 1.0)
    weight = window_at(window, np.clip(position, -0.5, 0.5)) * share
    gain = float(np.mean(np.abs(spectrum) ** 2 * weight))
    return np.asarray(np.conj(spectrum) * (weight / gain), dtype=np.complex128)


def band_window(waveform: AnyWaveform, window: str) -> str:
    """Return `window`. For phase codes return "none", because their sidelobes are those of the
    code.
    """
    return "none" if isinstance(waveform, PhaseCodedPulse | PmcwWaveform) else window
