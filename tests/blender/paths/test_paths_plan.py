# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan of gates on a path tracer of numpy, and the options: no render."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

import numpy as np
import pytest

pytest.importorskip("bpy")

from radarsim_addon.blender.plan import PathOptions
from radarsim_addon.blender.views import (
    PathClass,
    PowerBeyond,
    RenderRequest,
    TracedReplicate,
    TraceLimits,
    View,
    ViewWindow,
    look_beyond,
    trace_replicate,
)
from radarsim_addon.errors import ConfigError

SHAPE = (3, 4)
K = 10.0


@dataclass(frozen=True)
class Path:
    """One path of one pixel; rgb its reflectances."""

    row: int
    col: int
    order: int
    depth: int
    length: float
    amplitude: float
    rgb: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass
class Tracer:
    """Renders lists of paths as Cycles would: several may add up in a pixel.

    A pixel has as many surfaces in line as its deepest path needs; `unlucky` pixels lose, in
    renders that leave lobes to chance, all that lies behind the first surface.
    """

    paths: list[Path]
    asked: list[RenderRequest] = field(default_factory=list)
    unlucky: frozenset[tuple[int, int]] = frozenset()

    def render(self, request: RenderRequest) -> View:
        self.asked.append(request)
        path_class, planes = request.path_class, np.zeros((3, *SHAPE))
        for path in self.paths:
            if not path_class.order_min <= path.order <= (path_class.order_max or math.inf):
                continue
            most = math.inf if path_class.depth_max is None else path_class.depth_max
            if not path_class.depth_min <= path.depth <= most:
                continue
            behind = path.depth > (path_class.surface_depth or 0)
            if behind and (path.row, path.col) in self.unlucky:
                continue
            code = np.array([1.0, 2.0, 0.0]) * path.length / K * request.encoded
            planes[:, path.row, path.col] += path.amplitude * np.array(path.rgb) * np.exp(-code)
        return View(*planes, object_index=self._surfaces(path_class))

    def _surfaces(self, path_class: PathClass) -> np.ndarray:
        """Number 1 where there is a surface at the gate, behind those that are passed."""
        count = np.zeros(SHAPE, dtype=np.int32)
        for path in self.paths:
            count[path.row, path.col] = max(count[path.row, path.col], path.depth + 1)
        return (count > (path_class.surface_depth or 0)).astype(np.int32)

    def run(self, weight: np.ndarray | None = None, **limits: object) -> TracedReplicate:
        trace = trace_replicate(TraceLimits(**limits), np.ones(SHAPE) if weight is None else weight)
        request = next(trace)
        while True:
            try:
                request = trace.send(self.render(request))
            except StopIteration as stop:
                found: TracedReplicate = stop.value
                assert found.renders == len(self.asked)
                return found


def layers_as_paths(found: TracedReplicate) -> set[tuple[object, ...]]:
    """What the layers say, each pixel decoded by R/B (or against the plain render)."""
    paths = set()
    for layer in found.layers:
        base = layer.plain.red if layer.plain is not None else layer.encoded.blue
        for row, col in zip(*np.nonzero(layer.amplitude), strict=True):
            length = -K * math.log(layer.encoded.red[row, col] / base[row, col])
            amplitude = float(layer.amplitude[row, col])
            key = (layer.order, layer.depth, round(length, 6), round(amplitude, 9))
            paths.add((int(row), int(col), *key))
    return paths


def wanted(paths: list[Path], amplitude: str = "B") -> set[tuple[object, ...]]:
    pick = {"R": 0, "G": 1, "B": 2}
    return {
        (
            p.row,
            p.col,
            p.order,
            p.depth,
            round(p.length, 6),
            round(
                p.amplitude * (sum(p.rgb) / 3 if amplitude == "mean" else p.rgb[pick[amplitude]]), 9
            ),
        )
        for p in paths
    }


def random_paths(orders: int, depths: int, seed: int = 0) -> list[Path]:
    """At most one path a pixel and gate."""
    rng = np.random.default_rng(seed)
    paths = []
    for row, col, order, depth in itertools.product(
        range(SHAPE[0]), range(SHAPE[1]), range(1, orders + 1), range(depths)
    ):
        if rng.random() < 0.5:
            paths.append(Path(row, col, order, depth, rng.uniform(1, 80), rng.uniform(0.1, 1)))
    return paths


@pytest.mark.parametrize("world_encoding", [False, True])
@pytest.mark.parametrize("deterministic_transmission", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_every_path_class_is_found(
    seed: int, deterministic_transmission: bool, world_encoding: bool
) -> None:
    paths = random_paths(orders=3, depths=5, seed=seed)
    tracer = Tracer(paths)
    found = tracer.run(
        max_reflections=3,
        max_unfollowed_fraction=1e-9,
        deterministic_transmission=deterministic_transmission,
        world_encoding=world_encoding,
    )
    assert layers_as_paths(found) == wanted(paths)
    assert found.total == pytest.approx(sum(p.amplitude for p in paths))
    assert found.truncated_reflections <= 1e-9 * found.total
    assert found.truncated_transparency <= 1e-9 * found.total
    path_classes = [(layer.order, layer.depth) for layer in found.layers]
    assert len(path_classes) == len(set(path_classes))
    for layer in found.layers:
        assert (layer.vertex is not None) == (layer.order > 1)
        assert layer.position_is_first == (
            layer.depth == 0 or (deterministic_transmission and layer.order == 1)
        )


@pytest.mark.parametrize("deterministic_transmission", [False, True])
def test_holes_do_not_stop_it(deterministic_transmission: bool) -> None:
    """An empty order (a mirror) and empty depths (wholly transparent layers)."""
    paths = [Path(0, 0, 1, 6, 20.0, 1.0), Path(1, 1, 3, 4, 50.0, 0.5)]
    found = Tracer(paths).run(
        max_reflections=3,
        max_unfollowed_fraction=1e-6,
        deterministic_transmission=deterministic_transmission,
    )
    assert layers_as_paths(found) == wanted(paths)
    assert [(layer.order, layer.depth) for layer in found.layers] == [(1, 6), (3, 4)]


@pytest.mark.parametrize("deterministic_transmission", [False, True])
def test_nothing_to_see(deterministic_transmission: bool) -> None:
    """No echo: no layer, and no more renders than it takes to know."""
    tracer = Tracer([])
    found = tracer.run(max_reflections=5, deterministic_transmission=deterministic_transmission)
    assert found.layers == []
    assert (found.total, found.truncated_reflections, found.truncated_transparency) == (
        0.0,
        0.0,
        0.0,
    )
    assert len(tracer.asked) == 1


@pytest.mark.parametrize("deterministic_transmission", [False, True])
@pytest.mark.parametrize("max_reflections", [1, 2, 3, 4])
@pytest.mark.parametrize("max_depth", [0, 2, 4, 9])
def test_what_is_left_out_is_told(
    max_reflections: int, max_depth: int, deterministic_transmission: bool
) -> None:
    """Powers by their weights: found, too many reflections, too deep; together all there is."""
    rng = np.random.default_rng(5)
    weight = rng.uniform(0.5, 2.0, SHAPE)
    paths = random_paths(orders=4, depths=5, seed=2)

    def power(keep: object) -> float:
        return sum(p.amplitude * weight[p.row, p.col] for p in paths if keep(p))  # type: ignore[operator]

    found = Tracer(paths).run(
        weight,
        max_reflections=max_reflections,
        max_depth=max_depth,
        max_unfollowed_fraction=1e-9,
        deterministic_transmission=deterministic_transmission,
    )
    assert found.truncated_reflections <= 1e-9 * found.total
    limits = TraceLimits(max_reflections=max_reflections)
    asked = look_beyond(limits, weight, 16.0, coloured=False)
    with pytest.raises(StopIteration) as stop:
        asked.send(Tracer(paths).render(next(asked)))
    beyond: PowerBeyond = stop.value.value
    further = [p.amplitude * weight[p.row, p.col] for p in paths if p.order > max_reflections]
    assert beyond.power == pytest.approx(sum(further), abs=1e-9)
    assert beyond.strongest_ray >= max(further, default=0.0) * (1 - 1e-9)
    assert beyond.pixels_per_ray == 16.0
    assert found.total + beyond.power == pytest.approx(power(lambda p: True))
    strongest = max(float(np.max(layer.amplitude * weight)) for layer in found.layers)
    assert found.strongest == pytest.approx(strongest)
    too_deep = power(lambda p: p.order <= max_reflections and p.depth > max_depth)
    assert found.truncated_transparency == pytest.approx(too_deep, abs=1e-9)
    in_layers = sum(float(np.sum(layer.amplitude * weight)) for layer in found.layers)
    assert in_layers + found.truncated_reflections + found.truncated_transparency == pytest.approx(
        found.total
    )


@pytest.mark.parametrize(("size", "few"), [((2000, 1000), (500, 250)), ((65, 63), (65, 63))])
def test_few_rays_fill_the_whole_window(size: tuple[int, int], few: tuple[int, int]) -> None:
    window = ViewWindow(-1.0, 1.0, -0.5, 0.5, *size).with_few_rays()
    assert (window.width_px, window.height_px) == few
    assert (window.left, window.right, window.bottom, window.top) == (-1.0, 1.0, -0.5, 0.5)


def test_the_residual_ends_it() -> None:
    """What lies below the threshold is not rendered, and is in the sums."""
    paths = [Path(0, 0, 1, d, 10.0 + d, 10.0**-d) for d in range(8)]
    tracer = Tracer(paths)
    found = tracer.run(
        max_reflections=1, max_unfollowed_fraction=1e-3, deterministic_transmission=False
    )
    assert [layer.depth for layer in found.layers] == [0, 1, 2]
    left = sum(p.amplitude for p in paths[3:])
    assert found.truncated_transparency == pytest.approx(left)
    assert found.truncated_transparency <= 1e-3 * found.total * 1.2


def test_coloured_scenes_take_two_renders() -> None:
    """Ranges come from the same paths with and without code, channel by channel."""
    paths = [
        Path(0, 0, 1, 0, 22.0, 1.0, (0.8, 0.25, 0.05)),
        Path(0, 0, 1, 2, 31.0, 0.5, (0.1, 0.9, 0.4)),
        Path(2, 3, 2, 0, 44.0, 0.7, (0.3, 0.3, 0.3)),
    ]
    for channel in ("mean", "R", "G", "B"):
        found = Tracer(paths).run(
            max_reflections=2,
            max_unfollowed_fraction=1e-9,
            world_encoding=True,
            amplitude_channel=channel,
        )
        assert found.coloured
        assert all(layer.plain is not None for layer in found.layers)
        assert layers_as_paths(found) == wanted(paths, channel)


def test_grey_is_not_coloured_by_rounding() -> None:
    paths = [Path(0, 0, 1, 0, 22.0, 1.0, (1.0, 1 + 3e-6, 1 - 3e-6))]
    assert not Tracer(paths).run(world_encoding=True).coloured
    paths = [Path(0, 0, 1, 0, 22.0, 1.0, (1.0, 1 + 3e-4, 1.0))]
    assert Tracer(paths).run(world_encoding=True).coloured


def test_a_small_target_behind_a_pane_is_never_lost() -> None:
    """Whatever lot falls in the renders that leave lobes to chance."""
    paths = [Path(1, 2, 1, depth, 20.0 + depth, 1.0) for depth in (0, 2)]
    unlucky = frozenset(itertools.product(range(SHAPE[0]), range(SHAPE[1])))
    found = Tracer(paths, unlucky=unlucky).run(deterministic_transmission=True)
    assert layers_as_paths(found) == wanted(paths)


def test_opaque_surfaces_end_it() -> None:
    """One render of a gate is enough where nothing can lie behind."""
    tracer = Tracer([Path(0, 0, 1, 0, 20.0, 1.0), Path(2, 2, 1, 0, 30.0, 1.0)])
    found = tracer.run(deterministic_transmission=True, opaque=frozenset({1}))
    assert len(tracer.asked) == 1
    assert layers_as_paths(found) == wanted(tracer.paths)


def test_gates_of_certain_surfaces() -> None:
    """Order 1 in scenes of Radar Materials: gate and tail pass the same surfaces for certain."""
    tracer = Tracer([Path(0, 0, 1, 1, 20.0, 1.0)])
    tracer.run(deterministic_transmission=True)
    for request in tracer.asked:
        assert request.path_class.surface_depth == request.path_class.depth_min
    assert PathClass(1, 1, 1, 1, surface_depth=1) in [r.path_class for r in tracer.asked]


def test_a_long_chain_of_surfaces_ends_where_the_rest_is_weak() -> None:
    """Asked behind every fourth surface."""
    tracer = Tracer([Path(0, 0, 1, 0, 20.0, 1.0), Path(0, 0, 1, 20, 30.0, 1e-6)])
    found = tracer.run(deterministic_transmission=True)
    depths = [r.path_class.depth_min for r in tracer.asked if r.path_class.depth_max is None]
    assert depths == [4]
    assert found.truncated_transparency == 1e-6


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"max_reflections": 0}, "Max reflections is 0"),
        ({"replicates": 0}, "Replicates is 0"),
        ({"replicates": 1.5}, "Replicates is 1.5"),
        ({"tile_px": 2}, "Tile size"),
        ({"max_unfollowed_fraction": -1.0}, "Max unfollowed fraction is -1"),
        ({"max_unfollowed_fraction": math.nan}, "Max unfollowed fraction is nan"),
        ({"max_standard_error": 0.1, "replicates": 1}, "at least 2 replicates"),
        ({"time_limit_s": math.inf}, "Time limit is inf"),
        ({"range_encoding": "colour"}, "'world'"),
        ({"amplitude_channel": "A"}, "'mean'"),
    ],
)
def test_bad_options_are_named(changes: dict[str, object], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        PathOptions(**changes)  # type: ignore[arg-type]
