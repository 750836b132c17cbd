# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of a radar frame, from its rings or from its path table."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from ...array_types import Real
from ...contract import PathsRecord
from ..motion import FrameMotion
from ..paths import (
    Flags,
    PathCounts,
    PathFlag,
    PathRows,
    Paths,
    geometry_of,
    has_images,
    iter_rows,
    motion_of_rows,
    radiance_of,
    usable,
)
from ..runs import RadarFrame
from .frame_input import FrameInput, as_input
from .path_class_pixels import MIXED_TOLERANCE
from .ring_pixels import Decoded
from .ring_reader import RingReader
from .shell_geometry import ring_geometry
from .snapshot_rate import MAX_RANGE_RATE_MPS, range_rate


def iter_path_chunks(
    frame: RadarFrame | FrameInput,
    *,
    max_range_rate_mps: float = MAX_RANGE_RATE_MPS,
) -> Iterator[Paths]:
    """Yield the paths of one radar frame, ring by ring or part by part of its table.

    Parameters
    ----------
    frame
        Radar frame; one that is not opened yet is opened, see :func:`open_frame`. With rings and
        one snapshot, every range rate is 0 and flagged. Of several visibility updates the first is
        taken, or that of `RadarFrame.of_burst`.
    max_range_rate_mps
        Limit of a believable |range rate|, see :func:`.decoding.snapshot_rate.range_rate` [m/s].

    Yields
    ------
    Paths
        Those of a ring (at most three rings are in memory), or of some rows of the table.

    Raises
    ------
    FrameFileError, SchemaError
        As :meth:`RadarFrame.image`; SchemaError also where the times of the snapshots do not fit.
    """
    frame_input = as_input(frame)
    if frame_input.tables:
        table = frame_input.table
        yield from table_paths(table.record, table.rows, table.motion)
        return
    frame, reader = frame_input.frame, RingReader(frame_input)
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
            flags = np.full(first.mask.shape, PathFlag.SINGLE_SNAPSHOT, dtype=np.uint16)
        reader.drop_before(ring)
        paths = _ring_paths(ring, first, rate, flags)
        single = frame.max_reflections == 1
        geometry = ring_geometry(first, paths.row, paths.col, *reader.antennas, single)
        yield dataclasses.replace(paths, geometry=geometry)


def table_paths(
    record: PathsRecord, table: PathRows, motion: FrameMotion | None, first_row: int = 0
) -> Iterator[Paths]:
    """Yield the paths of an opened table in parts that fit into memory.

    Parameters
    ----------
    record, table
        From :func:`.paths.open_frame_table`.
    motion
        The frame's, see :func:`.paths.frame_motion`; None: nothing is known, all is stationary.
    first_row
        Number of the table's first row, for a part of a larger one.

    Yields
    ------
    Paths
        `row` numbers the rows of the table. Rows without a length are counted and left out.
    """
    if motion is not None and not motion.moving:
        motion = None
    for part in iter_rows(table):
        keep = usable(part)
        row = first_row + np.flatnonzero(keep)
        first_row += part.size
        rows = part if keep.all() else part[keep]
        flags = rows["flags"]
        zeros = np.zeros(rows.size, dtype=np.int64)
        yield Paths(
            radiance=radiance_of(rows, record),
            solid_angle_sr=np.array(rows["solid_angle_sr"]),
            length_m=np.array(rows["length_m"]),
            range_rate_mps=np.array(rows["range_rate_mps"]),
            ring=zeros,
            row=row,
            col=zeros,
            flags=np.array(flags),
            counts=PathCounts.of(flags, range_encoding_underflow=part.size - rows.size),
            geometry=geometry_of(rows, record.images),
            motion=None if motion is None else motion_of_rows(rows, motion),
            mirror_phase_rad=np.array(rows["mirror_phase_rad"]) if has_images(rows) else None,
        )


def frame_paths(
    frame: RadarFrame | FrameInput, *, max_range_rate_mps: float = MAX_RANGE_RATE_MPS
) -> Paths:
    """Return all paths of one radar frame in one table.

    Parameters
    ----------
    frame, max_range_rate_mps
        As for :func:`iter_path_chunks`.

    Returns
    -------
    Paths
        Ring by ring or in the order of the table.
    """
    return Paths.join(iter_path_chunks(frame, max_range_rate_mps=max_range_rate_mps))


def _ring_paths(ring: int, decoded: Decoded, rate_mps: Real, flags: Flags) -> Paths:
    row, col = np.nonzero(decoded.mask)
    here = flags[row, col]
    # NaN (undefined) compares false: it is not counted as mixed
    here[np.abs(decoded.mixing[row, col] - 1) > MIXED_TOLERANCE] |= PathFlag.MIXED
    return Paths(
        radiance=decoded.radiance[row, col],
        solid_angle_sr=decoded.solid_angle_sr[row, col],
        length_m=decoded.total_length_m[row, col],
        range_rate_mps=rate_mps[row, col],
        ring=np.full(row.size, ring, dtype=np.int64),
        row=row,
        col=col,
        flags=here,
        counts=PathCounts.of(
            here,
            range_encoding_underflow=decoded.range_encoding_underflow,
            no_range_encoding=decoded.no_range_encoding,
        ),
    )
