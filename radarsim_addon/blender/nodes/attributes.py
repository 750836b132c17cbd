# SPDX-License-Identifier: GPL-3.0-or-later
"""Scene attributes that drive the node groups during a measurement.

Read in shaders by Attribute nodes of type View Layer, written as custom properties of the scene:
changing one costs Cycles no re-sync of geometry. Absent (0) outside a measurement. Pure standard
library.
"""

ATTR_INVERSE_CODE_LENGTH = "radarsim_inverse_code_length"
"""1/k, per Blender unit."""
ATTR_RING_MIN = "radarsim_ring_min"
"""Near edge of the ring, Blender units (inclusive)."""
ATTR_RING_MAX = "radarsim_ring_max"
"""Far edge of the ring, Blender units (exclusive). 0 means: no gate."""
ATTR_EXTINCTION_LENGTH = "radarsim_extinction_length"
"""Normalising length of the extinction coefficient, Blender units. 0 means: one Blender unit."""

ATTR_WAVELENGTH = "radarsim_wavelength"
"""Vacuum wavelength at the carrier, Blender units, for materials of physical inputs. 0 means: one
Blender unit."""
ATTR_POLARISATION = "radarsim_polarisation"
"""Of waves that pass through walls: 0 mean of both, 1 vertical, 2 horizontal (of world Z)."""
ATTR_FACET_FRESNEL = "radarsim_facet_fresnel"
"""1: rough physical materials evaluate Fresnel's equations at each facet, which Cycles does from
Blender 5.0 on. 0: at normal incidence on the facet, which is what a radar sees straight back."""
OBJECT_LAYER_NORMAL = "radarsim_layer_normal"
"""Custom property of an object, three numbers: normal of its plane-parallel faces in object space,
for absorption and delay at an angle. Absent: those of normal incidence whatever the angle."""
OBJECT_LAYER_THICKNESS = "radarsim_layer_thickness"
"""Custom property of an object: distance between these faces, in the object's own units. It tells
which rays began inside, so that echoes between the faces keep their polarisation."""

# Gates of the acquisition "paths" (absent: no gate). Half-integers, so that no comparison in a
# shader depends on rounding.
ATTR_ORDER_MIN = "radarsim_order_min"
"""Fewest reflections of a path that the emitter lights, minus 1/2."""
ATTR_ORDER_MAX = "radarsim_order_max"
"""Most reflections, plus 1/2. 0 means: no limit."""
ATTR_DEPTH_MIN = "radarsim_depth_min"
"""Fewest transparent surfaces passed on the camera's side, plus 1/2."""
ATTR_DEPTH_MAX = "radarsim_depth_max"
"""Most transparent surfaces passed, plus 3/2. 0 means: no limit."""
ATTR_SURFACE_DEPTH = "radarsim_surface_depth"
"""Transparent surfaces that camera rays pass without choosing a lobe, plus 1/2. 0 means: none."""
ATTR_SURFACE_STOP = "radarsim_surface_stop"
"""Transparent surfaces after which camera rays end at a Radar Material, plus 1/2. 0: they go on."""
ATTR_VERTEX_SCALE = "radarsim_vertex_scale"
"""The emitter multiplies its colour by 1 + scale * (last vertex - origin), per axis. 0: no."""
ATTR_VERTEX_ORIGIN = "radarsim_vertex_origin"
"""Origin of the above, Blender units, three components."""
ATTR_WORLD_CODE = "radarsim_world_code"
"""1/k of the world volume, where it carries the code for materials of any kind, for the interior of
Radar Materials to add its delay. 0: materials carry the code."""
