# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels drawn on a layout that keeps what it is given: what they show, and at what cost."""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

from radarsim_addon import processes
from radarsim_addon.blender import addon
from radarsim_addon.blender.plan import radar_preset
from radarsim_addon.blender.rig_settings import apply_preset, settings
from radarsim_addon.blender.scene import action_curves, active_radar
from radarsim_addon.blender.ui import fields, link_budget_panel, overlays, scene_reading
from radarsim_addon.blender.ui.scene_panel import RADARSIM_OT_set_values
from radarsim_addon.errors import SceneError
from radarsim_addon.physics import antennas as physics_antennas
from tests.blender import radar_scenes as rs
from tests.blender import recording


def drawn() -> str:
    """All that the panels of a run show, with the tooltips of the buttons that set values."""
    layout = recording.drawn(*recording.TAB)
    tooltips = [
        RADARSIM_OT_set_values.description(bpy.context, SimpleNamespace(**button.values))
        for button in layout.buttons
        if button.operator == "radarsim.set_values"
    ]
    names = [name for b in layout.buttons for name in json.loads(b.values.get("names", "[]"))]
    return " ".join([*layout.texts, *(button.text for button in layout.buttons), *tooltips, *names])


@pytest.fixture
def registered() -> Iterator[None]:
    addon.register()
    yield
    addon.unregister()


def car_at(speed_mps: float) -> Any:
    rs.new_scene()
    rs.add_plate(80.0)
    car = rs.add_plate(50.0)
    car.name = "Car"
    rs.move_steadily(car, (0.0, speed_mps, 0.0))
    view = settings(active_radar(bpy.context.scene))
    view.sampling_mode, view.carrier_hz, view.prf_hz = "paths", 77e9, 1000.0
    return view


@pytest.mark.parametrize("mode", ["paths", "rings"])
def test_the_panel_warns_of_an_ambiguous_velocity_before_the_render(
    registered: None, mode: str
) -> None:
    """1 kHz at 77 GHz hold 0.97 m/s; 15 m/s need 4 x 15 / lambda = 15.4 kHz."""
    view = car_at(15.0)
    view.sampling_mode = mode
    text = drawn()
    assert "Car" in text
    assert "PRF 15.5 kHz" in text
    view.prf_hz = 15_500.0
    assert "unambiguous velocity" not in drawn()


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("carrier_ghz", 0.0, "Carrier is 0.0 Hz; expected a finite number above 0"),
        ("carrier_ghz", -5.0, "Carrier is -5000000000.0 Hz; expected"),
        ("prf_hz", 0.0, "PRF is 0.0 Hz; expected"),
        ("prf_hz", -1.0, "PRF is -1.0 Hz; expected"),
        ("transmit_power_w", -1.0, "Transmit power is -1.0 W; expected"),
    ],
)
def test_a_value_that_cannot_be_is_said_once_at_its_field(
    registered: None, field: str, value: float, said: str
) -> None:
    """A script, a file or an animation may set what the field would not take."""
    car_at(0.0)
    group = active_radar(bpy.context.scene).radarsim
    group.use_link_budget = True
    assert said.split(" is ")[0] + " is " not in drawn()
    setattr(group, field, value)
    text = drawn()
    assert text.count(said.split(";")[0]) == 1 and said in text
    if field != "transmit_power_w":
        assert text.count("A red field above") == 1


def test_too_many_pulses_are_said_where_they_are_set(registered: None) -> None:
    view = car_at(0.0)
    view.pulses = 4_194_304
    assert "A burst of 4194304 pulses takes" in drawn()


def test_an_animation_that_is_stretched_is_slower(registered: None) -> None:
    view = car_at(15.0)
    bpy.context.scene.render.frame_map_new = 200
    bpy.context.scene.frame_set(10)  # frame 5 of the animation
    assert "PRF 7.71 kHz" in drawn()
    view.prf_hz = 7_750.0
    assert "unambiguous velocity" not in drawn()


@pytest.mark.parametrize("mode", ["paths", "rings"])
def test_redraws_do_not_walk_through_the_scene(
    registered: None, mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    view = car_at(15.0)
    view.sampling_mode = mode
    calls: list[str] = []
    for name in ("extent_of_boxes", "visibility_in_parts", "echoing_boxes"):
        real = getattr(scene_reading, name)
        monkeypatch.setattr(
            scene_reading,
            name,
            lambda *a, real=real, name=name, **k: calls.append(name) or real(*a, **k),
        )
    first = drawn()
    once = len(calls)
    assert once
    for _ in range(5):
        assert drawn() == first
    assert len(calls) == once
    bpy.data.objects["Plate"].location.y += 200.0
    assert (drawn() != first) == (mode == "rings")  # the number of rings
    assert len(calls) == 2 * once


def test_panels_and_overlays_show_the_latest_record_and_read_nothing(
    registered: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    car_at(15.0)
    bpy.context.window_manager.radarsim.overlay_velocities = True
    first = drawn(), overlays.overlay_lines(recording.context())[1]
    car = bpy.data.objects["Car"]
    for curve in list(action_curves(car.animation_data.action)):
        curve.mute = True
    car.update_tag()
    bpy.context.view_layer.update()
    with monkeypatch.context() as patch:
        patch.setattr(scene_reading, "read_now", lambda _: None)
        for name in ("context_snapshot", "keyed_speeds", "rig_of"):
            patch.delattr(scene_reading, name)
        assert (drawn(), overlays.overlay_lines(recording.context())[1]) == first
    assert "PRF 15.5 kHz" in first[0] and "PRF 15.5 kHz" not in drawn()
    assert len(first[1]) == 1 and not overlays.overlay_lines(recording.context())[1]
    bpy.context.window_manager.radarsim.overlay_velocities = False


def test_a_scene_is_read_in_slices_once_edits_are_calm(
    registered: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A change between two slices begins the reading again."""
    car_at(15.0)
    for number in range(100):
        copy = bpy.data.objects["Car"].copy()
        copy.location.x = 3.0 * number
        bpy.context.scene.collection.objects.link(copy)
    recording.drawn(*recording.TAB)
    monkeypatch.setattr(scene_reading, "_SLICE_S", 0.0)
    bpy.data.objects["Plate"].location.y += 1.0
    bpy.context.view_layer.update()
    calm_in_s = scene_reading._read_slice()
    assert calm_in_s is not None and 0.0 < calm_in_s <= 0.2
    monkeypatch.setattr(scene_reading, "_CALM_S", 0.0)

    def count_slices(moved_in: int) -> int:
        for number in range(1000):
            if number == moved_in:
                bpy.data.objects["Plate"].location.y += 1.0
                bpy.context.view_layer.update()
            pause_s = scene_reading._read_slice()
            if pause_s is None:
                return number + 1
        return 0

    once = count_slices(-1)
    assert once > 50  # two objects with F-curves each
    assert count_slices(-1) == 1  # nothing has changed
    bpy.data.objects["Plate"].location.y += 1.0
    bpy.context.view_layer.update()
    assert count_slices(30) == 30 + once


def test_a_reading_that_blender_refused_begins_again(
    registered: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    car_at(15.0)
    refusal = "can't modify blend data in this state"

    def refuse(*_: Any) -> None:
        raise RuntimeError(refusal)

    monkeypatch.setattr(scene_reading, "_CALM_S", 0.0)
    with monkeypatch.context() as patch:
        patch.setattr(scene_reading, "keyed_speeds", refuse)
        with pytest.raises(RuntimeError, match=refusal):
            while scene_reading._read_slice() is not None:
                pass
    while scene_reading._read_slice() is not None:
        pass
    record = scene_reading.scene_record(recording.context(read=False))
    assert record is not None and record.speeds_mps["Car"] == pytest.approx(15.0, rel=1e-3)


def test_the_rig_that_is_shown_is_looked_for_again_where_it_no_longer_fits(
    registered: None,
) -> None:
    car_at(0.0)
    scene = bpy.context.scene
    radar = active_radar(scene)
    camera, light = (scene_reading.shown_rig(scene, radar).camera, radar.radarsim.light)
    other = bpy.data.objects.new("Other", bpy.data.cameras.new("Other"))
    scene.collection.objects.link(other)
    radar.radarsim.camera = other
    assert scene_reading.shown_rig(scene, radar).camera == other
    radar.radarsim.camera = None
    assert scene_reading.shown_rig(scene, radar).camera == camera and light is None
    scene_reading.shown_rig(scene, radar).emitter.data.energy = 0.0
    with pytest.raises(SceneError, match="power of 0 W"):
        scene_reading.shown_rig(scene, radar)


@pytest.mark.parametrize("preset", ["paper", "automotive_77ghz", "sar_c_band"])
def test_a_redraw_takes_no_step_for_an_object(
    registered: None, preset: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No integral of an antenna's gain is computed again; the SAR's is an aperture of 12 m."""
    view = car_at(15.0)
    scene = bpy.context.scene
    apply_preset(scene, active_radar(scene), radar_preset(preset))
    if preset == "sar_c_band":
        view.transmitter.kind, view.transmitter.width_m = "aperture", 12.0
    monkeypatch.setattr(link_budget_panel, "_systems", {})
    integrals: list[Any] = []
    integral = physics_antennas.gauss_legendre
    monkeypatch.setattr(
        physics_antennas,
        "gauss_legendre",
        lambda *given: integrals.append(given) or integral(*given),
    )
    steps = []
    for boxes in (0, 2000):
        for number in range(boxes):
            item = bpy.data.objects.new("Box", bpy.data.objects["Car"].data)
            item.location = (number % 50, 20.0 + number // 50, 0.0)
            bpy.context.scene.collection.objects.link(item)
        drawn()
        before, calls = len(integrals), 0

        def count(frame: Any, event: str, called: Any) -> None:
            nonlocal calls
            calls += event in ("call", "c_call")

        sys.setprofile(count)
        try:
            layout = recording.drawn(*recording.TAB, closed=True)
        finally:
            sys.setprofile(None)
        assert len(integrals) == before
        assert f"{boxes + 2} of {boxes + 2} objects are measured" in layout.texts
        steps.append(calls)
    assert bool(integrals) == (preset != "paper")  # whose antennas are isotropic
    assert steps[1] - steps[0] < 500  # of 5600: other texts, no step for an object


def test_what_a_crashed_session_left_is_removed_at_the_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    left, mine = tmp_path / "blender_crashed", tmp_path / "radarsim_running"
    for folder in (left, mine):
        folder.mkdir()
        (folder / "picture.npy").write_bytes(b"1")
        processes.own_folder(folder)
    owner = left / "radarsim_owner.json"
    text = owner.read_text(encoding="utf-8")
    began = str(processes.identity()["began"])
    owner.write_text(text.replace(began, "an earlier start"), encoding="utf-8")
    addon.register()
    assert not left.exists()
    assert mine.exists()


@pytest.mark.parametrize(
    ("width", "expected"), [(400, "about 3.4 min"), (190, "about 3.4 m\u2026"), (120, "")]
)
def test_the_state_in_a_header_leaves_room_for_the_name(
    width: int, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = SimpleNamespace(
        region=SimpleNamespace(width=width),
        preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
    )
    monkeypatch.setattr(fields, "bpy", SimpleNamespace(context=given, app=bpy.app))
    panel = SimpleNamespace(layout=recording.Layout(), bl_label="Measure")
    fields.draw_state(panel, "about 3.4 min")
    assert panel.layout.texts == [expected]
