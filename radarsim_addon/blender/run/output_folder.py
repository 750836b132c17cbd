# SPDX-License-Identifier: GPL-3.0-or-later
"""The run's folder: made, checked, compared with what an earlier run left, tidied up. No bpy."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from ... import contract
from ...atomic_files import (
    TEMPORARY_PATTERN,
    cannot_make,
    cannot_write,
    make_folder,
    remove_abandoned,
    remove_file,
    remove_temporaries,
)
from ...errors import OutputError, RadarSimError
from ...sidecar import file_sha256, read_record
from ..plan import Task


def prepare_folder(folder: Path) -> None:
    """Make the output folder if its parent exists, and try whether it can be written to."""
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise cannot_make(folder, error) from error
    try:
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(b"\0" * 4096)
    except OSError as error:
        raise cannot_write(folder, error) from error


def check_there(folder: Path, frame: int | None = None) -> None:
    """See that the folder of a run that is going on, and that of a frame, are still there.

    A new folder would contain a run without its plan.
    """
    if not (folder / contract.RUN_FILE).is_file():
        what = f"was emptied ({contract.RUN_FILE} is gone)" if folder.is_dir() else "has vanished"
        raise OutputError(
            f"The output folder {folder} {what} while the run was going on: it was removed or "
            "renamed, or its drive is gone. Put it back to resume the run, or start a "
            "new one."
        )
    if frame is not None and not (folder / contract.frame_dir(frame)).is_dir():
        raise OutputError(
            f"The folder {folder / contract.frame_dir(frame)} has vanished while the run was going "
            "on: it was removed or renamed. Start again; the other frames are kept."
        )


def make_frame_folder(folder: Path, frame: int, render: int = 0) -> None:
    """Make the folder of a radar frame, or of one of the renders of its burst."""
    check_there(folder)
    make_folder(folder / contract.burst_dir(frame, render), within=folder)


def earlier_run(folder: Path) -> contract.RunRecord | None:
    """The run whose files are in the folder; None for a folder without frames.

    OutputError: there are frames, but no readable ``run.json`` that says of which run.
    """
    run_file = folder / contract.RUN_FILE
    try:
        return read_record(run_file, contract.RunRecord)
    except RadarSimError as error:
        if not run_file.exists() and not any(_own_files(folder)):
            return None
        raise OutputError(
            f"The output folder {folder} holds frames of an unknown run ({error}) "
            "Choose another folder, or overwrite (Radar > Measure, or --overwrite)."
        ) from error


def open_folder(folder: Path, record: contract.RunRecord, overwrite: bool) -> None:
    """Prepare the folder for a run: keep frames of this run, remove or refuse those of another.

    Frames of an earlier run are removed with `overwrite`, and without it where `record` is of a
    scene in memory and the earlier run is of the same file and scene.
    """
    earlier = None
    try:
        earlier = earlier_run(folder)
    except OutputError:
        if not overwrite:
            raise
        clear_run(folder)
    if earlier is not None and (overwrite or earlier.fingerprint != record.fingerprint):
        if not overwrite:
            _check_replaceable(folder, earlier, record)
        clear_run(folder)
    clear_partial(folder)


def _check_replaceable(
    folder: Path, earlier: contract.RunRecord, record: contract.RunRecord
) -> None:
    """See that a run may replace an earlier one without being told to; OutputError if not."""
    remedy = "Choose another folder, or overwrite (Radar > Measure, overwrite=True, --overwrite)."
    if (earlier.blend_file, earlier.scene) != (record.blend_file, record.scene):
        raise OutputError(
            f"The output folder {folder} holds the run of another scene: {scene_text(earlier)}; "
            f"this is {scene_text(record)}. {remedy}"
        )
    if record.extra["resumable"]:
        raise OutputError(
            f"The output folder {folder} holds frames of another run (the scene's files, sampling "
            "mode, ring step, snapshots, resolution, samples, seed, carrier of physical materials "
            f"or software differ, or a script or the window measured it). {remedy}"
        )


def scene_text(record: contract.RunRecord) -> str:
    """Return the file and the scene of a run for messages.

    Parameters
    ----------
    record
        Plan of the run.

    Returns
    -------
    str
    """
    file = f"{record.blend_file!r}" if record.blend_file else "a file that was never saved"
    return f"{file}, scene {record.scene!r}" if record.scene else file


def clear_run(folder: Path) -> None:
    """Remove the files of an earlier run and its products; nothing that is not ours."""
    # The plan goes last: a clearing that is interrupted leaves frames of the earlier run, which
    # nobody mistakes for frames of the next one.
    products = folder / contract.PRODUCTS_DIR
    # A frame's summary goes first: products without it are not taken for whole ones.
    patterns = "frame_*_summary.json", "frame_[0-9]*_*", "range_doppler.*", "antennas.png"
    made = [path for pattern in patterns for path in products.glob(pattern)]
    for path in dict.fromkeys([*made, *_own_files(folder), folder / contract.RUN_FILE]):
        remove_file(path)


def clear_partial(folder: Path) -> None:
    """Remove what a killed run left half written."""
    remove_temporaries(folder)
    for place in (folder / contract.FRAMES_DIR).glob("frame_*"):
        _clear_partial(place, remove_temporaries)


def clear_partial_frame(folder: Path, frame: int) -> None:
    """Remove what processes that were killed on this machine left half written in a frame."""
    _clear_partial(folder / contract.frame_dir(frame), remove_abandoned)


def _clear_partial(frame_folder: Path, remove: Callable[[Path], None]) -> None:
    for place in (frame_folder, *frame_folder.glob("burst_*")):
        remove(place)
        remove(place / contract.TILES_DIR)


def is_done(folder: Path, task: Task, fingerprint: str) -> bool:
    """Whether a render of a run is there: sidecar of it, EXR as the sidecar says, byte for byte."""
    try:
        record = read_record(folder / task.sidecar_path, contract.RenderRecord)
        exr = folder / task.exr_path
        own = record.run_fingerprint == fingerprint and record.exr_file == exr.name
        return own and file_sha256(exr) == record.exr_sha256
    except (RadarSimError, OSError):
        return False


def _own_files(folder: Path) -> list[Path]:
    patterns = (
        "ring_*_t[01].exr",
        "ring_*_t[01].json",
        contract.PATHS_TABLE,
        contract.PATHS_FILE,
        contract.MOTION_FILE,
        contract.DEFORMING_SURFACES_FILE,
        contract.STILL_BODIES_FILE,
        "burst_*/*",
        f"burst_*/{contract.TILES_DIR}/*",
        contract.GROUND_TRUTH_FILE,
        f"{contract.TILES_DIR}/*",
        TEMPORARY_PATTERN,
    )
    frames = folder / contract.FRAMES_DIR
    found = (path for pattern in patterns for path in frames.glob(f"frame_*/{pattern}"))
    return [path for path in found if not path.is_dir()]  # a burst holds a folder of tiles
