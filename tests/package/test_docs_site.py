# SPDX-License-Identifier: GPL-3.0-or-later
"""The documentation site: no dead link or anchor, every page in its contents, every public name."""

from __future__ import annotations

import importlib
import inspect
import json
import os
import pkgutil
import re
import subprocess
import sys
import zlib
from pathlib import Path

import pytest

import radarsim_addon
from radarsim_addon import blender, errors, physics, signal
from scripts.docs_site import COMMANDS_PAGE, commands_page

ROOT = Path(__file__).resolve().parents[2]
pytest.importorskip("mkdocstrings")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site in strict mode: a dead link, or a docstring that cannot be read, is an error."""
    folder = tmp_path_factory.mktemp("docs") / "site"
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--site-dir", str(folder)],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1", "NO_COLOR": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    log = done.stdout + done.stderr
    assert done.returncode == 0, log
    assert 'not included in the "nav"' not in log, log
    return folder


def public_paths() -> set[str]:
    """What scripts use, as paths from the package."""
    found = {f"signal.{name}" for name in signal.__all__}
    found |= {f"blender.{name}" for name in blender.__all__}
    modules = [importlib.import_module(f"radarsim_addon.physics.{one.name}")
               for one in pkgutil.iter_modules(physics.__path__)]  # fmt: skip
    for module in (errors, *modules):
        found |= {
            f"{module.__name__.partition('.')[2]}.{name}"
            for name, item in vars(module).items()
            if not name.startswith("_")
            and (inspect.isfunction(item) or inspect.isclass(item))
            and item.__module__ == module.__name__
        }
    return found


@pytest.mark.slow
def test_every_public_name_is_on_a_page(site: Path) -> None:
    header, _, body = (site / "objects.inv").read_bytes().partition(b"zlib.\n")
    assert header.startswith(b"# Sphinx inventory")
    lines = zlib.decompress(body).decode().splitlines()
    shown = {line.split()[0].removeprefix("radarsim_addon.") for line in lines}
    assert len(public_paths()) > 200
    assert not public_paths() - shown


def test_docstrings_are_shown_without_markup_of_other_tools(site: Path) -> None:
    """Roles are links or code, and each parameter has its description in a table."""
    pages = {page.stem: page.read_text("utf-8") for page in site.glob("reference/api*.html")}
    for name, page in pages.items():
        assert not re.findall(r":(?:func|class|meth|mod):|<blockquote>", page), name
    assert 'href="api-runs.html#radarsim_addon.signal.open_run"' in pages["api-blender"]
    rows = re.sub(r"<[^>]+>|\s+", " ", pages["api-antennas"])
    assert re.search(r"loss_db \S+ all losses together, L in dB", re.sub(" +", " ", rows))
    for name in ("range_m", "velocity_mps", "doppler_hz"):  # one entry of a docstring
        assert f">{name}</span></code></td>" in pages["api-detection"], name
    assert "Boltzmann constant" in pages["api-errors"]  # a comment above the name


def test_commands_and_version_are_on_the_pages(site: Path) -> None:
    commands = (site / "reference" / "commands.html").read_text("utf-8")
    for option in ("--max-reflections", "--cfar", "--target-height", "radarsim selfcheck"):
        assert option in commands, option
    cited = (ROOT / "CITATION.cff").read_text("utf-8")
    assert f"\nversion: {radarsim_addon.__version__}\n" in cited
    for page in site.rglob("*.html"):
        text = page.read_text("utf-8")
        assert f"radarsim {radarsim_addon.__version__}" in text, page.name
        assert not re.search(r"<!-- (names|summary|rooms)", text), page.name  # a mark with a slip


def test_pages_work_from_the_disk(site: Path) -> None:
    """They load nothing from elsewhere, and the search index is a script."""
    for page in site.rglob("*.html"):
        loaded = re.findall(r"<(?:script|link|img)[^>]+(?:src|href)=\"([^\"]+)", page.read_text())
        assert loaded and not [one for one in loaded if one.startswith(("http", "//"))], page.name
        assert any(one.endswith("javascripts/iframe-worker.js") for one in loaded), page.name
    index = (site / "search" / "search_index.js").read_text("utf-8")
    found = json.loads(index.partition("=")[2])["docs"]
    limits = " ".join(o["title"] for o in found if o["location"].startswith("explanation/limits"))
    for word in ("Angle of arrival", "arrays", "MIMO", "Tracking", "SAR", "RCS", "Refraction"):
        assert word in limits, word


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub makes them."""
    text = re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    titles = re.findall(r"^#+ +(.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def test_links_work_in_the_repository() -> None:
    """A reader of the plain files has no made pages."""
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), ROOT / "blend_examples" / "README.md"]
    dead, checked = [], 0
    for page in pages:
        text = re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
        for link in re.findall(r"\]\(([^)\s]+)\)", text):
            if link.startswith(("http", "mailto:")):
                continue
            checked += 1
            name, _, anchor = link.partition("#")
            target = page.parent / name if name else page
            there = target.exists() and (not anchor or anchor in anchors(target))
            if not there:
                dead.append(f"{page.relative_to(ROOT)}: {link}")
    assert checked > 200 and not dead, "\n".join(dead)


def test_made_pages_are_linked_where_the_repository_has_others(site: Path) -> None:
    index = (site / "index.html").read_text("utf-8")
    for link in ("examples.html#streetblend", "notebooks/micro_doppler.html"):
        assert f'href="{link}"' in index, link
    assert 'href="reference/commands.html"' in index.split("<main")[1].split("</main>")[0]
    tutorial = (site / "tutorials" / "first-map-python.html").read_text("utf-8")
    assert 'href="../reference/commands.html#radarsim-process"' in tutorial


def test_no_rule_hides_single_head_cells_of_a_table() -> None:
    """Others would move to the left, over the wrong columns. A head without any text may go."""
    style = re.sub(r"/\*.*?\*/", "", (ROOT / "docs/stylesheets/site.css").read_text("utf-8"))
    hidden = re.findall(r"([^{}]+)\{[^}]*display:\s*none", style)
    assert hidden and not [rule for rule in hidden if re.search(r"\bt[hd]\b[^)]*$", rule.strip())]


def test_code_of_the_pages_fits_80_columns() -> None:
    """Outputs, too; the table of benchmarks is wider."""
    pages = [ROOT / "README.md", *ROOT.glob("docs/**/*.md"), ROOT / "blend_examples" / "README.md"]
    code = {page: page.read_text("utf-8") for page in pages if page.name != "benchmarks.md"}
    fence = re.compile(r"^```(?:python|sh|json|text|(?=\n))\n(.*?)^```", re.DOTALL | re.MULTILINE)
    found = {page: "\n".join(fence.findall(text)) for page, text in code.items()}
    for page in ROOT.glob("docs/notebooks/*.ipynb"):
        cells = json.loads(page.read_text("utf-8"))["cells"]
        found[page] = "\n".join("".join(c["source"]) for c in cells if c["cell_type"] == "code")
    helps = re.findall(r"```text\n(.*?)```", commands_page(), re.DOTALL)
    assert len(helps) == 8
    found[ROOT / COMMANDS_PAGE] = "\n".join(helps)
    wide = [
        f"{page.name}: {line}"
        for page, text in found.items()
        for line in text.splitlines()
        if len(line) > 80
    ]
    assert not wide, "\n".join(wide)
