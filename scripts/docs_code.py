# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the code of documentation pages and compare what it prints with what the page says.

The Python blocks of a page run one after the other, in one process and one empty folder. A ``text``
block right after a Python block is its expected output: words must be equal, numbers within 2 %
(or the last digit printed). In tutorials the commands (``sh`` blocks) run too. A block after a
comment ``<!-- not run: REASON -->`` is left out. The code cells of a Jupyter notebook run in the
same way, without a kernel; what a cell prints is compared with the output in the file, and so is
the number of its figures.

    python scripts/docs_code.py docs/tutorials/first-map-python.md           # compare
    python scripts/docs_code.py --write docs/tutorials/first-map-python.md   # write the outputs
"""

from __future__ import annotations

import argparse
import ast
import base64
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
#: Figures of notebooks: small files, for a repository.
_DPI, _COLOURS = 65, 128


@dataclass(frozen=True)
class Block:
    """Code of a page, the output that the page states, and where both stand."""

    kind: str
    code: str
    line: int
    expected: str | None
    span: tuple[int, int]
    run: bool
    figures: int = 0


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
        Block(
            "python", "".join(cell["source"]), n, _printed(cell), (n, n), True, len(_images(cell))
        )
        for n, cell in enumerate(json.loads(text)["cells"])
        if cell["cell_type"] == "code"
    ]


def _printed(cell: dict[str, Any]) -> str:
    return "".join(text for out in cell["outputs"] for text in out.get("text", ()))


def _images(cell: dict[str, Any]) -> list[bytes]:
    return [
        base64.b64decode(out["data"]["image/png"])
        for out in cell.get("outputs", ())
        if "image/png" in out.get("data", ())
    ]


def images(text: str) -> list[bytes]:
    """Return the figures of a notebook, as PNG files."""
    return [image for cell in json.loads(text)["cells"] for image in _images(cell)]


def outputs(page: Path) -> Iterator[tuple[Block, str, list[bytes]]]:
    """Run the blocks of a page in the current folder; yield what each printed, and its figures."""
    names: dict[str, Any] = {"__name__": "__main__"}
    notebook = page.suffix == ".ipynb"
    for block in (cells if notebook else blocks)(page.read_text("utf-8")):
        if not block.run:
            continue
        if block.kind == "python":
            out, figures = io.StringIO(), []
            with contextlib.redirect_stdout(out), warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # findings, also in the results
                if notebook:
                    figures = _run_cell(block.code, names)
                else:
                    exec(compile("\n" * block.line + block.code, str(page), "exec"), names)
            yield block, out.getvalue(), figures
        elif page.parent.name == "tutorials":
            lines = block.code.replace("\\\n", " ").splitlines()
            yield block, "".join(map(_command, lines)), []


def _run_cell(code: str, names: dict[str, Any]) -> list[bytes]:
    """Run a cell; return the figures that a notebook shows: its last value, and pyplot's.

    As in Jupyter, a semicolon at the end hides the last value.
    """
    tree = ast.parse(code)
    last = tree.body[-1]
    if isinstance(last, ast.Expr):
        tree.body.pop()
    exec(compile(tree, "cell", "exec"), names)
    value = None
    if isinstance(last, ast.Expr):
        value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    figures = [] if value is None or code.endswith(";") else [value]
    if pyplot := sys.modules.get("matplotlib.pyplot"):
        figures += [pyplot.figure(number) for number in pyplot.get_fignums()]
        pyplot.close("all")
    return [_png(figure) for figure in figures]


def _png(figure: Any) -> bytes:
    """Return a figure as a small PNG file; a value that is none fails."""
    from PIL import Image

    drawn, small = io.BytesIO(), io.BytesIO()
    figure.savefig(drawn, format="png", dpi=_DPI)
    image = Image.open(drawn).convert("RGB").quantize(_COLOURS, Image.Quantize.MAXCOVERAGE)
    image.save(small, "png", optimize=True)
    return small.getvalue()


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
    wrong: list[str] = []
    changes: list[tuple[tuple[int, int], str, list[bytes]]] = []
    with tempfile.TemporaryDirectory(prefix="radarsim_docs_") as folder:
        os.chdir(folder)
        try:
            for block, output, figures in outputs(page):
                if block.expected is None:
                    continue
                changes.append((block.span, output, figures))
                if (told := difference(block.expected, output)) is not None:
                    wrong.append(told)
                if block.figures != len(figures):
                    wrong.append(f"expected {block.figures} figures, found {len(figures)}")
        finally:
            os.chdir(there)
    if not write:
        return wrong
    if page.suffix == ".ipynb":
        text = _with_outputs(text, {first: (said, drawn) for (first, _), said, drawn in changes})
    else:
        for (first, last), output, _ in reversed(changes):
            text = text[:first] + output.rstrip("\n") + "\n" + text[last:]
    page.write_text(text, encoding="utf-8")
    return []


def _with_outputs(text: str, found: dict[int, tuple[str, list[bytes]]]) -> str:
    """Return a notebook with what its cells printed and drew, by their numbers."""
    notebook = json.loads(text)
    for count, (number, (printed, figures)) in enumerate(found.items(), 1):
        stream = {"name": "stdout", "output_type": "stream", "text": printed.splitlines(True)}
        pictures = [
            {
                "data": {"image/png": base64.b64encode(figure).decode()},
                "metadata": {},
                "output_type": "display_data",
            }
            for figure in figures
        ]
        cell = notebook["cells"][number]
        cell["outputs"] = [*([stream] if printed else []), *pictures]
        cell["execution_count"] = count
    return json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"


def notebook_page(text: str, name: str) -> str:
    """Return a notebook as Markdown, with its figures in files NAME_0.png, NAME_1.png, ..."""
    parts, drawn = [], 0
    for cell in json.loads(text)["cells"]:
        source = "".join(cell["source"])
        if "colab" in cell["metadata"].get("tags", ()):
            continue  # it installs radarsim, which readers of the site do otherwise
        source = re.sub(r"\]\((\w+)\.ipynb\)", r"](\1.md)", source)
        if cell["cell_type"] == "code":
            source = f"```python\n{source}\n```"
            if printed := _printed(cell):
                source += f"\n\n```text\n{printed.rstrip()}\n```"
            for _ in _images(cell):
                source += f"\n\n![Figure of the cell above]({name}_{drawn}.png)"
                drawn += 1
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
