# SPDX-License-Identifier: GPL-3.0-or-later
"""Names in files of radarsim 0.1 that are called otherwise today: they are still read."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

#: Fields of JSON records, and columns of the path table.
_TODAY = {
    "code_length_m": "range_encoding_length_m",
    "code": "range_encoding",
    "passes": "snapshots",
    "pass_index": "snapshot_index",
    "delta_t_s": "snapshot_interval_s",
    "acquisition": "sampling_mode",
    "system": "link_budget",
    "weighting": "amplitude_model",
    "camera": "receiver",
    "emitter": "transmitter",
    "max_order": "max_reflections",
    "residual": "max_unfollowed_fraction",
    "shifts": "replicates",
    "finest_level": "finest_refinement_level",
    "rows": "path_count",
    "reached": "stop_reason",
    "error_of": "error_scope",
    "left_order_share": "truncated_reflections_fraction",
    "left_order_sigma": "truncated_reflections_stderr",
    "left_depth_share": "truncated_transparency_fraction",
    "mixed_share": "mixed_power_fraction",
    "no_code_share": "unranged_power_fraction",
    "renders_per_burst": "visibility_updates",
    "chirp_length_s": "chirp_duration_s",
    "chip_length_s": "chip_duration_s",
    "sampling_rate_hz": "adc_rate_hz",  # of FMCW
    "degree": "code_degree",
    "repeats": "code_repeats",
    "gain_dbi": "peak_gain_dbi",  # of antennas with a shape
    "pieces": "segments",
    "move": "translation",
    "pivot": "rotation_centre",
    "turn": "rotation",
    "reference": "initial_orientation",
    "bound_m": "displacement_error_bound_m",
    "bound_wavelengths": "displacement_error_bound_wavelengths",
    "span_s": "duration_s",
    "reference_s": "epoch_offset_s",
    "approximated_share": "approximated_motion_fraction",
    "unknown_share": "unknown_motion_fraction",
    "tracks_file": "deforming_surfaces_file",
    "tracks_sha256": "deforming_surfaces_sha256",
    "first_m": "first_scatterer_m",
    "last_m": "last_scatterer_m",
    "object": "last_object",
    "body": "last_body",
    "track": "last_surface_point",
    "first_track": "first_surface_point",
    "shift": "replicate",
    "warnings": "findings",
}

#: Files of a frame.
GROUND_TRUTH_FILE_0_1 = "scene.json"


def todays_name(name: str, known: Collection[str]) -> str:
    """Return `name` if it is known, else what it is called today."""
    return name if name in known else _TODAY.get(name, name)


def todays_numbers(data: dict[str, Any]) -> dict[str, Any]:
    """Return a record whose numbers are counted as today: all reflections, the first one too."""
    bounces = data.get("max_bounces")
    return {"max_reflections": bounces + 1, **data} if type(bounces) is int else data


def todays_names(data: Mapping[str, Any], known: Collection[str]) -> dict[str, Any]:
    """Return a record with the names of today; those that `known` holds are kept."""
    return {todays_name(name, known): value for name, value in data.items()}
