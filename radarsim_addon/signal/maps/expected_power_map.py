# SPDX-License-Identifier: GPL-3.0-or-later
"""Standard errors of range profile and range-Doppler map, from replicates.

In the sampling mode "paths" every tile is measured with several replicates: its grid, moved by
fractions of a pixel. Each replicate is an estimate of profile and map; the scatter of the estimates
gives the variance of their mean. Replicates are spread more evenly than by chance, so the error is,
if anything, too large.

The powers are sorted into cells (Doppler, range), each path over all that its pixel covers
(`paths.spread`), and smeared by the point response. Where surfaces bend within a pixel (the limb of
a sphere) all replicates have the same error. All S of them together are a grid S times as dense, so
each path may be spread over an S-th of its pixel instead; what that changes is part of the standard
error.

Clutter has planes of its own among the cells (`scattering.ClutterSurfaces`), each smeared with the
Doppler spectrum of its scatterers; they give the powers of clutter alone, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import Indices, Integers, Real
from ...errors import ConfigError
from ...findings import Finding, finding
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..decoding import FrameInput, as_input
from ..paths import (
    NEGLIGIBLE_FRACTION,
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
    usable,
    views_by_replicate,
)
from ..radar import Radar, slow_time_window
from ..runs import RadarFrame
from ..scattering import STILL_PLANE, ClutterSurfaces, Link, interference_factors, reverse_factors
from ..spectrum import check_finite, repeat_orders, smooth_size
from .range_compression import expected_power_profile

#: Rows of a table that is treated at once, and cells of the grids of all its replicates: 32 MB.
_SMALL_TABLE, _MOST_CELLS = 1 << 16, 1 << 22
#: Cells in a bin of Doppler of the planes of clutter.
FINER = 4
#: Up to so many rows of Doppler are convolved one by one, faster than by a transform of all.
_FEW_ROWS = 16


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
    clutter_profile, clutter_profile_error, clutter_map, clutter_map_error
        The same of clutter alone; None where no surface is clutter and no rain returns power.
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
    clutter_profile: Real | None = None
    clutter_profile_error: Real | None = None
    clutter_map: Real | None = None
    clutter_map_error: Real | None = None
    gaps_from_m: float = math.inf

    @property
    def findings(self) -> list[Finding]:
        """The finding on gaps between single rays, if there are any."""
        if math.isinf(self.gaps_from_m):
            return []
        return [finding("range-gaps-between-rays", range_m=self.gaps_from_m)]

    def cell(self, range_m: float, doppler_hz: float) -> tuple[int, int]:
        """Return row and column of the map cell nearest to a range and a Doppler. The Doppler may
        fold.
        """
        rows = self.doppler_hz.size
        step_hz = self.doppler_hz[1] - self.doppler_hz[0] if rows > 1 else 1.0
        step_m = self.range_m[1] - self.range_m[0] if self.range_m.size > 1 else 1.0
        row = (round(doppler_hz / step_hz) + rows // 2) % rows
        column = round((range_m - self.range_m[0]) / step_m)
        return row, min(max(column, 0), self.range_m.size - 1)


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
        Points of the air that return power, too. None: none.

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
    cells = PowerCells(radar, frame_input.range_limits_m, cells_per_sample)
    raining = volume is not None and volume.size > 0
    surfaces = ClutterSurfaces(frame_input, rain=raining)
    smeared = Smearing(
        radar,
        range_taper,
        doppler_taper,
        cells.step_m,
        cells_per_sample,
        surfaces.correlations(np.arange(cells.pulses) / radar.burst.prf_hz),
    )
    sums = _TableSums(
        frame_input, cells, range_taper, receiver_gain, link, points_to, footprints, surfaces
    )
    if volume is not None and raining:
        sums.add_volume(volume)
    # all power, and that of clutter: planes from this one on
    starts = (0, STILL_PLANE) if surfaces.planes > 1 else (0,)
    shapes = cells.ranges, (cells.pulses, cells.ranges)
    means = [ReplicateMean(shape) for _ in starts for shape in shapes]

    def every(planes: list[Real]) -> list[Real]:
        return [values for start in starts for values in smeared(planes, start)]

    for planes in sums.replicates(table.rows):
        for mean, values in zip(means, every(planes), strict=True):
            mean.add(values)
    found = [
        (mean.mean, np.sqrt(mean.variance() + (mean.mean - values) ** 2))
        for mean, values in zip(means, every(sums.finer), strict=True)
    ]
    (profile, image), clutter = found[:2], found[2:]
    of_clutter: dict[str, Real] = {}
    for name, (mean_w, error_w) in zip(("clutter_profile", "clutter_map"), clutter, strict=False):
        of_clutter |= {name: mean_w, f"{name}_error": error_w}
    doppler_hz = np.fft.fftshift(np.fft.fftfreq(cells.pulses, 1 / radar.burst.prf_hz))
    gaps_from_m = sums.gaps.start_m()
    return ExpectedPower(
        cells.range_m, doppler_hz, *profile, *image, gaps_from_m=gaps_from_m, **of_clutter
    )


class _TableSums:
    """Sorts the power of a table's rows into cells, view by view.

    `finer` has every row spread over an S-th of its pixel, summed over all S replicates.
    """

    def __init__(
        self,
        frame_input: FrameInput,
        cells: PowerCells,
        range_taper: str,
        receiver_gain: float,
        link: Link | None,
        points_to: Callable[[Paths], None] | None,
        footprints: TableFootprints | None,
        surfaces: ClutterSurfaces,
    ) -> None:
        self._footprints, self._surfaces = footprints, surfaces
        self._grids = frame_input.table.grids
        radar, self._record = frame_input.radar, frame_input.table.record
        self._cells, self._link, self._points_to = cells, link, points_to
        waveform = radar.waveform
        self._band = waveform.carrier_hz, waveform.range_resolution_m, range_taper
        self._scale = receiver_gain * (self._record.carrier_hz / radar.waveform.carrier_hz) ** 2
        #: Clutter has a finer grid of Doppler: its sidelobes next to targets count.
        self._fine = cells.finer(FINER)
        clutter = [np.zeros(self._fine.shape) for _ in range(STILL_PLANE, surfaces.planes)]
        self.finer = [np.zeros(cells.shape), *clutter]
        self._volume = [np.zeros_like(plane) for plane in self.finer]
        self.gaps = RayGaps(
            frame_input.range_limits_m,
            radar.waveform.range_resolution_m * self._record.replicates,
        )

    def replicates(self, table: PathRows) -> Iterator[list[Real]]:
        """Yield the powers in cells of each replicate, plane by plane.

        All replicates of a small table are computed at once, because numpy has a high overhead for
        few rows.
        """
        count = self._record.replicates
        small = table.size <= _SMALL_TABLE and not has_images(table)
        if small and count * sum(plane.size for plane in self._volume) <= _MOST_CELLS:
            rows = table
            number = np.flatnonzero(usable(rows) & (rows["replicate"] < count))
            rows = rows if number.size == rows.size else rows[number]
            planes = [np.repeat(plane[None], count, axis=0) for plane in self._volume]
            self._add_rows(planes, number, rows, rows["replicate"].astype(np.int64))
            yield from map(list, zip(*planes, strict=True))
            return
        if self._link is not None and table.size <= _SMALL_TABLE:
            # find and keep all gains at once: of few rows they are all overhead
            rows = table
            number = np.flatnonzero(usable(rows))
            self._link.mean_factor_of_rows(rows[number], number)
        for views in views_by_replicate(table, count):
            planes = [plane[None].copy() for plane in self._volume]
            for number, rows in views:
                self._add_rows(planes, number, rows)
            yield [plane[0] for plane in planes]

    def add_volume(self, rows: PathRows) -> None:
        """Add points that are the same in all replicates. Call this before `replicates`."""
        gain = self._gain(rows)
        points = Points(
            np.arange(rows.size), rows["length_m"], rows["range_rate_mps"], np.ones(rows.size)
        )
        for planes in (self._volume, self.finer):
            self._fine.add_between(
                planes[STILL_PLANE], points, self._scale * gain * rows["power_w"]
            )
        if self._points_to is not None:
            radiance = gain * radiance_of(rows, self._record) * rows["solid_angle_sr"]
            self._points_to(make_paths(radiance, np.array(rows["length_m"])))

    def _add(
        self,
        planes: list[Real],
        part: Points,
        power: Real,
        rows: PathRows,
        grid_of: Integers | None = None,
    ) -> None:
        """Add the points of rows to their planes. With several grids, `grid_of` is the grid of each
        row.
        """
        if len(planes) == 1:
            self._cells.add(planes[0], part, power, grid_of)
            return
        plane_of_point = self._surfaces.planes_of(rows)[part.row]
        for plane in np.unique(plane_of_point).tolist():
            mine = plane_of_point == plane
            row, length_m, share = part.row[mine], part.length_m[mine], part.share[mine]
            rate_mps = part.range_rate_mps[mine]
            if not plane:
                points = Points(row, length_m, rate_mps, share)
                self._cells.add(planes[0], points, power, grid_of)
                continue
            for strength, added_mps in self._surfaces.lines(plane, rows):
                points = Points(row, length_m, rate_mps + added_mps[row], strength * share)
                self._fine.add_between(planes[plane], points, power, grid_of)

    def _add_rows(
        self,
        planes: list[Real],
        number: Indices,
        rows: PathRows,
        grid_of: Integers | None = None,
    ) -> None:
        """Add the rows of views to planes, (grids, ...).

        `number` are their numbers in the table. `grid_of` is the grid of each row; None: there is
        one grid.
        """
        record, cells = self._record, self._cells
        check_finite(rows["length_m"], number, "length")
        gain = self._gain(rows, number)
        power = self._scale * gain * rows["power_w"]
        radiance = gain * radiance_of(rows, record) * rows["solid_angle_sr"]
        steps = steps_of(rows, record.receiver, record.replicates, self._grids.of_views(number))
        if self._footprints is not None:
            self._footprints.take(number, rows, steps)
        self.gaps.add(rows, steps, power)
        views = len(planes[0])
        whole = record.replicates * power
        for part in spread(rows, steps, *cells.spacing, views):
            self._add(planes, part, whole, rows, grid_of)
            if self._points_to is not None:
                self._points_to(make_paths(radiance.take(part.row) * part.share, part.length_m))
        if record.replicates > 1:
            steps = steps.scaled(record.replicates**-0.5)
            for part in spread(rows, steps, *cells.spacing, views):
                self._add(self.finer, part, power, rows)

    def _gain(self, rows: PathRows, number: Indices | None = None) -> Real:
        gain = np.ones(rows.size)
        if self._link is not None:
            gain = self._link.mean_factor_of_rows(rows, number)
        if has_images(rows):
            gain = gain * interference_factors(rows, gain * rows["power_w"], *self._band)
        return gain * reverse_factors(rows, self._record, *self._band[:2])


class PowerCells:
    """Cells of range and Doppler: fractions of the sample spacing, and of the bins of the map."""

    def __init__(
        self,
        radar: Radar,
        range_limits_m: tuple[float, float],
        per_sample: int,
        per_bin: int = 1,
    ) -> None:
        self._given, self._per_bin = (radar, range_limits_m, per_sample), per_bin
        self._start_m, waveform = range_limits_m[0], radar.waveform
        self.step_m = waveform.sample_spacing_m / per_sample
        self._period = radar.range_period_m / self.step_m
        stop_m = min(range_limits_m[1], radar.waveform.unambiguous_range_m)
        self.ranges = int((stop_m - range_limits_m[0]) / self.step_m) + 1
        self.pulses = radar.burst.pulses
        self.shape = self.pulses * per_bin, self.ranges
        #: One cell of Doppler [m/s].
        self.step_mps = radar.waveform.wavelength_m * radar.burst.prf_hz / 2 / self.shape[0]
        #: Points' distances in total length (a cell) and range rate, and where a cell begins.
        self.spacing = 2 * self.step_m, self.step_mps, 2 * self._start_m - self.step_m

    def finer(self, per_bin: int) -> PowerCells:
        """Return the same cells with `per_bin` cells in each Doppler bin. The first cell is in the
        middle of its bin.
        """
        return PowerCells(*self._given, per_bin)

    @property
    def range_m(self) -> Real:
        """Centres of the range cells, (ranges,)."""
        return np.asarray(self._start_m + self.step_m * np.arange(self.ranges), dtype=np.float64)

    def add(self, grid: Real, part: Points, power: Real, grid_of: Integers | None = None) -> None:
        """Add the power of rows to the cells of a grid, at the points `part` that the rows are
        spread over. With several grids, (grids, ...), `grid_of` is the grid of each row.
        """
        seen, number = self.of(part.length_m, part.range_rate_mps)
        row, share = part.row.take(seen), part.share.take(seen)
        if grid_of is not None:
            number += (grid_of * math.prod(self.shape)).take(row)
        # unbuffered: of a small tile few cells are touched
        np.add.at(grid.ravel(), number, power.take(row) * share)

    def add_between(
        self, grid: Real, part: Points, power: Real, grid_of: Integers | None = None
    ) -> None:
        """Add as `add` does, but divide each point between the two cells of Doppler next to it."""
        place = part.range_rate_mps / self.step_mps
        below = np.floor(place)
        for cell, share in ((below, below + 1 - place), (below + 1, place - below)):
            points = Points(part.row, part.length_m, cell * self.step_mps, share * part.share)
            self.add(grid, points, power, grid_of)

    def of(
        self, length_m: Real, range_rate_mps: Real
    ) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
        """Return the indices of the points that are within the map, and the cell of each.

        If the range limits are wider than the range period, a point is seen at several ranges. Its
        index then occurs several times.
        """
        ranges, period = self.ranges, self._period
        cell = (length_m / 2 - self._start_m) / self.step_m
        if math.isinf(period):
            seen = np.flatnonzero((cell >= -0.5) & (cell < ranges - 0.5))
            place = np.rint(cell.take(seen))
        else:
            low = np.ceil((cell - (ranges - 0.5)) / period)
            copies = np.maximum(np.floor((cell + 0.5) / period) - low + 1, 0).astype(np.intp)
            seen = np.repeat(np.arange(copies.size), copies)
            place = np.rint(cell[seen] - repeat_orders(low, copies) * period)
        column = np.clip(place, 0, ranges - 1).astype(np.int64)  # halves are rounded to even
        bins = np.rint(-range_rate_mps.take(seen) / self.step_mps).astype(np.int64)
        bins += self.pulses // 2 * self._per_bin
        if bins.min(initial=0) < 0 or bins.max(initial=0) >= self.shape[0]:
            bins %= self.shape[0]  # Doppler folds, too
        return seen, bins * ranges + column


class ReplicateMean:
    """Mean of replicates and its standard error (Welford 1962), without keeping them."""

    def __init__(self, shape: int | tuple[int, int]) -> None:
        self.mean, self._squares, self._count = np.zeros(shape), np.zeros(shape), 0

    def add(self, values: Real) -> None:
        self._count += 1
        change = values - self.mean
        self.mean += change / self._count
        change *= values - self.mean
        self._squares += change

    def variance(self) -> Real:
        """Return the variance of the mean. It is NaN for one replicate, which gives no error."""
        if self._count < 2:
            return np.full(self.mean.shape, np.nan)
        return np.asarray(self._squares / ((self._count - 1) * self._count))


class Smearing:
    """Profiles and maps of planes of powers in cells, for tapers by name.

    `step_m` and `cells_per_sample` are those of the range cells. `correlations`, (pulses,) for each
    plane, give at lags of the pulses how its echoes keep from pulse to pulse apart from their
    Doppler: 1 for scatterers that do not move by themselves, as in the first plane.
    """

    def __init__(
        self,
        radar: Radar,
        range_taper: str,
        doppler_taper: str,
        step_m: float,
        cells_per_sample: int,
        correlations: Sequence[Real],
    ) -> None:
        self._range = _range_response(radar, range_taper, step_m, cells_per_sample)
        weight = slow_time_window(doppler_taper, radar.burst.pulses)
        weight = weight / weight.sum()
        self._doppler = [
            _doppler_response(weight, one, FINER if plane else 1)
            for plane, one in enumerate(correlations)
        ]

    def __call__(self, planes: Sequence[Real], first: int = 0) -> tuple[Real, Real]:
        """Return profile (ranges,) and map (pulses, ranges) of all planes from `first` on,
        together.

        Planes are (pulses, ranges) the first, with `FINER` times as many rows the others.
        """
        profile: Real | float = 0.0
        image: Real | float = 0.0
        for plane in range(first, len(planes)):
            profile = profile + planes[plane].sum(axis=0)
            step = FINER if plane else 1
            # most rows of Doppler are empty
            held = np.flatnonzero(planes[plane].any(axis=1))
            in_range = _smear(planes[plane][held], self._range)
            image = image + _smear_doppler(in_range, held, self._doppler[plane], step)
        return _smear(np.atleast_2d(profile), self._range)[0], np.asarray(image)


def _doppler_response(weight: Real, correlation: Real, finer: int) -> Real:
    """Return the power response of a burst over Doppler, in cells counted from the echo's own,
    (finer x pulses,).
    """
    cells = finer * weight.size
    if np.all(correlation == 1):
        return np.asarray(np.abs(np.fft.fft(weight, cells)) ** 2)
    # the spectrum of the taper's own correlation times the echoes', at lags of both signs
    squared = np.abs(np.fft.fft(weight, cells)) ** 2
    ahead = np.fft.ifft(squared).real[: weight.size] * correlation
    lags = np.zeros(cells)
    lags[: weight.size] = ahead
    lags[cells - weight.size + 1 :] += ahead[:0:-1]
    return np.asarray(np.maximum(np.fft.fft(lags).real, 0.0))


def _range_response(radar: Radar, range_taper: str, step_m: float, cells_per_sample: int) -> Real:
    """Return |h|^2 over range cells, with its peak in the middle."""
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


def _smear_doppler(rows: Real, held: Indices, response: Real, step: int) -> Real:
    """Convolve rows with a response over Doppler, circularly, and return every `step`-th row.

    `held` are the places of the rows; all other rows are empty.
    """
    count = response.size
    if held.size <= _FEW_ROWS:
        # sidelobes keep their digits where they are far below the strongest row, too
        shifts = (np.arange(0, count, step)[:, None] - held) % count
        return np.asarray(np.einsum("dh,hr->dr", response[shifts], rows))
    grid = np.zeros((count, rows.shape[1]))
    grid[held] = rows
    spectrum = np.fft.rfft(grid, axis=0) * np.fft.rfft(response)[:, None]
    return np.maximum(np.fft.irfft(spectrum, count, axis=0), 0.0)[::step]


class RayGaps:
    """Ranges at which most rays are further apart than range cells, in all replicates together.

    Ranges with less than `NEGLIGIBLE_FRACTION` of the received power do not count.
    """

    _BINS = 200

    def __init__(self, range_limits_m: tuple[float, float], widest_m: float) -> None:
        self._window_m, self._widest_m = range_limits_m, widest_m
        self._counts = np.zeros((2, self._BINS))
        self._power_w, self._total_w = np.zeros(self._BINS), 0.0

    def add(self, rows: PathRows, steps: Steps, power_w: Real) -> None:
        """Add the rows of a view with their powers, (n,)."""
        # column by column: reductions over axes of two are slow
        reach_m = np.maximum.reduce(list(abs(steps.length_m).reshape(-1, 4).T)) / 2
        range_m = np.array(rows["length_m"]) / 2
        wide = reach_m > self._widest_m
        for count, ranges_m in enumerate((range_m, range_m[wide])):
            self._counts[count] += np.histogram(ranges_m, self._BINS, self._window_m)[0]
        self._power_w += np.histogram(range_m, self._BINS, self._window_m, weights=power_w)[0]
        self._total_w += float(power_w.sum())

    def start_m(self) -> float:
        """Return the range beyond which rays leave gaps; infinite if there are few gaps."""
        held = self._power_w > NEGLIGIBLE_FRACTION * self._total_w
        sparse = held & (self._counts[1] > self._counts[0] / 2)
        if not sparse.any() or sparse.sum() < 0.05 * held.sum():
            return math.inf
        first = int(np.argmax(sparse))
        low_m, high_m = self._window_m
        return low_m + (high_m - low_m) * first / self._BINS
