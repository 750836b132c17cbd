# SPDX-License-Identifier: GPL-3.0-or-later
"""What to measure: measurement, path options, plan of a run. Pure Python, SI, float64."""

from .config_warnings import config_findings
from .coverage_arguments import (
    COVERAGE_SETTINGS,
    CoverageRequest,
    coverage_request,
    parse_axis,
    parse_coverage_arguments,
)
from .measurement import POLARISATIONS, Measurement, parse_frames
from .path_options import FINEST_PITCH, PathOptions
from .pixel_findings import find_coarse_pixels
from .presets import DEFAULT_PRESET, PRESETS, RadarPreset, radar_preset
from .records import fingerprint, run_record
from .render_arguments import given_settings, parse_render_arguments, render_settings
from .run_plan import (
    Extent,
    Instant,
    Plan,
    Task,
    automatic_rings,
    check_frame_rate,
    check_unit_scale,
    instant_at,
    make_plan,
)
from .run_settings import RunSettings
from .window_settings import merged, shortest_decimal

__all__ = [
    "COVERAGE_SETTINGS",
    "DEFAULT_PRESET",
    "FINEST_PITCH",
    "POLARISATIONS",
    "PRESETS",
    "CoverageRequest",
    "Extent",
    "Instant",
    "Measurement",
    "PathOptions",
    "Plan",
    "RadarPreset",
    "RunSettings",
    "Task",
    "automatic_rings",
    "check_frame_rate",
    "check_unit_scale",
    "config_findings",
    "coverage_request",
    "find_coarse_pixels",
    "fingerprint",
    "given_settings",
    "instant_at",
    "make_plan",
    "merged",
    "parse_axis",
    "parse_coverage_arguments",
    "parse_frames",
    "parse_render_arguments",
    "radar_preset",
    "render_settings",
    "run_record",
    "shortest_decimal",
]
