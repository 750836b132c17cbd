# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip installed in a clean user folder, as Blender does it, and used from there."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.typed_json import read_record

RINGS = 3


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("run") / "first run"


@pytest.fixture(scope="module")
def found(archive: Path, out: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a process with a clean user folder found."""
    script = Path(__file__).parent / "inside/installed.py"
    user = tmp_path_factory.mktemp("user")
    done = subprocess.run(
        [sys.executable, str(script), str(archive), str(out)],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        cwd=user,
        env={**os.environ, "BLENDER_USER_RESOURCES": str(user)},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    line = next(line for line in done.stdout.splitlines() if line.startswith("{"))
    result: dict[str, Any] = json.loads(line)
    result["user"] = str(user)
    return result


def test_it_is_installed_and_enabled(found: dict[str, Any]):
    assert found["installed"] == ["FINISHED"]
    assert found["enabled"]
    assert found["file"].startswith(found["user"])
    assert not found["checkout_imported"], "the extension leans on the checkout"


def test_it_brings_what_it_says(found: dict[str, Any]):
    for operator in ("setup_rig", "assign_material", "render_frames", "process_last_run"):
        assert operator in found["enabled_traces"]["operators"]
    assert "Object.radarsim" in found["enabled_traces"]["properties"]


def test_a_frame_is_rendered(found: dict[str, Any], out: Path):
    """The plate at 10 m fills ring 2 (10 to 15 m: it is flat, so its edges are farther) alone."""
    from radarsim_addon.signal.runs import exr

    assert found["rendered"] == ["FINISHED"]
    run = read_record(out / contract.RUN_FILE, contract.RunRecord)
    assert (run.rings, run.ring_step_m, run.snapshots) == (RINGS, 5.0, 2)
    light = []
    for ring in range(RINGS):
        path = out / contract.frame_dir(1) / (contract.render_stem(ring, 0) + ".exr")
        channels = exr.read_exr(path)
        light.append(float(np.sum(channels[contract.AMPLITUDE_CHANNEL])))
    assert light[0] == light[1] == 0.0
    assert light[2] > 0.0


def test_registering_twice_changes_nothing(found: dict[str, Any]):
    assert found["registered_twice"] == found["enabled_traces"]


@pytest.mark.parametrize("moment", ["after", "after_again"])
def test_disabling_leaves_nothing_behind(found: dict[str, Any], moment: str):
    assert found[moment] == found["before"]
    assert not any(found["before"].values())


def test_uninstalling_leaves_nothing_behind(found: dict[str, Any]) -> None:
    """No class, property, handler or operator, no file of its own, no word in another file."""
    assert found["uninstalled"] == ["FINISHED"]
    assert found["files_before"] > 300
    assert found["after_uninstall"] == found["before"] | {"files": []}
    assert found["addons"] == []


def test_it_can_be_enabled_again(found: dict[str, Any]):
    assert found["enabled_again"] == found["enabled_traces"]


def test_the_interface_for_scripts_is_that_of_the_wheel(found: dict[str, Any]) -> None:
    assert found["measured"] == [2, 8, 0]
    assert found["carrier_hz"] == 77e9
