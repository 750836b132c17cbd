# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan of a run: its renders, their times and range encoding. Does not import bpy.

In: a measurement, unit scale, frame rate and how far the scene reaches. The number of rings follows
from the farthest point, and the length k of the range encoding exp(-l/k) from the longest path, so
that neither R nor G underflows. Blender evaluates frame plus subframe in float32: times are those
of its sums. Out: the tasks, one Cycles render each, the record ``run.json``, and a fingerprint of
all that changes the pixels of a render.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import contract
from ...contract import MAX_RINGS
from ...errors import ConfigError
from ...findings import Finding
from ...signal.radar import Weather, channels_to_dict, waveform_to_dict
from .measurement import Measurement

#: Path lengths per length of the range encoding. exp(-2*8) in G leaves 20 decades of float32 for
#: the radiance, and float32 noise of the range is lowest at a few such lengths (4e-8 to 7e-8).
_LENGTHS_PER_CODE = 8.0


@dataclass(frozen=True)
class Extent:
    """How far the scene reaches over all frames of the run. All zero for an empty scene."""

    #: Distance of the farthest point that can echo from the transmitter, and from the receiver.
    from_emitter_m: float = 0.0
    from_receiver_m: float = 0.0
    #: Distance between the antennas.
    baseline_m: float = 0.0
    #: Size of all that can echo.
    diameter_m: float = 0.0

    def union(self, other: Extent) -> Extent:
        """Return the extent that covers both."""
        return Extent(*map(max, dataclasses.astuple(self), dataclasses.astuple(other)))


@dataclass(frozen=True)
class Instant:
    """A moment of the animation."""

    #: Whole frame and fraction of a frame, 0 to below 1, as Blender takes them.
    frame: int
    subframe: float
    #: Since frame 0, when Blender evaluates the animation.
    time_s: float

    @property
    def evaluated_frame(self) -> float:
        """Frame that Blender evaluates: it adds frame and subframe in float32."""
        return float(np.float32(self.frame) + np.float32(self.subframe))


@dataclass(frozen=True)
class Task:
    """One Cycles render: one ring in one snapshot of one radar frame."""

    #: Blender frame at which the radar frame starts.
    frame: int
    #: 0 at t, 1 after the snapshot interval.
    snapshot_index: int
    #: From 0.
    ring: int
    instant: Instant
    #: Edges of the ring, one way.
    ring_min_m: float
    ring_max_m: float

    @property
    def exr_path(self) -> str:
        """EXR file, relative to the run's folder."""
        stem = contract.render_stem(self.ring, self.snapshot_index)
        return f"{contract.frame_dir(self.frame)}/{stem}.exr"

    @property
    def sidecar_path(self) -> str:
        """JSON sidecar, relative to the run's folder."""
        return self.exr_path.removesuffix(".exr") + ".json"


@dataclass(frozen=True)
class Plan:
    """All renders of a run, and the numbers they share."""

    measurement: Measurement
    rings: int
    metres_per_unit: float
    #: Blender frames per second.
    fps: float
    #: Path length over which the range encoding falls by 1/e.
    range_encoding_length_m: float
    #: Length to which the Radar Material's extinction is normalised.
    extinction_length_m: float
    extent: Extent
    #: "rings" or "paths".
    sampling_mode: str = "rings"
    #: Text of the path options, for the fingerprint; empty with rings.
    options: str = ""
    #: Renders per burst.
    visibility_updates: int = 1

    @property
    def total(self) -> int:
        """Number of renders."""
        return self.measurement.renders(self.rings)

    def tasks(self, frames: Sequence[int] | None = None) -> Iterator[Task]:
        """Yield renders of some frames (None: all): frame by frame, snapshot by snapshot.

        Rings come last: a new ring costs Cycles nothing, a new time costs a new scene.
        """
        step_m = self.measurement.ring_step_m
        for frame in self.measurement.frames if frames is None else frames:
            for snapshot_index, instant in enumerate(self.instants(frame)):
                for ring in range(self.rings):
                    yield Task(
                        frame, snapshot_index, ring, instant, ring * step_m, (ring + 1) * step_m
                    )

    def instants(self, frame: int) -> list[Instant]:
        """Return the moments of a frame's snapshots: t, and t + delta t if there are two.

        Raises ConfigError if Blender's frame numbers are too coarse there for delta t.
        """
        first = instant_at(float(frame), self.fps)
        if self.measurement.snapshots == 1:
            return [first]
        interval_s = self.measurement.snapshot_interval_s
        second = instant_at(frame + interval_s * self.fps, self.fps)
        if not abs(second.time_s - first.time_s - interval_s) <= interval_s / 2:
            step_s = float(np.spacing(np.float32(abs(frame) + 1))) / self.fps
            raise ConfigError(
                f"Snapshot interval is {interval_s!r} s, but at frame {frame} Blender's time has "
                f"steps of {step_s:.3g} s. Lengthen the interval, or move the animation to lower "
                "frame numbers."
            )
        return [first, second]


def instant_at(frame: float, fps: float) -> Instant:
    """Return the moment that Blender evaluates for a fractional frame.

    Its sum in float32 has steps of 1.5e-5 frames at frame 250, of 1e-3 at frame 10 000.
    """
    whole = math.floor(frame)
    subframe = float(np.float32(frame - whole))
    if subframe >= 1.0:
        whole, subframe = whole + 1, 0.0
    moment = Instant(whole, subframe, 0.0)
    return dataclasses.replace(moment, time_s=moment.evaluated_frame / fps)


def range_encoding_length_m(measurement: Measurement, rings: int, extent: Extent) -> float:
    """Return the length k with which neither R nor G underflows: an eighth of the longest path.

    The longest path goes from the receiver over all reflections to the transmitter. Its last
    segment ends within the outermost ring, the others within the scene.
    """
    outermost_m = rings * measurement.ring_step_m
    bounces = measurement.max_reflections - 1
    longest_m = 2 * outermost_m + extent.baseline_m + bounces * max(extent.diameter_m, 0.0)
    if bounces:
        # With more reflections the first segment is not tied to the ring of the last one.
        longest_m += extent.from_receiver_m
    return longest_m / _LENGTHS_PER_CODE


def make_plan(
    measurement: Measurement,
    metres_per_unit: float,
    fps: float,
    extent: Extent,
    sampling_mode: str = "rings",
    options: str = "",
    visibility_updates: int = 1,
) -> Plan:
    """Return the plan of a run, with the number of rings chosen where the measurement has 0.

    Raises ConfigError if the scene needs more than `MAX_RINGS` rings, scale or frame rate are not
    positive, or there are more renders in a burst than pulses.
    """
    if visibility_updates > measurement.burst.pulses:
        raise ConfigError(
            f"Visibility updates is {visibility_updates}; expected at most one per pulse of the "
            f"burst, {measurement.burst.pulses}. Lower it, or send more pulses."
        )
    if sampling_mode == "rings" and any(one.displaced for one in measurement.channels):
        raise ConfigError(
            f"An array of {len(measurement.channels)} channels is asked for, and rings know no "
            "scatterers, so that lengths to its elements are unknown. Choose the sampling mode "
            "Paths, or Array: One Element."
        )
    check_unit_scale(metres_per_unit)
    check_frame_rate(fps)
    rings = measurement.rings or automatic_rings(measurement.ring_step_m, extent)
    inverse_k = np.float32(metres_per_unit / range_encoding_length_m(measurement, rings, extent))
    if not (np.isfinite(inverse_k) and inverse_k > 0):
        raise ConfigError(
            f"Rings of {measurement.ring_step_m:g} m do not fit a scene with "
            f"{metres_per_unit:g} m per Blender unit. Check Scene > Units > Unit Scale."
        )
    return Plan(
        measurement=measurement,
        rings=rings,
        metres_per_unit=metres_per_unit,
        fps=fps,
        # The shader reads 1/k in float32. k is recorded as the inverse of that number.
        range_encoding_length_m=metres_per_unit / float(inverse_k),
        extinction_length_m=measurement.extinction_length_m or metres_per_unit,
        extent=extent,
        sampling_mode=sampling_mode,
        options=options,
        visibility_updates=visibility_updates,
    )


def check_unit_scale(metres_per_unit: float) -> float:
    """Return the unit scale of the scene [m per Blender unit]; ConfigError if it cannot be used."""
    return _check_positive(
        "Unit Scale", metres_per_unit, ", the metres per Blender unit. Set it in Scene > Units; "
        "the default is 1."
    )  # fmt: skip


def check_frame_rate(fps: float) -> float:
    """Return the frame rate of the scene; ConfigError if it cannot be used."""
    return _check_positive("Frame rate", fps, ". Set it and its base in Output > Format.")


def _check_positive(name: str, value: float, hint: str) -> float:
    if not (math.isfinite(value) and value > 0):
        raise ConfigError(f"{name} of the scene is {value!r}; expected a positive number{hint}")
    return value


def automatic_rings(ring_step_m: float, extent: Extent) -> int:
    """Return the number of rings that reaches the scene's farthest point, 1 for an empty scene.

    Raises ConfigError if more than `MAX_RINGS` would be needed.
    """
    rings = max(1, math.floor(extent.from_emitter_m / ring_step_m) + 1)
    if rings > MAX_RINGS:
        raise ConfigError(
            f"The scene reaches {extent.from_emitter_m:.6g} m, which takes {rings} rings of "
            f"{ring_step_m:g} m; expected at most {MAX_RINGS}. Widen the ring step, give the "
            "number of rings, or take distant objects out of the render."
        )
    return rings


#: What changes no render.
_AFTER_RENDERING = (
    "waveform", "burst", "array", "array_schedule", "channels", "link_budget", "frames", "rings",
    "weather", "range_start_m", "range_stop_m",
)  # fmt: skip


def fingerprint(plan: Plan, scene_digest: str, versions: dict[str, str]) -> str:
    """Return a hash (SHA-256) of everything that changes the pixels of a render.

    Waveform, burst, array, link budget, weather and range limits are excluded, because they come in
    after rendering. Frames are excluded, because a run may resume with more of them. `scene_digest`
    names the scene: a hash of its files, or a text that no other run has.
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
    """Return the record that ``run.json`` contains, with its fingerprint.

    `blend_file` is empty if the file was never saved, `findings` are those before the first render.
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
        channels=channels_to_dict(measurement.channels),
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
