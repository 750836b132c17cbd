# SPDX-License-Identifier: GPL-3.0-or-later
"""The street canyon: cost of the commands `render` and `process`, stage by stage.

python -m scripts.benchmarks.canyon [--repeats 5] [--order 1 --order 2]
"""

from __future__ import annotations

import argparse
import json
import shutil
import statistics
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .clock import command_cost

_ROOT = Path(__file__).resolve().parents[2]
BLEND = _ROOT / "blend_examples" / "canyon.blend"
_RENDER = ("-m", "scripts.benchmarks.stages")
_PROCESS = ("-m", "radarsim_addon", "process")


def run_canyon(repeats: int = 5, orders: Sequence[int] = (1, 2)) -> list[dict[str, Any]]:
    """Return rows with the median and the range of each figure, for each order.

    Times are processor seconds; "render" is without Blender's start.
    """
    rows = []
    with tempfile.TemporaryDirectory(prefix="radarsim_canyon_") as name:
        folder = Path(name)
        for order in orders:
            each = [_once(folder, order) for _ in range(repeats)]
            row: dict[str, Any] = {"order": order, "repeats": repeats}
            for key in each[0]:
                values = [one[key] for one in each]
                row[key] = statistics.median(values)
                row[f"{key}_range"] = [min(values), max(values)]
            rows.append(row)
    return rows


def _once(folder: Path, order: int) -> dict[str, float]:
    run, stages = folder / "run", folder / "stages.json"
    shutil.rmtree(run, ignore_errors=True)  # else it resumes
    words: list[str | Path] = [BLEND, "--out", run, "--max-reflections", str(order)]
    render = command_cost([*_RENDER, stages, *words], _ROOT)
    found = json.loads(stages.read_text(encoding="utf-8"))
    plain = command_cost([*_PROCESS, run, "--no-plots"], _ROOT)
    pictures = command_cost([*_PROCESS, run, "--plots"], _ROOT)
    return {
        "render_s": render.cpu_s - found["start_s"],
        **found,
        "render_mib": render.peak_mib,
        "process_s": plain.cpu_s,
        "process_mib": plain.peak_mib,
        "process_pictures_s": pictures.cpu_s,
        "process_pictures_mib": pictures.peak_mib,
    }


def canyon_lines(rows: list[dict[str, Any]]) -> list[str]:
    """The rows as lines of the table."""
    keys = [key for key in rows[0] if f"{key}_range" in rows[0]]
    lines = ["", "Street canyon, 1e6 rays: processor seconds, MiB without mapped files"]
    lines.append(" " * 24 + "".join(f"{'order ' + str(row['order']):>24}" for row in rows))
    for key in keys:
        cells = [
            f"{row[key]:8.2f} ({row[key + '_range'][0]:.2f} to {row[key + '_range'][1]:.2f})"
            for row in rows
        ]
        lines.append(f"   {key:21}" + "".join(f"{cell:>28}" for cell in cells))
    return lines


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--order", type=int, action="append")
    given = parser.parse_args()
    print("\n".join(canyon_lines(run_canyon(given.repeats, given.order or (1, 2)))))


if __name__ == "__main__":
    main()
