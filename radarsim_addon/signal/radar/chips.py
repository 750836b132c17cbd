# SPDX-License-Identifier: GPL-3.0-or-later
"""What the waveforms that are made of chips share: pulses after a code, PMCW."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...array_types import Complex

#: Setting of the waveforms that are made of chips.
CHIP: dict[str, Any] = {
    "label": "Chip duration",
    "help": "Set the duration of one phase; the bandwidth is its inverse",
    "shown_in": "ns",
    "above": 0.0,
    "initial": 20e-9,
}


class ChipNumbers:
    """What follows from the duration of a chip [s] and the samples taken of it."""

    chip_duration_s: float
    samples_per_chip: int

    @property
    def bandwidth_hz(self) -> float:
        """Chip rate [Hz]."""
        return 1 / self.chip_duration_s

    @property
    def sampling_rate_hz(self) -> float:
        """Complex samples a second [Hz]."""
        return self.samples_per_chip / self.chip_duration_s

    def sampled(self, code: Sequence[int]) -> Complex:
        """Samples of a code of +1 and -1, (chips x samples_per_chip,)."""
        samples = np.repeat(np.asarray(code), self.samples_per_chip)
        return np.asarray(samples, dtype=np.complex128)
