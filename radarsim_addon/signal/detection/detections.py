# SPDX-License-Identifier: GPL-3.0-or-later
"""Targets above the noise of a map, and the paths that make a target.

A target is a local maximum above the CFAR threshold, interpolated between the cells. Its own
sidelobes raise the noise that the threshold's training cells show, so the response of a strong
point is subtracted first. `PathFinder` gives the paths of a frame whose range and Doppler, both as
the map shows them, are within 1.5 resolution cells of a target, and the objects that they touch.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ...arrays import Integers, Real
from ...contract import ImageRecord
from ...physics.mirrors import mirror_matrix
from ..decoding import FrameInput
from ..echoes import Echoes
from ..maps import RangeDopplerMap, Recording, fit_point, point_response, power_to_db
from ..motion import mean_over_burst, which_move
from ..paths import images_of, iter_rows, motion_of_rows, usable
from ..scattering import Link
from .cfar import Cfar, CfarResult, cfar_threshold, widened_guard
from .objects import path_power_w, path_rcs_m2
from .peaks import Peak, local_maxima, refine_peak

#: Maximum number of interpolated targets; the strongest are kept.
MAX_DETECTIONS = 256
#: Above this SNR a target's own sidelobes raise its surroundings [dB]. They are subtracted for so
#: many targets, the strongest, if one point contains this fraction of the peak's energy.
_OWN_DB, _MAX_OWN, _FITS = 20.0, 32, 0.97


@dataclass(frozen=True)
class Detection:
    """One target.

    Attributes
    ----------
    range_m, velocity_mps, doppler_hz
        Interpolated; range rate receding positive, Doppler -2 v / lambda.
    level_db
        10 log10 of the power at the interpolated peak.
    noise_db
        10 log10 of the mean noise power of its cell where that is known, else `surroundings_db`.
    snr_db
        Difference of both: (signal + noise) over noise.
    surroundings_db
        10 log10 of the mean power around it, without its own sidelobes: noise, clutter and what a
        target that is no point returns from beyond the guard cells.
    row, col
        Cell of the map.
    unfolded_velocity_mps, name
        As in `Peak`.
    """

    range_m: float
    velocity_mps: float
    doppler_hz: float
    level_db: float
    noise_db: float
    snr_db: float
    surroundings_db: float
    row: int
    col: int
    unfolded_velocity_mps: float | None = None
    name: str = ""


@dataclass(frozen=True)
class Detections:
    """Targets of one map.

    Attributes
    ----------
    targets
        Detections by falling SNR.
    cells
        Number of cells above the threshold.
    left_out
        Number of peaks beyond `MAX_DETECTIONS`.
    cfar
        The detector.
    training_cells, independent_cells
        Training cells of one cell, and the equivalent number of independent ones.
    """

    targets: list[Detection]
    cells: int
    left_out: int
    cfar: Cfar
    training_cells: int
    independent_cells: float


def detect_targets(
    rd_map: RangeDopplerMap,
    cfar: Cfar | None = None,
    dynamics_db: float = 140.0,
    *,
    wide: RangeDopplerMap | None = None,
    noise_power: Real | None = None,
) -> Detections:
    """Find the peaks above the CFAR threshold of a map, interpolated.

    Parameters
    ----------
    rd_map
        Range-Doppler map.
    cfar
        Detector; None: cell averaging at 1e-6.
    dynamics_db
        Levels further below the strongest cell are errors of the synthesis, no echoes [dB].
    wide
        The same map over more ranges (:func:`.detection.received_recording`), to interpolate in:
        without it a peak within a cell of the range limits is off by up to half a cell and 1.1 dB.
    noise_power
        Mean noise power of a cell of each row, (Doppler,), which SNRs refer to; None: unknown, they
        refer to the surroundings, which are not noise next to a strong target that is no point.

    Returns
    -------
    Detections
        Targets by falling SNR.

    Notes
    -----
    Within the guard cells of a peak no weaker one is taken. Range and Doppler are those of the
    maximum of the trigonometric interpolation: exact for one target without noise.
    """
    cfar = widened_guard(rd_map, cfar or Cfar())
    result = cfar_threshold(rd_map, cfar)
    power = rd_map.plane_power
    above = power > np.maximum(result.threshold, power.max(initial=0.0) * 10 ** (-dynamics_db / 10))
    peaks = np.argwhere(above & local_maxima(power))
    order = np.argsort(-power[peaks[:, 0], peaks[:, 1]], kind="stable")
    free = np.ones(power.shape, dtype=bool)
    chosen: list[tuple[int, int]] = []
    left_out = 0
    guard = min(cfar.guard[0], (power.shape[0] - 1) // 2), cfar.guard[1]
    for row, col in peaks[order]:
        if not free[row, col]:
            continue
        if len(chosen) < MAX_DETECTIONS:
            chosen.append((int(row), int(col)))
        else:
            left_out += 1
        rows = (row + np.arange(-guard[0], guard[0] + 1)) % power.shape[0]
        free[rows, max(0, col - guard[1]) : col + guard[1] + 1] = False
    targets = interpolated_targets(rd_map, chosen, result, cfar, wide or rd_map, noise_power)
    targets.sort(key=lambda target: -target.snr_db)
    cells, independent = result.cells
    return Detections(targets, int(above.sum()), left_out, cfar, cells, independent)


def interpolated_targets(
    rd_map: RangeDopplerMap,
    chosen: list[tuple[int, int]],
    result: CfarResult,
    cfar: Cfar,
    wide: RangeDopplerMap,
    noise_power: Real | None,
) -> list[Detection]:
    """Return the targets of chosen cells (row, column), interpolated between the cells of `wide`.

    `result` has the noise around them, `noise_power` (Doppler,) is the receiver's; None: unknown.
    """
    if not chosen:
        return []
    found: list[Detection] = []
    for number, (row, col) in enumerate(chosen):
        place = int(np.argmin(np.abs(wide.range_m - rd_map.range_m[col])))
        peak = refine_peak(wide, row, place, 0.0)
        around_db = float(power_to_db(result.noise[row, col]))
        if number < _MAX_OWN and peak.level_db - around_db > _OWN_DB:
            rest = _noise_without(rd_map, peak, row, col, cfar)
            around_db = min(around_db, float(power_to_db(np.array(rest))))
        noise_db = around_db if noise_power is None else float(power_to_db(noise_power[row]))
        where = peak.range_m, peak.velocity_mps, peak.doppler_hz
        levels_db = peak.level_db, noise_db, peak.level_db - noise_db, around_db
        found.append(Detection(*where, *levels_db, row, col))
    return found


def _noise_without(rd_map: RangeDopplerMap, peak: Peak, row: int, col: int, cfar: Cfar) -> float:
    """Return the mean power of the training cells without the response of the target; infinite if
    the target is no point.
    """
    pulses, ranges = rd_map.plane.shape
    range_limits_m = (max(float(rd_map.range_m[0]), 0.0), float(rd_map.range_m[-1]))
    nothing = np.zeros((1, 1), dtype=np.complex128)
    echoes = Echoes(nothing, 0.0, range_limits_m, rd_map.radar, "radar-equation", 0.0)
    recording = Recording(echoes, range_limits_m, rd_map, 0, 0.0)
    response = point_response(recording, peak.range_m, peak.doppler_hz / rd_map.radar.burst.prf_hz)
    reach = min(cfar.guard[0] + cfar.train[0], (pulses - 1) // 2), cfar.guard[1] + cfar.train[1]
    apart = np.arange(-reach[0], reach[0] + 1)
    rows = (row + apart) % pulses
    cols = np.arange(max(0, col - reach[1]), min(ranges, col + reach[1] + 1))
    patch = rd_map.plane[np.ix_(rows, cols)]
    own = response.doppler[rows] @ response.ranges[:, cols]
    middle = np.ix_(np.abs(apart) <= 1, np.abs(cols - col) <= 2)
    amplitude, fraction = fit_point(own[middle], patch[middle])
    if fraction < _FITS:
        return math.inf
    around = (np.abs(apart) > cfar.guard[0])[:, None] | (np.abs(cols - col) > cfar.guard[1])
    rest = np.abs((patch - own * amplitude)[around]) ** 2
    if cfar.kind == "os":  # of exponential power
        return float(np.quantile(rest, cfar.rank)) / -math.log(1 - cfar.rank)
    return float(np.mean(rest))


def target_count(count: int, left_out: int) -> str:
    """Return the number of targets as text, such as "256 strongest of 300 targets"."""
    if left_out:
        return f"{count} strongest of {count + left_out} targets"
    return f"{count} target{'' if count == 1 else 's'}"


_Target = TypeVar("_Target", Peak, Detection)
#: A path that is further than this from a target, in resolution cells, has no part in it.
_REACH_CELLS = 1.5


@dataclass(frozen=True)
class TargetPaths:
    """Paths of a target of a map, the strongest first."""

    #: Objects that the largest part of their power touches: "Car", "Car via House" (the car moves,
    #: the house does not, or is a mirror), "Car and House"; "": unknown. The number of reflections
    #: follows if the path touches more than these.
    name: str
    #: Object of the last scatterer of the strongest path; object lists count its power there.
    last_object: str
    #: Corners of each path: receiver, mirrors, first and last scatterer, transmitter, (k, 3) [m].
    lines_m: list[Real]
    #: Power of each path, (n,) [W].
    power_w: Real
    #: Part of the power that touches the objects of the name; None: no path is there.
    purity: float | None = None
    #: Mean direction in which these arrive, a unit vector in world space, (3,).
    direction: Real | None = None
    #: Of the strongest path: reflections, and cross section for a watt of received power [m^2/W];
    #: None over mirrors.
    reflections: int = 0
    rcs_m2_per_w: float | None = None
    #: Power of all paths there [W]; those next to the peak count less.
    nearby_w: float = 0.0
    #: Where the strongest path of this name leaves the receiver for, (3,) [m]; None without paths.
    seen_at_m: Real | None = None


class BeamSines(NamedTuple):
    """Where an array sees a target: along axes, unit vectors in world space (k, 3), the sines of
    its direction, (k,), give or take `reach`, (k,). `sent` is the part that the direction in which
    a path leaves has in these sines, (k,); where it arrives has the rest.
    """

    axes: Real
    sines: Real
    reach: Real
    sent: Real


class PathFinder:
    """Finds the paths of a frame (sampling mode "paths") that make a target.

    A part of an object, such as the wheel of a car, has the object's name.
    Powers are those of the link budget; None: EIRP of the render, G_r = 1.
    """

    def __init__(self, frame_input: FrameInput, link: Link | None = None) -> None:
        self._input, self._radar = frame_input, frame_input.radar
        table, waveform = frame_input.table, self._radar.waveform
        self._record, self._rows = table.record, table.rows
        # A part is counted with its whole: numbers stand for the first object of that name.
        self._wholes = frame_input.whole_names
        self._names = ["", *(self._wholes[name] for name in self._record.objects)]
        first = {name: number for number, name in reversed(list(enumerate(self._names)))}
        self._whole = np.array([first[name] for name in self._names], dtype=np.int64)
        burst_s = (self._radar.burst.pulses - 1) / self._radar.burst.prf_hz
        motion = table.motion
        self._moves = np.zeros(0, bool) if motion is None else which_move(motion.bodies)
        if motion is not None and motion.tracks is not None:  # these deform
            self._moves[motion.tracks.body - 1] = True
        columns, start = [], 0
        for rows in iter_rows(self._rows):
            number = np.arange(start, start + rows.size)  # the link has kept gains of most
            start += rows.size
            power = path_power_w(
                rows, self._record, waveform.carrier_hz, link, waveform.range_resolution_m, number
            )
            power = np.where(usable(rows), power, 0.0)
            range_m, rate = rows["length_m"] / 2, rows["range_rate_mps"]
            if motion is not None and burst_s > 0:
                range_m, rate = mean_over_burst(motion_of_rows(rows, motion), burst_s, slice(None))
            elif burst_s > 0:
                range_m = range_m + burst_s / 2 * rate
            columns.append(np.stack([range_m, rate, power]).astype(np.float32))
        self._transmitter_m = np.asarray(self._record.transmitter.matrix_world)[:3, 3]
        joined = np.concatenate(columns, axis=1) if columns else np.zeros((3, 0), np.float32)
        period_m = self._radar.range_period_m
        self._range_m = joined[0] % np.float32(period_m) if np.isfinite(period_m) else joined[0]
        self._rate_mps, self._power_w = joined[1], joined[2]
        self._order = np.argsort(self._range_m, kind="stable")
        self._sorted_m = self._range_m[self._order]

    def of_target(
        self, range_m: float, velocity_mps: float, most: int = 12, beam: BeamSines | None = None
    ) -> TargetPaths:
        """Return the strongest paths within 1.5 resolution cells of a target, and the name of the
        target.

        The range is that in the middle of the burst, and the range rate may have folded. The name
        follows from all such paths, not only from the `most` that are returned. With a `beam` paths
        from other directions do not count.
        """
        radar = self._radar
        reach_m = _REACH_CELLS * radar.waveform.range_resolution_m
        first, last = np.searchsorted(self._sorted_m, [range_m - reach_m, range_m + reach_m])
        near = self._order[first:last]
        interval_mps = 2 * radar.max_unambiguous_velocity_mps
        apart_mps = np.abs(self._rate_mps[near] - velocity_mps) % interval_mps
        apart_mps = np.minimum(apart_mps, interval_mps - apart_mps)
        reach_mps = _REACH_CELLS * radar.velocity_resolution_mps
        inside = apart_mps <= reach_mps
        near, apart_mps = near[inside], apart_mps[inside]
        # what is next to the peak counts less
        away = ((self._range_m[near] - range_m) / reach_m) ** 2 + (apart_mps / reach_mps) ** 2
        if beam is not None:
            off = self._beams_off(near, beam)
            within = (off <= 1).all(axis=1)
            near, away = near[within], (away + np.sum(off**2, axis=1))[within]
        return self._answer(near, self._power_w[near] * np.exp(-2 * away), most)

    def _beams_off(self, rows: Integers, beam: BeamSines) -> Real:
        """Return how far off a beam an array sees paths, over the beam's reach, (n, k)."""
        few = self._rows[rows]
        arrives, last_m = few["direction"].astype(np.float64), few["last_scatterer_m"]
        if (over := images_of(few, self._record.images)) is not None:
            last_m = over.unfolded(1, last_m)  # towards the mirror
        leaves = last_m - self._transmitter_m
        leaves /= np.linalg.norm(leaves, axis=1, keepdims=True)
        leaves = np.where(np.isfinite(leaves).all(axis=1)[:, None], leaves, arrives)
        sines = beam.sent * (leaves @ beam.axes.T) + (1 - beam.sent) * (arrives @ beam.axes.T)
        return np.abs(sines - beam.sines) / beam.reach

    def of_object(self, name: str, most: int = 12) -> TargetPaths:
        """Return the strongest paths whose first or last scatterer is on an object or its parts."""
        pairs = zip(["", *self._record.objects], self._names, strict=True)
        chosen = np.array([bool(name) and name in pair for pair in pairs])
        if not chosen.any():
            return TargetPaths("", "", [], np.zeros(0))
        ends = chosen[self._rows["first_object"]] | chosen[self._rows["last_object"]]
        mine = np.flatnonzero(ends)
        found = self._answer(mine, self._power_w[mine], most)
        return dataclasses.replace(found, name=name, last_object=name)

    def named(self, targets: Iterable[_Target]) -> list[_Target]:
        """Return the targets with the names of the objects that their paths touch."""
        return [
            dataclasses.replace(one, name=self.of_target(one.range_m, one.velocity_mps, 1).name)
            for one in targets
        ]

    def _answer(self, rows: Integers, weight: Real, most: int) -> TargetPaths:
        rows, weight = rows[weight > 0], weight[weight > 0]
        if not rows.size:
            return TargetPaths("", "", [], np.zeros(0))
        ends = [self._whole[self._rows[end][rows]] for end in ("first_object", "last_object")]
        _, pair = np.unique(np.sort(ends, axis=0), axis=1, return_inverse=True)
        # A path and its reverse touch the same objects.
        of_pair = np.bincount(pair, weight)
        strongest = np.flatnonzero(pair == of_pair.argmax())
        number = int(rows[strongest[weight[strongest].argmax()]])
        row = self._rows[number]
        last = self._names[row["last_object"]]
        chosen = rows[np.argsort(-weight, kind="stable")[:most]]
        lines = [self._line(self._rows[number]) for number in chosen.tolist()]
        powers_w = np.asarray(self._power_w[chosen], dtype=np.float64)
        arrives = weight[strongest] @ self._rows["direction"][rows[strongest]].astype(np.float64)
        rcs_m2 = float(path_rcs_m2(self._rows[number : number + 1], self._record)[0])
        return TargetPaths(
            self._name(row),
            last,
            lines,
            powers_w,
            float(of_pair.max() / of_pair.sum()),
            arrives / np.linalg.norm(arrives) if arrives.any() else None,
            int(row["order"]),
            rcs_m2 / float(self._power_w[number]) if rcs_m2 > 0 else None,
            seen_at_m=self._line(row)[1],
            nearby_w=float(weight.sum()),
        )

    def _name(self, row: Mapping[str, Any]) -> str:
        ends = [self._names[row[end]] for end in ("first_object", "last_object")]
        touched = [name for name in dict.fromkeys(ends) if name]
        via: list[str] = []
        if len(touched) == 2:
            first, last = (self._moves_at(int(row[end])) for end in ("first_body", "last_body"))
            if first != last:
                via = [touched.pop(1 if first else 0)]
        touched.sort()
        unknown = int(row["order"]) - len(touched) - len(via)
        if "mirrors" in row:
            unknown -= int(row["mirrors"])
            images = (int(row[end]) for end in ("receiver_image", "transmitter_image"))
            mirrors = (name for n in images if n for name in self._record.images[n - 1].objects)
            via += [self._wholes.get(name, name) for name in mirrors]
        text = " and ".join(touched)
        text += f" via {' and '.join(dict.fromkeys(via))}" if via else ""
        return f"{text} ({row['order']} reflections)" if text and unknown > 0 else text

    def _moves_at(self, body: int) -> bool:
        return 0 < body <= self._moves.size and bool(self._moves[body - 1])

    def _line(self, row: Mapping[str, Any]) -> Real:
        """Return corners of a path, from the receiver to the transmitter."""
        receiver = np.asarray(self._input.receiver.matrix_world)[:3, 3]
        transmitter = np.asarray(self._input.transmitter.matrix_world)[:3, 3]
        first, last = row["first_scatterer_m"], row["last_scatterer_m"]
        images: list[ImageRecord | None] = [None, None]
        if "mirrors" in row:
            for end, name in enumerate(("receiver_image", "transmitter_image")):
                images[end] = self._record.images[row[name] - 1] if row[name] else None
        there = mirror_corners(receiver, images[0], first)
        back = mirror_corners(transmitter, images[1], last)
        scatterers = [first] if np.array_equal(first, last) else [first, last]
        corners = np.array([receiver, *there, *scatterers, *back[::-1], transmitter])
        return np.asarray(corners[np.isfinite(corners).all(axis=1)], dtype=np.float64)


def mirror_corners(antenna_m: Real, image: ImageRecord | None, scatterer_m: Real) -> Sequence[Real]:
    """Return the points at which a path meets the mirrors of an image, from antenna to scatterer,
    (3,) each [m].
    """
    if image is None:
        return ()
    planes = list(zip(image.normals, image.offsets_m, strict=True))
    seen = [antenna_m]  # the antenna over the first 0, 1, ... mirrors
    for normal, offset_m in planes:
        turn, shift = mirror_matrix(normal, offset_m)
        seen.append(turn @ seen[-1] + shift)
    corners: list[Real] = []
    at = scatterer_m
    for (normal, offset_m), apparent in zip(reversed(planes), reversed(seen[1:]), strict=True):
        toward = apparent - at
        at = at + (offset_m - np.dot(normal, at)) / np.dot(normal, toward) * toward
        corners.insert(0, at)
    return corners
