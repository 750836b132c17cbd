# SPDX-License-Identifier: GPL-3.0-or-later
"""Leading edges are of echoes within the range limits, not of sidelobes that reach in."""

import numpy as np
import pytest

from radarsim_addon.signal import (
    Burst,
    FmcwWaveform,
    PhaseCodedPulse,
    Radar,
    SteppedWaveform,
    Waveform,
    make_paths,
)
from radarsim_addon.signal.detection import find_edges
from radarsim_addon.signal.maps import ProfileAccumulator, expected_power_profile
from radarsim_addon.signal.radar import AnyWaveform
from tests.signal.oracle import unit_paths

LFM = Waveform(5.3e9, 50e6, 2.5e-6, 60e6)
FMCW = FmcwWaveform(77e9, 150e6, 256, 20e6)
STEPPED = SteppedWaveform(10e9, 0.5e6, 128, 10e-6)


def profiles(waveform: AnyWaveform, range_m: list[float], power: list[float]) -> ProfileAccumulator:
    """Expected power between 100 and 160 m."""
    radar = Radar(waveform, Burst(500.0, 4))
    found = ProfileAccumulator(radar, (100.0, 160.0), range_taper="none")
    paths = unit_paths(radar, range_m)
    paths.radiance[:] *= power
    found.add(paths)
    return found


@pytest.mark.parametrize("waveform", [LFM, FMCW, STEPPED], ids=lambda w: w.kind)
def test_an_echo_beyond_the_limits_has_no_edge_in_them(waveform: AnyWaveform) -> None:
    """30 m before the limits and 20 m behind them; only sidelobes reach in."""
    found = profiles(waveform, [70.0, 180.0], [1.0, 1.0])
    assert found.result().power.max() > 0
    assert find_edges(found.result(within=True)) == []


@pytest.mark.parametrize("waveform", [LFM, FMCW, STEPPED], ids=lambda w: w.kind)
def test_a_weak_echo_within_them_keeps_its_edge(waveform: AnyWaveform) -> None:
    """30 dB below the one beyond; the profile itself holds both."""
    found = profiles(waveform, [70.0, 130.0], [1.0, 1e-3])
    edges = find_edges(found.result(within=True))
    assert edges[0].peak_range_m == pytest.approx(130.0, abs=waveform.sample_spacing_m / 4)
    both = profiles(waveform, [70.0], [1.0]).result().power
    both = both + profiles(waveform, [130.0], [1e-3]).result().power
    assert np.abs(found.result().power - both).max() < 1e-12


@pytest.mark.parametrize("waveform", [LFM, FMCW, STEPPED], ids=lambda w: w.kind)
@pytest.mark.parametrize("level_db", [0.0, -8.0])
def test_peaks_four_resolutions_apart_are_found(waveform: AnyWaveform, level_db: float) -> None:
    """The weaker one in front of the other, and behind it."""
    apart_m = 4.5 * waveform.range_resolution_m
    for sign in (-1.0, 1.0):
        places = [130.0, 130.0 + sign * apart_m]
        found = find_edges(profiles(waveform, places, [1.0, 10 ** (level_db / 10)]).result())
        peaks = sorted(edge.peak_range_m for edge in found)
        assert peaks == pytest.approx(sorted(places), abs=waveform.sample_spacing_m / 2)


def test_rounding_and_code_sidelobes_are_no_leading_edges() -> None:
    radar = Radar(PhaseCodedPulse(5.3e9, 1e-7, 13), Burst(2000.0, 64))
    paths = make_paths(1.0, 2000.0)
    profile = expected_power_profile(paths, radar, range_limits_m=(0.0, 8000.0))
    edges = find_edges(profile)
    assert [round(edge.peak_range_m) for edge in edges] == [1001]  # nothing of the code's sidelobes
    with_far = make_paths(np.array([1.0, 1e-8]), np.array([2000.0, 12e3]))
    profile = expected_power_profile(with_far, radar, range_limits_m=(0.0, 8000.0))
    assert sorted(round(edge.peak_range_m / 10) for edge in find_edges(profile)) == [100, 600]
