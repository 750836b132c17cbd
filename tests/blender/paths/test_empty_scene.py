# SPDX-License-Identifier: GPL-3.0-or-later
"""The empty scene from which scenes of many objects are rendered: results, and when it is used."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.scene import reads_context
from radarsim_addon.blender.views import view_setup
from radarsim_addon.contract import PATHS_TABLE, burst_dir
from radarsim_addon.signal.paths import open_table
from radarsim_addon.signal.radar import Burst
from tests.blender import radar_scenes as rs
from tests.blender.path_helpers import run_paths

#: Renders within a burst, between whole frames.
IN_BURST = {"visibility_updates": 3}
pytestmark = pytest.mark.blender


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """Scenes of the context at each render; any number of objects is many."""
    monkeypatch.setattr(view_setup, "_MANY", 0)
    scenes: list[str] = []

    @bpy.app.handlers.persistent  # a new file would end it
    def note(*_: Any) -> None:
        scenes.append(bpy.context.scene.name)

    bpy.app.handlers.render_init.append(note)
    yield scenes
    bpy.app.handlers.render_init.remove(note)


def moving_scene() -> None:
    rs.new_scene()
    plate = rs.add_plate(15.0)
    rs.move_steadily(plate, (0.0, 0.0, -3.0))


def drive(expression: str) -> None:
    plate = next(item for item in bpy.data.objects if item.type == "MESH")
    plate.driver_add("location", 0).driver.expression = expression


def test_results_have_the_same_bits(
    tmp_path: Path, seen: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    tables = []
    for many in (0, 10**9):
        monkeypatch.setattr(view_setup, "_MANY", many)
        moving_scene()
        run = run_paths(
            tmp_path / str(many), frames=(1, 5), burst=Burst(20.0, 16), options=IN_BURST
        )
        folders = [run.folder / burst_dir(frame, n) for frame in (1, 5) for n in range(3)]
        tables.append([open_table(folder / PATHS_TABLE).copy() for folder in folders])
        assert len(bpy.data.scenes) == 1  # the other one is removed
    mine = bpy.context.scene.name
    assert {name == mine for name in seen} == {True, False}
    for one, other in zip(*tables, strict=True):
        assert one.size > 0
        assert one.equals(other)
    means = {one["last_scatterer_m"][:, 2].mean() for one in tables[0]}
    assert len(means) == 6  # it moved, from render to render within the burst too


@pytest.mark.parametrize("expression, asked", [("0.5 * 0.1", False), ("bpy.context.scene.x", True)])
def test_drivers_that_may_read_the_context(expression: str, asked: bool) -> None:
    moving_scene()
    assert not reads_context()
    drive(expression)
    assert reads_context() == asked


@pytest.mark.parametrize("name", ["render_pre", "frame_change_post", "depsgraph_update_post"])
def test_handlers_see_the_scene_of_the_user(tmp_path: Path, seen: list[str], name: str) -> None:
    moving_scene()
    handlers = getattr(bpy.app.handlers, name)
    handlers.append(lambda *_: None)
    try:
        assert reads_context()
        run_paths(tmp_path / "run")
    finally:
        handlers.pop()
    assert set(seen) == {bpy.context.scene.name}
