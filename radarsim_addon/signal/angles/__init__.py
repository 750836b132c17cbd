# SPDX-License-Identifier: GPL-3.0-or-later
"""Angles: from the phases of an array's channels to directions of echoes.

In: values of the channels in a cell of a map, or their covariance, and the places of the elements.
Out: unit vectors in the receiver's axes (x right, y up, z back), azimuth and elevation in degrees.
"""

from .directions import (
    MAX_SOURCES,
    ArrayGeometry,
    DirectionFinder,
    Source,
    angles_deg,
    bartlett,
    capon,
    count_sources,
    covariance_of,
    esprit,
    music,
    unit_vectors,
)

__all__ = [
    "MAX_SOURCES",
    "ArrayGeometry",
    "DirectionFinder",
    "Source",
    "angles_deg",
    "bartlett",
    "capon",
    "count_sources",
    "covariance_of",
    "esprit",
    "music",
    "unit_vectors",
]
