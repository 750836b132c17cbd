# SPDX-License-Identifier: GPL-3.0-or-later
"""Why a frame has no echo: an antenna inside a mesh, nothing in view, shaders that reflect nothing.

Called for such frames alone, because it looks at every triangle of what may surround an antenna.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...array_types import Real
from ...findings import Finding, finding
from ..materials import SURFACE_TYPES, assigned_materials
from ..state import EvaluatedObject, evaluated_mesh, evaluated_objects, read_triangles
from .ground_truth import antenna_positions
from .rig import Rig

#: Directions that no modelled face is parallel to; a point inside has an odd number of faces in
#: each of them, forwards and backwards.
_DIRECTIONS = np.array([[0.71, 0.23, 0.66], [-0.37, 0.83, 0.42], [0.19, -0.58, -0.79]])


def no_echo_findings(depsgraph: Any, rig: Rig, seen: Sequence[str]) -> list[Finding]:
    """Find why no echo was received.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        At the frame's time.
    rig
        Antennas.
    seen
        Names of the objects that rays of the receiver met.

    Returns
    -------
    list of Finding
        At least one, each an error.
    """
    surrounding = _surrounding(depsgraph, rig)
    if surrounding:
        return [finding("antenna-inside-mesh", *surrounding)]
    assigned = {one.item.name_full: one.materials for one in assigned_materials(depsgraph)}
    if not seen:
        return [finding("nothing-in-view", *sorted(assigned)) if assigned else finding("no-echo")]
    reflects = cache(_reflects)  # the links of a socket take a walk over all links of its tree
    dark = [n for n in seen if n in assigned and not any(map(reflects, assigned[n] or (None,)))]
    found = [finding("shaders-reflect-nothing", *dark)] if dark else []
    others = [name for name in seen if name not in dark]
    return found + ([finding("surfaces-return-nothing", *others)] if others else [])


def _surrounding(depsgraph: Any, rig: Rig) -> list[str]:
    """Return the closed meshes that contain one of the antennas, but not the other."""
    antennas = np.stack(antenna_positions(depsgraph, rig))
    found = []
    for one in evaluated_objects(depsgraph):
        shown = one.visible and not one.original.hide_render
        if shown and one.original.type in SURFACE_TYPES and one.original != rig.emitter:
            inside = [_contains(one, point) for point in antennas]
            if inside[0] != inside[1]:
                found.append(one.label)
    return found


def _contains(one: EvaluatedObject, point: Real) -> bool:
    corners = one.box @ one.matrix[:3, :3].T + one.matrix[:3, 3]
    if (point < corners.min(axis=0)).any() or (point > corners.max(axis=0)).any():
        return False
    with evaluated_mesh(one.evaluated) as mesh:
        if mesh is None:
            return False
        vertices, triangles = read_triangles(mesh)
    world = vertices.astype(np.float64) @ one.matrix[:3, :3].T + one.matrix[:3, 3]
    return surrounds(world, triangles, point)


def surrounds(vertices: Real, triangles: NDArray[np.int32], point: Real) -> bool:
    """Return whether triangles (m, 3) of vertices (n, 3) close around a point (3,)."""
    a, b, c = (vertices[triangles[:, k]] - point for k in range(3))
    along, across = b - a, c - a
    for direction in _DIRECTIONS:
        # Moeller and Trumbore, Journal of Graphics Tools 2, 21, 1997
        p = np.cross(direction, across)
        q = np.cross(-a, along)
        scale = (along * p).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = (-a * p).sum(axis=1) / scale
            v = (q @ direction) / scale
            t = (across * q).sum(axis=1) / scale
        hit = (u >= 0) & (v >= 0) & (u + v < 1)
        if any(np.count_nonzero(hit & side) % 2 == 0 for side in (t > 0, t < 0)):
            return False
    return True


def _reflects(material: Any) -> bool:
    """Return whether a material, or Blender's own where there is none, has a reflecting shader."""
    tree = None if material is None else material.node_tree
    if tree is None:
        return True
    output = tree.get_output_node("CYCLES")
    waiting = [] if output is None else [link.from_node for link in output.inputs["Surface"].links]
    met = set()
    while waiting:
        node = waiting.pop()
        if node in met:
            continue
        met.add(node)
        kind = node.bl_idname
        if kind == "ShaderNodeSubsurfaceScattering" or (
            kind.startswith("ShaderNodeBsdf") and kind != "ShaderNodeBsdfTransparent"
        ):
            return True
        inner = getattr(node, "node_tree", None)
        waiting += [] if inner is None else list(inner.nodes)
        waiting += [link.from_node for socket in node.inputs for link in socket.links]
    return False
