# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of antenna patterns (cuts through the peak) and of coverage diagrams."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, cast

import numpy as np

from ...arrays import Real
from ...physics.antennas import angles_from_direction
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..radar import (
    Coverage,
    CoverageCurve,
    PeakedAntenna,
    RadarSystem,
    cut_dbi,
    half_power_width_rad,
    peak_direction,
)
from .figure import fixed, new_figure, range_unit, with_minus

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
COVERAGE_PICTURE = "coverage.png"
#: Levels that are drawn, over that of free space [dB].
_LEAST_DB, _MOST_DB = -40.0, 12.5


def plot_antennas(system: RadarSystem) -> Figure:
    """Draw cuts through the peak of both antennas, around the beam and over the full circle."""
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


def decibels(power: Real) -> Real:
    """Return powers in decibels, NaN where there is none."""
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10(power))


def plot_coverage(found: Coverage, curve: CoverageCurve) -> Figure:
    """Draw a coverage diagram.

    Left: the pattern-propagation factor F^4 over range and height, with the line on which the echo
    is as strong as at the last range in free space. Right: the curve at one range, and the flat
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
    """Draw the line of equal echoes, and that below which rays do not hold."""
    free_db = 40 * np.log10(found.range_m[-1] / found.range_m)
    echo_db = level_db + free_db
    if np.nanmin(echo_db) < 0 < np.nanmax(echo_db):
        axes.contour(x, found.height_m, echo_db, levels=[0.0], colors="white", linewidths=1)
    close = np.asarray(found.zone > 0, dtype=np.float64)
    if 0 < close.mean() < 1:
        axes.contour(
            x, found.height_m, close, levels=[0.5], colors="black", linestyles="--", linewidths=1
        )
