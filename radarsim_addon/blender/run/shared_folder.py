# SPDX-License-Identifier: GPL-3.0-or-later
"""A run's folder that several processes may write at the same time. Does not import bpy.

The first process is the coordinator: it tidies the folder up and writes ``run.json``. Others join
it if they measure the same. Frames are claimed by leases, one at a time; nothing else is locked.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Generator, Iterable, Sequence
from pathlib import Path
from typing import Any

from ... import contract
from ...atomic_files import make_folder
from ...errors import OutputError
from ...sidecar import read_record, write_record
from ...signal.runs import shared_plan
from . import output_folder
from .leases import STALE_S, Lease, Leases

#: Lease of the process that opens the folder. It is held for a moment only.
_OPENING = "run"
_POLL_S = 0.1


class FramesHeldError(OutputError):
    """Other processes hold all frames that are left."""


class SharedFolder:
    """A run's folder, which exists, and the frames of it that this process has claimed."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        # Beside run.json, where a look for them costs the same however many frames there are.
        self._leases = Leases(folder)
        self._lease: Lease | None = None
        self._plan: dict[str, Any] = {}
        self._fingerprint = ""
        self._ours: tuple[int, ...] = ()

    def open(self, record: contract.RunRecord, overwrite: bool) -> None:
        """Write the plan of a run, or join the processes that are at work on it.

        With `overwrite`, the frames in the folder are removed.
        """
        self._plan, self._fingerprint = shared_plan(record), record.fingerprint
        with self._opening_lease():
            others = self.workers()
            if others:
                self._refuse_another_run(" and ".join(others))
                return
            output_folder.open_folder(self._folder, record, overwrite)
            write_record(self._folder / contract.RUN_FILE, record)
            make_folder(self._folder / contract.FRAMES_DIR, within=self._folder)
            for left in self._folder.glob("*.lease"):  # of processes that are gone
                # Another may have claimed a frame since, and look for us when we have finished.
                if self._leases.holder(left.name.split(".")[0]) is None:
                    with contextlib.suppress(OSError):
                        left.unlink()

    def join(self, record: contract.RunRecord) -> None:
        """Take the plan that is there for this process's, if it is; else OutputError.

        Nothing is written and nothing tidied up: thousands may join at the same time.
        """
        self._plan, self._fingerprint = shared_plan(record), record.fingerprint
        self._refuse_another_run("Another process")

    def workers(self) -> list[str]:
        """Return who has claimed frames of this folder, each once."""
        found = self._leases.holders()
        return sorted({who for name, who in found.items() if name != _OPENING})

    def holders(self, frames: Iterable[int]) -> list[str]:
        """Return who has claimed which of some frames."""
        found = (self._leases.holder(_name(frame)) for frame in frames)
        return list(dict.fromkeys(who for who in found if who is not None))

    def claimed(self, frames: Sequence[int]) -> Generator[int, None, list[int]]:
        """Claim frames, one after another; each is given back when the next one is asked for.

        Another process may have measured one since: look. Frames of other processes come last,
        since some may fail. Returned are frames that are left to others.
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
                    output_folder.clear_partial_frame(self._folder, frame)
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
        """Renew the lease of the frame; False where another process has taken the frame over."""
        return self._lease is not None and self._lease.renew()

    def close(self) -> None:
        """Give back what is claimed. May be called again."""
        if self._lease is not None:
            self._lease.release()
            self._lease = None

    # -- details -----------------------------------------------------------------------------------

    def _claim(self, frame: int) -> Lease | None:
        """Claim a frame while nobody opens the folder, and see that the plan is still ours."""
        deadline_s = time.monotonic() + 2 * STALE_S
        while time.monotonic() < deadline_s:
            output_folder.check_there(self._folder)
            lease = self._leases.claim(_name(frame))
            if lease is None:
                return None
            # Whoever opens the folder looks for leases after this one of its own: it has seen ours,
            # or we see its, or the plan that it has written.
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
        """Whether the plan in the folder is that of our run; the same file is read once."""
        path = self._folder / contract.RUN_FILE
        with contextlib.suppress(OSError):
            found = path.stat()
            version = (found.st_ino, found.st_mtime_ns, found.st_size)
            if version != self._ours and self._is_ours(read_record(path, contract.RunRecord)):
                self._ours = version
            return version == self._ours
        return False

    def _is_ours(self, record: contract.RunRecord) -> bool:
        """Whether a plan is that of our run."""
        return record.fingerprint == self._fingerprint and shared_plan(record) == self._plan

    def _refuse_another_run(self, others: str) -> None:
        earlier = output_folder.earlier_run(self._folder)
        if earlier is None or not self._is_ours(earlier):
            raise OutputError(
                f"{others} is rendering another run into the output folder "
                f"{self._folder} already (scene, frames or settings differ). Wait for it, stop it, "
                "or choose another folder."
            )


def _name(frame: int) -> str:
    return Path(contract.frame_dir(frame)).name
