# SPDX-License-Identifier: GPL-3.0-or-later
"""The documentation site: no dead link or anchor, every page in its contents."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
pytest.importorskip("mkdocstrings")


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    """Strict mode: a link to nothing, or an interface that cannot be read, is an error."""
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--site-dir", str(tmp_path / "site")],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1", "NO_COLOR": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    log = done.stdout + done.stderr
    assert done.returncode == 0, log
    assert 'not included in the "nav"' not in log, log
    commands = (tmp_path / "site" / "reference" / "commands.html").read_text("utf-8")
    assert "--max-reflections" in commands and "--cfar" in commands
    interface = (tmp_path / "site" / "reference" / "api-signal.html").read_text("utf-8")
    assert "range_process" in interface and "Range-compressed pulses" in interface
