# SPDX-License-Identifier: GPL-3.0-or-later
"""Processing of a run for the window, in a process of its own. Does not import bpy.

    python -m radarsim_addon.blender.ui.processing_worker RUN VIEWS [OPTION ...]

writes one JSON record per line: progress, results of frames, an error. What the window shows of
each frame goes into the folder VIEWS. OPTIONs are those of `radarsim process`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ...errors import RadarSimError
from ...findings import to_json
from .frame_views import write_view


def processing_records(folder: Path, views: Path, words: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Process a run step by step; write what the window shows of each frame.

    words: options of `radarsim process`.
    """
    # slow: not for `add-on enabled`
    from ...signal.pipeline import parse_process_arguments, process_options, process_run

    chosen = parse_process_arguments(["process", str(folder), "--no-plots", *words])
    for event in process_run(folder, process_options(chosen)):
        if hasattr(event, "rd_map"):
            write_view(event, views)
            yield _frame_record(event)
        else:
            yield {"fraction": event.done / max(event.total, 1), "text": event.text}


def _frame_record(result: Any) -> dict[str, Any]:
    text = f"Frame {result.frame}: {len(result.files)} files"
    if result.files:
        text += f" in {result.files[0].parent}"
    findings = [to_json(item) for item in result.findings]
    return {"frame": result.frame, "text": text, "findings": findings}


def main(words: list[str]) -> int:
    """Write the records of a run to standard output; return the exit code."""
    try:
        for record in processing_records(Path(words[0]), Path(words[1]), words[2:]):
            print(json.dumps(record), flush=True)
    except RadarSimError as error:
        print(json.dumps({"error": str(error), "kind": type(error).__name__}), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
