# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan of gates on a path tracer of numpy, and the tiling: no render."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

import numpy as np
import pytest

pytest.importorskip("bpy")

from radarsim_addon.blender.path_budget import CellGrid, CellPowers, ErrorBudget
from radarsim_addon.blender.path_gates import TracedView, TraceLimits, trace_view
from radarsim_addon.blender.path_options import PathOptions
from radarsim_addon.blender.path_tiles import shift_px
from radarsim_addon.blender.path_views import Gate, RenderRequest, View, coarse_variance
from radarsim_addon.errors import ConfigError
from radarsim_addon.signal.pathtable import FLAG_NO_CODE, PATH_DTYPE

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
        gate, planes = request.gate, np.zeros((3, *SHAPE))
        for path in self.paths:
            if not gate.order_min <= path.order <= (gate.order_max or math.inf):
                continue
            most = math.inf if gate.depth_max is None else gate.depth_max
            if not gate.depth_min <= path.depth <= most:
                continue
            behind = path.depth > (gate.surface_depth or 0)
            if behind and (path.row, path.col) in self.unlucky:
                continue
            code = np.array([1.0, 2.0, 0.0]) * path.length / K * request.coded
            planes[:, path.row, path.col] += path.amplitude * np.array(path.rgb) * np.exp(-code)
        return View(*planes, object_index=self._surfaces(gate))

    def _surfaces(self, gate: Gate) -> np.ndarray:
        """Number 1 where there is a surface at the gate, behind those that are passed."""
        count = np.zeros(SHAPE, dtype=np.int32)
        for path in self.paths:
            count[path.row, path.col] = max(count[path.row, path.col], path.depth + 1)
        return (count > (gate.surface_depth or 0)).astype(np.int32)

    def run(self, weight: np.ndarray | None = None, **limits: object) -> TracedView:
        trace = trace_view(TraceLimits(**limits), np.ones(SHAPE) if weight is None else weight)
        request = next(trace)
        while True:
            try:
                request = trace.send(self.render(request))
            except StopIteration as stop:
                found: TracedView = stop.value
                assert found.renders == len(self.asked)
                return found


def layers_as_paths(found: TracedView, coloured: bool = False) -> set[tuple[object, ...]]:
    """What the layers say, each pixel decoded by R/B (or against the plain render)."""
    paths = set()
    for layer in found.layers:
        base = layer.plain.red if layer.plain is not None else layer.coded.blue
        for row, col in zip(*np.nonzero(layer.amplitude), strict=True):
            length = -K * math.log(layer.coded.red[row, col] / base[row, col])
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


@pytest.mark.parametrize("world_code", [False, True])
@pytest.mark.parametrize("lottery_free", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_every_gate_is_found(seed: int, lottery_free: bool, world_code: bool) -> None:
    paths = random_paths(orders=3, depths=5, seed=seed)
    tracer = Tracer(paths)
    found = tracer.run(max_order=3, residual=1e-9, lottery_free=lottery_free, world_code=world_code)
    assert layers_as_paths(found) == wanted(paths)
    assert found.total == pytest.approx(sum(p.amplitude for p in paths))
    assert found.left_order <= 1e-9 * found.total
    assert found.left_depth <= 1e-9 * found.total
    gates = [(layer.order, layer.depth) for layer in found.layers]
    assert len(gates) == len(set(gates))
    for layer in found.layers:
        assert (layer.vertex is not None) == (layer.order > 1)
        assert layer.position_is_first == (layer.depth == 0 or (lottery_free and layer.order == 1))


@pytest.mark.parametrize("lottery_free", [False, True])
def test_holes_do_not_stop_it(lottery_free: bool) -> None:
    """An empty order (a mirror) and empty depths (wholly transparent layers)."""
    paths = [Path(0, 0, 1, 6, 20.0, 1.0), Path(1, 1, 3, 4, 50.0, 0.5)]
    found = Tracer(paths).run(max_order=3, residual=1e-6, lottery_free=lottery_free)
    assert layers_as_paths(found) == wanted(paths)
    assert [(layer.order, layer.depth) for layer in found.layers] == [(1, 6), (3, 4)]


@pytest.mark.parametrize("lottery_free", [False, True])
def test_nothing_to_see(lottery_free: bool) -> None:
    """No echo: no layer, and no more renders than it takes to know."""
    tracer = Tracer([])
    found = tracer.run(max_order=5, lottery_free=lottery_free)
    assert found.layers == []
    assert (found.total, found.left_order, found.left_depth) == (0.0, 0.0, 0.0)
    assert len(tracer.asked) == 1


@pytest.mark.parametrize("lottery_free", [False, True])
@pytest.mark.parametrize("max_order", [1, 2, 3, 4])
@pytest.mark.parametrize("max_depth", [0, 2, 4, 9])
def test_what_is_left_out_is_told(max_order: int, max_depth: int, lottery_free: bool) -> None:
    """Powers by their weights: found, too many reflections, too deep; together all there is."""
    rng = np.random.default_rng(5)
    weight = rng.uniform(0.5, 2.0, SHAPE)
    paths = random_paths(orders=4, depths=5, seed=2)

    def power(keep: object) -> float:
        return sum(p.amplitude * weight[p.row, p.col] for p in paths if keep(p))  # type: ignore[operator]

    found = Tracer(paths).run(
        weight,
        max_order=max_order,
        max_depth=max_depth,
        residual=1e-9,
        lottery_free=lottery_free,
        probe=True,
    )
    assert found.left_order <= 1e-9 * found.total
    assert found.beyond == pytest.approx(power(lambda p: p.order > max_order), abs=1e-9)
    assert found.total + found.beyond == pytest.approx(power(lambda p: True))
    too_deep = power(lambda p: p.order <= max_order and p.depth > max_depth)
    assert found.left_depth == pytest.approx(too_deep, abs=1e-9)
    in_layers = sum(float(np.sum(layer.amplitude * weight)) for layer in found.layers)
    assert in_layers + found.left_order + found.left_depth == pytest.approx(found.total)


@pytest.mark.parametrize("coarse", [1, 4])
@pytest.mark.parametrize("slope", [0.0, 0.02])
def test_variance_of_a_coarse_image(coarse: int, slope: float) -> None:
    """Rays that lots are drawn for, over a surface that brightens across: by trial."""
    rng = np.random.default_rng(2)
    height, width = 38, 53  # no multiple of the blocks
    rows = np.arange(height) * -(-height // coarse) // height
    cols = np.arange(width) * -(-width // coarse) // width
    expected = (1 + slope * np.arange(cols[-1] + 1)) * np.ones((rows[-1] + 1, 1))
    sums, variances = [], []
    for _ in range(400):
        # one ray in twenty meets something, and is that much brighter
        rays = expected * (rng.random(expected.shape) < 0.05) / 0.05
        image = rays[rows][:, cols]
        sums.append(image.sum())
        variances.append(coarse_variance(image, coarse))
    assert np.mean(variances) == pytest.approx(np.var(sums), rel=0.2)


def test_variance_of_a_single_block() -> None:
    assert coarse_variance(np.full((3, 4), 2.0), 4) == 24.0**2
    assert coarse_variance(np.zeros((8, 8)), 4) == 0.0


def test_the_residual_ends_it() -> None:
    """What lies below the threshold is not rendered, and is in the sums."""
    paths = [Path(0, 0, 1, d, 10.0 + d, 10.0**-d) for d in range(8)]
    tracer = Tracer(paths)
    found = tracer.run(max_order=1, residual=1e-3, lottery_free=False)
    assert [layer.depth for layer in found.layers] == [0, 1, 2]
    left = sum(p.amplitude for p in paths[3:])
    assert found.left_depth == pytest.approx(left)
    assert found.left_depth <= 1e-3 * found.total * 1.2


def test_coloured_scenes_take_two_renders() -> None:
    """Ranges come from the same paths with and without code, channel by channel."""
    paths = [
        Path(0, 0, 1, 0, 22.0, 1.0, (0.8, 0.25, 0.05)),
        Path(0, 0, 1, 2, 31.0, 0.5, (0.1, 0.9, 0.4)),
        Path(2, 3, 2, 0, 44.0, 0.7, (0.3, 0.3, 0.3)),
    ]
    for channel in ("mean", "R", "G", "B"):
        found = Tracer(paths).run(max_order=2, residual=1e-9, world_code=True, amplitude=channel)
        assert found.coloured
        assert all(layer.plain is not None for layer in found.layers)
        assert layers_as_paths(found) == wanted(paths, channel)


def test_grey_is_not_coloured_by_rounding() -> None:
    paths = [Path(0, 0, 1, 0, 22.0, 1.0, (1.0, 1 + 3e-6, 1 - 3e-6))]
    assert not Tracer(paths).run(world_code=True).coloured
    paths = [Path(0, 0, 1, 0, 22.0, 1.0, (1.0, 1 + 3e-4, 1.0))]
    assert Tracer(paths).run(world_code=True).coloured


def test_a_small_target_behind_a_pane_is_never_lost() -> None:
    """Whatever lot falls in the renders that leave lobes to chance."""
    paths = [Path(1, 2, 1, depth, 20.0 + depth, 1.0) for depth in (0, 2)]
    unlucky = frozenset(itertools.product(range(SHAPE[0]), range(SHAPE[1])))
    found = Tracer(paths, unlucky=unlucky).run(lottery_free=True)
    assert layers_as_paths(found) == wanted(paths)


def test_opaque_surfaces_end_it() -> None:
    """One render of a gate is enough where nothing can lie behind."""
    tracer = Tracer([Path(0, 0, 1, 0, 20.0, 1.0), Path(2, 2, 1, 0, 30.0, 1.0)])
    found = tracer.run(lottery_free=True, opaque=frozenset({1}))
    assert len(tracer.asked) == 1
    assert layers_as_paths(found) == wanted(tracer.paths)


def test_gates_of_certain_surfaces() -> None:
    """Order 1 in scenes of Radar Materials: gate and tail pass the same surfaces for certain."""
    tracer = Tracer([Path(0, 0, 1, 1, 20.0, 1.0)])
    tracer.run(lottery_free=True)
    for request in tracer.asked:
        assert request.gate.surface_depth == request.gate.depth_min
    assert Gate(1, 1, 1, 1, surface_depth=1) in [r.gate for r in tracer.asked]


# -- shifts and tiles ------------------------------------------------------------------------------


def test_shifts_fill_the_pixel() -> None:
    """Low discrepancy: the first n leave no square of the pixel of 3/n unvisited, none repeats."""
    shifts = np.array([shift_px(i) for i in range(256)])
    assert np.all(np.abs(shifts) <= 0.5)
    assert len({tuple(s) for s in shifts}) == 256
    assert np.all(np.abs(shifts[0]) > 0.01)  # off the centre
    for count, cells in ((64, 4), (256, 8)):
        place = np.floor((shifts[:count] + 0.5) * cells).astype(int)
        hits = np.zeros((cells, cells), dtype=int)
        np.add.at(hits, (place[:, 0], place[:, 1]), 1)
        assert hits.min() >= 2
        assert hits.max() <= 6
    # A linear function is integrated much better than by random shifts (0.29/sqrt(n)).
    assert np.abs(shifts[:64].mean(axis=0)).max() < 0.02


def rows_at(lengths: list[float], powers: list[float], objects: list[int]) -> np.ndarray:
    rows = np.zeros(len(lengths), dtype=PATH_DTYPE)
    rows["length_m"], rows["power_w"], rows["object"] = lengths, powers, objects
    return rows


def powers_of(grid: CellGrid, shifts: list[np.ndarray]) -> CellPowers:
    """Cell powers of a tile from the rows of its shifts."""
    return grid.powers([grid.shift_powers(rows, len(shifts)) for rows in shifts])


def many(length: float, power: float, number: int, hits: int = 400) -> np.ndarray:
    """Rows of equal power on one object."""
    return rows_at([length] * hits, [power / hits] * hits, [number] * hits)


def test_cell_powers() -> None:
    """Means and variances of the mean over the shifts, by hand."""
    grid = CellGrid(bin_m=1.0, bins=10)
    shifts = [
        rows_at([7.0, 11.0], [1.0, 2.0], [1, 2]),
        rows_at([7.4, 7.6], [3.0, 1.0], [1, 1]),
    ]
    shifts[1]["flags"][1] = FLAG_NO_CODE
    powers = powers_of(grid, shifts)
    found = dict(
        zip(powers.cells.tolist(), zip(powers.mean, powers.variance, strict=True), strict=True)
    )
    first_object = grid.first_object
    # A row's power is its share of two shifts: twice it is the shift's own estimate.
    assert found[3] == pytest.approx((4.0, 4.0))  # 2 and 6
    assert found[5] == pytest.approx((2.0, 4.0))  # 4 and 0
    assert found[first_object + 1] == pytest.approx((5.0, 9.0))  # 2 and 8
    assert found[first_object + 2] == pytest.approx((2.0, 4.0))
    assert set(found) == {3, 5, first_object + 1, first_object + 2}


def test_an_object_of_a_few_pixels_is_uncertain_even_where_shifts_agree() -> None:
    """A square of n grid points has n +- 0.54 n^(1/4) of them, by how the grid happens to lie."""
    grid = CellGrid(bin_m=1.0, bins=10)
    for hits in (1, 16, 400):
        powers = powers_of(grid, [many(7.0, 1.0, 1, hits)] * 2)
        place = powers.cells.tolist().index(grid.first_object + 1)
        relative = math.sqrt(powers.variance[place]) / powers.mean[place]
        assert relative == pytest.approx(0.5385 * hits**-0.75 / math.sqrt(2), rel=1e-3)


def test_edge_variance_is_that_of_a_square_on_a_shifted_grid() -> None:
    """The constant behind it, by trial: squares of random size, place and turn."""
    rng = np.random.default_rng(1)
    ratios = []
    for _ in range(4000):
        side, turn = rng.uniform(3, 12), rng.uniform(0, math.pi / 2)
        u, v = np.meshgrid(np.arange(-12, 13) + rng.random(), np.arange(-12, 13) + rng.random())
        x = u * math.cos(turn) + v * math.sin(turn)
        y = v * math.cos(turn) - u * math.sin(turn)
        count = np.count_nonzero((np.abs(x) < side / 2) & (np.abs(y) < side / 2))
        ratios.append((count - side**2) ** 2 / side)
    assert np.mean(ratios) == pytest.approx(0.29, rel=0.15)


def test_refinement_goes_where_the_error_is() -> None:
    """A strong tile that is known well, a faint one whose shifts disagree, one without echo."""
    grid = CellGrid(bin_m=1.0, bins=100)
    budget = ErrorBudget(grid.first_object)
    budget.powers[0] = powers_of(grid, [many(20.0, 100.0 + d, 1) for d in (0.0, 0.1)])
    budget.powers[1] = powers_of(grid, [many(90.0, 1e-3 * d, 2) for d in (1.0, 2.0)])
    budget.powers[2] = powers_of(grid, [rows_at([], [], []) for _ in range(2)])
    assert budget.worst([0, 1, 2], 0.8) == [1]
    before = budget.relative_error()
    budget.powers[1] = powers_of(grid, [many(90.0, 1.5e-3, 2) for _ in range(2)])
    assert budget.relative_error() < before
    # A small object is refined though its shifts agree, ground without number is not.
    budget.powers[1] = powers_of(grid, [many(90.0, 1.5e-3, 2, hits=2) for _ in range(2)])
    budget.powers[3] = powers_of(grid, [many(50.0, 1.0, 0) for _ in range(2)])
    assert budget.worst([0, 1, 2, 3], 0.9) == [1]
    assert budget.worst([2, 3], 1.0) == []


def test_relative_error_in_closed_form() -> None:
    """Two cells of 1 and 4 W with errors of 10 % and 20 %, weighed by the roots of their powers."""
    grid = CellGrid(bin_m=1.0, bins=100)
    budget = ErrorBudget()
    # Two shifts a +- d: variance of the mean d^2.
    rows = [
        np.concatenate(
            [rows_at([10.0], [(1 + s * 0.1) / 2], [0]), rows_at([50.0], [(4 + s * 0.8) / 2], [0])]
        )
        for s in (1, -1)
    ]
    budget.powers[0] = powers_of(grid, rows)
    bins = [(1.0, 0.1), (4.0, 0.2), (5.0, 0.9 / 5)]  # the third is object 0
    weight = [math.sqrt(p) for p, _ in bins]
    want = math.sqrt(sum(w * e**2 for w, (_, e) in zip(weight, bins, strict=True)) / sum(weight))
    assert budget.relative_error() == pytest.approx(want)
    assert ErrorBudget().relative_error() == 0.0


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"max_order": 0}, "Reflections"),
        ({"shifts": 0}, "Shifts"),
        ({"shifts": 1.5}, "Shifts"),
        ({"tile_px": 2}, "Tile size"),
        ({"residual": -1.0}, "Residual"),
        ({"residual": math.nan}, "Residual"),
        ({"error_target": 0.1, "shifts": 1}, "at least 2 shifts"),
        ({"time_budget_s": math.inf}, "Time budget"),
        ({"code": "colour"}, "'world'"),
        ({"amplitude": "A"}, "'mean'"),
    ],
)
def test_bad_options_are_named(changes: dict[str, object], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        PathOptions(**changes)  # type: ignore[arg-type]
