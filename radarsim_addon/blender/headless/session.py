# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of a process that needs Blender: the job of a command line, and a clean exit."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import os
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...atomic_files import refusal_to_open
from ...contract import RUN_FILE
from ...errors import ConfigError, RadarSimError, SceneError
from ...findings import finding
from ...processes import keep_freed_memory, own_folder, remove_abandoned_folders
from ..materials import set_mirrors
from ..paths import PathJob
from ..plan import given_settings
from ..rig_settings import (
    RADAR_PROPERTY,
    output_folder,
    read_link_budget,
    read_measurement,
    read_path_options,
    register,
    settings,
)
from ..rings import RingJob
from ..run import MeasurementJob
from ..run.scene_state import Device, choose_device
from ..scene import (
    active_radar,
    antennas_of,
    file_identity,
    find_rig,
    foreign_handlers,
    looks_at_view,
    radars,
)
from ..views import ViewCamera


@contextlib.contextmanager
def before_sorting(function: Callable[[], None]) -> Iterator[None]:
    """Call a function when a file has been read, before Blender sorts its objects."""

    @persistent
    def call(*_: Any) -> None:
        function()

    bpy.app.handlers.load_post.append(call)
    try:
        yield
    finally:
        bpy.app.handlers.load_post.remove(call)


def add_early_camera(scene: bpy.types.Scene, radar: Any) -> ViewCamera | None:
    """Add the camera that renders paths before Blender sorts the objects of a scene.

    Blender sorts all objects of a scene after it has opened a file, and again when the scene gets
    another camera. A camera that exists from the start saves the second time: 0.4 s for 5000
    objects.

    Return None without a radar that can measure. Also return None where the camera could change the
    scene: the receiver is chosen only because it is the active camera, or something depends on the
    active camera.
    """
    with contextlib.suppress(RadarSimError):
        antennas = antennas_of(scene, radar)
        rig = find_rig(scene, **antennas, any_projection=True)
        if looks_at_view():
            return None
        camera = ViewCamera(scene)
        if find_rig(scene, **antennas, any_projection=True) == rig:
            camera.number_objects()
            return camera
        camera.restore()
    return None


def make_job(
    scene: bpy.types.Scene,
    view_layer: bpy.types.ViewLayer,
    folder: Path,
    *,
    radar: Any = None,
    overwrite: bool = False,
    given: Mapping[str, Any] | None = None,
    link_budget_file: Path | None = None,
) -> MeasurementJob:
    """Make the job, of rings or of paths, for the settings of a scene. It is not prepared yet.

    `radar` None is the active radar of the scene. `given` values replace its settings, by their
    names, in SI. `link_budget_file` (JSON) replaces its link budget. `overwrite` replaces any run
    in the folder.
    """
    radar = active_radar(scene) if radar is None else radar
    values = dict(given or {})
    measurement = read_measurement(scene, radar, **values)
    link_budget = read_link_budget(radar, measurement.waveform.wavelength_m, link_budget_file)
    measurement = dataclasses.replace(measurement, link_budget=link_budget)
    antennas = antennas_of(scene, radar)
    if sampling_mode(radar, values) == "paths":
        options = read_path_options(radar, **values)
        return PathJob(
            scene, view_layer, measurement, folder, options, overwrite=overwrite, **antennas
        )
    return RingJob(scene, view_layer, measurement, folder, overwrite=overwrite, **antennas)


def sampling_mode(radar: Any, given: Mapping[str, Any]) -> str:
    """Return the sampling mode of a radar, or the one among the given values."""
    return str(given.get("sampling_mode", settings(radar).sampling_mode))


_AUTOEXEC = {"-y", "--enable-autoexec"}
#: Words of Blender's command line that change no scene; of these, words with a value.
_PLAIN = {"-b", "--background", "-Y", "--disable-autoexec", "--factory-startup", "-noaudio", "-q"}
_PLAIN |= _AUTOEXEC
_VALUED = {"-t", "--threads", "--python-exit-code"}


def open_scene(
    arguments: argparse.Namespace,
    early: Callable[[Any, Any], None] | None = None,
    open_copy: Callable[[], None] | None = None,
) -> tuple[Any, Any, Any]:
    """Open the file of a command line; return the scene, view layer and radar that it names.

    `early` is called with the scene and the radar, if both exist, before Blender sorts the objects.
    `open_copy` is called to open the file, if it is given.
    """
    # An enabled extension has registered its settings already, perhaps from another copy of the
    # package; those hold the file's values, and only their names matter here.
    if not hasattr(bpy.types.Object, RADAR_PROPERTY):
        register()
    own = session_folder()
    if own is not None:
        own_folder(own)
    remove_abandoned_folders()
    if arguments.blend is not None:

        def look() -> None:
            with contextlib.suppress(RadarSimError):  # raised again when the file is open
                if early is not None:
                    early(*_find(arguments))

        with before_sorting(look):
            if open_copy is None:
                _open_file(arguments.blend)
            else:
                open_copy()
    scene, radar = _find(arguments)
    if arguments.view_layer is not None:
        return scene, scene.view_layers[arguments.view_layer], radar
    if scene == bpy.context.scene:
        return scene, bpy.context.view_layer, radar
    enabled = (layer for layer in scene.view_layers if layer.use)
    return scene, next(enabled, scene.view_layers[0]), radar


def _find(arguments: argparse.Namespace) -> tuple[Any, Any]:
    """Return the scene and the radar that a command line names; without names the active ones."""
    scene = bpy.context.scene
    if arguments.scene is not None:
        if arguments.scene not in bpy.data.scenes:
            found = ", ".join(repr(one.name) for one in bpy.data.scenes)
            raise SceneError(f"The file has no scene {arguments.scene!r}; it has {found}.")
        scene = bpy.data.scenes[arguments.scene]
    if arguments.rig is None:
        return scene, active_radar(scene)
    by_name = {radar.name: radar for radar in radars(scene)}
    if arguments.rig not in by_name:
        known = ", ".join(map(repr, by_name)) or "none"
        raise SceneError(f"The scene has no radar {arguments.rig!r}; it has {known}.")
    return scene, by_name[arguments.rig]


def open_job(
    arguments: argparse.Namespace, open_copy: Callable[[], None] | None = None
) -> MeasurementJob:
    """Open the file of a command line; return its job, which is not prepared yet.

    `open_copy` opens a copy of a file in memory. Such a job resumes no earlier run.
    """
    keep_freed_memory()
    cameras: list[ViewCamera | None] = [None]

    def add_camera(scene: bpy.types.Scene, radar: Any) -> None:
        if sampling_mode(radar, given_settings(arguments)) == "paths":
            cameras.append(add_early_camera(scene, radar))

    scene, view_layer, radar = open_scene(arguments, add_camera, open_copy)
    if arguments.device is not None:
        choose_device(scene, Device(arguments.device.upper()))
    for patterns, choice in ((arguments.mirrors, "first"), (arguments.no_mirrors, "never")):
        if patterns is not None:
            set_mirrors(scene, patterns, choice)
    folder = arguments.out.absolute() if arguments.out else output_folder(radar)
    job = make_job(
        scene,
        view_layer,
        folder,
        radar=radar,
        overwrite=arguments.overwrite,
        given=given_settings(arguments),
        link_budget_file=arguments.link_budget,
    )
    by_scripts = changed_by_scripts(opened_here=arguments.blend is not None)
    if by_scripts:
        job.early_findings.append(finding("changed-by-scripts", *by_scripts))
    elif open_copy is not None:
        job.just_opened = True
    else:
        job.identity = f"{file_identity()} {arguments.mirrors!r} {arguments.no_mirrors!r}"
    job.view_camera = cameras[-1]
    return job


def changed_by_scripts(opened_here: bool) -> list[str]:
    """Return what may have changed the file since it was opened; empty for nothing.

    If radarsim has opened the file, its scripts are disabled. Otherwise the Blender program has
    opened it, and the words of its command line decide.
    """
    found = foreign_handlers()
    if not opened_here:
        own = sys.argv[1 : sys.argv.index("--")] if "--" in sys.argv else sys.argv[1:]
        if not _runs_one_script(own):
            found.append(" ".join(["blender", *own]))
        if bpy.context.preferences.filepaths.use_scripts_auto_execute or _AUTOEXEC & set(own):
            found += [text.name for text in bpy.data.texts if text.use_module]
    return found


def _runs_one_script(own: list[str]) -> bool:
    """Return whether Blender's command line opens this file and runs only this script."""
    words, files, scripts = iter(own), 0, 0
    for word in words:
        if bpy.data.filepath and os.path.realpath(word) == os.path.realpath(bpy.data.filepath):
            files += 1
        elif word in ("-P", "--python"):
            scripts += 1
            next(words, "")
        elif word in _VALUED:
            next(words, "")
        elif word not in _PLAIN:
            return False
    return (files, scripts) == (1, 1)


def check_workers(opened_here: bool) -> None:
    """Check that all workers of a run measure the scene of the file; ConfigError if not."""
    changed = changed_by_scripts(opened_here)
    if changed:
        raise ConfigError(
            f"Scripts may have changed the open scene ({', '.join(changed)}), so radarsim cannot "
            "know whether all workers and parts measure the same one. Save the changed scene, and "
            "give that file to radarsim render."
        )


def limit_threads() -> None:
    """Let Cycles use at most OMP_NUM_THREADS threads, as libraries do. Call it before a job."""
    threads = os.environ.get("OMP_NUM_THREADS", "")
    if threads.isdecimal() and int(threads) > 0:
        for scene in bpy.data.scenes:
            scene.render.threads_mode, scene.render.threads = "FIXED", int(threads)


def _open_file(path: Path) -> None:
    """Open a .blend file with its scripts disabled."""
    remedy = "Give the .blend file to render."
    if os.path.isdir(path):
        if os.path.isfile(path / RUN_FILE):
            remedy += f" This folder holds a run: radarsim process {path} processes it."
        raise ConfigError(f"{path} is a folder, not a .blend file. {remedy}")
    refusal = refusal_to_open(path)
    if refusal:
        raise ConfigError(f"{path} {refusal}. {remedy}")
    before = _version(path)
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path.absolute()), load_ui=False, use_scripts=False)
    except RuntimeError as error:
        said = " ".join(str(error).removeprefix("Error: ").split()).rstrip(".")
        raise SceneError(
            f"{path} cannot be opened: {said}. Give a .blend file that this version of Blender "
            "reads."
        ) from error
    if _version(path) != before:
        raise SceneError(f"{path} was changed while it was opened. Give the command again.")


def _version(path: Path) -> tuple[int, int, int]:
    found = path.stat()
    return found.st_ino, found.st_mtime_ns, found.st_size


def session_folder() -> Path | None:
    """Return Blender's temporary folder of this session; None where it has none of its own."""
    folder = Path(bpy.app.tempdir)
    return folder if folder.name.startswith("blender_") else None


def leave_blender(code: int) -> None:
    """End the process at once with an exit code; all files are written and closed.

    sys.exit would call C++ destructors while Cycles still holds the persistent scene, and a crash
    there would replace the exit code. As a module, Blender 4.5 even hangs if a property group is
    registered or a driver was refused.
    """
    own = session_folder()
    if own is not None:
        shutil.rmtree(own, ignore_errors=True)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
