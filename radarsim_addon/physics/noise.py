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
    """Return the noise power referred to the receiver's input, k (T_a + (F - 1) T_0) B.

    T_0 = 290 K (Skolnik, 2.3); at T_a = T_0 it is k T_0 B F.

    Parameters
    ----------
    bandwidth_hz
        B [Hz]. For complex samples it is the sampling rate: the result is the power of each
        sample's noise, real and imaginary together.
    noise_figure_db
        F in dB, 0 or more.
    antenna_temperature_k
        T_a [K].

    Returns
    -------
    ndarray
        Power of the broadcast shape [W].

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
    """Return white complex Gaussian noise; the same seed gives the same noise.

    Parameters
    ----------
    rng
        Source of random numbers.
    shape
        Shape of the result.
    power_w
        Mean |x|^2 [W].

    Returns
    -------
    ndarray
        Complex noise.
    """
    scale = np.sqrt(float(real_array("Noise power", power_w, "W", minimum=0.0)) / 2)
    noise = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
    return np.asarray(scale * noise, dtype=np.complex128)


@dataclass(frozen=True)
class SnrPrediction:
    """Signal-to-noise ratios of one target.

    Attributes
    ----------
    single_sample_db
        One complex sample of the echo, before any processing [dB].
    single_pulse_db
        Peak of the compressed pulse: signal energy over noise density, P T / (k T_s) [dB].
    burst_db
        Peak of the range-Doppler map, all pulses added coherently, tapers included [dB].
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
    """Predict the SNR of a point target after a matched filter and coherent integration.

    Peak signal over mean noise power. The compressed pulse has SNR E/N_0 = P T/(k T_s) at any
    sampling rate (Skolnik, 5.2); N pulses give N times it. Valid for a target in the middle of a
    range and Doppler cell: off the middle, up to 3.9 dB less per axis (straddling, no taper).

    Parameters
    ----------
    received_power_w
        Power of the echo during the pulse [W], from the radar equation with its losses.
    pulse_length_s, sampling_rate_hz
        Pulse width [s] and complex sampling rate [Hz].
    pulses
        Pulses added coherently.
    noise_figure_db, antenna_temperature_k
        As in `noise_power_w`.
    window_loss_db
        SNR loss of the range and Doppler tapers together, 0 or more: see `window_loss_db()`.

    Returns
    -------
    SnrPrediction
        In dB.

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
        raise ConfigError(
            "Noise power is zero (0 K and 0 dB noise figure), so the SNR is infinite. Give an "
            "antenna temperature or a noise figure above 0."
        )
    sample = float(to_db(power / noise))
    pulse = sample + float(to_db(length * rate))
    return SnrPrediction(sample, pulse, pulse + float(to_db(pulses)) - float(loss))


def window_loss_db(window: ArrayLike) -> float:
    """Return the SNR loss of a window against the matched filter, N sum w^2 / (sum w)^2.

    Harris 1978.

    Parameters
    ----------
    window
        Weights, (N,).

    Returns
    -------
    float
        Loss [dB], 0 or more.

    Raises
    ------
    ConfigError
        The weights are no list, or their sum is zero.
    """
    weights = real_array("Window", window)
    if weights.ndim != 1 or weights.size == 0 or weights.sum() == 0:
        raise ConfigError(
            f"Window has the shape {weights.shape} and the sum {weights.sum():g}; expected a list "
            "of weights with a sum other than zero."
        )
    return float(to_db(weights.size * np.sum(weights**2) / np.sum(weights) ** 2))
