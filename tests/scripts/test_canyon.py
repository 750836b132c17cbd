# SPDX-License-Identifier: GPL-3.0-or-later
"""The street canyon: its profile in closed form, and a measurement of it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon.physics.fresnel import unpolarised_reflectance
from scripts.benchmarks.canyon_profile import first_order_profile

GROUND = complex(3.5721, 0.2519)
WALL = complex(2.2926, 0.1259)


def test_ground_alone() -> None:
    """A plane below the radar: dOmega = 2 pi h / R^2 dR, by an integral over range."""
    edges = np.arange(0.0, 31.0)
    found = first_order_profile([], (40.0, 40.0), 2.0, (WALL, GROUND), edges)
    for low, high, power in zip(edges, edges[1:], found):
        fine = np.linspace(max(low, 2.0), max(high, 2.0), 20001)
        middle, step = (fine[1:] + fine[:-1]) / 2, np.diff(fine)
        cosine = 2.0 / middle
        density = unpolarised_reflectance(GROUND, cosine) * cosine / middle**2
        expected = np.sum(density * 2 * math.pi * 2.0 / middle**2 * step) / (4 * math.pi**2)
        assert power == pytest.approx(expected, rel=1e-6)


def test_a_wall_hides_what_is_behind_and_lower() -> None:
    near = ((10.0, -50.0, -1.0), (11.0, 50.0, 8.0))
    low = ((20.0, -50.0, -1.0), (21.0, 50.0, 13.0))  # its top is seen lower than the near one's
    high = ((20.0, -50.0, -1.0), (21.0, 50.0, 20.0))
    edges = np.arange(0.0, 60.0)
    alone, hidden, seen = (
        first_order_profile(boxes, (40.0, 60.0), 2.0, (WALL, GROUND), edges)
        for boxes in ([near], [near, low], [low, high, near])
    )
    np.testing.assert_allclose(hidden, alone, rtol=2e-3)
    # straight ahead the far wall begins where the line over the near one meets it: 23.3 m
    np.testing.assert_allclose(seen[:23], alone[:23], rtol=2e-3)
    assert seen[23] > 1.1 * alone[23]


@pytest.mark.slow
def test_measured(bpy: Any, tmp_path: Path) -> None:
    """The scene, measured coarsely, against the integral: in all, and in bins of 1 m."""
    from radarsim_addon import blender as radarsim
    from radarsim_addon.contract import PATHS_FILE, PathsRecord, frame_dir
    from radarsim_addon.signal.paths.table import open_table
    from radarsim_addon.typed_json import read_record
    from scripts import make_canyon
    from scripts.benchmarks.canyon_accuracy import binned, errors_db, exact_w

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    radar = make_canyon.build()
    run = radarsim.measure(radar, tmp_path / "run", width_px=566, height_px=283)
    frame = run.path / frame_dir(1)
    record = read_record(frame / PATHS_FILE, PathsRecord)
    measured = binned(open_table(frame / record.table_file), record)
    expected = exact_w(record, run.radar.waveform.wavelength_m)
    assert measured.sum() == pytest.approx(expected.sum(), rel=2e-4)
    assert np.sqrt(np.mean(errors_db(measured, expected) ** 2)) < 0.3
