# SPDX-License-Identifier: GPL-3.0-or-later
"""Kilometres of path: the code does not underflow, and what it says of lengths and phase."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.signal import PathFlag

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import nodes
from radarsim_addon.blender.paths import view_tracer
from radarsim_addon.signal.radar import Waveform
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender

HALF_M, END_M = 400.0, 5000.0
PHASE = "phase-unreliable"


def corridor() -> None:
    """Two mirror walls 800 m apart and a rough end at 5 km."""
    rs.new_scene()
    ph.field_of_view(34)
    bpy.context.scene.camera.data.clip_end = 1e6
    walls = ph.mirror()
    for side in (-HALF_M, HALF_M):
        low, high = -3000, 3000
        corners = [(side, -1, low), (side, END_M, low), (side, END_M, high), (side, -1, high)]
        ph.quad("Wall", corners, walls)
    corners = [(x, END_M, z) for x, z in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    ph.quad("End", [(HALF_M * x, y, 3000 * z) for x, y, z in corners], ph.rough_metal())


@pytest.mark.parametrize("code", ["materials", "world"])
def test_kilometres_do_not_underflow(tmp_path: Path, code: str) -> None:
    """Orders 1 to 3 over 10 to 12 km of path: all coded, lengths those of the mirror images."""

    corridor()
    kept, original = [], view_tracer.rows_of_replicate
    view_tracer.rows_of_replicate = lambda traced, *rest: (
        kept.append(traced) or original(traced, *rest)
    )
    try:
        options = {"max_reflections": 3, "range_encoding": code, "mirror_images": 0}
        run = ph.run_paths(tmp_path, width_px=32, height_px=32, options=options)
    finally:
        view_tracer.rows_of_replicate = original
    rows, record = run.table(), run.record()
    direction = rows["direction"]
    unfolded = direction * (END_M / direction[:, 1:2])
    images = np.rint(unfolded[:, 0] / (2 * HALF_M))
    np.testing.assert_array_equal(rows["order"], 1 + np.abs(images))
    assert {1, 2, 3} == set(rows["order"])
    assert rows.size > 500
    # Every path has its code: R, and the G that carries it, are normal numbers of float32.
    assert not np.any(rows["flags"] & PathFlag.NO_RANGE)
    assert record.unranged_power_fraction == 0.0
    (traced,) = kept
    for layer in traced.layers:
        lit = layer.amplitude > 0
        assert lit.any()
        values = layer.encoded.channels()[:, lit]
        assert np.all(np.isfinite(values))
        assert values.min() > np.finfo(np.float32).tiny
    # R = exp(-length / k): even over the longest path allowed for it stays above exp(-8).
    longest_m = float(rows["length_m"].max())
    assert longest_m > 10_000
    assert math.isfinite(record.range_encoding_length_m)
    assert record.range_encoding_length_m == run.job.plan.range_encoding_length_m
    assert longest_m < 8 * record.range_encoding_length_m
    x = unfolded[:, 0] - 2 * HALF_M * images
    scatterer = np.stack([np.where(images % 2, -x, x), unfolded[:, 1], unfolded[:, 2]], axis=1)
    length = np.linalg.norm(unfolded, axis=1) + np.linalg.norm(scatterer, axis=1)
    one = rows["order"] == 1
    np.testing.assert_allclose(rows["length_m"][one], length[one], rtol=1e-6)
    # What is coded alone is as exact as the row says of itself.
    far = np.abs(rows["length_m"] - length)[~one] / rows["length_sigma_m"][~one]
    assert np.sqrt(np.mean(far**2)) < 2
    assert far.max() < 6


def behind_glass() -> None:
    """Metal at 4 km behind 0.5 m of n = 2: the delay makes all its lengths coded ones."""
    from tests.blender.render_helpers import add_box

    rs.new_scene()
    ph.field_of_view(2)
    add_box(
        (-300, 2000, -300), (300, 2000.5, 300), nodes.make_material("Glass", 2.0, 0.0, 0.0, 0.5)
    )
    ph.plate_at(4000, 1000, ph.rough_metal())


@pytest.mark.parametrize("carrier_hz", [1e9, 77e9])
def test_phase_of_coded_lengths(tmp_path: Path, carrier_hz: float) -> None:
    """The same lengths: fine for a wave of 30 cm, said to be too coarse for one of 4 mm."""
    behind_glass()
    waveform = Waveform(carrier_hz, 50e6, 2.5e-6, 60e6)
    run = ph.run_paths(tmp_path, width_px=8, height_px=8, waveform=waveform)
    rows, record = run.table(), run.record()
    plate = rows[rows["transparent_depth"] == 2]
    assert plate.size == 64
    assert np.all(plate["flags"] == PathFlag.ENCODED_LENGTH)
    error_m = np.abs(plate["length_m"] - 2 * (4000 + 0.5) / plate["direction"][:, 1])
    # What the finding goes by is no guess: the lengths are off by about as much.
    assert error_m.max() < 6 * plate["length_sigma_m"].max()
    wavelength_m = ph.C0_MPS / carrier_hz
    assert record.length_sigma_wavelengths == pytest.approx(record.length_sigma_m / wavelength_m)
    found = [item for item in record.findings if item.code == PHASE]
    assert len(found) == (1 if carrier_hz == 77e9 else 0)
    if found:
        assert found[0].numbers["length_sigma_m"] == record.length_sigma_m


def test_phase_of_lengths_from_vertices(tmp_path: Path) -> None:
    """At 1 km and 77 GHz, but seen directly: exact, and no word of phase."""
    rs.new_scene()
    ph.radar_at((0, -1000, 0))
    ph.field_of_view(2)
    ph.plate_at(0, 300, ph.rough_metal())
    waveform = Waveform(77e9, 50e6, 2.5e-6, 60e6)
    run = ph.run_paths(tmp_path, width_px=8, height_px=8, waveform=waveform)
    assert run.table().size == 64
    assert PHASE not in [item.code for item in run.record().findings]
