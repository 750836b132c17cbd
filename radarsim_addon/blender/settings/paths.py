# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's settings of the acquisition "paths", part of ``scene.radarsim``."""

from __future__ import annotations

from typing import Any

import bpy

from ..plan import PathOptions, shortest_decimal


class PathSettings:
    """Mixed into `properties.RadarSettings`."""

    sampling_mode: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Acquisition",
        items=(
            ("RINGS", "Rings", "The paper's: shells of range, all paths of a shell in a pixel"),
            (
                "PATHS",
                "Paths",
                "One path per pixel: exact ranges, any material, standard error reported",
            ),
        ),
        default="PATHS",
        description="How the scene is measured",
    )
    path_order: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Reflections",
        default=1,
        min=1,
        soft_max=4,
        max=64,
        description="Most reflections of a path. Power in more is reported as a share",
    )
    path_replicates: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Shifts",
        default=4,
        min=1,
        soft_max=64,
        max=10_000,
        description="Sub-pixel shifts of each tile: replicates, from which the error is estimated",
    )
    path_error_percent: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Error target [%]",
        default=0.0,
        min=0.0,
        max=1000.0,
        precision=2,
        description="Refine tiles until the relative standard error (over range bins and objects) "
        "is below this. 0: no refinement by error",
    )
    path_refine_by: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Error of",
        items=(
            ("both", "Both", "Half from range bins, half from objects"),
            ("ranges", "Ranges", "Range bins, weighed by the root of their power"),
            ("objects", "Objects", "The power of each object, all alike: small targets"),
        ),
        description="What the error target is for",
    )
    path_budget_s: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Time budget [s]",
        default=0.0,
        min=0.0,
        precision=1,
        description="Stop refining a frame after this time. 0: no limit",
    )
    path_motion: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Motion",
        items=(
            ("kinematic", "Kinematic", "Every path's length at every pulse, from what it touches"),
            ("off", "Off", "All stands still during a burst"),
        ),
        description="How paths move during a burst",
    )
    path_motion_samples: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Motion samples",
        default=4097,
        min=17,
        max=65_537,
        description="Most moments of a burst at which the animation is looked at; fewer are taken "
        "where they are enough for the wavelength",
    )
    path_visibility_updates: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Renders per burst",
        default=1,
        min=1,
        soft_max=16,
        max=1000,
        description="More than one where what is visible changes during a burst; echoes fade from "
        "one render to the next",
    )
    path_code: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Range code",
        items=(
            ("auto", "Automatic", "By Radar Materials where everything has one, else by the world"),
            ("materials", "Materials", "Only objects with a Radar Material echo"),
            ("world", "World volume", "Objects of any material echo"),
        ),
        description="What carries the range code",
    )
    path_amplitude: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Amplitude",
        items=(
            ("mean", "Mean", "Mean of red, green and blue"),
            ("R", "Red", "Red channel"),
            ("G", "Green", "Green channel"),
            ("B", "Blue", "Blue channel"),
        ),
        description="Which channel is the amplitude where materials are coloured",
    )


def read_path_options(settings: Any, **overrides: Any) -> PathOptions:
    """The settings as `PathOptions`.

    Parameters
    ----------
    settings : PathSettings
    **overrides
        Numbers from a command line, by the fields of `PathOptions`. None: the scene's own.

    Raises
    ------
    ConfigError
        Numbers that do not fit together.
    """
    values: dict[str, Any] = {
        "max_reflections": int(settings.path_order),
        "replicates": int(settings.path_replicates),
        "max_standard_error": shortest_decimal(settings.path_error_percent) / 100,
        "refine_for": settings.path_refine_by,
        "time_limit_s": shortest_decimal(settings.path_budget_s),
        "motion": settings.path_motion,
        "motion_samples": int(settings.path_motion_samples),
        "visibility_updates": int(settings.path_visibility_updates),
        "range_encoding": settings.path_code,
        "amplitude_channel": settings.path_amplitude,
    }
    values.update({name: value for name, value in overrides.items() if value is not None})
    return PathOptions(**values)
