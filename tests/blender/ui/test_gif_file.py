# SPDX-License-Identifier: GPL-3.0-or-later
"""GIF files, read by Pillow."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from radarsim_addon.blender.ui.pictures import picture_palette
from radarsim_addon.blender.ui.result_files import GifWriter

pytestmark = pytest.mark.blender


def written(pictures: list[np.ndarray], palette: np.ndarray, seconds: float = 0.2) -> bytes:
    stream = io.BytesIO()
    height, width = pictures[0].shape[:2]
    writer = GifWriter(stream, width, height, palette, seconds)
    for picture in pictures:
        for _ in writer.add(picture):
            pass
    writer.close()
    return stream.getvalue()


@pytest.mark.parametrize("size", [(1, 1), (1, 2), (37, 53), (600, 700)])
@pytest.mark.parametrize("kind", ["noise", "flat", "stripes"])
def test_pixels_come_back(size: tuple[int, int], kind: str) -> None:
    """Noise fills the table of codes again and again; flat pictures have the longest codes."""
    rng = np.random.default_rng(7)
    palette = (np.array(list(np.ndindex(6, 6, 6))) / 5).astype(np.float32)
    numbers = {
        "noise": rng.integers(0, 216, size),
        "flat": np.full(size, 77),
        "stripes": np.add.outer(np.arange(size[0]), np.arange(size[1]) // 3) % 216,
    }[kind]
    pictures = [palette[numbers], palette[numbers[::-1]]]
    image = Image.open(io.BytesIO(written(pictures, palette)))
    if not np.array_equal(pictures[0], pictures[1]):  # Pillow joins pictures that are the same
        assert image.n_frames == 2
        assert image.info["duration"] == 200 and image.info["loop"] == 0
    for number in range(image.n_frames):
        image.seek(number)
        found = np.asarray(image.convert("RGB"))
        np.testing.assert_array_equal(found, np.round(pictures[number] * 255))


def test_colours_of_pictures_are_close() -> None:
    """The palette holds the colour table, greys of text and the marks, to 4 % of a channel."""
    palette = picture_palette()
    assert palette.shape[0] <= 256
    grey = np.repeat(np.linspace(0.1, 1, 64)[:, None], 3, axis=1)
    wanted = np.concatenate([palette[:200], grey])[None].astype(np.float32)
    image = Image.open(io.BytesIO(written([wanted], palette)))
    found = np.asarray(image.convert("RGB")) / 255
    assert np.abs(found - wanted).max() < 0.04
