# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses of bodies and lengths of paths at every moment of a burst.

In: sampled poses and the motion files of a run. Out: fits with an error bound, path lengths [m] and
range rates [m/s] at any time [s].
"""

from .body_motion import AntennaMotion, BodyMotion, BodyMotions, axes_of, places_m, which_move
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
)
from .motion_file import (
    FrameMotion,
    StillBodies,
    Tracks,
    VertexSeries,
    body_record,
    read_motion,
    read_still_bodies,
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
    "read_still_bodies",
    "smooth_poses",
    "which_move",
    "write_still_bodies",
    "write_tracks",
]
