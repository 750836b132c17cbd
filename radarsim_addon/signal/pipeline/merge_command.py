# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim merge``: one run folder of parts that were measured apart."""

from __future__ import annotations

import dataclasses
import errno
import itertools
import os
import shutil
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from ...atomic_files import cannot_write, make_folder
from ...contract import MOTION_FILE, PRODUCTS_DIR, RUN_FILE, RunRecord, frame_dir
from ...errors import ConfigError, FrameFileError, OutputError, SchemaError
from ...findings import frames_text, merge
from ...sidecar import check_digest, file_sha256, write_record
from ..paths import frame_motion, open_frame_table
from ..pictures import ANTENNA_PICTURE
from ..products import SUMMARY_ENDING
from ..results import frame_file
from ..runs import RadarFrame, Run, open_run, shared_plan
from .console import Subcommands

#: Fields in which parts of a run may differ: each names its own frames.
_FRAMES = ("frames", "frame_times_s")


def add_merge_parser(commands: Subcommands) -> None:
    """Add ``merge`` to the commands."""
    parser = commands.add_parser(
        "merge",
        help="one run of parts that were measured into folders of their own",
        epilog="example: radarsim merge run part_1 part_2 part_3",
    )
    parser.add_argument("out", metavar="DIR", help="new folder of the whole run")
    parser.add_argument("parts", metavar="PART", nargs="+", help="folder of a part: holds run.json")


def merge_parts(out: str | Path, parts: Sequence[str | Path]) -> int:
    """Merge parts of a run, with their products; print what is there. Returns the exit code.

    Files are linked where disk and file system allow it, else copied. A frame that several parts
    hold is taken from the first one where it is complete. All files with digests are compared with
    these before anything is written; a `RadarSimError` names the first that differs.
    """
    folder, runs = Path(out), [open_run(part) for part in parts]
    record = _merged_record(runs)
    if os.path.isdir(folder) and any(folder.iterdir()):
        raise OutputError(f"{folder} is not empty. Give a new folder for the whole run.")
    sources: dict[int, tuple[Path, list[Path]]] = {}
    for run in runs:
        for frame in run.frames():
            if frame.number not in sources and not frame.missing():
                sources[frame.number] = run.path, _checked_files(frame)
    make_folder(folder)  # not before all parts are found whole
    for run in runs:
        picture = run.path / PRODUCTS_DIR / ANTENNA_PICTURE
        _put(run.path, folder, [picture] if picture.exists() else [])
    for root, files in sources.values():
        _put(root, folder, files)
    # last: an interrupted merge is no run
    write_record(folder / RUN_FILE, record)
    print(f"radarsim: {len(sources)} of {len(record.frames)} frames in {folder}")
    left = tuple(number for number in record.frames if number not in sources)
    if left:
        text = frames_text(left, record.frames)
        print(f"radarsim: {text}: complete in no part; radarsim render resumes the run")
    return 0


def _merged_record(runs: Sequence[Run]) -> RunRecord:
    """The plan of all parts; ConfigError where they are not parts of one run."""
    first = runs[0].record
    for run in runs[1:]:
        here, there = shared_plan(first), shared_plan(run.record)
        names = [name for name in here if name not in _FRAMES and here[name] != there[name]]
        if run.record.fingerprint != first.fingerprint:
            names.append("scene, settings or software")
        if names:
            raise ConfigError(
                f"{run.path} and {runs[0].path} are no parts of one run: they differ in "
                f"{', '.join(names)}. Render parts with --shard I/N, which plans all frames alike."
            )
    times = {
        number: time_s
        for run in runs
        for number, time_s in zip(run.record.frames, run.record.frame_times_s, strict=True)
    }
    same = all(run.record.frames == first.frames for run in runs)
    frames = first.frames if same else sorted(times)
    return dataclasses.replace(
        first,
        frames=list(frames),
        frame_times_s=[times[number] for number in frames],
        findings=merge([item for run in runs for item in run.record.findings]),
        # how far all frames reach together is not known where each part looked at its own
        extra=first.extra if same else {k: v for k, v in first.extra.items() if k != "extent"},
    )


def _checked_files(frame: RadarFrame) -> list[Path]:
    """Files of a frame and its products; a named error where a file is not as it was written."""
    frame.scene()
    if frame.sampling_mode == "paths":
        for render in map(frame.of_burst, range(frame.visibility_updates)):
            record, _ = open_frame_table(render.path, frame.number, frame.record.fingerprint)
            frame_motion(render.path, record)
    else:
        for ring, snapshot in itertools.product(range(frame.rings), range(frame.snapshots)):
            frame.image(ring, snapshot)
    root = frame.run.path
    files = list(_files(root / frame_dir(frame.number)))
    for path in files:
        if path.suffix == ".json" and path.name != MOTION_FILE:
            check_digest(path)
    return [*files, *_checked_products(root / PRODUCTS_DIR, frame.number)]


def _checked_products(folder: Path, frame: int) -> list[Path]:
    """Products of a frame; a named error where one is not as its summary has it."""
    summary = frame_file(folder, frame, SUMMARY_ENDING)
    fields = check_digest(summary) if summary.is_file() else {}
    for name, digest in fields.get("files_sha256", {}).items():
        path = folder / name
        if not path.is_file() or file_sha256(path) != digest:
            raise SchemaError(
                f"{path} is missing or was changed: its SHA-256 is not that in {summary.name}. "
                "Process this part again."
            )
    return sorted(folder.glob(f"frame_{frame:04d}_*"))


def _files(folder: Path) -> Iterator[Path]:
    """Files of a frame, of all its renders."""
    for path in sorted(folder.rglob("*")):
        if path.is_symlink():
            raise FrameFileError(f"{path} is a symbolic link; expected a file. Put it there.")
        if path.is_file():
            yield path


def _put(root: Path, folder: Path, files: Iterable[Path]) -> None:
    """Link or copy files of a part to the same places in the whole."""
    for source in files:
        target = make_folder((folder / source.relative_to(root)).parent) / source.name
        try:
            try:
                os.link(source, target)
            except OSError as error:
                if error.errno == errno.EEXIST:
                    continue
                shutil.copyfile(source, target)
        except OSError as error:
            raise cannot_write(target, error) from error
