# SPDX-License-Identifier: GPL-3.0-or-later
"""Scene attributes that drive the node groups during a measurement.

Shaders read them by Attribute nodes of type View Layer; radarsim writes them as custom properties
of the scene. A change of one does not make Cycles synchronise geometry again. They are absent (0)
outside a measurement. Uses the standard library only.
"""

ATTR_INVERSE_CODE_LENGTH = "radarsim_inverse_code_length"
"""1/k, per Blender unit."""
ATTR_RING_MIN = "radarsim_ring_min"
"""Near edge of the ring, Blender units, inclusive."""
ATTR_RING_MAX = "radarsim_ring_max"
"""Far edge of the ring, Blender units, exclusive. 0: paths of all ranges."""
ATTR_EXTINCTION_LENGTH = "radarsim_extinction_length"
"""Normalising length of the extinction coefficient, Blender units. 0: one Blender unit."""

ATTR_WAVELENGTH = "radarsim_wavelength"
"""Wavelength in vacuum at the carrier, Blender units, for physical materials. 0: one Blender
unit."""
ATTR_POLARISATION = "radarsim_polarisation"
"""Polarisation relative to world Z: 0 mean of both, 1 vertical, 2 horizontal."""
ATTR_BY_POLARISATION = "radarsim_by_polarisation"
"""1: the channels carry the two polarisations through all faces that a path of one reflection
passes: red p on both ways, green s on the way from the receiver, blue s on that to the transmitter.
0: each face takes the mean of both."""
ATTR_FACET_FRESNEL = "radarsim_facet_fresnel"
"""1: rough physical materials evaluate Fresnel's equations at each facet, which Cycles does from
Blender 5.0 on. 0: at normal incidence on the facet, which is exact in backscatter."""
OBJECT_LAYER_NORMAL = "radarsim_layer_normal"
"""Custom property of an object, three numbers: normal of its plane-parallel faces in object space,
for absorption and delay at an angle. Absent: those of normal incidence at all angles."""
OBJECT_LAYER_THICKNESS = "radarsim_layer_thickness"
"""Custom property of an object: distance between these faces, in the object's own units. Shaders
use it to find rays that began inside, so that echoes between the faces keep their polarisation."""

OBJECT_LAYER_AT_FACES = "radarsim_layer_at_faces"
"""Custom property of an object with layer normal and thickness, three numbers: 1, the place of the
layer's middle along the normal in the object's own units, 0. Its faces absorb and delay, each for
half of the layer, in place of the volume, whose depths Cycles rounds. Absent: the volume does."""

OBJECT_SHELL_THICKNESS = "radarsim_shell_thickness"
"""Custom property of an object that consists of walls in any directions: their thickness, in the
object's own units. Each face absorbs and delays for half of the wall behind it, at its own angle,
in place of the volume. 0 or absent: none."""
FACE_WALL_THICKNESS = "radarsim_wall_thickness"
"""Attribute of the faces of such an object: the thickness of the wall behind each, in the object's
own units. 0 or absent: that of the object."""

# Path class of a render in the sampling mode "paths" (absent: all paths). Half-integers, so that no
# comparison in a shader depends on rounding.
ATTR_ORDER_MIN = "radarsim_order_min"
"""Minimum number of reflections, minus 1/2."""
ATTR_ORDER_MAX = "radarsim_order_max"
"""Maximum number of reflections, plus 1/2. 0: no limit."""
ATTR_SECOND_ORDER_MIN = "radarsim_second_order_min"
ATTR_SECOND_ORDER_MAX = "radarsim_second_order_max"
"""The same of the second view of a render."""
ATTR_FIRST_VIEW_RIGHT = "radarsim_first_view_right"
"""Which way is right in the first view, a unit vector in the world. The second is upside down, so
that it is left there."""
ATTR_DEPTH_MIN = "radarsim_depth_min"
"""Minimum number of transparent surfaces that camera rays pass, plus 1/2."""
ATTR_DEPTH_MAX = "radarsim_depth_max"
"""Maximum number of transparent surfaces that camera rays pass, plus 3/2. 0: no limit."""
ATTR_SURFACE_DEPTH = "radarsim_surface_depth"
"""Transparent surfaces that camera rays pass without a choice of lobe, plus 1/2. 0: none."""
ATTR_SURFACE_STOP = "radarsim_surface_stop"
"""Transparent surfaces after which camera rays end at a Radar Material, plus 1/2. 0: none end."""
ATTR_VERTEX_SCALE = "radarsim_vertex_scale"
"""The transmitter's colour is multiplied by 1 + scale * (last vertex - origin), per axis."""
ATTR_VERTEX_ORIGIN = "radarsim_vertex_origin"
"""Origin for `ATTR_VERTEX_SCALE`, Blender units, three components."""
ATTR_MARK_ORDER = "radarsim_mark_order"
"""Reflections before the surface that shines as the last vertex of a path: `VertexMark`. 0: none
does."""
ATTR_MARK_DEPTH = "radarsim_mark_depth"
"""Transparent surfaces that camera rays pass before that surface, plus 1."""
ATTR_MARK_SCALE = "radarsim_mark_scale"
"""`ATTR_VERTEX_SCALE` for the light of that surface instead of the transmitter's. 0: white."""
ATTR_WORLD_CODE = "radarsim_world_code"
"""1/k of a world volume that encodes the range for all materials, for the delay inside Radar
Materials. 0: the materials encode the range."""
