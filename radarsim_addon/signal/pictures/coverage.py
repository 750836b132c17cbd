# SPDX-License-Identifier: GPL-3.0-or-later
"""Picture of a coverage diagram: levels over height and range, and the curve at one range."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...array_types import Real
from ..radar import Coverage, CoverageCurve
from .figure import new_figure
from .numbers import range_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COVERAGE_PICTURE = "coverage.png"
#: Levels that are drawn, over that of free space [dB].
_LEAST_DB, _MOST_DB = -40.0, 12.5


def decibels(power: Real) -> Real:
    """Return powers in decibels, NaN where there is none."""
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10(power))


def plot_coverage(found: Coverage, curve: CoverageCurve) -> Figure:
    """Draw a coverage diagram.

    Parameters
    ----------
    found
        Diagram.
    curve
        Its curve at one range.

    Returns
    -------
    matplotlib.figure.Figure
        Left: the pattern-propagation factor F^4 over range and height, with the line on which the
        echo is as strong as at the last range in free space. Right: the curve, and the flat
        two-ray model.
    """
    figure = new_figure(13, 6.5)
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(2.2, 1))
    unit = range_unit(float(found.range_m[-1]))
    x, level_db = found.range_m / unit.size, decibels(found.factor)
    left.set_facecolor("0.75")
    mesh = left.pcolormesh(
        x, found.height_m, np.maximum(level_db, _LEAST_DB), vmin=_LEAST_DB, vmax=_MOST_DB,
        shading="nearest", cmap="viridis", rasterized=True,
    )  # fmt: skip
    if min(level_db.shape) > 1:
        _draw_lines(left, found, x, level_db)
    left.axvline(curve.range_m / unit.size, color="white", linestyle=":", linewidth=1)
    left.set_xlabel(f"range along the ground [{unit.name}]")
    left.set_ylabel("height over the ground [m]")
    left.set_title(
        "pattern-propagation factor F⁴; grey: below the horizon; below the dashed line: rays do "
        "not hold",
        fontsize=10,
    )
    figure.colorbar(mesh, ax=left, label="over free space at the peak of the antennas [dB]")
    for power, label, style in (
        (curve.factor, "F⁴", "-"),
        (curve.ground_gain, "relative to free space", "--"),
        (curve.two_ray, "flat two-ray model", ":"),
    ):
        held = np.where(curve.zone == 0, np.maximum(decibels(power), _LEAST_DB), np.nan)
        right.plot(held, found.height_m, style, label=label)
    right.set_xlim(_LEAST_DB, _MOST_DB)
    right.set_xlabel("echo [dB]")
    right.set_title(f"at {curve.range_m / unit.size:.6g} {unit.name}", fontsize=10)
    right.grid(alpha=0.3)
    right.legend(fontsize=8, loc="lower left")
    figure.suptitle(found.title, fontsize=11)
    return figure


def _draw_lines(axes: Axes, found: Coverage, x: Real, level_db: Real) -> None:
    """The line of equal echoes, and that below which rays do not hold."""
    free_db = 40 * np.log10(found.range_m[-1] / found.range_m)
    echo_db = level_db + free_db
    if np.nanmin(echo_db) < 0 < np.nanmax(echo_db):
        axes.contour(x, found.height_m, echo_db, levels=[0.0], colors="white", linewidths=1)
    close = np.asarray(found.zone > 0, dtype=np.float64)
    if 0 < close.mean() < 1:
        axes.contour(
            x, found.height_m, close, levels=[0.5], colors="black", linestyles="--", linewidths=1
        )
