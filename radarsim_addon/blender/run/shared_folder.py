# SPDX-License-Identifier: GPL-3.0-or-later
"""A run's folder that several processes may write at the same time. Does not import bpy.

`SharedFolder` is the folder as a run uses it. The first process is the coordinator: it removes old
files (`open_folder`) and writes ``run.json``. Other processes join if they measure the same run.
Each process claims frames by leases, one at a time; nothing else is locked.

A lease is a file that exactly one process can create (`Leases.claim`). Its owner renews it every
10 s. A lease that was not renewed for 60 s, by the clock of the file server, is stale. Another
process may then create a lease of the next generation, which replaces it. So processes on several
machines share a folder without a lock, and take over the frames of a killed process. On the owner's
own machine, a lease is stale as soon as its process has ended.
"""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import tempfile
import threading
import time
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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
from ...processes import identity, is_gone
from ...signal.runs import plan_changes, shared_plan
from ...typed_json import file_sha256, read_record, write_record
from ..plan import Task

# -------------------------------------------------------------------------------------------------
# The run's folder: made, checked, compared with an earlier run, tidied up.
# -------------------------------------------------------------------------------------------------


def prepare_folder(folder: Path) -> None:
    """Make the output folder if its parent exists, and test whether it is writable."""
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
    """Check that the folder of a run, and that of a frame, are still there.

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
    """Return the record of the run in the folder; None for a folder without frames.

    OutputError: the folder has frames, but no readable ``run.json`` that names their run.
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


def open_folder(folder: Path, record: contract.RunRecord, overwrite: bool) -> list[str]:
    """Prepare the folder for a run. Keep its own frames; remove or refuse those of another run.
    Return the settings that have changed since the earlier run.

    `overwrite` removes the frames of an earlier run. Without it, they are removed only if `record`
    is of a scene in memory and the earlier run is of the same file and scene.
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
    remove_temporaries(folder)  # which a killed run has left half written
    for frame_folder in (folder / contract.FRAMES_DIR).glob("frame_*"):
        _clear_partial(frame_folder, remove_temporaries)
    return [] if earlier is None else plan_changes(earlier, record)


def _check_replaceable(
    folder: Path, earlier: contract.RunRecord, record: contract.RunRecord
) -> None:
    """Check that a run may replace an earlier one without `overwrite`; OutputError if not."""
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
    """Return the names of the file and the scene of a run, for messages."""
    file = f"{record.blend_file!r}" if record.blend_file else "a file that was never saved"
    return f"{file}, scene {record.scene!r}" if record.scene else file


def clear_run(folder: Path) -> None:
    """Remove the files and products of an earlier run, and no file of anything else."""
    # The plan is removed last: if this is interrupted, the remaining frames still have their plan.
    products = folder / contract.PRODUCTS_DIR
    # A frame's summary goes first: products without it are not taken for whole ones.
    patterns = "frame_*_summary.json", "frame_[0-9]*_*", "range_doppler.*", "antennas.png"
    made = [path for pattern in patterns for path in products.glob(pattern)]
    for path in dict.fromkeys([*made, *_own_files(folder), folder / contract.RUN_FILE]):
        remove_file(path)


def _clear_partial(frame_folder: Path, remove: Callable[[Path], None]) -> None:
    for place in (frame_folder, *frame_folder.glob("burst_*")):
        remove(place)
        remove(place / contract.TILES_DIR)


def is_done(folder: Path, task: Task, fingerprint: str) -> bool:
    """Return whether a render of a run is complete: the sidecar is there, and the EXR that it names
    has the same bytes.
    """
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


# -------------------------------------------------------------------------------------------------
# Leases: which process works on which part of a run's folder.
# -------------------------------------------------------------------------------------------------


#: Time between two renewals of a lease, and the age from which it is stale [s].
BEAT_S, STALE_S = 10.0, 60.0

_SUFFIX = ".lease"
#: Leases are some hundred bytes; a larger file is none.
_MAX_BYTES = 4096
#: Tries to create a lease, while others try, too; and the time between them [s].
_TRIES, _PAUSE_S = 40, 0.02


@dataclass(frozen=True)
class _Seen:
    """A lease file: its generation, its content, and the time of its renewal by the server."""

    generation: int
    path: Path
    content: bytes
    renewed_s: float


class Lease:
    """A lease that this process owns; see `Leases.claim`."""

    def __init__(self, leases: Leases, name: str, path: Path, content: bytes) -> None:
        self.name = name
        self._leases, self._path, self._content = leases, path, content

    def renew(self) -> bool:
        """Renew the lease; False if another process has taken over."""
        try:
            # One open file: if another process replaces it meanwhile, nobody uses this one.
            with open(self._path, "rb+") as stream:
                if stream.read(_MAX_BYTES) != self._content:
                    return False
                stream.seek(0)
                stream.write(self._content)
                stream.flush()
                os.fsync(stream.fileno())
            return self._leases.newest(self.name) == self._path
        except FileNotFoundError:
            return False
        except OSError as error:
            raise _unusable(self._path, error) from error

    def release(self) -> None:
        """Give the lease back. May be called again."""
        self._leases.forget(self)
        with contextlib.suppress(OSError, OutputError):  # else it becomes stale
            if self.renew():
                self._path.unlink()

    def __enter__(self) -> Lease:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


class Leases:
    """Leases in a folder. A lease that was not renewed for `stale_s` [s] is stale."""

    def __init__(self, folder: Path, beat_s: float = BEAT_S, stale_s: float = STALE_S) -> None:
        self._folder, self._beat_s, self._stale_s = folder, beat_s, stale_s
        self._held: list[Lease] = []
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None

    def claim(self, name: str) -> Lease | None:
        """Take the lease of a name, such as "frame_0001"; None if another process holds it.

        A thread renews it until it is released.
        """
        content = json.dumps(identity() | {"token": secrets.token_hex(16)}).encode()
        for _ in range(_TRIES):
            seen = self._seen(name)
            if seen is not None and not self._is_stale(seen):
                return None
            generation = 1 if seen is None else seen.generation + 1
            path = self._folder / f"{name}.{generation:06d}{_SUFFIX}"
            try:
                handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
            except FileExistsError:
                time.sleep(_PAUSE_S)
                continue
            except OSError as error:
                raise _unusable(path, error) from error
            with os.fdopen(handle, "wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            # The stale lease must still be there: else its successor has come and gone meanwhile,
            # and the generations have begun again.
            if self.newest(name) != path or not _still_there(seen):
                path.unlink(missing_ok=True)
                time.sleep(_PAUSE_S)
                continue
            for _, older in self._files(name)[:-1]:
                with contextlib.suppress(OSError):
                    older.unlink(missing_ok=True)
            lease = Lease(self, name, path, content)
            self._keep(lease)
            return lease
        return None

    def holder(self, name: str) -> str | None:
        """Return who holds a lease, such as "process 12 on tower"; None if nobody does."""
        seen = self._seen(name)
        if seen is None or self._is_stale(seen):
            return None
        owner = _owner(seen)
        return f"process {owner.get('pid', '?')} on {owner.get('host', '?')}"

    def holders(self) -> dict[str, str]:
        """Return the holder of each lease of the folder, by the name of the lease."""
        names = {path.name.split(".")[0] for path in self._folder.glob(f"*{_SUFFIX}")}
        found = {name: self.holder(name) for name in sorted(names)}
        return {name: who for name, who in found.items() if who is not None}

    def newest(self, name: str) -> Path | None:
        """Return the newest file of a lease."""
        files = self._files(name)
        return files[-1][1] if files else None

    def forget(self, lease: Lease) -> None:
        """Stop renewing a lease."""
        with self._lock:
            if lease in self._held:
                self._held.remove(lease)
            if not self._held:
                self._stopped.set()
                self._thread = None

    def _keep(self, lease: Lease) -> None:
        with self._lock:
            self._held.append(lease)
            if self._thread is None:
                self._stopped = threading.Event()
                self._thread = threading.Thread(
                    target=self._renew_all, args=(self._stopped,), daemon=True, name="leases"
                )
                self._thread.start()

    def _renew_all(self, stopped: threading.Event) -> None:
        while not stopped.wait(self._beat_s):
            with self._lock:
                held = list(self._held)
            for lease in held:
                with contextlib.suppress(OutputError):  # the owner finds out before it publishes
                    lease.renew()

    def _files(self, name: str) -> list[tuple[int, Path]]:
        """Return the files of a lease, the oldest generation first."""
        found = []
        for path in self._folder.glob(f"{name}.*{_SUFFIX}"):
            digits = path.name[len(name) + 1 : -len(_SUFFIX)]
            if digits.isdecimal():
                found.append((int(digits), path))
        return sorted(found)

    def _seen(self, name: str) -> _Seen | None:
        for generation, path in reversed(self._files(name)):
            found = _read(path)
            if found is not None:
                return _Seen(generation, path, *found)
        return None

    def _is_stale(self, seen: _Seen) -> bool:
        """Return whether the process of a lease has ended, or has not renewed it for too long."""
        age_s = self._server_time_s() - seen.renewed_s
        # A lease from the future was left when a clock was wrong: its owner would have renewed
        # it. One without content has just been created, or its owner was killed then.
        return is_gone(_owner(seen)) or abs(age_s) > self._stale_s

    def _server_time_s(self) -> float:
        """Return the time of the file server: that of a file which is written now."""
        probe = self._folder / f".clock-{secrets.token_hex(8)}.part"
        try:
            with open(probe, "xb") as stream:
                stream.write(b"\0")
                stream.flush()
                os.fsync(stream.fileno())
                return os.fstat(stream.fileno()).st_mtime
        except OSError as error:
            raise _unusable(probe, error) from error
        finally:
            with contextlib.suppress(OSError):
                probe.unlink(missing_ok=True)


def _read(path: Path) -> tuple[bytes, float] | None:
    """Return the content of a lease and the time of its renewal; None if there is none."""
    try:
        with open(path, "rb") as stream:  # a network file system looks again only when it opens
            return stream.read(_MAX_BYTES), os.fstat(stream.fileno()).st_mtime
    except FileNotFoundError:
        return None
    except OSError as error:
        raise _unusable(path, error) from error


def _still_there(seen: _Seen | None) -> bool:
    """Return whether no other lease has replaced a stale one yet."""
    found = None if seen is None else _read(seen.path)
    return seen is None or (found is not None and found[0] == seen.content)


def _owner(seen: _Seen) -> dict[str, Any]:
    if not seen.content:
        return {}
    try:
        found = json.loads(seen.content)
    except ValueError:
        found = None
    if not isinstance(found, dict) or not isinstance(found.get("pid"), int):
        raise OutputError(
            f"{seen.path} is not a lease of radarsim. Remove it if no other program needs it."
        )
    return found


def _unusable(path: Path, error: OSError) -> OutputError:
    return OutputError(
        f"Cannot use {path}, which shows who works in the output folder: "
        f"{error.strerror or error}. Choose an output folder that is there and is writable."
    )


#: Lease of the process that opens the folder. It is held for a moment only.
_OPENING = "run"
_POLL_S = 0.1


class FramesHeldError(OutputError):
    """Other processes hold all remaining frames."""


class SharedFolder:
    """The existing folder of a run, and the frames that this process has claimed in it."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        # Next to run.json, where finding them costs the same for any number of frames.
        self._leases = Leases(folder)
        self._lease: Lease | None = None
        self._plan: dict[str, Any] = {}
        self._fingerprint = ""
        self._ours: tuple[int, ...] = ()

    def open(self, record: contract.RunRecord, overwrite: bool) -> list[str]:
        """Write the plan of a run, or join the processes that measure it.

        With `overwrite`, the frames in the folder are removed. Return what has changed since the
        earlier run of the folder.
        """
        self._plan, self._fingerprint = shared_plan(record), record.fingerprint
        with self._opening_lease():
            others = self.workers()
            if others:
                self._refuse_another_run(" and ".join(others))
                return []
            changes = open_folder(self._folder, record, overwrite)
            write_record(self._folder / contract.RUN_FILE, record)
            make_folder(self._folder / contract.FRAMES_DIR, within=self._folder)
            for left in self._folder.glob("*.lease"):  # of processes that are gone
                # Another may have claimed a frame since, and look for us when we have finished.
                if self._leases.holder(left.name.split(".")[0]) is None:
                    with contextlib.suppress(OSError):
                        left.unlink()
            return changes

    def join(self, record: contract.RunRecord) -> None:
        """Check that the plan in the folder is the one of this process; OutputError if not.

        No file is written or removed, so that thousands may join at the same time.
        """
        self._plan, self._fingerprint = shared_plan(record), record.fingerprint
        self._refuse_another_run("Another process")

    def workers(self) -> list[str]:
        """Return the processes that have claimed frames of this folder, each once."""
        found = self._leases.holders()
        return sorted({who for name, who in found.items() if name != _OPENING})

    def holders(self, frames: Iterable[int]) -> list[str]:
        """Return the holders of some frames, by frame."""
        found = (self._leases.holder(_name(frame)) for frame in frames)
        return list(dict.fromkeys(who for who in found if who is not None))

    def claimed(self, frames: Sequence[int]) -> Generator[int, None, list[int]]:
        """Claim frames, one after another. Each is released when the next one is requested.

        Another process may have measured a frame since. Frames that others hold come last, because
        some may fail. Return the frames that other processes keep.
        """
        waiting, some = list(frames), False
        while waiting:
            left = []
            for frame in waiting:
                self._lease = self._claim(frame)
                if self._lease is None:
                    left.append(frame)
                    continue
                with self._lease:
                    # Files of processes on this machine that are gone.
                    _clear_partial(self._folder / contract.frame_dir(frame), remove_abandoned)
                    yield frame
                self._lease = None
            if len(left) == len(waiting):
                break
            waiting, some = left, True
        if waiting and not some:
            raise FramesHeldError(
                f"{' and '.join(self.holders(waiting)) or 'Another process'} is rendering into the "
                f"output folder {self._folder} already, and no frame is left. Wait for it, stop "
                "it, or choose another folder."
            )
        return waiting

    def keeps_frame(self) -> bool:
        """Renew the lease of the frame; return False if another process has taken it over."""
        return self._lease is not None and self._lease.renew()

    def close(self) -> None:
        """Release the claimed frame. May be called again."""
        if self._lease is not None:
            self._lease.release()
            self._lease = None

    def _claim(self, frame: int) -> Lease | None:
        """Claim a frame while no process opens the folder, and check that the plan is ours."""
        deadline_s = time.monotonic() + 2 * STALE_S
        while time.monotonic() < deadline_s:
            check_there(self._folder)
            lease = self._leases.claim(_name(frame))
            if lease is None:
                return None
            # A process that opens the folder first creates a lease, then looks for others: either
            # it has seen ours, or we see its lease or the plan that it has written.
            if self._leases.holder(_OPENING) is None:
                if self._plan_is_ours():
                    return lease
                lease.release()
                raise OutputError(
                    f"Another process has written another plan into {self._folder} (its "
                    f"{contract.RUN_FILE} has changed). Start again to continue that run, or "
                    "choose another folder."
                )
            lease.release()
            time.sleep(_POLL_S)
        return None

    def _opening_lease(self) -> Lease:
        deadline_s = time.monotonic() + 2 * STALE_S
        while time.monotonic() < deadline_s:
            lease = self._leases.claim(_OPENING)
            if lease is not None:
                return lease
            time.sleep(_POLL_S)
        raise OutputError(
            f"{self._leases.holder(_OPENING) or 'Another process'} keeps opening the output "
            f"folder {self._folder}. Choose another folder, or wait for it."
        )

    def _plan_is_ours(self) -> bool:
        """Return whether the plan in the folder is ours. An unchanged file is read once."""
        path = self._folder / contract.RUN_FILE
        with contextlib.suppress(OSError):
            found = path.stat()
            version = (found.st_ino, found.st_mtime_ns, found.st_size)
            if version != self._ours and self._is_ours(read_record(path, contract.RunRecord)):
                self._ours = version
            return version == self._ours
        return False

    def _is_ours(self, record: contract.RunRecord) -> bool:
        return record.fingerprint == self._fingerprint and shared_plan(record) == self._plan

    def _refuse_another_run(self, others: str) -> None:
        earlier = earlier_run(self._folder)
        if earlier is None or not self._is_ours(earlier):
            raise OutputError(
                f"{others} is rendering another run into the output folder "
                f"{self._folder} already (scene, frames or settings differ). Wait for it, stop it, "
                "or choose another folder."
            )


def _name(frame: int) -> str:
    return Path(contract.frame_dir(frame)).name
