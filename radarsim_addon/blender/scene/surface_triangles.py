# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles of many surfaces of a snapshot about a point, in float64. Does not import bpy."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ...array_types import Real
from ..state import Snapshot

#: Triangles that are placed at once, about.
_TOGETHER = 1 << 16


def triangles_about(snapshot: Snapshot, rows: Iterable[int], point: Real) -> Iterator[Real]:
    """Yield corners of the triangles of each surface relative to a point, (m, 3, 3)."""
    waiting: list[tuple[int, Any, Any]] = []
    size = 0
    for row in rows:
        found = snapshot.triangles(snapshot.shapes[snapshot.layout.shape[row]])
        waiting.append((row, *found))
        size += len(found[1])
        if size > _TOGETHER:
            yield from _corners_about(snapshot, waiting, point)
            waiting, size = [], 0
    yield from _corners_about(snapshot, waiting, point)


def _corners_about(
    snapshot: Snapshot, surfaces: list[tuple[int, Any, Any]], point: Real
) -> list[Real]:
    """As `triangles_about`, of rows with their vertices and triangles; like meshes in one pass."""
    alike: defaultdict[tuple[int, int], list[int]] = defaultdict(list)
    for number, (_, vertices, triangles) in enumerate(surfaces):
        alike[len(vertices), len(triangles)].append(number)
    found: list[Real] = [np.empty((0, 3, 3))] * len(surfaces)
    for (points, faces), numbers in alike.items():
        rows, vertices, triangles = zip(*(surfaces[number] for number in numbers), strict=True)
        matrices = snapshot.matrices_of(np.array(rows, dtype=np.intp))
        own = np.concatenate(vertices, dtype=np.float64).reshape(len(numbers), points, 3)
        world = own @ matrices[:, :3, :3].transpose(0, 2, 1)
        world += (matrices[:, :3, 3] - point)[:, None]
        of_each = np.concatenate(triangles).reshape(len(numbers), faces, 3)
        corners = world[np.arange(len(numbers))[:, None, None], of_each]
        for number, one in zip(numbers, corners, strict=True):
            found[number] = one
    return found
