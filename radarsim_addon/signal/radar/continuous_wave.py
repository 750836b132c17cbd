# SPDX-License-Identifier: GPL-3.0-or-later
"""Waveforms whose receiver samples frequencies: FMCW with de-chirp, stepped frequency, PMCW.

Frozen, in SI, checked on construction; they satisfy :class:`.radar.config.AnyWaveform`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, Protocol, runtime_checkable

from ...array_types import Complex
from ...errors import ConfigError
from ...options import check_settings, documented, setting
from ...physics.constants import SPEED_OF_LIGHT_MPS
from .chips import CHIP, ChipNumbers
from .codes import m_sequence
from .waveform import (
    BANDWIDTH,
    CARRIER,
    MAX_WAVEFORM_SAMPLES,
    AnyWaveform,
    WaveformNumbers,
    check_carrier,
)


class LineNumbers(WaveformNumbers):
    """What follows for the family "line" from the grid of frequencies.

    Frequency k of `grid_count` is f0 + (k - grid_middle) grid_step_hz, observed at the time
    `grid_start_s` + k `grid_interval_s` of each pulse.
    """

    family: ClassVar[Literal["pulse", "line"]] = "line"

    @property
    def sample_count(self: LineWaveform) -> int:
        """One sample for each frequency."""
        return self.grid_count

    @property
    def sample_spacing_m(self: LineWaveform) -> float:
        """One-way range between two independent samples, c / (2 N df) [m]."""
        return SPEED_OF_LIGHT_MPS / (2 * self.grid_count * self.grid_step_hz)

    @property
    def range_period_m(self: LineWaveform) -> float:
        """Range after which the profile repeats, c / 2 df [m]."""
        return SPEED_OF_LIGHT_MPS / (2 * self.grid_step_hz)

    @property
    def grid_middle(self: LineWaveform) -> float:
        """Index of the carrier in the grid: (N-1)/2."""
        return (self.grid_count - 1) / 2

    @property
    def grid_middle_s(self: LineWaveform) -> float:
        """Time of the middle of the band in each pulse [s]."""
        return self.grid_start_s + self.grid_middle * self.grid_interval_s


@runtime_checkable
class LineWaveform(AnyWaveform, Protocol):
    """Protocol of the family "line", see :class:`LineNumbers`."""

    @property
    def grid_count(self) -> int:
        """Number N of frequencies."""
        ...

    @property
    def grid_step_hz(self) -> float:
        """Their distance df [Hz]."""
        ...

    @property
    def grid_start_s(self) -> float:
        """Time of the first one in each pulse [s]."""
        ...

    @property
    def grid_interval_s(self) -> float:
        """Time between two [s]; 0: all at once."""
        ...

    @property
    def grid_middle(self) -> float:
        """Index of the carrier in the grid, where it falls between two a half."""
        ...

    @property
    def grid_middle_s(self) -> float:
        """Time of the middle of the band in each pulse [s]."""
        ...

    @property
    def range_period_m(self) -> float:
        """Range after which the profile repeats, c / 2 df [m]."""
        ...


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
        above=0.0,
        initial=10e6,
    )
    adc_start_s: float = setting(
        "ADC start", "Set the time from the start of the ramp to the first sample", 0.0,
        shown_in="us", minimum=0.0,
    )  # fmt: skip
    ramp_s: float | None = setting(
        "Ramp", "Set the duration of the ramp. None: it ends with the last sample", None,
        shown_in="us", above=0.0, initial=30e-6,
    )  # fmt: skip
    idle_s: float = setting(
        "Idle time", "Set the least pause between two chirps; ramp and pause fit into 1 / PRF", 0.0,
        shown_in="us", minimum=0.0,
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
        """Ramp and idle time [s]."""
        sampled_s = self.adc_start_s + self.adc_samples / self.sampling_rate_hz
        return (sampled_s if self.ramp_s is None else self.ramp_s) + self.idle_s

    @property
    def unambiguous_range_m(self) -> float:
        """Where the beat leaves the ADC's band: c fs / 2K, half of it with a real ADC [m]."""
        whole_m = SPEED_OF_LIGHT_MPS * self.sampling_rate_hz / (2 * self.slope_hz_per_s)
        return whole_m / 2 if self.real_adc else whole_m

    @property
    def grid_count(self) -> int:
        """Frequencies: one per ADC sample."""
        return self.adc_samples

    @property
    def grid_step_hz(self) -> float:
        """What the ramp climbs between samples, K / fs [Hz]."""
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
        shown_in="kHz", above=0.0, initial=500e3,
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
        shown_in="us", above=0.0, initial=5e-6,
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
        """One sample a step [Hz]."""
        return 1 / self.step_time_s

    @property
    def duration_s(self) -> float:
        """All steps [s]."""
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
        """All repeats [s]."""
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
        """N // 2, as a discrete Fourier transform has its frequencies."""
        return self.grid_count // 2

    def replica_samples(self) -> Complex:
        """One code, (chips x samples_per_chip,)."""
        return self.sampled(m_sequence(self.code_degree))


# told by its class: to look for each name of the protocol takes a hundred times as long
for _kind in (FmcwWaveform, SteppedWaveform, PmcwWaveform):
    LineWaveform.register(_kind)
