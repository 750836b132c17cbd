# SPDX-License-Identifier: GPL-3.0-or-later
"""The radar's numbers: what follows from them, and slips of the unit."""

from __future__ import annotations

import math

import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.signal import Burst, Radar, Waveform


def test_numbers_of_the_papers_radar() -> None:
    waveform = Waveform(5.3e9, 50e6, 2.5e-6, 60e6)
    radar = Radar(waveform, Burst(1000.0, 128))
    assert waveform.fm_rate_hz_per_s == pytest.approx(20e12, rel=1e-15)
    assert waveform.range_resolution_m == pytest.approx(2.99792458, rel=1e-12)
    assert radar.burst.unambiguous_range_m == pytest.approx(149_896.229, rel=1e-12)
    assert radar.max_unambiguous_velocity_mps == pytest.approx(299_792_458 / 5.3e9 * 250, rel=1e-12)
    # 22.1 cm/s: one turn of phase over the burst of 128 ms.
    assert radar.velocity_resolution_mps == pytest.approx(0.0565646 / 2 / 0.128, rel=1e-6)
    assert radar.doppler_hz(10.0) == pytest.approx(-353.578, abs=1e-3), "receding is negative"


def test_a_carrier_in_the_wrong_unit_is_named() -> None:
    with pytest.raises(ConfigError, match=r"5\.3e\+18 Hz.*Check the unit"):
        Waveform(5.3e9 * 1e9, 50e6, 2.5e-6, 60e6)
    with pytest.raises(ConfigError, match="check the units"):
        Waveform(5.3, 50e6, 2.5e-6, 60e6)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_numbers_that_are_none(value: float) -> None:
    for place in range(4):
        numbers = [5.3e9, 50e6, 2.5e-6, 60e6]
        numbers[place] = value
        with pytest.raises(ConfigError, match="expected a finite number above 0"):
            Waveform(*numbers)
