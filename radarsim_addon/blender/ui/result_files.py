# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that write the pictures of a run: one as PNG, all frames as GIF or MP4."""

from __future__ import annotations

import struct
from collections.abc import Generator, Iterable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import bpy
import numpy as np
from bpy_extras.io_utils import ExportHelper
from numpy.typing import NDArray

from ...arrays import Single
from ...atomic_files import replaced
from ...errors import OutputError
from ...movie_file import MovieWriter
from .fields import reported
from .picture_images import save_picture
from .pictures import HEIGHT, WIDTH, picture_palette
from .result_pictures import KINDS
from .shown_results import RESULTS_PROPERTY, picture_of, shown_run, shown_view

# -------------------------------------------------------------------------------------------------
# Moving pictures as GIF (GIF89a), without a package that Blender lacks. Does not import bpy.
# -------------------------------------------------------------------------------------------------


#: Pixels that are compressed between two breaks: about 20 ms.
_SLICE = 1 << 17
#: Bits of a colour channel by which the nearest colour of the palette is looked up.
_BITS = 5
_LARGEST_CODE = 4095


class GifWriter:
    """Writes pictures of one size into a stream, one after the other, and starts again at the end.

    Parameters
    ----------
    stream
        Open binary file.
    width, height
        Size of the pictures [px].
    palette
        At most 256 colours, sRGB values from 0 to 1, (colours, 3).
    seconds
        How long each picture is shown [s].
    """

    def __init__(
        self, stream: BinaryIO, width: int, height: int, palette: Single, seconds: float
    ) -> None:
        self._stream, self._size = stream, (width, height)
        self._hundredths = max(2, round(seconds * 100))
        colours = np.zeros((256, 3), dtype=np.uint8)
        colours[: len(palette)] = np.round(palette * 255)
        steps = (np.arange(1 << _BITS) + 0.5) / (1 << _BITS)
        cube = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
        # |a - b|^2 without |a|^2, which is the same for all colours of the palette
        apart = (palette**2).sum(axis=1) - 2 * cube @ palette.T
        self._nearest: NDArray[np.uint8] = apart.argmin(axis=1).astype(np.uint8)
        stream.write(b"GIF89a" + struct.pack("<HHBBB", width, height, 0xF7, 0, 0))
        stream.write(colours.tobytes())
        stream.write(b"!\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00")  # for ever

    def add(self, picture: Single) -> Iterator[None]:
        """Write a picture (height, width, 3) in steps that take some hundredths of a second."""
        levels = (picture * (1 << _BITS)).astype(np.intp).clip(0, (1 << _BITS) - 1)
        place = (levels[..., 0] << 2 * _BITS) | (levels[..., 1] << _BITS) | levels[..., 2]
        pixels = self._nearest[place].tobytes()
        self._stream.write(struct.pack("<BBBBHBB", 0x21, 0xF9, 4, 0, self._hundredths, 0, 0))
        self._stream.write(struct.pack("<BHHHHB", 0x2C, 0, 0, *self._size, 0))
        self._stream.write(b"\x08")
        packed = bytearray()
        for part in _compressed(pixels):
            packed += part
            yield
        for start in range(0, len(packed), 255):
            block = packed[start : start + 255]
            self._stream.write(bytes([len(block)]) + block)
        self._stream.write(b"\0")

    def close(self) -> None:
        """Write the end of the file; the stream stays open."""
        self._stream.write(b";")


def _compressed(pixels: bytes) -> Iterator[bytes]:
    """Compress 8-bit pixels by LZW with codes of growing width (GIF89a, appendix F)."""
    clear, end = 256, 257
    known: dict[int, int] = {}
    following, width = 258, 9
    bits, count = clear, 9
    prefix = pixels[0]
    for start in range(1, max(len(pixels), 2), _SLICE):
        found = bytearray()
        for value in pixels[start : start + _SLICE]:
            key = prefix << 8 | value
            code = known.get(key)
            if code is not None:
                prefix = code
                continue
            bits |= prefix << count
            count += width
            known[key] = following
            if following == 1 << width:
                width += 1
            following += 1
            prefix = value
            if following > _LARGEST_CODE:
                bits |= clear << count
                count += width
                known, following, width = {}, 258, 9
            while count >= 8:
                found.append(bits & 255)
                bits >>= 8
                count -= 8
        yield bytes(found)
    bits |= prefix << count
    count += width
    # The reader has entered one more code by now, and may have widened its codes.
    if following == 1 << width:
        width += 1
    bits |= end << count
    count += width
    yield bits.to_bytes((count + 7) // 8, "little")


#: Time between two steps of a file that is being written [s].
_TICK_S = 0.01
#: Pictures of all frames: they do not change from frame to frame.
_OF_ALL_FRAMES = ("RANGE_TIME", "PPI")


class _PictureFile(ExportHelper):
    """A file of the chosen picture; its name in the dialog is that of the picture."""

    @classmethod
    def poll(cls, context: Any) -> bool:
        return shown_view() is not None

    def invoke(self, context: Any, event: Any) -> set[str]:
        picture = getattr(context.window_manager, RESULTS_PROPERTY).picture
        self.filepath = f"{picture.lower()}{self.filename_ext}"
        return super().invoke(context, event)  # type: ignore[no-any-return]

    def path(self) -> Path:
        """The file to write; an `OutputError` where its folder is missing."""
        path = Path(bpy.path.abspath(self.filepath))
        if not path.parent.is_dir():
            raise OutputError(f"The folder {path.parent} does not exist. Choose an existing one.")
        return path


class RADARSIM_OT_save_picture(_PictureFile, bpy.types.Operator):
    """Save the chosen picture of the results as PNG, 1200 x 800 pixels"""

    bl_idname = "radarsim.save_picture"
    bl_label = "Save Radar Picture"
    bl_options = {"REGISTER"}
    filename_ext = ".png"

    def execute(self, context: Any) -> set[str]:
        with reported(self):
            kind = KINDS[getattr(context.window_manager, RESULTS_PROPERTY).picture]
            pixels = picture_of(context, kind)
            if pixels is None:
                raise OutputError(
                    f"There is no {kind.label.lower()} of this frame yet. Press Process Last Run."
                )
            path = self.path()
            save_picture(pixels, path)
            self.report({"INFO"}, f"Saved {path}")
            return {"FINISHED"}
        return {"CANCELLED"}


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

    def check(self, context: Any) -> bool:
        """Follow the choice of the format in the dialog."""
        before, ending = self.filepath, ".mp4" if self.movie else ".gif"
        self.filename_ext = ending
        if Path(before).suffix.lower() in (".mp4", ".gif"):
            self.filepath = str(Path(before).with_suffix(ending))
        return self.filepath != before

    _timer: Any = None
    _steps: Generator[float, None, None]

    def execute(self, context: Any) -> set[str]:
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

    def modal(self, context: Any, event: Any) -> set[str]:
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

    def _ended(self, context: Any, outcome: str) -> set[str]:
        self._steps.close()
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        return {outcome}

    def _written(self, context: Any, path: Path) -> Generator[float, None, None]:
        """Write the file in short steps; yield the fraction that is done."""
        run, name = shown_run(), getattr(context.window_manager, RESULTS_PROPERTY).picture
        assert run is not None
        frames = sorted(run.frames)
        if name in _OF_ALL_FRAMES:
            frames = frames[:1]

        def pictures() -> Iterator[Single]:
            for frame in frames:
                if shown_run() is not run:
                    raise OutputError("The run was processed again meanwhile; save it again.")
                picture = picture_of(context, KINDS[name], frame)
                if picture is None:
                    raise OutputError(
                        f"Frame {frame} has no {KINDS[name].label.lower()}. Press Process Last Run."
                    )
                yield picture

        write = _write_mp4 if path.suffix.lower() == ".mp4" else _write_gif
        with replaced(path) as temporary:
            for done in write(temporary, pictures(), self.seconds):
                yield done / len(frames)
        self.report({"INFO"}, f"Saved {path}: {len(frames)} frames")


def _write_gif(path: Path, pictures: Iterable[Single], seconds: float) -> Iterator[int]:
    """Write an animation in short steps; yield the number of finished pictures."""
    with open(path, "wb") as stream:
        writer = GifWriter(stream, WIDTH, HEIGHT, picture_palette(), seconds)
        for done, picture in enumerate(pictures):
            for _ in writer.add(picture):
                yield done
        writer.close()


def _write_mp4(path: Path, pictures: Iterable[Single], seconds: float) -> Iterator[int]:
    """Write a movie in short steps; yield the number of finished pictures."""
    done = 0
    with MovieWriter(path, seconds) as writer:
        for done, picture in enumerate(pictures):
            writer.add(np.round(picture * 255).clip(0, 255).astype(np.uint8))
            yield done
        for _ in writer.close():
            yield done


CLASSES: tuple[type, ...] = (RADARSIM_OT_save_picture, RADARSIM_OT_save_animation)
