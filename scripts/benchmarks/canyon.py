# SPDX-License-Identifier: GPL-3.0-or-later
"""The street canyon: cost of the commands `render` and `process`, and error of the power.

python -m scripts.benchmarks.canyon [--repeats 5] [--order 1 --order 2]
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from radarsim_addon.contract import PATHS_FILE, PathsRecord, frame_dir
from radarsim_addon.signal.paths.table import open_table
from radarsim_addon.typed_json import read_record

from .stages import process_cost, render_cost

BLEND = Path(__file__).resolve().parents[2] / "blend_examples" / "canyon.blend"
#: Rays of the two measurements of the error, and replicates of the second one.
_RAYS, _REPLICATES = (1414, 707), 8


def run_canyon(repeats: int = 5, orders: Sequence[int] = (1, 2)) -> list[dict[str, Any]]:
    """Return a row for each order: median and range of each figure [s of processor, MiB]."""
    rows = []
    with tempfile.TemporaryDirectory(prefix="radarsim_canyon_") as name:
        for order in orders:
            each = [_once(Path(name), order) for _ in range(repeats)]
            row: dict[str, Any] = {"order": order, "repeats": repeats}
            for key in each[0]:
                values = [one[key] for one in each]
                row[key] = statistics.median(values)
                row[f"{key}_range"] = [min(values), max(values)]
            rows.append(row)
    return rows


def _once(folder: Path, order: int) -> dict[str, float]:
    run = folder / "run"
    render = render_cost(BLEND, run, "--max-reflections", order)
    plain, pictures = process_cost(run, "--no-plots"), process_cost(run, "--plots")
    stages = ("render_s", "start_s", "preparation_s", "cycles_s", "rest_s", "renders")
    return {
        **{key: render[key] for key in stages},
        "render_mib": render["peak_mib"],
        "process_s": plain["process_s"],
        "process_mib": plain["peak_mib"],
        "process_pictures_s": pictures["process_s"],
        "process_pictures_mib": pictures["peak_mib"],
    }


def run_canyon_error(quick: bool = False) -> dict[str, float]:
    """Return the rms error of bins of 1 m per million rays [dB], and the error of that.

    Single reflections are compared with their integral. Second reflections have no closed form:
    the scatter of replicates about their mean, at a quarter of the rays, tells their error; that
    of independent rays falls with the root of their number.
    """
    from . import canyon_accuracy

    width, height = (n // 2 for n in _RAYS)
    with tempfile.TemporaryDirectory(prefix="radarsim_canyon_") as name:
        run = Path(name) / "run"

        def table(*words: str | int) -> tuple[Any, PathsRecord]:
            render_cost(BLEND, run, *words)
            record = read_record(run / frame_dir(1) / PATHS_FILE, PathsRecord)
            return open_table(run / frame_dir(1) / record.table_file), record

        rows, record = table("--resolution", "{}x{}".format(*_RAYS))
        exact_w = canyon_accuracy.exact_w(record, canyon_accuracy.wavelength_m(run))
        found = canyon_accuracy.errors_db(canyon_accuracy.binned(rows, record), exact_w)
        count = 3 if quick else _REPLICATES
        rows, record = table(
            "--resolution", f"{width}x{height}", "--replicates", count, "--max-reflections", 2
        )
        second = canyon_accuracy.second_reflections(rows, record)
        mean_w, bins = second.mean(axis=0), canyon_accuracy.STREET_TWICE
    each = [canyon_accuracy.errors_db(one, mean_w, bins) for one in second]
    # about their own mean: (n - 1) / n of the variance; a quarter of the rays: twice the error
    per_run = np.sqrt(np.mean(np.square(each), axis=1)) * np.sqrt(count / (count - 1)) / 2
    return {
        "first_db": float(np.sqrt(np.mean(found**2))),
        "first_db_error": _spread_of_rms(found),
        "second_db": float(np.sqrt(np.mean(per_run**2))),
        "second_db_error": float(np.std(per_run, ddof=1) / np.sqrt(count)),
        "replicates": count,
    }


def _spread_of_rms(values: np.ndarray) -> float:
    """Standard error of a root mean square, from the scatter of the squares."""
    squares = values**2
    return float(np.std(squares, ddof=1) / np.sqrt(len(squares)) / 2 / np.sqrt(squares.mean()))


def canyon_lines(rows: list[dict[str, Any]]) -> list[str]:
    """The rows as lines of the table."""
    keys = [key for key in rows[0] if f"{key}_range" in rows[0]]
    lines = ["", "Street canyon, 1e6 rays: processor seconds, MiB without mapped files"]
    lines.append(" " * 24 + "".join(f"{'order ' + str(row['order']):>28}" for row in rows))
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
