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


def test_the_preview_survives_edits_and_undo_and_ends(live: dict[str, Any]):
    assert live["fault"] == ""
    assert live["left"] == []


def test_the_preview_may_write_where_blender_refuses_timers(live: dict[str, Any]):
    plain, tick = live["refused"]
    assert "Writing to ID classes" in plain
    assert tick == live["fault_there"] == ""
