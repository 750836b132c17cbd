# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's walk through the Radar tab in a real Blender window, with real clicks and keys.

The walk is made once (`tests/gui/inside/walk.py`); each test looks at one thing that it noted.
Screenshots are kept in out/gui.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from tests.gui.conftest import Chroot

pytestmark = pytest.mark.gui

RINGS, PASSES = 12, 2
RENDERS = RINGS * PASSES
#: The window may stop responding while the copy is saved, on a busy machine.
LONGEST_GAP_S = 5.0
#: Processing runs in a process of its own; what is left is the drawing of the window itself.
LONGEST_PROCESSING_GAP_S = 2.0
#: Processor time of the window's thread for a step of a run, or a click in the panel of results.
LONGEST_STEP_S = 0.2


@pytest.fixture(scope="module")
def walk(installed: Chroot, shots_dir: Path) -> dict[str, Any]:
    """What the walk noted."""
    folder = installed.outside / "walk"
    folder.mkdir()
    for old in shots_dir.glob("*.png"):
        old.unlink()
    done = installed.window(f"{installed.inside}/inside/walk.py", f"{installed.inside}/walk")
    for shot in folder.glob("*.png"):
        shutil.copy(shot, shots_dir)
    if (folder / "result.json").exists():
        shutil.copy(folder / "result.json", shots_dir)
    log = done.stdout + done.stderr
    (shots_dir / "blender.log").write_text(log)
    assert (folder / "result.json").exists(), log
    result: dict[str, Any] = json.loads((folder / "result.json").read_text())
    assert not result["error"], "\n".join((result["error"], *result["log"], log[-6000:]))
    return result


def pixels(path: Path) -> Any:
    from matplotlib import image

    return image.imread(path)


def test_the_tab_opens(walk: dict[str, Any], shots_dir: Path):
    assert walk["tab"] == "Radar"
    for name in walk["shots"]:
        assert pixels(shots_dir / name)[..., :3].std() > 0.05, f"{name} shows nothing"


def test_materials_are_listed_by_name(walk: dict[str, Any]):
    assert walk["suggested"] == ["Material"]  # of the factory scene's cube


def test_antennas_are_drawn_and_materials_take_a_medium(walk: dict[str, Any]):
    assert walk["physical"] == "concrete"


def test_the_rig_is_a_camera_and_a_lamp_on_an_empty(walk: dict[str, Any]):
    added = [kind for name, kind in walk["rig"].items() if name not in ("Camera", "Light")]
    assert sorted(added) == ["CAMERA", "EMPTY", "LIGHT"]


def test_the_material_is_on_all_that_was_selected(walk: dict[str, Any]):
    assert len(walk["materials"]) == 4
    for name, slots in walk["materials"].items():
        assert len(slots) == 1, name
        assert "radar" in slots[0].lower(), (name, slots)


def test_a_button_of_the_checklist_sets_the_prf(walk: dict[str, Any]):
    """10 m/s at 77 GHz need 4 x 10 / wavelength = 10.3 kHz; the line of sight is oblique."""
    assert 9e3 < walk["fixed_prf_hz"] <= 10.3e3


def expected_files() -> set[str]:
    frame = "frames/frame_0001/"
    stems = [f"{frame}ring_{ring:03d}_t{p}" for ring in range(RINGS) for p in range(PASSES)]
    return {"run.json", f"{frame}ground_truth.json"} | {
        stem + suffix for stem in stems for suffix in (".exr", ".json")
    }


def test_all_files_of_a_run_are_there(walk: dict[str, Any]):
    assert expected_files() <= set(walk["first"]["files"])
    assert not [name for name in walk["first"]["files"] if ".part" in name]


def test_the_window_lives_while_it_renders(walk: dict[str, Any]):
    assert walk["running_at_shot"]
    assert walk["zoomed"] > 1.1, "the view did not follow the mouse wheel"
    assert walk["first"]["beats"] > RENDERS
    assert walk["first"]["longest_gap_s"] < LONGEST_GAP_S
    assert walk["first"]["longest_own_s"] < LONGEST_STEP_S


def test_escape_stops_a_run(walk: dict[str, Any]):
    rendered = [name for name in walk["stopped"]["files"] if name.endswith(".exr")]
    assert 2 <= len(rendered) < RENDERS
    assert not [name for name in walk["stopped"]["files"] if ".part" in name]
    for name in rendered:
        assert name.replace(".exr", ".json") in walk["stopped"]["files"]


def test_escape_is_heard_at_any_moment(walk: dict[str, Any]):
    assert len(walk["escapes"]) == 6
    assert all(1 <= rendered < RENDERS for rendered in walk["escapes"]), walk["escapes"]


def test_a_second_run_replaces_the_one_that_was_stopped(walk: dict[str, Any]):
    again = walk["continued"]
    assert expected_files() <= set(again["files"])
    stopped = [name for name in walk["stopped"]["files"] if name.endswith(".exr")]
    assert sorted(again["rendered_again"]) == sorted(stopped) != []


def test_paths_are_measured_from_the_window(walk: dict[str, Any]):
    expected = {"run.json", "frames/frame_0001/paths.npz", "frames/frame_0001/paths.json"}
    assert expected <= set(walk["paths"]["files"])
    assert not [name for name in walk["paths"]["files"] if ".part" in name or name.endswith(".exr")]


def test_escape_stops_a_run_of_paths(walk: dict[str, Any]):
    found = walk["stopped_paths"]["files"]
    assert "run.json" in found
    assert "frames/frame_0001/paths.json" not in found
    assert ".radarsim.lock" not in found


@pytest.mark.parametrize("run", ["first", "stopped", "continued", "stopped_paths", "paths"])
def test_all_settings_are_restored(walk: dict[str, Any], run: str):
    assert walk[run]["changed"] == []


def test_the_window_lives_while_it_processes(walk: dict[str, Any]):
    assert walk["processing"]["longest_gap_s"] < LONGEST_PROCESSING_GAP_S


def test_the_last_run_is_processed_and_shown(walk: dict[str, Any]):
    assert len(walk["images"]) >= 2, walk["images"]
    assert all(min(size) > 0 for size in walk["images"].values())
    assert walk["shown"], "no Image Editor shows a result"
    assert [name for name in walk["products"] if name.startswith("products/")]


def test_a_click_on_a_peak_of_the_map_chooses_its_target(walk: dict[str, Any]):
    wanted, found = walk["clicked"]
    assert wanted == found


def test_pictures_have_the_size_at_which_they_are_shown(walk: dict[str, Any]):
    """Blender drops pixels of images that it shows smaller: thin lines become dashed."""
    assert walk["zoom"] == pytest.approx([1.0, 1.0], abs=2e-3)


def test_targets_select_their_objects_and_settings_process_again(walk: dict[str, Any]):
    """A click takes at most 0.2 s of the window's thread, whatever the machine does besides."""
    listed, selected = walk["target"]
    assert listed == selected
    assert "Radar spectrogram" in walk["pictures"]
    assert len(walk["steps_s"]) == 4 and max(walk["steps_s"]) < LONGEST_STEP_S
