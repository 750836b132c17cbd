# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of a path besides its numbers: one value for each flag, in files and in memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Flags = NDArray[np.uint16]


class PathFlag:
    """Bits of the column ``flags`` of the path table and of `Paths.flags`.

    Plain integers and not an `enum.IntFlag`, whose members numpy would promote to int64.
    """

    ENCODED_LENGTH = 1
    """The length is that of the range encoding in float32: a vertex of the path is unknown."""

    NO_FIRST_VERTEX = 2
    """The scatterer nearest to the receiver is unknown (more than two reflections)."""

    MIXED = 4
    """Several ranges in the pixel (|G B/R^2 - 1| above a tolerance): its range is their mixture."""

    NO_RANGE = 8
    """Light without range encoding, or beyond its reach: the length is 0 and no map contains it."""

    SINGLE_SNAPSHOT = 16
    """No echo in the second snapshot, or no second snapshot: range rate unknown, taken as 0."""

    RANGE_RATE_REJECTED = 32
    """The range changed faster than the limit allows: another surface; range rate taken as 0."""

    CROSSED_SHELL = 64
    """The echo moved into the neighbouring ring between the snapshots, and was found there."""

    HAS_REVERSE = 128
    """Its first and last scatterer scatter in many directions: the wave also takes the reverse way,
    a path of its own. `power_w` is that of one of the two."""


#: Value of each flag by its name in files.
PATH_FLAGS = {name.lower(): flag for name, flag in vars(PathFlag).items() if name.isupper()}
