# SPDX-License-Identifier: GPL-3.0-or-later
"""Picture of a spectrogram: Doppler and range rate against time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..maps import Spectrogram, power_to_db
from .cells import cell_axis, strongest
from .figure import new_figure
from .map import MOST_CELLS, picture_floor_db
from .numbers import frequency_unit, reference_text, speed_unit, time_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_spectrogram(shown: Spectrogram, title: str = "Spectrogram", unit: str = "") -> Figure:
    """Draw a spectrogram in decibels, time to the right, Doppler up and range rate at the right.

    Parameters
    ----------
    shown
        The spectrogram.
    title
        Text above the axes.
    unit
        Unit of its powers in decibels, "dBW" with the amplitude model "radar-equation".

    Returns
    -------
    matplotlib.figure.Figure
        The picture.
    """
    fastest_hz = float(np.abs(shown.doppler_hz).max())
    rate_per_hz = -shown.radar.waveform.wavelength_m / 2
    hertz, speed = frequency_unit(fastest_hz), speed_unit(fastest_hz * rate_per_hz)
    burst_s = shown.radar.burst.pulses / shown.radar.burst.prf_hz
    seconds = time_unit(burst_s)
    window_s = shown.options.window_pulses / shown.radar.burst.prf_hz
    across = cell_axis(shown.time_s, MOST_CELLS, seconds.size, window_s)
    up = cell_axis(shown.doppler_hz, MOST_CELLS, hertz.size)
    power = shown.power
    top, floor_db = float(power.max(initial=0.0)), picture_floor_db(power)
    figure = new_figure(8, 5.5)
    axis = figure.subplots()
    level = power_to_db(strongest(power, (across.step, up.step)), top or 1.0, floor_db)
    image = axis.imshow(
        level.T,
        aspect="auto",
        origin="lower",
        extent=(across.low, across.high, up.low, up.high),
        vmin=floor_db,
        vmax=0,
        cmap="viridis",
        interpolation="nearest",
    )
    axis.set_xlim(across.low, across.end)
    axis.set_ylim(up.low, up.end)
    axis.set_xlabel(f"time [{seconds.name}]")
    axis.set_ylabel(f"Doppler [{hertz.name}] (receding: negative)")
    factor = rate_per_hz * hertz.size / speed.size
    right = axis.secondary_yaxis(
        "right", functions=(lambda y: np.multiply(y, factor), lambda y: np.divide(y, factor))
    )
    right.set_ylabel(f"range rate [{speed.name}]")
    bar = figure.colorbar(image, ax=axis, pad=0.12)
    bar.set_label(f"power [dB re strongest cell{reference_text(top, unit)}]")
    axis.set_title(title, fontsize=10)
    return figure
