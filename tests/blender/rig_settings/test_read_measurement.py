# SPDX-License-Identifier: GPL-3.0-or-later
"""What the settings of a radar become: measurement, output folder."""

from __future__ import annotations

from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import rig_settings as properties
from radarsim_addon.errors import ConfigError, OutputError
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


@pytest.fixture
def scene(addon: Any) -> Any:
    return rs.ring_scene()


def test_settings_are_what_was_typed(scene: Any) -> None:
    settings = rs.radar()
    settings.carrier_ghz, settings.bandwidth_mhz = 77.1, 153.3
    settings.chirp_duration_us, settings.sampling_rate_mhz = 12.3, 160.7
    settings.prf_hz, settings.snapshot_interval_ms = 1234.5, 7.1
    found = properties.read_measurement(scene)
    assert found.waveform.carrier_hz == 77.1e9
    assert found.waveform.bandwidth_hz == 153.3e6
    assert found.waveform.duration_s == 12.3e-6
    assert found.waveform.sampling_rate_hz == 160.7e6
    assert found.burst.prf_hz == 1234.5
    assert found.snapshot_interval_s == 7.1e-3


def test_defaults_are_the_paper(scene: Any) -> None:
    view = properties.settings(bpy.data.objects["Radar"])
    view.ring_step_m, view.rings = 250.0, 21
    found = properties.read_measurement(scene)
    assert (found.rings, found.ring_step_m, found.snapshots, found.snapshot_interval_s) == (
        21,
        250.0,
        2,
        0.01,
    )
    assert found.waveform == rs.WAVEFORM
    assert found.burst == rs.BURST
    settings = rs.radar()
    assert settings.fm_rate_mhz_per_us == pytest.approx(20.0)
    settings.chirp_duration_us, settings.fm_rate_mhz_per_us = 2.3, 20.0
    assert properties.read_measurement(scene).waveform.bandwidth_hz == 46e6


def test_frames_from_the_settings(scene: Any) -> None:
    settings = rs.radar()
    scene.frame_set(5)
    assert properties.read_measurement(scene).frames == (5,)
    settings.frame_mode = "range"
    settings.frame_start, settings.frame_end, settings.frame_step = 2, 7, 2
    assert properties.read_measurement(scene).frames == (2, 4, 6)
    settings.frame_end = 1
    with pytest.raises(ConfigError, match="Frames 2 to 1 are none"):
        properties.read_measurement(scene)
    settings.frame_mode = "scene"
    scene.frame_start, scene.frame_end, scene.frame_step = 10, 12, 1
    assert properties.read_measurement(scene).frames == (10, 11, 12)


def test_extinction_length(scene: Any) -> None:
    settings = rs.radar()
    assert properties.read_measurement(scene).extinction_length_m == 0.0
    settings.extinction_length_m = 525.0
    assert properties.read_measurement(scene).extinction_length_m == 525.0
    settings.extinction = "wavelength"
    assert properties.read_measurement(scene).extinction_length_m == 299792458 / 5.3e9


def test_command_line_overrides_the_settings_in_float64(scene: Any) -> None:
    found = properties.read_measurement(
        scene, carrier_hz=76.123456789e9, rings=3, snapshots=1, frames=(1, 2), rain_mm_per_h=12.5
    )
    assert found.weather.rain_mm_per_h == 12.5
    assert found.waveform.carrier_hz == 76.123456789e9
    assert (found.rings, found.snapshots, found.frames, found.burst.prf_hz) == (
        3,
        1,
        (1, 2),
        1000.0,
    )
    with pytest.raises(ConfigError, match="Number of rings is -1"):
        properties.read_measurement(scene, rings=-1)


def test_unsaved_file_has_no_relative_folder(scene: Any) -> None:
    with pytest.raises(OutputError, match="never saved"):
        properties.output_folder(bpy.data.objects["Radar"])
    rs.radar().output_folder = " "
    with pytest.raises(OutputError, match="No output folder"):
        properties.output_folder(bpy.data.objects["Radar"])
