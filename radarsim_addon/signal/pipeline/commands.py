# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that process no frame: ``radarsim info``, ``objects``, ``antennas`` and ``merge``.

Each has a function that prints and returns the exit code. `write_coverage` puts a coverage diagram
into files.
"""

from __future__ import annotations

import argparse
import dataclasses
import errno
import itertools
import math
import os
import shutil
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TypeAlias

from ...atomic_files import cannot_write, make_folder
from ...contract import (
    MOTION_FILE,
    PRODUCTS_DIR,
    RUN_FILE,
    LinkBudget,
    PathsRecord,
    RunRecord,
    frame_dir,
)
from ...errors import ConfigError, FrameFileError, OutputError, SchemaError
from ...findings import Finding, finding_lines, frames_text, from_json, merge, percent_text
from ...options import CommandParser
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ...terminal import printable, wrapped
from ...typed_json import check_digest, file_sha256, read_json, write_record
from ..decoding import open_frame
from ..detection import (
    BudgetReport,
    FrameBudget,
    frame_statistics,
    matching_objects,
    object_echoes,
    projection_findings,
    statistics_findings,
)
from ..paths import frame_motion, open_frame_table
from ..pictures import (
    ANTENNA_PICTURE,
    COVERAGE_PICTURE,
    plot_antennas,
    plot_coverage,
    save_figure,
)
from ..products import MOST_SUMMARY_BYTES, SUMMARY_ENDING, frame_file, write_coverage_files
from ..radar import Coverage, Radar, coverage_curve, half_power_width_rad, make_system, read_system
from ..runs import FRAME_FIELDS, RadarFrame, Run, frame_findings, open_run, shared_plan

#: Where a parser of arguments collects its commands.
Subcommands: TypeAlias = "argparse._SubParsersAction[CommandParser]"
#: Rounding of the range encoding in float32, relative to its length or the path's, the larger one.
_CODE_NOISE = 7e-8
_ENDS = ("transmitter", "receiver")
#: Above this a unit was mistaken: an array of wavelengths would not fit into memory.
_HIGHEST_CARRIER_GHZ = 1e4


def print_run(folder: str) -> int:
    """Print the plan of a run and its first whole frame. Return the exit code."""
    run = open_run(folder)
    record, radar = run.record, run.radar
    waveform, burst = radar.waveform, radar.burst
    gaps = run.missing()
    rows = [
        ("run", str(run.path)),
        ("file", record.blend_file or "(not saved)"),
        ("scene", record.scene),
        ("frames", f"{len(record.frames)} ({record.frames[0]} to {record.frames[-1]})"),
        *_acquisition_rows(run, len(gaps)),
        *_array_rows(radar),
        ("scale", f"1 Blender unit = {record.metres_per_unit:g} m"),
        ("encoding length", f"{record.range_encoding_length_m:g} m"),
        ("extinction length", f"{record.extinction_length_m:g} m"),
        ("carrier", f"{waveform.carrier_hz / 1e9:g} GHz, {waveform.wavelength_m:.6g} m"),
        (
            "bandwidth",
            f"{waveform.bandwidth_hz / 1e6:g} MHz in {waveform.duration_s:g} s ({waveform.kind})",
        ),
        ("sampling rate", f"{waveform.sampling_rate_hz / 1e6:g} MHz"),
        ("burst", f"{burst.pulses} pulses at {burst.prf_hz:g} Hz"),
        ("range resolution", f"{waveform.range_resolution_m:.4g} m (c / 2B)"),
        ("unambiguous range", f"{radar.unambiguous_range_m:.6g} m"),
        ("unambiguous rate", f"+-{radar.max_unambiguous_velocity_mps:.4g} m/s"),
        ("rate resolution", f"{radar.velocity_resolution_mps:.4g} m/s"),
    ]
    if record.sampling_mode == "rings":
        rows += _noise_rows(run)
    for name, text in rows:
        print(f"{name:18} {text}")
    if gaps:
        print(f"incomplete: frame {gaps[0].frame}: {gaps[0].reason}; {len(gaps)} in all")
    found = [*record.findings, *frame_findings(run.path, record.frames)]
    missing_frames = {gap.frame for gap in gaps}
    whole = next((f for f in run.frames() if f.number not in missing_frames), None)
    if whole is not None:
        frame_input = open_frame(whole)
        statistics = frame_statistics(frame_input, radar)
        counts = statistics.counts
        print(f"frame {whole.number}:")
        print(f"  {counts.text}")
        if statistics.nearest_m is not None and statistics.farthest_m is not None:
            print(f"  ranges           {statistics.nearest_m:g} to {statistics.farthest_m:g} m")
        print(f"  mixed pixels     {100 * statistics.mixed_power_fraction:.2f} % of the power")
        if record.sampling_mode == "paths":
            _print_quality(frame_input.table.record)
        else:
            print(
                f"  snapshots        {counts.crossed_shell} crossed a ring, "
                f"{counts.range_rate_rejected} too fast, "
                f"{counts.single_snapshot} in the first only"
            )
            found += statistics_findings(statistics, radar)
    for number in record.frames:
        path = frame_file(run.path / PRODUCTS_DIR, number, SUMMARY_ENDING)
        if path.is_file():
            summary = read_json(path, MOST_SUMMARY_BYTES, "", FrameFileError)
            found += (from_json(item, str(path)) for item in summary.get("findings", ()))
    for line in finding_lines(found, record.frames, whole=True):
        print(line)
    return 0


def _array_rows(radar: Radar) -> list[tuple[str, str]]:
    if len(radar.channels) < 2:
        return []
    ends = [len({getattr(one, end) for one in radar.channels}) for end in ("tx", "rx")]
    names = [f"{n} {name}{'' if n == 1 else 's'}" for n, name in zip(ends, _ENDS, strict=True)]
    how = ", in turn" if radar.slots == 1 else f", at once, codes of {radar.slots} pulses"
    return [("array", f"{names[0]}, {names[1]}{how if ends[0] > 1 else ''}")]


def _acquisition_rows(run: Run, gaps: int) -> list[tuple[str, str]]:
    record = run.record
    start_m, stop_m = run.range_limits_m
    image = f"{record.width_px} x {record.height_px} px"
    if record.sampling_mode == "paths":
        return [
            ("sampling mode", f"paths, one per pixel; ranges {start_m:g} to {stop_m:g} m"),
            ("frames rendered", f"{run.renders - gaps} of {run.renders}"),
            ("image", f"{image} before refinement"),
        ]
    return [
        ("rings", f"{record.rings} of {record.ring_step_m:g} m: {start_m:g} to {stop_m:g} m"),
        ("snapshots", f"{record.snapshots}, {record.snapshot_interval_s:g} s apart"),
        ("renders", f"{run.renders - gaps} of {run.renders} are there"),
        ("image", f"{image}, {record.samples} samples"),
    ]


def _print_quality(record: PathsRecord) -> None:
    """Print the quality that the table of a frame records."""
    replicates = "1 replicate" if record.replicates == 1 else f"{record.replicates} replicates"
    print(
        f"  tiles            {record.tiles}, {replicates} each, finest level "
        f"{record.finest_refinement_level}; {record.renders} renders in "
        f"{record.render_time_s:.1f} s"
    )
    if record.small_objects:
        print(
            f"  small objects    {record.small_objects} in view, {record.small_objects_tiled} with "
            "tiles of their own"
        )
    print(f"  refined until    {record.stop_reason}")
    over = {"ranges": "range bins", "objects": "objects"}
    known = percent_text(record.relative_error) if record.path_count else "unknown"
    print(
        f"  standard error   {known} (over "
        f"{over.get(record.error_scope, 'range bins and objects')})"
    )
    print(
        f"  range encoding   in "
        f"{record.range_encoding}{', coloured scene' if record.coloured else ''}"
    )
    print(
        f"  lengths within   {record.length_sigma_m:.2g} m, "
        f"{record.length_sigma_wavelengths:.2g} wavelengths"
    )
    upper = record.truncated_reflections_upper
    bound = "" if upper is None else f", at most {percent_text(upper)}"
    print(
        f"  power left out   {percent_text(record.truncated_reflections_fraction)} after more "
        "reflections (standard "
        f"error {percent_text(record.truncated_reflections_stderr)}{bound}), "
        f"{percent_text(record.truncated_transparency_fraction)} behind more transparent surfaces"
    )
    unranged = round(record.unranged_power_fraction, 6)
    print(
        f"  without a range  {percent_text(unranged)} of the power; mixed "
        f"{percent_text(record.mixed_power_fraction)}, range bias at most "
        f"{record.mixed_bias_bound_m:.2g} m"
    )


def _noise_rows(run: Run) -> list[tuple[str, str]]:
    """Return the rounding of float32 at the far end of the rings."""
    record = run.record
    noise_m = (
        _CODE_NOISE * max(record.range_encoding_length_m, 2 * record.rings * record.ring_step_m) / 2
    )
    rows = [("range rounding", f"about {noise_m:.1g} m per pixel (float32 range encoding)")]
    if record.snapshots == 2:
        rate_mps = 2**0.5 * noise_m / record.snapshot_interval_s
        rows.append(("rate rounding", f"about {rate_mps:.1g} m/s per pixel"))
    return rows


def add_objects_parser(commands: Subcommands, frame_numbers: Callable[[str], list[int]]) -> None:
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
    parser.add_argument("--parts", action="store_true", help="parts of objects by themselves")
    parser.add_argument("--frames", type=frame_numbers, metavar="A:B", help="frames [all]")
    parser.add_argument("--link-budget", metavar="FILE", help="link budget (JSON) [the run's own]")


def print_objects(
    folder: str,
    pattern: str | None,
    frames: Sequence[int] | None,
    system_file: str | None,
    parts: bool = False,
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
        frame_input = frame_input.by_parts() if parts else frame_input
        groups = None if pattern is None else {pattern: matching_objects(frame_input, pattern)}
        link = FrameBudget(frame_input).link
        echoes = object_echoes(frame_input, run.radar.waveform.carrier_hz, link, groups)
        total_w = sum(echo.power_w for echo in echoes)
        print(f"frame {frame.number}: t = {frame.time_s:g} s")
        for line in BudgetReport(total_w, None, echoes).lines():
            print("\n".join(wrapped(f"  {line}")))
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


def add_antennas_parser(commands: Subcommands) -> None:
    parser = commands.add_parser(
        "antennas",
        help="picture of the antennas' patterns",
        epilog="example: radarsim antennas link_budget.json --carrier-ghz 77",
    )
    parser.add_argument("source", metavar="DIR|FILE", help="folder of a run, or a link budget file")
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="where the picture goes; else DIR/products of a run, the folder of a link budget file",
    )
    parser.add_argument("--carrier-ghz", type=float, help="carrier, for a link budget file")


def print_antennas(source: str, out: str | None, carrier_ghz: float | None) -> int:
    """Draw the antennas of a run or of a link budget file; return the exit code.

    The picture goes to `out`; None: where the run's products are (``antennas.png``, as processing
    names it), or next to the file, under its name. A carrier of None is the run's.
    """
    path = Path(source)
    record: LinkBudget | None
    if os.path.isdir(path):
        run = open_run(path)
        record, wavelength_m = run.record.link_budget, run.radar.waveform.wavelength_m
        place, name = path / PRODUCTS_DIR, ANTENNA_PICTURE
        if record is None:
            raise ConfigError(
                f"{path} is a run without a link budget; give a link budget file instead."
            )
    else:
        record, wavelength_m = read_system(path), math.nan
        place, name = path.parent, f"{path.stem}_{ANTENNA_PICTURE}"
    if carrier_ghz is not None and not 0 < carrier_ghz <= _HIGHEST_CARRIER_GHZ:
        raise ConfigError(
            f"Carrier of {carrier_ghz:g} GHz; expected above 0, at most {_HIGHEST_CARRIER_GHZ:g}. "
            "--carrier-ghz takes GHz: 77 for a carrier of 77e9 Hz."
        )
    if carrier_ghz is not None:
        wavelength_m = SPEED_OF_LIGHT_MPS / (carrier_ghz * 1e9)
    if not wavelength_m > 0:
        raise ConfigError("No carrier: a link budget file holds none, give --carrier-ghz.")
    system = make_system(record, wavelength_m)
    folder = make_folder(place if out is None else Path(out))
    target = save_figure(plot_antennas(system), folder / name)
    for end, antenna in (("transmitter", system.transmitter), ("receiver", system.receiver)):
        widths = [math.degrees(half_power_width_rad(antenna, p)) for p in ("azimuth", "elevation")]
        print(
            f"{end:12} peak {10 * math.log10(antenna.peak_gain):7.2f} dBi   half-power beamwidth "
            f"{widths[0]:.3g} x {widths[1]:.3g} degrees"
        )
    print(f"wrote {target}")
    return 0


def add_merge_parser(commands: Subcommands) -> None:
    parser = commands.add_parser(
        "merge",
        help="one run of parts that were measured into folders of their own",
        epilog="example: radarsim merge run part_1 part_2 part_3",
    )
    parser.add_argument("out", metavar="DIR", help="new folder of the whole run")
    parser.add_argument("parts", metavar="PART", nargs="+", help="folder of a part: holds run.json")


def merge_parts(out: str | Path, parts: Sequence[str | Path]) -> int:
    """Merge parts of a run, with their products, and print the number of frames. Return the exit
    code.

    Files are linked where disk and file system allow it, else copied. A frame that several parts
    hold is taken from the first one where it is complete. All files with digests are compared with
    these before anything is written; a `RadarSimError` names the first that differs.
    """
    folder, runs = Path(out), [open_run(part) for part in parts]
    record = _merged_record(runs)
    if os.path.isdir(folder) and any(folder.iterdir()):
        raise OutputError(f"{folder} is not empty. Give a new folder for the whole run.")
    sources: dict[int, tuple[Path, list[Path]]] = {}
    for run in runs:
        for frame in run.frames():
            if frame.number not in sources and not frame.missing():
                sources[frame.number] = run.path, _checked_files(frame)
    make_folder(folder)  # not before all parts are found whole
    for run in runs:
        picture = run.path / PRODUCTS_DIR / ANTENNA_PICTURE
        _put(run.path, folder, [picture] if picture.exists() else [])
    for root, files in sources.values():
        _put(root, folder, files)
    # last: an interrupted merge is no run
    write_record(folder / RUN_FILE, record)
    print(f"radarsim: {len(sources)} of {len(record.frames)} frames in {folder}")
    left = tuple(number for number in record.frames if number not in sources)
    if left:
        text = frames_text(left, record.frames)
        print(f"radarsim: {text}: complete in no part; radarsim render resumes the run")
    return 0


def _merged_record(runs: Sequence[Run]) -> RunRecord:
    """Return the plan of all parts; ConfigError where they are not parts of one run."""
    first = runs[0].record
    for run in runs[1:]:
        here, there = shared_plan(first), shared_plan(run.record)
        names = [name for name in here if name not in FRAME_FIELDS and here[name] != there[name]]
        if run.record.fingerprint != first.fingerprint:
            names.append("scene, settings or software")
        if names:
            raise ConfigError(
                f"{run.path} and {runs[0].path} are no parts of one run: they differ in "
                f"{', '.join(names)}. Render parts with --shard I/N, which plans all frames alike."
            )
    times = {
        number: time_s
        for run in runs
        for number, time_s in zip(run.record.frames, run.record.frame_times_s, strict=True)
    }
    same = all(run.record.frames == first.frames for run in runs)
    frames = first.frames if same else sorted(times)
    return dataclasses.replace(
        first,
        frames=list(frames),
        frame_times_s=[times[number] for number in frames],
        findings=merge([item for run in runs for item in run.record.findings]),
        # how far all frames reach together is not known where each part looked at its own
        extra=first.extra if same else {k: v for k, v in first.extra.items() if k != "extent"},
    )


def _checked_files(frame: RadarFrame) -> list[Path]:
    """Return files of a frame and its products; a named error where a file is not as it was
    written.
    """
    frame.scene()
    if frame.sampling_mode == "paths":
        for render in map(frame.of_burst, range(frame.visibility_updates)):
            record, _ = open_frame_table(render.path, frame.number, frame.record.fingerprint)
            frame_motion(render.path, record)
    else:
        for ring, snapshot in itertools.product(range(frame.rings), range(frame.snapshots)):
            frame.image(ring, snapshot)
    files: list[Path] = []
    for path in sorted((frame.run.path / frame_dir(frame.number)).rglob("*")):
        if path.is_symlink():
            raise FrameFileError(f"{path} is a symbolic link; expected a file. Put it there.")
        if path.is_file():
            files.append(path)
    for path in files:
        if path.suffix == ".json" and path.name != MOTION_FILE:
            check_digest(path)
    return [*files, *_checked_products(frame.run.path / PRODUCTS_DIR, frame.number)]


def _checked_products(folder: Path, frame: int) -> list[Path]:
    """Return products of a frame; a named error where one is not as its summary has it."""
    summary = frame_file(folder, frame, SUMMARY_ENDING)
    fields = check_digest(summary) if summary.is_file() else {}
    for name, digest in fields.get("files_sha256", {}).items():
        path = folder / name
        if not path.is_file() or file_sha256(path) != digest:
            raise SchemaError(
                f"{path} is missing or was changed: its SHA-256 is not that in {summary.name}. "
                "Process this part again."
            )
    return sorted(folder.glob(f"frame_{frame:04d}_*"))


def _put(root: Path, folder: Path, files: Iterable[Path]) -> None:
    """Link or copy files of a part to the same places in the whole."""
    for source in files:
        target = make_folder((folder / source.relative_to(root)).parent) / source.name
        try:
            try:
                os.link(source, target)
            except OSError as error:
                if error.errno == errno.EEXIST:
                    continue
                shutil.copyfile(source, target)
        except OSError as error:
            raise cannot_write(target, error) from error


def write_coverage(
    found: Coverage, folder: Path, curve_m: float | None = None, picture: bool = True
) -> list[Path]:
    """Write a diagram as npz, its curve over height as CSV, and the picture.

    The curve is at the range `curve_m`; None: the last one of the diagram.
    """
    curve = coverage_curve(found, curve_m)
    files = write_coverage_files(found, curve, make_folder(folder))
    if picture:
        files.append(save_figure(plot_coverage(found, curve), folder / COVERAGE_PICTURE))
    return files
