# SPDX-License-Identifier: GPL-3.0-or-later
"""Lengths of paths over a burst from the motion of their vertices: one render for all pulses.

A path of one reflection has the length |P - C| + |P - T|, one of two
|P1 - C| + |P1 - P2| + |P2 - T|, with vertices that move with their bodies and antennas C and T that
may also move. Only *changes* are computed, as |a + d| - |a| = (2 a.d + d.d) / (|a + d| + |a|), and
added to the length in the table: at the time of the render it is that length exactly, and optical
delays in walls are kept. That is the frame's time t = 0, or a later one for further renders of a
burst.

With three or more reflections the first and the last vertex are known, those between are not. The
legs at both ends are then exact. The path from first to last vertex changes like the straight line
between them: exact if all vertices move as one body (a corner reflector), an approximation
otherwise. Paths without known vertices are taken as stationary.

A path over a planar mirror is as long as the straight one from the antenna's image. From the
antenna itself it leads to the scatterer's image: the scatterer, unfolded. A curved mirror reflects
one path like the plane that touches it at the point of reflection: length and direction are those
of the plane's image, and so are their changes as the ends begin to move.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ...arrays import Int32, Real, are_finite
from ...contract import ImageRecord
from ...errors import ConfigError
from ...physics.mirrors import mirror_matrix
from .body_motion import BodyMotion, which_move
from .motion_file import FrameMotion, VertexSeries

Rows = NDArray[np.bool_] | NDArray[np.intp] | slice


class PathMotion(Protocol):
    """Total optical lengths of n paths at any time of a burst.

    Time 0 is the frame's time t, at which the length is the paths' ``length_m``.
    """

    @property
    def moving(self) -> NDArray[np.bool_]:
        """(n,): False where the length is the same at all times."""

    @property
    def moving_vertices(self) -> NDArray[np.bool_]:
        """True where the first and where the last vertex moves, (n, 2)."""

    @property
    def scatterers_move(self) -> NDArray[np.bool_]:
        """(n,): True where a vertex or a mirror of the path moves, not only an antenna."""

    def lengths_m(self, times_s: Real, rows: Rows) -> Real:
        """Return the total lengths of some rows, (rows, times) [m]. Callers limit rows x times."""

    def displacements_m(self, times_s: Real, rows: Rows, end: int, points_m: Real) -> Real:
        """Return displacements since t = 0 of points near the first (`end` 0) or last (1) vertex.

        `points_m` are points at t = 0 on the bodies of these vertices, (rows, 3) [m]. The result,
        (rows, times, 3) [m], is 0 where the motion of the vertex is not known.
        """

    def select(self, rows: Rows) -> PathMotion: ...


@dataclass(frozen=True)
class LinearMotion:
    """Constant range rates, receding positive: l(t) = l + 2 v t.

    The motion of vertices is unknown, and all of the rate is taken for the scatterers'.
    """

    #: Total length at t = 0, (n,) [m].
    length_m: Real
    #: Rate of the one-way range, receding positive, (n,) [m/s].
    range_rate_mps: Real

    @property
    def moving(self) -> NDArray[np.bool_]:
        return np.asarray(self.range_rate_mps != 0)

    @property
    def moving_vertices(self) -> NDArray[np.bool_]:
        return np.zeros((self.length_m.size, 2), dtype=bool)

    @property
    def scatterers_move(self) -> NDArray[np.bool_]:
        return self.moving

    def lengths_m(self, times_s: Real, rows: Rows) -> Real:
        return self.length_m[rows, None] + 2 * self.range_rate_mps[rows, None] * times_s

    def displacements_m(self, times_s: Real, rows: Rows, end: int, points_m: Real) -> Real:
        return np.zeros((len(points_m), np.size(times_s), 3))

    def select(self, rows: Rows) -> LinearMotion:
        return LinearMotion(self.length_m[rows], self.range_rate_mps[rows])


def mean_over_burst(motion: PathMotion, burst_s: float, rows: Rows) -> tuple[Real, Real]:
    """Return one-way ranges [m] in the middle of a burst and mean range rates [m/s] over it,
    (rows,) each.

    A map shows an echo there: range rates of accelerating bodies at t are not those of its peaks.
    """
    first_m, middle_m, last_m = motion.lengths_m(np.array([0.0, 0.5, 1.0]) * burst_s, rows).T / 2
    return middle_m, (last_m - first_m) / burst_s


@dataclass(frozen=True)
class JoinedMotion:
    """Motions in sequence, as of paths that were joined."""

    parts: tuple[PathMotion, ...]

    @property
    def moving(self) -> NDArray[np.bool_]:
        return np.concatenate([part.moving for part in self.parts])

    @property
    def moving_vertices(self) -> NDArray[np.bool_]:
        return np.concatenate([part.moving_vertices for part in self.parts])

    @property
    def scatterers_move(self) -> NDArray[np.bool_]:
        return np.concatenate([part.scatterers_move for part in self.parts])

    def _places(
        self, rows: Rows
    ) -> Iterator[tuple[PathMotion, NDArray[np.intp], NDArray[np.intp]]]:
        """Yield the parts that rows lie in, with the rows' places among `rows` and in the part."""
        starts = np.cumsum([0, *(part.moving.size for part in self.parts)])
        wanted = np.arange(starts[-1])[rows]
        for part, start, stop in zip(self.parts, starts[:-1], starts[1:], strict=True):
            here = np.flatnonzero((wanted >= start) & (wanted < stop))
            if here.size:
                yield part, here, wanted[here] - start

    def lengths_m(self, times_s: Real, rows: Rows) -> Real:
        lengths = np.empty((np.arange(self.moving.size)[rows].size, np.size(times_s)))
        for part, here, own in self._places(rows):
            lengths[here] = part.lengths_m(times_s, own)
        return lengths

    def displacements_m(self, times_s: Real, rows: Rows, end: int, points_m: Real) -> Real:
        moved = np.empty((len(points_m), np.size(times_s), 3))
        for part, here, own in self._places(rows):
            moved[here] = part.displacements_m(times_s, own, end, points_m[here])
        return moved

    def select(self, rows: Rows) -> PathMotion:
        starts = np.cumsum([0, *(part.moving.size for part in self.parts)])
        return SelectedMotion(self, np.arange(starts[-1])[rows])


@dataclass(frozen=True)
class SelectedMotion:
    """Some rows of another motion, in any order."""

    whole: PathMotion
    rows: NDArray[np.intp]

    @property
    def moving(self) -> NDArray[np.bool_]:
        return self.whole.moving[self.rows]

    @property
    def moving_vertices(self) -> NDArray[np.bool_]:
        return self.whole.moving_vertices[self.rows]

    @property
    def scatterers_move(self) -> NDArray[np.bool_]:
        return self.whole.scatterers_move[self.rows]

    def lengths_m(self, times_s: Real, rows: Rows) -> Real:
        return self.whole.lengths_m(times_s, self.rows[rows])

    def displacements_m(self, times_s: Real, rows: Rows, end: int, points_m: Real) -> Real:
        return self.whole.displacements_m(times_s, self.rows[rows], end, points_m)

    def select(self, rows: Rows) -> PathMotion:
        return SelectedMotion(self.whole, self.rows[rows])


def join_motion(parts: Sequence[PathMotion]) -> PathMotion:
    """Join several motions, one at least, in the order of their rows."""
    return parts[0] if len(parts) == 1 else JoinedMotion(tuple(parts))


#: Images that are kept whichever of them some paths need.
_FEW = 65


@dataclass(frozen=True)
class PathImages:
    """Images of receiver and transmitter over which n paths go."""

    #: Image x -> A x + b of a point, by the image's number: (images, 3, 3), (images, 3) [m]. Number
    #: 0 is the antenna itself; those of single paths over curved mirrors are at the end.
    linear: Real
    offset_m: Real
    #: Numbers of the receiver's and of the transmitter's image, (n, 2).
    numbers: Int32
    #: What the images are of, by number less 1.
    records: tuple[ImageRecord, ...] = ()

    @classmethod
    def of(
        cls,
        records: Sequence[ImageRecord],
        numbers: NDArray[np.integer],
        planes: Real | None = None,
    ) -> PathImages:
        """Return the images of a table. Its `numbers` count from 1 in `records`; one below 0 is the
        image in its plane of `planes`, normals and offsets (n, 2, 4) [m].
        """
        linear, offset_m = [np.eye(3)], [np.zeros(3)]
        for record in records:
            turned, shift = np.eye(3), np.zeros(3)
            for normal, at_m in zip(record.normals, record.offsets_m, strict=True):
                mirror, back = mirror_matrix(normal, at_m)
                turned, shift = mirror @ turned, mirror @ shift + back
            linear.append(turned)
            offset_m.append(shift)
        return cls(
            np.array(linear), np.array(offset_m), np.zeros((0, 2), np.int32), tuple(records)
        ).of_paths(numbers, planes)

    def of_paths(self, numbers: NDArray[np.integer], planes: Real | None = None) -> PathImages:
        """Return the same images for other paths, with `numbers` and `planes` as for `of`."""
        matrices, shifts_m = self.linear, self.offset_m
        own_numbers: Int32 = np.array(numbers, dtype=np.int32)
        if planes is not None:
            own = own_numbers < 0
            normals, at = planes[own][:, :3], planes[own][:, 3:]
            own_numbers[own] = len(matrices) + np.arange(len(normals))
            mirrors = np.eye(3) - 2 * normals[:, :, None] * normals[:, None, :]
            matrices = np.concatenate([matrices, mirrors])
            shifts_m = np.concatenate([shifts_m, 2 * at * normals])
        return replace(self, linear=matrices, offset_m=shifts_m, numbers=own_numbers)

    def select(self, rows: Rows) -> PathImages:
        numbers = self.numbers[rows]
        if len(self.linear) <= max(numbers.size, _FEW):
            return replace(self, numbers=numbers)
        used = np.union1d(np.arange(1 + len(self.records)), numbers)
        return replace(
            self,
            linear=self.linear[used],
            offset_m=self.offset_m[used],
            numbers=np.searchsorted(used, numbers).astype(np.int32),
        )

    def join(self, parts: Sequence[PathImages | None], counts: Sequence[int]) -> PathImages:
        """Return the images of parts of a table, with so many paths each; None: without any."""
        common = 1 + len(self.records)
        linear, offset_m = [self.linear], [self.offset_m]
        numbers, last = [], len(self.linear)
        for part, count in zip(parts, counts, strict=True):
            if part is None:
                numbers.append(np.zeros((count, 2), dtype=np.int32))
            elif part.linear is self.linear:
                numbers.append(part.numbers)
            else:
                later = np.int32(last - common)
                numbers.append(part.numbers + later * (part.numbers >= common))
                linear.append(part.linear[common:])
                offset_m.append(part.offset_m[common:])
                last += len(part.linear) - common
        return replace(
            self,
            linear=np.concatenate(linear),
            offset_m=np.concatenate(offset_m),
            numbers=np.concatenate(numbers),
        )

    def places(self, end: int, antenna_m: Real) -> Real:
        """Return where the image of an antenna is, (n, 3) [m]; `end` 0 receiver, 1 transmitter."""
        found = self.linear @ antenna_m + self.offset_m
        return np.asarray(found[self.numbers[:, end]])

    def moves(self, end: int, moves_m: Real) -> Real:
        """Return how the image moves where the antenna does, (times, 3) or (3,): (n, ..., 3)."""
        found = np.einsum("kij,...j->k...i", self.linear, moves_m)
        return np.asarray(found[self.numbers[:, end]])

    def unfolded(self, end: int, points_m: Real) -> Real:
        """Return points (n, 3) as the antenna sees them over the mirrors, (n, 3) [m]."""
        return self.unturned(end, points_m - self.offset_m[self.numbers[:, end]])

    def unturned(self, end: int, vectors: Real) -> Real:
        """Return vectors (n, ..., 3) as the antenna sees them over the mirrors."""
        turned: Real = np.einsum("nji,n...j->n...i", self.linear[self.numbers[:, end]], vectors)
        return turned

    def moving(self, bodies: Sequence[BodyMotion]) -> NDArray[np.bool_]:
        """Return which images have a mirror that moves, by their numbers."""
        found = [any(b > 0 and bodies[b - 1].moving for b in one.bodies) for one in self.records]
        moving = np.zeros(len(self.linear), dtype=bool)
        moving[1 : 1 + len(found)] = found
        return moving

    def moves_with_mirrors(
        self,
        number: int,
        antenna_m: Real,
        moves_m: Real,
        bodies: Sequence[BodyMotion],
        times_s: Real,
    ) -> Real:
        """Return how an image has moved where its mirrors move, too, (times, 3) [m].

        A mirror is stationary in the axes of its body: the point is taken there, mirrored, and
        taken back.
        """
        before, now = antenna_m, antenna_m + moves_m
        for mirror, shift, body in self._mirrors(number, bodies):
            before = mirror @ before + shift
            if body is None:
                now = now @ mirror.T + shift
                continue
            turned, moved = body.change(times_s)
            origin, turned = body.origin_m, turned + np.eye(3)
            own = np.linalg.solve(turned, (now - origin - moved)[..., None])[..., 0] + origin
            arm = own @ mirror.T + shift - origin
            now = np.einsum("tij,tj->ti", turned, arm) + origin + moved
        return np.asarray(now - before)

    def velocity_with_mirrors(
        self, number: int, antenna_m: Real, velocity_mps: Real, bodies: Sequence[BodyMotion]
    ) -> Real:
        """Return the velocity of an image at t = 0 where its mirrors move, too, (3,) [m/s]."""
        place, velocity = antenna_m, velocity_mps
        for mirror, shift, body in self._mirrors(number, bodies):
            after = mirror @ place + shift
            if body is None:
                velocity = mirror @ velocity
            else:
                own, mirrored = body.velocity(np.stack([place, after]))
                velocity = mirror @ (velocity - own) + mirrored
            place = after
        return np.asarray(velocity)

    def _mirrors(
        self, number: int, bodies: Sequence[BodyMotion]
    ) -> Iterator[tuple[Real, Real, BodyMotion | None]]:
        """Yield the reflection at each mirror of an image, and its body where that moves."""
        one = self.records[number - 1]
        for normal, at_m, body in zip(one.normals, one.offsets_m, one.bodies, strict=True):
            moves = body > 0 and bodies[body - 1].moving
            yield *mirror_matrix(normal, at_m), bodies[body - 1] if moves else None


#: Rows times moments computed at once: 12 MB for each array of vectors.
_BLOCK = 1 << 19


def row_blocks(rows: int, times: int) -> Iterator[slice]:
    """Yield parts of so many rows that are computed at once at so many times."""
    step = max(1, _BLOCK // max(times, 1))
    for start in range(0, rows, step):
        yield slice(start, min(start + step, rows))


@dataclass(frozen=True)
class KinematicMotion:
    """Motion of n rows of a path table, a `PathMotion`."""

    scene: FrameMotion
    #: Lengths at t = 0, (n,) [m].
    length_m: Real
    order: Int32
    #: Vertices and the direction from the receiver, (n, 3); NaN where unknown.
    first_scatterer_m: Real
    last_scatterer_m: Real
    direction: Real
    #: Body and track of the first and of the last vertex, (n, 2); 0: unknown, none.
    bodies: Int32
    tracks: Int32
    #: Images of the antennas over which the paths go; None: none.
    images: PathImages | None = None

    @functools.cached_property
    def known(self) -> NDArray[np.bool_]:
        """Rows with known first and last vertex, (n,)."""
        return are_finite(self.first_scatterer_m) & are_finite(self.last_scatterer_m)

    @functools.cached_property
    def moving(self) -> NDArray[np.bool_]:
        if self.scene.receiver.moving or self.scene.emitter.moving:
            return self.known
        return self.scatterers_move

    @functools.cached_property
    def scatterers_move(self) -> NDArray[np.bool_]:
        first, last = self.moving_vertices.T
        moving = first | last
        if self.images is not None:
            over = self.images.moving(self.scene.bodies)[self.images.numbers].any(axis=-1)
            moving |= over & self.known
        return np.asarray(moving)

    @functools.cached_property
    def moving_vertices(self) -> NDArray[np.bool_]:
        moves = np.concatenate([[False], which_move(self.scene.bodies)])
        touched = moves[self.bodies] | (self.tracks > 0)
        return np.asarray(touched & self.known[:, None])

    @functools.cached_property
    def approximated(self) -> NDArray[np.bool_]:
        """Moving rows with unknown middle vertices that may move differently, (n,)."""
        apart = (self.bodies[:, 0] != self.bodies[:, 1]) | (self.tracks > 0).any(axis=-1)
        return np.asarray(self.moving & (self.order > 2) & apart)

    @functools.cached_property
    def unknown(self) -> NDArray[np.bool_]:
        """Rows with a vertex of unknown body, (n,)."""
        return np.asarray(~self.known | (self.bodies == 0).any(axis=-1))

    def select(self, rows: Rows) -> KinematicMotion:
        return KinematicMotion(
            self.scene,
            self.length_m[rows],
            self.order[rows],
            self.first_scatterer_m[rows],
            self.last_scatterer_m[rows],
            self.direction[rows],
            self.bodies[rows],
            self.tracks[rows],
            None if self.images is None else self.images.select(rows),
        )

    def lengths_m(self, times_s: Real, rows: Rows) -> Real:
        times_s = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
        self._check(times_s)
        index = np.arange(self.length_m.size)[rows]
        lengths = np.repeat(self.length_m[index][:, None], times_s.size, axis=1)
        places = np.flatnonzero(self.moving[index])
        for part in row_blocks(places.size, times_s.size):
            here = places[part]
            lengths[here] += self._change(index[here], times_s)
        return lengths

    def _check(self, times_s: Real) -> None:
        slack_s = 1e-9 + 1e-6 * self.scene.span_s
        if times_s.size and (
            times_s.min() < -slack_s or times_s.max() > self.scene.span_s + slack_s
        ):
            raise ConfigError(
                f"Lengths are needed from {times_s.min():g} to {times_s.max():g} s, but motion "
                f"was sampled from 0 to {self.scene.span_s:g} s. Render the run again with this "
                "burst."
            )

    def _change(self, rows: NDArray[np.intp], times_s: Real) -> Real:
        """Return the lengths minus the lengths at t = 0, (rows, times) [m]."""
        scene = self.scene
        first, last = self.first_scatterer_m[rows], self.last_scatterer_m[rows]
        receiver_m, emitter_m = (self._place(end, rows) for end in (0, 1))
        moved_receiver, moved_emitter = (self._moved(end, rows, times_s) for end in (0, 1))
        moved_last = self._displacement(rows, 1, times_s, last)
        several = self.order[rows] > 1
        moved_first = moved_last
        if several.any():
            moved_first = moved_last.copy()
            moved_first[several] = self._displacement(rows[several], 0, times_s, first[several])
        if scene.orthographic:
            change = self._plane_leg(rows, moved_first, times_s, moved_receiver)
        else:
            change = leg_change(first - receiver_m, moved_first - moved_receiver)
        change += leg_change(last - emitter_m, moved_last - moved_emitter)
        if several.any():
            change[several] += leg_change(
                (last - first)[several], moved_last[several] - moved_first[several]
            )
        return change

    def _place(self, end: int, rows: NDArray[np.intp]) -> Real:
        """Return receiver (0) or transmitter (1), or its images, at t, (3,) or (rows, 3)."""
        place_m: Real = (self.scene.receiver, self.scene.emitter)[end].pose[:3, 3]
        return place_m if self.images is None else self.images.select(rows).places(end, place_m)

    def _moved(self, end: int, rows: NDArray[np.intp], times_s: Real) -> Real:
        """Return how far an antenna, or its images, have moved, (1 or rows, times, 3) [m]."""
        body = (self.scene.receiver, self.scene.emitter)[end]
        place_m = body.pose[:3, 3]
        move = body.displacement(place_m[None], times_s)[0]
        if self.images is None:
            return np.asarray(move[None])
        images = self.images.select(rows)
        moved = images.moves(end, move)
        for number, here in self._over_moving(images, end):
            moved[here] = images.moves_with_mirrors(
                number, place_m, move, self.scene.bodies, times_s
            )
        return moved

    def _antenna_velocity(self, end: int, rows: NDArray[np.intp]) -> Real:
        """Return the velocity of an antenna, or of its images, at t = 0, (1 or rows, 3) [m/s]."""
        body = (self.scene.receiver, self.scene.emitter)[end]
        place_m = body.pose[:3, 3]
        velocity = body.velocity(place_m[None])[0]
        if self.images is None:
            return np.asarray(velocity[None])
        images = self.images.select(rows)
        velocities = images.moves(end, velocity)
        for number, here in self._over_moving(images, end):
            velocities[here] = images.velocity_with_mirrors(
                number, place_m, velocity, self.scene.bodies
            )
        return velocities

    def _over_moving(self, images: PathImages, end: int) -> Iterator[tuple[int, NDArray[np.intp]]]:
        """Yield each image with a mirror that moves, and the rows over it."""
        for number in np.flatnonzero(images.moving(self.scene.bodies)).tolist():
            here = np.flatnonzero(images.numbers[:, end] == number)
            if here.size:
                yield number, here

    def _plane_leg(
        self, rows: NDArray[np.intp], moved: Real, times_s: Real, moved_receiver: Real
    ) -> Real:
        """Return the change of the distance from an orthographic receiver's plane."""
        turned, _ = self.scene.receiver.change(times_s)
        boresight = self.direction[rows]
        arm = self.first_scatterer_m[rows] - self.scene.receiver.pose[:3, 3]
        # b(t).(P(t) - C(t)) - b.(P - C), b(t) - b = (F(t) - 1) b
        shift = moved - moved_receiver
        turning = np.einsum("tij,nj->nti", turned, boresight)
        change = np.einsum("nti,ni->nt", shift, boresight)
        change += np.einsum("nti,nti->nt", turning, arm[:, None] + shift)
        return np.asarray(change)

    def displacements_m(self, times_s: Real, rows: Rows, end: int, points_m: Real) -> Real:
        times_s = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
        self._check(times_s)
        return self._displacement(np.arange(self.length_m.size)[rows], end, times_s, points_m)

    def _displacement(self, rows: NDArray[np.intp], end: int, times_s: Real, points: Real) -> Real:
        """Return how far points at one end (0 first, 1 last) have moved, (rows, times, 3)."""
        moved = np.zeros((rows.size, times_s.size, 3))
        for motion, here, surface in self._groups(rows, end):
            if surface is None:
                moved[here] = motion.displacement(points[here], times_s)
            else:
                moved[here] = self._on_surface(motion, surface, times_s)
        return moved

    def _groups(
        self, rows: NDArray[np.intp], end: int
    ) -> Iterator[tuple[BodyMotion, NDArray[np.intp], _SurfacePoints | None]]:
        """Yield motion and rows of each body, points on deforming surfaces separately."""
        numbers, tracks = self.bodies[rows, end], self.tracks[rows, end]
        for body in np.unique(numbers).tolist():
            if body == 0:
                continue
            motion, all_points = self.scene.bodies[body - 1], self.scene.tracks
            here = np.flatnonzero((numbers == body) & (tracks == 0))
            if here.size and motion.moving:
                yield motion, here, None
            here = np.flatnonzero((numbers == body) & (tracks > 0))
            if here.size and all_points is not None:
                point = tracks[here] - 1
                corners, weights = all_points.vertices[point], all_points.weights[point]
                yield motion, here, _SurfacePoints(all_points.series[body], corners, weights)

    def _on_surface(self, motion: BodyMotion, surface: _SurfacePoints, times_s: Real) -> Real:
        """Return the displacement of points on a deforming mesh: T + F A v(t), (rows, times, 3)."""
        axes = motion.pose[:3, :3]
        turned, shift = motion.change(times_s)
        start = surface.start(self.scene.epoch_offset_s)
        positions = surface.series.positions(surface.corners, times_s)
        now = np.einsum("nk,tnki->nti", surface.weights, positions)
        arm = now @ axes.T
        moved: Real = arm - (start @ axes.T)[:, None] + shift
        moved += np.einsum("tij,ntj->nti", turned, arm)
        return moved

    def range_rates_mps(self) -> Real:
        """Return the one-way range rates at t = 0, receding positive, (n,) [m/s]; 0 if unknown.

        dL/dt = sum over vertices of v . (u_in - u_out), and the antennas' own motion; u_in points
        along the path from receiver to transmitter into the vertex.
        """
        rates = np.zeros(self.length_m.size)
        rows = np.flatnonzero(self.moving)
        if not rows.size:
            return rates
        scene = self.scene
        first, last = self.first_scatterer_m[rows], self.last_scatterer_m[rows]
        receiver_m, emitter_m = (self._place(end, rows) for end in (0, 1))
        v_last = self._velocity(rows, 1)
        several = self.order[rows] > 1
        v_first = np.where(several[:, None], self._velocity(rows, 0), v_last)
        to_first = _unit(first - receiver_m)
        v_receiver, v_emitter = (self._antenna_velocity(end, rows) for end in (0, 1))
        rate = np.zeros(rows.size)
        if scene.orthographic:
            to_first = self.direction[rows]
            turning = to_first @ scene.receiver.rates()[0].T
            rate += np.sum(turning * (first - receiver_m), axis=-1)
        to_last = _unit(last - emitter_m)
        between = _unit(last - first)
        rate += np.sum((v_first - v_receiver) * to_first, axis=-1)
        rate += np.sum((v_last - v_emitter) * to_last, axis=-1)
        rate += np.where(several, np.sum((v_last - v_first) * between, axis=-1), 0.0)
        rates[rows] = rate / 2
        return rates

    def _velocity(self, rows: NDArray[np.intp], end: int) -> Real:
        points = (self.first_scatterer_m, self.last_scatterer_m)[end][rows]
        velocity = np.zeros((rows.size, 3))
        for motion, here, surface in self._groups(rows, end):
            if surface is None:
                velocity[here] = motion.velocity(points[here])
                continue
            axes, epoch_s = motion.pose[:3, :3], self.scene.epoch_offset_s
            turning, shift = motion.rates()
            velocities = surface.series.velocities(surface.corners, epoch_s)
            own = np.einsum("nk,nki->ni", surface.weights, velocities)
            place = surface.start(epoch_s)
            velocity[here] = own @ axes.T + (place @ axes.T) @ turning.T + shift
        return velocity


class _SurfacePoints(NamedTuple):
    """Points on one deforming mesh: three vertices and their weights, (rows, 3) each."""

    series: VertexSeries
    corners: Int32
    weights: Real

    def start(self, epoch_s: float) -> Real:
        """Return positions at the epoch in the body's own axes, (rows, 3) [m]."""
        positions = self.series.positions(self.corners, np.array([epoch_s]))
        return np.asarray(np.einsum("nk,tnki->tni", self.weights, positions)[0])


def leg_change(leg: Real, moved: Real) -> Real:
    """Return |a + d| - |a| without cancellation, (n, times) [m]; a is (n, 3), d (n, times, 3)."""
    # einsum over three components is several times faster than sums of products here
    along = 2 * np.einsum("ni,nti->nt", leg, moved)
    along += np.einsum("nti,nti->nt", moved, moved)
    length = np.sqrt(np.einsum("ni,ni->n", leg, leg))[:, None]
    total = np.sqrt(np.maximum(length**2 + along, 0.0)) + length
    change: Real = np.zeros_like(along)
    np.divide(along, total, out=change, where=total > 0)
    return change


def _unit(vectors: Real) -> Real:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(length > 0, vectors / length, 0.0))
