# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the code of documentation pages and compare what it prints with what the page says.

The Python blocks of a page run one after the other, in one process and one empty folder. A ``text``
block right after a Python block is its expected output: words must be equal, numbers within 2 %
(or the last digit printed). In tutorials the commands (``sh`` blocks) run too. A block after a
comment ``<!-- not run: REASON -->`` is left out. The code cells of a Jupyter notebook run in the
same way, without a kernel; what a cell prints is compared with the output in the file.

    python scripts/docs_code.py docs/tutorials/first-map-python.md           # compare
    python scripts/docs_code.py --write docs/tutorials/first-map-python.md   # write the outputs
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
_FENCE = re.compile(
    r"(?P<skip><!-- not run: [^>]*-->\s*)?^```(?P<kind>python|sh)\n(?P<code>.*?)^```\n"
    r"(?:\n```text\n(?P<expected>.*?)^```\n)?",
    re.DOTALL | re.MULTILINE,
)
_NUMBER = re.compile(r"[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
RELATIVE = 0.02


@dataclass(frozen=True)
class Block:
    """Code of a page, the output that the page states, and where both stand."""

    kind: str
    code: str
    line: int
    expected: str | None
    span: tuple[int, int]
    run: bool


def blocks(text: str) -> list[Block]:
    """Return the Python and shell blocks of a page."""
    return [
        Block(
            m["kind"],
            m["code"],
            text.count("\n", 0, m.start("code")),
            m["expected"],
            m.span("expected"),
            m["skip"] is None,
        )
        for m in _FENCE.finditer(text)
    ]


def cells(text: str) -> list[Block]:
    """Return the code cells of a notebook; `line` and `span` hold the number of the cell."""
    return [
        Block("python", "".join(cell["source"]), n, _printed(cell), (n, n), run=True)
        for n, cell in enumerate(json.loads(text)["cells"])
        if cell["cell_type"] == "code"
    ]


def _printed(cell: dict[str, Any]) -> str:
    return "".join(text for out in cell["outputs"] for text in out.get("text", ()))


def outputs(page: Path) -> Iterator[tuple[Block, str]]:
    """Run the blocks of a page in the current folder; yield each with what it printed."""
    names: dict[str, Any] = {"__name__": "__main__"}
    find = cells if page.suffix == ".ipynb" else blocks
    for block in find(page.read_text("utf-8")):
        if not block.run:
            continue
        if block.kind == "python":
            out = io.StringIO()
            with contextlib.redirect_stdout(out), warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # findings, also in the results
                exec(compile("\n" * block.line + block.code, str(page), "exec"), names)
            yield block, out.getvalue()
        elif page.parent.name == "tutorials":
            lines = block.code.replace("\\\n", " ").splitlines()
            yield block, "".join(map(_command, lines))


def _command(line: str) -> str:
    words = shlex.split(line, comments=True)
    if words[:1] != ["radarsim"]:
        return ""
    done = subprocess.run(
        [sys.executable, "-m", "radarsim_addon", *words[1:]],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"{line}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def difference(expected: str, found: str) -> str | None:
    """Return the first line that differs, expected and found; None if all agree."""
    wanted, got = expected.splitlines(), found.splitlines()
    for line, other in zip(wanted, got, strict=False):
        if not _alike(line, other):
            return f"expected {line!r}, found {other!r}"
    if len(wanted) != len(got):
        return f"expected {len(wanted)} lines, found {len(got)}"
    return None


def _alike(line: str, other: str) -> bool:
    if _NUMBER.sub("#", line).split() != _NUMBER.sub("#", other).split():
        return False
    pairs = zip(_NUMBER.findall(line), _NUMBER.findall(other), strict=True)
    return all(abs(float(a) - float(b)) <= _tolerance(a) for a, b in pairs)


def _tolerance(number: str) -> float:
    decimals = len(number.partition(".")[2].partition("e")[0])
    return max(RELATIVE * abs(float(number)), 1.01 * 10.0**-decimals)


def run(page: Path, write: bool = False) -> list[str]:
    """Run a page in a folder of its own; return what differs, or write the outputs into it."""
    text, there = page.read_text("utf-8"), Path.cwd()
    wrong, changes = [], []
    with tempfile.TemporaryDirectory(prefix="radarsim_docs_") as folder:
        os.chdir(folder)
        try:
            for block, output in outputs(page):
                if block.expected is None:
                    continue
                changes.append((block.span, output))
                if (told := difference(block.expected, output)) is not None:
                    wrong.append(told)
        finally:
            os.chdir(there)
    if not write:
        return wrong
    if page.suffix == ".ipynb":
        text = _with_outputs(text, {first: output for (first, _), output in changes})
    else:
        for (first, last), output in reversed(changes):
            text = text[:first] + output.rstrip("\n") + "\n" + text[last:]
    page.write_text(text, encoding="utf-8")
    return []


def _with_outputs(text: str, printed: dict[int, str]) -> str:
    """Return a notebook with what its cells printed, by their numbers, and no other output."""
    notebook = json.loads(text)
    for number, output in printed.items():
        stream = {"name": "stdout", "output_type": "stream", "text": output.splitlines(True)}
        notebook["cells"][number]["outputs"] = [stream] if output else []
    return json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"


def notebook_page(text: str) -> str:
    """Return a notebook as Markdown."""
    parts = []
    for cell in json.loads(text)["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "code":
            source = f"```python\n{source}\n```"
            if printed := _printed(cell):
                source += f"\n\n```text\n{printed.rstrip()}\n```"
        parts.append(source)
    return "\n\n".join(parts) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="write the outputs into the pages")
    parser.add_argument("pages", type=Path, nargs="+")
    chosen = parser.parse_args()
    wrong = {page: run(page.absolute(), chosen.write) for page in chosen.pages}
    for page, told in wrong.items():
        print(f"{page}: " + ("; ".join(told) or ("written" if chosen.write else "as stated")))
    return int(any(wrong.values()))


if __name__ == "__main__":
    sys.exit(main())
