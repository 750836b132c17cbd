# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths over mirrors: from the surfaces of a scene, and rows of single scatterings, all families.

In: a `SceneModel`, both antennas, and rows of the path table as they are rendered. Out: the rows
with those over mirrors on the way from the transmitter, back to the receiver, or both, and findings
on what is left out. `mirrors` finds the surfaces that mirror, `obstacles` what lies on ways,
`array_sight` what the outermost elements of an array do not see.

A renderer finds the transmitter by a straight shadow ray, so it never sees a path whose last leg
goes over a mirror. A way over mirrors is one whose length is stationary (Fermat). `connections`
finds these ways between an antenna and any number of places, over

- a chain of planes: over the image of the antenna in the planes the way is straight, so it is known
  exactly; it must meet the faces of each plane (Allen and Berkley, J. Acoust. Soc. Am. 65, 1979);
- a curved mirror, a mesh that is shaded smooth: by Newton's method on the bisector of both legs,
  from guesses on every patch that may reflect (`specular_points`).

Both give the same columns (`Ways`). A way counts if nothing lies on its legs. The field goes from
mirror to mirror as a vector with Fresnel's coefficients (`physics.mirrors`), and its power per area
at the place falls by the squared length, or by the widths of the beam behind a curved mirror
(Deschamps, Proc. IEEE 60, 1972).

`mirror_paths` makes rows of ways. A render with the light at the image of the transmitter, which
nothing blocks, gives the powers over a chain of planes, with all that scatters before. Curved
mirrors have no image that all places share: there, and on the way back to a receiver that stands
apart, the power is that of the direct path times the ratio of irradiances or solid angles, which is
exact for a Lambert surface. With both antennas in one place a reverse path has the same power: with
d of the direct path and m_k over mirror k, a path over mirrors k and l has m_k m_l / d. All these
paths are of one point, so their phases are those of their lengths and mirrors, and they add up in
phase. The point that another pixel sees in a mirror is left out: it is the same path once more.

Limits: two planes in a row, or one curved mirror; no path over a focus; lobes of surfaces must be
wider than the angle between the ways (`alike_in_both`); edges do not diffract.
"""

from .array_sight import HiddenPower, hidden_power
from .connections import CurvedMirrors, ImageChain, Ways
from .mirror_paths import ONE_PLACE, MirrorPaths
from .mirrors import MirrorFaces, mirror_faces
from .obstacles import BodyMesh, Obstacles
from .specular_points import GRAZING, bisectors

__all__ = [
    "GRAZING",
    "ONE_PLACE",
    "BodyMesh",
    "CurvedMirrors",
    "HiddenPower",
    "ImageChain",
    "MirrorFaces",
    "MirrorPaths",
    "Obstacles",
    "Ways",
    "bisectors",
    "hidden_power",
    "mirror_faces",
]
