# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost of a run by several processes: start, frames, storage; and what large runs need by these.

python -m scripts.benchmarks.worker_costs
"""

from __future__ import annotations

import contextlib
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from radarsim_addon.contract import frame_dir

from .clock import Cost, command_cost, half_range

_ROOT = Path(__file__).resolve().parents[2]
_FRAMES, _FEW, _PLANNED, _REPEATS = 60, 10, 1000, 3
#: Frames and processor cores of the runs whose cost is computed from the measured figures.
_RUNS, _CORES = (10**3, 10**5, 10**7), (2, 64, 1000)
#: Most frames of one run; a longer one is split.
_RUN_FRAMES = 10**5

_CLUSTER = """
import sys
from distributed import LocalCluster
if __name__ == "__main__":
    with LocalCluster(n_workers=int(sys.argv[2]), threads_per_worker=1, host="127.0.0.1",
                      dashboard_address=None, local_directory=sys.argv[1]) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


def run_workers(blend: Path, folder: Path, quick: bool = False) -> dict[str, Any]:
    """Measure frames of a moving car: one worker, two workers, two workers of Dask.

    Parameters
    ----------
    blend
        The scene, with an animation.
    folder
        Where runs are written.
    quick
        Each command once.

    Returns
    -------
    dict
        Processor seconds of a worker's start and of a frame, bytes and files of a frame, and by the
        clock: ratio of one worker to two, and seconds that Dask adds to a frame; with errors.
    """
    each = [_once(blend, folder) for _ in range(1 if quick else _REPEATS)]
    found: dict[str, Any] = {"frames": _FRAMES, "repeats": len(each)}
    for key in each[0]:
        values = [one[key] for one in each]
        found |= {key: statistics.median(values), f"{key}_error": half_range(values)}
    return found


def _once(blend: Path, folder: Path) -> dict[str, float]:
    with tempfile.TemporaryDirectory(dir=folder) as name, dask_cluster(Path(name)) as address:
        here = Path(name)

        def render(part: str, count: int, *words: str) -> Cost:
            frames = ("--frames", f"1:{count}")
            return _command("render", blend, "--out", here / part, *frames, *words)

        def process(part: str, *words: str) -> Cost:
            return _command("process", here / part, "--no-plots", *words)

        def pair(part: str, *words: str) -> tuple[Cost, Cost]:
            return render(f"few_{part}", _FEW, *words), render(part, _FRAMES, *words)

        one, two = ("--workers", "1"), ("--workers", "2")
        few_1, all_1 = pair("one", *one)
        few_2, all_2 = pair("two", *two)
        render("warm", 4, "--dask", address)  # its workers load Blender here
        few_dask, all_dask = pair("dask", "--dask", address)
        few_products, all_products = process("few_one", *one), process("one", *one)
        planned = render("planned", _PLANNED, "--plan-only")
        look_s = (planned.cpu_s - render("short", _FEW, "--plan-only").cpu_s) / (_PLANNED - _FEW)
        frame_s, start_s = _line(few_1.cpu_s - _FEW * look_s, all_1.cpu_s - _FRAMES * look_s)
        process_s, process_start_s = _line(few_products.cpu_s, all_products.cpu_s)
        dask_s, local_s = (_line(a.wall_s, b.wall_s)[0] for a, b in (
            (few_dask, all_dask), (few_2, all_2)))  # fmt: skip
        files = [
            path.stat().st_size
            for place in (here / "one" / frame_dir(_FEW), here / "one" / "products")
            for path in place.rglob("*")
            if path.is_file() and (place.name != "products" or f"{_FEW:04d}" in path.name)
        ]
    return {
        "start_s": start_s,
        "frame_s": frame_s,
        "process_start_s": process_start_s,
        "process_s": process_s,
        "look_s": look_s,
        "frame_bytes": float(sum(files)),
        "frame_files": float(len(files)),
        "two_workers": all_1.wall_s / all_2.wall_s,
        "dask_s": dask_s - local_s,
    }


def _line(few_s: float, all_s: float) -> tuple[float, float]:
    """Time of a frame, and time without frames [s], from commands of few and of all frames."""
    frame_s = (all_s - few_s) / (_FRAMES - _FEW)
    return frame_s, few_s - _FEW * frame_s


def _command(*words: str | Path) -> Cost:
    return command_cost(["-m", "radarsim_addon", *words], _ROOT)


@contextlib.contextmanager
def dask_cluster(folder: Path, workers: int = 2) -> Iterator[str]:
    """Start a Dask cluster of processes of one thread on this machine; give its address.

    In a process of its own: one that holds bpy would pass on its paths.
    """
    script = folder / "cluster.py"
    script.write_text(_CLUSTER, encoding="utf-8")
    own = filter(None, [os.environ.get("PYTHONPATH")])
    with subprocess.Popen(
        [sys.executable, str(script), str(folder / "dask"), str(workers)],
        cwd=_ROOT,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(_ROOT), *own])},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.stdin.close()
            process.wait(60)


def run_hours(part: dict[str, Any], frames: int, cores: int) -> float:
    """Hours that so many frames take on so many cores, by the measured figures.

    Frames are split into runs of at most 1e5, as many of them at once as there are cores for. The
    first look at a run's frames is one process's; its other cores wait for that. What shared disks
    and memory cost is not in it.
    """
    runs = max(1, frames // _RUN_FRAMES)
    at_once = min(runs, cores)
    frame_s = part["look_s"] + (part["frame_s"] + part["process_s"]) * at_once / cores
    run_s = part["start_s"] + part["process_start_s"] + frames / runs * frame_s
    return float(runs / at_once * run_s / 3600.0)


def worker_lines(part: dict[str, Any]) -> list[str]:
    """The figures, and what large runs need."""
    rows = (
        ("start of a worker, render", "start_s", "s"),
        ("   process", "process_start_s", "s"),
        ("a frame, render", "frame_s", "s"),
        ("   process, without pictures", "process_s", "s"),
        ("first look at a frame", "look_s", "s"),
        ("files of a frame", "frame_files", ""),
        ("   their size", "frame_bytes", "bytes"),
    )
    lines = ["", "6. Workers: 64 x 64, 77 GHz, moving car; processor seconds, one thread a worker"]
    for label, key, unit in rows:
        error = part[f"{key}_error"]
        given = "" if error is None else f" +- {error:.1g}"
        lines.append(f"   {label:32}{part[key]:.4g}{given} {unit}")
    lines.append("   What runs need by these figures: hours by the clock, storage")
    lines.append(" " * 20 + "".join(f"{f'{cores} cores':>13}" for cores in _CORES))
    for frames in _RUNS:
        hours = "".join(f"{run_hours(part, frames, cores):>13.3g}" for cores in _CORES)
        size = f"{frames * part['frame_bytes'] / 1e9:,.0f} GB"
        lines.append(f"   {frames:>10,} frames{hours}   {size}")
    return lines


def main() -> None:
    """Print the figures."""
    from .workload_costs import built

    with tempfile.TemporaryDirectory(prefix="radarsim_workers_") as name:
        part = run_workers(built("car", Path(name)), Path(name))
    print("\n".join(worker_lines(part)))
    print(f"   2 workers are {part['two_workers']:.2f} times as fast as 1")
    print(f"   Dask adds {1e3 * part['dask_s']:.0f} ms to a frame")


if __name__ == "__main__":
    main()
