# SPDX-License-Identifier: GPL-3.0-or-later
"""JSON files read as dataclasses: every value is checked, and errors name its place.

Settings and records of other programs come through here. Nothing behind it needs to check a type,
or whether a number is finite. Never more of a file is read than expected. Records of the contract
are written with a digest of their fields (`write_record`), under a temporary name that is renamed,
so that a killed run leaves no half record. Standard library only.
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
import hashlib
import json
import math
import typing
from collections.abc import Callable
from dataclasses import MISSING
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from . import contract
from .atomic_files import TextTooLongError, read_text, record_fields, write_json
from .errors import ConfigError, FrameFileError, SchemaError
from .findings import Finding
from .findings import from_json as finding_from_json
from .options import MAX_LENGTH_M, Declared, Setting, declared, value_type

# -- any dataclass ---------------------------------------------------------------------------------

Record = TypeVar("Record")

_EXPECTED = {float: "finite number", int: "whole number", str: "text", bool: "true or false"}


def read_json(path: Path, most_bytes: int, remedy: str, error: type[Exception]) -> dict[str, Any]:
    """Read a JSON object of at most `most_bytes`; errors of the class `error` end with `remedy`."""
    try:
        data = json.loads(read_text(path, most_bytes), parse_constant=_not_finite)
    except FileNotFoundError as wrong:
        raise error(f"{path} is missing. {remedy}") from wrong
    except TextTooLongError as wrong:
        raise error(
            f"{path} holds more than {most_bytes} bytes, which no such file does. {remedy}"
        ) from wrong
    except OSError as wrong:
        raise error(
            f"{path} cannot be read: {wrong.strerror or wrong}. Check its name and permissions."
        ) from wrong
    except (ValueError, RecursionError, MemoryError) as wrong:
        raise error(f"{path} cannot be read as JSON ({wrong}). {remedy}") from wrong
    if not isinstance(data, dict):
        raise error(f"{path} holds a {type(data).__name__}; expected a JSON object. {remedy}")
    return data


def from_json(
    kind: type[Record],
    data: object,
    where: str,
    error: type[Exception] = ConfigError,
    *,
    unknown: typing.Literal["refuse", "ignore"] = "refuse",
    limits: Callable[[str], Setting] | None = None,
) -> Record:
    """Make a dataclass instance from parsed JSON.

    Errors of the class `error` begin with `where`. Records ignore unknown fields: later versions
    may add some. `limits` bounds numbers that are no settings, by the names of their fields.
    """
    reader = _Reader(error, unknown == "refuse", limits)
    return typing.cast(Record, reader.record(kind, data, where))


@dataclasses.dataclass(frozen=True)
class _Reader:
    """Errors' class, whether unknown fields are refused, and bounds by names of fields."""

    error: type[Exception]
    strict: bool
    limits: Callable[[str], Setting] | None

    def record(self, kind: type, data: object, where: str) -> Any:
        """Make an instance of a dataclass."""
        if not isinstance(data, dict):
            raise self.error(f"{where} is {data!r:.60}; expected a JSON object with its fields.")
        fields, known = _fields(kind), _known(kind, self.limits)
        values: dict[str, Any] = {}
        for key, value in data.items():
            if key in fields:
                hint, plain, setting = known[key]
                if type(value) is plain and _fits(value, setting):
                    values[key] = value
                else:
                    values[key] = self._value(hint, value, f"{where}: {key}", setting)
            elif self.strict:
                near = difflib.get_close_matches(key[:60], fields, 1)
                guess = f" Do you mean {near[0]!r}?" if near else ""
                raise self.error(
                    f"{where} has the unknown field {key!r:.60}; its fields are "
                    f"{', '.join(fields)} (SI units).{guess}"
                )
        lacking = [
            name
            for name, item in fields.items()
            if name not in values and item.default is MISSING and item.default_factory is MISSING
        ]
        if lacking:
            raise self.error(
                f"{where} lacks {', '.join(lacking)}; its fields are {', '.join(fields)}."
            )
        try:
            return kind(**values)
        except ValueError as wrong:
            raise self.error(f"{where}: {wrong}") from wrong

    def _value(self, hint: object, value: Any, where: str, setting: Declared | None = None) -> Any:
        """Convert a value to its annotated type."""
        kind, optional, origin, inner = _parts(hint)
        if value is None and optional:
            return None
        if kind is Finding:
            return finding_from_json(value, where)
        if dataclasses.is_dataclass(kind):
            return self.record(typing.cast(type, kind), value, where)
        if origin is dict or kind is dict:
            if not isinstance(value, dict):
                self._refuse(value, where, "a JSON object")
            return {
                k: self._value(inner[1], v, f"{where}: {k:.60}", setting) for k, v in value.items()
            }
        if origin is list:
            if not isinstance(value, list):
                self._refuse(value, where, "a list")
            plain = inner[0]
            if plain is float and all(type(x) is plain and _fits(x, setting) for x in value):
                return value
            items = [
                self._value(inner[0], v, f"{where}[{i}]", setting) for i, v in enumerate(value)
            ]
            if typing.get_origin(inner[0]) is list and len({len(row) for row in items}) > 1:
                self._refuse(value, where, "rows of one length")
            return items
        if origin is tuple and isinstance(value, list):
            value = tuple(value)
        elif kind is float and type(value) is int:
            value = float(value) if value.bit_length() < 1024 else math.inf
        elif kind is int and type(value) is float and value.is_integer():
            value = int(value)  # JSON of other programs writes 128.0 for 128
        if setting is not None:
            try:
                setting.check(value)
            except ConfigError as wrong:
                raise self.error(f"{where}: {wrong}") from wrong
        elif kind in _EXPECTED and (
            type(value) is not kind or (kind is float and not math.isfinite(value))
        ):
            article = "a " if kind in (float, int) else ""
            self._refuse(value, where, article + _EXPECTED[kind])
        return value

    def _refuse(self, value: object, where: str, expected: str) -> NoReturn:
        raise self.error(f"{where} is {value!r:.60}; expected {expected}.")


@functools.cache
def _fields(kind: type) -> dict[str, dataclasses.Field[Any]]:
    """Return fields of a dataclass by name."""
    return {item.name: item for item in dataclasses.fields(kind)}


@functools.cache
def _known(
    kind: type, limits: Callable[[str], Setting] | None
) -> dict[str, tuple[Any, Any, Declared | None]]:
    """Return, for each field of a dataclass, the annotation, the type of plain values (None for
    others), and the bounds.

    Few values of a file are anything else.
    """
    settings = declared(kind)
    return {
        name: (
            hint,
            plain if (plain := _parts(hint)[0]) in _EXPECTED else None,
            settings.get(name) or _limited(limits, name, hint),
        )
        for name, hint in typing.get_type_hints(kind).items()
    }


def _fits(value: object, setting: Declared | None) -> bool:
    """Return True if a plain value of the right type is within its bounds."""
    if setting is not None:
        return setting.fits(value)
    return type(value) is not float or math.isfinite(value)


@functools.cache
def _parts(hint: object) -> tuple[Any, bool, Any, tuple[Any, ...]]:
    """Return the kind of the values, True if None is one of them, and the parts of the kind."""
    kind, optional = value_type(hint)
    return kind, optional, typing.get_origin(kind), typing.get_args(kind)


@functools.cache
def _limited(limits: Callable[[str], Setting] | None, name: str, hint: object) -> Declared | None:
    """Return the bounds of the numbers in a field that is no setting."""
    kind, optional, origin, inner = _parts(hint)
    while origin in (list, dict):
        kind, optional, origin, inner = _parts(inner[-1])
    if limits is None or kind not in (int, float):
        return None
    return Declared(name, kind, optional, MISSING, limits(name))


def _not_finite(text: str) -> NoReturn:
    raise ValueError(f"it holds {text}; expected finite numbers")


# -- records of the contract -----------------------------------------------------------------------

#: A record of a run with ten thousand frames stays far below this.
_MAX_JSON_BYTES = 64 * 1024 * 1024

_POSES = ("matrix_world", "pose", "translation", "rotation_centre")
_POSITIVE: dict[str, Any] = {"above": 0.0, "maximum": MAX_LENGTH_M}
_COUNT: dict[str, Any] = {"minimum": 1, "maximum": 1 << 22}
_FRAME: dict[str, Any] = {"minimum": -(1 << 20), "maximum": 1 << 20}
#: Bounds by the names of fields, which mean the same in all records.
_LIMITS: dict[str, dict[str, Any]] = {
    "frame": _FRAME,
    "frames": _FRAME,
    "rings": {"minimum": 1, "maximum": contract.MAX_RINGS},
    "ring_step_m": _POSITIVE,
    "snapshots": {"minimum": 1, "maximum": 2},
    "width_px": _COUNT,
    "height_px": _COUNT,
    "visibility_updates": _COUNT,
    "replicates": {"minimum": 1, "maximum": 1 << 16},
    "path_count": {"minimum": 0, "maximum": 1 << 40},
    "metres_per_unit": _POSITIVE,
    "range_encoding_length_m": _POSITIVE,
    "carrier_hz": {"above": 0.0, "maximum": 1e13},
    "near_clip_m": {"minimum": 0.0, "maximum": MAX_LENGTH_M},
    "duration_s": {"minimum": 0.0},
}

#: Name of the digest in a JSON file.
_DIGEST = "record_sha256"

FrameRecord = contract.RenderRecord | contract.PathsRecord | contract.GroundTruthRecord


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file, as hexadecimal digits."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def write_record(path: Path, record: object, sync: bool = True) -> None:
    """Write a record as JSON; it appears whole or not at all.

    Records of frames get a digest of their fields. Without `sync` it may be lost, or damaged, by a
    power failure.
    """
    of_frame = isinstance(record, FrameRecord)
    write_json(path, with_digest(vars(record)) if of_frame else record, sync)


def with_digest(fields: dict[str, Any]) -> dict[str, Any]:
    """Return fields of a JSON file and the digest by which `check_digest` finds changes."""
    text = json.dumps(fields, sort_keys=True, default=record_fields)
    return {**fields, _DIGEST: hashlib.sha256(text.encode()).hexdigest()}


def check_digest(path: Path) -> dict[str, Any]:
    """Return the fields of a JSON file that match the digest in it.

    Empty for files without a digest, such as those of older versions. SchemaError: they differ.
    """
    remedy = "Remove it, and render or process this part again."
    fields = read_json(path, _MAX_JSON_BYTES, remedy, FrameFileError)
    digest = fields.pop(_DIGEST, None)
    if digest is None:
        return {}
    found = with_digest(fields)[_DIGEST]
    if found != digest:
        raise SchemaError(
            f"{path} was changed after it was written: SHA-256 of its fields {found[:12]}..., "
            f"expected {digest!s:.12}... {remedy}"
        )
    return fields


def read_record(path: Path, kind: type[Record]) -> Record:
    """Read and check one record.

    SchemaError: it is of another kind, or of a newer schema than this version reads.
    FrameFileError: anything else is wrong.
    """
    belonging = {contract.RenderRecord: " and its EXR", contract.PathsRecord: " and its table"}
    remedy = (
        "Give the run's own folder, or remove what is left of the file"
        f"{belonging.get(kind, '')} and render the run again."
    )
    data = read_json(path, _MAX_JSON_BYTES, remedy, FrameFileError)
    expected = next(f.default for f in dataclasses.fields(kind) if f.name == "schema")  # type: ignore[arg-type]
    if data.get("schema") != expected:
        raise SchemaError(
            f"{path} has schema {data.get('schema')!r:.60}; expected {expected!r}. "
            "Give a file that radarsim wrote."
        )
    version = data.get("schema_version")
    if type(version) is not int or version < 1:
        raise SchemaError(
            f"{path} has schema_version {version!r:.60}; expected a whole number from 1."
        )
    if version > contract.SCHEMA_VERSION:
        raise SchemaError(
            f"{path} has schema version {version!r:.60}; this radarsim reads up to "
            f"{contract.SCHEMA_VERSION}. Update radarsim to process this run."
        )
    return from_json(kind, data, str(path), FrameFileError, unknown="ignore", limits=_limit)


def check_run(
    path: Path,
    record: FrameRecord,
    fingerprint: str,
) -> None:
    """Raise a SchemaError where a frame's record is of a run with another fingerprint.

    Records of older versions name no run, and an empty fingerprint fits all.
    """
    found = record.run_fingerprint
    if found and fingerprint and found != fingerprint:
        raise SchemaError(
            f"{path}: frame {record.frame} belongs to another run (fingerprint {found[:12]}..., "
            f"expected {fingerprint[:12]}...). It was copied into this folder: remove the frame's "
            "folder and render this run again."
        )


def _limit(name: str) -> Setting:
    """Return bounds of the numbers in a field, of any record."""
    if name in _LIMITS:
        return Setting(name, "", **_LIMITS[name])
    most = MAX_LENGTH_M if name.endswith("_m") or name in _POSES else None
    return Setting(name, "", minimum=most and -most, maximum=most)
