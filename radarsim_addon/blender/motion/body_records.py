# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of the bodies of a frame in its motion file, and of the many that are stationary."""

from __future__ import annotations

from collections.abc import Container
from pathlib import Path
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ...array_types import Indices, Real
from ...motion_record import BodyRecord
from ...sidecar import file_sha256
from ...signal.motion import BodyMotions, StillBodies, body_record, write_still_bodies
from ..scene import instance_name
from ..state import Layout
from .bodies import Parts

#: Stationary bodies from which on they are in a file of their own: a record of each takes longer.
MANY = 256


def write_bodies(
    folder: Path, parts: Parts, motions: BodyMotions, deforming: Container[str]
) -> tuple[list[BodyRecord], str, str]:
    """Return the records of bodies of these motions, and name and digest of the file of the others.

    It has the stationary ones where these are many; else the name is empty. `deforming` are the
    names of the objects whose surfaces deform.
    """
    names, bodies = parts.names, parts.bodies
    rows, boxes = bodies.row[parts.index], bodies.box[parts.index]
    instances = _instance_names(bodies.snapshot.layout, rows)
    still = np.array([name not in deforming for name in names], dtype=bool)
    for at, motion in motions.others.items():
        if motion.moving or motion.noise_m or motion.displacement_error_bound_m:
            still[at] = False
    chosen = np.flatnonzero(still)
    file = digest = ""
    if len(chosen) < MANY:
        still[:] = False
    else:
        path = write_still_bodies(
            folder,
            StillBodies(
                1 + chosen,
                _poses_of(motions, chosen),
                [names[at] for at in chosen.tolist()],
                instances[chosen].tolist(),
            ),
        )
        file, digest = path.name, file_sha256(path)
    records = [
        body_record(names[at], instances[at], motions[at], names[at] in deforming, boxes[at])
        for at in np.flatnonzero(~still).tolist()
    ]
    return records, file, digest


def _poses_of(motions: BodyMotions, chosen: Indices) -> Real:
    """Return the poses of some bodies, (n, 4, 4), translation in metres."""
    poses = motions.poses[chosen]
    for at, motion in motions.others.items():
        poses[chosen == at] = motion.pose
    return poses


#: Names of the instances of a layout, (rows,), None where not asked for; and of its instancers.
_names: WeakKeyDictionary[Layout, tuple[list[str], NDArray[np.object_]]] = WeakKeyDictionary()


def _instance_names(layout: Layout, rows: Indices) -> NDArray[np.object_]:
    """Return the names of the instances in some rows, (n,): many are the same in each frame."""
    owners = [item.name_full for item in layout.instancers]
    known = _names.get(layout)
    if known is None or known[0] != owners:  # someone has renamed them
        known = _names[layout] = owners, np.full(layout.shape.size, None, dtype=object)
    names = known[1]
    new = rows[names[rows] == None]  # noqa: E711
    names[new] = [instance_name(key) for key in layout.keys(new)]
    return np.asarray(names[rows])
