# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that lie in the field of view and were met by no ray because they are too small."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ... import contract
from ...findings import Finding, finding
from ..scene import Poses
from ..views import ViewWindow
from .screen_boxes import projected_bounds

#: Objects of fewer pixels than this can lie between all rays of a view.
_SURELY_HIT_PX = 2.0


def missed_objects_findings(
    poses: Poses,
    names: Sequence[str],
    met: Collection[int],
    receiver: contract.ReceiverRecord,
    frame: ViewWindow,
) -> list[Finding]:
    """Find objects that no ray met although they are in sight.

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
    return [finding("object-missed-by-rays", *small)] if small else []
