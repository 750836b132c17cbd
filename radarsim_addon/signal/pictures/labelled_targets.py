# SPDX-License-Identifier: GPL-3.0-or-later
"""Which targets of a map get a number in its picture."""

from __future__ import annotations

from collections.abc import Sequence

from ..detection import Detection, Peak
from ..maps import RangeDopplerMap
from .numbers import cell_width

#: Maximum number of labels, and of labels of stationary targets.
_LABELS, _STILL_LABELS = 5, 2
#: A peak this far below a labelled one at its Doppler or range may be its sidelobe [dB].
_SHADOW_DB = 25.0
#: Closer than this only the stronger target gets a label [fraction of an axis].
_NEAR = 0.03
#: Tapers widen a response to at most three cells on each side: slower targets count as stationary.
_STILL_CELLS = 3.0


def foremost(
    rd_map: RangeDopplerMap, peaks: Sequence[Peak], targets: Sequence[Detection]
) -> list[Peak | Detection]:
    """Choose the targets to label: peaks, then moving targets, then stationary ones.

    Each group is sorted by falling level. Targets next to a labelled one get no label, nor those
    25 dB below one at its Doppler or range, where its sidelobes are.
    """
    cell_m, cell_hz = cell_width(rd_map.range_m), cell_width(rd_map.doppler_hz)
    chosen: list[Peak | Detection] = list(peaks[:_LABELS])
    moving = [t for t in targets if abs(t.doppler_hz) >= _STILL_CELLS * cell_hz > 0]
    still = [t for t in targets if not abs(t.doppler_hz) >= _STILL_CELLS * cell_hz > 0]
    for group, most in ((moving, _LABELS), (still, _STILL_LABELS)):
        left = most
        for target in sorted(group, key=lambda item: -item.level_db):
            if len(chosen) >= _LABELS or not left:
                break
            if not any(
                _hidden(target, other, cell_hz, cell_m, rd_map.plane.shape) for other in chosen
            ):
                chosen.append(target)
                left -= 1
    return chosen


def _hidden(
    item: Detection,
    other: Peak | Detection,
    cell_hz: float,
    cell_m: float,
    shape: tuple[int, ...],
) -> bool:
    """Whether a target is the other one, or may be its sidelobe."""
    apart_hz = abs(item.doppler_hz - other.doppler_hz)
    apart_m = abs(item.range_m - other.range_m)
    near_hz, near_m = (
        max(guard * cell, _NEAR * cell * count)
        for guard, cell, count in zip((4, 8), (cell_hz, cell_m), shape, strict=True)
    )
    if apart_hz <= near_hz and apart_m <= near_m:
        return True
    aligned = apart_hz <= 2 * cell_hz or apart_m <= 4 * cell_m
    return aligned and item.level_db < other.level_db - _SHADOW_DB
