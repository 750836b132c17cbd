# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of arrays with mirrors, and rows as a render of Lambert surfaces would give them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from radarsim_addon.contract import ReceiverRecord
from radarsim_addon.signal.paths import PathRows
from radarsim_addon.signal.scene import Mesh, Meshes, SceneModel, Surface
from radarsim_addon.signal.tracing import MirrorFaces, MirrorPaths, Obstacles, mirror_faces

WAVELENGTH_M = 0.0566
METAL = Surface(kind="simple", n=1e4, kappa=1e4, specularity=1.0, roughness=0.0)
PANE = Surface(kind="simple", n=1.5, kappa=0.0, specularity=0.0, roughness=0.5)
ROUGH = Surface(kind="simple", n=1e4, kappa=1e4, specularity=0.0, roughness=0.5)


def glass(index: complex) -> Surface:
    """Smooth, and nothing comes out of it again."""
    n, kappa = index.real, index.imag
    return Surface(kind="physical", n=n, kappa=kappa, roughness=0.0, transmissions=(0.0,))


def mesh(
    corners_m: Sequence[Sequence[float]] | np.ndarray,
    faces: Sequence[Sequence[int]] | np.ndarray = ((0, 1, 2), (0, 2, 3)),
    normals: np.ndarray | None = None,
) -> Mesh:
    """A mesh of triangles, flat or with normals at its vertices; one quadrilateral by default."""
    triangles = np.array(faces, dtype=np.int32)
    sides = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2))
    edges = np.unique(sides, axis=0, return_inverse=True)[1].reshape(-1)
    return Mesh(
        np.array(corners_m, dtype=np.float64),
        np.arange(0, triangles.size, 3, dtype=np.int32),
        triangles.reshape(-1),
        edges.astype(np.int32),
        np.zeros(len(triangles), dtype=np.int32),
        None if normals is None else normals[triangles.reshape(-1)],
    )


def box(low: Sequence[float], high: Sequence[float]) -> Mesh:
    """A closed box between two corners, with normals that point out of it."""
    corners = np.array(list(itertools.product(*zip(low, high, strict=True))), dtype=np.float64)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return mesh(corners, [t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])


def sphere(rows: int, columns: int, middle_m: np.ndarray, radius_m: float) -> Mesh:
    """A closed ball that is shaded smooth."""
    polar, around = np.meshgrid(
        np.linspace(0, math.pi, rows + 1)[1:-1], np.arange(columns) * 2 * math.pi / columns,
        indexing="ij",
    )  # fmt: skip
    ring = np.stack(
        [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1
    ).reshape(-1, 3)
    normals = np.concatenate([ring, [[0, 0, 1.0], [0, 0, -1.0]]])
    top = len(ring)
    numbers = []
    for j in range(columns):
        k = (j + 1) % columns
        last = (rows - 2) * columns
        numbers += [(top, j, k), (last + j, top + 1, last + k)]
        for i in range(0, last, columns):
            numbers += [(i + j, i + columns + j, i + k), (i + k, i + columns + j, i + columns + k)]
    return mesh(middle_m + radius_m * normals, numbers, normals)


def obstacles(bodies: dict[str, tuple[Mesh, Surface]], pose: np.ndarray | None = None) -> Obstacles:
    """Bodies by the names of their objects, in the world's axes or at one pose."""
    meshes, surfaces = (list(column) for column in zip(*bodies.values(), strict=True))
    count = len(bodies)
    model = SceneModel(
        list(bodies),
        1 + np.arange(count),
        np.tile(np.eye(4) if pose is None else pose, (count, 1, 1)),
        np.array([[m.vertices.min(axis=0), m.vertices.max(axis=0)] for m in meshes]),
        np.arange(count),
        [(surface,) for surface in surfaces],
        Meshes.of(meshes),
        1.0,
    )
    return Obstacles(model, {})


def faces_of(bodies: dict[str, tuple[Mesh, Surface]]) -> MirrorFaces:
    return mirror_faces(obstacles(bodies))


def panorama(place_m: np.ndarray) -> ReceiverRecord:
    """A receiver that sees all directions."""
    pose = np.eye(4)
    pose[:3, 3] = place_m
    sides = (-math.pi, math.pi, -math.pi / 2, math.pi / 2)
    return ReceiverRecord("equirectangular", pose.tolist(), *sides, 0.0)


def paths_in(
    bodies: dict[str, tuple[Mesh, Surface]],
    receiver: np.ndarray | ReceiverRecord,
    transmitter_m: np.ndarray,
    reflections: int = 3,
    **marks: Any,
) -> MirrorPaths:
    """Paths over the mirrors of bodies whose faces are flat, but for mirrors."""
    own = obstacles(bodies)

    def normals(body: np.ndarray, starts_m: np.ndarray, points_m: np.ndarray) -> np.ndarray:
        found = [own.mesh(n - 1).normals[0] for n in body.tolist()]  # type: ignore[union-attr]
        return np.array(found).reshape(-1, 3)

    return MirrorPaths(
        own,
        normals,
        panorama(receiver) if isinstance(receiver, np.ndarray) else receiver,
        transmitter_m,
        100.0,
        "vertical",
        WAVELENGTH_M,
        reflections,
        8,
        **marks,
    )


def single(
    points_m: np.ndarray, body: np.ndarray, normals: np.ndarray, lamp_m: np.ndarray,
    receiver_m: np.ndarray, solid: np.ndarray,
) -> PathRows:  # fmt: skip
    """Rows of single scatterings at points that a receiver sees, with the light at a place."""
    rows = PathRows.zeros(len(points_m))
    rows["first_scatterer_m"] = rows["last_scatterer_m"] = points_m
    rows["first_body"] = rows["last_body"] = body
    rows["order"] = 1
    towards = lamp_m - points_m
    away_m = np.linalg.norm(towards, axis=1)
    rows["power_w"] = solid * np.abs(np.sum(normals * towards, axis=1)) / away_m**3
    seen = points_m - receiver_m
    rows["length_m"] = away_m + np.linalg.norm(seen, axis=1)
    rows["direction"] = seen / np.linalg.norm(seen, axis=1)[:, None]
    return rows
