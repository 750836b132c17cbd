# SPDX-License-Identifier: GPL-3.0-or-later
"""Peaks, SNR and moving targets found among point echoes, against what was put in."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable

import numpy as np

from radarsim_addon.signal import (
    Burst,
    Cfar,
    FmcwWaveform,
    Paths,
    Radar,
    Receiver,
    apply_receiver,
    detect_targets,
    find_peaks,
    make_paths,
    synthesize,
)
from radarsim_addon.signal.detection import (
    CfarKind,
    DopplerFolds,
    Peak,
    find_moving_targets,
    received_recording,
)
from radarsim_addon.signal.maps import map_noise_gain, map_noise_rows

from .case import Bench, Check, absolute_check, worst_of
from .points import WAVEFORMS, WINDOWS, Point, apparent_range_m, map_of, radar_of, received

PLACES = 4
SNR_DB = (20.0, 40.0, 60.0)
SNR_TARGETS = 8
#: SNR of a car, and its scatterers.
CAR_SNR_DB, CAR_POINTS = (30.0, 50.0, 70.0), 300
SCENES = 120
CARS = 18
#: Separation of moving targets that are resolved at all, in Doppler [cells] or range [m].
APART = (8.0, 60.0)
#: Moving targets this near to an end of the window may be listed or not [m].
END_M = 10.0


def _errors(label: str, name: str, peak: Peak, point: Point) -> list[Check]:
    """Range, range rate and level of a peak; in cells and dB."""
    radar = radar_of(name)
    cell_m, cell_mps = radar.waveform.sample_spacing_m, radar.velocity_resolution_mps
    range_m = apparent_range_m(radar, point[0], point[1] * cell_mps)
    source = "where it was put, with the range-Doppler coupling"
    return [
        absolute_check(
            label, 0.0, (peak.range_m - range_m) / cell_m, 0.005, source, unit="range cells"
        ),
        absolute_check(
            label, point[1], peak.velocity_mps / cell_mps, 0.005, source, unit="Doppler cells"
        ),
        absolute_check(label, point[2], peak.level_db, 0.1, source, unit="dB"),
    ]


def _worst(label: str, rows: Iterable[list[Check]]) -> list[Check]:
    """The worst range, range rate and level."""
    parts = zip(*rows, strict=True)
    whats = ("range", "range rate", "level")
    return [worst_of(f"{label}, {what}", part) for what, part in zip(whats, parts, strict=True)]


def peaks(_bench: Bench) -> list[Check]:
    """Single echoes at random places between the cells, every waveform with every window."""
    rng = np.random.default_rng(0)
    checks: list[Check] = []
    for name, waveform in WAVEFORMS.items():
        rows = []
        for label, window in WINDOWS.items():
            for _ in range(PLACES):
                cells = float(rng.uniform(4, 20) * rng.choice([-1, 1]))
                point = (450 + float(rng.uniform()) * waveform.sample_spacing_m, cells, 0.0)
                _, rd_map = received(name, [point], (200.0, 700.0), window)
                rows.append(_errors(label, name, find_peaks(rd_map, 1)[0], point))
        checks += _worst(f"peaks, {name}", rows)
    return checks


def beside_clutter(_bench: Bench) -> list[Check]:
    """An echo 30 dB below a stationary one at the same range, and one at the window's end."""
    rng = np.random.default_rng(1)
    rows, ends = [], []
    for name, waveform in WAVEFORMS.items():
        cell_mps = radar_of(name).velocity_resolution_mps
        for label, window in WINDOWS.items():
            # From where the main lobe of the stationary echo leaves a peak.
            first = {"none": 2.2, "Kaiser 8": 4.4}.get(label, 3.3)
            for cells in (first, first + 1.6, 8.3):
                range_m = 500 + float(rng.uniform()) * waveform.sample_spacing_m
                point = (range_m, float(cells * rng.choice([-1, 1])), 0.0)
                _, rd_map = received(name, [point, (range_m, 0.0, 30.0)], (200.0, 900.0), window)
                found = find_peaks(rd_map, 1, min_speed_mps=1.6 * cell_mps)[0]
                rows.append(_errors(f"{name}, {label}, {cells:g} cells off", name, found, point))
            point = (400 + 0.3 * waveform.sample_spacing_m, 8.3, 0.0)
            echoes, rd_map = received(name, [point], (400.0, 700.0), window)
            wide = received_recording(echoes, rd_map, 0).rd_map
            targets = detect_targets(rd_map, wide=wide).targets
            target = max(targets, key=lambda item: item.level_db)
            peak = Peak(
                target.range_m, target.velocity_mps, target.doppler_hz, target.level_db, 0.0
            )
            ends.append(_errors(f"{name}, {label}", name, peak, point))
    return [*_worst("30 dB below clutter", rows), *_worst("at the end of the window", ends)]


def snr(_bench: Bench) -> list[Check]:
    """Mean SNR of detected targets in noise of known power."""
    rng = np.random.default_rng(5)
    checks = []
    detectors: tuple[tuple[str, str, CfarKind], ...] = (
        ("LFM", "none", "ca"),
        ("LFM", "Hamming", "os"),
        ("FMCW", "none", "ca"),
    )
    for name, label, kind in detectors:
        window, radar = WINDOWS[label], radar_of(name)
        gain = map_noise_gain(radar, window, window)
        places = [(450 + 4 * rng.uniform(), rng.uniform(5, 15), 0.0) for _ in range(SNR_TARGETS)]
        clean = [received(name, [place], (350.0, 550.0), window)[0] for place in places]
        for snr_db in SNR_DB:
            sigma = math.sqrt(10 ** (-snr_db / 10) / gain / 2)
            found = []
            for echoes in clean:
                shape = echoes.plane.shape
                noise = sigma * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape))
                noisy = dataclasses.replace(echoes, samples=echoes.samples + noise)
                targets = detect_targets(map_of(noisy, window), Cfar(kind, 1e-4)).targets
                found.append(max(targets, key=lambda item: item.level_db).snr_db)
            # (S + N) / N, as the program defines it.
            expected_db = 10 * math.log10(10 ** (snr_db / 10) + 1)
            spread = float(np.std(found, ddof=1) / math.sqrt(len(found)))
            checks.append(
                absolute_check(
                    f"SNR, {name}, window {label}, {kind}: mean of {SNR_TARGETS}",
                    expected_db,
                    float(np.mean(found)),
                    0.25 + 3 * spread,
                    "(S + N) / N of what was put in; bound 0.25 dB and 3 standard errors",
                    unit="dB",
                    standard_error=spread,
                )
            )
    return checks


def car_snr(_bench: Bench) -> list[Check]:
    """SNR of a car of many scatterers, over noise whose level maps without an echo tell."""
    waveform = FmcwWaveform(77e9, 1e9, 256, 10e6)
    radar, window = Radar(waveform, Burst(1 / waveform.duration_s, 64)), "hamming"
    rng = np.random.default_rng(6)
    ranges_m, rates_mps = rng.uniform(20, 24.5, CAR_POINTS), rng.normal(4, 0.5, CAR_POINTS)
    powers = rng.exponential(size=CAR_POINTS) * 4 * math.pi / waveform.wavelength_m**2
    clean = synthesize(
        make_paths(powers, 2 * ranges_m, rates_mps), radar, range_limits_m=(10.0, 35.0)
    )
    silence = dataclasses.replace(clean, samples=np.zeros_like(clean.samples))
    receivers = [Receiver(noise_figure_db=12.0, noise_seed=seed) for seed in range(9)]
    noise = [apply_receiver(silence, receiver) for receiver in receivers]
    floor_w = float(np.mean([map_of(n.echoes, window).plane_power for n in noise[1:]]))
    rows_w = noise[0].noise_power_w * map_noise_rows(map_of(clean, window), window, window)
    top = max(detect_targets(map_of(clean, window)).targets, key=lambda item: item.level_db)
    checks = []
    for snr_db in CAR_SNR_DB:
        power = floor_w * 10 ** ((snr_db - top.level_db) / 10)
        noisy = noise[0].echoes.samples + clean.samples * math.sqrt(power)
        rd_map = map_of(dataclasses.replace(clean, samples=noisy), window)
        found = detect_targets(rd_map, noise_power=rows_w).targets[0]
        checks.append(
            absolute_check(
                f"SNR of a car, {found.level_db - found.surroundings_db:.1f} dB over surroundings",
                10 * math.log10(10 ** (snr_db / 10) + 1),
                found.snr_db,
                1.0,
                "echoes without noise, over the mean of maps of noise alone",
                unit="dB",
            )
        )
    return checks


def moving_targets(_bench: Bench) -> list[Check]:
    """Random scenes: up to 3 moving targets and 60 stationary points, all waveforms and windows."""
    rng = np.random.default_rng(7)
    names = list(WAVEFORMS)
    present = lost = false = 0
    for number in range(SCENES):
        name = names[number % len(names)]
        window = list(WINDOWS.values())[int(rng.integers(len(WINDOWS)))]
        mti = int(rng.choice([0, 0, 2, 3]))
        range_limits_m = (0.0, 900.0) if rng.uniform() < 0.5 else (300.0, 600.0)
        moving = _apart(rng)
        still = [
            (float(rng.uniform(100, 800)), 0.0, float(rng.uniform(-20, 30)))
            for _ in range(int(rng.integers(0, 61)))
        ]
        if not moving and not still:
            continue
        echoes, rd_map = received(name, moving + still, range_limits_m, window, mti)
        listed = find_moving_targets(echoes, rd_map, mti)
        radar = radar_of(name)
        cell_m, cell_mps = radar.waveform.sample_spacing_m, radar.velocity_resolution_mps
        for point in moving:
            range_m = apparent_range_m(radar, point[0], point[1] * cell_mps)
            from_end_m = min(range_m - range_limits_m[0], range_limits_m[1] - range_m)
            near = [
                peak
                for peak in listed
                if abs(peak.velocity_mps / cell_mps - point[1]) < 1
                and abs(peak.range_m - range_m) < 2 * cell_m
            ]
            if near:
                listed.remove(near[0])
            if from_end_m > END_M:
                present += 1
                lost += not near
        false += len(listed)
    source = "what was put in"
    label = f"{SCENES} random scenes with {present} moving targets"
    return [
        absolute_check(f"{label}: moving targets lost", 0.0, float(lost), 0.0, source),
        absolute_check(f"{label}: false moving targets", 0.0, float(false), 0.0, source),
    ]


def _apart(rng: np.random.Generator) -> list[Point]:
    """Moving targets of 2 to 30 cells and 0 to -40 dB, the first of 0 dB."""
    points: list[Point] = []
    count = int(rng.integers(0, 4))
    while len(points) < count:
        cells = float(rng.uniform(2, 30) * rng.choice([-1, 1]))
        range_m = float(rng.uniform(150, 750))
        level_db = -float(rng.uniform(0, 40)) if points else 0.0
        if all(abs(cells - c) > APART[0] or abs(range_m - r) > APART[1] for r, c, _ in points):
            points.append((range_m, cells, level_db))
    return points


def folded_targets(_bench: Bench) -> list[Check]:
    """Cars of many scatterers, folded or not, and a walker 40 dB below at another range."""
    rng = np.random.default_rng(11)
    false = lost = 0
    rates = []
    for number in range(CARS):
        prf_hz = (1000.0, 3000.0, 40e3)[number % 3]
        window = ("hamming", "hann", "taylor:4:-35")[number // 3 % 3]
        radar = Radar(FmcwWaveform(77e9, 300e6, 256, 20e6), Burst(prf_hz, 128))
        count, rate_mps = int(rng.integers(2, 400)), float(rng.uniform(5, 20))
        power = rng.exponential(1.0, count)
        car = make_paths(power, 2 * (50.0 + rng.uniform(-2.2, 2.2, count)), rate_mps)
        walker = make_paths(power.sum() * 1e-4, 160.0, -1.6)
        paths, folds = Paths.join([car, walker]), DopplerFolds(radar)
        folds.add(paths)
        echoes = synthesize(paths, radar, range_limits_m=(0.0, 120.0))
        rd_map = map_of(echoes, window)
        listed = folds.unfolded(find_moving_targets(echoes, rd_map, folds=folds))
        middle_s = 127 / 2 / prf_hz
        # half the car, its migration, and two range cells
        reach_m = 2.2 + rate_mps * middle_s + 1.0
        at_m = 80.0 - 1.6 * middle_s
        walkers = [peak for peak in listed if abs(peak.range_m - at_m) < 0.5]
        cars = [p for p in listed if abs(p.range_m - 50.0 - rate_mps * middle_s) < reach_m]
        false += len(listed) - len(walkers) - len(cars)
        lost += (not walkers) + (not cars)
        rates += [abs((peak.unfolded_velocity_mps or 0.0) + 1.6) for peak in walkers]
        rates += [abs((peak.unfolded_velocity_mps or 0.0) - rate_mps) for peak in cars]
    source, label = "what was put in", f"{CARS} cars and walkers at 77 GHz, PRF 1 to 40 kHz"
    return [
        absolute_check(f"{label}: targets lost", 0.0, float(lost), 0.0, source),
        absolute_check(f"{label}: sidelobes listed", 0.0, float(false), 0.0, source),
        absolute_check(f"{label}: unfolded range rate", 0.0, max(rates), 0.05, source, unit="m/s"),
    ]


def slow_movers(_bench: Bench) -> list[Check]:
    """A moving target of 1.55 cells next to clutter 30 dB stronger."""
    rng = np.random.default_rng(4)
    still = [(float(rng.uniform(100, 800)), 0.0, float(rng.uniform(-20, 30))) for _ in range(40)]
    found: dict[bool, list[Check]] = {False: [], True: []}
    for name in WAVEFORMS:
        for label, window in WINDOWS.items():
            echoes, rd_map = received(name, [(500.3, 1.55, 0.0), *still], (0.0, 900.0), window)
            listed = find_moving_targets(echoes, rd_map)
            cells = math.nan
            if len(listed) == 1:
                cells = listed[0].velocity_mps / radar_of(name).velocity_resolution_mps
            wide = label == "Kaiser 8"
            bound = 0.05 if wide else 0.02
            found[wide].append(
                absolute_check(
                    f"{name}, {label}", 1.55, cells, bound, "what was put in", unit="Doppler cells"
                )
            )
    return [
        worst_of("slow moving target next to clutter" + ", Kaiser 8" * wide, c)
        for wide, c in found.items()
    ]
