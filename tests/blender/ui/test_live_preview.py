# SPDX-License-Identifier: GPL-3.0-or-later
"""Live preview: its numbers against those of a rendered run, its switch, what it leaves behind."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from radarsim_addon import signal
from radarsim_addon.blender.materials import make_physical_material, set_clutter
from radarsim_addon.blender.ui import live_preview, live_scene
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

CARRIER_HZ = 5.3e9


@pytest.fixture
def scene(addon: Any) -> Iterator[Any]:
    """A radar at the origin that looks along +Y; the preview is off afterwards."""
    made = rs.new_scene()
    ph.field_of_view(30)
    rs.radar().width_px = rs.radar().height_px = 64
    yield made
    live_preview.stop_live()


def drafted(drafts: int = 1, timeout_s: float = 60.0) -> dict[str, Any]:
    """Fields and arrays of a draft, the timer's part played by hand."""
    state = bpy.context.window_manager
    state.radarsim_live = True
    preview = live_preview.live_preview()
    assert preview is not None
    wanted = preview.statistics.drafts + drafts
    end_s = time.monotonic() + timeout_s
    while preview.statistics.drafts < wanted:
        assert time.monotonic() < end_s and not preview.fault, preview.fault
        time.sleep(min(preview.tick(bpy.context), 0.02))
    assert preview.draft is not None
    return {**preview.draft.fields, **preview.draft.arrays}


def rendered(folder: Path) -> Any:
    """Expected power of a run of the same scene, with the settings of the tab."""
    radar = rs.radar()
    measured = live_scene.read_measurement(bpy.context.scene)
    changes = {"waveform": measured.waveform, "burst": measured.burst, "max_reflections": 1}
    size = {"width_px": radar.width_px, "height_px": radar.height_px, "range_stop_m": 40.0}
    ph.run_paths(folder, **changes, **size, options={"replicates": 4})
    return signal.expected_power(signal.open_run(folder).frame(1))


def ball(material: Any, smooth: bool = True) -> Any:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, location=(0.5, 12, 0))
    item = bpy.context.object
    if smooth:
        bpy.ops.object.shade_smooth()
    item.data.materials.append(material)
    return item


def rough() -> Any:
    return make_physical_material("Rough", "concrete", carrier_hz=CARRIER_HZ, rms_slope=0.3)


def sea() -> Any:
    material = make_physical_material("Sea", "concrete", carrier_hz=CARRIER_HZ, rms_slope=0.2)
    set_clutter(material, "constant_gamma", gamma_db=-5.0)
    return material


@pytest.mark.parametrize(
    "add",
    [
        lambda: ph.plate_at(12.0, 2.0, ph.lambert(0.5), tilt_deg=20.0),
        lambda: ball(ph.lambert(0.4)),
        lambda: ball(ph.rough_metal()),
        lambda: ball(rough(), smooth=False),
        lambda: ph.plate_at(12.0, 3.0, sea(), tilt_deg=35.0),
    ],
    ids=["Lambert plate", "Lambert sphere", "simple sphere", "physical flat sphere", "clutter"],
)
def test_a_draft_has_the_peak_of_the_rendered_run(
    scene: Any, tmp_path: Path, add: Callable[[], Any]
) -> None:
    add()
    rs.radar().range_stop_m = 40.0
    found = drafted()
    expected = rendered(tmp_path / "run")
    peak = int(np.argmax(expected.profile))
    own = int(np.argmax(found["profile_w"]))
    np.testing.assert_allclose(found["range_m"], expected.range_m)
    off_db = 10 * np.log10(found["profile_w"][own] / expected.profile[peak])
    print("off", off_db, found["peak_error_db"])
    assert abs(off_db) < 1.0
    cell_m = 2 * (expected.range_m[1] - expected.range_m[0])
    assert abs(found["range_m"][own] - expected.range_m[peak]) <= cell_m
