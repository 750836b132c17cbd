# SPDX-License-Identifier: GPL-3.0-or-later
"""Records of the objects of a frame, which :mod:`.contract` keeps in the ground truth."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class FluctuationRecord:
    """How the clutter of a surface fluctuates, see physics.clutter_statistics.

    motion_speed_mps and motion_fraction are what the kind of motion makes of them.
    """

    texture: str = "none"
    texture_shape: float = 0.0
    texture_length_m: float = 0.0
    motion: str = "none"
    motion_speed_mps: float = 0.0
    motion_fraction: float = 0.0


@dataclass(frozen=True)
class ObjectRecord:
    """Where one mesh object truly is: the reference that measured ranges are compared with.

    nearest_range_m is the least distance from the receiver to the object's evaluated mesh at t, and
    null if a shader displaces the surface. centre_range_m is the distance to the centre of its
    bounding box. range_rate_mps is the rate of that distance between the snapshots (receding > 0);
    null with one snapshot. collections are those that hold the object, at any depth. rms_height_m
    and correlation_length_m are those of the first of its materials that has any; null: none has.
    fluctuation and clutter (the name of the clutter model) likewise.
    """

    name: str
    nearest_range_m: float | None
    centre_range_m: float
    range_rate_mps: float | None
    materials: list[str] = field(default_factory=list)
    collections: list[str] = field(default_factory=list)
    rms_height_m: float | None = None
    correlation_length_m: float | None = None
    fluctuation: FluctuationRecord | None = None
    clutter: str | None = None
