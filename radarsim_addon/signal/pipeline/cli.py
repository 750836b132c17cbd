# SPDX-License-Identifier: GPL-3.0-or-later
"""The ``radarsim`` command: ``radarsim process DIR`` and ``radarsim info DIR``.

Exit codes: 0 done, 1 failed, 2 bad arguments, 3 done but a finding of severity error concerns all
frames, 130 stopped by Ctrl-C; on stderr ``radarsim: Name: message``.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ... import __version__
from ...coordinator import Reply, run_frames
from ...errors import ConfigError, RadarSimError
from ...findings import Finding, exit_code, finding_lines, from_json, to_json
from ...options import CommandParser, add_arguments, add_share_arguments, declared, given, share_of
from ...terminal import error_line, printable, wrapped
from ..detection import (
    Cfar,
    Detection,
    DirectedDetection,
    Peak,
    target_count,
    velocity_before_folding_mps,
)
from ..echoes import Receiver
from ..maps import RangeDopplerMap, SpectrogramOptions, level_unit
from ..pictures import MapFile, cell_width, decimals_for, fixed, map_file
from ..products import FrameResult
from ..radar import Weather, load_radar
from ..runs import open_run
from .commands import (
    Subcommands,
    add_antennas_parser,
    add_merge_parser,
    add_objects_parser,
    merge_parts,
    print_antennas,
    print_objects,
    print_run,
)
from .options import ProcessOptions
from .process import KeptFrame, Products, open_products, process_run, products_folder


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
    pictures = ("plots", "animate", "animation_format")
    files = ("products", *pictures, "hdf5", "sigmf", "parquet", "ros_bag")
    of_radar = ("link_budget", "thermal_noise")
    detection = ("mti", "parts")
    others = [name for name in options if name not in (*files, *of_radar, *detection)]
    add_arguments(process, options, *others, defaults=True)
    group = process.add_argument_group("radar and receiver (docs/waveforms.md, docs/receiver.md)")
    group.add_argument(
        "--waveform",
        metavar="FILE",
        help="Read another waveform, burst and array (JSON) [the run's own]",
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
    """Return options from parsed arguments. `ConfigError`: they do not fit together."""
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
    if chosen.shard is not None:
        options.setdefault("animate", False)
        for flag, name in (("--animate", "animation"), ("--ros-bag", "bag")):
            if options.get(flag[2:].replace("-", "_")):
                raise ConfigError(
                    f"{flag} with --shard: the {name} has all frames, and a shard has a part of "
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
    """Return the frames of parsed arguments. With a shard, return its part of them."""
    frames = chosen.frames or open_run(chosen.folder).record.frames
    return share_of(chosen).part(frames)


def parse_process_arguments(words: list[str]) -> argparse.Namespace:
    """Parse a command line from the word "process" on, without the other commands."""
    parser = CommandParser()
    add_process_parser(parser.add_subparsers(dest="command", required=True))
    return parser.parse_args(words)


def process_by_workers(chosen: argparse.Namespace, words: list[str]) -> int:
    """Process a run by workers; return the exit code."""
    maps: dict[int, MapFile] = {}
    findings: list[Finding] = []

    def show(reply: Reply) -> None:
        print("\n".join(reply.get("lines", ())), flush=True)
        findings.extend(from_json(item, "worker") for item in reply.get("findings", ()))
        if "map" in reply:
            path = Path(reply["map"]["path"])
            maps[reply["frame"]] = MapFile(**(reply["map"] | {"path": path}))

    run = open_run(chosen.folder)
    options = process_options(chosen).for_run(run)
    with open_products(run, options, chosen.out, chosen.allow_incomplete) as products:
        about = {"frames": chosen.frames or run.record.frames}
        run_frames(words, share_of(chosen), sys.stdout, show, about=about)
        path = products.draw_common([maps[n] for n in chosen_frames(chosen) if n in maps])
    if path is not None:
        print(f"animation: {path}")
    return exit_code(findings, chosen_frames(chosen) or run.record.frames)


class FrameProcessor:
    """Processes frames of a run in a worker; see :class:`radarsim_addon.frame_worker`."""

    def __init__(self, chosen: argparse.Namespace) -> None:
        run = open_run(Path(chosen.folder).absolute())
        options = process_options(chosen).for_run(run)
        # the coordinator has made the folder
        folder = products_folder(run, chosen.out).absolute()
        resume = not chosen.again
        self._products = Products(run, options, folder, chosen.allow_incomplete, resume)

    def about(self) -> dict[str, Any]:
        """Return all frames of the run."""
        return {"frames": self._products.run.record.frames}

    def do(self, frame: int) -> dict[str, Any]:
        """Process a frame, and write its products."""
        source = self._products.run.frame(frame)
        skipped = self._products.skipped(source)
        if skipped is not None:
            return {"findings": [to_json(skipped)]}
        kept = self._products.kept(source)
        if kept is not None:
            return _reply(kept_lines(kept), kept.findings, kept.map) | {"earlier": True}
        *_, result = self._products.process(source)
        assert isinstance(result, FrameResult)
        shown = map_file(result, self._products.folder)
        return _reply(frame_lines(result), result.findings, shown)

    def stop(self) -> None:
        """End now. Half-written files are removed on the way."""
        sys.exit()

    def close(self) -> None:
        """Do nothing: no file is kept open."""


def _reply(lines: list[str], findings: list[Finding], shown: MapFile) -> dict[str, Any]:
    described = dataclasses.asdict(shown) | {"path": str(shown.path)}
    return {"lines": lines, "findings": [to_json(f) for f in findings], "map": described}


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
                    percent = 100 * event.done / event.total
                    line = f"\r\x1b[K{percent:3.0f} %  {event.text}"
                    print(line, end="", file=sys.stderr, flush=True)
                continue
            if lines:
                print("\r\x1b[K" if live else "", end="", file=sys.stderr)
                print("\n".join(lines), flush=True)
            findings += found
            seen += frames
    finally:  # of the frames that are done, whatever ended the run
        # `info` looks at the run's own products
        for line in finding_lines(findings, seen, whole=chosen.out is not None):
            print(line)
    if findings and chosen.out is None:
        print(f"`radarsim info {chosen.folder}` gives causes and remedies")
    return exit_code(findings, seen)


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

    `others` are commands of the caller with their help, for the list of commands.
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
            return print_objects(
                chosen.folder, chosen.object, chosen.frames, chosen.link_budget, chosen.parts
            )
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


# -- text for people: figures in columns, in the digits that a map's cells bear --------------------

#: Targets of a frame that are listed.
_MOST_LINES = 10


def frame_lines(result: FrameResult) -> list[str]:
    """Return a text about the echoes, targets and files of a frame."""
    counts, digits = result.statistics.counts, map_digits(result.rd_map)
    unit = level_unit(result.echoes.amplitude_model)
    lines = [f"frame {result.frame}: t = {result.time_s:g} s, {counts.text}"]
    lines += [
        f"  leading edge  {digits.range_text(edge.range_m)}   level {edge.level_db:z8.2f} {unit}"
        for edge in result.edges
    ]
    if result.edges_left_out:
        left, are = result.edges_left_out, "is" if result.edges_left_out == 1 else "are"
        edges = f"{left} leading edge{'' if left == 1 else 's'}"
        lines.append(f"  {edges} of lower prominence {are} not listed")
    lines += [
        f"  moving target {digits.range_text(peak.range_m)}   level {peak.level_db:z8.2f} {unit}   "
        f"{digits.motion_text(peak)}   {peak.peak_to_background_db:.1f} dB above its surroundings"
        f"{_name_text(peak)}"
        for peak in result.moving_targets
    ]
    if result.detections is not None:
        found = result.detections
        count = target_count(len(found.targets), found.left_out)
        cells = f"{found.cells} cell{'' if found.cells == 1 else 's'}"
        lines.append(f"  CFAR          {count}, {cells} above the threshold")
        lines += [f"  {line}" for line in detection_lines(found.targets, result.rd_map)]
    lines += [f"  {line}" for line in result.budget.lines()]
    if result.files:
        lines.append(f"  {len(result.files)} files in {result.files[0].parent}")
    return [part for line in lines for part in wrapped(line)]


def kept_lines(kept: KeptFrame) -> list[str]:
    """Return text for a frame that was done before."""
    return [f"frame {kept.frame}: done before, {len(kept.files)} files in {kept.map.path.parent}"]


def detection_lines(
    targets: Sequence[Detection], rd_map: RangeDopplerMap | None = None
) -> list[str]:
    """Return one line for each of the first targets; `rd_map` gives the digits that its cells
    bear.
    """
    digits = map_digits(rd_map)
    lines = [
        f"target       {digits.range_text(t.range_m)}   SNR {t.snr_db:z8.2f} dB   "
        f"{digits.motion_text(t)}{_angle_text(t)}{_name_text(t)}"
        for t in targets[:_MOST_LINES]
    ]
    if len(targets) > _MOST_LINES:
        lines.append(f"{len(targets) - _MOST_LINES} more targets in the files")
    return lines


def _angle_text(target: Detection) -> str:
    """Return the angles of a target of an array, with the digits that its SNR bears."""
    if not isinstance(target, DirectedDetection):
        return ""
    angles = {"azimuth": target.azimuth_deg, "elevation": target.elevation_deg}
    known = [f"{name} {angle:+.2f}" for name, angle in angles.items() if angle is not None]
    return f"   {', '.join(known)} deg"


def _name_text(target: Peak | Detection) -> str:
    return f"   {printable(target.name)}" if target.name else ""


def map_digits(rd_map: RangeDopplerMap | None) -> Digits:
    """Return digits for values that are interpolated between the cells of a map. There are at least
    the usual ones.
    """
    if rd_map is None:
        return Digits()
    step_hz = cell_width(rd_map.doppler_hz)
    step_mps = step_hz * rd_map.radar.waveform.wavelength_m / 2
    usual = Digits()
    return Digits(
        max(usual.range, decimals_for(cell_width(rd_map.range_m))),
        max(usual.rate, decimals_for(step_mps)),
        max(usual.doppler, decimals_for(step_hz)),
    )


@dataclass(frozen=True)
class Digits:
    """Digits behind the point of ranges [m], range rates [m/s] and Doppler [Hz]."""

    range: int = 2
    rate: int = 3
    doppler: int = 2

    def range_text(self, range_m: float) -> str:
        """Return a range, right-aligned."""
        return f"{fixed(range_m, self.range):>10} m"

    def motion_text(self, target: Peak | Detection) -> str:
        """Return range rate and Doppler, right-aligned; a rate of 0 has no sign."""
        rate = fixed(target.velocity_mps, self.rate, signed=True)
        doppler = fixed(target.doppler_hz, self.doppler, signed=True)
        text = f"range rate {rate:>9} m/s   Doppler {doppler:>9} Hz"
        true_mps = velocity_before_folding_mps(target)
        if true_mps is not None:
            text += f"   folded, true range rate {fixed(true_mps, self.rate, signed=True)} m/s"
        return text
