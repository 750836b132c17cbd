# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of frames on axes that are drawn once: the same as drawn whole, in any order."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.movie_file import png_bytes
from radarsim_addon.signal import (
    Burst,
    Cfar,
    FrameResult,
    ProcessOptions,
    Radar,
    Waveform,
    process_run,
)
from radarsim_addon.signal.pictures import draw_results, echo, new_figure, profile
from radarsim_addon.signal.pictures import map as maps
from radarsim_addon.signal.pictures.figure import TALL_TEXT, Sheet
from tests.signal.synthetic import Setup, points, write_run

SETUP = Setup(
    rings=2,
    frames=(1, 2, 3),
    radar=Radar(Waveform(5.3e9, 50e6, 2.5e-6, 60e6), Burst(1000.0, 64)),
)
SHEETS = (echo._sheet, profile._sheet, maps._sheet)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> list[FrameResult]:
    """A weak slow target, a strong and a fast one, and nothing."""

    def picture(frame: int, ring: int, snapshot: int) -> tuple[np.ndarray, np.ndarray]:
        echoes = [
            [(5, 6, 400.0, 5.0, 1e-9)],
            [(5, 6, 100.0, 0.0, 1e-3), (2, 3, 300.0, -11.0, 1e-4)],
            [],
        ]
        return points(SETUP, echoes[frame - 1])(frame, ring, snapshot)

    folder = write_run(tmp_path_factory.mktemp("run") / "run", SETUP, picture)
    options = ProcessOptions(products=False, plots=False, animate=False, cfar=Cfar())
    return [e for e in process_run(folder, options) if isinstance(e, FrameResult)]


def drawn(result: FrameResult, folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in draw_results(result, folder)}


def test_a_picture_does_not_depend_on_those_before(
    results: list[FrameResult], tmp_path: Path
) -> None:
    """Workers draw other frames before it, and the axes once."""
    alone = []
    for result in results:
        for sheet in SHEETS:
            sheet.cache_clear()
        alone.append(drawn(result, tmp_path))
    assert drawn(results[2], tmp_path) == alone[2]
    assert [sheet.cache_info().misses for sheet in SHEETS] == [1, 1, 1]
    for number in (1, 0, 2):  # on the axes of the last
        assert drawn(results[number], tmp_path) == alone[number]
    assert len({one[name] for one in alone for name in one}) == 12


def as_whole(sheet: Sheet) -> Callable[[], np.ndarray]:
    """The picture of a sheet, drawn by matplotlib from nothing."""

    def picture() -> np.ndarray:
        canvas = sheet._canvas
        for animated in (False, True):
            for artist in sheet._changing:
                artist.set_animated(animated)
            if not animated:
                canvas.draw()
        return np.array(canvas.buffer_rgba())[..., :3]

    return picture


def test_frames_look_as_drawn_whole(
    results: list[FrameResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    """But for rounding where lines cross, in less than one of a thousand pixels."""
    pairs: list[tuple[np.ndarray, np.ndarray]] = []
    parts = Sheet.picture

    def both(sheet: Sheet) -> np.ndarray:
        whole = as_whole(sheet)()
        pairs.append((whole, parts(sheet)))
        return pairs[-1][1]

    monkeypatch.setattr(Sheet, "picture", both)
    for result in results:
        maps_of, found = result.rd_map.channel(0), result.detections
        assert found is not None
        echo.draw_echo(result.echoes.channel(0), "Echo [g]")
        profile.draw_range_profile(
            result.compressed.channel(0), result.profile, result.edges, "Profile",
            expected=None, noise_power=1e-20, unit="dBW",
        )  # fmt: skip
        maps.draw_range_doppler(
            maps_of, result.moving_targets, "Map", targets=found.targets, left_out=3,
            noise_power=1e-20, unit="dBW",
        )  # fmt: skip
    assert len(pairs) == 9
    for whole, picture in pairs:
        assert picture[:20].min() < 100, "the title is at the top"
        assert whole.shape == picture.shape and whole.std() > 5
        assert (np.abs(whole.astype(int) - picture).max(axis=2) > 32).mean() < 1e-3


def test_what_was_added_is_gone(results: list[FrameResult]) -> None:
    figure = new_figure(4, 3)
    axis = figure.subplots()
    axis.set_xlim(0, 1)
    axis.set_ylim(0, 1)
    title = axis.set_title(TALL_TEXT)
    sheet = Sheet(figure, [title])
    title.set_text("one")
    before = sheet.picture()
    axis.plot([0, 1], [0, 1], label="line")
    axis.legend()
    figure.text(0.5, 0.5, "text")
    assert before[:40].min() < 100, "the title is in the picture"
    assert (sheet.picture() != before).any()
    assert (sheet.picture() == before).all()
    title.set_text("two")
    assert (sheet.picture() != before).any()


def test_png_holds_the_pixels() -> None:
    """Any reader sees them, and their size in print."""
    from PIL import Image as image

    pixels = np.random.default_rng(3).integers(0, 256, (5, 7, 3), dtype=np.uint8)
    with image.open(io.BytesIO(png_bytes(pixels, 120))) as found:
        found.verify()
    with image.open(io.BytesIO(png_bytes(pixels, 120))) as found:
        assert found.mode == "RGB" and (np.array(found) == pixels).all()
        assert found.info["dpi"] == pytest.approx((120, 120), rel=1e-4)
