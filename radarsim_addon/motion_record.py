# SPDX-License-Identifier: GPL-3.0-or-later
"""Record in ``motion.json``: how bodies that paths touch move; see :mod:`.contract`."""

from __future__ import annotations

from dataclasses import dataclass, field

from .contract import SCHEMA_VERSION, Matrix, check_pose
from .findings import Finding


@dataclass(frozen=True)
class SegmentRecord:
    """A piece of a body's motion; see signal.motionmodel.Segment for what the numbers are."""

    start_s: float
    stop_s: float
    translation: Matrix
    rotation_centre: list[float]
    rotation: Matrix
    initial_orientation: Matrix
    linear: Matrix = field(default_factory=list)


@dataclass(frozen=True)
class BodyRecord:
    """One object or instance: its pose at t, translation in metres, and how it moves from there.

    instance tells instances of one object apart; it is empty for the object itself. Without
    pieces the body is stationary. noise_m is what the samples scatter about the fit,
    displacement_error_bound_m bounds the error of a displacement, both at the body's farthest
    point. box holds the low and the high corner of a turning body's mesh, in its own axes [m at
    scale 1]; empty where it is not known.
    """

    object: str
    instance: str
    pose: Matrix
    deforms: bool
    segments: list[SegmentRecord]
    noise_m: float
    displacement_error_bound_m: float
    box: list[list[float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        check_pose(self.pose)


@dataclass(frozen=True)
class MotionRecord:
    """Motion of all bodies that paths touch, over one burst from time_s on.

    Numbers in the table's columns body and first_body count bodies from 1. antennas are receiver
    and emitter. displacement_error_bound_m is the largest bound of what moves.
    approximated_motion_fraction is the power of moving paths of three and more reflections, whose
    middle is unknown; unknown_motion_fraction that of paths with a vertex that is not known to
    belong to any body, which is taken as stationary. Many stationary bodies are in a file of their
    own, still_bodies_file, with their numbers; bodies then holds the others, in order.
    """

    frame: int
    time_s: float
    duration_s: float
    samples: int
    receiver_kind: str
    antennas: list[BodyRecord]
    bodies: list[BodyRecord]
    displacement_error_bound_m: float
    displacement_error_bound_wavelengths: float
    approximated_motion_fraction: float
    unknown_motion_fraction: float
    deforming_surfaces_file: str
    deforming_surfaces_sha256: str
    epoch_offset_s: float = 0.0  # when the table was rendered, after time_s; poses are of then
    still_bodies_file: str = ""
    still_bodies_sha256: str = ""
    findings: list[Finding] = field(default_factory=list)
    versions: dict[str, str] = field(default_factory=dict)
    schema: str = "radarsim/motion"
    schema_version: int = SCHEMA_VERSION
