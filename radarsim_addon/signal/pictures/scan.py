# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the range profiles of all frames: against time, and by direction (plan position)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...arrays import Real
from ..maps import power_to_db
from .figure import cell_width, range_unit, time_unit
from .frame_view import FrameProfile
from .map import ColourScale, label_colours

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Most cells of range in either picture.
_MOST_CELLS = 2000
#: Smallest sector of a plan position, and widest part of a sector that is drawn straight [deg].
_LEAST_SECTOR_DEG, _STRAIGHT_DEG = 0.2, 1.0


def draw_range_time(
    figure: Figure, profiles: Sequence[FrameProfile], scale: ColourScale
) -> tuple[Axes, tuple[float, float]]:
    """Draw profiles side by side: each column shows the frame nearest in time.

    Return the axes, and the size of their units to the right and up [s] and [m].
    """
    order = sorted(profiles, key=lambda one: one.time_s)
    times_s = np.array([one.time_s for one in order])
    gap_s = float(np.median(np.diff(times_s))) if times_s.size > 1 else 1.0
    ends = times_s[0] - gap_s / 2, times_s[-1] + gap_s / 2
    edges_s = np.array([ends[0], *(times_s[1:] + times_s[:-1]) / 2, ends[1]])
    seconds = time_unit(float(np.abs(edges_s).max()))
    edges_m, levels = _levels(order, scale)
    length = range_unit(float(edges_m[-1]))
    axis = figure.subplots()
    mesh = axis.pcolormesh(
        edges_s / seconds.size, edges_m / length.size, levels.T,
        vmin=scale.floor_db, vmax=0, cmap="viridis", rasterized=True,
    )  # fmt: skip
    axis.set_xlim(*(edges_s[[0, -1]] / seconds.size).tolist())
    axis.set_ylim(*(edges_m[[0, -1]] / length.size).tolist())
    axis.set_xlabel(f"time [{seconds.name}]")
    axis.set_ylabel(f"one-way range [{length.name}]")
    axis.ticklabel_format(useOffset=False)
    axis.set_facecolor("0.85")
    label_colours(axis, figure.colorbar(mesh, ax=axis, pad=0.02), scale)
    return axis, (seconds.size, length.size)


def draw_plan_position(
    figure: Figure, profiles: Sequence[FrameProfile], scale: ColourScale
) -> Axes:
    """Draw profiles by the direction that the receiver looked in: +Y of the world is up.

    Each direction shows the frame that looked nearest to it, grey where none did. Return the axes.
    """
    order = sorted(profiles, key=lambda one: one.azimuth_deg)
    azimuth_deg = np.array([one.azimuth_deg for one in order])
    after = np.append(azimuth_deg, azimuth_deg[0] + 360)
    gaps = np.diff(after)
    apart = gaps[gaps > _LEAST_SECTOR_DEG]
    # A sector is as wide as the step of the scan; of one direction alone, as the field of view.
    sector = float(np.median(apart)) if apart.size > 1 else profiles[-1].width_deg
    half = max(sector, _LEAST_SECTOR_DEG) / 2
    # it ends half a sector away, or amid the next frame's direction
    up = np.minimum(azimuth_deg + half, (after[1:] + after[:-1]) / 2)
    before = np.insert(azimuth_deg, 0, azimuth_deg[-1] - 360)
    down = np.maximum(azimuth_deg - half, (before[1:] + before[:-1]) / 2)
    edges_m, levels = _levels(order, scale)
    length = range_unit(float(edges_m[-1]))
    axis = figure.subplots()
    axis.set_facecolor("0.85")
    edges_deg, columns = [down[:1]], []
    for row, (first, last) in enumerate(zip(down, up, strict=True)):
        if first > edges_deg[-1][-1] + 1e-9:
            edges_deg.append(np.array([first]))
            columns.append(np.full((1, levels.shape[1]), np.nan))
        parts = max(math.ceil((last - first) / _STRAIGHT_DEG), 1)
        edges_deg.append(np.linspace(first, last, parts + 1)[1:])
        columns.append(np.repeat(levels[row][None], parts, axis=0))
    turn = np.radians(np.concatenate(edges_deg))[:, None]
    mesh = axis.pcolormesh(
        np.sin(turn) * edges_m / length.size, np.cos(turn) * edges_m / length.size,
        np.ma.masked_invalid(np.concatenate(columns)),
        vmin=scale.floor_db, vmax=0, cmap="viridis", rasterized=True,
    )  # fmt: skip
    far = edges_m[-1] / length.size
    axis.set_xlim(-far, far)
    axis.set_ylim(-far, far)
    axis.set_aspect("equal")
    axis.set_xlabel(f"east, +X [{length.name}]")
    axis.set_ylabel(f"north, +Y [{length.name}]")
    label_colours(axis, figure.colorbar(mesh, ax=axis, pad=0.02), scale)
    return axis


def _levels(profiles: Sequence[FrameProfile], scale: ColourScale) -> tuple[Real, Real]:
    """Return the edges of common cells of range [m], no wider than those of any profile, and the
    levels of all profiles there, (profiles, cells) [dB]; NaN beyond their ends.
    """
    widths_m = [cell_width(one.range_m) or 1.0 for one in profiles]
    both = list(zip(profiles, widths_m, strict=True))
    low_m = max(min(float(one.range_m[0]) - width / 2 for one, width in both), 0.0)
    high_m = max(float(one.range_m[-1]) + width / 2 for one, width in both)
    count = math.ceil((high_m - low_m) / min(widths_m) - 1e-6)
    edges_m = np.linspace(low_m, high_m, min(count, _MOST_CELLS) + 1)
    found = np.full((len(profiles), edges_m.size - 1), np.nan)
    for row, (one, width_m) in enumerate(both):
        middle_m = (edges_m[1:] + edges_m[:-1]) / 2
        place = np.rint((middle_m - one.range_m[0]) / width_m).astype(np.int64)
        inside = (place >= 0) & (place < one.range_m.size)
        power = one.power[place[inside]]
        found[row, inside] = power_to_db(power, scale.reference or 1.0, scale.floor_db)
    return edges_m, found
