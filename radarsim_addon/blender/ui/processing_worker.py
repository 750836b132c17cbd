# SPDX-License-Identifier: GPL-3.0-or-later
"""Processing of a run for the window, in a process of its own. Does not import bpy.

    python -m radarsim_addon.blender.ui.processing_worker RUN PICTURES

writes one JSON record per line: progress, results of frames, an error. The pictures of the last
frame are in the second folder, as arrays.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import RadarSimError
from ...findings import to_json
from .pictures import draw_map, draw_profile

MAP_FILE, PROFILE_FILE = "map.npy", "profile.npy"


def processing_records(folder: Path, pictures: Path) -> Iterator[dict[str, Any]]:
    """Process a run step by step; draw the pictures of each frame over those before."""
    from ...signal.pipeline import ProcessOptions, process_run  # slow: not for `add-on enabled`

    for event in process_run(folder, ProcessOptions(plots=False)):
        if hasattr(event, "rd_map"):
            yield _frame_record(event, pictures)
        else:
            yield {"fraction": event.done / max(event.total, 1), "text": event.text}


def _frame_record(result: Any, pictures: Path) -> dict[str, Any]:
    title = f"frame {result.frame}, t = {result.time_s:.4g} s"
    unit = "dBW" if result.echoes.amplitude_model == "radar-equation" else "dB"
    shown, profile = result.rd_map, result.profile
    picture = draw_map(
        shown.range_m,
        shown.doppler_hz,
        shown.power_db[0],
        shown.radar.waveform.wavelength_m,
        f"Range-Doppler map, {title}",
        unit,
    )
    np.save(pictures / MAP_FILE, picture)
    picture = draw_profile(profile.range_m, profile.power, f"Range profile, {title}", unit)
    np.save(pictures / PROFILE_FILE, picture)
    text = f"Frame {result.frame}: {len(result.files)} files"
    if result.files:
        text += f" in {result.files[0].parent}"
    findings = [to_json(item) for item in result.findings]
    return {"frame": result.frame, "text": text, "findings": findings}


def main(words: list[str]) -> int:
    """Write the records of a run to standard output; return the exit code."""
    try:
        for record in processing_records(*map(Path, words)):
            print(json.dumps(record), flush=True)
    except RadarSimError as error:
        print(json.dumps({"error": str(error), "kind": type(error).__name__}), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
