# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks for NaN, infinite and extremely large coordinates, before a run writes a file.

Each raises `SceneError`, with the object and what to do. `frame` is the Blender frame, with its
fraction, for the message.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from ...arrays import Indices, Real
from ...errors import SceneError
from ..state import Shape, Snapshot

#: Largest coordinate [Blender units]: its square still fits the float32 that Cycles computes in.
#: Blender stores an infinite coordinate as the largest float32, which is larger.
_MAX_COORDINATE_UNITS = 1e18
#: Points that are checked at once, about.
_TOGETHER = 1 << 18


def check_pose(name: str, matrix_world: Any, frame: float | None = None) -> None:
    """Check that the world matrix (4, 4) of an object is finite and not extremely large."""
    matrix = np.array(matrix_world, dtype=np.float64)
    if _out_of_bounds(matrix).any():
        raise SceneError(
            f"The transform of {name!r} is not finite{_at(frame)}: its location is "
            f"({_coordinates(matrix[:3, 3])}), or its rotation or scale is not finite. radarsim "
            "cannot compute ranges from it. Enter finite numbers in Object > Transform, and check "
            "the keyframes, drivers, constraints and parents of the object."
        )


def check_poses(name: Callable[[int], str], matrices: Real, frame: float) -> None:
    """Check the world matrices (n, 4, 4) of many objects; `name` returns that of one of them."""
    for row in np.unique(np.nonzero(_out_of_bounds(matrices))[0]).tolist():
        check_pose(name(row), matrices[row], frame)


def check_vertices(name: str, vertices: NDArray[Any], frame: float) -> None:
    """Check that the vertices (n, 3) of a surface are finite, in any unit of length."""
    bad = _bad_rows(vertices)
    if bad.size:
        found = f"{bad.size} of its vertices (one is at ({_coordinates(vertices[bad[0]])}))"
        raise SceneError(_mesh_message(name, found + _at(frame), "vertices"))


#: Shapes that Blender has not evaluated since they were found to be finite.
_finite: WeakSet[Shape] = WeakSet()


def check_meshes_finite(snapshot: Snapshot, rows: Indices) -> None:
    """Check that transforms and vertices of rows of a snapshot are finite.

    All vertices are read, once per mesh, because Blender's bounding boxes ignore NaN.
    """
    for row in rows[_out_of_bounds(snapshot.largest[rows])].tolist():
        check_pose(snapshot.label(row), snapshot.matrix(row))
    shapes, first = np.unique(snapshot.layout.shape[rows], return_index=True)
    waiting: list[tuple[Shape, int, NDArray[Any]]] = []
    size = 0
    for number, row in zip(shapes.tolist(), rows[first].tolist(), strict=True):
        shape = snapshot.shapes[number]
        if shape not in _finite:
            mesh = snapshot.mesh(shape) if shape.kind == "MESH" else None
            points = shape.box if mesh is None else mesh.vertices
            waiting.append((shape, row, points))
            size += len(waiting[-1][2])
        if size > _TOGETHER:
            _check_shapes(snapshot, waiting)
            waiting, size = [], 0
    if waiting:
        _check_shapes(snapshot, waiting)


def _check_shapes(snapshot: Snapshot, found: list[tuple[Shape, int, NDArray[Any]]]) -> None:
    """Check shapes, each with a row and its points, at once; only where that fails, one by one."""
    if _out_of_bounds(np.concatenate([numbers for _, _, numbers in found])).any():
        for shape, row, numbers in found:
            _check_shape(shape, numbers, snapshot.label(row))
    _finite.update(shape for shape, _, _ in found)


def _check_shape(shape: Shape, numbers: NDArray[Any], label: str) -> None:
    bad = _bad_rows(numbers)
    if bad.size and shape.kind != "MESH":
        raise SceneError(_mesh_message(label, "its bounding box", "points"))
    if bad.size:
        found = (
            f"{bad.size} of its {len(numbers)} vertices (the first, {bad[0]}, is at "
            f"({_coordinates(numbers[bad[0]])}))"
        )
        raise SceneError(_mesh_message(label, found, "vertices"))


def _out_of_bounds(numbers: NDArray[Any]) -> NDArray[np.bool_]:
    return ~(np.abs(numbers) <= _MAX_COORDINATE_UNITS)  # also true for NaN


def _bad_rows(vertices: NDArray[Any]) -> NDArray[np.intp]:
    return np.flatnonzero(_out_of_bounds(vertices).any(axis=1))


def _coordinates(point: NDArray[Any]) -> str:
    return ", ".join(f"{value:g}" for value in point)


def _at(frame: float | None) -> str:
    return "" if frame is None else f" at frame {frame:.6g}"


def _mesh_message(name: str, found: str, elements: str) -> str:
    return (
        f"The shape of {name!r} has coordinates that are NaN, infinite or beyond "
        f"{_MAX_COORDINATE_UNITS:g} units in {found}. radarsim cannot compute ranges from them. "
        f"Delete those {elements}, check the modifiers and shape keys, or import the object again."
    )
