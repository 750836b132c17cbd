# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene that a radar measures, without Blender: what its surfaces are, and what rays meet.

`surface` says what a material is at the carrier, as numbers that are read once, and what follows
from them: whether it mirrors, how wide its lobes are, what passes it. `mesh` has the polygons of an
object, and `rays` casts rays on them, one mesh by one or as bodies of a scene that share meshes, in
any one unit of length. `model` joins them: which bodies there are, where, and of what. `walls`
finds which faces of a mesh are walls, and how thick these are.
"""

from .mesh import Mesh
from .model import Meshes, SceneModel
from .rays import RayMesh, RayScene, along_curve, barycentric, triangle_distances
from .surface import (
    SHARP,
    SMOOTH_BELOW,
    Angles,
    Clutter,
    Kind,
    RoughSurface,
    ScatteredLobe,
    Shader,
    Surface,
    is_conductor,
)
from .walls import (
    ALL_FACES,
    LAYER_SHARE,
    MIN_PLATE_FRACTION,
    MOST_TRIANGLES,
    ConvexBodies,
    Depths,
    LayerFaces,
    WallFaces,
    convex_bodies,
    depths_behind,
    find_walls,
)

__all__ = [
    "ALL_FACES",
    "LAYER_SHARE",
    "MIN_PLATE_FRACTION",
    "MOST_TRIANGLES",
    "SHARP",
    "SMOOTH_BELOW",
    "Angles",
    "Clutter",
    "ConvexBodies",
    "Depths",
    "Kind",
    "LayerFaces",
    "Mesh",
    "Meshes",
    "RayMesh",
    "RayScene",
    "RoughSurface",
    "ScatteredLobe",
    "SceneModel",
    "Shader",
    "Surface",
    "WallFaces",
    "along_curve",
    "barycentric",
    "convex_bodies",
    "depths_behind",
    "find_walls",
    "is_conductor",
    "triangle_distances",
]
