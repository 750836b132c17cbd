# SPDX-License-Identifier: GPL-3.0-or-later
"""Writers by name: registered once, called in order, their old files removed."""

from __future__ import annotations

from pathlib import Path

import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.signal import FrameResult, ProcessOptions, process_run
from radarsim_addon.signal.products import (
    frame_file,
    frame_result,
    remove_stale,
    result_writer,
    write_result,
)
from radarsim_addon.signal.products.frame_result import writer_names
from tests.signal.synthetic import Setup, points, write_run


@pytest.fixture
def result(tmp_path: Path) -> FrameResult:
    setup = Setup(rings=2)
    folder = write_run(tmp_path / "run", setup, points(setup, [(1, 1, 300.0, 0.0, 1.0)]))
    events = process_run(folder, ProcessOptions(products=False, plots=False))
    return next(event for event in events if isinstance(event, FrameResult))


@pytest.fixture(autouse=True)
def own_registry(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frame_result, "_WRITERS", dict(frame_result._WRITERS))


def test_every_format_has_a_writer() -> None:
    assert writer_names() == (
        "csv", "exr", "hdf5", "json", "npz", "parquet", "png", "points", "sigmf"
    )  # fmt: skip


def test_a_new_writer_is_called_and_its_old_files_go(result: FrameResult, tmp_path: Path) -> None:
    @result_writer("text", ".txt", "_more.txt")
    def write_text(found: FrameResult, folder: Path) -> list[Path]:
        path = frame_file(folder, found.frame, ".txt")
        path.write_text(f"{found.statistics.counts.paths} paths", "utf-8")
        return [path]

    stale, foreign = tmp_path / "frame_0001_more.txt", tmp_path / "frame_0002_more.txt"
    stale.touch()
    foreign.touch()
    files = write_result(result, tmp_path, ["json", "text"])
    assert [path.name for path in files] == ["frame_0001_summary.json", "frame_0001.txt"]
    assert files[1].read_text("utf-8") == "1 paths"
    remove_stale(tmp_path, 1, files)
    assert not stale.exists()
    assert foreign.exists() and all(path.exists() for path in files)


def test_names_are_known_and_taken_once(result: FrameResult, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"No writer is called 'cphd'.*'sigmf'"):
        write_result(result, tmp_path, ["cphd"])
    with pytest.raises(ValueError, match="registered already"):
        result_writer("npz")
    with pytest.raises(ValueError, match="registered already"):
        result_writer("npy", "_map.npz")


def test_writers_without_contents_write_nothing(result: FrameResult, tmp_path: Path) -> None:
    assert result.detections is None
    assert write_result(result, tmp_path, ["csv"]) == []
