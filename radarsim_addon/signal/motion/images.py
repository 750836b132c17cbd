# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of antennas in planar mirrors, for the ends of paths that go over them.

A path over a mirror is as long as the straight one from the antenna's image. Seen from the antenna
itself, it goes to the scatterer's image: the scatterer, unfolded.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...array_types import Int32, Real
from ...contract import ImageRecord
from ...physics.mirrors import mirror_matrix
from .body_motion import BodyMotion
from .path_motion import Rows


@dataclass(frozen=True)
class PathImages:
    """Images of receiver and transmitter over which n paths go.

    Attributes
    ----------
    linear, offset_m
        Image x -> A x + b of a point, by the image's number: (images, 3, 3), (images, 3) [m].
        Number 0 is the antenna itself.
    numbers
        Numbers of the receiver's and of the transmitter's image, (n, 2).
    records
        What the images are of, by number less 1.
    """

    linear: Real
    offset_m: Real
    numbers: Int32
    records: tuple[ImageRecord, ...] = ()

    @classmethod
    def of(cls, records: Sequence[ImageRecord], numbers: NDArray[np.integer]) -> PathImages:
        """Return the images of a table: `numbers` as `numbers`, from 1 in `records`."""
        linear, offset_m = [np.eye(3)], [np.zeros(3)]
        for record in records:
            turned, shift = np.eye(3), np.zeros(3)
            for normal, at_m in zip(record.normals, record.offsets_m, strict=True):
                mirror, back = mirror_matrix(normal, at_m)
                turned, shift = mirror @ turned, mirror @ shift + back
            linear.append(turned)
            offset_m.append(shift)
        ends = np.asarray(numbers, dtype=np.int32)
        return cls(np.array(linear), np.array(offset_m), ends, tuple(records))

    def select(self, rows: Rows) -> PathImages:
        """Return the images of some paths."""
        return replace(self, numbers=self.numbers[rows])

    def join(self, parts: Sequence[PathImages | None], counts: Sequence[int]) -> PathImages:
        """Return the images of parts of a table, with so many paths each; None: without any."""
        numbers = [
            np.zeros((count, 2), dtype=np.int32) if part is None else part.numbers
            for part, count in zip(parts, counts, strict=True)
        ]
        return replace(self, numbers=np.concatenate(numbers))

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
        return np.array([False, *found])

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
