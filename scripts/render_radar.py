# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the radar frames of a .blend file without a window.

    blender -b scene.blend -P scripts/render_radar.py -- --out DIR [options]
    python scripts/render_radar.py scene.blend --out DIR [options]      (Python with bpy)

What is not given comes from the file's own radar settings. A run that was stopped goes on where it
stopped when the same command is given again. Scripts inside the .blend file are not run (under
blender -b give --disable-autoexec, -Y, if your preferences allow them).

Exit codes: 0 done, 1 failed, 2 bad arguments, 130 stopped by Ctrl-C.
"""

from __future__ import annotations

import argparse
import math
import os
import shutil
import signal
import sys
import traceback
import types
from pathlib import Path
from typing import Any


def finite_number(text: str) -> float:
    """A number that is neither NaN nor infinite."""
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text} is not a finite number")
    return value


def folder_name(text: str) -> Path:
    """A path that is not empty: an empty one would be the current folder."""
    if not text.strip():
        raise argparse.ArgumentTypeError("the folder's name is empty")
    return Path(text)


def parse_arguments(arguments: list[str], needs_blend: bool) -> argparse.Namespace:
    """Options of the command line. argparse exits with 2 (bad) or 0 (--help)."""
    assert __doc__ is not None
    parser = argparse.ArgumentParser(
        prog="render_radar.py",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "blend",
        type=Path,
        nargs=None if needs_blend else "?",
        help="the .blend file (under blender -b: the one that is open)",
    )
    parser.add_argument(
        "--out",
        type=folder_name,
        metavar="DIR",
        help="folder of the run; made if its parent exists",
    )
    parser.add_argument("--scene", metavar="NAME", help="scene to render; else the active one")
    parser.add_argument("--frames", metavar="A:B[:STEP]", help="Blender frames, both ends included")
    parser.add_argument("--rings", type=int, metavar="N", help="number of rings")
    parser.add_argument(
        "--auto-rings", action="store_true", help="as many rings as the scene's extent needs"
    )
    parser.add_argument(
        "--sampling-mode",
        "--acquisition",
        choices=("rings", "paths"),
        help="rings: the paper's shells; paths: one path per pixel, with standard errors. Left "
        "out: that of the other options given, else the file's own",
    )
    parser.add_argument(
        "--max-reflections", "--order", type=int, metavar="N", help="paths: most reflections"
    )
    parser.add_argument(
        "--replicates", "--shifts", type=int, metavar="N", help="paths: replicates of each tile"
    )
    parser.add_argument(
        "--max-standard-error",
        "--error",
        type=finite_number,
        metavar="PERCENT",
        help="paths: refine until this standard error",
    )
    parser.add_argument(
        "--refine-for",
        "--error-of",
        choices=("both", "ranges", "objects"),
        help="paths: what --error is of; objects: of the power of each object, small ones too",
    )
    parser.add_argument(
        "--time-limit",
        "--budget",
        type=finite_number,
        metavar="S",
        help="paths: stop refining a frame after S seconds",
    )
    parser.add_argument(
        "--motion",
        choices=("kinematic", "off"),
        help="paths: lengths at every pulse from the animation, or all stands still in a burst",
    )
    parser.add_argument(
        "--motion-samples",
        type=int,
        metavar="N",
        help="paths: most moments of a burst at which the animation is looked at",
    )
    parser.add_argument(
        "--visibility-updates",
        "--renders-per-burst",
        type=int,
        metavar="N",
        help="paths: more than one where what is visible changes during a burst",
    )
    parser.add_argument(
        "--range-encoding",
        "--code",
        choices=("auto", "materials", "world"),
        help="paths: what carries the range code; world: materials of any kind echo",
    )
    parser.add_argument(
        "--amplitude-channel",
        "--amplitude",
        choices=("mean", "R", "G", "B"),
        help="paths: channel that is the amplitude in coloured scenes",
    )
    parser.add_argument("--ring-step", type=finite_number, metavar="M", help="width of a ring [m]")
    parser.add_argument("--snapshots", "--passes", type=int, choices=(1, 2), help="1: no Doppler")
    parser.add_argument(
        "--snapshot-interval",
        "--delta-t",
        type=finite_number,
        metavar="S",
        help="time between the passes [s]",
    )
    parser.add_argument("--samples", type=int, metavar="N", help="paths a pixel")
    parser.add_argument("--resolution", metavar="WxH", help="pixels, for example 640x360")
    parser.add_argument("--bounces", type=int, metavar="N", help="reflections after the first one")
    parser.add_argument(
        "--waveform",
        "--radar",
        type=Path,
        metavar="FILE",
        help="waveform and burst (JSON); else the file's own",
    )
    parser.add_argument("--carrier-ghz", type=finite_number, metavar="F", help="carrier [GHz]")
    parser.add_argument("--bandwidth-mhz", type=finite_number, metavar="B", help="bandwidth [MHz]")
    parser.add_argument("--chirp-us", type=finite_number, metavar="T", help="chirp length [us]")
    parser.add_argument(
        "--sampling-mhz", type=finite_number, metavar="F", help="sampling rate [MHz]"
    )
    parser.add_argument("--prf-hz", type=finite_number, metavar="F", help="pulses a second [Hz]")
    parser.add_argument("--pulses", type=int, metavar="N", help="pulses of a burst")
    parser.add_argument("--seed", type=int, metavar="N", help="Cycles' seed")
    parser.add_argument(
        "--polarisation",
        choices=("average", "vertical", "horizontal"),
        help="of waves that go through physical materials",
    )
    parser.add_argument(
        "--link-budget",
        "--system",
        type=Path,
        metavar="FILE",
        help="power budget (JSON); else the file's own",
    )
    parser.add_argument(
        "--overwrite", action="store_true", help="remove another run's frames from the folder"
    )
    parser.add_argument(
        "--process", action="store_true", help="process the run afterwards into DIR/products"
    )
    return parser.parse_args(arguments)


def load_package() -> types.ModuleType:
    """The radarsim package: the installed one, else the one beside this script's folder."""
    repository = Path(__file__).resolve().parents[1]
    if (repository / "radarsim_addon" / "__init__.py").is_file():
        # A checkout: its own package, also where another version is installed. Only this script
        # does that; the package itself never touches sys.path.
        sys.path.insert(0, str(repository))
    import radarsim_addon

    return radarsim_addon


#: Exit code after Ctrl-C, as shells have it: 128 + SIGINT.
INTERRUPTED = 130


class StopRequest:
    """Ctrl-C: the first one asks to stop after the running render, the second one stops at once.

    Raising KeyboardInterrupt would not do: Cycles' Python part swallows it in the middle of a
    render and goes on.
    """

    def __init__(self) -> None:
        self.asked = False
        signal.signal(signal.SIGINT, self._on_signal)

    def _on_signal(self, *_: Any) -> None:
        if self.asked:
            os._exit(INTERRUPTED)
        self.asked = True
        print("\nradarsim: stopping after this step (Ctrl-C again: at once)", file=sys.stderr)


def run(arguments: argparse.Namespace, inside_blender: bool, stop: StopRequest) -> int:
    """Render, and process if asked for. Returns the exit code."""
    try:
        load_package()
        from radarsim_addon.errors import RadarSimError
    except ImportError as error:
        return fail(f"radarsim_addon cannot be imported ({error}). Install it: pip install .", 1)
    if not inside_blender:
        try:
            import bpy  # noqa: F401
        except ImportError as error:
            return fail(
                f"MissingDependencyError: bpy cannot be imported ({error}). Install it with "
                "'pip install .[blender]' (Python 3.13 or 3.11), or run this script by "
                "blender -b FILE -P.",
                1,
            )
    try:
        return render(arguments, inside_blender, stop)
    except RadarSimError as error:
        return fail(f"{type(error).__name__}: {error}", error.exit_code)
    except KeyboardInterrupt:
        return fail("Interrupted; the same command goes on where it stopped.", INTERRUPTED)


def render(arguments: argparse.Namespace, inside_blender: bool, stop: StopRequest) -> int:
    """Everything that needs the package."""
    import bpy

    from radarsim_addon.blender.headless import ProgressLine, command_line, make_job, quiet_blender
    from radarsim_addon.blender.settings import radar as properties

    # An enabled extension has registered its settings already, perhaps from another copy of the
    # package; those hold the file's values, and only their names matter here.
    if not hasattr(bpy.types.Scene, properties.SCENE_PROPERTY):
        properties.register()
    overrides = command_line.command_line_overrides(arguments)
    with quiet_blender() as stream:
        if arguments.blend is not None:
            open_file(bpy, arguments.blend)
        scene = find_scene(bpy, arguments.scene)
        folder = arguments.out.absolute() if arguments.out else properties.output_folder(scene)
        job = make_job(
            scene,
            view_layer_of(bpy, scene),
            folder,
            overwrite=arguments.overwrite,
            sampling_mode=command_line.chosen_acquisition(arguments),
            overrides=overrides,
            path_overrides=command_line.path_overrides(arguments),
            system_file=arguments.link_budget,
        )
        job.file_just_opened = arguments.blend is not None
        with job:
            known = len(job.warnings)
            print_warnings(job.warnings, stream)
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
                print_warnings(job.warnings[known:], stream)
        if job.summary:
            print(f"radarsim: {job.summary}", file=stream, flush=True)
        print(f"radarsim: wrote {folder}", file=stream, flush=True)
        if arguments.process:
            process(folder, stream, stop)
    return 0


def print_warnings(warnings: list[str], stream: Any) -> None:
    """One line each; a name in it must not steer the terminal."""
    from radarsim_addon.terminal_text import printable

    for warning in warnings:
        print(f"radarsim: warning: {printable(warning)}", file=stream, flush=True)


def process(folder: Path, stream: Any, stop: StopRequest) -> None:
    """Run the companion module over the run's folder."""
    from radarsim_addon.framewarnings import FrameWarnings
    from radarsim_addon.signal.pipeline.process import FrameResult, process_run

    warnings = FrameWarnings()
    try:
        for event in process_run(folder):
            if stop.asked:
                raise KeyboardInterrupt
            if isinstance(event, FrameResult):
                print(f"radarsim: frame {event.frame}: {len(event.files)} files", file=stream)
                warnings.add(event.frame, event.warnings)
    finally:
        print_warnings(warnings.lines(), stream)
    print(f"radarsim: processed into {folder / 'products'}", file=stream, flush=True)


def open_file(bpy: Any, path: Path) -> None:
    """Open a .blend file with its scripts disabled."""
    from radarsim_addon.errors import ConfigError, SceneError

    if not path.is_file():
        raise ConfigError(f"{path} does not exist. Give the .blend file to render.")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path.absolute()), load_ui=False, use_scripts=False)
    except RuntimeError as error:
        raise SceneError(
            f"{path} cannot be opened: {str(error).strip()} "
            "Give a .blend file that this version of Blender reads."
        ) from error


def find_scene(bpy: Any, name: str | None) -> Any:
    """The scene of that name, or the active one."""
    from radarsim_addon.errors import SceneError

    if name is None:
        return bpy.context.scene
    if name not in bpy.data.scenes:
        found = ", ".join(repr(scene.name) for scene in bpy.data.scenes)
        raise SceneError(f"The file has no scene {name!r}; it has {found}.")
    return bpy.data.scenes[name]


def view_layer_of(bpy: Any, scene: Any) -> Any:
    """The view layer to measure: the active one of the active scene, else the first enabled one."""
    if scene == bpy.context.scene:
        return bpy.context.view_layer
    return next((layer for layer in scene.view_layers if layer.use), scene.view_layers[0])


def fail(message: str, code: int) -> int:
    """Print a message on standard error and hand the exit code on."""
    print(f"radarsim: {message}", file=sys.stderr, flush=True)
    return code


def main() -> None:
    """Entry under both kinds of Python."""
    inside_blender = "bpy" in sys.modules and bool(sys.modules["bpy"].app.binary_path)
    if inside_blender:
        marker = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
        words = sys.argv[marker + 1 :]
    else:
        words = sys.argv[1:]
    try:
        arguments = parse_arguments(words, needs_blend=not inside_blender)
        code = run(arguments, inside_blender, StopRequest())
    except SystemExit as end:  # argparse: 0 after --help, 2 after bad arguments
        code = end.code if isinstance(end.code, int) else 2
    except Exception:
        traceback.print_exc()  # a defect; Blender would print it and quit with 0
        code = 1
    if "bpy" in sys.modules:
        leave_blender(code)
    sys.exit(code)


def leave_blender(code: int) -> None:
    """Quit at once with this exit code; all files are written and closed.

    sys.exit would run C++ destructors while Cycles still holds the persistent scene; a crash there
    would replace the exit code. As a module Blender 4.5 even hangs there, with a property group
    registered or a driver that was refused.
    """
    session_folder = Path(sys.modules["bpy"].app.tempdir)
    if session_folder.name.startswith("blender_"):
        shutil.rmtree(session_folder, ignore_errors=True)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


if __name__ == "__main__":
    main()
