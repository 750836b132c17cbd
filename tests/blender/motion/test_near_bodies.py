# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies near points, while some of them move: each pair that a search of all finds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

pytest.importorskip("bpy")

from radarsim_addon.arrays import Real
from radarsim_addon.blender.motion import bodies as module
from radarsim_addon.blender.motion.bodies import pairs_near
from radarsim_addon.blender.state import Layout

MARGIN_M = 0.05
COUNT = 600


def layout(count: int) -> Layout:
    none = np.zeros(count, dtype=np.intp)
    return Layout(none, [], none, np.zeros((count, 8), np.int32), none > 0, [], {}, {})


def scene() -> tuple[Real, Real, Real]:
    """Points, poses and boxes of several sizes."""
    rng = np.random.default_rng(3)
    pose = np.tile(np.eye(4), (COUNT, 1, 1))
    pose[:, :3, 3] = rng.uniform(-5, 5, (COUNT, 3))
    half = np.where(rng.random(COUNT) < 0.8, 0.3, 1.7)[:, None]
    box = np.stack([np.repeat(-half, 3, axis=1), np.repeat(half, 3, axis=1)], axis=1)
    return rng.uniform(-5, 5, (300, 3)), pose, box


def touching(points: Real, pose: Real, box: Real) -> set[tuple[int, int]]:
    """All pairs of a point and a box that it is in, or as far from as the margin."""
    local = points[:, None] - pose[:, :3, 3]
    local = np.einsum("nji,knj->kni", pose[:, :3, :3], local)
    off = np.maximum(np.maximum(box[:, 0] - local, local - box[:, 1]), 0.0)
    return set(zip(*np.nonzero(np.linalg.norm(off, axis=2) <= MARGIN_M), strict=True))


def found(kept_by: Layout, points: Real, pose: Real, box: Real) -> set[tuple[int, int]]:
    pairs = pairs_near(kept_by, slice(0, COUNT), pose, box, points, MARGIN_M)
    listed = list(zip(*map(np.ndarray.tolist, pairs), strict=True))
    assert len(set(listed)) == len(listed)  # a pair twice would count as two boxes
    return set(listed)


def one_moves(pose: Real, box: Real) -> None:
    pose[7, 0, 3] += 4.0


def one_turns(pose: Real, box: Real) -> None:
    box[7] = [[-3, -0.1, -0.1], [3, 0.1, 0.1]]
    pose[7, :3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]


def one_grows(pose: Real, box: Real) -> None:
    box[7] *= 6.0


def many_move(pose: Real, box: Real) -> None:
    pose[: COUNT // 2, 1, 3] -= 1.0


@pytest.mark.parametrize("change", [one_moves, one_turns, one_grows, many_move])
def test_what_changes_is_found_where_it_is(change: Callable[[Real, Real], None]) -> None:
    points, pose, box = scene()
    kept_by = layout(COUNT)
    assert found(kept_by, points, pose, box) >= touching(points, pose, box)
    before = touching(points, pose, box)
    pose, box = pose.copy(), box.copy()
    for _ in range(2):
        change(pose, box)
        pose, box = pose.copy(), box.copy()
        assert touching(points, pose, box) != before
        assert found(kept_by, points, pose, box) >= touching(points, pose, box)


def test_trees_are_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    points, pose, box = scene()
    kept_by = layout(COUNT)
    made: list[int] = []
    tree = module._tree

    def counted(places: Real) -> object:
        made.append(len(places))
        return tree(places)

    monkeypatch.setattr(module, "_tree", counted)
    found(kept_by, points, pose, box)
    assert sum(made) == COUNT + len(points)
    made.clear()
    pose = pose.copy()
    one_moves(pose, box)
    found(kept_by, points, pose, box)
    assert made == [len(points)]


def test_few_points_are_sought_by_trees_too() -> None:
    points, pose, box = scene()
    assert found(layout(COUNT), points[:3], pose, box) >= touching(points[:3], pose, box)
