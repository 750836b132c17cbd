# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim objects DIR --object NAME``: cross section and power of objects, frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ...errors import FrameFileError
from ...findings import Finding, finding_lines
from ...terminal_text import printable
from ..decoding import open_frame
from ..detection import (
    BudgetReport,
    FrameBudget,
    matching_objects,
    object_echoes,
    projection_findings,
)
from ..radar import read_system
from ..runs import open_run
from .console import Subcommands


def add_objects_parser(commands: Subcommands, frame_numbers: Callable[[str], list[int]]) -> None:
    """Add the command to an argparse collection of commands."""
    parser = commands.add_parser(
        "objects",
        help="radar cross section and power of objects, from their paths",
        epilog='example: radarsim objects run --object "Car*"',
    )
    parser.add_argument("folder", metavar="DIR", help="folder that holds run.json")
    parser.add_argument(
        "--object",
        metavar="NAME",
        help="object, collection, or a pattern with * and ?; several are taken together "
        "[each object by itself]",
    )
    parser.add_argument("--frames", type=frame_numbers, metavar="A:B", help="frames [all]")
    parser.add_argument(
        "--link-budget", "--system", metavar="FILE", help="link budget (JSON) [the run's own]"
    )


def print_objects(
    folder: str, pattern: str | None, frames: Sequence[int] | None, system_file: str | None
) -> int:
    """Print a line for each frame and object; return the exit code."""
    run = open_run(folder)
    link_budget = None if system_file is None else read_system(system_file)
    chosen = [run.frame(n) for n in frames] if frames is not None else list(run.frames())
    findings: list[Finding] = []
    for frame in chosen:
        gaps = frame.missing()
        if gaps:
            raise FrameFileError(f"{frame.path}: {gaps[0].reason}. Render the run again.")
        frame_input = open_frame(frame, link_budget=link_budget)
        groups = None if pattern is None else {pattern: matching_objects(frame_input, pattern)}
        link = FrameBudget(frame_input).link
        echoes = object_echoes(frame_input, run.radar.waveform.carrier_hz, link, groups)
        total_w = sum(echo.power_w for echo in echoes)
        print(f"frame {frame.number}: t = {frame.time_s:g} s")
        for line in BudgetReport(total_w, None, echoes).lines():
            print(f"  {line}")
        for echo in echoes:
            if echo.multi_object_power_w > 0.01 * echo.power_w:
                print(
                    f"  {printable(echo.name)}: another {echo.multi_object_power_w:.3g} "
                    "W come by way of "
                    "other objects too and are not in its cross section"
                )
        findings += (found.in_frame(frame.number) for found in projection_findings(frame_input))
    for line in finding_lines(findings, [frame.number for frame in chosen]):
        print(line)
    return 0
