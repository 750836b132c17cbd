# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that radarsim 0.1 saved, with the settings in the scene: opened, they have a radar's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.rig_settings import (
    RADAR_SETTINGS,
    migrate_scene,
    read_link_budget,
    read_measurement,
    read_path_options,
    settings,
)
from radarsim_addon.blender.scene import active_radar, radars, setup_rig
from radarsim_addon.contract import AntennaRecord
from radarsim_addon.errors import SceneError
from radarsim_addon.signal.radar import (
    FmcwWaveform,
    PhaseCodedPulse,
    PmcwWaveform,
    SteppedWaveform,
    Waveform,
)

pytestmark = pytest.mark.blender

DATA = Path(__file__).parents[2] / "data" / "version_0_1"
#: What was set in each file, by the names and in the units of today; the rest are defaults.
CHANGED: dict[str, dict[str, Any]] = {
    "rings_paper": {
        "extinction_length_m": 5250.0, "sampling_mode": "rings", "rings": 13,
        "width_px": 96, "height_px": 54, "samples": 1,
    },
    "paths_walls": {
        "max_reflections": 2, "max_standard_error": 0.12, "range_encoding": "materials",
        "polarisation": "vertical", "extinction": "wavelength", "bandwidth_hz": 150e6,
        "sampling_rate_hz": 180e6, "pulses": 8, "width_px": 48, "height_px": 32, "seed": 3,
        "snapshots": 1,
    },
    "paths_fmcw_moving": {
        "replicates": 2, "waveform_kind": "fmcw", "carrier_hz": 77e9, "bandwidth_hz": 300e6,
        "adc_samples": 128, "adc_start_s": 1e-6, "idle_s": 2e-6, "prf_hz": 20000.0, "pulses": 64,
        "width_px": 48, "height_px": 32, "use_link_budget": True, "transmit_power_w": 0.02,
        "transmit_loss_db": 1.0, "receive_loss_db": 1.5, "other_loss_db": 0.5,
        "noise_figure_db": 12.0, "antenna_temperature_k": 300.0,
    },
    "paths_pmcw_moving": {
        "replicates": 1, "waveform_kind": "pmcw", "carrier_hz": 24e9, "chip_duration_s": 5e-9,
        "code_degree": 6, "code_repeats": 4, "prf_hz": 50000.0, "pulses": 32, "width_px": 40,
        "height_px": 30,
    },
    "paths_deforming": {
        "replicates": 2, "motion_samples": 257, "carrier_hz": 10e9, "bandwidth_hz": 150e6,
        "chirp_duration_s": 1e-6, "sampling_rate_hz": 160e6, "prf_hz": 2000.0, "pulses": 32,
        "width_px": 32, "height_px": 24, "frame_mode": "range", "frame_start": 2, "frame_end": 4,
        "frame_step": 2,
    },
    "paths_orthographic": {
        "replicates": 2, "carrier_hz": 10e9, "polarisation": "horizontal", "bandwidth_hz": 150e6,
        "chirp_duration_s": 1e-6, "sampling_rate_hz": 160e6, "pulses": 8, "width_px": 48,
        "height_px": 32,
    },
    "paths_equirectangular": {
        "max_standard_error": 0.08, "refine_for": "objects", "range_encoding": "world",
        "waveform_kind": "stepped", "carrier_hz": 9.6e9, "step_hz": 1e6, "steps": 64, "pulses": 4,
        "prf_hz": 500.0, "width_px": 48, "height_px": 24,
    },
    "paths_bursts": {
        "replicates": 2, "visibility_updates": 3, "waveform_kind": "barker",
        "chip_duration_s": 10e-9, "prf_hz": 400.0, "pulses": 48, "width_px": 40, "height_px": 30,
    },
}  # fmt: skip
WAVEFORMS: dict[str, Any] = {
    "rings_paper": Waveform(5.3e9, 50e6, 2.5e-6, 60e6),
    "paths_walls": Waveform(5.3e9, 150e6, 2.5e-6, 180e6),
    "paths_fmcw_moving": FmcwWaveform(77e9, 300e6, 128, 10e6, 1e-6, None, 2e-6),
    "paths_pmcw_moving": PmcwWaveform(24e9, 5e-9, 6, 4),
    "paths_equirectangular": SteppedWaveform(9.6e9, 1e6, 64, 5e-6),
    "paths_bursts": PhaseCodedPulse(5.3e9, 10e-9, 13),
}


def open_old(name: str) -> Any:
    bpy.ops.wm.open_mainfile(filepath=str(DATA / f"{name}.blend"), load_ui=False)
    return bpy.context.scene


def values(radar: Any) -> dict[str, Any]:
    view = settings(radar)
    return {name: getattr(view, name) for name in RADAR_SETTINGS}


@pytest.mark.parametrize("name", CHANGED)
def test_every_value_of_an_old_file_is_kept(addon: Any, name: str) -> None:
    scene = open_old(name)
    (radar,) = radars(scene)
    assert radar == active_radar(scene) == bpy.data.objects["Radar"]
    defaults = {
        key: None if item.optional and not item.of.on else item.initial
        for key, item in RADAR_SETTINGS.items()
    }
    assert values(radar) == {**defaults, **CHANGED[name]}
    measurement = read_measurement(scene)
    if name in WAVEFORMS:
        assert measurement.waveform == WAVEFORMS[name]
    if name == "paths_walls":
        assert measurement.extinction_length_m == 299792458 / 5.3e9
    read_path_options(radar)
    assert not migrate_scene(scene)  # nothing is left of them
    assert "radarsim" not in scene


def test_antennas_of_an_old_file(addon: Any) -> None:
    scene = open_old("paths_fmcw_moving")
    budget = read_link_budget(active_radar(scene), 0.004)
    assert budget is not None
    beam = {"azimuth_beamwidth_deg": 30.0, "elevation_beamwidth_deg": 12.0}
    assert budget.transmitter == AntennaRecord("gaussian", beam)
    assert budget.receiver.kind == "array"
    array = {
        "columns": 4, "rows": 2, "column_taper": "hamming", "row_taper": "uniform",
        "steer_azimuth_deg": 5.0, "steer_elevation_deg": 0.0, "column_spacing_wavelengths": 0.5,
        "row_spacing_wavelengths": 0.5, "element_exponent": 1.0,
    }  # fmt: skip
    assert budget.receiver.parameters == array


def test_a_migrated_file_is_saved_and_opened(addon: Any, tmp_path: Path) -> None:
    scene = open_old("paths_walls")
    poses = {item.name: [list(row) for row in item.matrix_world] for item in scene.objects}
    expected = values(active_radar(scene))
    path = tmp_path / "new.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    scene = bpy.context.scene
    assert values(active_radar(scene)) == expected
    assert {i.name: [list(row) for row in i.matrix_world] for i in scene.objects} == poses


@pytest.mark.parametrize("parent", ["none", "empty"])
def test_a_light_without_a_rig_keeps_the_settings_itself(addon: Any, parent: str) -> None:
    """Nothing is added or moved: the light that transmits, or what carries it, is the radar."""
    scene = open_old("paths_walls")
    radar = active_radar(scene)
    expected = values(radar)
    names = set(scene.objects.keys())
    light = next(item for item in scene.objects if item.type == "LIGHT")
    stored = {"pulses": 5, "carrier_ghz": 24.0, "path_shifts": 9, "passes": 0, "emitter": light}
    if bpy.app.version >= (5, 0, 0):
        scene.bl_system_properties_get(do_create=True)["radarsim"] = stored
    else:
        scene["radarsim"] = stored
    if parent == "none":
        light.parent = None
        radar = light
    assert migrate_scene(scene)
    assert active_radar(scene) == radar
    view = settings(radar)
    assert (view.pulses, view.carrier_hz, view.replicates, view.snapshots) == (5, 24e9, 9, 1)
    assert radar.radarsim.light == light
    assert set(scene.objects.keys()) == names
    assert expected["pulses"] == 8


def test_settings_without_a_radar_wait_for_one(addon: Any) -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    stored = {"pulses": 77, "acquisition": 0, "max_bounces": 2}
    if bpy.app.version >= (5, 0, 0):
        scene.bl_system_properties_get(do_create=True)["radarsim"] = stored
    else:
        scene["radarsim"] = stored
    assert not migrate_scene(scene)
    with pytest.raises(SceneError, match="no transmitter"):
        active_radar(scene)
    assert bpy.ops.radarsim.setup_rig() == {"FINISHED"}
    view = settings(active_radar(scene))
    assert (view.pulses, view.sampling_mode, view.max_reflections) == (77, "rings", 3)


def test_a_rig_takes_its_radar_into_another_file(addon: Any, tmp_path: Path) -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig = setup_rig(bpy.context.scene)
    settings(rig).carrier_hz = 76.512345678901e9
    settings(rig).transmitter.kind = "cosine"
    group = bpy.data.collections.new("Car radar")
    bpy.context.scene.collection.children.link(group)
    for item in (rig, *rig.children):
        group.objects.link(item)
    path = str(tmp_path / "car.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    for link in (False, True):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        scene = bpy.context.scene
        own = setup_rig(scene)
        settings(own).pulses = 3
        with bpy.data.libraries.load(path, link=link) as (_, wanted):
            wanted.collections = ["Car radar"]
        scene.collection.children.link(wanted.collections[0])
        assert len(radars(scene)) == 2
        assert active_radar(scene) == own  # chosen when it was set up
        (brought,) = [radar for radar in radars(scene) if radar != own]
        scene.radarsim_rig = brought
        assert active_radar(scene) == brought
        assert settings(brought).carrier_hz == 76.512345678901e9
        assert settings(brought).transmitter.kind == "cosine"
        assert (settings(own).pulses, settings(brought).pulses) == (3, 128)
        assert read_measurement(scene).waveform.carrier_hz == 76.512345678901e9
