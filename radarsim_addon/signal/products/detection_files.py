# SPDX-License-Identifier: GPL-3.0-or-later
"""Detections as CSV and JSON: ``csv``."""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path

from ...atomic_files import replaced, write_json
from ..detection import Detection, Detections
from ..maps import level_unit
from ..results import FrameResult, frame_file, result_writer


@result_writer("csv", "_detections.csv", "_detections.json")
def write_csv(result: FrameResult, folder: Path) -> list[Path]:
    """Write what CFAR found in a frame; without CFAR nothing."""
    if result.detections is None:
        return []
    unit = level_unit(result.echoes.amplitude_model)
    return write_detections(frame_file(folder, result.frame, ""), result.detections, unit)


def write_detections(stem: Path, found: Detections, unit: str = "dB") -> list[Path]:
    """Write ``_detections.csv``, one target a row, and ``_detections.json``; return both paths.

    `stem` is their path up to ``_detections``, `unit` that of levels.
    """
    table, record = (stem.with_name(f"{stem.name}_detections.{end}") for end in ("csv", "json"))
    names = [field.name for field in dataclasses.fields(Detection)]
    with replaced(table) as temporary, open(temporary, "w", encoding="utf-8", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(names)
        writer.writerows([getattr(target, name) for name in names] for target in found.targets)
    write_json(
        record,
        {
            "sign_convention": "range rate positive = receding; Doppler = -2 v / wavelength",
            "level_unit": unit,
            **dataclasses.asdict(found),
        },
    )
    return [table, record]
