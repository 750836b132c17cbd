# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks for NaN, infinite and extremely large coordinates, before a run writes a file."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...array_types import Real
from ...errors import SceneError
from ..state import EvaluatedObject, read_numbers

#: Largest coordinate [Blender units]: its square still fits the float32 that Cycles computes in.
#: Blender stores an infinite coordinate as the largest float32, which is larger.
_MAX_COORDINATE_UNITS = 1e18


def check_pose(name: str, matrix_world: Any, frame: float | None = None) -> None:
    """Check that the matrix of an object is finite and within `_MAX_COORDINATE_UNITS`.

    Parameters
    ----------
    name
        Name of the object, for the message.
    matrix_world
        World matrix, shape (4, 4), Blender units.
    frame
        Blender frame, with its fraction, of the matrix, for the message.

    Raises
    ------
    SceneError
        The matrix is not finite or too large.
    """
    matrix = np.array(matrix_world, dtype=np.float64)
    if _out_of_bounds(matrix).any():
        raise SceneError(
            f"The transform of {name!r} is not finite{_at(frame)}: its location is "
            f"({_coordinates(matrix[:3, 3])}), or its rotation or scale is not finite. radarsim "
            "cannot compute ranges from it. Enter finite numbers in Object > Transform, and check "
            "the keyframes, drivers, constraints and parents of the object."
        )


def check_poses(names: Sequence[str], matrices: Real, frame: float) -> None:
    """Check the matrices of many objects at once.

    Parameters
    ----------
    names
        Names of the objects, for the message.
    matrices
        World matrices, shape (objects, 4, 4), Blender units.
    frame
        Blender frame, with its fraction, of the matrices, for the message.

    Raises
    ------
    SceneError
        A matrix is not finite or too large.
    """
    for row in np.unique(np.nonzero(_out_of_bounds(matrices))[0]).tolist():
        check_pose(names[row], matrices[row], frame)


def check_vertices(name: str, vertices: NDArray[Any], frame: float) -> None:
    """Check that the vertices of a surface are finite at a frame of the burst.

    Parameters
    ----------
    name
        Name of the object, for the message.
    vertices
        Shape (n, 3), in any unit of length.
    frame
        Blender frame, with its fraction, for the message.

    Raises
    ------
    SceneError
        A vertex is not finite or too far away.
    """
    bad = _bad_rows(vertices)
    if bad.size:
        found = f"{bad.size} of its vertices (one is at ({_coordinates(vertices[bad[0]])}))"
        raise SceneError(_mesh_message(name, found + _at(frame), "vertices"))


def check_meshes_finite(surfaces: Iterable[EvaluatedObject]) -> None:
    """Check that the transforms and vertices of surfaces are finite; `SceneError` names the first.

    All vertices are read, once per mesh, because Blender's bounding boxes ignore NaN.
    """
    seen: set[int] = set()
    for one in surfaces:
        check_pose(one.label, one.matrix_world)
        data = one.evaluated.data
        if data.as_pointer() in seen:
            continue
        seen.add(data.as_pointer())
        if one.evaluated.type != "MESH":
            if _out_of_bounds(one.box).any():
                raise SceneError(_mesh_message(one.label, "its bounding box", "points"))
            continue
        vertices = read_numbers(data.vertices, "co", 3)
        bad = _bad_rows(vertices)
        if bad.size:
            found = (
                f"{bad.size} of its {len(vertices)} vertices (the first, {bad[0]}, is at "
                f"({_coordinates(vertices[bad[0]])}))"
            )
            raise SceneError(_mesh_message(one.label, found, "vertices"))


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
