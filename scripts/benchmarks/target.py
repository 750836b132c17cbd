# SPDX-License-Identifier: GPL-3.0-or-later
"""Power of the small target, rings and tiles alike: by several frames, so that luck does not count.

A frame lays its pixels over the target's edges in one of many ways, and may be right by chance. So
each way to measure is judged by the largest error over several frames of nearly one size.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .paper import PaperScene, decibel_error

TOLERANCE_DB = 0.2
#: Ways to set the rings whose spread is measured: width, height, samples.
SPREAD_OF = ((640, 360, 4), (640, 360, 1), (320, 180, 4), (320, 180, 1))
#: Widths next to the nominal one, in steps that keep the frame 16:9 [16 pixels].
_STEPS = (-3, -2, -1, 0, 1, 2, 3)
#: Rings of 250 m that reach beyond the target; those farther do not hold it.
_RINGS_TO_TARGET = 8


def ring_spread(scene: PaperScene, target_w: float, quick: bool = False) -> list[dict[str, Any]]:
    """Errors of the target's power over frames of nearly one size, for each way to set the rings.

    Parameters
    ----------
    scene
        The paper's scene.
    target_w
        The target's power [W].
    quick
        The coarsest alone, two frames.
    """
    found = []
    for width, _, samples in SPREAD_OF[-1 if quick else None :]:
        errors = []
        for step in _STEPS[: 2 if quick else None]:
            w = width + 16 * step
            result = scene.rings(w, w * 9 // 16, samples, count=_RINGS_TO_TARGET)
            errors.append(decibel_error(result.target_w, target_w))
        label = f"{width}x{width * 9 // 16}, {samples} spp"
        found.append({"label": label, "target_db": errors, **_spread(errors)})
    return found


def _spread(errors_db: list[float]) -> dict[str, float]:
    errors = np.array(errors_db)
    return {
        "frames": errors.size,
        "rms_db": float(np.sqrt(np.mean(errors**2))),
        "max_db": float(np.abs(errors).max()),
    }


def target_summary(rows: list[dict[str, Any]], spread: list[dict[str, Any]]) -> dict[str, Any]:
    """The runs that laid tiles over the target, and how long rings take for it.

    Parameters
    ----------
    rows
        Runs of `accuracy`: the first one is the rings at full resolution.
    spread
        From `ring_spread`.
    """
    tiles = [r for r in rows if r["series"] == "tiles"]
    cpu_s, wall_s = (float(np.median([r[key] for r in tiles])) for key in ("cpu_s", "wall_s"))
    rings = {"full": rows[0]}
    times = {r["label"]: r for r in rows if r["sampling_mode"] == "rings"}
    enough = [times[s["label"]] for s in spread if s["max_db"] <= TOLERANCE_DB]
    if enough:
        rings["cheapest"] = min(enough, key=lambda r: r["cpu_s"])
    return {
        **_spread([r["target_db"] for r in tiles]),
        "cpu_s": cpu_s,
        "wall_s": wall_s,
        "ring_spread": spread,
        "rings": {
            name: {
                "label": row["label"],
                "ratio_cpu": row["cpu_s"] / cpu_s,
                "ratio_wall": row["wall_s"] / wall_s,
            }
            for name, row in rings.items()
        },
    }


def target_lines(found: dict[str, Any]) -> list[str]:
    """The summary as lines of the table."""
    lines = [
        "",
        f"   target's power over {found['frames']} frames of nearly one size:",
    ]
    tiles = {**found, "label": "with tiles laid over it"}
    for kind, row in [*(("rings", r) for r in found["ring_spread"]), ("paths", tiles)]:
        lines.append(
            f"   {kind:6} {row['label']:24} at most {row['max_db']:.3f} dB, rms "
            f"{row['rms_db']:.3f} dB"
        )
    lines.append(f"   the paths' median: {found['cpu_s']:.2f} s cpu, {found['wall_s']:.2f} s wall")
    for name, text in (
        ("full", "rings at full resolution"),
        ("cheapest", f"cheapest rings within {TOLERANCE_DB} dB in all frames"),
    ):
        if name in found["rings"]:
            rings = found["rings"][name]
            lines.append(
                f"   time of the {text} ({rings['label']}) over that: {rings['ratio_cpu']:.0f} by "
                f"processor time, {rings['ratio_wall']:.0f} by wall time"
            )
    return lines
