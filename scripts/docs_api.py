# SPDX-License-Identifier: GPL-3.0-or-later
"""Docstrings for the pages of the Python interface, and lists of public names for them.

`ForReaders` (an extension of Griffe, which reads the sources for mkdocstrings) changes docstrings
to what Markdown shows: roles such as ``:func:`` become links or code, and a text in the place of a
type becomes a description. Comments that begin with ``#:`` become docstrings of the names below.

In a page, ``<!-- names: signal.maps -->`` stands for the public names of that room, each with its
docstring, and ``<!-- summary: signal.maps -->`` for a table of them that links to these docstrings.
``<!-- rooms: signal/scene signal/radar -->`` stands for a table of rooms and the first sentences of
their docstrings. Several rooms may be named in each.
"""

from __future__ import annotations

import ast
import functools
import inspect
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import griffe

from radarsim_addon import blender, errors, signal

PACKAGE = Path(signal.__file__).parents[1]
_ROLE = re.compile(r":(?:func|class|meth|mod|attr|data):`([^`]+)`")
_MARK = re.compile(r"^<!-- (names|summary|rooms): (.+) -->$", re.MULTILINE)
_SECTION = re.compile(
    r"^(Parameters|Attributes|Returns|Yields|Raises)\n-{3,}\n(.*?)(?=^\w[\w ]*\n-{3,}\n|\Z)",
    re.DOTALL | re.MULTILINE,
)
_ENTRY = re.compile(r"^(\S.*)\n((?:(?:[ \t].*)?\n)*)", re.MULTILINE)
#: Types that stand after a colon without a description.
_TYPE = re.compile(r"(ArrayLike|bpy\.types\.\w+)(, optional)?")


def public_names(place: str) -> list[str]:
    """Return the public names of ``signal.ROOM``, ``blender`` or ``errors``."""
    if place == "blender":
        return list(blender.__all__)
    if place == "errors":
        return [name for name, item in vars(errors).items() if inspect.isclass(item)]
    room = place.partition(".")[2]
    return [name for name in signal.__all__ if _rooms()[name] == room]


@functools.cache
def _rooms() -> dict[str, str]:
    """Return the room of each public name of signal: the first one that has it."""
    rooms: dict[str, str] = {}
    for part in signal._PARTS:
        for name in import_module(f"{signal.__name__}.{part}").__all__:
            rooms.setdefault(name, part)
    return rooms


def expand(markdown: str) -> str:
    """Put names, or a table of them, in the place of each mark of a page."""
    return _MARK.sub(lambda mark: _LISTS[mark[1]](mark[2].split()), markdown)


def _documented(places: list[str]) -> str:
    return "\n".join(
        f"::: radarsim_addon.{place.partition('.')[0]}.{name}\n"
        "    options: {show_root_toc_entry: true}\n"
        for place in places
        for name in public_names(place)
    )


def _summary(rooms: list[str]) -> str:
    rows = ["| name | what |", "| --- | --- |"]
    for name in (name for room in rooms for name in public_names(room)):
        first = (inspect.getdoc(getattr(signal, name)) or "").split("\n\n")[0].replace("\n", " ")
        text = plain_roles(first).replace("|", "\\|")
        rows.append(f"| [`{name}`][{signal.__name__}.{name}] | {text} |")
    return "\n".join(rows)


def _first_sentences(rooms: list[str]) -> str:
    """Read from the sources: some rooms need bpy."""
    rows = ["| room | what it does |", "| --- | --- |"]
    for room in rooms:
        source = (PACKAGE / room / "__init__.py").read_text("utf-8")
        first = (ast.get_docstring(ast.parse(source)) or "").split("\n\n")[0].replace("\n", " ")
        rows.append(f"| `{room}` | {first} |")
    return "\n".join(rows)


_LISTS = {"names": _documented, "summary": _summary, "rooms": _first_sentences}


def plain_roles(text: str) -> str:
    """Return a docstring whose roles are links to public names, and code otherwise."""

    def shown(role: re.Match[str]) -> str:
        path = role[1].lstrip("~.").removeprefix("radarsim_addon.")
        name = path.rpartition(".")[2]
        for package in (signal, blender):
            if name in package.__all__ and not path.startswith("physics."):
                return f"[`{name}`][{package.__name__}.{name}]"
        return f"`{path}`"

    return _ROLE.sub(shown, text)


def described(docstring: str) -> str:
    """Return a docstring in which each entry of a section has its text as a description.

    ``width_m : width [m]`` would be a name and a type.
    """
    return _SECTION.sub(lambda part: _described_section(part[1], part[2]), docstring + "\n")


def _described_section(title: str, body: str) -> str:
    def entry(found: re.Match[str]) -> str:
        head, below = found[1], found[2]
        name, colon, text = head.partition(" : ")
        # What is returned has a type alone where it needs no words.
        if not below.strip() and colon and not _TYPE.fullmatch(text):
            colon, below = "", f"    {text}\n"
        kind = f"{colon}{text}" if colon else ""
        names = name.split(", ") if title == "Attributes" else [name]
        return "".join(f"{one}{kind}\n{below}" for one in names)

    return f"{title}\n{'-' * len(title)}\n{_ENTRY.sub(entry, body)}\n"


class ForReaders(griffe.Extension):
    """Changes docstrings when their sources have been read."""

    def on_instance(self, *, obj: griffe.Object, agent: Any, **_: Any) -> None:
        """Change one docstring."""
        if obj.docstring is None and obj.is_attribute and isinstance(agent, griffe.Visitor):
            comment = _comment_above(agent.code, obj.lineno or 1)
            obj.docstring = griffe.Docstring(comment, parent=obj) if comment else None
        if obj.docstring is not None:
            text = described(plain_roles(obj.docstring.value))
            text = re.sub(r"::$", ":", text, flags=re.MULTILINE)
            # A quotation in Markdown.
            text = re.sub(r"((?:^>>> .*\n)+)", r"```python\n\1```\n", text, flags=re.MULTILINE)
            obj.docstring.value = text.strip()


def _comment_above(code: str, line: int) -> str:
    """Return the ``#:`` comment that ends above a line."""
    lines, found = _lines(code), []
    for text in reversed(lines[: line - 1]):
        if not text.lstrip().startswith("#:"):
            break
        found.append(text.strip().removeprefix("#:").strip())
    return "\n".join(reversed(found))


@functools.lru_cache(maxsize=1)
def _lines(code: str) -> list[str]:
    return code.splitlines()
