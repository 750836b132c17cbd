# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits are crossed: just below and just above."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy
import pytest

from radarsim_addon.blender.ui import scene_panel

pytestmark = pytest.mark.blender


@pytest.mark.parametrize(("seconds", "long"), [(901.0, True), (899.0, False)])
def test_long_run_is_named(seconds: float, long: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    unused: Any = None  # only the time counts
    monkeypatch.setattr(scene_panel, "effort", lambda *_: ("", seconds))
    monkeypatch.setattr(scene_panel, "active_group", lambda _: SimpleNamespace(quality="draft"))
    assert bool(scene_panel.long_run(bpy.context, unused)) == long
