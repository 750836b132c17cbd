# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures as Blender images, in the size at which Image Editors show them.

Blender drops pixels of an image that it shows smaller: thin lines become dashed. Each image
therefore gets the size at which it is shown, by means over the picture's pixels, and follows the
zoom up to the picture's own size.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...arrays import Single
from ...atomic_files import replaced
from ...movie_file import png_bytes
from .fields import may_write
from .pictures import resized
from .result_pictures import KINDS

COVERAGE_IMAGE = "Radar coverage"
#: Names of the images of all kinds of pictures.
_IMAGES = {COVERAGE_IMAGE, *(kind.image for kind in KINDS.values())}
#: Maximum number of attempts to fit the view of a new editor.
_MAX_FITS = 30
_FIT_INTERVAL_S = 0.3
#: Time after the last change of a zoom at which an image gets its size [s].
_CALM_S = 0.2
#: Room around an image that is fitted, and the narrowest image [px].
_MARGIN_PX, _LEAST_PX = 10, 200
#: Pixels per inch that files state.
_DPI = 100.0
_pictures: dict[str, Single] = {}
_handles: list[Any] = []


def as_image(name: str, picture: Single) -> Any:
    """Return a Blender image of a picture, packed into the file; one of the name is reused.

    It gets the width of its image in an editor, else that of another picture of ours that is shown.
    picture: sRGB values in 0 to 1, shape (height, width, 3), top row first.
    """
    image = bpy.data.images.get(name)
    if image is None:
        # A new image whose source becomes "FILE" marks all objects as changed, as an edit does.
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "picture.png")
            path.write_bytes(_file_of(picture, min(picture.shape[1], 64)))
            image = bpy.data.images.load(str(path))
        image.name, image.filepath_raw = name, ""
    shown = [area.spaces.active.image for _, area, _ in _shown()]
    sized = [one.size[0] for one in (image, *shown) if one in shown and one.name in _pictures]
    _pictures[name] = picture
    _write(image, picture, next(filter(None, sized), picture.shape[1]))
    return image


def _write(image: Any, picture: Single, width: int) -> None:
    """Give an image the pixels of a picture, in a width [px].

    As a packed file that it reads: Blender needs three times as long to set pixels and pack them.
    """
    data = _file_of(picture, width)
    image.pack(data=data, data_len=len(data))
    image.buffers_free()
    image.update()


def _file_of(picture: Single, width: int) -> bytes:
    """PNG of a picture in a width [px]."""
    height = round(picture.shape[0] * width / picture.shape[1])
    return png_bytes((resized(picture, width, height) * 255 + 0.5).astype(np.uint8), _DPI)


def save_picture(picture: Single, path: Path) -> None:
    """Write a picture as PNG in its own size; an `OutputError` where that fails."""
    with replaced(path) as temporary:
        temporary.write_bytes(_file_of(picture, picture.shape[1]))


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

        @may_write
        def fit() -> float | None:
            left[0] -= 1
            return None if _fit_images() or not left[0] else _FIT_INTERVAL_S

        # The size of a new editor is known after it was drawn.
        bpy.app.timers.register(fit, first_interval=_FIT_INTERVAL_S)


def _shown() -> list[tuple[Any, Any, Any]]:
    """Editors of all windows that show one of our pictures: (window, area, region)."""
    return [
        (window, area, next(item for item in area.regions if item.type == "WINDOW"))
        for window in bpy.context.window_manager.windows
        for area in window.screen.areas
        if area.type == "IMAGE_EDITOR"
        and area.spaces.active.image is not None
        and area.spaces.active.image.name in _IMAGES
    ]


def _width_px(area: Any) -> float:
    """Width at which an editor shows its image [px]."""
    space = area.spaces.active
    shown_px = float(space.zoom[0] * space.image.size[0])
    return shown_px if math.isfinite(shown_px) else 0.0  # an editor that was not drawn yet


def _largest_px(picture: Single) -> int:
    """Width up to which an image gets the size that is shown [px].

    That of the picture; on a display of twice the density twice as much, without steps in lines.
    """
    density = round(float(bpy.context.preferences.system.ui_scale))
    return int(picture.shape[1]) * max(density, 1)


def _fit_images() -> bool:
    """Fit the view of all editors with our images; return whether all views fitted before."""
    fitted = True
    for window, area, region in _shown():
        space = area.spaces.active
        if space.image.name not in _pictures:
            continue
        picture = _pictures[space.image.name]
        room = min(
            region.width - _MARGIN_PX,
            (region.height - _MARGIN_PX) * picture.shape[1] / picture.shape[0],
        )
        if _width_px(area) <= room + 1:
            continue
        fitted = False
        with bpy.context.temp_override(
            window=window, screen=window.screen, area=area, region=region
        ):
            bpy.ops.image.view_all(fit_view=True)
        area.tag_redraw()
    return fitted


def _wanted_px() -> dict[str, int]:
    """Width that each shown image must get, where it is another one [px]."""
    found: dict[str, float] = {}
    for _, area, _ in _shown():
        name = area.spaces.active.image.name
        if name in _pictures:
            found[name] = max(found.get(name, _LEAST_PX), _width_px(area))
    limited = {name: min(round(px), _largest_px(_pictures[name])) for name, px in found.items()}
    return {name: px for name, px in limited.items() if px != bpy.data.images[name].size[0]}


@may_write
def _sharpen() -> None:
    """Give images the size at which they are shown; what an editor shows stays in its place."""
    for name, width in _wanted_px().items():
        image = bpy.data.images[name]
        editors = [one for one in _shown() if one[1].spaces.active.image == image]
        before = [
            (_width_px(area), region.view2d.region_to_view(region.width / 2, region.height / 2))
            for _, area, region in editors
        ]
        _write(image, _pictures[name], width)
        for (window, area, region), (shown_px, centre) in zip(editors, before, strict=True):
            exact = round(shown_px) == width
            with bpy.context.temp_override(
                window=window, screen=window.screen, area=area, region=region
            ):
                bpy.ops.image.view_all()
                bpy.ops.image.view_zoom_ratio(ratio=1.0 if exact else shown_px / width)
                offset = [(at - 0.5) * size for at, size in zip(centre, image.size, strict=True)]
                bpy.ops.image.view_pan(offset=[round(value) for value in offset])
            area.tag_redraw()


def _look() -> None:
    """Called when an Image Editor is drawn: see to its image's size once the zoom is calm."""
    image = bpy.context.space_data.image
    if image is None or image.name not in _pictures or not _wanted_px():
        return
    if bpy.app.timers.is_registered(_sharpen):
        bpy.app.timers.unregister(_sharpen)
    bpy.app.timers.register(_sharpen, first_interval=_CALM_S)


def follow_zoom() -> None:
    """Keep images at the size at which they are shown; a second call changes nothing."""
    if not _handles and not bpy.app.background:
        add = bpy.types.SpaceImageEditor.draw_handler_add
        _handles.append(add(_look, (), "WINDOW", "POST_PIXEL"))


def ignore_zoom() -> None:
    """Take it back; a second call changes nothing."""
    while _handles:
        bpy.types.SpaceImageEditor.draw_handler_remove(_handles.pop(), "WINDOW")
    if bpy.app.timers.is_registered(_sharpen):
        bpy.app.timers.unregister(_sharpen)
    _pictures.clear()
