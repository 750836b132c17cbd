# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the results. matplotlib is imported when the first one is made, and never pyplot.

Each function returns a matplotlib Figure: a notebook shows it, :func:`save` writes it.
"""

from __future__ import annotations

import functools
import importlib
import importlib.util
import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MissingDependencyError
from .compress import Compressed, PowerProfile
from .decode import decode
from .detect import LeadingEdge, Peak
from .detections import Detection
from .echoes import Echoes
from .files import replaced
from .frames import RadarFrame
from .rangedoppler import RangeDopplerMap, decibels
from .uncertainty import ExpectedPower

#: Stated beside every Doppler axis.
SIGN_TEXT = r"$f_D=-2v/\lambda$: receding ($v>0$) on the left"
#: What a row of samples is, by kind of waveform.
_LINE_BEGINS = {"fmcw": "ramp", "stepped": "ramp of steps", "pmcw": "code"}
#: Widest picture of one ring in the montage [px].
_THUMBNAIL_PX = 480


def has_matplotlib() -> bool:
    """Whether pictures can be made."""
    return importlib.util.find_spec("matplotlib") is not None


def new_figure(width_in: float, height_in: float) -> Any:
    """An empty figure that belongs to nobody's pyplot.

    Raises
    ------
    MissingDependencyError
        matplotlib is not installed.
    """
    if not has_matplotlib():
        raise MissingDependencyError(
            "matplotlib is not installed; it draws the pictures. Install it with "
            "'pip install matplotlib', or process without plots."
        )
    # A Figure of its own: no window system, no state shared with the caller's pyplot.
    figure = _figure_class()(figsize=(width_in, height_in), layout="constrained")
    importlib.import_module("matplotlib.backends.backend_agg").FigureCanvasAgg(figure)
    return figure


@functools.cache
def _figure_class() -> Any:
    """matplotlib's Figure that a notebook shows by itself, without pyplot."""

    def as_png(figure: Any) -> bytes:
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=100)
        return stream.getvalue()

    base = importlib.import_module("matplotlib.figure").Figure
    return type("Figure", (base,), {"_repr_png_": as_png})


def save(figure: Any, path: str | Path, dpi: int = 120) -> Path:
    """Write a figure as PNG under a temporary name, then rename."""
    path = Path(path)
    with replaced(path) as temporary:
        figure.savefig(temporary, dpi=dpi, format="png")
    return path


def plot_rings(frame: RadarFrame, pass_index: int = 0, floor_db: float = -60.0) -> Any:
    """Montage of all rings of a frame: radiance in decibels (the paper's Fig. 6)."""
    step_m = frame.record.ring_step_m
    thumbnails, tops = [], []
    for ring in range(frame.rings):
        record, channels = frame.image(ring, pass_index)
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
    figure = new_figure(2.0 * columns + 0.8, (2.0 * aspect + 0.35) * lines + 0.8)
    axes = figure.subplots(lines, columns, squeeze=False)
    picture = None
    for ring, axis in enumerate(axes.ravel()):
        axis.set_axis_off()
        if ring < frame.rings:
            level = decibels(thumbnails[ring], reference, floor_db)
            picture = axis.imshow(level, vmin=floor_db, vmax=0, cmap="magma")
            axis.set_title(f"{ring * step_m:g}-{(ring + 1) * step_m:g} m", fontsize=7, pad=2)
    figure.colorbar(picture, ax=axes, label="radiance [dB re strongest pixel]", fraction=0.02)
    when = "t" if pass_index == 0 else r"t + $\Delta$t"
    figure.suptitle(f"Rings of frame {frame.number} at {when}", fontsize=10)
    return figure


def _range_extent(range_m: Any) -> tuple[float, float]:
    """Outer edges of the first and last cell."""
    half = (range_m[1] - range_m[0]) / 2 if len(range_m) > 1 else 0.5
    return float(range_m[0] - half), float(range_m[-1] + half)


def plot_echo(echoes: Echoes, title: str = "Raw echo") -> Any:
    """Magnitude and real part of the echoes, pulse against fast time (the paper's Fig. 7)."""
    figure = new_figure(10, 6)
    first, second = figure.subplots(2, 1, sharex=True)
    times_us = echoes.fast_time_s * 1e6
    left, right = _range_extent(times_us)
    extent = (left, right, -0.5, echoes.samples.shape[0] - 0.5)
    common = {"aspect": "auto", "origin": "lower", "extent": extent, "interpolation": "nearest"}
    magnitude = np.abs(echoes.samples)
    top = float(magnitude.max())
    unit = r"$\sqrt{W}$" if echoes.weighting == "radar-equation" else r"$B\,r^2$"
    level = decibels(magnitude**2, top**2 or 1.0, -60)
    picture = first.imshow(level, vmin=-60, vmax=0, cmap="viridis", **common)
    figure.colorbar(picture, ax=first, label="|s| [dB re strongest]")
    # echoes fall with the square of range: scale the real part so that far ones show too
    limit = float(np.quantile(magnitude, 0.95)) or top or 1.0
    picture = second.imshow(echoes.samples.real, vmin=-limit, vmax=limit, cmap="RdBu_r", **common)
    figure.colorbar(picture, ax=second, label=f"Re s [{unit}], clipped at 95 %")
    for axis in (first, second):
        axis.set_ylabel(f"pulse (PRF {echoes.radar.burst.prf_hz:g} Hz)")
    if echoes.radar.waveform.family == "line":
        # each sample holds the echoes of all ranges
        second.set_xlabel(f"time since the {_LINE_BEGINS[echoes.radar.waveform.kind]} began [µs]")
    else:
        second.set_xlabel("fast time since the middle of the pulse [µs]")
        metres = 299.792458 / 2
        top_axis = first.secondary_xaxis(
            "top", functions=(lambda t: t * metres, lambda r: r / metres)
        )
        top_axis.set_xlabel("one-way range of the echo's middle [m]")
    figure.suptitle(title, fontsize=10)
    return figure


def plot_matched_filter(
    compressed: Compressed | None = None,
    profile: PowerProfile | None = None,
    edges: Sequence[LeadingEdge] = (),
    title: str = "Matched filter",
    floor_db: float = -80.0,
    reference_ranges_m: Sequence[float] = (),
    expected: ExpectedPower | None = None,
) -> Any:
    """Compressed power in decibels against range (the paper's Fig. 8).

    Parameters
    ----------
    compressed
        Coherent output: the mean over the pulses of |.|^2 is drawn.
    profile
        Expected power, without speckle.
    edges
        Leading edges to mark.
    title, floor_db
        Title; lowest level drawn, below the strongest.
    reference_ranges_m
        True ranges, drawn as dashed lines.
    expected
        Expected power with its standard error, drawn as a band of one sigma to each side.
    """
    figure = new_figure(10, 4.5)
    axis = figure.subplots()
    tops = []
    if compressed is not None:
        coherent = np.mean(np.abs(compressed.values) ** 2, axis=0)
        tops.append(float(coherent.max()))
    if profile is not None:
        tops.append(float(profile.power.max()))
    reference = max(tops, default=0.0) or 1.0
    if compressed is not None:
        level = decibels(coherent, reference, floor_db)
        axis.plot(
            compressed.range_m,
            level,
            lw=0.6,
            color="0.6",
            label=f"coherent, mean of pulses ({compressed.window})",
        )
    if profile is not None:
        axis.plot(
            profile.range_m,
            decibels(profile.power, reference, floor_db),
            lw=1.2,
            color="C0",
            label=f"expected power, no speckle ({profile.window})",
        )
    if expected is not None and np.isfinite(expected.profile_error).all():
        band = [
            decibels(np.maximum(value, 0.0), reference, floor_db)
            for value in (
                expected.profile - expected.profile_error,
                expected.profile + expected.profile_error,
            )
        ]
        axis.fill_between(
            expected.range_m, *band, color="C0", alpha=0.3, lw=0, label="one standard error"
        )
    for edge in edges:
        half_db = edge.level_db - 10 * math.log10(2 * reference)
        axis.plot(edge.range_m, half_db, "v", color="C3", ms=6)
        axis.annotate(
            f"{edge.range_m:.1f} m",
            (edge.range_m, half_db),
            fontsize=8,
            xytext=(-4, 6),
            textcoords="offset points",
            ha="right",
            color="C3",
        )
    for number, value in enumerate(reference_ranges_m):
        axis.axvline(
            value,
            ls="--",
            lw=0.8,
            color="C2",
            zorder=0,
            label="true near face" if number == 0 else None,
        )
    source = compressed if compressed is not None else profile
    if source is not None and source.range_m.size > 1:
        axis.set_xlim(float(source.range_m[0]), float(source.range_m[-1]))
    axis.set_ylim(floor_db, 8)
    axis.set_xlabel("one-way range [m]")
    axis.set_ylabel("power [dB re strongest]")
    axis.grid(alpha=0.3)
    if edges:
        axis.plot([], [], "v", color="C3", label="half-power leading edge")
    axis.legend(fontsize=8, loc="best")
    axis.set_title(title, fontsize=10)
    return figure


def plot_range_doppler(
    rd_map: RangeDopplerMap,
    peaks: Sequence[Peak] = (),
    title: str = "Range-Doppler map",
    floor_db: float = -80.0,
    *,
    targets: Sequence[Detection] = (),
) -> Any:
    """Map in decibels, Doppler below and range rate above it (the paper's Fig. 9).

    `peaks` are circled and written out; `targets` of a CFAR are circled, the strongest three
    written out. With targets the scale begins a little below the weakest one's surroundings.
    """
    if targets:
        top_db = float(decibels(rd_map.power).max())
        floor_db = max(floor_db, min(t.noise_db for t in targets) - 10 - top_db)
        floor_db = min(floor_db, -20.0)
    figure = new_figure(8, 6.5)
    axis = figure.subplots()
    power = rd_map.power
    left, right = _range_extent(rd_map.doppler_hz)
    bottom, top = _range_extent(rd_map.range_m)
    picture = axis.imshow(
        decibels(power, float(power.max()) or 1.0, floor_db).T,
        aspect="auto",
        origin="lower",
        extent=(left, right, bottom, top),
        vmin=floor_db,
        vmax=0,
        cmap="viridis",
        interpolation="nearest",
    )
    figure.colorbar(picture, ax=axis, label="power [dB re strongest cell]")
    axis.set_xlabel(f"Doppler [Hz]      {SIGN_TEXT}")
    axis.set_ylabel("one-way range [m]")
    factor = -rd_map.radar.waveform.wavelength_m / 2
    upper = axis.secondary_xaxis("top", functions=(lambda f: f * factor, lambda v: v / factor))
    upper.set_xlabel("range rate v [m/s]")
    for target in targets:
        axis.plot(target.doppler_hz, target.range_m, "o", mfc="none", mec="C1", ms=9)
    if targets:
        axis.plot([], [], "o", mfc="none", mec="C1", ms=9, ls="", label=f"CFAR: {len(targets)}")
        axis.legend(fontsize=8, loc="upper right")
    marked: list[Peak | Detection] = [*peaks, *targets[:3]]
    for peak in marked:
        axis.plot(peak.doppler_hz, peak.range_m, "o", mfc="none", mec="w", ms=12)
        on_left = peak.doppler_hz < (left + right) / 2
        axis.annotate(
            f"{peak.range_m:.1f} m\n{peak.velocity_mps:+.2f} m/s\n{peak.doppler_hz:.1f} Hz",
            (peak.doppler_hz, peak.range_m),
            color="w",
            fontsize=8,
            va="center",
            xytext=(10 if on_left else -10, 0),
            textcoords="offset points",
            ha="left" if on_left else "right",
        )
    axis.set_title(title, fontsize=10)
    return figure
