# SPDX-License-Identifier: GPL-3.0-or-later
"""Metres in a Blender unit: the smallest and largest that Blender takes, and none at all."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import addon
from radarsim_addon.blender import rig_settings as properties
from radarsim_addon.blender.headless import make_job
from radarsim_addon.blender.ui.scene_panel import RADARSIM_PT_scene
from radarsim_addon.errors import ConfigError
from radarsim_addon.signal import iter_path_chunks, open_run
from tests.blender import radar_scenes as rs
from tests.blender import recording


@pytest.fixture
def settings() -> Iterator[Any]:
    """A plate at 10 units, small and quick; the scene's radar settings."""
    rs.new_scene()
    properties.register()
    rs.add_plate(10.0, 8.0)
    found = rs.radar()
    found.width_px = found.height_px = 8
    found.samples, found.snapshots, found.motion, found.replicates = 1, "1", "off", 1
    yield found
    properties.unregister()


def lengths_units(folder: Path, settings: Any, kind: str, scale: float) -> np.ndarray:
    """Lengths of all paths of a run with this scale, in Blender units."""
    scene = bpy.context.scene
    scene.unit_settings.scale_length = scale
    # as Blender keeps it: 0 becomes the least that it takes
    kept = scene.unit_settings.scale_length
    settings.ring_step_m = 4 * kept
    with make_job(scene, bpy.context.view_layer, folder, given={"sampling_mode": kind}) as job:
        for task in job.pending():
            job.start(task)
            job.render(task)
            job.finish(task)
    parts = [paths.length_m for paths in iter_path_chunks(open_run(folder).frame(1))]
    return np.sort(np.concatenate(parts)) / kept


@pytest.mark.parametrize("kind", ["rings", "paths"])
def test_ranges_scale_from_the_smallest_to_the_largest(
    tmp_path: Path, settings: Any, kind: str
) -> None:
    usual = lengths_units(tmp_path / "usual", settings, kind, 1.0)
    assert usual.size
    assert usual.min() == pytest.approx(20.0, abs=0.1)
    for number, scale in enumerate((0.0, 1e9)):
        found = lengths_units(tmp_path / str(number), settings, kind, scale)
        np.testing.assert_allclose(found, usual, rtol=1e-6)


@pytest.mark.parametrize("kind", ["rings", "paths"])
def test_a_scale_that_is_no_number_is_refused(tmp_path: Path, settings: Any, kind: str) -> None:
    scene = bpy.context.scene
    scene.unit_settings.scale_length = math.nan
    with pytest.raises(ConfigError, match=r"Unit Scale of the scene is nan.*Scene > Units"):
        make_job(
            scene, bpy.context.view_layer, tmp_path / "run", given={"sampling_mode": kind}
        ).prepare()
    assert not (tmp_path / "run").exists()


def drawn_plan(settings: Any, kind: str) -> str:
    """What the panels say of the run."""
    settings.sampling_mode = kind
    layout = recording.drawn(RADARSIM_PT_scene)
    said = [button.values.get("message", "") for button in layout.buttons]
    return " ".join([*layout.texts, *said])


@pytest.mark.parametrize("kind", ["rings", "paths"])
def test_the_panel_says_what_is_wrong(settings: Any, kind: str) -> None:
    addon.register()
    settings.ring_step_m = 4.0
    assert "resolves" not in drawn_plan(settings, kind)
    settings.bandwidth_mhz = 150e-6
    assert "150 Hz resolves 999.31 km (c / 2B)" in drawn_plan(settings, kind)
    bpy.context.scene.unit_settings.scale_length = math.nan
    assert "Unit Scale of the scene is nan" in drawn_plan(settings, kind)
