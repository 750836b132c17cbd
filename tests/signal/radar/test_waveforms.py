# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of waveforms: their codes, what follows from their numbers, and their responses."""

import csv
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.physics.constants import SPEED_OF_LIGHT_MPS
from radarsim_addon.signal import (
    ArbitraryPulse,
    Burst,
    FmcwWaveform,
    PhaseCodedPulse,
    PmcwWaveform,
    Radar,
    SteppedWaveform,
    Waveform,
    expected_power_profile,
    make_paths,
    replica,
    synthesize,
    waveform_from_dict,
)
from radarsim_addon.signal.echoes import Receiver, apply_receiver
from radarsim_addon.signal.maps import range_process
from radarsim_addon.signal.radar import AnyWaveform
from radarsim_addon.signal.radar.waveforms import BARKER, barker, m_sequence
from tests.signal.oracle import unit_paths
from tests.signal.waveform_kinds import ALL, BARKER13, PMCW, STEPPED, burst_of

# -- codes -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("length", BARKER)
def test_barker_sidelobes_are_at_most_one(length: int) -> None:
    code = np.array(barker(length))
    assert code.size == length
    full = np.correlate(code, code, "full")
    assert full[length - 1] == length
    assert np.abs(np.delete(full, length - 1)).max() == 1


@pytest.mark.parametrize("degree", range(2, 17))
def test_m_sequence_has_periodic_autocorrelation_minus_one(degree: int) -> None:
    code = np.array(m_sequence(degree))
    assert code.size == 2**degree - 1
    periodic = np.fft.ifft(np.abs(np.fft.fft(code)) ** 2).real
    assert periodic[0] == pytest.approx(code.size, rel=1e-12)
    np.testing.assert_allclose(periodic[1:], -1, atol=1e-6)


# -- numbers ---------------------------------------------------------------------------------------


def automotive() -> list[dict[str, str]]:
    path = Path(__file__).parents[2] / "data" / "automotive_numbers.csv"
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


@pytest.mark.parametrize("row", automotive(), ids=lambda row: row["config"])
def test_fmcw_numbers_are_those_of_published_radars(row: dict[str, str]) -> None:
    carrier_hz = float(row["f_centre_of_ADC_window_GHz"]) * 1e9
    bandwidth_hz = float(row["B_adc_GHz"]) * 1e9
    cell_m = float(row["dR=c/2B_m"])
    max_m = float(row["Rmax_complex=fs*c/2S_m (half if real ADC)"])
    vmax, dv = (
        float(row[key]) for key in ("vmax=lam/(4*Ntx*Tc)_mps", "dv=lam/(2*Nchirp*Ntx*Tc)_mps")
    )
    samples, chirps = round(max_m / cell_m), round(2 * vmax / dv)
    # all transmitters in turn: one of them repeats after Ntx chirps
    interval_s = SPEED_OF_LIGHT_MPS / carrier_hz / (4 * vmax)
    rate_hz = samples / (0.8 * interval_s / 12)
    for real in (False, True):
        waveform = FmcwWaveform(carrier_hz, bandwidth_hz, samples, rate_hz, real_adc=real)
        radar = Radar(waveform, Burst(1 / interval_s, chirps))
        assert waveform.range_resolution_m == pytest.approx(cell_m, rel=5e-6)
        assert waveform.sample_spacing_m == pytest.approx(cell_m, rel=5e-6)
        expected_m = max_m / 2 if real else max_m
        assert waveform.unambiguous_range_m == pytest.approx(expected_m, rel=5e-6)
        assert radar.max_unambiguous_velocity_mps == pytest.approx(vmax, rel=5e-6)
        assert radar.velocity_resolution_mps == pytest.approx(dv, rel=5e-6)


@pytest.mark.parametrize(
    "make",
    [
        lambda f: Waveform(f, 50e6, 2.5e-6, 60e6),
        lambda f: PhaseCodedPulse(f, 20e-9, 13, 2),
        lambda f: ArbitraryPulse(f, 60e6, np.ones(9, dtype=complex), band_hz=50e6),
        lambda f: FmcwWaveform(f, 50e6, 64, 1e6),
        lambda f: SteppedWaveform(f, 1e6, 50, 1e-6),
        lambda f: PmcwWaveform(f, 20e-9, 5),
    ],
    ids=["lfm", "barker", "arbitrary", "fmcw", "stepped", "pmcw"],
)
def test_a_band_reaches_no_lower_than_zero(make: Callable[[float], AnyWaveform]) -> None:
    """50 MHz of bandwidth: 25.1 MHz is a carrier, 24.9 MHz is none."""
    assert make(25.1e6).bandwidth_hz == pytest.approx(50e6)
    with pytest.raises(ConfigError, match="not above half the bandwidth"):
        make(24.9e6)


def test_stepped_and_pmcw_ranges() -> None:
    assert STEPPED.unambiguous_range_m == pytest.approx(SPEED_OF_LIGHT_MPS / 4e6)
    assert STEPPED.range_resolution_m == pytest.approx(SPEED_OF_LIGHT_MPS / (2 * 256e6))
    assert PMCW.unambiguous_range_m == pytest.approx(SPEED_OF_LIGHT_MPS * 255e-9 / 2)
    assert Radar(PMCW, Burst(1 / PMCW.duration_s, 4)).unambiguous_range_m < 40


# -- stepped frequency, codes, samples -------------------------------------------------------------


def test_stepped_frequency_repeats_after_c_over_two_steps() -> None:
    radar = burst_of(STEPPED, 1)
    period_m = SPEED_OF_LIGHT_MPS / (2 * STEPPED.step_hz)
    range_limits_m = (0.0, period_m)
    near = range_process(
        synthesize(unit_paths(radar, [12.0]), radar, range_limits_m=range_limits_m), "none"
    )
    far = range_process(
        synthesize(unit_paths(radar, [12.0 + period_m]), radar, range_limits_m=range_limits_m),
        "none",
    )
    np.testing.assert_allclose(np.abs(far.plane), np.abs(near.plane), atol=1e-6)
    assert near.range_m[-1] < period_m


def test_stepped_samples_are_taken_in_the_middle_of_their_steps() -> None:
    """Tone k of pulse m is received at m/PRF + (k + 1/2) T, by hand; half the delay before it met
    the target of 40 m/s.
    """
    waveform = SteppedWaveform(5.3e9, 1e6, 8, 25e-6)
    echoes = synthesize(
        make_paths(4 * math.pi / waveform.wavelength_m**2, 2 * 50.0, 40.0),
        Radar(waveform, Burst(1000.0, 3)), range_limits_m=(0.0, 100.0), tolerance=1e-9,
    )  # fmt: skip
    tone, pulse = np.arange(8), np.arange(3)[:, None]
    received_m = 2 * (50.0 + 40.0 * (pulse * 1e-3 + (tone + 0.5) * 25e-6))
    length_m = received_m / (1 + 40.0 / SPEED_OF_LIGHT_MPS)  # c tau = l(t - tau / 2)
    want = np.exp(-2j * np.pi * (5.3e9 + (tone - 3.5) * 1e6) * length_m / SPEED_OF_LIGHT_MPS)
    np.testing.assert_allclose(echoes.plane, want, atol=1e-7)


def test_pmcw_sidelobes_are_minus_one_nth() -> None:
    radar = burst_of(PMCW, 2)
    cell_m = PMCW.sample_spacing_m
    echoes = synthesize(unit_paths(radar, [40 * cell_m]), radar, range_limits_m=(0.0, 38.0))
    assert echoes.plane.shape == (8, 255), "one row a code"
    code = np.roll(np.array(m_sequence(8)), 40)
    carrier = np.exp(-4j * np.pi * 40 * cell_m / PMCW.wavelength_m)
    np.testing.assert_allclose(echoes.plane[0], code * carrier, atol=1e-6)
    profile = range_process(echoes, "hamming", 1)
    assert profile.range_taper == "none", "a code's sidelobes are its own"
    assert profile.plane.shape == (2, 254)
    values = profile.plane[0] / carrier
    assert values[40] == pytest.approx(1, abs=1e-6)
    np.testing.assert_allclose(np.delete(values, 40), -1 / 255, atol=1e-6)


def test_pmcw_loses_what_doppler_turns_during_the_repeats() -> None:
    waveform = PmcwWaveform(79e9, 1e-9, 10, code_repeats=64)
    radar = burst_of(waveform, 16)
    rate_mps = 0.35 * 2 * radar.max_unambiguous_velocity_mps
    echoes = synthesize(unit_paths(radar, [20.0], [rate_mps]), radar, range_limits_m=(0.0, 50.0))
    peak = np.abs(range_process(echoes, oversample=8).plane).max(axis=1)
    turn = 0.35  # cycles from pulse to pulse
    expected = abs(np.sin(np.pi * turn) / (64 * np.sin(np.pi * turn / 64)))
    # a sixteenth of a cell off the raster: 0.6 %
    np.testing.assert_allclose(peak, expected, rtol=8e-3)


def test_barker_pulse_has_sidelobes_of_one_thirteenth() -> None:
    radar = Radar(BARKER13, Burst(1000.0, 1))
    cell_m = BARKER13.sample_spacing_m
    range_m = 300.0
    echoes = synthesize(unit_paths(radar, [range_m]), radar, range_limits_m=(100.0, 500.0))
    profile = range_process(echoes, "hamming", 1)
    assert profile.range_taper == "none"
    # at lags of whole chips, on the samples: shift the path onto one
    range_m = 100.0 + 100 * cell_m
    profile = range_process(
        synthesize(unit_paths(radar, [range_m]), radar, range_limits_m=(100.0, 500.0)), "none", 1
    )
    magnitude = np.abs(profile.plane[0])
    assert magnitude[100] == pytest.approx(1, abs=1e-6)
    lags = np.arange(1, 13) * BARKER13.samples_per_chip
    expected = [0, 1 / 13] * 6
    np.testing.assert_allclose(magnitude[100 + lags], expected, atol=1e-6)
    np.testing.assert_allclose(magnitude[100 - lags], expected, atol=1e-6)


def test_samples_of_a_chirp_give_what_the_chirp_gives(tmp_path: Path) -> None:
    chirp = Waveform(5.3e9, 50e6, 2.5e-6, 60e6)
    np.save(tmp_path / "chirp.npy", 3 * replica(chirp))
    given = {
        "kind": "arbitrary", "carrier_hz": 5.3e9, "sampling_rate_hz": 60e6, "band_hz": 50e6,
        "file": "chirp.npy",
    }  # fmt: skip
    copy = waveform_from_dict(given, tmp_path)
    results = []
    for waveform in (chirp, copy):
        radar = Radar(waveform, Burst(1000.0, 2))
        echoes = synthesize(
            unit_paths(radar, [700.0], [20.0]), radar, range_limits_m=(500.0, 900.0)
        )
        results.append((echoes.plane, range_process(echoes, "taylor:4:-35").plane))
    np.testing.assert_allclose(results[1][0], results[0][0], atol=1e-12)
    np.testing.assert_allclose(results[1][1], results[0][1], atol=1e-12)


@pytest.mark.parametrize("waveform", ALL, ids=lambda w: w.kind)
@pytest.mark.parametrize("window", ["none", "hann", "taylor:4:-35"])
def test_a_path_of_power_p_peaks_at_p(waveform: AnyWaveform, window: str) -> None:
    radar = burst_of(waveform, 2)
    top_m = min(waveform.unambiguous_range_m, 1500.0)
    range_m = round(0.3 * top_m / waveform.sample_spacing_m) * waveform.sample_spacing_m
    power = 3.7e-9
    paths = make_paths(power * 4 * math.pi / waveform.wavelength_m**2, 2 * range_m)
    found = range_process(synthesize(paths, radar, range_limits_m=(0.0, top_m)), window, 2)
    column = round(range_m / (waveform.sample_spacing_m / 2))
    assert np.abs(found.plane[0, column]) ** 2 == pytest.approx(power, rel=1e-6)
    assert int(np.argmax(np.abs(found.plane[0]))) == column
    profile = expected_power_profile(paths, radar, range_limits_m=(0.0, top_m), range_taper=window)
    np.testing.assert_allclose(
        profile.power[:: 2], np.abs(found.plane[0, : -(-profile.power.size // 2)]) ** 2,
        atol=2e-5 * power,
    )  # fmt: skip


def test_a_real_adc_shows_the_whole_power() -> None:
    """It records half of the amplitude at the beat, and the image beyond its range."""
    waveform = FmcwWaveform(77e9, 1e9, 512, 20e6, real_adc=True)
    radar, range_m, power = Radar(waveform, Burst(5000.0, 4)), 80 * waveform.sample_spacing_m, 2e-9
    paths = make_paths(power * 4 * math.pi / waveform.wavelength_m**2, 2 * range_m)
    limits_m = (0.0, waveform.unambiguous_range_m)
    recorded = apply_receiver(synthesize(paths, radar, range_limits_m=limits_m), Receiver()).echoes
    assert np.mean(np.abs(recorded.plane) ** 2) == pytest.approx(power / 2, rel=1e-2)
    assert not recorded.plane.imag.any()
    found = np.abs(range_process(recorded, "hann", 1).plane) ** 2
    assert found[0, 80] == pytest.approx(power, rel=1e-4)
    assert found.max() == found[:, 80].max()
