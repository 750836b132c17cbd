# SPDX-License-Identifier: GPL-3.0-or-later
"""Arguments of ``radarsim process``, and the options that they make."""

from __future__ import annotations

import argparse
import dataclasses

from ...errors import ConfigError
from ...option_arguments import (
    CommandParser,
    add_arguments,
    add_share_arguments,
    given,
    share_of,
)
from ...options import declared
from ..detection import Cfar
from ..echoes import Receiver
from ..maps import SpectrogramOptions
from ..radar import Weather, load_radar
from ..runs import open_run
from .console import Subcommands
from .options import ProcessOptions


def frame_numbers(text: str) -> list[int]:
    """Return "3", "1:10" or "1:10,15" as a list of frames, ends included."""
    numbers: list[int] = []
    for part in text.split(","):
        ends = [int(end) for end in part.split(":")]
        if len(ends) > 2 or ends[-1] < ends[0] or ends[-1] - ends[0] > 1_000_000:
            raise ValueError(part)
        numbers.extend(range(ends[0], ends[-1] + 1))
    return numbers


frame_numbers.__name__ = "frames (like 1:10)"  # argparse names the type in its message


def add_process_parser(commands: Subcommands) -> None:
    """Add ``process`` to the commands."""
    process = commands.add_parser(
        "process",
        help="echo, range profile, range-Doppler map and products of every frame",
        epilog="example: radarsim process run --cfar os --pfa 1e-4 --range-limits 0:150",
        allow_abbrev=False,
    )
    process.add_argument("folder", metavar="DIR", help="folder that holds run.json")
    process.add_argument("--out", metavar="DIR", help="Write the results there [DIR/products]")
    add_share_arguments(process)
    process.add_argument("--frames", type=frame_numbers, metavar="A:B", help="Set the frames [all]")
    options, receiver, cfar = declared(ProcessOptions), declared(Receiver), declared(Cfar)
    files = ("products", "plots", "animate", "animation_format", "hdf5", "sigmf")
    of_radar = ("link_budget", "thermal_noise")
    detection = ("mti",)
    others = [name for name in options if name not in (*files, *of_radar, *detection)]
    add_arguments(process, options, *others, defaults=True)
    group = process.add_argument_group("radar and receiver (docs/waveforms.md, docs/receiver.md)")
    group.add_argument(
        "--waveform", metavar="FILE", help="Read another waveform and burst (JSON) [the run's own]"
    )
    add_arguments(group, options, *of_radar, defaults=True)
    add_arguments(group, receiver, defaults=True)
    group = process.add_argument_group("weather (docs/weather.md)")
    add_arguments(group, declared(Weather), defaults=True)
    group = process.add_argument_group("detection (docs/detection.md)")
    add_arguments(group, options, *detection, defaults=True)
    add_arguments(group, cfar, "kind")
    add_arguments(group, cfar, *list(cfar)[1:], defaults=True)
    group = process.add_argument_group("spectrogram (docs/signal.md)")
    windows = declared(SpectrogramOptions)
    add_arguments(group, windows, "window_pulses")
    add_arguments(group, windows, *list(windows)[1:], defaults=True)
    group = process.add_argument_group("files")
    add_arguments(group, options, *files, defaults=True)
    group.add_argument("--again", action="store_true", help="Process frames that are done too")
    group.add_argument(
        "--allow-incomplete", action="store_true", help="Skip frames that are not all there"
    )


def process_options(chosen: argparse.Namespace) -> ProcessOptions:
    """Return options from parsed arguments.

    Parameters
    ----------
    chosen
        From `parse_process_arguments`.

    Returns
    -------
    ProcessOptions
        How the run is to be processed.

    Raises
    ------
    ConfigError, FrameFileError
        Options that do not fit together, or a file that cannot be read.
    """
    radar = None
    if chosen.waveform is not None:
        # a waveform file may hold no burst: then the run's own
        radar = load_radar(chosen.waveform, open_run(chosen.folder).radar.burst)
    detector = declared(Cfar)
    cfar = given(chosen, detector)
    if cfar and "kind" not in cfar:
        flags = ", ".join(detector[name].flag for name in cfar)
        raise ConfigError(
            f"{flags} without --cfar: there is no detector to set. Add --cfar ca or --cfar os."
        )
    windows = given(chosen, declared(SpectrogramOptions))
    if windows and "window_pulses" not in windows:
        raise ConfigError(
            "There are options of a spectrogram, and none is asked for. Add --spectrogram N, the "
            "pulses of a window."
        )
    options, air = given(chosen, declared(ProcessOptions)), given(chosen, declared(Weather))
    if chosen.shard is not None and options.setdefault("animate", False):
        raise ConfigError(
            "--animate with --shard: the animation shows all frames, and a shard has a part of "
            "them. Leave one of them out."
        )
    return ProcessOptions(
        radar=radar,
        receiver=Receiver(**given(chosen, declared(Receiver))),
        weather=dataclasses.replace(open_run(chosen.folder).weather, **air) if air else None,
        cfar=Cfar(**cfar) if "kind" in cfar else None,
        spectrogram=SpectrogramOptions(**windows) if windows else None,
        **options,
    )


def chosen_frames(chosen: argparse.Namespace) -> list[int]:
    """Return the frames of parsed arguments: those of the shard."""
    frames = chosen.frames or open_run(chosen.folder).record.frames
    return share_of(chosen).part(frames)


def parse_process_arguments(words: list[str]) -> argparse.Namespace:
    """Parse a command line without the other commands.

    Parameters
    ----------
    words
        Words from "process" on.

    Returns
    -------
    argparse.Namespace
        Values by the names of the options.
    """
    parser = CommandParser()
    add_process_parser(parser.add_subparsers(dest="command", required=True))
    return parser.parse_args(words)
