# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers and units for people: no "-0.0", as many digits as the cells support, km for long ranges.

Functions of this module return text; stored values are never rounded.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

#: Maximum number of decimals: float64 holds no more of a range of metres.
_MOST_DIGITS = 12


@dataclass(frozen=True)
class Unit:
    """Symbol of a unit such as "km", and its size in SI units."""

    name: str
    size: float


def fixed(value: float, decimals: int, *, signed: bool = False) -> str:
    """Return a number with `decimals` decimals; zero has no sign.

    Parameters
    ----------
    value
        Number, finite or not.
    decimals
        Digits after the point, 0 or more.
    signed
        Whether a positive number has a plus sign.

    Returns
    -------
    str
        The number.
    """
    text = f"{value:{'+' if signed else ''}z.{decimals}f}"
    # the option z takes the minus from zero, not the plus
    return text[1:] if text.startswith("+") and not float(text) else text


def decimals_for(step: float) -> int:
    """Return the number of decimals that shows a tenth of a step.

    Parameters
    ----------
    step
        Step such as the width of a cell, in the unit of the text.

    Returns
    -------
    int
        0 to 12; 0 if the step is not finite or not positive.
    """
    if not (math.isfinite(step) and step > 0):
        return 0
    return min(max(math.ceil(1 - math.log10(step) - 1e-9), 0), _MOST_DIGITS)


def cell_width(centres: ArrayLike) -> float:
    """Return the distance between the evenly spaced cells of an axis.

    Parameters
    ----------
    centres
        Centres of the cells, (cells,).

    Returns
    -------
    float
        In the unit of the centres; 0 for a single cell.
    """
    values = np.asarray(centres, dtype=np.float64)
    return float(abs(values[1] - values[0])) if values.size > 1 else 0.0


def _chosen(units: tuple[tuple[float, Unit], ...], largest: float) -> Unit:
    for least, unit in units:
        if abs(largest) >= least:
            return unit
    return units[-1][1]


def range_unit(largest_m: float) -> Unit:
    """Return km from 20 km, mm below half a metre, else m, by the longest range of an axis [m]."""
    units = ((20e3, Unit("km", 1e3)), (0.5, Unit("m", 1.0)), (0.0, Unit("mm", 1e-3)))
    return _chosen(units, largest_m) if largest_m > 0 else Unit("m", 1.0)


def speed_unit(largest_mps: float) -> Unit:
    """Return km/s from 5 km/s, mm/s below 0.1 m/s, else m/s."""
    units = ((5e3, Unit("km/s", 1e3)), (0.1, Unit("m/s", 1.0)), (0.0, Unit("mm/s", 1e-3)))
    return _chosen(units, largest_mps) if largest_mps > 0 else Unit("m/s", 1.0)


def frequency_unit(largest_hz: float) -> Unit:
    """Return MHz from 10 MHz, kHz from 10 kHz, else Hz."""
    return _chosen(
        ((1e7, Unit("MHz", 1e6)), (1e4, Unit("kHz", 1e3)), (0, Unit("Hz", 1.0))), largest_hz
    )


def time_unit(largest_s: float) -> Unit:
    """Return s from 1 s, ms from 1 ms, ns below 0.1 us, else us."""
    units = (
        (1.0, Unit("s", 1.0)),
        (1e-3, Unit("ms", 1e-3)),
        (1e-7, Unit("µs", 1e-6)),
        (0.0, Unit("ns", 1e-9)),
    )
    return _chosen(units, largest_s)


def reference_text(power: float, unit: str) -> str:
    """Return the power of 0 dB as text such as " = -73.1 dBW"; "" if its unit is unknown."""
    if not (unit and power > 0):
        return ""
    return f" = {with_minus(fixed(10 * math.log10(power), 1))} {unit}"


def with_minus(text: str) -> str:
    """Replace hyphens before digits by minus signs, as on matplotlib's axes."""
    return re.sub(r"-(?=[\d.])", "\N{MINUS SIGN}", text)
