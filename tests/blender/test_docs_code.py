# SPDX-License-Identifier: GPL-3.0-or-later
"""The code in the documentation runs, and prints what the pages say."""

from __future__ import annotations

import json
import subprocess
import sys
import types
from pathlib import Path

import pytest

from scripts import docs_code

ROOT = Path(__file__).resolve().parents[2]

pytestmark = [pytest.mark.blender, pytest.mark.slow]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
#: Other pages with Python in them, but for those that read the run of `make demo`.
PAGES = [
    ROOT / "docs" / f"{name}.md"
    for name in (
        "arrays",
        "clutter",
        "headless",
        "materials",
        "mirrors",
        "physics",
        "reference/api",
    )
]


@pytest.mark.parametrize("page", [*TUTORIALS, *NOTEBOOKS, *PAGES], ids=lambda page: page.stem)
def test_code_of_pages(page: Path, capfd: pytest.CaptureFixture[str]) -> None:
    if "import pandas" in page.read_text("utf-8"):
        pytest.importorskip("pandas")
    assert docs_code.run(page) == []


def test_a_notebook_whose_output_is_wrong_is_seen(tmp_path: Path) -> None:
    """Every code cell is compared, also one that should print nothing; figures too."""
    first, second = (
        {"cell_type": "code", "source": [code], "outputs": [], "metadata": {}}
        for code in ("x = 3", "print(x)")
    )
    page = tmp_path / "page.ipynb"
    page.write_text(json.dumps({"cells": [first, second]}))
    assert docs_code.run(page) == ["expected 0 lines, found 1"]
    docs_code.run(page, write=True)
    assert docs_code.run(page) == []
    assert "```text\n3\n```" in docs_code.notebook_page(page.read_text(), "page")


def test_a_notebook_holds_its_figures(tmp_path: Path) -> None:
    """That of the last line, and those of pyplot; a semicolon hides a value. One less is seen."""
    codes = (
        "import matplotlib\nmatplotlib.use('Agg')\nfrom matplotlib.figure import Figure",
        "Figure((2, 2))",
        "import matplotlib.pyplot as plt\nplt.plot([1, 2]);",
        "[1, 2];",
    )
    cells = [
        {"cell_type": "code", "source": [code], "outputs": [], "metadata": {}} for code in codes
    ]
    page = tmp_path / "page.ipynb"
    page.write_text(json.dumps({"cells": cells}))
    assert docs_code.run(page) == ["expected 0 figures, found 1"] * 2
    docs_code.run(page, write=True)
    assert docs_code.run(page) == []
    text = page.read_text()
    assert [image[:4] for image in docs_code.images(text)] == [b"\x89PNG"] * 2
    shown = docs_code.notebook_page(text, "page")
    assert "(page_0.png)" in shown and "(page_1.png)" in shown
    counts = [cell["execution_count"] for cell in json.loads(text)["cells"]]
    assert counts == [1, 2, 3, 4]


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda page: page.stem)
def test_notebooks_are_executed_and_small(notebook: Path) -> None:
    text = notebook.read_text("utf-8")
    codes = [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in codes] == list(range(1, len(codes) + 1))
    assert docs_code.images(text) and len(text) < 150_000


def test_the_first_cell_of_notebooks_installs_radarsim_on_colab_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sources = {docs_code.cells(page.read_text("utf-8"))[0].code for page in NOTEBOOKS}
    assert len(sources) == 1 and len(NOTEBOOKS) == 6
    (source,) = sources
    commands: list[list[str]] = []
    monkeypatch.setattr(subprocess, "run", lambda words, check: commands.append(words))
    exec(source, {})
    assert not commands
    # as on Colab, with a checkout where the cell looks for it
    monkeypatch.setitem(sys.modules, "google", types.ModuleType("google"))
    monkeypatch.setitem(sys.modules, "google.colab", types.ModuleType("google.colab"))
    assert source.count("/content/radarsim") == 2
    source = source.replace("/content/radarsim", ROOT.as_posix())
    exec(source, {})
    update, packages, pip = commands
    assert update[:2] == ["apt-get", "update"]
    assert {"libegl1", "libxkbcommon0", "libxi6"} <= set(packages)
    assert pip[-1] == f"{ROOT.as_posix()}[blender]"
    monkeypatch.setattr(sys, "version_info", (3, 12, 0))
    with pytest.raises(RuntimeError, match=r"3\.13 or 3\.11"):
        exec(source, {})


def test_every_page_with_python_is_run() -> None:
    """Or it is one of those whose code needs the demo's run."""
    with_python = {
        page
        for page in (ROOT / "docs").rglob("*.md")
        if any(block.kind == "python" for block in docs_code.blocks(page.read_text("utf-8")))
    }
    demo = {ROOT / "docs" / name for name in ("signal.md", "acquisition.md")}
    assert with_python - demo <= {*TUTORIALS, *PAGES}
    assert set(PAGES) <= with_python


def test_a_wrong_statement_is_seen() -> None:
    """Numbers within 2 %, or the last digit; all else to the letter."""
    assert docs_code.difference("range 40.01 m\n", "range 40.02 m\n") is None
    assert docs_code.difference("3 m/s", "4 m/s") is None
    assert docs_code.difference("range 40.01 m", "range 41.01 m") is not None
    assert docs_code.difference("range 40 m", "range 40 km") is not None
    assert docs_code.difference("a\nb", "a") is not None
