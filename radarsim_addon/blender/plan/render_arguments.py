# SPDX-License-Identifier: GPL-3.0-or-later
"""Options of ``radarsim render``, by the names of the settings. Does not import bpy."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ...errors import ConfigError
from ...option_arguments import (
    CommandParser,
    add_arguments,
    add_share_arguments,
    given,
)
from ...options import Declared, declared
from ...signal.radar import WAVEFORM_KINDS, Burst, Weather
from .measurement import Measurement, parse_frames
from .path_options import PathOptions
from .run_settings import RunSettings
from .window_settings import merged

#: Settings that one sampling mode alone has.
_RINGS = ("rings", "ring_step_m", "samples")
_PATHS = tuple(
    name for name, item in declared(PathOptions).items()
    if item.of.window and name not in declared(Measurement)
)  # fmt: skip
_EXAMPLES = """examples:
  radarsim render scene.blend --out run --process
  radarsim render scene.blend --out run --frames 1:10 --max-standard-error 5
  blender -b scene.blend -P scripts/render_radar.py -- --out run

What is not given comes from the settings of the file's radar. The same command again resumes a run
that was stopped, if the files of the scene have not changed. Scripts inside the .blend file are not
run (under blender -b give --disable-autoexec, -Y, if your preferences allow them).

exit codes: 0 done, 1 failed, 2 bad arguments, 3 done but a finding of severity error concerns all
frames (no echo, open meshes), 130 stopped by Ctrl-C"""


def render_settings() -> dict[str, Declared]:
    """Return the settings that have options.

    Returns
    -------
    dict of str to Declared
        Declarations by name, in the order of the help.
    """
    run = declared(RunSettings)
    names = ("sampling_mode", "extinction", "waveform_kind", "waveform_file")
    waveforms = [kind for name, kind in WAVEFORM_KINDS.items() if name != "arbitrary"]
    others = merged(Measurement, PathOptions, Burst, Weather, *waveforms)
    return {**{name: run[name] for name in names}, **others}


def parse_render_arguments(
    words: list[str], prog: str = "radarsim render", needs_blend: bool = True
) -> argparse.Namespace:
    """Parse the command line. argparse exits with 2 (bad arguments) or 0 (--help).

    Parameters
    ----------
    words
        Words after the command.
    prog
        Name of the command in its help.
    needs_blend
        Whether a file must be named; else the open one is rendered.

    Returns
    -------
    argparse.Namespace
        Values by the names of the options; None where an option is not given.
    """
    parser = CommandParser(
        prog=prog,
        description="Measure the radar frames of a .blend file without a window.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "blend",
        type=Path,
        nargs=None if needs_blend else "?",
        help=".blend file (under blender -b: the one that is open)",
    )
    parser.add_argument(
        "--out",
        type=folder_name,
        metavar="DIR",
        help=declared(RunSettings)["output_folder"].of.help,
    )
    parser.add_argument("--scene", metavar="NAME", help="Render this scene; else the active one")
    parser.add_argument(
        "--rig", metavar="NAME", help="Measure with this radar; else the active one"
    )
    parser.add_argument("--frames", metavar="A:B[:STEP]", help="Set the frames, both ends included")
    parser.add_argument("--resolution", metavar="WxH", help="Set the pixels, for example 640x360")
    parser.add_argument(
        "--link-budget",
        "--system",
        type=Path,
        metavar="FILE",
        help="Read the link budget (JSON); else the radar's own",
    )
    add_arguments(parser, render_settings())
    parser.add_argument(
        "--mirrors",
        metavar="NAMES",
        help="Image the transmitter in these objects first: names with * and ?, after commas more",
    )
    parser.add_argument(
        "--no-mirrors",
        metavar="NAMES",
        help="Make no image of the transmitter in these objects, whatever their materials",
    )
    parser.add_argument(
        "--device",
        choices=("cpu", "cuda", "optix", "hip", "oneapi", "metal"),
        type=str.lower,
        help="Render with this kind of device; else as file and preferences choose",
    )
    parser.add_argument(
        "--overwrite", action="store_true", help=declared(RunSettings)["overwrite"].of.help
    )
    parser.add_argument(
        "--process", action="store_true", help="Process the run afterwards into DIR/products"
    )
    add_share_arguments(parser)
    parser.add_argument(
        "--plan-only", action="store_true", help="Write run.json for --shard, and render nothing"
    )
    parser.add_argument("--frame-worker", action="store_true", help=argparse.SUPPRESS)
    return parser.parse_args(words)


def folder_name(text: str) -> Path:
    """A path that is not empty: an empty one would be the current folder."""
    if not text.strip():
        raise argparse.ArgumentTypeError("the folder's name is empty")
    return Path(text)


def given_settings(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the values that replace the radar's settings.

    Parameters
    ----------
    arguments
        From `parse_render_arguments`.

    Returns
    -------
    dict of str
        Values by the names of the settings, in SI.

    Raises
    ------
    ConfigError
        Options that exclude one another.
    """
    values = given(arguments, render_settings())
    if arguments.frames is not None:
        values["frames"] = parse_frames(arguments.frames)
    if arguments.resolution is not None:
        values["width_px"], values["height_px"] = _parse_resolution(arguments.resolution)
    mode = _sampling_mode(arguments, values)
    if mode is not None:
        values["sampling_mode"] = mode
    return values


def _sampling_mode(arguments: argparse.Namespace, values: dict[str, Any]) -> str | None:
    """The mode that was named, or that the options belong to; None: the radar's own."""
    if "sampling_mode" in values:
        return str(values["sampling_mode"])
    settings = render_settings()
    of_rings = [settings[name].flag for name in _RINGS if name in values]
    of_paths = [settings[name].flag for name in _PATHS if name in values]
    if of_rings and of_paths:
        raise ConfigError(
            f"{of_paths[0]} belongs to paths and {of_rings[0]} to rings. Give options of one of "
            "them, or choose with --sampling-mode."
        )
    return "rings" if of_rings else "paths" if of_paths else None


def _parse_resolution(text: str) -> tuple[int, int]:
    """Return ``640x360`` as two numbers."""
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdecimal() for part in parts):
        raise ConfigError(f"Resolution {text!r} is not understood; expected WxH, such as 640x360.")
    width, height = map(int, parts)
    for name, value in (("width", width), ("height", height)):
        if value == 0:
            raise ConfigError(f"Resolution {text!r} has a {name} of 0; expected at least 1 pixel.")
    return width, height
