# SPDX-License-Identifier: GPL-3.0-or-later
"""Speckle of a rough patch: mean power, distribution of intensity, and what is said of too few."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from radarsim_addon.arrays import Real
from radarsim_addon.signal import expected_power_profile, iter_path_chunks, open_run, synthesize
from radarsim_addon.signal.decoding import frame_paths, open_frame
from radarsim_addon.signal.maps import expected_power, range_process
from radarsim_addon.signal.paths.paths import Paths, make_paths, path_power_w
from radarsim_addon.signal.scattering import FrameSpeckle

from .case import Bench, Case, Check, Group, absolute_check
from .scenes import (
    EIRP_W,
    acquire,
    add_box,
    add_plate,
    facing_plate,
    lambert,
    new_scene,
    wavelength,
)

RMS_HEIGHT_M = 0.05
#: Where speckle is asked to be fully developed, and no better than that: k h and pixels a side
#: (40 to 50 paths in a range cell).
LEAST_KH, LEAST_PX = 1.5, 64
#: A smooth surface, and pixels a side.
SMOOTH_KH, SMOOTH_PX = 0.3, (24, 48, 96)
SEEDS = 200
#: Pixels a side, bandwidths [Hz], seeds: cells of scatterers are deeper than the range resolution.
DEEP = ((24, 50e6, 400), (64, 150e6, 100), (64, 500e6, 100))
RANGE_M, PLATE_M, TILT_DEG = 1000.0, 100.0, 70.0
#: Further patches for the mean: centres [m], shifted by no simple fraction of pixels and cells.
CENTRES_M = ((1.3, RANGE_M + 1.7, 0.4), (0.7, RANGE_M - 0.9, -0.9))
#: Shifts of the radar, in units of the critical baseline; edge of the patch, and of the cells of
#: scatterers, which must be the same from everywhere.
BASELINES = (0.25, 0.5, 0.75, 1.0)
BASELINE_PLATE_M, BASELINE_CELL_M, BASELINE_SEEDS = 24.0, 1.0, 200
#: Level ground: the radar's height, where it begins and ends, and the view, half of it below.
GROUND_HEIGHT_M, GROUND_M, GROUND_FOV_DEG = 0.5, (10.0, 300.0), 12.0
#: Beyond the patch's edges by this the range cells are not full [m].
MARGIN_M = 12.0


def _patch(
    bench: Bench,
    side_px: int,
    rms_height_m: float = RMS_HEIGHT_M,
    centre_m: tuple[float, float, float] = (0.0, RANGE_M, 0.0),
    bandwidth_hz: float | None = None,
) -> Any:
    """A rough plate that covers 90 m of range, measured; the run opened."""
    new_scene(6.5)
    plate = facing_plate(centre_m, PLATE_M, TILT_DEG, spin_deg=0.0)
    add_plate("Patch", plate, _material(rms_height_m))
    wide: dict[str, Any] = {}
    if bandwidth_hz is not None:
        wide = {"bandwidth_hz": bandwidth_hz, "sampling_rate_hz": 1.2 * bandwidth_hz}
    return open_run(acquire(bench, side_px, 1, **wide).folder)


def _material(rms_height_m: float | None) -> Any:
    material = lambert(0.6)
    if rms_height_m is None:
        return material
    material["radarsim_rms_height_m"] = rms_height_m
    material["radarsim_correlation_length_m"] = 0.5
    return material


def _step(run: Any) -> int:
    """Samples to the next range cell, a resolution and a half away."""
    waveform = run.radar.waveform
    samples: int = math.ceil(2 * waveform.range_resolution_m / waveform.sample_spacing_m)
    return samples


def _intensities(run: Any, seeds: int = SEEDS) -> Real:
    """|s|^2 over the expected power of the points of all pixels, (seeds, samples)."""
    frame, radar = run.frame(1), run.radar
    points: list[Paths] = []
    expected_power(frame, points_to=points.append)
    reach_m = PLATE_M / 2 * math.sin(math.radians(TILT_DEG)) - MARGIN_M
    range_limits_m = (RANGE_M - reach_m - 100, RANGE_M + reach_m + 100)
    profile = expected_power_profile(points, radar, range_limits_m=range_limits_m, oversample=2)
    found = []
    for seed in range(seeds):
        speckle = FrameSpeckle(open_frame(frame), seed)
        paths = (speckle.apply(part) for part in iter_path_chunks(frame))
        echoes = synthesize(paths, radar, range_limits_m=range_limits_m, speckle_seed=seed)
        compressed = range_process(echoes, oversample=1)
        power = np.abs(compressed.plane[0]) ** 2
        expected = np.interp(compressed.range_m, profile.range_m, profile.power)
        full = np.abs(compressed.range_m - RANGE_M) < reach_m
        found.append(power[full] / expected[full])
    return np.array(found)


def statistics(bench: Bench) -> list[Check]:
    from scipy.stats import kstest

    run = _patch(bench, 192)
    report = FrameSpeckle(open_frame(run.frame(1)), 0).report()
    ratio = _intensities(run)[:, :: _step(run)]
    mean, count = float(ratio.mean()), ratio.size
    spread = float(ratio.std(ddof=1) / math.sqrt(count))
    ordered = np.sort(ratio.ravel())
    for level in np.linspace(0, 6, 61):
        bench.point(
            "speckle",
            intensity=level,
            measured=float(np.mean(ordered > level)),
            expected=math.exp(-level),
        )
    p_value = float(kstest(ordered, "expon").pvalue)
    height = 2 * math.pi / wavelength() * RMS_HEIGHT_M
    label = f"{ratio.shape[1]} range cells, {SEEDS} seeds, kh = {height:.1f}"
    assert report is not None
    few = report.median_scatterers
    return [
        _mean_check(label, mean, spread),
        absolute_check(
            "standard deviation over mean of the intensity",
            1.0,
            float(ratio.std(ddof=1) / mean),
            # Variance of the estimate for an exponential law: sqrt(2/N).
            3 * math.sqrt(2 / count),
            "exponential law; bound 3 standard errors",
            standard_error=math.sqrt(2 / count),
        ),
        Check(
            "Kolmogorov-Smirnov p of an exponential law, shortfall from 0.01",
            1.0,
            p_value,
            "",
            max(0.01 - p_value, 0.0),
            0.0,
            "1",
            "p > 0.01",
            points=count,
        ),
        Check(
            "scatterers in a range cell (median), shortfall from 40",
            40.0,
            few,
            "",
            max(40 - few, 0.0),
            0.0,
            "1",
            "at least 40, as the program reports them",
        ),
    ]


def least(bench: Bench) -> list[Check]:
    """The least roughness and number of paths at which intensity is taken to be exponential."""
    from scipy.stats import kstest

    rms_height_m = LEAST_KH * wavelength() / (2 * math.pi)
    run = _patch(bench, LEAST_PX, rms_height_m)
    report = FrameSpeckle(open_frame(run.frame(1)), 0).report()
    assert report is not None
    paths = _paths_per_cell(run)
    found = [_intensities(run)]
    for centre_m in CENTRES_M:
        patch = _patch(bench, LEAST_PX, rms_height_m, centre_m)
        found.append(_intensities(patch, SEEDS // 2))
    ratio = found[0][:, :: _step(run)]
    count = ratio.size
    p_value = float(kstest(np.sort(ratio.ravel()), "expon").pvalue)
    return [
        _plates_check(f"kh = {LEAST_KH:g}, {paths:.0f} paths in a cell", found),
        Check(
            f"Kolmogorov-Smirnov p of an exponential law, kh = {LEAST_KH:g}, shortfall from 0.01",
            1.0,
            p_value,
            "",
            max(0.01 - p_value, 0.0),
            0.0,
            "1",
            "p > 0.01",
            points=count,
        ),
        absolute_check(
            # Several paths share a scatterer: the program warns of so few, and is on the safe side.
            f"paths in a range cell (median; over {report.median_scatterers:.0f} scatterers)",
            45.0,
            paths,
            5.0,
            "40 to 50, counted in the table",
        ),
    ]


def _mean_check(label: str, mean: float, spread: float, errors: float = 3.0) -> Check:
    """Mean of the intensity, within some of its standard errors."""
    return absolute_check(
        f"mean intensity over the sum of powers, {label}",
        1.0,
        mean,
        errors * spread,
        f"sum of the paths' powers; bound {errors:g} standard errors",
        standard_error=spread,
    )


def _plates_check(label: str, found: list[Real]) -> Check:
    """Mean of the intensities (seeds, samples) of several plates."""
    every = np.concatenate([ratio.mean(axis=1) for ratio in found])
    label = f"{label}, {len(found)} plates, {every.size} seeds in all"
    return _mean_check(label, float(every.mean()), float(every.std(ddof=1) / math.sqrt(every.size)))


def deep_cells(bench: Bench) -> list[Check]:
    """Pixels that cover several range cells: paths over one scatterer lie in several of them."""
    checks = []
    for side_px, bandwidth_hz, seeds in DEEP:
        run = _patch(bench, side_px, bandwidth_hz=bandwidth_hz)
        label = f"{side_px} pixels, range resolution {run.radar.waveform.range_resolution_m:.2g} m"
        checks.append(_plates_check(label, [_intensities(run, seeds)]))
    return checks


def _paths_per_cell(run: Any) -> float:
    """Median number of the table's rows in a range cell well within the patch."""
    resolution_m = run.radar.waveform.range_resolution_m
    reach_m = PLATE_M / 2 * math.sin(math.radians(TILT_DEG)) - MARGIN_M
    away_m = (
        np.concatenate([part.length_m / 2 for part in iter_path_chunks(run.frame(1))]) - RANGE_M
    )
    cells = int(reach_m / resolution_m)
    edges = resolution_m * np.arange(-cells, cells + 1)
    return float(np.median(np.histogram(away_m, edges)[0]))


def too_few(bench: Bench) -> list[Check]:
    """A coarse grid of pixels: the program says that cells hold too few scatterers."""
    run = _patch(bench, 24)
    report = FrameSpeckle(open_frame(run.frame(1)), 0).report()
    assert report is not None
    said = float(any(found.code == "few-scatterers" for found in report.findings))
    return [
        absolute_check(
            f"too few scatterers are reported ({report.median_scatterers:.0f} in a range cell)",
            1.0,
            said,
            0.0,
            "a finding (1) or none (0)",
        )
    ]


def smooth(bench: Bench) -> list[Check]:
    """A surface that reflects mostly coherently: its level at ever finer pixels."""
    checks = []
    for side_px in SMOOTH_PX:
        fields, expected_w = _fields(
            bench, side_px=side_px, rms_height_m=SMOOTH_KH * wavelength() / (2 * math.pi)
        )
        ratio = np.abs(fields) ** 2 / expected_w
        spread = float(ratio.std(ddof=1) / math.sqrt(ratio.size))
        label = f"kh = {SMOOTH_KH:g}, {side_px} pixels"
        checks.append(_mean_check(label, float(ratio.mean()), spread, 3.5))
    return checks


def decorrelation(bench: Bench) -> list[Check]:
    """The same surface seen from places ever further to the side: correlation of its echoes."""
    critical_m = wavelength() * RANGE_M / (2 * BASELINE_PLATE_M)
    fields = {share: _fields(bench, share * critical_m)[0] for share in (0.0, *BASELINES)}
    first = fields[0.0]
    checks = []
    for share in BASELINES:
        other = fields[share]
        found = abs(np.vdot(first, other)) / np.linalg.norm(first) / np.linalg.norm(other)
        expected = float(np.sinc(share))
        checks.append(
            absolute_check(
                f"correlation, radar shifted by {share:g} of the critical baseline",
                expected,
                float(found),
                0.12,
                "sinc of it (Zebker and Villasenor 1992)",
                # Of the correlation coefficient of complex Gaussians.
                standard_error=(1 - expected**2) / math.sqrt(2 * BASELINE_SEEDS),
            )
        )
    return checks


def _fields(
    bench: Bench, shift_m: float = 0.0, side_px: int = 60, rms_height_m: float | None = None
) -> tuple[NDArray[np.complex128], float]:
    """Echo of a patch at the carrier, one resolution cell, over seeds, and its expected power; the
    radar to the side.
    """
    new_scene(math.degrees(2 * math.atan(0.65 * BASELINE_PLATE_M / RANGE_M)))
    bpy.data.objects["Radar"].location.x = shift_m
    plate = facing_plate((0.0, RANGE_M, 0.0), BASELINE_PLATE_M, spin_deg=0.0)
    add_plate("Patch", plate, _material(rms_height_m))
    run = open_run(acquire(bench, side_px, 1).folder)
    paths = frame_paths(run.frame(1))
    power_w = path_power_w(paths, wavelength())
    found = []
    for seed in range(BASELINE_SEEDS):
        over = FrameSpeckle(open_frame(run.frame(1)), seed, BASELINE_CELL_M).apply(paths)
        assert over.phasors is not None
        phase = np.exp(-2j * np.pi / wavelength() * over.length_m)
        found.append((np.sqrt(power_w) * phase) @ over.phasors)
    return np.array(found), float(power_w.sum())


def grazing(bench: Bench) -> list[Check]:
    """Mean power of the echoes of level ground in bins of a metre, against the ring integral.

    A ring of ground dr wide at the slant range r has the solid angle h dr dphi / r^2; radiance of
    a Lambert surface is albedo E cos / (4 pi^2 r^2), cos = h / r.
    """
    new_scene(GROUND_FOV_DEG)
    # thin: its front faces the radar
    low_m = (-60.0, GROUND_M[0], -1e-4 - GROUND_HEIGHT_M)
    add_box("Ground", low_m, (60.0, GROUND_M[1], -GROUND_HEIGHT_M), lambert(0.6))
    run = open_run(acquire(bench, 256, 2, bandwidth_hz=150e6, sampling_rate_hz=180e6).folder)
    frame_input = open_frame(run.frame(1))
    paths = FrameSpeckle(frame_input, 0).apply(frame_paths(frame_input))
    range_m = np.arange(GROUND_M[0], GROUND_M[1], 0.05) + 0.025
    solid_sr = GROUND_HEIGHT_M * 0.05 * math.radians(GROUND_FOV_DEG) / range_m**2
    radiance = 0.6 * EIRP_W * GROUND_HEIGHT_M / (4 * math.pi**2 * range_m**3)

    def metres(radiance: Real, length_m: Real, solid_sr: Real) -> Real:
        profile = expected_power_profile(
            make_paths(radiance, length_m, solid_angle_sr=solid_sr),
            run.radar,
            range_limits_m=(20.0, 120.0),
        )
        return np.histogram(profile.range_m, np.arange(50.0, 101.0), weights=profile.power)[0]

    found = metres(paths.radiance, paths.length_m, paths.solid_angle_sr)
    ratio = found / metres(radiance, 2 * range_m, solid_sr)
    return [
        absolute_check(
            "rms error of the mean power of echoes, level ground at 0.3 to 0.6 degrees, bins of "
            "1 m, 50 to 100 m",
            0.0,
            float(np.sqrt(np.mean((ratio - 1) ** 2))),
            0.05,
            "integral over rings of ground; rows of pixels are up to 16 m apart",
        )
    ]


GROUP = Group(
    "speckle",
    "Speckle",
    "A Lambert plate of 100 m at 1 km, tilted by 70 degrees: output of the matched filter "
    "over the expected power, many range cells and seeds. Two radars next to each other; "
    f"level ground {GROUND_HEIGHT_M:g} m below the radar.",
    (
        Case("rough patch", statistics, 40.0),
        Case("least roughness and paths", least, 40.0),
        Case("pixels deeper than range cells", deep_cells, 40.0),
        Case("smooth surface", smooth, 40.0),
        Case("too few scatterers", too_few, 10.0),
        Case("radar shifted sideways", decorrelation, 40.0),
        Case("ground at grazing incidence", grazing, 40.0, quick=True),
    ),
)
