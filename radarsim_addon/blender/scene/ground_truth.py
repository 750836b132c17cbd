# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of a scene that need no render: extent and ground truth of objects."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

import bpy
import numpy as np

from ... import contract
from ...array_types import Real
from ...findings import Finding, finding
from ...vectors import distances
from ..materials import (
    clutter_name,
    fluctuation_of,
    roughness_of,
)
from ..nodes import is_radar_material
from ..plan import Extent
from ..state import Shape, Snapshot, take_snapshot
from .boxes import Boxes, extent_of_boxes
from .finite_checks import check_meshes_finite
from .isolation import ABSORBER_NAME, echoes
from .nearest import nearest_distances
from .rig import Rig
from .surface_triangles import triangles_about
from .visibility import rendered_rows


def check_surfaces(depsgraph: Any) -> None:
    """Check that all rendered surfaces are finite at the depsgraph's time; `SceneError` if not."""
    snapshot = take_snapshot(depsgraph)
    check_meshes_finite(snapshot, rendered_rows(snapshot))


def scene_extent(
    depsgraph: Any, rig: Rig, metres_per_unit: float, any_material: bool = False
) -> Extent:
    """Return the distances of the surfaces that can echo, at the depsgraph's time.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.
    rig
        Antennas.
    metres_per_unit
        Metres per Blender unit.
    any_material
        Include surfaces without a Radar Material.

    Returns
    -------
    Extent
        Distances of bounding boxes, so never too small [m]. Only the baseline if nothing can echo.
    """
    boxes = echoing_boxes(depsgraph, any_material)
    return extent_of_boxes(boxes, antenna_positions(depsgraph, rig), metres_per_unit)


def echoing_boxes(depsgraph: Any, any_material: bool) -> Boxes:
    """Return the bounding boxes of the surfaces that can echo, at the depsgraph's time.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.
    any_material
        Include surfaces without a Radar Material.

    Returns
    -------
    Boxes
        Rows of the snapshot, and corners in Blender units.
    """
    snapshot = take_snapshot(depsgraph)
    rows = rendered_rows(snapshot)
    if not any_material:
        is_radar = cache(is_radar_material)
        echoing = [_echoes(shape, is_radar) for shape in snapshot.shapes]
        rows = rows[snapshot.of_shapes(echoing)[rows]]
    return Boxes(snapshot, rows)


def _echoes(shape: Shape, is_radar: Callable[[Any], bool]) -> bool:
    """As `echoes` of a surface; its evaluated slots, known already, hold what its own ones do."""
    return (shape.own and any(map(is_radar, shape.materials))) or echoes(shape.original, is_radar)


def antenna_positions(depsgraph: Any, rig: Rig) -> tuple[Real, Real]:
    """Return the places of receiver and transmitter, (3,) each [Blender units]."""
    return _origin(rig.camera, depsgraph), _origin(rig.emitter, depsgraph)


def _origin(item: Any, depsgraph: Any) -> Real:
    return np.array(item.evaluated_get(depsgraph).matrix_world, dtype=np.float64)[:3, 3]


# -- ground truth ----------------------------------------------------------------------------------


def rendered_surfaces(depsgraph: Any) -> Boxes:
    """Return all rendered surfaces at the depsgraph's time."""
    return echoing_boxes(depsgraph, any_material=True)


def object_records(
    depsgraph: Any,
    rig: Rig,
    metres_per_unit: float,
    later: tuple[Boxes, Real] | None = None,
    interval_s: float = 0.0,
) -> list[contract.ObjectRecord]:
    """Return the ground truth of all rendered objects at the depsgraph's time, sorted by name.

    All instances of one object by one instancer have one record, that of the nearest instance, with
    the name ``instancer/object``. `later` has the surfaces `interval_s` later [s], and the place of
    the receiver, for range rates.
    """
    found, receiver = rendered_surfaces(depsgraph), _origin(rig.camera, depsgraph)
    snapshot = found.snapshot
    collections = _collections_of_objects()
    after: dict[int, int] = {}
    if later is not None:
        here, there = found.pairs(later[0])
        after = dict(zip(here.tolist(), there.tolist(), strict=True))
    nearest = _nearest_instances(found, receiver)
    rows = [row for row, _ in nearest]
    rates: dict[int, float] = {}
    centres_m = (_centre_ranges(snapshot, rows, receiver) * metres_per_unit).tolist()
    if later is not None and interval_s > 0:
        known = [row for row in rows if row in after]
        then = _centre_ranges(later[0].snapshot, [after[row] for row in known], later[1])
        before_m = dict(zip(rows, centres_m, strict=True))
        rates = {
            row: (then_m - before_m[row]) / interval_s
            for row, then_m in zip(known, (then * metres_per_unit).tolist(), strict=True)
        }
    records = []
    said_by = cache(_said_by_materials)
    for (row, distance), centre_m in zip(nearest, centres_m, strict=True):
        shape = snapshot.shapes[snapshot.layout.shape[row]]
        held_by, said = collections.get(shape.original.name_full, []), said_by(shape.materials)
        nearest_m = None if any(map(_displaces, shape.materials)) else distance * metres_per_unit
        label, rate_mps = snapshot.label(row), rates.get(row)
        records.append(_object_record(label, held_by, nearest_m, centre_m, rate_mps, said))
    return sorted(records, key=lambda record: record.name)


def _nearest_instances(found: Boxes, receiver: Real) -> list[tuple[int, float]]:
    """Row and distance of the nearest instance of each label, if it has faces."""
    snapshot = found.snapshot
    # No point of a box is nearer than this, so most instances need no exact distance.
    centre, radius = found.spheres(receiver)
    least = np.linalg.norm(centre - receiver, axis=1) - radius
    order = np.argsort(least, kind="stable")
    label = found.labels()[1][order]
    order = order[np.argsort(label, kind="stable")]
    groups = np.split(order, np.flatnonzero(np.diff(np.sort(label))) + 1) if order.size else []
    firsts = (int(found.rows[instances[0]]) for instances in groups)
    exact = nearest_distances(triangles_about(snapshot, firsts, receiver))
    nearest = []
    for instances, distance in zip(groups, exact.tolist(), strict=True):
        best = (distance, int(found.rows[instances[0]]))
        for index in instances[1:]:
            if least[index] > best[0]:
                break
            row = int(found.rows[index])
            (other,) = nearest_distances(triangles_about(snapshot, [row], receiver)).tolist()
            best = min(best, (other, row))
        if math.isfinite(best[0]):
            nearest.append((best[1], best[0]))
    return nearest


class _Said(NamedTuple):
    """What the materials of an object say of it."""

    names: list[str]
    rms_height_m: float | None
    correlation_length_m: float | None
    fluctuation: contract.FluctuationRecord | None
    clutter: str | None


def _said_by_materials(materials: tuple[Any, ...]) -> _Said:
    held = [one.name for one in materials if one is not None and one.name != ABSORBER_NAME]
    roughness = roughness_of(materials)
    return _Said(held, *roughness, fluctuation_of(materials), clutter_name(materials))


def _object_record(
    label: str,
    collections: list[str],
    nearest_m: float | None,
    centre_m: float,
    rate_mps: float | None,
    said: _Said,
) -> contract.ObjectRecord:
    return contract.ObjectRecord(
        name=label,
        nearest_range_m=nearest_m,
        centre_range_m=centre_m,
        range_rate_mps=rate_mps,
        materials=said.names,
        collections=collections,
        rms_height_m=said.rms_height_m,
        correlation_length_m=said.correlation_length_m,
        fluctuation=said.fluctuation,
        clutter=said.clutter,
    )


def _centre_ranges(snapshot: Snapshot, rows: Sequence[int], receiver: Real) -> Real:
    """Return the distances of the centres of boxes from the receiver, (n,) [Blender units]."""
    corners = snapshot.corners_of(np.array(rows, dtype=np.intp)).reshape(-1, 8, 3)
    return distances(corners.mean(axis=1), receiver)


def displaced_surfaces(depsgraph: Any) -> list[Finding]:
    """Name the rendered objects whose surface Cycles displaces: their meshes do not show it.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.

    Returns
    -------
    list of Finding
        At most one.
    """
    found = rendered_surfaces(depsgraph)
    shapes = found.snapshot.shapes
    displaced = found.snapshot.of_shapes([any(map(_displaces, one.materials)) for one in shapes])
    names = {found.snapshot.label(row) for row in found.rows[displaced[found.rows]].tolist()}
    return [finding("displaced-by-shader", *sorted(names))] if names else []


def _displaces(material: Any) -> bool:
    """Return whether a material moves the surface itself, not only its normals."""
    if material is None or material.node_tree is None or material.displacement_method == "BUMP":
        return False
    output = material.node_tree.get_output_node("CYCLES")
    return output is not None and bool(output.inputs["Displacement"].is_linked)


def _collections_of_objects() -> dict[str, list[str]]:
    """Return the names of the collections that hold each object, also indirectly, sorted.

    One pass over the file's collections: an object's own list of its users takes a walk each.
    """
    holding: dict[str, set[str]] = {}
    for collection in bpy.data.collections:
        for item in collection.all_objects:
            holding.setdefault(item.name_full, set()).add(collection.name)
    return {name: sorted(held) for name, held in holding.items()}
