# SPDX-License-Identifier: GPL-3.0-or-later
"""Picture of a range profile: coherent and expected power, leading edges, noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...array_types import Real
from ..detection import LeadingEdge
from ..echoes import only_channel
from ..maps import ExpectedPower, PowerProfile, RangeProfiles, power_to_db
from .figure import new_figure
from .labels import number_points
from .map import BELOW_NOISE_DB, SPAN_DB
from .numbers import Unit, decimals_for, fixed, range_unit, reference_text, with_minus

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Room above the strongest value, for the numbers of edges [dB].
_HEADROOM_DB = 10.0


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
) -> Figure:
    """Draw compressed power in decibels against range (the paper's Fig. 8).

    Parameters
    ----------
    compressed
        Coherent output: the mean over the pulses of |.|^2 is drawn.
    profile
        Expected power, without speckle and noise.
    edges
        Leading edges to number; their ranges are listed below the axes.
    title
        Text above the axes.
    floor_db
        Lowest level drawn, relative to the strongest; None: -80 dB, or down to the noise.
    reference_ranges_m
        True ranges [m], drawn as dashed lines.
    expected
        Expected power with its standard error, drawn as a band of one standard error.
    noise_power
        Mean thermal noise of a range bin (:func:`.maps.noise_floor.range_noise_gain` times that of
        a sample), drawn as a line; 0: unknown.
    unit
        Unit of the powers in decibels, "dBW" with the amplitude model "radar-equation".

    Returns
    -------
    matplotlib.figure.Figure
        The picture.
    """
    figure = new_figure(10, 4.5)
    axis, curves = figure.subplots(), _curves(compressed, profile)
    top = max((float(curve.power.max(initial=0.0)) for curve in curves), default=0.0)
    noise_db = 10 * math.log10(noise_power / top) if noise_power > 0 and top > 0 else None
    if floor_db is None:
        floor_db = -SPAN_DB if noise_db is None else _floor_db(noise_db)
    farthest_m = max((float(np.abs(curve.range_m).max()) for curve in curves), default=0.0)
    scale = _Scale(top or 1.0, floor_db, range_unit(farthest_m))
    _draw_curves(axis, curves, scale)
    _draw_error(axis, expected, scale)
    if noise_db is not None:
        _draw_noise(axis, noise_db, noise_power, unit)
    _draw_references(axis, reference_ranges_m, scale)
    axis.set_ylabel(f"power [dB re strongest{reference_text(top, unit)}]" if top else "power [dB]")
    axis.set_title(title, fontsize=10)
    source = profile or compressed
    cell_m = 1.0 if source is None else source.radar.waveform.range_resolution_m
    _draw_edges(figure, axis, edges, scale, cell_m, bool(top))
    return figure


class _Curve(NamedTuple):
    """One line of the picture."""

    range_m: Real
    power: Real
    text: str
    width: float
    colour: str


class _Scale(NamedTuple):
    """Power of 0 dB, lowest level, and unit of range."""

    reference: float
    floor_db: float
    length: Unit

    def level_db(self, power: Real) -> Real:
        return power_to_db(power, self.reference, self.floor_db)


def _curves(compressed: RangeProfiles | None, profile: PowerProfile | None) -> list[_Curve]:
    found = []
    if compressed is not None:
        pulses = compressed.values.shape[1]
        mean = f"mean power of {pulses} pulses" if pulses > 1 else "one pulse"
        text = f"coherent, {mean} (range taper: {compressed.range_taper})"
        power = only_channel(compressed.mean_power)
        found.append(_Curve(compressed.range_m, power, text, 0.6, "0.55"))
    if profile is not None:
        text = f"expected power, no speckle, no noise (range taper: {profile.range_taper})"
        found.append(_Curve(profile.range_m, profile.power, text, 1.2, "C0"))
    return found


def _floor_db(noise_db: float) -> float:
    """Return the lowest level [dB] of a picture whose noise has this level."""
    return min(5.0 * math.floor((noise_db - BELOW_NOISE_DB) / 5), -20.0)


def _draw_curves(axis: Axes, curves: Sequence[_Curve], scale: _Scale) -> None:
    """Draw the curves, and the axes that fit the first one."""
    length = scale.length
    for curve in curves:
        level_db = scale.level_db(curve.power)
        x = curve.range_m / length.size
        axis.plot(x, level_db, label=curve.text, lw=curve.width, color=curve.colour)
    if curves and curves[0].range_m.size > 1:
        ends = curves[0].range_m[[0, -1]] / length.size
        axis.set_xlim(float(ends[0]), float(ends[1]))
    axis.set_ylim(scale.floor_db, _HEADROOM_DB)
    axis.ticklabel_format(useOffset=False)
    axis.set_xlabel(f"one-way range [{length.name}]")
    axis.grid(alpha=0.3)


def _draw_noise(axis: Axes, noise_db: float, noise_power: float, unit: str) -> None:
    level = with_minus(fixed(10 * math.log10(noise_power), 1))
    text = f"mean noise, {level} {unit}".rstrip()
    axis.axhline(noise_db, color="0.2", ls=":", lw=1.0, label=text)


def _draw_references(axis: Axes, ranges_m: Sequence[float], scale: _Scale) -> None:
    for number, range_m in enumerate(ranges_m):
        # a label that begins with an underscore is not in the legend
        text = "true near face" if number == 0 else "_"
        place = range_m / scale.length.size
        axis.axvline(place, ls="--", lw=0.8, color="C2", zorder=0, label=text)


def _draw_error(axis: Axes, expected: ExpectedPower | None, scale: _Scale) -> None:
    """Draw a band of one standard error if it is known."""
    if expected is None or not np.isfinite(expected.profile_error).all():
        return
    low, high = (
        scale.level_db(np.maximum(expected.profile + sign * expected.profile_error, 0.0))
        for sign in (-1, 1)
    )
    x, text = expected.range_m / scale.length.size, "one standard error"
    axis.fill_between(x, low, high, color="C0", alpha=0.3, lw=0, label=text)


def _draw_edges(
    figure: Figure,
    axis: Axes,
    edges: Sequence[LeadingEdge],
    scale: _Scale,
    cell_m: float,
    any_echo: bool,
) -> None:
    """Mark and number the leading edges, and draw the legend of the axes."""
    length = scale.length
    digits = decimals_for(cell_m / length.size)
    spots, texts = [], []
    for edge in edges:
        half_db = edge.level_db - 10 * math.log10(2 * scale.reference)
        if half_db >= scale.floor_db:
            spots.append((edge.range_m / length.size, half_db))
            texts.append(f"{fixed(spots[-1][0], digits)} {length.name}")
    if spots:
        axis.plot(*zip(*spots, strict=True), "v", color="C3", ms=6, label="half-power leading edge")
    if not any_echo:
        axis.text(0.5, 0.5, "no echo", fontsize=14, ha="center", transform=axis.transAxes)
    elif axis.get_legend_handles_labels()[1]:
        axis.legend(fontsize=8, loc="best")
    number_points(figure, axis, spots, texts, colour="C3", back="white", left=True)
