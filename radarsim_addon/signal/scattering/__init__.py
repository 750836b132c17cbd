# SPDX-License-Identifier: GPL-3.0-or-later
"""ROOM."""

from .antenna_gains import Link, frame_antennas
from .frame_speckle import FrameSpeckle
from .random_phases import path_phasors
from .surface_speckle import SpeckleReport

__all__ = [
    "FrameSpeckle",
    "Link",
    "SpeckleReport",
    "frame_antennas",
    "path_phasors",
]
