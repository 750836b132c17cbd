# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that write the pictures of a run: one as PNG, all frames as GIF or MP4."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import bpy
from bpy_extras.io_utils import ExportHelper

from ...atomic_files import replaced
from ...errors import OutputError
from ...movie_file import MovieWriter
from .fields import reported
from .picture_images import awaited
from .result_pictures import KINDS
from .shown_results import RESULTS_PROPERTY, picture_fields, shown_run, shown_view

#: Time between two steps of a file that is being written [s].
_TICK_S = 0.01
#: Pictures of all frames: they do not change from frame to frame.
_OF_ALL_FRAMES = ("RANGE_TIME", "PPI")


class _PictureFile(ExportHelper):
    """A file of the chosen picture, which is written in short steps; its name in the dialog is that
    of the picture.
    """

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return shown_view() is not None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        picture = getattr(context.window_manager, RESULTS_PROPERTY).picture
        self.filepath = f"{picture.lower()}{self.filename_ext}"
        return super().invoke(context, event)  # type: ignore[no-any-return]

    def path(self) -> Path:
        """The file to write; an `OutputError` where its folder is missing."""
        path = Path(bpy.path.abspath(self.filepath))
        if not path.parent.is_dir():
            raise OutputError(f"The folder {path.parent} does not exist. Choose an existing one.")
        return path

    _timer: Any = None
    _steps: Generator[float, None, None]
    report: Callable[..., None]

    def execute(self, context: bpy.types.Context) -> set[str]:
        with reported(self):
            self._steps = self._written(context, self.path())
            if bpy.app.background:
                for _ in self._steps:
                    pass
                return {"FINISHED"}
            manager = context.window_manager
            manager.progress_begin(0.0, 1.0)
            self._timer = manager.event_timer_add(_TICK_S, window=context.window)
            manager.modal_handler_add(self)
            return {"RUNNING_MODAL"}
        return {"CANCELLED"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC" and event.value == "PRESS":
            return self._ended(context, "CANCELLED")
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            context.window_manager.progress_update(next(self._steps))
        except StopIteration:
            return self._ended(context, "FINISHED")
        except (OutputError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return self._ended(context, "CANCELLED")
        return {"PASS_THROUGH"}

    def _ended(self, context: bpy.types.Context, outcome: str) -> set[str]:
        self._steps.close()
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        return {outcome}


class RADARSIM_OT_save_picture(_PictureFile, bpy.types.Operator):
    """Save the chosen picture of the results as PNG, 1200 x 800 pixels"""

    bl_idname = "radarsim.save_picture"
    bl_label = "Save Radar Picture"
    bl_options = {"REGISTER"}
    filename_ext = ".png"

    def _written(self, context: bpy.types.Context, path: Path) -> Generator[float, None, None]:
        name = getattr(context.window_manager, RESULTS_PROPERTY).picture
        png = yield from _drawn(context, name, None)
        with replaced(path) as temporary:
            temporary.write_bytes(png)
        self.report({"INFO"}, f"Saved {path}")


class RADARSIM_OT_save_animation(_PictureFile, bpy.types.Operator):
    """Save the chosen picture of all frames as an animated GIF or as an MP4 movie"""

    bl_idname = "radarsim.save_animation"
    bl_label = "Save Radar Animation"
    bl_options = {"REGISTER"}
    filename_ext = ".gif"

    movie: bpy.props.BoolProperty(
        name="MP4",
        default=False,
        description="Write a movie with Blender's FFmpeg. Off: a GIF that repeats",
    )
    seconds: bpy.props.FloatProperty(
        name="Time per Frame [s]",
        default=0.2,
        min=0.02,
        max=10.0,
        description="Set how long each frame is shown [s]",
    )

    def check(self, context: bpy.types.Context) -> bool:
        """Follow the choice of the format in the dialog."""
        before, ending = self.filepath, ".mp4" if self.movie else ".gif"
        self.filename_ext = ending
        if Path(before).suffix.lower() in (".mp4", ".gif"):
            self.filepath = str(Path(before).with_suffix(ending))
        return self.filepath != before

    def _written(self, context: bpy.types.Context, path: Path) -> Generator[float, None, None]:
        run, name = shown_run(), getattr(context.window_manager, RESULTS_PROPERTY).picture
        assert run is not None
        frames = sorted(run.frames)
        if name in _OF_ALL_FRAMES:
            frames = frames[:1]
        with tempfile.TemporaryDirectory(prefix="radarsim_") as folder:
            files = []
            for done, frame in enumerate(frames):
                yield done / len(frames)
                if shown_run() is not run:
                    raise OutputError("The run was processed again meanwhile; save it again.")
                files.append(Path(folder, f"{frame:06d}.png"))
                files[-1].write_bytes((yield from _drawn(context, name, frame)))
            if path.suffix.lower() == ".mp4":
                yield from self._write_mp4(path, files)
            else:
                fields = {"gif": str(path), "files": [str(f) for f in files]}
                yield from awaited({**fields, "seconds": self.seconds})
        self.report({"INFO"}, f"Saved {path}: {len(frames)} frames")

    def _write_mp4(self, path: Path, files: list[Path]) -> Generator[float, None, None]:
        with replaced(path) as temporary, MovieWriter(temporary, self.seconds) as writer:
            for file in files:
                writer.add_png(file.read_bytes())
            for _ in writer.close():
                yield 1.0


def _drawn(
    context: bpy.types.Context, name: str, frame: int | None
) -> Generator[float, None, bytes]:
    """Yield until a picture of a frame (None: the one that is shown) is drawn; return its PNG."""
    fields = picture_fields(context, name, frame)
    if fields is None:
        raise OutputError(
            f"There is no {KINDS[name].label.lower()} of this frame yet. Press Process Last Run."
        )
    found = yield from awaited(fields)
    return bytes(found.arrays["png"].tobytes())


CLASSES: tuple[type, ...] = (RADARSIM_OT_save_picture, RADARSIM_OT_save_animation)
