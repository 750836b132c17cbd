# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of a radar frame, from its rings or from its path table.

`open_frame` reads and checks all that processing needs: whoever holds a `FrameInput` opens no file
by name. Tables are memory-mapped and ring images come one at a time, so the memory needed does not
grow with the number of paths or rings.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ...arrays import Real, Single
from ...contract import (
    GroundTruthRecord,
    LinkBudget,
    PathsRecord,
    ReceiverRecord,
    RenderRecord,
    TransmitterRecord,
    render_stem,
)
from ...errors import ConfigError, SchemaError
from ...typed_json import read_record
from ..motion import FrameMotion
from ..paths import (
    Flags,
    GridPlaces,
    PathCounts,
    PathFlag,
    PathRows,
    Paths,
    frame_motion,
    geometry_of,
    has_images,
    iter_rows,
    motion_of_rows,
    open_frame_table,
    radiance_of,
    usable,
)
from ..radar import Radar
from ..runs import RadarFrame
from .path_class_pixels import MIXED_TOLERANCE
from .ring_pixels import (
    MAX_RANGE_RATE_MPS,
    Decoded,
    PixelGrid,
    decode,
    pixel_grid,
    range_rate,
    ring_geometry,
)

#: From ring and snapshot index to sidecar and colour channels, as `RadarFrame.image`.
ImageReader = Callable[[int, int], tuple[RenderRecord, dict[str, Single]]]


@dataclass(frozen=True)
class FrameTable:
    """The path table of one render of a burst."""

    record: PathsRecord  #: its sidecar
    rows: PathRows  #: memory-mapped, checked against the SHA-256 of the sidecar, (path_count,)
    #: Motion of the antennas and of the bodies that the rows number; None: nothing moves.
    motion: FrameMotion | None
    #: Pixels of its views.
    grids: GridPlaces = field(default_factory=GridPlaces, compare=False, repr=False)


@dataclass(frozen=True)
class FrameInput:
    """All that is known of a radar frame before it is processed.

    Attributes
    ----------
    frame
        Frame of a run, with the run's header.
    radar
        Waveform and burst.
    link_budget
        Transmit power, antennas, losses; None: none.
    range_limits_m
        One-way ranges (start, stop) that are recorded [m].
    receiver, transmitter
        Antennas at the frame's time.
    ground_truth
        Places of the objects; None where the run holds no such record.
    tables
        Sampling mode "paths": one for each visibility update of the burst. "rings": none.
    images
        Sampling mode "rings": reads one image.
    """

    frame: RadarFrame
    radar: Radar
    link_budget: LinkBudget | None
    range_limits_m: tuple[float, float]
    receiver: ReceiverRecord
    transmitter: TransmitterRecord
    ground_truth: GroundTruthRecord | None
    tables: tuple[FrameTable, ...]
    images: ImageReader

    @property
    def table(self) -> FrameTable:
        """The table of the burst's first render; `ConfigError` if the frame holds ring images."""
        if not self.tables:
            raise ConfigError(
                f"{self.frame.path} was measured by rings, which do not know the object of a path. "
                "Measure the scene by paths (Sampling mode: Paths, or --sampling-mode paths)."
            )
        return self.tables[0]

    @cached_property
    def whole_names(self) -> dict[str, str]:
        """Name under which lists count each object of the table: its own, or that of the object
        whose part it is.
        """
        scene = [] if self.ground_truth is None else self.ground_truth.objects
        wholes = {item.name: item.part_of for item in scene if item.part_of}
        return {name: wholes.get(name, name) for name in self.table.record.objects}

    def by_parts(self) -> FrameInput:
        """Return the input with each part of an object, such as the wheel of a car, by itself."""
        if self.ground_truth is None:
            return self
        objects = [dataclasses.replace(item, part_of="") for item in self.ground_truth.objects]
        return dataclasses.replace(
            self, ground_truth=dataclasses.replace(self.ground_truth, objects=objects)
        )

    def of_update(self, number: int) -> FrameInput:
        """Return the input with one visibility update of the burst alone, counted from 0."""
        table = self.tables[number]
        return dataclasses.replace(
            self,
            tables=(table,),
            receiver=table.record.receiver,
            transmitter=table.record.transmitter,
        )


def open_frame(
    frame: RadarFrame,
    *,
    radar: Radar | None = None,
    link_budget: LinkBudget | None = None,
    range_limits_m: tuple[float, float] | None = None,
) -> FrameInput:
    """Read and check what a frame's folder holds.

    Parameters
    ----------
    frame
        A radar frame of a run; of a later render of its burst, that render alone.
    radar, link_budget, range_limits_m
        Waveform and burst, link budget, one-way ranges (start, stop) [m]; None: those of the run.

    Returns
    -------
    FrameInput
        Each path table in it was hashed once.

    Raises
    ------
    FrameFileError, SchemaError
        A file is missing or damaged, or files do not belong together.
    """
    tables: list[FrameTable] = []
    if frame.sampling_mode == "paths":
        # a later render of the burst is opened by itself, the first one with all that follow
        renders = [frame.render] if frame.render else range(frame.visibility_updates)
        for number in renders:
            render = frame.of_burst(number)
            record, rows = open_frame_table(render.path, render.number, render.record.fingerprint)
            tables.append(FrameTable(record, rows, frame_motion(render.path, record)))
    sidecar: PathsRecord | RenderRecord = (
        tables[0].record
        if tables
        else read_record(frame.path / f"{render_stem(0, 0)}.json", RenderRecord)
    )
    return FrameInput(
        frame=frame,
        radar=radar or frame.run.radar,
        link_budget=link_budget or frame.record.link_budget,
        range_limits_m=range_limits_m or frame.run.range_limits_m,
        receiver=sidecar.receiver,
        transmitter=sidecar.transmitter,
        ground_truth=frame.scene(),
        tables=tuple(tables),
        images=frame.image,
    )


def as_input(frame: RadarFrame | FrameInput) -> FrameInput:
    """Return an opened frame as it is, and open one that is not."""
    return frame if isinstance(frame, FrameInput) else open_frame(frame)


class RingReader:
    """Decodes renders on demand and keeps those of neighbouring rings."""

    def __init__(self, frame_input: FrameInput) -> None:
        self._frame, self._images = frame_input.frame, frame_input.images
        self._kept: dict[tuple[int, int], Decoded] = {}
        self._grids: dict[object, PixelGrid] = {}
        #: Receiver and transmitter at t.
        self.antennas = frame_input.receiver, frame_input.transmitter
        self._times_s: dict[int, float] = {}

    def get(self, ring: int, snapshot_index: int) -> Decoded:
        key = (ring, snapshot_index)
        if key not in self._kept:
            record, channels = self._images(ring, snapshot_index)
            time_s = self._times_s.setdefault(snapshot_index, record.time_s)
            if time_s != record.time_s:
                raise SchemaError(
                    f"{self._frame.path}: ring {ring}, snapshot {snapshot_index} is at "
                    f"{record.time_s} s, "
                    f"other rings of the snapshot at {time_s} s. Render this frame again."
                )
            if snapshot_index == 0:
                self.antennas = record.receiver, record.transmitter
            view = repr(record.receiver)
            if view not in self._grids:
                self._grids.clear()
                self._grids[view] = pixel_grid(record.receiver, record.width_px, record.height_px)
            self._kept[key] = decode(record, channels, self._grids[view])
        return self._kept[key]

    @property
    def snapshot_interval_s(self) -> float:
        """Time between the snapshots, as the sidecars have it [s]."""
        measured_s = self._times_s[1] - self._times_s[0]
        planned_s = self._frame.record.snapshot_interval_s
        # Blender holds frames in float32, and the interval is what it has evaluated.
        slack_s = 1e-6 * planned_s + 2**-23 * max(map(abs, self._times_s.values()))
        if abs(measured_s - planned_s) > slack_s:
            raise SchemaError(
                f"{self._frame.path}: the snapshots are {measured_s!r} s apart, the run's plan has "
                f"{planned_s!r} s. Render this frame again."
            )
        return measured_s

    def drop_before(self, ring: int) -> None:
        for key in [key for key in self._kept if key[0] < ring]:
            del self._kept[key]


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
        Limit of a believable |range rate|, see :func:`range_rate` [m/s].

    Yields
    ------
    Paths
        Paths of a ring (at most three rings are in memory), or of some rows of the table.

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
    """Yield the paths of an opened table in parts that fit into memory. `row` numbers the rows of
    the table, from `first_row` for a part of a larger one. Rows without a length are counted and
    left out.
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
