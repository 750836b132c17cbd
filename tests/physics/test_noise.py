# SPDX-License-Identifier: GPL-3.0-or-later
"""kTBF, the bistatic radar equation, and predicted SNR against a simulated matched filter."""

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.physics import radar_equation
from radarsim_addon.physics import radar_equation as eq


def test_thermal_noise_in_one_hertz() -> None:
    """-173.975 dBm/Hz at 290 K, the textbook's -174."""
    assert 10 * np.log10(float(radar_equation.noise_power_w(1.0)) / 1e-3) == pytest.approx(
        -173.9752, abs=1e-4
    )


def test_noise_figure_and_antenna_temperature() -> None:
    room = radar_equation.noise_power_w(50e6, 3.0)
    assert float(room / radar_equation.noise_power_w(50e6)) == pytest.approx(10**0.3, rel=1e-12)
    # 3 dB receiver under a cold sky: 30 K + 0.99526 * 290 K.
    cold = radar_equation.noise_power_w(1.0, 3.0, 30.0)
    assert float(cold) / 1.380649e-23 == pytest.approx(30 + (10**0.3 - 1) * 290, rel=1e-12)


def test_snr_of_a_simulated_burst_is_the_predicted_one() -> None:
    """Chirp in white noise, matched filter, coherent sum of pulses: peak over noise power."""
    rate, length, pulses, power = 60e6, 2.5e-6, 16, 3e-13
    figure_db = 4.0
    samples = round(rate * length)
    time = (np.arange(samples) - samples / 2) / rate
    chirp = np.exp(1j * np.pi * 50e6 / length * time**2)
    noise_power = float(radar_equation.noise_power_w(rate, figure_db))
    prediction = radar_equation.predict_snr(power, length, rate, pulses, figure_db)
    assert prediction.single_sample_db == pytest.approx(10 * np.log10(power / noise_power))

    rng = np.random.default_rng(3)
    draws = radar_equation.complex_noise(rng, (1500, pulses, samples), noise_power)
    filtered = draws @ np.conj(chirp)
    signal = np.sqrt(power) * np.sum(np.abs(chirp) ** 2)
    single = signal**2 / np.mean(np.abs(filtered) ** 2)
    # 24000 draws: standard error 0.65 %, 0.03 dB.
    assert 10 * np.log10(single) == pytest.approx(prediction.single_pulse_db, abs=0.15)
    burst = (pulses * signal) ** 2 / np.mean(np.abs(filtered.sum(axis=1)) ** 2)
    # 1500 draws: 2.6 %, 0.11 dB.
    assert 10 * np.log10(burst) == pytest.approx(prediction.burst_db, abs=0.5)


def test_snr_does_not_depend_on_the_sampling_rate() -> None:
    slow, fast = (
        radar_equation.predict_snr(1e-12, 2.5e-6, rate, 128, 4.0) for rate in (60e6, 600e6)
    )
    assert slow.burst_db == pytest.approx(fast.burst_db, abs=1e-12)
    assert slow.single_sample_db - fast.single_sample_db == pytest.approx(10)
    assert slow.burst_db - slow.single_pulse_db == pytest.approx(10 * np.log10(128))
    tapered = radar_equation.predict_snr(1e-12, 2.5e-6, 60e6, 128, 4.0, window_loss_db=2.7)
    assert tapered.burst_db == pytest.approx(slow.burst_db - 2.7)


def test_window_loss_closed_forms() -> None:
    """Rectangular 0 dB; Hann N sum w^2/(sum w)^2 -> 1.5; Hamming -> 1.3628 (Harris 1978)."""
    count = 4096
    n = np.arange(count) / count
    assert radar_equation.window_loss_db(np.ones(7)) == pytest.approx(0, abs=1e-14)
    hann = 0.5 - 0.5 * np.cos(2 * np.pi * n)
    assert radar_equation.window_loss_db(hann) == pytest.approx(10 * np.log10(1.5), abs=1e-9)
    hamming = 0.54 - 0.46 * np.cos(2 * np.pi * n)
    expected = (0.54**2 + 0.46**2 / 2) / 0.54**2
    assert radar_equation.window_loss_db(hamming) == pytest.approx(
        10 * np.log10(expected), abs=1e-9
    )


def test_complex_noise_is_reproducible_and_of_the_power_asked() -> None:
    first, second = (
        radar_equation.complex_noise(np.random.default_rng(7), (200_000,), 2e-12) for _ in range(2)
    )
    np.testing.assert_array_equal(first, second)
    assert np.mean(np.abs(first) ** 2) == pytest.approx(2e-12, rel=0.015)
    assert abs(np.mean(first**2)) < 0.02 * 2e-12  # circular


def test_bistatic_with_equal_ranges_is_monostatic() -> None:
    mono = eq.monostatic_power_w(12.0, 3.0, 1e3, 0.0566, 100.0)
    assert float(eq.bistatic_power_w(12.0, 3.0, 1e3, 1e3, 0.0566, 100.0)) == pytest.approx(
        float(mono), rel=1e-14
    )
    lossy = eq.bistatic_power_w(12.0, 3.0, 1e3, 1e3, 0.0566, 100.0, loss_db=3.0)
    assert float(mono / lossy) == pytest.approx(10**0.3, rel=1e-12)


def test_bistatic_power_by_hand() -> None:
    """1 kW, 20 dB, 0.1 m, 10 m^2, 2 km there and 5 km back, 6 dB of losses: -125.9 dBW."""
    power = eq.bistatic_power_w(1e3, 10.0, 2e3, 5e3, 0.1, 100.0, loss_db=6.0)
    by_hand_db = 30 + 20 - 20 + 10 - 30 * np.log10(4 * np.pi) - 66.0206 - 73.9794 - 6
    assert float(eq.to_db(power)) == pytest.approx(by_hand_db, abs=1e-4)


def test_rcs_from_power_inverts_the_radar_equation() -> None:
    rcs = np.array([1e-6, 1.0, 1e6])
    power = eq.bistatic_power_w(5.0, rcs, 2e3, 700.0, 0.004, 30.0)
    np.testing.assert_allclose(
        eq.rcs_from_power_m2(power, 5.0, 2e3, 700.0, 0.004, 30.0), rcs, rtol=1e-13
    )


def test_decibels() -> None:
    assert float(eq.to_db(100.0)) == 20
    assert float(eq.to_db(0.0)) == -np.inf
    np.testing.assert_allclose(eq.from_db(eq.to_db([1e-30, 1.0, 1e30])), [1e-30, 1, 1e30])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: radar_equation.noise_power_w(0.0), "Noise bandwidth is 0 Hz"),
        (lambda: radar_equation.noise_power_w(1.0, -1.0), "Noise figure is -1 dB"),
        (lambda: radar_equation.noise_power_w(np.nan), "Noise bandwidth holds nan"),
        (lambda: radar_equation.predict_snr(1.0, 1e-6, 1e6, 0), "Number of pulses is 0"),
        (lambda: radar_equation.predict_snr(1.0, 1e-6, 1e6, 1, 0.0, 0.0), "Noise power is zero"),
        (
            lambda: radar_equation.predict_snr(1.0, 1e-6, 1e6, window_loss_db=-1.0),
            "Window loss is -1 dB",
        ),
        (lambda: radar_equation.window_loss_db([1.0, -1.0]), "sum other than zero"),
        (lambda: eq.bistatic_power_w(1.0, 1.0, 0.0, 1.0, 0.05), "Transmitter range is 0 m"),
        (lambda: eq.to_db(-1.0), "Power ratio"),
    ],
)
def test_bad_input(call, message) -> None:
    with pytest.raises(ConfigError, match=message):
        call()
