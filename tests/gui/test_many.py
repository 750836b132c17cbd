# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of 2501 objects in a real Blender window (`tests/gui/inside/many.py`)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from tests.gui.conftest import Chroot

pytestmark = pytest.mark.gui
#: Longest time for which the window's thread may work at once [ms].
LONGEST_MS = 30.0


@pytest.fixture(scope="module")
def many(installed: Chroot, shots_dir: Path) -> dict[str, Any]:
    """What the script noted."""
    folder = installed.outside / "many"
    folder.mkdir()
    done = installed.window(f"{installed.inside}/inside/many.py", f"{installed.inside}/many")
    log = done.stdout + done.stderr
    assert (folder / "result.json").exists(), log
    result: dict[str, Any] = json.loads((folder / "result.json").read_text())
    (shots_dir / "many.json").write_text(json.dumps(result, indent=1))
    assert not result["error"], "\n".join((result["error"], *result["log"], log[-6000:]))
    return result


@pytest.mark.parametrize("what", ["move", "add", "remove"])
def test_the_window_works_in_slices_after_an_edit(many: dict[str, Any], what: str) -> None:
    assert many["objects"] > 2500 and many["fault"] == ""
    assert many["read_again"][what]
    spent_ms = dict(many["longest_ms"][what])
    spent_ms.pop("garbage collection", None)
    assert {"_read_slice", "_tick"} <= set(spent_ms)
    assert max(spent_ms.values()) < LONGEST_MS, spent_ms
