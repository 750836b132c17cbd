# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of the live preview: places of its lines, texts and colours."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("bpy")  # blf comes with it

from radarsim_addon.blender.ui.live_picture import (
    BACK,
    SPAN_DB,
    Box,
    LivePicture,
    Placement,
    Quads,
    drag_live,
    filled,
    fitting_scale,
    forget_drawing,
    lay_out_draft,
    level_colours,
    picture_quads,
    pixels,
    place_live,
    placement,
)
from radarsim_addon.blender.ui.small_drawings import viridis
from radarsim_addon.messages import Message

RANGE_M = np.arange(0.0, 100.5, 0.5)
RATES = np.linspace(-20.0, 19.0, 40)
LINES = ["Live preview", "1000 rays"]


def draft(**changes: Any) -> dict[str, Any]:
    """A peak of 1e-9 W at 70 m and 10 m/s, 30 dB above all else."""
    profile, image = np.full(RANGE_M.size, 1e-12), np.full((RATES.size, RANGE_M.size), 1e-14)
    profile[140] = image[30, 140] = 1e-9
    arrays = {"range_m": RANGE_M, "velocity_mps": RATES, "profile_w": profile, "map_w": image}
    return {**arrays, **changes}


def picture(arrays: dict[str, Any], scale: float = 1.0) -> LivePicture:
    fields = {"noise_w": 1e-13}
    return lay_out_draft(fields, arrays, LINES, (900.0, 10.0), scale)


@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_the_peak_is_marked_where_its_range_and_level_are(scale: float) -> None:
    found = picture(draft(), scale)
    box = found.profile
    assert found.mark is not None
    x, y = found.mark
    # axes from -0.25 m to 100.25 m, from -145 dBW to -85 dBW
    assert (x - box.left) / (box.right - box.left) == pytest.approx(70.25 / 100.5)
    assert (y - box.bottom) / (box.top - box.bottom) == pytest.approx(55 / SPAN_DB)
    assert "strongest: 70 m, \u221290 dBW" in [text.text for text in found.texts]
    assert found.curve[:, 1].max() == pytest.approx(y)
    np.testing.assert_allclose((y - found.noise[:, 1]) / (box.top - box.bottom), 40 / SPAN_DB)
    assert found.panel.right == 900.0 and found.panel.bottom == 10.0
    assert box.right - box.left == 360 * scale


def test_all_is_within_the_panel() -> None:
    found = picture(draft())
    panel = found.panel
    places = [
        found.grid,
        found.curve,
        found.noise,
        np.array([(text.x, text.y) for text in found.texts]),
    ]
    for box in (found.profile, found.map, found.strip):
        places.append(np.array([(box.left, box.bottom), (box.right, box.top)]))
    low, high = np.concatenate(places).min(axis=0), np.concatenate(places).max(axis=0)
    assert panel.left <= low[0] and high[0] <= panel.right
    assert panel.bottom <= low[1] and high[1] <= panel.top
    assert [text.text for text in found.texts][: len(LINES)] == LINES


def test_the_map_shows_the_peak_in_its_row_and_column() -> None:
    """Range upwards, range rate to the right."""
    found = picture(draft())
    assert found.colours is not None and found.colours.shape == (150, 360, 4)
    place = np.argwhere(np.abs(found.colours[..., :3] - _colour(-90.0)).max(axis=-1) < 1e-6)
    # 150 pixels for 201 ranges from below, 360 for 40 range rates
    assert place.min(axis=0).tolist() == [105, 270] and place.max(axis=0).tolist() == [105, 278]
    left, top = found.map.left, found.map.bottom
    at_10 = [text.x for text in found.texts if text.text == "10" and text.y < top]
    assert at_10 == [pytest.approx(left + 9 * 30.5, abs=0.1)]  # the peak's 10 m/s


def _colour(level_db: float) -> Any:
    return viridis()[round((level_db + 85 + SPAN_DB) / SPAN_DB * 255)]


def test_one_pulse_has_no_map_and_no_echo_is_said() -> None:
    nothing = draft(profile_w=np.zeros(RANGE_M.size), map_w=np.zeros((1, RANGE_M.size)))
    found = picture({**nothing, "velocity_mps": np.zeros(1)})
    assert found.colours is None and found.mark is None and not len(found.curve)
    texts = [text.text for text in found.texts]
    assert "no echo" in texts and not [text for text in texts if "rate" in text]


def test_colours_are_those_of_the_levels() -> None:
    found = level_colours(10 ** (np.array([-90.0, -30.0, -60.0, 5.0]) / 10), 0.0)
    np.testing.assert_array_equal(found[:, :3], viridis()[[0, 128, 0, 255]])


def painted(quads: Quads, width: int, height: int) -> Any:
    """Pixels (height, width, 3) of rectangles on black, bottom row first: those with their middle
    in one, blended one after the other.
    """
    found = np.zeros((height, width, 3))
    corners = quads.corners.reshape(-1, 4, 2)
    triangles = quads.triangles.reshape(-1, 6)
    np.testing.assert_array_equal(
        triangles - triangles[:, :1], np.broadcast_to([0, 1, 2, 0, 2, 3], triangles.shape)
    )
    np.testing.assert_array_equal(triangles[:, 0], 4 * np.arange(len(corners)))
    for places, colour in zip(corners, quads.colours[::4], strict=True):
        (left, low), (right, top) = np.ceil(places[[0, 2]] - 0.5).astype(int)
        part = found[low:top, left:right]
        part[...] = part * (1 - colour[3]) + colour[:3] * colour[3]
    return found


def test_rectangles_are_the_pixels_that_they_stand_for() -> None:
    random = np.random.default_rng(5)
    colours = random.random((3, 4)).astype(np.float32)[random.integers(0, 3, (6, 9))]
    colours[..., 3] = 1.0
    colours[2:4, 1:8, 3] = 0.0
    found = pixels(colours, Box(2.0, 3.0, 2.0 + 18, 3.0 + 12))
    picture = painted(found, 22, 17)[3:15, 2:20]
    wanted = np.where(colours[..., 3:] > 0, colours[..., :3], 0.0).repeat(2, 0).repeat(2, 1)
    np.testing.assert_allclose(picture, wanted, atol=1e-6)
    assert len(found.corners) == len(found.colours) < 4 * 6 * 9
    np.testing.assert_allclose(
        painted(filled(Box(1.0, 1.0, 3.0, 2.0), BACK), 4, 3)[1, 1:3], 0.07 * 0.86, rtol=1e-6
    )


def test_the_whole_picture_is_few_rectangles() -> None:
    """Map, strip, curve and ring are where the picture has them; the noise is a dashed line."""
    found = picture(draft())
    quads = picture_quads(found, 1.0)
    assert len(quads.corners) / 4 < 3000
    colours = painted(quads, 901, 500)
    box = found.map
    area = colours[round(box.bottom) : round(box.top), round(box.left) : round(box.right)]
    assert found.colours is not None
    np.testing.assert_allclose(area, found.colours[..., :3], atol=1e-6)
    strip = colours[round(found.strip.bottom) : round(found.strip.top), round(found.strip.left) + 5]
    np.testing.assert_allclose(strip[[0, -1]], viridis()[[0, -1]], atol=1e-6)
    box, (x, y) = found.profile, found.mark or (0.0, 0.0)
    orange = (colours[..., 0] > 0.6) & (colours[..., 2] < 0.15)
    orange[round(box.top) + 8 :] = orange[: round(box.bottom)] = False
    noise_y = round(float(found.noise[0, 1]))
    dashes = orange[noise_y - 1 : noise_y + 2].any(axis=0)
    assert 0.4 < dashes[round(box.left) : round(box.right)].mean() < 0.6
    ring = np.argwhere(orange[round(y) - 8 : round(y) + 9, round(x) - 8 : round(x) + 9])
    away = np.hypot(*(ring + 0.5 - 8 + [[round(y) - y, round(x) - x]]).T)
    assert len(ring) > 20 and away.min() > 2.9 and away.max() < 5.1
    blue = (colours[..., 2] > 0.5) & (colours[..., 0] < 0.4)
    rows = np.nonzero(blue[:, round(x) - 40])[0]
    flat_y = np.interp(x - 40, *found.curve.T)
    assert len(rows) and abs(rows.mean() + 0.5 - flat_y) < 1.0


@pytest.mark.parametrize(
    ("room_px", "scale"),
    [((2000.0, 1400.0), 2.0), ((700.0, 1400.0), 700 / 452), ((2000.0, 400.0), 400 / 432)],
)
def test_the_picture_fits_into_the_view(room_px: tuple[float, float], scale: float) -> None:
    """On a display of scale 2 as large as it can be; too small to be read it is not drawn."""
    found = fitting_scale(2.0, room_px, True, len(LINES))
    assert found == pytest.approx(scale)
    panel = picture(draft(), found).panel
    assert panel.right - panel.left <= room_px[0] * (1 + 1e-9)
    assert panel.top - panel.bottom <= room_px[1] * (1 + 1e-9)
    assert fitting_scale(2.0, (200.0, 1400.0), True, len(LINES)) == 0.0


def view(hud_px: int = 1) -> Any:
    """A 3D view with settings of the last operator that are so wide, and nothing else over it."""
    system = SimpleNamespace(ui_scale=2.0, use_region_overlap=True)
    hud = SimpleNamespace(type="HUD", x=30, y=20, width=hud_px, height=60)
    return SimpleNamespace(
        region=SimpleNamespace(x=10, y=10, width=1200, height=900),
        area=SimpleNamespace(regions=[hud]),
        preferences=SimpleNamespace(system=system),
    )


@pytest.fixture
def placed() -> Iterator[Placement]:
    """Where the picture is, at first in its corner."""
    forget_drawing()
    yield placement
    forget_drawing()


def test_the_picture_is_moved_within_the_view(placed: Placement) -> None:
    message = Message({}, draft())
    first, scale = place_live(view(), message, len(LINES))
    placement.size = 0.5
    small, half = place_live(view(), message, len(LINES))
    assert half == pytest.approx(1.0) and (small.right, small.bottom) == (first.right, first.bottom)
    drag_live(view(), Placement(size=0.5), small, (-100.0, 40.0), resize=False)
    moved, _ = place_live(view(), message, len(LINES))
    assert np.subtract(moved, small) == pytest.approx([-100, 40, -100, 40])
    drag_live(view(), Placement(size=0.5), small, (-5000.0, 5000.0), resize=False)
    held, _ = place_live(view(), message, len(LINES))
    assert held.left == pytest.approx(0.0) and held.top == pytest.approx(900.0)
    drag_live(view(), Placement(size=0.5), small, (5000.0, -5000.0), resize=False)
    assert place_live(view(), message, len(LINES))[0] == pytest.approx(small)
    assert scale > half


def test_the_picture_is_resized_by_its_upper_left_corner(placed: Placement) -> None:
    message, start = Message({}, draft()), Placement(size=0.5)
    placement.size = 0.5
    small, _ = place_live(view(), message, len(LINES))
    drag_live(view(), start, small, (-0.25 * (small.right - small.left), 0.0), resize=True)
    large, scale = place_live(view(), message, len(LINES))
    assert scale == pytest.approx(1.25)
    assert (large.right, large.bottom) == (small.right, small.bottom)
    drag_live(view(), start, small, (5000.0, -5000.0), resize=True)
    assert place_live(view(), message, len(LINES))[1] == pytest.approx(0.6), "still readable"
    drag_live(view(), start, small, (-5000.0, 5000.0), resize=True)
    assert place_live(view(), message, len(LINES))[0].top == pytest.approx(900.0)
    forget_drawing()
    assert placement == Placement()


def test_the_settings_of_the_last_operator_cover_no_axis(placed: Placement) -> None:
    message = Message({}, draft())
    placement.size = 0.5
    alone, _ = place_live(view(), message, len(LINES))
    assert place_live(view(200), message, len(LINES))[0] == alone
    above, _ = place_live(view(900), message, len(LINES))
    assert above.bottom == pytest.approx(20 + 60 - 10 + 12)
    assert (above.left, above.right) == (alone.left, alone.right)
