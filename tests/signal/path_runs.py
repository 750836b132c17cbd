# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of the acquisition "paths" without Blender: Lambert plates traced ray by ray in numpy."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from radarsim_addon import contract
from radarsim_addon.signal.decoding import pixel_rays
from radarsim_addon.signal.paths import (
    COLUMN_GROUPS,
    PATH_FLAGS,
    PathRows,
    unrendered_record,
    write_table,
)
from radarsim_addon.signal.radar import Burst, Waveform
from radarsim_addon.typed_json import write_record

WAVEFORM = Waveform(5.3e9, 50e6, 2.5e-6, 60e6)
BURST = Burst(1000.0, 64)
C0_MPS = 299_792_458.0


def pose(position: Sequence[float], azimuth_deg: float = 0.0, elevation_deg: float = 0.0) -> list:
    """Pose of something that looks along the world's +Y (-z of its own), turned right and up."""
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    ahead = np.array([math.sin(a) * math.cos(e), math.cos(a) * math.cos(e), math.sin(e)])
    right = np.array([math.cos(a), -math.sin(a), 0.0])
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = right, np.cross(right, ahead), -ahead
    matrix[:3, 3] = position
    return matrix.tolist()


def camera(matrix: list, half_deg: float = 30.0) -> contract.ReceiverRecord:
    """A square perspective camera."""
    t = math.tan(math.radians(half_deg))
    return contract.ReceiverRecord("perspective", matrix, -t, t, -t, t, 0.0)


@dataclass(frozen=True)
class Plate:
    """A Lambert rectangle: centre, half edges (world vectors), albedo."""

    name: str
    centre: tuple[float, float, float]
    half_u: tuple[float, float, float]
    half_v: tuple[float, float, float]
    albedo: float = 1.0


def plate(
    name: str,
    centre: tuple[float, float, float],
    side_m: float,
    tilt_deg: float = 0.0,
    albedo: float = 1.0,
) -> Plate:
    """A square plate that faces -Y, tilted about X."""
    h, t = side_m / 2, math.radians(tilt_deg)
    return Plate(name, centre, (h, 0, 0), (0, h * math.sin(t), h * math.cos(t)), albedo)


def trace(
    plates: Sequence[Plate],
    receiver: contract.ReceiverRecord,
    emitter: contract.TransmitterRecord,
    size_px: int,
    replicates: int = 1,
    seed: int = 0,
) -> PathRows:
    """Rows of order 1, nearest plate first; shifts move the grid by a random part of a pixel."""
    rng = np.random.default_rng(seed)
    emitter_m = np.array(emitter.matrix_world)[:3, 3]
    wavelength_m = C0_MPS / WAVEFORM.carrier_hz
    parts = []
    for shift in range(replicates):
        du, dv = rng.uniform(-0.5, 0.5, 2) if replicates > 1 else (0.0, 0.0)
        step = (receiver.right - receiver.left) / size_px
        moved = dataclasses.replace(
            receiver,
            left=receiver.left + du * step,
            right=receiver.right + du * step,
            bottom=receiver.bottom + dv * step,
            top=receiver.top + dv * step,
        )
        rays = pixel_rays(moved, size_px, size_px)
        direction = rays.direction.reshape(-1, 3)
        origin_m = np.broadcast_to(rays.origin_m, rays.direction.shape).reshape(-1, 3)
        solid = rays.solid_angle_sr.ravel()
        nearest = np.full(solid.size, np.inf)
        which = np.zeros(solid.size, dtype=int)
        for number, item in enumerate(plates, start=1):
            u, v = np.array(item.half_u), np.array(item.half_v)
            normal = np.cross(u, v)
            with np.errstate(divide="ignore", invalid="ignore"):
                t = ((np.array(item.centre) - origin_m) @ normal) / (direction @ normal)
                local = origin_m + t[:, None] * direction - item.centre
                hit = (
                    (np.abs(local @ u) <= u @ u)
                    & (np.abs(local @ v) <= v @ v)
                    & (t > 0)
                    & (t < nearest)
                )
            nearest[hit], which[hit] = t[hit], number
        hit = which > 0
        rows = PathRows.zeros(np.count_nonzero(hit))
        point = origin_m[hit] + nearest[hit, None] * direction[hit]
        normals = np.array([np.cross(p.half_u, p.half_v) for p in plates], dtype=float)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        normal = normals[which[hit] - 1]
        albedo = np.array([p.albedo for p in plates])[which[hit] - 1]
        to_emitter = emitter_m - point
        there = np.linalg.norm(to_emitter, axis=1)
        cosine = np.abs(np.sum(to_emitter * normal, axis=1)) / there
        radiance = albedo / math.pi * emitter.eirp_w * cosine / (4 * math.pi * there**2)
        rows["power_w"] = radiance * solid[hit] * wavelength_m**2 / (4 * math.pi) / replicates
        rows["length_m"] = nearest[hit] + there
        rows["order"] = 1
        rows["first_scatterer_m"] = rows["last_scatterer_m"] = point
        rows["direction"] = direction[hit]
        rows["solid_angle_sr"] = solid[hit] / replicates
        rows["last_object"] = rows["first_object"] = which[hit]
        rows["replicate"] = shift
        parts.append(rows)
    return PathRows.joined(parts)


def write_run(
    folder: Path,
    rows: PathRows,
    names: list[str],
    receiver: contract.ReceiverRecord,
    emitter: contract.TransmitterRecord,
    *,
    range_limits_m: float,
    system: contract.LinkBudget | None = None,
    replicates: int = 1,
    scene: contract.GroundTruthRecord | None = None,
) -> Path:
    """A run of one frame; returns its folder."""
    frame = folder / contract.frame_dir(1)
    frame.mkdir(parents=True)
    table = frame / contract.PATHS_TABLE
    written = write_table(table, [rows], rows.size)
    run = contract.RunRecord(
        sampling_mode="paths",
        frames=[1],
        frame_times_s=[0.0],
        rings=1,
        ring_step_m=range_limits_m,
        snapshots=1,
        snapshot_interval_s=0.0,
        width_px=64,
        height_px=64,
        samples=1,
        seed=0,
        max_reflections=1,
        metres_per_unit=1.0,
        range_encoding_length_m=100.0,
        extinction_length_m=1.0,
        waveform=dataclasses.asdict(WAVEFORM),
        burst=dataclasses.asdict(BURST),
        blend_file="",
        fingerprint="",
        link_budget=system,
    )
    write_record(folder / contract.RUN_FILE, run)
    record = dataclasses.replace(
        unrendered_record(receiver, emitter, WAVEFORM.carrier_hz, rows, names, replicates),
        frame=1,
        range_encoding_length_m=100.0,
        extinction_length_m=1.0,
        width_px=64,
        height_px=64,
        renders=1,
        column_groups=COLUMN_GROUPS,
        flags=PATH_FLAGS,
        stop_reason="all tiles",
        table_file=contract.PATHS_TABLE,
        column_sha256=written.column_sha256,
    )
    write_record(frame / contract.PATHS_FILE, record)
    if scene is not None:
        write_record(frame / contract.GROUND_TRUTH_FILE, scene)
    return folder
