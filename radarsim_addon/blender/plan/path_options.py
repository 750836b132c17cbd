# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user asks of the acquisition "paths". Standard library only."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...errors import ConfigError

#: Cameras finer than this see float32 of their own directions [rad per pixel].
FINEST_PITCH = 5e-7


@dataclass(frozen=True)
class PathOptions:
    """How paths are followed, and when it is enough.

    Parameters
    ----------
    max_reflections
        Most reflections.
    max_depth
        Most transparent surfaces on the receiver's side.
    max_unfollowed_fraction
        Share of the total power that may stay unfollowed.
    replicates
        Sub-pixel shifts of each tile; they are the replicates that the standard error comes from.
        One alone tells that of objects, by their edges and by what neighbouring pixels differ.
    max_standard_error
        Relative standard error (over range bins and objects) at which refinement ends; 0: no
        refinement.
    refine_for
        What the relative error is of: "both", "ranges" (range bins) or "objects".
    time_limit_s
        Time per radar frame after which no further tile is refined [s]; 0: no limit.
    max_refinement_level
        Most halvings of the pixel pitch.
    tile_px
        Side of a tile.
    motion
        "kinematic": every path's length at every pulse, from the motion of what it touches; "off":
        all stands still during a burst.
    motion_samples
        Most samples of the animation in a burst.
    visibility_updates
        How often a burst is rendered, for scenes whose visibility changes in it: at its beginning,
        at its end and evenly between. Echoes fade from one to the next.
    range_encoding
        "auto", "materials" or "world": what carries the range code.
    amplitude_channel
        Which channel is the amplitude in coloured scenes: "mean", "R", "G" or "B".
    """

    max_reflections: int = 1
    max_depth: int = 64
    max_unfollowed_fraction: float = 1e-4
    replicates: int = 4
    max_standard_error: float = 0.0
    refine_for: str = "both"
    time_limit_s: float = 0.0
    max_refinement_level: int = 12
    tile_px: int = 256
    motion: str = "kinematic"
    motion_samples: int = 4097
    visibility_updates: int = 1
    range_encoding: str = "auto"
    amplitude_channel: str = "mean"

    def __post_init__(self) -> None:
        for name, value, low, high in (
            ("Reflections", self.max_reflections, 1, 64),
            ("Transparent surfaces", self.max_depth, 0, 1000),
            ("Shifts", self.replicates, 1, 10_000),
            ("Refinement levels", self.max_refinement_level, 0, 40),
            ("Tile size", self.tile_px, 4, 4096),
            ("Motion samples", self.motion_samples, 17, 65_537),
            ("Renders per burst", self.visibility_updates, 1, 1000),
        ):
            if not (isinstance(value, int) and low <= value <= high):
                raise ConfigError(f"{name}: {value!r}; expected a whole number {low} to {high}.")
        for name, number, top in (
            ("Residual", self.max_unfollowed_fraction, 1.0),
            ("Error target", self.max_standard_error, 10.0),
            ("Time budget", self.time_limit_s, 1e9),
        ):
            if not (math.isfinite(number) and 0 <= number <= top):
                raise ConfigError(f"{name}: {number!r}; expected a number from 0 to {top:g}.")
        if self.motion not in ("kinematic", "off"):
            raise ConfigError(f"Motion {self.motion!r}; expected 'kinematic' or 'off'.")
        if self.range_encoding not in ("auto", "materials", "world"):
            raise ConfigError(
                f"Code {self.range_encoding!r}; expected 'auto', 'materials' or 'world'."
            )
        if self.amplitude_channel not in ("mean", "R", "G", "B"):
            raise ConfigError(
                f"Amplitude {self.amplitude_channel!r}; expected 'mean', 'R', 'G' or 'B'."
            )
        if self.refine_for not in ("both", "ranges", "objects"):
            raise ConfigError(
                f"Refinement by {self.refine_for!r}; expected 'both', 'ranges' or 'objects'."
            )
        if self.refines and self.replicates < 2 and self.refine_for != "objects":
            raise ConfigError(
                f"One shift a tile gives no standard error of range bins, and the error is of "
                f"{self.refine_for!r}; expected at least 2 shifts with an error target or a time "
                "budget, or an error of 'objects'."
            )

    @property
    def error_scope(self) -> str:
        """What the error that is reported is of: one shift knows that of objects alone."""
        return "objects" if self.replicates == 1 else self.refine_for

    @property
    def refines(self) -> bool:
        """Whether tiles are refined at all."""
        return self.max_standard_error > 0 or self.time_limit_s > 0
