# SPDX-License-Identifier: GPL-3.0-or-later
"""A measurement that a timer drives, tick by tick."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.nodes import attributes
from radarsim_addon.blender.state import SettingsRestorer
from radarsim_addon.blender.ui import operators
from radarsim_addon.blender.ui.operators import InteractiveRender
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


@pytest.fixture
def scene(addon: Any) -> Any:
    return rs.ring_scene()


def handler_counts() -> dict[str, int]:
    return {
        name: len(getattr(bpy.app.handlers, name))
        for name in dir(bpy.app.handlers)
        if isinstance(getattr(bpy.app.handlers, name), list)
    }


@pytest.fixture
def interactive_run(scene: Any, tmp_path: Path) -> Any:
    """A prepared run, driven tick by tick (without a window renders end within the tick)."""
    handlers = handler_counts()
    display = bpy.context.preferences.view.render_display_type
    job = rs.job_for(tmp_path)
    job.prepare()
    run = InteractiveRender(job, bpy.context.preferences)
    assert bpy.context.preferences.view.render_display_type == "NONE"
    yield run
    run.close()
    assert job.unrestored == []
    assert handler_counts() == handlers
    assert bpy.context.preferences.view.render_display_type == display
    scene = bpy.context.scene  # a test may have loaded a file
    assert attributes.ATTR_RING_MAX not in scene
    assert scene.render.resolution_x == 1920


def test_ticks_render_everything(interactive_run: Any, tmp_path: Path) -> None:
    ticks = 0
    while not interactive_run.tick():
        ticks += 1
        assert ticks < 100
    assert interactive_run.stop_reason == ""
    assert interactive_run.job.done == interactive_run.job.total == 3
    assert len(list(tmp_path.rglob("ring_*.json"))) == 3


def test_esc_stops_after_the_running_render_and_the_run_goes_on(
    interactive_run: Any, tmp_path: Path
) -> None:
    assert not interactive_run.tick()
    interactive_run.request_stop("stopped by Esc")
    assert interactive_run.tick()
    assert interactive_run.job.done == 1
    interactive_run.close()
    assert interactive_run.tick()
    assert rs.run(tmp_path).done == 3


@pytest.mark.parametrize("stopped", [False, True])
def test_the_end_waits_for_icons_that_cycles_draws(
    interactive_run: Any, monkeypatch: pytest.MonkeyPatch, stopped: bool
) -> None:
    """To set the render engine meanwhile blocks Blender for good."""
    busy = True
    monkeypatch.setattr(operators, "_icons_are_drawn", lambda: busy)
    if stopped:
        interactive_run.request_stop("stopped by Esc")
    for _ in range(50):
        assert not interactive_run.tick()
    assert interactive_run.job.done == (0 if stopped else 3)
    busy = False
    assert interactive_run.tick()


@pytest.mark.parametrize("engine", ["CYCLES", "BLENDER_WORKBENCH"])
def test_the_engine_is_set_only_where_it_is_another(
    scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, engine: str
) -> None:
    scene.render.engine = engine
    names = []
    put = SettingsRestorer.set

    def noted(self: Any, owner: Any, name: str, value: Any) -> None:
        names.append(name)
        put(self, owner, name, value)

    monkeypatch.setattr(SettingsRestorer, "set", noted)
    job = rs.job_for(tmp_path)
    job.prepare()
    assert scene.render.engine == "CYCLES"
    job.restore()
    assert scene.render.engine == engine
    assert ("engine" in names) == (engine != "CYCLES") and "resolution_x" in names


def test_a_moment_at_which_blender_refuses_changes_is_waited_for(
    interactive_run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    touch = interactive_run.job.touch
    touch()
    refusals = iter(range(5))

    def touch_later() -> None:
        if next(refusals, None) is not None:
            raise AttributeError("Writing to ID classes in this context is not allowed")
        touch()

    monkeypatch.setattr(interactive_run.job, "touch", touch_later)
    for _ in range(5):
        assert not interactive_run.tick()
        assert interactive_run.rendering is None
    assert not interactive_run.tick()
    assert interactive_run.rendering is not None


def test_cancelled_render_stops_the_run(
    interactive_run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Esc during a render reaches Blender's own render job, which calls render_cancel."""
    assert not interactive_run.tick()
    interactive_run._ended = ""
    bpy.app.handlers.render_cancel[-1](bpy.context.scene, None)
    assert interactive_run.tick()
    assert interactive_run.stop_reason == "cancelled"
    assert not list(tmp_path.rglob("ring_*.json"))


def test_a_render_that_vanishes_is_named(
    interactive_run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(operators, "_PATIENCE_TICKS", 3)
    assert not interactive_run.tick()
    interactive_run._ended = ""
    with pytest.raises(operators.RenderError, match="without a message"):
        for _ in range(10):
            interactive_run.tick()


def test_saving_in_the_middle_saves_the_users_settings(
    interactive_run: Any, tmp_path: Path
) -> None:
    interactive_run.tick()
    path = tmp_path / "saved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    assert interactive_run.closed
    assert interactive_run.tick()
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    assert scene.render.resolution_x == 1920
    assert attributes.ATTR_RING_MAX not in scene


def test_progress_of_a_single_frame_moves(scene: Any, tmp_path: Path) -> None:
    """One tile of four replicates: five steps, each shown, and what is done in words."""
    settings = rs.radar()
    settings.sampling_mode, settings.output_folder = "paths", str(tmp_path)
    job = operators._job_of(bpy.context)
    job.prepare()
    run = InteractiveRender(job, bpy.context.preferences)
    shown, stages = [], []
    try:
        while not run.tick():
            shown.append(job.fraction)
            stages.append(job.stage)
    finally:
        run.close()
    assert job.total == job.done == 5
    assert 0.8 in shown  # before the table is written
    assert stages[-1] == "frame 1, motion and path table"
    assert {stage.partition(",")[0] for stage in stages} == {"frame 1"}
