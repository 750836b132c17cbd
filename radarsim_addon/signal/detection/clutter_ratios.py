# SPDX-License-Identifier: GPL-3.0-or-later
"""Clutter next to targets and noise: expected power of clutter in the cells of the map."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...terminal_text import printable
from ..maps import ExpectedPower
from .objects import ObjectEcho

#: Powers below this fraction of the strongest are what transforms round.
_ROUNDING = 1e-14


@dataclass(frozen=True)
class CellClutter:
    """Clutter in the cell of the map where an object is.

    Attributes
    ----------
    clutter_w, clutter_error_w
        Expected power of clutter there and its standard error [W].
    signal_to_clutter_db
        Of the object as a point in the middle of the cell; None: no clutter is there.
    clutter_to_noise_db
        None: no clutter there, or no noise is known.
    """

    clutter_w: float
    clutter_error_w: float
    signal_to_clutter_db: float | None
    clutter_to_noise_db: float | None


@dataclass(frozen=True)
class ClutterBudget:
    """Clutter of a frame, in the range-Doppler map without a canceller.

    Attributes
    ----------
    surfaces
        Objects that are clutter.
    strongest_w, range_m, velocity_mps
        Expected power of clutter in its strongest cell [W], and where that is.
    noise_w
        Mean noise of a cell of the map [W]; None: unknown.
    objects
        By the name of each other object in the map.
    """

    surfaces: frozenset[str]
    strongest_w: float
    range_m: float
    velocity_mps: float
    noise_w: float | None
    objects: Mapping[str, CellClutter] = field(default_factory=dict)

    def summary(self) -> dict[str, Any]:
        """Return the record for ``_summary.json``."""
        return {
            "surfaces": sorted(self.surfaces),
            "strongest_w": self.strongest_w,
            "strongest_range_m": self.range_m,
            "strongest_velocity_mps": self.velocity_mps,
            "strongest_clutter_to_noise_db": ratio_db(self.strongest_w, self.noise_w),
        }

    def of_object(self, name: str) -> dict[str, Any] | None:
        """Return the record of an object; None for clutter, and for what is not in the map."""
        return dataclasses.asdict(self.objects[name]) if name in self.objects else None

    def line(self) -> str:
        """Return text for people."""
        text = (
            f"clutter ({', '.join(map(printable, sorted(self.surfaces))) or 'rain'}) up to "
            f"{10 * math.log10(self.strongest_w) + 30:.2f} dBm in a cell of the map "
            f"({self.range_m:.6g} m, {self.velocity_mps:z.3g} m/s)"
        )
        over_db = ratio_db(self.strongest_w, self.noise_w)
        return text if over_db is None else f"{text}: {over_db:.1f} dB over noise"


def clutter_budget(
    expected: ExpectedPower,
    surfaces: frozenset[str],
    places: Mapping[str, tuple[ObjectEcho, float]],
    wavelength_m: float,
    noise_w: float | None,
) -> ClutterBudget | None:
    """Compare objects with the clutter in their cells; None without clutter.

    `places` has each object in the map with the range at which the map shows it [m], `noise_w` is
    the mean noise of a cell.
    """
    least_w = _ROUNDING * float(expected.map.max(initial=0.0))
    clutter, error = expected.clutter_map, expected.clutter_map_error
    if clutter is None or error is None or not clutter.any():
        return None
    row, column = np.unravel_index(int(np.argmax(clutter)), clutter.shape)
    objects = {}
    for name, (echo, range_m) in places.items():
        if name in surfaces:
            continue
        cell = expected.cell(range_m, -2 * echo.range_rate_mps / wavelength_m)
        here_w = float(clutter[cell]) if clutter[cell] > least_w else 0.0
        objects[name] = CellClutter(
            here_w,
            float(error[cell]),
            ratio_db(echo.power_w, here_w),
            ratio_db(here_w, noise_w),
        )
    return ClutterBudget(
        surfaces,
        float(clutter[row, column]),
        float(expected.range_m[column]),
        float(-expected.doppler_hz[row] * wavelength_m / 2),
        noise_w,
        objects,
    )


def ratio_db(power_w: float, reference_w: float | None) -> float | None:
    """Return 10 log10 of a ratio; None where it is no finite number."""
    if not reference_w or power_w <= 0:
        return None
    return 10 * math.log10(power_w / reference_w)
