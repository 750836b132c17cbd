# SPDX-License-Identifier: GPL-3.0-or-later
"""Warnings of many frames are said once, with their frames."""

from pathlib import Path

import pytest

from radarsim_addon.framewarnings import FrameWarnings, frames_text
from radarsim_addon.signal.pipeline import main
from tests.signal.synthetic import Setup, points, write_run


def test_frames_that_follow_one_another_are_joined() -> None:
    assert frames_text([3], [1, 2, 3]) == "frame 3"
    assert frames_text([1, 2, 3], [1, 2, 3]) == "frames 1-3"
    assert frames_text([1, 2, 4, 6], [1, 2, 3, 4, 5, 6]) == "frames 1-2, 4, 6"
    # every second frame was asked for
    assert frames_text([1, 3, 7], [1, 3, 5, 7]) == "frames 1-3, 7"


def collected(*frames: list[str]) -> list[str]:
    """Lines of frames 1, 2..."""
    found = FrameWarnings()
    for number, texts in enumerate(frames, 1):
        found.add(number, texts)
    return found.lines()


def test_a_single_frame_is_not_named() -> None:
    assert collected(["It is so."]) == ["It is so."]


def test_numbers_that_change_become_a_span() -> None:
    texts = [f"{share} % lie in cells of fewer than 40 (median 1e{n:+03d} m)." for n, share in
             ((-5, 37), (2, 9), (0, 1_200))]  # fmt: skip
    (line,) = collected(*([text] for text in texts), [])
    assert line == (
        "frames 1-3: 9 to 1200 % lie in cells of fewer than 40 (median 1e-05 to 1e+02 m)."
    )
    assert collected(["1,024 rows"], ["300 rows"]) == ["frames 1-2: 300 to 1,024 rows"]


def test_names_are_no_numbers() -> None:
    found = collected(
        ["'Wall 2' is open."], ["'Wall 3' is open."], ["Cube.001 is."], ["Cube.002 is."]
    )
    assert found == [
        "frame 1: 'Wall 2' is open.",
        "frame 2: 'Wall 3' is open.",
        "frame 3: Cube.001 is.",
        "frame 4: Cube.002 is.",
    ]
    # an apostrophe opens no name
    (line,) = collected(["Blender's 5 m, world's"], ["Blender's 7 m, world's"])
    assert line == "frames 1-2: Blender's 5 to 7 m, world's"


def test_several_of_one_kind_in_a_frame_stay_apart() -> None:
    assert collected(["Layer 1 leaks.", "Layer 2 leaks."]) == ["Layer 1 leaks.", "Layer 2 leaks."]


def test_process_says_each_warning_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    setup = Setup(frames=(1, 2, 3))
    # beyond +-14.1 m/s at 1000 Hz: folded, in every frame
    write_run(tmp_path / "run", setup, points(setup, [(5, 6, 600.0, 30.0, 1e-6)]))
    assert main(["process", str(tmp_path / "run"), "--no-plots"]) == 0
    lines = capsys.readouterr().out.splitlines()
    found = [line for line in lines if line.lstrip().startswith("warning")]
    (warning,) = found
    assert warning.startswith("warning: frames 1-3: 1 paths move faster than the unambiguous 14.14")
