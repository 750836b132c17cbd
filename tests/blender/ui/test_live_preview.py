# SPDX-License-Identifier: GPL-3.0-or-later
"""Live preview: its numbers against those of a rendered run, its switch, what it leaves behind."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from radarsim_addon import signal
from radarsim_addon.blender import addon as addon_module
from radarsim_addon.blender import nodes
from radarsim_addon.blender.materials import make_physical_material, set_clutter, set_scattered_lobe
from radarsim_addon.blender.rig_settings import read_measurement
from radarsim_addon.blender.ui import live_preview
from radarsim_addon.blender.ui.live_scene import LiveReader
from radarsim_addon.signal.draft.draft import scene_of
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

CARRIER_HZ = 5.3e9


@pytest.fixture
def scene(addon: Any) -> Iterator[Any]:
    """A radar at the origin that looks along +Y; the preview is off afterwards."""
    made = rs.new_scene()
    ph.field_of_view(30)
    rs.radar().width_px = rs.radar().height_px = 64
    yield made
    live_preview.stop_live()


def switched_on() -> live_preview.LivePreview:
    bpy.context.window_manager.radarsim_live = True
    preview = live_preview.current_preview()
    assert preview is not None
    return preview


def drafted(drafts: int = 1) -> dict[str, Any]:
    """Fields and arrays of a draft, the timer's part played by hand."""
    preview = switched_on()
    wanted, end_s = preview.statistics.drafts + drafts, time.monotonic() + 60
    while preview.statistics.drafts < wanted:
        assert time.monotonic() < end_s and not preview.fault, preview.fault
        time.sleep(min(preview.tick(bpy.context), 0.02))
    assert preview.draft is not None
    return {**preview.draft.fields, **preview.draft.arrays}


def handler_counts() -> dict[str, int]:
    handlers = bpy.app.handlers
    lists = {name: getattr(handlers, name) for name in dir(handlers)}
    return {name: len(one) for name, one in lists.items() if isinstance(one, list)}


def ball(x: float, y: float, material: Any, smooth: bool = True) -> Any:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, location=(x, y, 0))
    item = bpy.context.object
    if smooth:
        bpy.ops.object.shade_smooth()
    item.data.materials.append(material)
    return item


def sea() -> Any:
    material = make_physical_material("Sea", "concrete", carrier_hz=CARRIER_HZ, rms_slope=0.2)
    set_clutter(material, "constant_gamma", gamma_db=-5.0)
    return material


def test_a_draft_has_the_peaks_of_the_rendered_run(scene: Any, tmp_path: Path) -> None:
    """Powers, ranges and range rates of five kinds of surfaces, each at a range of its own."""
    ph.field_of_view(70)
    rough = make_physical_material("Rough", "concrete", carrier_hz=CARRIER_HZ, rms_slope=0.3)
    items = {
        "Lambert plate": ph.plate_at(10.0, 2.0, ph.lambert(0.5), tilt_deg=20.0),
        "Lambert sphere": ball(-5.0, 15.0, ph.lambert(0.4)),
        "simple sphere, moves": ball(6.0, 22.0, ph.rough_metal()),
        "flat physical sphere": ball(13.0, 26.0, rough, smooth=False),
        "clutter": ph.plate_at(34.0, 5.0, sea(), tilt_deg=35.0),
    }
    items["clutter"].location.x = -15.0
    rs.move_steadily(items["simple sphere, moves"], (0.0, 8.0, 0.0))
    settings = rs.radar()
    settings.range_stop_m = 60.0
    found = drafted(drafts=2)
    measured = read_measurement(scene)
    names = ("waveform", "burst", "width_px", "height_px", "range_stop_m")
    changes = {name: getattr(measured, name) for name in names}
    ph.run_paths(tmp_path, **changes, options={"replicates": 2})
    expected = signal.expected_power(signal.open_run(tmp_path).frame(1))
    np.testing.assert_allclose(found["range_m"], expected.range_m)
    for name, item in items.items():
        near = np.abs(found["range_m"] - item.location.length) < 2.5
        own, there = (
            int(np.argmax(np.where(near, power, 0.0)))
            for power in (found["profile_w"], expected.profile)
        )
        off_db = 10 * np.log10(found["profile_w"][own] / expected.profile[there])
        assert abs(off_db) < 0.3, name
        assert abs(own - there) <= 1, name  # cells of half a sample
    moving = items["simple sphere, moves"]
    column = np.abs(found["range_m"] - moving.location.length + 1).argmin()
    rows = (np.argmax(found["map_w"][:, column]), np.argmax(expected.map[::-1][:, column]))
    assert rows[0] == rows[1]
    rate_mps = 8.0 * moving.location.y / moving.location.length
    assert found["velocity_mps"][rows[0]] == pytest.approx(rate_mps, abs=0.12)


def test_a_slice_ends_after_the_part_that_takes_long(
    scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    ball(0.0, 20.0, ph.lambert(0.5))
    monkeypatch.setattr(live_preview, "_SLICE_S", -1.0)
    preview, parts = switched_on(), [0]
    read = preview._reader.read

    def counted(context: Any) -> Iterator[Any]:
        for part in read(context):
            parts[-1] += 1
            yield part

    monkeypatch.setattr(preview._reader, "read", counted)
    while preview._sent is None:
        preview.tick(bpy.context)
        parts.append(0)
    assert max(parts) == 1 and sum(parts) >= 6


def test_what_moves_is_drafted_again_and_meshes_stay(scene: Any) -> None:
    plate = ph.plate_at(10.0, 2.0, ph.lambert(0.5))
    first = drafted()
    preview = switched_on()
    sent: list[str] = []
    send = preview._process.send
    preview._process.send = lambda message: (sent.append(message.fields["kind"]), send(message))
    plate.location.y = 20.0
    bpy.context.view_layer.update()
    while True:
        second = drafted()
        if second["number"] != first["number"]:
            break
    assert sent == ["scene"]
    peaks_m = [one["range_m"][np.argmax(one["profile_w"])] for one in (first, second)]
    assert peaks_m == pytest.approx([10.0, 20.0], abs=1.5)
    # 1/R^4 of a plate that is seen whole
    fall_db = 10 * np.log10(first["profile_w"].max() / second["profile_w"].max())
    assert fall_db == pytest.approx(40 * np.log10(2.0), abs=0.5)
    rs.radar().prf_hz *= 2  # a setting that no evaluation reports
    last = second
    while last["number"] == second["number"]:
        last = drafted()
    assert np.ptp(last["velocity_mps"]) == pytest.approx(2 * np.ptp(second["velocity_mps"]))


def test_the_switch_leaves_nothing_behind(scene: Any) -> None:
    before = handler_counts()
    state = bpy.context.window_manager
    assert not state.radarsim_live
    process = switched_on()._process._process
    assert state.radarsim_live and handler_counts() != before
    state.radarsim_live = False
    assert handler_counts() == before
    assert process.poll() is not None
    assert not bpy.app.timers.is_registered(live_preview._tick)
    switched_on()
    addon_module.unregister()
    assert live_preview.current_preview() is None
    assert not hasattr(bpy.types.WindowManager, "radarsim_live")
    assert not bpy.app.timers.is_registered(live_preview._tick)
    assert live_preview._on_load not in bpy.app.handlers.load_pre
    addon_module.register()


def test_another_file_switches_it_off_and_no_file_holds_it(scene: Any, tmp_path: Path) -> None:
    ph.plate_at(10.0, 2.0, ph.lambert(0.5))
    drafted()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "on.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "on.blend"))
    assert not bpy.context.window_manager.radarsim_live
    assert live_preview.current_preview() is None


def test_undo_pauses_it(scene: Any) -> None:
    ph.plate_at(10.0, 2.0, ph.lambert(0.5))
    drafted()
    preview = switched_on()
    live_preview._on_undo()
    assert preview._sent is None and preview._snapshot is None
    number = preview._number
    assert drafted()["number"] > number


def test_faults_are_shown(scene: Any) -> None:
    ph.plate_at(10.0, 2.0, ph.lambert(0.5))
    camera = bpy.data.objects["Radar Receiver"].data
    camera.type, camera.panorama_type = "PANO", "FISHEYE_EQUIDISTANT"
    preview = switched_on()
    while not preview.fault:
        preview.tick(bpy.context)
    assert "projection" in preview.lines()[1]
    camera.type = "PERSP"
    preview.fault = ""
    drafted()
    assert preview.fault == ""
    preview._process._process.kill()
    preview._process._process.wait()
    preview.tick(bpy.context)
    assert "ended" in preview.lines()[1]


def test_what_a_draft_leaves_out_is_named(scene: Any) -> None:
    ph.plate_at(10.0, 2.0, ph.mirror())
    wall = nodes.make_material("Wall", 2.0, 0.1, specularity=0.2, roughness=0.0)
    set_scattered_lobe(wall, 4)
    ph.plate_at(16.0, 2.0, wall)
    moved = ph.plate_at(14.0, 2.0, ph.principled("Paint", (0.2, 0.4, 0.6)))
    moved.constraints.new("COPY_LOCATION")
    hidden, finer = ball(3.0, 20.0, ph.lambert(0.5)), ball(6.0, 20.0, ph.lambert(0.5))
    hidden.modifiers.new("Bevel", "BEVEL")
    hidden.hide_viewport = True
    finer.modifiers.new("Finer", "SUBSURF").render_levels = 2
    drafted()
    notes = switched_on().notes
    for words in (
        "mirror-like part is left out: 2",
        "lobe is left out: 1",
        "diffuse: 1",
        "velocity is left out: 1",
        "viewport hides, which are left out: 1",
        "not as in renders: 1",
    ):
        assert any(words in note for note in notes), notes


def test_objects_of_all_kinds_are_read(scene: Any) -> None:
    """Polygons with many corners, modifiers, an edited mesh, no mesh at all."""
    bpy.ops.mesh.primitive_cylinder_add(location=(0, 12, 0), rotation=(1.5708, 0, 0))
    bpy.context.object.data.materials.append(ph.lambert(0.5))
    bpy.ops.object.metaball_add(location=(5, 30, 0))
    scene.collection.objects.link(bpy.data.objects.new("Hair", bpy.data.hair_curves.new("Hair")))
    scene.collection.objects.link(bpy.data.objects.new("None", bpy.data.meshes.new("None")))
    first = drafted()
    caps, sides = 2 * 30, 2 * 32
    assert first["triangles"] > caps + sides
    assert switched_on().notes == (
        "hair and point clouds, which are left out: 1",
        "objects drawn as in the viewport, not as in renders: 1",  # metaballs are coarser in it
    )
    bpy.context.view_layer.objects.active = cylinder = bpy.data.objects["Cylinder"]
    cylinder.modifiers.new("Away", "DISPLACE").strength = 0.0
    bpy.ops.object.mode_set(mode="EDIT")
    import bmesh  # there once bpy is

    edited = bmesh.from_edit_mesh(cylinder.data)
    bmesh.ops.translate(edited, vec=(0, 0, 5), verts=edited.verts)
    bmesh.update_edit_mesh(cylinder.data)
    bpy.context.view_layer.update()
    second = first
    while second["number"] == first["number"]:
        second = drafted()
    bpy.ops.object.mode_set(mode="OBJECT")
    near_m = [one["range_m"][np.argmax(one["profile_w"])] for one in (first, second)]
    assert near_m[1] - near_m[0] == pytest.approx(-5.0, abs=1.3)


def read_scene() -> dict[str, Any]:
    """Fields and arrays of the scene as it is sent, and its notes."""
    bpy.context.view_layer.update()
    *_, found = LiveReader().read(bpy.context)
    return {**vars(scene_of(found.message)), "notes": found.notes}


def test_what_did_not_change_is_not_drafted_again(scene: Any) -> None:
    rs.move_steadily(ball(0.0, 20.0, sea()), (0.0, 8.0, 0.0))
    reader = LiveReader()
    first, second = ([*reader.read(bpy.context)][-1] for _ in range(2))
    assert second.same(first) and not second.same(None)
    rs.radar().prf_hz *= 2  # a setting that no evaluation reports
    assert not [*reader.read(bpy.context)][-1].same(first)


def test_materials_of_cycles_echo_only_where_all_do(scene: Any) -> None:
    ph.plate_at(10.0, 2.0, ph.principled("Paint", (0.2, 0.4, 0.6)))
    rs.radar().range_encoding = "materials"
    found = read_scene()
    assert (found["surfaces"], found["slots"], found["notes"]) == ([], [[-1]], ())
    rs.radar().range_encoding = "auto"
    found = read_scene()
    assert found["slots"] == [[0]] and found["surfaces"][0].output.kind == "Principled"
    assert found["notes"] == ("materials taken as diffuse: 1",)
    ph.plate_at(10.0, 2.0, ph.lambert(0.3)).is_holdout = True
    assert sorted(read_scene()["slots"]) == [[-1], [0]]


def test_instances_move_with_all_that_moves_them(scene: Any) -> None:
    """A collection within a collection, whose inner instancer may be still."""
    inner, outer = (bpy.data.collections.new(name) for name in ("Inner", "Outer"))
    plate = ph.plate_at(10.0, 2.0, ph.lambert(0.5))
    scene.collection.objects.unlink(plate)
    inner.objects.link(plate)
    within = rs.instance_of(inner, (0.0, 0.0, 3.0))
    within.rotation_euler.z = np.pi / 2
    scene.collection.objects.unlink(within)
    outer.objects.link(within)
    top = rs.instance_of(outer, (1.0, 2.0, 0.0))
    rs.move_steadily(plate, (0.0, 8.0, 0.0))
    found = read_scene()
    rate_mps = (found["moves"][0] @ found["matrices"][0] - found["matrices"][0])[:3, 3]
    np.testing.assert_allclose(rate_mps / found["interval_s"], [-8.0, 0.0, 0.0], atol=1e-2)
    assert found["notes"] == ()
    rs.move_steadily(top, (0.0, 0.0, 5.0))
    found = read_scene()
    rate_mps = (found["moves"][0] @ found["matrices"][0] - found["matrices"][0])[:3, 3]
    np.testing.assert_allclose(rate_mps / found["interval_s"], [-8.0, 0.0, 5.0], atol=1e-2)
    rs.move_steadily(within, (1.0, 0.0, 0.0))
    assert read_scene()["notes"] == ("objects whose velocity is left out: 1",)
    other = ph.plate_at(10.0, 2.0, ph.lambert(0.5))
    scene.collection.objects.unlink(other)
    outer.objects.link(other)
    other.hide_viewport = True
    assert "objects that the viewport hides, which are left out: 1" in read_scene()["notes"]


def test_what_the_viewport_hides_is_read(scene: Any) -> None:
    """Hidden itself, by its collection, by the layer, and by the eye: also its range counts."""
    ph.plate_at(10.0, 2.0, nodes.make_material("Metal", 100.0, 0.0, roughness=0.5))
    rs.radar().range_encoding = "materials"
    far = ph.plate_at(100.0, 2.0, bpy.data.materials["Metal"])
    own = bpy.data.collections.new("Own")
    scene.collection.children.link(own)
    scene.collection.objects.unlink(far)
    own.objects.link(far)
    layer = bpy.context.view_layer.layer_collection.children["Own"]
    limits = read_scene()["range_limits_m"]

    def check() -> None:
        found = read_scene()
        assert (found["range_limits_m"], found["notes"]) == (pytest.approx(limits), ())
        assert sorted(found["matrices"][:, 1, 3]) == [10.0, 100.0]

    for owner in (far, own, layer):
        owner.hide_viewport = True
        check()
        owner.hide_viewport = False
        check()
    far.hide_set(True)
    check()
    far.data.materials.clear()
    assert read_scene()["range_limits_m"][1] < 20.0


def test_a_refusal_is_shown_only_where_the_update_is_refused_too(
    scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Blender's note of drawing stays after some renders."""
    preview = switched_on()
    refusals = 1

    def step(self: Any, context: Any) -> float:
        nonlocal refusals
        refusals -= 1
        if refusals >= 0:
            raise RuntimeError("can't modify blend data in this state (drawing/rendering)")
        return 0.05

    monkeypatch.setattr(live_preview.LivePreview, "_step", step)
    assert live_preview._tick() == 0.05 and preview.fault == ""
    refusals = 2
    live_preview._tick()
    assert "can't modify" in preview.fault
