# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses of bodies and lengths of paths at every moment of a burst.

In: sampled poses and the motion files of a run. Out: fits with an error bound, path lengths [m] and
range rates [m/s] at any time [s].
"""

from .antenna_motion import AntennaMotion, axes_of, places_m
from .body_motion import BodyMotion
from .body_motions import BodyMotions, which_move
from .fit import cubic_spline, fit_body, fit_vertices, smooth_poses
from .images import PathImages
from .kinematics import KinematicMotion, leg_change
from .motion_file import FrameMotion, Tracks, VertexSeries, body_record, read_motion, write_tracks
from .path_motion import JoinedMotion, LinearMotion, PathMotion, Rows, join_motion, mean_over_burst
from .still_bodies import StillBodies, read_still_bodies, write_still_bodies

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
