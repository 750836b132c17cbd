# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies of a scene: what they share, and what another process gets."""

from __future__ import annotations

import pickle

import numpy as np

from radarsim_addon.signal.scene import Mesh, Meshes, SceneModel, Surface


def triangle(size: float) -> Mesh:
    corners = np.arange(3, dtype=np.int32)
    none = np.zeros(1, dtype=np.int32)
    return Mesh(size * np.eye(3), none, corners, corners, none)


def model(read: list[int]) -> SceneModel:
    """Three bodies of two objects; the first shape is not a mesh. Notes which meshes are read."""
    made = [None, triangle(2.0)]

    def mesh(number: int) -> Mesh | None:
        read.append(number)
        return made[number]

    meshes = Meshes(mesh, lambda number: [0, 1][number], 2)
    surfaces = [(), (Surface(kind="simple", transmissions=(0.5,)), Surface())]
    return SceneModel(
        ["Lamp", "Plate"],
        np.array([1, 2, 2]),
        np.tile(np.eye(4), (3, 1, 1)),
        np.zeros((3, 2, 3)),
        np.array([0, 1, 1]),
        surfaces,
        meshes,
        0.5,
    )


def test_bodies_have_the_mesh_and_surfaces_of_their_shape() -> None:
    read: list[int] = []
    scene = model(read)
    assert len(scene) == 3
    assert scene.of_number(2).tolist() == [1, 2]
    assert scene.name(2) == "Plate"
    assert scene.mesh(0) is None
    assert scene.mesh(1) is scene.mesh(2)
    assert scene.meshes.face_count(1) == 1
    assert scene.of_shapes([len(every) for every in scene.surfaces], int).tolist() == [0, 2, 2]


def test_a_copy_has_all_meshes() -> None:
    """Which are read before the model leaves the process."""
    read: list[int] = []
    scene = model(read)
    copied = pickle.loads(pickle.dumps(scene))
    assert read == [0, 1]
    assert copied.mesh(0) is None
    np.testing.assert_array_equal(copied.mesh(2).vertices, 2.0 * np.eye(3))
    assert copied.meshes.face_count(1) == 1
    assert copied.metres_per_unit == 0.5
    assert str(copied.surfaces) == str(scene.surfaces)
    np.testing.assert_array_equal(copied.is_open, scene.is_open)
    assert read == [0, 1]
