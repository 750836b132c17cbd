# SPDX-License-Identifier: GPL-3.0-or-later
"""An output folder that is removed or emptied in the middle of a run is named as gone."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import rig_settings as properties
from radarsim_addon.blender.headless import make_job
from radarsim_addon.errors import OutputError
from tests.blender import radar_scenes as rs

GONE = "run has vanished while the run was going on"


@pytest.fixture
def scene() -> Iterator[Any]:
    """A plate in one ring and one tile, two frames."""
    found = rs.new_scene()
    properties.register()
    rs.add_plate(10.0, 8.0)
    settings = rs.radar()
    settings.width_px = settings.height_px = 8
    settings.samples, settings.snapshots, settings.ring_step_m = 1, "1", 20.0
    settings.motion, settings.replicates = "off", 1
    settings.frame_mode, settings.frame_end = "range", 2
    yield found
    properties.unregister()


@pytest.mark.parametrize("kind", ["rings", "paths"])
@pytest.mark.parametrize("after", ["start", "render", "finish"])
def test_a_run_whose_folder_goes_says_so(tmp_path: Path, scene: Any, kind: str, after: str) -> None:
    """Nor is the folder made anew, without the plan, for the frames that follow."""
    folder = tmp_path / "run"
    with (
        pytest.raises(OutputError, match=GONE),
        make_job(scene, bpy.context.view_layer, folder, given={"sampling_mode": kind}) as job,
    ):
        for task in job.pending():
            for step in ("start", "render", "finish"):
                getattr(job, step)(task)
                if step == after:
                    shutil.rmtree(folder, ignore_errors=True)
    assert not folder.exists()


@pytest.mark.parametrize("kind", ["rings", "paths"])
@pytest.mark.parametrize(
    ("removed", "message"),
    [("run.json", r"was emptied \(run.json is gone\)"), ("frames", "frame_0001 has vanished")],
)
def test_what_is_left_of_it_is_told(
    tmp_path: Path, scene: Any, kind: str, removed: str, message: str
) -> None:
    folder = tmp_path / "run"
    with (
        pytest.raises(OutputError, match=message),
        make_job(scene, bpy.context.view_layer, folder, given={"sampling_mode": kind}) as job,
    ):
        for task in job.pending():
            job.start(task)
            job.render(task)
            place = folder / removed
            shutil.rmtree(place) if place.is_dir() else place.unlink(missing_ok=True)
            job.finish(task)
