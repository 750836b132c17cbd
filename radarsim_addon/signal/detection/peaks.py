# SPDX-License-Identifier: GPL-3.0-or-later
"""Interpolated peaks of a map, and leading edges of a profile.

A peak is a local maximum whose place is that of the trigonometric interpolation of the map
(`refine_peak`). A leading edge is the range where a profile first reaches half the power of a peak;
`find_edges` omits those that are sidelobes or paired echoes of stronger peaks.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...arrays import Complex, Indices, Mask, Real
from ...errors import ConfigError
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..maps import PowerProfile, RangeDopplerMap, expected_power_profile, power_to_db
from ..paths import make_paths
from ..radar import slow_time_window

#: Highest ratio to an empty surrounding, so that every level stays a finite number [dB].
MAX_ABOVE_DB = 300.0
#: Cells (Doppler, range) to each side of a peak that are its own.
_GUARD_CELLS = (4, 8)
#: Peaks of lower prominence are ripple on a flank [dB].
_MIN_PROMINENCE_DB = 0.5
#: A peak is told to so many cells: beyond that its top is flat in float64.
_TOP = 1e-8


@dataclass(frozen=True)
class Peak:
    """A local maximum of a range-Doppler map, interpolated between its cells.

    Attributes
    ----------
    range_m
        One-way range [m].
    velocity_mps, doppler_hz
        Range rate, receding positive [m/s], and Doppler [Hz].
    level_db
        10 log10 of the power at the interpolated peak.
    peak_to_background_db
        That level over the median of the surroundings [dB].
    unfolded_velocity_mps
        Range rate of the paths there [m/s]: `velocity_mps` plus a multiple of lambda PRF / 2.
        None: not looked up, or no moving path is there.
    name
        Objects that its paths touch, as in `TargetPaths`; empty: not looked up, or unknown.
    """

    range_m: float
    velocity_mps: float
    doppler_hz: float
    level_db: float
    peak_to_background_db: float
    unfolded_velocity_mps: float | None = None
    name: str = ""


@dataclass(frozen=True)
class LeadingEdge:
    """Range where a profile first reaches half the power of a peak, coming from the radar.

    Attributes
    ----------
    range_m, peak_range_m
        One-way ranges of the edge and of the peak [m].
    level_db
        10 log10 of the power of the peak.
    prominence_db
        Height of the peak over the saddle to any higher one [dB].
    """

    range_m: float
    peak_range_m: float
    level_db: float
    prominence_db: float


def find_peaks(
    rd_map: RangeDopplerMap,
    count: int = 5,
    *,
    min_speed_mps: float = 0.0,
    range_m: tuple[float, float] | None = None,
    min_above_db: float = 0.0,
) -> list[Peak]:
    """Find the strongest local maxima of a map.

    Parameters
    ----------
    rd_map
        Range-Doppler map.
    count
        Maximum number of peaks.
    min_speed_mps
        Ignore cells with |range rate| below this, the stripe of stationary echoes [m/s].
    range_m
        Search these one-way ranges only (start, stop) [m]; None: all.
    min_above_db
        Ignore peaks less than this above their surroundings [dB], see
        :func:`peak_to_background_db`. Within its guard cells of a peak no other is taken.

    Returns
    -------
    list of Peak
        Strongest first, interpolated trigonometrically: exact for one path away from the range
        limits. From two rows off 0 Hz on, the fit includes a stationary echo at the same range.
    """
    power, guard = rd_map.plane_power, _GUARD_CELLS
    wanted = np.abs(rd_map.velocity_mps)[:, None] >= min_speed_mps
    wanted = wanted & np.ones(power.shape[1], dtype=bool)[None, :]
    if range_m is not None:
        wanted &= (rd_map.range_m >= range_m[0]) & (rd_map.range_m <= range_m[1])
    candidates = np.where(wanted & local_maxima(power), power, 0.0)
    peaks: list[Peak] = []
    while len(peaks) < count:
        row, col = divmod(int(np.argmax(candidates)), power.shape[1])
        if not candidates[row, col] > 0:
            break
        rows = (row + np.arange(-guard[0], guard[0] + 1)) % power.shape[0]
        candidates[rows, max(0, col - guard[1]) : col + guard[1] + 1] = 0.0
        above_db = peak_to_background_db(power, row, col)
        if above_db >= min_above_db:
            peaks.append(refine_peak(rd_map, row, col, above_db))
    return peaks


def local_maxima(power: Real) -> NDArray[np.bool_]:
    """Return the cells not below any of their eight neighbours; Doppler wraps, range does not."""
    # the largest of three along the ranges, then of three of these along Doppler
    line = power.copy()
    np.maximum(line[:, 1:], power[:, :-1], out=line[:, 1:])
    np.maximum(line[:, :-1], power[:, 1:], out=line[:, :-1])
    largest = np.maximum(line, np.roll(line, 1, axis=0))
    np.maximum(largest, np.roll(line, -1, axis=0), out=largest)
    return np.asarray((power > 0) & (power >= largest))


def are_local_maxima(power: Real, rows: Indices, cols: Indices) -> Mask:
    """Return which of these cells are maxima in the sense of `local_maxima`, (n,). For few cells it
    is much faster.
    """
    own, last = power[rows, cols], power.shape[1] - 1
    found = np.ones(rows.size, dtype=bool)
    for down, across in itertools.product((-1, 0, 1), repeat=2):
        neighbour = (rows + down) % power.shape[0], np.clip(cols + across, 0, last)
        found &= own >= power[neighbour]
    return found


def peak_to_background_db(
    power: Real,
    row: int,
    col: int,
    guard: tuple[int, int] = _GUARD_CELLS,
    reach: tuple[int, int] = (16, 64),
) -> float:
    """Return the power of a cell over the median of its surroundings.

    Parameters
    ----------
    power
        Map in any linear unit, (pulses, ranges).
    row, col
        The cell.
    guard, reach
        The surroundings are the cells within `reach` (Doppler, range) but not within `guard` of the
        cell; Doppler wraps, range ends at the limits.

    Returns
    -------
    float
        Ratio [dB], at most `MAX_ABOVE_DB`.

    Raises
    ------
    ConfigError
        The map has no cell beyond the guard cells.
    """
    rows = np.unique((row + np.arange(-reach[0], reach[0] + 1)) % power.shape[0])
    cols = np.arange(max(0, col - reach[1]), min(power.shape[1], col + reach[1] + 1))
    row_distance = np.abs(rows - row)
    row_distance = np.minimum(row_distance, power.shape[0] - row_distance)
    outside = (row_distance > guard[0])[:, None] | (np.abs(cols - col) > guard[1])[None, :]
    around = power[np.ix_(rows, cols)][outside]
    if around.size == 0:
        raise ConfigError(
            f"Map of {power.shape} cells (Doppler, range) has no cells beyond guard cells {guard}, "
            "so a peak has no background. Use fewer guard cells, more pulses or wider range limits."
        )
    floor = power[row, col] * 10 ** (-MAX_ABOVE_DB / 10)
    return float(10 * np.log10(power[row, col] / max(float(np.median(around)), floor)))


def refine_peak(rd_map: RangeDopplerMap, row: int, col: int, peak_to_background_db: float) -> Peak:
    """Return the maximum of the trigonometric interpolation near a cell, axis by axis.

    Its terms are the tapered pulses and their Fourier coefficients over range. Both axes need sums
    over these alone, whose weights are transformed instead of the map.

    Off 0 Hz an echo a e(f) is fitted together with a stationary one c at the same range: least
    squares with the taper w as weight, whose inner products are the map's own sums, a = (sum x
    e(-f) - W(f) sum x) / (1 - |W(f)|^2) for tapered pulses x, W(f) = sum w e(-f).
    """
    plane = rd_map.plane
    pulses, ranges = plane.shape
    wave = np.fft.fftfreq(ranges)
    # pulses counted from the middle of the burst, or a peak would rotate as Doppler varies
    pulse = np.arange(pulses) - (pulses - 1) / 2
    weight = slow_time_window(rd_map.doppler_taper, pulses)
    weight /= weight.sum()
    deflate = abs(row - pulses // 2) >= 2
    frequency = float(row - pulses // 2) / pulses
    position = float(col)
    best = 0.0

    def terms(x: float) -> Complex:
        """Return weights that sum tapered pulses to the root of the energy at a Doppler."""
        turn = np.exp(-2j * np.pi * x * pulse)
        if not deflate:
            return np.asarray(turn)
        leak = complex(turn @ weight)
        return np.asarray((turn - leak) / math.sqrt(max(1 - abs(leak) ** 2, 1e-12)))

    for _ in range(3):
        # no BLAS: its threads share such sums, and their number would show in the last digits
        weights = np.fft.fftshift(np.fft.ifft(terms(frequency)))
        line = np.fft.fft(np.einsum("p,pr->r", weights, plane)) / ranges
        position, best = _climb(
            lambda x: np.exp(2j * np.pi * wave * x), line, position, 1.0, (0.0, ranges - 1.0)
        )
        weights = np.fft.fft(np.exp(2j * np.pi * wave * position))
        train = np.fft.ifft(np.fft.ifftshift(np.einsum("pr,r->p", plane, weights))) / ranges
        frequency, best = _climb(terms, train, frequency, 1.0 / pulses)
    if deflate:
        leak = complex(np.exp(-2j * np.pi * frequency * pulse) @ weight)
        best /= math.sqrt(max(1 - abs(leak) ** 2, 1e-12))
    frequency = (frequency + 0.5) % 1.0 - 0.5
    doppler_hz = frequency * rd_map.radar.burst.prf_hz
    step_m = rd_map.range_m[1] - rd_map.range_m[0] if ranges > 1 else 0.0
    return Peak(
        range_m=float(rd_map.range_m[0] + step_m * position),
        velocity_mps=-doppler_hz * rd_map.radar.waveform.wavelength_m / 2,
        doppler_hz=doppler_hz,
        level_db=float(power_to_db(np.array(best**2))),
        peak_to_background_db=peak_to_background_db,
    )


def value_weights(
    rd_map: RangeDopplerMap, range_m: float, doppler_hz: float
) -> tuple[Complex, Complex]:
    """Return weights of the rows, (Doppler,), and of the columns, (ranges,), whose sum is the value
    of the map's trigonometric interpolation at a range and a Doppler.
    """
    pulses, ranges = rd_map.values.shape[1:]
    cycles = doppler_hz / rd_map.radar.burst.prf_hz
    rows = np.fft.fftshift(np.fft.ifft(np.exp(-2j * np.pi * cycles * np.arange(pulses))))
    step_m = float(rd_map.range_m[1] - rd_map.range_m[0]) if ranges > 1 else 1.0
    place = (range_m - float(rd_map.range_m[0])) / step_m
    cols = np.fft.fft(np.exp(2j * np.pi * np.fft.fftfreq(ranges) * place)) / ranges
    return rows, cols


def _climb(
    factors: Callable[[float], Complex],
    terms: Complex,
    start: float,
    step: float,
    within: tuple[float, float] = (-math.inf, math.inf),
) -> tuple[float, float]:
    """Return place and value of the maximum of |sum factors(x) terms| at most `step` from `start`,
    within the limits `within`.

    The interpolation over range is periodic: after the last cell comes the first one.
    """

    def value(x: float) -> float:
        return float(abs(np.einsum("i,i->", factors(x), terms)))

    # Brent's search (Algorithms for Minimization without Derivatives, 1973, ch. 5): parabolas
    # through the three best places, golden sections where they do not converge
    low, high = max(start - step, within[0]), min(start + step, within[1])
    least = _TOP * step
    best = second = third = start
    top = top_second = top_third = value(start)
    move = before = 0.0
    while max(best - low, high - best) > 2 * least:
        one = (best - second) * (top - top_third)
        two = (best - third) * (top - top_second)
        bend = 2 * (one - two)
        parabola = ((best - third) * two - (best - second) * one) / bend if bend else math.inf
        if abs(parabola) < abs(before) / 2 and low < best + parabola < high:
            before, move = move, parabola
        else:
            before = (high if best < (low + high) / 2 else low) - best
            move = (3 - 5**0.5) / 2 * before
        place = best + math.copysign(max(abs(move), least), move)
        found = value(place)
        if found >= top:
            low, high = (best, high) if place >= best else (low, best)
            best, second, third = place, best, second
            top, top_second, top_third = found, top, top_second
        else:
            low, high = (place, high) if place < best else (low, place)
            if found >= top_second or second == best:
                second, third = place, second
                top_second, top_third = found, top_second
            elif found >= top_third or third in (best, second):
                third, top_third = place, found
    return best, top


def leading_edges(
    profile: PowerProfile,
    count: int = 2,
    *,
    separation_m: float | None = None,
    by: Literal["power", "prominence"] = "power",
    range_m: tuple[float, float] | None = None,
) -> list[LeadingEdge]:
    """Find half-power leading edges of the strongest separated peaks of a profile.

    Parameters
    ----------
    profile
        Expected power against range.
    count
        Maximum number of peaks.
    separation_m
        No second peak within this distance of a stronger one [m]; None: 20 range resolutions.
    by
        "power" takes the highest peaks; "prominence" those highest, in decibels, over the saddle to
        any higher one: faint far objects before near clutter.
    range_m
        Search these one-way ranges only (start, stop) [m]; None: all.

    Returns
    -------
    list of LeadingEdge
        In the order of `by`. The edge is the last place before the peak where the power is half
        the peak's, linearly interpolated. Peaks without such a place are omitted, and so are those
        on the flank of a higher peak that lies between this place and them.

    Raises
    ------
    ConfigError
        `by` has another value.
    """
    power, axis_m = profile.power, profile.range_m
    if separation_m is None:
        separation_m = 20 * profile.radar.waveform.range_resolution_m
    inside = np.ones(axis_m.size, dtype=bool)
    if range_m is not None:
        inside = (axis_m >= range_m[0]) & (axis_m <= range_m[1])
    padded = np.concatenate([[0.0], power, [0.0]])
    top = (power > padded[:-2]) & (power >= padded[2:]) & inside
    places = np.flatnonzero(top)
    level_db = power_to_db(power)
    prominence_db = np.array([_prominence_db(level_db, int(i)) for i in places])
    if by not in ("power", "prominence"):
        raise ConfigError(f"Peaks by {by!r}; expected 'power' or 'prominence'.")
    order = np.argsort(-(power[places] if by == "power" else prominence_db), kind="stable")
    edges: list[LeadingEdge] = []
    for index in order:
        place = int(places[index])
        if prominence_db[index] < _MIN_PROMINENCE_DB:
            continue
        far = all(abs(axis_m[place] - e.peak_range_m) >= separation_m for e in edges)
        below = np.flatnonzero(power[:place] < power[place] / 2)
        low = int(below[-1]) if below.size else -1
        # Without such a place, the edge is outside the range limits.
        rises = low >= 0 and bool(np.all(power[low:place] <= power[place]))
        if far and rises and len(edges) < count:
            fraction = (power[place] / 2 - power[low]) / (power[low + 1] - power[low])
            edges.append(
                LeadingEdge(
                    range_m=float(axis_m[low] + fraction * (axis_m[low + 1] - axis_m[low])),
                    peak_range_m=float(axis_m[place]),
                    level_db=float(level_db[place]),
                    prominence_db=float(prominence_db[index]),
                )
            )
    return edges


def _prominence_db(level_db: Real, place: int) -> float:
    """Return the height of a peak above the higher of the two saddles that lead to higher peaks
    [dB].
    """
    saddles = []
    for side in (level_db[:place][::-1], level_db[place + 1 :]):
        higher = np.flatnonzero(side > level_db[place])
        stretch = side[: higher[0]] if higher.size else side
        lowest = float(stretch.min()) if stretch.size else float(level_db[place])
        saddles.append((higher.size > 0, lowest))
    towards_higher = [lowest for found, lowest in saddles if found]
    base = max(towards_higher) if towards_higher else min(lowest for _, lowest in saddles)
    return float(level_db[place] - base)


#: Dynamic range of a profile of expected power: its convolution rounds at 1e-16 of the largest
#: value times the square root of its length [dB].
PROFILE_DYNAMICS_DB = 130.0
#: An edge up to this far above a stronger peak's response to one path is its sidelobe [dB].
_SIDELOBE_DB = 6.0
#: Smallest distance of two peaks [range resolutions]: a main lobe of Hamming between its nulls.
_SEPARATION = 4.0
#: Peaks that are looked at, the most prominent ones, and leading edges that a summary lists.
_MAX_PEAKS, MAX_EDGES = 50, 5


def find_edges(profile: PowerProfile) -> list[LeadingEdge]:
    """Find leading edges by falling prominence, without sidelobes and paired echoes of stronger
    ones.

    A chirp of low time-bandwidth product has paired echoes up to its own length away, some 38 dB
    down with any taper (the Fresnel ripple of its spectrum). Levels more than `PROFILE_DYNAMICS_DB`
    below the strongest are rounding.
    """
    waveform = profile.radar.waveform
    pulse_m = SPEED_OF_LIGHT_MPS * waveform.duration_s / 2
    reach_m = pulse_m if waveform.family == "pulse" else 0.0
    least = float(profile.power.max(initial=0.0)) * 10 ** (-PROFILE_DYNAMICS_DB / 10)
    profile = dataclasses.replace(profile, power=np.maximum(profile.power, least))
    separation_m = _SEPARATION * waveform.range_resolution_m
    found = leading_edges(profile, _MAX_PEAKS, by="prominence", separation_m=separation_m)
    found = _without_sidelobes(profile, found)
    return [
        edge
        for edge in found
        if not any(
            abs(edge.peak_range_m - other.peak_range_m) <= 1.02 * reach_m
            and edge.level_db < other.level_db - 28
            for other in found
        )
    ]


def _without_sidelobes(profile: PowerProfile, found: list[LeadingEdge]) -> list[LeadingEdge]:
    """Return the edges that are above the responses of all stronger peaks at their range."""
    kept: list[LeadingEdge] = []
    range_limits_m = (float(profile.range_m[0]), float(profile.range_m[-1]))
    step_m = float(profile.range_m[1] - profile.range_m[0]) if profile.range_m.size > 1 else 1.0
    sidelobes = np.zeros_like(profile.power)
    for edge in sorted(found, key=lambda item: -item.level_db):
        place = int(np.argmin(np.abs(profile.range_m - edge.peak_range_m)))
        # the envelope of sidelobes: each is two cells wide
        reach = 2 * math.ceil(profile.radar.waveform.sample_spacing_m / step_m)
        near = sidelobes[max(0, place - reach) : place + reach + 1].max(initial=0.0)
        if 10 ** (edge.level_db / 10) <= near * 10 ** (_SIDELOBE_DB / 10):
            continue
        kept.append(edge)
        point = expected_power_profile(
            make_paths(1.0, 2 * edge.peak_range_m),
            profile.radar,
            range_limits_m=range_limits_m,
            range_taper=profile.range_taper,
        ).power
        count = min(point.size, sidelobes.size)
        strength = 10 ** (edge.level_db / 10) / max(float(point.max()), 1e-300)
        sidelobes[:count] += strength * point[:count]
    return [edge for edge in found if edge in kept]
