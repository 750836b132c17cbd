#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Copy screenshots of the window into docs/images: cropped, with few colours.

    make gui-test PYTEST_ARGS="-k 'test_tutorial or test_live'" && python scripts/window_pictures.py

tests/gui takes the screenshots in a real Blender window and leaves them in out/gui.
"""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
#: What is shown of a screenshot of 1600 x 1000 pixels: left, top, right, bottom. Letters keep their
#: size, so that they are readable at half of it.
WINDOW = (450, 0, 1600, 1000)
#: The pictures of the results next to the scene.
RESULTS, EDITORS = "tutorial_5_map.png", (0, 0, 1320, 895)


def main() -> int:
    folder = ROOT / "out" / "gui"
    shots = sorted([*folder.glob("tutorial_*.png"), *folder.glob("live_preview.png")])
    if not shots:
        print("No screenshots in out/gui: run `make gui-test` first.", file=sys.stderr)
        return 1
    for shot in shots:
        with Image.open(shot) as opened:
            part = opened.convert("RGB").crop(EDITORS if shot.name == RESULTS else WINDOW)
        target = ROOT / "docs" / "images" / shot.name
        part.quantize(256, kmeans=2, dither=Image.Dither.NONE).save(target, optimize=True)
        print(f"{target.relative_to(ROOT)}: {target.stat().st_size / 1024:.0f} KiB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
