#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's experiment, end to end: build the scene, render the rings, process, draw, report.

    python scripts/demo.py [--out out/paper]

Writes fig6_rings.png, fig7_echo.png, fig8_matched_filter.png, fig9_range_doppler.png and
summary.json into the folder, the run itself into its subfolder ``run``. Every number of the
summary is measured from the run's own output; where the objects truly are is read from the scene's
geometry, which the run keeps in ground_truth.json.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from radarsim_addon.atomic_files import write_json
from radarsim_addon.contract import GROUND_TRUTH_FILE, RUN_FILE, GroundTruthRecord, frame_dir
from radarsim_addon.errors import RadarSimError, RenderError
from radarsim_addon.signal.maps import power_unit
from radarsim_addon.signal.pictures import (
    plot_echo,
    plot_range_doppler,
    plot_range_profile,
    plot_rings,
    save_figure,
)
from radarsim_addon.signal.pipeline import FrameResult, ProcessOptions, process_run
from radarsim_addon.signal.runs import open_run
from radarsim_addon.typed_json import read_record

#: An edge this far from an object's near face is of something else [range resolutions].
EDGE_SEARCH = 3


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "paper", metavar="DIR")
    out = parser.parse_args(argv).out.resolve()
    try:
        summary = run_demo(out)
    except RadarSimError as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return error.exit_code
    print_table(summary, out)
    return 0


def run_demo(out: Path) -> dict[str, Any]:
    """Build, render and process; returns what summary.json holds."""
    run_folder = out / "run"
    out.mkdir(parents=True, exist_ok=True)
    # A demonstration shows how long a whole run takes: nothing of an earlier one is used.
    shutil.rmtree(run_folder, ignore_errors=True)
    scene_file = out / "paper_scene.blend"

    start = time.perf_counter()
    call("building the scene", "make_paper_scene.py", str(scene_file), quiet=True)
    built = time.perf_counter()
    call("rendering", "render_radar.py", str(scene_file), "--out", str(run_folder))
    rendered = time.perf_counter()
    print("radarsim: processing", flush=True)
    result = process(run_folder)
    frame = open_run(run_folder).frame(result.frame)
    unit = power_unit(result.echoes.amplitude_model)
    for name, figure in (
        ("fig6_rings", plot_rings(frame)),
        ("fig7_echo", plot_echo(result.echoes)),
        (
            "fig8_matched_filter",
            plot_range_profile(result.compressed, result.profile, result.edges, unit=unit),
        ),
        (
            "fig9_range_doppler",
            plot_range_doppler(result.rd_map, result.moving_targets, unit=unit, paper_axes=True),
        ),
    ):
        save_figure(figure, out / f"{name}.png")
    done = time.perf_counter()

    summary = summarise(run_folder, result)
    summary["time_s"] = {
        "build": round(built - start, 2),
        "render": round(rendered - built, 2),
        "process": round(done - rendered, 2),
        "total": round(done - start, 2),
    }
    summary["peak_memory_mib"] = {
        "render": round(peak_mib(resource.RUSAGE_CHILDREN), 1),
        "process": round(peak_mib(resource.RUSAGE_SELF), 1),
    }
    write_json(out / "summary.json", summary)
    return summary


def call(what: str, script: str, *arguments: str, quiet: bool = False) -> None:
    """Run one of the scripts next to this one in a Python of its own."""
    print(f"radarsim: {what}", flush=True)
    command = [sys.executable, str(ROOT / "scripts" / script), *arguments]
    result = subprocess.run(
        command, capture_output=quiet, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"}
    )
    if result.returncode:
        detail = (result.stderr or "").strip() if quiet else "see above"
        raise RenderError(f"{script} ended with exit code {result.returncode}: {detail}")


def process(run_folder: Path) -> FrameResult:
    """Process the one frame of the run."""
    for event in process_run(run_folder, ProcessOptions(plots=False)):
        if isinstance(event, FrameResult):
            return event
    raise RenderError(f"{run_folder} holds no radar frame.")


def peak_mib(who: int) -> float:
    """Peak resident memory [MiB] of this process or of the largest child."""
    peak = resource.getrusage(who).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10


def summarise(run_folder: Path, result: FrameResult) -> dict[str, Any]:
    """Return what was measured, with the ground truth."""
    record = open_run(run_folder).record
    truth = read_record(run_folder / frame_dir(result.frame) / GROUND_TRUTH_FILE, GroundTruthRecord)
    radar = result.rd_map.radar
    slow = radar.velocity_resolution_mps / 2
    reach_m = EDGE_SEARCH * radar.waveform.range_resolution_m
    still = []
    for item in truth.objects:
        near_m = item.nearest_range_m
        if abs(item.range_rate_mps or 0.0) > slow or not result.edges or near_m is None:
            continue
        apart_m, edge = min(
            ((abs(edge.range_m - near_m), edge) for edge in result.edges), key=lambda pair: pair[0]
        )
        # The plane's nearest point is below the radar, out of its view: no edge belongs to it.
        if apart_m <= reach_m:
            still.append(
                {
                    "name": item.name,
                    "near_face_m": near_m,
                    "leading_edge_m": edge.range_m,
                    "level_db": edge.level_db,
                }
            )
    target: dict[str, Any] = {}
    if result.moving_targets:
        peak = result.moving_targets[0]
        moving = [
            (i.nearest_range_m, i.range_rate_mps)
            for i in truth.objects
            if i.nearest_range_m is not None and i.range_rate_mps and abs(i.range_rate_mps) > slow
        ]
        near_m, rate_mps = min(moving, key=lambda pair: abs(pair[0] - peak.range_m))
        # A map shows a moving target where it is in the middle of the burst.
        middle_s = (radar.burst.pulses - 1) / 2 / radar.burst.prf_hz
        target = {
            "range_m": peak.range_m,
            "true_range_m": near_m + rate_mps * middle_s,
            "true_velocity_mps": rate_mps,
            "velocity_mps": peak.velocity_mps,
            "doppler_hz": peak.doppler_hz,
            "level_above_background_db": peak.peak_to_background_db,
        }
    return {
        "static_objects": sorted(still, key=lambda s: s["near_face_m"]),
        "target": target,
        "rings": record.rings,
        "ring_step_m": record.ring_step_m,
        "snapshots": record.snapshots,
        "carrier_hz": radar.waveform.carrier_hz,
        "pulses": radar.burst.pulses,
        "mixed_power_fraction": result.statistics.mixed_power_fraction,
        "versions": record.versions,
    }


def print_table(summary: dict[str, Any], out: Path) -> None:
    """The short table at the end of ``make demo``."""
    print(f"\n{'':16}{'true':>12}{'measured':>12}")
    for item in summary["static_objects"]:
        print(
            f"{item['name']:16}{item['near_face_m']:>10.2f} m{item['leading_edge_m']:>10.2f} m"
            "   half-power leading edge"
        )
    target = summary["target"]
    if target:
        print(
            f"{'Target':16}{target['true_range_m']:>10.2f} m{target['range_m']:>10.2f} m"
            "   in the middle of the burst"
        )
        print(
            f"{'':16}{target['true_velocity_mps']:>+8.2f} m/s{target['velocity_mps']:>+8.2f} m/s"
            "   receding is +"
        )
        print(
            f"{'':28}{target['doppler_hz']:>+9.1f} Hz"
            f"   {target['level_above_background_db']:.0f} dB above surroundings, no noise"
        )
    else:
        print("Target: nothing moves in the map")
    times = summary["time_s"]
    print(
        f"\n{summary['rings']} rings x {summary['snapshots']} snapshots: {times['render']:.1f} s, "
        f"processing {times['process']:.1f} s, all {times['total']:.1f} s, "
        f"Blender {summary['versions'].get('blender', '?')}"
    )
    print(f"pictures and summary.json in {shown(out)}, the run in {shown(out / 'run' / RUN_FILE)}")


def shown(path: Path) -> str:
    """A path relative to the checkout where it lies in it."""
    return str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else str(path)


if __name__ == "__main__":
    sys.exit(main())
