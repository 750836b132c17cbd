# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of antennas in planar mirrors, for the ends of paths that go over them.

A path over a mirror is as long as the straight one from the antenna's image. Seen from the antenna
itself, it goes to the scatterer's image: the scatterer, unfolded.

A curved mirror reflects one path like the plane that touches it at the point of reflection: length
and direction are those of the plane's image, and so is how both change as the ends begin to move.
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

#: Images that are kept whichever of them some paths need.
_FEW = 65


@dataclass(frozen=True)
class PathImages:
    """Images of receiver and transmitter over which n paths go.

    Attributes
    ----------
    linear, offset_m
        Image x -> A x + b of a point, by the image's number: (images, 3, 3), (images, 3) [m].
        Number 0 is the antenna itself; those of single paths over curved mirrors are at the end.
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
    def of(
        cls,
        records: Sequence[ImageRecord],
        numbers: NDArray[np.integer],
        planes: Real | None = None,
    ) -> PathImages:
        """Return the images of a table: `numbers` as `numbers`, from 1 in `records`; one below 0 is
        the image in its plane of `planes`, normals and offsets (n, 2, 4) [m].
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
        """Return the images of some paths."""
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
