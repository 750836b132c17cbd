# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim antennas``: gains, beamwidths and a picture of two antennas."""

from __future__ import annotations

import math
import os
from pathlib import Path

from ...atomic_files import make_folder
from ...contract import PRODUCTS_DIR, LinkBudget
from ...errors import ConfigError
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..pictures import ANTENNA_PICTURE, plot_antennas, save_figure
from ..radar import half_power_width_rad, make_system, read_system
from ..runs import open_run
from .console import Subcommands

#: Above this a unit was mistaken: an array of wavelengths would not fit into memory.
_HIGHEST_CARRIER_GHZ = 1e4


def add_antennas_parser(commands: Subcommands) -> None:
    """Add the command to an argparse collection of commands."""
    parser = commands.add_parser(
        "antennas",
        help="picture of the antennas' patterns",
        epilog="example: radarsim antennas link_budget.json --carrier-ghz 77",
    )
    parser.add_argument("source", metavar="DIR|FILE", help="folder of a run, or a link budget file")
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="where the picture goes; else DIR/products of a run, the folder of a link budget file",
    )
    parser.add_argument("--carrier-ghz", type=float, help="carrier, for a link budget file")


def print_antennas(source: str, out: str | None, carrier_ghz: float | None) -> int:
    """Draw the antennas of a run or of a link budget file; return the exit code.

    The picture goes to `out`; None: where the run's products are (``antennas.png``, as processing
    names it), or next to the file, under its name. A carrier of None is the run's.
    """
    path = Path(source)
    record: LinkBudget | None
    if os.path.isdir(path):
        run = open_run(path)
        record, wavelength_m = run.record.link_budget, run.radar.waveform.wavelength_m
        place, name = path / PRODUCTS_DIR, ANTENNA_PICTURE
        if record is None:
            raise ConfigError(
                f"{path} is a run without a link budget; give a link budget file instead."
            )
    else:
        record, wavelength_m = read_system(path), math.nan
        place, name = path.parent, f"{path.stem}_{ANTENNA_PICTURE}"
    if carrier_ghz is not None and not 0 < carrier_ghz <= _HIGHEST_CARRIER_GHZ:
        raise ConfigError(
            f"Carrier of {carrier_ghz:g} GHz; expected above 0, at most {_HIGHEST_CARRIER_GHZ:g}. "
            "--carrier-ghz takes GHz: 77 for a carrier of 77e9 Hz."
        )
    if carrier_ghz is not None:
        wavelength_m = SPEED_OF_LIGHT_MPS / (carrier_ghz * 1e9)
    if not wavelength_m > 0:
        raise ConfigError("No carrier: a link budget file holds none, give --carrier-ghz.")
    system = make_system(record, wavelength_m)
    folder = make_folder(place if out is None else Path(out))
    target = save_figure(plot_antennas(system), folder / name)
    for end, antenna in (("transmitter", system.transmitter), ("receiver", system.receiver)):
        widths = [math.degrees(half_power_width_rad(antenna, p)) for p in ("azimuth", "elevation")]
        print(
            f"{end:12} peak {10 * math.log10(antenna.peak_gain):7.2f} dBi   half-power beamwidth "
            f"{widths[0]:.3g} x {widths[1]:.3g} degrees"
        )
    print(f"wrote {target}")
    return 0
