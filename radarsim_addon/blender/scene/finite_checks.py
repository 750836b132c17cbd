# SPDX-License-Identifier: GPL-3.0-or-later
"""Places that are no places: NaN, infinite or absurdly far, found before anything is written."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import SceneError

#: Largest coordinate [Blender units]: its square still fits the float32 that Cycles computes in.
#: Blender takes an infinite coordinate as the largest float32, which is beyond it.
FARTHEST_UNITS = 1e18


def usable(numbers: NDArray[Any]) -> bool:
    """Whether all numbers are finite, and not so large that their squares overflow."""
    return bool((np.abs(numbers) <= FARTHEST_UNITS).all())


def check_pose(name: str, matrix_world: Any, frame: float | None = None) -> None:
    """Refuse an object whose matrix is NaN, infinite or beyond `FARTHEST_UNITS`.

    Parameters
    ----------
    name
        Of the object.
    matrix_world
        4x4.
    frame
        Blender frame, with its fraction, at which the matrix was taken, for the message.

    Raises
    ------
    SceneError
        Its name, the location that was found, and where such values come from.
    """
    matrix = np.array(matrix_world, dtype=np.float64)
    if not usable(matrix):
        place = ", ".join(f"{value:g}" for value in matrix[:3, 3])
        raise SceneError(
            f"The place of {name!r} is not a number or has no end{_at(frame)}: its location is "
            f"({place}), or its rotation or scale is such. Expected finite numbers. Type them "
            "anew in Object > Transform, and look at its key frames, drivers, constraints and "
            "parents."
        )


def check_vertices(name: str, places: NDArray[Any], frame: float) -> None:
    """Refuse vertices (n, 3) of a surface that are no usable numbers at a frame of the burst.

    Raises
    ------
    SceneError
        Name, frame, how many, and where the first of them is.
    """
    if usable(places):
        return
    bad = np.flatnonzero(~(np.abs(places) <= FARTHEST_UNITS).all(axis=1))
    where = ", ".join(f"{value:g}" for value in places[bad[0]])
    found = f"{bad.size} of its vertices (one is at ({where})){_at(frame)}"
    raise SceneError(_vertex_text(name, found, "vertices"))


def _at(frame: float | None) -> str:
    return "" if frame is None else f" at frame {frame:.6g}"


def check_meshes_finite(surfaces: Iterable[tuple[str, Any, Any]]) -> None:
    """Refuse surfaces with a place or a vertex that is not a usable number.

    Vertices are read one and all, as Blender leaves NaN out of bounding boxes; the mesh of many
    instances is read once.

    Parameters
    ----------
    surfaces
        Name, evaluated object and world matrix of each object or instance.

    Raises
    ------
    SceneError
        The first that is found, by name.
    """
    seen: set[int] = set()
    for name, evaluated, matrix in surfaces:
        check_pose(name, matrix)
        key = evaluated.data.as_pointer()
        if key in seen:
            continue
        seen.add(key)
        if evaluated.type != "MESH":
            if not usable(np.array([tuple(corner) for corner in evaluated.bound_box])):
                raise SceneError(_vertex_text(name, "its bounding box", "points"))
            continue
        vertices = evaluated.data.vertices
        places = np.empty(len(vertices) * 3, dtype=np.float32)
        vertices.foreach_get("co", places)
        if usable(places):
            continue
        rows = places.reshape(-1, 3)
        bad = np.flatnonzero(~(np.abs(rows) <= FARTHEST_UNITS).all(axis=1))
        where = ", ".join(f"{value:g}" for value in rows[bad[0]])
        which = f"{bad.size} of its {len(vertices)} vertices (the first, {bad[0]}, is at ({where}))"
        raise SceneError(_vertex_text(name, which, "vertices"))


def _vertex_text(name: str, found: str, what: str) -> str:
    return (
        f"The shape of {name!r} is broken: NaN, infinite or beyond {FARTHEST_UNITS:g} units in "
        f"{found}. Expected finite coordinates. Delete those {what}, or look at its modifiers and "
        "shape keys, or import it anew."
    )
