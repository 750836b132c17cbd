# SPDX-License-Identifier: GPL-3.0-or-later
"""Process a run inside Blender, and show its pictures as Blender images."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ... import contract, errors
from ...array_types import Single
from ...errors import OutputError
from ...findings import Finding, from_json
from ...processes import own_folder
from .processing_worker import MAP_FILE, PROFILE_FILE, processing_records

MAP_IMAGE = "Radar range-Doppler map"
PROFILE_IMAGE = "Radar range profile"
COVERAGE_IMAGE = "Radar coverage"
#: Maximum number of attempts to fit the view of a new editor.
_MAX_FITS = 30
_FIT_INTERVAL_S = 0.3


class ProcessingJob:
    """Processing of a run folder in steps; `close` ends it before its end.

    With `apart` a process of its own does it, so that no step takes long. Raises OutputError for a
    folder without a run.
    """

    def __init__(self, folder: Path, apart: bool = False) -> None:
        if not (folder / contract.RUN_FILE).is_file():
            raise OutputError(
                f"{folder} contains no run ({contract.RUN_FILE} is missing). "
                "Press Render Radar Frames first, or choose the folder of a run."
            )
        self._pictures = tempfile.TemporaryDirectory(prefix="radarsim_")
        own_folder(Path(self._pictures.name))
        self._worker: subprocess.Popen[str] | None = None
        pictures = Path(self._pictures.name)
        self._waiting: Iterator[dict[str, Any] | None]
        if apart and _python() is not None:
            self._waiting = self._records_of_worker(folder, pictures)
        else:
            self._waiting = processing_records(folder, pictures)
        self._to_show = [(MAP_IMAGE, MAP_FILE), (PROFILE_IMAGE, PROFILE_FILE)]
        self.fraction = 0.0
        self.text = "Processing"
        self.findings: list[Finding] = []
        self.frames: list[int] = []
        self.images: list[Any] = []

    def step(self) -> bool:
        """Do one step; return whether it was the last one, and `images` are complete.

        Raises a `RadarSimError` where the run is incomplete or damaged.
        """
        for record in self._waiting:
            if record is not None:
                self._take(record)
            return False
        if self._to_show:
            name, file = self._to_show.pop(0)
            self.images.append(as_image(name, np.load(Path(self._pictures.name) / file)))
            return False
        self.close()
        return True

    def close(self) -> None:
        """End the process, if it still runs, and remove its files."""
        if self._worker is not None:
            self._worker.kill()
            self._worker.wait()
        self._pictures.cleanup()

    def _take(self, record: dict[str, Any]) -> None:
        if "error" in record:
            raise getattr(errors, record["kind"], errors.RadarSimError)(record["error"])
        self.text = record["text"]
        self.fraction = record.get("fraction", self.fraction)
        if "frame" in record:
            self.findings += [from_json(item, "Findings") for item in record["findings"]]
            self.frames.append(record["frame"])

    def _records_of_worker(self, folder: Path, pictures: Path) -> Iterator[dict[str, Any] | None]:
        """Records as they come; None while there is none."""
        root = Path(errors.__file__).parent
        name = f"{root.name}.blender.ui.processing_worker"
        complaints = Path(pictures, "errors.txt")
        with open(complaints, "w", encoding="utf-8") as stderr:
            self._worker = subprocess.Popen(
                [str(_python()), "-m", name, str(folder), str(pictures)],
                stdout=subprocess.PIPE,
                stderr=stderr,
                encoding="utf-8",
                env={**os.environ, "PYTHONPATH": os.pathsep.join([str(root.parent), *sys.path])},
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
        lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        stream = self._worker.stdout
        assert stream is not None
        reader = threading.Thread(target=_copy, args=(stream, lines), daemon=True)
        reader.start()
        while reader.is_alive() or not lines.empty():
            yield None if lines.empty() else json.loads(lines.get())
        if self._worker.wait():
            said = complaints.read_text(encoding="utf-8", errors="replace").strip()
            raise OutputError(
                f"Processing ended with code {self._worker.returncode}: {said[-300:] or 'no words'}"
                f". Process {folder} with `radarsim process` to see all of it."
            )


def _copy(stream: Iterable[str], lines: queue.SimpleQueue[str]) -> None:
    for line in stream:
        lines.put(line)


def _python() -> str | None:
    """The Python that Blender brings; None where it names another program."""
    return sys.executable if "python" in Path(sys.executable or "").name.lower() else None


def as_image(name: str, picture: Single) -> Any:
    """Return a Blender image with these pixels, packed into the file; one of the name is reused.

    picture: sRGB values in 0 to 1, shape (height, width, 3), top row first.
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
    """Show images in the open Image Editors; without one, in a new window."""
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
            if image is None or image.name not in (PROFILE_IMAGE, MAP_IMAGE, COVERAGE_IMAGE):
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
