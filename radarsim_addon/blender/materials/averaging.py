# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that let waves through in the mean of both polarisations, and what it costs to take the
mean at each of them and not at the end of the way."""

from __future__ import annotations

import math
from collections.abc import Collection
from functools import cache
from typing import Any

from ...findings import Finding, finding
from ...physics.slab import slab_power
from ..nodes import attributes
from ..nodes.group_search import group_input
from ..nodes.physical_material import EXTINCTION, INDEX
from ..state import take_snapshot
from .assignments import assigned_materials
from .layers import passes_by_polarisation


def averaging_objects(depsgraph: Any) -> dict[str, complex]:
    """Return the objects that take the mean of both polarisations, with their largest index.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date, materials at the carrier.

    Returns
    -------
    dict of str to complex
        By object's name.
    """
    found = {}
    averages, index = cache(passes_by_polarisation), cache(_index)  # many objects share materials
    for item, materials in assigned_materials(depsgraph):
        indices = [index(material) for material in materials if averages(material)]
        if indices:
            found[item.name_full] = max(indices, key=abs)
    return found


def average_in_a_row(depsgraph: Any, objects: Collection[str]) -> bool:
    """Return whether waves may pass several walls of these objects one after the other.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date; layer normals are set.
    objects
        Names, from `averaging_objects`.

    Returns
    -------
    bool
        Also for one object that consists of several walls, or has several instances.
    """
    snapshot = take_snapshot(depsgraph)
    shapes = [shape.original for shape in snapshot.shapes]
    ours = snapshot.of_shapes([item.name_full in objects for item in shapes])
    several = (
        attributes.OBJECT_SHELL_THICKNESS in item
        or (
            attributes.OBJECT_LAYER_NORMAL in item and attributes.OBJECT_LAYER_THICKNESS not in item
        )
        for item in shapes
        if item.name_full in objects
    )
    return int((ours & snapshot.layout.visible).sum()) > 1 or any(several)


def separate_averages(objects: dict[str, complex], paths: str) -> Finding:
    """Return the finding that these objects take the mean each by itself.

    Parameters
    ----------
    objects
        From `averaging_objects`, at least one.
    paths
        The paths that it concerns, in words.

    Returns
    -------
    Finding
        With the error of two walls of the largest index.
    """
    index = max(objects.values(), key=abs)
    return finding(
        "walls-averaged-separately",
        *objects,
        paths=paths,
        loss_30_db=_loss_db(index, 30.0),
        loss_60_db=_loss_db(index, 60.0),
    )


def _loss_db(index: complex, angle_deg: float) -> float:
    """What two walls pass on both ways over what they pass with a mean at each [dB]."""
    wall = slab_power(index, 1e-12, 1.0, math.cos(math.radians(angle_deg)), "single-pass")
    s, p = float(wall.transmitted_s), float(wall.transmitted_p)
    return 20 * math.log10((s**2 + p**2) / 2 / ((s + p) / 2) ** 2)


def _index(material: Any) -> complex:
    n, kappa = (group_input(material, name) for name in (INDEX, EXTINCTION))
    return complex(
        1.0 if n is None else n.default_value, 0.0 if kappa is None else kappa.default_value
    )
