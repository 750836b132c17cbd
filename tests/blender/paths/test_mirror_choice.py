# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that a user marks as mirrors, or as none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import rig_settings
from radarsim_addon.blender import set_mirror as set_mirror_by_script
from radarsim_addon.blender.headless.session import open_job
from radarsim_addon.blender.materials import mirror_choice, set_mirror, set_mirrors
from radarsim_addon.blender.plan import parse_render_arguments
from radarsim_addon.errors import ConfigError
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


def street() -> dict[str, Any]:
    """A plate between a large mirror below and a small one to the right; the objects."""
    rs.new_scene()
    ph.radar_at((0, 0, 4.0))
    ph.quad("Road", [(-40, -5, 0), (40, -5, 0), (40, 60, 0), (-40, 60, 0)], ph.mirror())
    ph.quad("Window", [(6, 10, 3), (6, 14, 3), (6, 14, 5), (6, 10, 5)], ph.mirror())
    ph.quad("Plate", [(-1, 20, 3), (1, 20, 3), (1, 20, 5), (-1, 20, 5)], ph.rough_metal())
    return {name: bpy.data.objects[name] for name in ("Road", "Window", "Plate")}


def images(folder: Path, **options: Any) -> tuple[list[tuple[str, ...]], set[str]]:
    """Objects of the images of a run, and the codes of its findings."""
    run = ph.run_paths(folder, width_px=16, height_px=16, options={"max_reflections": 2, **options})
    record = run.record()
    found = [*run.job.findings, *record.findings]
    return [tuple(one.objects) for one in record.images], {one.code for one in found}


def test_marks_decide_which_mirrors_get_an_image(tmp_path: Path) -> None:
    items = street()
    found, codes = images(tmp_path / "both")
    assert found == [("Road",), ("Window",)] and "mirrors-left-out" not in codes
    assert "object-without-echo" not in codes  # the images are the echo of a mirror
    assert images(tmp_path / "one", mirror_images=1)[0] == [("Road",)]
    set_mirror(items["Window"], "first")
    found, codes = images(tmp_path / "first", mirror_images=1)
    assert found == [("Window",)] and "mirrors-left-out" in codes
    set_mirror(items["Window"], "never")
    found, codes = images(tmp_path / "never", mirror_images=1)
    assert found == [("Road",)] and "mirrors-left-out" not in codes
    set_mirror(items["Plate"])
    assert "mirror-first-without-image" in images(tmp_path / "rough")[1]


def test_names_of_the_command_line(tmp_path: Path) -> None:
    items = street()
    bpy.context.view_layer.update()
    path = tmp_path / "street.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    words = [str(path), "--mirrors", "Win*, Plate", "--no-mirrors", "Road"]
    marked = open_job(parse_render_arguments([*words, "--out", str(tmp_path / "run")]))
    found = {name: mirror_choice(bpy.data.objects[name]) for name in items}
    assert found == {"Road": "never", "Window": "first", "Plate": "first"}
    plain = open_job(parse_render_arguments([str(path), "--out", str(tmp_path / "run")]))
    assert marked.identity and marked.identity != plain.identity
    others = {
        open_job(
            parse_render_arguments([str(path), *more, "--out", str(tmp_path / "run")])
        ).identity
        for more in (["--mirrors", "Road"], ["--no-mirrors", "Road"], ["--mirrors", "Window"])
    }
    assert len(others | {plain.identity, marked.identity}) == 5
    with pytest.raises(ConfigError, match="No object of the scene is called 'Wall'"):
        set_mirrors(bpy.context.scene, "Road,Wall", "never")
    with pytest.raises(ConfigError, match="'yes'; expected one of auto, first, never"):
        set_mirror_by_script(bpy.data.objects["Road"], "yes")


def test_the_window_has_the_same_choice(tmp_path: Path) -> None:
    items = street()
    rig_settings.register()
    try:
        assert items["Road"].radarsim_mirror_images == "auto"
        items["Road"].radarsim_mirror_images = "never"
        assert mirror_choice(items["Road"]) == "never"
        set_mirror(items["Road"], "first")
        assert items["Road"].radarsim_mirror_images == "first"
    finally:
        rig_settings.unregister()
