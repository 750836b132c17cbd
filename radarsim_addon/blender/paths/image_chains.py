# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of the transmitter over one mirror, or over two in a row, and the ways to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ... import contract
from ...array_types import Indices, Mask, Real
from ...physics.mirrors import MirrorMaterial, Reflected, co_polar, reflected_ways, sent_fields
from ...vectors import norms, take_rows
from .mirrors import Mirror
from .obstacles import Obstacles

#: Height over a mirror, over the way to it, below which a point is on its plane.
_LEAST_HEIGHT = 1e-6


@dataclass(frozen=True, eq=False)
class ImageChain:
    """Mirrors in the order from the transmitter, and its images in the first, the first two...

    `places_m` (mirrors + 1, 3) begins with the transmitter itself.
    """

    mirrors: tuple[Mirror, ...]
    places_m: Real

    @property
    def image_m(self) -> Real:
        """Place of the last image, (3,) [m]."""
        return np.asarray(self.places_m[-1])

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the objects with the mirrors."""
        return tuple(dict.fromkeys(name for mirror in self.mirrors for name in mirror.objects))

    @property
    def record(self) -> contract.ImageRecord:
        """As the table's sidecar has it."""
        return contract.ImageRecord(
            [mirror.normal.tolist() for mirror in self.mirrors],
            [mirror.offset_m for mirror in self.mirrors],
            list(self.objects),
            [mirror.own_body for mirror in self.mirrors],
        )

    def over(self, mirror: Mirror) -> ImageChain | None:
        """Return the chain with another mirror behind; None where its image is not in front."""
        last_m = self.image_m
        if mirror is self.mirrors[-1] or mirror.heights_m(last_m[None])[0] <= 0:
            return None
        places_m = np.vstack([self.places_m, mirror.image_m(last_m)])
        return replace(self, mirrors=(*self.mirrors, mirror), places_m=places_m)


@dataclass(frozen=True)
class WaysOver:
    """The ways of some rows to the transmitter over a chain of mirrors.

    `rows` are those that meet all mirrors, (n,); `met_m` where, from the scatterer on, (mirrors, n,
    3), and `triangle` of each mirror, likewise.
    """

    rows: Indices
    met_m: Real
    triangle: Indices

    def of(self, kept: Mask) -> WaysOver:
        """Return some of the ways."""
        return WaysOver(self.rows[kept], self.met_m[:, kept], self.triangle[:, kept])


def first_images(mirrors: Sequence[Mirror], transmitter_m: Real) -> list[ImageChain]:
    """Return the chains of one mirror each."""
    return [
        ImageChain((one,), np.stack([transmitter_m, one.image_m(transmitter_m)])) for one in mirrors
    ]


def second_images(chains: Sequence[ImageChain]) -> list[ImageChain]:
    """Return the chains of two of these mirrors, those in which most is seen first."""
    pairs = [
        (one.mirrors[0].sight_sr * other.mirrors[0].sight_sr, one.over(other.mirrors[0]))
        for one in chains
        for other in chains
    ]
    ranked = sorted(pairs, key=lambda pair: -pair[0])
    return [chain for _, chain in ranked if chain is not None]


def ways_over(chain: ImageChain, points_m: Real) -> WaysOver:
    """Find where ways from points (n, 3) to the transmitter meet the mirrors of a chain."""
    rows, at_m = np.arange(len(points_m)), points_m
    met: list[Real] = []
    triangles: list[Indices] = []
    for number in range(len(chain.mirrors) - 1, -1, -1):
        mirror, image_m = chain.mirrors[number], chain.places_m[number + 1]
        way_m = image_m - at_m
        over_m, under_m = mirror.heights_m(at_m), mirror.heights_m(chain.places_m[number][None])
        above = np.flatnonzero(over_m > _LEAST_HEIGHT * norms(way_m))
        share = over_m[above] / (over_m[above] + under_m)
        place_m = take_rows(at_m, above) + share[:, None] * take_rows(way_m, above)
        triangle = mirror.triangle_at(place_m)
        there = np.flatnonzero(triangle >= 0)
        kept = above[there]
        met, triangles = [one[kept] for one in met], [one[kept] for one in triangles]
        at_m = take_rows(place_m, there)
        rows = rows[kept]
        met.append(at_m)
        triangles.append(triangle[there])
    return WaysOver(rows, np.stack(met), np.stack(triangles))


def find_blocked(
    chain: ImageChain, ways: WaysOver, points_m: Real, bodies: Indices, obstacles: Obstacles
) -> tuple[Mask, Mask]:
    """Return whether something opaque, or only something open, lies on ways from points on bodies,
    (n, 3) and (n,), which belong to the ways.
    """
    blocked = np.zeros(len(points_m), dtype=bool)
    through = blocked.copy()
    at_m, own = points_m, bodies
    stations = [*ways.met_m, np.broadcast_to(chain.places_m[0], points_m.shape)]
    for number, next_m in enumerate(stations):
        left = np.flatnonzero(~blocked)
        blocked[left], on_through = obstacles.block(at_m[left], next_m[left], own[left])
        through[left] |= on_through
        if number < len(chain.mirrors):
            own = chain.mirrors[-1 - number].body[ways.triangle[number]]
        at_m = next_m
    return blocked, through & ~blocked


def reflection(
    chain: ImageChain, ways: WaysOver, polarisation: str, wavelength_m: float
) -> Reflected:
    """Return the waves of a polarisation behind the mirrors, where they meet the scatterers.

    The field goes from mirror to mirror as a vector. A scatterer takes the part of it with the
    polarisation of the run.
    """
    from_m = np.broadcast_to(chain.places_m[0], (ways.rows.size, 3))
    fields, onward = np.zeros((0, ways.rows.size, 3), dtype=np.complex128), from_m
    for number, mirror in enumerate(chain.mirrors):
        met_m, triangle = ways.met_m[-1 - number], ways.triangle[-1 - number]
        incoming = met_m - from_m
        incoming = incoming / norms(incoming)[:, None]
        if number == 0:
            fields = sent_fields(incoming, polarisation)
        groups: dict[MirrorMaterial, list[int]] = {}
        for index, material in enumerate(mirror.material):
            groups.setdefault(material, []).append(index)
        for material, numbers in groups.items():
            mine = np.flatnonzero(np.isin(triangle, numbers))
            fields[:, mine] = material.reflect(
                fields[:, mine], incoming[mine], mirror.normal, wavelength_m
            )
        onward, from_m = reflected_ways(incoming, mirror.normal), met_m
    return co_polar(fields, onward, polarisation)
