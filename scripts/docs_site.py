# SPDX-License-Identifier: GPL-3.0-or-later
"""Pages of the documentation site that are made when it is built (a hook of MkDocs).

``reference/commands.md`` is the help of every command, so that it cannot differ from the parsers;
``examples.md`` is the page of blend_examples/; notebooks become pages that link to the notebook.
`docs_api` puts public names into the pages of the Python interface. The version is on every page.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING
from unittest import mock

from radarsim_addon import __version__
from radarsim_addon.blender.plan import (
    parse_coverage_arguments,
    parse_render_arguments,
    parse_selfcheck_arguments,
)
from radarsim_addon.signal.pipeline import main
from scripts.docs_api import expand
from scripts.docs_code import images, notebook_page

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
COMMANDS_PAGE, EXAMPLES_PAGE = "reference/commands.md", "examples.md"
_BLENDER_PARSERS: dict[str, Callable[[list[str]], object]] = {
    "render": parse_render_arguments,
    "coverage": parse_coverage_arguments,
    "selfcheck": parse_selfcheck_arguments,
}
_COMMANDS = (
    "render", "coverage", "process", "info", "objects", "antennas", "merge", "selfcheck",
)  # fmt: skip
#: What a search shows first: what there is and is not; names of functions after explanations.
_BOOST = {"explanation/limits": 4, "reference/api-": 0.2}
#: Links that work in the repository, and the made page that takes their place.
_MADE = (
    (re.compile(r"\(\.\./blend_examples/README\.md"), f"({EXAMPLES_PAGE}"),
    (re.compile(r"(\([^()\s]*notebooks/\w+)\.ipynb\)"), r"\1.md)"),
    (re.compile(r"`radarsim --help`"), f"[Commands]({COMMANDS_PAGE})"),
    (
        re.compile(r"`radarsim (\w+) --help`"),
        rf"[`radarsim \1 --help`]({COMMANDS_PAGE}#radarsim-\1)",
    ),
)
#: Links from a page of ``docs`` itself to a file of the repository that is not in the site.
_OUTSIDE = re.compile(r"\[([^\]]+)\]\(\.\./([^)]+)\)")
_HEAD = """# Commands

The command `radarsim` has the subcommands below. `blender -b FILE -P scripts/render_radar.py --
OPTIONS` takes the options of `radarsim render`. [Rendering without a window](../headless.md)
explains exit codes and how runs resume.
"""


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Name the version that the pages describe."""
    config.site_name = f"radarsim {__version__}"
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the made pages to those of ``docs``."""
    from mkdocs.structure.files import File

    files.append(File.generated(config, COMMANDS_PAGE, content=commands_page()))
    examples = (ROOT / "blend_examples" / "README.md").read_text("utf-8")
    files.append(File.generated(config, EXAMPLES_PAGE, content=examples.replace("../docs/", "")))
    for notebook in sorted((ROOT / "docs" / "notebooks").glob("*.ipynb")):
        link = f"\n[Download this page as a Jupyter notebook]({notebook.name}).\n"
        text, stem = notebook.read_text("utf-8"), notebook.stem
        page = notebook_page(text, stem) + link
        files.append(File.generated(config, f"notebooks/{stem}.md", content=page))
        for number, image in enumerate(images(text)):
            name = f"notebooks/{stem}_{number}.png"
            files.append(File.generated(config, name, content=image))
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Expand marks; link made pages; name files outside of ``docs`` by their paths."""
    boost = next((one for start, one in _BOOST.items() if page.file.src_uri.startswith(start)), 1)
    page.meta["search"] = {"boost": boost}
    markdown = expand(markdown)
    up = "../" * page.file.src_uri.count("/")
    for link, made in _MADE:
        markdown = link.sub(made.replace(f"({COMMANDS_PAGE}", f"({up}{COMMANDS_PAGE}"), markdown)
    return markdown if "/" in page.file.src_uri else _OUTSIDE.sub(r"\1 (`\2`)", markdown)


def commands_page() -> str:
    """Return the page of commands, in Markdown."""
    parts = [_HEAD]
    for command in (
        "render",
        "coverage",
        "process",
        "info",
        "objects",
        "antennas",
        "merge",
        "selfcheck",
    ):
        parts.append(f"## radarsim {command}\n\n```text\n{_help_of(command)}```\n")
    return "\n".join(parts)


def _help_of(command: str) -> str:
    out = io.StringIO()
    with (
        mock.patch.dict(os.environ, {"COLUMNS": "80", "NO_COLOR": "1"}),
        contextlib.redirect_stdout(out),
        contextlib.suppress(SystemExit),
    ):
        if command in _BLENDER_PARSERS:
            _BLENDER_PARSERS[command](["--help"])
        else:
            main([command, "--help"])
    return out.getvalue()
