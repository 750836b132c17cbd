# SPDX-License-Identifier: GPL-3.0-or-later
"""A plate of many pixels, and the speckle of its surface, for tests."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from radarsim_addon import contract
from radarsim_addon.signal.paths import PathRows
from radarsim_addon.signal.paths.table import open_table
from radarsim_addon.signal.scattering.surface_speckle import Body, Roughness, SurfaceSpeckle
from radarsim_addon.typed_json import read_record
from tests.signal import path_runs as pr

CARRIER_HZ = pr.WAVEFORM.carrier_hz
WAVELENGTH_M = pr.WAVEFORM.wavelength_m
WAVENUMBER = 2 * math.pi / WAVELENGTH_M
RESOLUTION_M = pr.WAVEFORM.range_resolution_m
IDENTITY = {1: Body("Plate", np.eye(4))}
COLUMNS = ("first_object", "last_object")


def scene(
    folder: Path, *, at: tuple[float, float, float] = (0, 0, 0), size_px: int = 64,
    range_m: float = 1000.0, side_m: float = 30.0, tilt_deg: float = 0.0,
    emitter_at: tuple[float, float, float] | None = None, seed: int = 0, replicates: int = 1,
) -> tuple[contract.PathsRecord, PathRows, Path]:  # fmt: skip
    """A plate and its table, seen by a radar near the origin that looks along +Y."""
    target = pr.plate("Plate", (0, range_m, 0), side_m, tilt_deg)
    receiver = pr.camera(pr.pose(at), math.degrees(0.6 * side_m / range_m))
    emitter = contract.TransmitterRecord(pr.pose(at if emitter_at is None else emitter_at), 1e6)
    rows = pr.trace([target], receiver, emitter, size_px, replicates, seed)
    pr.write_run(
        folder,
        rows,
        ["Plate"],
        receiver,
        emitter,
        range_limits_m=2 * range_m,
        replicates=replicates,
    )
    frame = folder / contract.frame_dir(1)
    record = read_record(frame / contract.PATHS_FILE, contract.PathsRecord)
    return record, open_table(frame / contract.PATHS_TABLE), folder


def speckle(
    record: contract.PathsRecord, table: PathRows, seed: int,
    roughness: Mapping[int, Roughness] | None = None, bodies: Mapping[int, Body] = IDENTITY,
    cell_m: float | None = None,
) -> SurfaceSpeckle:  # fmt: skip
    return SurfaceSpeckle(
        record, table, bodies, COLUMNS, CARRIER_HZ, RESOLUTION_M, seed, roughness, cell_m
    )
