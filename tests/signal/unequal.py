# SPDX-License-Identifier: GPL-3.0-or-later
"""A run of a few echoes that differ in everything: range, rate, power, rows; two antennas.

Each echo is in the middle of a cell of `FMCW`, so that numbers of neighbours follow by hand.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from radarsim_addon import contract
from radarsim_addon.signal import Burst, FmcwWaveform, Radar
from radarsim_addon.signal.paths import PathRows
from radarsim_addon.typed_json import read_record, write_record
from tests.signal import path_runs as pr

EIRP_W = 40.0
TRANSMITTER_M = np.array([5.0, -1.0, 0.5])
WAVELENGTH_M = pr.WAVEFORM.wavelength_m
#: Odd numbers of samples and pulses; cells of 2.998 m and 0.943 m/s, up to 752 m.
FMCW = Radar(FmcwWaveform(5.3e9, 50e6, 251, 2e6), Burst(1000.0, 15))
CELL_M = FMCW.waveform.range_resolution_m
CELL_MPS = WAVELENGTH_M / 2 * 1000.0 / 15
REPLICATES = 2


@dataclass(frozen=True)
class Echo:
    """An object: direction, cell of its range, cells of its rate, powers in both replicates [W]."""

    name: str
    azimuth_deg: float
    elevation_deg: float
    cell: int
    rate_cells: int
    powers_w: tuple[float, float]

    @property
    def range_m(self) -> float:
        return self.cell * CELL_M

    @property
    def rate_mps(self) -> float:
        return self.rate_cells * CELL_MPS

    @property
    def place_m(self) -> np.ndarray:
        """The point of this direction whose path has the length of the cell."""
        azimuth, up = math.radians(self.azimuth_deg), math.radians(self.elevation_deg)
        ahead = np.array([math.sin(azimuth), math.cos(azimuth), 0]) * math.cos(up)
        ahead[2] = math.sin(up)
        # d + |d a - t| = l
        length_m = 2 * self.range_m
        along_m = float(ahead @ TRANSMITTER_M)
        square = float(TRANSMITTER_M @ TRANSMITTER_M)
        return np.asarray(ahead * (length_m**2 - square) / (2 * (length_m - along_m)))

    @property
    def power_w(self) -> float:
        return sum(self.powers_w)

    @property
    def rcs_m2(self) -> float:
        """By the radar equation with both ranges."""
        back = float(self.place_m @ self.place_m)
        there = float(np.sum((self.place_m - TRANSMITTER_M) ** 2))
        return self.power_w * (4 * math.pi) ** 3 * there * back / (EIRP_W * WAVELENGTH_M**2)


#: Not in the order of power, range or name.
ECHOES = (
    Echo("Mast", -14.0, 3.0, 67, 0, (4e-11, 1e-11)),
    Echo("Boat", 2.0, -4.0, 104, 3, (1.2e-11, 1.8e-11)),
    Echo("Aircraft", 12.0, 5.0, 133, -5, (5e-13, 1.5e-12)),
)


def rows_of(echoes: tuple[Echo, ...] = ECHOES) -> PathRows:
    rows = PathRows.zeros(len(echoes) * REPLICATES)
    for number, echo in enumerate(echoes):
        for replicate in range(REPLICATES):
            at = replicate * len(echoes) + number
            row = rows[at : at + 1]
            place = echo.place_m
            row["power_w"], row["length_m"] = echo.powers_w[replicate], 2 * echo.range_m
            row["order"], row["replicate"] = 1, replicate
            row["first_scatterer_m"] = row["last_scatterer_m"] = place
            row["direction"] = place / np.linalg.norm(place)
            row["range_rate_mps"] = echo.rate_mps
            row["first_object"] = row["last_object"] = number + 1
            row["solid_angle_sr"] = 1e-6 * (1 + number)
    return rows


def write_run(folder: Path, frame: int = 1, time_s: float = 0.0, moving: bool = True) -> Path:
    """Write the run of one frame; return its folder."""
    receiver = pr.camera(pr.pose((0, 0, 0)))
    transmitter = contract.TransmitterRecord(pr.pose(TRANSMITTER_M.tolist()), EIRP_W)
    rows = rows_of()
    rows["range_rate_mps"] *= moving
    pr.write_run(
        folder, rows, [echo.name for echo in ECHOES], receiver, transmitter,
        range_limits_m=750.0, replicates=REPLICATES,
    )  # fmt: skip
    record = read_record(folder / contract.RUN_FILE, contract.RunRecord)
    write_record(
        folder / contract.RUN_FILE, replace(record, frames=[frame], frame_times_s=[time_s])
    )
    place = folder / contract.frame_dir(frame)
    (folder / contract.frame_dir(1)).rename(place)
    paths = read_record(place / contract.PATHS_FILE, contract.PathsRecord)
    write_record(place / contract.PATHS_FILE, replace(paths, frame=frame))
    return folder
