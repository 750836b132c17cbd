# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that numpy draws for Blender's image editor."""

from __future__ import annotations

import numpy as np
import pytest

from radarsim_addon.blender.ui import pictures

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
    np.testing.assert_allclose(pictures.nice_ticks(low, high, about), expected, atol=1e-12)


def test_shrinking_keeps_single_dots() -> None:
    values = np.zeros((7, 5000))
    values[3, 1234] = 1.0
    small = pictures.resample_max(values, 100, 1)
    assert small.shape == (7, 100)
    assert small[3, 1234 * 100 // 5000] == 1.0
    assert small.sum() == 1.0
    assert pictures.resample_max(np.arange(3.0), 6, 0).tolist() == [0, 0, 1, 1, 2, 2]


def test_map_shows_a_dot_where_it_is() -> None:
    """A receding target at 1750 m: left of the middle, a third up, in the brightest colour."""
    range_m = np.arange(0.0, 5250.0, 1.25)
    doppler_hz = (np.arange(128) - 64) * 1000 / 128
    power_db = np.full((128, range_m.size), -150.0)
    row, column = 64 - 45, 1400
    power_db[row, column] = -80.0
    picture = pictures.draw_map(range_m, doppler_hz, power_db, 0.05657, "Map")
    assert picture.shape == (pictures.HEIGHT, pictures.WIDTH, 3)
    area = picture[pictures.TOP + 1 : -pictures.BOTTOM - 1, pictures.LEFT + 1 : -pictures.RIGHT - 1]
    yellow = np.array([0.993, 0.906, 0.144])  # the upper end of viridis
    places = np.argwhere(np.abs(area - yellow).max(axis=2) < 0.01)
    assert 0 < len(places) < 50
    y, x = places.mean(axis=0)
    assert x / area.shape[1] == pytest.approx((row + 0.5) / 128, abs=0.01)
    assert 1 - y / area.shape[0] == pytest.approx(range_m[column] / 5250, abs=0.01)
    # Axes have numbers: ink in the margins.
    assert (picture[-pictures.BOTTOM + 8 :, pictures.LEFT : -pictures.RIGHT] < 0.5).any()
    assert (picture[pictures.TOP : -pictures.BOTTOM, : pictures.LEFT - 8] < 0.5).any()


def test_empty_map_and_profile_can_be_drawn() -> None:
    axis = np.arange(10.0)
    for picture in (
        pictures.draw_map(axis, axis - 5, np.full((10, 10), -300.0), 0.05, "Empty"),
        pictures.draw_profile(axis, np.zeros(10), "Empty"),
    ):
        assert np.isfinite(picture).all()
    plain = np.ones_like(picture[300:500, 400:700])
    words = picture[pictures.TOP + 100 : -pictures.BOTTOM - 100, 500:620]
    assert words.min() < 0.3 and plain.min() == 1.0  # "no echo" in the middle


@pytest.mark.parametrize(("pulses", "limit"), [(128, 0.973), (4, 0.973), (5, 0.973)])
def test_the_axis_of_the_range_rate_tells_where_it_folds(
    monkeypatch: pytest.MonkeyPatch, pulses: int, limit: float
) -> None:
    """77 GHz and 1 kHz hold lambda PRF / 4, however many pulses there are."""
    texts: list[str] = []
    mask = pictures.text_mask
    monkeypatch.setattr(pictures, "text_mask", lambda text: texts.append(text) or mask(text))
    doppler_hz = np.fft.fftshift(np.fft.fftfreq(pulses, 1e-3))
    power_db = np.full((pulses, 10), -80.0)
    pictures.draw_map(np.arange(10.0), doppler_hz, power_db, 299792458 / 77e9, "Folds")
    assert f"Range rate [m/s] (receding: positive; folds at +-{limit} m/s)" in texts


def test_one_pulse_has_no_doppler_numbers() -> None:
    power_db = np.full((1, 10), -80.0)
    one = pictures.draw_map(np.arange(10.0), np.zeros(1), power_db, 0.05, "One")
    burst = pictures.draw_map(
        np.arange(10.0), np.arange(4.0) - 2, np.repeat(power_db, 4, axis=0), 0.05, "Burst"
    )
    ticks = np.s_[-pictures.BOTTOM + 8 : -pictures.BOTTOM + 30, pictures.LEFT : -pictures.RIGHT]
    assert (burst[ticks] < 0.5).any() and not (one[ticks] < 0.5).any()
    above = np.s_[pictures.TOP - 55 : pictures.TOP - 8, pictures.LEFT : -pictures.RIGHT]
    assert (burst[above] < 0.5).any() and not (one[above] < 0.5).any()


def test_text_is_as_wide_as_its_letters() -> None:
    both = pictures.text_mask("AB").shape[1]
    assert both == pictures.text_mask("A").shape[1] + pictures.text_mask("B").shape[1]
    assert pictures.text_mask("").shape[1] == 0
    np.testing.assert_array_equal(pictures.text_mask("雷"), pictures.text_mask("?"))


@pytest.mark.parametrize("slope", [0.0, 0.3, 3.0, 25.0])
def test_a_line_covers_what_a_strip_of_its_width_covers(slope: float) -> None:
    """Of a strip of width w and slope m a column holds w sqrt(1 + m^2), a row this by m."""
    area = np.ones((200, 40, 3), dtype=np.float32)
    columns = (np.arange(40 * pictures.FINE) + 0.5) / pictures.FINE
    pictures.draw_curve(area, 100.3 + slope * (columns - 20), (0.0, 0.0, 0.0), 2.5)
    cover = 1 - area[..., 0]
    chord = 2.5 * np.hypot(1, slope)
    inner = cover[:, 18:23] if slope < 20 else cover[:, 20:21]
    np.testing.assert_allclose(inner.sum(axis=0), chord, rtol=0.01)
    if slope > 1:  # no gaps in a steep flank
        np.testing.assert_allclose(cover[95:106].sum(axis=1), chord / slope, rtol=0.05)


def test_a_profile_passes_through_its_values() -> None:
    """A rising profile of 10 cells: the line is at each cell's own range and level."""
    range_m, level_db = np.arange(10.0) + 0.5, np.arange(10) * 6.0 - 100
    picture = pictures.draw_profile(range_m, 10 ** (level_db / 10), "Steps", span_db=60.0)
    top_db = 5 * np.ceil((level_db.max() + 1) / 5)
    rows, columns = pictures.HEIGHT - pictures.TOP - pictures.BOTTOM - 1, 1200 - 110 - 190 - 1
    for metres, level in zip(range_m[2:], level_db[2:], strict=True):
        column = round(pictures.LEFT + metres / 10 * columns)
        blue = picture[pictures.TOP : -pictures.BOTTOM, column]
        dark = (0.6 - blue[:, 0]).clip(0) * (blue[:, 2] - blue[:, 0] > 0.3)
        at = (dark * np.arange(dark.size)).sum() / dark.sum()
        assert at == pytest.approx((top_db - level) / 60 * rows, abs=0.7)


def test_smaller_pictures_keep_thin_lines() -> None:
    """A line of one pixel keeps its darkness, wherever it falls; a larger picture has no steps."""
    picture = np.ones((80, 120, 3), dtype=np.float32)
    picture[:, 7::16] = 0.0
    for width, height in ((75, 50), (41, 27), (119, 79)):
        small = pictures.resized(picture, width, height)
        assert small.shape == (height, width, 3)
        dark = (1 - small).sum(axis=1)
        np.testing.assert_allclose(dark, 8 * width / 120, rtol=1e-5)
    ramp = np.broadcast_to(np.linspace(0, 1, 20, dtype=np.float32)[:, None, None], (20, 5, 3))
    steps = np.diff(pictures.resized(ramp, 5, 40)[2:-2, 0, 0])
    np.testing.assert_allclose(steps, 1 / 38, rtol=1e-4)
