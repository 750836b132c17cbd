# SPDX-License-Identifier: GPL-3.0-or-later
"""Decoded renders of a frame's rings, a few at a time."""

from __future__ import annotations

from ...contract import ReceiverRecord, TransmitterRecord
from ...errors import SchemaError
from .frame_input import FrameInput
from .ring_pixels import Decoded, PixelGrid, decode, pixel_grid


class RingReader:
    """Decodes renders on demand and keeps those of neighbouring rings."""

    def __init__(self, frame_input: FrameInput) -> None:
        self._frame, self._images = frame_input.frame, frame_input.images
        self._kept: dict[tuple[int, int], Decoded] = {}
        self._grids: dict[object, PixelGrid] = {}
        self._antennas = frame_input.receiver, frame_input.transmitter
        self._times_s: dict[int, float] = {}

    def get(self, ring: int, snapshot_index: int) -> Decoded:
        """Pixels of a ring in one snapshot."""
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
                self._antennas = record.receiver, record.transmitter
            view = repr(record.receiver)
            if view not in self._grids:
                self._grids.clear()
                self._grids[view] = pixel_grid(record.receiver, record.width_px, record.height_px)
            self._kept[key] = decode(record, channels, self._grids[view])
        return self._kept[key]

    @property
    def antennas(self) -> tuple[ReceiverRecord, TransmitterRecord]:
        """Receiver and transmitter at t."""
        return self._antennas

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
        """Let go of the rings before."""
        for key in [key for key in self._kept if key[0] < ring]:
            del self._kept[key]
