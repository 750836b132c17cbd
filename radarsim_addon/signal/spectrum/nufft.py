# SPDX-License-Identifier: GPL-3.0-or-later
"""Non-uniform Fourier sums: scattered delays to frequencies.

    F[k] = sum_i c_i exp(-j k x_i),    k = -N//2 ... (N-1)//2

finufft does it (Barnett, Magland and af Klinteberg, SIAM J. Sci. Comput. 41, C479, 2019). The
direct sum is here as well, as the check.

`RowsType1` does many small sums in one call. `nufft_lines` adds a second axis of any frequencies u:

    F[l, k] = sum_i c_i exp(-j (k x_i + u[l, k] y_i))

A 2-D type 1 gives the sum at k and at regular q, where u lies between. In q the sum is limited to
angles of a part of the circle, so that a kernel interpolates it (Dutt and Rokhlin, SIAM J. Sci.
Comput. 14, 1368, 1993); strengths are divided by the kernel's spectrum first. Against a 2-D type 3
a target costs one row of a kernel in place of a square, and the grid is a quarter.
"""

from __future__ import annotations

import functools
import importlib
import math
from collections.abc import Iterator
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ...arrays import Complex, Real
from ...errors import ConfigError

Backend = Literal["finufft", "direct"]

#: Default tolerance, relative to sum |c_i|.
TOLERANCE = 1e-9
#: What float64 leaves of a transform: tighter tolerances than this are not asked of the engines.
TIGHTEST = 1e-14
#: Up to this many frequencies the fine grid stays in the cache: sorting the points costs more (23
#: of 45 ms for a million) than it saves.
_UNSORTED = 1 << 14
#: Up to so many terms take longer to plan than to add up.
_FEW_TERMS = 1 << 12
#: Cells between rows of points on one grid: the widest kernel.
_MARGIN = 16
#: Shifts of a point by a fraction of a cell over which its spectrum is averaged.
_SHIFTS = 32


def nufft1(
    points: Real,
    values: NDArray[np.complex128] | Real,
    size: int,
    tolerance: float = TOLERANCE,
    backend: Backend = "finufft",
) -> Complex:
    """Sum c_i exp(-j k x_i) for k = -size//2 ... (size-1)//2.

    Parameters
    ----------
    points
        x_i [rad], (n,); any real number.
    values
        c_i, (n,), real or complex.
    size
        Number of frequencies.
    tolerance
        Largest error relative to sum |c_i|, 1e-13 to 1e-2.
    backend
        "finufft", or "direct" for the sum term by term.

    Returns
    -------
    ndarray
        (size,), complex, k ascending: index size//2 is k = 0.

    Raises
    ------
    ConfigError
        The tolerance is beyond 1e-13 to 1e-2.
    """
    if not 1e-13 <= tolerance <= 1e-2:
        raise ConfigError(f"NUFFT tolerance is {tolerance!r}; expected 1e-13 to 1e-2.")
    engine = Type1(size, tolerance, backend)
    if points.size == 0:
        return np.zeros(size, dtype=np.complex128)
    # into [-pi, pi]: finufft takes no points far outside without losing digits
    wrapped = points - 2 * np.pi * np.round(points / (2 * np.pi))
    if points.size * size <= _FEW_TERMS:
        return _direct(wrapped, values.astype(np.complex128), size)
    return engine(wrapped, np.ascontiguousarray(values, dtype=np.complex128))


def check_backend(backend: Backend) -> Backend:
    """Return the backend. Raises ConfigError for an unknown one."""
    if backend not in get_args(Backend):
        raise ConfigError(f"NUFFT backend {backend!r}; expected one of {get_args(Backend)}.")
    return backend


class Type1:
    """One-dimensional type-1 transforms of one size, planned once, in one thread each: sums are
    then the same from run to run. For one thread at a time.
    """

    def __init__(self, size: int, tolerance: float, backend: Backend = "finufft") -> None:
        self._size = size
        self._tolerance = tolerance
        self.backend = check_backend(backend)
        self._plan: Any = None

    def __call__(self, points: Real, values: Complex) -> Complex:
        """Return F[k] for points within [-pi, pi] and complex values: one set (n,), or several
        (sets, n).
        """
        if self.backend == "finufft":
            self._set(points)
        if values.ndim > 1:
            return np.stack([self._sum(points, own) for own in values])
        return self._sum(points, np.ascontiguousarray(values))

    def _sum(self, points: Real, values: Complex) -> Complex:
        if self.backend == "direct":
            return _direct(points, values, self._size)
        result: Complex = self._plan.execute(values)
        return result

    def _set(self, points: Real) -> None:
        if self._plan is None:
            finufft = importlib.import_module("finufft")
            sort = 0 if self._size <= _UNSORTED else 2
            self._plan = finufft.Plan(
                1, (self._size,), eps=self._tolerance, isign=-1, nthreads=1, spread_sort=sort
            )
        self._plan.setpts(points)


class RowsType1:
    """One-dimensional type-1 transforms of rows of points, to `tolerance` of sum |c_i| of a row:
    finufft spreads all rows in one call. A transform of a few hundred points is all overhead. Rows
    lie one after the other on one grid here, each with a margin as wide as the kernel.
    """

    def __init__(self, size: int, tolerance: float) -> None:
        self._size, self._tolerance = size, tolerance
        self._fine = 2 * smooth_size(max(size, _MARGIN))
        self._kept = (np.arange(size) - size // 2) % self._fine
        self._plans: dict[tuple[int, int], Any] = {}
        self._divisor = _kernel_spectrum(size, self._fine, tolerance)

    def __call__(self, points: Real, values: Complex) -> Complex:
        """Return F[k], (sets, rows, size), for points (rows, n) within [-pi, pi] and complex values
        (sets, rows, n).
        """
        rows, half = len(points), _MARGIN // 2
        slot = self._fine + _MARGIN
        place = points * (self._fine / (2 * np.pi)) + (self._fine / 2 + half)
        place += slot * np.arange(rows)[:, None]
        sets = len(values)
        if (sets, rows) not in self._plans:
            self._plans[sets, rows] = _kernel_plan(
                1, rows * slot, self._tolerance, _WIDE, n_trans=sets
            )
        plan = self._plans[sets, rows]
        plan.setpts(place.ravel() * (2 * np.pi / (rows * slot)) - np.pi)
        grid = plan.execute(np.ascontiguousarray(values.reshape(sets, -1)))
        grid = grid.reshape(sets, rows, slot)
        # what lies in a margin belongs to the other end
        grid[..., half : 2 * half] += grid[..., -half:]
        grid[..., -2 * half : -half] += grid[..., :half]
        found = np.fft.fft(grid[..., half:-half], axis=-1)
        return np.asarray(found[..., self._kept] / self._divisor)


@functools.lru_cache(16)
def _kernel_spectrum(size: int, fine: int, tolerance: float) -> Complex:
    """Return the spectrum of a point at the middle, (size,): the mean over all shifts of a cell."""
    slot, shifts = fine + _MARGIN, np.arange(_SHIFTS) / _SHIFTS
    places = (np.arange(_SHIFTS) * slot + fine // 2 + shifts) / (_SHIFTS * slot)
    plan = _kernel_plan(1, _SHIFTS * slot, tolerance, _WIDE)
    plan.setpts(2 * np.pi * places - np.pi)
    grid = plan.execute(np.ones(_SHIFTS, dtype=np.complex128)).reshape(_SHIFTS, slot)
    k = np.arange(size) - size // 2
    spectra = np.fft.fft(grid[:, :fine], axis=1)[:, k % fine]
    turns = np.exp(2j * np.pi / fine * k * (shifts[:, None]))
    # counted from the middle of the grid, where points are 0
    return np.asarray((spectra * turns).mean(axis=0))


def _direct(points: Real, values: Complex, size: int) -> Complex:
    """Sum up term by term, as the definition is, in blocks that bound memory."""
    k = np.arange(size, dtype=np.float64) - size // 2
    total = np.zeros(size, dtype=np.complex128)
    block = max(1, (1 << 20) // size)
    for start in range(0, points.size, block):
        part = slice(start, start + block)
        total += values[part] @ np.exp(-1j * np.outer(points[part], k))
    return total


def smooth_size(number: int) -> int:
    """Return the smallest product of 2, 3 and 5 that is at least a number, because its FFTs are
    fast.
    """
    best = 1 << max(0, (number - 1).bit_length())
    five = 1
    while five < best:
        three = five
        while three < best:
            rest = -(-number // three)
            best = min(best, three << max(0, (rest - 1).bit_length()))
            three *= 3
        five *= 5
    return best


#: Points of the grid in q beyond the targets, on both sides together: the widest kernel, and two.
MARGIN = 18
#: Circle over the angles of points. A kernel for the narrow one has up to nine digits.
NARROW, _WIDE, _NINE_DIGITS = 1.25, 2.0, 3e-9
#: Grid points interpolated at a time for either: places on a longer line would lose digits.
_MANY_CELLS, _CELLS = 1 << 16, 1 << 11
#: What the digits of the places leave, whatever the tolerance (measured 1.1e-13 to 1.6e-13).
LEAST_ERROR = 2e-13
#: Shifts of a cell at which the kernel is sampled, cells of each, and degree of its spectrum's fit.
_MIXED_SHIFTS, _SLOT, _DEGREE = 32, 32, 32


def nufft_lines(
    x: Real, y: Real, values: Complex, size: int, u: Real, tolerance: float
) -> Iterator[Complex]:
    """Yield the sum F[l, k], (lines, size), of each set of values, (sets, n). Points x within
    [-pi, pi] and y are (n,), u (lines, size) in radians per unit of y.
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
    spectrum = np.polynomial.chebyshev.chebval(y / widest, _mixed_kernel_spectrum(tolerance, over))
    near, rows = [], max(1, cells // count)
    for start in range(0, size, rows):  # of one frequency, one after the other on a line
        part = slice(start, min(start + rows, size))
        cells = count * (part.stop - start)
        cell_rad = 2 * math.pi / cells
        zeros = cell_rad * (half + count * np.arange(part.stop - start)) - math.pi
        places = u.T[part] * (cell_rad / unit) + zeros[:, None]
        near.append((part, _kernel_plan(2, cells, tolerance, over, spread_sort=0)))
        near[-1][1].setpts(places.ravel())
    grid = np.empty((size, count), dtype=np.complex128)
    for own in values:
        found = np.empty(u.T.shape, dtype=np.complex128)
        plan.execute(own / spectrum, out=grid)
        for part, interpolation in near:
            interpolation.execute(grid[part].reshape(-1), out=found[part].reshape(-1))
        yield found.T


def _kernel_plan(kind: int, cells: int, tolerance: float, over: float, **options: int) -> Any:
    """Return a plan that spreads (1) or interpolates (2) along a line of cells, without a
    transform.
    """
    return importlib.import_module("finufft").Plan(
        kind, (cells,), eps=tolerance, isign=-1, nthreads=1, upsampfac=over,
        spreadinterponly=1, **options,
    )  # fmt: skip


@functools.lru_cache(maxsize=16)
def _mixed_kernel_spectrum(tolerance: float, over: float) -> Real:
    """Return Chebyshev coefficients of the kernel's spectrum up to the widest angle, 1 / (2 over)
    cycles.
    """
    shifts = np.arange(_MIXED_SHIFTS) / _MIXED_SHIFTS
    plan = _kernel_plan(1, _MIXED_SHIFTS * _SLOT, tolerance, over, spread_sort=0)
    middles = _SLOT * np.arange(_MIXED_SHIFTS) + _SLOT // 2 + shifts
    plan.setpts(middles * (2 * np.pi / (_MIXED_SHIFTS * _SLOT)) - np.pi)
    kernel = plan.execute(np.ones(_MIXED_SHIFTS, dtype=np.complex128)).real.reshape(
        _MIXED_SHIFTS, _SLOT
    )
    distance = np.arange(_SLOT) - _SLOT // 2 - shifts[:, None]
    places = np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))
    turns = np.cos(np.pi / over * distance[..., None] * places)
    found = np.einsum("sc,scp->p", kernel, turns) / _MIXED_SHIFTS
    return np.asarray(np.polynomial.chebyshev.chebfit(places, found, _DEGREE))
