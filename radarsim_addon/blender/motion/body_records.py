# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of the bodies of a frame in its motion file, and of the many that are stationary."""

from __future__ import annotations

from collections.abc import Container, Sequence
from pathlib import Path

import numpy as np

from ...motion_record import BodyRecord
from ...sidecar import file_sha256
from ...signal.motion import BodyMotion, StillBodies, body_record, write_still_bodies
from ..scene import instance_name
from .bodies import Parts

#: Stationary bodies from which on they are in a file of their own: a record of each takes longer.
MANY = 256


def write_bodies(
    folder: Path, parts: Parts, motions: Sequence[BodyMotion], deforming: Container[str]
) -> tuple[list[BodyRecord], str, str]:
    """Return the records of bodies of these motions, and name and digest of the file of the others.

    It has the stationary ones where these are many; else the name is empty. `deforming` are the
    names of the objects whose surfaces deform.
    """
    names, bodies = parts.names, parts.bodies
    rows, boxes = bodies.row[parts.index], bodies.box[parts.index]
    instances = list(map(instance_name, bodies.snapshot.layout.keys(rows)))
    still = [
        not (motion.moving or motion.noise_m or motion.displacement_error_bound_m)
        and name not in deforming
        for name, motion in zip(names, motions, strict=True)
    ]
    chosen = np.flatnonzero(still).tolist()
    file = digest = ""
    if len(chosen) < MANY:
        still = [False] * len(still)
    else:
        path = write_still_bodies(
            folder,
            StillBodies(
                1 + np.array(chosen),
                np.stack([motions[at].pose for at in chosen]),
                [names[at] for at in chosen],
                [instances[at] for at in chosen],
            ),
        )
        file, digest = path.name, file_sha256(path)
    records = [
        body_record(names[at], instances[at], motions[at], names[at] in deforming, boxes[at])
        for at, apart in enumerate(still)
        if not apart
    ]
    return records, file, digest
