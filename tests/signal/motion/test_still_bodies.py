# SPDX-License-Identifier: GPL-3.0-or-later
"""Stationary bodies in a file of their own: read as if they were in the motion file."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.contract import MotionRecord
from radarsim_addon.errors import FrameFileError, SchemaError
from radarsim_addon.signal.motion import (
    BodyMotion,
    FrameMotion,
    StillBodies,
    body_record,
    read_motion,
    write_still_bodies,
)
from radarsim_addon.signal.motion.body_motion import Segment
from radarsim_addon.typed_json import file_sha256, write_record

SPAN_S = 0.02
#: Which of the six bodies move.
MOVING = (1, 4)


def body(number: int) -> BodyMotion:
    pose = np.eye(4)
    pose[:3] += 0.1 * np.random.default_rng(number).normal(size=(3, 4))
    if number not in MOVING:
        return BodyMotion(pose)
    return BodyMotion(pose, (Segment(0.0, SPAN_S, np.array([pose[:3, 3], [0.1, 0.0, 0.0]])),))


BODIES = [body(number) for number in range(6)]
NAMES = [(f"Stein {number}", f"Fläche/{number}") for number in range(6)]


def record(chosen: list[int]) -> MotionRecord:
    still = BodyMotion(np.eye(4))
    return MotionRecord(
        frame=1,
        time_s=0.0,
        duration_s=SPAN_S,
        samples=17,
        receiver_kind="perspective",
        antennas=[body_record(name, "", still, False) for name in "CT"],
        bodies=[body_record(*NAMES[n], BODIES[n], False) for n in chosen],
        displacement_error_bound_m=0.0,
        displacement_error_bound_wavelengths=0.0,
        approximated_motion_fraction=0.0,
        unknown_motion_fraction=0.0,
        deforming_surfaces_file="",
        deforming_surfaces_sha256="",
    )


def file_of(chosen: list[int]) -> StillBodies:
    names, instances = zip(*(NAMES[n] for n in chosen), strict=True)
    pose = np.stack([BODIES[n].pose for n in chosen])
    return StillBodies(1 + np.array(chosen), pose, names, instances)


def read(folder: Path, motion: MotionRecord) -> FrameMotion:
    write_record(folder / contract.MOTION_FILE, motion)
    return read_motion(folder, 1, file_sha256(folder / contract.MOTION_FILE))


def apart(folder: Path, bodies: StillBodies) -> MotionRecord:
    """The record of what moves, and a file of these."""
    path = write_still_bodies(folder, bodies)
    return dataclasses.replace(
        record(list(MOVING)),
        still_bodies_file=path.name,
        still_bodies_sha256=file_sha256(path),
    )


STILL = [n for n in range(6) if n not in MOVING]


def test_they_are_read_as_if_they_were_in_the_motion_file(tmp_path: Path) -> None:
    together = read(tmp_path, record(list(range(6))))
    found = read(tmp_path, apart(tmp_path, file_of(STILL)))
    assert found.body_keys == together.body_keys
    assert list(found.boxes) == list(together.boxes)
    assert len(found.bodies) == len(together.bodies) == 6
    for mine, other in zip(found.bodies, together.bodies, strict=True):
        np.testing.assert_array_equal(mine.pose, other.pose)
        assert (mine.moving, mine.epoch_offset_s) == (other.moving, other.epoch_offset_s)
    assert [n for n, one in enumerate(found.bodies) if one.moving] == list(MOVING)


def test_the_file_is_the_same_each_time(tmp_path: Path) -> None:
    first = write_still_bodies(tmp_path, file_of(STILL)).read_bytes()
    assert write_still_bodies(tmp_path, file_of(STILL)).read_bytes() == first


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"number": np.array([1, 3, 4, 7])}, "numbers must ascend and lie between 1 and 6"),
        ({"number": np.array([1, 4, 3, 6])}, "numbers must ascend and lie"),
        ({"number": np.array([0, 3, 4, 6])}, "numbers must ascend and lie"),
        ({"number": np.array([1.0, 3.0, 4.0, 6.0])}, "number holds values of type float64"),
        ({"pose": np.full((4, 4, 4), np.nan)}, "poses that are not finite"),
        ({"pose": np.zeros((4, 3, 4))}, r"poses of shape \(4, 3, 4\)"),
        ({"object": ["one"]}, "1 objects and 4 instances"),
    ],
)
def test_what_is_no_list_of_bodies_is_named(
    tmp_path: Path, change: dict[str, object], said: str
) -> None:
    wrong = dataclasses.replace(file_of(STILL), **change)  # type: ignore[arg-type]
    with pytest.raises(FrameFileError, match=said):
        read(tmp_path, apart(tmp_path, wrong))


REMEDY = r"Render the run again: it renders this frame and keeps the others\.$"


def test_damaged_files_are_named(tmp_path: Path) -> None:
    """By what happened, all with the same advice."""
    motion = apart(tmp_path, file_of(STILL))
    path = tmp_path / contract.STILL_BODIES_FILE
    whole = path.read_bytes()
    other = dataclasses.replace(motion, still_bodies_file="other.npz")
    with pytest.raises(SchemaError, match=r"names the file 'other\.npz' of .*" + REMEDY):
        read(tmp_path, other)
    write_still_bodies(tmp_path, dataclasses.replace(file_of(STILL), instance=["", "", "", ""]))
    with pytest.raises(SchemaError, match=r"was changed, or belongs to another frame\. " + REMEDY):
        read(tmp_path, motion)
    unreadable = r"cannot be read as stationary bodies \(.*\)\. " + REMEDY
    for count in (0, 10, len(whole) // 2, len(whole) - 50):
        path.write_bytes(whole[:count])
        with pytest.raises(FrameFileError, match=unreadable):
            read(tmp_path, motion)
    np.savez(path, number=np.array([{}], dtype=object))
    with pytest.raises(FrameFileError, match="holds Python objects.*" + REMEDY):
        read(tmp_path, motion)
    np.savez(path, number=np.arange(1, 5))
    with pytest.raises(FrameFileError, match="pose is missing.*" + REMEDY):
        read(tmp_path, motion)
    path.unlink()
    with pytest.raises(FrameFileError, match=r"is missing\. " + REMEDY):
        read(tmp_path, motion)
    path.mkdir()
    with pytest.raises(FrameFileError, match=unreadable):
        read(tmp_path, motion)


def test_every_changed_byte_is_found(tmp_path: Path) -> None:
    motion = apart(tmp_path, file_of(STILL))
    path = tmp_path / contract.STILL_BODIES_FILE
    whole = path.read_bytes()
    for place in range(0, len(whole), 37):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        with pytest.raises((FrameFileError, SchemaError), match=REMEDY):
            read(tmp_path, motion)
