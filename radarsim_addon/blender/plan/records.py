# SPDX-License-Identifier: GPL-3.0-or-later
"""The record of a run, and the fingerprint that identifies its renders. Does not import bpy."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from typing import Any

from ... import contract
from ...findings import Finding
from ...signal.radar import Weather, waveform_to_dict
from .run_plan import Plan

#: What changes no render.
_AFTER_RENDERING = (
    "waveform", "burst", "link_budget", "frames", "rings", "weather",
    "range_start_m", "range_stop_m",
)  # fmt: skip


def fingerprint(plan: Plan, scene_digest: str, versions: dict[str, str]) -> str:
    """Return a hash of everything that changes the pixels of a render.

    Waveform, burst, link budget, weather and range limits are excluded, because they come in after
    rendering. Frames are excluded, because a run may resume with more of them.

    Parameters
    ----------
    plan
        Plan of the run.
    scene_digest
        Names the scene: a hash of its files, or a text that no other run has.
    versions
        Version by the name of the software.

    Returns
    -------
    str
        SHA-256 in hexadecimal digits.
    """
    measurement: dict[str, Any] = dataclasses.asdict(plan.measurement)
    for key in _AFTER_RENDERING:
        del measurement[key]
    parts = {
        "measurement": measurement,
        "metres_per_unit": plan.metres_per_unit,
        "fps": plan.fps,
        "range_encoding_length_m": plan.range_encoding_length_m,
        "extinction_length_m": plan.extinction_length_m,
        "sampling_mode": plan.sampling_mode,
        "options": plan.options,
        "scene": scene_digest,
        "versions": versions,
    }
    if plan.sampling_mode == "paths":
        # These follow from how far the scene reaches in the frames asked for; each table has its
        # own length of the range encoding in its sidecar.
        del measurement["ring_step_m"], parts["range_encoding_length_m"]
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def run_record(
    plan: Plan,
    scene_digest: str,
    blend_file: str,
    scene: str,
    findings: list[Finding],
    versions: dict[str, str],
) -> contract.RunRecord:
    """Return the record that ``run.json`` contains.

    Parameters
    ----------
    plan
        Plan of the run.
    scene_digest
        As for :func:`fingerprint`.
    blend_file
        Name of the .blend file; empty if it was never saved.
    scene
        Name of the scene.
    findings
        Findings before the first render.
    versions
        Version by the name of the software.

    Returns
    -------
    RunRecord
        With its fingerprint.
    """
    measurement = plan.measurement
    return contract.RunRecord(
        sampling_mode=plan.sampling_mode,
        frames=list(measurement.frames),
        frame_times_s=[plan.instants(frame)[0].time_s for frame in measurement.frames],
        rings=plan.rings,
        ring_step_m=measurement.ring_step_m,
        snapshots=measurement.snapshots,
        snapshot_interval_s=measurement.snapshot_interval_s if measurement.snapshots == 2 else 0.0,
        width_px=measurement.width_px,
        height_px=measurement.height_px,
        visibility_updates=plan.visibility_updates,
        samples=measurement.samples,
        seed=measurement.seed,
        max_reflections=measurement.max_reflections,
        metres_per_unit=plan.metres_per_unit,
        range_encoding_length_m=plan.range_encoding_length_m,
        extinction_length_m=plan.extinction_length_m,
        waveform=waveform_to_dict(measurement.waveform),
        burst=dataclasses.asdict(measurement.burst),
        blend_file=blend_file,
        scene=scene,
        fingerprint=fingerprint(plan, scene_digest, versions),
        findings=findings,
        versions=versions,
        link_budget=measurement.link_budget,
        range_start_m=measurement.range_start_m,
        range_stop_m=measurement.range_stop_m,
        weather=dataclasses.asdict(measurement.weather) if measurement.weather != Weather() else {},
    )
