# SPDX-License-Identifier: GPL-3.0-or-later
"""Receiver noise, and the signal-to-noise ratio that the radar equation predicts for a burst."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..array_types import Real
from ..errors import ConfigError
from .checks import real_array
from .constants import BOLTZMANN_J_PER_K, REFERENCE_TEMPERATURE_K
from .radar_equation import from_db, to_db


def noise_power_w(
    bandwidth_hz: ArrayLike,
    noise_figure_db: ArrayLike = 0.0,
    antenna_temperature_k: ArrayLike = REFERENCE_TEMPERATURE_K,
) -> Real:
    """Noise power referred to the receiver's input [W].

    k (T_a + (F - 1) T_0) B with T_0 = 290 K (Skolnik, 2.3); k T_0 B F at T_a = T_0. For complex
    samples B is the sampling rate: the power of each sample's noise, real and imaginary together.

    Raises
    ------
    ConfigError
        NaN, bandwidth not positive, noise figure below 0 dB, negative temperature.
    """
    bandwidth = real_array("Noise bandwidth", bandwidth_hz, "Hz", above=0.0)
    factor = from_db(real_array("Noise figure", noise_figure_db, "dB", minimum=0.0))
    antenna = real_array("Antenna temperature", antenna_temperature_k, "K", minimum=0.0)
    temperature = antenna + (factor - 1) * REFERENCE_TEMPERATURE_K
    return np.asarray(BOLTZMANN_J_PER_K * temperature * bandwidth, dtype=np.float64)


def complex_noise(
    rng: np.random.Generator, shape: tuple[int, ...], power_w: float
) -> NDArray[np.complex128]:
    """White complex Gaussian noise whose mean |x|^2 is `power_w` [W]; same seed, same noise."""
    scale = np.sqrt(float(real_array("Noise power", power_w, "W", minimum=0.0)) / 2)
    noise = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
    return np.asarray(scale * noise, dtype=np.complex128)


@dataclass(frozen=True)
class SnrPrediction:
    """Signal-to-noise ratios of one target, in dB.

    single_sample_db
        One complex sample of the echo, before any processing.
    single_pulse_db
        Peak of the compressed pulse: signal energy over noise density, P T / (k T_s).
    burst_db
        Peak of the range-Doppler map, all pulses added coherently, windows included.
    """

    single_sample_db: float
    single_pulse_db: float
    burst_db: float


def predict_snr(
    received_power_w: float,
    pulse_length_s: float,
    sampling_rate_hz: float,
    pulses: int = 1,
    noise_figure_db: float = 0.0,
    antenna_temperature_k: float = REFERENCE_TEMPERATURE_K,
    window_loss_db: float = 0.0,
) -> SnrPrediction:
    """What a matched filter and coherent integration make of a point target's echo.

    Peak signal over mean noise power. The compressed pulse has SNR E/N_0 = P T/(k T_s), whatever
    the sampling rate (Skolnik, 5.2); N pulses give N times it. Holds for a target in the middle of
    a range and Doppler cell: off the middle, up to 3.9 dB less per axis (straddling, no window).

    Parameters
    ----------
    received_power_w
        Power of the echo while the pulse lasts [W], from the radar equation with its losses.
    pulse_length_s, sampling_rate_hz
        Chirp length and complex sampling rate.
    pulses
        Pulses added coherently.
    noise_figure_db, antenna_temperature_k
        As in `noise_power_w`.
    window_loss_db
        SNR loss of the range and Doppler windows together, 0 or more: see `window_loss_db()`.

    Raises
    ------
    ConfigError
        As in `noise_power_w`; pulses below 1; a negative loss.
    """
    if not (isinstance(pulses, int) and pulses >= 1):
        raise ConfigError(f"Number of pulses is {pulses!r}; expected an integer from 1 up.")
    power = real_array("Received power", received_power_w, "W", minimum=0.0)
    length = real_array("Pulse length", pulse_length_s, "s", above=0.0)
    rate = real_array("Sampling rate", sampling_rate_hz, "Hz", above=0.0)
    loss = real_array("Window loss", window_loss_db, "dB", minimum=0.0)
    noise = noise_power_w(rate, noise_figure_db, antenna_temperature_k)
    if noise <= 0:
        raise ConfigError("Noise power is zero (0 K and 0 dB noise figure): the SNR is infinite.")
    sample = float(to_db(power / noise))
    pulse = sample + float(to_db(length * rate))
    return SnrPrediction(sample, pulse, pulse + float(to_db(pulses)) - float(loss))


def window_loss_db(window: ArrayLike) -> float:
    """SNR loss of a window against the matched filter [dB], N sum w^2 / (sum w)^2 (Harris 1978).

    Raises
    ------
    ConfigError
        No row of weights, or their sum is zero.
    """
    weights = real_array("Window", window)
    if weights.ndim != 1 or weights.size == 0 or weights.sum() == 0:
        raise ConfigError("A window is a list of weights whose sum is not zero.")
    return float(to_db(weights.size * np.sum(weights**2) / np.sum(weights) ** 2))
