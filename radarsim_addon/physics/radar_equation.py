# SPDX-License-Identifier: GPL-3.0-or-later
"""Powers: from radiance to received watts, the radar equation, receiver noise and SNR.

The path tracer gives radiance L; a pixel of the solid angle dOmega delivers P = L A_e dOmega
(`received_power_w`). The same power follows from a cross section by the radar equation
(`bistatic_power_w`), and with the noise k T B F the SNR of a burst (`predict_snr`). In all
functions gain is that of the receiving antenna, G_r, linear. Sources: Skolnik, Introduction to
Radar
Systems; Balanis, Antenna Theory.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Real, reals
from ..errors import ConfigError
from .checks import real_array
from .constants import BOLTZMANN_J_PER_K, REFERENCE_TEMPERATURE_K


def to_db(ratio: ArrayLike) -> Real:
    """Return 10 log10 of a power ratio.

    Parameters
    ----------
    ratio : 0 or more

    Returns
    -------
    ndarray : decibels; -inf for zero
    """
    value = real_array("Power ratio", ratio, "", minimum=0.0)
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10(value))


def from_db(level_db: ArrayLike) -> Real:
    """Return the power ratio 10^(dB/10).

    Parameters
    ----------
    level_db : decibels

    Returns
    -------
    ndarray
    """
    (value,) = reals(level_db)
    return np.asarray(10 ** (value / 10))


def effective_area_m2(wavelength_m: ArrayLike, gain: ArrayLike = 1.0) -> Real:
    """Return the effective area of a receiving antenna, G lambda^2 / (4 pi) (Balanis, eq. 2-110).

    Parameters
    ----------
    wavelength_m, gain : lambda [m] and G

    Returns
    -------
    ndarray : [m^2]
    """
    wavelength, gain = reals(wavelength_m, gain)
    return gain * wavelength**2 / (4 * np.pi)


def received_power_w(
    radiance: ArrayLike, solid_angle_sr: ArrayLike, wavelength_m: ArrayLike, gain: ArrayLike = 1.0
) -> Real:
    """Return the power that a pixel delivers to the receiver, P = L A_e dOmega.

    There is no further range weight: the return path's 1/R^2 is in dOmega.

    Parameters
    ----------
    radiance, solid_angle_sr : L [W/(m^2 sr)] and dOmega [sr]
    wavelength_m, gain : as for `effective_area_m2`

    Returns
    -------
    ndarray : [W]
    """
    radiance, solid_angle = reals(radiance, solid_angle_sr)
    return radiance * solid_angle * effective_area_m2(wavelength_m, gain)


def monostatic_power_w(
    eirp_w: ArrayLike,
    rcs_m2: ArrayLike,
    range_m: ArrayLike,
    wavelength_m: ArrayLike,
    gain: ArrayLike = 1.0,
) -> Real:
    """Return EIRP G_r lambda^2 sigma / ((4 pi)^3 R^4), the radar equation (Skolnik, eq. 1.7).

    Parameters
    ----------
    eirp_w, rcs_m2 : EIRP [W] and sigma [m^2]
    range_m, wavelength_m : R and lambda [m]
    gain : G_r

    Returns
    -------
    ndarray : received power [W]
    """
    eirp, gain, wavelength = reals(eirp_w, gain, wavelength_m)
    rcs, distance = reals(rcs_m2, range_m)
    return eirp * gain * wavelength**2 * rcs / ((4 * np.pi) ** 3 * distance**4)


def bistatic_power_w(
    eirp_w: ArrayLike,
    rcs_m2: ArrayLike,
    transmitter_range_m: ArrayLike,
    receiver_range_m: ArrayLike,
    wavelength_m: ArrayLike,
    gain: ArrayLike = 1.0,
    loss_db: ArrayLike = 0.0,
) -> Real:
    """Return EIRP G_r lambda^2 sigma / ((4 pi)^3 R_t^2 R_r^2 L) (Skolnik, eq. 25.1).

    Parameters
    ----------
    eirp_w, rcs_m2 : EIRP towards the target [W] and sigma [m^2]
    transmitter_range_m, receiver_range_m, wavelength_m : R_t, R_r and lambda [m]
    gain : G_r towards the target
    loss_db : all losses together, L in dB

    Returns
    -------
    ndarray : received power [W]
    """
    eirp = real_array("EIRP", eirp_w, "W", minimum=0.0)
    rcs = real_array("Radar cross section", rcs_m2, "m^2", minimum=0.0)
    there = real_array("Transmitter range", transmitter_range_m, "m", above=0.0)
    back = real_array("Receiver range", receiver_range_m, "m", above=0.0)
    wavelength = real_array("Wavelength", wavelength_m, "m", above=0.0)
    received = eirp * real_array("Gain", gain, "", minimum=0.0) * wavelength**2 * rcs
    loss = from_db(real_array("Loss", loss_db, "dB"))
    return np.asarray(received / ((4 * np.pi) ** 3 * there**2 * back**2 * loss))


def rcs_from_power_m2(
    power_w: ArrayLike,
    eirp_w: ArrayLike,
    transmitter_range_m: ArrayLike,
    receiver_range_m: ArrayLike,
    wavelength_m: ArrayLike,
    gain: ArrayLike = 1.0,
) -> Real:
    """Return the radar cross section that returns a power: `bistatic_power_w` solved for sigma.

    Parameters
    ----------
    power_w : received power [W]
    eirp_w, transmitter_range_m, receiver_range_m, wavelength_m, gain : as for `bistatic_power_w`

    Returns
    -------
    ndarray : [m^2]
    """
    power = real_array("Received power", power_w, "W", minimum=0.0)
    eirp = real_array("EIRP", eirp_w, "W", above=0.0)
    unit = bistatic_power_w(eirp, 1.0, transmitter_range_m, receiver_range_m, wavelength_m, gain)
    return np.asarray(power / unit)


def lambert_plate_rcs_m2(albedo: ArrayLike, area_m2: ArrayLike, cos_incidence: ArrayLike) -> Real:
    """Return the monostatic cross section of a rough (Lambert) plate, 4 rho A cos^2(theta).

    Parameters
    ----------
    albedo, area_m2, cos_incidence : rho, A [m^2] and cos(theta)

    Returns
    -------
    ndarray : [m^2]
    """
    rho, area, cosine = reals(albedo, area_m2, cos_incidence)
    return np.asarray(4 * rho * area * cosine**2)


def lambert_radiance(
    albedo: ArrayLike, eirp_w: ArrayLike, range_m: ArrayLike, cos_incidence: ArrayLike = 1.0
) -> Real:
    """Return the radiance of a Lambert surface lit by a point transmitter.

    rho/pi * EIRP cos(theta) / (4 pi R^2).

    Parameters
    ----------
    albedo, eirp_w, range_m, cos_incidence : rho, EIRP [W], R [m] and cos(theta)

    Returns
    -------
    ndarray : [W/(m^2 sr)]
    """
    rho, eirp, distance, cosine = reals(albedo, eirp_w, range_m, cos_incidence)
    return rho / np.pi * (eirp * cosine / (4 * np.pi * distance**2))


# -- noise -----------------------------------------------------------------------------------------


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
    noise_figure_db : F in dB, 0 or more
    antenna_temperature_k : T_a [K]

    Returns
    -------
    ndarray : [W]
    """
    bandwidth = real_array("Noise bandwidth", bandwidth_hz, "Hz", above=0.0)
    factor = from_db(real_array("Noise figure", noise_figure_db, "dB", minimum=0.0))
    antenna = real_array("Antenna temperature", antenna_temperature_k, "K", minimum=0.0)
    temperature = antenna + (factor - 1) * REFERENCE_TEMPERATURE_K
    return np.asarray(BOLTZMANN_J_PER_K * temperature * bandwidth)


def complex_noise(
    rng: np.random.Generator, shape: tuple[int, ...], power_w: float
) -> NDArray[np.complex128]:
    """Return white complex Gaussian noise; the same seed gives the same noise.

    Parameters
    ----------
    rng, shape : source of random numbers, and shape of the result
    power_w : mean |x|^2 [W]

    Returns
    -------
    ndarray
    """
    scale = np.sqrt(float(real_array("Noise power", power_w, "W", minimum=0.0)) / 2)
    noise = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
    return np.asarray(scale * noise, dtype=np.complex128)


@dataclass(frozen=True)
class SnrPrediction:
    """Signal-to-noise ratios of one target [dB].

    Attributes
    ----------
    single_sample_db : one complex sample of the echo, before any processing
    single_pulse_db : peak of the compressed pulse: signal energy over noise density, P T / (k T_s)
    burst_db : peak of the range-Doppler map, all pulses added coherently, tapers included
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
    pulse_length_s, sampling_rate_hz : pulse width [s] and complex sampling rate [Hz]
    pulses : pulses added coherently
    noise_figure_db, antenna_temperature_k : as in `noise_power_w`
    window_loss_db
        SNR loss of the range and Doppler tapers together, 0 or more: see `window_loss_db()`.

    Returns
    -------
    SnrPrediction

    Raises
    ------
    ConfigError : pulses below 1; noise of zero
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
    window : weights, (N,)

    Returns
    -------
    float : [dB], 0 or more

    Raises
    ------
    ConfigError : the weights are no list, or their sum is zero
    """
    weights = real_array("Window", window)
    if weights.ndim != 1 or weights.size == 0 or weights.sum() == 0:
        raise ConfigError(
            f"Window has the shape {weights.shape} and the sum {weights.sum():g}; expected a list "
            "of weights with a sum other than zero."
        )
    return float(to_db(weights.size * np.sum(weights**2) / np.sum(weights) ** 2))
