# SPDX-License-Identifier: GPL-3.0-or-later
"""Processing for the window: in a process of its own, no step of which holds the window up."""

from __future__ import annotations

import contextlib
import stat
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.ui import worker_process
from radarsim_addon.blender.ui.result_pictures import KINDS
from radarsim_addon.blender.ui.shown_results import ProcessingJob
from radarsim_addon.errors import FrameFileError, OutputError
from radarsim_addon.messages import Message
from radarsim_addon.signal import pipeline
from radarsim_addon.signal.pictures import answer_request
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


@pytest.fixture
def scene(addon: Any) -> Any:
    return rs.ring_scene()


def pictures(job: ProcessingJob) -> list[np.ndarray]:
    view = job.result.view(job.frames[-1])
    fields = {
        "number": 1, "folder": job.result.folder.name, "frames": job.frames, "frame": view.frame,
        "span_db": 80.0, "width_px": 600, "chosen": None,
    }  # fmt: skip
    found = [
        answer_request(Message({**fields, "kind": name}, {})).arrays["png"]
        for name, kind in KINDS.items()
        if kind.needs in view.arrays
    ]
    job.result.close()
    return found


def test_nothing_is_processed_here_and_the_pictures_are_the_same(
    scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The window's process only reads records; progress is seen on the way."""
    rs.run(tmp_path, snapshots=2)
    with (
        monkeypatch.context() as patch,
        contextlib.closing(ProcessingJob(tmp_path, apart=True)) as apart,
    ):
        patch.setattr(pipeline, "process_run", None)  # whoever calls it fails
        fractions, ended = set(), False
        while not ended:
            ended = apart.step()
            fractions.add(apart.fraction)
            time.sleep(0.005)
        shown = pictures(apart)
    assert len(fractions) > 3 and max(fractions) == 1.0
    assert apart.frames == [1]
    with contextlib.closing(ProcessingJob(tmp_path)) as here:
        while not here.step():
            pass
        assert here.text == apart.text
        assert here.findings == apart.findings
        assert len(shown) == len(KINDS) - 1  # no spectrogram was asked for
        for one, other in zip(shown, pictures(here), strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("apart", [False, True])
def test_processing_needs_a_whole_run(scene: Any, tmp_path: Path, apart: bool) -> None:
    rs.run(tmp_path, limit=1)
    job = ProcessingJob(tmp_path, apart)
    with contextlib.closing(job), pytest.raises(FrameFileError, match="lacks"):
        while not job.step():
            time.sleep(0.005)


def test_a_stop_ends_the_process(scene: Any, tmp_path: Path) -> None:
    rs.run(tmp_path)
    job = ProcessingJob(tmp_path, apart=True)
    assert not job.step()
    assert job._worker is not None
    worker, views = job._worker._process, Path(job.result.folder.name)
    assert worker.poll() is None and views.is_dir()
    job.close()
    assert worker.poll() is not None
    assert not views.exists()
    job.close()


def test_a_worker_that_fails_is_named(
    scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rs.run(tmp_path / "run")
    broken = tmp_path / "python"
    broken.write_text("#!/bin/sh\necho 'no numpy here' >&2\nexit 3\n")
    broken.chmod(broken.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr(worker_process, "python_program", lambda: str(broken))
    job = ProcessingJob(tmp_path / "run", apart=True)
    with contextlib.closing(job), pytest.raises(OutputError, match="code 3: no numpy here"):
        while not job.step():
            time.sleep(0.005)


_SENDS_TO_AN_ENDED_PROCESS = """
import gc, signal, time
if hasattr(signal, "SIGPIPE"):
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # as in the Blender program
import numpy as np
from radarsim_addon.blender.ui.worker_process import WorkerProcess
from radarsim_addon.messages import Message
for _ in range(2):
    worker = WorkerProcess("signal.draft.worker")
    worker.send(Message({"kind": "nothing"}, {"much": np.zeros(1 << 22)}))
    time.sleep(0.05)
    worker.close()
    del worker
    gc.collect()
    time.sleep(0.2)
print("alive")
"""


def test_blender_survives_a_worker_that_ends_while_it_is_written_to() -> None:
    """Blender does not ignore the signal of a broken pipe, as Python's own program does."""
    done = subprocess.run(
        [sys.executable, "-c", _SENDS_TO_AN_ENDED_PROCESS],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout.split()[-1:]) == (0, ["alive"]), done.stderr
