# SPDX-License-Identifier: GPL-3.0-or-later
"""Bistatic paths: what is seen directly, and lit through something that delays by little."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.materials import make_physical_material
from radarsim_addon.signal.paths import PathFlag
from radarsim_addon.signal.radar import Waveform
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.paths.test_paths_walls import slab

pytestmark = pytest.mark.blender

CARRIER_HZ = 77e9
N = 1.6
WAVEFORM = Waveform(CARRIER_HZ, 50e6, 2.5e-6, 60e6)


def film(**keywords: float) -> object:
    return make_physical_material("Film", "index", carrier_hz=CARRIER_HZ, n=N, k=0.0, **keywords)


@pytest.mark.parametrize(
    ("kind", "thickness_m", "range_m"),
    [("wall", 1e-3, 1000.0), ("wall", 2e-5, 30.0), ("pane", 1e-3, 1000.0), ("none", 1e-3, 1000.0)],
)
def test_delay_on_the_way_from_the_transmitter(
    tmp_path: Path, kind: str, thickness_m: float, range_m: float
) -> None:
    """A film close to the transmitter, which the receiver looks past: d (Re q - c) longer."""
    rs.new_scene()
    ph.field_of_view(0.5 * 60 / range_m)
    rs.add_plate(range_m, 1.0)
    emitter = bpy.data.objects["Radar Emitter"]
    emitter.parent = None
    emitter.location = (8.0, 0.0, 0.0)
    if kind != "none":
        pane = {"sheet_thickness_m": thickness_m} if kind == "pane" else {}
        slab(5.0, 0.0 if pane else thickness_m, 0.0, film(**pane))
        item = bpy.data.objects["Wall"]
        item.location.x, item.scale = 8.1, (0.1, 1.0, 0.1)
    rows = ph.run_paths(tmp_path, width_px=8, height_px=8, waveform=WAVEFORM).table()
    rows = rows[rows["last_scatterer_m"][:, 1] > range_m - 1]
    assert rows.size == 64 and np.all(rows["transparent_depth"] == 0)
    point_m = rows["last_scatterer_m"]
    ways_m = np.linalg.norm(point_m - (8.0, 0.0, 0.0), axis=1)
    bare_m = np.linalg.norm(point_m, axis=1) + ways_m
    cosine = point_m[:, 1] / ways_m
    want_m = 0.0 if kind == "none" else thickness_m * (np.sqrt(N**2 - 1 + cosine**2) - cosine)
    off_m = rows["length_m"] - bare_m - want_m
    sigma_m = rows["length_sigma_m"]
    by_encoding = rows["flags"] & PathFlag.ENCODED_LENGTH != 0
    assert np.all(by_encoding) if kind != "none" else not np.any(by_encoding)
    # of the points, too, where they are rendered in float32
    noise_m = np.hypot(sigma_m, 0.0 if kind == "none" else 2e-7 * range_m)
    assert np.sqrt(np.mean((off_m / noise_m) ** 2)) < 2.0
    # all have a part of the error in common: that of the transmitter's float32 place
    assert abs(off_m.mean()) < max(4 * noise_m.mean() / math.sqrt(off_m.size), 1e-9)
    if kind != "none":
        assert np.all(want_m < 20 * sigma_m)  # else the encoding alone would tell
