# SPDX-License-Identifier: GPL-3.0-or-later
"""A receiver's effects on echoes: phase noise, thermal noise, sampling with few bits. All are off
by default.

**Phase noise** is that of the oscillator that transmitter and receiver share. The transmitted wave
carries exp(j phi(t)), the mixer takes exp(j phi(t)) off again; of a path of delay tau

    exp(j [phi(t - tau) - phi(t)])

is left, whose spectrum is that of phi times 4 sin^2(pi f tau): range correlation (Budge and Burt,
IEEE National Radar Conference 1993). Near echoes are therefore clean close to the carrier. Pulses
and PMCW: `add_phase_noise` puts it on the samples. FMCW and stepped frequency: the synthesis puts
it on path by path, with the factors of `LineOscillator`.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...arrays import Complex, Real
from ...errors import ConfigError
from ...findings import Finding, finding
from ...options import check_settings, documented, setting
from ...physics.checks import read_csv
from ...physics.constants import REFERENCE_TEMPERATURE_K
from ...physics.radar_equation import complex_noise, noise_power_w
from ..radar import FmcwWaveform, PmcwWaveform, Radar, SteppedWaveform, replica
from ..spectrum import smooth_size
from .echoes import Echoes, line_times_s, line_waveform

#: Samples of the oscillator's phase over a burst (512 MB with its spectrum).
_MOST_SAMPLES = 1 << 25
#: Delays for which the phase is formed, as a fraction of the period of the fastest fluctuation;
#: straight between them: at most 0.5 % of it off (-46 dB).
_DELAY_SHARE = 1 / 32
#: Spectrum below which the pulse is taken to hold nothing, relative to its strongest frequency.
_EMPTY = 1e-10
#: Phase within a step of stepped frequency from which on its average is not that of the wave:
#: echoes are too strong by 4.34 phase^2 dB, here 0.1 dB [rad].
_SMALL_PHASE_RAD = 0.15


@dataclass(frozen=True)
class PhaseNoise:
    """Spectrum of the oscillator's phase.

    Attributes
    ----------
    offset_hz
        Offsets from the carrier, rising [Hz].
    level_dbc_hz
        Single-sideband level L(f) at these [dBc/Hz]; straight over log f, beyond them nothing.
    """

    offset_hz: tuple[float, ...]
    level_dbc_hz: tuple[float, ...]

    def __post_init__(self) -> None:
        offsets, levels = np.asarray(self.offset_hz), np.asarray(self.level_dbc_hz)
        if offsets.size != levels.size or offsets.size < 2:
            raise ConfigError(
                f"Phase noise has {offsets.size} offsets and {levels.size} levels; expected as "
                "many of both, at least two."
            )
        if not (
            np.isfinite(offsets).all() and (offsets > 0).all() and (np.diff(offsets) > 0).all()
        ):
            raise ConfigError("Phase noise: offsets must be finite, above 0 Hz and rising.")
        if not np.isfinite(levels).all() or (levels > 0).any():
            raise ConfigError(
                f"Phase noise: a level is {levels.max():g} dBc/Hz; expected finite numbers below 0."
            )

    def density(self, frequency_hz: Real) -> Real:
        """Return the two-sided density of the phase, equal to L(|f|) [rad^2/Hz]."""
        f = np.abs(frequency_hz)
        inside = (f >= self.offset_hz[0]) & (f <= self.offset_hz[-1])
        safe = np.where(inside, f, self.offset_hz[0])
        level_db = np.interp(np.log10(safe), np.log10(self.offset_hz), self.level_dbc_hz)
        return np.where(inside, 10 ** (level_db / 10), 0.0)


def load_phase_noise(path: str | Path) -> PhaseNoise:
    """Read phase noise from a table (CSV) with the columns offset_hz and level_dbc_hz.

    Parameters
    ----------
    path
        CSV file; offsets from the carrier [Hz] ascend, levels are single-sideband [dBc/Hz].

    Returns
    -------
    PhaseNoise
        Spectrum of the oscillator's phase.

    Raises
    ------
    ConfigError
        The file cannot be read, or does not fit.
    """
    table = read_csv(path, [("offset_hz", "level_dbc_hz")])
    offsets, levels = table.numbers("offset_hz"), table.numbers("level_dbc_hz")
    return PhaseNoise(tuple(offsets.tolist()), tuple(levels.tolist()))


class PhaseTrack:
    """One realisation of the phase at times n / rate, n = 0 ... count-1, averaged over `average_s`.
    Fluctuations slower than the whole length and faster than rate / 2 are left out.
    """

    def __init__(
        self, noise: PhaseNoise, rate_hz: float, count: int, seed: int, average_s: float = 0.0
    ) -> None:
        size = smooth_size(count)
        if size > _MOST_SAMPLES:
            raise ConfigError(
                f"Phase noise over {size} samples ({size / rate_hz:g} s at {rate_hz:g} Hz); at "
                f"most {_MOST_SAMPLES}. Take fewer pulses, a higher PRF, a lower sampling rate or, "
                "for stepped frequency, a table that ends at a lower offset."
            )
        self._rate_hz, self._size, self._count = rate_hz, size, count
        self._frequency_hz = np.fft.rfftfreq(size, 1 / rate_hz)
        rng = np.random.default_rng(seed)
        gauss = rng.standard_normal((2, self._frequency_hz.size))
        power = noise.density(self._frequency_hz) * rate_hz / size / 2
        power *= np.sinc(self._frequency_hz * average_s) ** 2
        self._spectrum = size * np.sqrt(power) * (gauss[0] + 1j * gauss[1])

    def at(self, later_s: float = 0.0) -> Real:
        """Return phi(t + later) at the times, (count,) [rad]."""
        spectrum = self._spectrum
        if later_s != 0:
            spectrum = spectrum * np.exp(2j * np.pi * self._frequency_hz * later_s)
        return np.asarray(np.fft.irfft(spectrum, self._size)[: self._count])


def add_phase_noise(echoes: Echoes, noise: PhaseNoise, seed: int = 0) -> Complex:
    """Add an oscillator's phase noise to ideal pulse or PMCW echoes; return samples (channels,
    rows, samples). The transmitted samples carry the phase, so range correlation is exact. Echoes
    that the window cuts are treated as if they ended there.
    """
    waveform = echoes.radar.waveform
    if isinstance(waveform, PmcwWaveform):
        return _through_codes(echoes, waveform, noise, seed)
    if waveform.family == "line":
        raise ConfigError(
            f"Phase noise of a waveform of kind {waveform.kind!r} differs from path to path: give "
            "it to the synthesis, synthesizer_for(..., phase_noise=...)."
        )
    return _through_pulses(echoes, noise, seed)


def _scene(samples: Complex, spectrum: Complex) -> Complex:
    """Return the spectrum of the scene, by which that of the pulse was multiplied. It is 0 where
    the pulse has no power.
    """
    power = np.abs(spectrum) ** 2
    least = _EMPTY * float(power.max())
    weight = np.where(power > least, np.conj(spectrum) / np.maximum(power, least), 0.0)
    return np.asarray(samples * weight, dtype=np.complex128)


def _track(
    radar: Radar, noise: PhaseNoise, rate_hz: float, last: int, seed: int, average_s: float = 0.0
) -> PhaseTrack:
    whole_s = (radar.burst.pulses - 1) / radar.burst.prf_hz
    whole_s += max(channel.start_offset_s for channel in radar.channels)
    return PhaseTrack(noise, rate_hz, math.ceil(whole_s * rate_hz) + last + 2, seed, average_s)


def _through_pulses(echoes: Echoes, noise: PhaseNoise, seed: int) -> Complex:
    radar = echoes.radar
    rate_hz = radar.waveform.sampling_rate_hz
    pulse = replica(radar.waveform)
    count = echoes.samples.shape[-1]
    # sample 0 of the record, in samples after sample 0 of the transmitted pulse
    ahead = echoes.first_sample_s * rate_hz + (pulse.size - 1) / 2
    whole = math.floor(ahead)
    track = _track(radar, noise, rate_hz, whole + count + 1, seed)
    sent, received = track.at(), track.at((ahead - whole) / rate_hz)
    size = smooth_size(count + pulse.size)
    clean = np.fft.fft(pulse, size)
    result = np.empty_like(echoes.samples)
    for channel, m in np.ndindex(*result.shape[:2]):
        offset_s = radar.channels[channel].start_offset_s
        start = round((m / radar.burst.prf_hz + offset_s) * rate_hz)
        noisy = np.fft.fft(pulse * np.exp(1j * sent[start : start + pulse.size]), size)
        samples = echoes.samples[channel, m]
        line = np.fft.ifft(_scene(np.fft.fft(samples, size), clean) * noisy)[:count]
        first = start + whole
        result[channel, m] = line * np.exp(-1j * received[first : first + count])
    return result


def _through_codes(echoes: Echoes, waveform: PmcwWaveform, noise: PhaseNoise, seed: int) -> Complex:
    code = replica(waveform)
    count, rate_hz = code.size, waveform.sampling_rate_hz
    track = _track(echoes.radar, noise, rate_hz, (waveform.code_repeats + 2) * count, seed)
    phase = track.at()
    responses = np.fft.ifft(_scene(np.fft.fft(echoes.samples), np.fft.fft(code)))
    twice = np.concatenate([code, code])
    result = np.empty_like(echoes.samples)
    times_s = line_times_s(echoes.radar)
    for channel, m in np.ndindex(*result.shape[:2]):
        start = round((float(times_s[m]) + echoes.radar.channels[channel].start_offset_s) * rate_hz)
        # the code before is still under way while this one is received
        sent = twice * np.exp(1j * phase[start : start + 2 * count])
        spectrum = np.fft.fft(sent) * np.fft.fft(responses[channel, m], 2 * count)
        here = slice(start + count, start + 2 * count)
        result[channel, m] = np.fft.ifft(spectrum)[count:] * np.exp(-1j * phase[here])
    return result


def takes_phase_noise_by_path(radar: Radar) -> bool:
    """Return True for FMCW and stepped frequency: the synthesis adds their phase noise."""
    return radar.waveform.family == "line" and not isinstance(radar.waveform, PmcwWaveform)


class LineOscillator:
    """Phase noise of FMCW and stepped frequency, which is put on path by path: straight between the
    delays q step_s at which `factor` is formed.

    FMCW has an anti-alias filter before its ADC. A stepped receiver averages over each step: faster
    fluctuations fold, by sinc^2(f x step time). The phase therefore has several samples per step.
    """

    def __init__(
        self, radar: Radar, noise: PhaseNoise, seed: int = 0, start_offset_s: float = 0.0
    ) -> None:
        waveform = line_waveform(radar)
        interval_s, every, average_s = waveform.grid_interval_s, 1, 0.0
        if isinstance(waveform, SteppedWaveform):
            every, average_s = math.ceil(2 * noise.offset_hz[-1] * interval_s), interval_s
        count, rate_hz = waveform.grid_count * every, every / interval_s
        self._track = _track(radar, noise, rate_hz, count, seed, average_s)
        starts = np.rint((line_times_s(radar) + start_offset_s) * rate_hz).astype(np.intp)
        self._places = starts[:, None] + np.arange(0, count, every)
        self._now = self._track.at()[self._places]
        self.step_s = _DELAY_SHARE / min(noise.offset_hz[-1], rate_hz / 2)

    def factor(self, order: int) -> Complex:
        """Return exp(j [phi(t - tau) - phi(t)]) at tau = order step_s, (pulses, samples)."""
        then = self._track.at(-order * self.step_s)[self._places]
        return np.asarray(np.exp(1j * (then - self._now)), dtype=np.complex128)


@documented
@dataclass(frozen=True)
class Receiver:
    """A receiver's shortcomings; the default has none."""

    noise_figure_db: float | None = setting(
        "Noise figure", "Add thermal noise of this noise figure. None: no thermal noise", None,
        unit="dB", minimum=0.0,
    )  # fmt: skip
    antenna_temperature_k: float = setting(
        "Antenna temperature", "Set the noise temperature of the antenna", REFERENCE_TEMPERATURE_K,
        unit="K", minimum=0.0,
    )  # fmt: skip
    adc_bits: int | None = setting(
        "ADC bits", "Round I and Q to this number of bits, sign included. None: exact", None,
        minimum=1, maximum=24,
    )  # fmt: skip
    adc_full_scale: float | None = setting(
        "ADC full scale",
        "Set the amplitude at which I and Q clip [sqrt(W)]. None: the largest that occurs",
        None,
        above=0.0,
    )
    phase_noise: PhaseNoise | None = setting(
        "Phase noise",
        "Read the spectrum of the oscillator's phase noise (CSV: offset_hz, level_dbc_hz)",
        None,
        parse=load_phase_noise,
        metavar="FILE",
    )
    noise_seed: int = setting(
        "Noise seed", "Set the seed of thermal noise and phase noise", 0,
        minimum=0, maximum=2**63 - 1,
    )  # fmt: skip

    def __post_init__(self) -> None:
        check_settings(self)
        if self.adc_full_scale is not None and self.adc_bits is None:
            raise ConfigError("ADC full scale without a number of bits; give both.")

    @property
    def ideal(self) -> bool:
        """True if echoes pass unchanged."""
        return self.noise_figure_db is None and self.adc_bits is None and self.phase_noise is None

    @property
    def phase_noise_seed(self) -> int:
        """Seed of the oscillator, another than that of the thermal noise."""
        return int(np.random.SeedSequence([self.noise_seed, 1]).generate_state(1)[0])


@dataclass(frozen=True)
class ReceivedSignal:
    """Samples as the receiver delivers them, and what it did.

    Attributes
    ----------
    echoes
        The samples; real (imaginary part 0) with a real ADC.
    noise_power_w
        Mean |noise|^2 of a complex sample, k (T_a + (F-1) T_0) fs [W]; a real ADC keeps half of it.
    full_scale
        Amplitude at which I and Q clip [sqrt(W)]; None: not quantised.
    step
        Height of one ADC step [sqrt(W)]; None: not quantised.
    clipped
        Values of I and Q that were clipped.
    step_phase_rad
        RMS phase noise of a far echo within a step of stepped frequency, which is averaged [rad].
    recorded
        Samples of each receiver before transmitters that send at once were told apart; None: they
        send in turn.
    """

    echoes: Echoes
    noise_power_w: float = 0.0
    full_scale: float | None = None
    step: float | None = None
    clipped: int = 0
    step_phase_rad: float = 0.0
    recorded: Echoes | None = None

    @property
    def findings(self) -> list[Finding]:
        """Limits of the samples: clipping, and phase noise within frequency steps."""
        found = []
        if self.clipped:
            size = self.echoes.samples.size
            found.append(finding("adc-clipped", count=self.clipped, samples=size))
        if self.step_phase_rad > _SMALL_PHASE_RAD:
            loss_db = 10 * math.log10(math.e) * self.step_phase_rad**2
            phase_rad = self.step_phase_rad
            found.append(finding("phase-noise-within-steps", phase_rad=phase_rad, loss_db=loss_db))
        return found

    @property
    def floor_power_w(self) -> float:
        """Mean |.|^2 of thermal noise and of the ADC's rounding, per complex sample [W]."""
        return self.noise_power_w + self.rounding_power_w

    @property
    def rounding_power_w(self) -> float:
        """Mean |.|^2 of the ADC's rounding per complex sample [W]: white, step^2 / 12 each in I and
        Q (Bennett 1948).
        """
        return (self.step or 0.0) ** 2 / 6


def apply_receiver(echoes: Echoes, receiver: Receiver | None = None) -> ReceivedSignal:
    """Return the samples that a receiver records of echoes.

    In this order: phase noise of the oscillator (FMCW and stepped frequency take it in the
    synthesis), thermal noise of the bandwidth fs, the one channel of a real ADC, its bits.

    Parameters
    ----------
    echoes
        From :func:`.echoes.synthesize`.
    receiver
        None: ideal.

    Returns
    -------
    ReceivedSignal
        Samples (channels, rows, samples), noise power [W], scale and clipping of the ADC.

    Raises
    ------
    ConfigError
        Thermal noise with the amplitude model "paper", whose amplitudes are no powers.
    """
    receiver = receiver or Receiver()
    waveform = echoes.radar.waveform
    samples = echoes.samples
    noise_w = 0.0
    if receiver.phase_noise is not None and not takes_phase_noise_by_path(echoes.radar):
        samples = add_phase_noise(echoes, receiver.phase_noise, receiver.phase_noise_seed)
    if receiver.noise_figure_db is not None:
        if echoes.amplitude_model != "radar-equation":
            raise ConfigError(
                "Thermal noise is in watts; amplitudes of the amplitude model "
                f"{echoes.amplitude_model!r} are not. Use the amplitude model 'radar-equation', "
                "or no thermal noise."
            )
        noise_w = float(
            noise_power_w(
                waveform.sampling_rate_hz,
                receiver.noise_figure_db,
                receiver.antenna_temperature_k,
            )
        )
        rng = np.random.default_rng(receiver.noise_seed)
        samples = samples + complex_noise(rng, samples.shape, noise_w)
    real = isinstance(waveform, FmcwWaveform) and waveform.real_adc
    if real:
        samples = samples.real.astype(np.complex128)
    scale, step, clipped = None, None, 0
    if receiver.adc_bits is not None:
        parts = samples.real if real else np.ascontiguousarray(samples).view(np.float64)
        parts, scale, clipped = quantise(parts, receiver.adc_bits, receiver.adc_full_scale)
        samples = parts.astype(np.complex128) if real else parts.view(np.complex128)
        step = scale / 2 ** (receiver.adc_bits - 1)
    if samples is not echoes.samples:
        echoes = dataclasses.replace(echoes, samples=samples)
    phase_rad = 0.0
    if receiver.phase_noise is not None and isinstance(waveform, SteppedWaveform):
        phase_rad = _phase_within_steps_rad(receiver.phase_noise, waveform.step_time_s)
    return ReceivedSignal(echoes, noise_w, scale, step, clipped, phase_rad)


def _phase_within_steps_rad(noise: PhaseNoise, step_s: float) -> float:
    """Return the RMS of phi(t - tau) - phi(t) that the average over a step removes, for an echo
    from so far that both are independent: sqrt(2 int L (1 - sinc^2(f T)) df) over both sidebands.
    """
    f = np.geomspace(noise.offset_hz[0], noise.offset_hz[-1], 10001)
    left = noise.density(f) * (1 - np.sinc(f * step_s) ** 2)
    return float(np.sqrt(2 * np.sum((left[1:] + left[:-1]) * np.diff(f))))


def quantise(values: Real, bits: int, full_scale: float | None = None) -> tuple[Real, float, int]:
    """Round values to the steps of an ADC with two's complement.

    Also return the scale, and the number of values outside the codes. `full_scale` is the amplitude
    of the code -2^(bits-1); None: no value is clipped. The largest code is 2^(bits-1) - 1. One bit
    gives the sign only, as half of full scale.
    """
    half = 2 ** (bits - 1)
    if full_scale is None:
        largest = float(np.abs(values).max(initial=0.0))
        full_scale = (largest or 1.0) * (half / max(half - 1, 1))
    step = full_scale / half
    if bits == 1:
        return np.where(values < 0, -0.5, 0.5) * full_scale, full_scale, 0
    codes = np.rint(values / step)
    clipped = int(np.count_nonzero((codes < -half) | (codes > half - 1)))
    return np.clip(codes, -half, half - 1) * step, full_scale, clipped
