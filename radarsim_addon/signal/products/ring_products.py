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
from ..results import FrameResult, frame_file, result_writer
from ..runs import RadarFrame, write_exr

_QUANTITIES = ("amplitude", "range")


@result_writer("exr", *(f"_{quantity}_t{n}.exr" for quantity in _QUANTITIES for n in (0, 1)))
def write_ring_products(result: FrameResult, folder: Path) -> list[Path]:
    """Write the ring products of a result; nothing where it comes from a path table."""
    frame = result.source.frame
    return write_products(frame, folder) if frame.sampling_mode == "rings" else []


def write_products(frame: RadarFrame, folder: Path) -> list[Path]:
    """Write the products of one frame, two for each snapshot.

    Parameters
    ----------
    frame
        Radar frame with the sampling mode "rings".
    folder
        Existing folder.

    Returns
    -------
    list of Path
        Files written. One snapshot at a time is in memory.
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
            channel = f"ring.{ring:03d}"  # three digits: any reader sorts rings by number
            amplitude[channel] = decoded.radiance.astype(np.float32)
            range_m[channel] = decoded.range_m.astype(np.float32)
        for quantity, images in zip(_QUANTITIES, (amplitude, range_m), strict=True):
            written.append(frame_file(folder, frame.number, f"_{quantity}_t{snapshot_index}.exr"))
            write_exr(written[-1], images)
    return written
