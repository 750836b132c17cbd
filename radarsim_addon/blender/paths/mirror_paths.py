# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths whose last reflections are those of planar mirrors: kept where the mirror is on the way.

A render with the transmitter in the place of its image gives all surfaces that see the image as if
nothing were in between. A path is one if the way from its last scatterer to the image meets the
mirror, and nothing else lies on the way to that point and on from there to the transmitter.
"""

from __future__ import annotations

import math
from weakref import WeakKeyDictionary

import numpy as np

from ... import contract
from ...array_types import Indices, Mask, Real
from ...findings import Finding, finding
from ...signal.motion import PathImages
from ...signal.paths import IMAGE_DTYPE, PathFlag, PathRows
from ...vectors import are_finite, crosses, dots, norms
from ..materials import MirrorMaterial, lobe_width
from ..motion import Bodies
from ..plan import Measurement, PathOptions
from ..state import Shape
from ..views import TracedReplicate, pixel_numbers
from .hit_points import HitPoints
from .mirrors import Mirror, find_mirrors
from .obstacles import BodyMesh, Obstacles
from .same_point import ONE_PLACE, add_reverse_paths, alike_in_both, in_view

#: Distance of a vertex from the mirror that it is on, over the length of its path: float32.
_ON_MIRROR = 1e-5
#: How far a mirrored ray passes its next vertex, over the length of the path: float32.
_MIRRORED = 1e-4
#: Height over a mirror, over the way to it, below which a point is on its plane.
_LEAST_HEIGHT = 1e-6


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
        widths = [
            min((lobe_width(one) for one in shape.materials), default=math.inf)
            for shape in bodies.snapshot.shapes
        ]
        #: Width of the narrowest lobe by the body's number, from 1.
        self._lobes = np.append(0.0, np.array(widths)[bodies.shape])
        self._reflections = options.max_reflections
        most = options.mirror_images if self._reflections > 1 else 0
        self.mirrors, self._findings = find_mirrors(
            self._obstacles, transmitter_m, measurement.waveform.wavelength_m, most
        )
        if self._reflections == 1:
            names = [name for item in self._findings for name in item.subjects]
            self._findings = [finding("mirrors-need-reflections", *names)] if names else []
        elif self._reflections == 2 and self.mirrors:
            names = [name for mirror in self.mirrors for name in mirror.objects]
            self._findings.append(finding("mirror-both-ways-left-out", *dict.fromkeys(names)))
        apart_m = float(np.linalg.norm(self._receiver_m - transmitter_m))
        #: Whether a path and its reverse are alike.
        self._one_place = apart_m <= ONE_PLACE * reach_m and receiver.kind != "orthographic"
        if self.mirrors and not self._one_place:
            self._findings.append(finding("mirror-ways-not-in-phase", distance_m=apart_m))
        #: Bodies that scatter otherwise towards an image.
        self._narrow: set[int] = set()
        places = [mirror.image_m(transmitter_m) for mirror in self.mirrors]
        #: Places of the images, (n, 3) [m].
        self.images_m: Real = np.array(places).reshape(-1, 3)

    @property
    def findings(self) -> list[Finding]:
        """What to know of the mirrors, after all rows."""
        names = [self._name(body) for body in sorted(self._narrow)]
        if not (names and self._one_place):
            return self._findings
        return [*self._findings, finding("mirror-lobe-narrow", *dict.fromkeys(names))]

    def _name(self, body: int) -> str:
        """Name of the object of a body, from 1."""
        bodies = self._obstacles.bodies
        return str(bodies.originals[int(bodies.number[body - 1])].name)

    @property
    def bodies(self) -> dict[int, str]:
        """Names of the objects of all mirrors by the numbers of their bodies."""
        numbers = {int(n) for mirror in self.mirrors for n in np.unique(mirror.body)}
        return {number: self._name(number) for number in sorted(numbers)}

    @property
    def records(self) -> list[contract.ImageRecord]:
        """The images, in the order of their numbers from 1."""
        return [mirror.record for mirror in self.mirrors]

    def choose(self, image: int, rows: PathRows) -> tuple[PathRows, float]:
        """Return the paths among rows that were measured with an image, from 1, with the mirror in
        their order, power and phase; and the power of those left out because open objects lie on
        the way [W].
        """
        mirror = self.mirrors[image - 1]
        rows = rows[are_finite(rows["last_scatterer_m"]) & (rows["flags"] & PathFlag.NO_RANGE == 0)]
        last_m = rows["last_scatterer_m"]
        way_m = self.images_m[image - 1] - last_m
        over_m, under_m = mirror.heights_m(last_m), mirror.heights_m(self._transmitter_m[None])
        above = np.flatnonzero(over_m > _LEAST_HEIGHT * norms(way_m))
        share = over_m[above] / (over_m[above] + under_m)
        met_m = last_m[above] + share[:, None] * way_m[above]
        triangle = mirror.triangle_at(met_m)
        there = np.flatnonzero(triangle >= 0)
        rows, met_m, triangle = rows[above[there]], met_m[there], triangle[there]
        blocked, through = self._blocked(rows, met_m, mirror.body[triangle])
        through_w = float(rows["power_w"][through].sum())
        free = ~(blocked | through)
        rows = rows[free]
        self._reflect(mirror, rows, met_m[free], triangle[free])
        rows["transmitter_image"] = image
        rows["mirrors"] = 1
        rows["order"] += 1
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
            once &= alike
        wide["point"] = np.where(once, pixel_numbers(traced), 0)
        return wide

    def with_both_ways(self, rows: PathRows) -> PathRows:
        """Return rows of a tile replicate with those that come back over mirrors, as
        `same_point` has them.
        """
        if not self._one_place:
            return rows
        rows = rows[~self._seen_directly(rows)]
        images = PathImages.of(self.records, np.zeros((0, 2), dtype=np.int32))
        return add_reverse_paths(
            rows, images, self._receiver_m, self._transmitter_m, self._reflections
        )

    def _alike(self, rows: PathRows, image: int) -> Mask:
        """Whether surfaces scatter nearly alike towards the transmitter and its image, (n,)."""
        lobe = self._lobes[rows["last_body"]]
        image_m = self.images_m[image - 1]
        return alike_in_both(rows["last_scatterer_m"], self._transmitter_m, image_m, lobe)

    def _seen_directly(self, rows: PathRows) -> Mask:
        """Rows whose first vertex is on a mirror, and whose second one another pixel sees."""
        gone = np.zeros(rows.size, dtype=bool)
        two = rows["order"] - rows["mirrors"] == 2
        two &= (rows["transparent_depth"] == 0) & (rows["last_body"] > 0)
        two &= are_finite(rows["first_scatterer_m"]) & are_finite(rows["last_scatterer_m"])
        for image, mirror in enumerate(self.mirrors, start=1):
            mine = np.flatnonzero(two & np.isin(rows["first_body"], np.unique(mirror.body)))
            first_m = rows["first_scatterer_m"][mine]
            close = np.abs(mirror.heights_m(first_m)) <= _ON_MIRROR * rows["length_m"][mine]
            # The rest of the power of a mirror may be diffuse.
            onward_m = rows["last_scatterer_m"][mine] - first_m
            turned = onward_m - 2 * dots(onward_m, mirror.normal)[:, None] * mirror.normal
            off_m = norms(crosses(turned, rows["direction"][mine]))
            close &= off_m <= _MIRRORED * rows["length_m"][mine]
            mine, first_m = mine[close], first_m[close]
            mine = mine[mirror.triangle_at(first_m) >= 0]
            mine = mine[self._alike(rows[mine], image)]
            mine = mine[in_view(rows["last_scatterer_m"][mine], self._receiver)]
            gone[mine[self._visible(rows[mine])]] = True
        return gone

    def _visible(self, rows: PathRows) -> Mask:
        """Whether the receiver sees last vertices from the side from which first vertices do."""
        last_m = rows["last_scatterer_m"]
        normals = self._hits.normals(rows["last_body"], rows["first_scatterer_m"], last_m)
        sides = [
            dots(normals, place_m - last_m)
            for place_m in (rows["first_scatterer_m"], self._receiver_m)
        ]
        seen = sides[0] * sides[1] > 0
        ends_m = np.broadcast_to(self._receiver_m, last_m.shape)
        blocked, through = self._obstacles.block(last_m, ends_m, rows["last_body"])
        return np.asarray(seen & ~blocked & ~through)

    def _blocked(self, rows: PathRows, met_m: Real, mirror_body: Indices) -> tuple[Mask, Mask]:
        """Whether something opaque, or only something open, lies on the ways of each row."""
        blocked, through = self._obstacles.block(rows["last_scatterer_m"], met_m, rows["last_body"])
        left = np.flatnonzero(~blocked)
        ends_m = np.broadcast_to(self._transmitter_m, met_m[left].shape)
        blocked[left], on_through = self._obstacles.block(met_m[left], ends_m, mirror_body[left])
        through[left] |= on_through
        return blocked, through & ~blocked

    def _reflect(self, mirror: Mirror, rows: PathRows, met_m: Real, triangle: Indices) -> None:
        """Put the reflection coefficients of the mirror into powers and phases."""
        to_mirror = met_m - self._transmitter_m
        to_mirror /= norms(to_mirror)[:, None]
        groups: dict[MirrorMaterial, list[int]] = {}
        for number, material in enumerate(mirror.material):
            groups.setdefault(material, []).append(number)
        for material, numbers in groups.items():
            mine = np.flatnonzero(np.isin(triangle, numbers))
            power, phase_rad = material.reflection(
                to_mirror[mine], mirror.normal, self._polarisation
            )
            rows["power_w"][mine] *= power
            rows["mirror_phase_rad"][mine] = -phase_rad  # echoes carry exp(+j w t)


def with_image_columns(rows: PathRows) -> PathRows:
    """Return rows with the columns of images, 0 where they are new."""
    wide = np.zeros(rows.shape, dtype=IMAGE_DTYPE)
    for name in rows.dtype.names or ():
        wide[name] = rows[name]
    return wide
