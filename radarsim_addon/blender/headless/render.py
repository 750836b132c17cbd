# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim render``: measure the radar frames of a .blend file without a window."""

from __future__ import annotations

import argparse
import os
import shutil
import signal as signals
import sys
import traceback
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import bpy

from ... import contract
from ...errors import ConfigError, RadarSimError, SceneError
from ...findings import Finding, exit_code, finding_lines
from ...processes import own_folder, remove_abandoned_folders
from ...sidecar import read_record
from ...signal.pipeline import FrameResult, process_run
from ...signal.runs import open_run
from ..plan import given_settings
from ..rig_settings import RADAR_PROPERTY, migrate_scene, output_folder, register
from ..scene import active_radar, radars
from .console import ProgressLine, quiet_blender
from .jobs import make_job


class _StopRequest:
    """Ctrl-C or SIGTERM: the first asks to stop after the running render, a second stops at once.

    Raising KeyboardInterrupt would not do: Cycles' Python part swallows it in the middle of a
    render and continues.
    """

    def __init__(self) -> None:
        self.asked = False
        #: Exit code, as in shells: 128 + number of the signal.
        self.code = 128 + signals.SIGINT
        for number in (signals.SIGINT, signals.SIGTERM):
            signals.signal(number, self._on_signal)

    def _on_signal(self, number: int, _: Any) -> None:
        self.code = 128 + number
        if self.asked:
            os._exit(self.code)
        self.asked = True
        print("\nradarsim: stopping after this step (Ctrl-C again: at once)", file=sys.stderr)


def run_and_leave(arguments: argparse.Namespace) -> None:
    """Render, then end the process with the exit code of the command."""
    try:
        code = run(arguments, _StopRequest())
    except Exception:
        traceback.print_exc()  # a defect; Blender would print it and quit with 0
        code = 1
    _leave_blender(code)


def run(arguments: argparse.Namespace, stop: _StopRequest) -> int:
    """Render, and process if asked for. Return the exit code."""
    try:
        return measure(arguments, stop)
    except RadarSimError as error:
        return _fail(f"{type(error).__name__}: {error}", error.exit_code)
    except KeyboardInterrupt:
        return _fail("Interrupted; the same command resumes the run.", stop.code)


def measure(arguments: argparse.Namespace, stop: _StopRequest) -> int:
    """Measure what the command line asks for; KeyboardInterrupt: Ctrl-C, after the running step.

    Return the exit code.
    """
    # An enabled extension has registered its settings already, perhaps from another copy of the
    # package; those hold the file's values, and only their names matter here.
    if not hasattr(bpy.types.Object, RADAR_PROPERTY):
        register()
    given = given_settings(arguments)
    session_folder = _session_folder()
    if session_folder is not None:
        own_folder(session_folder)
    remove_abandoned_folders()
    with quiet_blender() as stream:
        if arguments.blend is not None:
            _open_file(arguments.blend)
        scene = _find_scene(arguments.scene)
        migrate_scene(scene)  # opened before the settings were registered: blender -b FILE -P
        radar = active_radar(scene) if arguments.rig is None else _find_radar(scene, arguments.rig)
        folder = arguments.out.absolute() if arguments.out else output_folder(radar)
        job = make_job(
            scene,
            _view_layer_of(scene),
            folder,
            radar=radar,
            overwrite=arguments.overwrite,
            given=given,
            link_budget_file=arguments.link_budget,
        )
        job.file_just_opened = arguments.blend is not None
        with job:
            _print_findings(job.run_findings, job.frames, stream)
            progress = ProgressLine(stream, job.unit)
            progress.show(job.done, job.total, None)
            try:
                for task in job.pending():
                    if stop.asked:
                        raise KeyboardInterrupt
                    job.start(task)
                    job.render(task)
                    job.finish(task)
                    progress.show(job.done, job.total, job.seconds_left)
                progress.show(job.done, job.total, None)
            finally:  # of the frames that are done, whatever ended the run
                _print_findings(job.frame_findings, job.frames, stream)
        if job.summary:
            print(f"radarsim: {job.summary}", file=stream, flush=True)
        print(f"radarsim: wrote {folder}", file=stream, flush=True)
        done = 0
        held = any(item.code == "frames-left-to-others" for item in job.frame_findings)
        if arguments.process and held and open_run(folder).missing():
            text = "not processed: other processes still measure frames; the last one processes all"
            print(f"radarsim: {text}", file=stream, flush=True)
        elif arguments.process:
            done = process(folder, stream, stop, {item.code for item in job.findings})
        return max(
            done, exit_code([*job.run_findings, *_frame_findings(folder, job.frames)], job.frames)
        )


def _frame_findings(folder: Path, frames: Sequence[int]) -> list[Finding]:
    """Findings of these frames as far as they are done, by this session or earlier ones."""
    found = []
    for frame in frames:
        path = folder / contract.frame_dir(frame) / contract.PATHS_FILE
        if path.is_file():
            found += read_record(path, contract.PathsRecord).findings
    return found


def _print_findings(findings: list[Finding], frames: Sequence[int], stream: Any) -> None:
    """Print findings of `frames`, one line each."""
    for line in finding_lines(findings, frames):
        print(f"radarsim: {line}", file=stream, flush=True)


def process(folder: Path, stream: Any, stop: _StopRequest, printed: Collection[str]) -> int:
    """Process the run; print findings whose codes were not printed at the render.

    Return the exit code.
    """
    findings: list[Finding] = []
    frames: list[int] = []
    try:
        for event in process_run(folder):
            if stop.asked:
                raise KeyboardInterrupt
            if isinstance(event, FrameResult):
                print(f"radarsim: frame {event.frame}: {len(event.files)} files", file=stream)
                findings += event.findings
                frames.append(event.frame)
    finally:
        _print_findings([i for i in findings if i.code not in printed], frames, stream)
    print(f"radarsim: processed into {folder / 'products'}", file=stream, flush=True)
    return exit_code(findings, frames)


def _open_file(path: Path) -> None:
    """Open a .blend file with its scripts disabled."""
    if not path.is_file():
        raise ConfigError(f"{path} does not exist. Give the .blend file to render.")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path.absolute()), load_ui=False, use_scripts=False)
    except RuntimeError as error:
        raise SceneError(
            f"{path} cannot be opened: {str(error).strip()} "
            "Give a .blend file that this version of Blender reads."
        ) from error


def _find_scene(name: str | None) -> Any:
    """The scene of that name, or the active one."""
    if name is None:
        return bpy.context.scene
    if name not in bpy.data.scenes:
        found = ", ".join(repr(scene.name) for scene in bpy.data.scenes)
        raise SceneError(f"The file has no scene {name!r}; it has {found}.")
    return bpy.data.scenes[name]


def _view_layer_of(scene: Any) -> Any:
    """The view layer to measure: the active one of the active scene, else the first enabled one."""
    if scene == bpy.context.scene:
        return bpy.context.view_layer
    return next((layer for layer in scene.view_layers if layer.use), scene.view_layers[0])


def _fail(message: str, code: int) -> int:
    """Print a message on standard error and hand the exit code on."""
    print(f"radarsim: {message}", file=sys.stderr, flush=True)
    return code


def _find_radar(scene: Any, name: str) -> Any:
    """Return the radar of that name."""
    found = {radar.name: radar for radar in radars(scene)}
    if name not in found:
        known = ", ".join(map(repr, found)) or "none"
        raise SceneError(f"The scene has no radar {name!r}; it has {known}.")
    return found[name]


def _session_folder() -> Path | None:
    """Blender's temporary folder of this session; None where it has none of its own."""
    folder = Path(bpy.app.tempdir)
    return folder if folder.name.startswith("blender_") else None


def _leave_blender(code: int) -> None:
    """Quit at once with this exit code; all files are written and closed.

    sys.exit would run C++ destructors while Cycles still holds the persistent scene; a crash there
    would replace the exit code. As a module Blender 4.5 even hangs there, with a property group
    registered or a driver that was refused.
    """
    session_folder = _session_folder()
    if session_folder is not None:
        shutil.rmtree(session_folder, ignore_errors=True)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
