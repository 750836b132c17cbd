# SPDX-License-Identifier: GPL-3.0-or-later
"""Thermal noise, ADC and phase noise against closed forms."""

import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.physics.constants import SPEED_OF_LIGHT_MPS
from radarsim_addon.signal import (
    Burst,
    Echoes,
    FmcwWaveform,
    PhaseCodedPulse,
    PhaseNoise,
    PmcwWaveform,
    Radar,
    Receiver,
    SteppedWaveform,
    Waveform,
    apply_receiver,
    load_phase_noise,
    make_paths,
    range_doppler,
)
from radarsim_addon.signal.echoes import EchoOptions, synthesizer_for
from radarsim_addon.signal.echoes.receiver import PhaseTrack, quantise
from radarsim_addon.signal.maps import map_noise_gain, range_process
from radarsim_addon.signal.radar import AnyWaveform
from tests.signal.oracle import unit_paths

BOLTZMANN = 1.380649e-23
#: Loss of the Hamming window, tests/data/sar_window_metrics.csv [dB].
HAMMING_DB = 1.3459

LFM = Waveform(5.3e9, 50e6, 20e-6, 50e6)
KINDS: list[tuple[AnyWaveform, float]] = [
    # waveform, coherent integration of one pulse in seconds
    (LFM, 20e-6),
    (PhaseCodedPulse(5.3e9, 50e-9, 13, 2), 650e-9),
    (FmcwWaveform(77e9, 1e9, 512, 20e6), 25.6e-6),
    (FmcwWaveform(77e9, 1e9, 512, 20e6, real_adc=True), 12.8e-6),
    (SteppedWaveform(10e9, 2e6, 256, 10e-6), 2.56e-3),
    (PmcwWaveform(79e9, 1e-9, 9, code_repeats=8), 8 * 511e-9),
]
NAMES = ["lfm", "barker", "fmcw", "fmcw real", "stepped", "pmcw"]


def residual_density(noise: PhaseNoise, range_m: float, offset_hz: np.ndarray) -> np.ndarray:
    """Density of the phase that is left of an echo: L(f) 4 sin^2(pi f tau) [rad^2/Hz]."""
    delay_s = 2 * range_m / SPEED_OF_LIGHT_MPS
    return noise.density(offset_hz) * 4 * np.sin(np.pi * offset_hz * delay_s) ** 2


def empty_echoes(waveform: AnyWaveform, pulses: int) -> Echoes:
    radar = Radar(waveform, Burst(1 / waveform.duration_s, pulses))
    range_limits_m = (0.0, min(3000.0, waveform.unambiguous_range_m))
    return synthesizer_for(radar, range_limits_m).result()


@pytest.mark.parametrize(("waveform", "integration_s"), KINDS, ids=NAMES)
@pytest.mark.parametrize("window", ["none", "hamming"])
def test_floor_of_the_map_is_ktf_over_the_integration_time(
    waveform: AnyWaveform, integration_s: float, window: str
) -> None:
    """k T0 F / (T M), worse by the loss of each window that is used."""
    pulses = 64
    received = apply_receiver(
        empty_echoes(waveform, pulses), Receiver(noise_figure_db=6.0, noise_seed=3)
    )
    rd_map = range_doppler(range_process(received.echoes, window, 1), window)
    density = BOLTZMANN * 290 * 10**0.6
    assert received.noise_power_w == pytest.approx(density * waveform.sampling_rate_hz, rel=1e-9)
    # sampled at mid-share, a window over 64 pulses loses slightly more than the continuous one
    windows = (rd_map.range_taper == "hamming") + (rd_map.doppler_taper == "hamming")
    expected = density / (integration_s * pulses) * 10 ** (windows * HAMMING_DB / 10)
    cells = rd_map.plane_power.size / (1.36**windows)  # as many independent ones
    # 4 standard errors, and what the closed form leaves out: ripple of the chirp's spectrum
    slack = 4 / math.sqrt(cells) + (0.01 if waveform is LFM else 0.001) + 0.003 * windows
    assert rd_map.plane_power.mean() == pytest.approx(expected, rel=slack)
    predicted = received.noise_power_w * map_noise_gain(received.echoes.radar, window, window)
    assert rd_map.plane_power.mean() == pytest.approx(predicted, rel=4 / math.sqrt(cells))


@pytest.mark.parametrize(("waveform", "integration_s"), KINDS, ids=NAMES)
def test_processing_gain_is_samples_times_pulses(
    waveform: AnyWaveform, integration_s: float
) -> None:
    radar = Radar(waveform, Burst(1 / waveform.duration_s, 32))
    samples = integration_s * waveform.sampling_rate_hz
    ideal = 1 / (samples * 32)
    assert map_noise_gain(radar, "none", "none") == pytest.approx(
        ideal, rel=0.01 if waveform is LFM else 1e-9
    )


def test_target_in_noise_has_the_snr_of_the_radar_equation() -> None:
    """Peak over floor, averaged over seeds: P T M / (k T0 F)."""
    radar = Radar(LFM, Burst(1000.0, 32))
    range_m = 1200 * LFM.sample_spacing_m / 3
    power_w = 1e-15
    paths = make_paths(power_w * 4 * math.pi / LFM.wavelength_m**2, 2 * range_m)
    synthesizer = synthesizer_for(radar, (0.0, 3000.0))
    synthesizer.add(paths)
    echoes = synthesizer.result()
    ratios = []
    for seed in range(12):
        received = apply_receiver(echoes, Receiver(noise_figure_db=3.0, noise_seed=seed))
        power = range_doppler(range_process(received.echoes, "none", 1), "none").plane_power
        column = round(range_m / LFM.sample_spacing_m)
        floor = np.median(power) / math.log(2)
        ratios.append(power[16, column] / floor)
    snr = power_w * 20e-6 * 32 / (BOLTZMANN * 290 * 10**0.3)
    # |s + n|^2 has the mean S + N and the spread sqrt(2 S N)
    slack = 4 * math.sqrt(2 / snr / 12) + 0.02
    assert np.mean(ratios) == pytest.approx(snr + 1, rel=slack)
    assert 15 < 10 * math.log10(snr) < 60


def test_noise_is_the_seeds_and_off_unless_asked_for() -> None:
    echoes = empty_echoes(LFM, 2)
    assert apply_receiver(echoes).echoes is echoes
    first, again, other = (
        apply_receiver(echoes, Receiver(noise_figure_db=0.0, noise_seed=s)).echoes.plane
        for s in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert (first != other).all()


def test_noise_needs_watts() -> None:
    radar = Radar(LFM, Burst(1000.0, 2))
    echoes = synthesizer_for(radar, (0.0, 100.0), EchoOptions(amplitude_model="paper")).result()
    with pytest.raises(ConfigError, match="'radar-equation'"):
        apply_receiver(echoes, Receiver(noise_figure_db=3.0))


# -- ADC -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bits", [4, 8, 12, 16])
def test_quantised_sine_has_the_snr_of_its_bits(bits: int) -> None:
    """6.02 b + 1.76 dB for a sine of full scale (Bennett 1948)."""
    sine = np.sin(2 * np.pi * np.sqrt(2) * np.arange(200_000) / 7) * (1 - 2.0 ** (1 - bits))
    rounded, scale, clipped = quantise(sine, bits, 1.0)
    assert (scale, clipped) == (1.0, 0)
    assert np.unique(rounded).size <= 2**bits
    snr_db = 10 * np.log10(np.mean(sine**2) / np.mean((rounded - sine) ** 2))
    full_db = 6.02 * bits + 1.76 + 20 * math.log10(1 - 2.0 ** (1 - bits))
    assert snr_db == pytest.approx(full_db, abs=0.6 if bits < 8 else 0.1)


def test_clipping_is_counted() -> None:
    rounded, _, clipped = quantise(np.array([-2.0, -1.0, -0.26, 0.0, 0.9, 1.0]), 3, 1.0)
    np.testing.assert_array_equal(rounded, [-1, -1, -0.25, 0, 0.75, 0.75])
    assert clipped == 3  # -2, and what rounds to +1, which has no code


def test_automatic_full_scale_clips_nothing() -> None:
    values = np.random.default_rng(0).standard_normal(1000) * 3e-9
    rounded, scale, clipped = quantise(values, 10)
    assert clipped == 0
    assert np.abs(rounded - values).max() <= scale / 2**10 * (1 + 1e-12)
    assert np.abs(rounded).max() == pytest.approx(np.abs(values).max(), rel=1e-12)


def test_one_bit_is_the_sign() -> None:
    rounded, _, _ = quantise(np.array([-0.1, 0.3]), 1, 1.0)
    np.testing.assert_array_equal(rounded, [-0.5, 0.5])


def test_a_real_adc_delivers_real_samples() -> None:
    waveform = FmcwWaveform(77e9, 1e9, 64, 20e6, real_adc=True)
    echoes = empty_echoes(waveform, 4)
    received = apply_receiver(echoes, Receiver(noise_figure_db=0.0, adc_bits=8))
    assert not received.echoes.plane.imag.any()
    assert received.echoes.plane.real.any()


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"noise_figure_db": -1.0}, "Noise figure"),
        ({"adc_bits": 0}, "ADC bits"),
        ({"adc_bits": 40}, "ADC bits"),
        ({"adc_full_scale": 1.0}, "without a number of bits"),
        ({"adc_bits": 8, "adc_full_scale": 0.0}, "full scale is 0"),
        ({"noise_seed": -1}, "Noise seed is -1"),
    ],
)
def test_receivers_that_do_not_fit(numbers: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Receiver(**numbers)


# -- phase noise -----------------------------------------------------------------------------------


def test_phase_track_has_the_tables_spectrum() -> None:
    noise = PhaseNoise((1e3, 1e5, 1e6), (-60.0, -90.0, -100.0))
    power = np.zeros(4097)
    for seed in range(60):
        phase = PhaseTrack(noise, 4e6, 8192, seed).at()
        power += np.abs(np.fft.rfft(phase)) ** 2 / (8192 * 4e6) / 60
    f = np.fft.rfftfreq(8192, 1 / 4e6)
    for low, high in ((2e3, 4e3), (5e4, 7e4), (2e5, 3e5), (8e5, 9.9e5)):
        here = (f > low) & (f < high)
        slack = 4 / math.sqrt(60 * here.sum())
        assert np.mean(power[here] / noise.density(f[here])) == pytest.approx(1, abs=slack)
    assert power[f > 1.01e6].max() < 1e-6 * power.max(), "nothing beyond the table"
    assert noise.density(np.array([1e4]))[0] == pytest.approx(10**-7.5)


def test_phase_track_can_be_read_later() -> None:
    track = PhaseTrack(PhaseNoise((1e4, 1e5), (-60.0, -60.0)), 1e6, 4096, 0)
    np.testing.assert_allclose(track.at(5e-6)[:-5], track.at()[5:], atol=1e-12)


@pytest.mark.parametrize("range_m", [3.0, 30.0, 120.0])
def test_dechirped_echo_keeps_what_range_correlation_leaves(range_m: float) -> None:
    """Pedestal of the beat's spectrum: L(f) 4 sin^2(pi f tau)."""
    waveform = FmcwWaveform(77e9, 0.5e9, 1024, 20e6)
    radar = Radar(waveform, Burst(1 / waveform.duration_s, 128))
    noise = PhaseNoise((0.4e6, 4e6), (-100.0, -100.0))
    clean = synthesizer_for(radar, (0.0, 150.0))
    clean.add(unit_paths(radar, [range_m]))
    f = np.fft.fftfreq(1024, 1 / 20e6)
    window = np.hanning(1024)
    power = np.zeros(1024)
    seeds = 5
    for seed in range(seeds):
        synthesizer = synthesizer_for(radar, (0.0, 150.0), phase_noise=noise, phase_noise_seed=seed)
        synthesizer.add(unit_paths(radar, [range_m]))
        rest = synthesizer.result().plane * np.conj(clean.result().plane) - 1
        power += np.mean(np.abs(np.fft.fft(rest * window)) ** 2, axis=0) / seeds
    power /= window @ window * 20e6
    for low, high in ((0.5e6, 0.8e6), (1.2e6, 1.6e6), (3e6, 3.5e6)):
        here = (np.abs(f) > low) & (np.abs(f) < high)
        expected = residual_density(noise, range_m, f[here]).mean()
        # both sidebands of a small phase are one another's mirror, and the window joins bins
        slack = 4 / math.sqrt(seeds * 128 * here.sum() / 4) + 0.02
        assert power[here].mean() == pytest.approx(expected, rel=slack)


@pytest.mark.parametrize("range_m", [15.0, 60.0, 450.0])
def test_steps_fold_what_is_faster_than_they_are(range_m: float) -> None:
    """White pedestal to 20 times half the step rate, against averages over steps of a fine phase
    and against sum L(f) 4 sin^2(pi f tau) sinc^2(f T) over the frequencies that fold together.
    """
    step_s, steps, pulses, fine = 2e-6, 128, 64, 200
    waveform = SteppedWaveform(5.3e9, 20e3, steps, step_s)
    radar = Radar(waveform, Burst(1 / waveform.duration_s, pulses))
    noise = PhaseNoise((1e3, 5e6), (-100.0, -100.0))
    echo = []
    for settings in ({}, {"phase_noise": noise, "phase_noise_seed": 4}):
        synthesizer = synthesizer_for(radar, (0.0, 1000.0), **settings)
        synthesizer.add(unit_paths(radar, [range_m]))
        echo.append(synthesizer.result().plane)
    rest = echo[1] * np.conj(echo[0]) - 1

    rng = np.random.default_rng(8)
    rate_hz, size = fine / step_s, fine * steps * pulses
    spectrum = np.fft.rfft(rng.normal(0, math.sqrt(1e-10 * rate_hz), size))
    spectrum[np.fft.rfftfreq(size, 1 / rate_hz) > 5e6] = 0
    phase = np.fft.irfft(spectrum, size)
    delay = round(2 * range_m / SPEED_OF_LIGHT_MPS * rate_hz)
    apart = np.exp(1j * (np.roll(phase, delay) - phase))
    direct = apart.reshape(pulses, steps, fine).mean(axis=-1) - 1

    f = np.fft.fftfreq(steps, step_s)[:, None] + np.arange(-10, 11) / step_s
    folded = np.sum(residual_density(noise, range_m, f) * np.sinc(f * step_s) ** 2, axis=1)
    window = np.hanning(steps)
    for low_hz, high_hz in ((3e4, 1.2e5), (1.3e5, 2.3e5)):
        here = (np.abs(f[:, 10]) > low_hz) & (np.abs(f[:, 10]) < high_hz)
        found, simulated = (
            np.mean(np.abs(np.fft.fft(values * window)[:, here]) ** 2) * step_s / (window @ window)
            for values in (rest, direct)
        )
        slack = 4 / math.sqrt(pulses * here.sum() / 4)
        assert found == pytest.approx(folded[here].mean(), rel=slack)
        assert found == pytest.approx(simulated, rel=1.5 * slack)


@pytest.mark.parametrize("level_dbc_hz", [-78.0, -72.0])
def test_phase_that_is_large_within_a_step_is_named(level_dbc_hz: float) -> None:
    """By how much the average of the phase keeps more of an echo than that of the wave."""
    step_s, steps, fine, last_hz = 2e-6, 4096, 200, 5e6
    rng = np.random.default_rng(6)
    rate_hz, size = fine / step_s, fine * steps
    density = 10 ** (level_dbc_hz / 10)
    spectrum = np.fft.rfft(rng.normal(0, math.sqrt(density * rate_hz), size))
    spectrum[np.fft.rfftfreq(size, 1 / rate_hz) > last_hz] = 0
    phase = np.fft.irfft(spectrum, size)
    apart = (np.roll(phase, 50 * fine) - phase).reshape(steps, fine)
    wave, averaged = np.exp(1j * apart).mean(), np.exp(1j * apart.mean(axis=1)).mean()
    excess_db = 20 * math.log10(abs(averaged) / abs(wave))

    radar = Radar(SteppedWaveform(5.3e9, 20e3, 64, step_s), Burst(1000.0, 4))
    noise = PhaseNoise((1.0, last_hz), (level_dbc_hz, level_dbc_hz))
    synthesizer = synthesizer_for(radar, (0.0, 1000.0), phase_noise=noise)
    synthesizer.add(unit_paths(radar, [100.0]))
    found = apply_receiver(synthesizer.result(), Receiver(phase_noise=noise)).findings
    assert [item.code for item in found] == ["phase-noise-within-steps"]
    assert found[0].numbers["loss_db"] == pytest.approx(excess_db, rel=0.05)
    quiet = PhaseNoise((1.0, last_hz), (level_dbc_hz - 20, level_dbc_hz - 20))
    assert not apply_receiver(synthesizer.result(), Receiver(phase_noise=quiet)).findings


@pytest.mark.parametrize(
    "waveform",
    [
        Waveform(5.3e9, 5e6, 2e-6, 10e6),
        PmcwWaveform(5.3e9, 1e-7, 8),
        SteppedWaveform(5.3e9, 20e3, 16, 1e-6),
    ],
    ids=lambda w: w.kind,
)
def test_phase_of_a_far_echo_has_the_closed_forms_spread(waveform: AnyWaveform) -> None:
    """Slow fluctuations turn the whole pulse: variance 2 int L(f) 4 sin^2(pi f tau) df."""
    noise = PhaseNoise((300.0, 2e3), (-50.0, -50.0))
    range_m = 3000.0
    radar = Radar(waveform, Burst(4e3, 256))
    range_limits_m = (2500.0, 3500.0)
    found = []
    for seed in range(6):
        receiver = Receiver(phase_noise=noise, noise_seed=seed)
        synthesizer = synthesizer_for(
            radar, range_limits_m, phase_noise=noise, phase_noise_seed=receiver.phase_noise_seed
        )
        synthesizer.add(unit_paths(radar, [range_m]))
        values = range_process(
            apply_receiver(synthesizer.result(), receiver).echoes, "none", 8
        ).plane
        column = int(np.argmax(np.abs(values).mean(axis=0)))
        found.append(np.var(np.angle(values[:, column] / values[:, column].mean())))
    f = np.linspace(300, 2e3, 2001)
    expected = 2 * residual_density(noise, range_m, f).mean() * (f[-1] - f[0])
    assert np.mean(found) == pytest.approx(expected, rel=0.15)


def test_phase_noise_from_a_table(tmp_path: Path) -> None:
    file = tmp_path / "oscillator.csv"
    file.write_text("# synthesiser\noffset_hz,level_dbc_hz\n1e3,-80\n1e6,-110\n")
    assert load_phase_noise(file) == PhaseNoise((1e3, 1e6), (-80.0, -110.0))
    file.write_text("offset_hz,level_dbc_hz\n1e3,-80\n1e3,-110\n")
    with pytest.raises(ConfigError, match="rising"):
        load_phase_noise(file)
    with pytest.raises(ConfigError, match="does not exist"):
        load_phase_noise(tmp_path / "none.csv")
    with pytest.raises(ConfigError, match="below 0"):
        PhaseNoise((1.0, 2.0), (3.0, -10.0))
