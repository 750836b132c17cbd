# SPDX-License-Identifier: GPL-3.0-or-later
"""Processing resumes: what is kept, what is done again, and that no byte tells the difference."""

from __future__ import annotations

import dataclasses
import itertools
import json
import shutil
from pathlib import Path

import pytest

from radarsim_addon.contract import RUN_FILE
from radarsim_addon.signal import (
    Burst,
    Cfar,
    FrameResult,
    ProcessOptions,
    Radar,
    Waveform,
    process_run,
)
from radarsim_addon.signal.pipeline import main
from tests.signal.synthetic import Setup, points, run_record, write_run
from tests.worker_processes import differences, products

FRAMES = (1, 2, 3, 4)
SETUP = Setup(
    rings=2,
    frames=FRAMES,
    radar=Radar(Waveform(5.3e9, 50e6, 2.5e-6, 60e6), Burst(1000.0, 64)),
)
ECHOES = [(5, 6, 300.0, 5.0, 1e-6)]
QUICK = ProcessOptions(products=False, plots=False, animate=True, cfar=Cfar(pfa=1e-12))


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run, processed without a break."""
    folder = write_run(tmp_path_factory.mktemp("run") / "run", SETUP, points(SETUP, ECHOES))
    assert processed(folder) == list(FRAMES)
    return folder


@pytest.fixture
def folder(done: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(done, tmp_path / "run"))


def processed(folder: Path, options: ProcessOptions = QUICK) -> list[int]:
    """Resume; the frames that were not kept."""
    events = process_run(folder, options, resume=True)
    return [event.frame for event in events if isinstance(event, FrameResult)]


def test_an_interrupted_run_is_the_same_in_the_end(done: Path, tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", SETUP, points(SETUP, ECHOES))
    events = process_run(folder, QUICK, resume=True)
    results = (event for event in events if isinstance(event, FrameResult))
    assert [event.frame for event in itertools.islice(results, 2)] == [1, 2]
    events.close()
    kept = {path: path.stat().st_mtime_ns for path in (folder / "products").iterdir()}
    assert processed(folder) == [3, 4]
    assert all(path.stat().st_mtime_ns == time_ns for path, time_ns in kept.items())
    assert not differences(products(folder), products(done))
    assert "range_doppler.gif" in products(done)


def test_all_is_kept_and_its_findings_are_said(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["process", str(folder), "--no-plots", "--receive-antenna-gain-dbi", "1"]
    first = main(words), capsys.readouterr().out
    again = main(words), capsys.readouterr().out
    assert again[0] == first[0]
    assert again[1].count("done before") == len(FRAMES) and "done before" not in first[1]
    findings = [
        [x for x in out.splitlines() if "warning" in x.lower()] for _, out in (first, again)
    ]
    assert findings[0] == findings[1]
    assert main([*words, "--again"]) == first[0]
    assert capsys.readouterr().out == first[1]


@pytest.mark.parametrize(
    "change",
    [
        {"range_taper": "hann"},
        {"radar": dataclasses.replace(SETUP.radar, burst=Burst(1000.0, 32))},
        {"cfar": Cfar(pfa=1e-3)},
        {"hdf5": True},
        {"sigmf": True},
    ],
)
def test_other_settings_do_all_again(folder: Path, change: dict[str, object]) -> None:
    assert processed(folder, dataclasses.replace(QUICK, **change)) == list(FRAMES)


def test_products_of_other_settings_never_stay_next_to_a_summary(folder: Path, done: Path) -> None:
    """Stopped between the files of a frame: these are of one setting, those of another."""
    other = dataclasses.replace(QUICK, range_taper="hann")
    events = process_run(folder, other, resume=True)
    for event in events:
        if not isinstance(event, FrameResult) and event.text.startswith("frame 1: products"):
            break
    events.close()
    assert products(folder)["frame_0001_map.npz"] != products(done)["frame_0001_map.npz"]
    assert processed(folder) == [1]
    assert not differences(products(folder), products(done))


def test_what_is_damaged_is_done_again(folder: Path, done: Path) -> None:
    place = folder / "products"
    (place / "frame_0001_profile.npz").unlink()
    (place / "frame_0002_map.npz").write_bytes(b"short")
    (place / "frame_0003_summary.json").write_text("{")
    assert processed(folder) == [1, 2, 3]
    assert not differences(products(folder), products(done))


@pytest.mark.parametrize("suffix", [".json", ".npz"])
def test_a_folder_in_a_files_place_ends_no_run(folder: Path, suffix: str) -> None:
    """Who needs the file names it; this one is nobody's."""
    (folder / f"frames/frame_0001/odd{suffix}").mkdir()
    assert processed(folder) == [1]
    assert processed(folder) == []


def test_a_frame_that_was_measured_again_is_processed(folder: Path) -> None:
    changed = write_run(folder.parent / "other", SETUP, points(SETUP, [(5, 6, 310.0, 5.0, 1e-6)]))
    shutil.copytree(changed / "frames/frame_0003", folder / "frames/frame_0003", dirs_exist_ok=True)
    assert processed(folder) == [3]


def test_more_frames_and_another_version(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    more = dataclasses.replace(SETUP, frames=(*FRAMES, 5))
    write_run(folder.parent / "other", more, points(more, ECHOES))
    shutil.copytree(folder.parent / "other/frames/frame_0005", folder / "frames/frame_0005")
    plan = dataclasses.asdict(run_record(more))
    (folder / RUN_FILE).write_text(json.dumps(plan))
    assert processed(folder) == [5]
    monkeypatch.setattr(
        "radarsim_addon.signal.pipeline.process._software", lambda: {"radarsim": "9.9.9"}
    )
    assert processed(folder) == [*FRAMES, 5]
