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


@pytest.mark.parametrize(("light", "told"), [(1.1e-38, False), (1.2e-38, True)])
def test_marks_with_all_digits(light: float, told: bool) -> None:
    marks = path_classes.MarkedVertices(path_classes.TraceLimits())
    view: Any = SimpleNamespace(colours=lambda lit: np.array([1.0, light]))
    for place in (True, False):
        marks._views[path_classes.VertexMark(2, 0, place), False] = view
    assert (marks.found(2, 0, False, np.ones((1, 1))) is not None) is told


@pytest.mark.parametrize(("left", "columns"), [(0.7e-6, 1), (1.4e-6, 2)])
def test_a_difference_of_renders_is_rounding(
    monkeypatch: pytest.MonkeyPatch, left: float, columns: int
) -> None:
    """Of three pixels one is left, and another by so much: which ones are rendered next."""
    limits = path_classes.TraceLimits(max_depth=1, max_unfollowed_fraction=0.0)
    tracer = path_classes._Tracer(limits, np.ones((1, 3)), path_classes.TracedReplicate())
    regions = []

    def layer(order: int, depth: int, path_class: Any, region: Any, only: Any) -> Any:
        regions.append(region)
        yield from ()
        return SimpleNamespace(amplitude=np.array([[0.5, 1 - left, 1.0]]) * (depth == 0))

    monkeypatch.setattr(tracer, "layer", layer)
    list(tracer.depths_of(2, np.ones((1, 3))))
    assert regions[1].right - regions[1].left == columns
