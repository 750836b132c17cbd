# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths and their reverses against random scatterers on two walls, summed one by one."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from radarsim_addon.arrays import Real
from radarsim_addon.contract import ImageRecord, TransmitterRecord
from radarsim_addon.signal import open_run, synthesize
from radarsim_addon.signal.decoding import frame_paths, open_frame
from radarsim_addon.signal.maps import expected_power, range_process
from radarsim_addon.signal.motion import BodyMotion, PathImages
from radarsim_addon.signal.motion.body_motion import AntennaMotion
from radarsim_addon.signal.paths import (
    IMAGE_DTYPE,
    PathFlag,
    PathGeometry,
    PathRows,
    Paths,
    make_paths,
)
from radarsim_addon.signal.radar import Burst, Channel, Element, Radar
from radarsim_addon.signal.scattering import (
    FrameSpeckle,
    antenna_motion,
    reverse_amplitudes,
    reverse_factors,
)
from tests.signal import path_runs as pr
from tests.signal.path_runs import C0_MPS, pose

CARRIER_HZ = 5.3e9
WAVE = 2 * np.pi * CARRIER_HZ / C0_MPS
HERE = np.zeros(3)
#: Level mirror below everything.
FLOOR_M = -1.5
#: Realisations of the speckle.
SEEDS = 250


def walls() -> tuple[Real, Real]:
    """Scatterers of two walls, (12, 3) each."""
    spread = np.random.default_rng(1).uniform(-1, 1, (2, 12, 3)) * (0, 1, 0.8)
    return spread[0] + (-2, 11, 0), spread[1] + (2, 10, 0)


def rows_of(first_m: Real, last_m: Real, flags: int = PathFlag.HAS_REVERSE) -> PathRows:
    """Rows of all paths from scatterers to others."""
    rows = PathRows.zeros(len(first_m) * len(last_m), IMAGE_DTYPE)
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


@pytest.mark.parametrize("resolution_m", [0.3, 1.0, 3.0])
def test_echoes_have_the_power_that_is_expected(resolution_m: float) -> None:
    """Also where the range resolution separates both echoes in part."""
    left, right = walls()
    site = np.array([1.3, -0.2, 0.4])
    rows = rows_of(left, right)
    expected = reverse_factors(rows, record_of(site), CARRIER_HZ, resolution_m)
    antennas = AntennaMotion(
        BodyMotion(np.array(pose((0.0, 0.0, 0.0)))), BodyMotion(np.array(pose(tuple(site))))
    )
    paths, channel = paths_of(rows), Channel(Element(), Element())
    found = reverse_amplitudes(paths, channel, antennas, CARRIER_HZ, resolution_m)
    assert found is not None
    np.testing.assert_allclose(np.abs(found) ** 2, expected, atol=1e-9)
    # by hand: band-limited echoes of both paths, one after the other by d
    longer_m = (legs(right, left, HERE, site).T - legs(left, right, HERE, site)).ravel()
    overlap = np.sinc(longer_m / (2 * resolution_m))
    by_hand = 1 + overlap * np.cos(WAVE * longer_m)
    near = np.abs(longer_m) < 32 * 2 * resolution_m  # beyond, the overlap is cut off
    np.testing.assert_allclose(expected[near], by_hand[near], atol=1e-3)
    assert expected[near].max() - expected[near].min() > 0.3


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


def rows_of_two_walls(apart_m: float) -> tuple[PathRows, Any, Any]:
    """Rows of both directions over two walls, and the antennas."""
    rng = np.random.default_rng(4)
    left = rng.uniform(-1, 1, (8, 3)) * (0, 1, 0.8) + (-2.1, 11, 0.2)
    right = rng.uniform(-1, 1, (8, 3)) * (0, 1, 0.8) + (1.9, 10.3, 0)
    site = np.array([apart_m, 0.1 * apart_m, -0.2 * apart_m])
    every = []
    for number, (first, last) in enumerate(((left, right), (right, left)), start=1):
        rows = PathRows.zeros(first.shape[0] ** 2)
        old = rows_of(first, last)
        for name in ("order", "flags", "first_scatterer_m", "last_scatterer_m"):
            rows[name] = old[name]
        first_m = rows["first_scatterer_m"]
        rows["direction"] = first_m / np.linalg.norm(first_m, axis=1)[:, None]
        rows["length_m"] = legs(first, last, HERE, site).ravel()
        rows["power_w"], rows["solid_angle_sr"] = rng.uniform(1e-6, 3e-6, rows.size), 1e-12
        rows["first_object"], rows["last_object"] = number, 3 - number
        every.append(rows)
    receiver = pr.camera(pr.pose((0, 0, 0)))
    return PathRows.joined(every), receiver, TransmitterRecord(pr.pose(tuple(site)), 1e6)


@pytest.mark.parametrize(("apart_m", "cell_m"), [(0.0, 0.5), (0.02, 1e-3), (0.5, 0.03), (6.0, 0.5)])
def test_expected_power_is_the_mean_of_echoes(
    tmp_path: Path, apart_m: float, cell_m: float
) -> None:
    """Over seeds, and where both paths of a pair are in the table: they interfere once."""
    rows, receiver, transmitter = rows_of_two_walls(apart_m)
    folder = pr.write_run(tmp_path, rows, ["A", "B"], receiver, transmitter, range_limits_m=100)
    frame, radar = open_run(folder).frame(1), Radar(pr.WAVEFORM, Burst(1000.0, 1))
    found = open_frame(frame, radar=radar)
    antennas = antenna_motion(receiver, transmitter)
    expected_w = expected_power(found, range_taper="hamming", cells_per_sample=16).profile.sum()
    powers_w = []
    for seed in range(SEEDS):
        paths = FrameSpeckle(found, seed, cell_m).apply(frame_paths(frame))
        limits_m = (0.0, 60.0)
        echoes = synthesize(
            paths, radar, range_limits_m=limits_m, speckle_seed=seed, antennas=antennas
        )
        profile = range_process(echoes, range_taper="hamming", oversample=16)
        powers_w.append(float(np.sum(np.abs(profile.plane[0]) ** 2)))
    mean_w, error_w = np.mean(powers_w), np.std(powers_w) / math.sqrt(SEEDS)
    assert error_w < 0.1 * expected_w
    # between the grid's samples and the tails beyond the limits 2 %
    assert abs(mean_w - expected_w) < 3.5 * error_w + 0.02 * expected_w
