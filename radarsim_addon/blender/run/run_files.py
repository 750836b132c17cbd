# SPDX-License-Identifier: GPL-3.0-or-later
"""The JSON files that a run writes next to its renders: plan, labels of a frame, sidecars."""

from __future__ import annotations

import dataclasses
import secrets
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy

from ... import contract
from ...errors import RadarSimError
from ...findings import Finding
from ...sidecar import file_sha256, read_record, write_record
from ..plan import Instant, Plan, Task, run_record
from ..scene import Rig
from ..scene import ground_truth as ground_truth


def plan_record(
    plan: Plan, scene: str, identity: str, findings: list[Finding], versions: dict[str, str]
) -> contract.RunRecord:
    """Return what ``run.json`` holds.

    `scene` is the scene's name and `identity` that of its files; empty: the run is like no other.
    `findings` are known before the first render; `versions` are of programs.
    """
    file_name = Path(bpy.data.filepath).name
    digest = identity or secrets.token_hex(16)
    record = run_record(plan, digest, file_name, scene, findings, versions)
    record.extra["extent"] = dataclasses.astuple(plan.extent)
    record.extra["resumable"] = bool(identity)
    record.extra["polarisation"] = plan.measurement.polarisation
    return record


def write_scene(
    folder: Path,
    frame: int,
    plan: Plan,
    rig: Rig,
    show: Callable[[Instant], Any],
    fingerprint: str,
) -> None:
    """Write the labels of a radar frame, unless those of this run are there.

    `show` brings the scene to a moment and returns the depsgraph at it. `fingerprint` is the run's.
    """
    path = folder / contract.frame_dir(frame) / contract.GROUND_TRUTH_FILE
    try:
        if read_record(path, contract.GroundTruthRecord).run_fingerprint == fingerprint:
            return
    except RadarSimError:
        pass
    instants = plan.instants(frame)
    units = plan.metres_per_unit
    later, interval_s = None, 0.0
    if len(instants) > 1:
        depsgraph = show(instants[1])
        receiver, _ = ground_truth.antenna_positions(depsgraph, rig)
        later = ground_truth.rendered_surfaces(depsgraph), receiver
        interval_s = instants[1].time_s - instants[0].time_s
    objects = ground_truth.object_records(show(instants[0]), rig, units, later, interval_s)
    record = contract.GroundTruthRecord(frame, instants[0].time_s, objects, fingerprint)
    write_record(path, record)


def render_record(
    plan: Plan,
    task: Task,
    camera: contract.ReceiverRecord,
    emitter: contract.TransmitterRecord,
    exr: Path,
    versions: dict[str, str],
    fingerprint: str,
) -> contract.RenderRecord:
    """The sidecar of a finished render of a ring, in the file `exr` of a run's `fingerprint`."""
    measurement = plan.measurement
    return contract.RenderRecord(
        sampling_mode="rings",
        frame=task.frame,
        snapshot_index=task.snapshot_index,
        time_s=task.instant.time_s,
        ring=task.ring,
        ring_min_m=task.ring_min_m,
        ring_max_m=task.ring_max_m,
        width_px=measurement.width_px,
        height_px=measurement.height_px,
        metres_per_unit=plan.metres_per_unit,
        range_encoding_length_m=plan.range_encoding_length_m,
        extinction_length_m=plan.extinction_length_m,
        receiver=camera,
        transmitter=emitter,
        samples=measurement.samples,
        seed=measurement.seed,
        max_reflections=measurement.max_reflections,
        exr_file=exr.name,
        exr_sha256=file_sha256(exr),
        run_fingerprint=fingerprint,
        versions=versions,
    )
