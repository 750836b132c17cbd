# SPDX-License-Identifier: GPL-3.0-or-later
"""Standard errors of shifted grids against the true error of shapes in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from radarsim_addon.contract import ReceiverRecord
from radarsim_addon.signal.decoding import pixel_rays
from radarsim_addon.signal.paths import (
    PathRows,
    edge_variances,
    lone_variances,
    replicate_offset_px,
)
from radarsim_addon.signal.paths.replicates import replicate_variances

PX = 1e-3
SIZE = 28


def camera(kind: str, shift: tuple[float, float] = (0.0, 0.0)) -> ReceiverRecord:
    """A window of 28 x 28 pixels of 1e-3 that is shifted by a part of a pixel."""
    half = SIZE / 2
    left, right = (-half + shift[0]) * PX, (half + shift[0]) * PX
    bottom, top = (-half + shift[1]) * PX, (half + shift[1]) * PX
    turn = math.radians(30)
    pose = np.eye(4)
    pose[:2, :2] = [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
    return ReceiverRecord(kind, pose.tolist(), left, right, bottom, top, 0.0)


def estimate(shape: object, kind: str, count: int) -> tuple[float, float, float]:
    """Mean number of pixels in a shape over the shifts, variance of it by their scatter, and at
    least by edges."""
    sums, least = [], 0.0
    for number in range(count):
        seen = camera(kind, replicate_offset_px(number))
        rays = pixel_rays(seen, SIZE, SIZE)
        u = seen.left / PX + 0.5 + np.arange(SIZE)
        v = seen.top / PX - 0.5 - np.arange(SIZE)
        row, col = np.nonzero(shape(u[None, :], v[:, None]))  # type: ignore[operator]
        rows = PathRows.zeros(row.size)
        rows["direction"] = rays.direction[row, col]
        rows["solid_angle_sr"] = rays.solid_angle_sr[row, col] / count
        rows["order"] = 1
        if kind == "orthographic":
            rows["first_scatterer_m"] = rays.origin_m[row, col] + 5 * rays.direction[row, col]
        label = np.ones(row.size, dtype=np.int64)
        found = edge_variances(rows, label, np.ones(row.size), camera(kind), count)
        least += float(found[-1]) / count if row.size else 0.0
        sums.append(row.size)
    return float(np.mean(sums)), float(np.var(sums, ddof=1)) / count, least


def places(count: int) -> np.ndarray:
    """Sub-pixel places of a shape."""
    one = (np.arange(count) + 0.37) / count - 0.5
    return np.stack(np.meshgrid(one, one), axis=-1).reshape(-1, 2)


def errors(width: float, height: float, kind: str, count: int) -> np.ndarray:
    """True error, scatter and least error of a rectangle along the grid, by place, (n, 3)."""
    found = []
    for x, y in places(6):

        def inside(u: np.ndarray, v: np.ndarray, x: float = x, y: float = y) -> np.ndarray:
            return (np.abs(u - x) < width / 2) & (np.abs(v - y) < height / 2)

        mean, scatter, least = estimate(inside, kind, count)
        found.append((mean - width * height, math.sqrt(scatter), math.sqrt(least)))
    return np.array(found)


@pytest.mark.parametrize("count", [1, 2, 4, 7, 16])
def test_variance_of_a_side_by_trial(count: int) -> None:
    """Intervals of any length and place, against the closed form."""
    rng = np.random.default_rng(1)
    replicates = np.array([replicate_offset_px(i) for i in range(count)])
    for axis, variance in enumerate(replicate_variances(count)):
        start, length = rng.random((2, 200_000, 1))
        inside = (replicates[:, axis] - start) % 1.0 < length
        trial = np.mean((inside.mean(axis=1) - length[:, 0]) ** 2)
        assert variance == pytest.approx(trial, rel=0.02)
    if count == 1:
        assert variance == pytest.approx(1 / 6)


@pytest.mark.parametrize("count", [2, 4, 8])
@pytest.mark.parametrize("side", [1.1, 2.1, 3.9, 5.05, 7.5, 10.1, 14.3, 20.1, 20.5])
def test_edges_along_the_grid(side: float, count: int) -> None:
    """Squares: the error is never far beyond what is reported, wherever the square lies."""
    true, scatter, least = errors(side, side, "perspective", count).T
    reported = np.maximum(scatter, least)
    ratio = math.sqrt(np.mean(true**2) / np.mean(reported**2))
    assert ratio < 1.3
    # 5 is for two shifts, which may be off by most of a pixel on both sides
    assert np.max(np.abs(true) / reported) < (5 if count == 2 else 3.2)
    if side in (10.1, 20.1):  # what the scatter alone said
        assert np.max(np.abs(true) > 3 * scatter)


@pytest.mark.parametrize("kind", ["perspective", "orthographic", "equirectangular"])
def test_a_thin_strip_along_the_grid(kind: str) -> None:
    """All of its length rides on the same columns, in views of every kind."""
    true, scatter, least = errors(2.05, 19.0, kind, 4).T
    reported = np.maximum(scatter, least)
    assert np.max(np.abs(true) / reported) < 3
    assert np.max(np.abs(true) > 3 * scatter)


def test_edges_aslant_add_little() -> None:
    """A square turned by 30 degrees: as little as its edge makes uncertain whatever its turn."""
    turn = math.radians(30)
    found = []
    for x, y in places(5):

        def inside(u: np.ndarray, v: np.ndarray, x: float = x, y: float = y) -> np.ndarray:
            a = (u - x) * math.cos(turn) + (v - y) * math.sin(turn)
            b = (v - y) * math.cos(turn) - (u - x) * math.sin(turn)
            return (np.abs(a) < 8) & (np.abs(b) < 8)

        found.append(estimate(inside, "perspective", 4)[2])
    # Kendall (1948): 0.0728 of the perimeter, in one shift
    assert np.mean(found) < 0.0728 * 64 / 4
    along = errors(16.0, 16.0, "perspective", 4)[:, 2]
    assert np.mean(found) < 0.3 * np.mean(along**2)


def test_labels_are_told_apart() -> None:
    """Two halves of a square: each has its own edge where they meet; together they have none."""
    seen = camera("perspective")
    rays = pixel_rays(seen, SIZE, SIZE)
    rows, value = PathRows.zeros(100), np.full(100, 2.0)
    rows["direction"] = rays.direction[9:19, 9:19].reshape(-1, 3)
    rows["solid_angle_sr"] = rays.solid_angle_sr[9:19, 9:19].ravel()
    rows["order"] = 1
    label = np.repeat(np.arange(10) // 5 + 1, 10)  # upper and lower half
    found = edge_variances(rows, label, value, seen, 1)
    one = 1 / 6 / 2  # an edge of one pixel
    assert found == pytest.approx([0, *[one * 4 * (2 * 5**2 + 2 * 10**2)] * 2])
    whole = edge_variances(rows, np.ones(100, dtype=np.int64), value, seen, 1)
    assert whole == pytest.approx([0, one * 4 * 4 * 10**2])
    gates = rows.copy()
    gates["transparent_depth"] = label
    same = edge_variances(gates, np.ones(100, dtype=np.int64), value, seen, 1)
    assert same == pytest.approx([0, found[1] + found[2]])
    assert edge_variances(rows[:0], label[:0], value[:0], seen, 4) == pytest.approx([0])


def view_of(labels: np.ndarray, camera_kind: str = "perspective") -> tuple[np.ndarray, np.ndarray]:
    """Rows of one shift and the labels of them: one pixel each where there is a label."""
    rays = pixel_rays(camera(camera_kind), SIZE, SIZE)
    row, col = np.nonzero(labels)
    rows = PathRows.zeros(row.size)
    rows["direction"] = rays.direction[row, col]
    rows["solid_angle_sr"] = rays.solid_angle_sr[row, col]
    rows["order"] = 1
    if camera_kind == "orthographic":
        rows["first_scatterer_m"] = rays.origin_m[row, col] + 5 * rays.direction[row, col]
    return rows, labels[row, col]


@pytest.mark.parametrize("side", [1.1, 2.1, 3.9, 5.05, 7.5, 10.1, 14.3, 20.1, 20.5])
def test_edges_in_one_shift(side: float) -> None:
    """Squares anywhere on the grid, of one shift: what is reported is the error they have."""
    true, reported = [], []
    for x, y in places(20):
        # the middle of a pixel is where its ray is
        at = np.arange(SIZE) - SIZE / 2 + 0.5
        inside = (np.abs(at[None, :] - x) < side / 2) & (np.abs(at[:, None] - y) < side / 2)
        rows, label = view_of(inside.astype(np.int64))
        found = lone_variances(rows, label, np.ones(label.size), camera("perspective"))
        true.append(label.size - side**2)
        reported.append(math.sqrt(found[-1]))
    ratio = math.sqrt(np.mean(np.square(true)) / np.mean(np.square(reported)))
    # a side of n + f pixels has f (1 - f), on average over f 1/6, which is what is reported
    fraction = side % 1
    expected = math.sqrt(6 * fraction * (1 - fraction))
    if side < 2:  # a lone pixel may be wrong by all of itself
        assert 0.5 * expected < ratio < expected
    else:
        assert ratio == pytest.approx(expected, rel=0.12)
    assert np.max(np.abs(true) / np.array(reported)) < 3.6


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_chance_in_one_shift(kind: str) -> None:
    """Pixels left to chance: the variance of their sum, from one draw of them."""
    rng = np.random.default_rng(5)
    labels = np.zeros((SIZE, SIZE), dtype=np.int64)
    labels[4:24, 4:14], labels[4:24, 14:24] = 1, 2
    rows, label = view_of(labels, kind)
    # one in four is met, as by a lobe that a lot chooses; the other half is smooth
    draws = np.where(label == 1, 4.0 * (rng.random((400, label.size)) < 0.25), 1.0)
    seen = camera(kind)
    estimates = np.array([lone_variances(rows, label, draw, seen) for draw in draws])
    flat = lone_variances(rows, label, np.ones(label.size), seen)
    chance = estimates[:, 1].mean() - flat[1]
    # the edges' runs vary with the draw, too: (4/12 + ...) of it at most
    assert chance == pytest.approx(200 * 16 * 0.25 * 0.75, rel=0.25)
    assert estimates[:, 2] == pytest.approx(flat[2])
    true = draws[:, label == 1].sum(axis=1)
    sigma = np.sqrt(estimates[:, 1])
    assert np.mean(np.abs(true - 200) > 2 * sigma) < 0.05


def test_a_smooth_surface_in_one_shift() -> None:
    """A slope adds little to its edges; a lone pixel, and what has no place, are not known."""
    labels = np.zeros((SIZE, SIZE), dtype=np.int64)
    labels[4:24, 4:24] = 1
    rows, label = view_of(labels)
    slope = 1 + np.arange(20.0)[None, :] / 20 * np.ones((20, 1))
    found = lone_variances(rows, label, slope.ravel(), camera("perspective"))
    edges = edge_variances(rows, label, slope.ravel(), camera("perspective"), 1)
    assert found[1] - edges[1] == pytest.approx(400 * 0.05**2 / 4)  # along one of two axes
    assert found[1] < 1.01 * edges[1]
    labels = np.zeros((SIZE, SIZE), dtype=np.int64)
    labels[3, 3] = 1
    rows, label = view_of(labels)
    assert lone_variances(rows, label, np.full(1, 3.0), camera("perspective"))[1] >= 9
    rows, label = view_of(labels, "orthographic")
    rows["first_scatterer_m"] = np.nan
    assert lone_variances(rows, label, np.full(1, 3.0), camera("orthographic"))[1] == 9
    assert lone_variances(rows[:0], label[:0], np.zeros(0), camera("perspective")) == [0]
