# SPDX-License-Identifier: GPL-3.0-or-later
"""The search for an interpreter, with made-up ones: versions 3.98 and 3.99 exist nowhere else."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="a POSIX shell script")

#: What pyenv puts on PATH for every version that it knows, chosen or not.
FAILING_SHIM = '#!/bin/sh\necho "pyenv: $(basename "$0"): command not found" >&2\nexit 127\n'


def fake_python(path: Path, version: str) -> Path:
    """An executable that answers the search's question as CPython `version` would."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        f'#!/bin/sh\nfor last; do :; done\n[ "$last" = {version} ] && echo "$0" || exit 1\n'
    )
    path.chmod(0o755)
    return path


def find(
    root: Path, *versions: str, path: list[Path] | None = None, **env: str
) -> subprocess.CompletedProcess[str]:
    folders = [*map(str, path or []), "/usr/bin", "/bin"]
    return subprocess.run(
        ["/bin/sh", str(root / "scripts/find_python.sh"), *versions],
        capture_output=True,
        text=True,
        check=False,
        env={"PATH": os.pathsep.join(folders), "HOME": "/nonexistent", **env},
    )


def test_a_failing_shim_is_passed_over_for_the_version_beside_it(root: Path, tmp_path: Path):
    shims = tmp_path / "py env" / "shims"  # with a space in it
    shims.mkdir(parents=True)
    for name in ("python3.99", "python3", "python"):
        (shims / name).write_text(FAILING_SHIM)
        (shims / name).chmod(0o755)
    real = fake_python(tmp_path / "py env/versions/3.99.1/bin/python3.99", "3.99")
    done = find(root, "3.99", path=[shims])
    assert (done.returncode, done.stdout.strip()) == (0, str(real)), done.stderr


def test_the_newest_is_taken_wherever_it_lies(root: Path, tmp_path: Path):
    fake_python(tmp_path / "early/python3.98", "3.98")
    newest = fake_python(tmp_path / "late/python3", "3.99")
    done = find(root, "3.99", "3.98", path=[tmp_path / "early", tmp_path / "late"])
    assert (done.returncode, done.stdout.strip()) == (0, str(newest))


def test_a_name_does_not_prove_a_version(root: Path, tmp_path: Path):
    fake_python(tmp_path / "bin/python3.99", "3.98")
    assert find(root, "3.99", path=[tmp_path / "bin"]).returncode == 2


@pytest.mark.parametrize(
    ("variable", "below"),
    [
        ("PYENV_ROOT", "versions/3.99.0/bin"),
        ("UV_PYTHON_INSTALL_DIR", "cpython-3.99.0-linux-x86_64-gnu/bin"),
    ],
)
def test_managed_interpreters_off_path_are_found(
    root: Path, tmp_path: Path, variable: str, below: str
):
    real = fake_python(tmp_path / below / "python3.99", "3.99")
    environment: dict[str, str] = {variable: str(tmp_path)}
    done = find(root, "3.99", path=None, **environment)
    assert (done.returncode, done.stdout.strip()) == (0, str(real))


def test_none_says_which_to_install(root: Path):
    done = find(root, "3.99")
    assert done.returncode == 2
    assert done.stdout == ""
    for word in ("3.13", "3.11", "none for 3.12", "PYTHON=", "install"):
        assert word in done.stderr


def test_a_chosen_interpreter_is_used_or_refused_by_name(root: Path, tmp_path: Path):
    chosen = fake_python(tmp_path / "mine", "3.98")
    fake_python(tmp_path / "bin/python3.99", "3.99")
    taken = find(root, "3.99", "3.98", path=[tmp_path / "bin"], PYTHON=str(chosen))
    assert taken.stdout.strip() == str(chosen)
    refused = find(root, "3.99", path=[tmp_path / "bin"], PYTHON=str(chosen))
    assert refused.returncode == 2
    assert str(chosen) in refused.stderr


def test_this_interpreter_is_found(root: Path):
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    done = find(root, version, PYTHON=sys.executable)
    assert done.returncode == 0, done.stderr
    found = subprocess.run([done.stdout.strip(), "--version"], capture_output=True, text=True)
    assert found.stdout.startswith(f"Python {version}.")
