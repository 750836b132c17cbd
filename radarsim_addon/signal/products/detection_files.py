# SPDX-License-Identifier: GPL-3.0-or-later
"""Detections as CSV and JSON."""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path
from typing import Any

from ...atomic_files import replaced, write_json
from ..detection import Detection, Detections


def write_detections(stem: Path, found: Detections, unit: str = "dB") -> list[Path]:
    """Write ``<stem>_detections.csv`` and ``.json``, levels in `unit`; returns both."""
    table = stem.with_name(stem.name + "_detections.csv")
    names = [field.name for field in dataclasses.fields(Detection)]
    with replaced(table) as temporary, open(temporary, "w", encoding="utf-8", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(names)
        writer.writerows([getattr(target, name) for name in names] for target in found.targets)
    record = stem.with_name(stem.name + "_detections.json")
    write_json(record, detections_record(found, unit))
    return [table, record]


def detections_record(found: Detections, unit: str = "dB") -> dict[str, Any]:
    """As plain JSON; `unit` is that of levels."""
    return {
        "sign_convention": "range rate positive = receding; Doppler = -2 v / wavelength",
        "level_unit": unit,
        **dataclasses.asdict(found),
    }
