# SPDX-License-Identifier: GPL-3.0-or-later
"""Complex baseband echoes of a burst (Eq. 9-14 of the paper, with the carrier phase).

    s(t_m, tau) = sum_i a_i w(tau - tau_i) exp(-j 2 pi f0 tau_i),   tau_i = l_i(t_m)/c

is formed in the frequency domain, W(f) sum_i a_i exp(-j 2 pi (f0+f) tau_i), by
:mod:`.spectrum.accumulator`. t_m = m/PRF from the frame's time t. The pulse that comes back is
scaled in time by the range rate, see :mod:`.spectrum.pulse_motion`.
"""

from __future__ import annotations

import numpy as np

from ...array_types import Mask
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..motion import AntennaMotion
from ..paths import Paths
from ..radar import Channel, Radar, replica, replica_spectrum
from ..scattering import Link
from ..spectrum import FrequencyGrid, PulseShape, ReceiveWindow, SpectrumAccumulator, smooth_size
from .channel_sums import ChannelPaths, ChannelSums, joined_report, silence_unformed
from .echoes import (
    DEFAULT_OPTIONS,
    Echoes,
    EchoOptions,
    check_window,
    pulse_times_s,
    window_samples,
)

#: Empty samples behind the window, which keep the tails of the band-limited chirp from wrapping.
_GUARD_SAMPLES = 64


class EchoSynthesizer:
    """Adds up the echoes of paths that come in parts (ring by ring); see :func:`synthesize`.

    Memory: one complex matrix (pulses, frequencies) and some 100 MB, however many paths.

    Parameters
    ----------
    radar
        With a waveform of the family "pulse".
    range_limits_m
        One-way ranges (start, stop) whose echoes are recorded whole [m].
    options
        See :class:`EchoOptions`.
    link
        Antenna gains at every pulse; None: those that the paths have.
    antennas
        Motion of the antennas, for channels of elements away from their origins; None: the link's.
    wanted
        Pulses whose echoes are formed, (pulses,); those of the others are 0. None: all.

    Raises
    ------
    ConfigError
        The window is empty or reversed, or the matrix of echoes too large.
    """

    def __init__(
        self,
        radar: Radar,
        range_limits_m: tuple[float, float],
        options: EchoOptions = DEFAULT_OPTIONS,
        *,
        link: Link | None = None,
        antennas: AntennaMotion | None = None,
        wanted: Mask | None = None,
    ) -> None:
        self.range_limits_m = check_window(range_limits_m)
        self.radar = radar
        self._options = options
        rate_hz = radar.waveform.sampling_rate_hz
        chirp = radar.waveform.sample_count
        start_s, stop_s = (2 * r / SPEED_OF_LIGHT_MPS for r in self.range_limits_m)
        self._count = window_samples(radar, self.range_limits_m)
        # An echo that only just reaches into the window needs a chirp's length of room before and
        # behind it; with that, the circular transform wraps nothing into the window.
        needed = self._count + 2 * chirp + _GUARD_SAMPLES
        radar.check_size(needed)
        size = smooth_size(needed)
        self._half_s = (chirp - 1) / 2 / rate_hz
        self._first_s = start_s - self._half_s
        self._grid = FrequencyGrid.centred(radar.waveform.carrier_hz, rate_hz / size, size)
        self._pulse: PulseShape | None = None
        if options.motion_within_pulse:
            self._pulse = PulseShape(replica(radar.waveform), rate_hz, size)
        self._window = ReceiveWindow(
            start_s - 2 * self._half_s,
            stop_s + 2 * self._half_s,
            1 / radar.burst.prf_hz if options.range_folding else None,
            radar.waveform.carrier_hz,
        )
        self._source = ChannelPaths(radar, options, link, antennas, wanted)
        self._sums = ChannelSums(self._source, self._accumulator)

    def _accumulator(self, channel: Channel) -> SpectrumAccumulator:
        options = self._options
        return SpectrumAccumulator(
            self._grid,
            self._source.times_of(channel, pulse_times_s(self.radar)) + channel.start_offset_s,
            tolerance=options.tolerance,
            method=options.slow_time_transform,
            backend=options.nufft_backend,
            listening=self._window,
            pulse=self._pulse,
            interval_s=1 / self.radar.burst.prf_hz if self.radar.burst.pulses > 1 else 0.0,
            chunk=options.chunk,
        )

    def add(self, paths: Paths) -> None:
        """Add the echoes of these paths, of finite lengths and amplitudes (`PathDataError`)."""
        self._sums.add(paths)

    def result(self) -> Echoes:
        """Echoes of all paths added so far."""
        spectra = self._sums.results(pulse_times_s(self.radar))
        size, pulses = self._grid.count, self.radar.burst.pulses
        # S has delays from the middle of the pulse; sample 0 is at first_s
        k = np.fft.fftfreq(size, 1 / size)
        turns = self._grid.step_hz * self._first_s
        shift = np.exp(2j * np.pi * (k * (turns - round(turns)) % 1.0))
        filter_ = shift
        if self._pulse is None:
            filter_ = replica_spectrum(self.radar.waveform, size) * shift
        samples = np.empty((len(spectra), pulses, self._count), dtype=np.complex128)
        for channel, spectrum in zip(samples, spectra, strict=True):
            if spectrum.moving is None:
                line = np.fft.ifft(np.fft.ifftshift(spectrum.still) * filter_)
                channel[:] = line[: self._count]
                continue
            for pulse, moving in enumerate(spectrum.moving):
                line = np.fft.ifftshift(moving + spectrum.still) * filter_
                channel[pulse] = np.fft.ifft(line)[: self._count]
        report = joined_report([spectrum.report for spectrum in spectra])
        return Echoes(
            silence_unformed(samples, self._source),
            self._first_s,
            self.range_limits_m,
            self.radar,
            self._options.amplitude_model,
            report.outside,
            report,
        )
