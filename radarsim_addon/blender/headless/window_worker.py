# SPDX-License-Identifier: GPL-3.0-or-later
"""The process that measures for a window.

It reads the order of a `SceneCopy` as a message and measures the copy. It writes these messages:
"began" with findings, "progress", and finally "end", "stopped" or "fault". It stops when a second
message arrives, or when its input ends because the window has been closed. It always removes the
copy.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import threading
import time
import traceback
from pathlib import Path
from typing import IO, Any

from ...errors import RadarSimError
from ...findings import finding, to_json
from ...messages import Message, open_messages, read_message, write_message
from ..plan import parse_render_arguments
from ..run import MeasurementJob
from .console import quiet_blender
from .scene_copy import open_copy
from .session import leave_blender, open_job

#: Time between two messages of progress [s].
_PAUSE_S = 0.1
#: Time for the current step to end after the window was closed [s].
_GRACE_S = 5.0
#: Least rays of a run from whose time the time of a ray follows.
_MANY_RAYS = 100_000


class _Stop:
    """Whether the window has stopped the run or was closed. A thread waits for it."""

    def __init__(self, reading: IO[bytes], folder: Path) -> None:
        self.asked = False
        self._reading, self._folder = reading, folder
        threading.Thread(target=self._wait, daemon=True).start()

    def _wait(self) -> None:
        while read_message(self._reading) is not None:
            self.asked = True
        self.asked = True
        time.sleep(_GRACE_S)
        shutil.rmtree(self._folder, ignore_errors=True)
        os._exit(1)


class _Writer:
    """Writes messages to the window."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._last_s = 0.0

    def write(self, kind: str, **fields: Any) -> None:
        with contextlib.suppress(OSError):  # the window is gone
            write_message(self._stream, {"kind": kind, **fields}, {})

    def progress(self, job: MeasurementJob) -> None:
        """Write the progress of a job, unless it was written a moment ago."""
        now_s = time.monotonic()
        if now_s - self._last_s >= _PAUSE_S:
            self._last_s = now_s
            self.write(
                "progress",
                done=job.done,
                total=job.total,
                fraction=job.fraction,
                seconds_left=job.seconds_left,
                stage=job.stage,
            )


def _measure(order: Message, stop: _Stop, writer: _Writer) -> None:
    fields = order.fields
    arguments = parse_render_arguments([fields["file"]])
    arguments.scene, arguments.view_layer = fields["scene"], fields["view_layer"]
    arguments.rig, arguments.overwrite = fields["radar"], fields["overwrite"]
    with quiet_blender():
        job = open_job(arguments, lambda: open_copy(order))
        if fields["handlers"]:
            found = finding("handlers-not-run", *fields["handlers"], frame=fields["frame"])
            job.early_findings.append(found)
        job.file_name = Path(fields["original"]).name
        job.prepare()
        try:
            writer.write(
                "began",
                unit=job.unit,
                folder=str(job.folder),
                total=job.total,
                frames=list(job.frames),
                fingerprint=job.fingerprint,
                findings=[to_json(item) for item in job.findings],
            )
            began_s = time.monotonic()
            for task in job.pending():
                if stop.asked:
                    writer.write("stopped", done=job.done, total=job.total)
                    return
                job.start(task)
                writer.progress(job)
                job.render(task)
                job.finish(task)
            per_ray_s = None
            rays = getattr(job, "rays", 0)
            if rays > _MANY_RAYS and not job.options.refines:  # type: ignore[attr-defined]
                per_ray_s = (time.monotonic() - began_s) / rays
        finally:
            job.leave()
    writer.write(
        "end",
        total=job.total,
        summary=job.summary,
        seconds_per_ray=per_ray_s,
        findings=[to_json(item) for item in job.findings],
    )


def main() -> None:
    """Measure what the window orders, then end Blender."""
    reading, writing = open_messages()
    order = read_message(reading)
    if order is None:
        leave_blender(1)
        return
    folder = Path(order.fields["file"]).parent
    stop, writer = _Stop(reading, folder), _Writer(writing)
    code = 0
    try:
        _measure(order, stop, writer)
    except RadarSimError as error:
        writer.write("fault", name=type(error).__name__, text=str(error))
        code = error.exit_code
    except Exception:
        traceback.print_exc()  # a defect: the window shows the end of it
        code = 1
    shutil.rmtree(folder, ignore_errors=True)
    leave_blender(code)


if __name__ == "__main__":
    main()
