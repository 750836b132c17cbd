# SPDX-License-Identifier: GPL-3.0-or-later
"""Options of the sampling mode "paths". Standard library only."""

from __future__ import annotations

from dataclasses import dataclass

from ...errors import ConfigError
from ...options import check_settings, documented, setting
from .measurement import MAX_REFLECTIONS

#: Below this pixel pitch, float32 rounds the camera's own directions [rad per pixel].
FINEST_PITCH = 5e-7


@documented
@dataclass(frozen=True)
class PathOptions:
    """How paths are followed, and when refinement stops."""

    max_reflections: int = setting(default=1, **MAX_REFLECTIONS)
    max_depth: int = setting(
        "Transparent surfaces", "Set the most transparent surfaces on the receiver's side", 64,
        minimum=0, maximum=1000, window=False,
    )  # fmt: skip
    max_unfollowed_fraction: float = setting(
        "Max unfollowed fraction", "Set the fraction of the power that may stay unfollowed", 1e-4,
        minimum=0.0, maximum=1.0, window=False,
    )  # fmt: skip
    replicates: int = setting(
        "Replicates",
        "Set the replicates of each tile: renders with other sub-pixel offsets, whose scatter "
        "gives the standard error",
        4,
        minimum=1,
        maximum=10_000,
        soft_maximum=64,
    )
    max_standard_error: float = setting(
        "Max standard error",
        "Refine tiles until the relative standard error (over range bins and objects) is below "
        "this. 0: no refinement by error",
        0.0,
        shown_in="%",
        minimum=0.0,
        maximum=10.0,
        digits=2,
    )
    refine_for: str = setting(
        "Refine for",
        "Choose what the standard error is of",
        "both",
        choices=(
            ("both", "Both", "Half from range bins, half from objects"),
            ("ranges", "Ranges", "Range bins, weighed by the root of their power"),
            ("objects", "Objects", "The power of each object, all alike: small targets"),
        ),
    )
    time_limit_s: float = setting(
        "Time limit", "Stop refining a frame after this time. 0: no limit", 0.0, unit="s",
        minimum=0.0, maximum=1e9, digits=1,
    )  # fmt: skip
    max_refinement_level: int = setting(
        "Max refinement level", "Set the most halvings of the pixel pitch", 12,
        minimum=0, maximum=40, window=False,
    )  # fmt: skip
    tile_px: int = setting(
        "Tile size",
        "Set the side of a tile; without refinement, 256 means 512 in scenes of more than 250 "
        "objects",
        256,
        minimum=4,
        maximum=4096,
        window=False,
    )
    motion: str = setting(
        "Motion",
        "Choose how paths move during a burst",
        "kinematic",
        choices=(
            ("kinematic", "Kinematic", "Every path's length at every pulse, from what it touches"),
            ("off", "Off", "Everything is stationary during a burst"),
            ("linear", "Linear simulations", "Simulations as Blender: straight between frames"),
        ),
    )
    motion_samples: int = setting(
        "Max motion samples",
        "Set the most samples of the animation in a burst; fewer are taken where they are enough "
        "for the wavelength",
        4097,
        minimum=17,
        maximum=65_537,
    )
    visibility_updates: int = setting(
        "Visibility updates",
        "Set the renders per burst. More than one where visibility changes during a burst; echoes "
        "fade from one render to the next",
        1,
        minimum=1,
        maximum=1000,
        soft_maximum=16,
    )
    mirror_images: int = setting(
        "Mirror images",
        "Set the most images of the transmitter in planar mirrors (smooth Radar Materials), and in "
        "pairs of them; each is one more view. Mirrors count as reflections. 0: none",
        8,
        minimum=0,
        maximum=64,
        soft_maximum=16,
    )
    range_encoding: str = setting(
        "Range encoding",
        "Choose what carries the range encoding",
        "auto",
        choices=(
            ("auto", "Automatic", "By Radar Materials where everything has one, else by the world"),
            ("materials", "Materials", "Only objects with a Radar Material echo"),
            ("world", "World Volume", "Objects of any material echo"),
        ),
    )
    amplitude_channel: str = setting(
        "Amplitude channel",
        "Choose the channel that is the amplitude where materials are coloured",
        "mean",
        choices=(
            ("mean", "Mean", "Mean of red, green and blue"),
            ("R", "Red", "Red channel"),
            ("G", "Green", "Green channel"),
            ("B", "Blue", "Blue channel"),
        ),
    )

    def __post_init__(self) -> None:
        check_settings(self)
        if self.max_reflections > 64:
            raise ConfigError(
                f"Max reflections is {self.max_reflections}; expected at most 64 with paths."
            )
        if self.refines and self.replicates < 2 and self.refine_for != "objects":
            raise ConfigError(
                f"Replicates is 1, and refinement is for {self.refine_for!r}. One replicate gives "
                "no standard error of range bins. Use at least 2 replicates, or refine for "
                "'objects'."
            )

    @property
    def error_scope(self) -> str:
        """What the reported error is of; with one replicate, of objects alone."""
        return "objects" if self.replicates == 1 else self.refine_for

    @property
    def refines(self) -> bool:
        """Whether tiles are refined at all."""
        return self.max_standard_error > 0 or self.time_limit_s > 0
