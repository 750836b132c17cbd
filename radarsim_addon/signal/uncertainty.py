# SPDX-License-Identifier: GPL-3.0-or-later
"""Standard errors of range profile and range-Doppler map, from replicates.

In the acquisition "paths" every tile is measured with several sub-pixel shifts of its grid. Each
shift is an estimate of the tile's powers; their scatter gives the variance of the mean, and tiles
are independent of one another, so variances add up.

The powers are first sorted into cells (Doppler, range); variances of neighbouring cells are then
smeared by the squared point response as if they were independent. A path that moves from a cell to
its neighbour between shifts makes them anticorrelated, so the error is, if anything, too large.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import ConfigError
from ..physics.constants import SPEED_OF_LIGHT_MPS
from .compress import expected_power_profile
from .config import Radar
from .frames import RadarFrame
from .link import Link
from .pathframes import open_frame_table, usable
from .paths import make_paths
from .pathtable import PathRows
from .synthesis_grid import repeat_orders
from .waveform_lines import FmcwWaveform, LineWaveform
from .windows import slow_time_window

Real = NDArray[np.float64]


@dataclass(frozen=True)
class ExpectedPower:
    """Expected power with its standard error.

    Attributes
    ----------
    range_m
        One-way range, (ranges,) [m].
    doppler_hz
        Doppler, (pulses,), negative for receding [Hz].
    profile, profile_error
        Power against range and its standard error, (ranges,).
    map, map_error
        Power in the range-Doppler map and its standard error, (pulses, ranges).
    """

    range_m: Real
    doppler_hz: Real
    profile: Real
    profile_error: Real
    map: Real
    map_error: Real


def expected_power(
    frame: RadarFrame,
    radar: Radar,
    window_m: tuple[float, float],
    *,
    window: str = "hamming",
    doppler_window: str = "hamming",
    receiver_gain: float = 1.0,
    cells_per_sample: int = 2,
    link: Link | None = None,
) -> ExpectedPower:
    """Expected power of a frame of paths, on range cells of a fraction of the sample spacing.

    Parameters
    ----------
    frame
        A radar frame of the acquisition "paths".
    radar, window_m, window, doppler_window, receiver_gain
        As for the profile and the map.
    cells_per_sample
        Range cells per sample of the echo, at least 2.
    link
        Radar system, see :mod:`.link`; None: no gains but `receiver_gain`.

    Notes
    -----
    Echoes beyond the unambiguous range stand folded, as by :func:`.echoes.synthesize`.

    Raises
    ------
    FrameFileError, SchemaError
        The frame's table is missing or damaged.
    """
    step_m = radar.waveform.sample_spacing_m / cells_per_sample
    stop_m = min(window_m[1], radar.waveform.unambiguous_range_m)
    ranges = int((stop_m - window_m[0]) / step_m) + 1
    pulses = radar.burst.pulses
    mean, variance = np.zeros(pulses * ranges), np.zeros(pulses * ranges)
    record, table = open_frame_table(frame.path, frame.number)
    scale = receiver_gain * (record.carrier_hz / radar.waveform.carrier_hz) ** 2
    for start, stop in _tile_edges(table):
        rows = np.array(table[start:stop])
        shifts = record.shifts
        rows = rows[usable(rows)]
        power = scale * shifts * np.array(rows["power_w"])
        if link is not None:
            power *= link.factor(rows["length_m"], rows["direction"], rows["last_m"])
        row, number = _cells(rows, radar, window_m[0], step_m, ranges, pulses)
        cells, place = np.unique(number, return_inverse=True)
        by_shift = np.zeros((shifts, cells.size))
        np.add.at(by_shift, (rows["shift"][row], place), power[row])
        mean[cells] += by_shift.mean(axis=0)
        if shifts > 1:
            variance[cells] += by_shift.var(axis=0, ddof=1) / shifts
        else:
            variance[:] = np.nan  # one estimate says nothing of its error
    response = _range_response(radar, window, step_m, cells_per_sample)
    doppler = np.abs(_doppler_response(doppler_window, pulses)) ** 2
    grid, spread = mean.reshape(pulses, ranges), variance.reshape(pulses, ranges)
    return ExpectedPower(
        range_m=np.asarray(window_m[0] + step_m * np.arange(ranges), dtype=np.float64),
        doppler_hz=np.fft.fftshift(np.fft.fftfreq(pulses, 1 / radar.burst.prf_hz)),
        profile=_smear(grid.sum(axis=0)[None], response)[0],
        profile_error=np.sqrt(_smear(spread.sum(axis=0)[None], response**2)[0]),
        map=_smear(_smear_doppler(grid, doppler), response),
        map_error=np.sqrt(_smear(_smear_doppler(spread, doppler**2), response**2)),
    )


def _tile_edges(table: PathRows) -> list[tuple[int, int]]:
    """First and last row of each tile: rows of one tile stand together."""
    if table.size == 0:
        return []
    tile = np.asarray(table["tile"])
    edges = np.concatenate([[0], np.flatnonzero(np.diff(tile)) + 1, [tile.size]])
    return [(int(a), int(b)) for a, b in itertools.pairwise(edges)]


def _cells(
    rows: PathRows, radar: Radar, start_m: float, step_m: float, ranges: int, pulses: int
) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Rows that are seen, again where they fold into a long window, and the cell of each."""
    waveform = radar.waveform
    cell = (rows["length_m"] / 2 - start_m) / step_m
    # it repeats with the pulses or the frequency steps; FMCW filters out what is beyond
    fold_m = radar.burst.unambiguous_range_m
    if isinstance(waveform, LineWaveform):
        fold_m = math.inf if isinstance(waveform, FmcwWaveform) else waveform.range_period_m
    period = fold_m / step_m
    if math.isinf(period):
        low = np.zeros(cell.size)
        copies = ((cell >= -0.5) & (cell < ranges - 0.5)).astype(np.intp)
        period = 0.0
    else:
        low = np.ceil((cell - (ranges - 0.5)) / period)
        copies = np.maximum(np.floor((cell + 0.5) / period) - low + 1, 0).astype(np.intp)
    seen = np.repeat(np.arange(copies.size), copies)
    place = np.rint(cell[seen] - repeat_orders(low, copies) * period)
    column = np.clip(place, 0, ranges - 1).astype(np.int64)  # halves are rounded to even
    cycles = -2 * rows["range_rate_mps"][seen] / waveform.wavelength_m / radar.burst.prf_hz
    bins = np.rint(cycles * pulses).astype(np.int64)
    return seen, (bins + pulses // 2) % pulses * ranges + column  # Doppler folds, too


def _range_response(radar: Radar, window: str, step_m: float, cells_per_sample: int) -> Real:
    """|h|^2 on the cells, its peak in the middle."""
    if radar.waveform.family == "line":
        # it repeats with the range: half a period to each side
        cells = int(radar.waveform.unambiguous_range_m / step_m) // 2 - 3
        if cells < 1:
            raise ConfigError("The waveform has too few range cells for an expected profile.")
    else:
        # the compressed pulse reaches its length to each side; twice that leaves nothing out
        cells = int(radar.waveform.duration_s * SPEED_OF_LIGHT_MPS / step_m)
    middle = cells + 2
    point = expected_power_profile(
        make_paths(1.0, 2 * middle * step_m),
        radar,
        window_m=(0.0, 2 * middle * step_m),
        window=window,
        oversample=cells_per_sample,
    )
    response = point.power[middle - cells : middle + cells + 1]
    return np.asarray(response / response[cells])


def _doppler_response(window: str, pulses: int) -> NDArray[np.complex128]:
    weight = slow_time_window(window, pulses)
    return np.asarray(np.fft.fft(weight / weight.sum()))


def _smear(grid: Real, response: Real) -> Real:
    """Convolve each row with a response whose peak is in its middle."""
    size = grid.shape[1] + response.size - 1
    spectrum = np.fft.rfft(grid, size, axis=1) * np.fft.rfft(response, size)
    start = response.size // 2
    result = np.fft.irfft(spectrum, size, axis=1)[:, start : start + grid.shape[1]]
    return np.maximum(result, 0.0)


def _smear_doppler(grid: Real, response: Real) -> Real:
    """Circular convolution over Doppler."""
    spectrum = np.fft.fft(grid, axis=0) * np.fft.fft(response)[:, None]
    return np.maximum(np.fft.ifft(spectrum, axis=0).real, 0.0)
