# SPDX-License-Identifier: GPL-3.0-or-later
"""Echoes of waveforms whose receiver samples frequencies (family "line").

Sample k of a pulse that begins at t_m is taken at t = t_m + u_k, when the transmitter is at
f_k = f0 + (k - k0) df. After the mixer a path of delay tau(t) leaves

    s_k = a exp(-j 2 pi [f_k tau - K tau^2 / 2]),      K = df / (time between samples)

with the residual video phase K tau^2 / 2 for FMCW alone (Meta, Hoogeboom, Ligthart, IEEE TGRS 45,
3519, 2007): a stepped tone has settled by the time it is sampled. Paths move while the ramp runs,
see :mod:`.spectrum.ramp`; PMCW holds all frequencies at once, and paths move while a code is
received, see :class:`.spectrum.pulse_shape.CodeShape`. The sums are those of
:mod:`.spectrum.accumulator`; only phase noise, which differs from path to path, is put on here.

Mixer and sign: received times conjugate of transmitted, so phases fall with delay as everywhere.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from ...array_types import Complex, Mask
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..motion import AntennaMotion
from ..paths import Paths
from ..radar import Channel, FmcwWaveform, PmcwWaveform, Radar, replica
from ..scattering import Link
from ..spectrum import (
    CodeShape,
    ReceiveWindow,
    Spectrum,
    SpectrumAccumulator,
    SynthesisReport,
    check_finite,
)
from .channel_sums import ChannelPaths, ChannelSums, joined_report, silence_unformed
from .echoes import DEFAULT_OPTIONS, Echoes, EchoOptions, check_window
from .frequency_grid import Oscillator, line_grid, line_ramp, line_times_s, line_waveform

#: A delay of 0 is received, too.
_JUST_BEFORE_S = 1e-30


class StretchSynthesizer:
    """Adds up the samples of paths that come in parts; parameters as of
    :class:`.echoes.pulse_synthesis.EchoSynthesizer`.

    Every echo within the waveform's own range is in the samples, whatever the window.
    `oscillators`, one for each channel, put phase noise on (not for PMCW); with them all pulses are
    formed.

    FMCW: beats beyond the ADC's band are taken out by an ideal anti-alias filter, and counted in
    ``outside``. Stepped frequency and PMCW: what is beyond the unambiguous range folds back.
    """

    def __init__(
        self,
        radar: Radar,
        range_limits_m: tuple[float, float],
        options: EchoOptions = DEFAULT_OPTIONS,
        *,
        oscillators: Sequence[Oscillator] | None = None,
        link: Link | None = None,
        antennas: AntennaMotion | None = None,
        wanted: Mask | None = None,
    ) -> None:
        self.radar = radar
        self.range_limits_m = check_window(range_limits_m)
        self._waveform = line_waveform(radar)
        self._options = options
        self._grid = line_grid(self._waveform)
        self._filtered = isinstance(self._waveform, FmcwWaveform)
        self._code: CodeShape | None = None
        if isinstance(self._waveform, PmcwWaveform) and options.motion_within_pulse:
            self._code = CodeShape(replica(self._waveform), self._waveform.sampling_rate_hz)
        self._oscillators = oscillators
        self._source = ChannelPaths(radar, options, link, antennas, wanted)
        self._sums = ChannelSums(self._source, self._accumulator)
        rows = line_times_s(radar).size
        self._noisy = [NoisyPathAccumulator(rows, self._grid.count) for _ in oscillators or ()]
        self._added, self._beyond = 0, 0

    def _accumulator(self, channel: Channel) -> SpectrumAccumulator:
        waveform = self._waveform
        ends_s = (-np.inf, np.inf)
        if self._filtered:
            ends_s = (-_JUST_BEFORE_S, 2 * waveform.unambiguous_range_m / SPEED_OF_LIGHT_MPS)
        middle_s = waveform.grid_start_s + (self._grid.count // 2) * waveform.grid_interval_s
        if self._code is not None:
            middle_s = self._code.half_s
        return SpectrumAccumulator(
            self._grid,
            self._source.times_of(channel, line_times_s(self.radar))
            + middle_s
            + channel.start_offset_s,
            tolerance=self._options.tolerance,
            method=self._options.slow_time_transform,
            backend=self._options.nufft_backend,
            listening=ReceiveWindow(*ends_s, reference_hz=waveform.carrier_hz),
            ramp=line_ramp(waveform),
            pulse=self._code,
            interval_s=1 / self.radar.burst.prf_hz if self.radar.burst.pulses > 1 else 0.0,
            chunk=self._options.chunk,
        )

    def add(self, paths: Paths) -> None:
        """Add the echoes of these paths, of finite lengths and amplitudes (`PathDataError`)."""
        beyond = paths.range_m >= self._waveform.unambiguous_range_m
        if not self._noisy:
            self._sums.add(paths)
        for channel, oscillator, noisy in zip(
            self.radar.channels, self._oscillators or (), self._noisy, strict=False
        ):
            self._add_noisy(paths, channel, oscillator, noisy)
        self._added += len(paths)
        self._beyond += int(np.count_nonzero(beyond))

    def _add_noisy(
        self, paths: Paths, channel: Channel, oscillator: Oscillator, noisy: NoisyPathAccumulator
    ) -> None:
        """Each path between the two nearest delays for which there is a factor."""
        rows = slice(0, len(paths))
        lengths = self._source.lengths_of(paths, channel)
        amplitudes = self._source.amplitudes_of(paths, channel)
        check_finite(amplitudes.constant, rows, "amplitude", self._added)
        check_finite(paths.length_m, rows, "length", self._added)
        position = paths.length_m / SPEED_OF_LIGHT_MPS / oscillator.step_s
        low = np.floor(position)
        for order in np.unique(np.concatenate([low, low + 1])):
            share = 1 - np.abs(position - order)
            near = np.flatnonzero(share > 0)
            accumulator = self._accumulator(channel)
            accumulator.add(lengths.select(near), amplitudes.select(near, share[near]))
            noisy.add(accumulator.result(), oscillator.factor(int(order)))

    def result(self) -> Echoes:
        """Echoes of all paths added so far; complex for a real ADC too, see `receiver`."""
        waveform = self._waveform
        # (channels, rows, N), for PMCW with the code's spectrum where paths move within it
        spectra = self._sums.results(line_times_s(self.radar))
        report = joined_report([spectrum.report for spectrum in spectra])
        samples = np.stack([part.values for part in self._noisy or spectra])
        if self._noisy:
            report = joined_report([noisy.report(report, self._added) for noisy in self._noisy])
            # every path was added for two delays, but is lost only once
            report.outside = float(self._beyond) if self._filtered else 0.0
        report.range_ambiguous_count = 0 if self._filtered else self._beyond
        if isinstance(waveform, PmcwWaveform):
            code = 1.0 if self._code is not None else np.fft.fft(replica(waveform))
            samples = np.fft.ifft(np.fft.ifftshift(samples, axes=-1) * code)
        return Echoes(
            silence_unformed(samples, self._source),
            waveform.grid_start_s,
            self.range_limits_m,
            self.radar,
            self._options.amplitude_model,
            report.outside,
            report,
        )


class NoisyPathAccumulator:
    """Spectra times factors of modulus 1, one for each delay of an oscillator's phase."""

    def __init__(self, rows: int, count: int) -> None:
        self.values = np.zeros((rows, count), dtype=np.complex128)
        self._parts: list[tuple[SynthesisReport, float]] = []

    def add(self, spectrum: Spectrum, factor: Complex) -> None:
        """Add one delay's."""
        values = spectrum.values
        self._parts.append((spectrum.report, float(np.vdot(values, values).real)))
        values *= factor
        self.values += values

    def report(self, empty: SynthesisReport, paths: int) -> SynthesisReport:
        """One report of all; a path counts in the steps of both delays that it lies between."""
        report = dataclasses.replace(empty, paths=paths, steps=[], notes=[])
        energy = float(np.vdot(self.values, self.values).real)
        expected, fast, notes = 0.0, 0, []
        for part, own in self._parts:
            for step in part.steps:
                report.count(step.motion, step.transform, step.paths, step.transforms, step.cpu_s)
            # the factors turn phases alone: absolute errors stay what they are
            if energy > 0:
                share = float(np.sqrt(own / energy))
                report.error_estimate += share * part.error_estimate
                report.error_bound += share * part.error_bound
            if part.cancellation_db is not None:
                expected += own / 10 ** (part.cancellation_db / 10)
            report.motion_error_rad = max(report.motion_error_rad, part.motion_error_rad)
            report.ramp_residual_phase_rad = max(
                report.ramp_residual_phase_rad, part.ramp_residual_phase_rad
            )
            fast += part.doppler_ambiguous_count
            report.wall_s += part.wall_s
            notes += part.notes
        report.doppler_ambiguous_count = -(-fast // 2)  # each is in two parts
        if energy > 0 and expected > 0:
            report.cancellation_db = 10 * float(np.log10(energy / expected))
        text = f"Phase noise path by path, each between two of {len(self._parts)} delays"
        report.notes = [*dict.fromkeys(notes), f"{text}: a path counts twice in the steps."]
        return report
