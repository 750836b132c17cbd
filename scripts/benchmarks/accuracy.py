# SPDX-License-Identifier: GPL-3.0-or-later
"""Error against time in the paper's scene: rings, paths over a uniform frame, paths refined."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from radarsim_addon.blender.paths.error_budget import FAINTEST

from .clock import Cost
from .paper import PaperScene, Real, Result, decibel_error, relative_l2
from .target import TOLERANCE_DB, ring_spread, target_summary

#: The paper's method at full resolution.
RINGS = (1280, 720, 4)
CHEAPER_RINGS = ((640, 360, 4), (640, 360, 1), (320, 180, 4), (320, 180, 1), (160, 90, 4))
#: Width, height, replicates. All are 16:9 as the rings: the sensor's width is given, so another
#: shape would cover other ground.
PATHS = (
    (48, 27, 1),
    (64, 36, 2),
    (112, 63, 2),
    (144, 81, 2),
    (240, 135, 2),
    (352, 198, 2),
    (528, 297, 2),
    (816, 459, 2),
    (816, 459, 4),
)
#: The same by more replicates of one coarse frame: a small target needs them for its edges.
SHIFTS_OF = (144, 81)
SHIFTS = (4, 8, 16, 32)
#: Start of the refined runs (width, height, replicates, tile side), and their error targets.
REFINED_FROM = (128, 72, 8, 32)
ERROR_TARGETS = (0.3, 0.15)
#: Coarse frames whose small objects get tiles of their own. Each lays its pixels over the target in
#: another way, so together they tell the error that the target's power has, not one lucky draw.
TILES_FROM = ((80, 45), (96, 54), (112, 63), (128, 72), (144, 81), (160, 90), (176, 99))
TILES = {"replicates": 1, "max_standard_error": 0.04, "refine_for": "objects"}
REFERENCE = {"width_px": 1296, "height_px": 729, "replicates": 8, "tile_px": 700}
#: Bins of the coarse profile, in range bins. Mixed pixels displace power by a few bins, which is
#: most of the rings' error and hardly changes this profile.
COARSE_BINS = 10
#: Runs shorter than this are timed three times, and the median counts [s].
_SHORT_S = 1.5
#: The target's face, perpendicular to the line of sight: half its side over its range, from the
#: scene's script (TARGET_EDGE, TARGET_RANGE).
_TARGET_HALF = 0.12 / 17.5


def run_accuracy(blend: Path, folder: Path, quick: bool = False) -> dict[str, Any]:
    """All runs of this part; a dictionary ready for JSON.

    Parameters
    ----------
    blend
        The paper's scene.
    folder
        For the runs, which are removed one by one.
    quick
        A tenth of the work: to see that it runs.
    """
    scene = PaperScene(blend, folder)
    reference_settings = dict(REFERENCE)
    if quick:
        reference_settings |= {"width_px": 432, "height_px": 243}
    scene.paths(48, 27, replicates=1)  # what Cycles does once is not counted: kernels, shaders
    reference = scene.paths(single_rays=True, **reference_settings)
    target_w = exact_target_w(reference)
    measure = _Measure(reference.profile, target_w)

    rows = [measure.row(scene.rings(*RINGS if not quick else (160, 90, 1)))]
    for settings in CHEAPER_RINGS[-2 if quick else None :]:
        rows.append(measure.row(scene.rings(*settings)))
    for width, height, replicates in PATHS[: 4 if quick else None]:
        rows.append(measure.row(timed(scene, width, height, replicates=replicates, tile_px=1024)))
    for replicates in SHIFTS[: 1 if quick else None]:
        result = timed(scene, *SHIFTS_OF, replicates=replicates, tile_px=1024)
        rows.append(measure.row(result, "replicates"))
    for width, height in TILES_FROM[: 2 if quick else None]:
        rows.append(measure.row(timed(scene, width, height, **TILES), "tiles"))
    width, height, replicates, tile_px = REFINED_FROM
    for target in ERROR_TARGETS[: 1 if quick else None]:
        result = timed(
            scene, width, height, replicates=replicates, tile_px=tile_px, max_standard_error=target
        )
        rows.append(measure.row(result, "refined"))
    return {
        "bin_m": 2.5,
        "reference": {
            **measure.row(reference),
            "standard_error": standard_error(reference.replicates, 1),
            "standard_error_coarse": standard_error(reference.replicates, COARSE_BINS),
            "target_w": target_w,
        },
        "runs": rows,
        "ratios": ratios(rows),
        "target": target_summary(rows, ring_spread(scene, target_w, quick)),
    }


def timed(scene: PaperScene, width: int, height: int, **options: Any) -> Result:
    """A run of paths; short ones three times over, with the median of their times."""
    results = [scene.paths(width, height, **options)]
    if results[0].wall_s < _SHORT_S:
        results += [scene.paths(width, height, **options) for _ in range(2)]

    def median(costs: list[Cost]) -> Cost:
        return Cost(
            float(np.median([c.wall_s for c in costs])), float(np.median([c.cpu_s for c in costs]))
        )

    return replace(
        results[0],
        acquire=median([r.acquire for r in results]),
        process=median([r.process for r in results]),
    )


def exact_target_w(reference: Result) -> float:
    """The target's power without its edges' error: its mean radiance, measured, times the solid
    angle of its face, a square seen square on: 4 atan(a^2 / (d sqrt(d^2 + 2 a^2))), a half its
    side. The faces behind are hidden."""
    a2 = _TARGET_HALF**2
    solid_sr = 4 * math.atan(a2 / math.sqrt(1 + 2 * a2))
    return float(reference.target_w / reference.details["target_sr"] * solid_sr)


def standard_error(replicates: list[Real], bins: int) -> float:
    """Relative L2 of the standard error of the mean over replicates. Those of a low-discrepancy
    sequence are better than independent ones: an upper bound."""
    profiles = np.stack([coarse(p, bins) for p in replicates])
    variance = profiles.var(axis=0, ddof=1) / len(replicates)
    return float(np.sqrt(variance.sum()) / np.linalg.norm(profiles.mean(axis=0)))


def coarse(profile: Real, bins: int) -> Real:
    """Sums over so many neighbouring range bins."""
    whole = profile.size // bins * bins
    return np.asarray(profile[:whole].reshape(-1, bins).sum(axis=1))


def error_by_bin(profile: Real, reference: Real) -> float:
    """Relative error of the range bins, weighted by the roots of their powers as in
    `ErrorBudget.relative_error`: this is what the refinement works on. Weak bins count, too."""
    used = reference > FAINTEST * reference.max()
    weight = np.sqrt(reference[used])
    relative = (profile[used] - reference[used]) / reference[used]
    return float(np.sqrt(np.sum(weight * relative**2) / np.sum(weight)))


class _Measure:
    """Turns results into rows of the table."""

    def __init__(self, reference: Real, target_w: float) -> None:
        self._reference, self._target_w = reference, target_w

    def row(self, result: Result, series: str = "") -> dict[str, Any]:
        return {
            "sampling_mode": result.sampling_mode,
            "label": result.label,
            "series": series or result.sampling_mode,
            "acquire_wall_s": result.acquire.wall_s,
            "acquire_cpu_s": result.acquire.cpu_s,
            "process_cpu_s": result.process.cpu_s,
            "wall_s": result.wall_s,
            "cpu_s": result.cpu_s,
            "samples": result.samples,
            "renders": result.renders,
            "error": relative_l2(result.profile, self._reference),
            "error_coarse": relative_l2(
                coarse(result.profile, COARSE_BINS), coarse(self._reference, COARSE_BINS)
            ),
            "error_by_bin": error_by_bin(result.profile, self._reference),
            "target_db": decibel_error(result.target_w, self._target_w),
            **{k: v for k, v in result.details.items() if k not in ("target_sr", "peak_mib")},
        }


def ratios(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Time of the rings over the time of the cheapest paths that are at least as good."""
    found = []
    main = rows[0]
    paths = [r for r in rows if r["sampling_mode"] == "paths"]
    for key, text in (
        ("error", "range profile, 2.5 m bins"),
        ("error_coarse", "range profile, 25 m bins"),
        ("error_by_bin", "range profile, bin by bin"),
    ):
        good = steady(paths, key, main[key])
        found.append(_ratio(text, main, good, key))
    good = steady(paths, "target_db", TOLERANCE_DB)
    text = f"target within {TOLERANCE_DB} dB"
    found.append(_ratio(f"{text}, rings at full resolution", main, good, "target_db"))
    return found


def steady(rows: list[dict[str, Any]], key: str, limit: float) -> dict[str, Any] | None:
    """The cheapest row that is within the limit, as all dearer ones of its series are: luck does
    not count."""
    found = []
    for series in sorted({r["series"] for r in rows}):
        best = None
        chosen = [r for r in rows if r["series"] == series]
        for row in sorted(chosen, key=lambda r: -r["cpu_s"]):
            if abs(row[key]) > abs(limit):
                break
            best = row
        found += [best] if best else []
    return min(found, key=lambda r: r["cpu_s"], default=None)


def _ratio(
    what: str, rings: dict[str, Any], paths: dict[str, Any] | None, key: str
) -> dict[str, Any]:
    if paths is None:
        return {"what": what, "rings": rings["label"], "paths": None}
    return {
        "what": what,
        "rings": rings["label"],
        "paths": paths["label"],
        "rings_value": rings[key],
        "paths_value": paths[key],
        "rings_cpu_s": rings["cpu_s"],
        "paths_cpu_s": paths["cpu_s"],
        "ratio_cpu": rings["cpu_s"] / paths["cpu_s"],
        "ratio_wall": rings["wall_s"] / paths["wall_s"],
    }
