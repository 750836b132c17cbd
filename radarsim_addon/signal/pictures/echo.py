# SPDX-License-Identifier: GPL-3.0-or-later
"""Picture of the raw samples: magnitude and real part, pulse against fast time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ...array_types import Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..echoes import Echoes
from ..maps import power_to_db, power_unit
from .cells import cell_axis, strongest
from .figure import new_figure, scale_on_top
from .numbers import frequency_unit, range_unit, reference_text, time_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Name of the start of a row of samples by kind of waveform.
_LINE_BEGINS = {"fmcw": "ramp", "stepped": "ramp of steps", "pmcw": "code"}
#: Decibels from the strongest sample to the lowest colour.
_SPAN_DB = 60.0
#: Maximum number of drawn cells along fast time and over the pulses.
_MOST_SAMPLES, _MOST_PULSES = 900, 280


def plot_echo(echoes: Echoes, title: str = "Raw echo") -> Figure:
    """Draw magnitude and real part of the echoes, pulse against fast time (the paper's Fig. 7).

    Parameters
    ----------
    echoes
        Samples of a burst. The magnitude of joined samples is that of the strongest; a single pulse
        is drawn as curves.
    title
        Text above the axes.

    Returns
    -------
    matplotlib.figure.Figure
        The picture.
    """
    figure = new_figure(10, 6)
    first, second = figure.subplots(2, 1, sharex=True)
    samples = echoes.plane
    magnitude = np.abs(samples)
    top = float(magnitude.max(initial=0.0))
    clock = time_unit(float(np.abs(echoes.fast_time_s).max()))
    # echoes fall with the square of range: scale the real part so that far ones show too
    limit = float(np.quantile(magnitude, 0.95)) or top or 1.0
    power_of_ten = 3 * math.floor(math.log10(limit) / 3)
    scale = 10.0**power_of_ten
    watts = echoes.amplitude_model == "radar-equation"
    unit = r"\sqrt{\mathrm{W}}" if watts else r"B\,r^2"
    value_text = (
        f"Re $s$ [$10^{{{power_of_ten}}}\\,{unit}$]" if power_of_ten else f"Re $s$ [${unit}$]"
    )
    level_text = (
        f"$|s|$ [dB re strongest{reference_text(top**2, power_unit(echoes.amplitude_model))}]"
    )
    if samples.shape[0] == 1:
        time = echoes.fast_time_s / clock.size
        first.plot(time, power_to_db(magnitude[0] ** 2, top**2 or 1.0, -_SPAN_DB), lw=0.8)
        first.set_ylim(-_SPAN_DB, 3)
        first.set_ylabel(level_text)
        second.plot(time, samples[0].real / scale, lw=0.8)
        second.set_ylabel(value_text)
        for axis in (first, second):
            axis.grid(alpha=0.3)
            axis.set_xlim(float(time[0]), float(time[-1]))
        title = f"{title}, one pulse"
    else:
        _draw_burst(figure, first, second, echoes, magnitude, clock.size, limit / scale, scale)
        figure.axes[-2].set_ylabel(level_text)
        figure.axes[-1].set_ylabel(f"{value_text}, 95 % of $|s|$ within" if top else "Re $s$")
        for axis in (first, second):
            axis.set_ylabel(_row_text(echoes))
    if not top:
        for axis in (first, second):
            axis.text(
                0.5, 0.5, "no echo", fontsize=14, ha="center", va="center",
                color="0.5", transform=axis.transAxes,
            )  # fmt: skip
    _label_times(first, second, echoes, clock.name, clock.size)
    figure.suptitle(title, fontsize=10)
    return figure


def _row_text(echoes: Echoes) -> str:
    """Return the name of a row of samples and its rate."""
    prf_hz = echoes.radar.burst.prf_hz
    unit = frequency_unit(prf_hz)
    rate = f"PRF {prf_hz / unit.size:.6g} {unit.name}"
    rows = echoes.samples.shape[1] // echoes.radar.burst.pulses
    return f"pulse ({rate})" if rows == 1 else f"code ({rows} per pulse, {rate})"


def _draw_burst(
    figure: Figure,
    first: Axes,
    second: Axes,
    echoes: Echoes,
    magnitude: Real,
    second_size: float,
    limit: float,
    scale: float,
) -> None:
    """Draw both images with their colour bars, the last two axes of the figure."""
    pulses = np.arange(magnitude.shape[0], dtype=np.float64)
    common: dict[str, Any] = {"aspect": "auto", "origin": "lower", "interpolation": "nearest"}
    across = cell_axis(echoes.fast_time_s, _MOST_SAMPLES, second_size)
    along = cell_axis(pulses, _MOST_PULSES)
    joined = strongest(magnitude, (along.step, across.step))
    top = float(magnitude.max(initial=0.0))
    picture = first.imshow(
        power_to_db(joined**2, top**2 or 1.0, -_SPAN_DB),
        vmin=-_SPAN_DB,
        vmax=0,
        cmap="viridis",
        extent=(across.low, across.high, along.low, along.high),
        **common,
    )
    figure.colorbar(picture, ax=first)
    picture = second.imshow(
        echoes.plane.real / scale,
        vmin=-limit,
        vmax=limit,
        cmap="RdBu_r",
        extent=(across.low, across.end, along.low, along.end),
        **common,
    )
    figure.colorbar(picture, ax=second, extend="both")
    for axis in (first, second):
        axis.set_xlim(across.low, across.end)
        axis.set_ylim(along.low, along.end)


def _label_times(first: Axes, second: Axes, echoes: Echoes, name: str, size: float) -> None:
    second.ticklabel_format(axis="x", useOffset=False)
    if echoes.radar.waveform.family == "line":
        # each sample holds the echoes of all ranges
        begun = _LINE_BEGINS[echoes.radar.waveform.kind]
        second.set_xlabel(f"time since the {begun} began [{name}]")
        return
    second.set_xlabel(f"fast time since the middle of the pulse [{name}]")
    length = range_unit(float(echoes.fast_time_s[-1]) * SPEED_OF_LIGHT_MPS / 2)
    factor = SPEED_OF_LIGHT_MPS / 2 * size / length.size
    scale_on_top(first, factor, f"one-way range of the echo's middle [{length.name}]")
