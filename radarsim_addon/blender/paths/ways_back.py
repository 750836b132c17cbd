# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths back over mirrors to a receiver that stands apart from the transmitter.

A pixel that sees a point gives the power of the direct way back. Over a mirror, an element of the
surface fills another solid angle: its projected area over the squared length of that way. A Lambert
surface has the same radiance in both directions, so the power is that of the direct way times the
ratio of the solid angles and the mirror's reflectance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...array_types import Mask, Real
from ...signal.motion import PathImages
from ...signal.paths import PathRows
from ...vectors import dots, norms
from .curved_paths import CurvedPaths
from .hit_points import HitPoints
from .image_chains import (
    ImageChain,
    find_blocked,
    first_images,
    reflection,
    second_images,
    ways_over,
)
from .mirrors import FLAT, Mirror
from .obstacles import Obstacles
from .same_point import alike_in_both, measured


@dataclass(frozen=True)
class WaysBack:
    """Finds the paths over the images of a receiver, and over curved mirrors to it.

    `chains` are its images by their numbers, `lobes` the widths of the narrowest lobes by the
    bodies' numbers. `curved` is None without curved mirrors.
    """

    chains: Mapping[int, ImageChain]
    obstacles: Obstacles
    hits: HitPoints
    lobes: Real
    receiver_m: Real
    transmitter_m: Real
    polarisation: str
    wavelength_m: float
    reflections: int
    curved: CurvedPaths | None

    def added(self, rows: PathRows, images: PathImages) -> tuple[PathRows, float]:
        """Return rows of a tile replicate with the paths back over mirrors.

        Those with a `point` that several paths have are of one scattering. Also returns the power
        of paths that are left out because open objects lie on the way [W].
        """
        seen = rows[rows["point"] > 0]
        last_m = seen["last_scatterer_m"]
        from_m = np.broadcast_to(self.receiver_m, last_m.shape)
        normals = self.hits.normals(seen["last_body"], from_m, last_m)
        own = _projected(normals, self.receiver_m - last_m)
        parts, through_w = [rows], 0.0
        for number, chain in self.chains.items():
            over = _projected(normals, chain.image_m - last_m)
            lobe = self.lobes[seen["last_body"]]
            mine = own * over > 0  # NaN: no normal is known
            mine &= alike_in_both(last_m, self.receiver_m, chain.image_m, lobe)
            mine &= seen["order"] + len(chain.mirrors) <= self.reflections
            known = np.flatnonzero(mine)
            ways = ways_over(chain, last_m[known])
            known = known[ways.rows]
            back = seen[known]
            blocked, through = find_blocked(
                chain, ways, back["last_scatterer_m"], back["last_body"], self.obstacles
            )
            found = reflection(chain, ways, self.polarisation, self.wavelength_m)
            back["power_w"] *= found.power * over[known] / own[known]
            back["mirror_phase_rad"] -= found.phase_rad  # echoes carry exp(+j w t)
            back["mirrors"] += len(chain.mirrors)
            back["order"] += len(chain.mirrors)
            back["receiver_image"] = number
            through_w += float(back["power_w"][through].sum())
            back = back[~(blocked | through)]
            parts.append(measured(back, images, self.receiver_m, self.transmitter_m))
        if self.curved is not None:
            back = seen[seen["order"] < self.reflections]
            back, blocked_w = self.curved.over(back, 0, self.receiver_m)
            through_w += blocked_w
            parts.append(measured(back, images, self.receiver_m, self.transmitter_m))
        return np.concatenate(parts), through_w

    def alike(self, rows: PathRows, number: int) -> Mask:
        """Whether surfaces scatter nearly alike towards the receiver and an image of it, (n,)."""
        image_m, lobe = self.chains[number].image_m, self.lobes[rows["last_body"]]
        return alike_in_both(rows["last_scatterer_m"], self.receiver_m, image_m, lobe)


def receiver_chains(
    mirrors: Sequence[Mirror],
    receiver_m: Real,
    images: list[ImageChain],
    wavelength_m: float,
    most: int,
    pairs: bool,
) -> tuple[dict[int, ImageChain], list[ImageChain]]:
    """Return the images of the receiver by their numbers, and those that the transmitter has not.

    `images` are those of the transmitter, numbered from 1; new ones follow. With `pairs`, images
    over two mirrors in a row are added, `most` in all.
    """
    same = [_on_plane(one, images, wavelength_m) for one in mirrors]
    chains = first_images(same, receiver_m)
    if pairs:
        chains += second_images(chains)[: most - len(chains)]
    numbers = {_planes(chain): number for number, chain in enumerate(images, start=1)}
    found: dict[int, ImageChain] = {}
    new: list[ImageChain] = []
    for chain in chains:
        number = numbers.get(_planes(chain))
        if number is None:
            new.append(chain)
            number = len(images) + len(new)
        found[number] = chain
    return found, new


def _on_plane(mirror: Mirror, images: Sequence[ImageChain], wavelength_m: float) -> Mirror:
    """A mirror in the plane that the transmitter's image has, where it is the same."""
    for chain in images:
        other = chain.mirrors[0]
        near = abs(other.offset_m - mirror.offset_m) <= FLAT * wavelength_m
        if len(chain.mirrors) == 1 and near and float(other.normal @ mirror.normal) > 1 - 1e-6:
            return Mirror(
                other.normal, other.offset_m, mirror.triangles_m, mirror.body, mirror.material,
                mirror.objects, mirror.sight_sr,
            )  # fmt: skip
    return mirror


def _planes(chain: ImageChain) -> tuple[tuple[float, ...], ...]:
    return tuple((*mirror.normal.tolist(), mirror.offset_m) for mirror in chain.mirrors)


def _projected(normals: Real, ways_m: Real) -> Real:
    """Solid angle that a unit of area fills at the ends of ways, (n,) [1/m^2]; signed by side."""
    return np.asarray(dots(normals, ways_m) / norms(ways_m) ** 3)
