# SPDX-License-Identifier: GPL-3.0-or-later
"""One sum of spectra for each channel of a radar."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...array_types import Complex
from ..motion import AntennaMotion, PathMotion
from ..paths import Paths, channel_lengths
from ..radar import Channel, Radar
from ..scattering import Link
from ..spectrum import AmplitudeHistory, Spectrum, SpectrumAccumulator, SynthesisReport
from .echoes import EchoOptions


@dataclass(frozen=True)
class ChannelPaths:
    """What makes lengths and amplitudes of paths in the channels of a radar. `link`: gains at every
    pulse, None: those that the paths have; `antennas`: their motion, None: the link's.
    """

    radar: Radar
    options: EchoOptions
    link: Link | None = None
    antennas: AntennaMotion | None = None

    def lengths_of(self, paths: Paths, channel: Channel) -> PathMotion:
        """Return the lengths of paths in a channel."""
        antennas = self.antennas or (None if self.link is None else self.link.antennas)
        return channel_lengths(paths, channel, antennas)

    def amplitudes_of(self, paths: Paths, channel: Channel) -> AmplitudeHistory:
        """Return the amplitudes of paths in a channel."""
        return self.options.history(paths, channel, self.radar, self.link)


class ChannelSums:
    """Adds up the spectra of paths in every channel, by a sum for each from `make`."""

    def __init__(
        self, source: ChannelPaths, make: Callable[[Channel], SpectrumAccumulator]
    ) -> None:
        self._source = source
        self._sums = [(channel, make(channel)) for channel in source.radar.channels]

    def add(self, paths: Paths) -> None:
        """Add paths to all channels."""
        for channel, total in self._sums:
            total.add(
                self._source.lengths_of(paths, channel), self._source.amplitudes_of(paths, channel)
            )

    def results(self) -> list[Spectrum]:
        """Spectra of all channels."""
        return [total.result() for _, total in self._sums]


def silence_inactive(samples: Complex, radar: Radar) -> Complex:
    """Set the rows (channels, rows, samples) of pulses without their channel to 0, in place."""
    for values, channel in zip(samples, radar.channels, strict=True):
        if channel.active is not None:
            active = channel.active_mask(radar.burst.pulses)
            values[~np.repeat(active, values.shape[0] // active.size)] = 0
    return samples


def joined_report(reports: list[SynthesisReport]) -> SynthesisReport:
    """Return the report of the channel of the largest error, with the time of all."""
    worst = max(reports, key=lambda report: report.error_estimate)
    return replace(worst, wall_s=sum(report.wall_s for report in reports))
