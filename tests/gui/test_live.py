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

#: Longest slice of the timer [s], and drafts a second of 1e5 triangles while one object moves.
LONGEST_SLICE_S, LEAST_UPDATES_PER_S = 0.02, 2.0


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
    assert live["moving"]["updates_per_s"] >= LEAST_UPDATES_PER_S
    assert live["moving"]["longest_slice_s"] <= LONGEST_SLICE_S


def test_the_preview_survives_edits_and_undo_and_ends(live: dict[str, Any]):
    assert live["fault"] == ""
    assert live["left"] == []
