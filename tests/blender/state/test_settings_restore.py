# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's scene comes back as it was; and nothing in it can spoil the measurement."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.state import SettingsRestorer
from radarsim_addon.errors import RadarSimError, SceneError
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


#: Properties that are not settings. use_nodes is always on from 5.0, where reading it warns;
#: storage_type is how Blender packs an attribute in memory.
#: `uv_layer_clone` is one of `uv_layers`: in Blender 4.5, reading the selection of a layer moves
#: all layers in memory, so that it is met once or twice.
SKIPPED = {
    *("rna_type", "session_uid", "is_evaluated", "depsgraph", "storage_type", "uv_layer_clone")
} | ({"use_nodes"} if bpy.app.version >= (5, 0, 0) else set())
#: Data of the user interface, and what no file holds.
NOT_IN_SCENE = {"window_managers", "workspaces", "screens", "brushes"}


def rna_values(owner: Any, place: str = "", seen: set[Any] | None = None) -> dict[str, Any]:
    """Every value of a Blender struct and of the structs in it, by place; data-blocks by name."""
    seen = set() if seen is None else seen
    found: dict[str, Any] = {}
    fields: dict[type, list[tuple[str, str]]] = {}  # a type's own take longer than their values

    def walk(owner: Any, place: str) -> None:
        kind = type(owner)
        if (owner.as_pointer(), kind) in seen:
            return
        seen.add((owner.as_pointer(), kind))
        if kind not in fields:
            fields[kind] = [
                (prop.identifier, prop.type)
                for prop in owner.bl_rna.properties
                if prop.identifier not in SKIPPED
            ]
        for identifier, data in fields[kind]:
            name, value = f"{place}.{identifier}", getattr(owner, identifier, None)
            if data == "COLLECTION":
                parts = [(f"{name}[{i}]", item) for i, item in enumerate(value or ())]
                found[name] = len(parts)
            else:
                parts = [(name, value)]
            for where, part in parts:
                if isinstance(part, bpy.types.ID) and not part.is_embedded_data:
                    found[where] = part.name_full
                elif isinstance(part, bpy.types.bpy_struct):
                    walk(part, where)
                elif data not in ("COLLECTION", "POINTER"):
                    found[where] = np.array(part).tolist() if hasattr(part, "__len__") else part
        if isinstance(owner, bpy.types.ID):
            found[f"{place} custom"] = {key: str(value) for key, value in owner.items()}

    walk(owner, place)
    return found


def snapshot(scene: Any) -> dict[str, Any]:
    """All settings of the open file, of the preferences, and the handlers."""
    seen: set[Any] = set()
    values = {"time": (scene.frame_current, scene.frame_subframe)}
    for prop in bpy.data.bl_rna.properties:
        if prop.type == "COLLECTION" and prop.identifier not in NOT_IN_SCENE:
            for item in getattr(bpy.data, prop.identifier):
                if item.name != "Render Result":
                    values |= rna_values(item, f"{prop.identifier} {item.name_full}", seen)
    for area in ("view", "system", "edit", "filepaths"):
        values |= rna_values(getattr(bpy.context.preferences, area), area, seen)
    for name in dir(bpy.app.handlers):
        if isinstance(getattr(bpy.app.handlers, name), list):
            values[f"handlers {name}"] = len(getattr(bpy.app.handlers, name))
    return values


def unusual_scene() -> Any:
    """A user's scene: every setting that matters differs from what a measurement needs."""
    scene = rs.new_scene()
    rs.add_plate(10.0)
    bare = rs.add_plate(12.0, preset=None)
    glowing = rs.add_plate(9.0, size=0.5, preset=None)
    material = bpy.data.materials.new("Glow")
    if material.node_tree is None:
        material.use_nodes = True
    principled = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    principled.inputs["Emission Strength"].default_value = 5.0
    glowing.data.materials.append(material)
    slot = rs.add_plate(13.0, preset=None)
    slot.data.materials.append(None)
    bare.name = "Bare"
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    scene.collection.objects.link(sun)
    sun.hide_render = False
    sun.keyframe_insert("hide_render", frame=1)
    world = bpy.data.worlds.new("Sky")
    if world.node_tree is None:
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 3.0
    scene.world = world
    scene.view_layers.new("Second")
    image = scene.render.image_settings
    image.file_format, image.color_mode, image.color_depth = "PNG", "RGBA", "16"
    scene.render.use_multiview = True
    image.views_format, image.stereo_3d_format.display_mode = "STEREO_3D", "SIDEBYSIDE"
    image.color_management, image.linear_colorspace_settings.name = "OVERRIDE", "Linear Rec.2020"
    image.view_settings.use_curve_mapping = True
    image.view_settings.curve_mapping.curves[3].points.new(0.3, 0.6).handle_type = "VECTOR"
    image.view_settings.curve_mapping.update()
    render = scene.render
    render.engine = "BLENDER_WORKBENCH"
    render.resolution_x, render.resolution_y, render.resolution_percentage = 640, 480, 50
    render.pixel_aspect_x = 1.5
    render.use_border = render.use_crop_to_border = render.use_motion_blur = True
    render.film_transparent = render.use_stamp = True
    render.filepath = "//somewhere/#"
    cycles = scene.cycles
    cycles.samples, cycles.seed, cycles.use_animated_seed = 77, 5, True
    cycles.sample_clamp_indirect, cycles.light_sampling_threshold = 3.0, 0.2
    cycles.use_denoising = cycles.use_adaptive_sampling = cycles.use_fast_gi = True
    cycles.pixel_filter_type, cycles.filter_width = "GAUSSIAN", 2.0
    scene.camera.data.clip_start = 0.25
    scene.camera.data.dof.use_dof = True
    emitter = bpy.data.objects["Radar Emitter"]
    emitter.visible_glossy = emitter.visible_diffuse = False
    emitter.data.color = (1.0, 0.5, 0.2)
    emitter.data.shadow_soft_size = 0.3
    scene["note"] = "mine"
    scene.frame_set(-7, subframe=0.25)
    return scene


def difference(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """What differs, readable."""
    return [
        f"{name}: {before.get(name)!r} -> {after.get(name)!r}"
        for name in sorted(before.keys() | after.keys())
        if before.get(name) != after.get(name)
    ]


@pytest.mark.parametrize("mode", ["rings", "paths"])
def test_every_setting_of_the_file_is_restored(tmp_path: Path, mode: str) -> None:
    scene = unusual_scene()
    before = snapshot(scene)
    assert len(before) > 10_000
    for end in ("error", "cancel", "success"):
        job: Any
        if mode == "rings":
            job = rs.job_for(tmp_path, snapshots=2, overwrite=True)
        else:
            job = ph.job_for(tmp_path, width_px=16, height_px=16, overwrite=True)
        with contextlib.suppress(ZeroDivisionError), job:
            for task in job.pending():
                job.start(task)
                job.render(task)
                if end == "cancel":
                    break
                if end == "error":
                    raise ZeroDivisionError
                job.finish(task)
        assert job.unrestored == []
        assert difference(before, snapshot(scene)) == [], end


def test_image_settings_of_every_format_come_back(tmp_path: Path) -> None:
    """Depth, codec and media type depend on each other: the order of restoring matters."""
    scene = unusual_scene()
    image = scene.render.image_settings
    cases = [
        ("JPEG", "RGB", "8"),
        ("TIFF", "RGBA", "16"),
        ("OPEN_EXR", "RGBA", "16"),
        ("HDR", "RGB", "32"),
    ]
    for name, mode, depth in cases:
        image.file_format, image.color_mode, image.color_depth = name, mode, depth
        if name == "OPEN_EXR":
            image.exr_codec = "DWAA"
        before = rna_values(image)
        rs.run(tmp_path / name)
        assert rna_values(image) == before
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE"
        image.file_format = "OPEN_EXR_MULTILAYER"
        image.color_depth = "16"
    else:
        image.file_format = "OPEN_EXR_MULTILAYER"
    before = rna_values(image)
    rs.run(tmp_path / "multilayer")
    assert rna_values(image) == before
    if hasattr(image, "media_type"):
        image.media_type = "VIDEO"
        before = rna_values(image)
        rs.run(tmp_path / "video")
        assert rna_values(image) == before


def test_everything_is_restored_when_preparing_fails(tmp_path: Path) -> None:
    scene = unusual_scene()
    rs.run(tmp_path, snapshots=2)
    scene.name = "Other"
    before = snapshot(scene)
    with pytest.raises(RadarSimError, match="another scene"), rs.job_for(tmp_path, seed=9):
        pass
    bpy.data.objects["Radar"].scale = (2, 2, 2)
    bpy.context.view_layer.update()
    with pytest.raises(SceneError, match="scaled"), rs.job_for(tmp_path / "b"):
        pass
    bpy.data.objects["Radar"].scale = (1, 1, 1)
    bpy.context.view_layer.update()
    assert difference(before, snapshot(scene)) == []


def test_foreign_light_does_not_enter(tmp_path: Path) -> None:
    """Sun, sky, a glowing plate that hides nothing, lens blur: bit-identical to a clean scene."""
    scene = rs.new_scene()
    rs.add_plate(10.0, preset="ground")
    rs.run(tmp_path / "clean", samples=4)
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    scene.collection.objects.link(sun)
    sun.data.energy = 100.0
    sun.keyframe_insert("hide_render", frame=1)
    world = bpy.data.worlds.new("Sky")
    world.color = (1, 1, 1)
    scene.world = world
    glowing = rs.add_plate(-5.0, preset=None)  # behind the radar
    material = bpy.data.materials.new("Glow")
    if material.node_tree is None:
        material.use_nodes = True
    principled = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    principled.inputs["Emission Strength"].default_value = 500.0
    glowing.data.materials.append(material)
    emitter = bpy.data.objects["Radar Emitter"]
    emitter.data.color = (1.0, 0.5, 0.2)
    emitter.visible_diffuse = False
    scene.camera.data.dof.use_dof = True
    scene.camera.data.dof.focus_distance = 2.0
    scene.view_layers[0].material_override = material
    scene.render.film_transparent = True
    scene.cycles.sample_clamp_direct = scene.cycles.sample_clamp_indirect = 1e-6
    scene.cycles.film_exposure, scene.cycles.blur_glossy = 3.0, 1.0
    rs.run(tmp_path / "spoilt", samples=4)
    assert any(np.any(image["B"] > 0) for image in rs.images(tmp_path / "clean"))
    for clean, spoilt in zip(
        rs.images(tmp_path / "clean"), rs.images(tmp_path / "spoilt"), strict=True
    ):
        for name in clean:
            np.testing.assert_array_equal(clean[name], spoilt[name])


def test_objects_without_radar_material_cast_a_shadow_and_give_no_echo(tmp_path: Path) -> None:
    """Bare, with an empty slot, glowing or shaded as usual: black, and named in a finding."""
    rs.new_scene()
    rs.add_plate(10.0, size=40.0)
    near = rs.add_plate(5.0, size=1.0, preset=None)
    empty_slot = rs.add_plate(5.0, size=1.0, preset=None)
    empty_slot.location.x = 1.5
    empty_slot.data.materials.append(None)
    glowing = rs.add_plate(5.0, size=1.0, preset=None)
    glowing.location.x = -1.5
    material = bpy.data.materials.new("Glow")
    if material.node_tree is None:
        material.use_nodes = True
    next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED").inputs[
        "Emission Strength"
    ].default_value = 5.0
    glowing.data.materials.append(material)
    job = rs.run(tmp_path, rings=1, ring_step_m=40.0, width_px=64, height_px=64)
    (bare,) = [item for item in job.findings if item.code == "no-radar-material"]
    assert near.name in bare.subjects
    (found,) = rs.decoded(tmp_path)
    image = rs.images(tmp_path)[0]["B"]
    # At 5 m a plate of 1 m fills tangents from -0.1 to 0.1; the others lie 0.3 to each side.
    for centre in (-0.3, 0.0, 0.3):
        shadow = (np.abs(found.u[None, :] - centre) < 0.09) & (np.abs(found.v[:, None]) < 0.09)
        assert shadow.sum() > 50
        assert np.all(image[shadow] == 0)
    assert np.all(found.range_m[found.mask] > 9.9)


def test_fog_without_radar_model_is_removed(tmp_path: Path) -> None:
    """A box with a volume alone neither shadows nor scatters."""
    rs.new_scene()
    rs.add_plate(10.0, size=40.0)
    rs.run(tmp_path / "clear", rings=1, ring_step_m=40.0)
    bpy.ops.mesh.primitive_cube_add(size=3.0, location=(0, 5, 0))
    material = bpy.data.materials.new("Fog")
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    fog = tree.nodes.new("ShaderNodeVolumeScatter")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(fog.outputs[0], output.inputs["Volume"])
    bpy.context.object.data.materials.append(material)
    rs.run(tmp_path / "fog", rings=1, ring_step_m=40.0)
    clear, foggy = rs.images(tmp_path / "clear")[0], rs.images(tmp_path / "fog")[0]
    assert np.all(clear["B"] > 0)
    np.testing.assert_allclose(foggy["B"], clear["B"], rtol=1e-6)
    np.testing.assert_allclose(foggy["R"], clear["R"], rtol=1e-5)


def test_recorder_restores_in_reverse_order() -> None:
    class Owner(dict):  # type: ignore[type-arg]
        def __init__(self) -> None:
            super().__init__()
            self.log: list[tuple[str, Any]] = []
            self.a, self.b = 1, [1, 2]

        def __setattr__(self, name: str, value: Any) -> None:
            if name != "log" and hasattr(self, "log"):
                self.log.append((name, value))
            super().__setattr__(name, value)

    owner = Owner()
    owner.log.clear()
    recorder = SettingsRestorer()
    recorder.set(owner, "a", 2)
    recorder.set(owner, "b", (5, 6))
    recorder.set(owner, "a", 3)
    recorder.set(owner, "a", 3)
    recorder.set_if_present(owner, "absent", 3)
    recorder.set_item(owner, "new", 1)
    with pytest.raises(AttributeError):
        recorder.set(owner, "absent", 1)
    del owner.log[:]
    assert recorder.restore() == []
    assert owner.log == [("a", 2), ("b", (1, 2)), ("a", 1)]
    assert dict(owner) == {}
    assert recorder.restore() == []


def test_recorder_goes_on_after_a_failure() -> None:
    class Owner:
        value = 1

    def fail() -> None:
        raise ReferenceError("gone")

    owner, recorder = Owner(), SettingsRestorer()
    recorder.set(owner, "value", 2)
    recorder.on_restore("broken", fail)
    assert recorder.restore() == ["broken: gone"]
    assert owner.value == 1


def test_restoring_uses_no_freed_memory() -> None:
    """The GNU C library overwrites freed memory here; other libraries ignore the variable."""
    test = f"{Path(__file__)}::{test_every_setting_of_the_file_is_restored.__name__}"
    overwrite = "glibc.malloc.tcache_count=0:glibc.malloc.perturb=170"
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"{test}[rings]"],
        env=os.environ | {"GLIBC_TUNABLES": overwrite},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
