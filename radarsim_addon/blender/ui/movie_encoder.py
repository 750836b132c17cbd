# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbered PNG files to an MP4 file by Blender's own FFmpeg, in a Blender of its own.

    blender -b --factory-startup -P movie_encoder.py -- FOLDER SECONDS FILE

The window's Blender could not respond during a render of the sequencer. FOLDER holds 000001.png and
so on; each is shown for SECONDS.
"""

from __future__ import annotations

import sys
from pathlib import Path

import bpy


def encode(folder: Path, seconds: float, out: Path) -> None:
    """Write the pictures of a folder as H.264; a RuntimeError of Blender's where that fails."""
    names = sorted(path.name for path in folder.glob("*.png"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    render = scene.render
    editor = scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences  # before 4.4
    strip = strips.new_image("Pictures", str(folder / names[0]), channel=1, frame_start=1)
    for name in names[1:]:
        strip.elements.append(name)
    strip.frame_final_duration = len(names)
    first = bpy.data.images.load(str(folder / names[0]))
    render.resolution_x, render.resolution_y = first.size
    render.resolution_percentage = 100
    scene.frame_start, scene.frame_end = 1, len(names)
    render.fps = max(1, round(1 / seconds))
    render.fps_base = render.fps * seconds
    scene.view_settings.view_transform = "Standard"  # the colours of the pictures
    settings = render.image_settings
    if hasattr(settings, "media_type"):  # Blender 5
        settings.media_type = "VIDEO"
    settings.file_format = "FFMPEG"
    render.ffmpeg.format, render.ffmpeg.codec = "MPEG4", "H264"
    render.ffmpeg.constant_rate_factor = "HIGH"
    render.filepath, render.use_file_extension = str(out), False
    bpy.ops.render.render(animation=True)


if __name__ == "__main__":
    given = sys.argv[sys.argv.index("--") + 1 :]
    encode(Path(given[0]), float(given[1]), Path(given[2]))
