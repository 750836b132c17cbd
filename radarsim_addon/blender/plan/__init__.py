# SPDX-License-Identifier: GPL-3.0-or-later
"""What to measure: measurement, path options, plan of a run. Pure Python, SI, float64.

`measurement` declares the numbers and choices of the user, which make the panel, the options of the
command line (`render_arguments`) and the checked records; `presets` has radars to begin with.
`run_plan` makes the renders of a run from a measurement and the extent of the scene.
`config_warnings` finds numbers that do not fit together.
"""

from .config_warnings import config_findings, find_coarse_pixels
from .measurement import (
    FINEST_PITCH,
    POLARISATIONS,
    Measurement,
    PathOptions,
    RunSettings,
    parse_frames,
)
from .presets import DEFAULT_PRESET, PRESETS, RadarPreset, radar_preset
from .render_arguments import (
    COVERAGE_SETTINGS,
    CoverageRequest,
    coverage_request,
    given_settings,
    merged,
    parse_axis,
    parse_coverage_arguments,
    parse_render_arguments,
    parse_selfcheck_arguments,
    render_settings,
    shortest_decimal,
)
from .run_plan import (
    Extent,
    Instant,
    Plan,
    Task,
    automatic_rings,
    check_frame_rate,
    check_unit_scale,
    fingerprint,
    instant_at,
    make_plan,
    run_record,
)

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
    "parse_selfcheck_arguments",
    "radar_preset",
    "render_settings",
    "run_record",
    "shortest_decimal",
]
