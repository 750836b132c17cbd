# SPDX-License-Identifier: GPL-3.0-or-later
"""Range-Doppler map: axes, level, and what is found in it."""

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.signal import (
    Burst,
    Paths,
    PowerProfile,
    Radar,
    RangeDopplerMap,
    Waveform,
    expected_power_profile,
    find_peaks,
    leading_edges,
    make_paths,
    peak_to_background_db,
    power_to_db,
    range_doppler,
    synthesize,
)
from radarsim_addon.signal.maps import range_process
from tests.signal.oracle import unit_paths

WAVEFORM = Waveform(5.3e9, 50e6, 2.5e-6, 60e6)
WINDOW_M = (500.0, 1500.0)


def radar_of(pulses: int) -> Radar:
    return Radar(WAVEFORM, Burst(1000.0, pulses))


def map_of(radar: Radar, range_m: list[float], rate_mps: list[float] | float) -> RangeDopplerMap:
    paths = unit_paths(radar, range_m, rate_mps)
    return range_doppler(range_process(synthesize(paths, radar, range_limits_m=WINDOW_M)))


@pytest.mark.parametrize("pulses", [1, 2, 5, 64, 127, 128])
def test_axes_are_exact_for_odd_and_even_trains(pulses: int) -> None:
    radar = radar_of(pulses)
    found = map_of(radar, [1000.0], 0.0)
    assert found.plane.shape == (pulses, found.range_m.size)
    assert found.doppler_hz[pulses // 2] == 0
    np.testing.assert_allclose(np.diff(found.doppler_hz), 1000.0 / pulses)
    np.testing.assert_allclose(
        found.velocity_mps, -found.doppler_hz * WAVEFORM.wavelength_m / 2, rtol=1e-14
    )
    # what is stationary is in the row of 0 Hz
    assert np.unravel_index(np.argmax(found.plane_power), found.plane_power.shape)[0] == pulses // 2


@pytest.mark.parametrize("window", ["none", "hamming", "taylor:4:-35"])
@pytest.mark.parametrize("pulses", [63, 64])
def test_unit_path_in_a_cell_is_zero_decibels(pulses: int, window: str) -> None:
    radar = radar_of(pulses)
    row = pulses // 2 - 7  # left of the middle
    rate_mps = 7 * 1000.0 / pulses * WAVEFORM.wavelength_m / 2
    middle_m = 500.0 + 200 * WAVEFORM.sample_spacing_m
    start_m = middle_m - rate_mps * (pulses - 1) / 2 / 1000.0
    paths = unit_paths(radar, [start_m], rate_mps)
    found = range_doppler(range_process(synthesize(paths, radar, range_limits_m=WINDOW_M)), window)
    peak = divmod(int(np.argmax(found.plane_power)), found.range_m.size)
    assert peak == (row, 400)
    assert found.velocity_mps[row] == pytest.approx(rate_mps)
    # it moves by 0.1 cells during the burst: some 0.01 dB
    assert found.power_db[0][peak] == pytest.approx(0, abs=0.03)


@pytest.mark.parametrize("rate_mps", [10.0, -10.0, 3.217, -0.9])
@pytest.mark.parametrize("range_m", [1000.0, 1234.567])
def test_peak_is_found_between_the_cells(range_m: float, rate_mps: float) -> None:
    radar = radar_of(128)
    peak = find_peaks(map_of(radar, [range_m], rate_mps), 1)[0]
    assert peak.velocity_mps == pytest.approx(rate_mps, abs=1e-5)
    assert peak.doppler_hz == pytest.approx(-2 * rate_mps / WAVEFORM.wavelength_m, abs=1e-3)
    middle_m = range_m + rate_mps * 127 / 2 / 1000
    assert peak.range_m == pytest.approx(middle_m, abs=0.005)
    # 1.3 m of migration during the burst lowers the peak by 0.1 dB
    assert peak.level_db == pytest.approx(0, abs=0.12)
    assert peak.peak_to_background_db > 40


def test_papers_target_is_on_the_left_at_353_6_hz() -> None:
    peak = find_peaks(map_of(radar_of(128), [1700.0 - 400], 10.0), 1)[0]
    assert peak.doppler_hz == pytest.approx(-353.6, abs=0.03)


def test_velocity_beyond_the_limit_folds() -> None:
    radar = radar_of(64)
    beyond = radar.max_unambiguous_velocity_mps + 1.0
    peak = find_peaks(map_of(radar, [1000.0], beyond), 1)[0]
    assert peak.velocity_mps == pytest.approx(
        beyond - 2 * radar.max_unambiguous_velocity_mps, abs=1e-3
    )


def test_weak_mover_beside_strong_clutter() -> None:
    radar = radar_of(128)
    aperture = WAVEFORM.wavelength_m**2 / (4 * np.pi)
    rng = np.random.default_rng(0)
    clutter = make_paths(1 / aperture, 2 * rng.uniform(600, 1400, 3000))
    target = make_paths(0.01 / aperture, 2 * 1100.0, 6.0)
    echoes = synthesize(Paths.join([clutter, target]), radar, range_limits_m=WINDOW_M)
    found = range_doppler(range_process(echoes))
    assert abs(find_peaks(found, 1)[0].velocity_mps) < 0.3
    peaks = find_peaks(found, 3, min_speed_mps=1.0, min_above_db=20)
    assert peaks[0].velocity_mps == pytest.approx(6.0, abs=1e-3)
    assert peaks[0].range_m == pytest.approx(1100 + 6 * 127 / 2000, abs=0.01)
    assert peaks[0].level_db == pytest.approx(-20, abs=0.2)
    # elsewhere there are only the target's own sidelobes, not those of clutter 100 dB above them
    elsewhere = find_peaks(found, 3, min_speed_mps=1.0, range_m=(500.0, 700.0))
    assert max(p.level_db for p in elsewhere) < -80


def test_several_peaks_come_strongest_first() -> None:
    radar = radar_of(64)
    aperture = WAVEFORM.wavelength_m**2 / (4 * np.pi)
    paths = make_paths(
        np.array([1.0, 4.0, 2.0]) / aperture, 2 * np.array([700.0, 900.0, 1200.0]),
        np.array([2.0, -2.0, 4.0]),
    )  # fmt: skip
    found = range_doppler(range_process(synthesize(paths, radar, range_limits_m=WINDOW_M)))
    peaks = find_peaks(found, 3)
    np.testing.assert_allclose([p.velocity_mps for p in peaks], [-2.0, 4.0, 2.0], atol=0.01)
    np.testing.assert_allclose(
        [p.level_db for p in peaks], 10 * np.log10([4.0, 2.0, 1.0]), atol=0.1
    )


@pytest.mark.filterwarnings("error")
def test_empty_map_has_the_floor_everywhere_and_no_peaks() -> None:
    radar = radar_of(16)
    echoes = synthesize([], radar, range_limits_m=WINDOW_M)
    found = range_doppler(range_process(echoes))
    assert not found.plane_power.any()
    assert (found.power_db == -300).all()
    assert find_peaks(found, 5) == []
    assert leading_edges(expected_power_profile([], radar, range_limits_m=WINDOW_M)) == []


def test_level_above_surroundings() -> None:
    power = np.full((64, 200), 2.0)
    power[10, 50] = 2000.0
    power[9:12, 47:54] = np.maximum(power[9:12, 47:54], 500.0)  # within the guard cells
    assert peak_to_background_db(power, 10, 50) == pytest.approx(30.0)
    power[:] = 0
    power[0, 0] = 1
    assert peak_to_background_db(power, 0, 0) == 300
    with pytest.raises(ConfigError, match="fewer guard cells"):
        peak_to_background_db(np.ones((3, 3)), 1, 1)


def test_decibels() -> None:
    np.testing.assert_allclose(power_to_db(np.array([100.0, 1.0, 0.0]), 10.0, -50), [10, -10, -50])


def profile_of(power: np.ndarray, step_m: float = 0.5) -> PowerProfile:
    return PowerProfile(power, np.asarray(step_m * np.arange(power.size)), radar_of(1), "none")


def test_leading_edge_of_a_triangle_is_interpolated() -> None:
    power = np.interp(np.arange(1000), [100, 200, 240], [0, 50, 0]) + 1e-3
    edge = leading_edges(profile_of(power), 1)[0]
    assert edge.peak_range_m == 100.0
    assert edge.range_m == pytest.approx(75.0, abs=1e-3)
    assert edge.level_db == pytest.approx(10 * np.log10(50), abs=1e-3)


def test_edges_are_separated_and_ordered() -> None:
    power = 1e-6 + np.sum(
        [
            a * np.exp(-(((np.arange(4000) - c) / 20) ** 2))
            for a, c in ((10, 500), (9, 560), (1e-3, 3000), (5, 1500))
        ],
        axis=0,
    )
    profile = profile_of(power)
    by_power = leading_edges(profile, 3, separation_m=100)
    np.testing.assert_allclose([e.peak_range_m for e in by_power], [250, 750, 1500], atol=1)
    # 9 rises 3 dB out of its neighbour's flank, 1e-3 rises 30 dB out of nothing
    by_rise = leading_edges(profile, 4, separation_m=10, by="prominence")
    np.testing.assert_allclose([e.peak_range_m for e in by_rise], [250, 750, 1500, 280], atol=1)
    assert by_rise[2].prominence_db == pytest.approx(30, abs=0.1)
    inside = leading_edges(profile, 3, range_m=(600, 1000))
    assert [round(e.peak_range_m) for e in inside] == [750]
    with pytest.raises(ConfigError, match="prominence"):
        leading_edges(profile, by="height")  # type: ignore[arg-type]


def test_a_step_on_the_flank_of_a_higher_peak_has_no_edge() -> None:
    """Its power does not fall to half before the higher peak; the edge found was that peak's."""
    place = np.arange(2000)
    power = 1e-3 + np.sum(
        [a * np.exp(-(((place - c) / 20) ** 2)) for a, c in ((9, 500), (4, 1000))], axis=0
    )
    power += 0.5 * ((place > 1000) & (place < 1200)) + 0.1 * ((place > 1100) & (place < 1110))
    found = leading_edges(profile_of(power), 5, separation_m=30)
    assert [round(edge.peak_range_m) for edge in found] == [250, 500]


def test_leading_edge_of_a_wide_face_is_at_the_face() -> None:
    """A face seen square-on: equal powers from 1000 m on, over 200 m."""
    radar = radar_of(1)
    paths = unit_paths(radar, list(np.arange(1000.0, 1200.0, 0.05)))
    for window in ("none", "hamming"):
        profile = expected_power_profile(paths, radar, range_limits_m=WINDOW_M, range_taper=window)
        edge = leading_edges(profile, 1, separation_m=300)[0]
        assert edge.range_m == pytest.approx(1000.0, abs=0.5)
