# SPDX-License-Identifier: GPL-3.0-or-later
"""The run that the window shows: its frame, its pictures, and the target that is chosen."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import tempfile
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy

from ... import errors
from ...contract import RUN_FILE, RunRecord
from ...errors import OutputError, RadarSimError, SceneError
from ...findings import Finding, from_json
from ...processes import own_folder
from ...signal.paths import MOST_UNCERTAIN
from ...signal.pictures import FrameProfile, FrameView, Target, profile_of, read_view
from ...typed_json import read_record
from ..rig_settings import output_folder, settings
from ..run import scene_text
from ..scene import active_radar, antennas_of, whole_of
from ..state import mesh_counts
from .fields import tr
from .picture_images import draw_image, forget_requests, show_images
from .result_pictures import KINDS, WIDTH, processing_records
from .scene_reading import redraw_panels
from .worker_process import WorkerProcess, python_program

# -------------------------------------------------------------------------------------------------
# Process a run inside Blender, in a process of its own where there is a window.
# -------------------------------------------------------------------------------------------------


@dataclass
class ProcessedRun:
    """A run as the window shows it: files of its frames in a folder of the session.

    `fingerprint` is that of its plan, `scene_uid` the number of its scene in this session.
    """

    folder: tempfile.TemporaryDirectory[str]
    fingerprint: str = ""
    scene_uid: int = 0
    frames: list[int] = field(default_factory=list)
    profiles: list[FrameProfile] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.view = functools.lru_cache(maxsize=4)(self._read)

    def _read(self, frame: int) -> FrameView:
        return read_view(Path(self.folder.name), frame)

    def close(self) -> None:
        """Remove its files."""
        self.folder.cleanup()


class ProcessingJob:
    """Processing of a run folder in steps; `close` ends it before its end.

    With `apart` a process of its own does it, so that no step takes long. `words`: options of
    `radarsim process`.
    """

    def __init__(self, folder: Path, apart: bool = False, words: Sequence[str] = ()) -> None:
        #: What there is to show; belongs to the caller once the last step is done.
        self.result = ProcessedRun(tempfile.TemporaryDirectory(prefix="radarsim_"))
        views = Path(self.result.folder.name)
        own_folder(views)
        self._worker: WorkerProcess | None = None
        self._waiting: Iterator[dict[str, Any] | None]
        if apart and python_program() is not None:
            self._waiting = self._records_of_worker(folder, views, words)
        else:
            self._waiting = processing_records(folder, views, words)
        self._done = False
        self.fraction = 0.0
        self.text = "Processing"
        self.findings: list[Finding] = []

    @property
    def frames(self) -> list[int]:
        """Frames that are processed."""
        return self.result.frames

    def step(self) -> bool:
        """Do one step; return whether it was the last one, and `result` is complete.

        Raises a `RadarSimError` where the run is incomplete or damaged.
        """
        for record in self._waiting:
            if record is not None:
                self._take(record)
            return False
        self._done = True
        return True

    def close(self) -> None:
        """End the process, if it still runs, and remove the files of an unfinished one."""
        if self._worker is not None:
            self._worker.close()
            self._worker = None
        if not self._done:
            self.result.close()

    def _take(self, record: dict[str, Any]) -> None:
        if "error" in record:
            raise getattr(errors, record["kind"], errors.RadarSimError)(record["error"])
        self.text = record["text"]
        self.fraction = record.get("fraction", self.fraction)
        if "frame" in record:
            self.findings += [from_json(item, "Findings") for item in record["findings"]]
            self.result.frames.append(record["frame"])
            self.result.profiles.append(profile_of(self.result.view(record["frame"])))

    def _records_of_worker(
        self, folder: Path, views: Path, words: Sequence[str]
    ) -> Iterator[dict[str, Any] | None]:
        """Records as they come; None while there is none."""
        self._worker = worker = WorkerProcess(
            "blender.ui.result_pictures", str(folder), str(views), *words
        )
        while not worker.is_read or worker.exit_code is None:
            yield None
            for message in worker.received():
                yield message.fields
        if worker.exit_code:
            raise OutputError(
                f"Processing ended with code {worker.exit_code}: {worker.last_words}"
                f". Process {folder} with `radarsim process` to see all of it."
            )


#: Settings of a radar that change no frame's results.
_OF_NO_FRAME = {
    "output_folder", "overwrite", "frame_mode", "frame_start", "frame_end", "frame_step"
}  # fmt: skip

#: Custom property of a scene that tells its last run, as JSON.
_LAST_RUN = "radarsim_last_run"
#: Where the state of the tab's results hangs on the window manager.
RESULTS_PROPERTY = "radarsim_results"


@dataclass
class MeasuredScene:
    """The scene of a run as it was copied, and whether it was edited since.

    Blender does not report edits of the radar's settings.
    """

    settings: tuple[Any, ...]
    radar: dict[str, Any]
    edited: bool = False
    fingerprint: str = ""


@dataclass
class _State:
    run: ProcessedRun | None = None
    frame: int = 0
    chosen: Target | None = None
    row: int = -1
    owner: object = field(default_factory=object)
    #: Fingerprints of all runs that this window has measured of the open file.
    own: set[str] = field(default_factory=set)
    #: Whether the file that was opened has a run that is not shown yet.
    waits: bool = False
    #: Scene of the last run that has begun, and of those that have not.
    scenes: list[MeasuredScene] = field(default_factory=list)


_state = _State()


def shown_run() -> ProcessedRun | None:
    """Return the run that is shown; None before one of the current scene was processed."""
    run = _state.run
    return run if run is not None and run.scene_uid == bpy.context.scene.session_uid else None


def shown_view() -> FrameView | None:
    """Return the frame that is shown; None before a run of the current scene was processed."""
    run = shown_run()
    return None if run is None else run.view(_state.frame)


def chosen_target() -> Target | None:
    """Return the target whose paths are drawn; None where none is chosen."""
    return None if shown_run() is None else _state.chosen


# -- whose results these are, and how old ----------------------------------------------------------


def check_own_run(scene: bpy.types.Scene, folder: Path) -> str:
    """Check that a folder holds a run of the open file and scene; return its fingerprint.

    OutputError: there is no run, or it is of another file or scene.
    """
    if not (folder / RUN_FILE).is_file():
        raise OutputError(
            f"{folder} contains no run ({RUN_FILE} is missing). "
            "Press Render Radar Frames first, or choose the folder of a run."
        )
    record = read_record(folder / RUN_FILE, RunRecord)
    here = Path(bpy.data.filepath).name, scene.name
    if record.fingerprint not in _state.own and (record.blend_file, record.scene) != here:
        raise OutputError(
            f"{folder} holds the run of another scene: {scene_text(record)}. Its targets and paths "
            "do not belong to this scene. Choose the output folder of this scene, or open that "
            "file. `radarsim process` processes any run."
        )
    return record.fingerprint


def note_copied(context: bpy.types.Context) -> MeasuredScene:
    """Note that the scene as it is now is copied for a run."""
    context.view_layer.update()  # an edit before is no edit since
    found = MeasuredScene(_settings_of(context.scene), _radar_of(context.scene))
    _state.scenes.append(found)
    return found


def note_measured(measured: MeasuredScene, fingerprint: str) -> None:
    """Note that the run of a scene has begun, if its file is still open."""
    found = [at for at, one in enumerate(_state.scenes) if one is measured]
    if found:
        measured.fingerprint = fingerprint
        _state.own.add(fingerprint)
        del _state.scenes[: found[0]]


def age_of_results() -> str:
    """Return why the results that are shown may not be those of the scene; empty if they are."""
    run = shown_run()
    if run is None:
        return ""
    if run.fingerprint not in _state.own:
        return tr("Of an earlier session: the scene may have changed")
    last = _state.scenes[0]
    if run.fingerprint != last.fingerprint:
        return tr("Older than the last run: process it")
    edited = last.edited or _radar_of(bpy.context.scene) != last.radar
    return tr("The scene was edited after this run") if edited else ""


def has_unseen_run() -> bool:
    """Return whether the run that the opened file was saved with is there, and not shown yet."""
    return _state.waits and shown_run() is None


@bpy.app.handlers.persistent
def _keep_with_file(*_: Any) -> None:
    """Save with each scene which run was its last one, and whether it was edited since."""
    last = _state.scenes[0] if _state.scenes else None
    for scene in bpy.data.scenes:
        if last is not None and last.fingerprint and last.settings[0] == scene.session_uid:
            record = {
                "fingerprint": last.fingerprint,
                "edited": last.edited or _radar_of(scene) != last.radar,
                "content": _content_of(scene),
            }
            scene[_LAST_RUN] = json.dumps(record)


def _recall_from_file() -> None:
    """Take over what was saved with the scene that a file opens with."""
    scene = bpy.context.scene
    record = {}
    with contextlib.suppress(TypeError, ValueError):  # no text, no JSON
        record = json.loads(scene.get(_LAST_RUN))
    fingerprint = record.get("fingerprint") if isinstance(record, dict) else None
    if not isinstance(fingerprint, str) or not fingerprint:
        return
    # a Blender without radarsim may have edited the file
    edited = record.get("edited") is not False or record.get("content") != _content_of(scene)
    _state.own.add(fingerprint)
    _state.scenes = [MeasuredScene(_settings_of(scene), _radar_of(scene), edited, fingerprint)]
    with contextlib.suppress(RadarSimError):
        folder = output_folder(active_radar(scene))
        _state.waits = check_own_run(scene, folder) == fingerprint


def _content_of(scene: bpy.types.Scene) -> str:
    """Return a digest of what a scene holds: objects with their places, data and materials."""
    found = [repr(_settings_of(scene)[1:])]
    for item in scene.objects:
        slots = [slot.material and slot.material.name for slot in item.material_slots]
        data = item.data
        size = mesh_counts(data)[0] if isinstance(data, bpy.types.Mesh) else 0
        parts = item.name_full, item.type, item.parent and item.parent.name, data and data.name
        place = [value for row in item.matrix_basis for value in row]
        if item.animation_data is not None:  # the frame decides where it is
            place = []
        found.append(repr((*parts, size, slots, place, item.hide_render)))
    return hashlib.sha256("\n".join(found).encode()).hexdigest()


def _settings_of(scene: bpy.types.Scene) -> tuple[Any, ...]:
    """Settings of a scene that change results; Blender reports them as it reports a selection."""
    render, world = scene.render, scene.world
    times = render.fps, render.fps_base, render.frame_map_old, render.frame_map_new
    scale = scene.unit_settings.scale_length
    return scene.session_uid, scale, *times, world and world.name, len(scene.objects)


def _radar_of(scene: bpy.types.Scene) -> dict[str, Any]:
    """Settings of the scene's radar that change the results of a frame; empty without a radar."""
    try:
        radar = active_radar(scene)
        antennas = antennas_of(scene, radar)
    except SceneError:
        return {}
    chosen = {name: item and item.name for name, item in antennas.items()}
    values = {k: v for k, v in settings(radar).values().items() if k not in _OF_NO_FRAME}
    return {**values, **chosen, "radar": radar.name}


@bpy.app.handlers.persistent
def _note_edit(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Note an edit of the scene. A selection and another frame are none."""
    uid = scene.session_uid
    watched = [one for one in _state.scenes if not one.edited and one.settings[0] == uid]
    if not watched:
        return
    others = any(not isinstance(one.id, bpy.types.Scene) for one in depsgraph.updates)
    now = _settings_of(scene)
    for one in watched:
        one.edited = others or now != one.settings
    if any(one.edited for one in watched):
        redraw_panels(bpy.context)


# -- what is shown ---------------------------------------------------------------------------------


def chosen_row() -> int:
    """Return the row of the chosen target in the list; -1 for none."""
    return _state.row


def show_run(context: bpy.types.Context, run: ProcessedRun) -> Iterator[list[Any]]:
    """Show a run in place of the one before, the same frame if it has it; picture by picture.

    Image Editors with pictures of ours keep their kinds, and one gets the chosen picture. Without
    any the steps yield the images to be shown, the chosen picture first. A step does not wait for a
    picture.
    """
    frame = _state.frame if _state.frame in run.frames else run.frames[-1]
    forget_run()
    _state.run, _state.frame = run, frame
    _fill_rows(context)
    follow_selection()
    picture = getattr(context.window_manager, RESULTS_PROPERTY).picture
    seen = _seen_kinds(context)
    for name in dict.fromkeys((picture, *(seen or ("MAP", "PROFILE")))):
        found: list[Any] = []
        if not draw_pictures(context, {name}, found.append):
            continue
        while not found:
            yield []
        images = [image for image in found if image is not None]
        if seen and name == picture:
            _show_image(images)
        yield [] if seen else images


def forget_run() -> None:
    """Show nothing; a second call changes nothing."""
    if _state.run is not None:
        _state.run.close()
    _state.run, _state.chosen, _state.row, _state.frame = None, None, -1, 0


def show_frame(context: bpy.types.Context, frame: int) -> None:
    """Show the processed frame next to a number; the chosen object stays chosen."""
    if _state.run is None:
        return
    name = _state.chosen["name"] if _state.chosen else ""
    _state.frame = min(_state.run.frames, key=lambda one: abs(one - frame))
    _fill_rows(context)
    _choose(context, None if not name else _of_object(name))


def draw_pictures(
    context: bpy.types.Context,
    kinds: Collection[str] | None = None,
    then: Callable[[Any], None] | None = None,
) -> list[str]:
    """Draw kinds of pictures; None: all that an Image Editor shows. Return those that can be drawn.

    `then` is called with the image of each, later; with None where it failed.
    """
    if kinds is None:
        kinds = set(_seen_kinds(context))
        if bpy.app.background:
            kinds.add(getattr(context.window_manager, RESULTS_PROPERTY).picture)
    asked = []
    for name in KINDS:
        fields = picture_fields(context, name) if name in kinds and shown_run() else None
        if fields is not None:
            asked.append(name)
            draw_image(KINDS[name].image, fields, then=then)
    return asked


def picture_fields(
    context: bpy.types.Context, name: str, frame: int | None = None
) -> dict[str, Any] | None:
    """Return what a picture of a frame (None: the one that is shown) is drawn from, as of
    `signal.pictures.worker`; None where the frame lacks what it needs.

    The chosen target is marked where it is in the frame that is shown.
    """
    run = _state.run
    if run is None:
        return None
    view = run.view(_state.frame if frame is None else frame)
    if KINDS[name].needs not in view.arrays:
        return None
    chosen = _state.chosen if frame in (None, _state.frame) else None
    return {
        "folder": run.folder.name,
        "frames": run.frames,
        "kind": name,
        "frame": view.frame,
        "span_db": getattr(context.window_manager, RESULTS_PROPERTY).span_db,
        "chosen": chosen and {key: value for key, value in chosen.items() if key != "lines_m"},
        "width_px": WIDTH,
    }


def _editors(context: bpy.types.Context) -> list[Any]:
    """Image Editors that show one of our pictures."""
    ours = {kind.image for kind in KINDS.values()}
    return [
        area
        for window in context.window_manager.windows
        for area in window.screen.areas
        if area.type == "IMAGE_EDITOR"
        and area.spaces.active.image is not None
        and area.spaces.active.image.name in ours
    ]


def _seen_kinds(context: bpy.types.Context) -> list[str]:
    """Kinds of pictures that Image Editors show."""
    seen = {area.spaces.active.image.name for area in _editors(context)}
    return [name for name, kind in KINDS.items() if kind.image in seen]


def show_picture(context: bpy.types.Context, name: str) -> None:
    """Show a kind of picture in the first editor with one of ours; without any in a new window."""
    draw_pictures(context, {name}, lambda image: _show_image([image] if image else []))


def _show_image(images: list[Any]) -> None:
    if not images or bpy.app.background:
        return
    editors = _editors(bpy.context)
    if not editors:
        show_images(bpy.context, images)
    elif not any(area.spaces.active.image == images[0] for area in editors):
        editors[0].spaces.active.image = images[0]


def choose_row(context: bpy.types.Context, row: int, frame: int | None = None) -> Target | None:
    """Choose the target of a row of the list; return it. frame: None: the one that is shown."""
    if frame not in (None, _state.frame) and _state.run is not None:
        _state.frame = frame
        _fill_rows(context)
    view = shown_view()
    if view is None or not 0 <= row < len(view.targets):
        return None
    _choose(context, view.targets[row], row)
    return _state.chosen


def _choose(context: bpy.types.Context, target: Target | None, row: int = -1) -> None:
    view = shown_view()
    if row < 0 and target is not None and view is not None and target in view.targets:
        row = view.targets.index(target)
    _state.chosen, _state.row = target, row
    draw_pictures(context)
    redraw_panels(context)


def _of_object(name: str) -> Target | None:
    """The object of the frame with a name, which for a part of an instance is "Instancer/Name"."""
    view = shown_view()
    if view is None:
        return None
    own = [item for key, item in view.objects.items() if name in (key, *key.split("/"))]
    return max(own, key=lambda item: item["power_dbm"] or -1e9, default=None)


def follow_selection() -> None:
    """Choose the target of the scene's active object, if it has an echo."""
    context = bpy.context
    active = context.view_layer.objects.active if context.view_layer else None
    if _state.run is None or active is None or not active.select_get():
        return
    chosen = _state.chosen
    names = [name for name in (active.name, whole_of(active)) if name]  # a wheel, its car
    if chosen is not None and {*names} & {chosen["name"], *chosen["name"].split("/")}:
        return  # it was chosen in the list
    target = next(filter(None, map(_of_object, names)), None)
    if target is not None:
        _choose(context, target)


def _fill_rows(context: bpy.types.Context) -> None:
    """Fill the list of the panel."""
    state, view = getattr(context.window_manager, RESULTS_PROPERTY), shown_view()
    state.rows.clear()
    for item in view.targets if view is not None else ():
        row = state.rows.add()
        row.name, row.range_text = item["name"] or "?", _short(item["range_m"])
        row.rate_text = f"{item['velocity_mps']:+z.1f}"
        row.snr_text = "" if item["snr_db"] is None else f"{item['snr_db']:.0f}"
        if item["rcs_dbsm"] is not None:
            row.rcs_text = f"{item['rcs_dbsm']:.0f}{uncertain_text(item)}"


def _short(range_m: float) -> str:
    """Return a range with three digits, from 1000 m in whole metres."""
    return f"{range_m:.3g}" if range_m < 999.5 else f"{range_m:.0f}"


def target_text(item: Target) -> str:
    """Return range, range rate, SNR and cross section of a target in one line."""
    parts = [f"{item['range_m']:.4g} m", f"{item['velocity_mps']:+z.1f} m/s"]
    if item["snr_db"] is not None:
        parts.append(f"{item['snr_db']:.0f} dB")
    if item["rcs_dbsm"] is not None:
        parts.append(f"{item['rcs_dbsm']:.0f} dBsm")
    return "  ".join(parts) + uncertain_text(item)


def uncertain_text(item: Target) -> str:
    """Return the standard error of a target's power if it is uncertain."""
    error = item["power_error"]
    return f" ±{100 * error:.0f} %" if error > MOST_UNCERTAIN else ""


@bpy.app.handlers.persistent
def _forget_at_load(*_: Any) -> None:
    forget_run()
    forget_requests()
    _state.own, _state.scenes, _state.waits = set(), [], False
    _recall_from_file()
    _subscribe()


def _subscribe() -> None:
    """Follow the active object. A subscription ends with the file that was open."""
    bpy.msgbus.clear_by_owner(_state.owner)
    bpy.msgbus.subscribe_rna(
        key=(bpy.types.LayerObjects, "active"),
        owner=_state.owner,
        args=(),
        notify=follow_selection,
    )


def follow_objects() -> None:
    """Follow the active object from now on; a second call changes nothing."""
    if _forget_at_load not in bpy.app.handlers.load_post:
        bpy.app.handlers.load_post.append(_forget_at_load)
        bpy.app.handlers.depsgraph_update_post.append(_note_edit)
        bpy.app.handlers.save_pre.append(_keep_with_file)
        _subscribe()


def ignore_objects() -> None:
    """Follow it no more, and forget the run; a second call changes nothing."""
    forget_run()
    if _forget_at_load in bpy.app.handlers.load_post:
        bpy.app.handlers.load_post.remove(_forget_at_load)
        bpy.app.handlers.depsgraph_update_post.remove(_note_edit)
        bpy.app.handlers.save_pre.remove(_keep_with_file)
        bpy.msgbus.clear_by_owner(_state.owner)
