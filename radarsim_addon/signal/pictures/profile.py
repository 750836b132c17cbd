# SPDX-License-Identifier: GPL-3.0-or-later
"""Picture of a range profile: coherent and expected power, leading edges, noise."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import Real
from ..detection import LeadingEdge
from ..echoes import only_channel
from ..maps import ExpectedPower, PowerProfile, RangeProfiles, power_to_db
from .figure import (
    TALL_TEXT,
    Sheet,
    Unit,
    decimals_for,
    fixed,
    lay_out,
    list_texts,
    new_figure,
    number_points,
    range_unit,
    reference_text,
    with_minus,
)
from .map import BELOW_NOISE_DB, SPAN_DB, ColourScale

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
    expected
        Expected power with its standard error, drawn as a band of one standard error.
    noise_power
        Mean thermal noise of a range bin (:func:`.maps.range_noise_gain` times that of a sample),
        drawn as a line; 0: unknown.
    unit
        Unit of the powers in decibels, "dBW" with the amplitude model "radar-equation".

    Returns
    -------
    matplotlib.figure.Figure
        The picture.
    """
    shown = _Shown.of(compressed, profile, edges, expected, floor_db, noise_power, unit)
    figure = new_figure(10, 4.5)
    axis = _empty_axes(figure, shown.scale, shown.ends)
    axis.set_title(title, fontsize=10)
    shown.draw(figure, axis)
    return figure


def draw_range_profile(
    compressed: RangeProfiles,
    profile: PowerProfile,
    edges: Sequence[LeadingEdge],
    title: str,
    *,
    expected: ExpectedPower | None,
    noise_power: float,
    unit: str,
) -> NDArray[np.uint8]:
    """Return the picture of `plot_range_profile`, (height, width, 3)."""
    shown = _Shown.of(compressed, profile, edges, expected, None, noise_power, unit)
    scale = dataclasses.replace(shown.scale, reference=1.0)
    figure, axis, sheet = _sheet(scale, shown.ends, len(shown.texts))
    axis.title.set_text(title)
    shown.draw(figure, axis)
    return sheet.picture()


def draw_expected_profile(figure: Figure, range_m: Real, power: Real, scale: ColourScale) -> Axes:
    """Draw one curve of expected power (ranges,) into an empty figure; return its axes."""
    own = _Scale(scale.reference or 1.0, scale.floor_db, range_unit(float(range_m[-1])))
    low, high = range_m[[0, -1]] / own.length.size
    curve = _Curve(range_m, power, "expected power, no speckle, no noise", 1.2, "C0")
    shown = _Shown([curve], own, None, scale.reference, [], [], None, 0.0, scale.unit)
    axis = _empty_axes(figure, own, (float(low), float(high)) if high > low else None)
    shown.draw(figure, axis)
    return axis


class _Curve(NamedTuple):
    """One line of the picture."""

    range_m: Real
    power: Real
    text: str
    width: float
    colour: str


@dataclass(frozen=True)
class _Scale:
    """Power of 0 dB, lowest level, and unit of range."""

    reference: float
    floor_db: float
    length: Unit

    def level_db(self, power: Real) -> Real:
        return power_to_db(power, self.reference, self.floor_db)


@dataclass(frozen=True)
class _Shown:
    """Content of a picture: the arguments of `plot_range_profile`, the `ends` of its ranges,
    `spots` and `texts` of the edges, and `top`, the strongest power.
    """

    curves: list[_Curve]
    scale: _Scale
    ends: tuple[float, float] | None
    top: float
    spots: list[tuple[float, float]]
    texts: list[str]
    expected: ExpectedPower | None
    noise_power: float
    unit: str

    @classmethod
    def of(
        cls,
        compressed: RangeProfiles | None,
        profile: PowerProfile | None,
        edges: Sequence[LeadingEdge],
        expected: ExpectedPower | None,
        floor_db: float | None,
        noise_power: float,
        unit: str,
    ) -> _Shown:
        curves = _curves(compressed, profile)
        top = max((float(curve.power.max(initial=0.0)) for curve in curves), default=0.0)
        if floor_db is None:
            floor_db = -SPAN_DB
            if noise_power > 0 and top > 0:
                noise_db = 10 * math.log10(noise_power / top)
                floor_db = min(5.0 * math.floor((noise_db - BELOW_NOISE_DB) / 5), -20.0)
        farthest_m = max((float(np.abs(curve.range_m).max()) for curve in curves), default=0.0)
        scale = _Scale(top or 1.0, floor_db, range_unit(farthest_m))
        ends = None
        if curves and curves[0].range_m.size > 1:
            low, high = (curves[0].range_m[[0, -1]] / scale.length.size).tolist()
            ends = low, high
        source = profile or compressed
        cell_m = 1.0 if source is None else source.radar.waveform.range_resolution_m
        spots, texts = _edge_spots(edges, scale, cell_m)
        return cls(curves, scale, ends, top, spots, texts, expected, noise_power, unit)

    def draw(self, figure: Figure, axis: Axes) -> None:
        """Fill the axes, and list the edges below."""
        length, top = self.scale.length, self.top
        for curve in self.curves:
            level_db = self.scale.level_db(curve.power)
            x = curve.range_m / length.size
            axis.plot(x, level_db, label=curve.text, lw=curve.width, color=curve.colour)
        _draw_error(axis, self.expected, self.scale)
        if self.noise_power > 0 and top > 0:
            level = with_minus(fixed(10 * math.log10(self.noise_power), 1))
            text = f"mean noise, {level} {self.unit}".rstrip()
            noise_db = 10 * math.log10(self.noise_power / top)
            axis.axhline(noise_db, color="0.2", ls=":", lw=1.0, label=text)
        text = f"power [dB re strongest{reference_text(top, self.unit)}]" if top else "power [dB]"
        axis.set_ylabel(text)
        if self.spots:
            label = "half-power leading edge"
            axis.plot(*zip(*self.spots, strict=True), "v", color="C3", ms=6, label=label)
        if not top:
            axis.text(0.5, 0.5, "no echo", fontsize=14, ha="center", transform=axis.transAxes)
        elif axis.get_legend_handles_labels()[1]:
            axis.legend(fontsize=8, loc="best")
        number_points(figure, axis, self.spots, self.texts, colour="C3", back="white", left=True)


def _empty_axes(figure: Figure, scale: _Scale, ends: tuple[float, float] | None) -> Axes:
    axis = figure.subplots()
    if ends is not None:
        axis.set_xlim(*ends)
    axis.set_ylim(scale.floor_db, _HEADROOM_DB)
    axis.ticklabel_format(useOffset=False)
    axis.set_xlabel(f"one-way range [{scale.length.name}]")
    axis.grid(alpha=0.3)
    return axis


@functools.lru_cache(maxsize=8)
def _sheet(
    scale: _Scale, ends: tuple[float, float] | None, texts: int
) -> tuple[Figure, Axes, Sheet]:
    """Return a sheet with room for so many texts."""
    figure = new_figure(10, 4.5)
    axis = _empty_axes(figure, scale, ends)
    title, label = axis.set_title(TALL_TEXT, fontsize=10), axis.set_ylabel(TALL_TEXT)
    room = list_texts(figure, [TALL_TEXT] * texts) if texts else None
    lay_out(figure)
    if room is not None:
        room.remove()
    return figure, axis, Sheet(figure, [title, label])


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


def _edge_spots(
    edges: Sequence[LeadingEdge], scale: _Scale, cell_m: float
) -> tuple[list[tuple[float, float]], list[str]]:
    """Return places of the leading edges in the picture, and their ranges as text."""
    length, spots, texts = scale.length, [], []
    for edge in edges:
        half_db = edge.level_db - 10 * math.log10(2 * scale.reference)
        if half_db >= scale.floor_db:
            spots.append((edge.range_m / length.size, half_db))
            digits = decimals_for(cell_m / length.size)
            texts.append(f"{fixed(spots[-1][0], digits)} {length.name}")
    return spots, texts
