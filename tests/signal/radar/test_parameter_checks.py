# SPDX-License-Identifier: GPL-3.0-or-later
"""Slips of a unit are told with what they do to the scene; what may be meant is not."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.findings import Finding
from radarsim_addon.signal.pipeline import main
from radarsim_addon.signal.radar import (
    AnyWaveform,
    Burst,
    FmcwWaveform,
    PhaseCodedPulse,
    PmcwWaveform,
    Radar,
    SteppedWaveform,
    Waveform,
    find_suspicious_parameters,
)
from tests.signal.synthetic import Setup, points, write_run

BURST = Burst(1000.0, 128)


def lfm(**change: float) -> Waveform:
    """The paper's pulse, changed."""
    paper = {
        "carrier_hz": 5.3e9,
        "bandwidth_hz": 50e6,
        "chirp_duration_s": 2.5e-6,
        "sampling_rate_hz": 60e6,
    }
    return Waveform(**{**paper, **change})


@pytest.mark.parametrize(
    ("waveform", "message"),
    [
        # c / 2B of 150 Hz is 999.308 km
        (lfm(bandwidth_hz=150.0), r"bandwidth of 150 Hz resolves 999.31 km \(c / 2B\)"),
        (FmcwWaveform(77e9, 150.0, 256, 10e6), "of 150 Hz .*ranges end at 5000 m.*Raise the band"),
        (SteppedWaveform(5.3e9, 1.0, 64, 1e-6), "of 64 Hz .*frequency steps.*kHz, us and ns in"),
        (PmcwWaveform(77e9, 50e-6, 3), "of 20 kHz .*us and ns in the panel"),
        (PhaseCodedPulse(77e9, 50e-6, 13), "of 20 kHz .*or shorter chips"),
        (lfm(bandwidth_hz=150e3), "150 kHz x 2.5e-06 s = 0.375.*at least 400 kHz"),
        # c / 40 kHz is 7.5 km
        (
            Waveform(40e3, 40e3, 1e-4, 50e3),
            "carrier of 40 kHz has a wavelength of 7494.8 m, but ranges end at 5000 m",
        ),
    ],
)
def test_a_useless_waveform_is_told_once(waveform: AnyWaveform, message: str) -> None:
    assert_one(find_suspicious_parameters(Radar(waveform, BURST), 5000.0, 10.0), message)


def assert_one(found: list[Finding], message: str) -> None:
    """One finding, of these words."""
    assert len(found) == 1
    assert re.search(message, found[0].message)


def test_a_burst_beyond_the_animation_is_told() -> None:
    slow = Radar(lfm(), Burst(1.0, 128))
    # lambda PRF / 4 = 0.0141 m/s
    words = "1 Hz lasts 128 s, the animation 10 s. .* only 0.0141 m/s"
    assert_one(find_suspicious_parameters(slow, 5000.0, 10.0), words)
    assert find_suspicious_parameters(slow, 5000.0, 200.0) == []


@pytest.mark.parametrize(
    ("radar", "reach_m"),
    [
        (Radar(lfm(), BURST), 5000.0),
        # over-the-horizon radar: 10 MHz, 20 kHz, 3000 km
        (Radar(Waveform(10e6, 20e3, 10e-3, 40e3), Burst(50.0, 64)), 3e6),
        # an unmodulated pulse has a bandwidth of 1 / T
        (Radar(lfm(bandwidth_hz=0.4e6), BURST), 5000.0),
        # 40 kHz of sound in air as a wave of the same length: 35 GHz
        (Radar(FmcwWaveform(35e9, 3.5e9, 256, 10e6), BURST), 5.0),
    ],
)
def test_what_may_be_meant_is_not_told(radar: Radar, reach_m: float) -> None:
    assert find_suspicious_parameters(radar, reach_m, 10.0) == []


def test_a_pulse_between_two_samples_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"1e-11 s holds 0\.0006 samples.*check their units"):
        lfm(chirp_duration_s=1e-11)
    assert lfm(chirp_duration_s=2 / 60e6).sample_count == 2


def test_process_warns_of_hertz_for_megahertz(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    setup = Setup()
    write_run(tmp_path / "run", setup, points(setup, [(5, 6, 600.0, 0.0, 1e-6)]))
    fields: dict[str, Any] = {"carrier_hz": 5.3e9, "bandwidth_hz": 150.0}
    fields |= {"chirp_duration_s": 2.5e-6, "sampling_rate_hz": 60e6}
    radar = tmp_path / "radar.json"
    radar.write_text(json.dumps({"waveform": fields, "burst": {"prf_hz": 1e3, "pulses": 16}}))
    words = ["process", str(tmp_path / "run"), "--waveform", str(radar), "--no-plots"]
    assert main(words) == 0
    assert "999.31 km (c / 2B), but ranges end at 1000 m" in capsys.readouterr().out
