# SPDX-License-Identifier: GPL-3.0-or-later
"""Power budgets in Blender: settings, patterns in the viewport, watts and cross sections."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from scipy.stats import ncx2

from radarsim_addon import blender as radarsim
from radarsim_addon import contract
from radarsim_addon.blender import rig_settings as properties
from radarsim_addon.blender.headless import make_job
from radarsim_addon.blender.plan import PRESETS
from radarsim_addon.blender.scene import active_radar, rig
from radarsim_addon.blender.ui import link_budget_panel as system_panel
from radarsim_addon.contract import AntennaRecord, LinkBudget
from radarsim_addon.errors import ConfigError, SettingNameError
from radarsim_addon.physics.radar_equation import bistatic_power_w
from radarsim_addon.signal.decoding import frame_paths, open_frame
from radarsim_addon.signal.detection import FrameBudget, matching_objects, object_echoes
from radarsim_addon.signal.paths.paths import path_power_w
from radarsim_addon.signal.radar import make_system
from radarsim_addon.signal.runs import open_run
from radarsim_addon.signal.scattering import FrameSpeckle
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender

WAVELENGTH_M = rs.WAVEFORM.wavelength_m
GAUSSIAN = {"azimuth_beamwidth_deg": 9.0, "elevation_beamwidth_deg": 5.0}


# -- settings --------------------------------------------------------------------------------------


@pytest.fixture
def scene(addon: Any) -> Any:
    made = rs.new_scene()
    rs.add_plate(10.0)
    rs.radar().width_px = rs.radar().height_px = 16
    return made


def test_an_antenna_takes_a_mapping(scene: Any) -> None:
    settings = properties.settings(active_radar(scene))
    settings.transmitter.peak_gain_dbi = 8.5
    settings.transmitter = {"kind": "gaussian", "azimuth_beamwidth_deg": 9.0}
    antenna = settings.transmitter
    assert (antenna.kind, antenna.azimuth_beamwidth_deg) == ("gaussian", 9.0)
    assert antenna.peak_gain_dbi == 8.5  # not in the mapping
    assert settings.receiver.kind == "isotropic"
    assert settings.values()["transmitter"]["azimuth_beamwidth_deg"] == 9.0
    with pytest.raises(SettingNameError, match="'beamwidth'"):
        settings.transmitter = {"beamwidth": 9.0}
    with pytest.raises(ConfigError, match="Azimuth beamwidth"):
        settings.transmitter = {"azimuth_beamwidth_deg": -1.0}
    with pytest.raises(ConfigError, match=r"transmitter is 3; expected a mapping .*kind, "):
        settings.transmitter = 3


def test_settings_reach_the_run(scene: Any, tmp_path: Path) -> None:
    settings = rs.radar()
    settings.use_link_budget = True
    settings.transmit_power_w = 0.1
    settings.noise_figure_db = 4.7
    settings.transmitter.kind = "gaussian"
    settings.transmitter.azimuth_beamwidth_deg = 9.0
    settings.transmitter.elevation_beamwidth_deg = 5.0
    settings.receiver.kind = "array"
    settings.receiver.use_peak_gain_dbi = True
    settings.receiver.peak_gain_dbi = 8.5
    job = make_job(scene, scene.view_layers[0], tmp_path / "run")
    with job:
        pass
    system = open_run(tmp_path / "run").record.link_budget
    assert system is not None
    assert (system.transmit_power_w, system.noise_figure_db) == (0.1, 4.7)  # as typed
    assert system.transmitter == AntennaRecord("gaussian", GAUSSIAN)
    assert system.receiver.parameters["peak_gain_dbi"] == 8.5
    assert make_system(system, WAVELENGTH_M).receiver.peak_gain == pytest.approx(10**0.85)
    # a power budget changes no render: the same run goes on without it
    settings.use_link_budget = False
    with make_job(scene, scene.view_layers[0], tmp_path / "run"):
        pass
    assert open_run(tmp_path / "run").record.link_budget is None


def test_every_kind_of_antenna_can_be_set(scene: Any, tmp_path: Path) -> None:
    settings = rs.radar()
    settings.use_link_budget = True
    table = tmp_path / "cuts.csv"
    table.write_text(
        "cut,angle_deg,gain_db\nazimuth,-30,-20\nazimuth,0,12\nazimuth,30,-20\n"
        "elevation,-40,-20\nelevation,0,12\nelevation,40,-20\n"
    )
    settings.receiver.file = str(table)
    for kind in pattern_kinds():
        settings.receiver.kind = kind
        system = system_panel.scene_system(scene)
        assert system is not None
        assert float(system.receiver.gain((0, 0, -1.0))) > 0
    assert "file" not in system.record.receiver.parameters  # the last one is the table
    settings.receiver.file = str(tmp_path / "none.csv")
    with pytest.raises(ConfigError, match="does not exist"):
        system_panel.scene_system(scene)


def pattern_kinds() -> list[str]:
    kinds = bpy.types.Object.bl_rna.properties["radarsim"].fixed_type.properties["receiver"]
    return [item.identifier for item in kinds.fixed_type.properties["kind"].enum_items]


def by_hand_db(preset: str, range_m: float) -> float:
    """SNR of 10 m^2: P G^2 lambda^2 sigma / ((4 pi)^3 R^4) over k 290 K F, times the time that is
    added up, less 1.34 dB for each of two Hamming windows.
    """
    values = PRESETS[preset].settings
    beam = values["transmitter"]
    # a Gaussian beam of these widths, over a plane
    widths = [math.radians(beam[f"{axis}_beamwidth_deg"]) for axis in ("azimuth", "elevation")]
    gain_db = 10 * math.log10(16 * math.log(2) / math.prod(widths))
    wavelength_m = 299_792_458.0 / values["carrier_hz"]
    if values["waveform_kind"] == "fmcw":
        pulse_s = values["adc_samples"] / values["adc_rate_hz"]
    else:
        pulse_s = values["chirp_duration_s"]
    power_db = 10 * math.log10(values["transmit_power_w"] * 10 * pulse_s * values["pulses"])
    spread_db = 30 * math.log10(4 * math.pi) + 40 * math.log10(range_m)
    noise_db = 10 * math.log10(1.380649e-23 * 290) + values["noise_figure_db"]
    return power_db + 2 * gain_db + 20 * math.log10(wavelength_m) - spread_db - noise_db - 2 * 1.34


@pytest.mark.parametrize("preset", [name for name in PRESETS if name != "paper"])
def test_panel_says_what_a_target_brings(addon: Any, preset: str) -> None:
    """Within 0.7 dB: wide beams are not those over a plane, and windows of 16 pulses lose more."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    radar = radarsim.add_radar(preset=preset)
    scene = bpy.context.scene

    def rows() -> dict[str, str]:
        measurement = properties.read_measurement(scene)
        return dict(system_panel.budget_rows(system_panel.scene_system(scene), measurement))

    found = rows()
    (text,) = (value for name, value in found.items() if name.startswith("SNR at "))
    snr_db = float(text.removesuffix(" dB (10 dBsm)"))
    assert snr_db == pytest.approx(by_hand_db(preset, radar.radarsim.range_stop_m), abs=0.7)
    number, unit = found[""].split("detected to ")[1].split(" (Pd 0.9, Pfa 1e-6)")[0].split()
    range_m = float(number) * {"m": 1.0, "km": 1e3}[unit]
    assert by_hand_db(preset, range_m) == pytest.approx(13.14, abs=0.7)
    beyond = preset not in ("marine_x_band", "sar_c_band")
    assert ("beyond the longest range" in found[""]) == beyond
    radar.radarsim.transmit_loss_db, radar.radarsim.other_loss_db = 1.0, 4.0
    (text,) = (value for name, value in rows().items() if name.startswith("SNR at "))
    assert float(text.split()[0]) == pytest.approx(snr_db - 5.0, abs=0.11)
    eirp = float(rows()["EIRP"].split()[0])
    assert eirp == pytest.approx(float(found["EIRP"].split()[0]) - 1.0, abs=0.11)


def test_rain_takes_from_the_range_of_detection(addon: Any) -> None:
    """10 mm/h take 5.82 dB/km at 77 GHz (P.838-3): at 120 m 1.4 dB both ways."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    radar, scene = radarsim.add_radar(), bpy.context.scene
    system = system_panel.scene_system(scene)
    dry, radar.radarsim.rain_mm_per_h = properties.read_measurement(scene), 10.0
    wet = properties.read_measurement(scene)
    snr = [system_panel.TargetSnr.of(system, one) for one in (dry, wet)]
    assert snr[0].at(120.0) - snr[1].at(120.0) == pytest.approx(2 * 0.12 * 5.82, rel=0.01)
    range_m = [one.longest_m(13.14) for one in snr]
    assert range_m[1] < range_m[0]
    assert [one.at(far_m) for one, far_m in zip(snr, range_m, strict=True)] == pytest.approx(
        [13.14] * 2
    )


def test_the_needed_snr_is_that_of_a_steady_target() -> None:
    """Marcum's Q function, integrated: a Rice variable beyond the threshold of Rayleigh noise."""
    for detected, false_alarms in ((0.9, 1e-6), (0.5, 1e-4), (0.99, 1e-8)):
        snr = 10 ** (system_panel.needed_snr_db(detected, false_alarms) / 10)
        threshold = -2 * math.log(false_alarms)
        assert ncx2.sf(threshold, 2, 2 * snr) == pytest.approx(detected, abs=0.03)


@pytest.mark.parametrize("watts", [0.016, 1.0, 1000.0, 3.2e-7])
def test_powers_are_fields_in_dbm(scene: Any, watts: float) -> None:
    rig = active_radar(scene).radarsim
    group = properties.settings(active_radar(scene))
    group.transmit_power_w = watts
    assert rig.transmit_power_dbm == pytest.approx(10 * math.log10(watts) + 30, abs=1e-4)
    rig.transmit_power_dbm = 12.0
    assert group.transmit_power_w == pytest.approx(10**-1.8, rel=1e-12)
    light = next(item for item in scene.objects if item.type == "LIGHT").data
    light.radarsim_eirp_dbm = 29.0
    assert light.energy == pytest.approx(10**-0.1, rel=1e-6)
    light.energy = watts
    assert light.radarsim_eirp_dbm == pytest.approx(10 * math.log10(watts) + 30, abs=1e-4)


# -- patterns in the viewport ----------------------------------------------------------------------


def test_patterns_are_drawn_and_removed(scene: Any) -> None:
    with pytest.raises(RuntimeError, match="There are no antennas"):
        bpy.ops.radarsim.draw_patterns()
    settings = rs.radar()
    settings.use_link_budget = True
    settings.transmitter.kind = "gaussian"
    before = {item.name for item in bpy.data.objects}
    for _ in range(2):  # the second time in place of the first
        assert bpy.ops.radarsim.draw_patterns(size=3.0) == {"FINISHED"}
    made = [item for item in bpy.data.objects if item.name not in before]
    assert sorted(item.name for item in made) == ["Radar Receive Pattern", "Radar Transmit Pattern"]
    for item in made:
        assert item.hide_render and item.hide_select and item.display_type == "WIRE"
    transmit = bpy.data.objects["Radar Transmit Pattern"]
    assert transmit.parent.type == "LIGHT"
    bpy.context.view_layer.update()
    world = np.array([transmit.matrix_world @ v.co for v in transmit.data.vertices])
    tip = world[np.argmax(np.linalg.norm(world, axis=1))]
    # boresight is the world's +Y; the top of a beam is flat to 1e-4 rad in float64
    np.testing.assert_allclose(tip, [0, 3, 0], atol=2e-3)
    assert bpy.ops.radarsim.remove_patterns() == {"FINISHED"}
    assert {item.name for item in bpy.data.objects} == before
    assert not [mesh for mesh in bpy.data.meshes if mesh.name.startswith("Radar ")]


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [
        ("gaussian", GAUSSIAN),
        (
            "array",
            {"columns": 8, "rows": 8, "steer_azimuth_deg": 25.0, "steer_elevation_deg": -10.0},
        ),
        ("isotropic", {}),
    ],
)
def test_pattern_surface_is_the_gain(kind: str, parameters: dict[str, Any]) -> None:
    record = LinkBudget(transmitter=AntennaRecord(kind, parameters))
    antenna = make_system(record, WAVELENGTH_M).transmitter
    vertices, faces = rig.pattern_surface(antenna)
    radius = np.linalg.norm(vertices, axis=1)
    assert radius.max() == pytest.approx(1.0, abs=1e-6)
    seen = radius > 0
    gain_db = 10 * np.log10(antenna.gain(vertices[seen]))
    np.testing.assert_allclose(radius[seen], 1 + (gain_db - gain_db.max()) / 40, atol=1e-9)
    # closed: every edge has two faces, the two ends of poles and seam apart
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert set(count) <= {1, 2}


def test_patterns_are_not_measured(scene: Any, tmp_path: Path) -> None:
    settings = rs.radar()
    settings.use_link_budget = True
    powers = []
    for number in range(2):
        if number:
            bpy.ops.radarsim.draw_patterns(size=20.0)  # around the plate
        run = ph.run_paths(tmp_path / f"run{number}", width_px=16, height_px=16)
        powers.append(run.table()["power_w"].copy())
        assert run.record().objects == ["Plate"]
    assert powers[0].size > 50
    np.testing.assert_array_equal(*powers)


# -- watts and square metres -----------------------------------------------------------------------


def rendered_plate(
    folder: Path,
    range_m: float,
    tilt_deg: float,
    emitter_at: tuple[float, float, float] | None = None,
) -> contract.PathsRecord:
    """A Lambert plate of 0.5 m and albedo 0.6 in a frame that fits it."""
    rs.new_scene()
    ph.plate_at(range_m, 0.5, ph.lambert(0.6), tilt_deg)
    ph.field_of_view(2 * math.degrees(math.atan(0.325 / range_m)))
    if emitter_at is not None:
        bpy.data.objects["Radar Emitter"].location = (emitter_at[0], emitter_at[2], -emitter_at[1])
    return ph.run_paths(folder, options={"replicates": 4}, width_px=64, height_px=64).record()


def sigma_plate(range_m: float, tilt_deg: float, emitter_at: Any = None) -> tuple[float, float]:
    """4 rho A cos cos, and the distance from the emitter."""
    at = np.zeros(3) if emitter_at is None else np.array(emitter_at)
    to_emitter = at - [0, range_m, 0]
    there = float(np.linalg.norm(to_emitter))
    normal = np.array([0, -math.cos(math.radians(tilt_deg)), math.sin(math.radians(tilt_deg))])
    return 4 * 0.6 * 0.25 * float(normal @ to_emitter) / there * float(-normal[1]), there


@pytest.mark.parametrize("tilt_deg", [0.0, 50.0])
def test_plate_through_cycles_from_10_m_to_10_km(bpy: Any, tmp_path: Path, tilt_deg: float) -> None:
    """Absolute power within 0.05 dB, slope R^-4 within 0.01."""
    ranges = (10.0, 100.0, 1000.0, 10_000.0)
    powers = []
    for range_m in ranges:
        folder = tmp_path / f"run{range_m:.0f}"
        record = rendered_plate(folder, range_m, tilt_deg)
        (echo,) = object_echoes(open_run(folder).frame(1), rs.WAVEFORM.carrier_hz)
        sigma, _ = sigma_plate(range_m, tilt_deg)
        assert 10 * math.log10(echo.rcs_m2 / sigma) == pytest.approx(0, abs=0.05)
        power = float(
            bistatic_power_w(record.transmitter.eirp_w, sigma, range_m, range_m, WAVELENGTH_M)
        )
        assert 10 * math.log10(echo.power_w / power) == pytest.approx(0, abs=0.05)
        powers.append(echo.power_w)
    slope = np.polyfit(np.log10(ranges), np.log10(powers), 1)[0]
    assert slope == pytest.approx(-4, abs=0.01)


def test_bistatic_plate_through_cycles(bpy: Any, tmp_path: Path) -> None:
    at = (-60.0, 40.0, 25.0)
    record = rendered_plate(tmp_path / "run", 100.0, 20.0, at)
    np.testing.assert_allclose(np.array(record.transmitter.matrix_world)[:3, 3], at, atol=1e-4)
    (echo,) = object_echoes(open_run(tmp_path / "run").frame(1), rs.WAVEFORM.carrier_hz)
    sigma, there = sigma_plate(100.0, 20.0, at)
    assert 10 * math.log10(echo.rcs_m2 / sigma) == pytest.approx(0, abs=0.05)
    power = float(bistatic_power_w(record.transmitter.eirp_w, sigma, there, 100.0, WAVELENGTH_M))
    assert 10 * math.log10(echo.power_w / power) == pytest.approx(0, abs=0.05)


def test_swept_beam_through_cycles(bpy: Any, tmp_path: Path) -> None:
    """A rig that turns over a small plate: the two-way pattern within 0.05 dB above -40 dB."""
    scene = rs.new_scene()
    ph.plate_at(200.0, 0.1, ph.lambert(1.0))
    ph.field_of_view(0.06)
    empty = bpy.data.objects["Radar"]
    aperture = AntennaRecord("aperture", {"width_m": 0.6, "height_m": 0.3})
    beam = AntennaRecord("gaussian", GAUSSIAN)
    record = LinkBudget(10.0, aperture, beam)
    system = make_system(record, WAVELENGTH_M)
    # the angle of the rig in world Z; positive turns the beam to the left of the plate
    angles_deg = (0.0, 1.0, -2.0, 3.0, -4.0, 4.6, -5.1, -6.5, 8.0, -9.5)
    start = tuple(empty.rotation_euler)
    levels, expected = [], []
    for number, angle_deg in enumerate(angles_deg):
        empty.rotation_euler = (start[0], start[1], start[2] + math.radians(angle_deg))
        # lens shift keeps the plate in the narrow frame of a receiver that looks elsewhere
        frame_width = 2 * math.tan(math.radians(0.03))
        scene.camera.data.shift_x = math.tan(math.radians(angle_deg)) / frame_width
        folder = tmp_path / f"run{number}"
        ph.run_paths(folder, width_px=64, height_px=64)
        run = open_run(folder)
        budget = FrameBudget(open_frame(run.frame(1), link_budget=record))
        paths = budget.apply(frame_paths(run.frame(1)))
        plain = path_power_w(frame_paths(run.frame(1)), WAVELENGTH_M).sum()
        levels.append(10 * math.log10(path_power_w(paths, WAVELENGTH_M).sum() / plain))
        a = math.radians(angle_deg)
        # closed forms: sinc^2 of the aperture, and -3 dB at half the beamwidth
        one_way = np.sinc(0.6 / WAVELENGTH_M * math.sin(a)) ** 2 * 2.0 ** -(
            (2 * angle_deg / GAUSSIAN["azimuth_beamwidth_deg"]) ** 2
        )
        peak = system.transmitter.peak_gain * system.receiver.peak_gain * 10.0 / 1e6
        expected.append(10 * math.log10(one_way * peak))
    assert min(expected) > max(expected) - 40
    np.testing.assert_allclose(levels, expected, atol=0.05)


# -- surfaces --------------------------------------------------------------------------------------


def test_runs_know_collections_and_roughness(bpy: Any, tmp_path: Path) -> None:
    scene = rs.new_scene()
    plate = rs.add_plate(10.0)
    inner, outer = bpy.data.collections.new("Inner"), bpy.data.collections.new("Outer")
    scene.collection.children.link(outer)
    outer.children.link(inner)
    inner.objects.link(plate)
    material = plate.material_slots[0].material
    material["radarsim_rms_height_m"] = 0.0004
    material["radarsim_correlation_length_m"] = 0.004
    run = ph.run_paths(tmp_path / "run", width_px=16, height_px=16)
    frame = open_run(run.folder).frame(1)
    record = frame.scene()
    assert record is not None
    (item,) = record.objects
    assert item.collections == ["Inner", "Outer"]
    assert (item.rms_height_m, item.correlation_length_m) == (0.0004, 0.004)
    assert matching_objects(frame, "Outer") == ["Plate"]
    radar = open_run(run.folder).radar
    speckle = FrameSpeckle(open_frame(frame, radar=radar), 0)
    assert {item.subjects for item in speckle.findings} == {("Plate",)}
    assert speckle.findings[0].code.startswith("kirchhoff-")
    # k h = 0.044: nearly all of the power is coherent (Ament), which paths do not form
    report = speckle.report()
    assert report is not None
    kh = 2 * math.pi / WAVELENGTH_M * 0.0004
    assert report.coherent_power_fraction == pytest.approx(math.exp(-((2 * kh) ** 2)), abs=2e-4)
    assert report.coherent_objects == ("Plate",)


def test_speckle_moves_with_an_animated_object(bpy: Any, tmp_path: Path) -> None:
    """A plate and its radar carried along together, and turned: the same speckle in both frames."""
    rs.new_scene()
    plate = ph.plate_at(40.0, 6.0, ph.lambert(0.5))
    ph.field_of_view(12.0)
    carrier = bpy.data.objects.new("Carrier", None)
    bpy.context.scene.collection.objects.link(carrier)
    for item in (plate, bpy.data.objects["Radar"]):
        item.parent = carrier
    carrier.keyframe_insert("location", frame=1)
    carrier.keyframe_insert("rotation_euler", frame=1)
    carrier.location, carrier.rotation_euler = (30.0, -7.0, 3.0), (0.2, -0.1, 0.7)
    carrier.keyframe_insert("location", frame=10)
    carrier.keyframe_insert("rotation_euler", frame=10)
    still = {"motion": "off"}  # within a burst; the frames differ all the same
    run = ph.run_paths(tmp_path / "run", frames=(1, 10), options=still, width_px=48, height_px=48)
    opened = open_run(run.folder)
    found = []
    for number in (1, 10):
        frame = opened.frame(number)
        paths = FrameSpeckle(open_frame(frame), 0, 1.0).apply(frame_paths(frame))
        assert paths.phasors is not None
        phase = np.exp(-2j * np.pi * paths.length_m / WAVELENGTH_M)
        found.append(np.sqrt(path_power_w(paths, WAVELENGTH_M)) * paths.phasors * phase)
    one, other = (np.sum(values) for values in found)
    # float32 poses in Blender: 1e-6 of 40 m are a thousandth of the wavelength
    assert abs(one - other) < 0.05 * abs(one)
    seed = FrameSpeckle(open_frame(opened.frame(1)), 1, 1.0)
    phasors = seed.apply(frame_paths(opened.frame(1))).phasors
    assert phasors is not None
    assert abs(np.vdot(phasors, found[0] / np.abs(found[0]))) < 0.2 * phasors.size
