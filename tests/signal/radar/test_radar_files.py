# SPDX-License-Identifier: GPL-3.0-or-later
"""Waveforms and radars from files, and what is said of those that do not fit."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError, FrameFileError
from radarsim_addon.signal import (
    ArbitraryPulse,
    Burst,
    load_radar,
    synthesize,
    waveform_from_dict,
    waveform_to_dict,
)
from radarsim_addon.signal.maps import range_process
from radarsim_addon.signal.radar import AnyWaveform
from radarsim_addon.signal.radar.radar_files import load_samples
from tests.signal.oracle import unit_paths
from tests.signal.waveform_kinds import ALL, BARKER13, FMCW, PMCW, STEPPED, burst_of


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
        ({"kind": "sonar"}, "sonar.*expected one of arbitrary"),
        ({"kind": ["lfm"]}, "of kind \\[.lfm.\\]; expected one of arbitrary"),
        ({"kind": "fmcw", "carrier_hz": 77e9}, "lacks bandwidth_hz, adc_samples"),
        ({**waveform_to_dict(FMCW), "slope": 1}, "unknown field 'slope'"),
        (
            {**waveform_to_dict(FMCW), "carrier_hz": "77e9"},
            "carrier_hz: Carrier is '77e9'",
        ),
        ({**waveform_to_dict(FMCW), "carrier_hz": 77.0}, "check the units"),
        ({**waveform_to_dict(FMCW), "ramp_s": 1e-6}, "ends before the ADC"),
        ({**waveform_to_dict(FMCW), "idle_s": -1.0}, "Idle time"),
        ({**waveform_to_dict(FMCW), "adc_samples": 1.5}, "ADC samples is 1.5"),
        ({**waveform_to_dict(PMCW), "code_degree": 40}, "Code degree is 40"),
        ({**waveform_to_dict(BARKER13), "code_length": 6}, "Code length is 6"),
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
    echoes = synthesize(unit_paths(radar, [20.0]), radar, range_limits_m=(50.0, 60.0))
    with pytest.raises(ConfigError, match="range ends at"):
        range_process(echoes)
