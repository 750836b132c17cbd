# SPDX-License-Identifier: GPL-3.0-or-later
"""Registration of the settings with Blender."""

from __future__ import annotations

from typing import Any

import bpy

from ..materials import mirror_property
from ..materials.physical_materials import READY
from ..nodes import PRESETS
from ..scene import ACTIVE_RADAR_PROPERTY
from .material import MATERIAL_PROPERTY, MaterialSettings
from .radar import (
    EIRP_PROPERTY,
    RADAR_PROPERTY,
    TEXT_CONTEXT,
    AntennaGroup,
    RadarGroup,
    active_radar_property,
    eirp_property,
)

PROGRESS_PROPERTY = "radarsim"
MIRROR_PROPERTY = "radarsim_mirror_images"


class MaterialSuggestion(bpy.types.PropertyGroup):
    """An optical material, and the radar material that replaces it."""

    material: bpy.props.StringProperty(name="Material", description="Optical material of the scene")
    ready: bpy.props.EnumProperty(
        name="Radar material",
        items=(
            ("KEEP", "Leave as it is", "Its echoes have the powers of the optical material"),
            *((name, name, asset.description) for name, asset in READY.items()),
        ),
        description="Choose the radar material in its place",
    )


class RadarProgress(bpy.types.PropertyGroup):
    """State of the tab that is not saved: the running job, and the chosen preset."""

    preset: bpy.props.EnumProperty(
        name="Preset",
        items=tuple((name, preset.label, preset.description) for name, preset in PRESETS.items()),
        options={"SKIP_SAVE"},
        description="Choose the material for the selected objects",
    )

    suggestions: bpy.props.CollectionProperty(
        type=MaterialSuggestion,
        options={"SKIP_SAVE"},
        description="Optical materials of the scene with radar materials for them",
    )
    suggestion: bpy.props.IntProperty(
        name="Suggestion", options={"SKIP_SAVE"}, description="Row of the list of suggestions"
    )
    seconds_per_ray: bpy.props.FloatProperty(
        name="Time per Ray",
        default=5e-6,
        min=0.0,
        options={"SKIP_SAVE"},
        description="Time per ray and reflection of the last run with paths [s]",
    )
    overlay_view: bpy.props.BoolProperty(
        name="Field of View",
        translation_context=TEXT_CONTEXT,
        default=True,
        options={"SKIP_SAVE"},
        description="Draw the edges of the receiver's view up to the range limit",
    )
    overlay_beams: bpy.props.BoolProperty(
        name="Beams at -3 dB",
        options={"SKIP_SAVE"},
        description="Draw where the gain of each antenna is half of its peak, one way",
    )
    overlay_elements: bpy.props.BoolProperty(
        name="Array Elements",
        default=True,
        options={"SKIP_SAVE"},
        description="Draw the elements of an array as squares, the virtual ones as crosses",
    )
    overlay_rings: bpy.props.BoolProperty(
        name="Range Rings",
        options={"SKIP_SAVE"},
        description="Draw arcs of constant range with labels, in the plane of the receiver's X",
    )
    overlay_unambiguous: bpy.props.BoolProperty(
        name="Unambiguous Range",
        options={"SKIP_SAVE"},
        description="Draw the arc beyond which echoes fold or are filtered off",
    )
    overlay_velocities: bpy.props.BoolProperty(
        name="Velocities",
        options={"SKIP_SAVE"},
        description="Draw how far what F-curves move goes in a second, with its speed [m/s]",
    )
    overlay_cell: bpy.props.BoolProperty(
        name="Cell at Cursor",
        options={"SKIP_SAVE"},
        description="Draw the range cell around the 3D cursor [m], with its velocity cell [m/s]",
    )
    overlay_paths: bpy.props.BoolProperty(
        name="Paths of Target",
        default=True,
        options={"SKIP_SAVE"},
        description="Draw the strongest paths of the target that is chosen in Results",
    )
    checked: bpy.props.StringProperty(
        name="Checked", options={"SKIP_SAVE"}, description="Findings of the last check, as JSON"
    )
    running: bpy.props.BoolProperty(
        name="Running", default=False, options={"SKIP_SAVE"}, description="A job is running"
    )
    fraction: bpy.props.FloatProperty(
        name="Progress",
        min=0.0,
        max=1.0,
        options={"SKIP_SAVE"},
        description="Share of the job that is done",
    )
    text: bpy.props.StringProperty(
        name="Status", options={"SKIP_SAVE"}, description="State of the last job"
    )
    findings: bpy.props.StringProperty(
        name="Findings", options={"SKIP_SAVE"}, description="Findings of the last run, as JSON"
    )
    processed: bpy.props.StringProperty(
        name="Processing Findings",
        options={"SKIP_SAVE"},
        description="Findings of the last processing, as JSON",
    )


#: Property groups within those.
_PARTS = (AntennaGroup, MaterialSuggestion)
#: Property groups by the Blender type that they hang on.
_GROUPS: tuple[tuple[Any, Any, str, str], ...] = (
    (RadarGroup, bpy.types.Object, RADAR_PROPERTY, "Radar"),
    (RadarProgress, bpy.types.WindowManager, PROGRESS_PROPERTY, "Radar progress"),
    (MaterialSettings, bpy.types.Material, MATERIAL_PROPERTY, "Radar material"),
)


def register() -> None:
    """Add ``radarsim`` to objects, materials, window manager; a second call changes nothing."""
    if AntennaGroup.is_registered:
        return
    for part in _PARTS:
        bpy.utils.register_class(part)
    for group, owner, name, label in _GROUPS:
        bpy.utils.register_class(group)
        setattr(owner, name, bpy.props.PointerProperty(type=group, name=label))
    setattr(bpy.types.Scene, ACTIVE_RADAR_PROPERTY, active_radar_property())
    setattr(bpy.types.Object, MIRROR_PROPERTY, mirror_property())
    setattr(bpy.types.Light, EIRP_PROPERTY, eirp_property())


def unregister() -> None:
    """Remove them; a second call changes nothing."""
    if not AntennaGroup.is_registered:
        return
    delattr(bpy.types.Scene, ACTIVE_RADAR_PROPERTY)
    delattr(bpy.types.Light, EIRP_PROPERTY)
    delattr(bpy.types.Object, MIRROR_PROPERTY)
    for group, owner, name, _ in reversed(_GROUPS):
        delattr(owner, name)
        bpy.utils.unregister_class(group)
    for part in reversed(_PARTS):
        bpy.utils.unregister_class(part)
