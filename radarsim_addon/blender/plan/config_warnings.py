# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the numbers of a measurement do not fit together, or pixels are too coarse for the scene.

Does not import bpy.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from ...findings import Finding, finding
from ...signal.radar import find_suspicious_parameters, range_limit
from .measurement import Measurement


def config_findings(
    measurement: Measurement,
    rings: int,
    farthest_m: float | None = None,
    frame_interval_s: float | None = None,
    sampling_mode: str = "rings",
    animation_s: float | None = None,
    speeds_mps: Mapping[str, float] = MappingProxyType({}),
) -> list[Finding]:
    """Find numbers that do not fit together, in a run of `rings` rings or of paths.

    `farthest_m` is the distance of the farthest point from the transmitter, `frame_interval_s` the
    time between two radar frames (None: there is one frame), `animation_s` the duration of the
    animation, `speeds_mps` the largest |range rate| of each object whose motion is known. None:
    unknown.
    """
    radar = measurement.radar
    of_rings = sampling_mode == "rings"
    covered_m = rings * measurement.ring_step_m if of_rings else math.inf
    reach_m = covered_m if farthest_m is None else min(covered_m, farthest_m)
    known_m = reach_m if math.isfinite(reach_m) else None
    found = find_suspicious_parameters(radar, known_m, animation_s)
    if of_rings:
        found += _ring_findings(measurement, covered_m, reach_m, farthest_m)
    if farthest_m is not None and 0 < measurement.range_stop_m < farthest_m:
        numbers = {"farthest_m": farthest_m, "range_stop_m": measurement.range_stop_m}
        found.append(finding("scene-beyond-range-limits", **numbers))
    unambiguous_m = radar.unambiguous_range_m
    if known_m is not None and known_m > unambiguous_m:
        numbers = {"farthest_m": known_m, "unambiguous_range_m": unambiguous_m}
        if radar.waveform.kind == "fmcw":
            found.append(finding("scene-beyond-sampled-band", **numbers))
        else:
            limit = range_limit(radar.waveform)
            found.append(finding("scene-beyond-unambiguous-range", **numbers, limit=limit))
    limit_mps = radar.max_unambiguous_velocity_mps
    fast = sorted((n for n, v in speeds_mps.items() if v > limit_mps), key=lambda n: -speeds_mps[n])
    if fast and radar.burst.pulses > 1:
        found.append(
            finding(
                "scene-beyond-unambiguous-velocity",
                *fast,
                fastest_mps=speeds_mps[fast[0]],
                max_unambiguous_velocity_mps=limit_mps,
                prf_hz=radar.prf_for_hz(speeds_mps[fast[0]]),
            )
        )
    if frame_interval_s is not None and len(measurement.frames) > 1:
        burst_s = radar.burst.pulses / radar.burst.prf_hz
        if burst_s > frame_interval_s * (1 + 1e-6):
            found.append(
                finding("bursts-overlap", burst_s=burst_s, frame_interval_s=frame_interval_s)
            )
    return found


def _ring_findings(
    measurement: Measurement, covered_m: float, reach_m: float, farthest_m: float | None
) -> list[Finding]:
    """Find rings and snapshots that do not fit the scene or the waveform."""
    found = []
    if farthest_m is not None and farthest_m > covered_m * (1 + 1e-6):
        found.append(finding("scene-beyond-rings", covered_m=covered_m, farthest_m=farthest_m))
    resolution_m = measurement.radar.waveform.range_resolution_m
    coarse = resolution_m > reach_m  # another finding reports it
    if not coarse and measurement.ring_step_m < resolution_m:
        found.append(
            finding(
                "ring-step-below-resolution",
                ring_step_m=measurement.ring_step_m,
                range_resolution_m=resolution_m,
            )
        )
    if measurement.snapshots == 1:
        found.append(finding("single-snapshot"))
    elif measurement.snapshot_interval_s < 0.002:
        interval_s = measurement.snapshot_interval_s
        found.append(finding("short-snapshot-interval", snapshot_interval_s=interval_s))
    return found


#: Range that a pixel may span, as a fraction of the range. Measured on ground with constant gamma,
#: in bins of 5 m: wrong by 0.3 dB at 0.3, by 1 dB at 0.5, by 5 dB or missing from 1 on.
LARGEST_STEP = 0.3
#: A finer resolution is proposed up to this many pixels.
_MOST_PX = 1 << 22
#: Relative change of the ratio of the sides that counts as none: 0.02 of 24 degrees.
_SAME_RATIO = 1e-3
#: With rings a pixel has one range: more range cells than these leave gaps between the pixels.
RING_CELLS = 2.0
#: Pixels across an object that rings must have to meet it.
_ACROSS = 2.0


def find_coarse_pixels(
    measurement: Measurement,
    sampling_mode: str,
    steps_m: Mapping[str, tuple[float, float]],
    sizes_px: Mapping[str, float],
) -> list[Finding]:
    """Find pixels that are too coarse for the surfaces and objects in view.

    `steps_m` has the largest range step of a pixel on each flat surface, and its range; `sizes_px`
    the size of each object. Paths follow surfaces between rays and measure small objects apart. The
    findings have the resolution that would do, as width_px and height_px: 0 if it is not possible.
    """
    found = []
    resolution_m = measurement.radar.waveform.range_resolution_m
    by_rings = sampling_mode == "rings"

    def excess(step_m: float, range_m: float) -> float:
        """How many times too long a step is."""
        cells = RING_CELLS * resolution_m
        return step_m / (cells if by_rings else max(cells, LARGEST_STEP * range_m))

    coarse = {name: excess(*step) for name, step in steps_m.items()}
    coarse = {name: times for name, times in coarse.items() if times > 1}
    if coarse:
        names = sorted(coarse, key=lambda name: -coarse[name])
        step_m, range_m = steps_m[names[0]]
        found.append(
            finding(
                "footprints-too-coarse",
                *names,
                step_m=step_m,
                range_m=range_m,
                range_cells=step_m / resolution_m,
                **_finer(measurement, coarse[names[0]]),
            )
        )
    small = {name: size for name, size in sizes_px.items() if 0 < size < 1} if by_rings else {}
    if small:
        names = sorted(small, key=lambda name: small[name])
        size_px = small[names[0]]
        numbers = _finer(measurement, _ACROSS / size_px)
        found.append(finding("objects-below-a-pixel", *names, size_px=size_px, **numbers))
    return found


def _finer(measurement: Measurement, factor: float) -> dict[str, int]:
    """Return the resolution with so many times the pixels a side, or a little more; zeros if that
    is too much.

    The ratio of the sides stays, and with it the field of view.
    """
    across, up = measurement.width_px, measurement.height_px
    width = math.ceil(across * factor)
    while abs(round(width * up / across) * across / (width * up) - 1) > _SAME_RATIO:
        width += 1  # ends at a multiple of the width
    height = round(width * up / across)
    if width * height > _MOST_PX:
        width = height = 0
    return {"width_px": width, "height_px": height}
