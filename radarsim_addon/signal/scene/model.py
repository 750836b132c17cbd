# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene that a radar measures at one moment: bodies, their meshes and their surfaces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ...arrays import Indices, Mask, Real
from .mesh import Mesh
from .surface import Surface


class Meshes:
    """Meshes of shapes by their numbers, from 0, read when they are first asked for.

    `read` returns the mesh of a shape, None for none, and `count` the number of its polygons, which
    takes less time. A mesh is kept by whoever has read it. Copies in other processes have all.
    """

    def __init__(
        self, read: Callable[[int], Mesh | None], count: Callable[[int], int], shapes: int
    ) -> None:
        self._read, self._count, self._shapes = read, count, shapes

    @classmethod
    def of(cls, meshes: Sequence[Mesh | None]) -> Meshes:
        """Return meshes that are there."""
        return cls(
            meshes.__getitem__,
            lambda number: 0 if (mesh := meshes[number]) is None else len(mesh.sides),
            len(meshes),
        )

    def __len__(self) -> int:
        return self._shapes

    def __getitem__(self, number: int) -> Mesh | None:
        return self._read(number)

    def face_count(self, number: int) -> int:
        """Return the number of polygons of a shape; 0 without a mesh."""
        return self._count(number)

    def __reduce__(self) -> tuple[Callable[..., Meshes], tuple[list[Mesh | None]]]:
        return Meshes.of, ([self[number] for number in range(len(self))],)


class SceneModel:
    """Objects and their instances at one moment: n bodies, in the order of their objects' numbers.

    Parameters
    ----------
    names
        Of the objects, whose numbers count from 1.
    number
        That of each body's object; 0 for none, (n,).
    pose, box
        From the axes of each body's mesh to the world, (n, 4, 4), and around the mesh in its own
        axes, (n, 2, 3), both [m].
    shape
        Number of each body's mesh and surfaces, from 0, (n,).
    surfaces
        Of the slots of each shape, one after another.
    meshes
        Of the shapes, in their own axes [scene units].
    metres_per_unit
        Metres of a scene unit.
    """

    def __init__(
        self,
        names: Sequence[str],
        number: Indices,
        pose: Real,
        box: Real,
        shape: Indices,
        surfaces: Sequence[Sequence[Surface]],
        meshes: Meshes,
        metres_per_unit: float,
    ) -> None:
        self.names, self.number, self.pose, self.box = names, number, pose, box
        self.shape, self.surfaces, self.meshes = shape, surfaces, meshes
        self.metres_per_unit = metres_per_unit

    def __len__(self) -> int:
        return int(self.number.size)

    def __reduce__(self) -> tuple[type[SceneModel], tuple[object, ...]]:
        names = self.names, self.number, self.pose, self.box, self.shape, self.surfaces
        return SceneModel, (*names, self.meshes, self.metres_per_unit)

    def name(self, number: int) -> str:
        """Return the name of the object of a number."""
        return self.names[number - 1]

    def of_number(self, number: int) -> Indices:
        """Return the indices of the bodies of an object."""
        first, stop = np.searchsorted(self.number, [number, number + 1])
        return np.arange(first, stop)

    def mesh(self, body: int) -> Mesh | None:
        """Return the mesh of a body by its index; None without one."""
        return self.meshes[int(self.shape[body])]

    def of_shapes(self, values: Sequence[object], dtype: DTypeLike = bool) -> NDArray[np.generic]:
        """Return for each body the value that its shape has, (n,)."""
        return np.array(values, dtype=dtype)[self.shape]

    @cached_property
    def is_open(self) -> Mask:
        """Whether waves pass a body, (n,)."""
        opens = [any(s.is_radar and not s.is_opaque for s in every) for every in self.surfaces]
        return np.array(opens, dtype=bool)[self.shape]
