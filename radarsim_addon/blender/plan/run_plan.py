# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan of a run: its renders, their times and range encoding. Does not import bpy."""

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
from ...signal.radar import Weather, waveform_to_dict
from .measurement import Measurement

#: Path lengths per length of the range encoding. exp(-2*8) in G leaves 20 decades of float32 for
#: the radiance, and float32 noise of the range is lowest at a few such lengths (4e-8 to 7e-8).
_LENGTHS_PER_CODE = 8.0


@dataclass(frozen=True)
class Extent:
    """How far the scene reaches over all frames of the run. All zero for an empty scene.

    Attributes
    ----------
    from_emitter_m, from_receiver_m
        Distance of the farthest point that can echo, from the transmitter and from the
        receiver [m].
    baseline_m
        Distance between the antennas [m].
    diameter_m
        Size of all that can echo [m].
    """

    from_emitter_m: float = 0.0
    from_receiver_m: float = 0.0
    baseline_m: float = 0.0
    diameter_m: float = 0.0

    def union(self, other: Extent) -> Extent:
        """Return the extent that covers both."""
        return Extent(
            *(
                max(a, b)
                for a, b in zip(dataclasses.astuple(self), dataclasses.astuple(other), strict=True)
            )
        )


@dataclass(frozen=True)
class Instant:
    """A moment of the animation.

    Attributes
    ----------
    frame, subframe
        Whole frame and fraction of a frame, 0 to below 1, as Blender takes them.
    time_s
        Time since frame 0 at which Blender evaluates the animation [s].
    """

    frame: int
    subframe: float
    time_s: float

    @property
    def evaluated_frame(self) -> float:
        """Frame that Blender evaluates: it adds frame and subframe in float32."""
        return float(np.float32(self.frame) + np.float32(self.subframe))


@dataclass(frozen=True)
class Task:
    """One Cycles render: one ring in one snapshot of one radar frame.

    Attributes
    ----------
    frame
        Blender frame at which the radar frame starts.
    snapshot_index
        0 at t, 1 after the snapshot interval.
    ring
        Number of the ring, from 0.
    instant
        Moment of the animation.
    ring_min_m, ring_max_m
        Edges of the ring, one way [m].
    """

    frame: int
    snapshot_index: int
    ring: int
    instant: Instant
    ring_min_m: float
    ring_max_m: float

    @property
    def exr_path(self) -> str:
        """EXR file, relative to the run's folder."""
        return (
            f"{contract.frame_dir(self.frame)}/"
            f"{contract.render_stem(self.ring, self.snapshot_index)}.exr"
        )

    @property
    def sidecar_path(self) -> str:
        """JSON sidecar, relative to the run's folder."""
        return self.exr_path.removesuffix(".exr") + ".json"


@dataclass(frozen=True)
class Plan:
    """All renders of a run, and the numbers they share.

    Attributes
    ----------
    measurement
        What is measured.
    rings
        Number of rings.
    metres_per_unit
        Metres per Blender unit.
    fps
        Blender frames per second.
    range_encoding_length_m
        Path length over which the range encoding falls by 1/e [m].
    extinction_length_m
        Length to which the Radar Material's extinction is normalised [m].
    extent
        How far the scene reaches.
    sampling_mode
        "rings" or "paths".
    options
        Text of the path options, for the fingerprint; empty with rings.
    visibility_updates
        Number of renders per burst.
    """

    measurement: Measurement
    rings: int
    metres_per_unit: float
    fps: float
    range_encoding_length_m: float
    extinction_length_m: float
    extent: Extent
    sampling_mode: str = "rings"
    options: str = ""
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

        Raises
        ------
        ConfigError
            Blender's frame numbers are too coarse there for delta t.
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

    Parameters
    ----------
    frame
        Frame with its fraction.
    fps
        Blender frames per second.

    Returns
    -------
    Instant
        With the time at which the animation is evaluated.

    Notes
    -----
    Blender's sum in float32 has steps of 1.5e-5 frames at frame 250, of 1e-3 at frame 10 000.
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
    """Return the plan of a run.

    Parameters
    ----------
    measurement, extent, sampling_mode, options
        See `Plan`.
    metres_per_unit, fps
        Metres per Blender unit and Blender frames per second, above 0.
    visibility_updates
        Number of renders per burst, at most one per pulse.

    Returns
    -------
    Plan
        With the number of rings chosen where the measurement has 0.

    Raises
    ------
    ConfigError
        The scene needs more than `MAX_RINGS` rings, scale or frame rate are not positive, or
        there are more renders in a burst than pulses.
    """
    if visibility_updates > measurement.burst.pulses:
        raise ConfigError(
            f"Visibility updates is {visibility_updates}; expected at most one per pulse of the "
            f"burst, {measurement.burst.pulses}. Lower it, or send more pulses."
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
    """Return the unit scale of the scene, if it can be used.

    Parameters
    ----------
    metres_per_unit
        Unit scale [m per Blender unit].

    Returns
    -------
    float
        The same.

    Raises
    ------
    ConfigError
        Not finite or not positive.
    """
    return _check_positive(
        "Unit Scale", metres_per_unit, ", the metres per Blender unit. Set it in Scene > Units; "
        "the default is 1."
    )  # fmt: skip


def check_frame_rate(fps: float) -> float:
    """Return the frame rate of the scene, if it can be used.

    Parameters
    ----------
    fps
        Blender frames per second.

    Returns
    -------
    float
        The same.

    Raises
    ------
    ConfigError
        Not finite or not positive.
    """
    return _check_positive("Frame rate", fps, ". Set it and its base in Output > Format.")


def _check_positive(name: str, value: float, hint: str) -> float:
    if not (math.isfinite(value) and value > 0):
        raise ConfigError(f"{name} of the scene is {value!r}; expected a positive number{hint}")
    return value


def automatic_rings(ring_step_m: float, extent: Extent) -> int:
    """Return the number of rings that reaches the scene's farthest point.

    Parameters
    ----------
    ring_step_m
        Width of a ring, one way [m].
    extent
        How far the scene reaches.

    Returns
    -------
    int
        At least 1, which is the number for an empty scene.

    Raises
    ------
    ConfigError
        More than `MAX_RINGS` would be needed.
    """
    rings = max(1, math.floor(extent.from_emitter_m / ring_step_m) + 1)
    if rings > MAX_RINGS:
        raise ConfigError(
            f"The scene reaches {extent.from_emitter_m:.6g} m, which takes {rings} rings of "
            f"{ring_step_m:g} m; expected at most {MAX_RINGS}. Widen the ring step, give the "
            "number of rings, or take distant objects out of the render."
        )
    return rings


# -------------------------------------------------------------------------------------------------
# The record of a run, and the fingerprint that identifies its renders. Does not import bpy.
# -------------------------------------------------------------------------------------------------


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
