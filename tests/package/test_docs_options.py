# SPDX-License-Identifier: GPL-3.0-or-later
"""Every ``--option`` that the pages name exists in a command, a script or a named other program."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from radarsim_addon.blender.plan import parse_coverage_arguments, parse_render_arguments
from radarsim_addon.signal.pipeline import main

REPOSITORY = Path(__file__).resolve().parents[2]
PAGES = [REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").glob("*.md"))]
COMMANDS = ("info", "process", "antennas", "objects", "merge")
#: Options of Blender itself, in command lines that begin with ``blender``.
OF_BLENDER = {"--disable-autoexec", "--enable-autoexec"}
#: Options of ``dask worker``.
OF_DASK = {"--nworkers", "--nthreads"}
#: Words that stand for any option.
PLACEHOLDERS = {"--option"}
OPTION = r"(?<![\w-])--[a-z][a-z0-9-]*"


def _shown_options(capsys: pytest.CaptureFixture[str]) -> set[str]:
    """Options in the help of the commands: hidden names of earlier versions are not in it."""
    for parse in (parse_render_arguments, parse_coverage_arguments):
        with pytest.raises(SystemExit):
            parse(["--help"])
    for command in COMMANDS:
        with pytest.raises(SystemExit):
            main([command, "--help"])
    return set(re.findall(OPTION, capsys.readouterr().out))


def _options_of_scripts() -> set[str]:
    """Options that a script reads, by the words in quotes in its source."""
    sources = [path for kind in ("*.py", "*.sh") for path in (REPOSITORY / "scripts").glob(kind)]
    sources.append(REPOSITORY / "tests" / "fuzz" / "__main__.py")
    text = "\n".join(path.read_text("utf-8") for path in sources)
    return set(re.findall(rf"add_argument\(\s*\"({OPTION})\"", text))


def test_options_in_the_pages_exist(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    known = _shown_options(capsys) | _options_of_scripts() | OF_BLENDER | OF_DASK | PLACEHOLDERS
    unknown = {
        f"{page.name}: {option}"
        for page in PAGES
        for option in re.findall(OPTION, page.read_text("utf-8"))
        if option not in known
    }
    assert not unknown, sorted(unknown)


def test_links_of_the_readme_lead_somewhere() -> None:
    """Each link leads to a file or another site; every picture has a text in its place."""
    text = (REPOSITORY / "README.md").read_text("utf-8")
    assert len(text.splitlines()) < 150
    assert "![]" not in text
    for target in re.findall(r"\]\(([^)#\s]+)?(?:#[^)]*)?\)", text):
        assert target.startswith("http") or (REPOSITORY / target).exists(), target
