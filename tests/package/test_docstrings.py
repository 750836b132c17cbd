# SPDX-License-Identifier: GPL-3.0-or-later
"""What users call carries numpydoc sections: parameters, results, errors, fields."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import pkgutil
import re
import textwrap
from types import ModuleType
from typing import Any

import pytest

from radarsim_addon import errors, physics, signal
from radarsim_addon.errors import ConfigError

_ERROR_KINDS = {
    name
    for name, kind in vars(errors).items()
    if inspect.isclass(kind) and issubclass(kind, errors.RadarSimError)
}


def _defined_in(module: ModuleType) -> list[Any]:
    """Public functions and classes that a module defines itself."""
    return [
        item
        for name, item in vars(module).items()
        if not name.startswith("_")
        and (inspect.isfunction(item) or inspect.isclass(item))
        and item.__module__ == module.__name__
    ]


def _public_items() -> dict[str, Any]:
    """What users call: all of physics, and the names of the companion module."""
    found = [getattr(signal, name) for name in signal.__all__]
    for info in pkgutil.iter_modules(physics.__path__, f"{physics.__name__}."):
        found += _defined_in(importlib.import_module(info.name))
    return {
        f"{item.__module__.partition('.')[2]}.{item.__qualname__}": item
        for item in found
        if inspect.isfunction(item) or inspect.isclass(item)
    }


def _sections_of(docstring: str) -> dict[str, str]:
    """Text of each numpydoc section by its heading."""
    parts = re.split(r"^(\w[\w ]*)\n-{3,}\n", docstring, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def _sections(item: Any) -> dict[str, str]:
    return _sections_of(inspect.getdoc(item) or "")


def _entries(section: str) -> set[str]:
    """Names at the left edge of a section: ``a, b`` or ``a : type`` or ``a [n]``."""
    lines = [line for line in section.splitlines() if line and not line[0].isspace()]
    return {name for line in lines for name in re.findall(r"[A-Za-z_]\w*", line.split(":")[0])}


def _raised(function: Any) -> set[str]:
    """Named errors that the body raises itself."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    calls = [node.exc for node in ast.walk(tree) if isinstance(node, ast.Raise)]
    names = [call.func if isinstance(call, ast.Call) else call for call in calls]
    return {name.id for name in names if isinstance(name, ast.Name)} & _ERROR_KINDS


def _gaps_of_function(function: Any) -> list[str]:
    sections = _sections(function)
    signature = inspect.signature(function)
    parameters = set(signature.parameters) - {"self", "cls"}
    gaps = sorted(parameters - _entries(sections.get("Parameters", "")))
    returned = signature.return_annotation
    if returned not in ("None", None, inspect.Signature.empty) and not (
        {"Returns", "Yields"} & sections.keys()
    ):
        gaps.append("Returns")
    return gaps + sorted(_raised(function) - _entries(sections.get("Raises", "")))


def _gaps_of_class(kind: Any) -> list[str]:
    if getattr(kind, "_is_protocol", False) or issubclass(kind, Exception):
        return []
    if dataclasses.is_dataclass(kind):
        fields = {field.name for field in dataclasses.fields(kind)}
    elif issubclass(kind, tuple):
        fields = set(getattr(kind, "_fields", ()))
    elif "__init__" in vars(kind):
        fields = set(inspect.signature(kind).parameters)
    else:
        return []
    sections = _sections(kind)
    named = _entries(sections.get("Attributes", "")) | _entries(sections.get("Parameters", ""))
    return sorted(field for field in fields - named if not field.startswith("_"))


def _gaps(item: Any) -> list[str]:
    return _gaps_of_class(item) if inspect.isclass(item) else _gaps_of_function(item)


ITEMS = _public_items()


def test_public_names_are_documented(subtests: pytest.Subtests) -> None:
    for name in sorted(ITEMS):
        with subtests.test(name):
            gaps = _gaps(ITEMS[name])
            assert not gaps, f"{name} does not document {', '.join(gaps)}"


def test_physics_and_the_companion_module_are_covered() -> None:
    assert sum(name.startswith("physics.") for name in ITEMS) > 100
    assert sum(name.startswith("signal.") for name in ITEMS) > 80


def test_a_gap_is_found() -> None:
    def documented(width_m: float) -> float:
        """Return the width.

        Parameters
        ----------
        width_m
            Width [m].

        Returns
        -------
        float
            The same [m].
        """
        return width_m

    def bare(width_m: float) -> float:
        """Return the width."""
        return width_m

    def raising() -> None:
        """Raise."""
        raise ConfigError("always")

    @dataclasses.dataclass
    class Plain:
        """A record."""

        width_m: float

    assert _gaps(documented) == []
    assert _gaps(bare) == ["width_m", "Returns"]
    assert _gaps(raising) == ["ConfigError"]
    assert _gaps(Plain) == ["width_m"]
