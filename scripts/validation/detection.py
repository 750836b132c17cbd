# SPDX-License-Identifier: GPL-3.0-or-later
"""CFAR in noise alone, and what is found among point echoes; no renders."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from radarsim_addon.arrays import Real
from radarsim_addon.signal import Burst, Cfar, FmcwWaveform, Radar, Receiver, cfar_threshold
from radarsim_addon.signal.detection import CfarKind
from radarsim_addon.signal.echoes import apply_receiver, synthesizer_for
from radarsim_addon.signal.maps import map_noise_gain

from . import targets
from .case import Bench, Case, Check, Group, relative_check, worst_of
from .points import WINDOWS, map_of, radar_of

_CHIRP = FmcwWaveform(77e9, 1e9, 1024, 40e6)
#: Radar and range window [m].
RADARS: dict[str, tuple[Radar, tuple[float, float]]] = {
    "LFM": (radar_of("LFM"), (500.0, 3000.0)),
    "FMCW": (Radar(_CHIRP, Burst(1 / _CHIRP.duration_s, 128)), (0.0, 150.0)),
}
RATES = (1e-2, 1e-4, 1e-6)
#: Maps a radar and window: sorting takes longer than adding.
MAPS: dict[CfarKind, int] = {"ca": 8, "os": 4}
#: Cells of range left out at either end of the window: guard and training cells of the default.
END_CELLS = Cfar().guard[1] + Cfar().train[1]
#: Width of what counts as one sample.
BLOCK_CELLS = 60


def _noise_maps(radar: Radar, range_limits_m: tuple[float, float], window: str) -> list[Any]:
    """Maps of thermal noise and the mean power of their cells, by k T F B and the filters."""
    gain = map_noise_gain(radar, window, window)
    found = []
    for seed in range(max(MAPS.values())):
        silence = synthesizer_for(radar, range_limits_m).result()
        received = apply_receiver(silence, Receiver(noise_figure_db=3.0, noise_seed=seed))
        found.append((map_of(received.echoes, window), received.noise_power_w * gain))
    return found


def _rates(maps: list[Any], kind: CfarKind) -> list[tuple[float, float]]:
    """False alarms over design, with its standard error, for each rate asked for.

    Noise of known mean power N exceeds a threshold T with exp(-T/N): the thresholds alone tell the
    rate. That these maps are not of mean power N to the percent is taken out by regression over
    blocks of columns (a control variate, whose mean is known: 1).
    """
    found: dict[float, tuple[Real, list[float]]] = {}
    level: list[float] = []
    for number, (rd_map, noise) in enumerate(maps):
        inner = slice(END_CELLS, -END_CELLS)
        power = rd_map.plane_power[:, inner] / noise
        blocks = max(4, power.shape[1] // BLOCK_CELLS)
        level += [float(part.mean()) - 1 for part in np.array_split(power, blocks, axis=1)]
        for pfa in RATES:
            # The factor on the statistic is one number a column, the same for every map.
            if number == 0:
                result = cfar_threshold(rd_map, Cfar(kind, pfa))
                found[pfa] = (result.threshold[0] / result.noise[0], [])
            elif pfa == RATES[0]:
                result = cfar_threshold(rd_map, Cfar(kind, pfa))
            factor, rates = found[pfa]
            passed = np.exp(-(result.noise * factor)[:, inner] / noise) / pfa
            rates += [float(part.mean()) for part in np.array_split(passed, blocks, axis=1)]
    levels = np.array(level)
    return [_regressed(levels, np.array(rates)) for _, rates in found.values()]


def _regressed(level: Real, rate: Real) -> tuple[float, float]:
    """Mean rate where the level is 0, and its standard error."""
    slope, value = np.polyfit(level, rate, 1)
    spread = (rate - value - slope * level).std(ddof=2) / math.sqrt(rate.size)
    return float(value), float(spread)


def false_alarms(bench: Bench) -> list[Check]:
    """Both detectors, two radars, five windows, three rates."""
    rows: dict[tuple[str, str, float], list[Check]] = {}
    table: dict[tuple[str, str], list[str]] = {}
    for radar_name, (radar, range_limits_m) in RADARS.items():
        for label, window in WINDOWS.items():
            maps = _noise_maps(radar, range_limits_m, window)
            for kind, count in MAPS.items():
                for pfa, (rate, spread) in zip(RATES, _rates(maps[:count], kind), strict=True):
                    table.setdefault((kind, label), []).append(f"{rate:.3f} ± {spread:.3f}")
                    rows.setdefault((radar_name, kind, pfa), []).append(
                        relative_check(
                            label,
                            pfa,
                            pfa * rate,
                            0.05 + 3 * spread,
                            "design; bound 0.05 and 3 standard errors",
                            standard_error=spread,
                        )
                    )
    heads = [f"{name}, {pfa:g}" for name in RADARS for pfa in RATES]
    bench.lines += [
        "",
        (
            f"False alarms over design in noise alone, guard {Cfar().guard}, training "
            f"{Cfar().train} (Doppler, range), from the thresholds and the known noise, away from "
            "the ends of the window:"
        ),
        "",
        "| detector | windows | " + " | ".join(heads) + " |",
        "| --- | --- |" + " --- |" * len(heads),
        *(
            f"| {kind} | {label} | " + " | ".join(table[kind, label]) + " |"
            for kind in MAPS
            for label in WINDOWS
        ),
    ]
    return [
        worst_of(f"false alarms, {name}, {kind}, window", checks)
        for (name, kind, _), checks in rows.items()
    ]


GROUP = Group(
    "detection",
    "Detection",
    "Noise and point echoes through synthesis, compression and range-Doppler map, for LFM, "
    "Barker, FMCW, stepped frequency and PMCW. Random scenes: 0 to 3 moving targets of 0 to "
    "-40 dB, up to 60 stationary points up to 30 dB stronger.",
    (
        Case("false alarms", false_alarms, 90.0),
        Case("peaks", targets.peaks, 20.0),
        Case("next to clutter, at the end of the window", targets.beside_clutter, 40.0),
        Case("SNR", targets.snr, 40.0),
        Case("SNR of a car", targets.car_snr, 5.0, quick=True),
        Case("moving_targets", targets.moving_targets, 40.0),
        Case("folded targets", targets.folded_targets, 60.0),
        Case("slow moving targets", targets.slow_movers, 10.0, quick=True),
    ),
)
