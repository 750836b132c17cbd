# SPDX-License-Identifier: GPL-3.0-or-later
"""Options of ``radarsim coverage``. Does not import bpy."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...array_types import Real
from ...errors import ConfigError
from ...option_arguments import CommandParser, add_arguments, finite_number
from .render_arguments import folder_name, render_settings

#: Settings of the radar that the command line can replace.
COVERAGE_SETTINGS = ("carrier_hz", "polarisation", "beyond_band")
#: Steps of an axis whose step is not given.
_STEPS = 400
_MOST_STEPS = 100_000
_EXAMPLE = """example:
  radarsim coverage scene.blend --target-height 0:60:0.5 --range-limits 500:20000

Writes coverage.png (height against range), coverage.npz (all numbers) and coverage.csv (over height
at one range) into the folder. Nothing is rendered."""


@dataclass(frozen=True)
class CoverageRequest:
    """What a coverage diagram is to show.

    Attributes
    ----------
    height_m, range_m
        Heights of targets over the ground, and ranges along it [m].
    curve_m
        Range of the curve over height [m]; None: the last one.
    ground
        Name of the object that is the ground; None: the largest one straight below the radar.
    rms_height_m
        RMS height of the ground in place of its material's [m].
    flat
        Take the Earth for flat.
    """

    height_m: Real
    range_m: Real
    curve_m: float | None = None
    ground: str | None = None
    rms_height_m: float | None = None
    flat: bool = False


def parse_axis(name: str, text: str) -> Real:
    """Return the values of ``FIRST:LAST`` or ``FIRST:LAST:STEP``.

    Parameters
    ----------
    name
        What they are, for the message.
    text
        Numbers in metres, both ends included.

    Returns
    -------
    ndarray
        Rising values; without a step, 401 of them.

    Raises
    ------
    ConfigError
        The text is not such, or it has more than 100 000 steps.
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

    Parameters
    ----------
    words
        Words after ``radarsim coverage``.

    Returns
    -------
    argparse.Namespace
        For `coverage_request`, and with the values of `COVERAGE_SETTINGS` that were given.
    """
    parser = CommandParser(
        prog="radarsim coverage",
        description="Draw the echo of a target over the ground of a .blend file: height against "
        "range.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
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


def coverage_request(arguments: argparse.Namespace) -> CoverageRequest:
    """Return what a command line asks for.

    Parameters
    ----------
    arguments
        From `parse_coverage_arguments`.

    Returns
    -------
    CoverageRequest
        Its axes rise.

    Raises
    ------
    ConfigError
        An axis is not understood.
    """
    return CoverageRequest(
        parse_axis("--target-height", arguments.target_height),
        parse_axis("--range-limits", arguments.range_limits),
        arguments.curve_range,
        arguments.ground,
        arguments.rms_height,
        arguments.flat,
    )
