# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures as Blender images, drawn by matplotlib in a process of its own.

A request has an answer later, in a timer; without a window it is answered at once. Blender drops
pixels of an image that it shows smaller: thin lines become dashed. Each image is therefore drawn in
the size at which it is shown, and again when the zoom changes.
"""

from __future__ import annotations

import collections
import itertools
import math
import tempfile
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
from numpy.typing import NDArray

from ...errors import OutputError
from ...messages import Message
from ...signal.pictures import answer_request
from .fields import is_refused, may_write, may_write_at_need, tr
from .result_pictures import KINDS, WIDTH, PictureAxes
from .worker_process import WorkerProcess, python_program

COVERAGE_IMAGE = "Radar coverage"
#: Names of the images of all kinds of pictures.
_IMAGES = {COVERAGE_IMAGE, *(kind.image for kind in KINDS.values())}
#: Maximum number of attempts to fit the view of a new editor.
_MAX_FITS = 30
_FIT_INTERVAL_S = 0.3
#: Time between two looks for an answer [s].
_LOOK_S = 0.01
#: Time after the last change of a zoom at which an image gets its size [s].
_CALM_S = 0.2
#: Room around an image that is fitted, and the narrowest image [px].
_MARGIN_PX, _LEAST_PX = 10, 200

# -- requests --------------------------------------------------------------------------------------

_Then = Callable[[Message], None]
_numbers = itertools.count()
_process: WorkerProcess | None = None
_waiting: dict[int, _Then] = {}
#: Answers that have come and were not used yet: Blender may refuse a change the first time.
_answers: collections.deque[Message] = collections.deque()


def start_drawing() -> None:
    """Start the process that draws, so that it is ready later; a second call changes nothing."""
    global _process
    if _process is not None and _process.last_words is not None:
        _process.close()
        _process = None
    if _process is None and not _at_once():
        _process = WorkerProcess("signal.pictures.worker")


def _at_once() -> bool:
    return bpy.app.background or python_program() is None


def request(fields: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], then: _Then) -> None:
    """Ask for a picture, as of `signal.pictures`; `then` is called with the answer."""
    number = next(_numbers)
    message = Message({"place": f"number {number}", **fields, "number": number}, dict(arrays))
    if _at_once():
        then(answer_request(message))
        return
    start_drawing()
    assert _process is not None
    _waiting[number] = then
    _process.send(message)
    if not bpy.app.timers.is_registered(_receive):
        bpy.app.timers.register(_receive, first_interval=_LOOK_S)


@may_write_at_need
def _receive() -> float | None:
    if _process is None:
        return None
    _answers.extend(_process.received())
    words = _process.last_words
    if words is not None and not _answers:
        error = tr("The process that draws has ended: {words}", words=words)
        _answers.extend(Message({"number": one, "error": error}, {}) for one in _waiting)
    while _answers:
        number = _answers[0].fields["number"]
        then = _waiting.pop(number, None)
        try:
            if then is not None:
                then(_answers[0])
        except Exception as error:
            if then is not None and is_refused(error):  # it is done again where Blender lets it
                _waiting[number] = then
            else:
                _answers.popleft()
            raise
        _answers.popleft()
    return _LOOK_S if _waiting else None


def forget_requests() -> None:
    """Ignore the answers to come: they are of a file that is no longer open."""
    _waiting.clear()


def awaited(fields: Mapping[str, Any]) -> Generator[float, None, Message]:
    """Yield 0 until the answer to a request has come; return it. OutputError where it failed."""
    found: list[Message] = []
    request(fields, {}, found.append)
    while not found:
        yield 0.0
    if "error" in found[0].fields:
        raise OutputError(found[0].fields["error"])
    return found[0]


# -- images ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Shown:
    """Axes of an image, and its height over its width."""

    axes: PictureAxes
    shape: float


_shown_pictures: dict[str, _Shown] = {}
#: What images are drawn from: the last request for each.
_requested: dict[str, tuple[Mapping[str, Any], Mapping[str, NDArray[Any]]]] = {}
_fault = ""


def fault_of_pictures() -> str:
    """Return why the last picture could not be drawn; empty if it was."""
    return _fault


def axes_of(name: str) -> PictureAxes | None:
    """Return the axes of an image; None before it was drawn."""
    return _shown_pictures[name].axes if name in _shown_pictures else None


def draw_image(
    name: str,
    fields: Mapping[str, Any],
    arrays: Mapping[str, NDArray[Any]] | None = None,
    then: Callable[[Any], None] | None = None,
    width_px: int = 0,
) -> None:
    """Draw a picture into the Blender image of a name, packed into the file; one is reused.

    It gets the width of its image in an editor, else that of another picture of ours that is shown.
    `then` is called with the image; None where it could not be drawn, or a later one replaces it.
    """
    given = arrays or {}
    _requested[name] = {key: value for key, value in fields.items() if key != "file"}, given
    shown = {area.spaces.active.image for _, area, _ in _editors()}
    own = bpy.data.images.get(name)
    sized = [one.size[0] for one in (own, *shown) if one in shown and one.name in _shown_pictures]
    width = width_px or next(filter(None, sized), WIDTH)

    def taken(found: Message) -> None:
        global _fault
        image = None
        if "error" in found.fields:
            _fault = found.fields["error"]
        elif "late" not in found.fields:
            _fault, image = "", _put(name, found)
            axes = PictureAxes(**found.fields["axes"])
            _shown_pictures[name] = _Shown(axes, image.size[1] / image.size[0])
        if then is not None:
            then(image)

    request({**fields, "place": name, "width_px": width}, given, taken)


def _put(name: str, found: Message) -> Any:
    """Put an answer into its image; what an editor shows stays in its place."""
    data, image = found.arrays["png"].tobytes(), bpy.data.images.get(name)
    if image is None:
        # A new image whose source becomes "FILE" marks all objects as changed, as an edit does.
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "picture.png")
            path.write_bytes(data)
            image = bpy.data.images.load(str(path))
        image.name, image.filepath_raw = name, ""
    editors = [one for one in _editors() if one[1].spaces.active.image == image]
    before = [
        (_width_px(area), region.view2d.region_to_view(region.width / 2, region.height / 2))
        for _, area, region in editors
    ]
    width = image.size[0]
    # As a packed file that it reads: Blender needs three times as long to set pixels and pack them.
    image.pack(data=data, data_len=len(data))
    image.buffers_free()
    image.update()
    for (window, area, region), (shown_px, centre) in zip(editors, before, strict=True):
        if image.size[0] != width and shown_px:
            exact = round(shown_px) == image.size[0]
            ratio = 1.0 if exact else shown_px / image.size[0]
            with bpy.context.temp_override(
                window=window, screen=window.screen, area=area, region=region
            ):
                bpy.ops.image.view_all()
                bpy.ops.image.view_zoom_ratio(ratio=ratio)
                offset = [(at - 0.5) * size for at, size in zip(centre, image.size, strict=True)]
                bpy.ops.image.view_pan(offset=[round(value) for value in offset])
        area.tag_redraw()
    return image


def show_images(context: bpy.types.Context, images: list[Any]) -> None:
    """Show images in the Image Editors with pictures of ours, else beside the 3D view."""
    editors = [area for _, area, _ in _editors()] or _free_editors(context)
    if not editors and images:
        editors = split_view(context, len(images))
    for area, image in zip(editors, images, strict=False):
        area.spaces.active.image = image
        _undrawn.add(area.as_pointer())
    if not bpy.app.background:
        _fit_soon()


def _free_editors(context: bpy.types.Context) -> list[Any]:
    """Image Editors that show nothing."""
    areas = [area for window in context.window_manager.windows for area in window.screen.areas]
    return [one for one in areas if one.type == "IMAGE_EDITOR" and one.spaces.active.image is None]


def split_view(context: bpy.types.Context, count: int) -> list[Any]:
    """Put Image Editors, one above the other, into a new half of a window's largest 3D view.

    Without a 3D view, of its largest editor. The view itself keeps its sidebar.
    """
    window = context.window or context.window_manager.windows[0]  # a timer has none
    areas = window.screen.areas
    views = [area for area in areas if area.type == "VIEW_3D"] or list(areas)
    largest = max(views, key=lambda item: item.width * item.height)
    made = _halves(context, window, largest, "VERTICAL")[1:]
    for area in made:  # none where there is too little room
        area.type = "IMAGE_EDITOR"
        area.spaces.active.show_gizmo = False  # its buttons would hide numbers
        if count > 1:
            made = _halves(context, window, area, "HORIZONTAL")
    return made


def _halves(context: bpy.types.Context, window: Any, area: Any, direction: str) -> list[Any]:
    """Split an area; return its right or upper half, which it is itself, and the new one."""
    known = set(window.screen.areas)
    region = next(one for one in area.regions if one.type == "WINDOW")
    with context.temp_override(window=window, screen=window.screen, area=area, region=region):
        bpy.ops.screen.area_split(direction=direction, factor=0.5)
    return [area, *(item for item in window.screen.areas if item not in known)]


#: Editors whose image was set and that were not drawn since: their size may not be known.
_undrawn: set[int] = set()
_fits_left = 0


def _fit_soon() -> None:
    global _fits_left
    _fits_left = _MAX_FITS
    if not bpy.app.timers.is_registered(_fit):
        bpy.app.timers.register(_fit, first_interval=_FIT_INTERVAL_S)


@may_write
def _fit() -> float | None:
    global _fits_left
    _fits_left -= 1
    return None if _fit_images() or _fits_left <= 0 else _FIT_INTERVAL_S


def _editors() -> list[tuple[Any, Any, Any]]:
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


def _fit_images() -> bool:
    """Fit the view of all editors with our images; return whether all views fitted before."""
    fitted = True
    for window, area, region in _editors():
        space = area.spaces.active
        if space.image.name not in _shown_pictures:
            continue
        shape = _shown_pictures[space.image.name].shape
        room = min(region.width - _MARGIN_PX, (region.height - _MARGIN_PX) / shape)
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
    for _, area, _ in _editors():
        name = area.spaces.active.image.name
        if name in _shown_pictures:
            found[name] = max(found.get(name, _LEAST_PX), _width_px(area))
    # on a display of twice the density twice as wide, without steps in lines
    most_px = WIDTH * max(round(float(bpy.context.preferences.system.ui_scale)), 1)
    limited = {name: min(round(px), most_px) for name, px in found.items()}
    return {name: px for name, px in limited.items() if px != bpy.data.images[name].size[0]}


def _sharpen() -> None:
    """Draw images again in the size at which they are shown."""
    if _waiting:  # the zoom is looked at again when the answer is drawn
        return
    for name, width in _wanted_px().items():
        draw_image(name, *_requested[name], width_px=width)


def _look() -> None:
    """Called when an Image Editor is drawn: see to its image's size once the zoom is calm."""
    image, pointer = bpy.context.space_data.image, bpy.context.area.as_pointer()
    if image is None or image.name not in _shown_pictures:
        return
    if pointer in _undrawn:
        _undrawn.discard(pointer)
        _fit_soon()
    if not _wanted_px():
        return
    if bpy.app.timers.is_registered(_sharpen):
        bpy.app.timers.unregister(_sharpen)
    bpy.app.timers.register(_sharpen, first_interval=_CALM_S)


_handles: list[Any] = []


def follow_zoom() -> None:
    """Keep images at the size at which they are shown; a second call changes nothing."""
    if not _handles and not bpy.app.background:
        add = bpy.types.SpaceImageEditor.draw_handler_add
        _handles.append(add(_look, (), "WINDOW", "POST_PIXEL"))


def stop_drawing() -> None:
    """Take it back, and end the process that draws; a second call changes nothing."""
    global _process
    while _handles:
        bpy.types.SpaceImageEditor.draw_handler_remove(_handles.pop(), "WINDOW")
    for timer in (_sharpen, _receive, _fit):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)
    if _process is not None:
        _process.close()
        _process = None
    _waiting.clear()
    _answers.clear()
    _shown_pictures.clear()
    _requested.clear()
