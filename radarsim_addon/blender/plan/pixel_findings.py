# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether pixels are fine enough for the surfaces and objects in view. Pure Python."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ...findings import Finding, finding
from .measurement import Measurement

#: Range that a pixel may span, as a fraction of the range. Measured on ground with constant gamma,
#: in bins of 5 m: wrong by 0.3 dB at 0.3, by 1 dB at 0.5, by 5 dB or missing from 1 on.
LARGEST_STEP = 0.3
#: A finer resolution is proposed up to this many pixels.
_MOST_PX = 1 << 22
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
    """Find pixels that are too coarse.

    Parameters
    ----------
    measurement
        What is asked for.
    sampling_mode
        "rings" or "paths", which follows surfaces between rays and measures small objects apart.
    steps_m
        Largest range step of a pixel on each flat surface in view, and its range [m].
    sizes_px
        Size of each object in view [px].

    Returns
    -------
    list of Finding
        With the resolution that would do, as width_px and height_px: 0 if it is not possible.
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
    """The resolution with so many times the pixels a side; zeros if that is too much."""
    across, up = measurement.width_px, measurement.height_px
    sides = [8 * math.ceil(side * factor / 8) for side in (across, up)]
    if math.prod(sides) > _MOST_PX:
        sides = [0, 0]
    return {"width_px": sides[0], "height_px": sides[1]}
