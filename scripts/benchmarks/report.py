# SPDX-License-Identifier: GPL-3.0-or-later
"""The table that bench.py prints."""

from __future__ import annotations

from typing import Any

from .bounds import bound_lines, read_history
from .canyon import canyon_lines
from .motion import motion_table
from .target import target_lines
from .worker_costs import worker_lines


def table(result: dict[str, Any]) -> str:
    """All parts as text."""
    machine = result["machine"]
    lines = [
        (
            f"{machine['cpus']} processors, load {machine['load']:.1f} at the start, "
            f"Python {machine['python']}, Blender {machine['blender']}, "
            f"radarsim {machine['radarsim']}"
        ),
    ]
    lines += bound_lines(result, read_history())
    for name, parts in (
        ("canyon", (canyon_lines,)),
        ("accuracy", (_accuracy, _target, _rings)),
        ("scaling", (_scaling,)),
        ("synthesis", (_synthesis,)),
        ("motion", (_motion,)),
        ("workers", (worker_lines,)),
    ):
        if name in result:
            for part in parts:
                lines += part(result[name])
    return "\n".join(lines)


def _motion(part: list[dict[str, Any]]) -> list[str]:
    return ["", "Motion: range rates against the truth", "", motion_table(part)]


def _accuracy(part: dict[str, Any]) -> list[str]:
    reference = part["reference"]
    lines = [
        "",
        (
            "1. Error against time, the paper's scene (one frame, one snapshot; from the scene to "
            "the profile)"
        ),
        (
            f"   reference: paths, {reference['label']}, {reference['samples']} paths; "
            "standard error "
            f"{100 * reference['standard_error']:.2g} % (2.5 m bins), "
            f"{100 * reference['standard_error_coarse']:.2g} % (25 m); "
            f"{reference['cpu_s']:.1f} s of processor time"
        ),
        "",
        (
            f"   {'':6} {'':34} {'wall':>7} {'cpu':>7} {'renders':>8} {'rays/paths':>11} "
            f"{'2.5 m':>8} {'25 m':>8} {'by bin':>8} {'target':>9}"
        ),
    ]
    for row in part["runs"]:
        lines.append(
            f"   {row['sampling_mode']:6} {row['label']:35}{row['wall_s']:>5.2f} s "
            f"{row['cpu_s']:>5.2f} s {row['renders']:>8} {row['samples']:>11} "
            f"{100 * row['error']:>6.2f} % {100 * row['error_coarse']:>6.2f} % "
            f"{100 * row['error_by_bin']:>6.1f} % {row['target_db']:>+6.2f} dB"
        )
    lines += ["", "   time of the rings over time of the cheapest paths that are as good:"]
    for ratio in part["ratios"]:
        if ratio["paths"] is None:
            lines.append(f"   {ratio['what']}: not reached")
            continue
        lines.append(
            f"   {ratio['what']}: {ratio['ratio_cpu']:.0f} by processor time, "
            f"{ratio['ratio_wall']:.0f} by wall time ({ratio['rings']}: "
            f"{ratio['rings_value']:.3g}; {ratio['paths']}: {ratio['paths_value']:.3g})"
        )
    return lines


def _target(part: dict[str, Any]) -> list[str]:
    return target_lines(part["target"])


def _rings(part: dict[str, Any]) -> list[str]:
    lines = ["", "2. Rings: one render, file written and verified"]
    for row in part["runs"]:
        if row["sampling_mode"] == "rings":
            each = row["samples"] / row["renders"]
            lines.append(
                f"   {row['label']:20} {1e3 * row['acquire_cpu_s'] / row['renders']:>8.0f} ms cpu, "
                f"{1e3 * row['acquire_wall_s'] / row['renders']:>8.0f} ms wall, "
                f"{1e6 * row['acquire_cpu_s'] / row['samples']:>5.2f} us cpu a ray "
                f"({each:.3g} rays)"
            )
    return lines


def _scaling(rows: list[dict[str, Any]]) -> list[str]:
    lines = ["", "3. Paths: cost and memory against the length of the run (tiles of 256 pixels)"]
    for row in rows:
        lines.append(
            f"   {row['width_px']}x{row['height_px']}, {row['replicates']:>2} replicates, "
            f"order {row['order']}: {row['paths']:>9} paths, {row['renders']:>5} renders, "
            f"{row['wall_s']:>6.1f} s wall, "
            f"{row['cpu_s']:>6.1f} s cpu, {row['cpu_us_per_path']:>5.2f} us a path, "
            f"peak {row['peak_mib']:.0f} MiB"
        )
    return lines


def _synthesis(part: dict[str, Any]) -> list[str]:
    lines = [
        "",
        (
            f"4. Echo spectrum of {part['frequencies']} frequencies, one pulse, tolerance "
            f"{part['tolerance']:g}: best of several (direct: * scaled from fewer paths)"
        ),
    ]
    for row in part["rows"]:
        text = f"   {row['paths']:>8} paths: direct {row['direct_cpu_s']:.3g} s cpu"
        text += "*" if row["direct_paths_timed"] < row["paths"] else " "
        seconds = row["finufft_cpu_s"]
        text += (
            f", finufft {1e3 * row['finufft_wall_s']:.3g} ms wall {1e3 * seconds:.3g} ms cpu "
            f"({row['direct_cpu_s'] / seconds:.0f} times less, error {row['finufft_error']:.1e})"
        )
        lines.append(text)
    burst = part["burst"]
    lines += [
        "",
        (
            f"5. Burst: {burst['paths']} paths, {burst['moving']} of them moving, "
            f"{burst['pulses']} pulses of {burst['frequencies']} frequencies: "
            f"{burst['wall_s']:.2f} s wall, {burst['cpu_s']:.2f} s cpu, peak "
            f"{burst['peak_mib']:.0f} MiB (the scene alone {burst['scene_mib']:.0f}), "
            f"error {burst['error']:.1e}"
        ),
        *(f"   {line}" for line in burst["steps"]),
    ]
    return lines
