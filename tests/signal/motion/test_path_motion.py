# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of paths: constant rates, and motions that were joined and picked from."""

import numpy as np
import pytest

from radarsim_addon.signal.motion import JoinedMotion, LinearMotion, join_motion
from radarsim_addon.signal.paths import Paths, make_paths

TIMES_S = np.array([0.0, 0.5, 2.0])


def test_constant_rate_lengthens_a_path_at_twice_the_range_rate():
    motion = LinearMotion(np.array([100.0, 40.0]), np.array([10.0, 0.0]))
    np.testing.assert_array_equal(motion.moving, [True, False])
    np.testing.assert_array_equal(
        motion.lengths_m(TIMES_S, slice(None)), [[100.0, 110.0, 140.0], [40.0, 40.0, 40.0]]
    )


def test_joined_motion_picks_the_same_rows_as_one_table():
    rng = np.random.default_rng(1)
    length_m, rate_mps = rng.uniform(10, 99, 9), rng.normal(size=9)
    whole = LinearMotion(length_m, rate_mps)
    cuts = [slice(0, 2), slice(2, 2), slice(2, 7), slice(7, 9)]
    joined = join_motion([LinearMotion(length_m[c], rate_mps[c]) for c in cuts])
    assert isinstance(joined, JoinedMotion)
    np.testing.assert_array_equal(joined.moving, whole.moving)
    for rows in (slice(None), slice(1, 8, 3), np.array([8, 0, 3]), rate_mps > 0):
        expected = whole.lengths_m(TIMES_S, rows)
        np.testing.assert_array_equal(joined.lengths_m(TIMES_S, rows), expected)
        picked = joined.select(rows)
        np.testing.assert_array_equal(picked.lengths_m(TIMES_S, slice(None)), expected)
        np.testing.assert_array_equal(picked.moving, whole.moving[rows])
        np.testing.assert_array_equal(
            picked.select(slice(1, 2)).lengths_m(TIMES_S, slice(None)), expected[1:2]
        )


def test_paths_without_a_motion_of_their_own_move_by_their_range_rate():
    still, target = make_paths(1.0, 20.0), make_paths([1.0, 2.0], [30.0, 50.0], [3.0, -1.0])
    lengths = Paths.join([still, target]).lengths.lengths_m(TIMES_S, slice(None))
    assert lengths[:, 2] == pytest.approx([20.0, 42.0, 46.0])
