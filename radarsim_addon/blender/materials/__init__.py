# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials of objects, and their properties at the carrier.

In: Blender's materials and the carrier [Hz]. Out: node inputs, layers, surface roughness [m].
"""

from .assignments import SURFACE_TYPES, MaterialAssignment, assigned_materials, slot_materials
from .interiors import settle_interiors
from .layers import beyond_float32, is_entered, passes_by_polarisation, set_layer_normals
from .material_limits import media_beyond_their_band
from .physical_materials import (
    EXACT_FACETS,
    has_rough_facets,
    is_physical,
    make_physical_material,
    refresh_materials,
    update_materials,
)
from .surface_roughness import is_rough, roughness_of
from .total_reflection import total_reflections

__all__ = [
    "EXACT_FACETS",
    "SURFACE_TYPES",
    "MaterialAssignment",
    "assigned_materials",
    "beyond_float32",
    "has_rough_facets",
    "is_entered",
    "is_physical",
    "is_rough",
    "make_physical_material",
    "media_beyond_their_band",
    "passes_by_polarisation",
    "refresh_materials",
    "roughness_of",
    "set_layer_normals",
    "settle_interiors",
    "slot_materials",
    "total_reflections",
    "update_materials",
]
