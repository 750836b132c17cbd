# SPDX-License-Identifier: GPL-3.0-or-later
"""Process a run inside Blender, in a process of its own where there is a window."""

from __future__ import annotations

import functools
import json
import queue
import subprocess
import tempfile
import threading
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ... import errors
from ...errors import OutputError
from ...findings import Finding, from_json
from ...processes import own_folder
from .frame_views import FrameView, read_view
from .processing_worker import processing_records
from .result_pictures import FrameProfile, profile_of
from .worker_process import python_program, start_worker


@dataclass
class ProcessedRun:
    """A run as the window shows it: files of its frames in a folder of the session.

    `fingerprint` is that of its plan, `scene_uid` the number of its scene in this session.
    """

    folder: tempfile.TemporaryDirectory[str]
    fingerprint: str = ""
    scene_uid: int = 0
    frames: list[int] = field(default_factory=list)
    profiles: list[FrameProfile] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.view = functools.lru_cache(maxsize=4)(self._read)

    def _read(self, frame: int) -> FrameView:
        return read_view(Path(self.folder.name), frame)

    def close(self) -> None:
        """Remove its files."""
        self.folder.cleanup()


class ProcessingJob:
    """Processing of a run folder in steps; `close` ends it before its end.

    With `apart` a process of its own does it, so that no step takes long. `words`: options of
    `radarsim process`.
    """

    def __init__(self, folder: Path, apart: bool = False, words: Sequence[str] = ()) -> None:
        #: What there is to show; belongs to the caller once the last step is done.
        self.result = ProcessedRun(tempfile.TemporaryDirectory(prefix="radarsim_"))
        views = Path(self.result.folder.name)
        own_folder(views)
        self._worker: subprocess.Popen[str] | None = None
        self._waiting: Iterator[dict[str, Any] | None]
        if apart and python_program() is not None:
            self._waiting = self._records_of_worker(folder, views, words)
        else:
            self._waiting = processing_records(folder, views, words)
        self._done = False
        self.fraction = 0.0
        self.text = "Processing"
        self.findings: list[Finding] = []

    @property
    def frames(self) -> list[int]:
        """Frames that are processed."""
        return self.result.frames

    def step(self) -> bool:
        """Do one step; return whether it was the last one, and `result` is complete.

        Raises a `RadarSimError` where the run is incomplete or damaged.
        """
        for record in self._waiting:
            if record is not None:
                self._take(record)
            return False
        self._done = True
        return True

    def close(self) -> None:
        """End the process, if it still runs, and remove the files of an unfinished one."""
        if self._worker is not None:
            self._worker.kill()
            self._worker.wait()
        if not self._done:
            self.result.close()

    def _take(self, record: dict[str, Any]) -> None:
        if "error" in record:
            raise getattr(errors, record["kind"], errors.RadarSimError)(record["error"])
        self.text = record["text"]
        self.fraction = record.get("fraction", self.fraction)
        if "frame" in record:
            self.findings += [from_json(item, "Findings") for item in record["findings"]]
            self.result.frames.append(record["frame"])
            self.result.profiles.append(profile_of(self.result.view(record["frame"])))

    def _records_of_worker(
        self, folder: Path, views: Path, words: Sequence[str]
    ) -> Iterator[dict[str, Any] | None]:
        """Records as they come; None while there is none."""
        complaints = Path(views, "errors.txt")
        with open(complaints, "w", encoding="utf-8") as stderr:
            self._worker = start_worker(
                "blender.ui.processing_worker",
                str(folder),
                str(views),
                *words,
                stdout=subprocess.PIPE,
                stderr=stderr,
                encoding="utf-8",
            )
        lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        stream = self._worker.stdout
        assert stream is not None
        reader = threading.Thread(target=_copy, args=(stream, lines), daemon=True)
        reader.start()
        while reader.is_alive() or not lines.empty():
            yield None if lines.empty() else json.loads(lines.get())
        if self._worker.wait():
            said = complaints.read_text(encoding="utf-8", errors="replace").strip()
            raise OutputError(
                f"Processing ended with code {self._worker.returncode}: {said[-300:] or 'no words'}"
                f". Process {folder} with `radarsim process` to see all of it."
            )


def _copy(stream: Iterable[str], lines: queue.SimpleQueue[str]) -> None:
    for line in stream:
        lines.put(line)
