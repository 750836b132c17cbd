# SPDX-License-Identifier: GPL-3.0-or-later
"""Antenna patterns: peak, beamwidths, and a picture of the cuts through the peak."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, cast

import numpy as np

from ...physics.antennas import angles_from_direction
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..radar import PeakedAntenna, RadarSystem, cut_dbi, half_power_width_rad, peak_direction
from .figure import new_figure
from .numbers import fixed, with_minus

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.projections.polar import PolarAxes

ANTENNA_PICTURE = "antennas.png"
#: Lower levels relative to the peak are not drawn [dB].
_DYNAMICS_DB = 60.0
#: Room for the legend above the peak [dB].
_HEADROOM_DB = 12.0
#: Cuts are drawn this many half-power beamwidths to each side, at most the full circle.
_BEAMWIDTHS = 12.0


def plot_antennas(system: RadarSystem) -> Figure:
    """Draw cuts through the peak of both antennas, around the beam and over the full circle.

    Parameters
    ----------
    system
        Link budget with the antennas at a wavelength.

    Returns
    -------
    matplotlib.figure.Figure
        The picture.
    """
    figure = new_figure(11, 8)
    for row, (title, antenna) in enumerate(
        (("Transmitter", system.transmitter), ("Receiver", system.receiver))
    ):
        near = figure.add_subplot(2, 2, 2 * row + 1)
        round_ = cast("PolarAxes", figure.add_subplot(2, 2, 2 * row + 2, projection="polar"))
        _draw(near, round_, antenna, title)
    figure.suptitle(
        f"Antennas at {SPEED_OF_LIGHT_MPS / system.wavelength_m / 1e9:.6g} GHz: gain over "
        "isotropic, cuts through the peak",
        fontsize=11,
    )
    return figure


def _draw(near: Axes, round_: PolarAxes, antenna: PeakedAntenna, title: str) -> None:
    peak_dbi = 10 * math.log10(antenna.peak_gain)
    widths = {plane: half_power_width_rad(antenna, plane) for plane in ("azimuth", "elevation")}
    through = peak_direction(antenna)
    centres = [abs(float(angle)) for angle in angles_from_direction(through)]
    reach = min(_BEAMWIDTHS * max(widths.values()) + max(centres), math.pi)
    all_round = np.linspace(-math.pi, math.pi, 7201)
    for plane, width in widths.items():
        angle = np.linspace(-reach, reach, 4001)
        label = (
            plane if width >= 2 * math.pi else f"{plane}: {math.degrees(width):.3g}° wide at −3 dB"
        )
        # both are visible where they are equal
        style = "-" if plane == "azimuth" else "--"
        near.plot(np.degrees(angle), cut_dbi(antenna, angle, plane, through), style, label=label)
        cut = np.maximum(cut_dbi(antenna, all_round, plane, through), peak_dbi - _DYNAMICS_DB)
        round_.plot(all_round, cut, style, linewidth=0.8)
    at = [fixed(math.degrees(angle), 1) for angle in angles_from_direction(through)]
    where = "" if at == ["0.0", "0.0"] else with_minus(f" at azimuth {at[0]}°, elevation {at[1]}°")
    near.set_title(with_minus(f"{title}: peak {fixed(peak_dbi, 2)} dBi{where}"), fontsize=10)
    near.set_xlabel("azimuth (right is positive) or elevation (up is positive) [°]")
    near.set_ylabel("gain [dBi]")
    near.set_ylim(peak_dbi - _DYNAMICS_DB, peak_dbi + _HEADROOM_DB)
    near.set_xlim(-math.degrees(reach), math.degrees(reach))
    near.grid(alpha=0.3)
    near.legend(fontsize=8, loc="upper right")
    round_.set_theta_zero_location("N")
    round_.set_theta_direction(-1)
    round_.set_rlim(peak_dbi - _DYNAMICS_DB, peak_dbi + 3)
    # circles every 20 dB below the peak, their numbers behind the antenna
    circles = [peak_dbi - down for down in (0.0, 20.0, 40.0)]
    texts = [with_minus(f"{fixed(level, 1)} dBi") for level in circles]
    round_.set_rgrids(
        circles, texts, angle=157.5, fontsize=7, ha="center",
        bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.8},
    )  # fmt: skip
    degrees = range(-135, 181, 45)
    round_.set_thetagrids(
        [angle % 360 for angle in degrees], [with_minus(f"{angle}°") for angle in degrees]
    )
    round_.set_title("full circle", fontsize=10)
