# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells of a picture: more than a screen shows are joined, and the strongest of them counts.

A picture of more rows than pixels leaves rows out, and a target of one row with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...array_types import Real
from .numbers import cell_width


@dataclass(frozen=True)
class CellAxis:
    """An axis of a picture, in the unit of its axis.

    `low` and `high` are the outer edges of the joined cells, `end` is that of the last cell before
    joining: the last joined cell may reach beyond it. `step` cells are joined.
    """

    low: float
    high: float
    end: float
    step: int


def cell_axis(centres: Real, most: int, unit_size: float = 1.0, single: float = 1.0) -> CellAxis:
    """Axis of evenly spaced cells of which at most `most` are drawn.

    Parameters
    ----------
    centres
        In SI units, ascending, (cells,).
    most
        Cells that a picture has room for.
    unit_size
        SI units in one of the picture's unit.
    single
        Width of the only cell, where there is one, in SI units.
    """
    width = cell_width(centres) or single
    step = -(-centres.size // most)
    low = float(centres[0]) - width / 2
    high = low + -(-centres.size // step) * step * width
    end = float(centres[-1]) + width / 2
    return CellAxis(low / unit_size, high / unit_size, end / unit_size, step)


def strongest(values: Real, steps: Sequence[int]) -> Real:
    """The largest of `steps` values next to each other, along each axis."""
    for axis, step in enumerate(steps):
        if step > 1:
            values = np.maximum.reduceat(values, np.arange(0, values.shape[axis], step), axis=axis)
    return values
