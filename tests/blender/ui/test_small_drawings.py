# SPDX-License-Identifier: GPL-3.0-or-later
"""Small drawings by numpy in Blender's panels and views."""

from __future__ import annotations

import numpy as np
import pytest

from radarsim_addon.blender.ui import small_drawings

pytestmark = pytest.mark.blender


@pytest.mark.parametrize(
    ("low", "high", "about", "expected"),
    [
        (0, 5250, 8, [0, 1000, 2000, 3000, 4000, 5000]),
        (-500, 492.2, 8, [-400, -200, 0, 200, 400]),
        (0.0, 0.003, 3, [0.0, 0.001, 0.002, 0.003]),
        (5, 5, 4, [5]),
    ],
)
def test_ticks_are_round(low: float, high: float, about: int, expected: list[float]) -> None:
    np.testing.assert_allclose(small_drawings.nice_ticks(low, high, about), expected, atol=1e-12)


def test_shrinking_keeps_single_dots() -> None:
    values = np.zeros((7, 5000))
    values[3, 1234] = 1.0
    small = small_drawings.resample_max(values, 100, 1)
    assert small.shape == (7, 100)
    assert small[3, 1234 * 100 // 5000] == 1.0
    assert small.sum() == 1.0
    assert small_drawings.resample_max(np.arange(3.0), 6, 0).tolist() == [0, 0, 1, 1, 2, 2]


def test_text_is_as_wide_as_its_letters() -> None:
    both = small_drawings.text_mask("AB").shape[1]
    assert both == small_drawings.text_mask("A").shape[1] + small_drawings.text_mask("B").shape[1]
    assert small_drawings.text_mask("").shape[1] == 0
    np.testing.assert_array_equal(small_drawings.text_mask("雷"), small_drawings.text_mask("?"))


@pytest.mark.parametrize("slope", [0.0, 0.3, 3.0, 25.0])
def test_a_line_covers_what_a_strip_of_its_width_covers(slope: float) -> None:
    """Of a strip of width w and slope m a column holds w sqrt(1 + m^2), a row this by m."""
    area = np.ones((200, 40, 3), dtype=np.float32)
    columns = (np.arange(40 * small_drawings.FINE) + 0.5) / small_drawings.FINE
    small_drawings.draw_curve(area, 100.3 + slope * (columns - 20), (0.0, 0.0, 0.0), 2.5)
    cover = 1 - area[..., 0]
    chord = 2.5 * np.hypot(1, slope)
    inner = cover[:, 18:23] if slope < 20 else cover[:, 20:21]
    np.testing.assert_allclose(inner.sum(axis=0), chord, rtol=0.01)
    if slope > 1:  # no gaps in a steep flank
        np.testing.assert_allclose(cover[95:106].sum(axis=1), chord / slope, rtol=0.05)
