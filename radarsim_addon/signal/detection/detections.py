# SPDX-License-Identifier: GPL-3.0-or-later
"""Targets above the noise of a map: CFAR, then interpolation between the cells."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...array_types import Real
from ..echoes import Echoes
from ..maps import RangeDopplerMap, Recording, fit_point, point_response, power_to_db
from .cfar import Cfar, CfarResult, cfar_threshold, widened_guard
from .peaks import Peak, local_maxima, refine_peak

#: Maximum number of interpolated targets; the strongest are kept.
MAX_DETECTIONS = 256
#: Above this SNR a target's own sidelobes raise its surroundings [dB]. They are subtracted for so
#: many targets, the strongest, if one point contains this fraction of the peak's energy.
_OWN_DB, _MAX_OWN, _FITS = 20.0, 32, 0.97


@dataclass(frozen=True)
class Detection:
    """One target.

    Attributes
    ----------
    range_m, velocity_mps, doppler_hz
        Interpolated; range rate receding positive, Doppler -2 v / lambda.
    level_db
        10 log10 of the power at the interpolated peak.
    noise_db
        10 log10 of the mean noise power of its cell where that is known, else `surroundings_db`.
    snr_db
        Difference of both: (signal + noise) over noise.
    surroundings_db
        10 log10 of the mean power around it, without its own sidelobes: noise, clutter and what a
        target that is no point returns from beyond the guard cells.
    row, col
        Cell of the map.
    unfolded_velocity_mps, name
        As in `Peak`.
    """

    range_m: float
    velocity_mps: float
    doppler_hz: float
    level_db: float
    noise_db: float
    snr_db: float
    surroundings_db: float
    row: int
    col: int
    unfolded_velocity_mps: float | None = None
    name: str = ""


@dataclass(frozen=True)
class Detections:
    """Targets of one map.

    Attributes
    ----------
    targets
        Detections by falling SNR.
    cells
        Number of cells above the threshold.
    left_out
        Number of peaks beyond `MAX_DETECTIONS`.
    cfar
        The detector.
    training_cells, independent_cells
        Training cells of one cell, and the equivalent number of independent ones, see
        :mod:`.detection.cfar`.
    """

    targets: list[Detection]
    cells: int
    left_out: int
    cfar: Cfar
    training_cells: int
    independent_cells: float


def detect_targets(
    rd_map: RangeDopplerMap,
    cfar: Cfar | None = None,
    dynamics_db: float = 140.0,
    *,
    wide: RangeDopplerMap | None = None,
    noise_power: Real | None = None,
) -> Detections:
    """Find the peaks above the CFAR threshold of a map, interpolated.

    Parameters
    ----------
    rd_map
        Range-Doppler map.
    cfar
        Detector; None: cell averaging at 1e-6.
    dynamics_db
        Levels further below the strongest cell are errors of the synthesis, no echoes [dB].
    wide
        The same map over more ranges (:func:`.detection.received_recording`), to
        interpolate in: without it a peak within a cell of the range limits is off by up to half a
        cell and 1.1 dB.
    noise_power
        Mean noise power of a cell of each row, (Doppler,), which SNRs refer to; None: unknown, they
        refer to the surroundings, which are not noise next to a strong target that is no point.

    Returns
    -------
    Detections
        Targets by falling SNR.

    Notes
    -----
    Within the guard cells of a peak no weaker one is taken. Range and Doppler are those of the
    maximum of the trigonometric interpolation, see :func:`.detection.peaks.find_peaks`: exact for
    one target without noise.
    """
    cfar = widened_guard(rd_map, cfar or Cfar())
    result = cfar_threshold(rd_map, cfar)
    power = rd_map.plane_power
    above = power > np.maximum(result.threshold, power.max(initial=0.0) * 10 ** (-dynamics_db / 10))
    peaks = np.argwhere(above & local_maxima(power))
    order = np.argsort(-power[peaks[:, 0], peaks[:, 1]], kind="stable")
    free = np.ones(power.shape, dtype=bool)
    chosen: list[tuple[int, int]] = []
    left_out = 0
    guard = min(cfar.guard[0], (power.shape[0] - 1) // 2), cfar.guard[1]
    for row, col in peaks[order]:
        if not free[row, col]:
            continue
        if len(chosen) < MAX_DETECTIONS:
            chosen.append((int(row), int(col)))
        else:
            left_out += 1
        rows = (row + np.arange(-guard[0], guard[0] + 1)) % power.shape[0]
        free[rows, max(0, col - guard[1]) : col + guard[1] + 1] = False
    targets = _interpolate(rd_map, chosen, result, cfar, wide or rd_map, noise_power)
    targets.sort(key=lambda target: -target.snr_db)
    cells, independent = result.cells
    return Detections(targets, int(above.sum()), left_out, cfar, cells, independent)


def _interpolate(
    rd_map: RangeDopplerMap,
    chosen: list[tuple[int, int]],
    result: CfarResult,
    cfar: Cfar,
    wide: RangeDopplerMap,
    noise_power: Real | None,
) -> list[Detection]:
    if not chosen:
        return []
    found: list[Detection] = []
    for number, (row, col) in enumerate(chosen):
        place = int(np.argmin(np.abs(wide.range_m - rd_map.range_m[col])))
        peak = refine_peak(wide, row, place, 0.0)
        around_db = float(power_to_db(result.noise[row, col]))
        if number < _MAX_OWN and peak.level_db - around_db > _OWN_DB:
            rest = _noise_without(rd_map, peak, row, col, cfar)
            around_db = min(around_db, float(power_to_db(np.array(rest))))
        noise_db = around_db if noise_power is None else float(power_to_db(noise_power[row]))
        found.append(
            Detection(
                peak.range_m,
                peak.velocity_mps,
                peak.doppler_hz,
                peak.level_db,
                noise_db,
                peak.level_db - noise_db,
                around_db,
                row,
                col,
            )
        )
    return found


def _noise_without(rd_map: RangeDopplerMap, peak: Peak, row: int, col: int, cfar: Cfar) -> float:
    """Return the mean power of the training cells without the target's response; inf: no point."""
    pulses, ranges = rd_map.plane.shape
    range_limits_m = (max(float(rd_map.range_m[0]), 0.0), float(rd_map.range_m[-1]))
    nothing = np.zeros((1, 1), dtype=np.complex128)
    echoes = Echoes(nothing, 0.0, range_limits_m, rd_map.radar, "radar-equation", 0.0)
    recording = Recording(echoes, range_limits_m, rd_map, 0, 0.0)
    response = point_response(recording, peak.range_m, peak.doppler_hz / rd_map.radar.burst.prf_hz)
    reach = min(cfar.guard[0] + cfar.train[0], (pulses - 1) // 2), cfar.guard[1] + cfar.train[1]
    apart = np.arange(-reach[0], reach[0] + 1)
    rows = (row + apart) % pulses
    cols = np.arange(max(0, col - reach[1]), min(ranges, col + reach[1] + 1))
    patch = rd_map.plane[np.ix_(rows, cols)]
    own = response.doppler[rows] @ response.ranges[:, cols]
    middle = np.ix_(np.abs(apart) <= 1, np.abs(cols - col) <= 2)
    amplitude, fraction = fit_point(own[middle], patch[middle])
    if fraction < _FITS:
        return math.inf
    around = (np.abs(apart) > cfar.guard[0])[:, None] | (np.abs(cols - col) > cfar.guard[1])
    rest = np.abs((patch - own * amplitude)[around]) ** 2
    if cfar.kind == "os":  # of exponential power
        return float(np.quantile(rest, cfar.rank)) / -math.log(1 - cfar.rank)
    return float(np.mean(rest))


def target_count(count: int, left_out: int) -> str:
    """Return a number of targets as text, such as "256 strongest of 300 targets".

    Parameters
    ----------
    count, left_out
        Number of targets, and of further peaks.

    Returns
    -------
    str
        The text.
    """
    if left_out:
        return f"{count} strongest of {count + left_out} targets"
    return f"{count} target{'' if count == 1 else 's'}"
