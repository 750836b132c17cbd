# SPDX-License-Identifier: GPL-3.0-or-later
"""The ``radarsim`` command: ``radarsim process DIR`` and ``radarsim info DIR``.

Exit codes: 0 done, 1 failed, 2 bad arguments, 3 done but a finding of severity error concerns all
frames, 130 stopped by Ctrl-C; on stderr ``radarsim: Name: message``.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence

from ... import __version__
from ...errors import RadarSimError
from ...findings import Finding, exit_code, finding_lines
from ...terminal_text import printable
from ..detection import target_count
from ..maps import level_unit
from ..results import FrameResult
from .antennas_command import add_antennas_parser, print_antennas
from .console import detection_lines, map_digits
from .info_command import print_run
from .objects_command import add_objects_parser, print_objects
from .process import Progress, process_run
from .process_arguments import add_process_parser, frame_numbers, process_options


def _parser(others: Mapping[str, str]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="radarsim", description="Radar products from a run that Blender rendered."
    )
    parser.add_argument("--version", action="version", version=f"radarsim {__version__}")
    commands = parser.add_subparsers(dest="command", required=True)
    for name, text in others.items():
        commands.add_parser(name, help=text)
    info = commands.add_parser(
        "info",
        help="what a run is, and whether it is complete",
        epilog="example: radarsim info run",
    )
    info.add_argument("folder", metavar="DIR", help="folder that holds run.json")
    add_process_parser(commands)
    add_objects_parser(commands, frame_numbers)
    add_antennas_parser(commands)
    return parser


def main(arguments: Sequence[str] | None = None, others: Mapping[str, str] | None = None) -> int:
    """Run the command and return its exit code.

    Parameters
    ----------
    arguments
        Words of the command line; None: those of the process.
    others
        Commands of the caller with their help, for the list of commands.

    Returns
    -------
    int
        0, 3 if a finding of severity error concerns all frames, 130 after an interruption, or the
        exit code of the named error.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words[:1] == ["rcs"]:  # its name in 0.1
        words[0] = "objects"
    for stream in (sys.stdout, sys.stderr):
        # a console that cannot show a path's letters must not end a run
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    try:
        chosen = _parser(others or {}).parse_args(words)  # exits with 2 on bad arguments
        if chosen.command == "antennas":
            return print_antennas(chosen.source, chosen.out, chosen.carrier_ghz)
        if chosen.command == "objects":
            return print_objects(chosen.folder, chosen.object, chosen.frames, chosen.link_budget)
        return _process(chosen) if chosen.command == "process" else print_run(chosen.folder)
    except RadarSimError as error:
        print(f"radarsim: {type(error).__name__}: {printable(str(error))}", file=sys.stderr)
        return error.exit_code
    except BrokenPipeError:
        # Whoever read our output has seen enough (| head): no word more, not at exit either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        print("radarsim: Interrupted; files written so far are whole.", file=sys.stderr)
        return 130  # 128 + SIGINT, as in shells


def _process(chosen: argparse.Namespace) -> int:
    options = process_options(chosen)
    live = sys.stderr.isatty()
    events = process_run(
        chosen.folder,
        options,
        out=chosen.out,
        frames=chosen.frames,
        allow_incomplete=chosen.allow_incomplete,
    )
    findings: list[Finding] = []
    frames: list[int] = []
    try:
        for event in events:
            if isinstance(event, FrameResult):
                if live:
                    print(end="\r\x1b[K", file=sys.stderr)
                _print_frame(event)
                findings += event.findings
                frames.append(event.frame)
            elif event.finding is not None:
                findings.append(event.finding)
                frames += event.finding.frames
            elif event.file is not None:
                print(event.text)
            elif live:
                _show(event)
    finally:  # of the frames that are done, whatever ended the run
        for line in finding_lines(findings, frames):
            print(line)
    return exit_code(findings, frames)


def _show(progress: Progress) -> None:
    share = 100 * progress.done / progress.total
    print(f"\r\x1b[K{share:3.0f} %  {progress.text}", end="", file=sys.stderr, flush=True)


def _print_frame(result: FrameResult) -> None:
    statistics = result.statistics
    unit = level_unit(result.echoes.amplitude_model)
    digits = map_digits(result.rd_map)
    print(f"frame {result.frame}: t = {result.time_s:g} s, {statistics.counts.paths} paths")
    for edge in result.edges:
        place = digits.range_text(edge.range_m)
        print(f"  leading edge  {place}   level {edge.level_db:z8.2f} {unit}")
    for peak in result.moving_targets:
        print(
            f"  moving target {digits.range_text(peak.range_m)}   "
            f"level {peak.level_db:z8.2f} {unit}   "
            f"{digits.motion_text(peak)}   "
            f"{peak.peak_to_background_db:.1f} dB above its surroundings"
        )
    if result.detections is not None:
        found = result.detections
        count = target_count(len(found.targets), found.left_out)
        cells = f"{found.cells} cell{'' if found.cells == 1 else 's'}"
        print(f"  CFAR          {count}, {cells} above the threshold")
        for line in detection_lines(found.targets, result.rd_map):
            print(f"  {line}")
    for line in result.budget.lines():
        print(f"  {line}")
    if result.files:
        print(f"  {len(result.files)} files in {result.files[0].parent}")


if __name__ == "__main__":
    sys.exit(main())
