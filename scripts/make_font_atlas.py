# SPDX-License-Identifier: GPL-3.0-or-later
"""Make radarsim_addon/blender/ui/font_atlas.npz: letters and colours for Blender's own panels.

    python scripts/make_font_atlas.py

Small drawings in panels and views are made by numpy, in Blender's main thread. The letters are
DejaVu Sans as matplotlib ships it, drawn once at one size; the colour table is matplotlib's viridis
(CC0). The licence of the font is written next to the atlas. Needs matplotlib and Pillow.
"""

from __future__ import annotations

import sys
from pathlib import Path

SIZE_PX = 18
CHARACTERS = "".join(chr(code) for code in range(32, 127)) + "\u2212\u00b7\u00d7\u00b0\u00b2\u03bb"


def main() -> int:
    import matplotlib
    import numpy as np
    from PIL import Image, ImageDraw, ImageFont

    fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    font = ImageFont.truetype(str(fonts / "DejaVuSans.ttf"), SIZE_PX)
    ascent, descent = font.getmetrics()
    height = ascent + descent
    advances = [round(font.getlength(character)) for character in CHARACTERS]
    width = max(advances) + 2
    glyphs = np.zeros((len(CHARACTERS), height, width), dtype=np.uint8)
    for index, character in enumerate(CHARACTERS):
        image = Image.new("L", (width, height), 0)
        ImageDraw.Draw(image).text((0, 0), character, font=font, fill=255)
        glyphs[index] = np.asarray(image)
    table = matplotlib.colormaps["viridis"](np.linspace(0, 1, 256))[:, :3]
    folder = Path(__file__).resolve().parents[1] / "radarsim_addon" / "blender" / "ui"
    np.savez_compressed(
        folder / "font_atlas.npz",
        codes=np.array([ord(character) for character in CHARACTERS], dtype=np.int32),
        advances=np.array(advances, dtype=np.int16),
        glyphs=glyphs,
        viridis=np.round(table * 255).astype(np.uint8),
    )
    licence = (fonts / "LICENSE_DEJAVU").read_text(encoding="utf-8")
    (folder / "font_atlas.LICENSE.txt").write_text(
        "font_atlas.npz holds letters of DejaVu Sans, drawn by scripts/make_font_atlas.py, and\n"
        "matplotlib's colour table viridis (CC0). The licence of DejaVu Sans:\n\n" + licence,
        encoding="utf-8",
    )
    print(f"wrote {folder / 'font_atlas.npz'}: {len(CHARACTERS)} letters of {height} px")
    return 0


if __name__ == "__main__":
    sys.exit(main())
