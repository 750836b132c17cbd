# SPDX-License-Identifier: GPL-3.0-or-later
"""A chroot with Blender 4.3, the extension installed in it from the built zip."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

#: The chroot's packages are fetched the first time.
MAKE_TIMEOUT_S = 1200
RUN_TIMEOUT_S = 600
SCREEN = (1600, 1000)


@dataclass(frozen=True)
class Chroot:
    """A Debian with Blender, and a folder in it that is this session's own."""

    root: Path
    #: The session's folder as seen from outside, and as seen from inside.
    outside: Path
    inside: str

    def run(
        self, *command: str, timeout_s: float = RUN_TIMEOUT_S
    ) -> subprocess.CompletedProcess[str]:
        """Run a command in the chroot, in the session's folder, which is its HOME too."""
        environment = {
            "PATH": "/usr/bin:/bin",
            "HOME": self.inside,
            "TMPDIR": self.inside + "/tmp",
            "LC_ALL": "C.UTF-8",
            # A graphics card's driver there is not: Mesa draws on the processor.
            "LIBGL_ALWAYS_SOFTWARE": "1",
        }
        settings = [f"{key}={value}" for key, value in environment.items()]
        try:
            return subprocess.run(
                ["chroot", str(self.root), "env", "-i", "-C", self.inside, *settings, *command],
                capture_output=True,
                text=True,
                errors="replace",
                timeout=timeout_s,
                check=False,
            )
        except subprocess.TimeoutExpired as late:
            said = [(part or b"").decode(errors="replace") for part in (late.stdout, late.stderr)]
            pytest.fail(f"{command}: not done after {timeout_s} s\n" + "\n".join(said)[-8000:])

    def window(self, script: str, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run a Python script in a Blender window on a virtual screen."""
        width, height = SCREEN
        done = self.run(
            "xvfb-run", "-a", "-s", f"-screen 0 {width}x{height}x24",
            "blender", "-p", "0", "0", str(width), str(height),
            "--python-exit-code", "1", "--python", script, "--", *arguments,
        )  # fmt: skip
        crash = self.outside / "tmp/blender.crash.txt"
        if crash.exists():  # Blender writes it where it crashes
            done.stderr += crash.read_text(errors="replace")
        return done


@pytest.fixture(scope="session")
def chroot(root: Path) -> Iterator[Chroot]:
    """The chroot, made the first time, with an empty folder for this session."""
    made = subprocess.run(
        ["sh", str(root / "scripts/gui_chroot.sh")],
        stdout=subprocess.PIPE,
        text=True,
        timeout=MAKE_TIMEOUT_S,
        check=False,
    )
    if made.returncode != 0:
        pytest.exit("the chroot for the GUI test could not be made (see above)", returncode=1)
    base = Path(made.stdout.strip().splitlines()[-1])
    outside = Path(tempfile.mkdtemp(prefix="radarsim-gui-", dir=base / "srv"))
    (outside / "tmp").mkdir()
    yield Chroot(base, outside, "/" + str(outside.relative_to(base)))
    shutil.rmtree(outside, ignore_errors=True)


@pytest.fixture(scope="session")
def installed(chroot: Chroot, root: Path) -> Chroot:
    """The chroot with the extension built from this checkout, installed and enabled."""
    built = subprocess.run(
        [sys.executable, str(root / "scripts/build_extension.py"), "--platforms", "linux-x64",
         "--out", str(chroot.outside)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    (archive,) = chroot.outside.glob("*.zip")
    for command in (
        ("validate", f"{chroot.inside}/{archive.name}"),
        ("install-file", "-r", "user_default", "--enable", f"{chroot.inside}/{archive.name}"),
    ):
        done = chroot.run("blender", "--command", "extension", *command)
        assert done.returncode == 0, done.stdout + done.stderr
    shutil.copytree(root / "tests/gui/inside", chroot.outside / "inside")
    # The batch script is used from a checkout, beside the extension that is enabled.
    checkout = chroot.outside / "checkout"
    unwanted = shutil.ignore_patterns("__pycache__")
    for part in ("radarsim_addon", "scripts"):
        shutil.copytree(root / part, checkout / part, ignore=unwanted)
    return chroot


@pytest.fixture(scope="session")
def shots_dir(root: Path) -> Path:
    """Where screenshots are kept, to be looked at."""
    folder = root / "out/gui"
    folder.mkdir(parents=True, exist_ok=True)
    return folder
