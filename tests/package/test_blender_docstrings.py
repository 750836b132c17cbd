# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface for scripts carries numpydoc sections. The source is read: no bpy here."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path

import pytest

import radarsim_addon
from radarsim_addon import blender
from tests.package.test_docstrings import _ERROR_KINDS, _entries, _sections_of

BLENDER = Path(radarsim_addon.__file__).parent / "blender"
#: Base classes whose subclasses Blender or Python build: no fields of their own to document.
_FIELDLESS = {"Protocol", "Enum", "IntEnum", "StrEnum", "IntFlag", "Exception"}

Function = ast.FunctionDef
Item = ast.FunctionDef | ast.ClassDef


def _public_items() -> dict[str, Item]:
    """All public functions and classes of the interface for scripts."""
    found = {}
    for path in sorted(BLENDER.glob("*/*.py")):
        for item in ast.parse(path.read_text("utf-8")).body:
            own = path.name == "scripting.py" and getattr(item, "name", "_")[0] != "_"
            if isinstance(item, Item) and (own or item.name in blender.__all__):
                found[item.name] = item
    return found


def _sections(item: Item) -> dict[str, str]:
    return _sections_of(inspect.cleandoc(ast.get_docstring(item) or ""))


def _parameters(function: Function) -> set[str]:
    given = function.args
    arguments = [*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg]
    return {argument.arg for argument in arguments if argument} - {"self", "cls", "_"}


def _raised(function: Function) -> set[str]:
    """Named errors that the body raises itself."""
    causes = [node.exc for node in ast.walk(function) if isinstance(node, ast.Raise)]
    names = [cause.func if isinstance(cause, ast.Call) else cause for cause in causes]
    return {name.id for name in names if isinstance(name, ast.Name)} & _ERROR_KINDS


def _gaps_of_function(function: Function) -> list[str]:
    sections = _sections(function)
    gaps = sorted(_parameters(function) - _entries(sections.get("Parameters", "")))
    returned = ast.unparse(function.returns) if function.returns else "None"
    if returned not in ("None", "Never") and not {"Returns", "Yields"} & sections.keys():
        gaps.append("Returns")
    return gaps + sorted(_raised(function) - _entries(sections.get("Raises", "")))


def _is_setting(value: ast.expr | None) -> bool:
    return isinstance(value, ast.Call) and ast.unparse(value.func).endswith("setting")


def _fields(kind: ast.ClassDef) -> set[str]:
    """Public fields of a dataclass or named tuple, else the parameters of ``__init__``.

    A field declared by ``setting(...)`` carries its label, unit and text in the declaration.
    """
    written = " ".join(ast.unparse(part) for part in (*kind.decorator_list, *kind.bases))
    if "dataclass" in written or "NamedTuple" in written:
        fields = {
            item.target.id
            for item in kind.body
            if isinstance(item, ast.AnnAssign)
            and isinstance(item.target, ast.Name)
            and not _is_setting(item.value)
        }
    else:
        fields = set()
        for item in kind.body:
            if isinstance(item, ast.FunctionDef) and item.name == "__init__":
                fields = _parameters(item)
    return {field for field in fields if not field.startswith("_")}


def _gaps_of_class(kind: ast.ClassDef) -> list[str]:
    if {ast.unparse(base) for base in kind.bases} & _FIELDLESS:
        return []
    sections = _sections(kind)
    named = _entries(sections.get("Attributes", "")) | _entries(sections.get("Parameters", ""))
    return sorted(_fields(kind) - named)


def _gaps(item: Item) -> list[str]:
    return _gaps_of_class(item) if isinstance(item, ast.ClassDef) else _gaps_of_function(item)


ITEMS = _public_items()


def test_public_names_are_documented(subtests: pytest.Subtests) -> None:
    for name in sorted(ITEMS):
        with subtests.test(name):
            gaps = _gaps(ITEMS[name])
            assert not gaps, f"{name} does not document {', '.join(gaps)}"


def test_a_gap_is_found() -> None:
    source = '''
def bare(width_m: float) -> float:
    """Return the width."""
    raise ConfigError("always")


class Plain(NamedTuple):
    """A record.

    Attributes
    ----------
    width_m
        Width [m].
    """

    width_m: float
    height_m: float
'''
    bare, plain = ast.parse(source).body
    assert isinstance(bare, Item) and isinstance(plain, Item)
    assert _gaps(bare) == ["width_m", "Returns", "ConfigError"]
    assert _gaps(plain) == ["height_m"]


def test_the_interface_for_scripts_is_read() -> None:
    assert set(blender.__all__) <= set(ITEMS)
