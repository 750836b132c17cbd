# SPDX-License-Identifier: GPL-3.0-or-later
"""Exit codes of commands in bad states, as docs/headless.md has them."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("bpy")

import radarsim_addon.__main__ as commands
from radarsim_addon.__main__ import main
from radarsim_addon.blender.headless import coverage, render, selfcheck
from radarsim_addon.blender.run.scene_state import Verdict
from radarsim_addon.errors import MissingDependencyError

pytestmark = pytest.mark.blender

DOCS = (Path(__file__).parents[3] / "docs/headless.md").read_text(encoding="utf-8")
#: Of the table: those of one digit.
CODES = [int(code) for code in re.findall(r"^\| (\d) \| .* \|$", DOCS, re.M)]
AXES = "--target-height", "0:30:10", "--range-limits", "100:200:50"


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["render", "empty.blend"], 1, "cannot be opened"),
        (["render", "none.blend"], 2, "does not exist"),
        (["render", "none.blend", "--device", "abacus"], 2, "abacus"),
        (["coverage", "empty.blend", *AXES], 1, "cannot be opened"),
        (["coverage", "none.blend", *AXES], 2, "does not exist"),
        (["coverage", "none.blend", *AXES, "--rms-height", "x"], 2, "--rms-height"),
        (["coverage", "empty.blend", "--target-height", "9:1", *AXES[2:]], 2, "--target-height"),
        (["selfcheck", "--device", "abacus"], 2, "abacus"),
        (["selfcheck", "--device", "cuda"], 1, "CUDA"),
        (["process", "nowhere"], 1, "FrameFileError"),
        (["process", "nowhere", "--frames", "5:1"], 2, "--frames"),
        (["process"], 2, "are required"),
        (["merge", "out", "nowhere"], 1, "FrameFileError"),
        (["merge", "out"], 2, "are required"),
    ],
)
def test_bad_inputs(
    words: list[str], code: int, said: str,
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    (tmp_path / "empty.blend").touch()
    monkeypatch.chdir(tmp_path)
    for module in (coverage, render):
        monkeypatch.setattr(module, "leave_blender", sys.exit)
    if words[0] == "render":
        words = [*words, "--out", "run"]
    try:
        found: Any = main(words)
    except SystemExit as end:
        found = end.code
    shown = capfd.readouterr().err
    assert (found, said in shown, "Traceback" in shown) == (code, True, False), shown
    assert code in CODES


@pytest.mark.parametrize(("failed", "code"), [((), 0), (("a fact",), 1)])
def test_selfcheck_fails_with_its_facts(
    failed: tuple[str, ...], code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(selfcheck, "check", lambda _: Verdict({}, failed))
    monkeypatch.setattr(selfcheck, "keep", lambda *_: None)
    assert main(["selfcheck"]) == code


@pytest.mark.parametrize(("version", "said"), [((3, 12), "uv python install 3.13"), ((3, 13), "")])
def test_a_python_that_bpy_does_not_exist_for_is_named(
    version: tuple[int, int], said: str, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """pip install '.[blender]' is no remedy there."""
    this_python = SimpleNamespace(version_info=version, stderr=sys.stderr)
    monkeypatch.setattr(commands, "sys", this_python)
    missing = ModuleNotFoundError("No module named 'bpy'", name="bpy")
    assert commands._no_bpy(missing) == MissingDependencyError.exit_code
    shown = capsys.readouterr().err
    assert ("for Python 3.12" in shown) == (version == (3, 12)) and said in shown
