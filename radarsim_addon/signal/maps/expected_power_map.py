# SPDX-License-Identifier: GPL-3.0-or-later
"""Standard errors of range profile and range-Doppler map, from replicates.

In the sampling mode "paths" every tile is measured with several replicates: its grid, moved by
fractions of a pixel. Each replicate is an estimate of profile and map; the scatter of the estimates
gives the variance of their mean. Replicates are spread more evenly than by chance, so the error is,
if anything, too large.

The powers are sorted into cells (Doppler, range), each path over all that its pixel covers, see
:mod:`.paths.footprints`, and smeared by the point response. Where surfaces bend within a pixel (the
limb of a sphere) all replicates have the same error. All S of them together are a grid S times as
dense, so each path may be spread over an S-th of its pixel instead; what that changes is part of
the standard error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...array_types import Indices, Real
from ...errors import ConfigError
from ...findings import Finding, finding
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..decoding import FrameInput, as_input
from ..paths import (
    PathRows,
    Paths,
    Points,
    Steps,
    TableFootprints,
    has_images,
    make_paths,
    radiance_of,
    spread,
    steps_of,
    views_by_replicate,
)
from ..radar import FmcwWaveform, LineWaveform, Radar, slow_time_window
from ..runs import RadarFrame
from ..scattering import Link, interference_factors
from ..spectrum import check_finite, repeat_orders, smooth_size
from .range_compression import expected_power_profile


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
    gaps_from_m
        Range from which on most rays of all replicates are further apart than range cells, which
        leaves gaps that are not in the scene; infinite where there are none [m].
    """

    range_m: Real
    doppler_hz: Real
    profile: Real
    profile_error: Real
    map: Real
    map_error: Real
    gaps_from_m: float = math.inf

    @property
    def findings(self) -> list[Finding]:
        """Gaps between single rays, where there are any."""
        if math.isinf(self.gaps_from_m):
            return []
        return [finding("range-gaps-between-rays", range_m=self.gaps_from_m)]


def expected_power(
    frame: RadarFrame | FrameInput,
    *,
    range_taper: str = "hamming",
    doppler_taper: str = "hamming",
    receiver_gain: float = 1.0,
    cells_per_sample: int = 2,
    link: Link | None = None,
    points_to: Callable[[Paths], None] | None = None,
    footprints: TableFootprints | None = None,
    volume: PathRows | None = None,
) -> ExpectedPower:
    """Compute the expected power of a frame of paths, on cells finer than the samples.

    Parameters
    ----------
    frame
        Frame of the sampling mode "paths". Its radar and range limits are those of the map.
    range_taper, doppler_taper
        Tapers by name, over the band and over the pulses.
    receiver_gain
        G_r, linear.
    cells_per_sample
        Range cells per sample of the echo, at least 2.
    link
        Antennas and losses; None: no gains but `receiver_gain`.
    points_to
        Called with the points that the paths are spread over, as paths of their own.
    footprints
        Takes the steps from ray to ray, which it then need not find again.
    volume
        Points of the air that return power, too, see :func:`.scattering.rain_rows`. None: none.

    Returns
    -------
    ExpectedPower
        Powers with their standard errors [W].

    Raises
    ------
    ConfigError
        The frame holds ring images, or the waveform has too few range cells.

    Notes
    -----
    Echoes beyond the unambiguous range fold, as in :func:`.echoes.synthesize`.
    """
    frame_input = as_input(frame)
    radar, table = frame_input.radar, frame_input.table
    cells = _Cells(radar, frame_input.range_limits_m, cells_per_sample)
    smeared = _Smearing(radar, range_taper, doppler_taper, cells, cells_per_sample)
    sums = _TableSums(frame_input, cells, range_taper, receiver_gain, link, points_to, footprints)
    profile, image = _Replicates(cells.ranges), _Replicates((cells.pulses, cells.ranges))
    if volume is not None and volume.size:
        sums.add_volume(volume)
    for views in views_by_replicate(table.rows, table.record.replicates):
        for total, values in zip((profile, image), smeared(sums.replicate(views)), strict=True):
            total.add(values)
    finer_profile, finer_map = smeared(sums.finer)
    return ExpectedPower(
        range_m=cells.range_m,
        doppler_hz=np.fft.fftshift(np.fft.fftfreq(cells.pulses, 1 / radar.burst.prf_hz)),
        profile=profile.mean,
        profile_error=np.hypot(profile.error(), profile.mean - finer_profile),
        map=image.mean,
        map_error=np.hypot(image.error(), image.mean - finer_map),
        gaps_from_m=sums.gaps.start_m(),
    )


class _TableSums:
    """Sorts the power of a table's rows into cells, view by view.

    `finer` has every row spread over an S-th of its pixel, summed over all S replicates; `gaps` is
    where single rays leave gaps.
    """

    def __init__(
        self,
        frame_input: FrameInput,
        cells: _Cells,
        range_taper: str,
        receiver_gain: float,
        link: Link | None,
        points_to: Callable[[Paths], None] | None,
        footprints: TableFootprints | None,
    ) -> None:
        self._footprints = footprints
        radar, self._record = frame_input.radar, frame_input.table.record
        self._cells, self._link, self._points_to = cells, link, points_to
        waveform = radar.waveform
        self._band = waveform.carrier_hz, waveform.range_resolution_m, range_taper
        self._scale = receiver_gain * (self._record.carrier_hz / radar.waveform.carrier_hz) ** 2
        self.finer = np.zeros(cells.pulses * cells.ranges)
        self._volume = np.zeros(self.finer.size)
        self.gaps = _Gaps(
            frame_input.range_limits_m,
            radar.waveform.range_resolution_m * self._record.replicates,
        )

    def replicate(self, views: Iterable[tuple[Indices, PathRows]]) -> Real:
        """Powers in cells from the views of one replicate, (pulses x ranges,)."""
        grid = self._volume.copy()
        for number, rows in views:
            self._add_view(grid, number, rows)
        return grid

    def add_volume(self, rows: PathRows) -> None:
        """Add points that are the same in all replicates, before those."""
        gain = self._gain(rows)
        points = Points(
            np.arange(rows.size), rows["length_m"], rows["range_rate_mps"], np.ones(rows.size)
        )
        for grid in (self._volume, self.finer):
            self._cells.add(grid, points, self._scale * gain * rows["power_w"])
        if self._points_to is not None:
            radiance = gain * radiance_of(rows, self._record) * rows["solid_angle_sr"]
            self._points_to(make_paths(radiance, np.array(rows["length_m"])))

    def _add_view(self, grid: Real, number: Indices, rows: PathRows) -> None:
        record, cells = self._record, self._cells
        check_finite(rows["length_m"], number, "length")
        gain = self._gain(rows)
        power = self._scale * gain * rows["power_w"]
        radiance = gain * radiance_of(rows, record) * rows["solid_angle_sr"]
        steps = steps_of(rows, record.receiver, record.replicates)
        if self._footprints is not None:
            self._footprints.take(number, rows, steps)
        self.gaps.add(rows, steps)
        for part in spread(rows, steps, *cells.spacing):
            cells.add(grid, part, record.replicates * power)
            if self._points_to is not None:
                self._points_to(make_paths(radiance[part.row] * part.share, part.length_m))
        if record.replicates > 1:
            steps = steps.scaled(record.replicates**-0.5)
            for part in spread(rows, steps, *cells.spacing):
                cells.add(self.finer, part, power)

    def _gain(self, rows: PathRows) -> Real:
        gain = np.ones(rows.size)
        if self._link is not None:
            gain = self._link.mean_factor_of_rows(rows)
        if has_images(rows):
            gain = gain * interference_factors(rows, gain * rows["power_w"], *self._band)
        return gain


class _Smearing:
    """The point response over powers in cells: gives the profile and the map."""

    def __init__(
        self,
        radar: Radar,
        range_taper: str,
        doppler_taper: str,
        cells: _Cells,
        cells_per_sample: int,
    ) -> None:
        self._cells = cells
        self._range = _range_response(radar, range_taper, cells.step_m, cells_per_sample)
        weight = slow_time_window(doppler_taper, radar.burst.pulses)
        self._doppler = np.abs(np.fft.fft(weight / weight.sum())) ** 2

    def __call__(self, grid: Real) -> tuple[Real, Real]:
        powers = grid.reshape(self._cells.pulses, self._cells.ranges)
        along = _smear(_smear_doppler(powers, self._doppler), self._range)
        return _smear(powers.sum(axis=0)[None], self._range)[0], along


class _Replicates:
    """Mean of replicates and its standard error (Welford 1962), without keeping them."""

    def __init__(self, shape: int | tuple[int, int]) -> None:
        self.mean, self._squares, self._count = np.zeros(shape), np.zeros(shape), 0

    def add(self, values: Real) -> None:
        self._count += 1
        change = values - self.mean
        self.mean += change / self._count
        self._squares += change * (values - self.mean)

    def error(self) -> Real:
        """NaN where there is one: it says nothing of its error."""
        if self._count < 2:
            return np.full(self.mean.shape, np.nan)
        return np.asarray(np.sqrt(self._squares / (self._count - 1) / self._count))


class _Gaps:
    """Where most rays are further apart than range cells, in all replicates together."""

    _BINS = 200

    def __init__(self, range_limits_m: tuple[float, float], widest_m: float) -> None:
        self._window_m, self._widest_m = range_limits_m, widest_m
        self._counts = np.zeros((2, self._BINS))

    def add(self, rows: PathRows, steps: Steps) -> None:
        """Rows of a view."""
        # column by column: reductions over axes of two are slow
        reach_m = np.maximum.reduce(list(abs(steps.length_m).reshape(-1, 4).T)) / 2
        range_m = np.array(rows["length_m"]) / 2
        wide = reach_m > self._widest_m
        for count, ranges_m in enumerate((range_m, range_m[wide])):
            self._counts[count] += np.histogram(ranges_m, self._BINS, self._window_m)[0]

    def start_m(self) -> float:
        """Infinite where they are few."""
        held, sparse = self._counts[0] > 0, self._counts[1] > self._counts[0] / 2
        if not sparse.any() or sparse.sum() < 0.05 * held.sum():
            return math.inf
        first = int(np.argmax(sparse))
        low_m, high_m = self._window_m
        return low_m + (high_m - low_m) * first / self._BINS


class _Cells:
    """Cells of range and Doppler: a fraction of the sample spacing, and the bins of the map."""

    def __init__(self, radar: Radar, range_limits_m: tuple[float, float], per_sample: int) -> None:
        self._radar, self._start_m = radar, range_limits_m[0]
        self.step_m = radar.waveform.sample_spacing_m / per_sample
        stop_m = min(range_limits_m[1], radar.waveform.unambiguous_range_m)
        self.ranges = int((stop_m - range_limits_m[0]) / self.step_m) + 1
        self.pulses = radar.burst.pulses
        #: One Doppler bin [m/s].
        self.step_mps = radar.waveform.wavelength_m * radar.burst.prf_hz / 2 / self.pulses
        #: Points' distances in total length and range rate, and where a cell begins.
        self.spacing = self.step_m, self.step_mps, 2 * self._start_m - self.step_m

    @property
    def range_m(self) -> Real:
        """Centres of the range cells, (ranges,) [m]."""
        return np.asarray(self._start_m + self.step_m * np.arange(self.ranges), dtype=np.float64)

    def add(self, grid: Real, part: Points, power: Real) -> None:
        """Add the points that rows of these powers are spread over to the cells of a grid."""
        seen, number = self.of(part.length_m, part.range_rate_mps)
        # unbuffered: of a small tile few cells are touched
        np.add.at(grid, number, (power[part.row] * part.share)[seen])

    def of(
        self, length_m: Real, range_rate_mps: Real
    ) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
        """Points that are seen, again where they fold into a long window, and the cell of each."""
        waveform, burst, ranges = self._radar.waveform, self._radar.burst, self.ranges
        cell = (length_m / 2 - self._start_m) / self.step_m
        # it repeats with the pulses or the frequency steps; FMCW filters out what is beyond
        fold_m = burst.unambiguous_range_m
        if isinstance(waveform, LineWaveform):
            fold_m = math.inf if isinstance(waveform, FmcwWaveform) else waveform.range_period_m
        period = fold_m / self.step_m
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
        bins = np.rint(-range_rate_mps[seen] / self.step_mps).astype(np.int64)
        # Doppler folds, too
        return seen, (bins + self.pulses // 2) % self.pulses * ranges + column


def _range_response(radar: Radar, range_taper: str, step_m: float, cells_per_sample: int) -> Real:
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
        range_limits_m=(0.0, 2 * middle * step_m),
        range_taper=range_taper,
        oversample=cells_per_sample,
    )
    response = point.power[middle - cells : middle + cells + 1]
    return np.asarray(response / response[cells])


def _smear(grid: Real, response: Real) -> Real:
    """Convolve each row with a response whose peak is in its middle."""
    # What is further from the peak than the grid is long reaches nothing.
    middle, reach = response.size // 2, grid.shape[1] - 1
    response = response[max(middle - reach, 0) : middle + reach + 1]
    size = smooth_size(grid.shape[1] + response.size - 1)
    spectrum = np.fft.rfft(grid, size, axis=1) * np.fft.rfft(response, size)
    start = response.size // 2
    result = np.fft.irfft(spectrum, size, axis=1)[:, start : start + grid.shape[1]]
    return np.maximum(result, 0.0)


def _smear_doppler(grid: Real, response: Real) -> Real:
    """Circular convolution over Doppler."""
    spectrum = np.fft.fft(grid, axis=0) * np.fft.fft(response)[:, None]
    return np.maximum(np.fft.ifft(spectrum, axis=0).real, 0.0)
