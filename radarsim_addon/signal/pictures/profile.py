# SPDX-License-Identifier: GPL-3.0-or-later
"""Picture of a range profile: coherent and expected power, leading edges, noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...array_types import Real
from ..detection import LeadingEdge
from ..maps import ExpectedPower, PowerProfile, RangeProfiles, power_to_db
from .figure import new_figure
from .labels import Label, place_labels
from .map import BELOW_NOISE_DB, SPAN_DB
from .numbers import decimals_for, fixed, range_unit, reference_text, with_minus

#: Room above the strongest, for labels [dB].
_HEADROOM_DB = 10.0
#: Stretches of a curve that labels look at.
_COLUMNS = 600


def plot_range_profile(
    compressed: RangeProfiles | None = None,
    profile: PowerProfile | None = None,
    edges: Sequence[LeadingEdge] = (),
    title: str = "Matched filter",
    floor_db: float | None = None,
    reference_ranges_m: Sequence[float] = (),
    expected: ExpectedPower | None = None,
    *,
    noise_power: float = 0.0,
    unit: str = "",
) -> Any:
    """Compressed power in decibels against range (the paper's Fig. 8).

    Parameters
    ----------
    compressed
        Coherent output: the mean over the pulses of |.|^2 is drawn.
    profile
        Expected power, without speckle and noise.
    edges
        Leading edges to mark.
    title, floor_db
        Title; lowest level drawn, below the strongest; None: 80 dB, or as far as the noise.
    reference_ranges_m
        True ranges, drawn as dashed lines.
    expected
        Expected power with its standard error, drawn as a band of one sigma to each side.
    noise_power
        Mean thermal noise of a cell (:func:`.maps.noise_floor.range_noise_gain` times that of a
        sample), drawn as a line; 0: not known.
    unit
        Unit of the powers in decibels, "dBW" with the weighting "radar-equation".
    """
    figure = new_figure(10, 4.5)
    axis = figure.subplots()
    curves: list[tuple[Real, Real]] = []
    if compressed is not None:
        curves.append((compressed.range_m, np.mean(np.abs(compressed.values) ** 2, axis=0)))
    if profile is not None:
        curves.append((profile.range_m, profile.power))
    top = max((float(power.max(initial=0.0)) for _, power in curves), default=0.0)
    reference = top or 1.0
    if floor_db is None:
        floor_db = -SPAN_DB
        if noise_power > 0 and top > 0:
            noise_db = 10 * math.log10(noise_power / top)
            floor_db = min(5.0 * math.floor((noise_db - BELOW_NOISE_DB) / 5), -20.0)
    length = range_unit(max((float(np.abs(r).max()) for r, _ in curves), default=0.0))
    texts, styles = [], []
    if compressed is not None:
        pulses = compressed.values.shape[0]
        mean = f"mean power of {pulses} pulses" if pulses > 1 else "one pulse"
        texts.append(f"coherent, {mean} (window: {compressed.window})")
        styles.append({"lw": 0.6, "color": "0.55"})
    if profile is not None:
        texts.append(f"expected power, no speckle, no noise (window: {profile.window})")
        styles.append({"lw": 1.2, "color": "C0"})
    for (range_m, power), text, style in zip(curves, texts, styles, strict=True):
        axis.plot(
            range_m / length.size, power_to_db(power, reference, floor_db), label=text, **style
        )
    _draw_error(axis, expected, length.size, reference, floor_db)
    if noise_power > 0 and top > 0:
        level = with_minus(fixed(10 * math.log10(noise_power), 1))
        axis.axhline(
            10 * math.log10(noise_power / top),
            color="0.2",
            ls=":",
            lw=1.0,
            label=f"mean noise, {level} {unit}".rstrip(),
        )
    for number, value in enumerate(reference_ranges_m):
        # a label that begins so is not in the legend
        text = "true near face" if number == 0 else "_"
        axis.axvline(value / length.size, ls="--", lw=0.8, color="C2", zorder=0, label=text)
    if curves and curves[0][0].size > 1:
        ends = curves[0][0][[0, -1]] / length.size
        axis.set_xlim(float(ends[0]), float(ends[1]))
    axis.set_ylim(floor_db, _HEADROOM_DB)
    axis.ticklabel_format(useOffset=False)
    axis.set_xlabel(f"one-way range [{length.name}]")
    axis.set_ylabel(f"power [dB re strongest{reference_text(top, unit)}]" if top else "power [dB]")
    axis.grid(alpha=0.3)
    axis.set_title(title, fontsize=10)
    labels = []
    source = profile or compressed
    cell_m = source.radar.waveform.range_resolution_m if source is not None else 1.0
    digits = decimals_for(cell_m / length.size)
    for edge in edges:
        half_db = edge.level_db - 10 * math.log10(2 * reference)
        if half_db < floor_db:
            continue
        place = edge.range_m / length.size
        axis.plot(place, half_db, "v", color="C3", ms=6)
        labels.append(Label(place, half_db, f"{fixed(place, digits)} {length.name}"))
    if labels:
        axis.plot([], [], "v", ls="", color="C3", label="half-power leading edge")
    if not top:
        axis.text(0.5, 0.5, "no echo", fontsize=14, ha="center", transform=axis.transAxes)
    elif axis.get_legend_handles_labels()[1]:
        axis.legend(fontsize=8, loc="best")
    drawn = [
        _trace(range_m / length.size, power_to_db(power, reference, floor_db), floor_db)
        for range_m, power in curves
    ]
    place_labels(
        axis,
        labels,
        colour="C3",
        back="white",
        drawn=np.concatenate(drawn) if drawn else None,
        half_cover=10.0,
    )
    return figure


def _draw_error(
    axis: Any, expected: ExpectedPower | None, size: float, reference: float, floor_db: float
) -> None:
    """A band of one standard error, where it is known."""
    if expected is None or not np.isfinite(expected.profile_error).all():
        return
    low, high = (
        power_to_db(
            np.maximum(expected.profile + sign * expected.profile_error, 0.0), reference, floor_db
        )
        for sign in (-1, 1)
    )
    axis.fill_between(
        expected.range_m / size, low, high, color="C0", alpha=0.3, lw=0, label="one standard error"
    )


def _trace(x: Real, level_db: Real, floor_db: float) -> Real:
    """Points along a curve, a decibel apart where it is steep, (points, 2)."""
    step = -(-x.size // _COLUMNS)
    starts = np.arange(0, x.size, step)
    low = np.minimum.reduceat(level_db, starts)
    high = np.maximum.reduceat(level_db, starts)
    levels = np.arange(floor_db + 1, _HEADROOM_DB)
    column, row = np.nonzero((levels > low[:, None] - 0.5) & (levels < high[:, None] + 0.5))
    return np.column_stack([x[starts[column]], levels[row]])
