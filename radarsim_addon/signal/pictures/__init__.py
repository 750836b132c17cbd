# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of echoes, profiles, maps, scenes and antennas. Imports matplotlib when it draws.

`figure` has what all pictures share: numbers and units, joined cells, sheets that are drawn once
for many frames, numbered points. `echo`, `profile`, `map`, `scene` and `antennas` draw one kind
each, `frame_pictures` all pictures of a frame and the animation of a run's maps. `frame_view` has
what pictures are drawn from in files between processes, `view_pictures` those that the window asks
for, and `worker` is the process that draws them.
"""

from .antennas import ANTENNA_PICTURE, COVERAGE_PICTURE, plot_antennas, plot_coverage
from .echo import plot_echo, plot_rings
from .figure import cell_width, decimals_for, fixed, new_figure, save_figure
from .frame_pictures import MapFile, animate_maps, common_scale, draw_results, map_file
from .frame_view import FrameProfile, FrameView, Target, profile_of, read_view, write_view
from .map import plot_range_doppler, plot_spectrogram
from .profile import plot_range_profile
from .scene import placed_targets, plot_scene
from .view_pictures import answer_request, coverage_message

__all__ = [
    "ANTENNA_PICTURE",
    "COVERAGE_PICTURE",
    "FrameProfile",
    "FrameView",
    "MapFile",
    "Target",
    "animate_maps",
    "answer_request",
    "cell_width",
    "common_scale",
    "coverage_message",
    "decimals_for",
    "draw_results",
    "fixed",
    "map_file",
    "new_figure",
    "placed_targets",
    "plot_antennas",
    "plot_coverage",
    "plot_echo",
    "plot_range_doppler",
    "plot_range_profile",
    "plot_rings",
    "plot_scene",
    "plot_spectrogram",
    "profile_of",
    "read_view",
    "save_figure",
    "write_view",
]
