# SPDX-License-Identifier: GPL-3.0-or-later
"""A second measurement into the same folder is of the scene as it is then, whatever has changed."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon import blender as radarsim
from radarsim_addon import contract, signal
from radarsim_addon.typed_json import read_record
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.run.stale_cases import CASES

pytestmark = [pytest.mark.blender, pytest.mark.slow]

#: What differs between two measurements of one scene.
_COST = re.compile(rb'"(render_time_s|motion_sha256|run_fingerprint|record_sha256)": *[^,}\s]*')


def found(folder: Path, frame: int = 1) -> dict[str, bytes]:
    """All files of a frame; of archives their arrays."""
    files: dict[str, bytes] = {}
    for path in sorted((folder / contract.frame_dir(frame)).iterdir()):
        if path.suffix == ".npz":
            with np.load(path) as arrays:
                files |= {f"{path.name} {name}": arrays[name].tobytes() for name in arrays}
        else:
            files[path.name] = _COST.sub(b"", path.read_bytes())
    return files


def measure(folder: Path) -> dict[str, bytes]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ph.run_paths(folder, width_px=12, height_px=12, options={"max_reflections": 1})
    return found(folder)


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_script_that_moves_what_it_has_opened(overwrite: bool, tmp_path: Path) -> None:
    """Blender calls the file unchanged after that; the interface for scripts is used."""
    rs.new_scene()
    rs.add_plate(10.0)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))

    def nearest_m(name: str, **given: Any) -> float:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run = radarsim.measure(
                bpy.data.objects["Radar"], tmp_path / name, frames=[1], sampling_mode="paths",
                width_px=16, height_px=16, replicates=1, **given,
            )  # fmt: skip
        return float(signal.frame_paths(run.frame(1)).range_m.min())

    assert nearest_m("run") == pytest.approx(10.0, abs=0.01)
    for item in bpy.data.objects:
        if item.type == "MESH":
            item.location.y += 5.0
    assert nearest_m("run", overwrite=overwrite) == pytest.approx(15.0, abs=0.01)
    nearest_m("fresh")
    assert found(tmp_path / "run") == found(tmp_path / "fresh")
    assert read_record(tmp_path / "run" / "run.json", contract.RunRecord).scene == "Scene"


@pytest.mark.parametrize("name", CASES)
def test_a_change_is_measured(name: str, tmp_path: Path) -> None:
    """The files are those of the saved scene in a fresh folder, and not those of before."""
    rs.new_scene()
    steps = CASES[name]()
    next(steps)
    before = measure(tmp_path / "run")
    assert next(steps, "changed") == "changed"
    after = measure(tmp_path / "run")
    for image in bpy.data.images:
        if image.is_dirty:
            image.pack()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    opened = measure(tmp_path / "opened")
    assert opened.keys() == after.keys()
    assert [key for key in after if after[key] != opened[key]] == []
    assert before != after
