# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of objects, and their properties at the carrier.

A material has one of the node groups of the room `nodes`. `physical_materials` reads a medium of
the library and a rough surface from its custom properties and sets the group's inputs at the
carrier; `clutter` and `scattered_lobe` add models of sigma0 and directive lobes, whose tables the
group reads; `mirrors` tells what a smooth surface reflects. For interiors, `layers` stores
normals and thicknesses of walls for the shaders, `interiors` chooses whether
the volume or the faces absorb and delay, and `total_reflection` names what straight rays through
interiors get wrong.
"""

from .clutter import (
    clutter_name,
    clutter_of,
    fluctuation_of,
    set_clutter,
    set_clutter_fluctuation,
    table_files,
)
from .interiors import (
    Interiors,
    found_inside,
    overlapping_shells,
    settle_interiors,
    settle_interiors_far_away,
)
from .layers import (
    beyond_float32,
    convex_objects,
    doubled_panes,
    interior_losses_db,
    set_layer_normals,
    sharpen_edges,
)
from .mirrors import (
    ground_mirror,
    mirror_choice,
    mirror_property,
    set_mirror,
    set_mirrors,
)
from .physical_materials import (
    EXACT_FACETS,
    SURFACE_TYPES,
    MaterialAssignment,
    assigned_materials,
    foreign_objects,
    has_no_faces,
    is_physical,
    make_physical_material,
    media_beyond_their_band,
    refresh_materials,
    roughness_of,
    slot_materials,
    update_materials,
)
from .scattered_lobe import set_clutter_tables, set_scattered_lobe
from .surfaces import LOBE_EXPONENT, read_surface, surface_at, surfaces_of
from .total_reflection import (
    average_in_a_row,
    averaging_objects,
    separate_averages,
    straight_interiors,
    total_reflections,
)

__all__ = [
    "EXACT_FACETS",
    "LOBE_EXPONENT",
    "SURFACE_TYPES",
    "Interiors",
    "MaterialAssignment",
    "assigned_materials",
    "average_in_a_row",
    "averaging_objects",
    "beyond_float32",
    "clutter_name",
    "clutter_of",
    "convex_objects",
    "doubled_panes",
    "fluctuation_of",
    "foreign_objects",
    "found_inside",
    "ground_mirror",
    "has_no_faces",
    "interior_losses_db",
    "is_physical",
    "make_physical_material",
    "media_beyond_their_band",
    "mirror_choice",
    "mirror_property",
    "overlapping_shells",
    "read_surface",
    "refresh_materials",
    "roughness_of",
    "separate_averages",
    "set_clutter",
    "set_clutter_fluctuation",
    "set_clutter_tables",
    "set_layer_normals",
    "set_mirror",
    "set_mirrors",
    "set_scattered_lobe",
    "settle_interiors",
    "settle_interiors_far_away",
    "sharpen_edges",
    "slot_materials",
    "straight_interiors",
    "surface_at",
    "surfaces_of",
    "table_files",
    "total_reflections",
    "update_materials",
]
