# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that lie in the field of view and were met by no ray because they are too small."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from .. import contract
from .path_tiles import Area
from .shown import Poses, Shown

#: Objects of fewer pixels than this can lie between all rays of a view.
_SURELY_HIT_PX = 2.0
_NAMES_SHOWN = 5


def unseen_warning(
    poses: Poses,
    names: Sequence[str],
    met: Collection[int],
    camera: contract.CameraRecord,
    width_px: int,
) -> str | None:
    """What to say of objects that no ray met although they are in sight.

    Refinement follows echoes: what gave none is never refined, and its power is missing from the
    error estimate too. Larger objects that were not met are hidden by others: nothing is said.

    Parameters
    ----------
    poses
        What is shown.
    names
        Names of the object numbers, from 1.
    met
        Numbers that some ray met.
    camera, width_px
        The frame before any refinement.
    """
    pitch = (camera.right - camera.left) / width_px
    pose = np.array(camera.matrix_world, dtype=np.float64)
    small = [
        name
        for number, name in enumerate(names, start=1)
        if number not in met
        and any(
            _is_small_in_view(shown, pose, camera, pitch)
            for shown in poses.objects.get(name, {}).values()
        )
    ]
    if not small:
        return None
    shown_names = ", ".join(map(repr, small[:_NAMES_SHOWN]))
    more = f" and {len(small) - _NAMES_SHOWN} more" if len(small) > _NAMES_SHOWN else ""
    return (
        f"In view, but smaller than the pixels and met by no ray: {shown_names}{more}. Their echo "
        "is missing, and no error estimate knows of it. Raise the resolution or the shifts, or "
        "narrow the field of view."
    )


def _is_small_in_view(
    shown: Shown, pose: np.ndarray, camera: contract.CameraRecord, pitch: float
) -> bool:
    seen = view_rectangle(shown, pose, camera)
    # The shorter side decides whether it can slip through between rays.
    return seen is not None and seen.shorter < _SURELY_HIT_PX * pitch


def view_rectangle(shown: Shown, pose: np.ndarray, camera: contract.CameraRecord) -> Area | None:
    """Area around an object's box, in tangents or, orthographic, metres; None out of sight, around
    the receiver, or in an equirectangular view, where the edges of a box are curved."""
    if camera.kind not in ("perspective", "orthographic"):
        return None
    corners = np.array(
        [
            [shown.box[i, 0], shown.box[j, 1], shown.box[k, 2]]
            for i in (0, 1)
            for j in (0, 1)
            for k in (0, 1)
        ]
    )
    world = corners @ shown.pose[:3, :3].T + shown.pose[:3, 3]
    local = (world - pose[:3, 3]) @ pose[:3, :3]
    depth = -local[:, 2]
    u, v = local[:, 0], local[:, 1]
    if camera.kind == "perspective":
        if depth.min() <= 0:
            return None
        u, v = u / depth, v / depth
    elif depth.max() <= 0:
        return None
    found = Area(float(u.min()), float(u.max()), float(v.min()), float(v.max()))
    inside = (
        found.right > camera.left
        and found.left < camera.right
        and found.top > camera.bottom
        and found.bottom < camera.top
    )
    return found if inside else None


def view_rectangles(
    poses: Poses, names: Sequence[str], camera: contract.CameraRecord, most: int
) -> list[Area]:
    """Areas of the objects in view; none if there are more than `most`."""
    pose = np.array(camera.matrix_world, dtype=np.float64)
    found = []
    for name in names:
        for shown in poses.objects.get(name, {}).values():
            seen = view_rectangle(shown, pose, camera)
            if seen is not None:
                found.append(seen)
                if len(found) > most:
                    return []
    return found
