# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of a radar frame, from its rings or from its path table."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from ...array_types import Real
from ..paths import (
    Flags,
    PathFlag,
    Paths,
    as_path_motion,
    frame_motion,
    geometry_of,
    is_mixed,
    join_paths,
    radiance_of,
    table_parts,
    usable,
)
from ..paths.paths import count_flags
from ..runs import RadarFrame
from .ring_pixels import Decoded
from .ring_reader import RingReader
from .shell_geometry import ring_geometry
from .snapshot_rate import MAX_RANGE_RATE_MPS, range_rate

#: |G B/R^2 - 1| above which a pixel counts as mixed. float32 noise stays below 2e-6; 1e-5 is a
#: spread of ranges (rms, one-way) of 0.16 % of the code length.
MIXED_TOLERANCE = 1e-5


def iter_path_chunks(
    frame: RadarFrame,
    *,
    max_range_rate_mps: float = MAX_RANGE_RATE_MPS,
    mixed_tolerance: float = MIXED_TOLERANCE,
) -> Iterator[Paths]:
    """Paths of one radar frame, ring by ring; at most three rings are in memory at a time.

    Parameters
    ----------
    frame
        Radar frame with one or two passes. With one, every range rate is 0 and flagged.
    max_range_rate_mps
        Limit of a believable |range rate|, see :func:`.decoding.snapshot_rate.range_rate` [m/s].
    mixed_tolerance
        |G B/R^2 - 1| above which a pixel is flagged as mixed.

    Raises
    ------
    FrameFileError, SchemaError
        As :meth:`RadarFrame.image`; SchemaError also where the times of the passes do not fit.
    """
    if frame.sampling_mode == "paths":
        yield from _table_paths(frame)
        return
    reader = RingReader(frame)
    for ring in range(frame.rings):
        first = reader.get(ring, 0)
        if frame.snapshots == 2:
            neighbours = [
                (reader.get(n, 0), reader.get(n, 1))
                for n in (ring - 1, ring + 1)
                if 0 <= n < frame.rings
            ]
            rate, flags = range_rate(
                first,
                reader.get(ring, 1),
                reader.snapshot_interval_s,
                neighbours,
                max_range_rate_mps,
            )
        else:
            rate = np.zeros(first.mask.shape)
            flags = np.full(first.mask.shape, PathFlag.SINGLE_SNAPSHOT, dtype=np.uint8)
        reader.drop_before(ring)
        paths = _ring_paths(ring, first, rate, flags, mixed_tolerance)
        single = frame.max_bounces == 0
        geometry = ring_geometry(first, paths.row, paths.col, *reader.antennas, single)
        yield dataclasses.replace(paths, geometry=geometry)


def _table_paths(frame: RadarFrame) -> Iterator[Paths]:
    """The table of a frame in parts; rows without a length are counted and left out."""
    first = 0
    scene = frame_motion(frame.path, frame.number)
    for record, rows in table_parts(frame.path, frame.number):
        keep = usable(rows)
        place = np.arange(first, first + rows.size, dtype=np.int32)[keep]
        first += rows.size
        rows = rows[keep]
        flags = np.where(is_mixed(rows), PathFlag.MIXED, 0).astype(np.uint8)
        zeros = np.zeros(rows.size, dtype=np.int32)
        yield Paths(
            radiance=radiance_of(rows, record),
            solid_angle_sr=np.array(rows["solid_angle_sr"]),
            length_m=np.array(rows["length_m"]),
            range_rate_mps=np.array(rows["range_rate_mps"]),
            ring=zeros,
            row=place,
            col=zeros,
            flags=flags,
            counts=count_flags(flags, range_encoding_underflow=int(np.count_nonzero(~keep))),
            geometry=geometry_of(rows),
            motion=as_path_motion(rows, scene),
        )


def frame_paths(
    frame: RadarFrame,
    *,
    max_range_rate_mps: float = MAX_RANGE_RATE_MPS,
    mixed_tolerance: float = MIXED_TOLERANCE,
) -> Paths:
    """All paths of one radar frame in one table, see :func:`iter_path_chunks`."""
    return join_paths(
        iter_path_chunks(
            frame, max_range_rate_mps=max_range_rate_mps, mixed_tolerance=mixed_tolerance
        )
    )


def _ring_paths(
    ring: int, decoded: Decoded, rate_mps: Real, flags: Flags, mixed_tolerance: float
) -> Paths:
    row, col = np.nonzero(decoded.mask)
    here = flags[row, col]
    # NaN (undefined) compares false: it is not counted as mixed
    here |= PathFlag.MIXED * (np.abs(decoded.mixing[row, col] - 1) > mixed_tolerance).astype(
        np.uint8
    )
    return Paths(
        radiance=decoded.radiance[row, col],
        solid_angle_sr=decoded.solid_angle_sr[row, col],
        length_m=decoded.total_length_m[row, col],
        range_rate_mps=rate_mps[row, col],
        ring=np.full(row.size, ring, dtype=np.int32),
        row=row.astype(np.int32),
        col=col.astype(np.int32),
        flags=here,
        counts=count_flags(here, decoded.range_encoding_underflow, decoded.no_range_encoding),
    )
