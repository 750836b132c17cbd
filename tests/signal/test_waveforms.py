# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of waveforms: what follows from their numbers, their responses, and their files."""

import csv
import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError, FrameFileError
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
    compress,
    expected_power_profile,
    load_radar,
    make_paths,
    range_doppler,
    replica,
    synthesize,
    waveform_from_dict,
    waveform_to_dict,
)
from radarsim_addon.signal.codes import BARKER, barker, m_sequence
from radarsim_addon.signal.config import AnyWaveform
from radarsim_addon.signal.linesynthesis import line_times_s
from radarsim_addon.signal.pathmotion import LinearMotion, Rows
from radarsim_addon.signal.waveform_files import load_samples
from tests.signal.oracle import unit_paths

FMCW = FmcwWaveform(77e9, 1e9, 256, 10e6, adc_start_s=5e-6, idle_s=4e-6)
STEPPED = SteppedWaveform(10e9, 2e6, 128, 50e-6)
PMCW = PmcwWaveform(79e9, 1e-9, 8, repeats=4)
BARKER13 = PhaseCodedPulse(5.3e9, 50e-9, 13, 4)
ALL = [Waveform(5.3e9, 50e6, 2.5e-6, 60e6), FMCW, STEPPED, PMCW, BARKER13]


def burst_of(waveform: AnyWaveform, pulses: int) -> Radar:
    # pulses with a pause, so that no echo of these tests comes after the next pulse
    prf_hz = 1e4 if waveform.family == "pulse" else 1 / waveform.duration_s
    return Radar(waveform, Burst(prf_hz, pulses))


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
    path = Path(__file__).parents[1] / "data" / "automotive_numbers.csv"
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
        assert radar.max_velocity_mps == pytest.approx(vmax, rel=5e-6)
        assert radar.velocity_resolution_mps == pytest.approx(dv, rel=5e-6)


def test_stepped_and_pmcw_ranges() -> None:
    assert STEPPED.unambiguous_range_m == pytest.approx(SPEED_OF_LIGHT_MPS / 4e6)
    assert STEPPED.range_resolution_m == pytest.approx(SPEED_OF_LIGHT_MPS / (2 * 256e6))
    assert PMCW.unambiguous_range_m == pytest.approx(SPEED_OF_LIGHT_MPS * 255e-9 / 2)
    assert Radar(PMCW, Burst(1 / PMCW.duration_s, 4)).unambiguous_range_m < 40


# -- FMCW ------------------------------------------------------------------------------------------


def beat(
    waveform: FmcwWaveform, range_m: float, rate_mps: float, times_s: np.ndarray
) -> np.ndarray:
    """Received times conjugate of transmitted, from the phase of the ramp itself."""
    start_hz = waveform.carrier_hz - waveform.slope_hz_per_s * waveform.grid_middle_s
    ramp_s = waveform.adc_start_s + np.arange(waveform.adc_samples) / waveform.sampling_rate_hz

    def cycles(t: np.ndarray) -> np.ndarray:
        return start_hz * t + waveform.slope_hz_per_s * t**2 / 2

    rows = []
    for time_s in times_s:
        delay_s = 2 * (range_m + rate_mps * (time_s + ramp_s)) / SPEED_OF_LIGHT_MPS
        rows.append(np.exp(2j * np.pi * (cycles(ramp_s - delay_s) - cycles(ramp_s))))
    return np.array(rows)


@pytest.mark.parametrize("rate_mps", [0.0, 8.0, -30.0, 300.0])
def test_beat_of_a_path_is_that_of_the_two_ramps(rate_mps: float) -> None:
    """Frequency, phase, residual video phase, coupling and motion within the ramp together."""
    radar = burst_of(FMCW, 8)
    found = synthesize(unit_paths(radar, [23.4], [rate_mps]), radar, window_m=(0.0, 38.0)).samples
    truth = beat(FMCW, 23.4, rate_mps, line_times_s(radar))
    assert np.linalg.norm(found - truth) < 1e-6 * np.linalg.norm(truth)


def test_beat_of_a_blade_that_turns_within_the_ramp() -> None:
    """Tip 50 m/s on 0.25 m: 10 000 m/s^2."""
    radar = burst_of(FMCW, 32)

    def range_m(time_s: np.ndarray) -> np.ndarray:
        angle = 200 * time_s + 0.4
        return np.hypot(20 + 0.25 * np.cos(angle), 0.25 * np.sin(angle))

    class Blade:
        moving = np.array([True])

        def lengths_m(self, times_s: np.ndarray, rows: object) -> np.ndarray:
            return 2 * range_m(times_s)[None]

        def select(self, rows: object) -> "Blade":
            return self

    paths = dataclasses.replace(unit_paths(radar, [20.0]), motion=Blade())
    found = synthesize(paths, radar, window_m=(0.0, 38.0)).samples
    start_hz = FMCW.carrier_hz - FMCW.slope_hz_per_s * FMCW.grid_middle_s
    ramp_s = FMCW.adc_start_s + np.arange(FMCW.adc_samples) / FMCW.sampling_rate_hz
    delay_s = 2 * range_m(line_times_s(radar)[:, None] + ramp_s) / SPEED_OF_LIGHT_MPS
    cycles = -start_hz * delay_s - FMCW.slope_hz_per_s * (ramp_s * delay_s - delay_s**2 / 2)
    truth = np.exp(2j * np.pi * cycles)
    # the jerk, left out, turns the phase by 2e-5 rad at the ends of the ramp
    assert np.linalg.norm(found - truth) < 1e-5 * np.linalg.norm(truth)


def test_beat_frequency_and_residual_video_phase() -> None:
    radar = burst_of(FMCW, 1)
    delay_s = 2 * 20.0 / SPEED_OF_LIGHT_MPS
    samples = synthesize(unit_paths(radar, [20.0]), radar, window_m=(0.0, 38.0)).samples[0]
    beat_hz = -FMCW.slope_hz_per_s * delay_s  # falls: received times conjugate of transmitted
    step = np.exp(2j * np.pi * beat_hz / FMCW.sampling_rate_hz)
    np.testing.assert_allclose(samples[1:] / samples[:-1], step, atol=1e-7)
    profile = compress(
        synthesize(unit_paths(radar, [20 * 0.149896229]), radar, window_m=(0.0, 38.0)), "none", 1
    )
    delay_s = 2 * 20 * 0.149896229 / SPEED_OF_LIGHT_MPS
    phase = -2 * np.pi * FMCW.carrier_hz * delay_s + np.pi * FMCW.slope_hz_per_s * delay_s**2
    assert profile.values[0, 20] == pytest.approx(np.exp(1j * phase), abs=1e-6)


def test_fmcw_mover_stands_where_it_will_be() -> None:
    """Range-Doppler coupling: f0 / K times the range rate."""
    radar = burst_of(FMCW, 64)
    rate_mps, range_m = 8.0, 20.0
    rd_map = range_doppler(
        compress(
            synthesize(unit_paths(radar, [range_m], [rate_mps]), radar, window_m=(0.0, 38.0)),
            "hann",
            16,
        ),
        "hann",
    )
    row, col = np.unravel_index(np.argmax(rd_map.power), rd_map.power.shape)
    burst_s = 63 / radar.burst.prf_hz
    later_s = FMCW.carrier_hz / FMCW.slope_hz_per_s
    assert rate_mps * later_s > 0.015
    expected_m = range_m + rate_mps * (burst_s / 2 + FMCW.grid_middle_s + later_s)
    # the cell's own raster, and the residual video phase: K tau of tau' is no Doppler
    assert rd_map.range_m[col] == pytest.approx(expected_m, abs=0.006)
    assert rd_map.velocity_mps[row] == pytest.approx(rate_mps, abs=radar.velocity_resolution_mps)


class _BurstOnly(LinearMotion):
    """Known from 0 to the end of the burst alone, as motion sampled from an animation."""

    span_s = 0.0

    def lengths_m(self, times_s: np.ndarray, rows: Rows) -> np.ndarray:
        assert times_s.min() >= 0 and times_s.max() <= self.span_s
        return super().lengths_m(times_s, rows)


@pytest.mark.parametrize("waveform", [FmcwWaveform(77e9, 1e9, 64, 5e6), STEPPED, PMCW])
def test_motion_is_asked_for_within_the_burst_alone(waveform: AnyWaveform) -> None:
    radar = burst_of(waveform, 6)
    paths = unit_paths(radar, [5.0], [3.0])
    motion = _BurstOnly(paths.length_m, paths.range_rate_mps)
    object.__setattr__(motion, "span_s", 6 / radar.burst.prf_hz)
    known = dataclasses.replace(paths, motion=motion)
    window_m = (0.0, 9.0)
    np.testing.assert_array_equal(
        synthesize(known, radar, window_m=window_m).samples,
        synthesize(paths, radar, window_m=window_m).samples,
    )


def test_anti_alias_filter_takes_out_what_is_beyond_the_adc() -> None:
    for real in (False, True):
        waveform = FmcwWaveform(77e9, 1e9, 256, 10e6, real_adc=real)
        radar = burst_of(waveform, 2)
        limit_m = waveform.unambiguous_range_m
        paths = unit_paths(radar, [limit_m * 0.9, limit_m * 1.1])
        echoes = synthesize(paths, radar, window_m=(0.0, 2 * limit_m))
        assert echoes.outside == 1
        profile = compress(echoes, "hann")
        assert profile.range_m[-1] < limit_m
        assert profile.range_m[np.argmax(np.abs(profile.values[0]))] == pytest.approx(
            0.9 * limit_m, abs=0.1
        )


# -- stepped frequency, codes, samples -------------------------------------------------------------


def test_stepped_frequency_repeats_after_c_over_two_steps() -> None:
    radar = burst_of(STEPPED, 1)
    period_m = SPEED_OF_LIGHT_MPS / (2 * STEPPED.step_hz)
    window_m = (0.0, period_m)
    near = compress(synthesize(unit_paths(radar, [12.0]), radar, window_m=window_m), "none")
    far = compress(
        synthesize(unit_paths(radar, [12.0 + period_m]), radar, window_m=window_m), "none"
    )
    np.testing.assert_allclose(np.abs(far.values), np.abs(near.values), atol=1e-6)
    assert near.range_m[-1] < period_m


def test_stepped_samples_are_the_tones_phases() -> None:
    radar = burst_of(STEPPED, 3)
    rate_mps = 4.0
    echoes = synthesize(unit_paths(radar, [12.0], [rate_mps]), radar, window_m=(0.0, 70.0))
    steps = np.arange(STEPPED.steps)
    tones_hz = STEPPED.carrier_hz + (steps - (STEPPED.steps - 1) / 2) * STEPPED.step_hz
    times_s = line_times_s(radar)[:, None] + (steps + 0.5) * STEPPED.step_time_s
    truth = np.exp(-4j * np.pi * tones_hz * (12.0 + rate_mps * times_s) / SPEED_OF_LIGHT_MPS)
    # left out: B T v / 2c = 0.011 cycles at the ends
    assert np.abs(echoes.samples - truth).max() < 0.08
    slow = synthesize(unit_paths(radar, [12.0], [0.004]), radar, window_m=(0.0, 70.0))
    truth = np.exp(-4j * np.pi * tones_hz * (12.0 + 0.004 * times_s) / SPEED_OF_LIGHT_MPS)
    assert np.abs(slow.samples - truth).max() < 8e-5


def test_pmcw_sidelobes_are_minus_one_nth() -> None:
    radar = burst_of(PMCW, 2)
    cell_m = PMCW.sample_spacing_m
    echoes = synthesize(unit_paths(radar, [40 * cell_m]), radar, window_m=(0.0, 38.0))
    assert echoes.samples.shape == (8, 255), "one row a code"
    code = np.roll(np.array(m_sequence(8)), 40)
    carrier = np.exp(-4j * np.pi * 40 * cell_m / PMCW.wavelength_m)
    np.testing.assert_allclose(echoes.samples[0], code * carrier, atol=1e-6)
    profile = compress(echoes, "hamming", 1)
    assert profile.window == "none", "a code's sidelobes are its own"
    assert profile.values.shape == (2, 254)
    values = profile.values[0] / carrier
    assert values[40] == pytest.approx(1, abs=1e-6)
    np.testing.assert_allclose(np.delete(values, 40), -1 / 255, atol=1e-6)


def test_pmcw_loses_what_doppler_turns_during_the_repeats() -> None:
    waveform = PmcwWaveform(79e9, 1e-9, 10, repeats=64)
    radar = burst_of(waveform, 16)
    rate_mps = 0.35 * 2 * radar.max_velocity_mps
    echoes = synthesize(unit_paths(radar, [20.0], [rate_mps]), radar, window_m=(0.0, 50.0))
    peak = np.abs(compress(echoes, oversample=8).values).max(axis=1)
    turn = 0.35  # cycles from pulse to pulse
    expected = abs(np.sin(np.pi * turn) / (64 * np.sin(np.pi * turn / 64)))
    # a sixteenth of a cell off the raster: 0.6 %
    np.testing.assert_allclose(peak, expected, rtol=8e-3)


def test_barker_pulse_has_sidelobes_of_one_thirteenth() -> None:
    radar = Radar(BARKER13, Burst(1000.0, 1))
    cell_m = BARKER13.sample_spacing_m
    range_m = 300.0
    echoes = synthesize(unit_paths(radar, [range_m]), radar, window_m=(100.0, 500.0))
    profile = compress(echoes, "hamming", 1)
    assert profile.window == "none"
    # at lags of whole chips, on the samples: shift the path onto one
    range_m = 100.0 + 100 * cell_m
    profile = compress(
        synthesize(unit_paths(radar, [range_m]), radar, window_m=(100.0, 500.0)), "none", 1
    )
    magnitude = np.abs(profile.values[0])
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
        echoes = synthesize(unit_paths(radar, [700.0], [20.0]), radar, window_m=(500.0, 900.0))
        results.append((echoes.samples, compress(echoes, "taylor:4:-35").values))
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
    found = compress(synthesize(paths, radar, window_m=(0.0, top_m)), window, 2)
    column = round(range_m / (waveform.sample_spacing_m / 2))
    assert np.abs(found.values[0, column]) ** 2 == pytest.approx(power, rel=1e-6)
    assert int(np.argmax(np.abs(found.values[0]))) == column
    profile = expected_power_profile(paths, radar, window_m=(0.0, top_m), window=window)
    np.testing.assert_allclose(
        profile.power[:: 2], np.abs(found.values[0, : -(-profile.power.size // 2)]) ** 2,
        atol=2e-5 * power,
    )  # fmt: skip


# -- files -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("waveform", ALL, ids=lambda w: w.kind)
def test_a_radar_file_gives_the_waveform_back(waveform: AnyWaveform, tmp_path: Path) -> None:
    data = waveform_to_dict(waveform)
    assert ("kind" in data) == (waveform.kind != "lfm")
    file = tmp_path / "radar.json"
    file.write_text(json.dumps({"waveform": data, "burst": {"pulses": 12}}))
    radar = load_radar(file)
    assert radar.waveform == waveform
    assert radar.burst == Burst(1 / waveform.duration_s, 12)


def test_arbitrary_samples_survive_a_dictionary() -> None:
    pulse = ArbitraryPulse(1e9, 10e6, np.array([1, 1j, -2.0]))
    again = waveform_from_dict(json.loads(json.dumps(waveform_to_dict(pulse))))
    np.testing.assert_allclose(again.samples, pulse.samples, rtol=1e-15)
    assert np.mean(np.abs(again.samples) ** 2) == pytest.approx(1)


def test_samples_from_a_table(tmp_path: Path) -> None:
    file = tmp_path / "pulse.csv"
    file.write_text("# made by hand\nreal, imag\n1, 0\n0.5, -2e-1\n")
    np.testing.assert_array_equal(load_samples(file), [1, 0.5 - 0.2j])


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.csv", "1,2\nx,3\n", "line 2"),
        ("a.csv", "1,2,3\n1,2,3\n", "line 2"),
        ("a.txt", "1,2", r"expected \.npy"),
        ("a.npy", "not an array", "cannot be read"),
        ("a.csv", "nan,1\n", "sample 0"),
    ],
)
def test_samples_that_are_none(tmp_path: Path, name: str, content: str, message: str) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(FrameFileError, match=message):
        load_samples(tmp_path / name)


def test_pickles_are_not_read(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(FrameFileError, match="cannot be read"):
        load_samples(tmp_path / "a.npy")
    with pytest.raises(FrameFileError, match="cannot be read"):
        load_samples(tmp_path / "missing.npy")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"kind": "sonar"}, "sonar.*knows"),
        ({"kind": "fmcw", "carrier_hz": 77e9}, "lacks adc_samples"),
        ({**waveform_to_dict(FMCW), "slope": 1}, "knows no slope"),
        ({**waveform_to_dict(FMCW), "carrier_hz": "77e9"}, "carrier_hz is '77e9'"),
        ({**waveform_to_dict(FMCW), "carrier_hz": 77.0}, "check the units"),
        ({**waveform_to_dict(FMCW), "ramp_s": 1e-6}, "ends before the ADC"),
        ({**waveform_to_dict(FMCW), "idle_s": -1.0}, "Idle time"),
        ({**waveform_to_dict(FMCW), "adc_samples": 1.5}, "ADC samples is 1.5"),
        ({**waveform_to_dict(PMCW), "degree": 40}, "Degree"),
        ({**waveform_to_dict(BARKER13), "code_length": 6}, "length 6"),
        ({**waveform_to_dict(STEPPED), "step_hz": math.nan}, "Frequency step"),
        ({"kind": "arbitrary", "carrier_hz": 1e9, "sampling_rate_hz": 1e6}, "needs"),
    ],
)
def test_waveforms_that_do_not_fit(data: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        waveform_from_dict(data)


def test_radar_files_that_do_not_fit(tmp_path: Path) -> None:
    file = tmp_path / "radar.json"
    for text, error, message in (
        ("{", FrameFileError, "cannot be read as JSON"),
        ('{"burst": {}}', ConfigError, "expected the objects"),
        (json.dumps({"waveform": waveform_to_dict(FMCW)}), ConfigError, "no burst"),
        (
            json.dumps({"waveform": waveform_to_dict(FMCW), "burst": {"pulses": 4, "prf_hz": 1e6}}),
            ConfigError,
            "longer than the pulse interval",
        ),
    ):
        file.write_text(text)
        with pytest.raises(error, match=message):
            load_radar(file)


def test_a_window_beyond_the_waveforms_range_is_named() -> None:
    radar = burst_of(FMCW, 1)
    echoes = synthesize(unit_paths(radar, [20.0]), radar, window_m=(50.0, 60.0))
    with pytest.raises(ConfigError, match="range ends at"):
        compress(echoes)
