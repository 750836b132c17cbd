# SPDX-License-Identifier: GPL-3.0-or-later
"""The tutorial in the window, click by click: its numbers, its labels, its screenshots."""

from __future__ import annotations

import json
import math
import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from tests.gui.conftest import Chroot

pytestmark = pytest.mark.gui
PAGE = Path(__file__).resolve().parents[2] / "docs" / "tutorials" / "first-map-window.md"


@pytest.fixture(scope="module")
def walk(installed: Chroot, shots_dir: Path) -> dict[str, Any]:
    """What the walk noted, and the summary of its frame; screenshots are in out/gui."""
    folder = installed.outside / "tutorial"
    folder.mkdir()
    done = installed.window(
        f"{installed.inside}/inside/tutorial.py", f"{installed.inside}/tutorial"
    )
    for shot in folder.glob("*.png"):
        shutil.copy(shot, shots_dir)
    log = done.stdout + done.stderr
    assert (folder / "result.json").exists(), log
    result: dict[str, Any] = json.loads((folder / "result.json").read_text())
    assert not result["error"], "\n".join((result["error"], *result["log"], log[-6000:]))
    (summary,) = folder.rglob("*_summary.json")
    return result | {"summary": json.loads(summary.read_text())}


def test_range_and_velocity(walk: dict[str, Any]) -> None:
    """The cube recedes at 10 m/s along Y; the radar sees (10 m/s) . u of it."""
    x, y, z = walk["radar_m"]
    away_m = math.dist((x, y, z), (0, 0, 0))
    (echo,) = walk["summary"]["link_budget"]["objects"]
    assert away_m - math.sqrt(3) < echo["range_m"] < away_m  # the corner that is nearest
    assert echo["range_rate_mps"] == pytest.approx(10.0 * -y / away_m, abs=0.7)
    stated = re.search(r"about (\d+) m away, with a range rate of ([\d.]+) m/s", PAGE.read_text())
    assert stated is not None
    assert echo["range_m"] == pytest.approx(float(stated[1]), abs=0.6)
    assert echo["range_rate_mps"] == pytest.approx(float(stated[2]), abs=0.1)


def test_the_page_shows_the_screenshots(walk: dict[str, Any]) -> None:
    """scripts/window_pictures.py makes them small."""
    shown = re.findall(r"\.\./images/(tutorial_\d_\w+)\.png", PAGE.read_text("utf-8"))
    assert shown == [Path(name).stem for name in walk["shots"]]
