# SPDX-License-Identifier: GPL-3.0-or-later
"""Antenna patterns for people: peak, beamwidths, and a picture of the cuts through the peak."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contract import PRODUCTS_DIR, SystemRecord
from ..errors import ConfigError
from ..physics.antennas import Antenna, angles_from_direction, direction_from_angles
from ..physics.constants import SPEED_OF_LIGHT_MPS
from . import plots
from .figuretext import fixed, with_minus
from .files import make_folder
from .frames import open_run
from .system import RadarSystem, make_system, read_system

Real = NDArray[np.float64]

ANTENNA_PICTURE = "antennas.png"
#: Below the peak by more than this is not drawn [dB].
_DYNAMICS_DB = 60.0
#: Room for the legend above the peak [dB].
_HEADROOM_DB = 12.0
#: Cuts are drawn this many half-power beamwidths to each side, where that is less than all round.
_BEAMWIDTHS = 12.0


def peak_direction(antenna: Antenna) -> Real:
    """Direction of the largest gain, (3,): a coarse search over the sphere, then finer ones."""
    centre, reach = (0.0, 0.0), np.pi
    for _ in range(12):
        azimuth = centre[0] + np.linspace(-reach, reach, 81)
        elevation = np.clip(centre[1] + np.linspace(-reach, reach, 81) / 2, -np.pi / 2, np.pi / 2)
        grid = np.meshgrid(azimuth, elevation, indexing="ij")
        gain = antenna.gain(direction_from_angles(*grid))
        # Among equals the one nearest to boresight: an isotropic antenna has no peak.
        near = gain * (1 - 1e-9 * (grid[0] ** 2 + grid[1] ** 2))
        best = np.unravel_index(np.argmax(near), gain.shape)
        centre, reach = (float(grid[0][best]), float(grid[1][best])), reach / 3
    return direction_from_angles(*centre)


def cut_dbi(antenna: Antenna, angle_rad: Real, plane: str, through: Real | None = None) -> Real:
    """Gain in a plane [dBi]: "azimuth" (one elevation) or "elevation" (one azimuth).

    Parameters
    ----------
    antenna
        Pattern.
    angle_rad
        Azimuths or elevations, all round, -pi to pi; elevations beyond 90 degrees go on behind.
    plane
        Which angle runs.
    through
        Direction that gives the other angle, (3,); None: boresight.
    """
    azimuth, elevation = angles_from_direction([0.0, 0.0, -1.0] if through is None else through)
    if plane == "azimuth":
        directions = direction_from_angles(angle_rad, np.full_like(angle_rad, elevation))
    else:
        level = direction_from_angles(azimuth, 0.0)
        directions = np.cos(angle_rad)[:, None] * level
        directions[:, 1] = np.sin(angle_rad)
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10(antenna.gain(directions)), dtype=np.float64)


def half_power_width_rad(antenna: Antenna, plane: str) -> float:
    """Full width at half power of the cut through the peak; 2 pi where it never falls so far."""
    angle = np.linspace(-math.pi, math.pi, 72001)
    gain = cut_dbi(antenna, angle, plane, peak_direction(antenna))
    peak = int(np.argmax(gain - 1e-9 * np.abs(angle)))
    low = gain < gain[peak] - 10 * math.log10(2)
    right = np.flatnonzero(low[peak:])
    left = np.flatnonzero(low[peak::-1])
    if not right.size or not left.size:
        return 2 * math.pi
    return float((right[0] + left[0]) * (angle[1] - angle[0]))


def plot_antennas(system: RadarSystem) -> Any:
    """Cuts of both antennas, in a frame that fits the beam and all round, as a Figure."""
    figure = plots.new_figure(11, 8)
    for row, (title, antenna) in enumerate(
        (("Transmitter", system.transmitter), ("Receiver", system.receiver))
    ):
        near = figure.add_subplot(2, 2, 2 * row + 1)
        round_ = figure.add_subplot(2, 2, 2 * row + 2, projection="polar")
        _draw(near, round_, antenna, title)
    figure.suptitle(
        f"Antennas at {SPEED_OF_LIGHT_MPS / system.wavelength_m / 1e9:.6g} GHz: gain over "
        "isotropic, cuts through the peak",
        fontsize=11,
    )
    return figure


def _draw(near: Any, round_: Any, antenna: Any, title: str) -> None:
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
        # where both are the same, both are seen
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
    round_.set_title("all round", fontsize=10)


def add_antennas_parser(commands: Any) -> None:
    """Add the command to an argparse collection of commands."""
    parser = commands.add_parser("antennas", help="picture of the antennas' patterns")
    parser.add_argument("source", metavar="DIR|FILE", help="folder of a run, or a system file")
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="where the picture goes; else DIR/products of a run, the folder of a system file",
    )
    parser.add_argument("--carrier-ghz", type=float, help="carrier, for a system file")


def print_antennas(source: str, out: str | None, carrier_ghz: float | None) -> int:
    """Draw the antennas of a run or of a system file; returns the exit code.

    Parameters
    ----------
    source
        Folder of a run, or a system file.
    out
        Folder for the picture, made where missing; None: where the run's products are
        (``antennas.png``, as processing names it), or beside the file, under its name.
    carrier_ghz
        Carrier [GHz]; None: the run's.

    Raises
    ------
    ConfigError
        No system, or no carrier.
    """
    path = Path(source)
    record: SystemRecord | None
    if path.is_dir():
        run = open_run(path)
        record, wavelength_m = run.record.system, run.radar.waveform.wavelength_m
        place, name = path / PRODUCTS_DIR, ANTENNA_PICTURE
        if record is None:
            raise ConfigError(f"{path} is a run without a system; give a system file instead.")
    else:
        record, wavelength_m = read_system(path), math.nan
        place, name = path.parent, f"{path.stem}_{ANTENNA_PICTURE}"
    if carrier_ghz is not None:
        wavelength_m = SPEED_OF_LIGHT_MPS / (carrier_ghz * 1e9)
    if not wavelength_m > 0:
        given = "No carrier" if carrier_ghz is None else f"Carrier of {carrier_ghz:g} GHz"
        raise ConfigError(f"{given}: a system file holds none, give --carrier-ghz, above 0.")
    system = make_system(record, wavelength_m)
    folder = make_folder(place if out is None else Path(out))
    target = plots.save(plot_antennas(system), folder / name)
    for end, antenna in (("transmitter", system.transmitter), ("receiver", system.receiver)):
        widths = [math.degrees(half_power_width_rad(antenna, p)) for p in ("azimuth", "elevation")]
        print(
            f"{end:12} peak {10 * math.log10(antenna.peak_gain):7.2f} dBi   half-power beamwidth "
            f"{widths[0]:.3g} x {widths[1]:.3g} degrees"
        )
    print(f"wrote {target}")
    return 0
