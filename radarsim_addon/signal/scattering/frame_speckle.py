# SPDX-License-Identifier: GPL-3.0-or-later
"""Speckle of a frame as a stage of processing: finds its surfaces, applies their scatterers to
paths.

`FrameSpeckle` spreads paths over what their pixels cover and gives them the phasors, lengths and
motion of the scatterers of `SurfaceSpeckle`.

`ClutterSurfaces` sorts rows by clutter, for expected power. A path is clutter where all of its
known scatterers lie on objects with a clutter model, texture or motion of their own. Planes: 0 is
no clutter, 1 has scatterers that do not move by themselves (rain too: its drops have range rates),
each further one is a kind of motion.

`rain_rows` and `rain_paths` add the echo of rain, which belongs to no surface.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from ...arrays import Indices, Integers, Real
from ...contract import FluctuationRecord, GroundTruthRecord, ObjectRecord
from ...findings import Finding, finding
from ...physics.clutter import bragg_velocity_mps, clutter_correlation
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ...physics.radar_equation import effective_area_m2
from ...physics.rough import kirchhoff_limits
from ...physics.weather import rain_fall_speeds, rain_reflectivity_per_m
from ..decoding import FrameInput, FrameTable, pixel_rays
from ..motion import JoinedMotion, KinematicMotion, LinearMotion
from ..paths import PathFlag, PathRows, Paths, TableFootprints, geometry_of, make_paths, radiance_of
from ..radar import Weather
from .amplitudes import hash_step, uniform
from .surface_speckle import Body, Roughness, SpeckleReport, SurfaceSpeckle, grazing_cosines

#: Largest distance of the points of one path, in range resolutions of one-way range and in Doppler
#: bins: responses at this distance add up to an even power with any taper, as that of a band B has
#: no part beyond B in its square's spectrum.
_CELLS = 1.0


class FrameSpeckle:
    """Applies the scatterers of a frame's surfaces to its paths as they stream by.

    A frame of rings has no scatterers: its paths stay as they are, as without a `seed`. `cell_m` is
    the edge of a scatterer's cell; None: from the footprints of the pixels. `footprints` are from
    `table_footprints`; None: they are found here.
    """

    def __init__(
        self,
        frame_input: FrameInput,
        seed: int | None,
        cell_m: float | None = None,
        footprints: TableFootprints | None = None,
    ) -> None:
        self._speckle: SurfaceSpeckle | None = None
        waveform, scene = frame_input.radar.waveform, frame_input.ground_truth
        self.findings = kirchhoff_findings(scene, waveform.wavelength_m)
        if scene is None and frame_input.tables:
            self.findings.append(finding("ground-truth-missing"))
        if seed is None or not frame_input.tables:
            return
        table = frame_input.table
        record, self._table = table.record, table.rows
        self._images = record.images
        self._footprints = footprints or table_footprints(frame_input)
        bodies, columns = _bodies(table)
        surfaces = list(numbered_objects(scene, record.objects))
        self._speckle = SurfaceSpeckle(
            record,
            self._table,
            bodies,
            columns,
            waveform.carrier_hz,
            waveform.range_resolution_m,
            seed,
            {
                number: Roughness(item.rms_height_m, item.correlation_length_m or 0.0)
                for number, item in surfaces
                if item.rms_height_m is not None
            },
            cell_m,
            self._footprints,
            {number: one.fluctuation for number, one in surfaces if one.fluctuation is not None},
        )
        self._time_s = record.time_s
        self._wavenumber = 2 * np.pi / waveform.wavelength_m

    def apply(self, paths: Paths) -> Paths:
        """Return the paths for the echo synthesis: spread over their pixels, with the factors and
        the motion of their scatterers. Add up powers before this step.
        """
        if self._speckle is None or not len(paths):
            return paths
        motion = paths.motion
        if isinstance(motion, JoinedMotion):
            ends = np.cumsum([part.moving.size for part in motion.parts])
            each = zip(ends, motion.parts, strict=True)
            parts = ((paths[end - part.moving.size : end], part) for end, part in each)
            return Paths.join(
                self.apply(dataclasses.replace(own, motion=part)) for own, part in parts
            )
        index, rows = self._footprints.points(paths.row)
        if index.size > len(paths):
            paths = self._spread(paths, index, rows)
        known = np.flatnonzero(self._speckle.known(rows))
        found = self._speckle.scattering(rows if known.size == rows.size else rows[known])
        phasors, length_m = np.full(len(paths), np.nan + 0j), paths.length_m.copy()
        # the phase is that over the scatterer, the delay that of all paths of a cell
        phasors[known] = self._speckle.factors_at_rest(found)
        phasors[known] *= np.exp(1j * self._wavenumber * found.common_m)
        length_m[known] += found.common_m
        sway_mps = np.zeros(len(paths))
        if found.sway_mps is not None:
            sway_mps[known] = found.sway_mps
        motion = paths.motion
        if isinstance(motion, KinematicMotion) and motion.moving[known].any():
            moving = np.flatnonzero(motion.moving[known])
            going = known[moving]
            phasors[going], sway_mps[going] = found.factor[moving], 0.0
            length_m[going] = paths.length_m[going] + found.longer_m[moving]
            motion = self._following(motion, going, found.cell[moving])
        if isinstance(motion, (KinematicMotion, LinearMotion)):
            motion = dataclasses.replace(motion, length_m=length_m)
        paths = dataclasses.replace(paths, length_m=length_m, motion=motion, phasors=phasors)
        paths = self._over_scatterers(paths, known, found.cell)
        return self._swaying(paths, sway_mps)

    def _following(
        self, motion: KinematicMotion, going: Indices, cells: Indices
    ) -> KinematicMotion:
        """Return the motion with the rows `going` moved to the scatterers of `cells`."""
        assert self._speckle is not None
        first_m, last_m = motion.first_scatterer_m.copy(), motion.last_scatterer_m.copy()
        first_m[going], last_m[going] = self._speckle.scatterers_m(cells)
        leaders = self._speckle.leaders(cells)
        track = leaders["last_surface_point"]
        one, tracks = motion.order[going] == 1, motion.tracks.copy()
        tracks[going, 0] = np.where(one, track, leaders["first_surface_point"])
        tracks[going, 1] = track
        return dataclasses.replace(
            motion, first_scatterer_m=first_m, last_scatterer_m=last_m, tracks=tracks
        )

    def _over_scatterers(self, paths: Paths, known: Indices, cells: Indices) -> Paths:
        """Move the vertices of paths with a reverse to the scatterers of their cells. All paths of
        a cell then have one difference to their reverses, and the same factor.
        """
        marked = np.flatnonzero(paths.flags[known] & PathFlag.HAS_REVERSE)
        if paths.geometry is None or not marked.size:
            return paths
        assert self._speckle is not None
        first_m = paths.geometry.first_scatterer_m.copy()
        last_m = paths.geometry.last_scatterer_m.copy()
        here = known[marked]
        first_m[here], last_m[here] = self._speckle.scatterers_m(cells[marked])
        geometry = dataclasses.replace(
            paths.geometry, first_scatterer_m=first_m, last_scatterer_m=last_m
        )
        return dataclasses.replace(paths, geometry=geometry)

    def _swaying(self, paths: Paths, sway_mps: Real) -> Paths:
        """Add the range rates of clutter that moves by itself to the paths. Its scatterers keep
        their velocities from frame to frame: phases follow the frame's time.
        """
        if not sway_mps.any() or paths.phasors is None:
            return paths
        turned = paths.phasors * np.exp(-2j * self._wavenumber * self._time_s * sway_mps)
        paths = dataclasses.replace(
            paths, phasors=turned, range_rate_mps=paths.range_rate_mps + sway_mps
        )
        if paths.motion is None:
            return paths
        # constant range rates in place of bodies that are at rest
        sways = sway_mps != 0
        return Paths.join(
            [
                paths.select(~sways),
                dataclasses.replace(
                    own := paths.select(sways),
                    motion=LinearMotion(own.length_m, own.range_rate_mps),
                ),
            ]
        )

    def _spread(self, paths: Paths, index: Indices, points: PathRows) -> Paths:
        """Return paths for points, each with the gain of its original path."""
        motion = paths.motion
        if isinstance(motion, KinematicMotion):
            motion = dataclasses.replace(
                motion,
                length_m=points["length_m"],
                order=motion.order[index],
                first_scatterer_m=points["first_scatterer_m"],
                last_scatterer_m=points["last_scatterer_m"],
                direction=points["direction"],
                bodies=motion.bodies[index],
                tracks=motion.tracks[index],
                images=None if motion.images is None else motion.images.select(index),
            )
        elif motion is not None:
            motion = motion.select(index)
        # geometry is the points' own
        chosen = dataclasses.replace(paths, geometry=None, motion=None).select(index)
        return dataclasses.replace(
            chosen,
            solid_angle_sr=points["solid_angle_sr"],
            length_m=points["length_m"],
            range_rate_mps=points["range_rate_mps"],
            geometry=geometry_of(points, self._images),
            motion=motion,
        )

    def report(self) -> SpeckleReport | None:
        return None if self._speckle is None else self._speckle.report()


def table_footprints(frame_input: FrameInput) -> TableFootprints:
    """Return the points over which rows of a frame's table are spread, as close together as its
    echoes need them.
    """
    waveform, burst, table = frame_input.radar.waveform, frame_input.radar.burst, frame_input.table
    return TableFootprints(
        table.record,
        table.rows,
        2 * _CELLS * waveform.range_resolution_m,
        _CELLS * waveform.wavelength_m * burst.prf_hz / 2 / burst.pulses,
    )


def _bodies(table: FrameTable) -> tuple[dict[int, Body], tuple[str, str]]:
    """Return the bodies that scatterers are fixed to, and the table's columns with their numbers.
    The bodies are those of the motion file, with their poses at t. Without such a file they are the
    objects, in world space.
    """
    motion, names = table.motion, table.record.objects
    if motion is None:
        bodies = {n: Body(name, np.eye(4)) for n, name in enumerate(names, start=1)}
        return bodies, ("first_object", "last_object")
    deforming = {} if motion.tracks is None else motion.tracks.series
    bodies = {
        number: Body(key, body.pose, box, body.turning or number in deforming)
        for number, (key, body, box) in enumerate(
            zip(
                motion.body_keys,
                motion.bodies,
                motion.boxes or [None] * len(motion.bodies),
                strict=True,
            ),
            start=1,
        )
    }
    return bodies, ("first_body", "last_body")


def kirchhoff_findings(scene: GroundTruthRecord | None, wavelength_m: float) -> list[Finding]:
    """Find the objects of known roughness for which the rough lobe is not valid, with reasons."""
    return [
        limit.about(item.name)
        for item in (scene.objects if scene is not None else [])
        if item.rms_height_m and item.correlation_length_m
        for limit in kirchhoff_limits(item.rms_height_m, item.correlation_length_m, wavelength_m)
    ]


def numbered_objects(
    scene: GroundTruthRecord | None, objects: list[str]
) -> Iterator[tuple[int, ObjectRecord]]:
    """Yield the objects of a scene's record with their numbers, from 1."""
    numbers = {name: number for number, name in enumerate(objects, start=1)}
    for item in scene.objects if scene is not None else []:
        number = numbers.get(item.name.rsplit("/", 1)[-1])
        if number is not None:
            yield number, item


STILL_PLANE = 1


class ClutterSurfaces:
    """Objects of a frame that are clutter; `rain`: whether there is clutter of no object, too."""

    def __init__(self, frame_input: FrameInput, *, rain: bool = False) -> None:
        objects = frame_input.table.record.objects
        self._wavelength_m = frame_input.radar.waveform.wavelength_m
        self._plane = np.zeros(len(objects) + 1, dtype=np.int64)
        self._motions: list[FluctuationRecord] = []
        names = []
        for number, item in numbered_objects(frame_input.ground_truth, objects):
            if item.clutter is None and item.fluctuation is None:
                continue
            names.append(objects[number - 1])
            self._plane[number] = self._plane_of(item.fluctuation or FluctuationRecord())
        self.names = frozenset(names)
        #: 1 without any clutter.
        self.planes = STILL_PLANE + 1 + len(self._motions) if names or rain else 1

    def _plane_of(self, fluctuation: FluctuationRecord) -> int:
        if fluctuation.motion == "none":
            return STILL_PLANE
        motion = dataclasses.replace(
            fluctuation, texture="none", texture_shape=0.0, texture_length_m=0.0
        )
        if motion not in self._motions:
            self._motions.append(motion)
        return STILL_PLANE + 1 + self._motions.index(motion)

    def planes_of(self, rows: PathRows) -> Integers:
        """Return the plane of each row, (n,)."""
        last, first = rows["last_object"], rows["first_object"]
        first = np.where(first == 0, last, first)  # if only the last vertex is known
        clutter = (self._plane[last] > 0) & (self._plane[first] > 0)
        return np.where(clutter, self._plane[last], 0)

    def lines(self, plane: int, rows: PathRows) -> list[tuple[float, Real]]:
        """Return the lines of the spectrum of a plane: the fraction of the power, and the range
        rates that the motion adds to rows [m/s], (n,). There is one line, or both Bragg lines of a
        sea.
        """
        motion = self._motions[plane - STILL_PLANE - 1] if plane > STILL_PLANE else None
        if motion is None or motion.motion != "sea":
            return [(1.0, np.zeros(rows.size))]
        bragg_mps = bragg_velocity_mps(self._wavelength_m, grazing_cosines(rows))
        part = motion.motion_fraction
        return [(part, -bragg_mps), (1 - part, bragg_mps)]

    def correlations(self, lag_s: Real) -> list[Real]:
        """Return the correlation of the echoes of each plane at lags [s], about its lines, (lags,)
        each.
        """
        still = [np.ones(lag_s.size)] * min(self.planes, STILL_PLANE + 1)
        return still + [
            clutter_correlation(
                one.motion, one.motion_speed_mps, one.motion_fraction, lag_s, self._wavelength_m
            )
            for one in self._motions
        ]


# -------------------------------------------------------------------------------------------------
# The echo of rain: points of the air within the field of view, as rows of a path table.
#
# From each of a grid of directions, cells of range up to the surface that is hit there hold
#
#     dP = EIRP lambda^2 / (4 pi)^3  eta dOmega dr / r_t^2
#
# with eta the reflectivity of rain and r_t the distance to the transmitter; the link budget adds
# gains and extinction, as to other paths. Drops have the distribution of fall speeds that
# is weighted by eta, and drift with the wind. In each direction, rain counts up to the nearest
# range from which on echoes of surfaces cover half of its cell, and without limit where there are
# no echoes (sky, mirrors).
# -------------------------------------------------------------------------------------------------

#: Directions along the longer side of the field of view, and points of a frame, at most.
_DIRECTIONS, _MOST_POINTS = 32, 2_000_000
#: Rows of a table that surfaces are told from, at most.
_LOOKED_AT = 200_000


def rain_rows(frame_input: FrameInput, weather: Weather, seed: int) -> PathRows:
    """Return points of rain as rows of order 1 without an object. `seed` is for the places and
    speeds of the drops. Empty without rain or for an orthographic receiver.
    """
    receiver, radar = frame_input.receiver, frame_input.radar
    if not weather.rain_echo or weather.rain_mm_per_h == 0 or receiver.kind == "orthographic":
        return PathRows.zeros(0)
    waveform, step_m = radar.waveform, radar.waveform.range_resolution_m
    start_m = max(frame_input.range_limits_m[0], step_m)
    count = max(int((frame_input.range_limits_m[1] - start_m) / step_m), 0)
    across = receiver.right - receiver.left, receiver.top - receiver.bottom
    side = max(1, min(_DIRECTIONS, int(np.sqrt(_MOST_POINTS / max(count, 1)))))
    size = [max(1, round(side * abs(one) / max(map(abs, across)))) for one in across]
    rays = pixel_rays(receiver, *size)
    direction, solid_sr = rays.direction.reshape(-1, 3), rays.solid_angle_sr.ravel()
    reach_m = _open_to_m(frame_input, direction, solid_sr)
    edges_m = start_m + step_m * np.arange(count + 1)
    ray, cell = np.nonzero(edges_m[None, :-1] < reach_m[:, None])
    near_m, far_m = edges_m[cell], np.minimum(edges_m[cell + 1], reach_m[ray])
    draws = _draws(ray.size, seed)
    range_m = near_m + (far_m - near_m) * draws[0]
    rows = PathRows.zeros(ray.size)
    way = direction[ray]
    place_m = rays.origin_m + range_m[:, None] * way
    from_emitter = place_m - np.asarray(frame_input.transmitter.matrix_world)[:3, 3]
    emitter_m = np.linalg.norm(from_emitter, axis=1)
    # over the cell dr / r^2 is (far - near) / (near far)
    spread = (far_m - near_m) / (near_m * far_m) * (range_m / emitter_m) ** 2
    eta = rain_reflectivity_per_m(waveform.carrier_hz, weather.rain_mm_per_h)
    # rows hold the power at the carrier of their table
    area_m2 = effective_area_m2(SPEED_OF_LIGHT_MPS / frame_input.table.record.carrier_hz)
    eirp_w = frame_input.transmitter.eirp_w
    rows["power_w"] = eirp_w * area_m2 / (4 * np.pi) ** 2 * eta * solid_sr[ray] * spread
    rows["solid_angle_sr"] = solid_sr[ray]
    rows["length_m"] = range_m + emitter_m
    rows["order"] = 1
    rows["direction"] = way
    rows["first_scatterer_m"] = rows["last_scatterer_m"] = place_m
    mean_mps, spread_mps = rain_fall_speeds(waveform.carrier_hz, weather.rain_mm_per_h)
    gauss = np.sqrt(-2 * np.log(1 - draws[1])) * np.cos(2 * np.pi * draws[2])
    both = (way + from_emitter / emitter_m[:, None]) / 2
    rows["range_rate_mps"] = (
        weather.wind_x_mps * both[:, 0]
        + weather.wind_y_mps * both[:, 1]
        - (mean_mps + spread_mps * gauss) * both[:, 2]
    )
    return rows


def rain_paths(rows: PathRows, frame_input: FrameInput, seed: int) -> Paths:
    """Return points of rain as paths with constant range rates and random phases from a seed."""
    phases = np.exp(2j * np.pi * _draws(rows.size, seed ^ 0x5DEECE66D)[0])
    paths = make_paths(
        radiance_of(rows, frame_input.table.record),
        np.array(rows["length_m"]),
        np.array(rows["range_rate_mps"]),
        np.array(rows["solid_angle_sr"]),
    )
    return type(paths)(**{**vars(paths), "geometry": geometry_of(rows), "phasors": phases})


def _draws(count: int, seed: int) -> list[Real]:
    """Draw three series of numbers, uniform over 0 to 1, (count,) each."""
    state = hash_step(np.arange(count, dtype=np.uint64) ^ hash_step(np.array(seed % 2**64, "u8")))
    found = []
    for _ in range(3):
        state = hash_step(state)
        found.append(uniform(state))
    return found


def _open_to_m(frame_input: FrameInput, direction: Real, solid_sr: Real) -> Real:
    """Return ranges up to which each direction is open, (directions,) [m]."""
    from scipy.spatial import cKDTree  # not at import: slow

    table = frame_input.table
    every = max(1, -(-table.rows.size // _LOOKED_AT))
    rows = table.rows[::every]
    rows = rows[(rows["transparent_depth"] == 0) & (rows["order"] >= 1)]
    place_m = np.asarray(frame_input.receiver.matrix_world)[:3, 3]
    hit_m = np.linalg.norm(rows["first_scatterer_m"] - place_m, axis=1)
    rows, hit_m = rows[np.isfinite(hit_m)], hit_m[np.isfinite(hit_m)]
    reach_m = np.full(direction.shape[0], np.inf)
    if not rows.size:
        return reach_m
    _, ray = cKDTree(direction).query(rows["direction"])
    # nearest first: blocked from where the rows so far cover half of the direction
    order = np.lexsort((hit_m, ray))
    ray, hit_m, part = ray[order], hit_m[order], every * rows["solid_angle_sr"][order]
    total = np.cumsum(part)
    first = np.searchsorted(ray, np.arange(direction.shape[0]))
    before = np.concatenate([[0.0], total])[first]
    half = np.flatnonzero(total - before[ray] >= solid_sr[ray] / 2)
    np.minimum.at(reach_m, ray[half], hit_m[half])
    return reach_m
