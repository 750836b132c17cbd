# SPDX-License-Identifier: GPL-3.0-or-later
"""Error of the street canyon's power in range bins of 1 m."""

from __future__ import annotations

from typing import Any

import numpy as np

from radarsim_addon.array_types import Real
from radarsim_addon.contract import PathsRecord
from radarsim_addon.physics.radar_equation import effective_area_m2
from radarsim_addon.signal.paths import spread, steps_of, tiles_by_replicate
from scripts import make_canyon

from .canyon_profile import first_order_profile

EDGES_M = np.arange(0.0, 101.0)
#: Bins within the street: ground from 2 m on, walls up to its ends at 75 m.
STREET = slice(2, 75)


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


def rms_db(power: Real, expected: Real) -> float:
    """Root mean square over the street's bins [dB]."""
    ratio = power[STREET] / expected[STREET]
    return float(np.sqrt(np.mean((10 * np.log10(ratio)) ** 2)))
