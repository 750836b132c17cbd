# SPDX-License-Identifier: GPL-3.0-or-later
"""Picture of the clutter that is expected in the range-Doppler map."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..maps import ExpectedPower
from ..radar import Radar
from .figure import new_figure
from .map import ColourScale, draw_map, floor_db_of, map_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_clutter(
    expected: ExpectedPower,
    radar: Radar,
    title: str = "Expected clutter",
    *,
    noise_power: float = 0.0,
    unit: str = "",
) -> Figure:
    """Draw the expected power of clutter in the range-Doppler map, without a canceller.

    Parameters
    ----------
    expected
        With clutter.
    radar
        Waveform and burst of the map.
    title
        Text above the axes.
    noise_power
        Mean thermal noise of a cell, marked at the colour bar; 0: unknown.
    unit
        Unit of the powers in decibels, "dBW" with the amplitude model "radar-equation".

    Returns
    -------
    matplotlib.figure.Figure
        The picture.
    """
    power = np.zeros_like(expected.map) if expected.clutter_map is None else expected.clutter_map
    top = float(power.max(initial=0.0))
    axes = map_axes(
        expected.doppler_hz, expected.range_m, -radar.waveform.wavelength_m / 2, radar.burst.prf_hz
    )
    floor_db = floor_db_of(top, 0.0, noise_power)
    scale = ColourScale(top, floor_db, noise_power, unit, "strongest cell of clutter")
    figure = new_figure(8, 6.5)
    axis, _ = draw_map(figure, power, axes, scale)
    axis.set_title(title, fontsize=10)
    return figure
