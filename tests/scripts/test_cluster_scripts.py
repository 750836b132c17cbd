# SPDX-License-Identifier: GPL-3.0-or-later
"""The example job scripts for SLURM and render farms give commands that radarsim understands."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from radarsim_addon.blender.plan import parse_render_arguments
from radarsim_addon.options import share_of

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts" / "cluster"
pytestmark = pytest.mark.skipif(os.name != "posix", reason="shell scripts")


def command_of(script: str, tmp_path: Path, words: list[str], **environment: str) -> list[str]:
    """Words that a script gives to `radarsim` or `blender`, which are replaced."""
    for name in ("radarsim", "blender"):
        program = tmp_path / name
        program.write_text('#!/bin/sh\nprintf "%s\\n" "$OMP_NUM_THREADS" "$@"\n')
        program.chmod(0o755)
    path = f"{tmp_path}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["sh", str(SCRIPTS / script), *words],
        env={"PATH": path, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.splitlines()


def test_a_task_of_a_slurm_array_does_its_shard(tmp_path: Path) -> None:
    array = {"SLURM_ARRAY_TASK_ID": "3", "SLURM_ARRAY_TASK_COUNT": "64"}
    words = ["my scene.blend", "/shared/my run", "--frames", "1:1000"]
    threads, command, *given = command_of("slurm_array.sh", tmp_path, words, **array)
    assert (threads, command) == ("1", "render")
    parsed = parse_render_arguments(given)
    assert (parsed.blend, parsed.out) == (Path("my scene.blend"), Path("/shared/my run"))
    assert parsed.process and share_of(parsed).shard == (3, 64)
    # one task again: the size of the whole array is told
    *_, last = command_of("slurm_array.sh", tmp_path, words, TASKS="64", **array)
    assert last == "3/64"


def test_a_task_of_a_render_farm_does_its_shard(tmp_path: Path) -> None:
    words = ["2", "8", "my scene.blend", "part 2", "--frames", "1:1000"]
    threads, *given = command_of("render_farm.sh", tmp_path, words, RADARSIM="/farm/radarsim")
    assert threads == "1"
    assert given[:4] == ["-b", "my scene.blend", "-P", "/farm/radarsim/scripts/render_radar.py"]
    parsed = parse_render_arguments(given[given.index("--") + 1 :], needs_blend=False)
    assert (parsed.out, share_of(parsed).shard) == (Path("part 2"), (2, 8))
