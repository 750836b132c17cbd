# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading and writing the JSON records of :mod:`radarsim_addon.contract`. Pure standard library.

Files are written under a temporary name and renamed, so that a killed run leaves no half record;
they are read with a size limit, and every field is checked before it is used.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import types
import typing
from pathlib import Path
from typing import Any, TypeVar

from . import contract
from .atomic_files import write_json
from .errors import FrameFileError, SchemaError
from .findings import Finding, from_json
from .old_names import todays_names
from .textfile import TextTooLongError, read_text

#: A record of a run with ten thousand frames stays far below this.
MAX_JSON_BYTES = 64 * 1024 * 1024

Record = TypeVar("Record")


def file_sha256(path: Path) -> str:
    """SHA-256 of a file, as hexadecimal digits."""
    digest = hashlib.sha256()
    with open(path, "rb") as stream:
        for block in iter(lambda: stream.read(1 << 20), b""):
            digest.update(block)
    return digest.hexdigest()


def write_record(path: Path, record: Any) -> None:
    """Write a record as JSON; it appears whole or not at all.

    Raises
    ------
    OutputError
        The folder is missing, read-only or full.
    """
    write_json(path, dataclasses.asdict(record))


def read_record(path: Path, kind: type[Record]) -> Record:
    """Read and check one record.

    Raises
    ------
    FrameFileError
        The file is missing, larger than `MAX_JSON_BYTES`, not JSON, or lacks a field.
    SchemaError
        The record is of another kind, or of a newer schema than this version reads.
    """
    try:
        data = json.loads(read_text(path, MAX_JSON_BYTES))
    except FileNotFoundError as error:
        raise FrameFileError(
            f"{path} is missing. radarsim writes it beside the frames: "
            "give the run's own folder, or render the run again."
        ) from error
    except TextTooLongError as error:
        raise FrameFileError(
            f"{path} holds more than {MAX_JSON_BYTES} bytes, which no radarsim record does. "
            "It was not written by radarsim: remove it."
        ) from error
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise FrameFileError(
            f"{path} cannot be read as JSON ({error}). Remove it{_belonging(kind)}, and render the "
            "run again."
        ) from error
    if not isinstance(data, dict):
        raise FrameFileError(f"{path} holds a {type(data).__name__}; expected a JSON object.")
    expected = next(f.default for f in dataclasses.fields(kind) if f.name == "schema")  # type: ignore[arg-type]
    if data.get("schema") != expected:
        raise SchemaError(
            f"{path} has schema {data.get('schema')!r}; expected {expected!r}. "
            "Give a file that radarsim wrote."
        )
    version = data.get("schema_version")
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        raise SchemaError(f"{path} has schema_version {version!r}; expected a whole number from 1.")
    if version > contract.SCHEMA_VERSION:
        raise SchemaError(
            f"{path} has schema version {version}; this radarsim reads up to "
            f"{contract.SCHEMA_VERSION}. Update radarsim to process this run."
        )
    return typing.cast(Record, _build(kind, data, str(path)))


def _belonging(kind: Any) -> str:
    """What must go with a damaged record, so that it is rendered again."""
    others = {contract.RenderRecord: " and its EXR", contract.PathsRecord: " and its table"}
    return others.get(kind, "")


def _build(kind: Any, value: Any, where: str) -> Any:
    """Turn parsed JSON into the annotated type, naming the place of what does not fit."""
    origin = typing.get_origin(kind)
    if kind is Finding:
        return from_json(value, where)
    if dataclasses.is_dataclass(kind):
        if not isinstance(value, dict):
            raise FrameFileError(f"{where} is {value!r:.60}; expected a JSON object.")
        hints = typing.get_type_hints(kind)
        value = todays_names(value, hints)
        arguments = {}
        for item in dataclasses.fields(kind):
            if item.name in value:
                arguments[item.name] = _build(
                    hints[item.name], value[item.name], f"{where}: {item.name}"
                )
            elif (
                item.default is dataclasses.MISSING and item.default_factory is dataclasses.MISSING
            ):
                raise FrameFileError(
                    f"{where} lacks the field {item.name!r}. It was not written by this version "
                    "of radarsim, or was edited: render the run again."
                )
        return kind(**arguments)  # type: ignore[operator]
    if origin in (types.UnionType, typing.Union):
        if value is None:
            return None
        return _build(next(a for a in typing.get_args(kind) if a is not type(None)), value, where)
    if origin is list:
        if not isinstance(value, list):
            raise FrameFileError(f"{where} is {value!r:.60}; expected a list.")
        (inner,) = typing.get_args(kind)
        return [_build(inner, item, f"{where}[{i}]") for i, item in enumerate(value)]
    if origin is dict:
        if not isinstance(value, dict):
            raise FrameFileError(f"{where} is {value!r:.60}; expected a JSON object.")
        inner = typing.get_args(kind)[1]
        return {key: _build(inner, item, f"{where}: {key}") for key, item in value.items()}
    if kind is float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise FrameFileError(f"{where} is {value!r:.60}; expected a number.")
        if not math.isfinite(value):
            raise FrameFileError(f"{where} is {value!r}; expected a finite number.")
        return float(value)
    if kind is int and (isinstance(value, bool) or not isinstance(value, int)):
        raise FrameFileError(f"{where} is {value!r:.60}; expected a whole number.")
    if kind is str and not isinstance(value, str):
        raise FrameFileError(f"{where} is {value!r:.60}; expected text.")
    return value
