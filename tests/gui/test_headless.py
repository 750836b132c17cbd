# SPDX-License-Identifier: GPL-3.0-or-later
"""The batch script under a Blender program: ``blender -b X.blend -P render_radar.py -- ...``."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
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


def test_the_zip_with_wheels_installs_in_a_clean_blender(chroot: Chroot, root: Path):
    """scipy and finufft come from the zip; the extension's transform by finufft is right."""
    done = subprocess.run(
        [sys.executable, str(root / "scripts/build_extension.py"), "--wheels", "linux-x64",
         "--out", str(chroot.outside / "with wheels")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    (archive,) = (chroot.outside / "with wheels").glob("*.zip")
    home = f"HOME={chroot.inside}/clean home"
    (chroot.outside / "clean home").mkdir()
    words = ("--command", "extension", "install-file", "-r", "user_default", "--enable")
    done = chroot.run("env", home, "blender", *words, f"{chroot.inside}/with wheels/{archive.name}")
    assert done.returncode == 0, done.stdout + done.stderr
    archive.unlink()
    (chroot.outside / "wheels.py").write_text(
        "import finufft, json, numpy, scipy.special\n"
        "from bl_ext.user_default.radarsim.signal.spectrum.nufft import has_finufft\n"
        "x, one = numpy.linspace(-3, 3, 1000), numpy.ones(1000, dtype=complex)\n"
        "value = finufft.nufft1d1(x, one, 64, eps=1e-9)[32 + 5]\n"
        "exact = numpy.exp(5j * x).sum()\n"
        "print('FOUND', json.dumps([finufft.__file__, scipy.special.__file__,\n"
        "    abs(value - exact), scipy.special.jv(0, 1.0), has_finufft()]))\n"
    )
    script = f"{chroot.inside}/wheels.py"
    done = chroot.run("env", home, "blender", "-b", "--python-exit-code", "1", "-P", script)
    assert done.returncode == 0, done.stdout + done.stderr
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("FOUND"))
    first, second, error, bessel, used = json.loads(line.removeprefix("FOUND"))
    assert "clean home" in first and "clean home" in second
    assert error < 1e-5 and bessel == pytest.approx(0.7651976865579666)
    assert used is True
