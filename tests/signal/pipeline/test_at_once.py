# SPDX-License-Identifier: GPL-3.0-or-later
"""Several ``radarsim process`` of one run at the same time: the last one wins, whole."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from tests.signal.synthetic import Setup, points, write_run

ROOT = Path(__file__).parents[3]
SETUP = Setup(frames=(1, 2, 3), rings=2)


def start(run: Path, out: Path, *words: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "radarsim_addon", "process", str(run), "--out", str(out)]
    return subprocess.Popen(
        [*command, "--no-plots", *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        text=True, cwd=ROOT,
    )  # fmt: skip


def arrays(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.npz")}


def test_two_at_once(tmp_path: Path) -> None:
    """Their maps differ by the taper: each file is of the one or of the other, none of both."""
    run = write_run(tmp_path / "run", SETUP, points(SETUP, [(1, 1, 300.0, 10.0, 2.0)]))
    tapers = ("none", "hann")
    alone = {}
    for taper in tapers:
        assert start(run, tmp_path / taper, "--range-taper", taper).wait() == 0
        alone[taper] = arrays(tmp_path / taper)
    assert all(alone["none"][name] != data for name, data in alone["hann"].items())
    both = [start(run, tmp_path / "both", "--range-taper", taper) for taper in tapers]
    for process in both:
        _, said = process.communicate(timeout=120)
        assert process.returncode == 0, said
    found = arrays(tmp_path / "both")
    assert found.keys() == alone["none"].keys()
    for name, data in found.items():
        assert data in (alone["none"][name], alone["hann"][name])
    assert {p.name for p in (tmp_path / "both").iterdir()} == {
        p.name for p in (tmp_path / "none").iterdir()
    }
    for path in (tmp_path / "both").glob("*.json"):
        json.loads(path.read_text("utf-8"))
