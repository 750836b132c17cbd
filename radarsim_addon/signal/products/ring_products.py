# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's four products of a radar frame: amplitude and range, at t and at t + delta t.

    products/frame_0001_amplitude_t0.exr      radiance L [W m^-2 sr^-1]
    products/frame_0001_range_t0.exr          one-way range, half the path's length [m]
    products/frame_0001_amplitude_t1.exr      the same at t + delta t
    products/frame_0001_range_t1.exr

Float32 EXR, one channel a ring: "ring.000", "ring.001"... Where a pixel has no echo, both are 0;
no value is NaN.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..decoding import PixelGrid, decode, pixel_grid
from ..runs import RadarFrame, write_exr


def ring_channel(ring: int) -> str:
    """Name of a ring's channel; three digits, so that any reader sorts rings by number."""
    return f"ring.{ring:03d}"


def product_path(folder: Path, frame: int, quantity: str, snapshot_index: int) -> Path:
    """Path of one product; quantity is "amplitude" or "range"."""
    return folder / f"frame_{frame:04d}_{quantity}_t{snapshot_index}.exr"


def write_products(frame: RadarFrame, folder: Path) -> list[Path]:
    """Write the products of one frame, two for each pass.

    Parameters
    ----------
    frame
        Radar frame.
    folder
        Existing folder.

    Returns
    -------
    list of Path
        Files written. One pass at a time is in memory.

    Raises
    ------
    FrameFileError, SchemaError
        As :meth:`RadarFrame.image`.
    OutputError
        The folder is missing, read-only or full.
    """
    written = []
    for snapshot_index in range(frame.snapshots):
        amplitude: dict[str, NDArray[np.float32]] = {}
        range_m: dict[str, NDArray[np.float32]] = {}
        grid: PixelGrid | None = None
        for ring in range(frame.rings):
            record, channels = frame.image(ring, snapshot_index)
            grid = grid or pixel_grid(record.receiver, record.width_px, record.height_px)
            decoded = decode(record, channels, grid)
            amplitude[ring_channel(ring)] = decoded.radiance.astype(np.float32)
            range_m[ring_channel(ring)] = decoded.range_m.astype(np.float32)
        for quantity, images in (("amplitude", amplitude), ("range", range_m)):
            path = product_path(folder, frame.number, quantity, snapshot_index)
            write_exr(path, images)
            written.append(path)
    return written
