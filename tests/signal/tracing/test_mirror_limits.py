# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits of mirrors and of paths over them are crossed: just below and just above."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import pytest

from radarsim_addon.physics.mirrors import Reflected
from radarsim_addon.signal.paths import IMAGE_DTYPE, PathRows
from radarsim_addon.signal.scene import Mesh
from radarsim_addon.signal.tracing import CurvedMirrors, ImageChain
from radarsim_addon.signal.tracing.connections import find_curved_mirrors
from radarsim_addon.signal.tracing.mirror_paths import MirrorPolarisation
from radarsim_addon.signal.tracing.mirrors import Plane, find_planes
from radarsim_addon.signal.tracing.specular_points import SmoothPatches, SpecularPoints
from tests.signal.tracing.mirror_scenes import METAL, ROUGH, faces_of, mesh, paths_in

ORIGIN = np.zeros(3)


def polarisation(turned: float, apart: float = 0.0) -> list[str]:
    found = MirrorPolarisation()
    columns = (np.array([one]) for one in (1.0, 0.0, turned, apart))
    found.add(("Mirror",), np.ones(1), Reflected(*columns))
    return [item.code for item in found.findings(both_ways=True)]


def floor(size_m: float, at_m: np.ndarray) -> Plane:
    """A triangle in the plane z = 0, as an antenna at a place sees it."""
    corners_m = size_m * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    faces = faces_of({"Floor": (mesh(corners_m, [(0, 1, 2)]), METAL)})
    ((plane,),), _ = find_planes(faces, [at_m], 1.0, 1)
    return plane


def is_above(height: float) -> bool:
    """A point 1 km from an image 1 m below the plane."""
    antenna_m = np.array([1.0, 1.0, 1.0])
    chain = ImageChain.of([floor(5e3, antenna_m)], antenna_m)
    return bool(chain.ways(np.array([[1001.0, 1.0, 1e3 * height]])).place.size)


def is_outside(off: float) -> bool:
    antenna_m = np.array([-off, 0.3, 1.0])
    chain = ImageChain.of([floor(1.0, antenna_m)], antenna_m)
    return not chain.ways(antenna_m[None]).place.size


def is_another_plane(wavelengths: float) -> bool:
    corners_m = [(0, 0, 0), (9, 0, 0), (9, 9, 0), (0, 9, 0)]
    near = {"Low": (mesh(corners_m), METAL)}
    near["High"] = mesh(np.add(corners_m, [9, 0, wavelengths])), METAL
    return len(find_planes(faces_of(near), [np.full(3, 5.0)], 1.0, 9)[0][0]) == 2


def bent(radius: float, *, sphere: bool = False) -> Mesh:
    """A small triangle on a cylinder, or a sphere, of so many wavelengths."""
    angle, z = np.array([0.0, 0.02, 0.01]), np.array([0.0, 0.0, 0.02])
    normals = np.column_stack([np.cos(angle), np.sin(angle), z if sphere else 0 * z])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    corners_m = radius * normals
    if not sphere:
        corners_m[:, 2] = z
    return mesh(corners_m, [(0, 1, 2)], normals)


def is_bent_little(radius: float, *, sphere: bool = False) -> bool:
    faces = faces_of({"Ball": (bent(radius, sphere=sphere), METAL)})
    return find_curved_mirrors(faces, ORIGIN, 1.0)[0] is not None


def is_rounded(wavelengths: float) -> bool:
    own: Any = SimpleNamespace(
        _lift_m=np.array([wavelengths]),
        own=np.zeros(1, int),
        _faces=SimpleNamespace(objects=lambda own: ("Ball",) * own.size),
    )
    return bool(CurvedMirrors.rounded(own, 1.0))


def is_wide(width: float) -> bool:
    """A bowl 1 m from both ends narrows the beam to this width over that behind a plane."""
    curvature = (width - 1) * np.eye(2)[None]
    patches = mock.Mock(spec=SmoothPatches)
    patches.select.return_value = patches
    patches.curvature.return_value = curvature
    point = np.array([[0.0, 0.0, -1.0]])
    none = np.zeros(1, int)
    found = SpecularPoints(none, none, np.full((1, 3), 1 / 3), point, -point)
    own: Any = SimpleNamespace(
        _search=SimpleNamespace(find=lambda _: found),
        _antenna_m=ORIGIN,
        _patches=patches,
        _faces=SimpleNamespace(body=np.ones(1, int)),
        own=none,
        _lift_m=np.zeros(1),
        _size_m=np.zeros(1),
        focusing=set(),
    )
    ways = CurvedMirrors.ways(own, np.zeros((1, 3)))
    assert bool(ways.place.size) != bool(own.focusing)
    return bool(ways.place.size)


def has_path(power: float) -> bool:
    """A path over a mirror whose power is this over that of the direct path."""
    plate = mesh([(-1, 9, -1), (1, 9, -1), (1, 9, 1), (-1, 9, 1)])
    ground = mesh([(-9, -9, -1), (9, -9, -1), (9, 20, -1), (-9, 20, -1)])
    paths = paths_in({"Floor": (ground, METAL), "Plate": (plate, ROUGH)}, ORIGIN, ORIGIN)
    rows = PathRows.zeros(1, IMAGE_DTYPE)
    rows["last_body"], rows["last_scatterer_m"] = 2, [[0, 9, 0]]
    one, found = np.ones(1), paths.images[0].ways(rows["last_scatterer_m"])
    straight = (math.hypot(9, 2) / 9) ** 3  # cosine and spreading
    waves = Reflected(power * straight * one, 0 * one, 0 * one, 0 * one)
    with mock.patch.object(type(found), "reflected", return_value=waves):
        return bool(paths._over(paths.images[0], rows, "transmitter", 1, ORIGIN)[0].size)


def are_apart(fraction: float) -> bool:
    """Antennas this far from one another, over the reach of paths: are both imaged?"""
    plate = mesh([(-1, 9, -1), (1, 9, -1), (1, 9, 1), (-1, 9, 1)])
    place_m = np.array([100 * fraction, 0.0, 0.0])
    return not paths_in({"Plate": (plate, ROUGH)}, ORIGIN, place_m)._one_place


def has_more_planes(count: float) -> bool:
    """As many mirrors above one another, of which one gets an image: is one not looked for?"""
    many = int(count)
    bodies = {
        f"Mirror {n}": (mesh([(0, 0, n), (1, 0, n), (0, 1, n)], [(0, 1, 2)]), METAL)
        for n in range(many)
    }
    (said,) = find_planes(faces_of(bodies), [np.array([0.0, 0.0, 99.0])], 1.0, 1)[1]
    assert said.numbers["count"] == many - 1
    return len(said.subjects) < many - 1


def is_another_way(off: float, turned: float) -> bool:
    """A row whose length and direction are off those over the mirror 1 m below, as fractions."""
    ground = mesh([(-9, -1, -9), (-9, -1, 9), (9, -1, 9), (9, -1, -9)])
    target = mesh([(-2, -0.5, -8), (2, -0.5, -8), (2, 2, -8), (-2, 2, -8)])
    paths = paths_in({"Mirror": (ground, METAL), "Target": (target, ROUGH)}, ORIGIN, ORIGIN)
    rows = PathRows.zeros(1, IMAGE_DTYPE)
    rows["order"], rows["last_body"] = 2, 2
    rows["last_scatterer_m"] = [[0, 1, -8]]
    way = np.array([0.0, -3.0, -8.0])  # the image of the scatterer is 3 m below
    length_m = np.linalg.norm(way) + np.linalg.norm([0, 1, 8])
    # the distance from the ray is a fraction of the whole length
    away = np.array([turned * length_m / np.linalg.norm(way), 0.0, 0.0])
    rows["direction"] = way / np.linalg.norm(way) + away
    rows["length_m"] = length_m * (1 + off)
    return not paths._seen_directly(rows)[0]


@pytest.mark.parametrize(
    ("crossed", "below", "above"),
    [
        pytest.param(lambda t: bool(polarisation(t)), 0.05, 0.07, id="turned-0.5-dB"),
        # 1 + 2 sqrt(apart) is 0.5 dB at 8.8e-4
        pytest.param(lambda a: bool(polarisation(0, a)), 7e-4, 1.1e-3, id="apart-0.5-dB"),
        pytest.param(is_above, 0.5e-6, 2e-6, id="least-height"),
        pytest.param(is_outside, 0.0, 3e-6, id="edge-of-triangle"),
        pytest.param(is_another_plane, 0.015, 0.03, id="flat"),
        pytest.param(is_rounded, 0.015, 0.03, id="rounded"),
        pytest.param(is_bent_little, 1.5, 1.7, id="radius-of-curvature"),
        pytest.param(partial(is_bent_little, sphere=True), 1.5, 1.7, id="radius-of-a-sphere"),
        pytest.param(is_wide, 0.45, 0.55, id="focus"),
        pytest.param(has_path, 0.7e-6, 1.4e-6, id="faint-mirror-path"),
        pytest.param(are_apart, 0.009, 0.011, id="one-place"),
        pytest.param(has_more_planes, 64, 65, id="planes"),
        pytest.param(lambda x: is_another_way(x, 0.0), 1.7e-5, 2.3e-5, id="mirrored-length"),
        pytest.param(lambda x: is_another_way(0.0, x), 1.7e-5, 2.3e-5, id="mirrored-direction"),
    ],
)
def test_limit_is_crossed(crossed: Callable[[float], bool], below: float, above: float) -> None:
    assert not crossed(below)
    assert crossed(above)
