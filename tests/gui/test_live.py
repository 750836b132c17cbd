# SPDX-License-Identifier: GPL-3.0-or-later
"""The live preview in a real Blender window (`tests/gui/inside/live.py`)."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from tests.gui.conftest import Chroot

pytestmark = pytest.mark.gui

#: Of the window's thread: longest slice of the timer, and with the drawing of the picture [s]: 3
#: times what an idle machine may take.
LONGEST_SLICE_S, LONGEST_BLOCK_S = 0.06, 0.09
#: Drafts per second of 1e5 triangles while one object moves, by the processor time of all steps.
LEAST_UPDATES_PER_S = 2.0


@pytest.fixture(scope="module")
def live(installed: Chroot, shots_dir: Path) -> dict[str, Any]:
    """What the script noted."""
    folder = installed.outside / "live"
    folder.mkdir()
    done = installed.window(f"{installed.inside}/inside/live.py", f"{installed.inside}/live")
    for shot in folder.glob("*.png"):
        shutil.copy(shot, shots_dir)
    log = done.stdout + done.stderr
    assert (folder / "result.json").exists(), log
    result: dict[str, Any] = json.loads((folder / "result.json").read_text())
    (shots_dir / "live.json").write_text(json.dumps(result, indent=1))
    assert not result["error"], "\n".join((result["error"], *result["log"], log[-6000:]))
    return result


def test_the_preview_follows_a_moving_object(live: dict[str, Any]):
    assert 1e5 <= live["triangles"] < 1.01e5
    found = live["moving"]
    assert found["updates_per_s"] > 0  # by the clock: as fast as the computer draws its window
    update_s = found["longest_draft_s"] + found["longest_own_s"] + max(found["drawings_s"])
    assert 1 / update_s >= LEAST_UPDATES_PER_S


@pytest.mark.parametrize("phase", ["start", "moving", "editing"])
def test_no_slice_takes_long(live: dict[str, Any], phase: str):
    """In processor time of the window's thread, whatever the machine does besides."""
    assert live[phase]["longest_own_s"] <= LONGEST_SLICE_S


@pytest.mark.parametrize("phase", ["start", "moving", "editing"])
def test_a_slice_and_a_drawing_block_the_window_shortly(live: dict[str, Any], phase: str):
    """At the start, nothing may be compiled that Blender's window has not used before."""
    found = live[phase]
    assert found["longest_own_s"] + max(found["drawings_s"]) <= LONGEST_BLOCK_S


def test_the_preview_survives_edits_and_undo_and_ends(live: dict[str, Any]):
    assert live["fault"] == ""
    assert live["left"] == []


def test_the_preview_may_write_where_blender_refuses_timers(live: dict[str, Any]):
    plain, tick = live["refused"]
    assert "Writing to ID classes" in plain
    assert tick == live["fault_there"] == ""
