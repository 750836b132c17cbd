# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim process`` by workers: the same files, frames that fail, signals; folders and links."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import pytest

from radarsim_addon import frame_worker
from radarsim_addon.coordinator import LocalWorkers
from radarsim_addon.errors import OutputError, WorkerError
from radarsim_addon.frame_worker import close, run_frame
from radarsim_addon.signal import Burst, ProcessOptions, Radar, Waveform, process_run
from radarsim_addon.signal.pipeline import main
from tests.signal.synthetic import Setup, points, write_run
from tests.worker_processes import (
    children,
    differences,
    finished,
    products,
    runs,
    start,
)

posix = pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="finds workers by /proc")

FRAMES = tuple(range(1, 5))
SETUP = Setup(
    rings=2,
    frames=FRAMES,
    radar=Radar(Waveform(5.3e9, 50e6, 2.5e-6, 60e6), Burst(1000.0, 64)),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with a moving target, its products by one process, and one more folder for others."""
    path = tmp_path_factory.mktemp("run") / "run"
    return write_run(path, SETUP, points(SETUP, [(5, 6, 400.0, 5.0, 1e-6)]))


@pytest.fixture(scope="module")
def alone(folder: Path) -> dict[str, bytes]:
    # a process of its own: other tests may have changed the settings of this one's pictures
    finished("process", folder, "--hdf5")
    return products(folder)


def test_workers_write_the_same_files(
    folder: Path, alone: dict[str, bytes], tmp_path: Path
) -> None:
    """Pictures, the animation with its common colours and HDF5, too; both keep what is done."""

    def printed(*words: str) -> str:
        out = finished("process", folder, "--hdf5", *words, "--out", tmp_path / "products")
        assert not differences(products(tmp_path), alone)
        return out

    out = printed("--workers", "2")
    assert "range_doppler.gif" in alone and "frame_0004.h5" in alone
    assert f"{len(FRAMES)}/{len(FRAMES)} frames, 100 %" in out
    assert sorted(line.split(":")[0] for line in out.splitlines() if line.startswith("frame ")) == [
        f"frame {number}" for number in FRAMES
    ]
    for frame in (2, 4):
        (tmp_path / f"products/frame_{frame:04d}_summary.json").unlink()
    assert printed().count("done before") == 2
    assert printed("--workers", "2").count("done before") == len(FRAMES)


def test_a_cluster_that_is_not_there_is_named(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("radarsim_addon.coordinator._TIMEOUT_S", 0.5)
    assert main(["process", str(folder), "--dask", "tcp://127.0.0.1:9"]) == 2
    assert "No Dask scheduler answers at 'tcp://127.0.0.1:9'" in capsys.readouterr().err


def test_a_frame_that_fails_is_set_aside_and_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_run(tmp_path / "run", SETUP, points(SETUP, [(5, 6, 400.0, 5.0, 1e-6)]))
    exr = path / "frames/frame_0003/ring_001_t0.exr"
    exr.write_bytes(exr.read_bytes()[:200])
    assert main(["process", str(path), "--no-plots", "--workers", "2"]) == 1
    error = capsys.readouterr().err
    assert "WorkerError: 1 of 4 frames failed 3 times and were set aside" in error
    assert "frame 3: FrameFileError" in error and exr.name in error
    written = {file.name[:10] for file in (path / "products").iterdir()}
    assert written == {f"frame_{n:04d}" for n in FRAMES if n != 3}


@posix
def test_a_signal_ends_workers_and_leaves_whole_files(folder: Path, tmp_path: Path) -> None:
    """SIGINT; tests/blender/headless/test_workers.py sends SIGTERM."""
    out = tmp_path / "products"
    process = start("process", folder, "--workers", 2, "--out", out)
    while process.poll() is None and not list(out.glob("*_summary.json")):
        time.sleep(0.01)
    workers = children(process)
    process.send_signal(signal.SIGINT)
    error = process.communicate(timeout=60)[1]
    assert process.returncode == 128 + signal.SIGINT, error
    assert "Interrupted; files written so far are whole" in error
    assert workers and not any(map(runs, workers))
    assert not list(out.glob(".part*"))


def test_an_answer_holds_the_error_and_closes_the_run(folder: Path, tmp_path: Path) -> None:
    words = ["process", str(folder), "--no-plots", "--out", str(tmp_path)]
    try:
        assert run_frame(str(tmp_path), words, None) == {"frames": list(FRAMES)}
        assert run_frame(str(tmp_path), words, 99)["error"] == "FrameFileError"
        assert "frame_0002_map.npz" not in os.listdir(tmp_path)
        assert run_frame(str(tmp_path), words, 2)["frame"] == 2
        # the next call of the command, in a worker process that outlived this one
        (first,) = frame_worker._open.values()
        for frame in (2, 1):
            assert run_frame(str(tmp_path), words, frame, "next call")["frame"] == frame
            (later,) = frame_worker._open.values()
            assert later is not first
        assert "frame_0002_map.npz" in os.listdir(tmp_path)
    finally:
        close()


def test_a_worker_that_cannot_start_says_why() -> None:
    code = "import sys; print('no such module', file=sys.stderr); sys.exit(3)"
    with (
        LocalWorkers([sys.executable, "-c", code], 2) as workers,
        pytest.raises(WorkerError, match=r"exit code 3 before it began\. no such module"),
    ):
        workers.open()


# -- folders ---------------------------------------------------------------------------------------
def test_a_refused_process_leaves_no_folder(folder: Path, tmp_path: Path) -> None:
    path = write_run(tmp_path / "run", SETUP, points(SETUP, []))
    (path / "frames/frame_0001/ring_000_t0.exr").unlink()
    assert main(["process", str(path)]) == 1
    assert not (path / "products").exists()
    (path / "products").mkdir()  # the user's own stays
    assert main(["process", str(path)]) == 1
    assert (path / "products").is_dir()


@pytest.mark.skipif(os.name != "posix", reason="links need rights elsewhere")
def test_links_at_folders(folder: Path, tmp_path: Path) -> None:
    """One that the user names is followed, if it leads somewhere; one inside the run is refused."""
    quick = ProcessOptions(products=False, plots=False)
    elsewhere, link = tmp_path / "elsewhere", tmp_path / "link"
    link.symlink_to(elsewhere)
    with pytest.raises(OutputError, match=r"link is a symbolic link to .*elsewhere, which does"):
        list(process_run(folder, quick, out=link, frames=[1]))
    elsewhere.mkdir()
    list(process_run(folder, quick, out=link, frames=[1]))
    assert (elsewhere / "frame_0001_map.npz").is_file()
    run = write_run(tmp_path / "run", SETUP, points(SETUP, []))
    (run / "products").symlink_to(tmp_path)
    with pytest.raises(OutputError, match=r"products is a symbolic link; expected a folder"):
        list(process_run(run, quick))
    assert not list(tmp_path.glob("frame_*"))
