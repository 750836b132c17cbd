# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions of many stationary bodies: the same as a list of each one's motion."""

from __future__ import annotations

import numpy as np
import pytest

from radarsim_addon.signal.motion import BodyMotion, BodyMotions, fit_body, which_move


def moving() -> BodyMotion:
    times_s = np.linspace(0.0, 0.1, 17)
    poses = np.tile(np.eye(4), (times_s.size, 1, 1))
    poses[:, 0, 3] = 5.0 * times_s
    return fit_body(times_s, poses, 0.1, 1.0)


def test_they_are_those_of_a_list() -> None:
    poses = np.tile(np.eye(4), (6, 1, 1))
    poses[:, 1, 3] = np.arange(6)
    noisy = BodyMotion(poses[4], noise_m=1e-6)
    found = BodyMotions(poses, {1: moving(), 4: noisy}, 0.02)
    assert found[1].moving
    assert found[np.int32(4)] is noisy  # type: ignore[call-overload]
    assert len(found) == len(list(found)) == 6
    for at in (0, 2, 3, 5):
        assert found[at].epoch_offset_s == 0.02
        assert not found[at].moving
        assert np.array_equal(found[at].pose, poses[at])
    assert found[-1].pose[1, 3] == 5
    with pytest.raises(IndexError):
        found[6]
    assert which_move(found).tolist() == which_move(list(found)).tolist()
    assert which_move(found).tolist() == [False, True, False, False, False, False]
    assert which_move(BodyMotions(poses[:0], {})).tolist() == which_move([]).tolist() == []


def test_a_part_of_them_is_one_of_the_list() -> None:
    poses = np.tile(np.eye(4), (6, 1, 1))
    poses[:, 1, 3] = np.arange(6)
    found = BodyMotions(poses, {0: moving(), 3: moving()}, 0.02)
    for part in (slice(2, None), slice(None, None, -1), slice(1, 6, 2), slice(4, 4)):
        apart, listed = found[part], list(found)[part]
        assert len(apart) == len(listed)
        assert which_move(apart).tolist() == [one.moving for one in listed]
        for one, other in zip(apart, listed, strict=True):
            assert np.array_equal(one.pose, other.pose)
            assert one.epoch_offset_s == other.epoch_offset_s
