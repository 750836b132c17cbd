# SPDX-License-Identifier: GPL-3.0-or-later
"""The built extension."""

from __future__ import annotations

import hashlib
import sys
import zipfile
from pathlib import Path

import pytest

from scripts import build_extension

#: The platform that this machine can install.
PLATFORM = {"win32": "windows-x64", "darwin": "macos-arm64"}.get(sys.platform, "linux-x64")
_WHEEL = "radarsim_test-1.0-py3-none-any.whl"


@pytest.fixture(scope="session")
def small_wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel of a package with one line, in place of 120 MB from the network."""
    path = tmp_path_factory.mktemp("wheel") / _WHEEL
    about = "radarsim_test-1.0.dist-info"
    with zipfile.ZipFile(path, "w") as wheel:
        wheel.writestr("radarsim_test.py", "FOUND = 1\n")
        wheel.writestr(
            f"{about}/METADATA", "Metadata-Version: 2.1\nName: radarsim-test\nVersion: 1.0\n"
        )
        wheel.writestr(
            f"{about}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        # by its record Blender removes a wheel again
        names = [
            "radarsim_test.py",
            *(f"{about}/{name}" for name in ("METADATA", "WHEEL", "RECORD")),
        ]
        wheel.writestr(f"{about}/RECORD", "".join(f"{name},,\n" for name in names))
    return path


@pytest.fixture
def few_wheels(small_wheel: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The build carries the small wheel alone."""
    _with_wheel(small_wheel, monkeypatch)


def _with_wheel(wheel: Path, patch: pytest.MonkeyPatch) -> None:
    digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
    patch.setattr(build_extension, "wheels_of", lambda platform: {wheel.name: digest})
    patch.setattr(build_extension, "fetch_wheel", lambda name, digest: wheel)


@pytest.fixture(scope="session")
def archive(small_wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The extension's zip for this machine, with the small wheel."""
    with pytest.MonkeyPatch.context() as patch:
        _with_wheel(small_wheel, patch)
        return build_extension.build(tmp_path_factory.mktemp("dist"), PLATFORM)
