# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim info``: what a run is, and whether it is complete."""

from __future__ import annotations

from ...contract import PathsRecord
from ...findings import finding_lines
from ..decoding import open_frame
from ..detection import frame_statistics, statistics_findings
from ..runs import Run, open_run

#: Rounding of the range encoding in float32, relative to its length or the path's, the larger one.
_CODE_NOISE = 7e-8


def print_run(folder: str) -> int:
    """Print what a run is and its first whole frame; return the exit code."""
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
    for line in finding_lines(record.findings):
        print(line)
    if gaps:
        print(f"incomplete: frame {gaps[0].frame}: {gaps[0].reason}; {len(gaps)} in all")
    missing_frames = {gap.frame for gap in gaps}
    whole = next((f for f in run.frames() if f.number not in missing_frames), None)
    if whole is not None:
        frame_input = open_frame(whole)
        statistics = frame_statistics(frame_input, radar)
        counts = statistics.counts
        print(f"frame {whole.number}:")
        print(f"  paths            {counts.paths}")
        if statistics.nearest_m is not None and statistics.farthest_m is not None:
            print(f"  ranges           {statistics.nearest_m:g} to {statistics.farthest_m:g} m")
        print(f"  mixed pixels     {100 * statistics.mixed_power_fraction:.2f} % of the power")
        if record.sampling_mode == "paths":
            _print_quality(frame_input.table.record)
            return 0
        print(
            f"  snapshots        {counts.crossed_shell} crossed a ring, "
            f"{counts.range_rate_rejected} too fast, "
            f"{counts.single_snapshot} in the first only"
        )
        for line in finding_lines(statistics_findings(statistics, radar)):
            print(f"  {line}")
    return 0


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
    """What the table of a frame says of itself."""
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
    known = f"{100 * record.relative_error:.2g} %" if record.path_count else "unknown"
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
    bound = "" if upper is None else f", at most {100 * upper:.2g} %"
    print(
        f"  power left out   {100 * record.truncated_reflections_fraction:.2g} % after more "
        "reflections (standard "
        f"error {100 * record.truncated_reflections_stderr:.1g} %{bound}), "
        f"{100 * record.truncated_transparency_fraction:.2g} % behind more transparent surfaces"
    )
    unranged = round(100 * record.unranged_power_fraction, 4)
    print(
        f"  without a range  {unranged:.2g} % of the power; mixed "
        f"{100 * record.mixed_power_fraction:.2g} %, range bias at most "
        f"{record.mixed_bias_bound_m:.2g} m"
    )
    for line in finding_lines(record.findings):
        print(f"  {line}")


def _noise_rows(run: Run) -> list[tuple[str, str]]:
    """What float32 costs at the far end of the rings."""
    record = run.record
    noise_m = (
        _CODE_NOISE * max(record.range_encoding_length_m, 2 * record.rings * record.ring_step_m) / 2
    )
    rows = [("range rounding", f"about {noise_m:.1g} m per pixel (float32 range encoding)")]
    if record.snapshots == 2:
        rate_mps = 2**0.5 * noise_m / record.snapshot_interval_s
        rows.append(("rate rounding", f"about {rate_mps:.1g} m/s per pixel"))
    return rows
