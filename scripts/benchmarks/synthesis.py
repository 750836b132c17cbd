# SPDX-License-Identifier: GPL-3.0-or-later
"""Echo spectra: the non-uniform FFTs against the direct sum, time and error."""

from __future__ import annotations

from typing import Any

import numpy as np

from radarsim_addon.signal.nufft import TOLERANCE, Backend, has_finufft, nufft1

from .clock import stopwatch

#: Frequencies: what a chirp of 2.5 us at 60 MHz needs over 5250 m.
FREQUENCIES = 3200
COUNTS = (10**3, 10**4, 10**5, 10**6)
#: Above this many paths the direct sum is timed over part of them, and scaled: it is linear.
DIRECT_PATHS = 10_000
#: Frequencies at which large sums are checked.
_CHECKED = 16


def run_synthesis(seed: int = 1) -> list[dict[str, Any]]:
    """One row for each number of paths."""
    generator = np.random.default_rng(seed)
    engines: list[Backend] = ["numpy", "finufft"] if has_finufft() else ["numpy"]
    rows = []
    for count in COUNTS:
        points = generator.uniform(-np.pi, np.pi, count)
        phases = generator.uniform(0, 2 * np.pi, count)
        values = generator.exponential(size=count) * np.exp(1j * phases)
        timed = min(count, DIRECT_PATHS)
        with stopwatch() as cost:
            nufft1(points[:timed], values[:timed], FREQUENCIES, backend="direct")
        row: dict[str, Any] = {
            "paths": count,
            "frequencies": FREQUENCIES,
            "tolerance": TOLERANCE,
            "direct_cpu_s": cost.cpu_s * count / timed,
            "direct_scaled": timed < count,
        }
        places = generator.choice(FREQUENCIES, _CHECKED, replace=False)
        k = places - FREQUENCIES // 2
        exact = np.array([np.sum(values * np.exp(-1j * n * points)) for n in k])
        for engine in engines:
            nufft1(points[:10], values[:10], FREQUENCIES, backend=engine)
            with stopwatch() as cost:
                found = nufft1(points, values, FREQUENCIES, backend=engine)
            row[f"{engine}_cpu_s"] = cost.cpu_s
            row[f"{engine}_wall_s"] = cost.wall_s
            row[f"{engine}_error"] = float(
                np.linalg.norm(found[places] - exact) / np.linalg.norm(exact)
            )
        rows.append(row)
    return rows
