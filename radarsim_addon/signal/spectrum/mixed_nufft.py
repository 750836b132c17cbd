# SPDX-License-Identifier: GPL-3.0-or-later
"""Non-uniform Fourier sums at regular frequencies along one axis and any along the other:

    F[l, k] = sum_i c_i exp(-j (k x_i + u[l, k] y_i)),      k = -N//2 ... (N-1)//2

A 2-D type 1 gives them at k and at regular q, where u lies between. In q the sum is limited to
angles of a part of the circle, so that a kernel interpolates it (Dutt and Rokhlin, SIAM J. Sci.
Comput. 14, 1368, 1993); strengths are divided by the kernel's spectrum first. Against a 2-D type 3
a target costs one row of a kernel in place of a square, and the grid is a quarter.
"""

from __future__ import annotations

import functools
import importlib
import math
from typing import Any

import numpy as np

from ...array_types import Complex, Real

#: Points of the grid in q beyond the targets, on both sides together: the widest kernel, and two.
MARGIN = 18
#: Circle over the angles of points. A kernel for the narrow one has up to nine digits.
NARROW, _WIDE, _NINE_DIGITS = 1.25, 2.0, 3e-9
#: Grid points interpolated at a time for either: places on a longer line would lose digits.
_MANY_CELLS, _CELLS = 1 << 16, 1 << 11
#: What the digits of the places leave, whatever the tolerance (measured 1.1e-13 to 1.6e-13).
LEAST_ERROR = 2e-13
#: Shifts of a cell at which the kernel is sampled, cells of each, and degree of its spectrum's fit.
_SHIFTS, _SLOT, _DEGREE = 32, 32, 32


def nufft_lines(x: Real, y: Real, values: Complex, size: int, u: Real, tolerance: float) -> Complex:
    """The sum above by finufft 2.4 or later, (sets, lines, size).

    Points x within [-pi, pi] and y are (n,), `values` (sets, n), u (lines, size) in radians per
    unit of y.
    """
    widest, farthest = max(float(np.abs(y).max()), 1e-300), float(np.abs(u).max())
    over, cells = (NARROW, _MANY_CELLS) if tolerance > _NINE_DIGITS else (_WIDE, _CELLS)
    unit = math.pi / (over * widest)  # of q
    half = max(math.ceil(farthest / unit + MARGIN / 2), MARGIN)
    count = 2 * half
    plan = importlib.import_module("finufft").Plan(
        1, (size, count), eps=tolerance, isign=-1, nthreads=1
    )
    plan.setpts(x, y * unit)
    spectrum = np.polynomial.chebyshev.chebval(y / widest, _kernel_spectrum(tolerance, over))
    strengths = np.ascontiguousarray(values / spectrum)
    result = np.empty((len(values), *u.T.shape), dtype=np.complex128)
    near, rows = [], max(1, cells // count)
    for start in range(0, size, rows):  # of one frequency, one after the other on a line
        part = slice(start, min(start + rows, size))
        cells = count * (part.stop - start)
        cell_rad = 2 * math.pi / cells
        zeros = cell_rad * (half + count * np.arange(part.stop - start)) - math.pi
        places = u.T[part] * (cell_rad / unit) + zeros[:, None]
        near.append((part, _kernel_plan(2, cells, tolerance, over)))
        near[-1][1].setpts(places.ravel())
    grid = np.empty((size, count), dtype=np.complex128)
    for own, into in zip(strengths, result, strict=True):
        plan.execute(own, out=grid)
        for part, interpolation in near:
            interpolation.execute(grid[part].reshape(-1), out=into[part].reshape(-1))
    return result.transpose(0, 2, 1)


def _kernel_plan(kind: int, cells: int, tolerance: float, over: float) -> Any:
    """Plan that spreads (1) or interpolates (2) along a line of cells, and does no more."""
    return importlib.import_module("finufft").Plan(
        kind, (cells,), eps=tolerance, isign=-1, nthreads=1, upsampfac=over,
        spreadinterponly=1, spread_sort=0,
    )  # fmt: skip


@functools.lru_cache(maxsize=16)
def _kernel_spectrum(tolerance: float, over: float) -> Real:
    """Chebyshev coefficients of the kernel's spectrum to the widest angle, 1 / 2 over cycles."""
    shifts = np.arange(_SHIFTS) / _SHIFTS
    plan = _kernel_plan(1, _SHIFTS * _SLOT, tolerance, over)
    middles = _SLOT * np.arange(_SHIFTS) + _SLOT // 2 + shifts
    plan.setpts(middles * (2 * np.pi / (_SHIFTS * _SLOT)) - np.pi)
    kernel = plan.execute(np.ones(_SHIFTS, dtype=np.complex128)).real.reshape(_SHIFTS, _SLOT)
    distance = np.arange(_SLOT) - _SLOT // 2 - shifts[:, None]
    places = np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))
    turns = np.cos(np.pi / over * distance[..., None] * places)
    found = np.einsum("sc,scp->p", kernel, turns) / _SHIFTS
    return np.asarray(np.polynomial.chebyshev.chebfit(places, found, _DEGREE))
