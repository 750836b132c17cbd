# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings in JSON files: dataclasses from parsed JSON, with errors that name the place."""

from __future__ import annotations

import dataclasses
import difflib
import typing
from dataclasses import MISSING
from typing import Any, TypeVar

from .errors import ConfigError
from .old_names import todays_name
from .options import Declared, Setting, declared, value_type

Record = TypeVar("Record")


def from_json(kind: type[Record], data: Any, where: str, error: type[Exception] = ConfigError
              ) -> Record:  # fmt: skip
    """Make a dataclass instance from parsed JSON.

    Parameters
    ----------
    kind
        Dataclass.
    data
        Fields by name; names of former versions are read too.
    where
        File and place, for messages.
    error
        Class of the errors about the JSON itself.

    Raises
    ------
    ConfigError
        A field is unknown or missing, a value has the wrong type or is out of bounds. The message
        names the place, what was found and what was expected.
    """
    if not isinstance(data, dict):
        raise error(f"{where} is {data!r:.60}; expected a JSON object with its fields.")
    fields = {item.name: item for item in dataclasses.fields(typing.cast(Any, kind))}
    settings, hints = declared(kind), typing.get_type_hints(kind)
    values: dict[str, Any] = {}
    for key, value in data.items():
        name = todays_name(key, fields)
        if name not in fields:
            near = difflib.get_close_matches(key, fields, 1)
            guess = f" Do you mean {near[0]!r}?" if near else ""
            raise error(
                f"{where} has the unknown field {key!r}; its fields are {', '.join(fields)} "
                f"(SI units).{guess}"
            )
        values[name] = _from_json(hints[name], value, f"{where}: {key}", error)
        item = settings.get(name) or Declared(
            name, *value_type(hints[name]), MISSING, Setting(name, "")
        )
        _check_at(f"{where}: {key}", item, values[name], error)
    lacking = [
        name
        for name, item in fields.items()
        if name not in values and item.default is MISSING and item.default_factory is MISSING
    ]
    if lacking:
        raise error(f"{where} lacks {', '.join(lacking)}; its fields are {', '.join(fields)}.")
    return kind(**values)


def _check_at(where: str, item: Declared, value: Any, error: type[Exception]) -> None:
    try:
        item.check(value)
    except ConfigError as wrong:
        raise error(f"{where}: {wrong}") from wrong


def _from_json(hint: Any, value: Any, where: str, error: type[Exception]) -> Any:
    """A JSON value as its annotated type, as far as JSON writes that type otherwise."""
    kind, optional = value_type(hint)
    if value is None and optional:
        return None
    if dataclasses.is_dataclass(kind):
        return from_json(typing.cast(Any, kind), value, where, error)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if kind is float and number:
        return float(value)
    if kind is int and isinstance(value, float) and value.is_integer():
        return int(value)  # JSON of other programs writes 128.0 for 128
    if typing.get_origin(kind) is tuple and isinstance(value, list):
        return tuple(value)
    if (kind is dict or typing.get_origin(kind) is dict) and not isinstance(value, dict):
        raise error(f"{where} is {value!r:.60}; expected a JSON object.")
    return value
