# SPDX-License-Identifier: GPL-3.0-or-later
"""Process a run inside Blender, and show its pictures as Blender images."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ... import contract
from ...array_types import Single
from ...errors import OutputError
from ...findings import Finding
from .pictures import draw_map, draw_profile

MAP_IMAGE = "Radar range-Doppler map"
PROFILE_IMAGE = "Radar range profile"
#: Maximum number of attempts to fit the view of a new editor.
_MAX_FITS = 30
_FIT_INTERVAL_S = 0.3


class ProcessingJob:
    """Processing of a run folder in steps.

    Parameters
    ----------
    folder
        Run folder.

    Raises
    ------
    OutputError
        The folder contains no run.
    """

    def __init__(self, folder: Path) -> None:
        if not (folder / contract.RUN_FILE).is_file():
            raise OutputError(
                f"{folder} contains no run ({contract.RUN_FILE} is missing). "
                "Press Render Radar Frames first, or choose the folder of a run."
            )
        # This import is slow, so enabling the add-on must not need it.
        from ...signal.pipeline import ProcessOptions, process_run

        self._events = process_run(folder, ProcessOptions(plots=False))
        self.fraction = 0.0
        self.text = "Processing"
        self.findings: list[Finding] = []
        self.frames: list[int] = []
        self.images: list[Any] = []

    def step(self) -> bool:
        """Do one step.

        Returns
        -------
        bool
            Whether all frames are processed. `images` are complete then.

        Raises
        ------
        RadarSimError
            The run is incomplete or damaged.
        """
        event = next(self._events, None)
        if event is None:
            return True
        if hasattr(event, "rd_map"):
            self._take(event)
        else:
            self.fraction = event.done / max(event.total, 1)
            self.text = event.text
        return False

    def _take(self, result: Any) -> None:
        """Draw the pictures of a frame in place of those of the frame before."""
        title = f"frame {result.frame}, t = {result.time_s:.4g} s"
        unit = "dBW" if result.echoes.amplitude_model == "radar-equation" else "dB"
        self.findings += result.findings
        self.frames.append(result.frame)
        self.images = [
            as_image(
                MAP_IMAGE,
                draw_map(
                    result.rd_map.range_m,
                    result.rd_map.doppler_hz,
                    result.rd_map.power_db[0],
                    result.rd_map.radar.waveform.wavelength_m,
                    f"Range-Doppler map, {title}",
                    unit,
                ),
            ),
            as_image(
                PROFILE_IMAGE,
                draw_profile(
                    result.profile.range_m, result.profile.power, f"Range profile, {title}", unit
                ),
            ),
        ]
        self.text = f"Frame {result.frame}: {len(result.files)} files"
        if result.files:
            self.text += f" in {result.files[0].parent}"


def as_image(name: str, picture: Single) -> Any:
    """Return a Blender image with these pixels; an image of the same name is reused.

    Parameters
    ----------
    name
        Name of the data-block.
    picture
        sRGB values in 0 to 1, shape (height, width, 3), top row first.

    Returns
    -------
    bpy.types.Image
        Packed, so that it is saved with the file.
    """
    height, width = picture.shape[:2]
    image = bpy.data.images.get(name)
    if image is not None and tuple(image.size) != (width, height):
        bpy.data.images.remove(image)
        image = None
    if image is None:
        image = bpy.data.images.new(name, width, height, alpha=False)
    pixels = np.ones((height, width, 4), dtype=np.float32)
    pixels[:, :, :3] = picture[::-1]  # Blender's rows go up
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    image.pack()
    return image


def _image_editors(context: Any, window: Any, count: int) -> list[Any]:
    """Split the largest area of a window into Image Editors."""
    area = max(window.screen.areas, key=lambda item: item.width * item.height)
    area.type = "IMAGE_EDITOR"
    if count > 1:
        known = set(window.screen.areas)
        with context.temp_override(window=window, area=area, region=area.regions[-1]):
            bpy.ops.screen.area_split(direction="VERTICAL", factor=0.5)
        return [area, *(item for item in window.screen.areas if item not in known)]
    return [area]


def show_images(context: Any, images: list[Any]) -> None:
    """Show images in the open Image Editors; without one, in a new window.

    Parameters
    ----------
    context : bpy.types.Context
    images : list of bpy.types.Image
    """
    editors = [
        area
        for window in context.window_manager.windows
        for area in window.screen.areas
        if area.type == "IMAGE_EDITOR"
    ]
    if not editors and images:
        before = list(context.window_manager.windows)
        bpy.ops.wm.window_new()
        new = [window for window in context.window_manager.windows if window not in before]
        if new:
            editors = _image_editors(context, new[0], len(images))
    for area, image in zip(editors, images, strict=False):
        area.spaces.active.image = image
    if not bpy.app.background:
        left = [_MAX_FITS]

        def fit() -> float | None:
            left[0] -= 1
            return None if _fit_images() or not left[0] else _FIT_INTERVAL_S

        # The size of a new editor is known after it was drawn.
        bpy.app.timers.register(fit, first_interval=_FIT_INTERVAL_S)


def _fit_images() -> bool:
    """Fit the view of all editors with our images; return whether all views fitted before."""
    fitted = True
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            space = area.spaces.active
            image = space.image if area.type == "IMAGE_EDITOR" else None
            if image is None or image.name not in (PROFILE_IMAGE, MAP_IMAGE):
                continue
            region = next(item for item in area.regions if item.type == "WINDOW")
            room = min(region.width / image.size[0], region.height / image.size[1])
            if space.zoom[0] <= room:
                continue
            fitted = False
            with bpy.context.temp_override(
                window=window, screen=window.screen, area=area, region=region
            ):
                bpy.ops.image.view_all(fit_view=True)
            area.tag_redraw()
    return fitted
