# SPDX-License-Identifier: GPL-3.0-or-later
"""What scripts and drivers move at whole frames only, by the whole number of the frame."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...array_types import Mask, Real
from ...findings import Finding, finding
from .animation import moves_in_steps
from .samples import Sampler


def stepped_at_frames(
    sampler: Sampler, moving_items: Callable[[int], Sequence[Any]]
) -> tuple[set[int], set[str], list[Finding]]:
    """Return rows of poses and names of surfaces that hold for each frame and then jump, as said.

    Not those with Constant keys, which are meant to. `moving_items` returns the objects that move a
    row. Samples whole frames, and the middles between them.
    """
    whole = sampler.plan.whole_frames()
    middles = [sampler.plan.between(*pair) for pair in itertools.pairwise(whole)]
    for moment in (*whole, *middles):
        sampler.take(*moment)
    whole_s, middles_s = ([at_s for at_s, _ in moments] for moments in (whole, middles))
    burst = sampler.plan.burst

    def jumps(values: dict[float, Real]) -> Mask:
        at_whole = np.stack([values[at_s] for at_s in whole_s])
        amid = np.stack([values[at_s] for at_s in middles_s])
        moved = (at_whole[1:] != at_whole[:-1]).any(axis=(0, 2, 3))
        return np.asarray(moved & (at_whole[:-1] == amid).all(axis=(0, 2, 3)))

    changing = sampler.changing
    poses = {at_s: sampler.poses(at_s, changing) for at_s in (*whole_s, *middles_s)}
    rows = {
        row
        for row in changing[jumps(poses)].tolist()
        if not any(moves_in_steps(item, *burst) for item in moving_items(row))
    }
    names = set()
    for name, surface in sampler.surfaces.items():
        vertices = {at_s: sampler.vertices[name][at_s] for at_s in (*whole_s, *middles_s)}
        if any(one is None for one in vertices.values()):
            continue
        jumping = jumps({at_s: one[None] for at_s, one in vertices.items()}).item()
        if jumping and not moves_in_steps(surface.item, *burst):
            names.add(name)
    moved = ["antennas" if row < 2 else sampler.parts[row - 2].name for row in sorted(rows)]
    subjects = dict.fromkeys([*moved, *sorted(names)])
    return rows, names, [finding("moves-at-whole-frames", *subjects)] if subjects else []
