# SPDX-License-Identifier: GPL-3.0-or-later
"""Which renders bring the marks of last vertices, on a path tracer of numpy: no render."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import pytest

pytest.importorskip("bpy")

from radarsim_addon.blender.views import RenderRequest, TracedReplicate, View
from tests.blender.paths.test_paths_plan import (
    SHAPE,
    Tracer,
    layers_as_paths,
    random_paths,
    wanted,
)


def place(order: int, depth: int) -> float:
    """Colour that stands for where paths of a class have their last vertex, 0.5 to 1.5."""
    return 0.5 + 0.1 * order + 0.01 * depth


@dataclass
class MarkingTracer(Tracer):
    """Surfaces shine whether or not the transmitter reaches them, dimmed as the walk was.

    The walk is another one where rays pass surfaces with certainty: on the way to the first one, or
    where they may only end after the last reflection that was asked for.
    """

    opaque: bool = False
    dark: bool = False

    def render(self, request: RenderRequest) -> View:
        view, mark = super().render(request), request.mark
        if mark is None:
            if request.vertex:
                colours = [plane * place(*self._only(request)) for plane in view.channels()]
                view = dataclasses.replace(
                    view, **dict(zip(("red", "green", "blue"), colours, strict=True))
                )
            return view
        assert request.encoded
        assert not request.by_polarisation
        path_class = request.path_class
        light = np.random.default_rng([mark.order, mark.depth]).uniform(1e-6, 2.0, SHAPE)
        if not self.opaque:
            light *= 7.0 if path_class.surface_depth is not None else 1.0
            light *= 3.0 if mark.order > (path_class.order_max or 0) else 1.0
        if mark.order > (path_class.order_max or 0) + 1 or self.dark:
            light *= 0.0
        if request.region is not None:
            part, whole = request.region, np.zeros(SHAPE)
            inside = np.s_[part.top : part.bottom, part.left : part.right]
            whole[inside] = light[inside]
            light = whole
        colour = place(mark.order, mark.depth) if mark.place else 1.0
        code = np.array([0.5, 0.25, 1.0])[:, None, None]
        marks = View(*(light * code * colour))
        view = dataclasses.replace(view, marks=marks)
        if request.vertex:
            colours = [plane * place(*self._only(request)) for plane in view.channels()]
            view = dataclasses.replace(
                view, **dict(zip(("red", "green", "blue"), colours, strict=True))
            )
        return view

    @staticmethod
    def _only(request: RenderRequest) -> tuple[int, int]:
        path_class = request.path_class
        assert path_class.order_min == path_class.order_max
        return path_class.order_min, path_class.depth_min


def check_vertices(found: TracedReplicate) -> None:
    """Each path of several reflections has the vertex of its class."""
    for layer in found.layers:
        if layer.order == 1:
            assert layer.vertex is None
            continue
        assert layer.vertex is not None
        lit = layer.amplitude > 0
        white = layer.encoded if layer.white is None else layer.white
        ratio = layer.vertex.channels()[:, lit] / white.channels()[:, lit]
        np.testing.assert_allclose(ratio, place(layer.order, layer.depth), rtol=1e-12)


def vertex_renders(tracer: Tracer) -> int:
    return sum(request.vertex for request in tracer.asked)


@pytest.mark.parametrize("world_encoding", [False, True])
@pytest.mark.parametrize("deterministic_transmission", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_every_vertex_is_told(
    seed: int, deterministic_transmission: bool, world_encoding: bool
) -> None:
    """With lobes left to chance; paths are those without marks, in fewer renders."""
    paths = random_paths(orders=3, depths=5, seed=seed)
    limits = {
        "max_reflections": 3,
        "max_unfollowed_fraction": 1e-9,
        "deterministic_transmission": deterministic_transmission,
        "world_encoding": world_encoding,
    }
    plain, marked = MarkingTracer(paths), MarkingTracer(paths)
    check_vertices(plain.run(**limits))
    found = marked.run(**limits, vertex_marks=True)
    check_vertices(found)
    assert layers_as_paths(found) == wanted(paths)
    assert vertex_renders(plain) == 10
    # Two of three classes need none. The world's encoding leaves the first render of an order
    # without marks.
    needed = 4 if world_encoding else 3
    assert vertex_renders(marked) == needed
    assert len(marked.asked) == len(plain.asked) - 10 + needed


@pytest.mark.parametrize("world_encoding", [False, True])
@pytest.mark.parametrize("orders", [2, 3, 4])
def test_where_nothing_is_transparent_no_render_is_for_vertices(
    orders: int, world_encoding: bool
) -> None:
    """The first render, of one reflection, has one half; an order takes one render of its own."""
    paths = random_paths(orders=orders, depths=1)
    tracer = MarkingTracer(paths, opaque=True)
    found = tracer.run(
        max_reflections=orders,
        max_unfollowed_fraction=1e-9,
        deterministic_transmission=True,
        world_encoding=world_encoding,
        all_opaque=True,
        opaque=frozenset({1}),
        vertex_marks=True,
    )
    check_vertices(found)
    assert layers_as_paths(found) == wanted(paths)
    # the fourth order's halves find no room in the renders before it
    assert vertex_renders(tracer) == (1 if orders == 4 else 0)
    assert len(tracer.asked) == {2: 2, 3: 4, 4: 6}[orders]


def test_marks_that_are_missing_are_replaced() -> None:
    """A surface without the light: the transmitter's colours tell its vertices."""
    paths = random_paths(orders=2, depths=3)
    tracer = MarkingTracer(paths, dark=True)
    found = tracer.run(
        max_reflections=2,
        max_unfollowed_fraction=1e-9,
        deterministic_transmission=True,
        vertex_marks=True,
    )
    check_vertices(found)
    assert layers_as_paths(found) == wanted(paths)
    assert vertex_renders(tracer) == 3


def test_one_reflection_needs_no_marks() -> None:
    tracer = MarkingTracer(random_paths(orders=1, depths=3))
    tracer.run(max_reflections=1, deterministic_transmission=True, vertex_marks=True)
    assert all(request.mark is None for request in tracer.asked)
