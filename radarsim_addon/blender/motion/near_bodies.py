# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of points and bodies that may touch: by spheres around the boxes of the bodies.

Few of many instances move from frame to frame, so the search trees of the others are kept.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ...array_types import Indices, Mask, Real
from ..state import Layout

#: Boxes up to which each is compared with each point.
_FEW = 32
#: Part of the bodies that may have changed before the trees are made again.
_MOST_CHANGED = 0.1

Pairs = tuple[Indices, Indices]


@dataclass(frozen=True)
class _Spheres:
    """Spheres around n boxes: `centre` (n, 3), `radius` (n,) [m] of `pose` and `box`.

    `groups` are indices of boxes of similar size, each with a search tree of their centres if there
    is one.
    """

    pose: Real
    box: Real
    centre: Real
    radius: Real
    groups: list[tuple[Indices, Any]]

    def changed(self, pose: Real, box: Real) -> Mask:
        """Return which of the n bodies have another pose or box now, (n,)."""
        differs = pose != self.pose
        # any() over 16 values each takes several times as long
        found = differs.reshape(-1, 16).view(np.uint64).any(axis=1)
        return np.asarray(found | (box != self.box).any(axis=(1, 2)))


_kept: WeakKeyDictionary[Layout, dict[tuple[int, int], _Spheres]] = WeakKeyDictionary()


def pairs_near(
    layout: Layout, bodies: slice, pose: Real, box: Real, points: Real, margin_m: float
) -> Pairs:
    """Return pairs of points and of bodies around whose boxes are spheres with the point.

    Parameters
    ----------
    layout
        Of the scene.
    bodies
        Which of its bodies: what is kept is of these.
    pose, box
        Their poses (n, 4, 4) and boxes (n, 2, 3) [m].
    points
        (k, 3) [m].
    margin_m
        Added to each radius [m].

    Returns
    -------
    tuple of ndarray
        Indices of points and, from 0, of bodies. Some pairs may be farther apart.
    """
    kept = _kept.setdefault(layout, {})
    spheres = kept.get((bodies.start, bodies.stop))
    changed = np.ones(len(pose), dtype=bool)
    if spheres is not None:
        changed = spheres.changed(pose, box)
    if spheres is None or changed.sum() > max(_FEW, _MOST_CHANGED * len(pose)):
        spheres, changed = _spheres(pose, box), np.zeros(len(pose), dtype=bool)
        if len(pose) >= _FEW:
            kept[bodies.start, bodies.stop] = spheres
    found = list(_pairs_in_groups(spheres, points, margin_m))
    if changed.any():
        found = [(row[~changed[part]], part[~changed[part]]) for row, part in found]
        loose = np.flatnonzero(changed)
        now = _spheres(pose[loose], box[loose])
        found += [(row, loose[part]) for row, part in _pairs_in_groups(now, points, margin_m)]
    rows, parts = zip(*found, strict=True)
    return np.concatenate(rows), np.concatenate(parts)


def _spheres(pose: Real, box: Real) -> _Spheres:
    centre = np.einsum("nij,nj->ni", pose[:, :3, :3], box.mean(axis=1)) + pose[:, :3, 3]
    half = (box[:, 1] - box[:, 0]) / 2
    reach = np.einsum("nij,nj->ni", np.abs(pose[:, :3, :3]), half)
    radius = np.linalg.norm(reach, axis=1)
    # One tree for each power of two of the radius: boxes of similar size have few neighbours.
    size = np.ceil(np.log2(np.maximum(radius, np.finfo(np.float64).tiny)))
    groups = [np.flatnonzero(size == one) for one in np.unique(size)]
    trees = [_tree(centre[here]) if here.size >= _FEW else None for here in groups]
    # copies: whoever changes theirs would not be noticed
    return _Spheres(pose.copy(), box.copy(), centre, radius, list(zip(groups, trees, strict=True)))


def _tree(places: Real) -> Any:
    """Return a search tree of places; None without scipy, as some Blender programs are."""
    with contextlib.suppress(ImportError):
        from scipy.spatial import cKDTree  # a second of processor time: most scenes need none

        return cKDTree(places, balanced_tree=False)
    return None


def _pairs_in_groups(spheres: _Spheres, points: Real, margin_m: float) -> Iterator[Pairs]:
    """Yield the pairs of each group, at most about the radius of the largest one apart."""
    of_points = None
    for here, tree in spheres.groups:
        radius = spheres.radius[here] + margin_m
        if tree is not None:
            of_points = _tree(points) if of_points is None else of_points
            reach_m = float(radius.max())
            pairs = of_points.sparse_distance_matrix(tree, reach_m, output_type="ndarray")
            yield pairs["i"], here[pairs["j"]]
            continue
        for start in range(0, here.size, _FEW):
            some = slice(start, start + _FEW)
            apart = np.linalg.norm(points - spheres.centre[here[some], None], axis=2)
            part, row = np.nonzero(apart <= radius[some, None])
            yield row, here[part + start]
