# SPDX-License-Identifier: GPL-3.0-or-later
"""Targets of an array: range, Doppler and direction.

A cell is a candidate if its power, averaged over the channels, exceeds that of the surrounding
cells by at least what a target at the detection threshold would add. Its sources
(`angles.DirectionFinder`) are detections where the power of their beam is above the CFAR threshold
of that beam's own surroundings, so that clutter from one direction does not raise the threshold of
the others, and the false-alarm rate is that of each beam. Range and Doppler are then interpolated
in the beam, and the direction is found again from the channels' values at just that range and
Doppler: in the middle of a cell they would have phases of the cell's, not of the target's.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...arrays import Complex, Real
from ..angles import MAX_SOURCES, ArrayGeometry, DirectionFinder, Source, angles_deg
from ..echoes import one_channel
from ..maps import RangeDopplerMap
from .cfar import Cfar, CfarResult, cfar_threshold, ring_mask, widened_guard
from .detections import (
    MAX_DETECTIONS,
    BeamSines,
    Detection,
    Detections,
    PathFinder,
    interpolated_targets,
)
from .peaks import local_maxima, value_weights

#: Signal-to-noise ratio of a beam at which no detector sees a target yet.
_UNSEEN = 20.0
#: Candidates whose direction is looked for; the others are the weakest.
_MAX_CANDIDATES = 2048
#: Power of another target in the cell of a stronger one, over that: the fit leaves less.
_WEAKEST = 1e-3
#: Power of a target over that of the paths in its cell and beam, above which they do not make it.
_MOST_OVER_PATHS = 100.0
#: Sine of the angle off broadside beyond which a beam is that of the edge of what can be seen.
_EDGE = 0.995
#: Paths farther than this from a target's direction, in beam widths, have no part in it.
_REACH_BEAMS = 1.0
#: Rounds of interpolating range and Doppler and finding the direction.
_ROUNDS = 2


@dataclass(frozen=True)
class DirectedDetection(Detection):
    """A target of an array; powers are those of one channel, SNRs those of the beam.

    Attributes
    ----------
    range_m, velocity_mps, doppler_hz, level_db, noise_db, snr_db, surroundings_db, row, col
        As in `Detection`.
    unfolded_velocity_mps, name
        As in `Peak`.
    azimuth_deg, elevation_deg
        Direction from the receiver: azimuth to the right, elevation upwards. None: the array has
        no extent in this direction, and 0 is assumed.
    x_m, y_m, z_m
        Place in the radar's axes: forward, left, up [m].
    world_x_m, world_y_m, world_z_m
        Place in the scene [m].
    true_azimuth_deg, true_elevation_deg
        Mean direction in which its paths arrive; None: not looked up, or unknown.
    reflections
        Reflections of its strongest path, 0: unknown. More than 1: a ghost or a multiple echo.
    purity
        Part of the power there that its objects have, 0 to 1; None: not looked up, or unknown.
    rcs_dbsm
        Cross section by its level and the gains in its direction; None: unknown.
    """

    azimuth_deg: float | None = None
    elevation_deg: float | None = None
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    world_x_m: float = 0.0
    world_y_m: float = 0.0
    world_z_m: float = 0.0
    true_azimuth_deg: float | None = None
    true_elevation_deg: float | None = None
    reflections: int = 0
    purity: float | None = None
    rcs_dbsm: float | None = None

    @property
    def direction(self) -> Real:
        """Unit vector in the receiver's axes: x right, y up, z back, (3,)."""
        place_m = np.array([-self.y_m, self.z_m, -self.x_m])
        return np.asarray(place_m / np.linalg.norm(place_m))


def detect_in_directions(
    rd_map: RangeDopplerMap,
    geometry: ArrayGeometry,
    pose: Real,
    cfar: Cfar | None = None,
    dynamics_db: float = 140.0,
    *,
    wide: RangeDopplerMap | None = None,
    noise_power: Real | None = None,
) -> Detections:
    """Find the targets of an array with their directions.

    Parameters
    ----------
    rd_map
        Range-Doppler map of all channels.
    geometry
        Places of the elements in the middle of the burst.
    pose
        Pose of the receiver at that time, (4, 4) [m].
    cfar
        Detector; None: cell averaging at 1e-6. The false-alarm rate is that of one beam.
    dynamics_db, wide, noise_power
        As for :func:`.detect_targets`, of one channel; `wide` has all channels.

    Returns
    -------
    Detections
        Of `DirectedDetection`, by falling SNR.
    """
    return _Search(rd_map, geometry, pose, cfar or Cfar(), dynamics_db, wide, noise_power).run()


def named_in_directions(
    finder: PathFinder,
    targets: Iterable[Detection],
    geometry: ArrayGeometry,
    pose: Real,
    watts: bool = True,
) -> list[DirectedDetection]:
    """Return targets of an array with what the paths in their cell and beam tell of them; `watts`:
    levels are powers.
    """
    measured = np.flatnonzero(geometry.measures)
    axes = pose[:3, :3].T[measured]
    reach = _REACH_BEAMS / geometry.extent_wavelengths[measured]
    # by least squares of the phases: the transmitters' part in the array's extent
    virtual, places = (x[:, measured] for x in (geometry.virtual_m, geometry.transmitter_m))
    sent = np.sum(virtual * (places - places.mean(axis=0)), axis=0) / np.sum(virtual**2, axis=0)
    named = []
    for one in targets:
        assert isinstance(one, DirectedDetection)
        beam = BeamSines(axes, one.direction[measured], reach, sent)
        paths = finder.of_target(one.range_m, one.velocity_mps, 1, beam)
        # Much stronger than the paths in its cell can make: a sidelobe of a target elsewhere.
        if watts and _MOST_OVER_PATHS * paths.nearby_w < 10 ** (one.level_db / 10):
            named.append(one)
            continue
        told: dict[str, Any] = {"name": paths.name, "purity": paths.purity}
        if paths.direction is not None:
            angles = angles_deg(pose[:3, :3].T @ paths.direction)
            told |= {"true_azimuth_deg": angles[0], "true_elevation_deg": angles[1]}
            told["reflections"] = paths.reflections
        if watts and paths.rcs_m2_per_w is not None:
            told["rcs_dbsm"] = one.level_db + 10 * math.log10(paths.rcs_m2_per_w)
        named.append(dataclasses.replace(one, **told))
    return named


class _Search:
    """The maps of all channels, and the thresholds of their mean power."""

    def __init__(
        self,
        rd_map: RangeDopplerMap,
        geometry: ArrayGeometry,
        pose: Real,
        cfar: Cfar,
        dynamics_db: float,
        wide: RangeDopplerMap | None,
        noise_power: Real | None,
    ) -> None:
        self._map, self._pose = rd_map, pose
        wide = wide or rd_map
        self._wide = dataclasses.replace(wide, values=np.ascontiguousarray(wide.values))
        self._finder = DirectionFinder(geometry)
        self._channels = len(rd_map.values)
        self._noise_power = noise_power
        self._power = rd_map.power.mean(axis=0)
        mean = _beam(rd_map, np.eye(self._channels)[0])
        mean = dataclasses.replace(mean, values=np.sqrt(self._power)[None].astype(complex))
        self._cfar = widened_guard(mean, cfar)
        self._result = cfar_threshold(mean, self._cfar)
        #: Threshold over the surroundings, by column.
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self._result.threshold / self._result.noise
        self._ratio = np.nanmax(np.where(np.isfinite(ratio), ratio, np.nan), axis=0, initial=0.0)
        self._least = self._power.max(initial=0.0) * 10 ** (-dynamics_db / 10)

    def run(self) -> Detections:
        cells, independent = self._result.cells
        found: list[Detection] = []
        free = np.ones(self._power.shape, dtype=bool)
        guard = min(self._cfar.guard[0], (free.shape[0] - 1) // 2), self._cfar.guard[1]
        above, left_out = 0, 0
        for row, col in self._candidates():
            if not free[row, col]:
                continue
            targets = self._targets(row, col)
            if not targets:
                continue
            above += 1
            if len(found) >= MAX_DETECTIONS:
                left_out += len(targets)
                continue
            found += targets
            rows = (row + np.arange(-guard[0], guard[0] + 1)) % free.shape[0]
            free[rows, max(0, col - guard[1]) : col + guard[1] + 1] = False
        found.sort(key=lambda target: -target.snr_db)
        return Detections(found, above, left_out, self._cfar, cells, independent)

    def _candidates(self) -> list[tuple[int, int]]:
        """Return cells that may hold a target, the strongest first."""
        count = self._channels
        rise = 1 + _UNSEEN / count - 1 / math.sqrt(count)
        rises = self._power > np.maximum(self._result.noise * rise, self._least)
        rises[:, self._map.range_m <= self._finder.geometry.reach_m] = False
        places = np.argwhere(rises & local_maxima(self._power))
        order = np.argsort(-self._power[places[:, 0], places[:, 1]], kind="stable")
        return [(int(row), int(col)) for row, col in places[order[:_MAX_CANDIDATES]]]

    def _targets(self, row: int, col: int) -> list[DirectedDetection]:
        """Return the targets of a cell above the thresholds of their beams."""
        where = float(self._map.range_m[col]), float(self._map.doppler_hz[row])
        (first,) = self._finder.find(self._map.values[:, row, col], *where, math.inf, 1)
        noise = self._noise_of_beam(first.weights, row, col)
        if not self._is_above(first, noise, col):
            return []
        alone = self._detection(row, col, first, noise)
        # What the first one leaves is told from others at its own range and Doppler.
        least_w = max(noise * self._ratio[col], abs(first.amplitude) ** 2 * _WEAKEST)
        sources = self._finder.find(
            self._values_at(alone), alone.range_m, alone.doppler_hz, least_w, MAX_SOURCES
        )
        found = []
        for source in sources if len(sources) > 1 else ():
            noise = self._noise_of_beam(source.weights, row, col)
            if self._is_above(source, noise, col):
                found.append(self._detection(row, col, source, noise))
        if len(found) < 2 or not self._finder.are_apart([one.direction for one in found]):
            return [alone]
        return found

    def _is_above(self, source: Source, noise: float, col: int) -> bool:
        if float(np.hypot(*source.direction[:2])) > _EDGE:
            return False
        return bool(abs(source.amplitude) ** 2 > max(noise * self._ratio[col], self._least))

    def _values_at(self, target: Detection) -> Complex:
        """Return the channels' values at a target's range and Doppler, between the cells, (n,)."""
        rows, cols = value_weights(self._wide, target.range_m, target.doppler_hz)
        return np.asarray(np.tensordot(rows, self._wide.values @ cols, axes=(0, 1)))

    def _noise_of_beam(self, weights: Complex, row: int, col: int) -> float:
        """Return the power around a cell in a beam, as the detector takes it."""
        (rows, cols), inside = ring_mask(self._cfar, self._power.shape, row, col)
        values = self._map.values[:, rows[:, None], cols]
        power = np.abs(np.einsum("c,crk->rk", weights, values))[inside] ** 2
        if self._cfar.kind == "ca":
            return float(power.mean()) if power.size else math.inf
        # of exponential power, by its quantile
        rank = float(np.quantile(power, self._cfar.rank)) if power.size else math.inf
        return rank / -math.log(1 - self._cfar.rank)

    def _detection(self, row: int, col: int, source: Source, noise: float) -> DirectedDetection:
        """Return a source with its range, Doppler and direction interpolated."""
        shape = self._power.shape
        for number in range(_ROUNDS + 1):
            beam, wide = _beam(self._map, source.weights), _beam(self._wide, source.weights)
            around = CfarResult(np.empty(0), np.broadcast_to(noise, shape), (0, 0.0))
            floor = self._noise_power
            if floor is not None:
                floor = floor * float(np.sum(np.abs(source.weights) ** 2))
            (target,) = interpolated_targets(beam, [(row, col)], around, self._cfar, wide, floor)
            if number < _ROUNDS:
                source = self._again(source, target)
        return self._placed(source, target)

    def _again(self, source: Source, target: Detection) -> Source:
        """Return a source found again from the channels' values at a target's range and Doppler."""
        count = MAX_SOURCES if source.among else 1
        least_w = abs(source.amplitude) ** 2 / 16
        found = self._finder.find(
            self._values_at(target), target.range_m, target.doppler_hz, least_w, count
        )
        return max(found, key=lambda one: float(one.direction @ source.direction))

    def _placed(self, source: Source, target: Detection) -> DirectedDetection:
        geometry = self._finder.geometry
        measured = zip(angles_deg(source.direction), geometry.measures, strict=True)
        azimuth_deg, elevation_deg = (angle if known else None for angle, known in measured)
        there_m = 2 * target.range_m - source.direction @ geometry.origin_m
        reach_m = (4 * target.range_m**2 - geometry.origin_m @ geometry.origin_m) / (2 * there_m)
        right, up, back = (reach_m * source.direction).tolist()
        world = (self._pose[:3, 3] + self._pose[:3, :3] @ (reach_m * source.direction)).tolist()
        given: dict[str, Any] = dataclasses.asdict(target)
        return DirectedDetection(
            **given,
            azimuth_deg=azimuth_deg,
            elevation_deg=elevation_deg,
            x_m=-back,
            y_m=-right,
            z_m=up,
            world_x_m=world[0],
            world_y_m=world[1],
            world_z_m=world[2],
        )


def _beam(rd_map: RangeDopplerMap, weights: Complex | Real) -> RangeDopplerMap:
    """Return the map of one beam: the sum of the channels with weights."""
    values = np.tensordot(weights, rd_map.values, axes=1)[None]
    return dataclasses.replace(rd_map, values=values, radar=one_channel(rd_map.radar, 0))
