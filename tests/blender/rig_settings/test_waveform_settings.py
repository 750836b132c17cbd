# SPDX-License-Identifier: GPL-3.0-or-later
"""Waveforms in the panel and on the command line, and in the run's plan."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import rig_settings as properties
from radarsim_addon.blender.headless import make_job
from radarsim_addon.blender.ui.shown_results import ProcessingJob
from radarsim_addon.errors import ConfigError
from radarsim_addon.options import declared
from radarsim_addon.signal import (
    Burst,
    FmcwWaveform,
    PhaseCodedPulse,
    PmcwWaveform,
    Radar,
    SteppedWaveform,
    open_run,
    waveform_to_dict,
)
from radarsim_addon.signal.radar import AnyWaveform
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


@pytest.fixture
def scene(addon: Any) -> Any:
    made = rs.ring_scene(8)
    rs.radar().snapshots = "1"
    return made


def test_each_kind_becomes_its_waveform(scene: Any) -> None:
    settings = rs.radar()
    settings.carrier_ghz = 77.1
    expected: dict[str, AnyWaveform] = {
        "fmcw": FmcwWaveform(77.1e9, 153.3e6, 128, 5.1e6, 1.5e-6, None, 7.1e-6, True),
        "stepped": SteppedWaveform(77.1e9, 500.3e3, 64, 2.1e-6),
        "pmcw": PmcwWaveform(77.1e9, 1.3e-9, 9, 4),
        "barker": PhaseCodedPulse(77.1e9, 1.3e-9, 7),
    }
    settings.bandwidth_mhz, settings.adc_samples, settings.adc_rate_mhz = 153.3, 128, 5.1
    settings.adc_start_us, settings.idle_us, settings.real_adc = 1.5, 7.1, True
    settings.step_khz, settings.steps, settings.step_time_us = 500.3, 64, 2.1
    settings.chip_duration_ns, settings.code_degree, settings.code_repeats = 1.3, 9, 4
    settings.code_length = "7"
    for kind, waveform in expected.items():
        settings.waveform_kind = kind
        assert properties.read_measurement(scene).waveform == waveform
        assert all(
            hasattr(settings, item.shown_name)
            for item in declared(type(waveform)).values()
            if item.of.window
        )
    with pytest.raises(
        ConfigError, match="--chirp-duration-us given, which a waveform of kind 'barker'"
    ):
        properties.read_measurement(scene, chirp_duration_s=3e-6)


def test_a_radar_file_in_the_panel_and_on_the_command_line(
    scene: Any, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "radar é.json"
    waveform = FmcwWaveform(77e9, 1e9, 256, 10e6)
    file.write_text(json.dumps({"waveform": waveform_to_dict(waveform), "burst": {"pulses": 9}}))
    found = properties.read_measurement(scene, waveform_file=file)
    assert found.radar == Radar(waveform, Burst(1 / waveform.duration_s, 9))
    rs.radar().waveform_kind = "file"
    assert "Traceback" not in "".join(capfd.readouterr())
    with pytest.raises(ConfigError, match="No waveform file"):
        properties.read_measurement(scene)
    rs.radar().waveform_file = str(file)
    assert properties.read_measurement(scene).radar == found.radar
    # Materials follow the file, not the field, which keeps its 5.3 GHz.
    assert properties.carrier_hz(scene) == 77e9
    rs.radar().waveform_kind = "lfm"
    assert properties.carrier_hz(scene) == 5.3e9


def test_an_fmcw_run_is_rendered_and_processed(scene: Any, tmp_path: Path) -> None:
    settings = rs.radar()
    settings.waveform_kind = "fmcw"
    settings.bandwidth_mhz, settings.adc_samples, settings.adc_rate_mhz = 100.0, 64, 1.0
    settings.pulses = 4
    folder = tmp_path / "run"
    with make_job(scene, bpy.context.view_layer, folder) as job:
        for task in job.pending():
            job.start(task)
            job.render(task)
            job.finish(task)
    assert open_run(folder).radar.waveform == FmcwWaveform(5.3e9, 100e6, 64, 1e6)
    processing = ProcessingJob(folder)
    while not processing.step():
        pass
    assert processing.result.frames == [1]
    with np.load(folder / "products/frame_0001_profile.npz") as arrays:
        peak_m = arrays["range_m"][np.argmax(arrays["expected_power"])]
    assert peak_m == pytest.approx(10.0, abs=1.5)
