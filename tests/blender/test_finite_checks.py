# SPDX-License-Identifier: GPL-3.0-or-later
"""Places, shapes and lenses that are no numbers are refused by name, and nothing is written."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.errors import SceneError  # noqa: E402
from tests.blender import path_helpers as ph  # noqa: E402
from tests.blender import radar_scenes as rs  # noqa: E402

pytestmark = pytest.mark.blender

NAN, INF = math.nan, math.inf


def location(value: float) -> None:
    bpy.data.objects["Plate"].location.y = value


def vertex(value: float) -> None:
    bpy.data.objects["Plate"].data.vertices[2].co.x = value


def instanced_vertex(value: float) -> None:
    """The mesh is at hand as an instance of a collection only."""
    plate = bpy.data.objects["Plate"]
    held = bpy.data.collections.new("Held")
    held.objects.link(plate)
    bpy.context.scene.collection.objects.unlink(plate)
    holder = bpy.data.objects.new("Holder", None)
    holder.instance_type, holder.instance_collection = "COLLECTION", held
    bpy.context.scene.collection.objects.link(holder)
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
        (location, NAN, ["'Plate'", "nan"], "key frames"),
        (location, INF, ["'Plate'"], "key frames"),
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
    (said,) = [
        text
        for text in ph.run_paths(tmp_path, width_px=8, height_px=8).record().warnings
        if text.startswith("Nothing echoes")
    ]
    for cause in ("mirror", "inside a closed mesh", "Camera off", "Holdout"):
        assert cause in said
