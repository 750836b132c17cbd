# SPDX-License-Identifier: GPL-3.0-or-later
"""The checklist of the tab: what it lists before a render, and what its buttons do."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

import bmesh

from radarsim_addon import blender as radarsim
from radarsim_addon.blender import addon as addon_module
from radarsim_addon.blender.plan import PRESETS
from radarsim_addon.blender.rig_settings import WAVEFORMS, read_measurement, settings
from radarsim_addon.blender.scene import active_radar
from radarsim_addon.blender.ui import scene_panel
from radarsim_addon.blender.ui.scene_panel import (
    RADARSIM_OT_select_subjects,
    RADARSIM_PT_scene,
    fixes_of,
    time_text,
    value_text,
)
from radarsim_addon.blender.ui.scene_reading import quick_findings, scene_record
from radarsim_addon.findings import Finding, finding
from tests.blender import radar_scenes as rs
from tests.blender import recording


@pytest.fixture
def scene(addon: Any, tmp_path: Path) -> Iterator[Any]:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.window_manager.radarsim.checked = ""
    yield bpy.context.scene


def listed() -> dict[str, recording.Button]:
    """Buttons of the scene panel: those that explain by their code, others by text or operator."""
    found = {}
    for button in recording.drawn(RADARSIM_PT_scene).buttons:
        code = button.values.get("code")
        found[code or button.text or button.operator] = button
    return found


def buttons_of(code: str) -> list[recording.Button]:
    """Buttons in the row of a finding, up to the one that explains it."""
    row: list[recording.Button] = []
    for button in recording.drawn(RADARSIM_PT_scene).buttons:
        row.append(button)
        if button.values.get("code") == code:
            return row[:-1]
        if "code" in button.values:
            row = []
    raise LookupError(code)


def fix_of(code: str) -> recording.Button:
    """The button that removes the cause of a finding."""
    others = "radarsim.select_subjects"
    (fix,) = (button for button in buttons_of(code) if button.operator != others)
    return fix


def quick() -> list[Finding]:
    """What the panel finds by itself."""
    measurement = read_measurement(bpy.context.scene)
    return quick_findings(bpy.context.scene, measurement, scene_record(recording.context()))


def press(button: recording.Button) -> None:
    group, _, name = button.operator.partition(".")
    assert getattr(getattr(bpy.ops, group), name)(**button.values) == {"FINISHED"}


def car(speed_mps: float) -> Any:
    item = rs.add_plate(50.0)
    item.name = "Car"
    rs.move_steadily(item, (0.0, speed_mps, 0.0))
    return item


@pytest.mark.parametrize("preset", PRESETS)
def test_all_panels_draw_for_every_radar(scene: Any, preset: str) -> None:
    assert recording.drawn(*recording.TAB).buttons  # without a radar
    rig = radarsim.add_radar(preset=preset)
    car(20.0)
    view = settings(rig)
    for kind in (*WAVEFORMS, "file"):
        view.waveform_kind = kind
        recording.drawn(*recording.TAB)
    view.waveform_kind = "lfm"
    for name, value in {
        "sampling_mode": "rings", "frame_mode": "range", "max_standard_error": 0.02,
        "rain_mm_per_h": 4.0, "gases": True, "extinction": "wavelength",
    }.items():  # fmt: skip
        setattr(view, name, value)
        recording.drawn(*recording.TAB)


@pytest.mark.parametrize("preset", ["automotive_77ghz", "long_range_77ghz", "paper"])
def test_an_ambiguous_velocity_is_fixed_by_a_press(scene: Any, preset: str) -> None:
    """60 m/s need 4 x 60 / wavelength: 61.7 kHz at 77 GHz, where the chirp has to be shorter."""
    radarsim.add_radar(preset=preset, range_stop_m=0.0)
    car(60.0)
    press(fix_of("scene-beyond-unambiguous-velocity"))
    measurement = read_measurement(scene)  # the pulse fits
    assert measurement.radar.max_unambiguous_velocity_mps >= 60.0
    assert "scene-beyond-unambiguous-velocity" not in listed()


def test_speeds_are_in_metres_whatever_the_unit(scene: Any) -> None:
    scene.unit_settings.scale_length = 0.5
    radarsim.add_radar(preset="automotive_77ghz")
    car(120.0)  # units per second
    (found,) = (one for one in quick() if one.code == "scene-beyond-unambiguous-velocity")
    assert found.numbers["fastest_mps"] == pytest.approx(60.0, rel=1e-3)


def test_range_limits_are_extended_by_a_press(scene: Any) -> None:
    radarsim.add_radar(preset="paper", range_stop_m=30.0)
    rs.add_plate(47.0)
    press(fix_of("scene-beyond-range-limits"))
    assert 47.0 < settings(active_radar(scene)).range_stop_m < 55.0
    assert "scene-beyond-range-limits" not in listed()


@pytest.mark.parametrize(
    ("values", "code"),
    [
        ({"snapshots": 1}, "single-snapshot"),
        ({"snapshot_interval_s": 0.001}, "short-snapshot-interval"),
        ({"rings": 1, "ring_step_m": 10.0}, "scene-beyond-rings"),
        ({"ring_step_m": 1.0}, "ring-step-below-resolution"),
        ({"prf_hz": 5e6, "chirp_duration_s": 1e-7}, "scene-beyond-unambiguous-range"),
    ],
)
def test_fixes_of_rings_and_ranges(scene: Any, values: dict[str, Any], code: str) -> None:
    radarsim.add_radar(preset="paper", sampling_mode="rings", **values)
    rs.add_plate(47.0)
    press(fix_of(code))
    assert code not in listed()
    if "prf_hz" in values:  # the farthest face echoes within a pulse interval
        prf_hz = settings(active_radar(scene)).prf_hz
        assert 0.8 * 299_792_458 / (2 * 47.1) < prf_hz < 299_792_458 / (2 * 47.0)


def test_ground_at_grazing_incidence_gets_finer_pixels_by_a_press(scene: Any) -> None:
    """2 m above ground a pixel of angle a spans a R^2 / 2 m of range: 0.3 R at most."""
    rig = radarsim.add_radar(
        preset="automotive_77ghz", width_px=64, height_px=32, range_stop_m=50.0
    )
    camera = bpy.data.objects["Radar Receiver"].data
    camera.angle = 1.0
    wall = rs.add_plate(40.0, 30.0)
    assert "footprints-too-coarse" not in listed()  # at normal incidence
    ground = rs.add_plate(0.0, 400.0, 90.0)
    ground.name, ground.location.z = "Ground", -2.0
    (found,) = (item for item in quick() if item.code == "footprints-too-coarse")
    assert found.subjects == ("Ground",) and wall.name not in found.subjects
    pixel, range_m = 2 * math.tan(0.5) / 64, found.numbers["range_m"]
    assert isinstance(range_m, float) and 40.0 < range_m <= 50.0
    assert found.numbers["step_m"] == pytest.approx(pixel * range_m**2 / 2, rel=0.02)
    press(fix_of("footprints-too-coarse"))
    assert "footprints-too-coarse" not in listed()
    view = settings(rig)
    needed = 64 * pixel * range_m / 2 / 0.3
    assert needed <= view.width_px < needed + 2
    assert view.width_px == 2 * view.height_px and camera.angle == pytest.approx(1.0)
    # For a radar that lies on the ground no resolution is proposed.
    ground.location.z = -0.005
    (only,) = buttons_of("footprints-too-coarse")
    assert only.operator == "radarsim.select_subjects"


def test_objects_below_a_pixel_of_rings_get_finer_pixels_by_a_press(scene: Any) -> None:
    rig = radarsim.add_radar(preset="paper", sampling_mode="rings", width_px=32, height_px=32)
    bpy.data.objects["Radar Receiver"].data.angle = 1.0
    rs.add_plate(47.0, 0.5).name = "Small"
    (found,) = (item for item in quick() if item.code == "objects-below-a-pixel")
    diagonal_px = 0.5 * math.sqrt(2) / 47.0 * 32 / (2 * math.tan(0.5))
    assert found.numbers["size_px"] == pytest.approx(diagonal_px, rel=1e-3)
    press(fix_of("objects-below-a-pixel"))
    assert settings(rig).width_px == settings(rig).height_px == math.ceil(64 / diagonal_px)
    assert "objects-below-a-pixel" not in listed()
    settings(rig).width_px = settings(rig).height_px = 32
    settings(rig).sampling_mode = "paths"  # with pixels of their own
    assert "objects-below-a-pixel" not in listed()


def flipped_cube() -> Any:
    mesh = bpy.data.meshes.new("Cube")
    faces = bmesh.new()
    bmesh.ops.create_cube(faces, size=2.0)
    bmesh.ops.reverse_faces(faces, faces=faces.faces[:])
    faces.to_mesh(mesh)
    faces.free()
    cube = bpy.data.objects.new("Cube", mesh)
    cube.location = (0.0, 20.0, 0.0)
    bpy.context.scene.collection.objects.link(cube)
    radarsim.assign_material(cube, radarsim.material("itu_concrete"))
    return cube


def test_the_check_finds_what_a_run_would_and_leaves_no_trace(scene: Any, tmp_path: Path) -> None:
    rig = radarsim.add_radar(width_px=8, height_px=8, output_folder=str(tmp_path / "run"))
    other = rs.add_plate(60.0)
    cube = flipped_cube()
    render = (scene.render.resolution_x, scene.render.engine, scene.frame_current)
    assert "mesh-inside-out" not in listed()
    assert bpy.ops.radarsim.check_scene() == {"FINISHED"}
    assert not list(tmp_path.iterdir())
    assert render == (scene.render.resolution_x, scene.render.engine, scene.frame_current)
    assert "mesh-inside-out" in listed()
    # Select, repair, check again.
    select = buttons_of("mesh-inside-out")[-1]
    assert select.operator == "radarsim.select_subjects"
    press(select)
    assert [item for item in (cube, other, rig) if item.select_get()] == [cube]
    assert bpy.context.view_layer.objects.active == cube
    press(fix_of("mesh-inside-out"))
    assert "mesh-inside-out" not in listed()  # before the next check
    assert bpy.ops.radarsim.check_scene() == {"FINISHED"}
    assert "mesh-inside-out" not in listed()


def test_the_check_reports_what_refuses_a_run(scene: Any, tmp_path: Path) -> None:
    rig = radarsim.add_radar(output_folder=str(tmp_path / "run"))
    rig.scale = (2.0, 2.0, 2.0)
    with pytest.raises(RuntimeError, match="is scaled"):
        bpy.ops.radarsim.check_scene()
    settings(rig).prf_hz = 1e7
    text = recording.drawn(*recording.TAB).texts
    assert any("longer than the pulse interval" in line for line in text)
    assert "cannot measure" in text


def test_a_file_that_was_never_saved_is_said_before_the_run(scene: Any, tmp_path: Path) -> None:
    rig = radarsim.add_radar()
    assert "No place for the run yet" in recording.drawn(*recording.TAB).texts
    settings(rig).output_folder = str(tmp_path / "run")
    assert "No place for the run yet" not in recording.drawn(*recording.TAB).texts


def test_without_radar_materials_the_row_says_so(scene: Any) -> None:
    radarsim.add_radar(range_encoding="materials")
    rs.add_plate(10.0)
    rs.add_plate(20.0, preset=None).name = "Bare"
    assert "1 of 2 objects are measured" in recording.drawn(RADARSIM_PT_scene).texts
    found = listed()
    assert "Bare" in found["no-radar-material"].values["message"]
    assert fix_of("no-radar-material").operator == "radarsim.suggest_materials"


def test_weather_is_said_in_its_header(scene: Any) -> None:
    """10 mm/h take 5.50 and 5.95 dB/km at 70 and 80 GHz (table of P.838-3): 5.82 at 77 GHz."""
    rig = radarsim.add_radar()
    assert "clear" in recording.drawn(*recording.TAB).texts
    settings(rig).rain_mm_per_h = 10.0
    (text,) = (text for text in recording.drawn(*recording.TAB).texts if text.endswith(" dB/km"))
    assert float(text.split()[0]) == pytest.approx(5.82, rel=0.01)
    drawn = recording.drawn(*recording.TAB)
    assert "The echo of rain is left out" in drawn.texts and "wind_x_mps" not in drawn.fields
    settings(rig).rain_echo = True
    drawn = recording.drawn(*recording.TAB)
    assert "The echo of rain is left out" not in drawn.texts
    assert {"rain_echo", "wind_x_mps", "wind_y_mps"} <= set(drawn.fields)


def test_quality_sets_replicates_and_refinement(scene: Any) -> None:
    rig = radarsim.add_radar()
    group, view = rig.radarsim, settings(rig)
    assert group.quality == "good"
    group.quality = "draft"
    assert (view.replicates, view.max_standard_error) == (2, 0.0)
    group.quality = "error"
    assert (view.replicates, view.max_standard_error) == (4, 0.01)
    view.max_standard_error = 0.03
    group.quality = "error"  # as it is: the user's number stays
    assert view.max_standard_error == 0.03
    group.quality = "good"
    assert (view.replicates, view.max_standard_error, view.time_limit_s) == (4, 0.0, 0.0)


def test_a_long_run_is_said_before_it_begins(scene: Any) -> None:
    """1000 frames of 4 million rays at 5 us: 20 s a frame, 5.7 h."""
    rig = radarsim.add_radar(width_px=1024, height_px=1024, frame_mode="scene")
    bpy.context.window_manager.radarsim.seconds_per_ray = 5e-6
    scene.frame_end = 1000
    drawn = recording.drawn(*recording.TAB)
    assert "about 6 h" in drawn.texts
    assert "quality=draft" in drawn.fields
    press(fix_of("run-takes-long"))
    assert settings(rig).replicates == 2 and not buttons_of("run-takes-long")  # 3 h
    scene.frame_end = 10
    assert "run-takes-long" not in listed()
    settings(rig).replicates, scene.frame_end = 4, 1000
    settings(rig).max_standard_error = 0.01
    assert any(text.startswith("at least") for text in recording.drawn(*recording.TAB).texts)
    assert [time_text(value) for value in (0.2, 90, 400, 8000)] == [
        "1 s",
        "90 s",
        "6.7 min",
        "2.2 h",
    ]


def test_operators_are_found_by_search_and_undone_in_one_step(addon: Any) -> None:
    """What needs to be told about what is internal; what changes the file can be undone."""
    operators: list[Any] = [
        item for item in addon_module.CLASSES if issubclass(item, bpy.types.Operator)
    ]
    internal = {
        item.bl_idname for item in operators if "INTERNAL" in getattr(item, "bl_options", ())
    }
    assert internal == {
        "radarsim.set_values", "radarsim.select_subjects",
        "radarsim.recalculate_normals", "radarsim.explain", "radarsim.read_out",
    }  # fmt: skip
    changing = {item.bl_idname for item in operators if "UNDO" in getattr(item, "bl_options", ())}
    assert changing >= {
        "radarsim.setup_rig", "radarsim.assign_material", "radarsim.apply_materials",
        "radarsim.apply_preset", "radarsim.load_preset", "radarsim.set_values",
        "radarsim.select_subjects", "radarsim.recalculate_normals", "radarsim.make_physical",
        "radarsim.draw_patterns", "radarsim.remove_patterns",
    }  # fmt: skip
    for item in operators:
        assert item.__doc__ and not item.__doc__.endswith("."), item


def test_numbers_that_do_not_fit_have_no_button(scene: Any) -> None:
    """A code's length is not shortened by a guess."""
    radarsim.add_radar(preset="paper", waveform_kind="pmcw", chip_duration_s=1e-6, prf_hz=100.0)
    measurement = read_measurement(scene)
    item = finding(
        "scene-beyond-unambiguous-velocity", "Car", fastest_mps=900.0,
        max_unambiguous_velocity_mps=1.0, prf_hz=64e3,
    )  # fmt: skip
    assert fixes_of(item, measurement) == []


@pytest.mark.parametrize("encoding", ["world", "materials"])
def test_the_checklist_counts_what_is_measured(scene: Any, encoding: str) -> None:
    """Geometry Nodes are no Radar Material, and what the receiver does not see is not measured."""
    radarsim.add_radar(range_encoding=encoding)
    rs.add_plate(10.0)
    for number in range(3):
        plate = rs.add_plate(20.0 + number, preset=None)
        plate.modifiers.new("Nodes", "NODES").node_group = bpy.data.node_groups.new(
            "Nodes", "GeometryNodeTree"
        )
    bpy.context.view_layer.update()
    any_material = encoding == "world"
    texts = recording.drawn(RADARSIM_PT_scene).texts
    assert f"{4 if any_material else 1} of 4 objects are measured" in texts
    assert f"1 of these {4 if any_material else 1} have a Radar Material" in texts
    assert "hidden-from-receiver" not in listed()
    plate.visible_camera = False
    bpy.context.view_layer.update()
    texts = recording.drawn(RADARSIM_PT_scene).texts
    assert f"{3 if any_material else 1} of 4 objects are measured" in texts
    assert plate.name in listed()["hidden-from-receiver"].values["message"]


def test_optical_materials_are_seen_without_a_check(scene: Any) -> None:
    """What a run's own check finds, and no more after each change."""
    radarsim.add_radar()
    rs.add_plate(10.0)
    assert "optical-material" not in listed()
    plate = rs.add_plate(20.0, preset=None)
    plate.name = "Bare"
    names = ("optical-material",)

    def seen() -> dict[str, tuple[str, ...]]:
        return {item.code: item.subjects for item in quick() if item.code in names}

    assert seen() == {"optical-material": ("Bare",)}
    mixed = rs.add_plate(30.0)
    mixed.name = "Mixed"
    mixed.data.materials.append(bpy.data.materials.new("Paint"))  # in a slot that no face uses
    assert seen() == {"optical-material": ("Bare",)}
    mixed.data.polygons[0].material_index = 1
    mixed.data.update()
    assert seen() == {"optical-material": ("Bare", "Mixed")}
    plate.hide_render = True
    bpy.context.view_layer.update()
    assert seen() == {"optical-material": ("Mixed",)}


def test_what_the_viewport_hides_is_counted_where_renders_show_it(scene: Any) -> None:
    """Fog and points have no surface, and are not counted."""
    radarsim.add_radar()
    rs.add_plate(10.0)
    hidden = rs.add_plate(20.0, preset=None)
    hidden.hide_viewport = True
    fog = rs.add_plate(30.0)
    material = bpy.data.materials.new("Fog")
    if material.node_tree is None:  # before Blender 5
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    output, volume = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("OutputMaterial", "VolumeScatter")
    )
    tree.links.new(volume.outputs[0], output.inputs["Volume"])
    fog.data.materials.clear()
    fog.data.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new("Points", bpy.data.meshes.new("Points")))
    bpy.context.view_layer.update()
    drawn = recording.drawn(RADARSIM_PT_scene)
    assert "2 of 2 objects are measured" in drawn.texts
    assert "1 of these 2 have a Radar Material" in drawn.texts
    assert "optical-material" in listed()
    hidden.hide_render = True
    bpy.context.view_layer.update()
    assert "1 of 1 objects are measured" in recording.drawn(RADARSIM_PT_scene).texts


def test_tooltips_say_what_a_fix_sets_and_what_is_selected(scene: Any) -> None:
    values = {"prf_hz": 61_700.0, "chirp_duration_s": 1.54e-5, "width_px": 1024, "ramp_s": None}
    texts = [value_text(name, value) for name, value in values.items()]
    assert texts == ["PRF 61.7 kHz", "Chirp Duration 15.4 us", "Width 1024", "Ramp none"]
    describe = RADARSIM_OT_select_subjects.description
    names = SimpleNamespace(names='["Car", "Bus", "Van", "Tram", "Bike"]')
    assert describe(bpy.context, names) == "Select 'Car', 'Bus', 'Van' and 2 more"


@pytest.mark.parametrize(("width", "count"), [(2000, 1), (220, 2)])
def test_a_title_is_never_cut(
    scene: Any, width: int, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a narrow sidebar it has more lines, next to its buttons."""
    narrow = SimpleNamespace(
        region=SimpleNamespace(width=width),
        preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
    )
    with monkeypatch.context() as patch:
        patch.setattr(scene_panel, "bpy", SimpleNamespace(context=narrow))
        layout: Any = recording.Layout()
        item = finding(
            "scene-beyond-unambiguous-velocity", "Car", fastest_mps=1.0,
            max_unambiguous_velocity_mps=1.0, prf_hz=64e3,
        )  # fmt: skip
        scene_panel.draw_rows(layout, [item], None)
    assert len(layout.texts) == count
    assert " ".join(layout.texts) == "Beyond unambiguous velocity"
    assert [button.operator for button in layout.buttons] == [
        "radarsim.select_subjects", "radarsim.explain",
    ]  # fmt: skip


def test_a_radar_without_its_camera_is_said_until_it_has_one(scene: Any) -> None:
    radarsim.add_radar()
    rs.add_plate(10.0)
    assert "cannot measure" not in recording.drawn(*recording.TAB).texts
    bpy.data.objects.remove(bpy.data.objects["Radar Receiver"])
    scene.camera = None
    bpy.context.view_layer.update()
    texts = recording.drawn(*recording.TAB).texts
    assert "cannot measure" in texts and any("has no camera" in text for text in texts)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    bpy.context.view_layer.update()
    assert "cannot measure" not in recording.drawn(*recording.TAB).texts


def test_a_size_that_does_not_fit_a_name_is_listed_at_once(scene: Any) -> None:
    """Until it is scaled; the arrow selects the object."""
    rs.setup_rig(scene)
    bpy.ops.mesh.primitive_cube_add(location=(0, 60, 0))
    item = bpy.context.object
    item.name, item.dimensions = "Parked Car", (18, 45, 15)
    (found,) = (one for one in quick() if one.code == "size-implausible")
    assert "a car of 45 m" in found.text and "(scale by 0.09)" in found.text
    (select,) = buttons_of("size-implausible")
    item.select_set(False)
    press(select)
    assert bpy.context.selected_objects == [item]
    item.scale = item.scale * 0.1
    bpy.context.view_layer.update()
    assert not [one for one in quick() if one.code == "size-implausible"]
