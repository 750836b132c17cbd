# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene as geometry: what straight rays meet.

`rays` casts rays on triangle meshes, one by one or as bodies of a scene that share meshes. Places
and directions are in any one unit of length.
"""

from .rays import RayMesh, RayScene, barycentric, triangle_distances

__all__ = ["RayMesh", "RayScene", "barycentric", "triangle_distances"]
