# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that lie in the field of view and were met by no ray because they are too small."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ... import contract
from ..scene import Poses
from ..views import ViewWindow
from .screen_boxes import projected_bounds

#: Objects of fewer pixels than this can lie between all rays of a view.
_SURELY_HIT_PX = 2.0
_NAMES_SHOWN = 5


def missed_objects_warning(
    poses: Poses,
    names: Sequence[str],
    met: Collection[int],
    receiver: contract.ReceiverRecord,
    frame: ViewWindow,
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
    receiver, frame
        The frame before any refinement.
    """
    boxes = projected_bounds(poses, names, receiver, met)
    # The side of fewer pixels decides whether it can slip through between rays.
    slips = np.minimum(*boxes.pixels(frame)) < _SURELY_HIT_PX
    small = [names[number - 1] for number in np.unique(boxes.number[slips])]
    if not small:
        return None
    shown_names = ", ".join(map(repr, small[:_NAMES_SHOWN]))
    more = f" and {len(small) - _NAMES_SHOWN} more" if len(small) > _NAMES_SHOWN else ""
    return (
        f"In view, but smaller than the pixels and met by no ray: {shown_names}{more}. Their echo "
        "is missing, and no error estimate knows of it. Raise the resolution or the shifts, or "
        "narrow the field of view."
    )
