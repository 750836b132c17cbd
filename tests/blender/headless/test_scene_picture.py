# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of a scene: what is where, the frame, the named targets, and nothing else changed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon import blender as radarsim
from radarsim_addon import signal
from radarsim_addon.blender import rig_settings
from radarsim_addon.blender.headless import scene_picture
from radarsim_addon.errors import ConfigError, SceneError
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender
#: Tangents of half the field of view, across and up, of pictures of 96 x 64 pixels.
HALF, WIDTH_PX, HEIGHT_PX = (0.6, 0.4), 96, 64
#: y, x in frames 1 and 25, and side of each plate, which faces the radar at the origin.
PLATES = {"Near": (10.0, (-2.0, -2.0), 2.0), "Far": (20.0, (0.0, 4.0), 2.0)}


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Any]:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig = radarsim.add_radar(look_at=(0, 1, 0), pulses=16, width_px=WIDTH_PX, height_px=HEIGHT_PX)
    radarsim.antennas(rig).receiver.data.angle = 2 * np.arctan(HALF[0])
    metal = radarsim.material(name="Metal", n=1e4, kappa=1e4, rms_slope=0.2)
    for name, (y, across, side) in PLATES.items():
        plate = rs.add_plate(y, side, preset=None)
        plate.name, plate.location.x = name, across[0]
        radarsim.assign_material(plate, metal)
        if across[1] != across[0]:
            rs.move_steadily(plate, (across[1] - across[0], 0.0, 0.0))
    yield radarsim.measure(rig, tmp_path / "run", frames=[1, 25], replicates=1)
    rig_settings.unregister()


def columns(name: str, frame: int) -> tuple[float, float]:
    """First and last column of a plate in the picture, by similar triangles."""
    y, across, side = PLATES[name]
    x = across[0 if frame == 1 else 1]
    edges = [(x + sign * side / 2) / y for sign in (-1, 1)]
    left, right = ((edge / HALF[0] + 1) / 2 * WIDTH_PX for edge in edges)
    return left, right


def state_of_the_file() -> dict[str, Any]:
    """Names of all data, and settings that a picture has to do with."""
    scene = bpy.context.scene
    found: dict[str, Any] = {
        item.identifier: [(one.name, one.users) for one in getattr(bpy.data, item.identifier)]
        for item in bpy.data.bl_rna.properties
        if item.type == "COLLECTION"
    }
    for owner in (scene.render, scene.render.image_settings, scene.cycles, scene.view_settings):
        for item in owner.bl_rna.properties:
            if item.type not in ("POINTER", "COLLECTION"):
                found[f"{type(owner).__name__}.{item.identifier}"] = str(
                    getattr(owner, item.identifier)
                )
    found["hidden"] = [item.hide_render for item in bpy.data.objects]
    found["places"] = [tuple(item.matrix_world.translation) for item in bpy.data.objects]
    found["layer"] = scene.view_layers[0].material_override, scene.camera, scene.world
    found["frame"] = scene.frame_current, scene.frame_subframe
    return found


def numbered(figure: Any) -> list[str]:
    (legend,) = figure.legends
    return [text.get_text() for text in legend.get_texts()]


@pytest.mark.parametrize("frame", [1, 25])
def test_objects_are_where_the_receiver_sees_them(run: Any, frame: int) -> None:
    bpy.context.scene.frame_set(7)
    opened = signal.open_frame(run.frame(frame))
    pixels = scene_picture._rendered(bpy.context.scene, opened.receiver, 1.0, frame, WIDTH_PX)
    assert pixels.shape == (HEIGHT_PX, WIDTH_PX, 3)
    sky = pixels[2, 2].astype(int)
    seen = np.abs(pixels[HEIGHT_PX // 2].astype(int) - sky).max(axis=1) > 20
    middles = np.arange(WIDTH_PX) + 0.5
    expected = np.zeros(WIDTH_PX, dtype=bool)
    for name in PLATES:
        left, right = columns(name, frame)
        expected |= (middles > left) & (middles < right)
    assert np.count_nonzero(seen != expected) <= 4  # a pixel at each edge


@pytest.mark.parametrize("frame", [1, 25])
def test_targets_are_named_and_marked_on_their_objects(run: Any, frame: int) -> None:
    figure: Any = radarsim.show(run, frame=frame, width_px=WIDTH_PX)
    texts = numbered(figure)
    assert {text.split("\n")[0] for text in texts} == set(PLATES)
    (axis,) = figure.axes
    across = np.asarray(axis.lines[0].get_data()[0], dtype=np.float64)
    for text, u in zip(texts, across.tolist(), strict=True):
        left, right = columns(text.split("\n")[0], frame)
        assert left <= (u / HALF[0] + 1) / 2 * WIDTH_PX <= right
    near = next(text for text in texts if text.startswith("Near"))
    assert 10.0 <= float(near.split("\n")[1].split()[0]) <= 10.5 and near.endswith("0.0 m/s")
    assert f"frame {frame}" in axis.get_title()
    assert figure._repr_png_()[:4] == b"\x89PNG"


def test_detections_of_a_result_are_marked(run: Any) -> None:
    options = signal.ProcessOptions(
        thermal_noise=True, cfar=signal.Cfar("ca", 1e-9), plots=False, products=False
    )
    result, _ = radarsim.process(run, options)
    assert result.detections.targets
    texts = numbered(radarsim.show(result, width_px=WIDTH_PX))
    first = result.detections.targets[0]
    assert texts[0].startswith(f"{first.name}\n{first.range_m:.4g} m")
    assert len(texts) == min(len(result.detections.targets), 5)


def test_scene_and_settings_are_as_before(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    fog = bpy.data.materials.new("Fog")
    if fog.node_tree is None:
        fog.use_nodes = True
    fog.node_tree.nodes.clear()
    output = fog.node_tree.nodes.new("ShaderNodeOutputMaterial")
    volume = fog.node_tree.nodes.new("ShaderNodeVolumePrincipled")
    fog.node_tree.links.new(volume.outputs[0], output.inputs["Volume"])
    bpy.ops.mesh.primitive_cube_add(size=60)
    bpy.context.object.data.materials.append(fog)
    bpy.context.scene.frame_set(7)
    before = state_of_the_file()
    figure = radarsim.show(run, width_px=WIDTH_PX)
    assert state_of_the_file() == before
    # the fog around the radar does not hide what is in it
    picture = np.asarray(figure.axes[0].images[0].get_array())
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 2

    def fails(*_: Any) -> None:
        raise RuntimeError("no camera")

    monkeypatch.setattr(scene_picture, "aim", fails)
    with pytest.raises(RuntimeError, match="no camera"):
        radarsim.show(run, width_px=WIDTH_PX)
    assert state_of_the_file() == before


def test_what_cannot_be_shown_is_refused(run: Any) -> None:
    (result,) = radarsim.process(run, signal.ProcessOptions(plots=False), frames=[1])
    with pytest.raises(ConfigError, match="The result is of frame 1"):
        radarsim.show(result, frame=25)
    with pytest.raises(ConfigError, match="Width is 3 pixels"):
        radarsim.show(run, width_px=3)
    bpy.context.scene.name = "Another"
    with pytest.raises(SceneError, match="which is not open"):
        radarsim.show(run)


def test_rings_show_the_scene_without_marks(tmp_path: Path) -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig = radarsim.add_radar(look_at=(0, 1, 0), preset="paper", width_px=32, height_px=24)
    rs.add_plate(10.0, 4.0, preset="metal")
    run = radarsim.measure(
        rig, tmp_path / "run", frames=[1], sampling_mode="rings", ring_step_m=4.0, samples=1
    )
    try:
        figure = radarsim.show(run, width_px=WIDTH_PX)
    finally:
        rig_settings.unregister()
    assert not figure.legends
    picture = np.asarray(figure.axes[0].images[0].get_array())
    middle, corner = picture[picture.shape[0] // 2, picture.shape[1] // 2], picture[1, 1]
    assert np.abs(middle.astype(int) - corner.astype(int)).max() > 20
