# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes of a scene between two measurements: each builds a scene, yields, then changes it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import bpy
import numpy as np

from radarsim_addon.blender import nodes
from radarsim_addon.blender.materials import set_clutter, set_clutter_fluctuation
from radarsim_addon.blender.scene.visibility import animation_curves
from tests.blender import motion_helpers as mh
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.slab_scene import physical_material

Case = Callable[[], Iterator[None]]
#: By name; the test measures each.
CASES: dict[str, Case] = {}


def case(function: Case) -> Case:
    CASES[function.__name__] = function
    return function


def simple(name: str, build: Callable[[], Any], change: Callable[[Any], Any]) -> None:
    """A case that changes what `build` returns."""

    def steps() -> Iterator[None]:
        made = build()
        yield
        change(made)

    CASES[name] = steps


def to(path: str, value: Any) -> Callable[[Any], None]:
    """A change of one property, by its path with numbers of items."""

    def change(item: Any) -> None:
        *first, last = path.split(".")
        for part in first:
            item = item[int(part)] if part.isdigit() else getattr(item, part)
        setattr(item, last, value)

    return change


# -- parts of scenes -------------------------------------------------------------------------------


def plate(size: float = 4.0, y: float = 10.0) -> Any:
    return ph.plate_at(y, size, ph.rough_metal())


def ball(material: Any = None) -> Any:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=12, ring_count=8, location=(0, 8, 0), radius=1.5)
    found = bpy.context.object
    found.data.materials.append(material or ph.rough_metal())
    return found


def grid(divisions: int = 3) -> Any:
    """A plate of small faces, in the plane of the wave front."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=divisions, y_subdivisions=divisions, size=3)
    found = bpy.context.object
    found.location, found.rotation_euler = (0, 8, 0), (math.radians(90), 0, 0)
    found.data.materials.append(ph.rough_metal())
    return found


def painted(item: Any = None) -> tuple[Any, Any, Callable[[Any], Any]]:
    """An object of a diffuse material; its node tree, and a function that sets the colour."""
    material = ph.lambert(0.5, "Paint")
    tree = material.node_tree
    diffuse = next(one for one in tree.nodes if one.bl_idname == "ShaderNodeBsdfDiffuse")
    item = item or grid()
    item.data.materials.clear()
    item.data.materials.append(material)
    return item, tree, lambda socket: tree.links.new(socket, diffuse.inputs["Color"])


def node(tree: Any, kind: str, **values: Any) -> Any:
    """A shader node with values of its properties."""
    made = tree.nodes.new(f"ShaderNode{kind}")
    for name, value in values.items():
        setattr(made, name, value)
    return made


def group(tree: Any, inner: Any, kind: str = "ShaderNodeTree", value: float = 0.3) -> Any:
    """A node group with one output, "Value", which `inner` or a Value node gives."""
    made = bpy.data.node_groups.new("Inner", kind)
    made.interface.new_socket("Value", in_out="OUTPUT", socket_type="NodeSocketFloat")
    source = node(made, "Value") if inner is None else node(made, "Group", node_tree=inner)
    if inner is None:
        source.outputs[0].default_value = value
    made.links.new(source.outputs[0], made.nodes.new("NodeGroupOutput").inputs[0])
    return made


def picture(value: float) -> Any:
    image = bpy.data.images.new("Picture", 4, 4, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(np.full(64, value, np.float32))
    image.update()
    return image


def radar_part(kind: str) -> Any:
    return next(one for one in bpy.data.objects if one.type == kind)


def link(item: Any) -> Any:
    bpy.context.scene.collection.objects.link(item)
    return item


def empty(location: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
    return mh.empty("Empty", location)


def modifier(item: Any, kind: str, **values: Any) -> Any:
    made = item.modifiers.new(kind, kind)
    for name, value in values.items():
        setattr(made, name, value)
    return made


def keyed(item: Any) -> Any:
    """An object that moves along y."""
    mh.key(item, "location", (1, (0, 8, 0)), (11, (0, 12, 0)))
    return item


def curve_of(item: Any) -> Any:
    return next(one for one in animation_curves(item.animation_data) if one.array_index == 1)


# -- faces, visibility -----------------------------------------------------------------------------


@case
def material_index_of_faces() -> Iterator[None]:
    item = grid()
    item.data.materials.append(nodes.make_material("Dull", 2.0, 0.5, 0.0, 0.5, penetrable=False))
    yield
    for face in item.data.polygons:
        face.material_index = 1


@case
def material_index_of_faces_in_bulk() -> Iterator[None]:
    item = grid()
    item.data.materials.append(nodes.make_material("Dull", 2.0, 0.5, 0.0, 0.5, penetrable=False))
    yield
    item.data.polygons.foreach_set("material_index", [1] * len(item.data.polygons))


simple("smooth_faces", ball, lambda item: item.data.shade_smooth())


@case
def flat_faces_in_bulk() -> Iterator[None]:
    item = ball()
    item.data.shade_smooth()
    yield
    item.data.polygons.foreach_set("use_smooth", [False] * len(item.data.polygons))


@case
def sharp_edges() -> Iterator[None]:
    item = ball()
    item.data.shade_smooth()
    yield
    for edge in item.data.edges:
        edge.use_edge_sharp = True


@case
def custom_normals() -> Iterator[None]:
    item = ball()
    item.data.shade_smooth()
    yield
    item.data.normals_split_custom_set_from_vertices([(0, -1, 0)] * len(item.data.vertices))


@case
def vertices_in_bulk() -> Iterator[None]:
    item = grid()
    yield
    item.data.vertices.foreach_set("co", [1.0, 1.0, 1.0] * len(item.data.vertices))
    points = np.array([[x, y, 0.5 * x] for x in (-1, -0.5, 0.5, 1) for y in (-1, 0, 0.5, 1)])
    item.data.vertices.foreach_set("co", points[: len(item.data.vertices)].ravel())


@case
def another_mesh() -> Iterator[None]:
    item = grid()
    other = grid(2).data
    bpy.data.objects.remove(bpy.context.object)
    other.transform(((0.5, 0, 0, 0), (0, 0.5, 0, 0), (0, 0, 0.5, 0), (0, 0, 0, 1)))
    yield
    item.data = other


def visibility(name: str) -> None:
    def change() -> Iterator[None]:
        plate(12.0, 20.0)
        radar_part("LIGHT").location = (3, 0, 0)  # what shades the plate does not hide the shadow
        item = grid()
        yield
        setattr(item, name, not getattr(item, name))

    CASES[name] = change


for _name in ("visible_camera", "visible_shadow", "is_holdout", "hide_render"):
    visibility(_name)


@case
def visible_to_reflected_rays() -> Iterator[None]:
    ph.quad("Floor", [(-9, 1, -2), (9, 1, -2), (9, 30, -2), (-9, 30, -2)], ph.rough_metal())
    item = plate(8.0)
    yield
    item.visible_diffuse = False


def part() -> Any:
    """A grid before a plate, in a collection of its own."""
    item, made = grid(), bpy.data.collections.new("Part")
    plate(8.0, 15.0)
    bpy.context.scene.collection.children.link(made)
    made.objects.link(item)
    bpy.context.scene.collection.objects.unlink(item)
    return made


def layer_of_part() -> Any:
    part()
    return bpy.context.scene.view_layers[0].layer_collection.children["Part"]


simple("collection_hidden_in_renders", part, to("hide_render", True))
for _name in ("exclude", "holdout", "indirect_only"):
    simple(f"layer_collection_{_name}", layer_of_part, to(_name, True))


# -- materials -------------------------------------------------------------------------------------


@case
def material_in_the_slot() -> Iterator[None]:
    item = grid()
    yield
    item.data.materials[0] = nodes.make_material("Dull", 2.0, 0.5, 0.0, 0.5, penetrable=False)


@case
def slot_of_the_object() -> Iterator[None]:
    item = grid()
    yield
    item.material_slots[0].link = "OBJECT"
    item.material_slots[0].material = ph.lambert(0.2)


def radar_input(name: str, value: float) -> None:
    def change() -> Iterator[None]:
        item = ball(nodes.make_material("Stone", 2.0, 0.3, 0.4, 0.5, penetrable=False))
        tree = item.data.materials[0].node_tree
        used = next(one for one in tree.nodes if one.bl_idname == "ShaderNodeGroup")
        yield
        used.inputs[name].default_value = value

    CASES[f"radar_material_{name}"] = change


for _name, _value in (("Roughness", 0.9), ("Index of Refraction", 4.0)):
    radar_input(_name, _value)


@case
def clutter_parameter() -> Iterator[None]:
    material = physical_material(2.3, 0.01)
    ph.quad("Floor", [(-9, 5, -2), (9, 5, -2), (9, 30, -2), (-9, 30, -2)], material)
    set_clutter(material, "constant_gamma", gamma_db=-10.0)
    yield
    set_clutter(material, "constant_gamma", gamma_db=-20.0)


@case
def clutter_fluctuation() -> Iterator[None]:
    material = physical_material(2.3, 0.01)
    ph.quad("Floor", [(-9, 5, -2), (9, 5, -2), (9, 30, -2), (-9, 30, -2)], material)
    set_clutter(material, "constant_gamma", gamma_db=-10.0)
    yield
    set_clutter_fluctuation(material, motion="gaussian", motion_speed_mps=1.0)


@case
def operation_of_a_math_node() -> Iterator[None]:
    _, tree, colour = painted()
    math_node = node(tree, "Math", operation="ADD")
    math_node.inputs[0].default_value, math_node.inputs[1].default_value = 0.3, 0.5
    colour(math_node.outputs[0])
    yield
    math_node.operation = "MULTIPLY"


@case
def clamp_of_a_math_node() -> Iterator[None]:
    _, tree, colour = painted()
    one = node(tree, "Math", operation="ADD")
    one.inputs[0].default_value, one.inputs[1].default_value = 1.0, 1.0
    two = node(tree, "Math", operation="MULTIPLY")
    tree.links.new(one.outputs[0], two.inputs[0])
    two.inputs[1].default_value = 0.4
    colour(two.outputs[0])
    yield
    one.use_clamp = True


@case
def value_of_a_node() -> Iterator[None]:
    _, tree, colour = painted()
    value = node(tree, "Value")
    value.outputs[0].default_value = 0.3
    colour(value.outputs[0])
    yield
    value.outputs[0].default_value = 0.6


@case
def blend_of_a_mix_node() -> Iterator[None]:
    _, tree, colour = painted()
    mixed = node(tree, "MixRGB", blend_type="MIX")
    mixed.inputs[0].default_value = 0.5
    mixed.inputs[1].default_value = mixed.inputs[2].default_value = ph.grey(0.4)
    colour(mixed.outputs[0])
    yield
    mixed.blend_type = "MULTIPLY"


def ramp() -> Any:
    _, tree, colour = painted()
    ramp_node = node(tree, "ValToRGB")
    ramp_node.inputs[0].default_value = 0.4
    colour(ramp_node.outputs[0])
    return ramp_node.color_ramp


simple("colour_ramp_colour", ramp, to("elements.1.color", (0.5, 0.5, 0.5, 1)))
simple("colour_ramp_interpolation", ramp, to("interpolation", "CONSTANT"))


@case
def curve_of_colours() -> Iterator[None]:
    _, tree, colour = painted()
    curves = node(tree, "RGBCurve")
    curves.inputs["Color"].default_value = ph.grey(0.5)
    colour(curves.outputs[0])
    yield
    for each in curves.mapping.curves:
        each.points[1].location = (1.0, 0.4)
    curves.mapping.update()


@case
def value_in_a_group() -> Iterator[None]:
    _, tree, colour = painted()
    inner = group(tree, None)
    colour(node(tree, "Group", node_tree=inner).outputs[0])
    yield
    inner.nodes["Value"].outputs[0].default_value = 0.7


@case
def value_in_a_nested_group() -> Iterator[None]:
    _, tree, colour = painted()
    inner = group(tree, None)
    colour(node(tree, "Group", node_tree=group(tree, group(tree, inner))).outputs[0])
    yield
    inner.nodes["Value"].outputs[0].default_value = 0.7


@case
def another_group() -> Iterator[None]:
    _, tree, colour = painted()
    used = node(tree, "Group", node_tree=group(tree, None))
    colour(used.outputs[0])
    other = group(tree, None, value=0.8)
    yield
    used.node_tree = other


def textured() -> tuple[Any, Any]:
    _, tree, colour = painted()
    texture = node(tree, "TexImage", image=picture(0.3))
    colour(texture.outputs[0])
    return tree, texture


@case
def pixels_of_an_image() -> Iterator[None]:
    _, texture = textured()
    yield
    texture.image.pixels.foreach_set(np.full(64, 0.8, np.float32))


@case
def projection_of_an_image() -> Iterator[None]:
    _, texture = textured()
    pixels = np.tile(np.array([0.1, 0.1, 0.1, 1, 0.8, 0.8, 0.8, 1], np.float32), 8)
    texture.image.pixels.foreach_set(pixels)
    texture.interpolation = "Linear"
    yield
    texture.interpolation = "Closest"


@case
def map_of_a_texture() -> Iterator[None]:
    _, texture = textured()
    pixels = np.repeat(np.array([0.1, 0.4, 0.6, 0.8], np.float32), 16)
    texture.image.pixels.foreach_set(pixels)
    mesh = next(one for one in bpy.data.meshes if one.uv_layers)
    yield
    for corner in mesh.uv_layers[0].data:
        corner.uv = 0.5 * corner.uv[0], 0.5 * corner.uv[1]


@case
def object_of_texture_coordinates() -> Iterator[None]:
    _, tree, colour = painted()
    place = empty()
    coordinates = node(tree, "TexCoord", object=place)
    noise = node(tree, "TexNoise")
    tree.links.new(coordinates.outputs["Object"], noise.inputs["Vector"])
    colour(noise.outputs[0])
    yield
    place.location.x = 3.0


@case
def custom_property_of_an_object() -> Iterator[None]:
    item, tree, colour = painted()
    item["albedo"] = 0.2
    colour(node(tree, "Attribute", attribute_type="OBJECT", attribute_name="albedo").outputs["Fac"])
    yield
    item["albedo"] = 0.7


@case
def custom_property_of_the_scene() -> Iterator[None]:
    _, tree, colour = painted()
    bpy.context.scene["albedo"] = 0.2
    read = node(tree, "Attribute", attribute_type="VIEW_LAYER", attribute_name="albedo")
    colour(read.outputs["Fac"])
    yield
    bpy.context.scene["albedo"] = 0.7


@case
def colour_of_an_object() -> Iterator[None]:
    item, tree, colour = painted()
    item.color = ph.grey(0.2)
    colour(node(tree, "ObjectInfo").outputs["Color"])
    yield
    item.color = ph.grey(0.7)


@case
def colours_of_vertices() -> Iterator[None]:
    item, tree, colour = painted()
    values = item.data.color_attributes.new("Shade", "FLOAT_COLOR", "POINT")
    values.data.foreach_set("color", [0.2, 0.2, 0.2, 1.0] * len(values.data))
    colour(node(tree, "VertexColor", layer_name="Shade").outputs[0])
    yield
    values.data.foreach_set("color", [0.7, 0.7, 0.7, 1.0] * len(values.data))


@case
def attribute_of_faces() -> Iterator[None]:
    item, tree, colour = painted()
    values = item.data.attributes.new("albedo", "FLOAT", "FACE")
    values.data.foreach_set("value", [0.2] * len(values.data))
    colour(node(tree, "Attribute", attribute_name="albedo").outputs["Fac"])
    yield
    values.data.foreach_set("value", [0.7] * len(values.data))


@case
def driver_of_a_node() -> Iterator[None]:
    _, tree, colour = painted()
    value = node(tree, "Value")
    colour(value.outputs[0])
    driven = value.outputs[0].driver_add("default_value")
    driven.driver.expression = "0.3"
    yield
    driven.driver.expression = "0.6"


@case
def key_of_a_node() -> Iterator[None]:
    _, tree, colour = painted()
    value = node(tree, "Value")
    colour(value.outputs[0])
    value.outputs[0].default_value = 0.3
    value.outputs[0].keyframe_insert("default_value", frame=1)
    yield
    (keys,) = animation_curves(tree.animation_data)
    keys.keyframe_points[0].co[1] = 0.7


# -- shape -----------------------------------------------------------------------------------------


for _kind, _name, _new, _given in (
    ("SOLIDIFY", "thickness", 1.0, {"thickness": 0.3}),
    ("ARRAY", "count", 3, {"count": 2, "relative_offset_displace": (0.5, 0, 0)}),
    ("SUBSURF", "render_levels", 2, {"levels": 0, "render_levels": 1}),
    ("DISPLACE", "strength", 0.9, {"strength": 0.3}),
    ("DISPLACE", "show_render", False, {"strength": 0.3}),
    ("DECIMATE", "ratio", 0.3, {"ratio": 0.8}),
    ("SIMPLE_DEFORM", "factor", 0.9, {"deform_method": "TAPER", "factor": 0.3}),
    ("BUILD", "frame_duration", 3.0, {"frame_start": 0.0, "frame_duration": 9.0}),
):
    _item = ball if _kind == "DECIMATE" else grid
    simple(
        f"modifier_{_kind.lower()}_{_name}",
        lambda item=_item, kind=_kind, given=_given: modifier(item(), kind, **given),
        to(_name, _new),
    )


@case
def order_of_modifiers() -> Iterator[None]:
    item = grid()
    modifier(item, "ARRAY", count=2)
    modifier(item, "SIMPLE_DEFORM", deform_method="TAPER", factor=0.8)
    yield
    item.modifiers.move(1, 0)


@case
def texture_of_a_displacement() -> Iterator[None]:
    item = grid(8)
    texture = bpy.data.textures.new("Rough", "CLOUDS")
    modifier(item, "DISPLACE", texture=texture, strength=1.0)
    yield
    texture.noise_scale = 1.0


@case
def weights_of_vertices() -> Iterator[None]:
    item = grid()
    weights = item.vertex_groups.new(name="Part")
    weights.add(range(len(item.data.vertices)), 0.2, "REPLACE")
    modifier(item, "DISPLACE", vertex_group="Part", strength=1.0)
    yield
    weights.add(range(len(item.data.vertices)), 0.9, "REPLACE")


@case
def cutter_of_a_boolean() -> Iterator[None]:
    item = ball()
    bpy.ops.mesh.primitive_cube_add(location=(0.5, 7, 0), size=2)
    cutter = bpy.context.object
    cutter.hide_render = True
    modifier(item, "BOOLEAN", operation="DIFFERENCE", object=cutter)
    yield
    cutter.location.x = -0.5


@case
def value_of_a_shape_key() -> Iterator[None]:
    item = grid()
    item.shape_key_add(name="Basis")
    deep = item.shape_key_add(name="Deep")
    for point in deep.data:
        point.co.z += 1.0
    deep.value = 0.2
    yield
    deep.value = 0.8


@case
def points_of_a_shape_key() -> Iterator[None]:
    item = grid()
    item.shape_key_add(name="Basis")
    deep = item.shape_key_add(name="Deep")
    deep.value = 1.0
    yield
    for point in deep.data:
        point.co.z += 1.0


@case
def points_of_a_lattice() -> Iterator[None]:
    item = grid()
    cage = link(bpy.data.objects.new("Cage", bpy.data.lattices.new("Cage")))
    cage.location, cage.scale = item.location, (4, 4, 4)
    modifier(item, "LATTICE", object=cage)
    yield
    for point in cage.data.points:
        point.co_deform[1] *= 0.5
        point.co_deform[0] += 0.1


@case
def pose_of_an_armature() -> Iterator[None]:
    item = grid()
    bpy.ops.object.armature_add(location=(0, 8, 0))
    rig = bpy.context.object
    weights = item.vertex_groups.new(name="Bone")
    weights.add(range(len(item.data.vertices)), 1.0, "REPLACE")
    modifier(item, "ARMATURE", object=rig)
    yield
    rig.pose.bones[0].location = (0.5, 0.3, 0.1)


@case
def hook() -> Iterator[None]:
    item, place = grid(), empty((0, 8, 0))
    modifier(item, "HOOK", object=place).vertex_indices_set(range(8))
    yield
    place.location.y = 7.0


def geometry_group() -> Any:
    """Geometry Nodes that move all points along z by an input."""
    made = bpy.data.node_groups.new("Shift", "GeometryNodeTree")
    made.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    made.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    given, out = made.nodes.new("NodeGroupInput"), made.nodes.new("NodeGroupOutput")
    shift = made.nodes.new("GeometryNodeSetPosition")
    vector = made.nodes.new("ShaderNodeCombineXYZ")
    made.links.new(given.outputs[0], shift.inputs["Geometry"])
    made.links.new(vector.outputs[0], shift.inputs["Offset"])
    made.links.new(shift.outputs[0], out.inputs[0])
    return made


@case
def value_in_geometry_nodes() -> Iterator[None]:
    used = geometry_group()
    modifier(grid(), "NODES", node_group=used)
    yield
    used.nodes["Combine XYZ"].inputs["Z"].default_value = 0.7


@case
def object_read_by_geometry_nodes() -> Iterator[None]:
    used, place = geometry_group(), empty()
    read = used.nodes.new("GeometryNodeObjectInfo")
    read.inputs["Object"].default_value = place
    used.links.new(read.outputs["Location"], used.nodes["Set Position"].inputs["Offset"])
    modifier(grid(), "NODES", node_group=used)
    yield
    place.location = (0.2, 0.1, 0.8)


@case
def operation_in_geometry_nodes() -> Iterator[None]:
    used = geometry_group()
    added = used.nodes.new("ShaderNodeMath")
    added.inputs[0].default_value, added.inputs[1].default_value = 0.9, 0.4
    used.links.new(added.outputs[0], used.nodes["Combine XYZ"].inputs["Z"])
    modifier(grid(), "NODES", node_group=used)
    yield
    added.operation = "SUBTRACT"


@case
def body_of_a_text() -> Iterator[None]:
    item = link(bpy.data.objects.new("Text", bpy.data.curves.new("Text", "FONT")))
    item.data.body, item.data.size = "Radar", 3.0
    item.location, item.rotation_euler = (-3, 8, 0), (math.radians(90), 0, 0)
    item.data.materials.append(ph.rough_metal())
    yield
    item.data.body = "WWWW"


def bent_curve() -> Any:
    bpy.ops.curve.primitive_bezier_circle_add(radius=1.5, location=(0, 8, 0))
    item = bpy.context.object
    item.rotation_euler = (math.radians(90), 0, 0)
    item.data.bevel_depth = 0.4
    item.data.materials.append(ph.rough_metal())
    return item


simple("bevel_of_a_curve", bent_curve, to("data.bevel_depth", 0.7))


@case
def point_of_a_curve() -> Iterator[None]:
    item = bent_curve()
    yield
    item.data.splines[0].bezier_points[0].co[0] -= 1.0


def metaball() -> Any:
    bpy.ops.object.metaball_add(type="BALL", radius=2.0, location=(0, 8, 0))
    item = bpy.context.object
    item.data.render_resolution = item.data.resolution = 0.5
    item.data.materials.append(ph.rough_metal())
    return item


simple("radius_of_a_metaball", metaball, to("data.elements.0.radius", 3.0))


def hair(**values: Any) -> Any:
    carrier, item = grid(), ball()
    item.scale = (0.2, 0.2, 0.2)
    item.location = (0, 9, -30)
    carrier.modifiers.new("Particles", "PARTICLE_SYSTEM")
    made = carrier.particle_systems[0]
    part = made.settings
    part.type, part.count, part.hair_length = "HAIR", 8, 1.0
    part.render_type, part.instance_object, part.particle_size = "OBJECT", item, 0.5
    for name, value in values.items():
        setattr(part, name, value)
    return made


simple("size_of_particles", hair, to("settings.particle_size", 0.8))


simple("seed_of_particles", hair, to("seed", 5))


# -- places and motion -----------------------------------------------------------------------------


simple("scale_of_an_object", grid, to("scale", (0.4, 0.9, 1)))


@case
def matrix_of_an_object() -> Iterator[None]:
    item = grid()
    yield
    matrix = item.matrix_world.copy()
    matrix[1][3] = 9.0
    item.matrix_world = matrix


@case
def place_of_a_parent() -> Iterator[None]:
    item, place = grid(), empty()
    item.parent = place
    yield
    place.location.y = 2.0


@case
def influence_of_a_constraint() -> Iterator[None]:
    item, place = grid(), empty((0, 12, 0))
    made = item.constraints.new("COPY_LOCATION")
    made.target = place
    made.influence = 0.2
    yield
    made.influence = 0.7


@case
def target_of_a_constraint() -> Iterator[None]:
    item, place = grid(), empty((0, 9, 0))
    item.constraints.new("COPY_LOCATION").target = place
    yield
    place.location.y = 11.0


@case
def expression_of_a_driver() -> Iterator[None]:
    item = grid()
    driven = item.driver_add("location", 1)
    driven.driver.expression = "8.0"
    yield
    driven.driver.expression = "frame + 8.0"


@case
def property_read_by_a_driver() -> Iterator[None]:
    item = grid()
    item["depth"] = 8.0
    driver = item.driver_add("location", 1).driver
    variable = driver.variables.new()
    variable.name = "depth"
    variable.targets[0].id, variable.targets[0].data_path = item, '["depth"]'
    driver.expression = "depth"
    yield
    item["depth"] = 9.0


@case
def value_of_a_key() -> Iterator[None]:
    item = keyed(grid())
    yield
    curve_of(item).keyframe_points[1].co[1] = 20.0


simple(
    "interpolation_of_a_key", lambda: keyed(grid()), lambda item: mh.interpolation(item, "LINEAR")
)


@case
def modifier_of_a_curve() -> Iterator[None]:
    item = keyed(grid())
    made = curve_of(item).modifiers.new("NOISE")
    made.strength, made.scale = 0.5, 50.0  # slow: a fast one takes 20 s to fit
    yield
    made.strength = 2.0


@case
def muted_curve() -> Iterator[None]:
    item = keyed(grid())
    item.location.y = 11.0
    yield
    curve_of(item).mute = True
    item.location.y = 9.0


@case
def another_action() -> Iterator[None]:
    item, other = keyed(grid()), grid()
    mh.key(other, "location", (1, (0, 9, 0)), (11, (0, 5, 0)))
    other.hide_render = True
    yield
    item.animation_data.action = other.animation_data.action
    item.animation_data.action_slot = other.animation_data.action_slot


@case
def strip_of_the_nla() -> Iterator[None]:
    item = keyed(grid())
    data = item.animation_data
    action, slot = data.action, data.action_slot
    strip = data.nla_tracks.new().strips.new("Move", 1, action)
    strip.action_slot = slot
    data.action = None
    yield
    strip.scale = 0.5


simple("frame_rate", lambda: keyed(grid()), lambda _: to("render.fps", 60)(bpy.context.scene))


simple(
    "remapped_time",
    lambda: keyed(grid()),
    lambda _: to("render.frame_map_new", 50)(bpy.context.scene),
)


@case
def contents_of_an_instance() -> Iterator[None]:
    item = grid()
    rs.instance_of(item)
    yield
    item.location.y = 9.0


@case
def instances_on_faces() -> Iterator[None]:
    carrier, item = grid(), ball()
    item.scale = (0.2, 0.2, 0.2)
    item.parent, item.location = carrier, (0, 0, 0)
    carrier.instance_type = "VERTS"
    yield
    carrier.instance_type = "FACES"


# -- antennas, scene -------------------------------------------------------------------------------


def of_part(kind: str, name: str, value: Any, item: bool = False, **given: Any) -> None:
    def build() -> Any:
        ball()
        part = radar_part(kind)
        owner = part if item else part.data
        for key, first in given.items():
            setattr(owner, key, first)
        return owner

    simple(f"{kind.lower()}_{name}", build, to(name, value))


of_part("LIGHT", "energy", 5e5)
of_part("LIGHT", "exposure", 1.0)
of_part("LIGHT", "location", (0.5, 0, 0.5), item=True)
of_part("CAMERA", "lens", 20.0)
of_part("CAMERA", "type", "ORTHO", ortho_scale=6.0)
of_part("CAMERA", "ortho_scale", 4.0, type="ORTHO", ortho_scale=6.0)
of_part("CAMERA", "rotation_euler", (0.05, 0, 0), item=True)
of_part("CAMERA", "latitude_max", 0.5, type="PANO", panorama_type="EQUIRECTANGULAR")
of_part("CAMERA", "longitude_min", -0.5, type="PANO", panorama_type="EQUIRECTANGULAR")


simple("unit_scale", ball, lambda _: to("unit_settings.scale_length", 0.5)(bpy.context.scene))


@case
def simplified_subdivision() -> Iterator[None]:
    modifier(ball(), "SUBSURF", levels=0, render_levels=2)
    yield
    bpy.context.scene.render.use_simplify = True
    bpy.context.scene.render.simplify_subdivision_render = 0


simple("added_object", lambda: plate(12.0, 20.0), lambda _: grid())


@case
def removed_object() -> Iterator[None]:
    plate(12.0, 20.0)
    item = grid()
    yield
    bpy.data.objects.remove(item)


simple("renamed_object", grid, to("name", "Other"))
