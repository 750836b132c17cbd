# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels that a ring can fill: nothing else of its render is worth its time.

With one reflection a pixel shows a ring only where its ray meets a surface there, however many
surfaces it passes before. So it suffices to know which parts of the view surfaces at these ranges
cover. All other pixels are exactly 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ... import contract
from ...array_types import Real
from ..plan import Plan
from ..scene import ground_truth
from ..state import Snapshot, read_triangles
from ..views import Region, ViewWindow
from .shells import Shells, axes_of

#: Types of objects without faces, which Cycles renders as hair and spheres.
_OF_POINTS = {"CURVES", "POINTCLOUD"}


def regions_by_ring(
    depsgraph: Any,
    plan: Plan,
    receiver: contract.ReceiverRecord,
    transmitter: contract.TransmitterRecord,
) -> list[Region] | None:
    """Return the pixels that each ring can fill at the depsgraph's time; None: perhaps all.

    They are known where paths have one reflection and Cycles renders the faces that Blender
    evaluates.
    """
    asked = plan.measurement
    if asked.max_reflections > 1 or receiver.kind != "perspective":
        return None
    found = ground_truth.rendered_surfaces(depsgraph)
    snapshot, units = found.snapshot, plan.metres_per_unit
    shapes = [snapshot.shapes[i] for i in np.unique(snapshot.layout.shape[found.rows])]
    if any(shape.kind in _OF_POINTS or not _as_evaluated(shape) for shape in shapes):
        return None
    place, axes = axes_of(receiver)
    corners = found.corners * units
    size_px = asked.width_px, asked.height_px
    view = ViewWindow(receiver.left, receiver.right, receiver.bottom, receiver.top, *size_px)
    source = (np.array(transmitter.matrix_world, dtype=np.float64)[:3, 3] - place) @ axes
    edges = [ring * asked.ring_step_m for ring in range(plan.rings + 1)]
    reach = max(float(np.abs(part).max(initial=0.0)) for part in (corners, place, corners - place))
    shells = Shells(view, source, edges, reach)
    large = found.rows[shells.take((corners - place) @ axes)]
    for shape in np.unique(snapshot.layout.shape[large]):
        triangles = _triangles(snapshot, int(shape))
        if triangles is None:
            return None
        for row in large[snapshot.layout.shape[large] == shape]:
            matrix = snapshot.matrix(row)
            world = (triangles @ matrix[:3, :3].T + matrix[:3, 3]) * units
            if not shells.take_triangles((world - place) @ axes):
                return None
    return shells.regions()


def _triangles(snapshot: Snapshot, shape: int) -> Real | None:
    """Triangles of a shape, own axes, (m, 3, 3) [Blender units]; None where it has no mesh."""
    with snapshot.mesh(snapshot.shapes[shape]) as mesh:
        if mesh is None:
            return None
        vertices, triangles = read_triangles(mesh)
        return vertices.astype(np.float64)[triangles]


def _as_evaluated(shape: Any) -> bool:
    """Whether Cycles renders the faces that Blender evaluates, and rays pass them straight."""
    item = shape.original
    return (
        not len(item.particle_systems)
        and not any(modifier.type == "SUBSURF" for modifier in item.modifiers)
        and not any(map(_moves_faces, shape.materials))
    )


def _moves_faces(material: Any) -> bool:
    """Whether a material displaces faces, or sends rays elsewhere."""
    tree = material and material.node_tree
    return bool(tree) and (
        any(link.to_socket.name == "Displacement" for link in tree.links)
        or any(node.bl_idname == "ShaderNodeBsdfRayPortal" for node in tree.nodes)
    )
