# SPDX-License-Identifier: GPL-3.0-or-later
"""Text for people: figures in columns, in the digits that a map's cells bear, and names."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from ...options import CommandParser
from ...terminal import printable
from ..detection import Detection, Peak, target_count, velocity_before_folding_mps
from ..maps import RangeDopplerMap, level_unit
from ..pictures import cell_width, decimals_for, fixed
from ..results import FrameResult
from .process import KeptFrame

#: Where a parser of arguments collects its commands.
Subcommands: TypeAlias = "argparse._SubParsersAction[CommandParser]"


def frame_lines(result: FrameResult) -> list[str]:
    """Return text for what was found in a frame."""
    counts, digits = result.statistics.counts, map_digits(result.rd_map)
    unit = level_unit(result.echoes.amplitude_model)
    lines = [f"frame {result.frame}: t = {result.time_s:g} s, {counts.paths} paths"]
    lines += [
        f"  leading edge  {digits.range_text(edge.range_m)}   level {edge.level_db:z8.2f} {unit}"
        for edge in result.edges
    ]
    if result.edges_left_out:
        lines.append(f"  {result.edges_left_out} leading edges of lower prominence are not listed")
    lines += [
        f"  moving target {digits.range_text(peak.range_m)}   level {peak.level_db:z8.2f} {unit}   "
        f"{digits.motion_text(peak)}   {peak.peak_to_background_db:.1f} dB above its surroundings"
        f"{_name_text(peak)}"
        for peak in result.moving_targets
    ]
    if result.detections is not None:
        found = result.detections
        count = target_count(len(found.targets), found.left_out)
        cells = f"{found.cells} cell{'' if found.cells == 1 else 's'}"
        lines.append(f"  CFAR          {count}, {cells} above the threshold")
        lines += [f"  {line}" for line in detection_lines(found.targets, result.rd_map)]
    lines += [f"  {line}" for line in result.budget.lines()]
    if result.files:
        lines.append(f"  {len(result.files)} files in {result.files[0].parent}")
    return lines


def kept_lines(kept: KeptFrame) -> list[str]:
    """Return text for a frame that was done before."""
    return [f"frame {kept.frame}: done before, {len(kept.files)} files in {kept.map.path.parent}"]


def detection_lines(
    targets: Sequence[Detection], rd_map: RangeDopplerMap | None = None, most: int = 10
) -> list[str]:
    """Return one line per target; `rd_map` gives the digits that its cells bear."""
    digits = map_digits(rd_map)
    lines = [
        f"target       {digits.range_text(t.range_m)}   SNR {t.snr_db:z8.2f} dB   "
        f"{digits.motion_text(t)}{_name_text(t)}"
        for t in targets[:most]
    ]
    if len(targets) > most:
        lines.append(f"{len(targets) - most} more targets in the files")
    return lines


def _name_text(target: Peak | Detection) -> str:
    return f"   {printable(target.name)}" if target.name else ""


def map_digits(rd_map: RangeDopplerMap | None) -> Digits:
    """Return digits for what is interpolated between the cells of a map; at least the usual
    ones.
    """
    if rd_map is None:
        return Digits()
    step_hz = cell_width(rd_map.doppler_hz)
    step_mps = step_hz * rd_map.radar.waveform.wavelength_m / 2
    usual = Digits()
    return Digits(
        max(usual.range, decimals_for(cell_width(rd_map.range_m))),
        max(usual.rate, decimals_for(step_mps)),
        max(usual.doppler, decimals_for(step_hz)),
    )


@dataclass(frozen=True)
class Digits:
    """Digits behind the point of ranges [m], range rates [m/s] and Doppler [Hz]."""

    range: int = 2
    rate: int = 3
    doppler: int = 2

    def range_text(self, range_m: float) -> str:
        """Return a range, right-aligned."""
        return f"{fixed(range_m, self.range):>10} m"

    def motion_text(self, target: Peak | Detection) -> str:
        """Return range rate and Doppler, right-aligned; a rate of 0 has no sign."""
        rate = fixed(target.velocity_mps, self.rate, signed=True)
        doppler = fixed(target.doppler_hz, self.doppler, signed=True)
        text = f"range rate {rate:>9} m/s   Doppler {doppler:>9} Hz"
        true_mps = velocity_before_folding_mps(target)
        if true_mps is not None:
            text += f"   folded, true range rate {fixed(true_mps, self.rate, signed=True)} m/s"
        return text
