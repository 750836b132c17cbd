# SPDX-License-Identifier: GPL-3.0-or-later
"""All that was computed of one radar frame, and the registry of writers that make files of it.

A room that writes a format registers a function for it::

    @result_writer("npz", "_profile.npz", "_map.npz")
    def write_arrays(result: FrameResult, folder: Path) -> list[Path]: ...

The endings tell the files of this writer from all others, so that processing again can remove what
it no longer writes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...arrays import Real
from ...atomic_files import remove_file
from ...errors import ConfigError
from ...findings import Finding
from ..decoding import FrameInput
from ..detection import BudgetReport, Detections, FrameStatistics, LeadingEdge, Peak
from ..echoes import Echoes, ReceivedSignal
from ..maps import (
    ExpectedPower,
    PowerProfile,
    RangeDopplerMap,
    RangeProfiles,
    Spectrogram,
    map_noise_gain,
    range_noise_gain,
)
from ..scattering import SpeckleReport


@dataclass(frozen=True)
class FrameResult:
    """All that was computed of one radar frame.

    Attributes
    ----------
    source
        Input that it was computed from.
    options
        How it was computed, as plain JSON: a record for files, to be read by people.
    statistics
        Sums over the paths.
    received
        Samples as the receiver recorded them, noise, quantisation.
    compressed
        Range profiles of all pulses.
    profile
        Expected power against range, without speckle and noise.
    rd_map
        Range-Doppler map.
    mti
        Pulses of the canceller before the map; 0: none.
    edges
        Leading edges in the profile, the most prominent ones first.
    moving_targets
        Peaks of the map that moving objects make, the strongest first. Rings do not know what
        moves: there, peaks off 0 Hz.
    budget
        Received power, noise, and the objects that echo.
    findings
        What to know before you trust the frame.
    expected
        Expected power with standard errors; None: rings, or amplitudes that are not watts.
    speckle
        Scatterers of the surfaces; None without any.
    detections
        Targets that CFAR found; None without CFAR.
    spectrogram
        Spectrogram of the first channel; None where none was asked for.
    edges_left_out
        Number of leading edges of lower prominence that `edges` does not list.
    files
        Files that hold the result, once they are written.
    fingerprint
        Hash of all that the files are made of; empty: not known.
    """

    source: FrameInput
    options: Mapping[str, Any]
    statistics: FrameStatistics
    received: ReceivedSignal
    compressed: RangeProfiles
    profile: PowerProfile
    rd_map: RangeDopplerMap
    mti: int
    edges: list[LeadingEdge]
    moving_targets: list[Peak]
    budget: BudgetReport
    findings: list[Finding]
    expected: ExpectedPower | None = None
    speckle: SpeckleReport | None = None
    detections: Detections | None = None
    spectrogram: Spectrogram | None = None
    edges_left_out: int = 0
    files: tuple[Path, ...] = ()
    fingerprint: str = ""

    @property
    def frame(self) -> int:
        """Number of the frame in Blender."""
        return self.source.frame.number

    @property
    def time_s(self) -> float:
        """Scene time of the frame [s]."""
        return self.source.frame.time_s

    @property
    def echoes(self) -> Echoes:
        """Samples as the receiver recorded them."""
        return self.received.echoes

    @property
    def profile_noise_power(self) -> float:
        """Mean noise of a cell of the profile, thermal and of the ADC [W]; 0 without."""
        gain = range_noise_gain(self.compressed.radar, self.compressed.range_taper)
        return self.received.floor_power_w * gain

    @property
    def noise_of_budget(self) -> float | None:
        """Mean thermal noise of a cell of the map by the link budget [W], asked for or not.

        None without a link budget, or where that has no noise. Without a canceller.
        """
        if not self.budget.noise_w:
            return None
        taper = self.rd_map.range_taper, self.rd_map.doppler_taper
        return self.budget.noise_w * map_noise_gain(self.source.radar, *taper)

    @property
    def clutter_to_noise(self) -> Real | None:
        """Clutter over the link budget's noise in the cells of `expected`, without a canceller.

        (pulses, ranges); None without clutter or without a link budget.
        """
        noise_w = self.noise_of_budget
        if self.expected is None or self.expected.clutter_map is None or noise_w is None:
            return None
        return self.expected.clutter_map / noise_w

    @property
    def map_noise_power(self) -> float:
        """Mean noise of a cell of the map, thermal and of the ADC [W]; 0 without."""
        taper = self.rd_map.range_taper, self.rd_map.doppler_taper
        return self.received.floor_power_w * map_noise_gain(self.rd_map.radar, *taper)


#: Writes files of a result into a folder and returns those that it wrote; maybe none.
WriteResult = Callable[[FrameResult, Path], list[Path]]


@dataclass(frozen=True)
class _Writer:
    write: WriteResult
    endings: tuple[str, ...]


_WRITERS: dict[str, _Writer] = {}


def result_writer(name: str, *endings: str) -> Callable[[WriteResult], WriteResult]:
    """Return a decorator that registers a writer under a name that is not taken yet.

    `endings` are those of all files that it may write, after ``frame_0001``; not taken yet.
    """
    taken = {ending for writer in _WRITERS.values() for ending in writer.endings}
    if name in _WRITERS or taken.intersection(endings):
        raise ValueError(f"A writer {name!r}, or one of {endings}, is registered already.")

    def register(write: WriteResult) -> WriteResult:
        _WRITERS[name] = _Writer(write, endings)
        return write

    return register


def writer_names() -> tuple[str, ...]:
    return tuple(sorted(_WRITERS))


def write_result(result: FrameResult, folder: Path, names: Iterable[str]) -> list[Path]:
    """Write a result into an existing folder with some of the registered writers, in this order."""
    files: list[Path] = []
    for name in names:
        if name not in _WRITERS:
            raise ConfigError(f"No writer is called {name!r}; expected one of {writer_names()}.")
        files += _WRITERS[name].write(result, folder)
    return files


def frame_file(folder: Path, frame: int, ending: str) -> Path:
    """Return the path of a frame's file, such as ``frame_0001_map.npz``."""
    return folder / f"frame_{frame:04d}{ending}"


def remove_stale(folder: Path, frame: int, written: Collection[Path]) -> None:
    """Remove files of a frame that an earlier processing wrote and this one did not."""
    for writer in _WRITERS.values():
        for ending in writer.endings:
            path = frame_file(folder, frame, ending)
            if path not in written:
                remove_file(path)
