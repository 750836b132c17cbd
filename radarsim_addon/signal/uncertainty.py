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
        number, power = _cells(rows, radar, window_m[0], step_m, ranges, pulses)
        cells, place = np.unique(number, return_inverse=True)
        by_shift = np.zeros((shifts, cells.size))
        if link is not None:
            power *= link.factor(rows["length_m"], rows["direction"], rows["last_m"])
        keep = usable(rows)
        np.add.at(by_shift, (rows["shift"][keep], place[keep]), scale * shifts * power[keep])
        inside = cells >= 0
        mean[cells[inside]] += by_shift.mean(axis=0)[inside]
        if shifts > 1:
            variance[cells[inside]] += by_shift.var(axis=0, ddof=1)[inside] / shifts
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
) -> tuple[NDArray[np.int64], Real]:
    """Number of each row's cell, -1 outside the window, and its power."""
    place = np.rint((rows["length_m"] / 2 - start_m) / step_m).astype(np.int64)
    cycles = -2 * rows["range_rate_mps"] / radar.waveform.wavelength_m / radar.burst.prf_hz
    bins = np.rint(cycles * pulses).astype(np.int64)
    row = (bins + pulses // 2) % pulses  # folds as in a radar
    number = np.where((place >= 0) & (place < ranges), row * ranges + place, -1)
    return number, np.array(rows["power_w"])


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
