# SPDX-License-Identifier: GPL-3.0-or-later
"""A radar frame opened once: all that processing needs of it, read and checked.

Whoever holds a :class:`FrameInput` opens no file by name. Tables are memory-mapped and ring images
come one at a time, so the memory needed does not grow with the number of paths or rings.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field

from ...array_types import Single
from ...contract import (
    GroundTruthRecord,
    LinkBudget,
    PathsRecord,
    ReceiverRecord,
    RenderRecord,
    TransmitterRecord,
    render_stem,
)
from ...errors import ConfigError
from ...sidecar import read_record
from ..motion import FrameMotion
from ..paths import GridPlaces, PathRows, frame_motion, open_frame_table
from ..radar import Radar
from ..runs import RadarFrame

ImageReader = Callable[[int, int], tuple[RenderRecord, dict[str, Single]]]
"""From ring and snapshot index to sidecar and colour channels, as :meth:`RadarFrame.image`."""


@dataclass(frozen=True)
class FrameTable:
    """The path table of one render of a burst.

    Attributes
    ----------
    record
        Its sidecar.
    rows
        Its rows, memory-mapped, checked against the SHA-256 of the sidecar, (path_count,).
    motion
        Motion of the antennas and of the bodies that the rows number; None: nothing moves.
    grids
        Pixels of its views.
    """

    record: PathsRecord
    rows: PathRows
    motion: FrameMotion | None
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
        """The table of the burst's first render.

        Raises
        ------
        ConfigError
            The frame holds ring images.
        """
        if not self.tables:
            raise ConfigError(
                f"{self.frame.path} was measured by rings, which do not know the object of a path. "
                "Measure the scene by paths (Sampling mode: Paths, or --sampling-mode paths)."
            )
        return self.tables[0]

    def of_update(self, number: int) -> FrameInput:
        """The input with one visibility update of the burst alone, counted from 0."""
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
    tables: tuple[FrameTable, ...] = ()
    if frame.sampling_mode == "paths":
        # a later render of the burst is opened by itself, the first one with all that follow
        renders = [frame.render] if frame.render else range(frame.visibility_updates)
        tables = tuple(_open_table(frame.of_burst(n)) for n in renders)
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
        tables=tables,
        images=frame.image,
    )


def as_input(frame: RadarFrame | FrameInput) -> FrameInput:
    """Return an opened frame as it is, and open one that is not.

    Parameters
    ----------
    frame
        Radar frame, or its input.

    Returns
    -------
    FrameInput
        As :func:`open_frame` gives it.
    """
    return frame if isinstance(frame, FrameInput) else open_frame(frame)


def _open_table(render: RadarFrame) -> FrameTable:
    record, rows = open_frame_table(render.path, render.number, render.record.fingerprint)
    return FrameTable(record, rows, frame_motion(render.path, record))
