# SPDX-License-Identifier: GPL-3.0-or-later
"""What a receiver does to the echoes: phase noise, thermal noise, sampling with few bits.

All of it is off unless asked for.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from ...array_types import Real
from ...errors import ConfigError
from ...options import check_settings, documented, setting
from ...physics.constants import REFERENCE_TEMPERATURE_K
from ...physics.noise import complex_noise, noise_power_w
from ..radar import FmcwWaveform
from .echoes import Echoes
from .phase_noise import PhaseNoise, add_phase_noise, load_phase_noise, takes_phase_noise_by_path


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
        """Whether echoes pass unchanged."""
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
    """

    echoes: Echoes
    noise_power_w: float = 0.0
    full_scale: float | None = None
    step: float | None = None
    clipped: int = 0

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
    if samples is echoes.samples:
        return ReceivedSignal(echoes)
    received = dataclasses.replace(echoes, samples=samples)
    return ReceivedSignal(received, noise_w, scale, step, clipped)


def quantise(values: Real, bits: int, full_scale: float | None = None) -> tuple[Real, float, int]:
    """Round values to the steps of an ADC with two's complement; also returns the scale and how
    many were outside its codes. `full_scale`, the amplitude of code -2^(bits-1), None: clips
    nothing. Codes end at 2^(bits-1) - 1; one bit is the sign alone, as half of full scale.
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
