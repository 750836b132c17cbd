# SPDX-License-Identifier: GPL-3.0-or-later
"""Matched filter against closed forms and an independent table of windows."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.signal import (
    ArbitraryPulse,
    Burst,
    Radar,
    Waveform,
    expected_power_profile,
    make_paths,
    matched_filter,
    slow_time_window,
    synthesize,
    window_at,
)
from radarsim_addon.signal.maps import range_process
from tests.signal.oracle import unit_paths

RADAR = Radar(Waveform(5.3e9, 50e6, 2.5e-6, 60e6), Burst(1000.0, 2))
WINDOW_M = (500.0, 1500.0)
WINDOWS = ["none", "hann", "hamming", "hamming:0.75", "blackman", "kaiser:2.5", "taylor:4:-35"]

#: Name in the table -> ours.
TABLE_NAMES = {
    "rectangular": "none",
    "Taylor nbar=4 SLL=-30 (sarpy default)": "taylor:4:-30",
    "Taylor nbar=4 SLL=-35": "taylor:4:-35",
    "Taylor nbar=5 SLL=-35": "taylor:5:-35",
    "Taylor nbar=6 SLL=-40": "taylor:6:-40",
    "Hamming 0.54": "hamming",
    "generalised Hamming 0.75 (Sentinel-1-like)": "hamming:0.75",
    "Hann": "hann",
    "Kaiser beta=2.5": "kaiser:2.5",
    "Blackman": "blackman",
}


def table() -> list[dict[str, str]]:
    path = Path(__file__).parents[2] / "data" / "sar_window_metrics.csv"
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("oversample", [1, 2, 8])
def test_unit_path_peaks_at_one_at_its_range_with_its_phase(window: str, oversample: int) -> None:
    range_m = WINDOW_M[0] + 100 * RADAR.waveform.sample_spacing_m
    echoes = synthesize(unit_paths(RADAR, [range_m]), RADAR, range_limits_m=WINDOW_M)
    found = range_process(echoes, window, oversample)
    column = 100 * oversample
    assert found.range_m[column] == pytest.approx(range_m, abs=1e-9)
    assert int(np.argmax(np.abs(found.plane[0]))) == column
    phase = np.exp(-4j * np.pi * range_m / RADAR.waveform.wavelength_m)
    assert found.plane[0, column] == pytest.approx(phase, abs=1e-8)


@pytest.mark.parametrize(("samples", "size"), [(25, 27), (41, 45), (43, 45), (73, 75)])
def test_profile_between_samples_is_that_of_the_band(samples: int, size: int) -> None:
    """An impulse fills the band of the sampling rate: the profile is Dirichlet's kernel of a
    transform with an odd number of frequencies."""
    radar = Radar(ArbitraryPulse(5.3e9, 50e6, np.array([1, 0j])), Burst(1000.0, 1))
    cell_m = radar.waveform.sample_spacing_m
    limits_m = (300.0, 300.0 + (samples - 3.9) * cell_m)
    echoes = synthesize(unit_paths(radar, [300.0 + 20 * cell_m]), radar, range_limits_m=limits_m)
    assert echoes.samples.shape[-1] == samples
    found = range_process(echoes, "none", 4)
    place = (found.range_m - 300.0) / cell_m - 20 + 1e-9
    kernel = np.sin(np.pi * place) / (size * np.sin(np.pi * place / size))
    np.testing.assert_allclose(found.plane[0] / found.plane[0, 80], kernel, atol=1e-6)


def test_range_axis_covers_the_window() -> None:
    found = range_process(
        synthesize(unit_paths(RADAR, [900.0]), RADAR, range_limits_m=WINDOW_M), oversample=4
    )
    steps = np.diff(found.range_m)
    assert found.range_m[0] == WINDOW_M[0]
    assert WINDOW_M[1] - steps[0] < found.range_m[-1] <= WINDOW_M[1]
    np.testing.assert_allclose(steps, RADAR.waveform.sample_spacing_m / 4, rtol=1e-9)
    assert found.plane.shape == (2, found.range_m.size)


@pytest.mark.parametrize("row", table(), ids=lambda row: row["window"])
def test_response_has_the_tables_width_sidelobes_and_loss(row: dict[str, str]) -> None:
    """Through echo and matched filter, with a chirp of time-bandwidth product 100 000."""
    window = TABLE_NAMES[row["window"]]
    waveform = Waveform(5.3e9, 50e6, 2e-3, 60e6)
    radar = Radar(waveform, Burst(400.0, 1))
    oversample = 8
    cell_m = waveform.range_resolution_m
    centre_m = 500.0
    echoes = synthesize(
        unit_paths(radar, [centre_m]),
        radar,
        range_limits_m=(centre_m - 45 * cell_m, centre_m + 45 * cell_m),
    )
    found = range_process(echoes, window, oversample)
    x = (found.range_m - centre_m) / cell_m  # in units of 1/B
    power = np.abs(found.plane[0]) ** 2

    peak = int(np.argmax(power))
    assert power[peak] == pytest.approx(1, abs=2e-3)

    def half_power(side: int) -> float:
        i = peak
        while power[i] > 0.5:
            i += side
        share = (power[i - side] - 0.5) / (power[i - side] - power[i])
        return abs(x[i - side] + side * share * (x[1] - x[0]))

    width = half_power(1) + half_power(-1)
    assert width == pytest.approx(float(row["IRW_over_1/B"]), rel=5e-3)

    null = float(row["first_null_over_1/B"])
    side = np.abs(x) > null
    level_db = 10 * np.log10(power[side].max())
    # the deepest sidelobes still see the ripple of the chirp's spectrum (1/sqrt(BT) of -40 dB)
    slack_db = 0.1 if float(row["PSLR_dB"]) > -45 else 0.6
    assert level_db == pytest.approx(float(row["PSLR_dB"]), abs=slack_db)

    reach = 10 * float(row["IRW_over_1/B"])
    sidelobes = power[side & (np.abs(x) <= reach)].sum()
    islr_db = 10 * np.log10(sidelobes / power[~side].sum())
    assert islr_db == pytest.approx(float(row["ISLR_dB_null_10IRW"]), abs=0.15)

    size = 262144
    noise = {w: np.mean(np.abs(matched_filter(waveform, size, w)) ** 2) for w in ("none", window)}
    loss_db = 10 * np.log10(noise["none"] / noise[window])
    assert loss_db == pytest.approx(float(row["SNR_loss_dB"]), abs=0.01)


def test_windows_against_scipy() -> None:
    from scipy.signal import windows

    count = 64
    middle = (np.arange(count) - (count - 1) / 2) / (count - 1)
    for ours, theirs in (
        ("hann", windows.hann(count)),
        ("hamming", windows.hamming(count)),
        ("blackman", windows.blackman(count)),
        ("kaiser:2.5", windows.kaiser(count, 2.5)),
    ):
        np.testing.assert_allclose(window_at(ours, middle), theirs, atol=1e-12)
    taylor = windows.taylor(count, nbar=5, sll=35, norm=False)
    np.testing.assert_allclose(slow_time_window("taylor:5:-35", count), taylor, rtol=1e-12)
    assert not window_at("hamming", np.array([-0.51, 0.51])).any()


@pytest.mark.parametrize(
    "window", ["", "gauss", "hann:2", "hamming:0.2", "kaiser", "kaiser:x", "taylor:4",
               "taylor:0:-35", "taylor:4:0", "taylor:2.5:-35"],
)  # fmt: skip
def test_unknown_windows_are_named(window: str) -> None:
    with pytest.raises(ConfigError, match=r"[Ww]indow"):
        window_at(window, np.zeros(3))


def test_expected_power_of_one_path_is_the_compressed_power() -> None:
    paths = make_paths(3.7, 2 * 1003.21)
    profile = expected_power_profile(paths, RADAR, range_limits_m=WINDOW_M, oversample=4)
    echoes = synthesize(paths, RADAR, range_limits_m=WINDOW_M)
    coherent = range_process(echoes, "hamming", 4)
    np.testing.assert_array_equal(profile.range_m, coherent.range_m)
    power = np.abs(coherent.plane[0]) ** 2
    np.testing.assert_allclose(profile.power, power, atol=1e-5 * power.max())


def test_expected_power_adds_up_powers_not_amplitudes() -> None:
    """Two paths half a wavelength apart cancel in the echo, and double in the mean power."""
    wavelength_m = RADAR.waveform.wavelength_m
    paths = unit_paths(RADAR, [1000.0, 1000.0 + wavelength_m / 4])
    profile = expected_power_profile(paths, RADAR, range_limits_m=WINDOW_M, oversample=16)
    assert profile.power.max() == pytest.approx(2, rel=1e-3)
    coherent = range_process(synthesize(paths, RADAR, range_limits_m=WINDOW_M), oversample=16)
    assert np.abs(coherent.plane).max() < 0.02


def test_expected_power_takes_negative_parts_of_a_pair() -> None:
    """Of paths that interfere each carries half of the pair, which can be below zero."""
    pair = replace(unit_paths(RADAR, [1000.0, 1000.0]), gain=np.array([2.5, -1.0]))
    found = expected_power_profile(pair, RADAR, range_limits_m=WINDOW_M)
    one = expected_power_profile(unit_paths(RADAR, [1000.0]), RADAR, range_limits_m=WINDOW_M)
    np.testing.assert_allclose(found.power, 1.5 * one.power, atol=1e-12 * one.power.max())


def test_expected_power_is_the_mean_over_speckle() -> None:
    rng = np.random.default_rng(11)
    cell_m = RADAR.waveform.range_resolution_m
    profile_m = np.linspace(900, 900 + 30 * cell_m, 400)
    total, trials = 0.0, 200
    for _ in range(trials):
        jitter_m = rng.uniform(-0.5, 0.5, profile_m.size) * RADAR.waveform.wavelength_m
        paths = unit_paths(RADAR, list(profile_m + jitter_m))
        values = range_process(
            synthesize(paths, RADAR, range_limits_m=(900.0, 1000.0)), oversample=2
        ).plane
        total = total + np.abs(values[0]) ** 2 / trials
    expected = expected_power_profile(
        unit_paths(RADAR, list(profile_m)), RADAR, range_limits_m=(900.0, 1000.0), oversample=2
    ).power
    inside = slice(15, 60)
    # 200 trials of exponential statistics over some 15 independent cells: 1/sqrt(3000), 5 sigma
    assert np.mean(total[inside]) == pytest.approx(np.mean(expected[inside]), rel=0.1)  # type: ignore[index]


def test_expected_power_near_the_window_reaches_into_it() -> None:
    """A shorter window shows a part of the longer one, sidelobes of what lies outside included."""
    step_m = RADAR.waveform.sample_spacing_m / 4
    start_m, stop_m = 900 + 160 * step_m, 900 + 400 * step_m
    paths = unit_paths(RADAR, [start_m - 5.0, stop_m + 4.0])
    whole = expected_power_profile(paths, RADAR, range_limits_m=(900.0, 1300.0), oversample=4)
    part = expected_power_profile(paths, RADAR, range_limits_m=(start_m, stop_m), oversample=4)
    want = whole.power[160:401]
    assert want.max() > 1e-5
    np.testing.assert_allclose(part.power, want, atol=1e-2 * want.max())


def test_expected_power_in_parts_and_nothing() -> None:
    paths = unit_paths(RADAR, list(np.linspace(600, 1400, 50)))
    whole = expected_power_profile(paths, RADAR, range_limits_m=WINDOW_M)
    parts = [paths.select(slice(i, i + 7)) for i in range(0, 50, 7)]
    pieces = expected_power_profile(iter(parts), RADAR, range_limits_m=WINDOW_M)
    np.testing.assert_allclose(pieces.power, whole.power, atol=1e-11)
    nothing = expected_power_profile([], RADAR, range_limits_m=WINDOW_M)
    assert not nothing.power.any()
    assert (whole.power >= 0).all()


@pytest.mark.parametrize("oversample", [0, -1, 65, 1.5])
def test_oversampling_is_checked(oversample: int) -> None:
    echoes = synthesize(unit_paths(RADAR, [900.0]), RADAR, range_limits_m=WINDOW_M)
    with pytest.raises(ConfigError, match="Oversampling"):
        range_process(echoes, oversample=oversample)
    if oversample < 2:
        with pytest.raises(ConfigError, match="at least 2"):
            expected_power_profile([], RADAR, range_limits_m=WINDOW_M, oversample=oversample)
