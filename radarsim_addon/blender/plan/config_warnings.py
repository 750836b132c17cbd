# SPDX-License-Identifier: GPL-3.0-or-later
"""What follows from a measurement's numbers, and where they do not fit together. No bpy.

The panel shows both; the run's file keeps the warnings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...signal.radar import find_suspicious_parameters
from .measurement import Measurement

_FOLD = "fold back to small ranges. Lower the PRF."
#: What becomes of echoes from beyond the unambiguous range, by kind of waveform.
_BEYOND = {
    "fmcw": "are taken out by the ADC's filter. Sample faster, or sweep less in the same time.",
    "stepped": "fold back to small ranges. Take smaller steps.",
    "pmcw": "fold back to small ranges. Take a longer code.",
}


@dataclass(frozen=True)
class Derived:
    """Numbers that follow; SI."""

    range_resolution_m: float
    unambiguous_range_m: float
    max_unambiguous_velocity_mps: float
    velocity_resolution_mps: float
    burst_s: float
    rings: int
    covered_range_m: float
    renders: int


def derive(measurement: Measurement, rings: int) -> Derived:
    """Numbers that follow from a measurement with `rings` rings."""
    radar = measurement.radar
    return Derived(
        range_resolution_m=radar.waveform.range_resolution_m,
        unambiguous_range_m=radar.unambiguous_range_m,
        max_unambiguous_velocity_mps=radar.max_unambiguous_velocity_mps,
        velocity_resolution_mps=radar.velocity_resolution_mps,
        burst_s=radar.burst.pulses / radar.burst.prf_hz,
        rings=rings,
        covered_range_m=rings * measurement.ring_step_m,
        renders=measurement.renders(rings),
    )


def warnings_for(
    measurement: Measurement,
    rings: int,
    farthest_m: float | None = None,
    frame_interval_s: float | None = None,
    sampling_mode: str = "rings",
    animation_s: float | None = None,
) -> list[str]:
    """Sentences about numbers that do not fit together; empty when all is well.

    Parameters
    ----------
    measurement
        What is asked for.
    rings
        Number of rings the run has.
    farthest_m
        Farthest point of the scene from the emitter [m], if known.
    frame_interval_s
        Time between two radar frames [s], if there are several.
    sampling_mode
        "rings" or "paths", which reach as far as the scene does.
    animation_s
        Length of the scene's animation [s], if known.
    """
    radar = measurement.radar
    of_rings = sampling_mode == "rings"
    covered_m = rings * measurement.ring_step_m if of_rings else math.inf
    reach_m = covered_m if farthest_m is None else min(covered_m, farthest_m)
    known_m = reach_m if math.isfinite(reach_m) else None
    found = find_suspicious_parameters(radar, known_m, animation_s)
    if of_rings and farthest_m is not None and farthest_m > covered_m * (1 + 1e-6):
        found.append(
            f"The rings end at {covered_m:.6g} m, the scene at {farthest_m:.6g} m: echoes from "
            "beyond are not rendered. Add rings or widen the ring step."
        )
    unambiguous_m = radar.unambiguous_range_m
    if known_m is not None and known_m > unambiguous_m:
        found.append(
            f"Targets beyond the unambiguous range of {unambiguous_m:.6g} m (the scene reaches "
            f"{known_m:.6g} m) " + _BEYOND.get(radar.waveform.kind, _FOLD)
        )
    coarse = radar.waveform.range_resolution_m > reach_m  # said already
    if of_rings and not coarse and measurement.ring_step_m < radar.waveform.range_resolution_m:
        found.append(
            f"The ring step of {measurement.ring_step_m:.4g} m is below the range resolution of "
            f"{radar.waveform.range_resolution_m:.4g} m: more renders, no more detail."
        )
    if of_rings and measurement.snapshots == 1:
        found.append("One pass gives no Doppler: every echo will be at 0 m/s. Take two passes.")
    elif of_rings and measurement.snapshot_interval_s < 0.002:
        found.append(
            f"Delta t of {measurement.snapshot_interval_s * 1e3:.4g} ms is short: "
            "Blender keeps animation in "
            "float32, which at 1 ms costs about 1 % of the velocity. 10 ms is a good value."
        )
    if frame_interval_s is not None and len(measurement.frames) > 1:
        burst_s = radar.burst.pulses / radar.burst.prf_hz
        if burst_s > frame_interval_s * (1 + 1e-6):
            found.append(
                f"A burst lasts {burst_s:.4g} s, but the next frame begins after "
                f"{frame_interval_s:.4g} s: bursts overlap. Fewer pulses, or every n-th frame."
            )
    return found
