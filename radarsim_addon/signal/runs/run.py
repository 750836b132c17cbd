# SPDX-License-Identifier: GPL-3.0-or-later
"""A run's folder: its plan, its completeness, and its renders one at a time.

Nothing is kept, so the memory does not grow with the number of frames or rings.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...arrays import Single
from ...atomic_files import refusal_to_open
from ...contract import (
    CHANNELS,
    GROUND_TRUTH_FILE,
    MAX_PIXELS,
    PATHS_FILE,
    PATHS_TABLE,
    RUN_FILE,
    GroundTruthRecord,
    PathsRecord,
    RenderRecord,
    RunRecord,
    burst_dir,
    frame_dir,
    render_stem,
)
from ...errors import ConfigError, FrameFileError, SchemaError
from ...findings import Finding, frames_text, merge, percent_text
from ...typed_json import check_run, file_sha256, from_json, read_record
from ..radar import Radar, Weather, burst_from_dict, channels_from_dict, waveform_from_dict
from .exr import read_exr

#: Fields of a plan that list its frames: parts of one run differ in them.
FRAME_FIELDS = ("frames", "frame_times_s")


@dataclass(frozen=True)
class MissingRender:
    """One render of the plan that is missing or incomplete.

    Attributes
    ----------
    frame, ring, snapshot_index
        Numbers of the render.
    reason
        Text for people.
    """

    frame: int
    ring: int
    snapshot_index: int
    reason: str


@dataclass(frozen=True)
class RadarFrame:
    """One radar frame of a run: `rings` images per snapshot, or a path table.

    :meth:`Run.frame` returns it; it holds no pixels.

    Attributes
    ----------
    run
        Run of the frame.
    number
        Number of the frame in Blender.
    render
        Index of the render within the burst, from 0.
    """

    run: Run
    number: int
    render: int = 0

    @property
    def record(self) -> RunRecord:
        """Header of the run."""
        return self.run.record

    @property
    def path(self) -> Path:
        """Folder of the frame's renders, or of one of the renders of its burst."""
        return self.run.path / burst_dir(self.number, self.render)

    @property
    def visibility_updates(self) -> int:
        """Number of renders of the burst; 1 except for paths with visibility updates."""
        return self.record.visibility_updates

    def of_burst(self, render: int) -> RadarFrame:
        """Return one of the renders of the burst, from 0: a frame with another table."""
        return dataclasses.replace(self, render=render)

    @property
    def time_s(self) -> float:
        """Planned scene time of the first snapshot [s]."""
        return self.record.frame_times_s[self.record.frames.index(self.number)]

    @property
    def sampling_mode(self) -> str:
        """ "rings" (images) or "paths" (a table)."""
        return self.record.sampling_mode

    @property
    def rings(self) -> int:
        """Number of rings."""
        return self.record.rings

    @property
    def max_reflections(self) -> int:
        """Most reflections of a path in the renders."""
        return self.record.max_reflections

    @property
    def snapshots(self) -> int:
        """1, or 2 for a second render of the frame after the snapshot interval."""
        return self.record.snapshots

    @property
    def planned(self) -> int:
        """Renders of the plan: images, or tables in the sampling mode "paths"."""
        if self.sampling_mode == "paths":
            return self.visibility_updates
        return self.rings * self.snapshots

    def missing(self) -> list[MissingRender]:
        """Return renders without EXR or sidecar. Checks names and sizes only."""
        found = []
        if self.sampling_mode == "paths":
            for render in map(self.of_burst, range(self.visibility_updates)):
                for name in (PATHS_FILE, PATHS_TABLE):
                    file = render.path / name
                    if not file.is_file() or file.stat().st_size == 0:
                        reason = f"{name} is missing or empty"
                        found.append(MissingRender(self.number, 0, 0, reason))
                        break
            return found
        for snapshot_index in range(self.snapshots):
            for ring in range(self.rings):
                stem = self.path / render_stem(ring, snapshot_index)
                for suffix, kind in ((".exr", "EXR"), (".json", "sidecar")):
                    file = stem.with_name(stem.name + suffix)
                    if not file.is_file() or file.stat().st_size == 0:
                        reason = f"{kind} {file.name} is missing or empty"
                        found.append(MissingRender(self.number, ring, snapshot_index, reason))
                        break
        return found

    def scene(self) -> GroundTruthRecord | None:
        """Return the ground truth of the objects, or None if the run holds no such record."""
        path = self.run.path / frame_dir(self.number) / GROUND_TRUTH_FILE
        if not path.is_file():
            return None
        record = read_record(path, GroundTruthRecord)
        check_run(path, record, self.record.fingerprint)
        return record

    def image(self, ring: int, snapshot_index: int = 0) -> tuple[RenderRecord, dict[str, Single]]:
        """Read one render and check it against its sidecar and the run's plan.

        Parameters
        ----------
        ring
            Ring, from 0.
        snapshot_index
            0 at t, 1 at t + delta t.

        Returns
        -------
        record, channels
            The sidecar, and float32 arrays (height, width) "R", "G", "B".

        Raises
        ------
        FrameFileError
            EXR or sidecar is missing or damaged, or a pixel is NaN, infinite or negative.
        SchemaError
            The sidecar is of a newer schema, or does not match its EXR or the plan.
        """
        if self.sampling_mode != "rings":
            raise SchemaError(
                f"{self.path} holds a path table, no ring images. Read it with iter_path_chunks."
            )
        if not (0 <= ring < self.rings and 0 <= snapshot_index < self.snapshots):
            raise IndexError(
                f"ring {ring}, snapshot {snapshot_index}: the run has {self.rings} rings and "
                f"{self.snapshots} snapshots, both counted from 0"
            )
        stem = render_stem(ring, snapshot_index)
        exr, sidecar = self.path / f"{stem}.exr", self.path / f"{stem}.json"
        record = read_record(sidecar, RenderRecord)
        self._check_plan(record, ring, snapshot_index, sidecar)
        images = read_exr(exr, CHANNELS)
        self._check_image(record, images, exr, sidecar)
        return record, images

    def _check_plan(
        self, record: RenderRecord, ring: int, snapshot_index: int, sidecar: Path
    ) -> None:
        plan = self.record
        check_run(sidecar, record, plan.fingerprint)
        expected = {
            "sampling_mode": plan.sampling_mode,
            "frame": self.number,
            "snapshot_index": snapshot_index,
            "ring": ring,
            "width_px": plan.width_px,
            "height_px": plan.height_px,
            "exr_file": f"{render_stem(ring, snapshot_index)}.exr",
        }
        for name, value in expected.items():
            if getattr(record, name) != value:
                raise SchemaError(
                    f"{sidecar}: {name} is {getattr(record, name)!r}, the run's plan has "
                    f"{value!r}. The file is of another run: remove it and render this run again."
                )
        for name in ("metres_per_unit", "range_encoding_length_m"):
            value = getattr(record, name)
            # slack: Blender's float32 rounds them
            if not math.isclose(value, getattr(plan, name), rel_tol=1e-5) or value <= 0:
                raise SchemaError(
                    f"{sidecar}: {name} is {value!r}, the run's plan has {getattr(plan, name)!r}. "
                    "The file belongs to another run: remove it and render this run again."
                )

    def _check_image(
        self, record: RenderRecord, images: dict[str, Single], exr: Path, sidecar: Path
    ) -> None:
        height, width = next(iter(images.values())).shape
        if (width, height) != (record.width_px, record.height_px):
            raise SchemaError(
                f"{exr} is {width} x {height} pixels, its sidecar {sidecar.name} has "
                f"{record.width_px} x {record.height_px}. Remove both and render the run again."
            )
        digest = file_sha256(exr)
        if digest != record.exr_sha256:
            raise SchemaError(
                f"{exr} does not match its sidecar {sidecar.name}: SHA-256 {digest[:12]}..., "
                f"expected {record.exr_sha256[:12]}... The file was changed or replaced: remove "
                "both and render the run again."
            )
        for name, image in images.items():
            negative = image < 0
            if negative.any():
                row, col = (int(i) for i in np.argwhere(negative)[0])
                raise FrameFileError(
                    f"{exr}: channel {name} is negative ({image[row, col]}) in "
                    f"{int(negative.sum())} pixel(s), the first at row {row}, column {col}; "
                    "radiance cannot be. Look for a light or a material of negative strength, "
                    "fix it and render this frame again."
                )


@dataclass(frozen=True)
class Run:
    """A run's folder, opened by :func:`open_run`.

    Attributes
    ----------
    path
        The folder.
    record
        Its plan.
    radar
        Waveform and burst.
    """

    path: Path
    record: RunRecord
    radar: Radar

    def frame(self, number: int) -> RadarFrame:
        """Return one radar frame by its number in Blender."""
        if number not in self.record.frames:
            raise FrameFileError(
                f"{self.path} has no frame {number}; it has "
                f"{frames_text(self.record.frames, self.record.frames)}. Give one of these."
            )
        return RadarFrame(self, number)

    def frames(self) -> Iterator[RadarFrame]:
        """Yield all radar frames of the plan, in its order; nothing is read."""
        for number in self.record.frames:
            yield RadarFrame(self, number)

    def missing(self) -> list[MissingRender]:
        """Return all missing renders of the plan."""
        return [gap for frame in self.frames() for gap in frame.missing()]

    @property
    def renders(self) -> int:
        """Number of renders in the plan; of tables in the sampling mode "paths"."""
        return sum(frame.planned for frame in self.frames())

    @property
    def range_limits_m(self) -> tuple[float, float]:
        """One-way ranges of profile and map: those of the plan, or else those that the rings cover
        [m].
        """
        record = self.record
        return record.range_start_m, record.range_stop_m or record.rings * record.ring_step_m

    @property
    def weather(self) -> Weather:
        """Rain, fog and gases of the plan."""
        return from_json(Weather, self.record.weather, f"{self.path / RUN_FILE}: weather")


def open_run(path: str | Path) -> Run:
    """Open a run's folder and check its plan.

    Parameters
    ----------
    path
        Folder that holds ``run.json``.

    Returns
    -------
    Run
        The run; no render is read.

    Raises
    ------
    FrameFileError
        The folder holds no run, or its plan is damaged.
    SchemaError
        The plan is of a newer schema.
    ConfigError
        Its numbers do not fit together (ring step zero, pulse longer than the pulse interval...).
    """
    path = Path(path)
    if not os.path.isdir(path):
        refusal = refusal_to_open(path) or "is not a folder"
        blend = path.suffix == ".blend" and refusal == "is not a folder"
        remedy = f" radarsim render {path} --out DIR measures one." if blend else ""
        raise FrameFileError(
            f"{path} {refusal}. Give the folder of a run: the one that holds {RUN_FILE}.{remedy}"
        )
    where = path / RUN_FILE
    record = read_record(where, RunRecord)
    if not record.frames or len(record.frames) != len(record.frame_times_s):
        raise FrameFileError(
            f"{where} lists {len(record.frames)} frames and {len(record.frame_times_s)} times; "
            "expected as many of both, at least one. Render the run again."
        )
    if record.sampling_mode not in ("rings", "paths"):
        raise SchemaError(
            f"{where}: sampling mode {record.sampling_mode!r:.60}; this version reads 'rings' and "
            "'paths'. Update radarsim to process this run."
        )
    if record.snapshots == 2 and record.snapshot_interval_s <= 0:
        raise ConfigError(
            f"{where}: snapshot interval is {record.snapshot_interval_s!r} s; expected more than 0 "
            "for two snapshots. Set it in the Radar tab and render the run again."
        )
    if record.width_px * record.height_px > MAX_PIXELS:
        raise FrameFileError(
            f"{where}: {record.width_px} x {record.height_px} pixels; expected at most "
            f"{MAX_PIXELS}. Render the run again."
        )
    try:
        waveform = waveform_from_dict(dict(record.waveform), path)
        burst = burst_from_dict(dict(record.burst))
        return Run(path, record, Radar(waveform, burst, channels_from_dict(record.channels)))
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from error


def shared_plan(record: RunRecord) -> dict[str, Any]:
    """Return the part of a plan on which all processes of a run agree: plain JSON with float
    numbers, to be compared.
    """
    # processes of one run may differ in these fields
    shared = dataclasses.replace(record, findings=[], fingerprint="", blend_file="", extra={})
    plain = json.dumps(dataclasses.asdict(shared))
    found: dict[str, Any] = json.loads(plain, parse_int=float)
    return found


#: Fields of a plan that no setting gives alone: they follow from the scene and from other fields.
_NO_SETTINGS = ("frame_times_s", "versions", "range_encoding_length_m")
#: Characters of the longest value that a change shows.
_LONGEST = 40


def plan_changes(earlier: RunRecord, now: RunRecord) -> list[str]:
    """Return the settings in which two plans differ, one text each: "array: 3x4 -> none"."""
    unset = set(_NO_SETTINGS)
    if earlier.sampling_mode == now.sampling_mode == "paths":
        unset |= {"rings", "ring_step_m"}  # they say how far the scene reaches
    pair = (shared_plan(record) for record in (earlier, now))
    before, after = ({k: v for k, v in plan.items() if k not in unset} for plan in pair)
    return list(_changes(before, after))


def _changes(before: dict[str, Any], after: dict[str, Any], within: str = "") -> Iterator[str]:
    for name in dict.fromkeys([*before, *after]):
        old, new = before.get(name), after.get(name)
        if isinstance(old, dict) and isinstance(new, dict) and old and new:
            yield from _changes(old, new, f"{name}.")
        elif old != new:
            shown = [_value_text(name, value) for value in (old, new)]
            text = " -> ".join(shown) if shown[0] != shown[1] else "other values"
            yield f"{within}{'array' if name == 'channels' else name}: {text}"


def _value_text(name: str, value: Any) -> str:
    if value in (None, "", [], {}):
        return "none"
    if name == "channels":
        return "x".join(str(len({str(one[end]) for one in value})) for end in ("tx", "rx"))
    if name == "frames":
        return frames_text(value, value).split(" ", 1)[1].replace(".0", "")
    text = f"{value:.12g}" if isinstance(value, float) else str(value)
    return text if len(text) <= _LONGEST else "set"


def frame_findings(folder: Path, frames: Iterable[int]) -> list[Finding]:
    """Return the findings in the records of these frames, as far as the frames are done. Frames of
    rings have no such findings.
    """
    found: list[Finding] = []
    for frame in frames:
        path = folder / frame_dir(frame) / PATHS_FILE
        if path.is_file():
            found += read_record(path, PathsRecord).findings
    return found


def done_before_text(run: Run, frames: Sequence[int]) -> str:
    """Return one line about frames that were rendered before: number of paths or images, standard
    errors, number of findings.
    """
    where = f"{frames_text(frames, run.record.frames)}: done before"
    if run.record.sampling_mode != "paths":
        return f"{where}; {sum(run.frame(frame).planned for frame in frames)} images"
    records = [read_record(run.frame(frame).path / PATHS_FILE, PathsRecord) for frame in frames]
    paths = sum(record.path_count for record in records)
    errors = sorted(record.relative_error for record in records if record.path_count)
    texts = [percent_text(error) for error in (*errors[:1], *errors[-1:])]
    known = " to ".join(dict.fromkeys(texts)) or "unknown"
    count = len(merge(item for record in records for item in record.findings))
    return (
        f"{where}; {paths:,} paths, standard error {known}, "
        f"{count} finding{'' if count == 1 else 's'}"
    )
