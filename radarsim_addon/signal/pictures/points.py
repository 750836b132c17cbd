# SPDX-License-Identifier: GPL-3.0-or-later
"""Picture of a point cloud: targets of an array seen from above, and their elevations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..detection import DirectedDetection
from .figure import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Area of a point in the picture at 10 dB, and for each dB above [points^2].
_LEAST_AREA, _AREA_PER_DB = 12.0, 2.0
#: Names are written at so many of the strongest points.
_NAMED = 8


def plot_points(
    points: Sequence[DirectedDetection], title: str, fastest_mps: float, elevations: bool
) -> Figure:
    """Draw the targets of an array: from above and, where it measures elevations, from the side.

    Colours are range rates up to `fastest_mps`, areas grow with the SNR in dB. The radar is at the
    lower end of the upper picture, at the left of the lower one.
    """
    figure = new_figure(8, 9 if elevations else 7)
    if elevations:
        above, side = figure.subplots(2, 1, height_ratios=[3, 1])
    else:
        above, side = figure.add_subplot(), None
    area = [_LEAST_AREA + _AREA_PER_DB * max(one.snr_db - 10, 0) for one in points]
    rate = [one.velocity_mps for one in points]
    style = {"c": rate, "s": area, "cmap": "coolwarm", "vmin": -fastest_mps, "vmax": fastest_mps}
    style |= {"edgecolors": "black", "linewidths": 0.4}
    forward, left, up = np.array([[one.x_m, one.y_m, one.z_m] for one in points]).reshape(-1, 3).T
    drawn = above.scatter(-left, forward, **style)
    above.plot(0, 0, "k^", markersize=9)
    for one in points[:_NAMED]:
        if one.name:
            above.annotate(
                one.name, (-one.y_m, one.x_m), (5, 5), textcoords="offset points", fontsize=7
            )
    above.set_aspect("equal", adjustable="datalim")
    above.set_xlabel("right of the radar [m]")
    above.set_ylabel("ahead of the radar [m]")
    above.set_title(title, fontsize=10)
    above.grid(alpha=0.3)
    figure.colorbar(drawn, ax=above, label="range rate, receding positive [m/s]")
    if side is not None:
        side.scatter(forward, up, **style)
        side.plot(0, 0, "k>", markersize=9)
        side.set_xlabel("ahead of the radar [m]")
        side.set_ylabel("above the radar [m]")
        side.grid(alpha=0.3)
    return figure
