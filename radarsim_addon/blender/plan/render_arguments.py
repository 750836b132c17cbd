# SPDX-License-Identifier: GPL-3.0-or-later
"""Options of ``radarsim render``, ``coverage`` and ``selfcheck``, by the names of the settings.

Does not import bpy.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

from ...arrays import Real
from ...errors import ConfigError
from ...options import (
    CommandParser,
    Declared,
    add_arguments,
    add_share_arguments,
    declared,
    finite_number,
    given,
)
from ...signal.radar import WAVEFORM_KINDS, Burst, Weather
from .measurement import Measurement, PathOptions, RunSettings, parse_frames

#: Kinds of devices that Cycles has, as its preferences name them.
_DEVICES = ("CPU", "CUDA", "OPTIX", "HIP", "ONEAPI", "METAL")


def merged(*kinds: type[Any]) -> dict[str, Declared]:
    """Return the settings of several dataclasses that the window shows; one name is one setting.

    In the order of the dataclasses and their fields. TypeError, a defect: two of them declare the
    same name differently.
    """
    found: dict[str, Declared] = {}
    for kind in kinds:
        for name, item in declared(kind).items():
            if item.of.window and found.setdefault(name, item) != item:
                raise TypeError(f"{kind.__name__}.{name} is declared otherwise elsewhere.")
    return found


def shortest_decimal(value: float, exponent: int = 0) -> float:
    """Return the decimal number that was typed into a float32 field, times ``10**exponent``.

    Blender's float properties are float32: 77 GHz as 77e9 would read back 76999999488. Seven
    significant digits are what float32 keeps of any typed number. NaN and infinity stay.
    """
    if not math.isfinite(value):
        return value
    return float(Decimal(f"{value:.7g}").scaleb(exponent))


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

What is not given comes from the settings of the file's radar. The same command
again resumes a run that was stopped, if the files of the scene have not
changed. Scripts inside the .blend file are not run (under blender -b give
--disable-autoexec, -Y, if your preferences allow them).

exit codes: 0 done, 1 failed, 2 bad arguments, 3 done but a finding of severity
error concerns all frames (no echo, open meshes), 130 stopped by Ctrl-C"""


def render_settings() -> dict[str, Declared]:
    """Return the settings that have options, in the order of the help."""
    run = declared(RunSettings)
    names = ("sampling_mode", "extinction", "waveform_kind", "waveform_file")
    waveforms = [kind for name, kind in WAVEFORM_KINDS.items() if name != "arbitrary"]
    others = merged(Measurement, PathOptions, Burst, Weather, *waveforms)
    return {**{name: run[name] for name in names}, **others}


def parse_render_arguments(
    words: list[str], prog: str = "radarsim render", needs_blend: bool = True
) -> argparse.Namespace:
    """Parse the command line. argparse exits with 2 (bad arguments) or 0 (--help).

    Values are None where an option is not given. Without `needs_blend` the open file is rendered.
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
    parser.set_defaults(view_layer=None)
    return parser.parse_args(words)


def folder_name(text: str) -> Path:
    """Return a path that is not empty: an empty one would be the current folder."""
    if not text.strip():
        raise argparse.ArgumentTypeError("the folder's name is empty")
    return Path(text)


def given_settings(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the values that replace the radar's settings, in SI, from `parse_render_arguments`.

    Raises ConfigError for options that exclude one another.
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
    """Return the mode that was named, or that the options belong to; None: the radar's own."""
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


# Options of ``radarsim coverage``.

#: Settings of the radar that the command line can replace.
COVERAGE_SETTINGS = ("carrier_hz", "polarisation", "beyond_band")
#: Steps of an axis whose step is not given.
_STEPS = 400
_MOST_STEPS = 100_000
_EXAMPLE = """example:
  radarsim coverage scene.blend --target-height 0:60 --range-limits 500:20000

Writes coverage.png (height against range), coverage.npz (all numbers) and
coverage.csv (over height at one range) into the folder. Nothing is rendered."""


@dataclass(frozen=True)
class CoverageRequest:
    """What a coverage diagram is to show."""

    #: Heights of targets over the ground, and ranges along it; both rise.
    height_m: Real
    range_m: Real
    #: Range of the curve over height; None: the last one.
    curve_m: float | None = None
    #: Name of the object that is the ground; None: the largest one straight below the radar.
    ground: str | None = None
    #: RMS height of the ground in place of its material's.
    rms_height_m: float | None = None
    #: Take the Earth for flat.
    flat: bool = False


def parse_axis(name: str, text: str) -> Real:
    """Return the rising values of ``FIRST:LAST`` (401 of them) or ``FIRST:LAST:STEP``, both ends
    included.

    `name` is for the message of the ConfigError: the text is not such, or has more than 100 000
    steps.
    """
    try:
        numbers = [finite_number(part) for part in text.split(":")]
    except argparse.ArgumentTypeError:
        numbers = []
    if len(numbers) in (2, 3) and numbers[1] > numbers[0]:
        first, last = numbers[:2]
        step = numbers[2] if len(numbers) == 3 else (last - first) / _STEPS
        if step > 0 and (last - first) / step <= _MOST_STEPS:
            count = int((last - first) / step * (1 + 1e-12)) + 1
            return np.asarray(first + step * np.arange(count), dtype=np.float64)
    raise ConfigError(
        f"{name} {text!r} is not understood; expected FIRST:LAST or FIRST:LAST:STEP in metres, "
        f"with FIRST below LAST and at most {_MOST_STEPS:,} steps, for example 0:60:0.5."
    )


def parse_coverage_arguments(words: list[str]) -> argparse.Namespace:
    """Parse the command line. argparse exits with 2 (bad arguments) or 0 (--help).

    The values are for `coverage_request`, with those of `COVERAGE_SETTINGS` that were given.
    """
    parser = CommandParser(
        prog="radarsim coverage",
        description="Draw the echo of a target over the ground of a .blend file.\n"
        "Height is drawn against range.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.set_defaults(view_layer=None)
    parser.add_argument("blend", type=Path, help=".blend file with a radar over a ground")
    parser.add_argument(
        "--target-height", metavar="A:B[:STEP]", required=True,
        help="Set the heights of the target over the ground [m]",
    )  # fmt: skip
    parser.add_argument(
        "--range-limits", metavar="A:B[:STEP]", required=True,
        help="Set the ranges along the ground [m]",
    )  # fmt: skip
    parser.add_argument(
        "--curve-range", type=finite_number, metavar="M",
        help="Draw the curve over height at this range, next to the closed form; else at the last",
    )  # fmt: skip
    parser.add_argument(
        "--out", type=folder_name, metavar="DIR",
        help="Write into this folder; else next to the .blend file",
    )  # fmt: skip
    parser.add_argument("--scene", metavar="NAME", help="Take this scene; else the active one")
    parser.add_argument("--rig", metavar="NAME", help="Take this radar; else the active one")
    parser.add_argument(
        "--link-budget", type=Path, metavar="FILE",
        help="Read the antennas (JSON); else the radar's own",
    )  # fmt: skip
    parser.add_argument(
        "--ground", metavar="NAME",
        help="Take this object for the ground; else the largest one straight below the radar",
    )  # fmt: skip
    parser.add_argument(
        "--rms-height", type=finite_number, metavar="M",
        help="Set the RMS height of the ground [m]; else its material's",
    )  # fmt: skip
    parser.add_argument(
        "--flat", action="store_true",
        help="Take the Earth for flat, as a render does; else 4/3 of its radius",
    )  # fmt: skip
    add_arguments(parser, render_settings(), *COVERAGE_SETTINGS)
    return parser.parse_args(words)


def parse_selfcheck_arguments(words: list[str]) -> str:
    """Return the kind of device of a command line. argparse exits with 2 or 0 (--help)."""
    parser = CommandParser(
        prog="radarsim selfcheck",
        description="Check on small scenes that Cycles gives what measurements stand on.",
    )
    parser.add_argument(
        "--device", choices=[kind.lower() for kind in _DEVICES], default="cpu", type=str.lower,
        help="Check the devices of this kind [cpu]",
    )  # fmt: skip
    return str(parser.parse_args(words).device).upper()


def coverage_request(arguments: argparse.Namespace) -> CoverageRequest:
    """Return what a command line asks for; ConfigError if an axis is not understood."""
    return CoverageRequest(
        parse_axis("--target-height", arguments.target_height),
        parse_axis("--range-limits", arguments.range_limits),
        arguments.curve_range,
        arguments.ground,
        arguments.rms_height,
        arguments.flat,
    )
