# SPDX-License-Identifier: GPL-3.0-or-later
""".ci/run fails when either half fails, with a stand-in for make."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="a POSIX shell script")


def ci(root: Path, tools: Path, failing: str, user: int) -> tuple[int, str, list[str]]:
    """Exit code, what was printed, and the targets that make was asked for."""
    called = tools / "called"
    called.write_text("")
    for name, body in {
        "make": f'echo "$1" >> "{called}"; [ "$1" != "{failing}" ]',
        "id": f'[ "$1" = -u ] && echo {user} || echo somebody',
        "debootstrap": ":",
    }.items():
        (tools / name).write_text(f"#!/bin/sh\n{body}\n")
        (tools / name).chmod(0o755)
    done = subprocess.run(
        ["/bin/sh", str(root / ".ci/run")],
        capture_output=True,
        text=True,
        check=False,
        env={"PATH": os.pathsep.join([str(tools), "/usr/bin", "/bin"])},
    )
    targets = called.read_text().split()
    if "gui-test" in targets:
        targets.remove("gui-chroot")  # made meanwhile
    return done.returncode, done.stdout + done.stderr, targets


def test_both_pass(root: Path, tmp_path: Path):
    code, _, called = ci(root, tmp_path, "", 0)
    assert (code, called) == (0, ["test", "gui-test"])


@pytest.mark.parametrize("failing", ["test", "gui-test"])
def test_either_failure_is_a_failure(root: Path, tmp_path: Path, failing: str):
    code, said, called = ci(root, tmp_path, failing, 0)
    assert code != 0
    assert "FAILED" in said
    assert called == ["test", "gui-test"]


def test_without_root_the_window_is_left_out_and_named(root: Path, tmp_path: Path):
    code, said, called = ci(root, tmp_path, "", 1000)
    assert (code, called) == (0, ["test"])
    assert "needs root" in said
