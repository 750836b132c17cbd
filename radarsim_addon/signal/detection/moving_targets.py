# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving targets of a frame: echoes with Doppler that no other echo's response explains.

The peaks of a map are not all targets: a strong echo has range and Doppler sidelobes, a short chirp
has paired echoes, the response between untapered frequencies falls with one over the distance, and
echoes beyond the range limits reach into the map. So the search works as CLEAN (Hogbom, A&A Suppl.
15, 417, 1974; with the re-estimation of RELAX, Li and Stoica, IEEE TSP 44, 281, 1996), on a map
over all ranges with echoes in the samples:

1. stationary echoes are removed exactly: W(f) / W(0) of the 0 Hz row;
2. the strongest unexplained peak is taken as an echo, its exact response
   (`maps.point_response`) subtracted, and the stationary part estimated again;
3. a residual is explained if it is below a quarter of the envelope of the subtracted responses, or
   not above the response of scatterers slower than 1.25 cells at that Doppler. A target that takes
   several echoes is no point: a few points do not have the sidelobes of its scatterers, so up to
   the whole envelope is taken for them. A residual up to eight times as large (amplitude) is a
   target only if a moving path is in its range cell and Doppler row, where the paths are known.

Where the radar moves, stationary objects have a Doppler, too, and 0 Hz is one like others. Then
nothing is removed at 0 Hz, and peaks are targets only where paths with a moving scatterer have more
power than all others, sidelobes included (`DopplerFolds.exceed_clutter`).

A map shows range rates modulo lambda PRF / 2, the paths have the true ones: `DopplerFolds` sums
their power by cell, and so tells how often a peak has folded.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...arrays import Complex, Integers, Mask, Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..echoes import Echoes
from ..maps import (
    PointResponse,
    RangeDopplerMap,
    RangeProfiles,
    Recording,
    cut_range_m,
    dynamics_db,
    fit_point,
    point_response,
)
from ..motion import mean_over_burst
from ..paths import Paths, path_power_w
from ..radar import Radar, slow_time_window
from ..spectrum import TOLERANCE
from .detections import Detection
from .peaks import (
    Peak,
    are_local_maxima,
    local_maxima,
    peak_to_background_db,
    refine_peak,
)

#: Fewer pulses do not separate moving from stationary targets.
_MIN_PULSES = 16
#: Smallest |Doppler| of a moving target [cells]: below, the main lobe of the 0 Hz ridge covers it.
SLOWEST_CELLS = 1.5
#: Fastest scatterer of the ridge [cells], and a margin on its response (amplitude).
_RIDGE_CELLS, _RIDGE_MARGIN = 1.25, 1.2
#: Fraction of an echo's envelope that its subtracted response may leave (amplitude), for a point
#: and for a target of many scatterers.
_POINT_LEAVES, _EXTENDED_LEAVES = 0.25, 1.0
#: Up to so many times that (amplitude) a peak without a moving path is a sidelobe: those of many
#: scatterers add up to several times those of the few echoes that stand for them.
_WITHOUT_PATH = 8.0
#: Smallest level of a target over the mean noise of a cell, and over its surroundings [dB].
_OVER_NOISE_DB, _OVER_AROUND_DB = 15.0, 10.0
#: Cells (Doppler, range) around a target in which residuals are its own.
_GUARD_CELLS = (4, 8)
#: Maximum number of subtracted echoes, and of listed targets.
_MAX_ECHOES, _MAX_TARGETS = 40, 5
#: Below this fraction of a peak's energy in its response, an ambiguous Doppler is tried.
_FITS = 0.97
#: Rounds of the fit of an echo that the end of the record cuts.
_CUT_ROUNDS = 3


def find_moving_targets(
    echoes: Echoes,
    rd_map: RangeDopplerMap,
    mti: int = 0,
    *,
    tolerance: float = TOLERANCE,
    noise_power: float = 0.0,
    slowest_cells: float = SLOWEST_CELLS,
    noisy_columns: bool = False,
    recording: Recording | None = None,
    folds: DopplerFolds | None = None,
) -> list[Peak]:
    """Find moving targets within the range limits: at most five, strongest first.

    Takes the samples, their map over ``echoes.range_limits_m`` and the pulses of its canceller (0:
    none). None is found with fewer than 16 pulses. `tolerance` is that of the synthesis: levels 20
    dB above its error are no rounding. `noise_power` is the mean noise of a cell; with
    `noisy_columns` strong stationary echoes have noise of their own at all Dopplers (phase noise),
    and a target also exceeds the median of its range cell by 15 dB. `slowest_cells` is the smallest
    |Doppler| in cells of 1 / (pulses x interval). `recording` is the result of
    `received_recording`; None: compute it. Without `folds`, an echo may have folded up to twice,
    and the radar is stationary.
    """
    if rd_map.values.shape[1] < _MIN_PULSES:
        return []
    recording = recording or received_recording(echoes, rd_map, mti)
    floor = recording.strongest * 10 ** (-dynamics_db(tolerance) / 10)
    floor = max(floor, noise_power * 10 ** (_OVER_NOISE_DB / 10))
    search = _Search(recording, floor, 10 * tolerance, slowest_cells, noisy_columns, folds)
    start_m, stop_m = float(rd_map.range_m[0]), float(rd_map.range_m[-1])
    slack_m = float(rd_map.range_m[1] - start_m) / 2 if rd_map.range_m.size > 1 else 0.0
    found = []
    for target in search.targets():
        peak = search.refined(target)
        speed = abs(peak.doppler_hz) * rd_map.values.shape[1] / rd_map.radar.burst.prf_hz
        inside = start_m - slack_m <= peak.range_m <= stop_m + slack_m
        if inside and (search.radar_moves or speed >= slowest_cells):
            col = int(np.argmin(np.abs(rd_map.range_m - peak.range_m)))
            above_db = peak_to_background_db(rd_map.plane_power, target.row, col)
            found.append(dataclasses.replace(peak, peak_to_background_db=above_db))
    return sorted(found, key=lambda peak: -peak.level_db)[:_MAX_TARGETS]


def received_recording(
    echoes: Echoes, rd_map: RangeDopplerMap, mti: int, compressed: RangeProfiles | None = None
) -> Recording:
    """Return the map over all ranges with echoes in the samples, complete or in part.

    `mti` is the number of pulses of the canceller of the map, `compressed` are the profiles before
    it; None: compute them.
    """
    waveform = echoes.radar.waveform
    if waveform.family == "line":  # sampled frequencies receive all ranges
        range_limits_m = 0.0, waveform.unambiguous_range_m
    else:
        start_m, stop_m = echoes.range_limits_m
        reach_m = SPEED_OF_LIGHT_MPS * waveform.duration_s / 2
        range_limits_m = max(start_m - reach_m, 0.0), stop_m + reach_m
    return Recording.over(echoes, range_limits_m, rd_map, mti, compressed)


class _Echo(NamedTuple):
    """A subtracted echo, and the cell of its peak."""

    amplitude: complex
    response: PointResponse
    row: int
    col: int


@dataclass(frozen=True)
class _Target:
    """A peak, with the echoes that were subtracted within its guard cells."""

    row: int
    col: int
    echoes: list[_Echo]

    @property
    def leaves(self) -> float:
        """Fraction of the envelope of the target's echoes that may remain after they are subtracted
        (amplitude).
        """
        first, *more = (abs(echo.amplitude) for echo in self.echoes)
        return min(max(sum(more) / first, _POINT_LEAVES), _EXTENDED_LEAVES)


@dataclass(frozen=True)
class _Fit:
    """A response fitted to a patch of the map, its values there; see :func:`.maps.fit_point`."""

    response: PointResponse
    own: Complex
    amplitude: complex
    fraction: float


class _Search:
    """State of the search: the residual map, and an upper limit of the residue of subtracted
    responses.
    """

    def __init__(
        self,
        recording: Recording,
        floor: float,
        error: float,
        slowest_cells: float,
        noisy_columns: bool,
        folds: DopplerFolds | None,
    ) -> None:
        rd_map = recording.rd_map
        self._folds = folds
        self._pathless = None if folds is None else ~folds.covers(rd_map)
        self.radar_moves = folds is not None and folds.radar_moves
        self._recording, self._floor, self._error = recording, floor, error
        self._pulses = rd_map.values.shape[1]
        self._zero = self._pulses // 2
        self._residual = rd_map.plane.copy()
        #: Amplitude that the subtracted echoes may have left.
        self._explained = np.zeros(self._residual.shape)
        weight = slow_time_window(rd_map.doppler_taper, self._pulses)
        self._still = doppler_line(weight, 0.0)
        self._ridge = ridge_shape(rd_map.doppler_taper, self._pulses, _RIDGE_CELLS)
        rows = np.abs(np.arange(self._pulses) - self._zero)
        self._wanted = (rows >= max(2, math.floor(slowest_cells)))[:, None]
        if folds is not None and folds.radar_moves:
            # 0 Hz is a Doppler like others: there may be a car that drives as fast as the radar
            self._still, self._ridge = np.zeros_like(self._still), np.zeros_like(self._ridge)
            self._wanted = folds.exceed_clutter(recording)
        self._noisy_columns = noisy_columns
        self._cuts = recording.echoes.radar.waveform.family == "pulse"
        self._take_still()

    def _take_still(self) -> None:
        row = self._residual[self._zero].copy()
        for i in np.flatnonzero(np.abs(self._still) > 1e-15):
            self._residual[i] -= self._still[i] * row

    def targets(self) -> list[_Target]:
        """Return all targets, including those beyond the range limits."""
        found: list[_Target] = []
        refused = np.zeros(self._residual.shape, dtype=bool)
        for _ in range(_MAX_ECHOES):
            place = self._strongest(found, refused)
            if place is None:
                break
            row, col, near = place
            if near is None:
                near = _Target(row, col, [])
                found.append(near)
            before = near.leaves if near.echoes else 0.0
            near.echoes.append(self._take(row, col, new=not near.echoes))
            # The residual that the last echo may leave. If the target's fraction has grown, its
            # earlier echoes may leave more, too.
            for echo in near.echoes:
                more = near.leaves - (0.0 if echo is near.echoes[-1] else before)
                if more:
                    around = envelope(echo.response, echo.row, echo.col)
                    around = np.maximum(around, self._error / _POINT_LEAVES)
                    self._explained += more * abs(echo.amplitude) * around
            self._take_still()
        return found

    def _strongest(
        self, found: list[_Target], refused: NDArray[np.bool_]
    ) -> tuple[int, int, _Target | None] | None:
        """Return the cell of the strongest peak that no target explains yet, and the target nearby,
        if any.
        """
        power = self._residual.real**2 + self._residual.imag**2
        loud = power > np.maximum(self._floor, self._explained**2)
        loud &= self._wanted
        loud &= ~refused
        rows, cols = np.nonzero(loud if self._explained.any() else loud & local_maxima(power))
        least = (_RIDGE_MARGIN * self._ridge[rows]) ** 2
        least *= np.maximum(power[self._zero - 1], power[self._zero + 1])[cols]
        if self._noisy_columns:
            median = np.median(power, axis=0)[cols]
            least = np.maximum(least, 10 ** (_OVER_NOISE_DB / 10) * median)
        if self._pathless is not None:
            sidelobes = (_WITHOUT_PATH * self._explained[rows, cols]) ** 2
            least = np.where(self._pathless[rows, cols], np.maximum(least, sidelobes), least)
        left = np.flatnonzero(power[rows, cols] > least)
        left = left[are_local_maxima(power, rows[left], cols[left])]
        rows, cols = rows[left], cols[left]
        for i in np.argsort(-power[rows, cols], kind="stable"):
            row, col = int(rows[i]), int(cols[i])
            for target in found:
                apart = abs(row - target.row)
                apart = min(apart, self._pulses - apart)
                if apart <= _GUARD_CELLS[0] and abs(col - target.col) <= _GUARD_CELLS[1]:
                    return row, col, target
            if peak_to_background_db(power, row, col) >= _OVER_AROUND_DB:
                return row, col, None
            refused[row, col] = True
        return None

    def _take(self, row: int, col: int, new: bool) -> _Echo:
        """Subtract the echo whose peak is near a cell, and return it."""
        range_m, cycles = self._place(row, col)
        rows = (row + np.arange(-2, 3)) % self._pulses
        cols = np.arange(max(0, col - 4), min(self._residual.shape[1], col + 5))
        start_m, stop_m = self._recording.echoes.range_limits_m
        cut = new and not start_m <= range_m <= stop_m and self._cuts
        if cut:
            # cut by the end of the record: a broad peak, and sidelobes that depend on its range
            range_m = cut_range_m(self._recording, self._residual[row], range_m)
            cols = np.arange(self._residual.shape[1])
        patch = self._residual[np.ix_(rows, cols)]

        def fit(at_m: float, at_cycles: float, folds: int) -> _Fit:
            response = point_response(self._recording, at_m, at_cycles, folds)
            own = response.doppler[rows] @ response.ranges[:, cols]
            return _Fit(response, own, *fit_point(own, patch))

        known = 0  # turns per pulse by which the Doppler of the paths there exceeds `cycles`
        if self._folds is not None:
            radar = self._recording.echoes.radar
            velocity_mps = -cycles * radar.burst.prf_hz * radar.waveform.wavelength_m / 2
            known = -(self._folds.order(range_m, velocity_mps) or 0)
        found, folded = fit(range_m, cycles, known), known
        for folds in (-1, 1, -2, 2) if new and not known else ():
            if found.fraction > _FITS:
                break
            other = fit(range_m, cycles, folds)
            if other.fraction > found.fraction:
                found, folded = other, folds
        if cut:
            found = self._settled(found, patch, range_m, cycles, lambda m, c: fit(m, c, folded))
        self._residual -= found.response.echo(found.amplitude)
        return _Echo(found.amplitude, found.response, row, col)

    def _settled(
        self,
        found: _Fit,
        patch: Complex,
        range_m: float,
        cycles: float,
        fit: Callable[[float, float], _Fit],
    ) -> _Fit:
        """Fit an echo that the end of the record cuts, by Gauss-Newton over range and Doppler.

        The cut part changes while the echo migrates, so the peak is displaced in both.
        """
        step_m = self._recording.echoes.radar.waveform.sample_spacing_m / 8
        step_cycles = 1 / (32 * self._pulses)
        for _ in range(_CUT_ROUNDS):
            terms = [found.own]
            for off_m, off_cycles in ((step_m, 0.0), (0.0, step_cycles)):
                more = fit(range_m + off_m, cycles + off_cycles).own
                less = fit(range_m - off_m, cycles - off_cycles).own
                terms.append((more - less) / 2)
            columns = np.stack([term.ravel() for term in terms], axis=1)
            value, *changes = np.linalg.lstsq(columns, patch.ravel(), rcond=None)[0]
            if not value:
                break
            moves = [min(max(float((change / value).real), -8.0), 8.0) for change in changes]
            range_m, cycles = range_m + step_m * moves[0], cycles + step_cycles * moves[1]
            found = fit(range_m, cycles)
        return found

    def _place(self, row: int, col: int) -> tuple[float, float]:
        """Return range [m] and Doppler [cycles per pulse] of a peak to hundredths of a cell."""
        pulses, range_m = self._pulses, self._recording.rd_map.range_m
        cols = np.clip(np.arange(col - 1, col + 2), 0, range_m.size - 1)
        trains = np.fft.ifft(np.fft.ifftshift(self._residual[:, cols], axes=0), axis=0)
        pulse = np.arange(pulses)
        fine = (row - self._zero + np.arange(-16, 17) / 16) / pulses
        turns = np.exp(-2j * np.pi * np.outer(fine, pulse))
        spectra = np.abs(np.einsum("fp,pr->fr", turns, trains))
        best = int(np.argmax(spectra[1:-1, 1])) + 1
        cycles = fine[best] + vertex(spectra[best - 1 : best + 2, 1]) / 16 / pulses
        step_m = float(range_m[1] - range_m[0]) if range_m.size > 1 else 0.0
        return float(range_m[col]) + step_m * vertex(spectra[best]), float(cycles)

    def refined(self, target: _Target) -> Peak:
        """Return the peak of a target in the map after all other targets are subtracted."""
        values = self._residual.copy()
        for echo in target.echoes:
            values += echo.response.echo(echo.amplitude)
        alone = dataclasses.replace(self._recording.rd_map, values=values[None])
        return refine_peak(alone, target.row, target.col, 0.0)


def doppler_line(weight: Real, cells: float) -> Complex:
    """Return the response of the map's rows to an echo at a Doppler in cells, relative
    to its peak.
    """
    pulse = np.arange(weight.size)
    train = weight / weight.sum() * np.exp(2j * np.pi * cells * pulse / weight.size)
    return np.asarray(np.fft.fftshift(np.fft.fft(train)))


@functools.lru_cache(4)
def ridge_shape(doppler_taper: str, pulses: int, fastest_cells: float) -> Real:
    """Return the largest response of slow clutter in each row, relative to that next to 0 Hz.

    The clutter is slower than `fastest_cells`. Stationary clutter is not included.
    """
    weight = slow_time_window(doppler_taper, pulses)
    zero, still = weight.size // 2, doppler_line(weight, 0.0)
    shape = np.zeros(weight.size)
    for cells in np.linspace(0.05, fastest_cells, 25):
        line = doppler_line(weight, float(cells))
        line -= line[zero] * still
        level = np.abs(line)
        shape = np.maximum(shape, level / max(level[zero - 1], level[zero + 1]))
    return np.asarray(np.maximum(shape, np.roll(shape[::-1], 1 - weight.size % 2)))


def envelope(response: PointResponse, row: int, col: int) -> Real:
    """Return the envelope of a response, with the nulls between sidelobes filled, (Doppler,
    ranges).
    """
    pulses, nodes = response.doppler.shape
    columns = response.ranges.shape[1]
    near = response.ranges[:, max(0, col - 4) : col + 5]
    # also between the rows: an echo on a row has its zeros in all others
    trains = np.fft.ifft(np.fft.ifftshift(response.doppler, axes=0), axis=0)
    half = np.exp(-1j * np.pi * np.arange(pulses) / pulses)[:, None]
    between = np.fft.fftshift(np.fft.fft(trains * half, axis=0), axes=0)
    lines = np.maximum(np.abs(response.doppler @ near), np.abs(between @ near)).max(axis=1)
    reach = 1 + math.ceil(nodes / 2)  # range sidelobes of a migrating echo are next to its row
    doppler = np.max([np.roll(lines, k) for k in range(-reach, reach + 1)], axis=0)
    profile = np.pad(np.abs(response.ranges).max(axis=0), 2)
    ranges = np.max([profile[k : k + columns] for k in range(5)], axis=0)
    found = np.outer(doppler, ranges)
    if response.image is not None:
        found += np.outer(
            np.abs(response.image.doppler).max(axis=1), np.abs(response.image.ranges).max(axis=0)
        )
    return np.asarray(found)


def vertex(values: Real) -> float:
    """Return the maximum of a parabola through the logarithms of three values, -1/2 to 1/2."""
    low, middle, high = np.log(np.maximum(values, 1e-300))
    bend = low - 2 * middle + high
    return float(np.clip((low - high) / (2 * bend), -0.5, 0.5)) if bend < 0 else 0.0


_Folded = TypeVar("_Folded", Peak, Detection)
#: A target takes the paths within so many cells of range, and Doppler rows, of its peak.
_REACH_CELLS, _REACH_ROWS = 2, 2
#: More than any profile has.
_RANGE_CELLS = 1 << 31
#: Rounding of a convolution by Fourier transforms, of its largest value.
_ROUNDING = 1e-14


class DopplerFolds:
    """Power of the moving paths by range cell and Doppler cell before folding."""

    def __init__(self, radar: Radar) -> None:
        self._radar = radar
        self._rows = radar.burst.pulses
        self._interval_mps = 2 * radar.max_unambiguous_velocity_mps
        self._period_m = radar.range_period_m
        self._cell_m = radar.waveform.range_resolution_m
        #: Both cells in one number (a sort of pairs takes ten times as long), and of each the
        #: power, power times range rate, and power of what moves because the radar does.
        self._codes = np.zeros(0, dtype=np.int64)
        self._sums = np.zeros((3, 0))

    def add(self, paths: Paths) -> None:
        """Add paths. If neither the radar nor the scatterers move, they never fold."""
        rated = paths.range_rate_mps != 0
        clutter = np.zeros(len(paths), dtype=bool)
        if paths.motion is not None:
            rated = rated | paths.motion.moving
            clutter = paths.motion.moving & ~paths.motion.scatterers_move
        moving = np.flatnonzero(rated)
        range_m, rate = paths.range_m[moving], paths.range_rate_mps[moving]
        if self._rows > 1:
            burst_s = (self._rows - 1) / self._radar.burst.prf_hz
            range_m, rate = mean_over_burst(paths.lengths, burst_s, moving)
        cell, doppler = self._cells(range_m, rate)
        power = path_power_w(paths, self._radar.waveform.wavelength_m)[moving]
        joined = np.concatenate([self._codes, doppler * _RANGE_CELLS + cell])
        self._codes, place = np.unique(joined, return_inverse=True)
        own = [power, power * rate, power * clutter[moving]]
        parts = np.concatenate([self._sums, own], axis=1)
        self._sums = np.stack([np.bincount(place, part) for part in parts])

    def _cells(self, range_m: Real, rate_mps: Real) -> tuple[Integers, Integers]:
        """Return the range cell and the Doppler cell before folding, of paths or of a peak."""
        if math.isfinite(self._period_m):
            range_m = np.mod(range_m, self._period_m)
        doppler = np.rint(rate_mps / self._interval_mps * self._rows)
        limit = _RANGE_CELLS - 1
        cell = np.clip(np.rint(range_m / self._cell_m), 0, limit).astype(np.int64)
        return cell, np.clip(doppler, -limit, limit).astype(np.int64)

    @property
    def radar_moves(self) -> bool:
        """True if stationary scatterers have a Doppler because an antenna moves."""
        return bool(self._sums[2].any())

    def _known(self) -> tuple[Integers, Integers, Integers]:
        """Return the range cell, the Doppler row and the number of Doppler folds of each path that
        was added.
        """
        doppler, cell = np.divmod(self._codes, _RANGE_CELLS)
        return cell, doppler % self._rows, (doppler + self._rows // 2) // self._rows

    def exceed_clutter(self, recording: Recording) -> Mask:
        """Return the cells of a map in which moving scatterers have more power than stationary
        scatterers, (Doppler, ranges).

        The powers are those of the paths. The sidelobes of the map spread each power over Doppler
        and range, because a stationary echo can hide a moving target at another Doppler.
        """
        rd_map = recording.rd_map
        (count, size), range_m = rd_map.plane.shape, rd_map.range_m
        cell, known_row, _ = self._known()
        power, moment, clutter = self._sums
        rate = np.divide(moment, power, out=np.zeros_like(power), where=power > 0)
        row = np.rint(-known_row * count / self._rows).astype(np.int64) + count // 2
        shown_m = cell * self._cell_m + rate * self._later_s
        spacing_m = float(range_m[1] - range_m[0]) if size > 1 else self._cell_m
        col = np.rint((shown_m - range_m[0]) / spacing_m).astype(np.int64)
        inside = (col >= 0) & (col < size)
        parts = np.zeros((2, count, size))
        for part, own in zip(parts, (power - clutter, clutter), strict=True):
            np.add.at(part, (row[inside] % count, col[inside]), own[inside])
        middle, weight = size // 2, slow_time_window(rd_map.doppler_taper, count)
        echo = np.abs(point_response(recording, float(range_m[middle]), 0.0).ranges[0]) ** 2
        line = np.abs(doppler_line(weight, 0.0)) ** 2
        moving = _spread(parts[0], line, echo)
        # places within cells are not known: of clutter the sidelobes count, not the nulls between
        between = [np.abs(doppler_line(weight, cells)) ** 2 for cells in (-0.5, 0.5)]
        reach = math.ceil(self._radar.waveform.sample_spacing_m / spacing_m / 2)
        around = np.pad(echo, reach)
        shifted = [around[n : n + size] for n in range(2 * reach + 1)]
        stationary = _spread(parts[1], np.max([line, *between], axis=0), np.max(shifted, axis=0))
        return np.asarray(moving > stationary + _ROUNDING * float(parts.max(initial=0.0)))

    def covers(self, rd_map: RangeDopplerMap) -> Mask:
        """Return the cells of a map in which a path of a moving scatterer may cause a peak,
        (Doppler, ranges).
        """
        range_m, rows, count = rd_map.range_m, self._rows, rd_map.plane.shape[0]
        edges = np.zeros((count, range_m.size + 1))
        power, _, clutter = self._sums
        cell, known_row, order = (part[clutter < power] for part in self._known())
        centre_m = cell * self._cell_m
        # a map after a canceller has fewer rows
        row = np.rint(-known_row * count / rows).astype(np.int64) + count // 2
        reach_m = self._reach_m(order)
        first, last = (np.searchsorted(range_m, centre_m + s * reach_m) for s in (-1, 1))
        for apart in range(-_REACH_ROWS, _REACH_ROWS + 1):
            np.add.at(edges, ((row + apart) % count, first), 1)
            np.add.at(edges, ((row + apart) % count, last), -1)
        return np.asarray(edges.cumsum(axis=1)[:, :-1] > 0)

    def _reach_m(self, order: Integers) -> Real:
        """Return how far from its range the peak of a path may be, because a chirp turns Doppler
        into range [m].
        """
        fastest_mps = (np.abs(order) + 0.5) * self._interval_mps
        return np.asarray(_REACH_CELLS * self._cell_m + fastest_mps * self._later_s)

    @property
    def _later_s(self) -> float:
        """Time after which an echo is at the range where a chirp shows it now, f0 / K [s]; 0
        without a chirp.
        """
        waveform = self._radar.waveform
        if waveform.kind not in ("lfm", "fmcw", "stepped"):
            return 0.0
        return float(waveform.duration_s * waveform.carrier_hz / waveform.bandwidth_hz)

    def order(self, range_m: float, velocity_mps: float) -> int | None:
        """Return how many times the strongest paths at a peak of the map have folded.

        Their range rate is `velocity_mps` plus this number times lambda PRF / 2. None: there is no
        moving path.
        """
        own_cell, own_doppler = self._cells(np.array(range_m), np.array(velocity_mps))
        cell, row, order = self._known()
        apart = np.abs(row - own_doppler % self._rows)
        near = np.minimum(apart, self._rows - apart) <= _REACH_ROWS
        near &= np.abs(cell - own_cell) * self._cell_m <= self._reach_m(order)
        if not near.any():
            return None
        _, place = np.unique(order[near], return_inverse=True)
        power, moment = (np.bincount(place, part[near]) for part in self._sums[:2])
        strongest = int(np.argmax(power))
        rate_mps = float(moment[strongest] / power[strongest]) if power[strongest] > 0 else 0.0
        return round((rate_mps - velocity_mps) / self._interval_mps)

    def unfolded(self, targets: Iterable[_Folded]) -> list[_Folded]:
        """Return the targets with the range rate of the paths that cause them."""
        found = []
        for target in targets:
            order = self.order(target.range_m, target.velocity_mps)
            rate = None if order is None else target.velocity_mps + order * self._interval_mps
            found.append(dataclasses.replace(target, unfolded_velocity_mps=rate))
        return found


def _spread(power: Real, line: Real, echo: Real) -> Real:
    """Convolve (Doppler, ranges) with responses centred in their arrays. Doppler wraps, range does
    not.
    """
    count, size = power.shape
    spectrum = np.fft.rfft(np.fft.ifftshift(line))[:, None]
    power = np.fft.irfft(np.fft.rfft(power, axis=0) * spectrum, count, axis=0)
    spectrum = np.fft.rfft(echo, 2 * size)
    power = np.fft.irfft(np.fft.rfft(power, 2 * size) * spectrum, 2 * size)
    return np.asarray(power[:, size // 2 : size // 2 + size])


def velocity_before_folding_mps(target: Peak | Detection) -> float | None:
    """Return the true range rate of a target whose Doppler has folded. None: it has not folded, or
    the rate is unknown.
    """
    true_mps = target.unfolded_velocity_mps
    return None if true_mps is None or true_mps == target.velocity_mps else true_mps
