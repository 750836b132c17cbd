# SPDX-License-Identifier: GPL-3.0-or-later
"""Replicates of small views out of one render: the same rows as from a render of each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.views.joint_render import MOST_TOGETHER
from radarsim_addon.blender.views.view_scene import PathScene
from radarsim_addon.signal.paths import PathRows
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.state.test_settings_restore import difference, snapshot

pytestmark = pytest.mark.blender


def moving_plate() -> Any:
    """A rough plate that comes nearer."""
    rs.new_scene()
    ph.plate_at(10, 4, ph.rough_metal())
    plate = bpy.data.objects["Plate"]
    for frame, shift in ((1, 0.0), (11, -3.0)):
        plate.delta_location = (0.0, shift, 0.2 * shift)
        plate.keyframe_insert("delta_location", frame=frame)
    bpy.context.scene.frame_set(1)
    return plate


def measured(
    folder: Path, monkeypatch: pytest.MonkeyPatch, joint: bool = True, **changes: Any
) -> tuple[list[PathRows], int]:
    """Tables of two frames, and how often Blender rendered."""
    made: list[int] = []
    render = PathScene._render

    def counted(scene: PathScene) -> None:
        made.append(scene.renders)
        render(scene)

    with monkeypatch.context() as patch:
        patch.setattr(PathScene, "_render", counted)
        if not joint:
            patch.setattr(PathScene, "join_looks", lambda *_: None)
        options = {"max_reflections": 1, "replicates": 3, **changes.pop("options", {})}
        size = {"width_px": 20, "height_px": 16, **changes}
        run = ph.run_paths(folder, options=options, frames=(1, 3), **size)
    tables = [run.table(frame) for frame in (1, 3)]
    return tables, len(made)


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO", "PANO"])
def test_rows_are_those_of_single_renders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    """Bit by bit, for every kind of camera and in each frame; two renders a frame, not four."""
    moving_plate()
    camera = bpy.context.scene.camera.data
    camera.type = kind
    if kind == "PANO":
        owner = camera if hasattr(camera, "panorama_type") else camera.cycles
        owner.panorama_type = "EQUIRECTANGULAR"
    together, few = measured(tmp_path / "joint", monkeypatch)
    alone, many = measured(tmp_path / "single", monkeypatch, joint=False)
    for one, other in zip(together, alone, strict=True):
        assert one.size and one.tobytes() == other.tobytes()
        assert set(one["replicate"]) == {0, 1, 2}
    assert together[0].tobytes() != together[1].tobytes()
    assert (few, many) == (4, 8)


def test_paths_that_need_chance_have_renders_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Second reflections depend on the seed, which all views of a render share."""
    moving_plate()
    changes = {"options": {"max_reflections": 2}}
    _, together = measured(tmp_path / "joint", monkeypatch, **changes)
    _, alone = measured(tmp_path / "single", monkeypatch, joint=False, **changes)
    assert together == alone


def test_large_views_have_renders_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They gain nothing, and would need the memory of all."""
    moving_plate()
    size = {"width_px": 128, "height_px": 64}
    _, renders = measured(tmp_path, monkeypatch, **size)
    assert renders == 8


def test_all_views_and_cameras_go_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a scene that has several views of its own, too."""
    moving_plate()
    render = bpy.context.scene.render
    render.use_multiview, render.views_format = True, "STEREO_3D"
    render.views.new("Mine").use = False
    render.views.active_index = 1
    image = render.image_settings
    image.color_management, image.linear_colorspace_settings.name = "OVERRIDE", "Linear Rec.2020"
    before = snapshot(bpy.context.scene)
    _, renders = measured(tmp_path, monkeypatch)
    assert renders == 4
    assert difference(before, snapshot(bpy.context.scene)) == []


def test_a_name_that_is_taken_costs_the_joint_render_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Blender finds the cameras of views by their names."""
    moving_plate()
    alone, _ = measured(tmp_path / "single", monkeypatch, joint=False)
    name = "radarsim view (temporary)_00001"
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(name, None))
    together, renders = measured(tmp_path / "taken", monkeypatch)
    assert renders == 8
    for one, other in zip(together, alone, strict=True):
        assert one.tobytes() == other.tobytes()


def test_replicates_beyond_the_most_have_renders_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Blender would keep the passes of all."""
    moving_plate()
    _, renders = measured(tmp_path, monkeypatch, options={"replicates": MOST_TOGETHER + 1})
    assert renders == 2 * (MOST_TOGETHER + 2)


def test_refined_tiles_share_renders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each small part of a wide image, with the rows of single renders."""
    moving_plate()
    options = {"max_standard_error": 0.01, "max_refinement_level": 2, "tile_px": 32}
    changes = {"options": options, "width_px": 132, "height_px": 32}
    together, few = measured(tmp_path / "joint", monkeypatch, **changes)
    alone, many = measured(tmp_path / "single", monkeypatch, joint=False, **changes)
    assert few < 0.5 * many
    for one, other in zip(together, alone, strict=True):
        assert one.size and one.tobytes() == other.tobytes()
