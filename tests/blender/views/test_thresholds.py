# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits are crossed: just below and just above."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("bpy")

from radarsim_addon.blender.views import path_classes

pytestmark = pytest.mark.blender


@pytest.mark.parametrize(("spread", "coloured"), [(0.8e-5, False), (1.2e-5, True)])
def test_grey_up_to_rounding(
    monkeypatch: pytest.MonkeyPatch, spread: float, coloured: bool
) -> None:
    limits: Any = SimpleNamespace(world_encoding=True, amplitude_channel="B", max_reflections=1)
    found: Any = SimpleNamespace(renders=0, coloured=None, total=0.0)
    monkeypatch.setattr(path_classes, "amplitude_of", lambda *_: np.zeros((1, 1)))
    tracer = path_classes._Tracer(limits, np.ones((1, 1)), found)
    view = SimpleNamespace(channels=lambda: np.array([[[1.0 - spread]], [[1.0]], [[1.0]]]))

    def render(*_: Any) -> Any:
        yield None
        return view

    monkeypatch.setattr(tracer, "render", render)
    list(tracer.open_render(path_classes.PathClass()))
    assert found.coloured is coloured
