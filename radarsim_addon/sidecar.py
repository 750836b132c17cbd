# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading and writing the JSON records of :mod:`radarsim_addon.contract`. Pure standard library.

Files are written under a temporary name and renamed, so that a killed run leaves no half record;
they are read with a size limit, and every field is checked before it is used.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from pathlib import Path
from typing import Any, TypeVar

from . import contract
from .atomic_files import record_fields, write_json
from .errors import FrameFileError, SchemaError
from .options import MAX_LENGTH_M, Setting
from .typed_json import from_json, read_json

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

Record = TypeVar("Record")
FrameRecord = contract.RenderRecord | contract.PathsRecord | contract.GroundTruthRecord


def file_sha256(path: Path) -> str:
    """SHA-256 of a file, as hexadecimal digits."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def write_record(path: Path, record: Any, sync: bool = True) -> None:
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
    """Bounds of the numbers in a field, of any record."""
    if name in _LIMITS:
        return Setting(name, "", **_LIMITS[name])
    most = MAX_LENGTH_M if name.endswith("_m") or name in _POSES else None
    return Setting(name, "", minimum=most and -most, maximum=most)
