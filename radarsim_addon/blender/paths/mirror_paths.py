# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths whose last reflections are those of planar mirrors: kept where the mirror is on the way.

A render with the transmitter in the place of its image gives all surfaces that see the image as if
nothing were in between. A path is one if the way from its last scatterer to the image meets the
mirror, and nothing else lies on the way to that point and on from there to the transmitter.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from ... import contract
from ...array_types import Indices, Mask, Real
from ...findings import finding
from ...signal.paths import IMAGE_DTYPE, PathFlag, PathRows
from ...vectors import are_finite, norms
from ..materials import MirrorMaterial
from ..motion import Bodies
from ..plan import Measurement, PathOptions
from ..state import Shape
from .mirrors import Mirror, find_mirrors
from .obstacles import BodyMesh, Obstacles

#: Height over a mirror, over the way to it, below which a point is on its plane.
_LEAST_HEIGHT = 1e-6


class MirrorPaths:
    """The images of the transmitter in one frame, and the paths over them.

    Parameters
    ----------
    bodies
        Of the frame; Blender must evaluate nothing else while rows are chosen.
    metres_per_unit
        Length of a Blender unit [m].
    transmitter_m
        Place of the transmitter, (3,) [m].
    measurement, options
        Of the run.
    meshes
        Meshes that were read; more are added.
    """

    def __init__(
        self,
        bodies: Bodies,
        metres_per_unit: float,
        transmitter_m: Real,
        measurement: Measurement,
        options: PathOptions,
        meshes: WeakKeyDictionary[Shape, BodyMesh | None],
    ) -> None:
        self._obstacles = Obstacles(bodies, metres_per_unit, meshes)
        self._transmitter_m, self._polarisation = transmitter_m, measurement.polarisation
        self._reflections = options.max_reflections
        most = options.mirror_images if self._reflections > 1 else 0
        self.mirrors, self.findings = find_mirrors(
            self._obstacles, transmitter_m, measurement.waveform.wavelength_m, most
        )
        if self._reflections == 1:
            names = [name for item in self.findings for name in item.subjects]
            self.findings = [finding("mirrors-need-reflections", *names)] if names else []
        elif self._reflections == 2 and self.mirrors:
            names = [name for mirror in self.mirrors for name in mirror.objects]
            self.findings.append(finding("mirror-both-ways-left-out", *dict.fromkeys(names)))
        places = [mirror.image_m(transmitter_m) for mirror in self.mirrors]
        #: Places of the images, (n, 3) [m].
        self.images_m: Real = np.array(places).reshape(-1, 3)

    @property
    def bodies(self) -> dict[int, str]:
        """Names of the objects of all mirrors by the numbers of their bodies."""
        bodies = self._obstacles.bodies
        numbers = {int(n) for mirror in self.mirrors for n in np.unique(mirror.body)}
        return {n: bodies.originals[int(bodies.number[n - 1])].name for n in sorted(numbers)}

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
        rows = with_image_columns(rows[free])
        self._reflect(mirror, rows, met_m[free], triangle[free])
        rows["transmitter_image"] = image
        rows["mirrors"] = 1
        rows["order"] += 1
        return rows, through_w

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
