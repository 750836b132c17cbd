# SPDX-License-Identifier: GPL-3.0-or-later
"""Places, shapes and lenses that are no numbers are refused by name, and nothing is written."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.scene.visibility import animation_curves
from radarsim_addon.errors import SceneError
from radarsim_addon.signal.radar import Burst
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender

NAN, INF = math.nan, math.inf


def location(value: float) -> None:
    bpy.data.objects["Plate"].location.y = value


def vertex(value: float) -> None:
    bpy.data.objects["Plate"].data.vertices[2].co.x = value


def instanced() -> Any:
    """Have the plate as an instance of a collection only; what holds it."""
    return rs.instance_of(bpy.data.objects["Plate"], name="Holder")


def instanced_vertex(value: float) -> None:
    instanced()
    vertex(value)


def curve(value: float) -> None:
    shape = bpy.data.curves.new("Wire", "CURVE")
    shape.extrude = 1.0
    spline = shape.splines.new("POLY")
    spline.points.add(1)
    spline.points[1].co = (value, 0, 0, 1)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Wire", shape))


def radar(value: float) -> None:
    bpy.data.objects["Radar"].location.z = value


def ortho(value: float) -> None:
    bpy.context.scene.camera.data.type = "ORTHO"
    bpy.context.scene.camera.data.ortho_scale = value


def lens(value: float) -> None:
    bpy.context.scene.camera.data.lens = value


@pytest.mark.parametrize(
    ("spoil", "value", "names", "advice"),
    [
        (location, NAN, ["'Plate'", "nan"], "keyframes"),
        (location, INF, ["'Plate'"], "keyframes"),
        (vertex, NAN, ["'Plate'", "1 of its 4 vertices", "nan"], "modifiers"),
        (vertex, INF, ["'Plate'", "1 of its 4 vertices"], "modifiers"),
        (instanced_vertex, NAN, ["'Holder/Plate'"], "modifiers"),
        (curve, NAN, ["Wire"], "modifiers"),
        (radar, NAN, ["'Radar Receiver'", "nan"], "parents"),
        (ortho, 0.0, ["'Radar Receiver'", "orthographic scale of 0"], "Camera > Lens"),
        (lens, NAN, ["'Radar Receiver'", "focal length of nan"], "Camera > Lens"),
    ],
)
def test_what_is_no_number_is_refused_by_name(
    tmp_path: Path, spoil: Callable[[float], None], value: float, names: list[str], advice: str
) -> None:
    rs.new_scene()
    rs.add_plate(10.0).name = "Plate"
    spoil(value)
    before = bpy.context.scene.frame_current
    with pytest.raises(SceneError) as error:
        ph.run_paths(tmp_path / "run", width_px=8, height_px=8)
    for text in [*names, advice]:
        assert text in str(error.value)
    assert not (tmp_path / "run").exists()
    assert bpy.context.scene.frame_current == before


def test_a_folder_that_was_there_stays(tmp_path: Path) -> None:
    rs.new_scene()
    rs.add_plate(10.0).name = "Plate"
    location(NAN)
    with pytest.raises(SceneError):
        ph.run_paths(tmp_path, width_px=8, height_px=8)
    assert list(tmp_path.iterdir()) == []


def test_a_frame_of_many_is_refused_before_the_first(tmp_path: Path) -> None:
    """Broken at frame 2 only: nothing is measured of frame 1."""
    rs.new_scene()
    rs.add_plate(10.0).name = "Plate"
    camera = bpy.context.scene.camera.data
    camera.type = "ORTHO"
    for frame, scale in ((1, 4.0), (2, 0.0)):
        camera.ortho_scale = scale
        camera.keyframe_insert("ortho_scale", frame=frame)
    with pytest.raises(SceneError, match="orthographic scale of 0"):
        ph.run_paths(tmp_path / "run", width_px=8, height_px=8, frames=(1, 2))
    assert not (tmp_path / "run").exists()


def test_nothing_echoes_names_the_usual_causes(tmp_path: Path) -> None:
    rs.new_scene()
    rs.add_plate(10.0).visible_camera = False
    (found,) = ph.run_paths(tmp_path, width_px=8, height_px=8).record().findings
    assert (found.code, found.subjects) == ("nothing-in-view", ("Plate",))
    for cause in ("outside the view", "edge-on", "Camera on", "Holdout", "scaled to 0"):
        assert cause in found.message


def within_burst(item: Any, path: str, value: float, index: int = -1) -> None:
    """Animate a property: as it is, then `value` from frame 2 on, and as it was from frame 3 on."""
    for frame in (1, 2, 3):
        item.keyframe_insert(path, index=index, frame=frame)
    for curve in animation_curves(item.id_data.animation_data):
        for point in curve.keyframe_points:
            point.interpolation = "CONSTANT"
        curve.keyframe_points[1].co.y = value
    bpy.context.scene.frame_set(1)


def spoil_within_burst(what: str) -> str:
    """Break a plate, an instance of it, its corner or the receiver; the name of what is broken."""
    plate = rs.add_plate(10.0)
    if what == "vertex":
        plate.shape_key_add(name="Basis")
        key = plate.shape_key_add(name="Far")
        for point in key.data:
            point.co.x = 1e30
        key.value = 0.0
        within_burst(key, "value", 1.0)
    elif what == "receiver":
        within_burst(bpy.data.objects["Radar"], "location", NAN, 0)
        return "Radar Receiver"
    else:
        within_burst(instanced() if what == "instance" else plate, "location", NAN, 0)
    return "Plate"


@pytest.mark.parametrize("what", ["plate", "instance", "receiver", "vertex"])
def test_what_is_no_number_within_a_burst_alone_is_named_with_its_frame(
    tmp_path: Path, what: str
) -> None:
    """A burst from frame 1 to 4, whole at both ends, broken from frame 2 to 3."""
    rs.new_scene()
    name = spoil_within_burst(what)
    with pytest.raises(SceneError, match=rf"'{name}'.*at frame 2") as error:
        ph.run_paths(tmp_path / "run", width_px=8, height_px=8, burst=Burst(1000.0, 125))
    assert ("1e+30" if what == "vertex" else "nan") in str(error.value)
    assert not (tmp_path / "run/frames/frame_0001/paths.json").exists()


def test_the_second_pass_is_looked_at_before_the_first(tmp_path: Path) -> None:
    rs.new_scene()
    within_burst(rs.add_plate(10.0), "location", NAN, 0)
    with pytest.raises(SceneError, match="transform of 'Plate' is not finite"):
        rs.run(tmp_path / "run", snapshots=2, snapshot_interval_s=1.5 / 24)
    assert not (tmp_path / "run").exists()
