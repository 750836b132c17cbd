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
from ...option_arguments import CommandParser, share_of
from ...terminal_text import error_line
from ..results import FrameResult
from .antennas_command import add_antennas_parser, print_antennas
from .console import frame_lines, kept_lines
from .frame_processor import process_by_workers
from .info_command import print_run
from .merge_command import add_merge_parser, merge_parts
from .objects_command import add_objects_parser, print_objects
from .process import Progress, process_run
from .process_arguments import (
    add_process_parser,
    chosen_frames,
    frame_numbers,
    process_options,
)


def _parser(others: Mapping[str, str]) -> argparse.ArgumentParser:
    parser = CommandParser(
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
    add_merge_parser(commands)
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
        if chosen.command == "merge":
            return merge_parts(chosen.out, chosen.parts)
        if chosen.command == "info":
            return print_run(chosen.folder)
        return (
            process_by_workers(chosen, words) if share_of(chosen).by_workers else _process(chosen)
        )
    except RadarSimError as error:
        print(error_line(error), file=sys.stderr)
        return error.exit_code
    except MemoryError as error:
        print(
            f"radarsim: MemoryError: {error or 'memory is full'}. Take fewer pulses or narrower "
            "range limits (--range-limits), or a machine with more memory.",
            file=sys.stderr,
        )
        return 1
    except BrokenPipeError:
        # Whoever read our output has seen enough (| head): no word more, not at exit either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt as stop:
        text = "Interrupted; files written so far are whole. The same command resumes."
        print(f"radarsim: {text}", file=sys.stderr)
        return getattr(stop, "exit_code", 130)  # 128 + SIGINT, as in shells


def _process(chosen: argparse.Namespace) -> int:
    options, numbers = process_options(chosen), chosen_frames(chosen)
    live = sys.stderr.isatty()
    events = process_run(
        chosen.folder,
        options,
        out=chosen.out,
        frames=numbers,
        allow_incomplete=chosen.allow_incomplete,
        resume=not chosen.again,
    )
    findings: list[Finding] = []
    seen: list[int] = []
    try:
        for event in events:
            lines: list[str] = []
            if isinstance(event, FrameResult):
                lines, found, frames = frame_lines(event), event.findings, [event.frame]
            elif event.kept is not None:
                lines, found = kept_lines(event.kept), event.kept.findings
                frames = [event.kept.frame]
            elif event.finding is not None:
                found, frames = [event.finding], list(event.finding.frames)
            elif event.file is not None:
                lines, found, frames = [event.text], [], []
            else:
                if live:
                    _show(event)
                continue
            if lines:
                print("\r\x1b[K" if live else "", end="", file=sys.stderr)
                print("\n".join(lines))
            findings += found
            seen += frames
    finally:  # of the frames that are done, whatever ended the run
        for line in finding_lines(findings, seen):
            print(line)
    return exit_code(findings, seen)


def _show(progress: Progress) -> None:
    share = 100 * progress.done / progress.total
    print(f"\r\x1b[K{share:3.0f} %  {progress.text}", end="", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
