# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scene holds: radar rig, instances, visibility, projections, checks, ground truth.

In: the evaluated scene in Blender units. Out: records in metres.
"""

from .closing_speeds import (
    VELOCITY_FRAMES,
    ClosingSpeeds,
    keyed_move,
    keyed_speeds,
    keyed_step,
    nothing_moves,
)
from .driver_checks import (
    disabled_drivers,
    driven_by_whole_frames,
    looks_at_view,
    may_move_at_whole_frames,
    moved_by_scripts,
    reads_context,
)
from .finite_checks import check_poses, check_vertices
from .ground_truth import displaced_surfaces, echoing_boxes, scene_extent
from .instance_poses import (
    InstancePose,
    Poses,
    distance_from_box,
    evaluated_poses,
    instance_name,
    pose_in_metres,
)
from .isolation import action_curves, animation_curves, echoes, isolate
from .mesh_checks import check_meshes
from .no_echo import no_echo_findings
from .optical_materials import replace_material, suggest_materials
from .pattern_mesh import PATTERN_PROPERTY, draw_patterns, remove_patterns
from .pixel_spans import PixelSpans, measure_pixel_spans
from .poses import receiver_record, rigid_pose, transmitter_record
from .projections import NEAR_CLIP_UNITS, aim, camera_kind, frame_edges
from .radar_ground import GroundBelow, ground_below
from .rig import (
    ACTIVE_RADAR_PROPERTY,
    Rig,
    active_radar,
    antennas_of,
    check_scale,
    find_rig,
    is_transmitter,
    radar_of,
    radars,
    setup_rig,
)
from .scene_files import file_identity, foreign_handlers, unreadable_files
from .simulations import (
    check_particles_are_baked,
    has_simulation_zone,
    is_simulated_body,
    renders_whole_frames_only,
    simulation_frames,
)
from .smooth_shading import check_normals, sharpen_walls
from .visibility import (
    hiding_is_animated,
    is_hidden_at_times,
    limited_visibility,
    show_as_rendered,
    show_what_ever_renders,
    show_what_renders,
)

__all__ = [
    "ACTIVE_RADAR_PROPERTY",
    "NEAR_CLIP_UNITS",
    "PATTERN_PROPERTY",
    "VELOCITY_FRAMES",
    "ClosingSpeeds",
    "GroundBelow",
    "InstancePose",
    "PixelSpans",
    "Poses",
    "Rig",
    "action_curves",
    "active_radar",
    "aim",
    "animation_curves",
    "antennas_of",
    "camera_kind",
    "check_meshes",
    "check_normals",
    "check_particles_are_baked",
    "check_poses",
    "check_scale",
    "check_vertices",
    "disabled_drivers",
    "displaced_surfaces",
    "distance_from_box",
    "draw_patterns",
    "driven_by_whole_frames",
    "echoes",
    "echoing_boxes",
    "evaluated_poses",
    "file_identity",
    "find_rig",
    "foreign_handlers",
    "frame_edges",
    "ground_below",
    "has_simulation_zone",
    "hiding_is_animated",
    "instance_name",
    "is_hidden_at_times",
    "is_simulated_body",
    "is_transmitter",
    "isolate",
    "keyed_move",
    "keyed_speeds",
    "keyed_step",
    "limited_visibility",
    "looks_at_view",
    "may_move_at_whole_frames",
    "measure_pixel_spans",
    "moved_by_scripts",
    "no_echo_findings",
    "nothing_moves",
    "pose_in_metres",
    "radar_of",
    "radars",
    "reads_context",
    "receiver_record",
    "remove_patterns",
    "renders_whole_frames_only",
    "replace_material",
    "rigid_pose",
    "scene_extent",
    "setup_rig",
    "sharpen_walls",
    "show_as_rendered",
    "show_what_ever_renders",
    "show_what_renders",
    "simulation_frames",
    "suggest_materials",
    "transmitter_record",
    "unreadable_files",
]
