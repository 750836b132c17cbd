# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames at which other objects render, or another camera is active, than when a run begins."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from radarsim_addon.signal.radar import Burst
from tests.blender import motion_helpers as mh
from tests.blender import path_helpers as ph

BURST = Burst(20_000.0, 64)


def measured(folder: Path, frames: tuple[int, ...]) -> ph.PathRun:
    return ph.run_paths(
        folder, waveform=mh.waveform(77e9), burst=BURST, frames=frames, width_px=8, height_px=8
    )


def hide(item: Any, state: str) -> None:
    """Hide an object in the viewport, or from renders until frame 9."""
    if state == "eye":
        item.hide_set(True)
    elif state == "viewport":
        item.hide_viewport = True
    elif state == "animated":
        for frame, hidden in ((1, True), (9, False)):
            item.hide_render = hidden
            item.keyframe_insert("hide_render", frame=frame)
        bpy.context.scene.frame_set(1)


@pytest.mark.parametrize("state", ["visible", "eye", "viewport", "animated"])
def test_what_the_viewport_does_not_show_yet_has_its_material(tmp_path: Path, state: str) -> None:
    """The same echo and the same cautions, whether the user sees it when the run begins."""
    mh.scene_at(20.0, 2.0)
    plate = mh.facets("Plate", [(0, 20, 0)], 1.2)
    hide(plate, state)
    run = measured(tmp_path / "run", (9,))
    rows = run.table(9)
    assert rows.size > 20
    power = ph.radiance(rows, 77e9) * math.pi / ph.irradiance(rows["length_m"] / 2)
    assert np.median(power / rows["direction"][:, 1]) == pytest.approx(0.5, rel=0.01)
    optical = [f.subjects for f in run.job.findings if f.code == "optical-material"]
    assert optical == [("Plate",)]
    assert plate.hide_render == (state == "animated")
    assert plate.hide_viewport == (state == "viewport")
    assert plate.hide_get() == (state == "eye")


def test_cameras_of_markers_do_not_take_the_place_of_the_receiver(tmp_path: Path) -> None:
    """Blender would render with the other camera from frame 5 on, 40 m further away."""
    mh.scene_at(20.0, 2.0)
    scene = bpy.context.scene
    mh.facets("Plate", [(0, 20, 0)], 1.2)
    own = scene.camera
    other = bpy.data.objects.new("Other", bpy.data.cameras.new("Other"))
    other.location, other.rotation_euler = (0, -40, 0), (math.pi / 2, 0, 0)
    scene.collection.objects.link(other)
    for frame, camera in ((1, own), (5, other)):
        scene.timeline_markers.new(camera.name, frame=frame).camera = camera
    scene.frame_set(1)
    run = measured(tmp_path / "run", (1, 9))
    for frame in (1, 9):
        rows = run.table(frame)
        assert rows.size > 20
        np.testing.assert_allclose(
            rows["length_m"], 2 * np.linalg.norm(rows["last_scatterer_m"], axis=1), rtol=1e-12
        )
    found = [f for f in run.job.findings if f.code == "camera-markers"]
    assert [f.subjects for f in found] == [("Other",)]
    assert [marker.camera for marker in scene.timeline_markers] == [own, other]
    assert scene.camera == own


def test_a_radar_that_passes_the_origin_is_sampled_as_elsewhere(tmp_path: Path) -> None:
    """Float32 is exact at the origin itself, but not before and after it."""
    mh.scene_at(20.0, 2.0)
    mh.facets("Plate", [(0, 20, 0)], 1.2)
    radar = bpy.data.objects["Radar"]
    mh.key(radar, "location", (-59, (0, -18.0, 0)), (61, (0, 18.0, 0)))
    mh.interpolation(radar, "LINEAR")
    rows, _, run = mh.measured(tmp_path / "run", 77e9, BURST, 1, width_px=8, height_px=8)
    rate = rows["range_rate_mps"] / rows["direction"][:, 1]
    assert np.abs(rate + 7.2).max() < 1e-4
    codes = [f.code for f in run.job.findings]
    assert "motion-unresolved" not in codes and "motion-sampling-slow" not in codes
