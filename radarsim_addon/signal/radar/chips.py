# SPDX-License-Identifier: GPL-3.0-or-later
"""What the waveforms that are made of chips share: pulses after a code, PMCW."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...array_types import Complex
from .waveform import check_count, check_positive


class ChipNumbers:
    """What follows from the length of a chip [s] and the samples taken of it."""

    chip_length_s: float
    samples_per_chip: int

    def check_chips(self, most_samples: int) -> None:
        """Both must be positive, and the samples no more than `most_samples`.

        Raises
        ------
        ConfigError
            Names the number that is wrong.
        """
        check_positive("Chip length", self.chip_length_s, "seconds")
        check_count("Samples per chip", self.samples_per_chip, 1, most_samples)

    @property
    def bandwidth_hz(self) -> float:
        """Chip rate [Hz]."""
        return 1 / self.chip_length_s

    @property
    def sampling_rate_hz(self) -> float:
        """Complex samples a second [Hz]."""
        return self.samples_per_chip / self.chip_length_s

    def sampled(self, code: Sequence[int]) -> Complex:
        """Samples of a code of +1 and -1, (chips x samples_per_chip,)."""
        samples = np.repeat(np.asarray(code), self.samples_per_chip)
        return np.asarray(samples, dtype=np.complex128)
