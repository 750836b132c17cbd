# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths and their reverses against random scatterers on two walls, summed one by one."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from radarsim_addon.array_types import Real
from radarsim_addon.contract import ImageRecord
from radarsim_addon.signal.motion import BodyMotion, PathImages
from radarsim_addon.signal.motion.antenna_motion import AntennaMotion
from radarsim_addon.signal.paths import (
    IMAGE_DTYPE,
    PathFlag,
    PathGeometry,
    PathRows,
    Paths,
    make_paths,
)
from radarsim_addon.signal.radar import Channel, Element
from radarsim_addon.signal.scattering import reverse_amplitudes, reverse_factors
from tests.signal.path_runs import C0_MPS, pose

CARRIER_HZ = 5.3e9
WAVE = 2 * np.pi * CARRIER_HZ / C0_MPS
HERE = np.zeros(3)
#: Level mirror below everything.
FLOOR_M = -1.5


def walls() -> tuple[Real, Real]:
    """Scatterers of two walls, (12, 3) each."""
    spread = np.random.default_rng(1).uniform(-1, 1, (2, 12, 3)) * (0, 1, 0.8)
    return spread[0] + (-2, 11, 0), spread[1] + (2, 10, 0)


def rows_of(first_m: Real, last_m: Real, flags: int = PathFlag.HAS_REVERSE) -> PathRows:
    """Rows of all paths from scatterers to others."""
    rows = np.zeros(len(first_m) * len(last_m), dtype=IMAGE_DTYPE)
    rows["order"], rows["flags"] = 2, flags
    rows["first_scatterer_m"] = np.repeat(first_m, len(last_m), axis=0)
    rows["last_scatterer_m"] = np.tile(last_m, (len(first_m), 1))
    return rows


def record_of(site_m: Real, kind: str = "perspective", images: tuple[Any, ...] = ()) -> Any:
    """What is read of a sidecar."""
    receiver = SimpleNamespace(kind=kind, matrix_world=pose((0.0, 0.0, 0.0)))
    transmitter = SimpleNamespace(matrix_world=pose(tuple(site_m)))
    return SimpleNamespace(receiver=receiver, transmitter=transmitter, images=list(images))


def legs(first_m: Real, last_m: Real, receiver_m: Real, site_m: Real) -> Real:
    """Lengths of paths over all pairs, (n, n) [m]."""
    ends = np.linalg.norm(first_m - receiver_m, axis=1)[:, None]
    ends = ends + np.linalg.norm(last_m - site_m, axis=1)[None]
    return np.asarray(ends + np.linalg.norm(first_m[:, None] - last_m[None], axis=-1))


def mean_power(there_m: Real, back_m: Real) -> float:
    """Mean power of pairs whose two paths have lengths (n, n) and one random phase, of 1 each."""
    rng, n = np.random.default_rng(2), len(there_m)
    both = np.exp(-1j * WAVE * there_m) + np.exp(-1j * WAVE * back_m)
    one, other = np.exp(2j * np.pi * rng.uniform(size=(2, 40_000, n)))
    return float(np.mean(np.abs(np.einsum("ra,ab,rb->r", one, both, other, optimize=True)) ** 2))


@pytest.mark.parametrize("apart_m", [0.0, 0.004, 0.02, 0.3])
def test_mean_power_is_that_of_random_scatterers(apart_m: float) -> None:
    left, right = walls()
    site = np.array([apart_m, 0.0, 0.0])
    expected = mean_power(legs(left, right, HERE, site), legs(right, left, HERE, site).T)
    record = record_of(site)
    every = [rows_of(left, right), rows_of(right, left)]
    found = sum(reverse_factors(rows, record, CARRIER_HZ, math.inf).sum() for rows in every)
    assert found == pytest.approx(expected, rel=0.03)
    if apart_m == 0:
        np.testing.assert_array_equal(reverse_factors(every[0], record, CARRIER_HZ, 1.0), 2.0)


def test_echoes_that_range_separates_add_by_power() -> None:
    left, right = walls()
    record = record_of((30.0, 0.0, 0.0))
    rows = rows_of(left, right)
    apart = reverse_factors(rows, record, CARRIER_HZ, 1e-3)
    longer = legs(right, left, HERE, np.array([30.0, 0, 0])).T
    longer = (longer - legs(left, right, HERE, np.array([30.0, 0, 0]))).ravel()
    far_apart = np.abs(longer) > 0.1
    assert far_apart.sum() > 100
    np.testing.assert_allclose(apart[far_apart], 1.0, atol=0.01)
    for other, kind in ((rows_of(left, right, 0), "perspective"), (rows, "orthographic")):
        far = record_of((0.0, 0.0, 0.0), kind)
        np.testing.assert_array_equal(reverse_factors(other, far, CARRIER_HZ, 1.0), 1.0)


def paths_of(rows: PathRows, images: PathImages | None = None) -> Paths:
    """Rows as paths."""
    first_m, zeros = rows["first_scatterer_m"], np.zeros(rows.size, dtype=np.int32)
    direction = first_m / np.linalg.norm(first_m, axis=1)[:, None]
    ends = first_m, rows["last_scatterer_m"], direction
    geometry = PathGeometry(zeros + 2, zeros, *ends, zeros, zeros, images)
    paths = make_paths(np.ones(rows.size), 20.0)
    return dataclasses.replace(paths, flags=rows["flags"].copy(), geometry=geometry)


@pytest.mark.parametrize("kind", ["element", "images"])
def test_amplitudes_are_those_of_both_paths(kind: str) -> None:
    left, right = walls()
    rows, images = rows_of(left, right), None
    element_m, site = np.array([0.03, 0.0, 0.0]), np.array([0.0, 0.01, 0.2])
    antennas = AntennaMotion(
        BodyMotion(np.array(pose((0.0, 0.0, 0.0)))), BodyMotion(np.array(pose(tuple(site))))
    )
    channel = Channel(Element(), Element(tuple(element_m)))
    # an antenna's axes: x right, y up, z back
    receiver = np.array([element_m[0], -element_m[2], element_m[1]])
    there = legs(left, right, receiver, site)
    back = legs(right, left, receiver, site).T
    if kind == "images":
        up = [0.0, 0.0, 1.0]
        record = ImageRecord(objects=["Floor"], normals=[up], offsets_m=[FLOOR_M], bodies=[1])
        numbers = np.tile(np.array([[0, 1]], dtype=np.int32), (rows.size, 1))
        images = PathImages.of([record], numbers)
        mirrored = [one * (1, 1, -1) + (0, 0, 2 * FLOOR_M) for one in (receiver, site)]
        there = legs(left, right, receiver, mirrored[1])
        back = legs(right, left, mirrored[0], site).T
    paths = paths_of(rows, images)
    found = reverse_amplitudes(paths, channel, antennas, CARRIER_HZ, 1e6)
    assert found is not None
    expected = (1 + np.exp(-1j * WAVE * (back - there))) / np.sqrt(2)
    np.testing.assert_allclose(found, expected.ravel(), atol=1e-6)
    paths.flags[:] = 0
    assert reverse_amplitudes(paths, channel, antennas, CARRIER_HZ, 1e6) is None
