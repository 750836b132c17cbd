# SPDX-License-Identifier: GPL-3.0-or-later
"""Picture of a range-Doppler map: levels, targets, numbers of the strongest. Spectrogram and
clutter.

Levels are in decibels over the strongest cell. Colours begin 10 dB below the noise where that is
known; otherwise 80 dB below the strongest cell, or higher if more than half of the map is noise.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import Real
from ..detection import Detection, Peak, target_count, velocity_before_folding_mps
from ..maps import ExpectedPower, RangeDopplerMap, Spectrogram, power_to_db
from ..radar import Radar
from .figure import (
    MOST_CELLS,
    TALL_TEXT,
    CellAxis,
    Sheet,
    Unit,
    cell_axis,
    cell_image,
    cell_width,
    decimals_for,
    fixed,
    frequency_unit,
    lay_out,
    list_texts,
    new_figure,
    number_points,
    range_unit,
    reference_text,
    say_empty,
    second_scale,
    speed_unit,
    strongest,
    time_unit,
    with_minus,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage


#: Maximum number of labels, and of labels of stationary targets.
_LABELS, _STILL_LABELS = 5, 2
#: A peak this far below a labelled one at its Doppler or range may be its sidelobe [dB].
_SHADOW_DB = 25.0
#: Closer than this only the stronger target gets a label [fraction of an axis].
_NEAR = 0.03
#: Tapers widen a response to at most three cells on each side: slower targets count as stationary.
_STILL_CELLS = 3.0
#: Decibels from the strongest cell to the lowest colour of a picture without noise.
SPAN_DB = 80.0
#: With noise the colours begin this far below its mean [dB].
BELOW_NOISE_DB = 10.0
#: Smallest span of the colours [dB].
LEAST_SPAN_DB = 20.0


@dataclass(frozen=True)
class MapAxes:
    """Cells of a picture along both axes, and the units of its axes."""

    doppler: CellAxis
    ranges: CellAxis
    doppler_unit: Unit
    range_unit: Unit
    rate_unit: Unit
    #: Range rate over Doppler [m].
    rate_per_hz: float
    #: Number of rows of the map.
    pulses: int


@dataclass(frozen=True)
class ColourScale:
    """Meaning of the colours of a map."""

    #: Power of 0 dB; 0: an empty map.
    reference: float
    #: Level where the colours begin.
    floor_db: float
    #: Mean noise of a cell; 0: unknown.
    noise_power: float = 0.0
    #: Unit of the reference in decibels; "": unknown.
    unit: str = ""
    #: Name of the reference.
    of: str = "strongest cell"


def plot_range_doppler(
    rd_map: RangeDopplerMap,
    peaks: Sequence[Peak] = (),
    title: str = "Range-Doppler map",
    floor_db: float | None = None,
    *,
    targets: Sequence[Detection] = (),
    left_out: int = 0,
    noise_power: float = 0.0,
    unit: str = "",
    paper_axes: bool = False,
) -> Figure:
    """Draw a map in decibels: range upwards, range rate to the right, Doppler above.

    Parameters
    ----------
    rd_map
        Range-Doppler map.
    peaks
        Moving targets, the strongest first: circled and numbered.
    title
        Text above the axes.
    floor_db
        Level where the colours begin, relative to the strongest cell; None: see `picture_floor_db`.
    targets
        CFAR detections: all are marked, with smaller marks the more there are. Up to five numbers
        in all; peaks come first, then moving, then stationary targets.
    left_out
        Number of CFAR peaks beyond the maximum that the detector keeps.
    noise_power
        Mean thermal noise of a cell (:func:`.maps.map_noise_gain` times that of a sample), marked
        at the colour bar; 0: unknown.
    unit
        Unit of the map's powers in decibels, "dBW" with the amplitude model "radar-equation".
    paper_axes
        Doppler to the right, as in the paper's Fig. 9: receding is on the left.

    Returns
    -------
    matplotlib.figure.Figure
        The picture.
    """
    axes, scale = _of_map(rd_map, noise_power, unit, floor_db)
    figure = new_figure(8, 6.5)
    axis, _ = draw_map(figure, rd_map.plane_power, axes, scale, paper_axes)
    axis.set_title(title, fontsize=10)
    _mark_targets(axis, axes, targets, left_out)
    _number_targets(figure, axis, rd_map, axes, foremost(rd_map, peaks, targets))
    return figure


def draw_range_doppler(
    rd_map: RangeDopplerMap,
    peaks: Sequence[Peak],
    title: str,
    *,
    targets: Sequence[Detection],
    left_out: int,
    noise_power: float,
    unit: str,
) -> NDArray[np.uint8]:
    """Return the picture of `plot_range_doppler`, (height, width, 3)."""
    axes, scale = _of_map(rd_map, noise_power, unit)
    chosen = foremost(rd_map, peaks, targets)
    lines = [_label_text(item, rd_map, axes).count("\n") for item in chosen]
    parts = _sheet(axes, scale.floor_db, len(lines), max(lines, default=0))
    parts.image.set_data(joined_level(rd_map.plane_power, axes, scale))
    label_colours(parts.axis, parts.bar, scale)
    parts.axis.title.set_text(title)  # it keeps its place above the upper scale
    _mark_targets(parts.axis, axes, targets, left_out)
    _number_targets(parts.figure, parts.axis, rd_map, axes, chosen)
    return parts.sheet.picture()


class _Parts(NamedTuple):
    """A figure for maps with these axes, and its parts that change."""

    figure: Figure
    axis: Axes
    image: AxesImage
    bar: Colorbar
    sheet: Sheet


@functools.lru_cache(maxsize=8)
def _sheet(axes: MapAxes, floor_db: float, texts: int, lines: int) -> _Parts:
    """Return a sheet with room for so many texts of so many lines more than one."""
    figure = new_figure(8, 6.5)
    axis, image, bar = empty_map(figure, axes, floor_db)
    title = axis.set_title(TALL_TEXT, fontsize=10)
    bar.set_label(TALL_TEXT)
    room = list_texts(figure, [TALL_TEXT + lines * f"\n{TALL_TEXT}"] * texts) if texts else None
    changing = [image, *axis.spines.values(), title, bar.ax.yaxis.label]
    lay_out(figure)
    if room is not None:
        room.remove()
    return _Parts(figure, axis, image, bar, Sheet(figure, changing))


def _of_map(
    rd_map: RangeDopplerMap, noise_power: float, unit: str, floor_db: float | None = None
) -> tuple[MapAxes, ColourScale]:
    """Return axes and colours of a map's picture."""
    power = rd_map.plane_power
    top = float(power.max(initial=0.0))
    floor_db = picture_floor_db(power, noise_power) if floor_db is None else floor_db
    return axes_of_map(rd_map), ColourScale(top, floor_db, noise_power, unit)


def axes_of_map(rd_map: RangeDopplerMap) -> MapAxes:
    """Return the axes of a map's picture."""
    radar = rd_map.radar
    factor = -radar.waveform.wavelength_m / 2
    return map_axes(rd_map.doppler_hz, rd_map.range_m, factor, radar.burst.prf_hz)


def _mark_targets(axis: Axes, axes: MapAxes, targets: Sequence[Detection], left_out: int) -> None:
    """Draw circles where CFAR found targets, and the legend."""
    if not targets:
        return
    size, width = (8.0, 1.0) if len(targets) <= 20 else (5.0, 0.8)
    if len(targets) > 60:
        size, width = 2.5, 0.5
    axis.plot(
        *zip(*(_place(item, axes) for item in targets), strict=True),
        "o", ls="", mfc="none", mec="C1", ms=size, mew=width,
        label=f"CFAR: {target_count(len(targets), left_out)}",
    )  # fmt: skip
    axis.legend(fontsize=8, loc="upper right", markerscale=max(5 / size, 1.0))


def _number_targets(
    figure: Figure,
    axis: Axes,
    rd_map: RangeDopplerMap,
    axes: MapAxes,
    chosen: Sequence[Peak | Detection],
) -> None:
    spots = [_place(item, axes) for item in chosen]
    for spot in spots:
        axis.plot(*spot, "o", mfc="none", mec="w", ms=9, mew=1.0)
    number_points(figure, axis, spots, [_label_text(item, rd_map, axes) for item in chosen])


def _place(item: Peak | Detection, axes: MapAxes) -> tuple[float, float]:
    return item.doppler_hz / axes.doppler_unit.size, item.range_m / axes.range_unit.size


def _label_text(item: Peak | Detection, rd_map: RangeDopplerMap, axes: MapAxes) -> str:
    """Return range, range rate and Doppler as text, with the digits that the cells support."""
    length, rate, hertz = axes.range_unit, axes.rate_unit, axes.doppler_unit
    step_m, step_hz = cell_width(rd_map.range_m), cell_width(rd_map.doppler_hz)
    text = fixed(item.range_m / length.size, decimals_for(step_m / length.size)) + f" {length.name}"
    if axes.pulses == 1:
        return text
    speed_digits = decimals_for(step_hz * abs(axes.rate_per_hz) / rate.size)
    speed = fixed(item.velocity_mps / rate.size, speed_digits, signed=True)
    doppler = fixed(item.doppler_hz / hertz.size, decimals_for(step_hz / hertz.size), signed=True)
    lines = [text, f"{speed} {rate.name}"]
    true_mps = velocity_before_folding_mps(item)
    if true_mps is not None:
        lines.append(f"true {fixed(true_mps / rate.size, speed_digits, signed=True)} {rate.name}")
    if float(doppler):
        lines.append(f"{doppler} {hertz.name}")
    return with_minus("\n".join(lines))


def foremost(
    rd_map: RangeDopplerMap, peaks: Sequence[Peak], targets: Sequence[Detection]
) -> list[Peak | Detection]:
    """Choose the targets to label: peaks, then moving targets, then stationary ones.

    Each group is sorted by falling level. Targets next to a labelled one get no label, nor those
    25 dB below one at its Doppler or range, where its sidelobes are.
    """
    cell_m, cell_hz = cell_width(rd_map.range_m), cell_width(rd_map.doppler_hz)
    chosen: list[Peak | Detection] = list(peaks[:_LABELS])
    moving = [t for t in targets if abs(t.doppler_hz) >= _STILL_CELLS * cell_hz > 0]
    still = [t for t in targets if not abs(t.doppler_hz) >= _STILL_CELLS * cell_hz > 0]
    for group, most in ((moving, _LABELS), (still, _STILL_LABELS)):
        left = most
        for target in sorted(group, key=lambda item: -item.level_db):
            if len(chosen) >= _LABELS or not left:
                break
            if not any(
                _hidden(target, other, cell_hz, cell_m, rd_map.plane.shape) for other in chosen
            ):
                chosen.append(target)
                left -= 1
    return chosen


def _hidden(
    item: Detection,
    other: Peak | Detection,
    cell_hz: float,
    cell_m: float,
    shape: tuple[int, ...],
) -> bool:
    """Return whether a target is the other one, or may be its sidelobe."""
    apart_hz = abs(item.doppler_hz - other.doppler_hz)
    apart_m = abs(item.range_m - other.range_m)
    near_hz, near_m = (
        max(guard * cell, _NEAR * cell * count)
        for guard, cell, count in zip((4, 8), (cell_hz, cell_m), shape, strict=True)
    )
    if apart_hz <= near_hz and apart_m <= near_m:
        return True
    aligned = apart_hz <= 2 * cell_hz or apart_m <= 4 * cell_m
    return aligned and item.level_db < other.level_db - _SHADOW_DB


def map_axes(doppler_hz: Real, range_m: Real, rate_per_hz: float, prf_hz: float = 0.0) -> MapAxes:
    """Return the axes of a picture from the centres of a map's cells, evenly spaced [Hz] and [m].

    `rate_per_hz` is -lambda / 2 [m], `prf_hz` the width of the one cell of a single pulse; 0: 1 Hz.
    """
    fastest_hz = float(np.abs(doppler_hz).max())
    hertz, length = frequency_unit(fastest_hz), range_unit(float(np.abs(range_m).max()))
    return MapAxes(
        cell_axis(doppler_hz, MOST_CELLS, hertz.size, prf_hz or 1.0),
        cell_axis(range_m, MOST_CELLS, length.size),
        hertz,
        length,
        speed_unit(fastest_hz * abs(rate_per_hz)),
        rate_per_hz,
        doppler_hz.size,
    )


def joined_level(power: Real, axes: MapAxes, scale: ColourScale) -> Real:
    """Return the level of each drawn cell, (ranges, Doppler) [dB]; the strongest of joined ones."""
    cells = strongest(power, (axes.doppler.step, axes.ranges.step))
    return power_to_db(cells, scale.reference or 1.0, scale.floor_db).T


def floor_db_of(top: float, median: float, noise_power: float = 0.0) -> float:
    """Return the level at which the colours of a map begin [dB], a multiple of 5 dB.

    With a known noise power, the colours begin `BELOW_NOISE_DB` below the noise. Without it, they
    begin at -`SPAN_DB`. If more than half of the map is noise, and its mean is higher than that,
    they begin `BELOW_NOISE_DB` below the mean. For noise of an exponential law the mean is the
    median over ln 2.
    """
    floor_db, middle = -SPAN_DB, median / math.log(2)
    if top > 0 and noise_power > 0:
        floor_db = 10 * math.log10(noise_power / top) - BELOW_NOISE_DB
    elif top > 0 and middle > 0:
        floor_db = max(floor_db, 10 * math.log10(middle / top) - BELOW_NOISE_DB)
    return min(5.0 * math.floor(floor_db / 5), -LEAST_SPAN_DB)


def picture_floor_db(power: Real, noise_power: float = 0.0) -> float:
    """Return `floor_db_of` for the power of one map, (Doppler, ranges)."""
    return floor_db_of(float(power.max(initial=0.0)), float(np.median(power)), noise_power)


def draw_map(
    figure: Figure, power: Real, axes: MapAxes, scale: ColourScale, paper_axes: bool = False
) -> tuple[Axes, AxesImage]:
    """Draw a map (Doppler, ranges) into an empty figure; return its axes and image."""
    axis, image, bar = empty_map(figure, axes, scale.floor_db, paper_axes)
    image.set_data(joined_level(power, axes, scale))
    label_colours(axis, bar, scale)
    return axis, image


def empty_map(
    figure: Figure, axes: MapAxes, floor_db: float, paper_axes: bool = False
) -> tuple[Axes, AxesImage, Colorbar]:
    """Draw the axes of a map into an empty figure; return them with image and colour bar."""
    axis = figure.subplots()
    image = cell_image(axis, axes.doppler, axes.ranges, cmap="viridis", vmin=floor_db, vmax=0)
    bar = figure.colorbar(image, ax=axis, pad=0.02)
    _label_axes(axis, axes, paper_axes)
    return axis, image, bar


def label_colours(axis: Axes, bar: Colorbar, scale: ColourScale) -> None:
    if not scale.reference > 0:
        bar.set_label("power [dB]")
        say_empty(axis, "white")
        return
    bar.set_label(f"power [dB re {scale.of}{reference_text(scale.reference, scale.unit)}]")
    if scale.noise_power > 0:
        noise_db = 10 * math.log10(scale.noise_power / scale.reference)
        bar.ax.axhline(noise_db, color="white", lw=1.2)
        bar.ax.annotate(
            "noise", (0.5, noise_db), xycoords=("axes fraction", "data"), xytext=(0, 2),
            textcoords="offset points", ha="center", va="bottom", fontsize=7, color="white",
        )  # fmt: skip


def _label_axes(axis: Axes, axes: MapAxes, paper_axes: bool) -> None:
    """Label range, range rate and Doppler. The data coordinates are range and Doppler."""
    axis.set_ylabel(f"one-way range [{axes.range_unit.name}]")
    axis.ticklabel_format(useOffset=False)
    if axes.pulses == 1:
        axis.set_xticks([])
        axis.set_xlabel("one pulse: Doppler is not resolved")
        return
    factor = axes.rate_per_hz * axes.doppler_unit.size / axes.rate_unit.size
    limit = abs(factor) * (axes.doppler.end - axes.doppler.low) / 2
    unit = axes.rate_unit.name
    rate = f"range rate $v$ [{unit}], folds at $\\pm${limit:.3g} {unit}"
    doppler = f"Doppler [{axes.doppler_unit.name}]      $f_D=-2v/\\lambda$"
    if paper_axes:
        axis.set_xlabel(f"{doppler}: receding ($v>0$) on the left")
    else:
        axis.invert_xaxis()  # receding is at negative Doppler
        axis.xaxis.tick_top()
        axis.xaxis.set_label_position("top")
        axis.set_xlabel(doppler)
    if factor:
        second_scale(axis, factor, rate, "top" if paper_axes else "bottom")


def plot_clutter(
    expected: ExpectedPower,
    radar: Radar,
    title: str = "Expected clutter",
    *,
    noise_power: float = 0.0,
    unit: str = "",
) -> Figure:
    """Draw the expected power of clutter in the range-Doppler map, without a canceller.

    Arguments as for `plot_range_doppler`.
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


def plot_spectrogram(shown: Spectrogram, title: str = "Spectrogram", unit: str = "") -> Figure:
    """Draw a spectrogram in decibels: time to the right, range rate upwards, Doppler downwards.

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
    axes, power = spectrogram_axes(shown), shown.power
    scale = ColourScale(float(power.max(initial=0.0)), picture_floor_db(power), unit=unit)
    figure = new_figure(8, 5.5)
    axis, image, bar = empty_spectrogram(figure, axes, scale.floor_db)
    cells = strongest(power, (axes.across.step, axes.up.step))
    image.set_data(power_to_db(cells, scale.reference or 1.0, scale.floor_db).T)
    label_colours(axis, bar, scale)
    axis.set_title(title, fontsize=10)
    return figure


@dataclass(frozen=True)
class SpectrogramAxes:
    """Cells of a spectrogram's picture in time and Doppler, and the units of its axes."""

    across: CellAxis
    up: CellAxis
    time_unit: Unit
    doppler_unit: Unit
    rate_unit: Unit
    #: Range rate over Doppler [m].
    rate_per_hz: float


def spectrogram_axes(shown: Spectrogram) -> SpectrogramAxes:
    """Return the axes of a spectrogram's picture."""
    fastest_hz = float(np.abs(shown.doppler_hz).max())
    rate_per_hz = -shown.radar.waveform.wavelength_m / 2
    hertz, burst = frequency_unit(fastest_hz), shown.radar.burst
    seconds = time_unit(burst.pulses / burst.prf_hz)
    window_s = shown.options.window_pulses / burst.prf_hz
    return SpectrogramAxes(
        cell_axis(shown.time_s, MOST_CELLS, seconds.size, window_s),
        cell_axis(shown.doppler_hz, MOST_CELLS, hertz.size),
        seconds,
        hertz,
        speed_unit(fastest_hz * abs(rate_per_hz)),
        rate_per_hz,
    )


def empty_spectrogram(
    figure: Figure, axes: SpectrogramAxes, floor_db: float
) -> tuple[Axes, AxesImage, Colorbar]:
    """Draw the axes of a spectrogram into an empty figure; return them with image and colour bar.

    The image has a row for each cell of Doppler.
    """
    axis = figure.subplots()
    image = cell_image(axis, axes.across, axes.up, cmap="viridis", vmin=floor_db, vmax=0)
    axis.invert_yaxis()  # range rates rise upwards
    axis.set_xlabel(f"time [{axes.time_unit.name}]")
    axis.set_ylabel(f"Doppler [{axes.doppler_unit.name}] (receding: negative)")
    factor = axes.rate_per_hz * axes.doppler_unit.size / axes.rate_unit.size
    right = axis.secondary_yaxis(
        "right", functions=(lambda y: np.multiply(y, factor), lambda y: np.divide(y, factor))
    )
    right.set_ylabel(f"range rate [{axes.rate_unit.name}]")
    return axis, image, figure.colorbar(image, ax=axis, pad=0.12)
