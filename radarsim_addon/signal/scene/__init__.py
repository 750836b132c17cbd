# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene that a radar measures, without Blender: what its surfaces are, and what rays meet.

`surface` says what a material is at the carrier, as numbers that are read once, and what follows
from them: whether it mirrors, how wide its lobes are, what passes it. `rays` casts rays on triangle
meshes, one by one or as bodies of a scene that share meshes, in any one unit of length.
"""

from .rays import RayMesh, RayScene, barycentric, triangle_distances
from .surface import (
    SHARP,
    SMOOTH_BELOW,
    Clutter,
    Kind,
    RoughSurface,
    ScatteredLobe,
    Shader,
    Surface,
    is_conductor,
)

__all__ = [
    "SHARP",
    "SMOOTH_BELOW",
    "Clutter",
    "Kind",
    "RayMesh",
    "RayScene",
    "RoughSurface",
    "ScatteredLobe",
    "Shader",
    "Surface",
    "barycentric",
    "is_conductor",
    "triangle_distances",
]
