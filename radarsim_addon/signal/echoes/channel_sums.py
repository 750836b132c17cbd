# SPDX-License-Identifier: GPL-3.0-or-later
"""One sum of spectra for each channel of a radar."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...array_types import Complex, Mask, Real
from ..motion import AntennaMotion, PathMotion
from ..paths import Paths, channel_lengths
from ..radar import Channel, Radar
from ..scattering import Link, reverse_amplitudes
from ..spectrum import AmplitudeHistory, Spectrum, SpectrumAccumulator, SynthesisReport
from .echoes import EchoOptions


@dataclass(frozen=True)
class ChannelPaths:
    """What makes lengths and amplitudes of paths in the channels of a radar. `link`: gains at every
    pulse, None: those that the paths have; `antennas`: their motion, None: the link's; `wanted`:
    pulses whose echoes are formed, (pulses,), None: all.
    """

    radar: Radar
    options: EchoOptions
    link: Link | None = None
    antennas: AntennaMotion | None = None
    wanted: Mask | None = None

    def rows_of(self, channel: Channel, rows: int) -> Mask:
        """Return which of the rows of samples are formed: of wanted pulses with the channel."""
        pulses = self.radar.burst.pulses
        used = channel.active_mask(pulses)
        if self.wanted is not None:
            used = used & self.wanted
        if not used.any():
            used = np.arange(pulses) == 0  # a sum needs a pulse
        return np.repeat(used, rows // pulses)

    def times_of(self, channel: Channel, times_s: Real) -> Real:
        """Return the times of the rows that are formed, out of those of all rows [s]."""
        return np.asarray(times_s[self.rows_of(channel, times_s.size)])

    def lengths_of(self, paths: Paths, channel: Channel) -> PathMotion:
        """Return the lengths of paths in a channel."""
        antennas = self.antennas or (None if self.link is None else self.link.antennas)
        return channel_lengths(paths, channel, antennas)

    def amplitudes_of(self, paths: Paths, channel: Channel) -> AmplitudeHistory:
        """Return the amplitudes of paths in a channel."""
        found = self.options.history(paths, channel, self.radar, self.link)
        antennas = self.antennas or (None if self.link is None else self.link.antennas)
        if antennas is None or self.options.speckle_seed is None:
            return found  # without speckle, rows add up coherently as they are
        waveform = self.radar.waveform
        factors = reverse_amplitudes(
            paths, channel, antennas, waveform.carrier_hz, waveform.range_resolution_m
        )
        return found if factors is None else found.select(slice(None), factors)


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

    def results(self, times_s: Real) -> list[Spectrum]:
        """Spectra of all channels for rows at these times; those of rows not formed are 0."""
        return [self._in_rows(channel, total.result(), times_s) for channel, total in self._sums]

    def _in_rows(self, channel: Channel, formed: Spectrum, times_s: Real) -> Spectrum:
        used = self._source.rows_of(channel, times_s.size)
        if formed.moving is None or used.all():
            return replace(formed, times_s=times_s)
        moving = np.zeros((times_s.size, formed.grid.count), dtype=np.complex128)
        moving[used] = formed.moving
        return replace(formed, moving=moving, times_s=times_s)


def silence_unformed(samples: Complex, source: ChannelPaths) -> Complex:
    """Set the rows (channels, rows, samples) that are not formed to 0, in place."""
    for values, channel in zip(samples, source.radar.channels, strict=True):
        values[~source.rows_of(channel, values.shape[0])] = 0
    return samples


def joined_report(reports: list[SynthesisReport]) -> SynthesisReport:
    """Return the report of the channel of the largest error, with the time of all."""
    worst = max(reports, key=lambda report: report.error_estimate)
    return replace(worst, wall_s=sum(report.wall_s for report in reports))
