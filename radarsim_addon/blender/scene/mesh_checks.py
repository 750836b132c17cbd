# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that make Cycles lose count of which objects a ray is in, found before rendering.

Cycles keeps a stack of the volumes that a ray has entered. It goes wrong without a word where an
object with an interior is open or has faces turned around, where faces of two objects coincide
exactly (touching cubes, a box that stands on a plane), and where more than 31 are nested.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...array_types import Real
from ..nodes.group_search import group_node
from ..state import evaluated_objects, read_numbers

Whole = NDArray[Any]

#: Most volumes that Cycles keeps track of along a ray.
MOST_NESTED = 31
#: Faces nearer than this share of the scene's size coincide; a gap of ten times as much is none.
_COINCIDENT = 2e-7
#: Names in one message.
_NAMES_SHOWN = 5
#: Faces of one object in one plane that are compared one by one with those of another.
_MOST_FACES = 4000
#: Objects with an interior whose nesting is looked at.
_MOST_BOXES = 4000


@dataclass(frozen=True)
class Faces:
    """Faces of one object or instance in world space.

    name, entered: whose they are, and whether it has an interior. normal (n, 3), offset (n,): the
    face's plane n.x = offset. low, high (n, 3): box of each face. defect: what is wrong with the
    mesh itself, or nothing.
    """

    name: str
    entered: bool
    normal: Real
    offset: Real
    low: Real
    high: Real
    defect: str = ""


def check_meshes(depsgraph: Any) -> list[str]:
    """Warnings about the meshes of a scene, by name of object; empty where none is found.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.
    """
    found: list[Faces] = []
    for one in evaluated_objects(depsgraph):
        item = one.evaluated
        if item.type != "MESH" or item.hide_render:
            continue
        name = item.name if one.instancer is None else f"{item.name} (instance)"
        faces = _faces(item.data, one.matrix, name, has_interior(item))
        if faces is not None:
            found.append(faces)
    if not any(item.entered for item in found):
        return []
    return [*_defects(found), *coincident_faces(found), *nested_too_deep(found)]


def has_interior(item: Any) -> bool:
    """Whether an object's material has a volume that Cycles keeps on its stack."""
    for slot in item.material_slots:
        if slot.material is None or slot.material.node_tree is None:
            continue
        if group_node(slot.material) is None:
            continue
        output = slot.material.node_tree.get_output_node("CYCLES")
        if output is not None and output.inputs["Volume"].is_linked:
            return True
    return False


def _faces(mesh: Any, matrix: Real, name: str, entered: bool) -> Faces | None:
    count, corners = len(mesh.polygons), len(mesh.loops)
    if not count:
        return None
    points = read_numbers(mesh.vertices, "co", 3)
    start = read_numbers(mesh.polygons, "loop_start", dtype=np.int32).ravel()
    corner = read_numbers(mesh.loops, "vertex_index", dtype=np.int32).ravel()
    local = read_numbers(mesh.polygons, "normal", 3)
    linear = matrix[:3, :3]
    world = points.astype(np.float64) @ linear.T + matrix[:3, 3]
    determinant = float(np.linalg.det(linear))
    if determinant == 0:
        return None
    normal = local.astype(np.float64) @ np.linalg.inv(linear)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    at_corner = world[corner]
    low = np.minimum.reduceat(at_corner, start, axis=0)
    high = np.maximum.reduceat(at_corner, start, axis=0)
    offset = np.einsum("ij,ij->i", normal, at_corner[start])
    defect = ""
    if entered:
        following = corner.copy()
        following[:-1] = corner[1:]
        following[np.append(start[1:], corners) - 1] = corner[start]
        flat = float((np.abs(normal @ normal[0]) < 1 - 1e-6).sum()) == 0
        defect = mesh_defect(corner, following, flat)
        if not defect and not flat:
            defect = _inside_out(at_corner, start, normal, determinant < 0)
    return Faces(name, entered, normal, offset, low, high, defect)


def mesh_defect(corner: NDArray[np.int32], following: NDArray[np.int32], flat: bool) -> str:
    """What keeps a mesh from enclosing a volume: "open", "flipped" or nothing.

    Parameters
    ----------
    corner, following
        Vertices at the two ends of every face's every edge, in the face's direction.
    flat
        The mesh lies in one plane: a half-space, which need not be closed.
    """
    size = int(max(corner.max(), following.max())) + 1
    directed = corner.astype(np.int64) * size + following
    opposite = following.astype(np.int64) * size + corner
    directed.sort()
    opposite.sort()
    if np.any(directed[1:] == directed[:-1]):
        return "flipped"
    if flat:
        return ""
    # Closed and consistent: every edge is passed once in each direction.
    return "" if np.array_equal(directed, opposite) else "open"


def _inside_out(at_corner: Real, start: Whole, normal: Real, mirrored: bool) -> str:
    """ "inside out" where the normals of a closed mesh point inwards: its volume is negative."""
    centre = at_corner.mean(axis=0)
    end = np.append(start[1:], len(at_corner))
    volume = 0.0
    # Fan of triangles around each face's first corner, all faces of a size at once.
    for sides in np.unique(end - start):
        first = start[end - start == sides]
        origin = at_corner[first] - centre
        for step in range(1, int(sides) - 1):
            second, third = at_corner[first + step] - centre, at_corner[first + step + 1] - centre
            volume += float(np.einsum("ij,ij->", origin, np.cross(second, third)))
    return "inside out" if (volume < 0) != mirrored else ""


def _defects(found: list[Faces]) -> list[str]:
    texts = {
        "open": (
            "open (a face is missing, or vertices are double): depths inside will be wrong. "
            "Close the mesh (Mesh > Merge by Distance, Fill), or disconnect Volume"
        ),
        "flipped": (
            "of faces turned against each other: depths inside will be wrong. "
            "Mesh > Normals > Recalculate Outside"
        ),
        "inside out": (
            "inside out (normals point inwards): depths will be counted outside. "
            "Mesh > Normals > Recalculate Outside, or Flip"
        ),
    }
    warnings = []
    for defect, text in texts.items():
        names = list(dict.fromkeys(item.name for item in found if item.defect == defect))
        if names:
            warnings.append(f"Mesh with an interior {_listed(names)} is {text}.")
    return warnings


def coincident_faces(found: list[Faces]) -> list[str]:
    """Pairs of objects, one of them with an interior, that share a part of a plane exactly."""
    low = np.min([item.low.min(axis=0) for item in found], axis=0)
    high = np.max([item.high.max(axis=0) for item in found], axis=0)
    tolerance = _COINCIDENT * max(float(np.abs([low, high]).max()), 1e-30)
    normal = np.concatenate([item.normal for item in found])
    offset = np.concatenate([item.offset for item in found])
    owner = np.repeat(np.arange(len(found)), [len(item.offset) for item in found])
    sign = np.where(normal[np.arange(len(normal)), np.abs(normal).argmax(axis=1)] < 0, -1.0, 1.0)
    normal, offset = normal * sign[:, None], offset * sign
    entered = np.array([item.entered for item in found])
    pairs: set[tuple[int, int]] = set()
    # Two grids half a cell apart: values on either side of a border share a cell in one of them.
    for shift in (0.0, 0.5):
        key = np.column_stack(
            [np.round(normal * 1e4), np.floor(offset / (20 * tolerance) + shift)]
        ).astype(np.int64)
        order = np.lexsort(key.T)
        edges = np.flatnonzero(np.any(np.diff(key[order], axis=0) != 0, axis=1)) + 1
        begin, end = np.append(0, edges), np.append(edges, len(order))
        owners = owner[order]
        # A plane of one owner alone is none of two.
        least = np.minimum.reduceat(owners, begin)
        most = np.maximum.reduceat(owners, begin)
        for group in np.flatnonzero(least != most):
            members = order[begin[group] : end[group]]
            _pairs_in_plane(members, owner, offset, found, entered, tolerance, pairs)
    named = {
        tuple(sorted((found[a].name, found[b].name))): None for a, b in sorted(pairs) if a != b
    }
    if not named:
        return []
    shown = ", ".join(f"{a!r} and {b!r}" for a, b in list(named)[:_NAMES_SHOWN])
    more = f" and {len(named) - _NAMES_SHOWN} more pairs" if len(named) > _NAMES_SHOWN else ""
    return [
        (
            f"Faces of {shown}{more} coincide exactly: rays lose count of which object they "
            "are in, and depths or shadows will be wrong. Leave a gap or an overlap of "
            f"{50 * tolerance:.1g} Blender units or more."
        )
    ]


def _pairs_in_plane(
    members: Whole,
    owner: Whole,
    offset: Real,
    found: list[Faces],
    entered: NDArray[np.bool_],
    tolerance: float,
    pairs: set[tuple[int, int]],
) -> None:
    """Add pairs of owners whose faces in one plane overlap."""
    first = np.concatenate([[0], np.cumsum([len(item.offset) for item in found])])
    owners = np.unique(owner[members])
    for index, a in enumerate(owners):
        mine = members[owner[members] == a][:_MOST_FACES]
        for b in owners[index + 1 :]:
            if not (entered[a] or entered[b]) or (int(a), int(b)) in pairs:
                continue
            others = members[owner[members] == b][:_MOST_FACES]
            one, two = found[a], found[b]
            if len(mine) * len(others) > _MOST_FACES * 100:
                others = others[:: len(mine) * len(others) // (_MOST_FACES * 100) + 1]
            low = np.maximum(one.low[mine - first[a]][:, None], two.low[others - first[b]][None])
            high = np.minimum(one.high[mine - first[a]][:, None], two.high[others - first[b]][None])
            # Overlap along two directions at least: faces that merely touch at an edge do not.
            wide = (high - low > 100 * tolerance).sum(axis=-1) >= 2
            apart = np.any(high - low < -tolerance, axis=-1)
            near = np.abs(offset[mine][:, None] - offset[others][None]) <= tolerance
            if np.any(wide & ~apart & near):
                pairs.add((int(a), int(b)))


def nested_too_deep(found: list[Faces]) -> list[str]:
    """A warning where the boxes of more than 31 objects with an interior share a point."""
    boxes = [item for item in found if item.entered]
    if not MOST_NESTED < len(boxes) <= _MOST_BOXES:
        return []
    low = np.array([item.low.min(axis=0) for item in boxes])
    high = np.array([item.high.max(axis=0) for item in boxes])
    # The deepest common point is at a corner of lower sides; centres find nests of any kind.
    for points in (low, (low + high) / 2):
        inside = [int(np.all((low <= p) & (p <= high), axis=1).sum()) for p in points]
        if max(inside) > MOST_NESTED:
            name = boxes[int(np.argmax(inside))].name
            return [
                (
                    f"Around {name!r} up to {max(inside)} objects with an interior lie in one "
                    f"another; Cycles keeps track of {MOST_NESTED} and leaves out the rest. Join "
                    "some, or disconnect their Volume."
                )
            ]
    return []


def _listed(names: list[str]) -> str:
    shown = ", ".join(repr(name) for name in names[:_NAMES_SHOWN])
    more = len(names) - _NAMES_SHOWN
    return f"{shown} and {more} more" if more > 0 else shown
