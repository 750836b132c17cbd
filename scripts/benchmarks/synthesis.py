# SPDX-License-Identifier: GPL-3.0-or-later
"""Echo spectra: time, error and memory of the synthesis and of the direct sum."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from radarsim_addon.signal.motion import LinearMotion
from radarsim_addon.signal.spectrum import Backend, FrequencyGrid, Spectrum, SpectrumAccumulator

from .clock import peak_mib, stopwatch

TOLERANCE = 1e-6
CARRIER_HZ, SAMPLING_HZ = 5.3e9, 60e6
#: Frequencies: what a chirp of 2.5 us at 60 MHz needs over 5250 m.
FREQUENCIES = 3200
COUNTS = (10**3, 10**4, 10**5, 10**6)
#: Terms (paths x frequencies) of the direct sum that are timed; more are scaled: it is linear.
_DIRECT_TERMS = 10**7
#: Frequencies at which results are compared with the direct sum.
_CHECKED = 16
#: Times are the best of so many.
_REPEATS = 5
LIGHT = 299_792_458.0


def run_synthesis(seed: int = 1) -> dict[str, Any]:
    """One spectrum for each number of paths, and the two cases with an upper limit."""
    rows = [_one_pulse(count, seed) for count in COUNTS]
    return {"tolerance": TOLERANCE, "frequencies": FREQUENCIES, "rows": rows, "burst": _burst()}


def _grid(count: int) -> FrequencyGrid:
    return FrequencyGrid.centred(CARRIER_HZ, SAMPLING_HZ / count, count)


def _scene(count: int, frequencies: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Lengths over the unambiguous delay and amplitudes of a speckled scene."""
    rng = np.random.default_rng(seed)
    length = rng.uniform(0, frequencies / SAMPLING_HZ * LIGHT, count)
    return length, rng.exponential(size=count) * np.exp(2j * np.pi * rng.random(count))


def _direct(lengths_m: np.ndarray, amplitude: np.ndarray, frequencies_hz: np.ndarray) -> np.ndarray:
    """The sum, term by term."""
    result = np.empty(frequencies_hz.size, dtype=complex)
    for i, f in enumerate(frequencies_hz.astype(np.longdouble) / np.longdouble(LIGHT)):
        cycles = lengths_m * f
        cycles -= np.rint(cycles)
        result[i] = np.sum(amplitude * np.exp(-2j * np.pi * cycles.astype(float)))
    return result


def _direct_cpu_s(lengths_m: np.ndarray, amplitude: np.ndarray) -> tuple[float, int]:
    """Time of the method "direct" for all frequencies, and paths that were timed."""
    timed = min(lengths_m.size, _DIRECT_TERMS // FREQUENCIES)
    with stopwatch() as cost:
        _form(lengths_m[:timed], np.zeros(timed), amplitude[:timed], 1, FREQUENCIES, "direct")
    return cost.cpu_s * lengths_m.size / timed, timed


def _form(
    length_m: np.ndarray,
    rate_mps: np.ndarray,
    amplitude: np.ndarray,
    pulses: int,
    frequencies: int,
    backend: Backend = "finufft",
    threads: int | None = None,
) -> Spectrum:
    accumulator = SpectrumAccumulator(
        _grid(frequencies),
        np.arange(pulses) / 1000.0,
        tolerance=TOLERANCE,
        backend=backend,
        threads=threads,
    )
    accumulator.add(LinearMotion(length_m, rate_mps), amplitude)
    return accumulator.result()


def _one_pulse(count: int, seed: int) -> dict[str, Any]:
    length_m, amplitude = _scene(count, FREQUENCIES, seed)
    still = np.zeros(count)
    direct_s, timed = _direct_cpu_s(length_m, amplitude)
    row: dict[str, Any] = {
        "paths": count,
        "direct_cpu_s": direct_s,
        "direct_paths_timed": timed,
    }
    places = np.random.default_rng(seed).choice(FREQUENCIES, _CHECKED, replace=False)
    exact = _direct(
        length_m.astype(np.longdouble), amplitude, _grid(FREQUENCIES).frequencies_hz[places]
    )
    walls, cpus = [], []
    for _ in range(_REPEATS):
        with stopwatch() as cost:
            found = _form(length_m, still, amplitude, 1, FREQUENCIES)
        walls.append(cost.wall_s)
        cpus.append(cost.cpu_s)
    row["finufft_wall_s"], row["finufft_cpu_s"] = min(walls), min(cpus)
    error = np.linalg.norm(found.values[0, places] - exact) / np.linalg.norm(exact)
    row["finufft_error"] = float(error)
    return row


def _burst() -> dict[str, Any]:
    """The burst in a process of its own, so that its peak memory is its own."""
    root = Path(__file__).resolve().parents[2]
    code = "from scripts.benchmarks.synthesis import measure_burst; measure_burst()"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True
    )
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def measure_burst(count: int = 10**6, pulses: int = 256, frequencies: int = 512) -> None:
    """A million paths, 1 % of them moving, several pulses; prints JSON."""
    length_m, amplitude = _scene(count, frequencies, 2)
    rng = np.random.default_rng(3)
    rate_mps = np.zeros(count)
    moving_targets = rng.choice(count, count // 100, replace=False)
    rate_mps[moving_targets] = rng.uniform(-14, 14, moving_targets.size)
    before_mib = peak_mib()
    walls, cpus = [], []
    for _ in range(3):
        with stopwatch() as cost:
            found = _form(length_m, rate_mps, amplitude, pulses, frequencies)
        walls.append(cost.wall_s)
        cpus.append(cost.cpu_s)
    values, places = found.values, rng.choice(pulses * frequencies, 8, replace=False)
    exact, long_m = [], length_m.astype(np.longdouble)
    for place in places:
        pulse, column = divmod(int(place), frequencies)
        moved_m = long_m + 2 * rate_mps * np.longdouble(found.times_s[pulse])
        frequency_hz = _grid(frequencies).frequencies_hz[column : column + 1]
        exact.append(_direct(moved_m, amplitude, frequency_hz)[0])
    error = np.linalg.norm(values.ravel()[places] - exact) / np.linalg.norm(exact)
    result = {
        "paths": count,
        "moving": int(moving_targets.size),
        "pulses": pulses,
        "frequencies": frequencies,
        "wall_s": min(walls),
        "cpu_s": min(cpus),
        "peak_mib": peak_mib(),
        "scene_mib": before_mib,
        "error": float(error),
        "steps": found.report.lines(),
    }
    print(json.dumps(result))
