# SPDX-License-Identifier: GPL-3.0-or-later
"""What comes of a frame."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..echoes import Echoes, ReceivedSignal
from ..maps import (
    ExpectedPower,
    PowerProfile,
    RangeDopplerMap,
    RangeProfiles,
    map_noise_gain,
    range_noise_gain,
)
from ..scattering import SpeckleReport
from .detections import Detections
from .peaks import LeadingEdge, Peak
from .power_budget import BudgetReport
from .statistics import FrameStatistics


@dataclass(frozen=True)
class FrameResult:
    """All that was computed of one radar frame, and the files that hold it.

    `echoes` are as the receiver delivers them, `reception` says what it did to them, `detections`
    is there where CFAR was asked for. `expected` (expected power with standard errors) is there
    for the acquisition "paths", whose sub-pixel shifts are replicates.
    """

    frame: int
    time_s: float
    statistics: FrameStatistics
    echoes: Echoes
    compressed: RangeProfiles
    profile: PowerProfile
    rd_map: RangeDopplerMap
    edges: list[LeadingEdge]
    moving_targets: list[Peak]
    warnings: list[str]
    files: list[Path]
    expected: ExpectedPower | None = None
    budget: BudgetReport | None = None
    speckle: SpeckleReport | None = None
    reception: ReceivedSignal | None = None
    detections: Detections | None = None

    @property
    def profile_noise_power(self) -> float:
        """Mean noise of a cell of the profile, thermal and of the ADC [W]; 0 without."""
        return self._noise_power(range_noise_gain(self.compressed.radar, self.compressed.window))

    @property
    def map_noise_power(self) -> float:
        """Mean noise of a cell of the map, thermal and of the ADC [W]; 0 without."""
        gain = map_noise_gain(self.rd_map.radar, self.rd_map.window, self.rd_map.doppler_taper)
        return self._noise_power(gain)

    def _noise_power(self, gain: float) -> float:
        return 0.0 if self.reception is None else self.reception.floor_power_w * gain
