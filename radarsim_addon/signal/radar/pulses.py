# SPDX-License-Identifier: GPL-3.0-or-later
"""Pulses other than the linear chirp: phase-coded, and any samples from a file.

Frozen, in SI, checked on construction; they satisfy :class:`.radar.config.AnyWaveform`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ...array_types import Complex
from ...errors import ConfigError
from ...options import check_settings, documented, setting
from .chips import CHIP, ChipNumbers
from .codes import barker
from .config import _SLACK
from .waveform import (
    BANDWIDTH,
    CARRIER,
    MAX_WAVEFORM_SAMPLES,
    SAMPLING_RATE,
    PulseNumbers,
    check_carrier,
)


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
        """The transmitted samples, (chips x samples_per_chip,)."""
        return self.sampled(barker(self.code_length))


@documented
@dataclass(frozen=True)
class ArbitraryPulse(PulseNumbers):
    """A pulse of given complex samples, read from a file by :mod:`.radar.radar_files`.

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
        """The transmitted samples, mean power 1."""
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
