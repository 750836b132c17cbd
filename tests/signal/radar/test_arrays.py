# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays: elements, presets, and radar files that hold them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.signal.radar import (
    ARRAY_PRESETS,
    SINGLE_CHANNEL,
    AntennaArray,
    Burst,
    Channel,
    Element,
    array_preset,
    channels_from_dict,
    channels_to_dict,
    linear_array,
    load_radar,
)

WAVEFORM = {
    "kind": "fmcw", "carrier_hz": 77e9, "bandwidth_hz": 300e6, "adc_samples": 256,
    "adc_rate_hz": 20e6,
}  # fmt: skip
RADAR = {"waveform": WAVEFORM, "burst": {"pulses": 64, "prf_hz": 1e4}}
WAVELENGTH_M = 299_792_458 / 77e9


def loaded(folder: Path, array: Any) -> Any:
    path = folder / "radar.json"
    path.write_text(json.dumps(RADAR | {"array": array}))
    return load_radar(path)


def test_channels_by_transmitter_and_their_slots() -> None:
    array = AntennaArray(linear_array(2, 0.02), linear_array(4, 0.005, axis=1))
    channels = array.channels(Burst(1e4, 8))
    assert [channel.start_offset_s for channel in channels] == [0.0] * 4 + [5e-5] * 4
    assert channels[5] == Channel(Element((0.01, 0, 0)), Element((0, -0.0025, 0)), 5e-5)
    assert array.virtual_m[5] == pytest.approx([0.01, -0.0025, 0])
    slow = AntennaArray(array.transmitters, array.receivers, 2e-5)
    assert slow.channels(Burst(1e4, 8))[-1].start_offset_s == 2e-5


@pytest.mark.parametrize("name", ARRAY_PRESETS)
def test_presets_have_no_gap_and_no_grating_lobe(name: str) -> None:
    """Virtual elements in a row, half a wavelength apart, without a gap."""
    array = array_preset(name, WAVELENGTH_M)
    steps = np.round(array.virtual_m / (WAVELENGTH_M / 2) * 2) / 2
    assert steps == pytest.approx(array.virtual_m / (WAVELENGTH_M / 2), abs=1e-9)
    for row in np.unique(steps[:, 1]):
        across = np.unique(steps[steps[:, 1] == row, 0])
        if row == steps[:, 1].min():
            assert np.diff(across) == pytest.approx(np.ones(across.size - 1))
    count = {"1x4": 4, "1x8": 8, "8x8": 8, "3x4": 8, "12x16": 86}[name]
    lowest = steps[steps[:, 1] == steps[:, 1].min(), 0]
    assert np.unique(lowest).size == count


def test_a_file_with_an_array(tmp_path: Path) -> None:
    by_name = loaded(tmp_path, {"preset": "3x4", "slot_s": 2e-5})
    assert len(by_name.channels) == 12
    assert by_name.channels[-1].start_offset_s == pytest.approx(4e-5)
    given = {
        "transmitters": [[0, 0, 0]],
        "receivers": [[-0.001, 0, 0], {"position_m": [0.001, 0, 0], "polarisation": "V"}],
    }
    channels = loaded(tmp_path, given).channels
    assert channels[1].rx == Element((0.001, 0.0, 0.0), polarisation="V")
    assert channels[1].reference_gain is False


def test_channels_return_from_plain_json() -> None:
    channels = array_preset("3x4", WAVELENGTH_M).channels(Burst(1e4, 8))
    again = channels_from_dict(json.loads(json.dumps(channels_to_dict(channels))))
    assert again == channels
    assert channels_to_dict((SINGLE_CHANNEL,)) == []
    assert channels_from_dict([]) == (SINGLE_CHANNEL,)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        ({"preset": "4x3"}, "no array preset '4x3'; expected one of 1x4, 1x8"),
        ({"preset": 5}, "no array preset ''"),
        ([], r"Array is \[\]; expected an object"),
        ({"receivers": []}, "Array lacks transmitters; expected preset"),
        ({"transmitters": [], "receivers": [[0, 0, 0]]}, "no transmitters"),
        ({"transmitters": 5, "receivers": []}, "Array: transmitters is 5; expected a list"),
        ({"transmitters": [[0, 0]], "receivers": [[0, 0, 0]]}, "three finite"),
        ({"transmitters": [["a", 0, 0]], "receivers": [[0, 0, 0]]}, "three finite"),
        ({"transmitters": [{"place": 1}], "receivers": [[0, 0, 0]]}, "unknown field 'place'"),
        ({"transmitters": [[0, 0, 0]] * 2, "receivers": [[0, 0, 0]]}, "Elements 0 and 1 of the"),
        ({"preset": "3x4", "slot_s": 0}, "slot_s is 0"),
        (
            {"preset": "3x4", "slot_s": 6e-5},
            "3 transmitters in turn need 132.8 us",
        ),
        (
            {"preset": "12x16"},
            r"12 transmitters in turn need 153.6 us, .* interval is 100 us. .* at most 6510 Hz",
        ),
    ],
)
def test_arrays_that_cannot_be(tmp_path: Path, array: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        loaded(tmp_path, array)


def test_too_many_channels() -> None:
    with pytest.raises(ConfigError, match="has 5184 channels; expected at most 4096"):
        AntennaArray(linear_array(72, 0.01), linear_array(72, 0.01))
