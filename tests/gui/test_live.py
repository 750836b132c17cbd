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
    assert live["on"]
    assert 1e5 <= live["triangles"] < 1.01e5
    found = live["moving"]
    assert found["slices"] > found["drafts"] >= found["first_drafts"] >= 2
    assert found["drawings"] >= 2  # each draft asks for one; drafts that come together share it
    assert live["editing"]["first_drafts"] >= 2  # the changed mesh is read again


def test_the_preview_is_moved_and_resized_with_the_mouse(live: dict[str, Any]):
    """The lower right corner stays where it is when the upper left one is dragged."""
    first, moved, resized = live["placed"]
    assert moved == pytest.approx(
        [first[0] - 150, first[1] + 60, first[2] - 150, first[3] + 60], abs=3
    )
    assert resized[1:3] == pytest.approx(moved[1:3], abs=1)
    heights = [top - bottom for _, bottom, _, top in (moved, resized)]
    assert heights[1] == pytest.approx(heights[0] - 40, abs=3)  # the smaller change of both
    ratio = [(right - left) / (top - bottom) for left, bottom, right, top in (moved, resized)]
    assert ratio[0] == pytest.approx(ratio[1], rel=1e-3)


def test_the_preview_survives_edits_and_undo_and_ends(live: dict[str, Any]):
    assert live["fault"] == ""
    assert live["left"] == []


def test_the_preview_may_write_where_blender_refuses_timers(live: dict[str, Any]):
    plain, tick = live["refused"]
    assert "Writing to ID classes" in plain
    assert tick == live["fault_there"] == ""
