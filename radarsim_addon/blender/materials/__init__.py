# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of objects, and their properties at the carrier.

In: Blender's materials and the carrier [Hz]. Out: node inputs, layers, surface roughness [m].
"""

from .assignments import (
    SURFACE_TYPES,
    MaterialAssignment,
    assigned_materials,
    foreign_objects,
    has_no_faces,
    slot_materials,
)
from .averaging import average_in_a_row, averaging_objects, separate_averages
from .clutter import (
    clutter_key,
    clutter_name,
    clutter_of,
    set_clutter,
    table_files,
)
from .clutter_fluctuation import fluctuation_of, set_clutter_fluctuation
from .clutter_tables import set_clutter_tables
from .convex_bodies import convex_objects
from .inside_walls import found_inside, overlapping_shells
from .interior_rounding import Interiors, settle_interiors_far_away
from .interiors import settle_interiors
from .layers import beyond_float32, delays, interior_losses_db, is_entered, set_layer_normals
from .material_limits import media_beyond_their_band
from .mirror_marks import (
    mirror_choice,
    mirror_property,
    set_mirror,
    set_mirrors,
)
from .mirrors import (
    LOBE_EXPONENT,
    glint_slope,
    ground_mirror,
    is_mirror_like,
    lobe_width,
    mirror_of,
    reciprocal_lobe,
)
from .pane_sides import doubled_panes
from .physical_materials import (
    EXACT_FACETS,
    has_rough_facets,
    is_physical,
    make_physical_material,
    refresh_materials,
    surface_of,
    update_materials,
)
from .scattered_lobe import ScatteredLobe, scattered_lobe_of, set_scattered_lobe
from .surface_roughness import is_rough, roughness_of
from .total_reflection import total_reflections
from .unrefracted import straight_interiors
from .wall_modifier import sharpen_edges

__all__ = [
    "EXACT_FACETS",
    "LOBE_EXPONENT",
    "SURFACE_TYPES",
    "Interiors",
    "MaterialAssignment",
    "ScatteredLobe",
    "assigned_materials",
    "average_in_a_row",
    "averaging_objects",
    "beyond_float32",
    "clutter_key",
    "clutter_name",
    "clutter_of",
    "convex_objects",
    "delays",
    "doubled_panes",
    "fluctuation_of",
    "foreign_objects",
    "found_inside",
    "glint_slope",
    "ground_mirror",
    "has_no_faces",
    "has_rough_facets",
    "interior_losses_db",
    "is_entered",
    "is_mirror_like",
    "is_physical",
    "is_rough",
    "lobe_width",
    "make_physical_material",
    "media_beyond_their_band",
    "mirror_choice",
    "mirror_of",
    "mirror_property",
    "overlapping_shells",
    "reciprocal_lobe",
    "refresh_materials",
    "roughness_of",
    "scattered_lobe_of",
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
    "surface_of",
    "table_files",
    "total_reflections",
    "update_materials",
]
