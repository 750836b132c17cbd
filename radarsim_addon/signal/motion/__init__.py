# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses of bodies and lengths of paths at every moment of a burst: one render for all pulses.

Blender samples poses in float32. `fit` replaces the samples of each body, or of the vertices of a
deforming mesh, by Chebyshev series of the degree that the noise allows, with an error bound;
`body_motion` evaluates them. `kinematics` adds the changes of each path's legs, from the motion of
its vertices and antennas, to its length in the table, and gives range rates. `motion_file` keeps
the motion of a frame on disk.
"""

from .body_motion import (
    AntennaMotion,
    BodyMotion,
    BodyMotions,
    Segment,
    axes_of,
    places_m,
    which_move,
)
from .fit import cubic_spline, fit_body, fit_vertices, smooth_poses
from .kinematics import (
    JoinedMotion,
    KinematicMotion,
    LinearMotion,
    PathImages,
    PathMotion,
    Rows,
    join_motion,
    leg_change,
    mean_over_burst,
    row_blocks,
)
from .motion_file import (
    FrameMotion,
    StillBodies,
    Tracks,
    VertexSeries,
    body_record,
    read_motion,
    write_still_bodies,
    write_tracks,
)

__all__ = [
    "AntennaMotion",
    "BodyMotion",
    "BodyMotions",
    "FrameMotion",
    "JoinedMotion",
    "KinematicMotion",
    "LinearMotion",
    "PathImages",
    "PathMotion",
    "Rows",
    "Segment",
    "StillBodies",
    "Tracks",
    "VertexSeries",
    "axes_of",
    "body_record",
    "cubic_spline",
    "fit_body",
    "fit_vertices",
    "join_motion",
    "leg_change",
    "mean_over_burst",
    "places_m",
    "read_motion",
    "row_blocks",
    "smooth_poses",
    "which_move",
    "write_still_bodies",
    "write_tracks",
]
