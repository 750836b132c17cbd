# SPDX-License-Identifier: GPL-3.0-or-later
"""The code in the documentation runs, and prints what the pages say."""

from __future__ import annotations

import json
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
    for name in ("clutter", "headless", "materials", "mirrors", "physics", "reference/api")
]


@pytest.mark.parametrize("page", [*TUTORIALS, *NOTEBOOKS, *PAGES], ids=lambda page: page.stem)
def test_code_of_pages(page: Path, capfd: pytest.CaptureFixture[str]) -> None:
    if "import pandas" in page.read_text("utf-8"):
        pytest.importorskip("pandas")
    assert docs_code.run(page) == []


def test_a_notebook_whose_output_is_wrong_is_seen(tmp_path: Path) -> None:
    """Every code cell is compared, also one that should print nothing; figures are not kept."""
    first, second = (
        {"cell_type": "code", "source": [code], "outputs": []} for code in ("x = 3", "print(x)")
    )
    page = tmp_path / "page.ipynb"
    page.write_text(json.dumps({"cells": [first, second]}))
    assert docs_code.run(page) == ["expected 0 lines, found 1"]
    docs_code.run(page, write=True)
    assert docs_code.run(page) == []
    assert "```text\n3\n```" in docs_code.notebook_page(page.read_text())
    for notebook in NOTEBOOKS:
        outputs = [out for cell in json.loads(notebook.read_text("utf-8"))["cells"]
                   for out in cell.get("outputs", ())]  # fmt: skip
        assert all(out["output_type"] == "stream" for out in outputs), notebook.name


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
