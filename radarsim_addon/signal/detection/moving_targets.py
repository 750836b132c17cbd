# SPDX-License-Identifier: GPL-3.0-or-later
"""Movers of a frame: echoes with Doppler that no other echo's response explains.

A list of a map's peaks is no list of movers: a strong echo shows range and Doppler sidelobes, a
short chirp its paired echoes, the response between unwindowed frequencies falls with one over the
distance, and all that reaches in from beyond the range window too. So the list is made as CLEAN
makes one (Hogbom, A&A Suppl. 15, 417, 1974; with the re-estimation of RELAX, Li and Stoica, IEEE
TSP 44, 281, 1996), on a map that extends to where echoes are in the samples at all:

1. what stands still is taken out, exactly: W(f) / W(0) of the 0 Hz row;
2. the strongest peak that nothing explains is taken as an echo, its exact response
   (:mod:`.maps.single_echo`) subtracted, and what stands still estimated again;
3. a residual is explained where it is below a quarter of the envelope of what was subtracted
   there, or not above what scatterers slower than 1.25 cells may show at that Doppler.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...array_types import Complex, Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..echoes import Echoes
from ..maps import (
    PointResponse,
    RangeDopplerMap,
    Recording,
    cut_range_m,
    dynamics_db,
    point_response,
)
from ..radar import slow_time_window
from ..spectrum import TOLERANCE
from .peaks import Peak, local_maxima, peak_to_background_db, pulse_spectra, refine_peak

#: Fewer pulses tell no mover from what stands still.
_LEAST_PULSES = 16
#: Least |Doppler| of a mover, cells of the burst: below, it is in the main lobe of the 0 Hz ridge.
SLOWEST_CELLS = 1.5
#: Fastest scatterer that counts to the ridge, in cells, and a margin on what it shows (amplitude).
_RIDGE_CELLS, _RIDGE_MARGIN = 1.25, 1.2
#: Share of an echo's envelope down to which its response is trusted (amplitude).
_TRUST = 0.25
#: Least level of a mover over the mean noise of a cell, and over its surroundings [dB].
_OVER_NOISE_DB, _OVER_AROUND_DB = 15.0, 10.0
#: Cells (Doppler, range) around a target in which residuals are its own.
_GUARD_CELLS = (4, 8)
#: Echoes subtracted at most, and movers listed.
_MOST_ECHOES, _MOST_MOVERS = 40, 5
#: Least share of a peak's energy that its response holds, or else a folded Doppler is tried.
_FITS = 0.97
#: Rounds of the fit of an echo that the end of the record cuts.
_CUT_ROUNDS = 3


@dataclass(frozen=True)
class _Target:
    """A peak, with the echoes that were subtracted within the guard cells of it."""

    row: int
    col: int
    echoes: list[tuple[complex, PointResponse]]


@dataclass(frozen=True)
class _Fit:
    """A response fitted to a patch of the map.

    Attributes
    ----------
    response
        The response.
    own
        It, in the patch.
    amplitude
        Of least squares.
    share
        Of the patch's energy that it holds.
    """

    response: PointResponse
    own: Complex
    amplitude: complex
    share: float

    @classmethod
    def of(cls, response: PointResponse, own: Complex, patch: Complex) -> _Fit:
        """By least squares."""
        norm = max(float(np.vdot(own, own).real), 1e-300)
        product = complex(np.vdot(own, patch))
        energy = max(float(np.vdot(patch, patch).real), 1e-300)
        return cls(response, own, product / norm, abs(product) ** 2 / (norm * energy))


def heard_window_m(echoes: Echoes) -> tuple[float, float]:
    """Ranges whose echoes are in the samples, wholly or in part [m].

    All of them where frequencies are sampled; of pulses a pulse's length more than the window.
    """
    waveform = echoes.radar.waveform
    if waveform.family == "line":
        return 0.0, waveform.unambiguous_range_m
    start_m, stop_m = echoes.range_limits_m
    reach_m = SPEED_OF_LIGHT_MPS * waveform.duration_s / 2
    return max(start_m - reach_m, 0.0), stop_m + reach_m


def received_recording(echoes: Echoes, rd_map: RangeDopplerMap, mti: int) -> Recording:
    """The map over all ranges that are heard."""
    return Recording.over(echoes, heard_window_m(echoes), rd_map, mti)


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
) -> list[Peak]:
    """Movers in the range window, strongest first, five at most.

    Parameters
    ----------
    echoes
        What the map was made of.
    rd_map
        Range-Doppler map over ``echoes.range_limits_m``.
    mti
        Pulses of the canceller that the map was made with, 0 for none.
    tolerance
        That of the synthesis: what is 20 dB above its error is no rounding.
    noise_power
        Mean noise of a cell: what does not stand 15 dB above it is not told from noise.
    slowest_cells
        Least |Doppler| of a mover, cells of 1 / (pulses x interval).
    noisy_columns
        Whether strong echoes that stand still have noise of their own at all Dopplers (phase
        noise): then a mover stands 15 dB above the median of its range cell.
    recording
        From `received_recording`, where it is there already.

    Returns
    -------
    list of Peak
        Range in the middle of the burst; empty for fewer than 16 pulses.
    """
    if rd_map.values.shape[0] < _LEAST_PULSES:
        return []
    recording = recording or received_recording(echoes, rd_map, mti)
    floor = recording.strongest * 10 ** (-dynamics_db(tolerance) / 10)
    floor = max(floor, noise_power * 10 ** (_OVER_NOISE_DB / 10))
    search = _Search(recording, floor, 10 * tolerance, slowest_cells, noisy_columns)
    start_m, stop_m = float(rd_map.range_m[0]), float(rd_map.range_m[-1])
    slack_m = float(rd_map.range_m[1] - start_m) / 2 if rd_map.range_m.size > 1 else 0.0
    found = []
    for target in search.targets():
        peak = search.refined(target)
        speed = abs(peak.doppler_hz) * rd_map.values.shape[0] / rd_map.radar.burst.prf_hz
        inside = start_m - slack_m <= peak.range_m <= stop_m + slack_m
        if inside and speed >= slowest_cells:
            col = int(np.argmin(np.abs(rd_map.range_m - peak.range_m)))
            above_db = peak_to_background_db(rd_map.power, target.row, col)
            found.append(dataclasses.replace(peak, peak_to_background_db=above_db))
    return sorted(found, key=lambda peak: -peak.level_db)[:_MOST_MOVERS]


class _Search:
    """State of the search: the residual map and the envelope of what was taken out of it."""

    def __init__(
        self,
        recording: Recording,
        floor: float,
        error: float,
        slowest_cells: float,
        noisy_columns: bool,
    ) -> None:
        rd_map = recording.rd_map
        self._recording, self._floor, self._error = recording, floor, error
        self._pulses = rd_map.values.shape[0]
        self._zero = self._pulses // 2
        self._residual = rd_map.values.copy()
        self._envelope = np.zeros(rd_map.values.shape)
        weight = slow_time_window(rd_map.doppler_taper, self._pulses)
        self._still = _line(weight, 0.0)
        self._ridge = _ridge_shape(weight)
        rows = np.abs(np.arange(self._pulses) - self._zero)
        self._wanted = rows >= max(2, math.floor(slowest_cells))
        self._noisy_columns = noisy_columns
        self._cuts = recording.echoes.radar.waveform.family == "pulse"
        self._take_still()

    def _take_still(self) -> None:
        row = self._residual[self._zero].copy()
        for i in np.flatnonzero(np.abs(self._still) > 1e-15):
            self._residual[i] -= self._still[i] * row

    def targets(self) -> list[_Target]:
        """All targets, those beyond the window among them."""
        found: list[_Target] = []
        refused = np.zeros(self._residual.shape, dtype=bool)
        for _ in range(_MOST_ECHOES):
            place = self._strongest(found, refused)
            if place is None:
                break
            row, col, near = place
            if near is None:
                near = _Target(row, col, [])
                found.append(near)
            near.echoes.append(self._take(row, col, new=not near.echoes))
            self._take_still()
        return found

    def _strongest(
        self, found: list[_Target], refused: NDArray[np.bool_]
    ) -> tuple[int, int, _Target | None] | None:
        """Cell of the strongest peak that nothing explains, and the target it belongs to."""
        power = np.abs(self._residual) ** 2
        ridge = np.maximum(power[self._zero - 1], power[self._zero + 1])
        least = np.maximum(self._floor, (_TRUST * self._envelope) ** 2)
        least = np.maximum(least, (_RIDGE_MARGIN * self._ridge[:, None]) ** 2 * ridge)
        if self._noisy_columns:
            median = np.median(power, axis=0)
            least = np.maximum(least, 10 ** (_OVER_NOISE_DB / 10) * median)
        peaks = local_maxima(power) & (power > least) & self._wanted[:, None] & ~refused
        rows, cols = np.nonzero(peaks)
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

    def _take(self, row: int, col: int, new: bool) -> tuple[complex, PointResponse]:
        """Subtract the echo that peaks near a cell; its amplitude and response."""
        range_m, cycles = self._place(row, col)
        rows = (row + np.arange(-2, 3)) % self._pulses
        cols = np.arange(max(0, col - 4), min(self._residual.shape[1], col + 5))
        start_m, stop_m = self._recording.echoes.range_limits_m
        cut = new and not start_m <= range_m <= stop_m and self._cuts
        if cut:
            # cut by the end of the record: a broad peak, and sidelobes that hang on its place
            range_m = cut_range_m(self._recording, self._residual[row], range_m)
            cols = np.arange(self._residual.shape[1])
        patch = self._residual[np.ix_(rows, cols)]

        def fit(at_m: float, at_cycles: float, folds: int) -> _Fit:
            response = point_response(self._recording, at_m, at_cycles, folds)
            return _Fit.of(response, response.doppler[rows] @ response.ranges[:, cols], patch)

        found, folded = fit(range_m, cycles, 0), 0
        for folds in (-1, 1, -2, 2) if new else ():
            if found.share > _FITS:
                break
            other = fit(range_m, cycles, folds)
            if other.share > found.share:
                found, folded = other, folds
        if cut:
            found = self._settled(found, patch, range_m, cycles, lambda m, c: fit(m, c, folded))
        self._residual -= found.response.echo(found.amplitude)
        envelope = np.maximum(_envelope(found.response, row, col), self._error / _TRUST)
        self._envelope += abs(found.amplitude) * envelope
        return found.amplitude, found.response

    def _settled(
        self,
        found: _Fit,
        patch: Complex,
        range_m: float,
        cycles: float,
        fit: Callable[[float, float], _Fit],
    ) -> _Fit:
        """An echo that the end of the record cuts, by Gauss and Newton over range and Doppler.

        The cut changes while it migrates, so its peak is off in both.
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
        """Range [m] and Doppler [cycles per pulse] of a peak, to some hundredths of a cell."""
        pulses, range_m = self._pulses, self._recording.rd_map.range_m
        cols = np.clip(np.arange(col - 1, col + 2), 0, range_m.size - 1)
        trains = np.fft.ifft(np.fft.ifftshift(self._residual[:, cols], axes=0), axis=0)
        pulse = np.arange(pulses)
        fine = (row - self._zero + np.arange(-16, 17) / 16) / pulses
        spectra = np.abs(np.exp(-2j * np.pi * np.outer(fine, pulse)) @ trains)
        best = int(np.argmax(spectra[1:-1, 1])) + 1
        cycles = fine[best] + _vertex(spectra[best - 1 : best + 2, 1]) / 16 / pulses
        step_m = float(range_m[1] - range_m[0]) if range_m.size > 1 else 0.0
        return float(range_m[col]) + step_m * _vertex(spectra[best]), float(cycles)

    def refined(self, target: _Target) -> Peak:
        """A target's peak in the map without all other targets."""
        values = self._residual.copy()
        for amplitude, response in target.echoes:
            values += response.echo(amplitude)
        alone = dataclasses.replace(self._recording.rd_map, values=values)
        return refine_peak(alone, pulse_spectra(alone), target.row, target.col, 0.0)


def _line(weight: Real, cells: float) -> Complex:
    """Row by row, what a map shows of an echo at a Doppler of so many cells; 1 at its place."""
    pulse = np.arange(weight.size)
    train = weight / weight.sum() * np.exp(2j * np.pi * cells * pulse / weight.size)
    return np.asarray(np.fft.fftshift(np.fft.fft(train)))


def _ridge_shape(weight: Real) -> Real:
    """Most that one scatterer of the ridge shows in each row, over what it does next to 0 Hz.

    Of scatterers slower than `_RIDGE_CELLS`, after step 1 of the module.
    """
    zero, still = weight.size // 2, _line(weight, 0.0)
    shape = np.zeros(weight.size)
    for cells in np.linspace(0.05, _RIDGE_CELLS, 25):
        line = _line(weight, float(cells))
        line -= line[zero] * still
        level = np.abs(line)
        shape = np.maximum(shape, level / max(level[zero - 1], level[zero + 1]))
    return np.asarray(np.maximum(shape, np.roll(shape[::-1], 1 - weight.size % 2)))


def _envelope(response: PointResponse, row: int, col: int) -> Real:
    """Envelope of a response, without the nulls between its sidelobes, (Doppler, ranges)."""
    pulses, nodes = response.doppler.shape
    columns = response.ranges.shape[1]
    near = response.ranges[:, max(0, col - 4) : col + 5]
    # between the rows, too: an echo on a row shows its zeros in all others
    trains = np.fft.ifft(np.fft.ifftshift(response.doppler, axes=0), axis=0)
    half = np.exp(-1j * np.pi * np.arange(pulses) / pulses)[:, None]
    between = np.fft.fftshift(np.fft.fft(trains * half, axis=0), axes=0)
    lines = np.maximum(np.abs(response.doppler @ near), np.abs(between @ near)).max(axis=1)
    reach = 1 + math.ceil(nodes / 2)  # sidelobes in range of what migrates stand beside its row
    doppler = np.max([np.roll(lines, k) for k in range(-reach, reach + 1)], axis=0)
    profile = np.pad(np.abs(response.ranges).max(axis=0), 2)
    ranges = np.max([profile[k : k + columns] for k in range(5)], axis=0)
    envelope = np.outer(doppler, ranges)
    if response.image is not None:
        envelope += np.outer(
            np.abs(response.image.doppler).max(axis=1), np.abs(response.image.ranges).max(axis=0)
        )
    return envelope


def _vertex(values: Real) -> float:
    """Place of the maximum of a parabola through the logarithms of three values, -1/2 to 1/2."""
    low, middle, high = np.log(np.maximum(values, 1e-300))
    bend = low - 2 * middle + high
    return float(np.clip((low - high) / (2 * bend), -0.5, 0.5)) if bend < 0 else 0.0
