# SPDX-License-Identifier: GPL-3.0-or-later
"""The EIRP that a run records is the one that Cycles sends: power and exposure of the light."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon import contract
from radarsim_addon.typed_json import read_record
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


@pytest.mark.parametrize(("power_w", "stops"), [(10.0, 0.0), (10.0, 1.5), (3.0, -4.0)])
def test_exposure_is_part_of_the_eirp(tmp_path: Path, power_w: float, stops: float) -> None:
    """A Lambert plate shows rho / pi * EIRP / (4 pi R^2) * cos: a stop doubles both."""
    rs.new_scene()
    ph.field_of_view(10)
    ph.plate_at(10, 30, ph.lambert(0.5))
    light = bpy.data.objects["Radar Emitter"].data
    if not hasattr(light, "exposure"):
        pytest.skip("lights have no exposure in this Blender")
    light.energy, light.exposure = power_w, stops
    run = ph.run_paths(tmp_path, width_px=8, height_px=8)
    rows = run.table()
    cosine = rows["direction"][:, 1]
    seen_w = ph.radiance(rows) * np.pi / 0.5 / cosine * 4 * np.pi * (10 / cosine) ** 2
    folder = tmp_path / contract.frame_dir(1)
    frame = read_record(folder / contract.PATHS_FILE, contract.PathsRecord)
    assert frame.transmitter.eirp_w == pytest.approx(power_w * 2.0**stops, rel=1e-6)
    np.testing.assert_allclose(seen_w, frame.transmitter.eirp_w, rtol=1e-5)
