# SPDX-License-Identifier: GPL-3.0-or-later
"""From maps to peaks, CFAR detections, moving targets, objects and their link budget.

`peaks` interpolates local maxima of a map trigonometrically and finds leading edges of a profile.
`cfar` has thresholds for the correlated cells of a tapered map, `detections` the targets above them
and the paths that make a target, `array_targets` those of several channels, with directions.
`moving_targets` subtracts echo after echo (CLEAN) and keeps what no other echo's response explains.
`objects` sums the paths of each object to power and cross section, `power_budget` compares these
with noise and clutter, `statistics` counts paths and reports doubtful ones.
"""

from .array_targets import DirectedDetection, detect_in_directions, named_in_directions
from .cfar import Cfar, CfarKind, CfarResult, cfar_threshold
from .detections import (
    Detection,
    Detections,
    PathFinder,
    TargetPaths,
    detect_targets,
    target_count,
)
from .moving_targets import (
    SLOWEST_CELLS,
    DopplerFolds,
    find_moving_targets,
    received_recording,
    velocity_before_folding_mps,
)
from .objects import ObjectEcho, matching_objects, object_echoes, paths_of_objects
from .peaks import (
    MAX_EDGES,
    LeadingEdge,
    Peak,
    find_edges,
    find_peaks,
    leading_edges,
    peak_to_background_db,
)
from .power_budget import BudgetReport, FrameBudget, predicted_snr, projection_findings
from .statistics import FrameStatistics, StatisticsSum, frame_statistics, statistics_findings

__all__ = [
    "MAX_EDGES",
    "SLOWEST_CELLS",
    "BudgetReport",
    "Cfar",
    "CfarKind",
    "CfarResult",
    "Detection",
    "Detections",
    "DirectedDetection",
    "DopplerFolds",
    "FrameBudget",
    "FrameStatistics",
    "LeadingEdge",
    "ObjectEcho",
    "PathFinder",
    "Peak",
    "StatisticsSum",
    "TargetPaths",
    "cfar_threshold",
    "detect_in_directions",
    "detect_targets",
    "find_edges",
    "find_moving_targets",
    "find_peaks",
    "frame_statistics",
    "leading_edges",
    "matching_objects",
    "named_in_directions",
    "object_echoes",
    "paths_of_objects",
    "peak_to_background_db",
    "predicted_snr",
    "projection_findings",
    "received_recording",
    "statistics_findings",
    "target_count",
    "velocity_before_folding_mps",
]
