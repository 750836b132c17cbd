# SPDX-License-Identifier: GPL-3.0-or-later
"""Options of scripts/render_radar.py by the names of the scene's settings. No bpy."""

from __future__ import annotations

import argparse
from typing import Any

from ...errors import ConfigError
from ..plan import parse_frames

#: Options that are of rings alone.
_RINGS = ("auto_rings",)
_RING_NUMBERS = ("rings", "ring_step", "samples", "bounces")
#: Options of paths that are called otherwise than what they set.
_PATH_FLAGS = {
    "time_limit_s": "time_limit",
    "amplitude": "amplitude_channel",
    "code": "range_encoding",
}


def command_line_overrides(arguments: argparse.Namespace) -> dict[str, Any]:
    """Options by the names of the scene's settings; None where not given."""
    if arguments.rings is not None and arguments.auto_rings:
        raise ConfigError("--rings and --auto-rings are both given; expected one of them.")
    of_pulse = (arguments.carrier_ghz, arguments.bandwidth_mhz, arguments.chirp_us)
    if arguments.waveform is not None and any(value is not None for value in of_pulse):
        raise ConfigError("--radar and numbers of a pulse are both given; expected one of them.")
    width_px, height_px = parse_resolution(arguments.resolution)
    return {
        "frames": None if arguments.frames is None else parse_frames(arguments.frames),
        "ring_count": arguments.rings,
        "ring_mode": "AUTO" if arguments.auto_rings else None,
        "ring_step_m": arguments.ring_step,
        "snapshots": arguments.snapshots,
        "snapshot_interval_ms": None
        if arguments.snapshot_interval is None
        else arguments.snapshot_interval * 1e3,
        "samples": arguments.samples,
        "width_px": width_px,
        "height_px": height_px,
        "max_bounces": arguments.bounces,
        "carrier_ghz": arguments.carrier_ghz,
        "bandwidth_mhz": arguments.bandwidth_mhz,
        "chirp_duration_us": arguments.chirp_us,
        "sampling_rate_mhz": arguments.sampling_mhz,
        "prf_hz": arguments.prf_hz,
        "pulses": arguments.pulses,
        "radar_file": arguments.waveform,
        "seed": arguments.seed,
        "polarisation": arguments.polarisation,
    }


def chosen_acquisition(arguments: argparse.Namespace) -> str | None:
    """The acquisition that was named, or that the options belong to; None: the file's own."""
    if arguments.sampling_mode is not None:
        return str(arguments.sampling_mode)
    of_rings = [f"--{name.replace('_', '-')}" for name in _RINGS if getattr(arguments, name)]
    of_rings += [
        f"--{name.replace('_', '-')}"
        for name in _RING_NUMBERS
        if getattr(arguments, name) is not None
    ]
    of_paths = [
        f"--{_PATH_FLAGS.get(name, name).replace('_', '-')}"
        for name, value in path_overrides(arguments).items()
        if value is not None
    ]
    if of_rings and of_paths:
        raise ConfigError(
            f"{of_paths[0]} is of paths, {of_rings[0]} of rings; expected options of one of them, "
            "or --acquisition that says which."
        )
    return "rings" if of_rings else "paths" if of_paths else None


def path_overrides(arguments: argparse.Namespace) -> dict[str, Any]:
    """Options of the acquisition "paths"; None where not given."""
    return {
        "max_reflections": arguments.max_reflections,
        "replicates": arguments.replicates,
        "refine_for": arguments.refine_for,
        "max_standard_error": None
        if arguments.max_standard_error is None
        else arguments.max_standard_error / 100,
        "time_limit_s": arguments.time_limit,
        "motion": arguments.motion,
        "motion_samples": arguments.motion_samples,
        "visibility_updates": arguments.visibility_updates,
        "range_encoding": arguments.range_encoding,
        "amplitude_channel": arguments.amplitude_channel,
    }


def parse_resolution(text: str | None) -> tuple[int | None, int | None]:
    """``640x360`` as two numbers."""
    if text is None:
        return None, None
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdecimal() and int(part) > 0 for part in parts):
        raise ConfigError(f"Resolution {text!r} is not understood; expected WxH, such as 640x360.")
    return int(parts[0]), int(parts[1])
