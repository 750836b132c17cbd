# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels drawn on a layout that keeps what it is given: what they show, and at what cost."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

from radarsim_addon import processes
from radarsim_addon.blender import addon
from radarsim_addon.blender.rig_settings import settings
from radarsim_addon.blender.scene import active_radar
from radarsim_addon.blender.ui import panels
from tests.blender import radar_scenes as rs


class Layout:
    """Records labels; gives itself for all that is nested."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def __getattr__(self, name: str) -> Callable[..., Any]:
        def draw(*_: Any, text: str = "", **__: Any) -> Layout:
            if name == "label":
                self.texts.append(text)
            return self

        return draw


def context() -> Any:
    return SimpleNamespace(
        scene=bpy.context.scene,
        window_manager=bpy.context.window_manager,
        active_object=None,
        region=SimpleNamespace(width=2000),
        preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
        evaluated_depsgraph_get=bpy.context.evaluated_depsgraph_get,
    )


def drawn() -> str:
    """All that the panels of a run show."""
    layout = Layout()
    for panel in (panels.RADARSIM_PT_rig, panels.RADARSIM_PT_render):
        panel.draw(SimpleNamespace(layout=layout), context())
    return " ".join(layout.texts)


@pytest.fixture
def registered() -> Iterator[None]:
    addon.register()
    yield


def car_at(speed_mps: float) -> Any:
    rs.new_scene()
    rs.add_plate(80.0)
    car = rs.add_plate(50.0)
    car.name = "Car"
    rs.move_steadily(car, (0.0, speed_mps, 0.0))
    view = settings(active_radar(bpy.context.scene))
    view.sampling_mode, view.carrier_hz, view.prf_hz = "paths", 77e9, 1000.0
    return view


@pytest.mark.parametrize("mode", ["paths", "rings"])
def test_the_panel_warns_of_an_ambiguous_velocity_before_the_render(
    registered: None, mode: str
) -> None:
    """1 kHz at 77 GHz hold 0.97 m/s; 15 m/s need 4 x 15 / lambda = 15.4 kHz."""
    view = car_at(15.0)
    view.sampling_mode = mode
    text = drawn()
    assert "Car" in text
    assert "at least 15.5 kHz" in text
    view.prf_hz = 15_500.0
    assert "unambiguous velocity" not in drawn()


@pytest.mark.parametrize("mode", ["paths", "rings"])
def test_redraws_do_not_walk_through_the_scene(
    registered: None, mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    view = car_at(15.0)
    view.sampling_mode = mode
    calls: list[str] = []
    for name in ("scene_extent", "keyed_speeds", "echoing_boxes"):
        real = getattr(panels, name)
        monkeypatch.setattr(
            panels, name, lambda *a, real=real, name=name, **k: calls.append(name) or real(*a, **k)
        )
    first = drawn()
    once = len(calls)
    assert once
    for _ in range(5):
        assert drawn() == first
    assert len(calls) == once
    bpy.data.objects["Plate"].location.y += 200.0
    assert (drawn() != first) == (mode == "rings")  # "Scene reaches ..."
    assert len(calls) == 2 * once


def test_what_a_crashed_session_left_is_removed_at_the_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    left, mine = tmp_path / "blender_crashed", tmp_path / "radarsim_running"
    for folder in (left, mine):
        folder.mkdir()
        (folder / "picture.npy").write_bytes(b"1")
        processes.own_folder(folder)
    owner = left / "radarsim_owner.json"
    text = owner.read_text(encoding="utf-8")
    began = str(processes.identity()["began"])
    owner.write_text(text.replace(began, "an earlier start"), encoding="utf-8")
    addon.register()
    assert not left.exists()
    assert mine.exists()
