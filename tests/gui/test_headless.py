# SPDX-License-Identifier: GPL-3.0-or-later
"""The batch script under a Blender program: ``blender -b X.blend -P render_radar.py -- ...``."""

from __future__ import annotations

import json
import subprocess
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.gui.conftest import Chroot

pytestmark = pytest.mark.gui

SCRIPT = "checkout/scripts/render_radar.py"


@pytest.fixture(scope="module")
def scenes(installed: Chroot) -> Chroot:
    """The chroot with two scenes: ``plate é.blend`` and ``no radar.blend``."""
    (installed.outside / "scenes").mkdir()
    done = installed.run(
        "blender", "-b", "--python-exit-code", "1", "--python",
        f"{installed.inside}/inside/make_scene.py", "--", f"{installed.inside}/scenes",
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return installed


def batch(chroot: Chroot, blend: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return chroot.run("blender", "-b", f"scenes/{blend}", "-P", SCRIPT, "--", *arguments)


def test_a_scene_is_rendered(scenes: Chroot):
    done = batch(
        scenes, "plate é.blend",
        "--out", "batch out", "--frames", "1:2", "--rings", "3", "--ring-step", "5",
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    out = scenes.outside / "batch out"
    assert len(list(out.rglob("*.exr"))) == 2 * 3 * 2
    run = json.loads((out / "run.json").read_text())
    assert (run["frames"], run["rings"], run["ring_step_m"]) == ([1, 2], 3, 5.0)
    again = batch(
        scenes, "plate é.blend",
        "--out", "batch out", "--frames", "1:2", "--rings", "3", "--ring-step", "5",
    )  # fmt: skip
    assert again.returncode == 0, again.stdout + again.stderr


def test_paths_are_measured_and_processed(scenes: Chroot):
    """One path per pixel, EXR files read by the OpenImageIO that the Blender program has."""
    done = batch(
        scenes, "plate é.blend",
        "--out", "batch paths", "--sampling-mode", "paths", "--resolution", "32x32",
        "--max-reflections", "2",
        "--process",
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    out = scenes.outside / "batch paths"
    record = json.loads((out / "frames/frame_0001/paths.json").read_text())
    assert record["path_count"] > 100
    assert (out / "products" / "frame_0001_map.npz").is_file()


def test_workers_are_blender_programs(scenes: Chroot):
    words = ["--frames", "1:3", "--rings", "2", "--ring-step", "5"]
    done = batch(scenes, "plate é.blend", "--out", "by workers", *words, "--workers", "2")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "3/3 frames, 100 %" in done.stdout
    out = scenes.outside / "by workers"
    assert len(list(out.rglob("*.exr"))) == 3 * 2 * 2
    assert not list(out.rglob("*.lease"))
    part = batch(scenes, "plate é.blend", "--out", "shard", *words, "--shard", "2/2")
    assert part.returncode == 0, part.stdout + part.stderr
    assert {path.parent.name for path in (scenes.outside / "shard").rglob("*.exr")} == {
        "frame_0002"
    }


def test_a_scene_without_radar_fails_and_says_so(scenes: Chroot):
    done = batch(scenes, "no radar.blend", "--out", "nothing")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "SceneError" in done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ("--out", "bad", "--no-such-option"),
        ("--out", "bad", "--rings", "many"),
        ("--out", "bad", "--rings", "3", "--ring-step", "0"),
        ("--out", "bad", "--frames", "5:1"),
    ],
)
def test_bad_arguments_are_refused(scenes: Chroot, arguments: tuple[str, ...]):
    done = batch(scenes, "plate é.blend", *arguments)
    assert done.returncode == 2, done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    assert not list((scenes.outside / "bad").rglob("*.exr"))


def test_help(scenes: Chroot):
    done = scenes.run("blender", "-b", "-P", SCRIPT, "--", "--help")
    assert done.returncode == 0, done.stdout + done.stderr
    for option in ("--out", "--frames", "--rings", "--ring-step"):
        assert option in done.stdout


def test_the_wheels_of_the_zip_are_used(installed: Chroot):
    """They come from the extension's folder, and the transform of finufft is right."""
    (installed.outside / "wheels.py").write_text(
        "import finufft, json, matplotlib, numpy, scipy.special\n"
        "from bl_ext.user_default.radarsim.signal.spectrum import nufft1\n"
        "x = numpy.linspace(-3, 3, 1000)\n"
        "error = abs(nufft1(x, numpy.ones(1000), 64)[32 + 5] - numpy.exp(-5j * x).sum())\n"
        "print('FOUND', json.dumps([finufft.__file__, matplotlib.__file__, scipy.__file__,\n"
        "    error, scipy.special.jv(0, 1.0)]))\n"
    )
    script = f"{installed.inside}/wheels.py"
    done = installed.run("blender", "-b", "--python-exit-code", "1", "-P", script)
    assert done.returncode == 0, done.stdout + done.stderr
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("FOUND"))
    *files, error, bessel = json.loads(line.removeprefix("FOUND"))
    assert all(file.startswith(installed.inside) for file in files)
    assert error < 1e-5 and bessel == pytest.approx(0.7651976865579666)
