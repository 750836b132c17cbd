# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths whose last reflections are those of planar mirrors: kept where the mirror is on the way.

A render with the transmitter in the place of its image gives all surfaces that see the image as if
nothing were in between. A path is one if the way from its last scatterer to the image meets the
mirror, and nothing else lies on the way to that point and on from there to the transmitter.
"""

from __future__ import annotations

import math
from functools import cache
from weakref import WeakKeyDictionary

import numpy as np

from ... import contract
from ...array_types import Mask, Real
from ...findings import Finding, finding
from ...signal.motion import PathImages
from ...signal.paths import IMAGE_DTYPE, PathFlag, PathRows
from ...vectors import are_finite, crosses, distances, dots, norms
from ..materials import lobe_width
from ..motion import Bodies
from ..plan import Measurement, PathOptions
from ..state import Shape
from ..views import TracedReplicate, pixel_numbers
from .hit_points import HitPoints
from .image_chains import (
    ImageChain,
    find_blocked,
    first_images,
    reflection,
    second_images,
    ways_over,
)
from .mirrors import find_mirrors
from .obstacles import BodyMesh, Obstacles
from .same_point import ONE_PLACE, add_reverse_paths, alike_in_both, in_view
from .ways_back import WaysBack, receiver_chains

#: How far a mirrored ray may pass its scatterer, and its length be off, over that: float32.
_MIRRORED = 2e-5


class MirrorPaths:
    """The images of the transmitter in one frame, and the paths over them.

    Parameters
    ----------
    bodies
        Of the frame; Blender must evaluate nothing else while rows are chosen.
    hits
        Finds normals.
    metres_per_unit
        Length of a Blender unit [m].
    receiver
        At the frame's time.
    transmitter_m
        Place of the transmitter, (3,) [m].
    reach_m
        Distance of the farthest surface from the receiver [m].
    measurement, options
        Of the run.
    meshes
        Meshes that were read; more are added.
    """

    def __init__(
        self,
        bodies: Bodies,
        hits: HitPoints,
        metres_per_unit: float,
        receiver: contract.ReceiverRecord,
        transmitter_m: Real,
        reach_m: float,
        measurement: Measurement,
        options: PathOptions,
        meshes: WeakKeyDictionary[Shape, BodyMesh | None],
    ) -> None:
        self._obstacles = Obstacles(bodies, metres_per_unit, meshes)
        self._transmitter_m, self._polarisation = transmitter_m, measurement.polarisation
        self._receiver, self._hits = receiver, hits
        self._receiver_m = np.asarray(receiver.matrix_world, dtype=np.float64)[:3, 3]
        width = cache(lobe_width)
        widths = [
            min(map(width, shape.materials), default=math.inf) for shape in bodies.snapshot.shapes
        ]
        #: Width of the narrowest lobe by the body's number, from 1.
        self._lobes = np.append(0.0, np.array(widths)[bodies.shape])
        self._reflections = options.max_reflections
        self._wavelength_m = measurement.waveform.wavelength_m
        most = options.mirror_images if self._reflections > 1 else 0
        self.mirrors, self._findings = find_mirrors(
            self._obstacles, transmitter_m, self._wavelength_m, most
        )
        if self._reflections == 1:
            names = [name for item in self._findings for name in item.subjects]
            self._findings = [finding("mirrors-need-reflections", *names)] if names else []
        elif self._reflections == 2 and self.mirrors:
            names = [name for mirror in self.mirrors for name in mirror.objects]
            self._findings.append(finding("mirror-both-ways-left-out", *dict.fromkeys(names)))
        rough = [name for one in self.mirrors if one.is_rough for name in one.objects]
        if rough:
            self._findings.append(finding("mirror-slightly-rough", *dict.fromkeys(rough)))
        apart_m = float(np.linalg.norm(self._receiver_m - transmitter_m))
        #: Whether a path and its reverse are alike.
        self._one_place = apart_m <= ONE_PLACE * reach_m and receiver.kind != "orthographic"
        #: Bodies that scatter otherwise towards an image.
        self._narrow: set[int] = set()
        self.images = first_images(self.mirrors, transmitter_m)
        if self._reflections > 2:
            self._add_second_images(most)
        #: Images of the receiver by their numbers, where it stands apart.
        self._back: WaysBack | None = None
        self._own_images: list[ImageChain] = []
        if receiver.kind == "orthographic" and self.mirrors:
            self._findings.append(finding("mirror-ways-not-in-phase"))
        elif not self._one_place:
            self._find_ways_back(most)
        #: Places of the images, (n, 3) [m].
        self.images_m: Real = np.array([one.image_m for one in self.images]).reshape(-1, 3)

    def _add_second_images(self, most: int) -> None:
        """Add the images over two mirrors in a row, as far as there may be more images."""
        second = second_images(self.images)
        free = most - len(self.images)
        self.images += second[:free]
        if second[free:]:
            names = dict.fromkeys(name for chain in second[free:] for name in chain.objects)
            count = len(second) - free
            self._findings.append(finding("mirror-pairs-left-out", *names, count=count, most=most))

    def _find_ways_back(self, most: int) -> None:
        """Find the images of a receiver that stands apart from the transmitter."""
        mirrors, findings = find_mirrors(
            self._obstacles, self._receiver_m, self._wavelength_m, most
        )
        told = {item.code for item in self._findings}
        if self._reflections > 1:
            self._findings += [item for item in findings if item.code not in told]
        pairs = self._reflections > 2
        chains, self._own_images = receiver_chains(
            mirrors, self._receiver_m, self.images, self._wavelength_m, most, pairs
        )
        self.mirrors += mirrors
        self._back = WaysBack(
            chains,
            self._obstacles,
            self._hits,
            self._lobes,
            self._receiver_m,
            self._transmitter_m,
            self._polarisation,
            self._wavelength_m,
            self._reflections,
        )

    @property
    def findings(self) -> list[Finding]:
        """What to know of the mirrors, after all rows."""
        names = [self._name(body) for body in sorted(self._narrow)]
        if not names or self._receiver.kind == "orthographic":
            return self._findings
        return [*self._findings, finding("mirror-lobe-narrow", *dict.fromkeys(names))]

    def _name(self, body: int) -> str:
        """Name of the object of a body, from 1."""
        bodies = self._obstacles.bodies
        return str(bodies.originals[int(bodies.number[body - 1])].name_full)

    @property
    def bodies(self) -> dict[int, str]:
        """Names of the objects of all mirrors by the numbers of their bodies."""
        numbers = {int(n) for mirror in self.mirrors for n in np.unique(mirror.body)}
        return {number: self._name(number) for number in sorted(numbers)}

    @property
    def shared_bodies(self) -> set[int]:
        """Numbers of the bodies whose planes are those of others, too."""
        shared = [mirror.body for mirror in self.mirrors if mirror.own_body == 0]
        return {int(n) for body in shared for n in np.unique(body)}

    @property
    def records(self) -> list[contract.ImageRecord]:
        """The images, in the order of their numbers from 1; the receiver's own are the last."""
        return [chain.record for chain in (*self.images, *self._own_images)]

    def choose(self, image: int, rows: PathRows) -> tuple[PathRows, float]:
        """Return the paths among rows that were measured with an image, from 1, with its mirrors
        in their order, power and phase; and the power of those left out because open objects lie on
        the way [W].
        """
        chain = self.images[image - 1]
        rows = rows[are_finite(rows["last_scatterer_m"]) & (rows["flags"] & PathFlag.NO_RANGE == 0)]
        ways = ways_over(chain, rows["last_scatterer_m"])
        rows = rows[ways.rows]
        blocked, through = find_blocked(
            chain, ways, rows["last_scatterer_m"], rows["last_body"], self._obstacles
        )
        through_w = float(rows["power_w"][through].sum())
        free = ~(blocked | through)
        rows = rows[free]
        power, phase_rad = reflection(chain, ways.of(free), self._polarisation, self._wavelength_m)
        rows["power_w"] *= power
        rows["mirror_phase_rad"] = -phase_rad  # echoes carry exp(+j w t)
        rows["transmitter_image"] = image
        rows["mirrors"] = len(chain.mirrors)
        rows["order"] += len(chain.mirrors)
        return rows, through_w

    def number(self, rows: PathRows, traced: TracedReplicate, image: int) -> PathRows:
        """Return rows with the columns of images, and with the point of each path that scatters
        once: its pixel.
        """
        wide = with_image_columns(rows)
        once = (rows["order"] == 1) & (rows["transparent_depth"] == 0) & (rows["last_body"] > 0)
        once &= rows["flags"] & PathFlag.NO_RANGE == 0
        if image:
            alike = self._alike(rows, image)
            self._narrow.update(np.unique(rows["last_body"][once & ~alike]).tolist())
            if self._back is None:
                once &= alike
        wide["point"] = np.where(once, pixel_numbers(traced), 0)
        return wide

    def with_both_ways(self, rows: PathRows) -> tuple[PathRows, float]:
        """Return rows of a tile replicate with those that come back over mirrors, as `same_point`
        or `ways_back` has them, and the power of those left out because open objects lie on the way
        [W].
        """
        if self._receiver.kind == "orthographic":
            return rows, 0.0
        rows = rows[~self._seen_directly(rows)]
        images = PathImages.of(self.records, np.zeros((0, 2), dtype=np.int32))
        if self._back is None:
            every = add_reverse_paths(
                rows, images, self._receiver_m, self._transmitter_m, self._reflections
            )
            return every, 0.0
        every, through_w = self._back.added(rows, images)
        for image in range(1, len(self.images) + 1):
            of_image = np.flatnonzero((every["transmitter_image"] == image) & (every["point"] > 0))
            every["point"][of_image[~self._alike(every[of_image], image)]] = 0
        _, place, paths = np.unique(every["point"], return_inverse=True, return_counts=True)
        every["point"][paths[place] == 1] = 0
        return every, through_w

    def _alike(self, rows: PathRows, image: int) -> Mask:
        """Whether surfaces scatter nearly alike towards the transmitter and its image, (n,)."""
        lobe = self._lobes[rows["last_body"]]
        image_m = self.images_m[image - 1]
        return alike_in_both(rows["last_scatterer_m"], self._transmitter_m, image_m, lobe)

    def _seen_directly(self, rows: PathRows) -> Mask:
        """Rows that come over mirrors to a vertex that another pixel sees."""
        gone = np.zeros(rows.size, dtype=bool)
        once = (rows["transparent_depth"] == 0) & (rows["last_body"] > 0)
        once &= are_finite(rows["last_scatterer_m"])
        back = dict(enumerate(self.images, 1)) if self._back is None else self._back.chains
        for image, chain in back.items():
            scatterers = rows["order"] - rows["mirrors"] == 1 + len(chain.mirrors)
            mine = np.flatnonzero(once & scatterers)
            if not mine.size:
                continue
            # The way over these mirrors has its direction and length; others scatter on the way.
            ends = np.stack([np.full(mine.size, image), rows["transmitter_image"][mine]], axis=-1)
            over = PathImages.of(self.records, ends)
            last_m = rows["last_scatterer_m"][mine]
            seen_m = over.unfolded(0, last_m) - self._receiver_m
            way_m = norms(seen_m) + distances(last_m, over.places(1, self._transmitter_m))
            length_m = rows["length_m"][mine]
            close = norms(crosses(seen_m, rows["direction"][mine])) <= _MIRRORED * length_m
            close &= np.abs(way_m - length_m) <= _MIRRORED * length_m
            mine = mine[close]
            alike = self._alike if self._back is None else self._back.alike
            mine = mine[alike(rows[mine], image)]
            mine = mine[in_view(rows["last_scatterer_m"][mine], self._receiver)]
            place_m = over.places(0, self._receiver_m)[0]
            gone[mine[self._visible(rows[mine], place_m)]] = True
        return gone

    def _visible(self, rows: PathRows, image_m: Real) -> Mask:
        """Whether the receiver sees last vertices from the side from which its image does."""
        last_m = rows["last_scatterer_m"]
        places_m = (
            np.broadcast_to(place_m, last_m.shape) for place_m in (image_m, self._receiver_m)
        )
        from_m, ends_m = places_m
        normals = self._hits.normals(rows["last_body"], from_m, last_m)
        seen = dots(normals, from_m - last_m) * dots(normals, ends_m - last_m) > 0
        blocked, through = self._obstacles.block(last_m, ends_m, rows["last_body"])
        return np.asarray(seen & ~blocked & ~through)


def with_image_columns(rows: PathRows) -> PathRows:
    """Return rows with the columns of images, 0 where they are new."""
    wide = np.zeros(rows.shape, dtype=IMAGE_DTYPE)
    for name in rows.dtype.names or ():
        wide[name] = rows[name]
    return wide
