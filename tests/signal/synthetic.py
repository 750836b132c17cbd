# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs without Blender: folders as the Blender half writes them, from ranges that a test chose."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from radarsim_addon import contract, typed_json
from radarsim_addon.signal.radar import Burst, Radar, Waveform, waveform_to_dict
from radarsim_addon.signal.runs import write_exr

#: The paper's radar (Table I), 128 pulses.
PAPER_RADAR = Radar(Waveform(5.3e9, 50e6, 2.5e-6, 60e6), Burst(1000.0, 128))

IDENTITY = [[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0], [0, 0, 0, 1.0]]

#: (frame, ring, pass) -> one-way range [m] and radiance [W m^-2 sr^-1], (height, width) each; 0
#: where there is no echo.
Picture = Callable[[int, int, int], tuple[np.ndarray, np.ndarray]]


@dataclasses.dataclass
class Setup:
    """Numbers of a synthetic run."""

    radar: Radar = PAPER_RADAR
    frames: tuple[int, ...] = (1,)
    rings: int = 4
    ring_step_m: float = 250.0
    snapshots: int = 2
    snapshot_interval_s: float = 0.01
    width_px: int = 16
    height_px: int = 12
    metres_per_unit: float = 100.0
    range_encoding_length_m: float = 1000.0
    near_clip_m: float = 1e-4
    half_width: float = 0.4
    half_height: float = 0.3

    def camera(self) -> contract.ReceiverRecord:
        """The receiver: looks along -z from the origin."""
        return contract.ReceiverRecord(
            kind="perspective",
            matrix_world=IDENTITY,
            left=-self.half_width,
            right=self.half_width,
            bottom=-self.half_height,
            top=self.half_height,
            near_clip_m=self.near_clip_m,
        )

    def frame_time_s(self, frame: int, snapshot_index: int = 0) -> float:
        """Scene time of a snapshot at 24 frames a second; Blender has it in float32 frames."""
        return float(np.float32(frame + 24 * self.snapshot_interval_s * snapshot_index)) / 24


def empty(setup: Setup) -> tuple[np.ndarray, np.ndarray]:
    """No echo."""
    return tuple(np.zeros((2, setup.height_px, setup.width_px)))  # type: ignore[return-value]


def points(setup: Setup, echoes: list[tuple[int, int, float, float, float]]) -> Picture:
    """Echoes (row, col, range_m at t, range rate, radiance), each in the ring where it belongs."""

    def picture(frame: int, ring: int, snapshot_index: int) -> tuple[np.ndarray, np.ndarray]:
        range_m, radiance = empty(setup)
        for row, col, start_m, rate_mps, strength in echoes:
            passed_s = setup.frame_time_s(frame, snapshot_index) - setup.frame_time_s(frame)
            now_m = start_m + rate_mps * passed_s
            if ring * setup.ring_step_m <= now_m < (ring + 1) * setup.ring_step_m:
                range_m[row, col], radiance[row, col] = now_m, strength
        return range_m, radiance

    return picture


def encode(setup: Setup, range_m: np.ndarray, radiance: np.ndarray) -> dict[str, np.ndarray]:
    """Colours that Cycles would render (Eq. 2-3), near clip included, rounded to float32."""
    camera = setup.camera()
    u = camera.left + (np.arange(setup.width_px) + 0.5) * (2 * setup.half_width / setup.width_px)
    v = camera.top - (np.arange(setup.height_px) + 0.5) * (2 * setup.half_height / setup.height_px)
    cut_m = setup.near_clip_m * np.sqrt(1 + u[None, :] ** 2 + v[:, None] ** 2)
    code = np.where(
        radiance > 0, np.exp(-(2 * range_m - cut_m) / setup.range_encoding_length_m), 0.0
    )
    blue = radiance * setup.metres_per_unit**2
    planes = {"R": blue * code, "G": blue * code**2, "B": blue}
    return {name: plane.astype(np.float32) for name, plane in planes.items()}


def render_record(
    setup: Setup, frame: int, ring: int, snapshot_index: int
) -> contract.RenderRecord:
    """Sidecar of one render; its checksum is still to be filled in."""
    return contract.RenderRecord(
        sampling_mode="rings",
        frame=frame,
        snapshot_index=snapshot_index,
        time_s=setup.frame_time_s(frame, snapshot_index),
        ring=ring,
        ring_min_m=ring * setup.ring_step_m,
        ring_max_m=(ring + 1) * setup.ring_step_m,
        width_px=setup.width_px,
        height_px=setup.height_px,
        metres_per_unit=setup.metres_per_unit,
        range_encoding_length_m=setup.range_encoding_length_m,
        extinction_length_m=setup.metres_per_unit,
        receiver=setup.camera(),
        transmitter=contract.TransmitterRecord(matrix_world=IDENTITY, eirp_w=1.0),
        samples=1,
        seed=0,
        max_reflections=2,
        exr_file=f"{contract.render_stem(ring, snapshot_index)}.exr",
        exr_sha256="",
    )


def run_record(setup: Setup) -> contract.RunRecord:
    """Plan of the run."""
    return contract.RunRecord(
        sampling_mode="rings",
        frames=list(setup.frames),
        frame_times_s=[setup.frame_time_s(f) for f in setup.frames],
        rings=setup.rings,
        ring_step_m=setup.ring_step_m,
        snapshots=setup.snapshots,
        snapshot_interval_s=setup.snapshot_interval_s,
        width_px=setup.width_px,
        height_px=setup.height_px,
        samples=1,
        seed=0,
        max_reflections=2,
        metres_per_unit=setup.metres_per_unit,
        range_encoding_length_m=setup.range_encoding_length_m,
        extinction_length_m=setup.metres_per_unit,
        waveform=waveform_to_dict(setup.radar.waveform),
        burst=dataclasses.asdict(setup.radar.burst),
        blend_file="synthetic.blend",
        fingerprint="synthetic",
    )


def write_render(
    folder: Path,
    setup: Setup,
    frame: int,
    ring: int,
    snapshot_index: int,
    channels: dict[str, np.ndarray],
    /,
    **changes: Any,
) -> Path:
    """Write one EXR and its sidecar, with fields of the sidecar changed at will."""
    place = folder / contract.frame_dir(frame)
    place.mkdir(parents=True, exist_ok=True)
    path = place / f"{contract.render_stem(ring, snapshot_index)}.exr"
    write_exr(path, channels)
    record = dataclasses.replace(
        render_record(setup, frame, ring, snapshot_index), exr_sha256=typed_json.file_sha256(path)
    )
    typed_json.write_record(path.with_suffix(".json"), dataclasses.replace(record, **changes))
    return path


def write_run(folder: Path, setup: Setup, picture: Picture) -> Path:
    """Write a whole run; returns its folder."""
    folder.mkdir(parents=True, exist_ok=True)
    typed_json.write_record(folder / contract.RUN_FILE, run_record(setup))
    for frame in setup.frames:
        for snapshot_index in range(setup.snapshots):
            for ring in range(setup.rings):
                channels = encode(setup, *picture(frame, ring, snapshot_index))
                write_render(folder, setup, frame, ring, snapshot_index, channels)
    return folder
