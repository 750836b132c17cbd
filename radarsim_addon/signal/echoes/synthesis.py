# SPDX-License-Identifier: GPL-3.0-or-later
"""Raw samples of a burst from paths, for every family of waveforms (Eq. 9-14 of the paper, with the
carrier phase).

**Pulses** (`EchoSynthesizer`). The complex baseband echo

    s(t_m, tau) = sum_i a_i w(tau - tau_i) exp(-j 2 pi f0 tau_i),   tau_i = l_i(t_m)/c

is formed in the frequency domain, W(f) sum_i a_i exp(-j 2 pi (f0+f) tau_i), by
`SpectrumAccumulator`; t_m = m/PRF from the frame's time t. The pulse that comes back is scaled in
time by the range rate (`PulseMotionTransform`).

**Waveforms whose receiver samples frequencies** (family "line", `StretchSynthesizer`). Sample k of
a pulse that begins at t_m is taken at t = t_m + u_k, when the transmitter is at f_k = f0 + (k - k0)
df. After the mixer a path of delay tau(t) leaves

    s_k = a exp(-j 2 pi [f_k tau - K tau^2 / 2]),      K = df / (time between samples)

with the residual video phase K tau^2 / 2 for FMCW alone (Meta, Hoogeboom, Ligthart, IEEE TGRS 45,
3519, 2007): a stepped tone has settled by the time it is sampled. Paths move while the ramp runs
(`RampTransform`); PMCW holds all frequencies at once, and paths move while a code is received
(`CodeShape`). Received times conjugate of transmitted, so phases fall with delay as everywhere.
Only phase noise, which differs from path to path, is put on here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from ...arrays import Complex, Mask, Real
from ...contract import AmplitudeModel
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..motion import AntennaMotion, PathMotion
from ..paths import MOST_SHARED, Paths, SharedValues, channel_lengths
from ..radar import Channel, FmcwWaveform, PmcwWaveform, Radar, replica, replica_spectrum
from ..scattering import Link, amplitude_history, reverse_amplitudes
from ..spectrum import (
    TOLERANCE,
    AmplitudeHistory,
    Backend,
    CodeShape,
    FrequencyGrid,
    Method,
    PulseShape,
    Ramp,
    ReceiveWindow,
    Spectrum,
    SpectrumAccumulator,
    SynthesisReport,
    check_finite,
    single_spectra,
    smooth_size,
)
from .echoes import (
    DEFAULT_OPTIONS,
    Echoes,
    EchoOptions,
    check_window,
    line_times_s,
    line_waveform,
    pulse_times_s,
    window_samples,
)
from .receiver import LineOscillator, PhaseNoise, takes_phase_noise_by_path


@dataclass(frozen=True)
class ChannelPaths:
    """Gives lengths and amplitudes of paths in the channels of a radar."""

    radar: Radar
    options: EchoOptions
    link: Link | None = None  #: gains at every pulse; None: those that the paths have
    antennas: AntennaMotion | None = None  #: their motion; None: the link's
    wanted: Mask | None = None  #: pulses whose echoes are formed, (pulses,); None: all

    def rows_of(self, channel: Channel, rows: int) -> Mask:
        """Return a mask of the rows that are formed: of wanted pulses that use the channel."""
        pulses = self.radar.burst.pulses
        used = channel.active_mask(pulses)
        if self.wanted is not None:
            used = used & self.wanted
        if not used.any():
            used = np.arange(pulses) == 0  # a sum needs a pulse
        return np.repeat(used, rows // pulses)

    def times_of(self, channel: Channel, times_s: Real) -> Real:
        """Select the times of the rows that are formed from those of all rows [s]."""
        return np.asarray(times_s[self.rows_of(channel, times_s.size)])

    def accumulator(
        self, grid: FrequencyGrid, times_s: Real, channel: Channel, **own: Any
    ) -> SpectrumAccumulator:
        """Return an empty sum for a channel, from the times of all rows [s]; `own` are the
        arguments that depend on the waveform.
        """
        options, burst = self.options, self.radar.burst
        slots = {(one.start_offset_s, one.active): one for one in self.radar.channels}
        ends_s = [
            self.times_of(one, times_s)[[0, -1]] + one.start_offset_s for one in slots.values()
        ]
        return SpectrumAccumulator(
            grid,
            self.times_of(channel, times_s) + channel.start_offset_s,
            span_s=(float(np.min(ends_s)), float(np.max(ends_s))),
            tolerance=options.tolerance,
            method=options.slow_time_transform,
            backend=options.nufft_backend,
            interval_s=1 / burst.prf_hz if burst.pulses > 1 else 0.0,
            chunk=options.chunk,
            **own,
        )

    def lengths_of(
        self, paths: Paths, channel: Channel, shared: SharedValues | None = None
    ) -> PathMotion:
        antennas = self.antennas or (None if self.link is None else self.link.antennas)
        return channel_lengths(paths, channel, antennas, shared)

    def amplitudes_of(
        self, paths: Paths, channel: Channel, shared: SharedValues | None = None
    ) -> AmplitudeHistory:
        waveform, options = self.radar.waveform, self.options
        found = amplitude_history(
            paths,
            channel,
            frequency_hz=waveform.carrier_hz,
            pulses=self.radar.burst.pulses,
            amplitude_model=options.amplitude_model,
            receiver_gain=options.receiver_gain,
            link=self.link,
            speckle_seed=options.speckle_seed,
            shared=shared,
        )
        antennas = self.antennas or (None if self.link is None else self.link.antennas)
        if antennas is None or options.speckle_seed is None:
            return found  # without speckle, rows add up coherently as they are
        factors = reverse_amplitudes(
            paths, channel, antennas, waveform.carrier_hz, waveform.range_resolution_m
        )
        return found if factors is None else found.select(slice(None), factors)


#: Values that a path has of an element at once: lengths and gains at the nodes of fits.
_VALUES = 64
#: Rows of all channels together that wait for their transforms.
_MOST_WAITING = 1 << 20


class ChannelSums:
    """Adds up the spectra of paths in every channel, by a sum for each from `make`.

    Lengths and gains are computed by element, not by channel: of an array of 12 x 16 those are 28,
    not 192. Paths are taken in parts, so that these values fit into the memory.
    """

    def __init__(
        self, source: ChannelPaths, make: Callable[[Channel], SpectrumAccumulator]
    ) -> None:
        self._source = source
        channels = source.radar.channels
        self._sums = [(channel, make(channel)) for channel in channels]
        elements = len({c.tx.position_m for c in channels}) + len(
            {c.rx.position_m for c in channels}
        )
        self._rows = MOST_SHARED // (8 * _VALUES * (elements + 1))

    def add(self, paths: Paths) -> None:
        several = len(self._sums) > 1
        step = self._rows if several else max(len(paths), 1)
        for start in range(0, len(paths), step):
            part = paths if step >= len(paths) else paths.select(slice(start, start + step))
            shared = SharedValues(len(self._sums))
            for channel, total in self._sums:
                total.add(
                    self._source.lengths_of(part, channel, shared),
                    self._source.amplitudes_of(part, channel, shared),
                )
                if several and len(part) * len(self._sums) > _MOST_WAITING:
                    total.flush()

    def results(self, times_s: Real) -> list[Spectrum]:
        """Return the spectra of all channels at these times. Rows that are not formed are 0."""
        found = []
        for channel, total in self._sums:
            formed, used = total.result(), self._source.rows_of(channel, times_s.size)
            moving = formed.moving
            if moving is not None and not used.all():
                moving = np.zeros((times_s.size, formed.grid.count), dtype=np.complex128)
                moving[used] = formed.moving
            found.append(replace(formed, moving=moving, times_s=times_s))
        return found


def silence_unformed(samples: Complex, source: ChannelPaths) -> Complex:
    """Set the rows (channels, rows, samples) that are not formed to 0, in place."""
    for values, channel in zip(samples, source.radar.channels, strict=True):
        values[~source.rows_of(channel, values.shape[0])] = 0
    return samples


def joined_report(reports: list[SynthesisReport]) -> SynthesisReport:
    """Report of the channel of the largest error, with the time of all."""
    worst = max(reports, key=lambda report: report.error_estimate)
    return replace(worst, wall_s=sum(report.wall_s for report in reports))


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
        # S has delays from the middle of the pulse; sample 0 is at first_s
        turns = self._grid.step_hz * self._first_s
        self._filter: Complex = np.exp(
            2j * np.pi * (np.fft.fftfreq(size, 1 / size) * (turns - round(turns)) % 1.0)
        )
        if self._pulse is None:
            self._filter = replica_spectrum(radar.waveform, size) * self._filter
        self._source = ChannelPaths(radar, options, link, antennas, wanted)
        self._sums = ChannelSums(self._source, self._accumulator)

    def _accumulator(self, channel: Channel) -> SpectrumAccumulator:
        return self._source.accumulator(
            self._grid,
            pulse_times_s(self.radar),
            channel,
            listening=self._window,
            pulse=self._pulse,
        )

    def add(self, paths: Paths) -> None:
        """Add the echoes of paths. `PathDataError`: a length or an amplitude is not finite."""
        self._sums.add(paths)

    def result(self) -> Echoes:
        """Return the echoes of all paths added so far."""
        spectra = self._sums.results(pulse_times_s(self.radar))
        pulses = self.radar.burst.pulses
        samples = np.empty((len(spectra), pulses, self._count), dtype=np.complex128)
        for channel, spectrum in zip(samples, spectra, strict=True):
            if spectrum.moving is None:
                channel[:] = self._line(spectrum.still)
                continue
            for pulse, moving in enumerate(spectrum.moving):
                channel[pulse] = self._line(moving + spectrum.still)
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

    def _line(self, spectrum: Complex) -> Complex:
        """Return the samples of a pulse."""
        return np.fft.ifft(np.fft.ifftshift(spectrum) * self._filter)[: self._count]

    def single_echoes(self, range_m: Real, rate_mps: Real) -> Echoes:
        """Return the echoes of n scatterers of amplitude 1, each alone in one of n pulses, at
        ranges [m] and range rates [m/s] of the middle of the pulse.
        """
        assert self._pulse is not None
        radar = replace(self.radar, burst=replace(self.radar.burst, pulses=range_m.size))
        radar.check_size(self._grid.count)
        spectra = single_spectra(
            self._grid, self._window, self._pulse, 2 * range_m, 2 * rate_mps, np.zeros(range_m.size)
        )
        return Echoes(
            np.array([[self._line(spectrum) for spectrum in spectra]]),
            self._first_s,
            self.range_limits_m,
            radar,
            self._options.amplitude_model,
            float(np.mean(~spectra.any(axis=1))),
        )


class StretchSynthesizer:
    """Adds up the samples of paths that come in parts; parameters as of `EchoSynthesizer`.

    Every echo within the waveform's own range is in the samples, whatever the window.
    `oscillators`, one for each channel, put phase noise on (not for PMCW); with them all pulses are
    formed.

    FMCW: beats beyond the ADC's band are taken out by an ideal anti-alias filter, and counted in
    ``outside``. Stepped frequency and PMCW: echoes beyond the unambiguous range fold back.
    """

    def __init__(
        self,
        radar: Radar,
        range_limits_m: tuple[float, float],
        options: EchoOptions = DEFAULT_OPTIONS,
        *,
        oscillators: Sequence[LineOscillator] | None = None,
        link: Link | None = None,
        antennas: AntennaMotion | None = None,
        wanted: Mask | None = None,
    ) -> None:
        self.radar = radar
        self.range_limits_m = check_window(range_limits_m)
        self._waveform = line_waveform(radar)
        self._options = options
        # exact where the engine has its zero
        ahead = self._waveform.grid_count // 2 - Fraction(self._waveform.grid_middle)
        step_hz = self._waveform.grid_step_hz
        centre_hz = Fraction(self._waveform.carrier_hz) + ahead * Fraction(step_hz)
        self._grid = FrequencyGrid.centred(centre_hz, step_hz, self._waveform.grid_count)
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
        if self._filtered:  # a delay of 0 is received, too
            ends_s = (-1e-30, 2 * waveform.unambiguous_range_m / SPEED_OF_LIGHT_MPS)
        middle_s = waveform.grid_start_s + (self._grid.count // 2) * waveform.grid_interval_s
        if self._code is not None:
            middle_s = self._code.half_s
        ramp: Ramp | None = None  # all frequencies at once
        if waveform.grid_interval_s != 0:
            video = waveform.slope_hz_per_s if isinstance(waveform, FmcwWaveform) else 0.0
            ramp = Ramp(waveform.grid_interval_s, video)
        return self._source.accumulator(
            self._grid,
            line_times_s(self.radar) + middle_s,
            channel,
            listening=ReceiveWindow(*ends_s, reference_hz=waveform.carrier_hz),
            ramp=ramp,
            pulse=self._code,
        )

    def add(self, paths: Paths) -> None:
        """Add the echoes of paths. `PathDataError`: a length or an amplitude is not finite."""
        beyond = paths.range_m >= self._waveform.unambiguous_range_m
        if not self._noisy:
            self._sums.add(paths)
        for channel, oscillator, noisy in zip(
            self.radar.channels, self._oscillators or (), self._noisy, strict=False
        ):
            self._add_noisy(paths, channel, oscillator, noisy)
        self._added += len(paths)
        self._beyond += int(np.count_nonzero(beyond))

    def single_echoes(self, range_m: Real, rate_mps: Real) -> Echoes:
        """Return the echoes of n scatterers of amplitude 1, each alone in one of n pulses of
        repeated codes, at ranges [m] and range rates [m/s] of the start of the pulse.
        """
        assert isinstance(self._waveform, PmcwWaveform) and self._code is not None
        repeats = self._waveform.code_repeats
        later_s = self._code.half_s + np.arange(repeats) * self._waveform.code_s
        spectra = single_spectra(
            self._grid,
            ReceiveWindow(),
            self._code,
            np.repeat(2 * range_m, repeats),
            np.repeat(2 * rate_mps, repeats),
            np.tile(later_s, range_m.size),
        )
        return Echoes(
            np.fft.ifft(np.fft.ifftshift(spectra, axes=-1))[None],
            self._waveform.grid_start_s,
            self.range_limits_m,
            replace(self.radar, burst=replace(self.radar.burst, pulses=range_m.size)),
            self._options.amplitude_model,
            float(np.mean(~spectra.any(axis=1))),
        )

    def _add_noisy(
        self,
        paths: Paths,
        channel: Channel,
        oscillator: LineOscillator,
        noisy: NoisyPathAccumulator,
    ) -> None:
        """Divide each path between the two nearest delays that have a factor."""
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
        """Return the echoes of all paths added so far. They are complex with a real ADC, too; see
        `receiver`.
        """
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
        values = spectrum.values
        self._parts.append((spectrum.report, float(np.vdot(values, values).real)))
        values *= factor
        self.values += values

    def report(self, empty: SynthesisReport, paths: int) -> SynthesisReport:
        """Return one report of all parts. A path counts in the steps of both delays next to it."""
        report = replace(empty, paths=paths, steps=[], notes=[])
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


def synthesizer_for(
    radar: Radar,
    range_limits_m: tuple[float, float],
    options: EchoOptions = DEFAULT_OPTIONS,
    *,
    phase_noise: PhaseNoise | None = None,
    phase_noise_seed: int = 0,
    link: Link | None = None,
    antennas: AntennaMotion | None = None,
    wanted: Mask | None = None,
) -> EchoSynthesizer | StretchSynthesizer:
    """Return the synthesizer for the waveform's family. Parameters are those of `EchoSynthesizer`.
    Phase noise is for FMCW and stepped frequency, which take it path by path; see `apply_receiver`.
    """
    radar = radar.sent
    if radar.waveform.family == "pulse":
        return EchoSynthesizer(
            radar, range_limits_m, options, link=link, antennas=antennas, wanted=wanted
        )
    oscillators = None
    if phase_noise is not None and takes_phase_noise_by_path(radar):
        oscillators = [
            LineOscillator(radar, phase_noise, phase_noise_seed, channel.start_offset_s)
            for channel in radar.channels
        ]
        wanted = None  # the oscillators' factors are of all rows
    return StretchSynthesizer(
        radar,
        range_limits_m,
        options,
        oscillators=oscillators,
        link=link,
        antennas=antennas,
        wanted=wanted,
    )


def synthesize(
    paths: Paths | Iterable[Paths],
    radar: Radar,
    *,
    range_limits_m: tuple[float, float],
    amplitude_model: AmplitudeModel = "radar-equation",
    receiver_gain: float = 1.0,
    nufft_backend: Backend = "finufft",
    tolerance: float = TOLERANCE,
    slow_time_transform: Method = "auto",
    range_folding: bool = True,
    motion_within_pulse: bool = True,
    chunk: int = 1 << 17,
    speckle_seed: int | None = None,
    link: Link | None = None,
    antennas: AntennaMotion | None = None,
) -> Echoes:
    """Return the echoes of a burst from paths (Eq. 9-14).

    Parameters
    ----------
    paths
        Paths, or several tables of them, as from :func:`.decoding.iter_path_chunks`.
    radar
        Waveform and burst.
    range_limits_m
        One-way ranges (start, stop) [m]. Echoes from these ranges are recorded completely. Echoes
        that reach in from outside are cut at the limits.
    amplitude_model, receiver_gain, nufft_backend, tolerance, slow_time_transform, range_folding
        See :class:`.echoes.EchoOptions`.
    motion_within_pulse, chunk, speckle_seed
        See :class:`.echoes.EchoOptions`.
    link, antennas
        See :func:`synthesizer_for`.

    Returns
    -------
    Echoes
        Samples (channels, rows, samples). Of transmitters that send at once, each pair by itself at
        all pulses of `radar.sent`; see :func:`.echoes.recorded_together`.

    Notes
    -----
    The range rate scales an echo in time, so the echo has the Doppler shift and the range-Doppler
    coupling of a moving target. The path is taken at the time when the wave reaches the target:
    half the delay after the emission. A range-ambiguous echo has the carrier phase of its true
    delay, because the phase of the oscillator is continuous.
    """
    options = EchoOptions(
        amplitude_model=amplitude_model,
        receiver_gain=receiver_gain,
        nufft_backend=nufft_backend,
        tolerance=tolerance,
        slow_time_transform=slow_time_transform,
        range_folding=range_folding,
        motion_within_pulse=motion_within_pulse,
        chunk=chunk,
        speckle_seed=speckle_seed,
    )
    synthesizer = synthesizer_for(radar, range_limits_m, options, link=link, antennas=antennas)
    for part in [paths] if isinstance(paths, Paths) else paths:
        synthesizer.add(part)
    return synthesizer.result()
