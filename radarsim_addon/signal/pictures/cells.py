# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells of a picture: cells beyond the resolution of a screen are joined, and the strongest counts.

A picture with more rows than pixels would omit rows, and with them targets of one row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...array_types import Real
from .numbers import cell_width


@dataclass(frozen=True)
class CellAxis:
    """Outer edges of the joined cells of a picture's axis, in the axis' unit.

    `end` is the outer edge of the last cell before joining: the last joined cell may extend beyond
    it. `step` is the number of cells joined to one.
    """

    low: float
    high: float
    end: float
    step: int


def cell_axis(centres: Real, most: int, unit_size: float = 1.0, single: float = 1.0) -> CellAxis:
    """Return the axis of evenly spaced cells of which at most `most` are drawn.

    `centres` (cells,) ascend, in SI units; `unit_size` is SI units per unit of the picture,
    `single` the width of a lone cell in SI units.
    """
    width = cell_width(centres) or single
    step = -(-centres.size // most)
    low = float(centres[0]) - width / 2
    high = low + -(-centres.size // step) * step * width
    end = float(centres[-1]) + width / 2
    return CellAxis(low / unit_size, high / unit_size, end / unit_size, step)


def strongest(values: Real, steps: Sequence[int]) -> Real:
    """Return the largest of `steps` adjacent values along each axis."""
    for axis, step in enumerate(steps):
        if step > 1:
            values = np.maximum.reduceat(values, np.arange(0, values.shape[axis], step), axis=axis)
    return values
