# SPDX-License-Identifier: GPL-3.0-or-later
"""Error of the street canyon's power in range bins of 1 m."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from radarsim_addon.arrays import Real
from radarsim_addon.contract import PathsRecord
from radarsim_addon.physics.radar_equation import effective_area_m2
from radarsim_addon.signal import open_run
from radarsim_addon.signal.paths import spread, steps_of, tiles_by_replicate
from scripts import make_canyon

from .canyon_profile import first_order_profile

EDGES_M = np.arange(0.0, 101.0)
#: Bins within the street: from the ground below the radar to the street's ends.
STREET = slice(2, 75)
#: Those of two reflections: the shortest way is over ground and wall.
STREET_TWICE = slice(12, 75)


def binned(rows: Any, record: PathsRecord) -> Real:
    """Power of rows in the bins, each path spread over its pixel as `radarsim process` does [W]."""
    found = np.zeros(len(EDGES_M) - 1)
    for views in tiles_by_replicate(rows, record.replicates):
        for view in views:
            steps = steps_of(view, record.receiver, record.replicates)
            for part in spread(view, steps, np.diff(EDGES_M)[0] / 2, np.inf):
                power_w = view["power_w"][part.row] * part.share
                found += np.histogram(part.length_m / 2, EDGES_M, weights=power_w)[0]
    return found


def exact_w(record: PathsRecord, wavelength_m: float) -> Real:
    """Power of single reflections in the bins [W]."""
    indices = complex(*make_canyon.CONCRETE), complex(*make_canyon.GROUND)
    profile = first_order_profile(
        make_canyon.blocks(), make_canyon.GROUND_M, make_canyon.RADAR_HEIGHT_M, indices, EDGES_M
    )
    return np.asarray(profile * effective_area_m2(wavelength_m) * record.transmitter.eirp_w)


def wavelength_m(run: Path) -> float:
    """Wavelength of a run's carrier [m]."""
    return float(open_run(run).radar.waveform.wavelength_m)


def second_reflections(rows: Any, record: PathsRecord) -> Real:
    """Power of paths of two reflections in the bins, as each replicate finds it (n, bins) [W]."""
    found = np.zeros((record.replicates, len(EDGES_M) - 1))
    chosen = rows[rows["order"] == 2]
    for number, power_w in enumerate(found):
        part = chosen[chosen["replicate"] == number]
        weights = record.replicates * part["power_w"]
        power_w += np.histogram(part["length_m"] / 2, EDGES_M, weights=weights)[0]
    return found


def errors_db(power: Real, expected: Real, bins: slice = STREET) -> Real:
    """Ratio in these bins [dB]."""
    return np.asarray(10 * np.log10(power[bins] / expected[bins]))
