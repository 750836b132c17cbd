# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the raw samples, pulse against fast time, and of the rings that they come from."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..decoding import decode
from ..echoes import Echoes
from ..maps import power_to_db, power_unit
from ..runs import RadarFrame
from .figure import (
    TALL_TEXT,
    CellAxis,
    Sheet,
    Unit,
    cell_axis,
    cell_image,
    frequency_unit,
    new_figure,
    range_unit,
    reference_text,
    say_empty,
    second_scale,
    strongest,
    time_unit,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage


#: Name of the start of a row of samples by kind of waveform.
_LINE_BEGINS = {"fmcw": "ramp", "stepped": "ramp of steps", "pmcw": "code"}
#: Decibels from the strongest sample to the lowest colour.
_SPAN_DB = 60.0
#: Maximum number of drawn cells along fast time and over the pulses.
_MOST_SAMPLES, _MOST_PULSES = 900, 280
#: Real parts are drawn in units in which their limit is below this.
_WIDEST = 999.0
#: Widest picture of one ring in the montage [px].
_THUMBNAIL_PX = 480


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
    scale = _Scale.of(echoes)
    if echoes.plane.shape[0] > 1:
        burst = _Burst(echo_axes(echoes))
        burst.show(echoes, scale, title)
        return burst.figure
    figure = new_figure(10, 6)
    first, second = figure.subplots(2, 1, sharex=True)
    samples, clock = echoes.plane[0], echo_axes(echoes)
    time = echoes.fast_time_s / clock.time.size
    power = np.abs(samples) ** 2
    first.plot(time, power_to_db(power, scale.top**2 or 1.0, -_SPAN_DB), lw=0.8)
    first.set_ylim(-_SPAN_DB, 3)
    first.set_ylabel(scale.level_text)
    second.plot(time, samples.real / scale.size, lw=0.8)
    second.set_ylabel(scale.value_text)
    for axis in (first, second):
        axis.grid(alpha=0.3)
        axis.set_xlim(float(time[0]), float(time[-1]))
        if not scale.top:
            say_empty(axis, "0.5")
    _label_times(first, second, clock)
    figure.suptitle(f"{title}, one pulse", fontsize=10)
    return figure


def draw_echo(echoes: Echoes, title: str) -> NDArray[np.uint8] | None:
    """Return the picture of `plot_echo` of a burst, (height, width, 3); None for a single pulse."""
    if echoes.plane.shape[0] == 1:
        return None
    burst, sheet = _sheet(echo_axes(echoes))
    burst.show(echoes, _Scale.of(echoes), title)
    return sheet.picture()


@dataclass(frozen=True)
class EchoAxes:
    """Parts of the axes of a picture: time, its unit, kind of waveform, rows."""

    across: CellAxis
    along: CellAxis
    time: Unit
    line_begins: str
    range_unit: Unit
    row_text: str


def echo_axes(echoes: Echoes) -> EchoAxes:
    unit = time_unit(float(np.abs(echoes.fast_time_s).max()))
    waveform = echoes.radar.waveform
    prf_hz = echoes.radar.burst.prf_hz
    hertz = frequency_unit(prf_hz)
    rate = f"PRF {prf_hz / hertz.size:.6g} {hertz.name}"
    rows = echoes.samples.shape[1] // echoes.radar.burst.pulses
    return EchoAxes(
        cell_axis(echoes.fast_time_s, _MOST_SAMPLES, unit.size),
        cell_axis(np.arange(echoes.plane.shape[0], dtype=np.float64), _MOST_PULSES),
        unit,
        # each sample of a line holds the echoes of all ranges
        _LINE_BEGINS[waveform.kind] if waveform.family == "line" else "",
        range_unit(float(echoes.fast_time_s[-1]) * SPEED_OF_LIGHT_MPS / 2),
        f"pulse ({rate})" if rows == 1 else f"code ({rows} per pulse, {rate})",
    )


def empty_echo(figure: Figure, axes: EchoAxes, floor_db: float) -> tuple[Axes, AxesImage, Colorbar]:
    """Draw the axes of levels into an empty figure; return them with image and colour bar."""
    axis = figure.subplots()
    image = cell_image(axis, axes.across, axes.along, cmap="viridis", vmin=floor_db, vmax=0)
    axis.set_ylabel(axes.row_text)
    _label_times(axis, axis, axes)
    return axis, image, figure.colorbar(image, ax=axis, pad=0.02)


@dataclass(frozen=True)
class _Scale:
    """Strongest magnitude, largest real part drawn, unit of real parts, and texts of both."""

    top: float
    limit: float
    size: float
    level_text: str
    value_text: str

    @classmethod
    def of(cls, echoes: Echoes) -> _Scale:
        magnitude = np.abs(echoes.plane)
        top = float(magnitude.max(initial=0.0))
        # echoes fall with the square of range: scale the real part so that far ones show too
        limit = float(np.quantile(magnitude, 0.95)) or top or 1.0
        power_of_ten = 3 * math.floor(math.log10(limit) / 3)
        watts = echoes.amplitude_model == "radar-equation"
        unit = r"\sqrt{\mathrm{W}}" if watts else r"B\,r^2"
        reference = reference_text(top**2, power_unit(echoes.amplitude_model))
        times = f"10^{{{power_of_ten}}}\\," if power_of_ten else ""
        return cls(
            top,
            limit,
            10.0**power_of_ten,
            f"$|s|$ [dB re strongest{reference}]",
            f"Re $s$ [${times}{unit}$]",
        )


class _Burst:
    """Figure of a burst: magnitude above, real part below, each with its colour bar."""

    def __init__(self, axes: EchoAxes) -> None:
        self.figure = new_figure(10, 6)
        first, second = self.axes = self.figure.subplots(2, 1, sharex=True)
        self._steps = axes.along.step, axes.across.step
        # real parts are not joined
        single = (replace(axis, high=axis.end) for axis in (axes.across, axes.along))
        self.images = [
            cell_image(first, axes.across, axes.along, cmap="viridis", vmin=-_SPAN_DB, vmax=0.0),
            cell_image(second, *single, cmap="RdBu_r", vmin=-_WIDEST, vmax=_WIDEST),
        ]
        self.bars = [
            self.figure.colorbar(image, ax=axis, extend=extend)
            for image, axis, extend in zip(
                self.images, (first, second), ("neither", "both"), strict=True
            )
        ]
        for axis in (first, second):
            axis.set_ylabel(axes.row_text)
        _label_times(first, second, axes)

    def show(self, echoes: Echoes, scale: _Scale, title: str) -> None:
        joined = strongest(np.abs(echoes.plane), self._steps)
        self.images[0].set_data(power_to_db(joined**2, scale.top**2 or 1.0, -_SPAN_DB))
        self.images[1].set_data(echoes.plane.real / scale.size)
        self.images[1].set_clim(-scale.limit / scale.size, scale.limit / scale.size)
        within = f"{scale.value_text}, 95 % of $|s|$ within" if scale.top else "Re $s$"
        for bar, text in zip(self.bars, (scale.level_text, within), strict=True):
            bar.ax.set_ylabel(text)
        for axis in () if scale.top else self.axes:
            say_empty(axis, "0.5")
        self.figure.suptitle(title, fontsize=10)


@functools.lru_cache(maxsize=4)
def _sheet(axes: EchoAxes) -> tuple[_Burst, Sheet]:
    burst = _Burst(axes)
    first, second = burst.bars
    first.ax.set_ylabel(f"$|s|$ {TALL_TEXT}")
    second.ax.set_ylabel(rf"$\sqrt{{|s|}}$ {TALL_TEXT}")
    changing = [
        part for axis, image in zip(burst.axes, burst.images, strict=True)
        for part in (image, *axis.spines.values())
    ]  # fmt: skip
    title = burst.figure.suptitle(TALL_TEXT, fontsize=10)
    return burst, Sheet(burst.figure, [*changing, first.ax.yaxis.label, second.ax, title])


def _label_times(first: Axes, second: Axes, axes: EchoAxes) -> None:
    second.ticklabel_format(axis="x", useOffset=False)
    if axes.line_begins:
        second.set_xlabel(f"time since the {axes.line_begins} began [{axes.time.name}]")
        return
    second.set_xlabel(f"fast time since the middle of the pulse [{axes.time.name}]")
    factor = SPEED_OF_LIGHT_MPS / 2 * axes.time.size / axes.range_unit.size
    second_scale(first, factor, f"one-way range of the echo's middle [{axes.range_unit.name}]")


def plot_rings(frame: RadarFrame, snapshot_index: int = 0, floor_db: float = -60.0) -> Figure:
    """Draw a montage of all rings of a frame: radiance in decibels (the paper's Fig. 6).

    Parameters
    ----------
    frame
        Radar frame with the sampling mode "rings".
    snapshot_index
        Snapshot, from 0.
    floor_db
        Level of the lowest colour, relative to the strongest pixel [dB].

    Returns
    -------
    matplotlib.figure.Figure
        The picture.
    """
    step_m = frame.record.ring_step_m
    thumbnails, tops = [], []
    for ring in range(frame.rings):
        record, channels = frame.image(ring, snapshot_index)
        radiance = decode(record, channels).radiance
        skip = max(1, -(-radiance.shape[1] // _THUMBNAIL_PX))
        rows, cols = (n - n % skip for n in radiance.shape)
        blocks = radiance[:rows, :cols].reshape(rows // skip, skip, cols // skip, skip)
        thumbnails.append(blocks.max(axis=(1, 3)))  # maximum: a small target stays visible
        tops.append(float(radiance.max()))
    reference = max(tops) or 1.0
    columns = min(7, frame.rings)
    lines = math.ceil(frame.rings / columns)
    aspect = frame.record.height_px / frame.record.width_px
    # at least as high as the label of the colour bar
    height_in = max((1.83 * aspect + 0.22) * lines + 0.4, 2.2)
    figure = new_figure(2.0 * columns + 0.8, height_in)
    figure.set_layout_engine("compressed")  # pictures keep their shape, without gaps between them
    axes = figure.subplots(lines, columns, squeeze=False)
    for ring, axis in enumerate(axes.ravel()):
        axis.set_axis_off()
        if ring < frame.rings:
            if tops[ring] <= 0:
                say_empty(axis, "0.6", 7)
            level = power_to_db(thumbnails[ring], reference, floor_db)
            axis.imshow(level, vmin=floor_db, vmax=0, cmap="magma")
            axis.set_title(f"{ring * step_m:g}-{(ring + 1) * step_m:g} m", fontsize=7, pad=2)
    bar = figure.colorbar(axes.flat[0].images[0], ax=axes, fraction=0.02)
    bar.set_label("radiance\n[dB re strongest pixel]", fontsize=8)
    later = ""
    if snapshot_index:
        later = f", second snapshot, {frame.record.snapshot_interval_s:g} s later"
    figure.suptitle(f"Rings, frame {frame.number}, t = {frame.time_s:.4g} s{later}", fontsize=10)
    return figure
