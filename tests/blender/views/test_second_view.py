# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of many instances: one render has a second view for the power beyond the last order."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix

from radarsim_addon.blender.nodes import attributes, make_material
from radarsim_addon.blender.views import PathClass, RenderRequest, joint_render
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender

FRAMES = (1, 2, 4)
SIZE = {"width_px": 32, "height_px": 32}


@pytest.fixture(autouse=True)
def few_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(joint_render, "MANY_INSTANCES", 1000)


def metal() -> Any:
    return make_material("Metal", 1e4, 1e4, specularity=0.0, penetrable=False)


def field(moves: bool = True) -> None:
    """1089 corners of two plates each, which reflect into one another, and a plate that moves."""
    rs.new_scene()
    ph.field_of_view(40)
    mesh = bpy.data.meshes.new("Corner")
    edge = [(0.0, 1.0, z) for z in (-0.4, 0.4)]
    sides = [(x, 0.0, z) for x in (-0.6, 0.6) for z in (-0.4, 0.4)]
    mesh.from_pydata([*edge, *sides], [], [(0, 1, 3, 2), (1, 0, 4, 5)])
    mesh.materials.append(metal())
    corner = bpy.data.objects.new("Corner", mesh)
    places = [(1.3 * (i % 33) - 20.8, 40.0, 1.0 * (i // 33) - 16.0) for i in range(33 * 33)]
    points = bpy.data.meshes.new("Field")
    points.from_pydata(places, [], [])
    carrier = bpy.data.objects.new("Field", points)
    for item in (corner, carrier):
        bpy.context.scene.collection.objects.link(item)
    corner.parent, carrier.instance_type = carrier, "VERTS"
    plate = ph.quad("Plate", [(-2, 0, -2), (2, 0, -2), (2, 0, 2), (-2, 0, 2)], metal())
    plate.location.y = 20.0
    if moves:
        rs.move_steadily(plate, (1.0, 5.0, 0.0))


def settings() -> dict[str, Any]:
    """What a second view changes in the file."""
    scene = bpy.context.scene
    views = [(v.name, v.use, v.camera_suffix, v.file_suffix) for v in scene.render.views]
    emitter = next(item for item in bpy.data.objects if item.type == "LIGHT")
    return {
        "views": views,
        "multiview": (scene.render.use_multiview, scene.render.views_format),
        "format": scene.render.image_settings.views_format,
        "camera": scene.camera.name,
        "objects": sorted(bpy.data.objects.keys()),
        "cameras": sorted(bpy.data.cameras.keys()),
        "groups": sorted(bpy.data.node_groups.keys()),
        "nodes": [getattr(n, "node_tree", None) for n in emitter.data.node_tree.nodes],
        "properties": sorted(key for key in scene.keys() if key.startswith("radarsim_")),
    }


def user_views() -> None:
    render = bpy.context.scene.render
    third = render.views.new("third")
    render.views[0].camera_suffix, render.views[1].use = "-mine", False
    third.use = True
    render.views_format = "MULTIVIEW"
    render.use_multiview = True


@pytest.mark.parametrize("prepare", [lambda: None, user_views])
def test_paths_stay_and_the_power_beyond_agrees(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, prepare: Callable[[], None]
) -> None:
    """All rows bit by bit; the power beyond the last order within its standard error."""
    runs = {}
    for name, many in (("two renders", 10**6), ("two views", 1000)):
        monkeypatch.setattr(joint_render, "MANY_INSTANCES", many)
        field()
        prepare()
        before = settings()
        runs[name] = ph.run_paths(tmp_path / name, frames=FRAMES, **SIZE)
        assert settings() == before
    for frame in FRAMES:
        apart, together = (run.record(frame) for run in runs.values())
        assert (apart.renders, together.renders) == (2, 1)
        assert apart.path_count > 300
        rows = [run.table(frame) for run in runs.values()]
        assert rows[0].tobytes() == rows[1].tobytes()
        fractions = [r.truncated_reflections_fraction for r in (apart, together)]
        error = np.hypot(apart.truncated_reflections_stderr, together.truncated_reflections_stderr)
        assert min(fractions) > 5 * error > 0
        assert abs(fractions[0] - fractions[1]) < 4 * error


def test_a_view_holds_its_own_orders_of_the_same_rays(tmp_path: Path) -> None:
    """With limits exchanged the views exchange their light; both see the same of order 1."""
    field(moves=False)
    first, later = PathClass(1, 1), PathClass(2, 5)
    found = {}
    with ph.job_for(tmp_path, **SIZE) as job:
        for task in job.pending():
            scene = job.path_scene  # type: ignore[attr-defined]
            job.start(task)
            assert scene.has_second_view
            for pair in ((first, first), (first, later), (later, first), (later, later)):
                scene.begin(RenderRequest(pair[0], beyond=pair[1]), None)
                scene.render()
                view = scene.end()
                assert view.beyond is not None
                found[pair] = view.blue.astype(float), view.beyond.blue.astype(float)
            break
    direct, mirrored = found[first, first]
    assert np.count_nonzero(direct) > 300
    # pixels at the edge of a plate may see another one: the rays agree to float32
    close = np.isclose(direct, mirrored, rtol=1e-3)
    assert close.mean() > 0.98
    assert np.array_equal(found[first, later][0], direct)
    assert np.array_equal(found[later, first][1], mirrored)
    assert np.array_equal(found[later, first][0], found[later, later][0])
    assert np.array_equal(found[first, later][1], found[later, later][1])
    sums = [float(view.sum()) for view in found[later, later]]
    assert 0.5 < sums[0] / sums[1] < 2.0


def edited_nodes() -> None:
    """The user's own nodes between a limit and its comparison."""
    emitter = next(item for item in bpy.data.objects if item.type == "LIGHT")
    tree = next(n.node_tree for n in emitter.data.node_tree.nodes if n.type == "GROUP")
    for node in tree.nodes:
        if node.type == "ATTRIBUTE" and node.attribute_name == attributes.ATTR_ORDER_MIN:
            link = node.outputs["Vector"].links[0]
            between = tree.nodes.new("ShaderNodeVectorMath")
            target = link.to_socket
            tree.links.new(node.outputs["Vector"], between.inputs[0])
            tree.links.new(between.outputs[0], target)


def panorama() -> None:
    data = bpy.context.scene.camera.data
    data.type = "PANO"
    settings_ = data if hasattr(data, "panorama_type") else data.cycles
    settings_.panorama_type = "EQUIRECTANGULAR"


def see_through() -> None:
    bpy.data.objects["Plate"].data.materials[0] = make_material(
        "Glass", 3.0, 0.0, specularity=0.0, penetrable=True
    )


@pytest.mark.parametrize("change", [edited_nodes, panorama, see_through])
def test_other_scenes_have_a_render_of_its_own(tmp_path: Path, change: Callable[[], None]) -> None:
    field(moves=False)
    change()
    run = ph.run_paths(tmp_path, **SIZE)
    assert run.record().renders > 1
    assert run.record().truncated_reflections_fraction > 0


def test_a_second_view_that_is_none_is_not_taken_for_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without its camera Blender renders the first one again, with all echoes."""
    monkeypatch.setattr(joint_render, "_UPSIDE_DOWN", Matrix.Identity(4))
    field(moves=False)
    run = ph.run_paths(tmp_path, **SIZE)
    assert run.record().renders == 2
    assert 0 < run.record().truncated_reflections_fraction < 0.3


def test_frames_in_which_nothing_moves_are_written_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As without a second view."""
    for many in (10**6, 1000):
        monkeypatch.setattr(joint_render, "MANY_INSTANCES", many)
        field(moves=False)
        run = ph.run_paths(tmp_path / str(many), frames=FRAMES, **SIZE)
        renders = [run.record(frame).renders for frame in FRAMES]
        each = 2 if many > 1000 else 1
        assert renders == [each, each, 0]
